//! `diagnostics`: bus, drives, slip, timing, and the bridge itself.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::messages::{Byte, DiagnosticStatus, KeyValue};

/// `diagnostic_msgs/msg/DiagnosticStatus`.
const OK: Byte = Byte(0);
const WARN: Byte = Byte(1);
const ERROR: Byte = Byte(2);

/// Slip above this is told, m/s.
const SLIPS: f64 = 0.02;
/// Counts of the bus that shall not grow.
const BUS: [&str; 6] =
    ["frames_lost", "working_counter_errors", "losses", "crc_errors", "link_losses", "silences"];

/// What the bridge adds of itself.
pub struct OfBridge {
    /// Publishers of `cmd_vel`.
    pub publishers: usize,
    /// What stands against them, in words.
    pub objection: Option<String>,
    /// Cycles that never came here.
    pub missing: u64,
    /// Messages that DDS didn't take.
    pub unsent: u64,
}

/// What was counted when it was last told.
#[derive(Default)]
pub struct Diagnostics {
    before: BTreeMap<&'static str, f64>,
    overruns: u64,
}

impl Diagnostics {
    /// All of it, from what the robot says of itself with the names of its values and wheels.
    pub fn of(
        &mut self,
        status: &Value,
        columns: &[String],
        wheels: &[String],
        bridge: &OfBridge,
    ) -> Vec<DiagnosticStatus> {
        let value = |name: &str| {
            let at = columns.iter().position(|known| known == name);
            at.and_then(|at| status["values"][at].as_f64()).unwrap_or(f64::NAN)
        };
        let mut all = vec![state(status), self.bus(&value)];
        all.extend(wheels.iter().zip(status["drives"].as_array().into_iter().flatten()).map(
            |(wheel, drive)| {
                let (is, error) = (
                    drive["state"].as_str().unwrap_or_default(),
                    drive["error"].as_str().unwrap_or_default(),
                );
                let level = match is {
                    "running" | "idle" | "under way" | "switching mode" => OK,
                    _ => ERROR,
                };
                let message = if error.is_empty() { is.to_owned() } else { format!("{is}: {error}") };
                let torque = value(&format!("{wheel}/torque_nm"));
                told(level, &format!("drive {wheel}"), message, &[("torque_nm", torque.to_string())])
            },
        ));
        all.push(slip(wheels, &value));
        all.push(self.timing(status));
        all.push(of_bridge(bridge));
        all
    }

    fn bus(&mut self, value: &dyn Fn(&str) -> f64) -> DiagnosticStatus {
        let counts = BUS.map(|name| (name, value(&format!("bus/{name}"))));
        let grown: Vec<_> = counts
            .iter()
            .filter(|(name, count)| self.before.get(name).is_some_and(|before| count > before))
            .collect();
        let away = value("bus/not_operational");
        let (level, message) = match (away > 0.0, grown.first()) {
            (true, _) => (ERROR, format!("{away} SubDevices aren't well")),
            (false, Some((name, count))) => (WARN, format!("{name}: {count}")),
            (false, None) => (OK, "as it should be".to_owned()),
        };
        self.before.extend(counts);
        let values: Vec<_> = counts.iter().map(|(name, count)| (*name, count.to_string())).collect();
        told(level, "bus", message, &values)
    }

    fn timing(&mut self, status: &Value) -> DiagnosticStatus {
        let count = |n: usize| status["counts"][n].as_u64().unwrap_or(0);
        let overruns = count(2);
        let level = if overruns > self.overruns { WARN } else { OK };
        self.overruns = overruns;
        let message = if level == OK {
            "in time".to_owned()
        } else {
            format!("{overruns} cycles were left out so far")
        };
        let of_timing = status["timing"].as_object().into_iter().flatten();
        let counts = [("cycles", count(0).to_string()), ("left_out", overruns.to_string())];
        let mut told = told(level, "timing", message, &counts);
        told.values
            .extend(of_timing.map(|(key, value)| KeyValue { key: key.clone(), value: value.to_string() }));
        told
    }
}

fn state(status: &Value) -> DiagnosticStatus {
    let text = |key: &str| status[key].as_str().unwrap_or_default().to_owned();
    let (phase, reason) = (text("phase"), text("stop_reason"));
    let level = match (phase.as_str(), status["emergency_stop"] == true) {
        ("fault", _) => ERROR,
        (_, true) => WARN,
        _ => OK,
    };
    let known = status["pose_known"].to_string();
    let values = [("commander", text("commander")), ("last_stop", reason), ("pose_known", known)];
    told(level, "state", phase, &values)
}

fn slip(wheels: &[String], value: &dyn Fn(&str) -> f64) -> DiagnosticStatus {
    let slips = wheels.iter().map(|wheel| (wheel, value(&format!("{wheel}/slip_m_s")).abs()));
    let worst = slips.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, slip)| *slip > SLIPS);
    let (level, message) = match worst {
        Some((wheel, slip)) => (WARN, format!("{wheel} slips by {slip:.3} m/s")),
        None => (OK, "every wheel grips".to_owned()),
    };
    let of = |name: &str| value(name).to_string();
    let values = [
        ("residual_m_s", of("state/slip_residual_m_s")),
        ("floor_friction", of("estimate/floor_friction")),
        ("traction_share", of("traction/share")),
    ];
    told(level, "slip", message, &values)
}

fn of_bridge(bridge: &OfBridge) -> DiagnosticStatus {
    let (level, message) = match &bridge.objection {
        Some(words) => (ERROR, words.clone()),
        None => (OK, "as it should be".to_owned()),
    };
    let values = [
        ("cmd_vel_publishers", bridge.publishers.to_string()),
        ("missing_cycles", bridge.missing.to_string()),
        ("unsent_messages", bridge.unsent.to_string()),
    ];
    told(level, "bridge", message, &values)
}

fn told(level: Byte, name: &str, message: String, values: &[(&str, String)]) -> DiagnosticStatus {
    let values = values.iter().map(|(key, value)| KeyValue { key: (*key).to_owned(), value: value.clone() });
    DiagnosticStatus {
        level,
        name: name.to_owned(),
        message,
        hardware_id: String::new(),
        values: values.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_a_person_must_know_has_its_level() {
        let columns: Vec<String> =
            ["bus/frames_lost", "bus/not_operational", "left/slip_m_s"].map(String::from).into();
        let wheels = vec!["left".to_owned()];
        let mut diagnostics = Diagnostics::default();
        let mut bridge = OfBridge { publishers: 1, objection: None, missing: 0, unsent: 0 };
        let status = |lost: f64, away: f64, slip: f64, state: &str, overruns: u64| {
            json!({
                "phase": "holding", "stop_reason": "", "commander": "nobody", "emergency_stop": false,
                "values": [lost, away, slip], "drives": [{ "state": state, "error": "" }],
                "counts": [100, 0, overruns], "timing": { "worst_us": 12.5 },
            })
        };
        let mut levels = |status: &Value, bridge: &OfBridge| -> Vec<(String, u8)> {
            let all = diagnostics.of(status, &columns, &wheels, bridge);
            all.into_iter().map(|one| (one.name, one.level.0)).collect()
        };
        let names = ["state", "bus", "drive left", "slip", "timing", "bridge"];
        let expected = |levels: [u8; 6]| -> Vec<(String, u8)> {
            names.map(String::from).into_iter().zip(levels).collect()
        };
        assert_eq!(levels(&status(3.0, 0.0, 0.0, "running", 0), &bridge), expected([0; 6]));
        assert_eq!(levels(&status(4.0, 0.0, 0.0, "running", 2), &bridge), expected([0, 1, 0, 0, 1, 0]));
        assert_eq!(levels(&status(4.0, 0.0, 0.0, "running", 2), &bridge), expected([0; 6]));
        bridge.objection = Some("two publish it".into());
        assert_eq!(levels(&status(4.0, 1.0, -0.1, "lost", 2), &bridge), expected([0, 2, 2, 1, 0, 2]));
    }
}
