//! Ways through known rooms: maps, distances, the robot's footprint in them, and the shortest way.
//!
//! - [`map`]: [`Map`], which cells of a floor are occupied: maps of ROS (YAML with PGM or PNG), polygons, circles.
//! - [`distance`]: from every cell to the nearest occupied one, exactly, in linear time.
//! - [`footprint`]: [`Footprint`], the robot's outline, and what of the floor it covers at a pose.
//! - [`space`]: [`Space`], a map in which footprints are looked for: whether a pose, or a motion, touches anything.
//! - [`gaps`]: places between cells' centres, where a gap hardly takes a disc.
//! - [`search`]: the shortest way of a disc at any angle; [`ridge`]: one that keeps to the middle, as a choice.
//! - [`sweep`]: [`Sweep`], whether a whole motion touches anything.
//! - `along`: whether a footprint gets along the way of the disc that every heading covers; [`turning`]: its way where it doesn't.
//! - [`smooth`]: a way without kinks where there is room.
//! - [`until`]: a search that whoever waits for it can end.
//! - [`mod@plan`]: [`plan()`] joins them.
//!
//! Poses are in the map's frame, lengths in m, angles in rad. Planning allocates; nothing here knows a clock.
#![forbid(unsafe_code)]

mod ahead;
mod along;
pub mod distance;
pub mod footprint;
pub mod gaps;
pub mod map;
pub mod plan;
pub mod ridge;
pub mod search;
pub mod smooth;
pub mod space;
pub mod sweep;
mod tiles;
pub mod turning;
pub mod until;

pub use footprint::{Footprint, FootprintError};
pub use map::{Map, MapError};
pub use plan::{Cost, Plan, PlanError, Task, plan};
pub use space::Space;
pub use sweep::Sweep;
pub use until::Until;

/// A place on the floor: x and y, m.
pub type Point = [f64; 2];
