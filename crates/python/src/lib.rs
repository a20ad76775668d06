//! omnibase for Python: the module `omnibase._omnibase`, which the package in `python/` hands on.
//!
//! - `simulation`: a simulated robot, cycle by cycle.
//! - `law`: the user's own control law in it.
//! - `side_by_side`: many of them, on all processors.
//! - `running`: a robot that runs in a process of its own.
//! - `geometry`: kinematics, odometry, trajectories.
//! - `recording`: what was recorded of a run.
//! - `robot_file`: what both are made of.
//! - `bus`: what is at a bus, objects, an exchange.
//! - `arrays`: numbers from and to numpy.
//!
//! Whatever takes time lets other threads of Python run meanwhile.
#![forbid(unsafe_code)]

mod arrays;
mod bus;
mod failure;
mod geometry;
mod law;
mod recording;
mod robot_file;
mod running;
mod side_by_side;
mod simulated;
mod simulation;

use pyo3::prelude::*;

#[pymodule]
mod _omnibase {
    use super::*;
    #[pymodule_export]
    use crate::bus::{exchange, scan, sdo_read, sdo_write};
    #[pymodule_export]
    use crate::failure::{Error, Refused};
    #[pymodule_export]
    use crate::geometry::{Kinematics, Odometry, trajectory};
    #[pymodule_export]
    use crate::law::Moment;
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::running::{Robot, Signals};
    #[pymodule_export]
    use crate::side_by_side::Simulations;
    #[pymodule_export]
    use crate::simulation::Simulation;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
