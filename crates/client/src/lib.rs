//! A program's seat at a running robot: what it does in every cycle, what may be asked of it, and what it may be told.
//!
//! - [`robots`]: which robots run on this machine, and where they listen.
//! - [`Seat`]: commands with the instant at which they were meant; a program that falls silent is lost, and what it drove
//!   stops.
//! - [`States`]: signals of every cycle, or every so many, with their instants.
//! - [`Inputs`]: what a program knows, as a `[[source]]` of the robot's file.
//!
//! Nothing here starts a thread: a program that hangs is silent, and silence stops what it drives. The messages stand in the
//! robot's own description, `/api/openapi.json`.
//!
//! ```no_run
//! use omnibase_client::{Frame, Seat, robots};
//! use std::time::{Duration, Instant};
//!
//! let robot = robots::latest()?;
//! let mut seat = Seat::take(&robot)?;
//! for _ in 0..50 {
//!     seat.drive([0.2, 0.0, 0.1], Frame::Body, Instant::now())?;
//!     while seat.hear(Duration::from_millis(20))?.is_some() {}
//! }
//! seat.let_go()?;
//! # Ok::<(), omnibase_client::Error>(())
//! ```
#![forbid(unsafe_code)]

mod clock;
mod connection;
mod facts;
mod inputs;
pub mod robots;
mod seat;
mod states;

pub use inputs::Inputs;
pub use robots::Found;
pub use seat::{Answer, Frame, Heard, Seat};
pub use states::{Row, States, Wanted};

use std::path::PathBuf;

/// The first number of the API's version that this crate speaks.
pub const VERSION: u64 = 1;

/// Why a robot isn't reached, or no more.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// None runs here.
    #[error("no robot runs on this machine under this user")]
    NoRobot,
    /// None of those that run here takes connections.
    #[error("no robot answers at {0}")]
    NoAnswer(String),
    /// A file or folder by which robots are found.
    #[error("{path}: {error}")]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The folder in which robots are announced isn't this user's own.
    #[error(
        "{path}: expected a folder of this user alone (mode 0700, no link), found {found}: whoever can write there could pass \
         for a robot. Remove it, or set XDG_RUNTIME_DIR to a folder of your own"
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// What it is.
        found: String,
    },
    /// It refuses the connection.
    #[error("the robot refuses: {0}")]
    Refused(String),
    /// It speaks another version.
    #[error("the robot speaks version {found} of its API: expected {VERSION}")]
    Version {
        /// Which.
        found: String,
    },
    /// It says what can't be understood.
    #[error("the robot says what can't be understood: {0}")]
    Words(String),
    /// It ended the connection.
    #[error("the robot ended the connection: {0}")]
    Ended(String),
    /// Something else than this program stopped it.
    #[error("the robot was stopped while this program drove it ({0}): a person looks, and enables the stick")]
    Stopped(String),
    /// It says nothing any more.
    #[error("the robot is silent")]
    Silent,
}
