//! Motors that would become too hot.

use omnibase_trajectory::fastest::Heat;

use super::*;

#[test]
fn motors_stay_as_cool_as_they_must() {
    let limits = Limits { acceleration_m_s2: 4.0, ..LIMITS };
    let heat = |window_s| Heat { window_s, torques: vec![[0.5, 0.0, 0.0]] };
    let to_and_fro: Vec<Pose2> =
        (0..9).map(|at| Pose2::new(if at % 2 == 0 { 0.0 } else { 1.0 }, 0.0, 0.0)).collect();
    let stops = Joining { tolerance_m: 0.0, ..JOINING };
    let motion = |heat: Option<Heat>| {
        let bounds = PlatformBounds { heat, ..PlatformBounds::new(limits) };
        FastestTrajectory::new(PiecewisePath::through(&to_and_fro, stops).unwrap(), &bounds).unwrap()
    };
    // The root of the mean square in the warmest window, by a sum of its own.
    let warmest = |motion: &FastestTrajectory<PiecewisePath>, window_s: f64| {
        let step_s = 1e-3;
        let squares: Vec<f64> = (0..(motion.duration_s() / step_s) as usize)
            .map(|at| (0.5 * motion.sample(step_s * at as f64).acceleration_in_odom.vx_m_s).powi(2))
            .collect();
        let width = (window_s / step_s) as usize;
        let sum =
            |end: usize| squares[end.saturating_sub(width)..end].iter().sum::<f64>() * step_s / window_s;
        (1..=squares.len()).map(sum).fold(0.0, f64::max).sqrt()
    };
    let free = motion(None);
    for window_s in [2.0, 5.0] {
        let cool = motion(Some(heat(window_s)));
        let (hot, kept) = (warmest(&free, window_s), warmest(&cool, window_s));
        assert!(hot > 1.1 && (0.9..1.005).contains(&kept), "{hot} and {kept} in {window_s} s");
        assert!(cool.duration_s() > free.duration_s());
    }
    // A window that is longer than all of it: before, the motors rested.
    assert_eq!(motion(Some(heat(100.0))).duration_s(), free.duration_s());
}

/// The least time from rest to rest under the integral of the acceleration's square alone: an acceleration that falls evenly, T³ = 12·d²/∫a²dt.
#[test]
fn a_straight_way_that_heats_takes_the_time_of_its_closed_form() {
    let limits = Limits { jerk_m_s3: 60.0, acceleration_m_s2: 6.0, ..LIMITS };
    let way = |length_m| [Pose2::default(), Pose2::new(length_m, 0.0, 0.0)];
    for (length_m, window_s, per_m_s2) in [(1.0, 4.0, 2.0), (0.8, 3.0, 1.5), (1.2, 6.0, 3.0)] {
        let heat = Heat { window_s, torques: vec![[per_m_s2, 0.0, 0.0]] };
        let bounds = PlatformBounds { heat: Some(heat.clone()), ..PlatformBounds::new(limits) };
        let motion =
            FastestTrajectory::new(PiecewisePath::through(&way(length_m), JOINING).unwrap(), &bounds)
                .unwrap();
        let least_s = (12.0 * (per_m_s2 * length_m).powi(2) / window_s).cbrt();
        let longer = motion.duration_s() / least_s - 1.0;
        println!(
            "{length_m} m: {:.4} s, {least_s:.4} s at least, {:.4} warm",
            motion.duration_s(),
            heat.most(&motion)
        );
        assert!((0.0..0.015).contains(&longer), "{} s, at least {least_s} s", motion.duration_s());
        assert!((0.99..1.001).contains(&heat.most(&motion)), "{}", heat.most(&motion));
    }
}

/// To and fro, with two motors: what they bear is used, and not exceeded.
#[test]
fn where_motors_become_too_hot_what_they_bear_is_used() {
    let limits = Limits { speed_m_s: 1.5, acceleration_m_s2: 6.0, jerk_m_s3: 30.0, ..LIMITS };
    let place = |at| Pose2::new(if at % 2 == 0 { 0.0 } else { 1.0 }, 0.2 * f64::from(at), 0.0);
    let places: Vec<Pose2> = (0..7).map(place).collect();
    // What the mean with slower windows takes is 3.4 to 8 % longer.
    for (tolerance_m, window_s, most_s) in
        [(0.0, 1.5, 7.36), (0.0, 4.0, 7.21), (0.05, 1.5, 6.81), (0.05, 4.0, 6.66)]
    {
        let path = PiecewisePath::through(&places, Joining { tolerance_m, ..JOINING }).unwrap();
        let heat = Heat { window_s, torques: vec![[0.35, 0.0, 0.0], [-0.2, 0.3, 0.0]] };
        let bounds = PlatformBounds { heat: Some(heat.clone()), ..PlatformBounds::new(limits) };
        let motion = FastestTrajectory::new(&path, &bounds).unwrap();
        let cold = FastestTrajectory::new(&path, &PlatformBounds::new(limits)).unwrap();
        println!(
            "{tolerance_m} m, {window_s} s: {:.4} s, cold {:.4} s",
            motion.duration_s(),
            cold.duration_s()
        );
        assert!(
            heat.most(&cold) > 1.1 && (0.99..1.001).contains(&heat.most(&motion)),
            "{}",
            heat.most(&motion)
        );
        assert!(
            cold.duration_s() < motion.duration_s() && motion.duration_s() < most_s,
            "{}",
            motion.duration_s()
        );
        assert!(loads(&motion, &bounds) < 1.004, "{}", loads(&motion, &bounds));
    }
}
