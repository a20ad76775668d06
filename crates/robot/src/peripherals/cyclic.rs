//! The cycle's part of the signals beside the drives: read, aged, told, written.

use std::fmt::Write;
use std::ops::Range;

use omnibase_cia402::Wanted;

use super::sources::Sources;
use crate::config::recorded_bytes::{self, RecordedBytes};
use crate::config::{DevicePlan, RobotPlan};
use crate::image::{ImageBuffer, ProcessImage};
use crate::registry::{Made, Registry};
use crate::signals::{
    AxisAsk, Between, CycleTime, Exchange, Heard, Inputs, MAX_DEVICES, MAX_SIGNALS, Outputs, RequestAnswer,
    SignalLayout, Signals, Told,
};
use crate::stages::{Leave, Peripheral, Readiness};

/// All SubDevices that drive no wheel, and what they remember from cycle to cycle.
pub(crate) struct Peripherals {
    layout: SignalLayout,
    all: Vec<Part>,
    sources: Sources,
    /// Values of the outputs until somebody sets them.
    on_stop: [f64; MAX_SIGNALS],
    /// What was asked of the outputs.
    asked: [Option<f64>; MAX_SIGNALS],
    /// What stages tell in this cycle.
    told: Told,
}

/// Process data of one direction of one of them, and where they stand in the record.
struct Kept {
    /// Bytes of process data.
    length: usize,
    /// Those that are recorded.
    recorded: RecordedBytes,
    /// Their place in the record.
    place: Range<usize>,
}

impl Kept {
    fn new(length: usize, recorded: RecordedBytes, at: &mut usize) -> Self {
        let place = next(at, recorded.count());
        Kept { length, recorded, place }
    }

    fn keep(&self, process_data: &[u8], record: &mut [u8]) {
        self.recorded.keep(process_data, &mut record[self.place.clone()]);
    }

    fn restore(&self, record: &[u8], process_data: &mut [u8]) {
        self.recorded.restore(&record[self.place.clone()], process_data);
    }
}

/// One of them, and where its signals and bytes stand.
struct Part {
    peripheral: Box<dyn Peripheral>,
    inputs: Range<usize>,
    outputs: Range<usize>,
    input_bytes: Kept,
    output_bytes: Kept,
    /// It is of a hot-connect group: as long as it was never heard it isn't there, and nobody waits for it.
    may_be_absent: bool,
    /// Where it missed more exchanges in a row it is lost, as for the safety chain, however long they took.
    tolerated: u32,
    /// Inputs older than this aren't believed, ns: as much as lost exchanges are tolerated.
    most_age_ns: u64,
    heard_ns: Option<u64>,
    missed_in_a_row: u32,
}

impl Part {
    /// It wasn't plugged in at the start, as far as is known: that is no loss.
    fn is_absent(&self) -> bool {
        self.may_be_absent && self.heard_ns.is_none()
    }
}

/// The next so many places.
pub(super) fn next(at: &mut usize, length: usize) -> Range<usize> {
    let begin = std::mem::replace(at, *at + length);
    begin..*at
}

impl Peripherals {
    pub(crate) fn new(plan: &RobotPlan, registry: &Registry) -> Made<Self> {
        let [mut inputs, mut outputs, mut input_bytes, mut output_bytes] = [0; 4];
        let made = registry.make_peripherals(plan)?;
        let tolerated = |device: &DevicePlan| device.most_missed(plan.safety.lost_exchanges_tolerated);
        let recorded = recorded_bytes::of_inputs(&plan.devices)
            .into_iter()
            .zip(recorded_bytes::of_outputs(&plan.devices));
        let devices = plan.devices.iter().zip(made).zip(recorded).take(MAX_DEVICES);
        let parts = devices.map(|((device, peripheral), (read, written))| Part {
            peripheral,
            inputs: next(&mut inputs, device.input.len()),
            outputs: next(&mut outputs, device.output.len()),
            input_bytes: Kept::new(device.input_bytes(), read, &mut input_bytes),
            output_bytes: Kept::new(device.output_bytes(), written, &mut output_bytes),
            may_be_absent: device.group.is_some(),
            tolerated: tolerated(device),
            most_age_ns: u64::from(tolerated(device)).saturating_mul(plan.bus.cycle_ns),
            heard_ns: None,
            missed_in_a_row: 0,
        });
        let all = parts.collect();
        let mut on_stop = [0.0; MAX_SIGNALS];
        let outputs = plan.devices.iter().flat_map(|device| &device.output);
        on_stop.iter_mut().zip(outputs).for_each(|(value, output)| *value = output.on_stop);
        Ok(Peripherals {
            layout: plan.signals(),
            all,
            sources: Sources::new(plan),
            on_stop,
            asked: [None; MAX_SIGNALS],
            told: Told::NOTHING,
        })
    }

    /// Before the first cycle nothing was heard.
    pub(crate) fn begin(&self) -> Signals {
        let mut signals = Signals { shape: self.layout.shape(), outputs: self.on_stop, ..Signals::NONE };
        signals.ages_s[..self.layout.devices.len() + self.layout.sources.len()].fill(f64::INFINITY);
        signals
    }

    /// From process data to signals; what wasn't heard grows old.
    pub(crate) fn read(
        &mut self,
        time: &CycleTime,
        exchange: Exchange,
        image: &dyn ProcessImage,
        signals: &mut Signals,
    ) {
        self.told = Told::NOTHING;
        signals.believed = 0;
        signals.input_bytes.fill(0);
        for (device, part) in self.all.iter_mut().enumerate() {
            let values = &mut signals.inputs[part.inputs.clone()];
            let sent = image.device_inputs(device).and_then(|bytes| bytes.get(..part.input_bytes.length));
            if let Some(heard) = sent.filter(|_| exchange.has_inputs_of_device(device)) {
                part.input_bytes.keep(heard, &mut signals.input_bytes);
                part.peripheral.read(time, heard, values);
                part.heard_ns = Some(time.now_ns);
                part.missed_in_a_row = 0;
            } else {
                part.missed_in_a_row = part.missed_in_a_row.saturating_add(1);
            }
            if part.heard_ns.is_none() || part.missed_in_a_row > part.tolerated {
                // What was set before a loss doesn't come back with the SubDevice.
                self.asked[part.outputs.clone()].fill(None);
                part.peripheral.lost();
            }
            let age_ns = part.heard_ns.map(|heard_ns| time.now_ns.saturating_sub(heard_ns));
            signals.ages_s[device] = age_ns.map_or(f64::INFINITY, |age_ns| age_ns as f64 * 1e-9);
            if age_ns.is_none_or(|age_ns| age_ns > part.most_age_ns) {
                continue;
            }
            for (input, value) in part.inputs.clone().zip(values) {
                signals.believed |= u64::from(value.is_finite()) << input;
            }
        }
        self.sources.read(time, signals);
    }

    /// Something came from another program; it counts in the next cycle.
    pub(crate) fn hear(&mut self, source: usize, heard: &Heard) {
        self.sources.hear(source, heard);
    }

    /// What another program said since the cycle before.
    pub(crate) fn hear_between(&mut self, source: usize, between: Between) {
        self.sources.hear_between(source, between);
    }

    /// What stages see.
    pub(crate) fn inputs<'a>(&'a self, signals: &'a Signals) -> Inputs<'a> {
        Inputs::new(&self.layout, signals)
    }

    /// What stages see, and what they tell.
    pub(crate) fn open<'a>(&'a mut self, signals: &'a Signals) -> (Inputs<'a>, Outputs<'a>) {
        (Inputs::new(&self.layout, signals), Outputs::new(&self.layout, &mut self.told))
    }

    /// Somebody sets an output; `false` where there is none that can have this value.
    pub(crate) fn ask(&mut self, index: u32, value: f64) -> bool {
        let output = index as usize;
        let takes = |part: &Part| {
            part.outputs.contains(&output)
                && !part.is_absent()
                && part.peripheral.takes(output - part.outputs.start, value)
        };
        if !value.is_finite() || !self.all.iter().any(takes) {
            return false;
        }
        self.asked[output] = Some(value);
        true
    }

    /// Whoever set an output is gone; `false` where there is none.
    pub(crate) fn reset(&mut self, index: u32) -> bool {
        let output = index as usize;
        let is_there = output < self.layout.outputs.len();
        if is_there {
            self.asked[output] = None;
        }
        is_there
    }

    /// Somebody wants one of them to move.
    pub(crate) fn move_by(&mut self, time: &CycleTime, device: u32, ask: &AxisAsk) -> RequestAnswer {
        // Of what isn't there nothing is known, so nothing of it is moved.
        let part = self.all.get_mut(device as usize).filter(|part| !part.is_absent());
        part.map_or(RequestAnswer::Refused, |part| part.peripheral.ask(time, ask))
    }

    /// Somebody saw what was wrong.
    pub(crate) fn acknowledge(&mut self) {
        self.all.iter_mut().for_each(|part| part.peripheral.acknowledge());
    }

    /// How far they are on their way, all together, and the first that failed. Those that weren't heard in this cycle
    /// aren't ready, and rest only where they did when they were heard last.
    pub(crate) fn readiness(&self, exchange: Exchange) -> (Readiness, Option<usize>) {
        let mut all = Readiness::NOTHING_MOVES;
        let mut failed = None;
        for (device, part) in self.all.iter().enumerate().filter(|(_, part)| !part.is_absent()) {
            let one = part.peripheral.readiness();
            all.is_ready &= one.is_ready && exchange.has_inputs_of_device(device);
            all.rests &= one.rests;
            all.stands &= one.stands;
            failed = failed.or(one.failed.then_some(device));
        }
        (Readiness { failed: failed.is_some(), ..all }, failed)
    }

    /// Says what is wrong with one of them, in words, and whether anything is.
    pub(crate) fn tell_problem(&self, device: usize, words: &mut dyn Write) -> bool {
        self.all.get(device).is_some_and(|part| part.peripheral.tell_problem(words))
    }

    /// From signals to process data. A robot that lets go of its drives lets go of the outputs: nothing that was asked
    /// before counts after it.
    pub(crate) fn write(
        &mut self,
        time: &CycleTime,
        leave: &Leave,
        lets_go: bool,
        image: &mut dyn ProcessImage,
        signals: &mut Signals,
    ) {
        if lets_go {
            self.asked = [None; MAX_SIGNALS];
        }
        for part in &mut self.all {
            let mut outputs = Outputs::new(&self.layout, &mut self.told);
            part.peripheral.signals(&Inputs::new(&self.layout, signals), &mut outputs);
        }
        // Drives are written in every phase; what they tell counts where the other stages are asked too.
        if lets_go || leave.wanted != Wanted::OperationEnabled {
            self.told = Told::NOTHING;
        }
        for (output, value) in signals.outputs.iter_mut().enumerate().take(self.layout.outputs.len()) {
            *value = self.asked[output].unwrap_or(self.on_stop[output]);
        }
        for (device, part) in self.all.iter_mut().enumerate().filter(|(_, part)| !part.is_absent()) {
            for output in part.outputs.clone().filter(|output| self.told.is_told >> output & 1 == 1) {
                // What it can't be told counts as if nobody had.
                if part.peripheral.takes(output - part.outputs.start, self.told.values[output]) {
                    signals.outputs[output] = self.told.values[output];
                }
            }
            let bytes = image.device_outputs(device);
            // Whoever was away had them zeroed; what is written builds on what was written last.
            let has_room = bytes.len() >= part.output_bytes.length;
            if has_room {
                part.output_bytes.restore(&signals.output_bytes, bytes);
            }
            part.peripheral.lead(time, leave);
            part.peripheral.write(time, &signals.outputs[part.outputs.clone()], bytes);
            if has_room {
                part.output_bytes.keep(bytes, &mut signals.output_bytes);
            }
        }
    }

    /// Puts a recorded cycle's inputs back into process data, and what programs sent back on its way.
    pub(crate) fn replay(&mut self, signals: &Signals, image: &mut ImageBuffer) {
        let images = image.device_inputs.iter_mut().zip(&mut image.devices_there);
        for (device, (part, (bytes, is_there))) in self.all.iter().zip(images).enumerate() {
            // Not of this cycle: it wasn't there, or it rested.
            let was_heard = signals.ages_s[device] == 0.0;
            *is_there = was_heard;
            bytes.clear();
            if was_heard {
                bytes.resize(part.input_bytes.length, 0);
                part.input_bytes.restore(&signals.input_bytes, bytes);
            }
        }
        self.sources.replay(signals);
    }
}
