//! The tables `run` and `recording` against themselves; interfaces, devices and folders are looked for when a run begins.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use super::Check;
use crate::config::{
    BridgeTable, ProblemKind, RecordingPlan, RecordingTable, RunTable, Switch, TIME_IN_NAME,
};

impl Check {
    pub(super) fn run(&mut self, table: &RunTable) {
        let texts = [
            ("interface", table.interface.as_deref()),
            ("redundant", table.redundant.as_deref()),
            ("token_file", table.token_file.as_deref()),
            ("paths", table.paths.as_deref()),
            ("joystick", text_of(table.joystick.as_ref())),
        ];
        for (key, _) in texts.iter().filter(|(_, text)| text.is_some_and(str::is_empty)) {
            let problem =
                self.report(ProblemKind::OutOfRange, &format!("run.{key}"), "there is nothing of this name");
            (problem.value, problem.limit) = (Some("\"\"".into()), Some("a name, or no such key".into()));
        }
        if table.interface.is_none() {
            for (key, is_given) in [("redundant", table.redundant.is_some()), ("cpu", table.cpu.is_some())] {
                if is_given {
                    let reason = "it is for drives at an interface, and none is given";
                    self.report(ProblemKind::Contradiction, &format!("run.{key}"), reason).limit =
                        Some("run.interface beside it".into());
                }
            }
        }
        if let (Some(interface), Some(redundant)) = (&table.interface, &table.redundant)
            && interface == redundant
        {
            let reason = "a ring has two ends, at two interfaces";
            let problem = self.report(ProblemKind::Contradiction, "run.redundant", reason);
            problem.value = Some(format!("\"{redundant}\""));
            problem.limit = Some("another interface than run.interface".into());
        }
        if let Some(address) = text_of(table.dashboard.as_ref())
            && address.parse::<SocketAddr>().is_err()
        {
            let problem = self.report(ProblemKind::OutOfRange, "run.dashboard", "this is no address");
            problem.value = Some(format!("\"{address}\""));
            problem.limit = Some("true, false, or an address and a port, as \"127.0.0.1:8400\"".into());
        }
        let is_served = table.dashboard.as_ref().is_some_and(|switch| switch.is_on().is_some());
        if table.token_file.is_some() && !is_served {
            let reason = "nobody asks for a token where no page is served";
            self.report(ProblemKind::Contradiction, "run.token_file", reason).limit =
                Some("run.dashboard beside it".into());
        }
    }

    pub(super) fn bridges(&mut self, bridges: &BTreeMap<String, BridgeTable>) {
        for (name, bridge) in bridges {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if name.is_empty() || !name.chars().all(is_plain) {
                let reason = "a program has to be found by it";
                let problem = self.report(ProblemKind::OutOfRange, &format!("bridge.{name}"), reason);
                problem.value = Some(format!("\"{name}\""));
                problem.limit = Some("letters, digits, `-` and `_`".into());
            }
            if bridge.program.as_deref() == Some("") {
                let setting = format!("bridge.{name}.program");
                let problem = self.report(ProblemKind::OutOfRange, &setting, "there is nothing of this name");
                (problem.value, problem.limit) = (Some("\"\"".into()), Some("a name, or no such key".into()));
            }
        }
    }

    pub(super) fn recording(
        &mut self,
        table: &RecordingTable,
        cycle_us: Option<u32>,
    ) -> Option<RecordingPlan> {
        if *table == RecordingTable::default() {
            return None;
        }
        let every_ns = self.every_ns(table, cycle_us);
        for (index, pattern) in table.signals.iter().flatten().enumerate() {
            if pattern.is_empty() {
                let setting = format!("recording.signals[{index}]");
                let problem = self.report(ProblemKind::OutOfRange, &setting, "no signal has this name");
                (problem.value, problem.limit) = (Some("\"\"".into()), Some("as \"state.*\"".into()));
            }
        }
        if table.signals.as_ref().is_some_and(Vec::is_empty) {
            let problem =
                self.report(ProblemKind::OutOfRange, "recording.signals", "nothing would be recorded");
            (problem.value, problem.limit) =
                (Some("[]".into()), Some("one signal or more, or no such key".into()));
        }
        if table.files.is_some() {
            let why = "without it there is one file, and nothing to keep some of";
            self.need(table.limit_mb, "recording.limit_mb", why);
        }
        let file = self.need(table.file.as_deref(), "recording.file", "the recording has to be somewhere")?;
        let name = file.rsplit('/').next().unwrap_or(file);
        let rest = file.replacen(TIME_IN_NAME, "", 1);
        if name.is_empty() || rest.contains(['{', '}']) || rest.contains('\0') {
            let problem = self.report(ProblemKind::OutOfRange, "recording.file", "this is no file's name");
            problem.value = Some(format!("{file:?}"));
            problem.limit = Some(format!("a file, with {TIME_IN_NAME} once at most and no other braces"));
        }
        Some(RecordingPlan {
            file: file.to_owned(),
            signals: table.signals.clone().unwrap_or_default(),
            every_ns,
            format: table.format.unwrap_or_default(),
            limit_bytes: table.limit_mb.map(|mb| u64::from(mb) * 1_000_000),
            files: table.files,
        })
    }

    /// Time from one recorded cycle to the next; `None`: every cycle.
    fn every_ns(&mut self, table: &RecordingTable, cycle_us: Option<u32>) -> Option<u64> {
        let cycle_ns = u64::from(cycle_us?) * 1000;
        if table.every_ms.is_some() && table.every_cycles.is_some() {
            let reason = "give `every_ms` or `every_cycles`, not both";
            self.report(ProblemKind::Contradiction, "recording.every_cycles", reason);
        }
        let every_ns = match (table.every_ms, table.every_cycles) {
            (Some(ms), _) => {
                let every_ns = (ms * 1e6).round() as u64;
                if every_ns < cycle_ns || !every_ns.is_multiple_of(cycle_ns) {
                    let cycle_ms = cycle_ns as f64 / 1e6;
                    let below = (every_ns / cycle_ns).max(1);
                    let reason = "it isn't a whole multiple of the cycle";
                    let problem = self.report(ProblemKind::OutOfRange, "recording.every_ms", reason);
                    problem.value = Some(ms.to_string());
                    problem.limit =
                        Some(format!("{} or {}", below as f64 * cycle_ms, (below + 1) as f64 * cycle_ms));
                }
                every_ns
            }
            (None, Some(cycles)) => u64::from(cycles) * cycle_ns,
            (None, None) => return None,
        };
        (every_ns > cycle_ns).then_some(every_ns)
    }
}

fn text_of(switch: Option<&Switch>) -> Option<&str> {
    switch?.is_on().flatten()
}
