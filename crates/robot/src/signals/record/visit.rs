//! One channel after the other, by its name and unit: how a record is named, written and read.

use std::fmt::Debug;

use omnibase_cia402::{ErrorCode, StatusWord};
use omnibase_platform::{Pose2, Regime, Twist2};

use super::super::{
    DriveMeasurement, DriveProgress, FusionReport, MAX_DEVICE_BYTES, MAX_WHEELS, ReferenceStatus, Setpoint,
    SignalLayout, SignalName, SignalShape, Signals, verdict_code, verdict_from_code,
};
use super::{PROCESS_WORDS, ProcessBytes};

pub(super) enum Slot<'a> {
    F64(&'a mut f64),
    U64(&'a mut u64),
    /// The code of a choice, and what each code is called.
    Code(&'a mut u64, NameOf<'a>),
}

/// The choice that has a code, as `Debug` writes it.
pub(super) type NameOf<'a> = &'a dyn Fn(u64) -> Option<String>;

/// A channel's name, of three parts; who doesn't ask for its text pays nothing for it.
#[derive(Clone, Copy)]
pub(super) struct Name<'a>([&'a str; 3]);

impl std::fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|part| f.write_str(part))
    }
}

pub(super) struct Visit<'a, V> {
    /// What stands before the names of channels.
    pub(super) prefix: [&'a str; 2],
    pub(super) visitor: V,
}

impl<'a, V: FnMut(Name<'_>, &str, Slot<'_>)> Visit<'a, V> {
    fn slot(&mut self, name: &str, unit: &str, slot: Slot<'_>) {
        let [first, second] = self.prefix;
        (self.visitor)(Name([first, second, name]), unit, slot);
    }

    pub(super) fn f64(&mut self, name: &str, unit: &str, value: &mut f64) {
        self.slot(name, unit, Slot::F64(value));
    }

    /// A number that may be missing: NaN in a recording.
    pub(super) fn option(&mut self, name: &str, unit: &'static str, value: &mut Option<f64>) {
        let mut number = value.unwrap_or(f64::NAN);
        self.f64(name, unit, &mut number);
        *value = Some(number).filter(|number| !number.is_nan());
    }

    pub(super) fn u64(&mut self, name: &str, unit: &str, value: &mut u64) {
        self.slot(name, unit, Slot::U64(value));
    }

    pub(super) fn code<T: Copy + Debug + Default>(
        &mut self,
        name: &str,
        value: &mut T,
        to: fn(T) -> u64,
        from: fn(u64) -> Option<T>,
    ) {
        let mut code = to(*value);
        self.named(name, &mut code, &|code| from(code).map(|choice| format!("{choice:?}")));
        *value = from(code).unwrap_or_default();
    }

    pub(super) fn named(&mut self, name: &str, code: &mut u64, name_of: NameOf<'_>) {
        self.slot(name, "", Slot::Code(code, name_of));
    }

    pub(super) fn pose(&mut self, name: &'a str, pose: &mut Pose2) {
        self.prefix = [name, ""];
        self.f64(".x", "m", &mut pose.x_m);
        self.f64(".y", "m", &mut pose.y_m);
        self.f64(".heading", "rad", &mut pose.heading_rad);
        self.prefix = [""; 2];
    }

    pub(super) fn twist(&mut self, name: &'a str, units: [&'static str; 3], twist: &mut Twist2) {
        self.prefix = [name, ""];
        self.f64(".x", units[0], &mut twist.vx_m_s);
        self.f64(".y", units[1], &mut twist.vy_m_s);
        self.f64(".heading", units[2], &mut twist.w_rad_s);
        self.prefix = [""; 2];
    }

    pub(super) fn setpoint(&mut self, names: [&'a str; 4], setpoint: &mut Setpoint) {
        self.pose(names[0], &mut setpoint.odom_from_body);
        self.twist(names[1], ["m/s", "m/s", "rad/s"], &mut setpoint.twist_in_odom);
        self.twist(names[2], ["m/s²", "m/s²", "rad/s²"], &mut setpoint.acceleration_in_odom);
        self.code(names[3], &mut setpoint.status, ReferenceStatus::code, ReferenceStatus::from_code);
    }

    pub(super) fn drive(&mut self, drive: &mut DriveMeasurement) {
        let mut counts = f64::from(drive.position_counts);
        self.f64("position", "counts", &mut counts);
        drive.position_counts = counts as i32;
        self.f64("increment", "rad", &mut drive.increment_rad);
        self.f64("speed", "rad/s", &mut drive.speed_rad_s);
        self.f64("torque", "N·m", &mut drive.torque_nm);
        let mut status = u64::from(drive.status.0);
        self.u64("status_word", "", &mut status);
        drive.status = StatusWord(status as u16);
        let mut mode = f64::from(drive.mode_code);
        self.f64("mode", "", &mut mode);
        drive.mode_code = mode as i8;
        let mut error = u64::from(drive.error.0);
        self.u64("error", "", &mut error);
        drive.error = ErrorCode(error as u16);
        self.code("progress", &mut drive.progress, DriveProgress::code, DriveProgress::from_code);
    }

    /// What sensors tell of the platform's place.
    pub(super) fn fusion(&mut self, names: &'a [String], fusion: &mut FusionReport, sensors: usize) {
        self.pose("map.pose", &mut fusion.map_from_body);
        let covariance =
            ["xx", "xy", "xh", "yy", "yh", "hh"].iter().zip(["m²", "m²", "m·rad", "m²", "m·rad", "rad²"]);
        self.prefix = ["map.covariance_", ""];
        for ((name, unit), value) in covariance.zip(&mut fusion.covariance) {
            self.f64(name, unit, value);
        }
        self.prefix = ["map.", ""];
        let mut placed = u64::from(fusion.is_placed);
        self.u64("placed", "", &mut placed);
        fusion.is_placed = placed != 0;
        for (n, sensor) in fusion.sensors.iter_mut().enumerate().take(sensors) {
            self.prefix = ["sensor.", names.get(n).map_or("", String::as_str)];
            self.code(".verdict", &mut sensor.verdict, verdict_code, verdict_from_code);
            self.f64(".nis", "", &mut sensor.nis);
        }
        self.prefix = [""; 2];
    }

    /// Nothing for a robot without them.
    pub(super) fn signals(&mut self, names: &'a SignalLayout, signals: &mut Signals) {
        let SignalShape { devices, sources, inputs, outputs, input_bytes, output_bytes, .. } = signals.shape;
        if devices + sources == 0 {
            return;
        }
        self.prefix = ["device.", ""];
        self.u64("believed", "", &mut signals.believed);
        for (part, bytes, length) in [
            ("input_", &mut signals.input_bytes, input_bytes),
            ("output_", &mut signals.output_bytes, output_bytes),
        ] {
            self.prefix = ["device.", part];
            for (number, bytes) in DEVICE_WORDS.iter().zip(bytes.chunks_exact_mut(8)).take(length.div_ceil(8))
            {
                self.word(number, bytes);
            }
        }
        if sources > 0 {
            self.prefix = ["source.", ""];
            self.u64("heard", "", &mut signals.heard);
            self.u64("zeroed", "", &mut signals.zeroed);
            self.u64("raised", "", &mut signals.raised);
        }
        let named = names.devices.iter().chain(names.sources.iter().map(|source| &source.name));
        let mut named = named.map(String::as_str).chain(std::iter::repeat(""));
        for age_s in signals.ages_s.iter_mut().take(devices + sources) {
            self.prefix = [named.next().unwrap_or_default(), ""];
            self.f64(".age", "s", age_s);
        }
        for (n, instant_ns) in signals.instants_ns.iter_mut().take(sources).enumerate() {
            self.prefix = [names.sources.get(n).map_or("", |source| source.name.as_str()), ""];
            self.u64(".instant", "ns", instant_ns);
        }
        self.prefix = [""; 2];
        for (names, values, count) in
            [(&names.inputs, &mut signals.inputs, inputs), (&names.outputs, &mut signals.outputs, outputs)]
        {
            for (n, value) in values.iter_mut().take(count).enumerate() {
                let SignalName { name, unit } = names.get(n).unwrap_or(&NAMELESS);
                self.f64(name, unit, value);
            }
        }
    }

    pub(super) fn bytes(&mut self, names: &[&str; PROCESS_WORDS], bytes: &mut ProcessBytes) {
        for (name, bytes) in names.iter().zip(bytes.0.chunks_exact_mut(8)) {
            self.word(name, bytes);
        }
    }

    /// Eight bytes as one number.
    fn word(&mut self, name: &str, bytes: &mut [u8]) {
        let mut word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
        self.u64(name, "", &mut word);
        bytes.copy_from_slice(&word.to_le_bytes());
    }
}

pub(super) const WHEELS: [&str; MAX_WHEELS] =
    ["wheel_1.", "wheel_2.", "wheel_3.", "wheel_4.", "wheel_5.", "wheel_6.", "wheel_7.", "wheel_8."];
const DEVICE_WORDS: [&str; MAX_DEVICE_BYTES / 8] =
    ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15"];
static NAMELESS: SignalName = SignalName { name: String::new(), unit: String::new() };

pub(super) const INPUTS: [&str; PROCESS_WORDS] =
    ["input_0", "input_1", "input_2", "input_3", "input_4", "input_5", "input_6", "input_7"];
pub(super) const OUTPUTS: [&str; PROCESS_WORDS] =
    ["output_0", "output_1", "output_2", "output_3", "output_4", "output_5", "output_6", "output_7"];

const REGIMES: [Regime; 5] =
    [Regime::Standstill, Regime::Translation, Regime::Rotation, Regime::Tangent, Regime::Other];

pub(super) fn regime_code(regime: Regime) -> u64 {
    match regime {
        Regime::Standstill => 0,
        Regime::Translation => 1,
        Regime::Rotation => 2,
        Regime::Tangent => 3,
        Regime::Other => 4,
    }
}

pub(super) fn regime_from_code(code: u64) -> Option<Regime> {
    REGIMES.into_iter().find(|regime| regime_code(*regime) == code)
}
