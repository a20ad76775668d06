//! What a platform is really like, found from what its wheels turned and where it really was.
//!
//! - [`dataset`]: [`Dataset`], runs of wheels, and beside them a gyro's turns, poses of a sensor, places on the floor.
//! - [`build`]: [`Build`], a platform's wheels, creep and sensors, and [`Tolerances`], how well they are known beforehand.
//! - [`unknown`]: [`Unknown`], what is solved for, one by one.
//! - [`mod@solve`]: [`solve()`], all of it by least squares, with standard deviations.
//! - [`observed`]: which combinations of unknowns the runs couldn't show, in words.
//! - [`figures`]: paths that show the most, and what each is expected to show; [`rehearsal`]: sensors that are made up.
//! - [`drift`]: how far dead reckoning runs from the truth, before and after; [`errors`]: what is still wrong, where that is known.
//!
//! # What can't be seen
//! A wheel shows `R·ω = b·ξ` with `b = (aₓ, a_y, x·a_y − y·aₓ)/(a·u)`: of its place only the lever arm of its
//! force. Where it stands along its force, no motion shows.
//!
//! Nor does any motion show where the base frame is within the body: wheels and sensor moved and turned
//! together are the same robot, so that these three numbers stay as the tolerances say. Loops that end where
//! they began don't show how long a metre is.
//!
//! Four and more wheels show nine numbers, as three wheels do; what they contradict each other by shows where
//! their hubs go at different speeds, and faintly.
//!
//! Units are SI, frames are those of [`omnibase_platform`]. No files, no clocks: instants are numbers of the caller.
#![forbid(unsafe_code)]

pub mod build;
mod chain;
pub mod creep;
pub mod dataset;
pub mod drift;
pub mod errors;
pub mod figures;
pub mod observed;
pub mod rehearsal;
pub mod solve;
pub mod unknown;
mod way;

pub use build::{Build, SensorMount, Tolerances};
pub use dataset::{Dataset, DatasetError, PlaceSample, PoseSample, Run, Step, TurnSample};
pub use drift::Drift;
pub use errors::WheelErrors;
pub use solve::{Found, MOST_DOUBTED, Solution, SolveError, WORST_CHI_SQUARE, solve};
pub use unknown::Unknown;
