//! A robot set up step by step: from drives on a bus to a robot's file.
//!
//! - [`Guide`]: the steps, one after the other; it asks a [`Hand`], notes all in a [`Record`], can be left and taken up again.
//! - [`Hand`]: whoever is asked and holds the key: a person at a terminal, a program, a test.
//! - [`DeadMan`]: how long a held key counts, in cycles. Without it nothing moves.
//! - [`jog`]: one drive turned slowly with little torque while the key is held, and why it stopped.
//! - [`robot_file`]: the file that comes of it.
//!
//! Nothing here reads a clock of its own: bus and clock come from outside, so that a simulated robot is set up in virtual
//! time as a real one is in real time.
#![forbid(unsafe_code)]

mod dead_man;
mod drive;
mod guide;
mod hand;
pub mod jog;
mod record;
pub mod robot_file;
mod turns;

pub use dead_man::DeadMan;
pub use drive::{DriveMap, MapProblem};
pub use guide::{
    BackUp, Calibrated, Ended, Guide, MOST_JOG_TORQUE_PER_MILLE, Open, Outside, SetupError, Wished,
};
pub use hand::{Answer, Hand, Key, Question};
pub use jog::{Jog, JogEnd, JogPlan, Still};
pub use record::{AliasWrite, FoundDevice, FoundDrive, Leg, PassedOver, Record, Step, Turned};
pub use turns::{COMMON_RESOLUTIONS, likely_resolution};
