//! Named values beside the drives: what other SubDevices and programs say, and what SubDevices are told.

use super::sources::{MAX_SOURCES, SourceName};

/// SubDevices that drive no wheel.
pub const MAX_DEVICES: usize = 16;
/// Named values of one direction.
pub const MAX_SIGNALS: usize = 64;
/// Recorded bytes of process data of all these SubDevices together in one direction.
pub const MAX_DEVICE_BYTES: usize = 128;

/// The name of a signal and its unit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SignalName {
    /// Its full name, as `buttons.3`.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
}

/// Which signals a robot has, in the order of its file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SignalLayout {
    /// Names of the SubDevices.
    pub devices: Vec<String>,
    /// Other programs that send inputs, at most [`MAX_SOURCES`].
    pub sources: Vec<SourceName>,
    /// What tells of the platform's motion beside its wheels.
    pub sensors: Vec<String>,
    /// What comes in, at most [`MAX_SIGNALS`]: the SubDevices' first, then the programs'.
    pub inputs: Vec<SignalName>,
    /// What goes out, at most [`MAX_SIGNALS`].
    pub outputs: Vec<SignalName>,
    /// Recorded bytes of the process data that are read.
    pub input_bytes: usize,
    /// Recorded bytes of the process data that are written.
    pub output_bytes: usize,
}

impl SignalLayout {
    /// The place of an input.
    pub fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|signal| signal.name == name)
    }

    /// The place of an output.
    pub fn output(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|signal| signal.name == name)
    }

    /// How many there are of everything.
    pub fn shape(&self) -> SignalShape {
        SignalShape {
            devices: self.devices.len(),
            sources: self.sources.len(),
            sensors: self.sensors.len(),
            inputs: self.inputs.len(),
            outputs: self.outputs.len(),
            input_bytes: self.input_bytes,
            output_bytes: self.output_bytes,
        }
    }
}

/// How many signals there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SignalShape {
    /// SubDevices.
    pub devices: usize,
    /// Other programs.
    pub sources: usize,
    /// Sensors of the platform's motion.
    pub sensors: usize,
    /// Inputs.
    pub inputs: usize,
    /// Outputs.
    pub outputs: usize,
    /// Recorded bytes of the process data that are read.
    pub input_bytes: usize,
    /// Recorded bytes of the process data that are written.
    pub output_bytes: usize,
}

/// All signals of one cycle; what lies beyond the robot's own is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signals {
    /// How many there are.
    pub shape: SignalShape,
    /// Process data from the SubDevices, one behind the other, raw; 0 of those that took no part in the exchange. Of a
    /// robot with more than these have room for, the bytes of the signals.
    pub input_bytes: [u8; MAX_DEVICE_BYTES],
    /// Age of each SubDevice's inputs, then of each program's, s; infinite until it was heard.
    pub ages_s: [f64; MAX_DEVICES + MAX_SOURCES],
    /// Which programs were heard in this cycle: bit n for source n.
    pub heard: u64,
    /// The instant of what each program sent last, on the robot's clock, ns.
    pub instants_ns: [u64; MAX_SOURCES],
    /// Inputs that a program said to be 0, or no number, at some instant since the cycle before: bit n for input n.
    pub zeroed: u64,
    /// Inputs that a program said to be anything but 0.
    pub raised: u64,
    /// Inputs, in their units: the last that were heard.
    pub inputs: [f64; MAX_SIGNALS],
    /// Which inputs are to be believed: bit n for input n. Not those that are old, or no number.
    pub believed: u64,
    /// Outputs, in their units.
    pub outputs: [f64; MAX_SIGNALS],
    /// Process data to the SubDevices, likewise.
    pub output_bytes: [u8; MAX_DEVICE_BYTES],
}

impl Signals {
    /// No signals.
    pub const NONE: Signals = Signals {
        shape: SignalShape {
            devices: 0,
            sources: 0,
            sensors: 0,
            inputs: 0,
            outputs: 0,
            input_bytes: 0,
            output_bytes: 0,
        },
        input_bytes: [0; MAX_DEVICE_BYTES],
        ages_s: [0.0; MAX_DEVICES + MAX_SOURCES],
        heard: 0,
        instants_ns: [0; MAX_SOURCES],
        zeroed: 0,
        raised: 0,
        inputs: [0.0; MAX_SIGNALS],
        believed: 0,
        outputs: [0.0; MAX_SIGNALS],
        output_bytes: [0; MAX_DEVICE_BYTES],
    };

    /// Whether a program said in between that an input is 0, or no number.
    pub fn was_zeroed(&self, input: usize) -> bool {
        self.zeroed >> input & 1 == 1
    }

    /// Whether a program said in between that an input is anything but 0.
    pub fn was_raised(&self, input: usize) -> bool {
        self.raised >> input & 1 == 1
    }

    /// An input by its place; `None` where it isn't to be believed.
    pub fn believed(&self, input: usize) -> Option<f64> {
        let is_believed = input < self.shape.inputs && self.believed >> input & 1 == 1;
        is_believed.then(|| self.inputs[input])
    }
}

impl Default for Signals {
    fn default() -> Self {
        Signals::NONE
    }
}

static NONE: Signals = Signals::NONE;
static NO_LAYOUT: SignalLayout = SignalLayout {
    devices: Vec::new(),
    sources: Vec::new(),
    sensors: Vec::new(),
    inputs: Vec::new(),
    outputs: Vec::new(),
    input_bytes: 0,
    output_bytes: 0,
};

/// What comes in beside the drives, by name.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    layout: &'a SignalLayout,
    signals: &'a Signals,
}

impl<'a> Inputs<'a> {
    /// The inputs of a cycle.
    pub fn new(layout: &'a SignalLayout, signals: &'a Signals) -> Self {
        Inputs { layout, signals }
    }

    /// An input by its full name, as `buttons.3`, in its unit; `None` where it is old, no number, or isn't there.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.believed(self.layout.input(name)?)
    }

    /// Their names, in order.
    pub fn names(&self) -> impl Iterator<Item = &'a str> {
        self.layout.inputs.iter().map(|signal| signal.name.as_str())
    }

    /// How old what a SubDevice or a program said is, s: infinite until it was heard; `None` where it isn't there.
    pub fn age_s(&self, name: &str) -> Option<f64> {
        let device = self.layout.devices.iter().position(|device| device == name);
        device.map(|device| self.signals.ages_s[device]).or_else(|| Some(self.source(name)?.1))
    }

    /// An input by its place; `None` where it isn't to be believed.
    pub(super) fn believed(&self, input: usize) -> Option<f64> {
        self.signals.believed(input)
    }

    /// An input by its place, as it was heard last; `None` where it is no number, or nothing was heard.
    pub(crate) fn at(&self, input: usize) -> Option<f64> {
        self.signals.inputs.get(input).copied().filter(|value| value.is_finite())
    }

    /// How old what a SubDevice said is, by its place, s.
    pub(crate) fn device_age_s(&self, device: usize) -> Option<f64> {
        (device < self.layout.devices.len()).then(|| self.signals.ages_s[device])
    }

    /// The instant of what a program sent, by its place, ns; `None` where nothing came in this cycle.
    pub(crate) fn heard_ns(&self, source: usize) -> Option<u64> {
        (self.signals.heard >> source & 1 == 1).then(|| self.signals.instants_ns[source])
    }

    /// A program by its name, and the age of what it sent last, s.
    pub(super) fn source(&self, name: &str) -> Option<(&'a SourceName, f64)> {
        let place = self.layout.sources.iter().position(|source| source.name == name)?;
        Some((&self.layout.sources[place], self.signals.ages_s[self.layout.devices.len() + place]))
    }
}

impl Default for Inputs<'_> {
    fn default() -> Self {
        Inputs { layout: &NO_LAYOUT, signals: &NONE }
    }
}

/// What stages tell other SubDevices in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Told {
    pub(crate) values: [f64; MAX_SIGNALS],
    pub(crate) is_told: u64,
}

impl Told {
    pub(crate) const NOTHING: Told = Told { values: [0.0; MAX_SIGNALS], is_told: 0 };
}

/// What goes out beside the drives, by name; it counts for the cycle in which it is set.
#[derive(Debug)]
pub struct Outputs<'a> {
    names: &'a [SignalName],
    told: &'a mut Told,
}

impl<'a> Outputs<'a> {
    pub(crate) fn new(layout: &'a SignalLayout, told: &'a mut Told) -> Self {
        Outputs { names: &layout.outputs, told }
    }

    /// Sets an output by its full name, as `valve.open`, in its unit; `false` where it isn't there, or the value is no
    /// number.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        let place = self.names.iter().position(|signal| signal.name == name);
        let Some(place) = place.filter(|place| *place < MAX_SIGNALS && value.is_finite()) else {
            return false;
        };
        self.told.values[place] = value;
        self.told.is_told |= 1 << place;
        true
    }
}
