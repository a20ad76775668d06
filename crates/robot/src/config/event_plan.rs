//! What happens to the simulated robot, and when.

use super::simulation_tables::PushFrame;

/// Something that happens to the simulated robot, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct EventPlan {
    /// Time of the run, ns.
    pub at_ns: u64,
    /// What.
    pub happening: Happening,
}

/// What happens to a simulated robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Happening {
    /// It is pushed, until the next one; zeros end it.
    Push {
        /// x and y, N.
        force_n: [f64; 2],
        /// About the vertical, N·m.
        moment_nm: f64,
        /// The axes of the force.
        frame: PushFrame,
    },
    /// Another payload stands on it.
    Payload {
        /// Mass, kg.
        mass_kg: f64,
        /// Moment of inertia, kg·m²; `None`: a disc out to the wheels.
        inertia_kg_m2: Option<f64>,
        /// x and y in base_link, m.
        position_m: [f64; 2],
        /// Height, m; `None`: the simulation's own.
        height_m: Option<f64>,
    },
    /// The payload of the robot's file is back.
    PayloadOfFile,
    /// The whole floor has this friction.
    Floor {
        /// While sticking.
        static_friction: f64,
        /// While sliding.
        sliding_friction: f64,
    },
    /// The floor is again as the robot's file says.
    FloorOfFile,
    /// A motor gives so much over what its current promises.
    TorqueRatio {
        /// Of which wheel.
        wheel: usize,
        /// So much.
        ratio: f64,
    },
    /// A motor gives what the robot's file says.
    TorqueRatioOfFile {
        /// Of which wheel.
        wheel: usize,
    },
    /// A drive fails with an error code.
    DriveFault {
        /// Of which wheel.
        wheel: usize,
        /// The code (0x603F).
        error_code: u16,
    },
    /// A drive's safety input takes its torque away, or gives it back.
    SafeTorqueOff {
        /// Of which wheel.
        wheel: usize,
        /// Whether it takes it away.
        is_off: bool,
    },
    /// A drive loses its supply, or has it again.
    Supply {
        /// Of which wheel.
        wheel: usize,
        /// Whether it has it.
        is_on: bool,
    },
}
