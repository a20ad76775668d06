//! Which signals of a run are recorded or exported, and how often.

use super::{RunSchema, Topic};

/// The key under which a recording says what of its run it holds, where that isn't everything.
pub const SELECTION: &str = "selection";

/// Which signals, and how often; by default all of them, in every cycle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Selection {
    /// Names as `state.pose_x_m`, where `*` stands for any characters; empty: all.
    pub signals: Vec<String>,
    /// Time from row to row, ns; `None`: every cycle.
    pub every_ns: Option<u64>,
}

impl Selection {
    /// Places of the chosen signals in a row, in the row's order.
    pub fn columns(&self, schema: &RunSchema) -> Vec<usize> {
        let names = schema.names().enumerate();
        names.filter(|(_, name)| self.holds_name(name)).map(|(place, _)| place).collect()
    }

    /// Whether a signal of a topic is chosen.
    pub(super) fn holds(&self, topic: &str, signal: &str) -> bool {
        self.holds_name(&full_name(topic, signal))
    }

    fn holds_name(&self, name: &str) -> bool {
        self.signals.is_empty() || self.signals.iter().any(|pattern| fits(pattern, name))
    }

    /// In words, what is left of a run; `None` where nothing is left out.
    pub fn words(&self, schema: &RunSchema) -> Option<String> {
        let count = self.columns(schema).len();
        if count == schema.width() && self.every_ns.is_none() {
            return None;
        }
        let every = match self.every_ns {
            None => "in every cycle".to_owned(),
            Some(ns) => format!("every {} ms", ns as f64 / 1e6),
        };
        Some(format!("{count} of {} signals, {every}", schema.width()))
    }
}

/// Picks the rows that are due.
#[derive(Clone, Copy, Debug)]
pub struct Due {
    every_ns: Option<u64>,
    next_ns: u64,
}

impl Due {
    /// Rows of a selection; the first one is due.
    pub fn new(selection: &Selection) -> Self {
        Due { every_ns: selection.every_ns.filter(|ns| *ns > 0), next_ns: 0 }
    }

    /// Whether the row of that time is due: the first one at or behind each multiple of the time between rows.
    pub fn take(&mut self, time_ns: u64) -> bool {
        let Some(every_ns) = self.every_ns else { return true };
        if time_ns < self.next_ns {
            return false;
        }
        self.next_ns = (time_ns / every_ns + 1).saturating_mul(every_ns);
        true
    }
}

impl RunSchema {
    /// Names of all signals in a row's order, as `state.pose_x_m`.
    pub fn names(&self) -> impl Iterator<Item = String> + '_ {
        self.topics
            .iter()
            .flat_map(|topic| topic.signals.iter().map(|signal| full_name(&topic.name, &signal.name)))
    }

    /// The signals at these places of a row, which rise.
    pub fn only(&self, columns: &[usize]) -> RunSchema {
        let (mut schema, mut place) = (RunSchema::default(), 0);
        for topic in &self.topics {
            let here = place..place + topic.signals.len();
            let chosen = columns.iter().filter(|column| here.contains(column));
            let signals: Vec<_> = chosen.map(|column| topic.signals[column - here.start].clone()).collect();
            if !signals.is_empty() {
                schema.topics.push(Topic { name: topic.name.clone(), signals });
            }
            place = here.end;
        }
        schema
    }
}

/// A signal's name as `state.pose_x_m`.
fn full_name(topic: &str, signal: &str) -> String {
    format!("{}.{signal}", topic.trim_matches('/').replace('/', "."))
}

/// Whether a name fits a pattern, in which `*` stands for any characters; `/` counts as `.`.
pub fn fits(pattern: &str, name: &str) -> bool {
    let pattern = pattern.trim_matches('/').replace('/', ".");
    let Some((start, rest)) = pattern.split_once('*') else { return pattern == name };
    let Some(mut name) = name.strip_prefix(start) else { return false };
    let (inner, end) = rest.rsplit_once('*').unwrap_or(("", rest));
    for part in inner.split('*') {
        match name.find(part) {
            Some(at) => name = &name[at + part.len()..],
            None => return false,
        }
    }
    name.ends_with(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_stands_for_any_characters() {
        for (pattern, name, expected) in [
            ("state.pose_x_m", "state.pose_x_m", true),
            ("/state/pose_x_m", "state.pose_x_m", true),
            ("state", "state.pose_x_m", false),
            ("state.*", "state.pose_x_m", true),
            ("*.pose_*_m", "state.pose_x_m", true),
            ("*.pose_*_m", "state.pose_heading_rad", false),
            ("wheel_*.speed_rad_s", "wheel_12.speed_rad_s", true),
            ("wheel_*.speed", "wheel_12.speed_rad_s", false),
            ("*", "anything", true),
            ("*a*b*c*", "xaxbxcx", true),
            ("*a*b*c*", "xaxcxbx", false),
            ("ab*ba", "aba", false),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn the_first_row_at_or_behind_each_multiple_is_due() {
        let mut due = Due::new(&Selection { every_ns: Some(10), ..Selection::default() });
        let times = [0, 4, 8, 12, 16, 20, 24, 41, 44, 49, 50];
        let taken: Vec<u64> = times.into_iter().filter(|time| due.take(*time)).collect();
        assert_eq!(taken, [0, 12, 20, 41, 50]);
    }

    #[test]
    fn chosen_signals_keep_their_topics_and_their_order() {
        let mut schema = RunSchema::default();
        schema.push("/a", ["x", "y"]);
        schema.push("/b", ["x"]);
        schema.push("/c", ["x", "z"]);
        let selection = Selection { signals: vec!["c.z".into(), "*.x".into()], every_ns: None };
        let columns = selection.columns(&schema);
        assert_eq!(columns, [0, 2, 3, 4]);
        assert_eq!(schema.only(&columns).names().collect::<Vec<_>>(), ["a.x", "b.x", "c.x", "c.z"]);
        assert_eq!(selection.words(&schema).unwrap(), "4 of 5 signals, in every cycle");
        assert_eq!(Selection::default().words(&schema), None);
    }
}
