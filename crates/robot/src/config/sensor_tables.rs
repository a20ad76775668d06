//! What tells of the platform's motion beside its wheels: as written, and resolved.

use omnibase_fusion::{Sensor, SensorKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One sensor. What it says comes in as an input of a `[[device]]` or a `[[source]]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SensorTable {
    /// Its name: small letters, digits and underscores, at most 24.
    pub name: Option<String>,
    /// What it tells.
    pub kind: Option<SensorName>,
    /// Where that comes in. Of a gyro the input's full name, as `imu.turn`; of the others the name of the SubDevice or
    /// program that has the inputs `x`, `y` and `heading`, as far as the kind has them; of an imu `turn`, `acceleration_x`
    /// and `acceleration_y`.
    pub from: Option<String>,
    /// Where it is mounted, x and y in base_link, m; default: 0, 0.
    pub position_m: Option<[f64; 2]>,
    /// In which direction its own x axis points, from that of base_link, rad; default: 0.
    pub heading_rad: Option<f64>,
    /// How old what it says is when it is sent, or read, ms; default: 0.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub delay_ms: Option<f64>,
    /// From its own unit to m or rad/s, of a gyro and of flow: negative for one that counts the other way; default: 1.
    pub scale: Option<f64>,
    /// Noise of a pose, standard deviation of x and y, m; default: 0.002. Covariances that are sent are added.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub sigma_m: Option<f64>,
    /// Noise of a pose's heading, rad; default: 0.004.
    #[schemars(range(min = 1e-6, max = 4.0))]
    pub sigma_rad: Option<f64>,
    /// Noise of a reading of flow or twist, m/s; default: 0.02.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub sigma_m_s: Option<f64>,
    /// Noise of a reading of an imu's accelerations, m/s²; default: 0.05.
    #[schemars(range(min = 1e-6, max = 100.0))]
    pub sigma_m_s2: Option<f64>,
    /// Noise of a reading of gyro, imu or twist, rad/s; default: 0.005.
    #[schemars(range(min = 1e-6, max = 10.0))]
    pub sigma_rad_s: Option<f64>,
    /// Standard deviation of a gyro's bias at the start, rad/s; default: 0.02.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bias_sigma_rad_s: Option<f64>,
    /// How far a gyro's bias wanders within a second, rad/s, growing with the root of the time; default: 3e-6.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bias_walk_rad_s: Option<f64>,
    /// Standard deviation of the scale of gyro, flow or twist; default: 0.005 for a gyro, 0.02 for the others.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub scale_sigma: Option<f64>,
    /// Standard deviation of the direction in which flow or twist is mounted, rad; default: 0.02.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub direction_sigma_rad: Option<f64>,
    /// It counts as silent after so long without a reading, ms; default: 300.
    #[schemars(range(min = 1, max = 60_000))]
    pub silent_ms: Option<u32>,
}

/// What a sensor tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorName {
    /// How fast the platform turns, counter-clockwise, rad/s.
    Gyro,
    /// How fast the platform turns, rad/s, and how the sensor is accelerated along its own axes, m/s², gravity's share on a
    /// slope included: a gyro with an accelerometer, which tells when wheels begin to slip.
    Imu,
    /// How far the floor was passed over since the sensor was switched on, along its own axes, m: an optical mouse.
    Flow,
    /// The sensor's own speed along its own axes, m/s and rad/s: visual odometry.
    Twist,
    /// The sensor's pose in map, m and rad: motion capture, markers, a map of the room.
    Pose,
}

impl From<SensorName> for SensorKind {
    fn from(name: SensorName) -> Self {
        match name {
            SensorName::Gyro => SensorKind::Turn,
            SensorName::Imu => SensorKind::Inertial,
            SensorName::Flow => SensorKind::Flow,
            SensorName::Twist => SensorKind::Twist,
            SensorName::Pose => SensorKind::Pose,
        }
    }
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorPlan {
    /// Its name.
    pub name: String,
    /// What it tells, as the file calls it.
    pub kind: SensorName,
    /// The places of its inputs: turn; turn and two accelerations; x and y; or x, y and heading. A pose with a covariance of its own has that too.
    pub inputs: Vec<usize>,
    /// Who has them.
    pub from: InputOwner,
    /// How old what it says is when it comes in with its own instant, ns.
    pub delay_ns: u64,
    /// From its own unit to m or rad/s.
    pub scale: f64,
    /// As the filter knows it.
    pub sensor: Sensor,
}

impl SensorPlan {
    /// chi² of a reading over its degrees of freedom, beyond which it is left out.
    pub fn gate(&self) -> f64 {
        omnibase_fusion::gate(self.sensor.kind)
    }
}

/// Who has inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputOwner {
    /// A SubDevice, by its place.
    Device(usize),
    /// A program, by its place.
    Source(usize),
}

/// Vices of a simulated sensor beside the noise that its own table gives; all are 0 where they aren't given.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SimulatedSensorTable {
    /// The sensor's name. What it says comes in from its `[[source]]`, or stands in the process data of its simulated SubDevice.
    pub name: Option<String>,
    /// Readings a second; default: 1000 for a gyro or imu, 125 for flow, 30 for twist, 100 for a pose, and whenever a SubDevice
    /// looks at its terminals for what one tells.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub rate_hz: Option<f64>,
    /// Noise in place of the sensor's own, m, m/s, m/s² or their like: x and y.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub noise: Option<f64>,
    /// Noise of heading or turn, rad or rad/s.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub turn_noise: Option<f64>,
    /// Bias of a gyro, rad/s.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub bias_rad_s: Option<f64>,
    /// How far that wanders within a second, rad/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bias_walk_rad_s: Option<f64>,
    /// Bias of an imu's accelerations, x and y, m/s²: a slope looks the same.
    pub bias_m_s2: Option<[f64; 2]>,
    /// What is wrong with its scale: 0.01 tells one per cent too much.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub scale_error: Option<f64>,
    /// Steps of what it tells, m, m/s or rad/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub quantum: Option<f64>,
    /// How far it is mounted beside the place that its table gives, x and y, m.
    pub position_error_m: Option<[f64; 2]>,
    /// By how much its direction is off, rad.
    #[schemars(range(min = -1.0, max = 1.0))]
    pub heading_error_rad: Option<f64>,
    /// How long a reading is on its way, ms, beside the delay that its table gives.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub latency_ms: Option<f64>,
    /// By how much more at most, evenly spread, ms.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub jitter_ms: Option<f64>,
    /// Share of readings that never come.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub drop_share: Option<f64>,
    /// Share of readings that are anywhere within a metre, or a metre a second, of the truth.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub outlier_share: Option<f64>,
    /// Share of the way on which a mouse is lifted off and tells nothing, a tenth of a metre at a time.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lift_off_share: Option<f64>,
    /// By how much its clock runs fast, ppm: its instants drift away from the robot's.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub clock_drift_ppm: Option<f64>,
    /// Its noise is another one with another seed; default: 1.
    pub seed: Option<u64>,
}
