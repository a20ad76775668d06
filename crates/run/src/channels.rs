//! A cycle as a row of a recording: its channels grouped in topics, and its exact words for replay.

use omnibase_record::run::{RunSchema, Selection, Word};
use omnibase_robot::RobotPlan;
use omnibase_robot::signals::{
    Channel, CycleRecord, NotARecord, RecordLayout, TOPICS_BESIDE, Value, ValueKind, column_name,
};

use crate::live::{Commander, JoystickState};
use omnibase_ethercat::paced::Times;
use omnibase_measure::tracking::Errors;
use omnibase_measure::truth::TruePlatform;
use omnibase_session::supervision::BusFigures;

/// Beside the robot's own channels: how the cycle went, and how far off it was.
const TIMING: [&str; 5] = ["round_trip_ns", "wake_up_ns", "compute_ns", "dc_phase_ns", "left_out_cycles"];
const ERROR: [&str; 3] = ["believed_m", "true_m", "heading_rad"];
const OPERATOR: [&str; 5] = ["commander", "emergency_stop", "blocked_sticks", "joystick", "moves_again_in_s"];
const TRUTH: [&str; 6] =
    ["pose_x_m", "pose_y_m", "pose_heading_rad", "twist_x_m_s", "twist_y_m_s", "twist_heading_rad_s"];

/// The key of a reference that was loaded while the robot ran: its table as TOML.
pub fn reference_key(number: u32) -> String {
    format!("reference/{number}")
}

/// Whether the truth is known, and recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// Simulated: a topic `/truth`.
    Truth,
    /// Hardware.
    BeliefAlone,
}

/// What a row tells beside the cycle's record.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleExtras {
    /// The cycle's times.
    pub times: Times,
    /// What the bus counted.
    pub bus: BusFigures,
    /// Time for computing, ns.
    pub compute_ns: u64,
    /// Its errors.
    pub errors: Errors,
    /// Who has the say.
    pub authority: Authority,
    /// In how many s the robot moves again without a person, after a loss; `None` where it doesn't.
    pub moves_again_in_s: Option<f64>,
    /// The truth, where it is known.
    pub truth: Option<TruePlatform>,
}

/// Who has the say over a robot that people and programs lead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Authority {
    /// Who commands.
    pub commander: Commander,
    /// The emergency stop is set.
    pub is_emergency: bool,
    /// Blocked sticks: bit 0 the joystick's, then the pages'.
    pub blocked_sticks: u64,
    /// What has become of the joystick at the robot's computer.
    pub joystick: JoystickState,
}

/// Puts cycles into rows; no allocation after its making.
#[derive(Clone, Debug)]
pub struct Rows {
    schema: RunSchema,
    /// Values of the record's channels in a row's order.
    order: Vec<usize>,
    known: Known,
    values: Vec<Value>,
    row: Vec<f64>,
    words: Vec<u64>,
}

impl Rows {
    /// Rows of a robot.
    pub fn new(layout: &RecordLayout, known: Known) -> Self {
        let channels = CycleRecord::channels(layout);
        let mut topics: Vec<(String, Vec<usize>)> = Vec::new();
        for (number, channel) in channels.iter().enumerate() {
            let topic = place(channel).0;
            match topics.iter_mut().find(|(name, _)| *name == topic) {
                Some((_, members)) => members.push(number),
                None => topics.push((topic, vec![number])),
            }
        }
        let mut schema = RunSchema::default();
        for (topic, members) in &topics {
            schema.push(topic, members.iter().map(|&number| place(&channels[number]).1));
        }
        let [timing, error, operator, bus, truth] = TOPICS_BESIDE.map(|topic| format!("/{topic}"));
        schema.push(&timing, TIMING);
        schema.push(&error, ERROR);
        schema.push(&operator, OPERATOR);
        schema.push(&bus, BusFigures::CHANNELS);
        if known == Known::Truth {
            schema.push(&truth, TRUTH);
        }
        let order: Vec<usize> = topics.into_iter().flat_map(|(_, members)| members).collect();
        schema.words = words(&order, &channels);
        let (row, words) = (Vec::with_capacity(schema.width()), Vec::with_capacity(schema.width()));
        Rows { values: Vec::with_capacity(order.len()), schema, order, known, row, words }
    }

    /// The columns.
    pub fn schema(&self) -> &RunSchema {
        &self.schema
    }

    /// A cycle as numbers in the schema's order.
    pub fn of(&mut self, record: &CycleRecord, extras: &CycleExtras) -> &[f64] {
        record.values(&mut self.values);
        self.row.clear();
        self.row.extend(self.order.iter().map(|&number| self.values[number].as_f64()));
        beside(self.known, extras, |value| self.row.push(value));
        &self.row
    }

    /// A cycle as exact words in the schema's order, as a recording takes them.
    pub fn words(&mut self, record: &CycleRecord, extras: &CycleExtras) -> &[u64] {
        record.values(&mut self.values);
        self.words.clear();
        self.words.extend(self.order.iter().map(|&number| word(self.values[number])));
        beside(self.known, extras, |value| self.words.push(value.to_bits()));
        &self.words
    }
}

/// What a row tells beside the record, in the schema's order.
fn beside(known: Known, extras: &CycleExtras, mut put: impl FnMut(f64)) {
    let Times { round_trip_ns, late_ns, dc_phase_ns, periods, .. } = extras.times;
    [round_trip_ns, late_ns, extras.compute_ns].into_iter().for_each(|ns| put(ns as f64));
    put(dc_phase_ns.map_or(f64::NAN, |phase_ns| phase_ns as f64));
    put(periods.saturating_sub(1) as f64);
    let Errors { believed_m, true_m, heading_rad } = extras.errors;
    [believed_m, true_m.unwrap_or(f64::NAN), heading_rad].into_iter().for_each(&mut put);
    let Authority { commander, is_emergency, blocked_sticks, joystick } = extras.authority;
    let codes = [commander.code(), is_emergency.into(), blocked_sticks, joystick.code()];
    codes.into_iter().for_each(|code| put(code as f64));
    put(extras.moves_again_in_s.unwrap_or(f64::NAN));
    extras.bus.values().into_iter().for_each(&mut put);
    if known == Known::Truth {
        let truth = extras.truth.unwrap_or_default();
        let (pose, twist) = (truth.odom_from_body, truth.twist_in_body);
        let truth = [pose.x_m, pose.y_m, pose.heading_rad, twist.vx_m_s, twist.vy_m_s, twist.w_rad_s];
        truth.into_iter().for_each(put);
    }
}

/// What the words of a record are, by the places of their values in a row.
fn words(order: &[usize], channels: &[Channel]) -> Vec<Word> {
    let mut places = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, &number)| places[number] = place);
    let words = places.into_iter().zip(channels).map(|(place, channel)| match channel.kind {
        ValueKind::F64 => Word::Bits(place),
        ValueKind::U64 => Word::Count(place),
    });
    words.collect()
}

/// The topic and the name by which recordings know a channel.
pub(crate) fn place(channel: &Channel) -> (String, String) {
    let (topic, rest) = channel.name.split_once('.').unwrap_or(("cycle", &channel.name));
    (format!("/{topic}"), column_name(&rest.replace('.', "_"), &channel.unit))
}

/// Whether some signal of this robot, on hardware or simulated, fits a pattern; an error says what there is.
pub fn known(pattern: &str, plan: &RobotPlan) -> Result<(), String> {
    let rows = Rows::new(&plan.record_layout(), Known::Truth);
    let selection = Selection { signals: vec![pattern.to_owned()], every_ns: None };
    if !selection.columns(rows.schema()).is_empty() {
        return Ok(());
    }
    let topic = pattern.trim_start_matches('/').split(['.', '/', '*']).next().unwrap_or_default();
    let of_topic: Vec<_> =
        rows.schema().names().filter(|name| name.split('.').next() == Some(topic)).collect();
    Err(if of_topic.is_empty() {
        let topics: Vec<_> = rows.schema().topics.iter().map(|topic| topic.name.trim_matches('/')).collect();
        format!("no signal has this name; there are {}, as \"state.*\"", topics.join(", "))
    } else {
        format!("no signal has this name; of this topic there are {}", of_topic.join(", "))
    })
}

/// The bits of a value.
pub fn word(value: Value) -> u64 {
    match value {
        Value::F64(value) => value.to_bits(),
        Value::U64(value) => value,
    }
}

/// The record of a row's exact words; of many rows [`RecordWords`] makes them faster.
pub fn record(layout: &RecordLayout, raw: &[u8]) -> Result<CycleRecord, NotARecord> {
    RecordWords::new(layout.clone()).record(raw)
}

/// What the exact words of a robot's rows are.
#[derive(Clone, Debug)]
pub struct RecordWords {
    layout: RecordLayout,
    channels: Vec<Channel>,
    values: Vec<Value>,
}

impl RecordWords {
    /// Of records of this layout.
    pub fn new(layout: RecordLayout) -> Self {
        RecordWords { channels: CycleRecord::channels(&layout), layout, values: Vec::new() }
    }

    /// A channel for each word.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The values of the row that was read last.
    pub(crate) fn values(&self) -> &[Value] {
        &self.values
    }

    /// The record of a row.
    pub fn record(&mut self, raw: &[u8]) -> Result<CycleRecord, NotARecord> {
        if raw.len() != 8 * self.channels.len() {
            return Err(NotARecord::Channels);
        }
        self.values.clear();
        self.values.extend(raw.as_chunks().0.iter().zip(&self.channels).map(|(bytes, channel)| {
            let word = u64::from_le_bytes(*bytes);
            match channel.kind {
                ValueKind::F64 => Value::F64(f64::from_bits(word)),
                ValueKind::U64 => Value::U64(word),
            }
        }));
        CycleRecord::from_values(&self.layout, &self.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_has_one_column_with_its_unit() {
        let mut rows = Rows::new(&RecordLayout::of_wheels(3), Known::Truth);
        let schema = rows.schema().clone();
        for (topic, signal) in [
            ("/state", "pose_x_m"),
            ("/state", "covariance_xh_m_rad"),
            ("/setpoint", "twist_heading_rad_s"),
            ("/wheel_3", "torque_nm"),
            ("/truth", "pose_heading_rad"),
            ("/cycle", "time_ns"),
        ] {
            assert!(schema.column(topic, signal).is_some(), "{topic} {signal} in {schema:#?}");
        }
        let plain = |name: &str| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
        assert!(schema.topics.iter().flat_map(|topic| &topic.signals).all(|signal| plain(&signal.name)));
        let mut cycle = CycleRecord::default();
        cycle.measurements.wheels = 3;
        cycle.state.odom_from_body.x_m = 0.1;
        cycle.measurements.drives[2].torque_nm = -0.0;
        let row = rows.of(&cycle, &CycleExtras::default()).to_vec();
        assert_eq!(row.len(), schema.width());
        assert_eq!(row[schema.column("/state", "pose_x_m").unwrap()], 0.1);
        let words = rows.words(&cycle, &CycleExtras::default());
        assert_eq!(words.len(), schema.width());
        let mut raw = Vec::new();
        for word in &schema.words {
            let (place, value) = match *word {
                Word::Bits(place) => (place, f64::from_bits(words[place])),
                Word::Count(place) => (place, words[place] as f64),
            };
            assert_eq!(value.to_bits(), row[place].to_bits(), "{word:?}");
            raw.extend_from_slice(&words[place].to_le_bytes());
        }
        assert_eq!(record(&RecordLayout::of_wheels(3), &raw), Ok(cycle));
        assert_eq!(record(&RecordLayout::of_wheels(4), &raw), Err(NotARecord::Channels));
    }
}
