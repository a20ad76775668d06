//! Where a platform is, from everything that tells of it: an error-state filter on SE(2).
//!
//! Wheels carry the pose on; gyros, flow sensors, twists and poses say by how much that is wrong. Nothing in this crate
//! knows a bus, a robot's file or a clock. In the order in which a reader needs them:
//!
//! - [`sensor`]: what a sensor says, where it is mounted and how well it knows
//! - [`belief`]: the pose, what is wrong with wheels and sensors, and their covariance: carried on and corrected
//! - [`standing`]: which sensor is believed, and why not
//! - [`epoch`]: what was heard in a few milliseconds, and how a belief passes through it
//! - [`filter`]: epochs in a ring; what comes late goes where it belongs, and what follows is computed again
//!
//! Same input, same bits: no clock, no randomness, and nothing is allocated after construction.
#![forbid(unsafe_code)]

pub mod belief;
pub mod epoch;
pub mod filter;
pub mod sensor;
pub mod standing;

pub use epoch::gate;
pub use filter::{Estimate, Filter, FilterSettings, Motion};
pub use sensor::{MAX_RATES, MAX_SENSORS, Reading, Sensor, SensorKind};
pub use standing::{Standing, Verdict};
