//! Everything of one cycle in one plain struct of fixed size.

mod visit;

use omnibase_platform::{Pose2, Regime};

use super::{
    Allowed, Commands, Course, CycleTime, Exchange, FusionReport, GripReport, GuardReport, LimitedBy,
    MAX_PROCESS_BYTES, MAX_WHEELS, Measurements, Phase, PlatformState, Quantity, Request, RequestAnswer,
    RequestSort, SafetyAction, SafetyReason, Setpoint, SignalLayout, Signals, SourceName, TractionReport,
};

use visit::{INPUTS, Name, OUTPUTS, Slot, Visit, WHEELS, regime_code, regime_from_code};

const PROCESS_WORDS: usize = MAX_PROCESS_BYTES / 8;
/// Codes of a choice are below it.
const MOST_CHOICES: u64 = 64;

/// One drive's process data of a cycle in one direction, raw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessBytes(pub [u8; MAX_PROCESS_BYTES]);

impl ProcessBytes {
    /// Those of a process image; what is longer than they can hold is left out.
    pub fn of(image: &[u8]) -> Self {
        let mut bytes = ProcessBytes::default();
        let length = image.len().min(MAX_PROCESS_BYTES);
        bytes.0[..length].copy_from_slice(&image[..length]);
        bytes
    }
}

impl Default for ProcessBytes {
    fn default() -> Self {
        ProcessBytes([0; MAX_PROCESS_BYTES])
    }
}

/// Everything of one cycle: what came in, what each stage made of it, and what went out.
///
/// `time`, `exchange`, `inputs`, the raw inputs of `signals` and `request` are enough to compute all the rest again, to
/// the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleRecord {
    /// The moment.
    pub time: CycleTime,
    /// What became of the exchange.
    pub exchange: Exchange,
    /// The drives' process data, raw, wheel by wheel.
    pub inputs: [ProcessBytes; MAX_WHEELS],
    /// What was asked in this cycle.
    pub request: Option<Request>,
    /// What became of that.
    pub answer: RequestAnswer,
    /// Where the robot is in its life.
    pub phase: Phase,
    /// Why it last stopped.
    pub stop_reason: SafetyReason,
    /// Which wheel, or which stage by its code, that reason is about.
    pub stop_where: u64,
    /// What the drives said.
    pub measurements: Measurements,
    /// What is known.
    pub state: PlatformState,
    /// What sensors tell of the platform's place; of a robot without them it says nothing.
    pub fusion: FusionReport,
    /// What is followed while tracking.
    pub course: Course,
    /// The reference's own time, s.
    pub reference_time_s: f64,
    /// Its rate: 1 as planned, 0 paused.
    pub reference_rate: f64,
    /// 1 where the reference was begun and isn't at its end.
    pub reference_begun: u64,
    /// The number with which the reference was loaded that is followed, or would be gone on with; 0 for the robot's own.
    pub reference: u64,
    /// The number of the one that the next `track` begins: the same where none waits.
    pub reference_next: u64,
    /// How far the wished pose is beside the motion that was asked for, in its axes: what repeats taught.
    pub correction: Pose2,
    /// What is wished.
    pub wished: Setpoint,
    /// What of it the platform's limits let through: what the controller follows.
    pub setpoint: Setpoint,
    /// What fence and obstacles let through.
    pub guard: GuardReport,
    /// Which controller of the plan has its say.
    pub controller: u64,
    /// What the controller wants.
    pub commands: Commands,
    /// What the wheels' torques tell of platform and floor.
    pub grip: GripReport,
    /// What the floor carries.
    pub traction: TractionReport,
    /// The force that the controller found beside those of its model, N.
    pub force_n: f64,
    /// What safety allows.
    pub allowed: Allowed,
    /// What the drives are sent, raw, wheel by wheel.
    pub outputs: [ProcessBytes; MAX_WHEELS],
    /// What comes and goes beside the drives.
    pub signals: Signals,
}

/// What the records of a robot hold.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordLayout {
    /// Wheels.
    pub wheels: usize,
    /// Signals beside the drives.
    pub signals: SignalLayout,
}

impl RecordLayout {
    /// Wheels, and nothing beside the drives.
    pub fn of_wheels(wheels: usize) -> Self {
        RecordLayout { wheels, signals: SignalLayout::default() }
    }
}

/// Topics of a recording beside those that the first part of a channel's name makes.
pub const TOPICS_BESIDE: [&str; 5] = ["timing", "error", "operator", "bus", "truth"];

/// How a channel's values are held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValueKind {
    /// A real number.
    F64,
    /// A whole number, or the code of a choice.
    U64,
}

/// One channel of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name, such as `wheel_1.speed`.
    pub name: String,
    /// Its unit; empty for codes and counts.
    pub unit: String,
    /// How its values are held.
    pub kind: ValueKind,
}

/// One value of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A real number.
    F64(f64),
    /// A whole number, or the code of a choice.
    U64(u64),
}

impl Value {
    /// The value as a real number, as plots need it.
    pub fn as_f64(self) -> f64 {
        match self {
            Value::F64(value) => value,
            Value::U64(value) => value as f64,
        }
    }
}

/// Why values are no record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotARecord {
    /// There are too few or too many, or one isn't of its channel's kind.
    Channels,
    /// A value that its channel can't have, such as a code of another version.
    Code {
        /// The channel's place.
        channel: usize,
        /// The value.
        value: Value,
    },
}

impl CycleRecord {
    /// The channels of such records, in a fixed order.
    pub fn channels(layout: &RecordLayout) -> Vec<Channel> {
        let mut list = Vec::new();
        let mut record = CycleRecord::of(layout);
        record.visit(&layout.signals, |name, unit, slot| {
            let kind = match slot {
                Slot::F64(_) => ValueKind::F64,
                Slot::U64(_) | Slot::Code(..) => ValueKind::U64,
            };
            list.push(Channel { name: name.to_string(), unit: unit.to_owned(), kind });
        });
        list
    }

    /// The channels of such records that are codes of choices, with each code's choice as `Debug` writes it.
    pub fn choices(layout: &RecordLayout) -> Vec<(Channel, Vec<(u64, String)>)> {
        let mut list = Vec::new();
        CycleRecord::of(layout).visit(&layout.signals, |name, unit, slot| {
            if let Slot::Code(_, name_of) = slot {
                let channel = Channel { name: name.to_string(), unit: unit.to_owned(), kind: ValueKind::U64 };
                let names = (0..MOST_CHOICES).filter_map(|code| Some((code, name_of(code)?)));
                list.push((channel, names.collect()));
            }
        });
        list
    }

    /// The first part of every channel's name that isn't a signal's.
    pub fn topics() -> Vec<String> {
        let some = SignalLayout {
            devices: vec![String::new()],
            sources: vec![SourceName::default()],
            sensors: vec![String::new()],
            ..SignalLayout::default()
        };
        let channels = CycleRecord::channels(&RecordLayout { wheels: MAX_WHEELS, signals: some });
        let topic = |channel: &Channel| channel.name.split('.').next().unwrap_or_default().to_owned();
        let mut topics: Vec<String> = channels.iter().map(topic).filter(|topic| !topic.is_empty()).collect();
        topics.extend(TOPICS_BESIDE.map(str::to_owned));
        topics.dedup();
        topics
    }

    /// What is learnt of the platform: mass kg, inertia kg·m², and the force beside those of the controller's model N.
    pub fn estimates(&self) -> [f64; 3] {
        [self.grip.dynamics.mass_kg, self.grip.dynamics.inertia_kg_m2, self.force_n]
    }

    /// An empty record of a robot.
    fn of(layout: &RecordLayout) -> CycleRecord {
        let mut record = CycleRecord::default();
        record.measurements.wheels = layout.wheels;
        record.signals.shape = layout.signals.shape();
        record
    }

    /// Puts the values of all channels into `values`, which is emptied first; no allocation once it is long enough.
    pub fn values(&self, values: &mut Vec<Value>) {
        values.clear();
        let mut copy = *self;
        // Nobody reads the names.
        let nameless = SignalLayout::default();
        copy.visit(&nameless, |_, _, slot| {
            values.push(match slot {
                Slot::F64(value) => Value::F64(*value),
                Slot::U64(value) | Slot::Code(value, _) => Value::U64(*value),
            });
        });
    }

    /// The record of such values.
    pub fn from_values(layout: &RecordLayout, values: &[Value]) -> Result<CycleRecord, NotARecord> {
        let mut record = CycleRecord::of(layout);
        let mut rest = values.iter();
        let mut fits = true;
        record.visit(&layout.signals, |_, _, slot| match (slot, rest.next()) {
            (Slot::F64(slot), Some(Value::F64(value))) => *slot = *value,
            (Slot::U64(slot) | Slot::Code(slot, _), Some(Value::U64(value))) => *slot = *value,
            _ => fits = false,
        });
        if !fits || rest.next().is_some() {
            return Err(NotARecord::Channels);
        }
        // A code that no choice has was read as the choice's default.
        let mut given = values.iter().enumerate();
        let mut unknown = None;
        record.visit(&SignalLayout::default(), |_, _, slot| {
            if let (Slot::U64(understood) | Slot::Code(understood, _), Some((channel, Value::U64(given)))) =
                (slot, given.next())
                && understood != given
            {
                unknown.get_or_insert(channel);
            }
        });
        match unknown {
            Some(channel) => Err(NotARecord::Code { channel, value: values[channel] }),
            None => Ok(record),
        }
    }

    /// The one list of all channels: reading, writing and naming go through it.
    fn visit(&mut self, names: &SignalLayout, visitor: impl FnMut(Name<'_>, &str, Slot<'_>)) {
        let mut v = Visit { prefix: [""; 2], visitor };
        v.u64("cycle.index", "", &mut self.time.index);
        v.u64("cycle.time", "ns", &mut self.time.now_ns);
        v.u64("cycle.period", "ns", &mut self.time.period_ns);
        let mut codes = self.exchange.codes();
        v.named("exchange.result", &mut codes[0], &|code| {
            Some(format!("{:?}", Exchange::from_codes([code, 0, 0])?))
        });
        v.u64("exchange.expected", "", &mut codes[1]);
        v.u64("exchange.received", "", &mut codes[2]);
        self.exchange = Exchange::from_codes(codes).unwrap_or_default();
        let (mut codes, mut arguments) = Request::codes(self.request);
        v.named("request.kind", &mut codes[0], &|code| Some(format!("{:?}", RequestSort::from_code(code)?)));
        v.u64("request.argument", "", &mut codes[1]);
        v.u64("request.valid_until", "ns", &mut codes[2]);
        v.f64("request.value_1", "", &mut arguments[0]);
        v.f64("request.value_2", "", &mut arguments[1]);
        v.f64("request.value_3", "", &mut arguments[2]);
        v.f64("request.value_4", "", &mut arguments[3]);
        v.f64("request.value_5", "", &mut arguments[4]);
        v.f64("request.value_6", "", &mut arguments[5]);
        self.request = Request::from_codes(codes, arguments).flatten();
        v.code("request.answer", &mut self.answer, RequestAnswer::code, RequestAnswer::from_code);
        v.code("phase", &mut self.phase, Phase::code, Phase::from_code);
        v.code("stop_reason", &mut self.stop_reason, SafetyReason::code, SafetyReason::from_code);

        v.u64("stop_where", "", &mut self.stop_where);
        v.pose("state.pose", &mut self.state.odom_from_body);
        v.twist("state.twist_in_body", ["m/s", "m/s", "rad/s"], &mut self.state.twist_in_body);
        v.f64("state.twist_age", "s", &mut self.state.twist_age_s);
        let covariance =
            ["xx", "xy", "xh", "yy", "yh", "hh"].iter().zip(["m²", "m²", "m·rad", "m²", "m·rad", "rad²"]);
        for ((name, unit), value) in covariance.zip(&mut self.state.covariance) {
            v.prefix = ["state.covariance_", ""];
            v.f64(name, unit, value);
        }
        v.prefix = [""; 2];
        let mut regime = regime_code(self.state.regime);
        v.named("state.regime", &mut regime, &|code| Some(format!("{:?}", regime_from_code(code)?)));
        self.state.regime = regime_from_code(regime).unwrap_or(Regime::Other);
        v.f64("state.slip_residual", "m/s", &mut self.state.slip_residual_m_s);
        let mut pose_known = u64::from(self.state.pose_known);
        v.u64("state.pose_known", "", &mut pose_known);
        self.state.pose_known = pose_known != 0;
        if self.signals.shape.sensors > 0 {
            v.fusion(&names.sensors, &mut self.fusion, self.signals.shape.sensors);
        }
        v.code("reference.course", &mut self.course, Course::code, Course::from_code);
        v.f64("reference.time", "s", &mut self.reference_time_s);
        v.f64("reference.rate", "", &mut self.reference_rate);
        v.u64("reference.begun", "", &mut self.reference_begun);
        v.u64("reference.number", "", &mut self.reference);
        v.u64("reference.next", "", &mut self.reference_next);
        v.pose("reference.correction", &mut self.correction);
        v.setpoint(["wished.pose", "wished.twist", "wished.acceleration", "wished.status"], &mut self.wished);
        v.setpoint(
            ["setpoint.pose", "setpoint.twist", "setpoint.acceleration", "setpoint.status"],
            &mut self.setpoint,
        );
        v.option("guard.fence_margin", "m", &mut self.guard.fence_margin_m);
        v.option("guard.fence_kept", "m", &mut self.guard.fence_kept_m);
        v.option("guard.obstacle_distance", "m", &mut self.guard.obstacle_distance_m);
        v.u64("guard.obstacle", "", &mut self.guard.nearest_obstacle);
        v.code("guard.limited_by", &mut self.guard.limited_by, LimitedBy::code, LimitedBy::from_code);
        v.f64("estimate.mass", "kg", &mut self.grip.dynamics.mass_kg);
        v.f64("estimate.inertia", "kg·m²", &mut self.grip.dynamics.inertia_kg_m2);
        v.f64("estimate.spin_friction", "N", &mut self.grip.dynamics.friction_n[0]);
        v.f64("estimate.roller_friction", "N", &mut self.grip.dynamics.friction_n[1]);
        v.f64("estimate.mass_moment.x", "kg·m", &mut self.grip.dynamics.mass_moment_kg_m[0]);
        v.f64("estimate.mass_moment.y", "kg·m", &mut self.grip.dynamics.mass_moment_kg_m[1]);
        v.option("estimate.floor_friction", "", &mut self.grip.friction);
        v.option("estimate.floor_friction_sigma", "", &mut self.grip.friction_sigma);
        v.f64("estimate.force", "N", &mut self.force_n);
        v.option("traction.friction", "", &mut self.traction.friction);
        v.f64("traction.share", "", &mut self.traction.share);
        v.f64("traction.factor", "", &mut self.traction.factor);
        v.u64("command.controller", "", &mut self.controller);
        v.code("command.quantity", &mut self.commands.quantity, Quantity::code, Quantity::from_code);
        v.f64("command.saturation", "", &mut self.commands.saturation);
        v.code("allowed.quantity", &mut self.allowed.commands.quantity, Quantity::code, Quantity::from_code);
        v.f64("allowed.saturation", "", &mut self.allowed.commands.saturation);
        v.code("allowed.action", &mut self.allowed.action, SafetyAction::code, SafetyAction::from_code);
        v.code("allowed.reason", &mut self.allowed.reason, SafetyReason::code, SafetyReason::from_code);
        v.u64("allowed.where", "", &mut self.allowed.where_index);
        for (wheel, name) in WHEELS.into_iter().enumerate().take(self.measurements.wheels) {
            v.prefix = [name, ""];
            v.drive(&mut self.measurements.drives[wheel]);
            v.f64("slip", "m/s", &mut self.grip.slip_m_s[wheel]);
            v.f64("slipped", "m", &mut self.grip.slipped_m[wheel]);
            v.f64("command", "rad/s or N·m", &mut self.commands.values[wheel]);
            v.f64("allowed", "rad/s or N·m", &mut self.allowed.commands.values[wheel]);
            v.bytes(&INPUTS, &mut self.inputs[wheel]);
            v.bytes(&OUTPUTS, &mut self.outputs[wheel]);
        }
        v.prefix = [""; 2];
        v.signals(names, &mut self.signals);
    }
}
