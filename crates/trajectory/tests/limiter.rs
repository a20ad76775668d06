//! Limits that hold in every cycle.

use omnibase_platform::Twist2;
use omnibase_trajectory::limiter::Outcome;
use omnibase_trajectory::limits::{Retiming, retimed};
use omnibase_trajectory::{
    Heading, Interpolation, LimitedTwist, Limits, PathPoints, Peaks, Placed, PointTrajectory, Shape,
    ShapeTrajectory, Trajectory, TwistLimiter,
};
use proptest::prelude::*;

const LIMITS: Limits = Limits {
    speed_m_s: 0.6,
    acceleration_m_s2: 0.5,
    jerk_m_s3: 5.0,
    rate_rad_s: 0.8,
    angular_acceleration_rad_s2: 1.0,
    angular_jerk_rad_s3: 8.0,
};

/// A small generator, so that a million cycles are the same on every machine (Marsaglia's xorshift64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// The largest share of each limit that was used.
#[derive(Debug, Default)]
struct Use {
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Use {
    fn see(&mut self, period_s: f64, before: &LimitedTwist, now: &LimitedTwist) {
        let (v, a, b) = (now.twist_in_odom, now.acceleration_in_odom, before.acceleration_in_odom);
        let jerk = Twist2::new(a.vx_m_s - b.vx_m_s, a.vy_m_s - b.vy_m_s, a.w_rad_s - b.w_rad_s)
            .scaled(1.0 / period_s);
        let most = |translation: f64, rotation: f64, before: f64| before.max(translation).max(rotation);
        self.speed = most(v.speed_m_s() / LIMITS.speed_m_s, v.w_rad_s.abs() / LIMITS.rate_rad_s, self.speed);
        self.acceleration = most(
            a.speed_m_s() / LIMITS.acceleration_m_s2,
            a.w_rad_s.abs() / LIMITS.angular_acceleration_rad_s2,
            self.acceleration,
        );
        self.jerk = most(
            jerk.speed_m_s() / LIMITS.jerk_m_s3,
            jerk.w_rad_s.abs() / LIMITS.angular_jerk_rad_s3,
            self.jerk,
        );
        // What is called acceleration is what the twist does.
        let (u, tolerance) = (before.twist_in_odom, 1e-15 / period_s);
        assert!((v.vx_m_s - u.vx_m_s - a.vx_m_s * period_s).abs() <= tolerance);
        assert!((v.vy_m_s - u.vy_m_s - a.vy_m_s * period_s).abs() <= tolerance);
        assert!((v.w_rad_s - u.w_rad_s - a.w_rad_s * period_s).abs() <= tolerance);
    }
}

/// Commands of every kind: held, reversed, stopped and resumed, turning, ramping, noisy, far beyond the limits.
struct Commands {
    random: Random,
    kind: u32,
    left: u32,
    now: Twist2,
    turn_rad: f64,
    ramp: Twist2,
    resumed: Twist2,
}

impl Commands {
    fn next(&mut self) -> Twist2 {
        if self.left == 0 {
            self.kind = (self.random.next() * 8.0) as u32;
            self.left = 1 + (self.random.next().powi(3) * 3000.0) as u32;
            let random = &mut self.random;
            let fresh =
                Twist2::new(random.between(-1.5, 1.5), random.between(-1.5, 1.5), random.between(-2.0, 2.0));
            match self.kind {
                0 | 1 => self.now = fresh,
                2 => self.now = self.now.scaled(-1.0),
                3 => (self.resumed, self.now) = (self.now, Twist2::default()),
                4 => self.now = self.resumed,
                5 => self.turn_rad = random.between(-3e-3, 3e-3),
                6 => self.ramp = fresh.scaled(4e-4),
                _ => {}
            }
        }
        self.left -= 1;
        match self.kind {
            5 => self.now = self.now.rotated(self.turn_rad),
            6 => {
                let (now, ramp) = (self.now, self.ramp);
                self.now = Twist2::new(
                    now.vx_m_s + ramp.vx_m_s,
                    now.vy_m_s + ramp.vy_m_s,
                    now.w_rad_s + ramp.w_rad_s,
                );
            }
            7 => {
                let random = &mut self.random;
                self.now = Twist2::new(
                    random.between(-1.0, 1.0),
                    random.between(-1.0, 1.0),
                    random.between(-1.0, 1.0),
                );
            }
            _ => {}
        }
        self.now
    }
}

#[test]
fn a_million_cycles_of_random_commands_stay_within_limits() {
    let period_s = 1e-3;
    let mut limiter = TwistLimiter::new(&LIMITS, period_s).unwrap();
    let random = Random(0x9E37_79B9_7F4A_7C15);
    let zero = Twist2::default();
    let mut commands =
        Commands { random, kind: 0, left: 0, now: zero, turn_rad: 0.0, ramp: zero, resumed: zero };
    let (mut before, mut seen) = (LimitedTwist::default(), Use::default());
    let mut passed = 0;
    for _ in 0..1_000_000 {
        let now = limiter.step(commands.next());
        seen.see(period_s, &before, &now);
        passed += u32::from(now.outcome == Outcome::Passed);
        before = now;
    }
    println!("{seen:?}, {passed} commands passed unchanged");
    for used in [seen.speed, seen.acceleration, seen.jerk] {
        assert!(used <= 1.0 + 1e-9, "{seen:?}");
        assert!(used >= 0.999, "the limits are used: {seen:?}");
    }
    assert!(passed > 10_000 && passed < 900_000, "{passed}");
}

/// The angle between two directions, in degrees; 0 where there is no speed.
fn apart_deg(v: Twist2, direction_rad: f64) -> f64 {
    let across = v.vy_m_s * direction_rad.cos() - v.vx_m_s * direction_rad.sin();
    let along = v.vx_m_s * direction_rad.cos() + v.vy_m_s * direction_rad.sin();
    if v.speed_m_s() < 1e-9 { 0.0 } else { across.abs().atan2(along.abs()).to_degrees() }
}

#[test]
fn the_path_keeps_its_direction_under_saturation() {
    // A million cycles along lines in random directions: starts, stops, reversals, resumes, all beyond the limits.
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
    let (mut worst_deg, mut direction_rad, mut saturated) = (0.0_f64, 0.0_f64, 0);
    let mut command = Twist2::default();
    for cycle in 0..1_000_000 {
        if cycle % 20_000 == 0 {
            direction_rad = random.between(-3.1, 3.1);
            limiter.restart(Twist2::default());
        }
        if cycle % 700 == 0 || cycle % 20_000 == 0 {
            let speed = if (cycle / 700) % 5 == 4 { 0.0 } else { random.between(-2.0, 2.0) };
            let (sin, cos) = direction_rad.sin_cos();
            command = Twist2::new(speed * cos, speed * sin, random.between(-1.0, 1.0));
        }
        let now = limiter.step(command);
        saturated += u32::from(now.outcome == Outcome::Limited);
        worst_deg = worst_deg.max(apart_deg(now.twist_in_odom, direction_rad));
    }
    println!("worst {worst_deg:e}°, {saturated} cycles saturated");
    assert!(saturated > 500_000);
    assert!(worst_deg <= 0.1, "{worst_deg}°");
}

#[test]
fn a_command_beyond_the_speed_limit_that_turns_keeps_its_direction() {
    // Driving a circle at twice the allowed speed: once caught up, the direction is the command's.
    for turn_rad_s in [0.05, 0.2, 0.5, 0.8, 1.2, 3.0, 8.0] {
        let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
        let mut worst_deg = 0.0_f64;
        for cycle in 0..60_000 {
            let angle = turn_rad_s * f64::from(cycle) * 1e-3;
            let now = limiter.step(Twist2::new(1.2 * angle.cos(), 1.2 * angle.sin(), 0.0));
            if cycle > 10_000 {
                worst_deg = worst_deg.max(apart_deg(now.twist_in_odom, angle));
                let speed = now.twist_in_odom.speed_m_s();
                // Faster turns leave less speed: v = A/ω.
                let most = LIMITS.speed_m_s.min(LIMITS.acceleration_m_s2 / turn_rad_s);
                assert!(speed > 0.89 * most, "{speed} m/s at {turn_rad_s} rad/s");
            }
        }
        println!("{turn_rad_s} rad/s: worst {worst_deg:e}°");
        assert!(worst_deg <= 0.1, "{worst_deg}° at {turn_rad_s} rad/s");
    }
}

#[test]
fn a_command_that_speeds_up_faster_than_allowed_is_followed_without_swinging() {
    // 0.3 m/s² of 0.2: late; with noise that makes its rate last from one cycle to the next, or not, as it comes.
    let limits = Limits { acceleration_m_s2: 0.2, jerk_m_s3: 40.0, ..LIMITS };
    let (mut limiter, mut random) = (TwistLimiter::new(&limits, 1e-3).unwrap(), Random(7));
    let (mut before, mut swung) = (Twist2::default(), 0.0);
    for cycle in 0..2000 {
        let t = f64::from(cycle) * 1e-3;
        let noise = 2e-5 * random.next();
        let command = Twist2::new(0.012 + 0.18 * t, 0.016 + 0.24 * t + noise, 0.0);
        let now = limiter.step(command).acceleration_in_odom;
        swung += Twist2::new(now.vx_m_s - before.vx_m_s, now.vy_m_s - before.vy_m_s, 0.0).speed_m_s();
        before = now;
    }
    // Up to 0.2 m/s² and what the noise turns it by; 40 m/s² where the command is shortened now and then.
    assert!(swung < 1.5, "{swung} m/s²");
}

#[test]
fn a_step_takes_the_time_of_the_best_profile() {
    // Closed form of the seven-phase profile: V/A + A/J for a speed that needs the full acceleration.
    let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
    let command = Twist2::new(0.36, -0.48, 0.0);
    let mut cycles = 0;
    while limiter.step(command).twist_in_odom != command {
        cycles += 1;
        assert!(cycles < 5000);
    }
    let best_s = 0.6 / 0.5 + 0.5 / 5.0;
    let found_s = f64::from(cycles) * 1e-3;
    assert!((found_s - best_s).abs() < 0.01, "{found_s} s, best {best_s} s");
}

#[test]
fn a_motion_within_the_limits_passes_unchanged_and_undelayed() {
    let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
    for cycle in 0..20_000 {
        let t = f64::from(cycle) * 1e-3;
        // From rest by smooth amplitude: at most 0.41 m/s², 0.6 m/s³.
        let amplitude = if t < 4.0 {
            0.4 * (t / 4.0).powi(3) * (10.0 - 15.0 * t / 4.0 + 6.0 * (t / 4.0).powi(2))
        } else {
            0.4
        };
        let command = Twist2::new(amplitude * t.cos(), amplitude * t.sin(), amplitude * (0.7 * t).sin());
        let now = limiter.step(command);
        assert_eq!(now.outcome, Outcome::Passed, "at {t} s");
        assert_eq!(now.twist_in_odom, command);
    }
}

#[test]
fn a_command_that_is_no_number_stops_smoothly() {
    let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
    let mut before = LimitedTwist::default();
    for _ in 0..2000 {
        before = limiter.step(Twist2::new(0.5, 0.0, 0.0));
    }
    let mut seen = Use::default();
    for _ in 0..3000 {
        let now = limiter.step(Twist2::new(f64::NAN, 0.2, f64::INFINITY));
        assert_eq!(now.outcome, Outcome::NotFinite);
        seen.see(1e-3, &before, &now);
        before = now;
    }
    assert!(seen.jerk <= 1.0 + 1e-9 && seen.acceleration <= 1.0 + 1e-9);
    assert_eq!(before.twist_in_odom, Twist2::default());
}

#[test]
fn lowered_limits_are_reached_by_braking() {
    let mut limiter = TwistLimiter::new(&LIMITS, 1e-3).unwrap();
    let command = Twist2::new(0.5, 0.3, 0.7);
    for _ in 0..900 {
        limiter.step(command);
    }
    let lower = Limits { speed_m_s: 0.1, acceleration_m_s2: 0.2, rate_rad_s: 0.1, ..LIMITS };
    limiter.set_limits(&lower).unwrap();
    let (mut before, mut seen) = (limiter.step(command), Use::default());
    for _ in 0..8000 {
        let now = limiter.step(command);
        seen.see(1e-3, &before, &now);
        before = now;
    }
    assert!(seen.jerk <= 1.0 + 1e-9 && seen.acceleration <= 1.0 + 1e-9, "{seen:?}");
    assert!((before.twist_in_odom.speed_m_s() - 0.1).abs() < 1e-12, "{before:?}");
    assert!((before.twist_in_odom.w_rad_s - 0.1).abs() < 1e-12);
}

#[test]
fn limits_that_are_none_are_refused() {
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = TwistLimiter::new(&Limits { jerk_m_s3: wrong, ..LIMITS }, 1e-3).unwrap_err();
        assert!(error.to_string().starts_with("jerk_m_s3 is "));
        assert!(TwistLimiter::new(&LIMITS, wrong).is_err());
    }
}

proptest! {
    /// From any reachable motion any held command is reached, exactly, and at once stays; other limits and periods.
    #[test]
    fn a_held_command_is_reached(
        first in (-1.0..1.0, -1.0..1.0, -1.0..1.0), cycles in 1usize..3000, second in (-0.42..0.42, -0.42..0.42, -0.8..0.8),
        jerk in 0.5..50.0, period_s in prop::sample::select(vec![1.25e-4, 5e-4, 1e-3, 4e-3]),
    ) {
        let limits = Limits { jerk_m_s3: jerk, angular_jerk_rad_s3: 2.0 * jerk, ..LIMITS };
        let mut limiter = TwistLimiter::new(&limits, period_s).unwrap();
        for _ in 0..cycles {
            limiter.step(Twist2::new(first.0, first.1, first.2));
        }
        let command = Twist2::new(second.0, second.1, second.2);
        let longest_s = 2.0 * LIMITS.speed_m_s / LIMITS.acceleration_m_s2 + 2.5 * (LIMITS.speed_m_s / jerk).sqrt() + 3.0 * LIMITS.acceleration_m_s2 / jerk + 1.0;
        let mut last = LimitedTwist::default();
        for _ in 0..(longest_s / period_s) as usize {
            last = limiter.step(command);
        }
        prop_assert_eq!(last.twist_in_odom, command);
        prop_assert_eq!(limiter.step(command).acceleration_in_odom, Twist2::default());
    }
}

/// A planned motion that uses the limits fully, as its twists leave a planner.
fn passes(trajectory: &dyn Trajectory, period_s: f64) -> (usize, f64) {
    let mut limiter = TwistLimiter::new(&LIMITS, period_s).unwrap();
    let (mut limited, mut x_m, mut y_m) = (0, 0.0, 0.0);
    let cycles = (trajectory.duration_s() / period_s).ceil() as usize;
    let mut worst_m = 0.0_f64;
    let (mut planned_x_m, mut planned_y_m) = (0.0, 0.0);
    for cycle in 1..=cycles {
        let command = trajectory.sample(cycle as f64 * period_s).twist_in_odom;
        let now = limiter.step(command);
        limited += usize::from(now.outcome != Outcome::Passed);
        x_m += now.twist_in_odom.vx_m_s * period_s;
        y_m += now.twist_in_odom.vy_m_s * period_s;
        planned_x_m += command.vx_m_s * period_s;
        planned_y_m += command.vy_m_s * period_s;
        worst_m = worst_m.max(f64::hypot(x_m - planned_x_m, y_m - planned_y_m));
    }
    (limited, worst_m)
}

#[test]
fn motions_planned_at_the_limits_pass_unchanged() {
    let path = PathPoints::parse("0 0 0 0\n1 2 0 0.3\n2 2 2 2\n12 0 2 1\n13 0 0 0").unwrap();
    let quintic = retimed(&path, Interpolation::Quintic, &LIMITS, Retiming::Fastest);
    let quintic = PointTrajectory::new(&quintic, Interpolation::Quintic);
    let b_spline = retimed(&path, Interpolation::BSpline, &LIMITS, Retiming::Fastest);
    let b_spline = PointTrajectory::new(&b_spline, Interpolation::BSpline);
    let mut trajectories: Vec<(&str, Box<dyn Trajectory>)> =
        vec![("quintic", Box::new(quintic)), ("b-spline", Box::new(b_spline))];
    for (name, shape) in [
        ("circle", Shape::Circle { radius_m: 2.0 }),
        ("small circle", Shape::Circle { radius_m: 0.3 }),
        ("ellipse", Shape::Ellipse { half_length_m: 2.0, half_width_m: 1.2 }),
        ("eight", Shape::Eight { half_length_m: 2.0 }),
        ("spiral", Shape::Spiral { step_m: 0.5 }),
    ] {
        let once = ShapeTrajectory::new(shape, Heading::Fixed, 2.0, 10.0).unwrap();
        let (stretch, _) = Peaks::of(&once).stretch(&LIMITS);
        trajectories.push((name, Box::new(Placed::new(once).stretched(stretch))));
    }
    for (name, trajectory) in trajectories {
        for period_s in [1e-3, 4e-3] {
            let (limited, worst_m) = passes(&*trajectory, period_s);
            println!("{name} at {period_s} s: {limited} cycles limited, {worst_m:e} m behind");
            assert_eq!(limited, 0, "{name}: {worst_m:e} m behind");
        }
    }
}

proptest! {
    /// Any limits, any period, commands of any size every few cycles: the limits hold.
    #[test]
    fn any_limits_hold(
        speed in 0.01..5.0, acceleration in 0.01..20.0, jerk in 0.05..500.0, period_s in 1e-4..2e-2, turn_rad in -0.3..0.3,
        commands in prop::collection::vec((-6.0..6.0, -6.0..6.0, 1usize..80), 1..40),
    ) {
        let limits = Limits { speed_m_s: speed, acceleration_m_s2: acceleration, jerk_m_s3: jerk, ..LIMITS };
        let mut limiter = TwistLimiter::new(&limits, period_s).unwrap();
        let mut before = LimitedTwist::default();
        for (x, y, cycles) in commands {
            let mut command = Twist2::new(x, y, x - y);
            for _ in 0..cycles {
                command = command.rotated(turn_rad * period_s * 50.0);
                let now = limiter.step(command);
                let (a, b) = (now.acceleration_in_odom, before.acceleration_in_odom);
                let change = f64::hypot(a.vx_m_s - b.vx_m_s, a.vy_m_s - b.vy_m_s);
                prop_assert!(now.twist_in_odom.speed_m_s() <= speed * (1.0 + 1e-9), "{:?}", now);
                prop_assert!(a.speed_m_s() <= acceleration * (1.0 + 1e-9), "{:?}", now);
                prop_assert!(change <= jerk * period_s * (1.0 + 1e-9) + 1e-15 / period_s, "{} {:?} {:?}", change, before, now);
                before = now;
            }
        }
    }
}
