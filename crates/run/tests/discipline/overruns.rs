//! What is late is left out: no burst of frames, the index of cycles stays on the grid of time.

use super::watched::{Deed, Extras, robot, watched};

const CYCLE_NS: u64 = 1_000_000;

/// Lateness in cycles, and how many are left out for it.
const LATE: [(f64, u64); 6] = [(0.2, 0), (0.49, 0), (0.6, 1), (1.3, 1), (5.0, 5), (7.7, 8)];

/// Has something go wrong before cycle 2000, whereby cycle `late` would come late, and looks at what comes of it.
fn late_by(deed: fn(u64) -> Deed, cycles_late: f64, late: u64, left_out: u64) {
    let robot = robot();
    let (quiet, _) = watched(&robot, Extras::default());
    assert_eq!(quiet.summary.overruns, 0);
    let late_ns = (cycles_late * CYCLE_NS as f64) as u64;
    let deeds = vec![(2000, deed(late_ns))];
    let (ran, seen) = watched(&robot, Extras { deeds, ..Extras::default() });
    let summary = &ran.summary;
    assert_eq!(summary.overruns, left_out, "{cycles_late} cycles late");
    // Each frame serves one SYNC0, and none is sent to make up for those that weren't.
    let gaps: Vec<u64> = seen.sent_ns.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let closest_ns = gaps.iter().min().unwrap();
    assert!(*closest_ns > CYCLE_NS / 2, "{cycles_late} cycles late: frames {closest_ns} ns apart");
    let at = gaps.iter().position(|gap| *gap > CYCLE_NS + CYCLE_NS / 10);
    if let Some(at) = at {
        assert!(gaps[at + 1..].iter().all(|gap| *gap < 3 * CYCLE_NS / 2), "{cycles_late}: one gap alone");
        let after_ns = gaps[at] + gaps[at + 1];
        // The frame after the late one is back on the grid (which follows the reference clock, so not to the ns).
        let off_ns = (after_ns % CYCLE_NS).min(CYCLE_NS - after_ns % CYCLE_NS);
        assert!(off_ns < CYCLE_NS / 20, "{cycles_late} cycles late: the grid moved by {off_ns} ns");
        assert_eq!((after_ns + CYCLE_NS / 2) / CYCLE_NS, 2 + left_out, "cycles from before to after");
    }
    let figures = summary.timing.wake_up_ns.as_ref().unwrap();
    if left_out > 0 {
        assert_eq!((figures.worst.cycle, figures.worst.left_out), (late + left_out, left_out));
        let expected = (late_ns.saturating_sub(CYCLE_NS))..=late_ns + CYCLE_NS / 100;
        assert!(expected.contains(&figures.worst.wake_up_ns), "{figures:?}");
        // What the index leaps over is what was left out: the run took as many cycles less.
        assert_eq!(figures.histogram.iter().map(|bin| bin.count).sum::<u64>(), summary.cycles);
    }
}

#[test]
fn a_host_that_oversleeps_leaves_cycles_out() {
    for (cycles_late, left_out) in LATE {
        late_by(Deed::Oversleep, cycles_late, 2000, left_out);
    }
}

#[test]
fn a_cycle_that_takes_too_long_leaves_cycles_out() {
    // A cycle may take as long as its period.
    for (cycles_late, left_out) in [(0.5, 0), (1.2, 0), (1.8, 1), (5.3, 4)] {
        late_by(Deed::Stall, cycles_late, 2001, left_out);
    }
}
