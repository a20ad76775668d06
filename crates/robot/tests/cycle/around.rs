//! Ways around an obstacle that stands in a fast motion's way.

use omnibase_platform::Pose2;
use omnibase_robot::config::AvoidanceKind;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::SafetyReason;
use omnibase_robot::{CycleRecord, Phase, RequestKind};

use super::support::{BMM, Bench, plan};

/// Goes 2 m ahead, past an obstacle of 0.25 m; the last cycle, and the greatest way aside, m.
fn past(centre_m: [f64; 2]) -> (CycleRecord, f64) {
    let mut plan = plan(&format!("{BMM}\n[fence]\nrectangle_m = [-1.2, -1.6, 3.2, 1.6]\n"));
    plan.guard.avoidance = AvoidanceKind::Guarded;
    let mut bench = Bench::new(plan);
    bench.enable();
    let obstacle = Obstacle { centre_m, radius_m: 0.25, velocity_m_s: [0.0; 2] };
    bench.step(Some(RequestKind::SetObstacle { index: 0, obstacle }));
    bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(2.0, 0.0, 0.0) }));
    let mut aside_m = 0.0_f64;
    for _ in 0..30_000 {
        let record = bench.step(None);
        aside_m = aside_m.max(record.setpoint.odom_from_body.y_m.abs());
        if bench.robot.phase() != Phase::Tracking {
            return (record, aside_m);
        }
    }
    panic!("still under way");
}

#[test]
fn a_fast_way_leads_around_an_obstacle_wherever_it_stands_in_it() {
    for place in -4..=4 {
        for x_m in [0.9, 0.99839, 1.1] {
            let centre_m = [x_m, 0.075 * f64::from(place) + 0.00156];
            let (record, aside_m) = past(centre_m);
            assert_eq!(record.allowed.reason, SafetyReason::None, "{centre_m:?}: aside {aside_m}");
            let lacks_m = record.setpoint.odom_from_body.distance_m(Pose2::new(2.0, 0.0, 0.0));
            assert!(lacks_m < 1e-3, "{centre_m:?}: {lacks_m}");
            assert!(aside_m > 0.2, "{centre_m:?}: {aside_m}");
        }
    }
}
