//! Finds what the report shows among the columns of a run.

use crate::run::RecordedRun;

/// Ends of names that are units, what their numbers are multiplied by to be in SI units, and those. Longer ones first.
const UNITS: [(&str, f64, &str); 19] = [
    ("_kg_m2", 1.0, "kg·m²"),
    ("_rad_s2", 1.0, "rad/s²"),
    ("_m_s2", 1.0, "m/s²"),
    ("_rad2", 1.0, "rad²"),
    ("_rad_s", 1.0, "rad/s"),
    ("_m_s", 1.0, "m/s"),
    ("_m2", 1.0, "m²"),
    ("_mrad", 1e-3, "rad"),
    ("_rad", 1.0, "rad"),
    ("_mm", 1e-3, "m"),
    ("_n_m", 1.0, "N·m"),
    ("_nm", 1.0, "N·m"),
    ("_kg", 1.0, "kg"),
    ("_ns", 1e-9, "s"),
    ("_us", 1e-6, "s"),
    ("_ms", 1e-3, "s"),
    ("_s", 1.0, "s"),
    ("_m", 1.0, "m"),
    ("_v", 1.0, "V"),
];

/// Nothing that a robot measures; squares of what is larger would not be finite.
const NONSENSE: f64 = 1e150;

/// A name with letters, digits and single underscores only: `/state` and `pose.x` become `state_pose_x`.
fn plain(topic: &str, signal: &str) -> String {
    let mut name = String::new();
    for character in topic.chars().chain(['_']).chain(signal.chars()) {
        if character.is_alphanumeric() {
            name.extend(character.to_lowercase());
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    name.trim_end_matches('_').to_owned()
}

/// The factor to SI units where `name` is `wanted`, with or without a unit behind it.
fn factor(name: &str, wanted: &str) -> Option<f64> {
    let rest = name.strip_prefix(wanted)?;
    if rest.is_empty() {
        return Some(1.0);
    }
    UNITS.iter().find(|(unit, ..)| *unit == rest).map(|(_, factor, _)| *factor)
}

/// Beginnings of the names of all signals that are shown, beside those of wheels.
const SHOWN: [&str; 22] = [
    "bus_dc_phase",
    "cycle_phase",
    "cycle_period",
    "exchange_result",
    "state_pose",
    "state_twist_in_body",
    "state_slip_residual",
    "reference_correction",
    "wished_pose",
    "wished_twist",
    "setpoint_pose",
    "setpoint_twist",
    "truth",
    "sensor_",
    "map_pose",
    "map_covariance",
    "estimate_mass",
    "estimate_inertia",
    "command_saturation",
    "allowed_saturation",
    "allowed_action",
    "timing",
];

/// Whether a topic with such signals stands beside the drives: only what may not be heard has an age.
fn is_beside<'a>(mut signals: impl Iterator<Item = &'a str>) -> bool {
    signals.any(|signal| factor(&plain("", signal), "age").is_some())
}

/// Whether a report needs the signal of a topic that has these.
pub(super) fn is_shown(topic: &str, signal: &str, of_topic: &[String]) -> bool {
    if is_beside(of_topic.iter().map(String::as_str)) {
        return true;
    }
    let name = plain(topic, signal);
    let own = plain("", signal);
    SHOWN.iter().any(|shown| name.starts_with(shown))
        || ["speed", "torque"].iter().any(|wanted| factor(&own, wanted).is_some())
}

/// A run by the names of its signals.
pub(super) struct Signals<'a> {
    run: &'a RecordedRun,
    names: Vec<String>,
    /// Time of each row since the first, s; it never runs backwards.
    pub(super) times_s: Vec<f64>,
}

/// What is known of one wheel.
pub(super) struct WheelSignals {
    /// Its name.
    pub(super) name: String,
    /// rad/s.
    pub(super) speed: Option<Vec<f64>>,
    /// N·m.
    pub(super) torque: Option<Vec<f64>>,
}

/// One value of what stands beside the drives.
pub(super) struct ValueBeside {
    /// Its name, without a unit.
    pub(super) name: String,
    /// Of its values.
    pub(super) unit: Option<&'static str>,
    /// In SI units; not a number where it wasn't known.
    pub(super) values: Vec<f64>,
}

impl ValueBeside {
    /// Whether it is never anything but 0 and 1, and no code of something else.
    pub(super) fn is_on_or_off(&self) -> bool {
        let is_code = matches!(self.name.as_str(), "state" | "mode");
        !is_code
            && self.unit.is_none()
            && self.values.iter().all(|value| !value.is_finite() || *value == 0.0 || *value == 1.0)
    }
}

/// A pose in each cycle.
pub(super) struct Poses {
    /// m.
    pub(super) x: Vec<f64>,
    /// m.
    pub(super) y: Vec<f64>,
    /// rad.
    pub(super) heading: Vec<f64>,
}

impl<'a> Signals<'a> {
    pub(super) fn new(run: &'a RecordedRun) -> Self {
        let topics = run.schema.topics.iter();
        let names = topics
            .flat_map(|topic| topic.signals.iter().map(|signal| plain(&topic.name, &signal.name)))
            .collect();
        // A run of no signals has rows all the same; they count as far as they are there.
        let width = run.schema.width().max(1);
        let rows = run.times_ns.len().min(run.values.len() / width);
        let first = run.times_ns.first().copied().unwrap_or(0);
        let mut last = 0;
        let since = |time: &u64| {
            last = time.saturating_sub(first).max(last);
            last as f64 * 1e-9
        };
        let times_s = run.times_ns[..rows].iter().map(since).collect();
        Signals { run, names, times_s }
    }

    /// The run itself.
    pub(super) fn run(&self) -> &'a RecordedRun {
        self.run
    }

    /// The values, in SI units, of the first of `wanted` that the run has.
    pub(super) fn column(&self, wanted: &[&str]) -> Option<Vec<f64>> {
        let found = wanted.iter().find_map(|wanted| {
            let named = self.names.iter().enumerate();
            named.filter_map(|(at, name)| Some((at, factor(name, wanted)?))).next()
        });
        found.map(|(at, factor)| self.values(at, factor))
    }

    /// The values of all signals whose names begin and end so, with what stands between.
    pub(super) fn named(&self, begin: &str, end: &str) -> Vec<(String, Vec<f64>)> {
        let found = self.names.iter().enumerate().filter_map(|(at, name)| {
            let between = name.strip_prefix(begin)?.strip_suffix(end)?;
            Some((between.to_owned(), self.values(at, 1.0)))
        });
        found.collect()
    }

    fn values(&self, column: usize, factor: f64) -> Vec<f64> {
        let rows = self.run.values.chunks_exact(self.run.schema.width());
        let value = |row: &[f64]| Some(row[column] * factor).filter(|value| value.abs() < NONSENSE);
        rows.take(self.times_s.len()).map(|row| value(row).unwrap_or(f64::NAN)).collect()
    }

    /// x, y and heading behind the first of `prefixes` that has all three.
    fn triple(&self, prefixes: &[&str]) -> Option<[Vec<f64>; 3]> {
        prefixes.iter().find_map(|prefix| {
            let axis = |ends: [&str; 2]| {
                let names = ends.map(|end| format!("{prefix}_{end}"));
                self.column(&[&names[0], &names[1]])
            };
            Some([axis(["x", "vx"])?, axis(["y", "vy"])?, axis(["heading", "w"])?])
        })
    }

    /// The poses behind the first of `prefixes` that the run has.
    pub(super) fn poses(&self, prefixes: &[&str]) -> Option<Poses> {
        self.triple(prefixes).map(|[x, y, heading]| Poses { x, y, heading })
    }

    /// The twists behind the first of `prefixes` that the run has: along x and y, m/s, and rad/s.
    pub(super) fn twists(&self, prefixes: &[&str]) -> Option<[Vec<f64>; 3]> {
        self.triple(prefixes)
    }

    /// Topics that are a wheel's: those with a speed and a torque, or named `wheel` with one of them.
    pub(super) fn wheels(&self) -> Vec<WheelSignals> {
        let given: Vec<_> = self.text("wheel_names").unwrap_or_default().split_whitespace().collect();
        let mut wheels = Vec::new();
        let mut at = 0;
        for topic in &self.run.schema.topics {
            let find = |wanted: &str| {
                let signals = topic.signals.iter().enumerate();
                let mut matching =
                    signals.filter_map(|(n, s)| Some((at + n, factor(&plain("", &s.name), wanted)?)));
                matching.next()
            };
            let (speed, torque) = (find("speed"), find("torque"));
            let name = topic.name.trim_matches('/');
            let is_named = name.to_lowercase().starts_with("wheel") && (speed.is_some() || torque.is_some());
            if is_named || (speed.is_some() && torque.is_some()) {
                let values = |found: Option<(usize, f64)>| found.map(|(at, factor)| self.values(at, factor));
                let name = given.get(wheels.len()).map_or(name, |given| given).to_owned();
                wheels.push(WheelSignals { name, speed: values(speed), torque: values(torque) });
            }
            at += topic.signals.len();
        }
        wheels
    }

    /// Devices without a wheel and other programs, each with its values.
    pub(super) fn beside(&self) -> Vec<(String, Vec<ValueBeside>)> {
        let mut found = Vec::new();
        let mut at = 0;
        for topic in &self.run.schema.topics {
            let names = topic.signals.iter().map(|signal| signal.name.as_str());
            if is_beside(names.clone()) {
                let values = names.enumerate().filter_map(|(place, name)| {
                    let name = plain("", name);
                    let unit = UNITS.iter().find(|(unit, ..)| name.ends_with(unit));
                    let (name, factor) = unit.map_or((&*name, 1.0), |(unit, factor, _)| {
                        (&name[..name.len() - unit.len()], *factor)
                    });
                    let values = || self.values(at + place, factor);
                    let is_of_the_line = matches!(name, "age" | "instant");
                    (!is_of_the_line).then(|| ValueBeside {
                        name: name.to_owned(),
                        unit: unit.map(|(.., unit)| *unit),
                        values: values(),
                    })
                });
                found.push((topic.name.trim_matches('/').to_owned(), values.collect()));
            }
            at += topic.signals.len();
        }
        found
    }

    /// What the description says under `key`; nothing where it says nothing.
    pub(super) fn text(&self, key: &str) -> Option<&'a str> {
        self.run.description.get(key).map(|text| text.trim()).filter(|text| !text.is_empty())
    }

    /// The finite number that the description has under `key`.
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.text(key)?.parse().ok().filter(|number: &f64| number.is_finite())
    }

    /// The tuples of numbers that the description has under `key`: `x y; x y`.
    pub(super) fn tuples<const N: usize>(&self, key: &str) -> Vec<[f64; N]> {
        tuples(self.text(key).unwrap_or_default())
    }

    /// Lists of such tuples: `x y; x y | x y; x y`.
    pub(super) fn lists<const N: usize>(&self, key: &str) -> Vec<Vec<[f64; N]>> {
        self.text(key).unwrap_or_default().split('|').map(tuples).collect()
    }
}

fn tuples<const N: usize>(text: &str) -> Vec<[f64; N]> {
    let tuples = text.split(';').map(|tuple| {
        let numbers = tuple.split_whitespace().map(|word| word.parse().ok().filter(|n: &f64| n.is_finite()));
        numbers.collect::<Option<Vec<f64>>>().and_then(|numbers| numbers.try_into().ok())
    });
    tuples.collect::<Option<Vec<_>>>().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_however_they_are_written() {
        assert_eq!(plain("/state", "pose.x"), "state_pose_x");
        assert_eq!(plain("/state/", "pose_x_m"), "state_pose_x_m");
        assert_eq!(plain("", "/phase"), "phase");
        assert_eq!(factor("state_pose_x_m", "state_pose_x"), Some(1.0));
        assert_eq!(factor("timing_round_trip_ns", "timing_round_trip"), Some(1e-9));
        assert_eq!(factor("state_pose_xx", "state_pose_x"), None);
        assert_eq!(factor("wheel_1_speed_command", "wheel_1_speed"), None);
    }
}
