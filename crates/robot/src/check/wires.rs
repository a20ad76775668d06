//! Drives that the simulated robot has wired wrongly, by their names.

use super::Check;
use crate::config::{ProblemKind, SimulationTable, nearest};

impl Check {
    pub(super) fn wires(&mut self, table: &SimulationTable, drives: &[&str]) {
        for (key, names) in [
            ("turned_drives", &table.turned_drives),
            ("turned_encoders", &table.turned_encoders),
            ("swapped_drives", &table.swapped_drives),
        ] {
            for name in names.iter().flatten().filter(|name| !drives.contains(&name.as_str())) {
                let near = nearest(name, drives.iter().copied());
                let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                let reason = format!("no drive has this name{near}");
                let problem = self.report(ProblemKind::UnknownName, &format!("simulation.{key}"), reason);
                (problem.value, problem.limit) = (Some(format!("\"{name}\"")), Some(drives.join(", ")));
            }
        }
        if let Some(names) = &table.swapped_drives
            && !matches!(&names[..], [one, other] if one != other)
        {
            let reason = "two drives change places";
            let problem = self.report(ProblemKind::WrongType, "simulation.swapped_drives", reason);
            (problem.value, problem.limit) = (Some(names.join(", ")), Some("two different names".into()));
        }
    }
}
