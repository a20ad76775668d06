//! The simulated robot: a rigid body on omni or mecanum wheels, driven by motors with limits.
//!
//! Written apart from the controllers' own model, so that a mistake there doesn't cancel out here: nothing in this
//! crate knows `platform`, an estimator or a controller. In the order in which a reader needs them:
//!
//! - [`floor`]: friction between tread and floor, with the sources of the default figures
//! - [`tread`]: how a tread gives way before it slides
//! - [`wheel`]: a wheel's geometry and inertia, and what the simulation tells about it
//! - [`body`]: the rigid body with its payload, advanced step by step; [`load`] shares the weight among the wheels
//!   and [`contact`] solves one step with stick and slip
//! - [`motor`]: torque limit, heating, voltage and current loop of a motor
//! - [`machine`]: body and motors, moved on to any instant in steps on a fixed grid, and the truth at the last one
//! - [`mechanics`]: body, wheels and floor of another program in place of these
//! - [`sensor`]: gyros, mice and trackers with their vices
//! - [`slide`]: an axis beside the wheels, with limit switches and ends
//! - [`robot`]: simulated drives on the motors: a segment that any MainDevice can run, and the truth behind it
//!
//! The planar model leaves out the roll and pitch motion (only its load transfer is there), the spin inertia of the
//! rollers, and the way the contact point wanders from roller to roller.
//!
//! Same input, same bits: no clock, no chance but that of a seed, and nothing is allocated after construction.
#![forbid(unsafe_code)]

pub mod body;
pub mod contact;
pub mod floor;
pub mod load;
pub mod machine;
pub mod mechanics;
pub mod motor;
pub mod pose;
pub mod robot;
pub mod sensor;
pub mod slide;
pub mod tread;
pub mod wheel;
pub mod wiring;

pub use body::{Body, BodyError, BodyParameters, Payload};
pub use floor::{Contact, Floor, Patch, Region, Slope, Surface};
pub use machine::{Machine, MachineError, MachineParameters, Truth, WheelDrive};
pub use mechanics::{Mechanics, Motion};
pub use motor::{Motor, MotorParameters, Waves};
pub use pose::{Pose, Twist, Wrench};
pub use robot::{DriveStation, RobotSim, RobotSimDescription, RobotSimError, SharedMachine};
pub use sensor::{SensorMessage, SensorParameters, SimulatedSensor, Tells};
pub use slide::{SharedSlide, SlideParameters};
pub use tread::Tread;
pub use wheel::{Grip, WheelParameters, WheelState};
pub use wiring::Wire;
