//! What the sensors of a simulated robot say: made of its true motion, on its way as long as the file says.

use omnibase_measure::truth::TruePlatform;
use omnibase_robot::config::{InputOwner, SensorName, SensorPlan, SimulatedSensorTable};
use omnibase_robot::signals::{Between, Heard};
use omnibase_robot::{Robot, RobotPlan};
use omnibase_robot_sim::{Pose, SensorMessage, SensorParameters, SimulatedSensor, Tells, Twist};

/// The sensors of a plan that it simulates.
pub struct Sensors {
    all: Vec<Line>,
}

/// One of them, and what it said that is still on its way, the first to arrive last.
struct Line {
    name: String,
    sensor: SimulatedSensor,
    source: usize,
    /// The places of its values among the source's.
    values: Vec<usize>,
    /// Values of the source that it has and this one doesn't tell, as a covariance: they are 0.
    count: usize,
    delay_ns: u64,
    scale: f64,
    under_way: Vec<SensorMessage>,
}

/// Messages of one sensor that can be on their way: a second of the fastest.
const UNDER_WAY: usize = 1024;

impl Sensors {
    /// Those of a plan; `None` where it has none.
    pub fn new(plan: &RobotPlan) -> Option<Self> {
        let line = |table: &SimulatedSensorTable| {
            let name = table.name.as_deref()?;
            let sensor = plan.sensors.iter().find(|sensor| sensor.name == name)?;
            let InputOwner::Source(source) = sensor.from else { return None };
            let before: usize = plan.devices.iter().map(|device| device.input.len()).sum::<usize>()
                + plan.sources[..source].iter().map(|source| source.input.len()).sum::<usize>();
            Some(Line {
                name: name.to_owned(),
                sensor: SimulatedSensor::new(parameters(table, sensor)),
                source,
                values: sensor.inputs.iter().take(3).map(|input| input - before).collect(),
                count: plan.sources[source].input.len(),
                delay_ns: sensor.delay_ns,
                scale: sensor.scale,
                under_way: Vec::with_capacity(UNDER_WAY),
            })
        };
        let all: Vec<Line> = plan.simulation.sensor.iter().filter_map(line).collect();
        (!all.is_empty()).then_some(Sensors { all })
    }

    /// One of them falls silent, by its name; what is under way of it is lost.
    pub fn silence(&mut self, name: &str) {
        self.all.retain(|line| line.name != name);
    }

    /// Gives the robot what arrives until an instant of its clock.
    pub fn hear(&mut self, robot: &mut Robot, now_ns: u64) {
        for line in &mut self.all {
            while let Some(message) = line.under_way.pop_if(|message| message.arrives_ns <= now_ns) {
                let mut heard = Heard { instant_ns: message.instant_ns.min(now_ns), ..Heard::NOTHING };
                heard.values[..line.count].fill(0.0);
                for (place, value) in line.values.iter().zip(message.values) {
                    heard.values[*place] = value / line.scale;
                }
                robot.hear_between(line.source, Between::of(&heard));
                robot.hear(line.source, &heard);
            }
        }
    }

    /// Lets all of them look at the truth at an instant of the robot's clock.
    pub fn look(&mut self, now_ns: u64, truth: &TruePlatform) {
        let pose = truth.odom_from_body;
        let body = Pose { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad };
        let twist = truth.twist_in_body;
        let twist = Twist { vx_m_s: twist.vx_m_s, vy_m_s: twist.vy_m_s, w_rad_s: twist.w_rad_s };
        for line in &mut self.all {
            let Some(message) = line.sensor.look(now_ns, body, twist) else { continue };
            // What takes as long in the sensor as its table says is late in both.
            let message = SensorMessage {
                arrives_ns: message.arrives_ns + line.delay_ns,
                instant_ns: message.instant_ns + line.delay_ns,
                ..message
            };
            if line.under_way.len() < UNDER_WAY {
                let at = line.under_way.partition_point(|other| other.arrives_ns > message.arrives_ns);
                line.under_way.insert(at, message);
            }
        }
    }
}

fn parameters(table: &SimulatedSensorTable, plan: &SensorPlan) -> SensorParameters {
    let sigma = plan.sensor.sigma;
    let (tells, rate_hz, noises) = match plan.kind {
        SensorName::Gyro => (Tells::Turn, 1000.0, [0.0, sigma[0]]),
        SensorName::Imu => (Tells::Inertia, 1000.0, [sigma[1], sigma[0]]),
        SensorName::Flow => (Tells::Way, 125.0, [sigma[0], 0.0]),
        SensorName::Twist => (Tells::Twist, 30.0, [sigma[0], sigma[2]]),
        SensorName::Pose => (Tells::Pose, 100.0, [sigma[0], sigma[2]]),
    };
    let mount = plan.sensor.body_from_sensor;
    let [x_m, y_m] = table.position_error_m.unwrap_or_default();
    let ns = |ms: Option<f64>| (ms.unwrap_or(0.0) * 1e6) as u64;
    SensorParameters {
        tells,
        mount: Pose {
            x_m: mount.x_m + x_m,
            y_m: mount.y_m + y_m,
            heading_rad: mount.heading_rad + table.heading_error_rad.unwrap_or(0.0),
        },
        period_ns: (1e9 / table.rate_hz.unwrap_or(rate_hz)) as u64,
        noise: table.noise.unwrap_or(noises[0]),
        turn_noise: table.turn_noise.unwrap_or(noises[1]),
        bias_rad_s: table.bias_rad_s.unwrap_or(0.0),
        bias_walk_rad_s: table.bias_walk_rad_s.unwrap_or(0.0),
        bias_m_s2: table.bias_m_s2.unwrap_or_default(),
        scale_error: table.scale_error.unwrap_or(0.0),
        quantum: table.quantum.unwrap_or(0.0),
        latency_ns: ns(table.latency_ms),
        jitter_ns: ns(table.jitter_ms),
        drop_share: table.drop_share.unwrap_or(0.0),
        outlier_share: table.outlier_share.unwrap_or(0.0),
        lift_off_share: table.lift_off_share.unwrap_or(0.0),
        clock_drift_ppm: table.clock_drift_ppm.unwrap_or(0.0),
        seed: table.seed.unwrap_or(1),
    }
}
