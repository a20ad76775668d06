//! Operating a robot: from its file over its bus (`omnibase-session`) to its figures (`omnibase-measure`).
//!
//! In the order in which a run goes:
//!
//! - [`robot_text`]: the robot's file with what the command line changes in it, as a plan; kept whole for replay.
//! - [`small_file`]: files whose size has an end.
//! - [`simulated`]: the simulated robot of a plan.
//! - [`drive_errors`]: which error each drive has.
//! - [`conductor`]: what is asked of the robot when: enable, track, hold, stop.
//! - [`mod@run`]: the run itself, the same in virtual and in real time: only link and clock differ.
//! - [`stepped`]: a simulated robot cycle by cycle, for programs that ask for each; [`pace`]: virtual time as fast as the host's.
//! - [`live`]: the same run under the hands of people and programs.
//! - [`mechanics`]: what it weighs and where its wheels are, for other programs.
//! - [`room`]: the room of a robot's file, and ways through it.
//! - [`view`]: what viewers draw of it; [`codes`]: what they call the codes of its signals.
//! - [`teach`]: from where a robot was driven to a path that it repeats.
//! - [`learn`]: from repeats of a motion to a correction of it.
//! - [`channels`]: a cycle as a row of a recording; [`mod@replay`]: a recording computed again, to the same bits;
//!   [`dataset`]: a recording as the calibration reads it.
#![forbid(unsafe_code)]

pub mod channels;
pub mod codes;
pub mod conductor;
pub mod dataset;
pub mod describe;
pub mod drive_errors;
pub mod floor_memory;
pub mod learn;
pub mod live;
pub mod mechanics;
pub mod pace;
pub mod replay;
pub mod robot_text;
pub mod room;
pub mod run;
pub mod simulated;
pub mod small_file;
pub mod stepped;
pub mod teach;
pub mod view;

pub use replay::{ReplayFileError, Replayed, ReplayedFile, replay, replay_from};
pub use robot_text::{LoadedRobot, RobotText};
pub use run::{Progress, Ran, RunError, Setup, run};
