//! The table of the simulated robot: its body, its floor, and what happens to it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::sensor_tables::SimulatedSensorTable;

/// Sliding friction of a patch or an event over its static friction, where only that is given.
pub const SLIDING_SHARE: f64 = 0.9;

/// The simulated body; what is missing takes the simulator's documented default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SimulationTable {
    /// What the robot's sensors say in the simulation, with their vices.
    pub sensor: Vec<SimulatedSensorTable>,
    /// Mass of the platform without payload, kg.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub mass_kg: Option<f64>,
    /// Moment of inertia about the vertical axis through its centre, without payload, kg·m².
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub inertia_kg_m2: Option<f64>,
    /// Centre of mass without payload, x and y in base_link, m.
    pub centre_of_mass_m: Option<[f64; 2]>,
    /// Height of that centre of mass over the floor, m.
    #[schemars(range(min = 0.0))]
    pub centre_of_mass_height_m: Option<f64>,
    /// Payload, kg.
    #[schemars(range(min = 0.0))]
    pub payload_kg: Option<f64>,
    /// Moment of inertia of the payload about the vertical axis through its own centre of mass, kg·m².
    #[schemars(range(min = 0.0))]
    pub payload_inertia_kg_m2: Option<f64>,
    /// Where the payload stands, x and y in base_link, m.
    pub payload_position_m: Option<[f64; 2]>,
    /// Height of the payload's centre of mass over the floor, m.
    #[schemars(range(min = 0.0))]
    pub payload_height_m: Option<f64>,
    /// Moment of inertia of one wheel, kg·m².
    #[schemars(range(min = 0.0))]
    pub wheel_inertia_kg_m2: Option<f64>,
    /// Greatest force along the force direction of a wheel while it sticks, over its load: longitudinal slip.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// That force while it slides, over the load.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sliding_friction: Option<f64>,
    /// Force against the rollers, across the force direction, over the load: transverse slip.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub roller_resistance: Option<f64>,
    /// Moment against a wheel's rolling, over load times radius.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub rolling_resistance: Option<f64>,
    /// Slip ratio over the ratio of force to load, well below sliding.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub creep: Option<f64>,
    /// Stiffness of a tread along the floor, at each wheel, 1e5 to 4e6 N/m; default: rigid.
    #[schemars(range(min = 1000.0, max = 1e9))]
    pub tread_stiffness_n_m: Option<f64>,
    /// Damping of such a tread over that which is critical for a wheel's (and rotor's) moment of inertia on it, 0.1 to 1;
    /// default: 0.1.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tread_damping_ratio: Option<f64>,
    /// Greatest torque of a motor, N·m; default: the drive's peak torque.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub motor_torque_limit_nm: Option<f64>,
    /// Moment of inertia of a motor's rotor, kg·m².
    #[schemars(range(min = 0.0))]
    pub rotor_inertia_kg_m2: Option<f64>,
    /// Motor speed above which the voltage no longer allows the peak torque, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub motor_rated_speed_rad_s: Option<f64>,
    /// Motor speed at which the voltage allows no torque, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub motor_greatest_speed_rad_s: Option<f64>,
    /// Time constant of a motor's heating at its rated torque, s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub heating_time_constant_s: Option<f64>,
    /// What the motors give over what their currents promise, in the order of the wheels, 0 to 2: below 1 they are weaker than
    /// the file says; default: 1.
    #[schemars(inner(range(min = 0.0, max = 2.0)))]
    pub torque_ratio: Option<Vec<f64>>,
    /// By how much each drive's clock runs fast, in the order of the wheels, ppm; default: up to 20, none like the next.
    #[schemars(inner(range(min = -200.0, max = 200.0)))]
    pub clock_drift_ppm: Option<Vec<f64>>,
    /// Drives whose wheels turn the wrong way: motor and encoder are both wired the other way round.
    pub turned_drives: Option<Vec<String>>,
    /// Drives whose encoders alone count the wrong way: against their motors.
    pub turned_encoders: Option<Vec<String>>,
    /// Two drives, each of which has the motor and the encoder of the other's wheel.
    #[schemars(length(equal = 2))]
    pub swapped_drives: Option<Vec<String>>,
    /// Amplitude of a motor's cogging torque, 0.5 to 5 % of the rated one, N·m; default: none.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub cogging_nm: Option<f64>,
    /// How often it comes in a turn of the motor, the least common multiple of slots and poles; default: 72.
    #[schemars(range(min = 1, max = 10_000))]
    pub cogging_per_turn: Option<u32>,
    /// Amplitude of a motor's torque ripple over its torque, 0.01 to 0.05; default: none.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub torque_ripple: Option<f64>,
    /// How often it comes in a turn of the motor, six times its pole pairs; default: 48.
    #[schemars(range(min = 1, max = 10_000))]
    pub torque_ripple_per_turn: Option<u32>,
    /// Slope of the floor, rad; default: level.
    #[schemars(range(min = 0.0, max = 1.4))]
    pub slope_rad: Option<f64>,
    /// Which way it goes down, from x in odom, rad; default: 0.
    pub slope_direction_rad: Option<f64>,
    /// Places on the floor with a friction of their own; the first one that holds a wheel counts.
    pub patch: Vec<PatchTable>,
    /// What happens to the robot, by time.
    pub event: Vec<EventTable>,
    /// A file of more `[[event]]`.
    pub events_file: Option<String>,
    /// Step of the integration, us.
    #[schemars(range(min = 1, max = 2_000))]
    pub step_us: Option<u32>,
}

/// A place on the simulated floor with a friction of its own: a rectangle or a disc, in odom as it is at the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct PatchTable {
    /// A rectangle along the axes: x_min, y_min, x_max, y_max, m; this or `centre_m` and `radius_m`.
    pub rectangle_m: Option<[f64; 4]>,
    /// Middle of a disc, x and y, m.
    pub centre_m: Option<[f64; 2]>,
    /// Its radius, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub radius_m: Option<f64>,
    /// As `simulation.static_friction`; 0 is a gap, over which a wheel finds no hold.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// As `simulation.sliding_friction`; default: nine tenths of the static one.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sliding_friction: Option<f64>,
}

/// A file of events.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EventsFile {
    /// What happens to the simulated robot, by time.
    pub event: Vec<EventTable>,
}

/// Something that happens to the simulated robot.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EventTable {
    /// When, s after the run's first cycle, as its events and recordings count.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub at_s: Option<f64>,
    /// What happens; it says which of the keys below are read.
    pub kind: Option<String>,
    /// For how long, s; default: from then on.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 1e6))]
    pub duration_s: Option<f64>,
    /// Force on the centre of mass, x and y, N.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub force_n: Option<[f64; 2]>,
    /// Moment about the vertical, N·m.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub moment_nm: Option<f64>,
    /// The axes of the force; default: `odom`.
    pub frame: Option<PushFrame>,
    /// Mass of the payload, kg; 0 is none.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub mass_kg: Option<f64>,
    /// Its moment of inertia about the vertical through its own centre of mass, kg·m²; default: a disc out to the wheels.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub inertia_kg_m2: Option<f64>,
    /// Where it stands, x and y in base_link, m; default: in the middle.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub position_m: Option<[f64; 2]>,
    /// Height of its centre of mass over the floor, m; default: `simulation.payload_height_m`, without it 0.6.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub height_m: Option<f64>,
    /// As `simulation.static_friction`, of the whole floor.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub static_friction: Option<f64>,
    /// As `simulation.sliding_friction`; default: nine tenths of the static one.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sliding_friction: Option<f64>,
    /// A drive by its name.
    pub drive: Option<String>,
    /// What its motor gives over what its current promises.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub torque_ratio: Option<f64>,
    /// Error code (0x603F).
    #[schemars(range(min = 1, max = 65_535))]
    pub error_code: Option<u32>,
}

/// The axes in which a push acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PushFrame {
    /// Those of odom as it is at the start.
    Odom,
    /// The platform's own: the push turns with it.
    Platform,
}
