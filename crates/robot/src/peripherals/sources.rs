//! The cycle's part of what other programs send: taken where it is newer, aged, believed while it is young and sound.

use std::ops::Range;

use crate::config::RobotPlan;
use crate::signals::{Between, CycleTime, Heard, MAX_SOURCES, Signals};

/// All programs that send inputs.
pub(super) struct Sources {
    all: Vec<Sender>,
    /// The place of the first one's age.
    ages_from: usize,
}

/// One of them, and where its values stand.
struct Sender {
    inputs: Range<usize>,
    bounds: Vec<[f64; 2]>,
    max_age_ns: u64,
    any_order: bool,
    /// What came since the cycle before.
    waiting: Option<Heard>,
    between: Between,
    heard_ns: Option<u64>,
}

impl Sources {
    /// Those of a plan; their values stand behind the SubDevices'.
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let mut at: usize = plan.devices.iter().map(|device| device.input.len()).sum();
        let all = plan.sources.iter().take(MAX_SOURCES).map(|source| {
            let inputs = super::cyclic::next(&mut at, source.input.len());
            Sender {
                inputs,
                bounds: source.input.iter().map(|sent| sent.bounds).collect(),
                max_age_ns: source.max_age_ns,
                any_order: source.any_order,
                waiting: None,
                between: Between::default(),
                heard_ns: None,
            }
        });
        Sources { all: all.collect(), ages_from: plan.devices.len() }
    }

    /// Something came from a source; it counts in the next cycle.
    pub(super) fn hear(&mut self, source: usize, heard: &Heard) {
        if let Some(sender) = self.all.get_mut(source) {
            sender.waiting = Some(*heard);
        }
    }

    /// What a source said since the cycle before, however short that was.
    pub(super) fn hear_between(&mut self, source: usize, between: Between) {
        if let Some(sender) = self.all.get_mut(source) {
            sender.between = between;
        }
    }

    /// What came is taken where it is no older than what was there; what wasn't heard grows old.
    pub(super) fn read(&mut self, time: &CycleTime, signals: &mut Signals) {
        (signals.heard, signals.zeroed, signals.raised) = (0, 0, 0);
        for (place, sender) in self.all.iter_mut().enumerate() {
            let Between { zero, nonzero } = std::mem::take(&mut sender.between);
            let own = (1_u64 << sender.inputs.len()) - 1;
            signals.zeroed |= (u64::from(zero) & own) << sender.inputs.start;
            signals.raised |= (u64::from(nonzero) & own) << sender.inputs.start;
            let values = &mut signals.inputs[sender.inputs.clone()];
            let is_older = |heard: &Heard| {
                !sender.any_order && sender.heard_ns.is_some_and(|last_ns| heard.instant_ns < last_ns)
            };
            // Of the future nobody can tell anything.
            let is_known = |heard: &Heard| heard.instant_ns <= time.now_ns;
            if let Some(heard) = sender.waiting.take().filter(|heard| !is_older(heard)).filter(is_known) {
                for (value, sent) in values.iter_mut().zip(&heard.values) {
                    *value = *sent;
                }
                sender.heard_ns = sender.heard_ns.max(Some(heard.instant_ns));
                signals.heard |= 1 << place;
                signals.instants_ns[place] = heard.instant_ns;
            }
            let age_ns = sender.heard_ns.map(|heard_ns| time.now_ns.saturating_sub(heard_ns));
            signals.ages_s[self.ages_from + place] =
                age_ns.map_or(f64::INFINITY, |age_ns| age_ns as f64 * 1e-9);
            if age_ns.is_none_or(|age_ns| age_ns > sender.max_age_ns) {
                continue;
            }
            for ((input, value), [least, greatest]) in sender.inputs.clone().zip(values).zip(&sender.bounds) {
                let is_sound = value.is_finite() && (*least..=*greatest).contains(value);
                signals.believed |= u64::from(is_sound) << input;
            }
        }
    }

    /// What came in a recorded cycle comes again.
    pub(super) fn replay(&mut self, recorded: &Signals) {
        for (place, sender) in self.all.iter_mut().enumerate() {
            let start = sender.inputs.start;
            sender.between = Between {
                zero: (recorded.zeroed >> start) as u32,
                nonzero: (recorded.raised >> start) as u32,
            };
            if recorded.heard >> place & 1 == 0 {
                continue;
            }
            let mut heard = Heard { instant_ns: recorded.instants_ns[place], ..Heard::NOTHING };
            for (value, input) in heard.values.iter_mut().zip(sender.inputs.clone()) {
                *value = recorded.inputs[input];
            }
            sender.waiting = Some(heard);
        }
    }
}
