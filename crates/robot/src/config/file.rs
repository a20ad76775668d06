//! The robot's file as it is written: one struct per table, every key optional, its unit in its name.
//!
//! What is missing or impossible is found by [`RobotPlan::check`](super::RobotPlan::check), so that all problems
//! come at once. The bounds in the attributes stand in the JSON schema too and are checked when the file is read.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::custom::Parameters;
use super::device_tables::DeviceTable;
use super::drive_tables::DriveTable;
use super::grip_tables::GripTable;
use super::guard_tables::{AvoidanceTable, FenceTable, ObstacleTable};
use super::joystick::JoystickTable;
use super::map_tables::MapTable;
use super::reference_table::ReferenceTable;
use super::run_tables::{BridgeTable, RecordingTable, RunTable};
use super::sensor_tables::SensorTable;
use super::simulation_tables::SimulationTable;
use super::source_tables::SourceTable;
use crate::signals::StopCategory;

/// One robot: its bus, drives, platform, limits, and the stages of its cycle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RobotFile {
    /// The robot's name, for messages, recordings and reports.
    pub name: Option<String>,
    /// The bus and its cycle.
    pub bus: BusTable,
    /// What every drive has in common; a key in `[[drive]]` replaces the same key here.
    pub drive_defaults: DriveTable,
    /// The drives, wheel by wheel.
    pub drive: Vec<DriveTable>,
    /// The SubDevices that drive no wheel.
    pub device: Vec<DeviceTable>,
    /// Other programs that send inputs while the robot runs.
    pub source: Vec<SourceTable>,
    /// What tells of the platform's motion beside its wheels.
    pub sensor: Vec<SensorTable>,
    /// Wheels and where they stand.
    pub platform: PlatformTable,
    /// Limits of the platform and its wheels; without all of them the drives aren't enabled.
    pub limits: LimitsTable,
    /// How the pose is estimated.
    pub estimator: EstimatorTable,
    /// The control law.
    pub controller: ControllerTable,
    /// The motion that is wished.
    pub reference: ReferenceTable,
    /// Watchdogs and stops.
    pub safety: SafetyTable,
    /// What is known of the floor's friction.
    pub grip: GripTable,
    /// The joystick.
    pub joystick: JoystickTable,
    /// The fence that the whole footprint never crosses; default: none.
    pub fence: Option<FenceTable>,
    /// What the robot does about obstacles.
    pub avoidance: AvoidanceTable,
    /// Obstacles that are there from the start; others come while the robot runs.
    pub obstacle: Vec<ObstacleTable>,
    /// The room through which ways are planned; none is needed for anything else.
    pub map: Option<MapTable>,
    /// The simulated body in place of the real one.
    pub simulation: SimulationTable,
    /// How `omnibase run` brings the robot up.
    pub run: RunTable,
    /// What is recorded of each run.
    pub recording: RecordingTable,
    /// Programs that join the robot with other systems, by their names; they are started with the run.
    pub bridge: BTreeMap<String, BridgeTable>,
}

/// The bus and its cycle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BusTable {
    /// Period of the cycle, us.
    #[schemars(range(min = 50, max = 100_000))]
    pub cycle_us: Option<u32>,
    /// How long an answer is awaited, us; default: half the cycle.
    #[schemars(range(min = 1, max = 100_000))]
    pub receive_timeout_us: Option<u32>,
    /// How the drives are synchronised; default: `sync0`.
    pub synchronisation: Option<Synchronisation>,
    /// Shift of SYNC0 against multiples of the cycle, us; default: half the cycle.
    #[schemars(range(min = -100_000, max = 100_000))]
    pub sync0_shift_us: Option<i32>,
    /// Who sets the pace; default: `distributed_clock`.
    pub clock_source: Option<ClockSource>,
    /// Objects of the drives that may be written by SDO while these are enabled, as `"6083"` or `"60F6:0A"`; default:
    /// none. Others only while no drive is enabled, and those that the cycle owns never.
    pub sdo_write_while_enabled: Option<Vec<String>>,
}

/// How the drives are synchronised (0x1C32, 0x1C33).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Synchronisation {
    /// Each drive by its own clock.
    FreeRun,
    /// By the arrival of process data.
    SyncManagerEvent,
    /// By SYNC0 of the distributed clocks.
    Sync0,
}

/// Who sets the pace of the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockSource {
    /// The cycle follows the distributed clock's time.
    DistributedClock,
    /// The distributed clock follows the host's time.
    Host,
}

/// Wheels and where they stand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct PlatformTable {
    /// Which layout; it says which of the keys below are read.
    pub layout: Option<String>,
    /// Radius of all wheels, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub wheel_radius_m: Option<f64>,
    /// Distance of wheel 1 from the centre, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub p1_m: Option<f64>,
    /// Distance of wheels 2 and 3 from the centre, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub p_m: Option<f64>,
    /// Distance of the wheels from the centre, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub centre_distance_m: Option<f64>,
    /// Angle of the first wheel from x forward, rad; default: 0.
    pub first_wheel_angle_rad: Option<f64>,
    /// Half the distance between front and rear axles, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub half_length_m: Option<f64>,
    /// Half the distance between left and right wheels, m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub half_width_m: Option<f64>,
    /// The wheels one by one, in the order of the drives.
    pub wheel: Vec<WheelTable>,
    /// What it weighs without a load, kg, as a scale shows it within a twentieth: wheels that push less than that takes slide;
    /// default: what is learnt alone.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub mass_kg: Option<f64>,
    /// Corners of the footprint, x and y in base_link, m; its convex hull counts; default: the wheels and their radius.
    pub footprint_m: Option<Vec<[f64; 2]>>,
    /// The layout's own keys.
    pub custom: Parameters,
}

/// One wheel of a general list.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct WheelTable {
    /// Where it touches the floor, x and y in base_link, m.
    pub position_m: Option<[f64; 2]>,
    /// Direction in which it rolls when the motor turns positive, rad from x forward.
    pub rolling_angle_rad: Option<f64>,
    /// Direction along which it transmits force, rad from x forward; default: the rolling direction (omni wheel).
    pub force_angle_rad: Option<f64>,
    /// Its radius, m; default: `wheel_radius_m`.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub radius_m: Option<f64>,
}

/// Limits of the platform and its wheels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct LimitsTable {
    /// Greatest speed, m/s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_m_s: Option<f64>,
    /// Greatest acceleration, m/s².
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub acceleration_m_s2: Option<f64>,
    /// Greatest jerk, m/s³.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub jerk_m_s3: Option<f64>,
    /// Greatest turning speed, rad/s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub turn_speed_rad_s: Option<f64>,
    /// Greatest turning acceleration, rad/s².
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub turn_acceleration_rad_s2: Option<f64>,
    /// Greatest turning jerk, rad/s³.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub turn_jerk_rad_s3: Option<f64>,
    /// Greatest wheel speed, rad/s: commands are scaled to it, a measured speed 10 % above stops.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub wheel_speed_rad_s: Option<f64>,
    /// Greatest wheel torque, N·m: each drive is told it and holds its motor to it, whatever the control law; a torque
    /// measured above it stops (`safety.wheel_torque_stop`).
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub wheel_torque_nm: Option<f64>,
}

/// How the pose is estimated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct EstimatorTable {
    /// Which estimator; it says which of the keys below are read.
    pub kind: Option<String>,
    /// α of the filtered derivative c = exp(−αT), 1/s; default: 400.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_filter_1_s: Option<f64>,
    /// Creep of the treads that odometry makes up for: slip ratio over the ratio of force to load, 0.01 to 0.05 for
    /// polyurethane; default: none.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub creep: Option<f64>,
    /// Force against the turning of a wheel's rollers over its load, for that creep; default: 0.03.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub roller_resistance: Option<f64>,
    /// Standard deviation of each wheel's true rolling radius over the one that is given, for the covariance: tread, load
    /// and wear; default: 0.003.
    #[schemars(range(min = 1e-6, max = 0.1))]
    pub radius_share: Option<f64>,
    /// Standard deviation of the direction in which each wheel is mounted, rad, likewise; default: 0.005.
    #[schemars(range(min = 1e-6, max = 0.1))]
    pub wheel_direction_sigma_rad: Option<f64>,
    /// Standard deviation of each coordinate of the place where each wheel touches the floor, m, likewise; default: 0.002.
    #[schemars(range(min = 1e-6, max = 0.1))]
    pub wheel_position_sigma_m: Option<f64>,
    /// Standard deviation of each coordinate of the pose at start, or where it was set, m: how well the robot stands in the
    /// origin of odom; default: 0.0001.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub start_sigma_m: Option<f64>,
    /// Standard deviation of the heading there, rad; default: 0.0001.
    #[schemars(range(min = 1e-6, max = 3.2))]
    pub start_sigma_rad: Option<f64>,
    /// Standard deviation of each coordinate after a metre, m, growing with the root of the way; default: 0.001.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub way_sigma_m: Option<f64>,
    /// Standard deviation of the heading after a metre, rad, likewise; default: 0.001.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub way_sigma_rad: Option<f64>,
    /// Standard deviation of the heading after a radian, rad, likewise; default: 0.0012.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub turn_sigma_rad: Option<f64>,
    /// In which frame paths, ways and the fence lie; default: `map`.
    pub task_frame: Option<TaskFrame>,
    /// Where sensors tell poses: beyond this standard deviation of x or y the pose counts as unknown, m; default: 0.1.
    #[schemars(range(min = 1e-4, max = 10.0))]
    pub unknown_sigma_m: Option<f64>,
    /// Likewise of the heading, rad; default: 0.1.
    #[schemars(range(min = 1e-4, max = 3.2))]
    pub unknown_sigma_rad: Option<f64>,
    /// The estimator's own keys.
    pub custom: Parameters,
}

/// The frame that tasks lie in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TaskFrame {
    /// Where all that tells of the platform says it is: odom is drawn to it softly.
    #[default]
    Map,
    /// Where wheels alone say it is; what sensors say is told, and moves nothing.
    Odom,
}

/// The control law.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ControllerTable {
    /// Which control law; keys of others may stand here too, for a robot that is switched to them.
    pub kind: Option<String>,
    /// Other control laws, to which a running robot can be switched.
    pub others: Option<Vec<String>>,
    /// Kp of x, y and heading of a law of speed, 1/s; default: the law's own.
    #[schemars(inner(range(min = 0.0)))]
    pub kp_1_s: Option<[f64; 3]>,
    /// Kp of x, y and heading of the law of torque, 1/s; default: designed.
    #[schemars(inner(range(min = 0.1)))]
    pub torque_kp_1_s: Option<[f64; 3]>,
    /// K of x and y, N·s/m; default: designed.
    #[schemars(range(min = 0.0))]
    pub damping_n_s_m: Option<f64>,
    /// K of the heading, N·m·s/rad; default: designed.
    #[schemars(range(min = 0.0))]
    pub turn_damping_n_m_s_rad: Option<f64>,
    /// First estimate of the mass, kg.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub mass_kg: Option<f64>,
    /// Bounds of that estimate, kg.
    #[schemars(inner(range(min = 1e-6)))]
    pub mass_bounds_kg: Option<[f64; 2]>,
    /// First estimate of the moment of inertia, kg·m².
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub inertia_kg_m2: Option<f64>,
    /// Bounds of that estimate, kg·m².
    #[schemars(inner(range(min = 1e-6)))]
    pub inertia_bounds_kg_m2: Option<[f64; 2]>,
    /// Greatest estimate of a wheel's friction and of the force that no model tells, N.
    #[schemars(range(min = 0.0))]
    pub friction_max_n: Option<f64>,
    /// Low-pass on what the law of torque makes its force of, 1/s; default: designed.
    #[schemars(range(min = 1.0, max = 1e5))]
    pub torque_filter_1_s: Option<f64>,
    /// How fast a disturbance observer follows, 1/s; default: designed.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub observer_1_s: Option<f64>,
    /// Least and greatest stiffness of one wheel's tread along the floor, N/m: the gains are designed for all between;
    /// default: 1e5 to 4e6.
    #[schemars(inner(range(min = 1e4, max = 1e8)))]
    pub tread_stiffness_n_m: Option<[f64; 2]>,
    /// Least damping of such a tread over that which is critical for its wheel's moment of inertia; default: 0.1.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub tread_damping_ratio: Option<f64>,
    /// Moment of inertia of a wheel with its rotor, seen at the wheel (the rotor's times gear ratio squared), kg·m²; default: 2 kg
    /// or 1/35 of `mass_kg` at the wheel's radius, whichever is less.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub wheel_inertia_kg_m2: Option<f64>,
    /// Time constant with which a drive's torque follows its command, us; default: 500.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub torque_lag_us: Option<f64>,
    /// The controllers' own keys.
    pub custom: Parameters,
}

/// Watchdogs and stops.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SafetyTable {
    /// Lost exchanges in a row that are tolerated before the drives' quick stop; default: 3.
    #[schemars(range(min = 0, max = 1000))]
    pub lost_exchanges_tolerated: Option<u32>,
    /// What follows where a SubDevice takes no part in more exchanges in a row than that; default: `quick_stop`.
    pub on_lost_device: Option<LostDeviceName>,
    /// What the robot does by itself when the SubDevice is back; default: `stay`.
    pub after_lost_device: Option<ComebackName>,
    /// How long it is awaited where that isn't `stay`, ms; default: 30 000.
    #[schemars(range(min = 1, max = 86_400_000))]
    pub lost_device_wait_ms: Option<u32>,
    /// For how long all exchanges were complete and all wheels stood before the drives are enabled again by themselves,
    /// ms; default: 1000.
    #[schemars(range(min = 1000, max = 600_000))]
    pub steady_before_comeback_ms: Option<u32>,
    /// For how long `move_again_unattended` warns before anything moves, ms; default: 5000.
    #[schemars(range(min = 3000, max = 600_000))]
    pub move_again_warning_ms: Option<u32>,
    /// Time without process data after which the drives stop by themselves, us: their watchdog, in steps of 100;
    /// default: 100000.
    #[schemars(range(min = 100, max = 6_553_500))]
    pub drive_watchdog_us: Option<u32>,
    /// Age at which a velocity command no longer counts, ms; default: 200.
    #[schemars(range(min = 1, max = 10_000))]
    pub command_age_ms: Option<u32>,
    /// Longest time for enabling all drives, ms; default: 5000.
    #[schemars(range(min = 1, max = 600_000))]
    pub enabling_timeout_ms: Option<u32>,
    /// Longest time for a ramp to a stop, ms; then the drives' quick stop; default: 5000.
    #[schemars(range(min = 1, max = 600_000))]
    pub stop_timeout_ms: Option<u32>,
    /// Distance between wished and estimated pose that stops, m; default: 0.5.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub tracking_error_m: Option<f64>,
    /// How far from the start of a path that is laid in odom the platform may stand, m; default: 0.05.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub start_distance_m: Option<f64>,
    /// How far from its heading there, rad; default: 0.1.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub start_heading_rad: Option<f64>,
    /// What a measured wheel speed above its limit leads to; default: `category_1`.
    pub wheel_speed_stop: Option<StopName>,
    /// What a wished speed above its limit leads to; default: `category_1`.
    pub reference_speed_stop: Option<StopName>,
    /// What a way that leads out of the fence, and can't be looked ahead on, leads to; default: `category_2`.
    pub fence_stop: Option<StopName>,
    /// What a lasting loss of the tracked path leads to; default: `category_1`.
    pub tracking_error_stop: Option<StopName>,
    /// What a measured wheel torque above its limit leads to; default: `category_1`.
    pub wheel_torque_stop: Option<StopName>,
    /// How far a measured torque may lie above its limit, N·m at the wheel; default: the greater of a tenth of the limit
    /// and a twentieth of the motor's rated torque.
    #[schemars(range(min = 0.0))]
    pub wheel_torque_margin_nm: Option<f64>,
    /// For how long a measured torque may lie further above than that, ms; time below counts back; default: 50.
    #[schemars(range(min = 1, max = 10_000))]
    pub wheel_torque_time_ms: Option<u32>,
    /// A measured wheel torque that swings to and fro by this part of its limit, five times in a row and faster
    /// than 20 Hz, leads to
    /// the drives' quick stop: the control loop rings; default: 0.15. 1: never.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub oscillation_share: Option<f64>,
    /// How far a wheel may slip within some two seconds, m, as its torque against the platform's acceleration tells; default: 0.01.
    #[schemars(range(min = 0.001, max = 1e6))]
    pub slip_m: Option<f64>,
    /// What a wheel that slips further leads to; default: `category_1`.
    pub slip_stop: Option<StopName>,
    /// An input, as `"imu.turn"`, that tells how fast the platform turns about the vertical, rad/s, to the left: slip is seen by it
    /// too; default: none.
    pub gyro_input: Option<String>,
    /// An input, as `"buttons.3"`, that must be there and not 0: without it nothing is enabled, and what is enabled
    /// stops; default: none.
    pub enable_input: Option<String>,
    /// An input, as `"buttons.4"`, that stops where it isn't 0, or isn't there; default: none.
    pub stop_input: Option<String>,
    /// What these two lead to, `category_0` or `category_1`; default: `category_1`.
    pub input_stop: Option<StopName>,
}

/// What the loss of a SubDevice leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LostDeviceName {
    /// The drives that are left brake by their own quick stop.
    QuickStop,
    /// The wheels that are left ramp down, then torque is removed.
    Ramp,
    /// Torque is removed at once.
    RemoveTorque,
}

/// What a robot does by itself whose SubDevice was lost and is back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ComebackName {
    /// Nothing: it stays without torque until a person acknowledges and enables it.
    Stay,
    /// Where nothing else happened its drives are acknowledged and enabled; it holds, and a person resumes.
    Hold,
    /// As `hold`; then, after a warning, it moves on along its path without a person.
    MoveAgainUnattended,
}

/// Stop categories of IEC 60204-1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StopName {
    /// Remove torque at once.
    #[serde(rename = "category_0")]
    Category0,
    /// Ramp down, then remove torque.
    #[serde(rename = "category_1")]
    Category1,
    /// Ramp down and hold.
    #[serde(rename = "category_2")]
    Category2,
}

impl From<StopName> for StopCategory {
    fn from(name: StopName) -> Self {
        match name {
            StopName::Category0 => StopCategory::RemoveTorque,
            StopName::Category1 => StopCategory::RampThenRemove,
            StopName::Category2 => StopCategory::RampAndHold,
        }
    }
}
