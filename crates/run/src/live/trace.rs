//! Where the robot went, in pieces that are shared: whoever looks holds nobody up.

use std::collections::VecDeque;
use std::sync::Arc;

/// Points of the trace that are kept: those of [`TRACE_KEPT_S`].
const TRACE_KEPT: usize = 60_000;
/// As long as that the trace is kept, s.
pub const TRACE_KEPT_S: f64 = 600.0;
/// The longest time between two points that follow each other, s: some cycles may be left out, and no more.
const TRACE_STEP_S: f64 = 0.1;
/// Points of one piece.
const PIECE: usize = 500;

/// One point of where the robot went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TracePoint {
    /// Time of the run, s.
    pub time_s: f64,
    /// Believed pose in odom: x, y in m, heading in rad.
    pub believed: [f64; 3],
    /// Setpoint, likewise.
    pub wished: [f64; 3],
    /// True pose, likewise; `None` on hardware.
    pub truth: Option<[f64; 3]>,
}

/// A part of the trace that isn't there.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "where the robot was from {from_s:.2} s to {until_s:.2} s is not known any more: {TRACE_KEPT_S} s are kept"
)]
pub struct TraceGap {
    /// Its begin, in time of the run, s.
    pub from_s: f64,
    /// Its end, s.
    pub until_s: f64,
}

impl TraceGap {
    /// The first one of a trace that should begin at a time, s.
    pub(super) fn in_trace(trace: &[TracePoint], time_s: f64) -> Option<TraceGap> {
        let mut last_s = time_s;
        for point in trace {
            if point.time_s > last_s + TRACE_STEP_S {
                return Some(TraceGap { from_s: last_s, until_s: point.time_s });
            }
            last_s = point.time_s;
        }
        None
    }
}

/// The latest points.
#[derive(Clone, Default)]
pub(super) struct Trace {
    full: VecDeque<Arc<[TracePoint]>>,
    open: Vec<TracePoint>,
}

impl Trace {
    /// One more.
    pub(super) fn push(&mut self, point: TracePoint) {
        self.open.push(point);
        if self.open.len() == PIECE {
            self.full.push_back(self.open.drain(..).collect());
            if self.full.len() > TRACE_KEPT / PIECE + 1 {
                self.full.pop_front();
            }
        }
    }

    /// The same, for whoever looks at it longer: a list of pieces is copied, not the points.
    pub(super) fn shared(&self) -> Trace {
        self.clone()
    }

    /// The points after a time of the run, s.
    pub(super) fn since(&self, time_s: f64) -> Vec<TracePoint> {
        let there = PIECE * self.full.len() + self.open.len();
        let pieces = self.full.iter().map(|piece| &piece[..]).chain([&self.open[..]]);
        let kept = pieces.flatten().skip(there.saturating_sub(TRACE_KEPT));
        kept.skip_while(|point| point.time_s <= time_s).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::{Ages, Live, Snapshot, live};
    use omnibase_robot::signals::StopCategory;

    /// Between two points, ns.
    const TRACE_NS: u64 = 10_000_000;

    /// A robot was looked at in every one of these cycles of 10 ms.
    fn traced(cycles: impl Iterator<Item = u64>) -> Live {
        let (live, mut end) = live(Ages { stick_ns: 1, session_ns: 1 }, StopCategory::RampAndHold, &[]);
        let mut snapshot = Snapshot::default();
        for cycle in cycles {
            snapshot.record.time.now_ns = cycle * TRACE_NS;
            end.show(&snapshot);
            live.snapshot();
        }
        live
    }

    #[test]
    fn a_trace_whose_beginning_or_middle_is_missing_is_refused_in_words() {
        let kept = TRACE_KEPT as u64;
        let live = traced(0..kept + 500);
        assert_eq!(live.whole_trace_since(10.0).unwrap().len(), TRACE_KEPT - 501);
        let gap = live.whole_trace_since(2.0).unwrap_err();
        assert!((gap.from_s, gap.until_s) == (2.0, 5.0), "{gap}");
        assert!(
            gap.to_string().contains("from 2.00 s to 5.00 s") && gap.to_string().contains("600 s"),
            "{gap}"
        );
        // A few cycles that were left out are no gap.
        let live = traced((0..100).chain(105..200));
        assert_eq!(live.whole_trace_since(0.5).unwrap().len(), 144);
        let live = traced((0..100).chain(150..200));
        assert!((live.whole_trace_since(0.5).unwrap_err().from_s - 0.99).abs() < 1e-9);
    }
}
