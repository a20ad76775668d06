//! What a cycle is recorded and told as: its row, and what happened in words.

use omnibase_fusion::{MAX_SENSORS, Verdict};
use omnibase_measure::slips::Slip;
use omnibase_platform::Pose2;
use omnibase_robot::signals::{MAX_WHEELS, SafetyReason};
use omnibase_session::Words;

use super::{Cycle, MOST_EVENTS};
use crate::channels::CycleExtras;
use crate::live::Client;

impl Cycle<'_> {
    /// Tells once, by its name, what is wrong with the axis about which the robot stopped.
    pub(super) fn look_at_axes(&mut self) {
        let before = std::mem::take(&mut self.axis_problem);
        if self.last.stop_reason != SafetyReason::Axis {
            return;
        }
        let device = (self.last.stop_where as usize).saturating_sub(MAX_WHEELS);
        let name = self.plan.devices.get(device).map_or("?", |device| device.name.as_str());
        let mut words = Words::new(format_args!("{name}: "));
        if !self.robot.tell_device_problem(device, &mut words) {
            return;
        }
        self.axis_problem = words;
        if before.is_empty() {
            self.happened(self.last.time.now_ns, words);
        }
    }

    /// Which sensor isn't believed any more, or is again.
    pub(super) fn look_at_sensors(&mut self) {
        for place in 0..self.plan.sensors.len().min(MAX_SENSORS) {
            let verdict = self.last.fusion.sensors[place].verdict;
            let before = std::mem::replace(&mut self.verdicts[place], verdict);
            let what = match verdict {
                _ if verdict == before => continue,
                Verdict::Awaited => continue,
                Verdict::Good if before == Verdict::Awaited => continue,
                Verdict::Good => "is believed again",
                Verdict::Silent if before == Verdict::Awaited => "says nothing",
                Verdict::Silent => "fell silent",
                Verdict::Frozen => "isn't believed: it says the same all the time while wheels move",
                Verdict::Contradicts => "isn't believed: it contradicts the others",
            };
            let name = &self.plan.sensors[place].name;
            self.happened(self.last.time.now_ns, Words::new(format_args!("sensor {name} {what}")));
        }
    }

    pub(super) fn record(&mut self, extras: &CycleExtras) {
        let (now_ns, phase) = (self.last.time.now_ns, self.robot.phase());
        if let Some((rows, sink)) = &mut self.recording {
            sink.push_row(now_ns, rows.words(&self.last, extras));
            if sink.is_broken() && !self.recording_lost {
                self.recording_lost = true;
                self.happened(now_ns, "the recording ended early: records are dropped from here on".into());
            }
        }
        for text in self.watch.look(&self.last, phase).into_iter().flatten() {
            self.happened(now_ns, text.into());
        }
        let mut over = [None; MAX_WHEELS];
        self.slips.look(&self.last, &mut |slip| over[slip.wheel] = Some(slip));
        for slip in over.into_iter().flatten() {
            let Slip { wheel, from: Pose2 { x_m, y_m, .. }, duration_s, way_m } = slip;
            let name = self.plan.drives.get(wheel).map_or("?", |drive| drive.name.as_str());
            let words = Words::new(format_args!(
                "{name} slipped by {way_m:.3} m in {duration_s:.3} s, from ({x_m:.2}, {y_m:.2}) m on"
            ));
            self.happened(now_ns, words);
        }
    }

    pub(super) fn happened(&mut self, time_ns: u64, text: Words) {
        self.happened_by(time_ns, text, None);
    }

    pub(super) fn happened_by(&mut self, time_ns: u64, text: Words, client: Option<Client>) {
        if let Some(live) = &mut self.live {
            live.tell(time_ns, text, client);
        }
        let text = client.map_or(text, |client| Words::new(format_args!("{text} ({client})")));
        if self.events.len() < MOST_EVENTS {
            self.events.push((time_ns, text));
        }
        if let Some((_, sink)) = &mut self.recording {
            sink.push_event(time_ns, &text);
        }
    }
}
