//! The control half of a robot on the simulated machine, in the process and without a bus: fast enough for hours.
//!
//! - [`Trial`]: a robot, its simulated drives, motors, wheels, floor and body, one cycle after the other.
//! - [`stops`]: whether everything stops in time, whatever is lost when.
//! - [`approaches`]: seeded worlds with fences and obstacles, on a kinematic body.
//! - [`Run`]: what tracking a reference came to, as believed and as it truly was.
//! - [`replans`]: motions that are replaced while they are under way, on the same.
//! - [`grip`]: treads that give way and slippery floors; [`slip`]: when a slip is noticed.
//! - [`sensed`]: such robots with sensors: how far they truly are from where they should be
//! - [`builds`]: robots built with the tolerances of their file, and whether their covariance says how wrong they are.
//! - [`calibration`]: such robots calibrated by what they drive, and driven again.
//! - [`seeded`]: robots of every kind on every floor, by the thousand, and what must happen to none of them.
//! - [`braking`]: the same robots are stopped under way, pushed, on slopes, with other loads: whether their ramps are followed.
//! - [`mujoco`]: the same robots on mechanics that aren't ours.
//! - [`wiring`]: robots that are not as their file says, and whether they are named.
//! - [`laws`]: the control laws, and those that an example is asked for.
//! - [`rows`]: tables whose rows are driven on all cores.
//! - [`framed`]: the same robots through bring-up and frames, as `omnibase run` runs them.
//!
//! The time of everything is as it is on the bus: a cycle reads what the drives measured one period before, and what
//! it computes reaches them one period later.
#![forbid(unsafe_code)]

pub mod approaches;
pub mod braking;
pub mod builds;
pub mod calibration;
mod core_time;
pub mod fast;
pub mod framed;
pub mod grip;
pub mod laws;
pub mod learning;
pub mod mujoco;
pub mod replans;
pub mod robots;
pub mod rows;
mod run;
pub mod seeded;
pub mod sensed;
mod servo_box;
pub mod slip;
pub mod stops;
mod trial;
pub mod wiring;

pub use core_time::core_s;
pub use run::Run;
pub use trial::{Trial, Without, plan_of};
