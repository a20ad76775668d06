//! The fence through the simulated machine: treads creep and wheels slip, so that the believed pose drifts.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, LimitedBy};
use omnibase_robot::{Phase, Request, RequestKind};
use omnibase_trials::approaches::room_in_fence_m;
use omnibase_trials::{Trial, plan_of, robots};

/// What pacing came to: least room of the true footprint, m; cycles that the fence limited; kept at the end, m.
struct Paced {
    least_m: f64,
    limited: u32,
    kept_m: f64,
}

/// Paces between the sides of a fence, turning slowly, by a stick that leads outwards at each end.
fn pace(sigmas: f64, seconds: u64) -> Paced {
    let fence =
        format!("\n[fence]\nrectangle_m = [-1.5, -1.2, 1.5, 1.2]\nmargin_m = 0.02\nsigmas = {sigmas:?}\n");
    let mut trial = Trial::new(plan_of(&(robots::MECANUM.to_owned() + &fence)));
    trial.enable();
    let corners_m = trial.plan.guard.fence.as_ref().map(|fence| fence.corners_m.clone()).unwrap_or_default();
    let footprint_m = trial.plan.guard.footprint_m.clone();
    let mut paced = Paced { least_m: f64::INFINITY, limited: 0, kept_m: 0.0 };
    for cycle in 0..1000 * seconds {
        let leg = cycle / 3500;
        let ahead = if leg % 2 == 0 { 0.8 } else { -0.8 };
        let twist = Twist2::new(ahead, 0.25 * (leg % 4) as f64 - 0.37, 0.25);
        trial.exchange();
        let valid_until_ns = trial.time().now_ns + 200_000_000;
        let kind = RequestKind::Velocity { twist, frame: Frame::Odom };
        let record = trial.compute_asked((cycle % 8 == 0).then_some(Request { kind, valid_until_ns }));
        paced.limited += u32::from(record.guard.limited_by == LimitedBy::Fence);
        paced.kept_m = record.guard.fence_kept_m.unwrap_or_default();
        paced.least_m = paced.least_m.min(room_in_fence_m(&footprint_m, &trial.pose(), &corners_m));
    }
    println!(
        "{seconds} s of pacing, {sigmas} sigmas: least true room {:.4} m, kept at the end {:.3} m",
        paced.least_m, paced.kept_m
    );
    assert_eq!(trial.robot.phase(), Phase::Tracking, "{}", trial.robot.record().stop_reason.text());
    paced
}

#[test]
fn after_four_minutes_of_pacing_the_truth_is_still_inside() {
    let paced = pace(3.0, 242);
    assert!(paced.least_m > 0.0, "{} m", paced.least_m);
    assert!(paced.limited > 10_000, "it was driven against the fence: {}", paced.limited);
    assert!((0.08..0.5).contains(&paced.kept_m), "the margin grew from 0.02 m: {}", paced.kept_m);
    // A margin that doesn't grow is not enough.
    let paced = pace(0.0, 242);
    assert!(paced.least_m < 0.0 && paced.kept_m == 0.02, "{} m, {} m", paced.least_m, paced.kept_m);
}
