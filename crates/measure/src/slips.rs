//! Which wheel slipped, where, for how long and how far.

use omnibase_platform::Pose2;
use omnibase_robot::signals::{CycleRecord, MAX_WHEELS};

/// A wheel that slipped, and grips again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Which wheel.
    pub wheel: usize,
    /// Where the platform was believed to be when it was noticed, in odom.
    pub from: Pose2,
    /// For how long it was seen, s.
    pub duration_s: f64,
    /// By how far, m.
    pub way_m: f64,
}

/// Notices slips that end.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlipWatch {
    /// Since when, ns, where, and how far by now.
    slipping: [Option<(u64, Pose2, f64)>; MAX_WHEELS],
}

impl SlipWatch {
    /// Takes in a cycle; `tell` hears of each slip that is over.
    pub fn look(&mut self, record: &CycleRecord, tell: &mut dyn FnMut(Slip)) {
        let now_ns = record.time.now_ns;
        for (wheel, (before, way_m)) in self.slipping.iter_mut().zip(record.grip.slipped_m).enumerate() {
            let slips = way_m > 0.0;
            match before {
                Some((_, _, by_now_m)) if slips => *by_now_m = way_m,
                Some((since_ns, from, way_m)) => {
                    let duration_s = now_ns.saturating_sub(*since_ns) as f64 * 1e-9;
                    tell(Slip { wheel, from: *from, duration_s, way_m: *way_m });
                    *before = None;
                }
                None if slips => *before = Some((now_ns, record.state.odom_from_body, way_m)),
                None => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_told_when_it_is_over() {
        let (mut watch, mut told) = (SlipWatch::default(), Vec::new());
        for (ms, way_m) in [(10, 0.0), (11, 0.004), (12, 0.006), (13, 0.009), (14, 0.0), (15, 0.0)] {
            let mut record = CycleRecord::default();
            record.time.now_ns = ms * 1_000_000;
            record.state.odom_from_body.x_m = 0.1 * ms as f64;
            record.grip.slipped_m[2] = way_m;
            watch.look(&record, &mut |slip| told.push(slip));
        }
        let from = Pose2 { x_m: 0.1 * 11.0, ..Pose2::default() };
        assert_eq!(told, [Slip { wheel: 2, from, duration_s: 0.003, way_m: 0.009 }]);
    }
}
