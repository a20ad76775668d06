//! A run of a robot: from its file to its figures.
//!
//! In the order in which a run goes:
//!
//! - [`robot_text`]: the robot's file with what the command line changes in it, as a plan; kept whole for replay.
//! - [`simulated`]: the simulated robot of a plan.
//! - [`session`]: the bus from PRE-OP to OP and back, one exchange a cycle, at the pace of clocks.
//! - [`supervision`]: who is missing, who comes back, and what the bus counts, in the spare time of cycles.
//! - [`drive_errors`]: which error each drive has.
//! - [`conductor`]: what is asked of the robot when: enable, track, hold, stop.
//! - [`mod@run`]: the run itself, the same in virtual and in real time: only link and clock differ.
//! - [`tracking`], [`truth`], [`summary`], [`events`]: how well it went, and what happened.
//! - [`timing`], [`quantiles`]: how long cycles took, and what happened in the worst ones.
//! - [`live`]: the same run under the hands of people and programs.
//! - [`teach`]: from where a robot was driven to a path that it repeats.
//! - [`channels`]: a cycle as a row of a recording; [`mod@replay`]: a recording computed again, to the same bits.
#![forbid(unsafe_code)]

pub mod channels;
pub mod conductor;
pub mod describe;
pub mod drive_errors;
pub mod events;
pub mod live;
pub mod quantiles;
pub mod replay;
pub mod robot_text;
pub mod run;
pub mod session;
pub mod simulated;
pub mod summary;
pub mod supervision;
pub mod teach;
pub mod timing;
pub mod tracking;
pub mod truth;

pub use replay::{Replayed, replay};
pub use robot_text::{LoadedRobot, RobotText};
pub use run::{Progress, Ran, RunError, Setup, run};
pub use summary::Summary;
