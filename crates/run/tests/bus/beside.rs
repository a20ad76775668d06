//! What people ask for beside a plan that leads the robot.

use omnibase_robot::signals::{Phase, RequestAnswer, SafetyReason};
use omnibase_robot::{RequestKind, RobotPlan};
use omnibase_run::conductor::{Conductor, Wish};

use crate::bench::{Bench, plan};

/// Longer than the way and its beginning and end.
const MOST_CYCLES: u64 = 10_000;

/// A run to its end; somebody asks in each cycle in which the plan asks for nothing.
fn led(plan: &RobotPlan, asked: RequestKind) -> (Conductor, Bench) {
    let mut bench = Bench::new(plan);
    let mut conductor = Conductor::new(None);
    while !conductor.is_over() && bench.cycles < MOST_CYCLES {
        let phase = bench.robot.phase();
        let by_plan = conductor.next(bench.robot.record(), phase, Wish::GoOn);
        let beside = Some(asked).filter(|_| phase == Phase::Tracking);
        bench.cycle(by_plan.or(beside));
        if phase == Phase::Tracking {
            assert_ne!(bench.robot.record().answer, RequestAnswer::Taken, "{asked:?}");
        }
    }
    assert!(conductor.is_over());
    (conductor, bench)
}

#[test]
fn what_is_refused_in_the_cycle_in_which_a_plan_ends_leaves_it_finished() {
    let plan = plan("[reference]\nkind = \"circle\"\nradius_m = 0.05\nduration_s = 3.0\n");
    // There is no such output; it isn't for a robot that moves; it is enabled.
    let nowhere = RequestKind::SetOutput { index: 0, value: 1.0 };
    for asked in [nowhere, RequestKind::Resume, RequestKind::Track, RequestKind::Enable] {
        let (conductor, bench) = led(&plan, asked);
        assert!(conductor.has_finished(), "{asked:?}");
        assert_eq!(conductor.stopped_by(), SafetyReason::None, "{asked:?}");
        assert_eq!(bench.robot.phase(), Phase::Disabled);
    }
}
