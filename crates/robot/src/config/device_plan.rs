//! What a SubDevice that drives no wheel means once its table is resolved.

use std::ops::Range;

use omnibase_ethercat::config as bus_config;
use omnibase_ethercat::config::Timeouts;

use super::axis_plan::AxisPlan;
use super::bus_config::{bytes, expected_identity, matched, sdos};
use super::bus_plan::{BusPlace, BusPlan, Identity, ParameterPlan};
use super::custom::Parameters;
use super::device_tables::SignalType;
use super::drive_tables::ParameterState;
use super::mapping::PdoPlan;
use super::recorded_bytes::{self, RecordedBytes};
use super::source_tables::SourcePlan;
use super::start_plan::DcPlan;
use crate::signals::{SignalLayout, SignalName};

/// One SubDevice that drives no wheel.
#[derive(Clone, Debug)]
pub struct DevicePlan {
    /// Its name.
    pub name: String,
    /// Where it is on the bus.
    pub place: BusPlace,
    /// The hot-connect group that it is of; `None` where it has to be there.
    pub group: Option<String>,
    /// In which cycles its process data go.
    pub every: bus_config::Every,
    /// Events of its clock, an axis' in each cycle, others' in those of its process data; `None` where it has none.
    pub dc: Option<DcPlan>,
    /// The longest waits for it.
    pub timeouts: Timeouts,
    /// Its kind by name.
    pub kind: String,
    /// Who must be there.
    pub identity: Identity,
    /// PDOs from the cycle to it; empty where nobody writes any.
    pub outputs: Vec<PdoPlan>,
    /// PDOs from it to the cycle; empty where nobody reads any.
    pub inputs: Vec<PdoPlan>,
    /// Signals that come from it.
    pub input: Vec<InputPlan>,
    /// Signals that it is told.
    pub output: Vec<OutputPlan>,
    /// The axis that its drive moves.
    pub axis: Option<AxisPlan>,
    /// SDOs: those of each state in the order in which they are sent.
    pub parameters: Vec<ParameterPlan>,
    /// Its kind reads and writes its signals alone, and nothing else of its process data.
    pub by_signals: bool,
    /// The kind's own keys.
    pub custom: Parameters,
}

/// A signal that comes from a SubDevice.
#[derive(Clone, Debug, PartialEq)]
pub struct InputPlan {
    /// Its name, without the SubDevice's.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// How it stands in the process data; `None` where its kind reads it in a way of its own.
    pub coding: Option<Coding>,
    /// Its value in the simulated robot; `None` for what the number 0 is.
    pub simulated: Option<f64>,
}

/// A signal that a SubDevice is told.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputPlan {
    /// Its name, without the SubDevice's.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// How it stands in the process data; `None` where its kind writes it in a way of its own.
    pub coding: Option<Coding>,
    /// Its value until somebody sets it, and when the robot stops.
    pub on_stop: f64,
}

/// How a value stands in process data: `value = number · scale + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coding {
    /// Its first bit in the SubDevice's process data of its direction.
    pub bit: u32,
    /// Its length, bits, at most 32.
    pub bits: u8,
    /// Type of the number.
    pub kind: SignalType,
    /// Factor; not 0.
    pub scale: f64,
    /// What is added.
    pub offset: f64,
}

impl Coding {
    /// The value in process data; NaN where these are too short.
    pub fn read(&self, bytes: &[u8]) -> f64 {
        let mut word = 0_u32;
        for n in 0..u32::from(self.bits) {
            let at = self.bit + n;
            let Some(byte) = bytes.get(at as usize / 8) else { return f64::NAN };
            word |= u32::from(byte >> (at % 8) & 1) << n;
        }
        let unused = 32_u32.saturating_sub(self.bits.into());
        let number = match self.kind {
            SignalType::F32 => f64::from(f32::from_bits(word)),
            SignalType::I8 | SignalType::I16 | SignalType::I32 => {
                f64::from(((word << unused) as i32) >> unused)
            }
            SignalType::Bool | SignalType::U8 | SignalType::U16 | SignalType::U32 => f64::from(word),
        };
        number * self.scale + self.offset
    }

    /// Puts a value into process data; nothing happens to what is too short.
    pub fn write(&self, value: f64, bytes: &mut [u8]) {
        let number = (value - self.offset) / self.scale;
        let (low, high) = self.numbers();
        let whole = number.round().clamp(low, high);
        let word = match self.kind {
            SignalType::F32 => (number as f32).to_bits(),
            _ if whole < 0.0 => whole as i32 as u32,
            _ => whole as u32,
        };
        for n in 0..u32::from(self.bits) {
            let at = self.bit + n;
            let Some(byte) = bytes.get_mut(at as usize / 8) else { return };
            let bit = 1 << (at % 8);
            *byte = if word >> n & 1 == 1 { *byte | bit } else { *byte & !bit };
        }
    }

    /// Whether the process data can hold a value.
    pub fn holds(&self, value: f64) -> bool {
        let number = (value - self.offset) / self.scale;
        let (low, high) = self.numbers();
        // Half a number is rounded away.
        (low - 0.5..high + 0.5).contains(&number)
    }

    /// The least and the greatest value that the process data can hold.
    pub fn values(&self) -> [f64; 2] {
        let (low, high) = self.numbers();
        let ends = [low, high].map(|number| number * self.scale + self.offset);
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }

    /// Its bits in the process data.
    pub(crate) fn bit_range(&self) -> Range<u32> {
        self.bit..self.bit + u32::from(self.bits)
    }

    /// The bytes in which it has a bit.
    pub(crate) fn bytes(&self) -> Range<usize> {
        let Range { start, end } = self.bit_range();
        start as usize / 8..end.div_ceil(8) as usize
    }

    fn numbers(&self) -> (f64, f64) {
        let size = f64::from(self.bits).exp2();
        match self.kind {
            SignalType::F32 => (f64::from(f32::MIN), f64::from(f32::MAX)),
            SignalType::I8 | SignalType::I16 | SignalType::I32 => (-size / 2.0, size / 2.0 - 1.0),
            SignalType::Bool | SignalType::U8 | SignalType::U16 | SignalType::U32 => (0.0, size - 1.0),
        }
    }
}

impl DevicePlan {
    /// Bytes of process data from it that are read.
    pub fn input_bytes(&self) -> usize {
        bytes(&self.inputs)
    }

    /// Bytes of process data to it that are written.
    pub fn output_bytes(&self) -> usize {
        bytes(&self.outputs)
    }

    /// How old its inputs are when the frame passes that fetches them, ns: since its last beat. Without a clock nobody knows: half a cycle.
    pub fn input_age_ns(&self, bus: &BusPlan) -> u64 {
        let Some(dc) = &self.dc else { return bus.cycle_ns / 2 };
        dc.last_beat_ns(bus.cycle_ns * u64::from(self.every.cycles()), bus.frame_ns())
    }

    /// Exchanges in a row that it may miss where `tolerated` of its own may be missed.
    pub fn most_missed(&self, tolerated: u32) -> u32 {
        tolerated.saturating_add(1).saturating_mul(self.every.cycles().into()) - 1
    }

    fn presence(&self) -> bus_config::Presence {
        self.group.as_deref().map_or_else(Default::default, |group| bus_config::Presence::Group(group.into()))
    }

    /// What the bus is asked for it, without its PDOs: what of these can be written only the SubDevice itself tells.
    /// One that is written to goes safe by its own watchdog when the program says nothing, as the drives do.
    pub fn subdevice_config(&self, bus: &BusPlan) -> bus_config::SubDeviceConfig {
        let watchdogs =
            if self.outputs.is_empty() { bus_config::WatchdogConfig::default() } else { bus.watchdogs() };
        bus_config::SubDeviceConfig {
            // What is read and written by bytes, and zeroed while its owner is away.
            own_bytes: true,
            name: Some(self.name.clone()),
            place: Some(matched(self.place)),
            identity: expected_identity(&self.identity),
            presence: self.presence(),
            every: self.every,
            sdos: sdos(&self.parameters, ParameterState::PreOp),
            safe_op_sdos: sdos(&self.parameters, ParameterState::SafeOp),
            watchdogs,
            dc: self.dc.map_or(bus_config::DcConfig::Off, |dc| {
                dc.config(bus.cycle_ns * u64::from(self.every.cycles()))
            }),
            assign_activate: self.dc.map(|dc| dc.assign_activate),
            sync_mode: self.axis.as_ref().and_then(|_| bus.sync_mode(self.dc.as_ref())),
            timeouts: self.timeouts,
            ..Default::default()
        }
    }
}

/// The names of all signals of such SubDevices and programs, as `buttons.3`, in the order of their tables.
pub(crate) fn signal_layout(devices: &[DevicePlan], sources: &[SourcePlan]) -> SignalLayout {
    let full = |device: &DevicePlan, name: &str, unit: &str| SignalName {
        name: format!("{}.{name}", device.name),
        unit: unit.to_owned(),
    };
    let inputs =
        devices.iter().flat_map(|one| one.input.iter().map(|input| full(one, &input.name, &input.unit)));
    let outputs =
        devices.iter().flat_map(|one| one.output.iter().map(|output| full(one, &output.name, &output.unit)));
    let mut layout = SignalLayout {
        devices: devices.iter().map(|device| device.name.clone()).collect(),
        sources: Vec::new(),
        sensors: Vec::new(),
        inputs: inputs.collect(),
        outputs: outputs.collect(),
        input_bytes: recorded_bytes::of_inputs(devices).iter().map(RecordedBytes::count).sum(),
        output_bytes: recorded_bytes::of_outputs(devices).iter().map(RecordedBytes::count).sum(),
    };
    sources.iter().for_each(|source| source.add_to(&mut layout));
    layout
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coding(bit: u32, bits: u8, kind: SignalType) -> Coding {
        Coding { bit, bits, kind, scale: 1.0, offset: 0.0 }
    }

    #[test]
    fn numbers_are_read_where_they_stand_with_their_sign() {
        let bytes = [0b1010_0000, 0xFF, 0x7F, 0x00, 0x80];
        assert_eq!(coding(5, 1, SignalType::Bool).read(&bytes), 1.0);
        assert_eq!(coding(6, 1, SignalType::Bool).read(&bytes), 0.0);
        assert_eq!(coding(8, 16, SignalType::I16).read(&bytes), 32767.0);
        assert_eq!(coding(24, 16, SignalType::I16).read(&bytes), -32768.0);
        assert_eq!(coding(24, 16, SignalType::U16).read(&bytes), 32768.0);
        assert_eq!(coding(5, 4, SignalType::I8).read(&bytes), -3.0);
        assert!(coding(33, 8, SignalType::U8).read(&bytes).is_nan());
        let scaled = Coding { scale: 0.1, offset: -40.0, ..coding(8, 16, SignalType::U16) };
        assert!((scaled.read(&bytes) - (3276.7 - 40.0)).abs() < 1e-9);
    }

    #[test]
    fn what_is_written_is_read_back_and_leaves_its_neighbours() {
        for (kind, bits, value) in [
            (SignalType::Bool, 1, 1.0),
            (SignalType::I16, 16, -1234.0),
            (SignalType::U32, 32, 4_000_000_000.0),
            (SignalType::I32, 32, -2_000_000_000.0),
            (SignalType::F32, 32, -1.5),
            (SignalType::U8, 3, 5.0),
        ] {
            let coding = coding(3, bits, kind);
            for before in [0x00, 0xFF] {
                let mut bytes = [before; 6];
                coding.write(value, &mut bytes);
                assert_eq!(coding.read(&bytes), value, "{kind:?}");
                let mask: u64 = ((1 << bits) - 1) << 3;
                let word =
                    |bytes: [u8; 6]| bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
                assert_eq!(word(bytes) & !mask, word([before; 6]) & !mask, "{kind:?}");
            }
        }
    }

    #[test]
    fn what_the_process_data_cant_hold_is_known() {
        let volts = Coding { scale: 10.0 / 32767.0, ..coding(0, 16, SignalType::I16) };
        assert!(volts.holds(10.0) && volts.holds(-10.0));
        assert!(!volts.holds(10.01) && !volts.holds(f64::NAN) && !volts.holds(f64::INFINITY));
        assert!(!coding(0, 1, SignalType::Bool).holds(2.0));
        assert_eq!(coding(0, 4, SignalType::U8).values(), [0.0, 15.0]);
    }
}
