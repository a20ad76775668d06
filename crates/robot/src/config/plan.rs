//! What a robot's file means once everything in it is resolved.

use std::collections::BTreeMap;

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_platform::Kinematics;

use super::bus_plan::BusPlan;
use super::device_plan::{DevicePlan, signal_layout};
use super::drive_plan::DrivePlan;
use super::event_plan::EventPlan;
use super::file::{ControllerTable, EstimatorTable};
use super::grip_tables::GripPlan;
use super::guard_tables::AvoidanceKind;
use super::joystick::JoystickTable;
use super::map_tables::MapTable;
use super::mapping;
use super::reference_table::ReferenceTable;
use super::run_tables::{BridgeTable, RecordingPlan, RunTable};
use super::sensor_tables::SensorPlan;
use super::simulation_tables::SimulationTable;
use super::source_tables::SourcePlan;
use crate::obstacle::Obstacle;
use crate::signals::{MAX_WHEELS, RecordLayout, SafetyAction, SignalLayout, StopCategory};

/// A robot, resolved and checked: everything that building its stages and bringing up its bus needs.
#[derive(Clone, Debug)]
pub struct RobotPlan {
    /// The robot's name.
    pub name: String,
    /// The bus and its cycle.
    pub bus: BusPlan,
    /// Objects that may be written by SDO while drives are enabled.
    pub sdo_write_while_enabled: Vec<ObjectAddress>,
    /// The drives in the order of the wheels.
    pub drives: Vec<DrivePlan>,
    /// The SubDevices that drive no wheel.
    pub devices: Vec<DevicePlan>,
    /// Other programs that send inputs.
    pub sources: Vec<SourcePlan>,
    /// What tells of the platform's motion beside its wheels.
    pub sensors: Vec<SensorPlan>,
    /// Wheels and where they stand.
    pub kinematics: Kinematics,
    /// What the platform weighs without a load, kg, where its file says so.
    pub mass_kg: Option<f64>,
    /// Limits.
    pub limits: Limits,
    /// How the pose is estimated.
    pub estimator: EstimatorTable,
    /// The control law.
    pub controller: ControllerTable,
    /// The motion that is wished.
    pub reference: ReferenceTable,
    /// Watchdogs and stops.
    pub safety: SafetyPlan,
    /// What is known of the floor's friction.
    pub grip: GripPlan,
    /// The joystick.
    pub joystick: JoystickTable,
    /// Footprint, fence and obstacles.
    pub guard: GuardPlan,
    /// The room through which ways are planned.
    pub map: Option<MapTable>,
    /// The simulated body.
    pub simulation: SimulationTable,
    /// What happens to it, in the order of time.
    pub events: Vec<EventPlan>,
    /// How it is brought up.
    pub run: RunTable,
    /// What is recorded of its runs; `None`: nothing.
    pub recording: Option<RecordingPlan>,
    /// Programs that are started beside it, by their names.
    pub bridges: BTreeMap<String, BridgeTable>,
}

impl RobotPlan {
    /// Names of the controllers: the one that begins, then those to which it can be switched.
    pub fn controllers(&self) -> impl Iterator<Item = &str> {
        self.controller.kind.iter().chain(self.controller.others.iter().flatten()).map(String::as_str)
    }

    /// The signals that come and go beside the drives.
    pub fn signals(&self) -> SignalLayout {
        SignalLayout {
            sensors: self.sensors.iter().map(|sensor| sensor.name.clone()).collect(),
            ..signal_layout(&self.devices, &self.sources)
        }
    }

    /// How long before a cycle's frame the drives read the encoders whose values it fetches, ns; that of the slowest drive.
    pub fn input_age_ns(&self) -> u64 {
        let clocks = self.drives.iter().filter_map(|drive| drive.dc);
        // Without a clock at the arrival of the frame before.
        clocks
            .map(|dc| dc.last_beat_ns(self.bus.cycle_ns, self.bus.frame_ns()))
            .max()
            .unwrap_or(self.bus.cycle_ns)
    }

    /// Whether every drive maps the torque that its motor gives (0x6077).
    pub(crate) fn tells_torques(&self) -> bool {
        self.drives.iter().all(|drive| mapping::find(&drive.inputs, 0x6077, 0).is_some())
    }

    /// What a cycle's record of this robot holds.
    pub fn record_layout(&self) -> RecordLayout {
        RecordLayout { wheels: self.drives.len(), signals: self.signals() }
    }
}

/// Footprint, fence and obstacles.
#[derive(Clone, Debug, PartialEq)]
pub struct GuardPlan {
    /// Corners of the footprint's convex hull, counter-clockwise, in base_link, m; at most 16.
    pub footprint_m: Vec<[f64; 2]>,
    /// Where the footprint comes from.
    pub footprint_source: FootprintSource,
    /// The fence.
    pub fence: Option<FencePlan>,
    /// The way of avoiding obstacles at the start.
    pub avoidance: AvoidanceKind,
    /// What the footprint keeps from an obstacle, m.
    pub distance_m: f64,
    /// Coefficient of `circulate`, 1/s.
    pub circulate_1_s: f64,
    /// How many standard deviations of the believed pose are kept beside that distance.
    pub obstacle_sigmas: f64,
    /// After so long without headway a plan is given up, s.
    pub give_up_s: f64,
    /// How much faster than the path's own speed is caught up, at most.
    pub catch_up_factor: f64,
    /// Obstacles that are there from the start, at most [`MAX_OBSTACLES`](crate::guard::MAX_OBSTACLES).
    pub obstacles: Vec<Obstacle>,
}

/// Where a footprint comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FootprintSource {
    /// The robot's file.
    Given,
    /// The wheels and their radius: the body may reach further.
    Wheels,
}

/// The fence.
#[derive(Clone, Debug, PartialEq)]
pub struct FencePlan {
    /// Corners in order, in odom, m; at most 32, sides don't cross.
    pub corners_m: Vec<[f64; 2]>,
    /// What the footprint keeps from it, m.
    pub margin_m: f64,
    /// How many standard deviations of the believed pose are kept beside the margin.
    pub sigmas: f64,
}

impl FencePlan {
    /// What is kept where the file says nothing else, from a fence that isn't there yet.
    pub const NONE: FencePlan = FencePlan { corners_m: Vec::new(), margin_m: 0.05, sigmas: 3.0 };
}

/// Limits of the platform and its wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Jerk, m/s³.
    pub jerk_m_s3: f64,
    /// Turning speed, rad/s.
    pub turn_speed_rad_s: f64,
    /// Turning acceleration, rad/s².
    pub turn_acceleration_rad_s2: f64,
    /// Turning jerk, rad/s³.
    pub turn_jerk_rad_s3: f64,
    /// Wheel speed, rad/s.
    pub wheel_speed_rad_s: f64,
    /// Wheel torque, N·m.
    pub wheel_torque_nm: f64,
}

/// The part of the limits that is the wheels' own, and can be set lower while the robot runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelLimits {
    /// Wheel speed, rad/s.
    pub speed_rad_s: f64,
    /// Wheel torque, N·m.
    pub torque_nm: f64,
}

impl Limits {
    /// What the robot's file allows the wheels.
    pub fn wheels(&self) -> WheelLimits {
        WheelLimits { speed_rad_s: self.wheel_speed_rad_s, torque_nm: self.wheel_torque_nm }
    }
}

/// What comes by itself when a lost SubDevice is back, and nothing else happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComebackPlan {
    /// How far it goes.
    pub end: ComebackEnd,
    /// How long the SubDevice is awaited, ns.
    pub within_ns: u64,
    /// For how long exchanges were complete and wheels stood before that, ns.
    pub steady_ns: u64,
    /// Lost exchanges in a row that are tolerated; more of them are all drives gone.
    pub lost_exchanges_tolerated: u32,
    /// The input, by its place, that enables: one that was seen off meanwhile forbids it.
    pub enable_input: Option<usize>,
    /// The input, by its place, that stops: one that was seen set meanwhile forbids it.
    pub stop_input: Option<usize>,
    /// By which errors of its own, beside those of the profile, the drive of each wheel says that the bus failed.
    pub bus_errors: [&'static [ErrorCode]; MAX_WHEELS],
}

impl ComebackPlan {
    /// Whether the drive of this wheel says by this error that the bus failed.
    pub fn is_of_the_bus(&self, wheel: usize, error: ErrorCode) -> bool {
        error.is_communication() || self.bus_errors.get(wheel).is_some_and(|own| own.contains(&error))
    }
}

/// How far a comeback goes by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComebackEnd {
    /// The drives are enabled and hold.
    Hold,
    /// After a warning the motion goes on.
    MoveAgain {
        /// How long it is warned, ns.
        warning_ns: u64,
    },
}

/// Watchdogs and stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyPlan {
    /// Lost exchanges in a row that are tolerated.
    pub lost_exchanges_tolerated: u32,
    /// What follows where a SubDevice takes no part in more than that.
    pub lost_device_stop: SafetyAction,
    /// What comes by itself when a lost SubDevice is back; `None`: nothing.
    pub comeback: Option<ComebackPlan>,
    /// Age at which a velocity command no longer counts, ns.
    pub command_age_ns: u64,
    /// Longest time for enabling all drives, ns.
    pub enabling_timeout_ns: u64,
    /// Longest time for a ramp to a stop, ns.
    pub stop_timeout_ns: u64,
    /// Distance between wished and estimated pose that stops, m.
    pub tracking_error_m: f64,
    /// How far from the start of a path that is laid in odom the platform may stand, m.
    pub start_distance_m: f64,
    /// How far from its heading there, rad.
    pub start_heading_rad: f64,
    /// What a measured wheel speed above its limit leads to.
    pub wheel_speed_stop: StopCategory,
    /// What a wished speed above its limit leads to.
    pub reference_speed_stop: StopCategory,
    /// What a way that leads out of the fence leads to.
    pub fence_stop: StopCategory,
    /// What the loss of the tracked path leads to.
    pub tracking_error_stop: StopCategory,
    /// What a measured wheel torque above its limit leads to.
    pub wheel_torque_stop: StopCategory,
    /// How far a measured torque may lie above its limit, N·m at the wheel; `None`: the greater of a tenth of the limit
    /// and a twentieth of the rated torque.
    pub wheel_torque_margin_nm: Option<f64>,
    /// For how long it may lie further above, ns.
    pub wheel_torque_time_ns: u64,
    /// Swings of a torque reach at least so far, as a part of its limit.
    pub oscillation_share: f64,
    /// How far a wheel may slip within some two seconds, m.
    pub slip_m: f64,
    /// What further leads to.
    pub slip_stop: StopCategory,
    /// The input, by its place, that tells how fast the platform turns, rad/s.
    pub gyro_input: Option<usize>,
    /// The input, by its place, without which nothing is enabled.
    pub enable_input: Option<usize>,
    /// The input, by its place, that stops.
    pub stop_input: Option<usize>,
    /// What these two lead to.
    pub input_stop: StopCategory,
}

/// The platform's limits as trajectories know them.
pub fn motion_limits(limits: &Limits) -> omnibase_trajectory::Limits {
    omnibase_trajectory::Limits {
        speed_m_s: limits.speed_m_s,
        acceleration_m_s2: limits.acceleration_m_s2,
        jerk_m_s3: limits.jerk_m_s3,
        rate_rad_s: limits.turn_speed_rad_s,
        angular_acceleration_rad_s2: limits.turn_acceleration_rad_s2,
        angular_jerk_rad_s3: limits.turn_jerk_rad_s3,
    }
}
