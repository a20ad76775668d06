//! What the sensors of a simulated robot say: made of its true motion, on its way as long as the file says.

use omnibase_ethercat::wire::HostTime;
use omnibase_ethercat_sim::device::panel::IoPanel;

use omnibase_measure::truth::TruePlatform;
use omnibase_robot::config::{Coding, InputOwner, PdoPlan, SensorName, SensorPlan, SimulatedSensorTable};
use omnibase_robot::signals::{Between, Heard};
use omnibase_robot::{Robot, RobotPlan};
use omnibase_robot_sim::{
    Pose, SensorMessage, SensorParameters, SharedMachine, SimulatedSensor, Tells, Twist,
};

use super::beside::{show, simulated_bytes};

/// Messages of one sensor that can be on their way: a second of the fastest source, and of a terminal that looks each 0.1 ms.
const UNDER_WAY: [usize; 2] = [1024, 10_240];

/// A SubDevice that wasn't looked at for longer measures no further ahead than this, ns.
const MOST_BETWEEN_NS: u64 = 100_000_000;

/// A sensor, and what it said that is still on its way, the first to arrive last.
struct Line {
    sensor: SimulatedSensor,
    delay_ns: u64,
    scale: f64,
    under_way: Vec<SensorMessage>,
}

impl Line {
    /// `on_the_bus` are sensors of a SubDevice: they measure each time that it does, where nothing else is said.
    fn new(table: &SimulatedSensorTable, plan: &SensorPlan, on_the_bus: bool) -> Self {
        Line {
            sensor: SimulatedSensor::new(parameters(table, plan, on_the_bus)),
            delay_ns: plan.delay_ns,
            scale: plan.scale,
            under_way: Vec::with_capacity(UNDER_WAY[usize::from(on_the_bus)]),
        }
    }

    /// Lets it look at the truth at an instant.
    fn look(&mut self, now_ns: u64, body: Pose, twist: Twist) {
        let Some(message) = self.sensor.look(now_ns, body, twist) else { return };
        // What takes as long in the sensor as its table says is late in both.
        let message = SensorMessage {
            arrives_ns: message.arrives_ns + self.delay_ns,
            instant_ns: message.instant_ns + self.delay_ns,
            values: message.values.map(|value| value / self.scale),
        };
        if self.under_way.len() < self.under_way.capacity() {
            let at = self.under_way.partition_point(|other| other.arrives_ns > message.arrives_ns);
            self.under_way.insert(at, message);
        }
    }

    /// The next that arrives until an instant.
    fn arrived(&mut self, now_ns: u64) -> Option<SensorMessage> {
        self.under_way.pop_if(|message| message.arrives_ns <= now_ns)
    }
}

/// The simulated sensors of a plan whose values come from one owner.
fn simulated(
    plan: &RobotPlan,
    is_of: impl Fn(InputOwner) -> bool,
) -> impl Iterator<Item = (&SimulatedSensorTable, &SensorPlan)> {
    plan.simulation.sensor.iter().filter_map(move |table| {
        let name = table.name.as_deref()?;
        let sensor = plan.sensors.iter().find(|sensor| sensor.name == name)?;
        is_of(sensor.from).then_some((table, sensor))
    })
}

/// Inputs of the SubDevices that come before one: those stand first among all inputs.
fn inputs_before(plan: &RobotPlan, device: usize) -> usize {
    plan.devices[..device].iter().map(|device| device.input.len()).sum()
}

/// The simulated sensors of a plan that speak as programs do.
pub struct Sensors {
    all: Vec<Speaker>,
}

/// One of them.
struct Speaker {
    name: String,
    line: Line,
    source: usize,
    /// The places of its values among the source's.
    values: Vec<usize>,
    /// Values of the source that it has and this one doesn't tell, as a covariance: they are 0.
    count: usize,
}

impl Sensors {
    /// Those of a plan; `None` where it has none.
    pub fn new(plan: &RobotPlan) -> Option<Self> {
        let speaker = |(table, sensor): (&SimulatedSensorTable, &SensorPlan)| {
            let InputOwner::Source(source) = sensor.from else { return None };
            let of_sources = plan.sources[..source].iter().map(|source| source.input.len()).sum::<usize>();
            let before = inputs_before(plan, plan.devices.len()) + of_sources;
            Some(Speaker {
                name: sensor.name.clone(),
                line: Line::new(table, sensor, false),
                source,
                values: sensor.inputs.iter().take(3).map(|input| input - before).collect(),
                count: plan.sources[source].input.len(),
            })
        };
        let of_sources = simulated(plan, |owner| matches!(owner, InputOwner::Source(_)));
        let all: Vec<Speaker> = of_sources.filter_map(speaker).collect();
        (!all.is_empty()).then_some(Sensors { all })
    }

    /// One of them falls silent, by its name; what is under way of it is lost.
    pub fn silence(&mut self, name: &str) {
        self.all.retain(|speaker| speaker.name != name);
    }

    /// Gives the robot what arrives until an instant of its clock.
    pub fn hear(&mut self, robot: &mut Robot, now_ns: u64) {
        for Speaker { line, source, values, count, .. } in &mut self.all {
            while let Some(message) = line.arrived(now_ns) {
                let mut heard = Heard { instant_ns: message.instant_ns.min(now_ns), ..Heard::NOTHING };
                heard.values[..*count].fill(0.0);
                for (place, value) in values.iter().zip(message.values) {
                    heard.values[*place] = value;
                }
                robot.hear_between(*source, Between::of(&heard));
                robot.hear(*source, &heard);
            }
        }
    }

    /// Lets all of them look at the truth at an instant of the robot's clock.
    pub fn look(&mut self, now_ns: u64, truth: &TruePlatform) {
        let pose = truth.odom_from_body;
        let body = Pose { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad };
        let twist = truth.twist_in_body;
        let twist = Twist { vx_m_s: twist.vx_m_s, vy_m_s: twist.vy_m_s, w_rad_s: twist.w_rad_s };
        self.all.iter_mut().for_each(|speaker| speaker.line.look(now_ns, body, twist));
    }
}

/// The simulated sensors that a SubDevice tells: they measure when it does, and what they say stands in its process data.
pub(super) struct Told {
    machine: SharedMachine,
    /// When it looked last, ns.
    looked_ns: u64,
    /// Each with how its values are coded.
    lines: Vec<(Line, Vec<Coding>)>,
    inputs: Vec<PdoPlan>,
    bytes: Vec<u8>,
}

impl Told {
    /// Those of a SubDevice without a wheel, by its number in the robot's file; `None` where it has none.
    pub fn new(plan: &RobotPlan, number: usize, machine: &SharedMachine) -> Option<Self> {
        let device = &plan.devices[number];
        let line = |(table, sensor): (&SimulatedSensorTable, &SensorPlan)| {
            let input = |at: &usize| device.input[at - inputs_before(plan, number)].coding;
            let codings: Option<Vec<Coding>> = sensor.inputs.iter().take(3).map(input).collect();
            Some((Line::new(table, sensor, true), codings?))
        };
        let lines: Vec<_> =
            simulated(plan, |owner| owner == InputOwner::Device(number)).filter_map(line).collect();
        (!lines.is_empty()).then(|| Told {
            machine: machine.clone(),
            looked_ns: 0,
            lines,
            inputs: device.inputs.clone(),
            bytes: simulated_bytes(device),
        })
    }

    /// The device reads its terminals at an instant of the machine's clock.
    pub fn measure(&mut self, panel: &IoPanel, now: HostTime) {
        let truth = {
            let mut machine = self.machine.lock();
            machine.advance(now.0);
            machine.truth()
        };
        // What takes a while in it takes a whole number of its looks, the nearest.
        let until_ns = truth.time_ns + truth.time_ns.saturating_sub(self.looked_ns).min(MOST_BETWEEN_NS) / 2;
        self.looked_ns = truth.time_ns;
        for (line, codings) in &mut self.lines {
            line.look(truth.time_ns, truth.pose, truth.twist_in_body);
            while let Some(message) = line.arrived(until_ns) {
                for (coding, value) in codings.iter().zip(message.values) {
                    coding.write(value, &mut self.bytes);
                }
            }
        }
        show(&self.inputs, &self.bytes, panel);
    }
}

fn parameters(table: &SimulatedSensorTable, plan: &SensorPlan, on_the_bus: bool) -> SensorParameters {
    let sigma = plan.sensor.sigma;
    let (tells, rate_hz, noises) = match plan.kind {
        SensorName::Gyro => (Tells::Turn, 1000.0, [0.0, sigma[0]]),
        SensorName::Imu => (Tells::Inertia, 1000.0, [sigma[1], sigma[0]]),
        SensorName::Flow => (Tells::Flow, 125.0, [sigma[0], 0.0]),
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
        period_ns: match (table.rate_hz, on_the_bus) {
            (None, true) => 0,
            (own_hz, _) => (1e9 / own_hz.unwrap_or(rate_hz)) as u64,
        },
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
