//! Robots that are stopped under way on slippery floors and treads that give way, on slopes, pushed and with other loads: nothing breaks
//! their ramps off for not being followed.

use omnibase_robot::signals::SafetyReason;
use omnibase_trials::braking::Braking;

/// Robots.
const ROBOTS: u64 = 80;

#[test]
fn a_ramp_that_a_law_of_ours_follows_is_not_broken_off() {
    let mut stopped = 0;
    for seed in 1..=ROBOTS {
        let braking = Braking::new(seed);
        let ended = braking.ride();
        stopped += u64::from(ended.first != SafetyReason::None);
        let heeds = !matches!(ended.broken_off, Some(SafetyReason::TrackingError | SafetyReason::WheelSpeed));
        assert!(heeds, "{ended:?}: {}", braking.row());
    }
    assert!(stopped > ROBOTS * 9 / 10, "{stopped} were stopped under way");
}

#[test]
fn on_a_slope_a_law_that_keeps_to_the_floors_friction_brakes_all_the_same() {
    // Nobody pushes them. What they take for a light platform, or one whose mass is near one side, must not take their torque away: they were up to 0.68 m off.
    for seed in [170, 398, 1103] {
        let braking = Braking::new(seed);
        let ended = braking.ride();
        println!("{ended:?}: {}", braking.row());
        assert!(ended.broken_off.is_none() && ended.off_m < 0.05, "{ended:?}: {}", braking.row());
    }
}
