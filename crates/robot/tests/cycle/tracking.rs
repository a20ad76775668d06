//! Each control law follows paths; limits hold in every cycle; what is learnt stays bounded and becomes true.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Dynamics, Frame, Quantity, SafetyReason, StopCategory};
use omnibase_robot::{CycleRecord, Phase, RequestKind};

use crate::support::{BMM, Bench, MECANUM, Random, laws_of_torque, plan};

const SQUARE: &str = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], \
                      [15, 0, 2, 0], [20, 0, 0, 0]]\n";
const CIRCLE: &str = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 10.0\n";

fn controlled(robot: &str, controller: &str, reference: &str) -> String {
    robot.replace("kind = \"closed_loop_speed\"", &format!("kind = \"{controller}\"")) + reference
}

struct Run {
    /// Distances between the wished and the true pose, m: root of the mean square, and greatest.
    rms_m: f64,
    greatest_m: f64,
    final_m: f64,
    final_heading_rad: f64,
}

/// Enables, tracks the whole reference, settles for a second; panics where the robot stops.
fn track(bench: &mut Bench, each: &mut dyn FnMut(&CycleRecord)) -> Run {
    bench.enable();
    bench.step(Some(RequestKind::Track));
    let (mut sum, mut count, mut greatest) = (0.0, 0.0_f64, 0.0_f64);
    while bench.robot.phase() == Phase::Tracking {
        let before = bench.pose;
        let record = bench.step(None);
        // The body's pose of the moment to which this cycle's inputs and setpoint belong.
        let error_m = record.wished.odom_from_body.distance_m(before);
        sum += error_m * error_m;
        count += 1.0;
        greatest = greatest.max(error_m);
        each(&record);
        assert!(count < 200_000.0, "it never ends");
    }
    let record = bench.run(1000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None));
    let wished = record.wished.odom_from_body;
    Run {
        rms_m: (sum / count).sqrt(),
        greatest_m: greatest,
        final_m: wished.distance_m(bench.pose),
        final_heading_rad: (wished.heading_rad - bench.pose.heading_rad).abs(),
    }
}

#[test]
fn every_controller_follows_square_and_circle() {
    // Bounds: root of the mean square and final error, m. Without slip all errors are the controllers' own.
    for (controller, rms_m, final_m) in [
        ("open_loop", 5e-3, 5e-3),
        ("closed_loop_speed", 5e-4, 1e-5),
        ("adaptive_torque", 1.5e-3, 1e-3),
        ("disturbance_observer", 1.5e-3, 1e-3),
    ] {
        for (name, reference) in [("square", SQUARE), ("circle", CIRCLE)] {
            let mut bench = Bench::new(plan(&controlled(BMM, controller, reference)));
            let run = track(&mut bench, &mut |_| {});
            let figures = format!(
                "{controller} {name}: rms {:.6} m, greatest {:.6} m, final {:.7} m, {:.7} rad",
                run.rms_m, run.greatest_m, run.final_m, run.final_heading_rad
            );
            println!("{figures}");
            assert!(run.rms_m < rms_m && run.final_m < final_m && run.final_heading_rad < 5e-3, "{figures}");
        }
    }
}

#[test]
fn four_wheels_follow_too() {
    for (controller, rms_m) in
        [("closed_loop_speed", 5e-4), ("adaptive_torque", 1.5e-3), ("disturbance_observer", 1.5e-3)]
    {
        let text = controlled(MECANUM, controller, CIRCLE)
            .replace("[simulation]", "mass_kg = 60.0\ninertia_kg_m2 = 4.0\n\n[simulation]");
        let run = track(&mut Bench::new(plan(&text)), &mut |_| {});
        assert!(run.rms_m < rms_m && run.final_m < 1e-3, "{controller}: {} {}", run.rms_m, run.final_m);
    }
}

#[test]
fn every_shape_runs_to_its_end() {
    for reference in [
        "kind = \"ellipse\"\nsemi_axis_x_m = 1.0\nsemi_axis_y_m = 0.5",
        "kind = \"spiral\"\nstep_m = 0.3\nturns = 2.5",
        "kind = \"holonomic\"\nradius_m = 0.6\nduration_s = 12.0",
        "kind = \"eight\"\nhalf_length_m = 0.8\nheading = \"follows_tangent\"",
        "kind = \"path\"\ninterpolation = \"quintic\"\npoints = [[0, 0, 0, 0], [4, 1, 0, 1.5], [8, 1, 1, 0]]",
        "kind = \"path\"\ninterpolation = \"spline\"\npoints = [[0, 0, 0, 0], [4, 1, 0, 1.5], [8, 1, 1, 0]]",
        "kind = \"path\"\ninterpolation = \"cubic_mean_slope\"\npoints = [[0, 0, 0, 0], [4, 1, 0, 1], [8, 1.5, 1, 0]]",
    ] {
        let text = format!("{BMM}\n[reference]\n{reference}\n");
        let run = track(&mut Bench::new(plan(&text)), &mut |_| {});
        assert!(run.rms_m < 1e-3 && run.final_m < 1e-4, "{reference}: {} {}", run.rms_m, run.final_m);
    }
}

#[test]
fn a_path_too_fast_is_refused_with_the_time_it_needs() {
    let text =
        format!("{BMM}\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [1, 2, 0, 0], [9, 0, 0, 0]]\n");
    let registry = omnibase_robot::Registry::with_built_in();
    let problems = omnibase_robot::RobotPlan::from_toml(&text, &registry, &|_| Err(String::new()))
        .expect_err("too fast");
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert_eq!(problems[0].setting, "reference.points[1]");
    assert!(problems[0].reason.contains("needs"), "{}", problems[0]);
    assert!(problems[0].place.is_some());
}

/// Speed, acceleration and jerk of the setpoint against the limits, from three setpoints in a row.
#[derive(Default)]
struct Rates {
    twists: Vec<Twist2>,
    greatest: [f64; 6],
}

impl Rates {
    fn watch(&mut self, record: &CycleRecord) {
        let period_s = record.time.period_s();
        self.twists.push(record.setpoint.twist_in_odom);
        let minus = |a: Twist2, b: Twist2| {
            Twist2::new(a.vx_m_s - b.vx_m_s, a.vy_m_s - b.vy_m_s, a.w_rad_s - b.w_rad_s)
                .scaled(1.0 / period_s)
        };
        if let [first, second, third] = self.twists[..] {
            let (before, now) = (minus(second, first), minus(third, second));
            for (order, twist) in [third, now, minus(now, before)].iter().enumerate() {
                self.greatest[2 * order] = self.greatest[2 * order].max(twist.speed_m_s());
                self.greatest[2 * order + 1] = self.greatest[2 * order + 1].max(twist.w_rad_s.abs());
            }
            self.twists.remove(0);
        }
    }

    fn within(&self, bench: &Bench) {
        let limits = &bench.plan.limits;
        let allowed = [
            limits.speed_m_s,
            limits.turn_speed_rad_s,
            limits.acceleration_m_s2,
            limits.turn_acceleration_rad_s2,
            limits.jerk_m_s3,
            limits.turn_jerk_rad_s3,
        ];
        for (order, (greatest, allowed)) in self.greatest.iter().zip(allowed).enumerate() {
            // The jerk is a second difference of rounded speeds: 1e-16 / (1 ms)² of noise.
            let tolerance = 1e-9 * allowed + if order > 3 { 1e-8 } else { 1e-12 };
            assert!(*greatest <= allowed + tolerance, "{order}: {greatest} above {allowed}");
            assert!(*greatest >= 0.5 * allowed, "{order}: {greatest} never came near {allowed}");
        }
    }
}

#[test]
fn limits_hold_in_a_million_cycles_of_random_commands() {
    let eight = "\n[reference]\nkind = \"eight\"\nhalf_length_m = 0.8\nheading = \"follows_tangent\"\n[safety]\ntracking_error_m = 100.0\n";
    let mut bench = Bench::new(plan(&(BMM.to_string() + eight)));
    bench.enable();
    let mut random = Random(0x5EED_0001);
    let mut rates = Rates::default();
    let mut twist = Twist2::default();
    let (mut silent_until, mut stops, mut silences, mut tracks) = (0, 0, 0, 0);
    for cycle in 0..1_000_000_u32 {
        if random.within(1.0) > 0.99 {
            twist = match cycle % 4 {
                0 => twist.scaled(-1.0),
                1 | 2 => Twist2::new(random.within(0.7), random.within(0.7), random.within(1.5)),
                _ => Twist2::default(),
            };
        }
        let frame = if cycle / 1000 % 2 == 0 { Frame::Body } else { Frame::Odom };
        let mut request = Some(RequestKind::Velocity { twist, frame });
        match random.within(1.0) {
            // Somebody stops it in full motion; the next command resumes at once, mid-ramp where it may.
            chance if chance > 0.999 => {
                stops += 1;
                request = Some(RequestKind::Stop(StopCategory::RampAndHold));
            }
            // The command's source falls silent for up to a second: its command grows old, the platform ramps down.
            chance if chance < -0.9995 => {
                silences += 1;
                silent_until = cycle + (random.within(1000.0).abs() as u32);
            }
            _ => {}
        }
        if cycle < silent_until {
            request = (bench.robot.phase() == Phase::Holding).then_some(RequestKind::Track);
            tracks += u32::from(request.is_some());
        }
        let record = bench.step(request);
        let fine = [SafetyReason::None, SafetyReason::Requested, SafetyReason::CommandAge];
        assert!(fine.contains(&record.stop_reason), "cycle {cycle}: {:?}", record.stop_reason);
        rates.watch(&record);
    }
    println!("{stops} stops, {silences} silences, {tracks} references started; {:?}", rates.greatest);
    assert!(stops > 200 && silences > 100 && tracks > 10, "{stops} {silences} {tracks}");
    rates.within(&bench);
}

#[test]
fn saturated_wheels_keep_the_direction() {
    let slow = BMM.replace("wheel_speed_rad_s = 15.0", "wheel_speed_rad_s = 4.0")
        + "\n[safety]\ntracking_error_m = 10.0\n";
    let mut random = Random(0x5EED_0002);
    let mut saturated = 0;
    for _ in 0..20 {
        let mut bench = Bench::new(plan(&slow));
        bench.enable();
        let (vx, vy) = (random.within(0.7), random.within(0.7));
        let wished = vy.atan2(vx);
        for cycle in 0..1500 {
            bench.step(Some(RequestKind::Velocity { twist: Twist2::new(vx, vy, 0.0), frame: Frame::Odom }));
            let record = bench.robot.record();
            saturated += u32::from(record.commands.saturation < 1.0);
            if cycle > 100 && bench.twist_in_body.speed_m_s() > 0.05 {
                let found = bench.twist_in_body.vy_m_s.atan2(bench.twist_in_body.vx_m_s);
                let off = (found - wished).sin().abs().to_degrees();
                assert!(off < 0.1, "{off}° off, saturation {}", record.commands.saturation);
            }
        }
    }
    assert!(saturated > 5000, "{saturated}");
}

#[test]
fn saturated_torques_keep_the_direction() {
    for law in laws_of_torque() {
        let weak = controlled(BMM, law, "\n[safety]\ntracking_error_m = 10.0\n")
            .replace("wheel_torque_nm = 21.0", "wheel_torque_nm = 2.5");
        saturated_keeps_the_direction(law, &weak);
    }
}

fn saturated_keeps_the_direction(law: &str, weak: &str) {
    let mut random = Random(0x5EED_0005);
    let mut saturated = 0;
    for _ in 0..20 {
        let mut bench = Bench::new(plan(weak));
        // What rubs isn't scaled with the torques.
        bench.friction_nm = 0.0;
        bench.enable();
        let (vx, vy) = (random.within(0.7), random.within(0.7));
        let wished = vy.atan2(vx);
        for cycle in 0..1500 {
            bench.step(Some(RequestKind::Velocity { twist: Twist2::new(vx, vy, 0.0), frame: Frame::Odom }));
            saturated += u32::from(bench.robot.record().commands.saturation < 1.0);
            if cycle > 100 && bench.twist_in_body.speed_m_s() > 0.05 {
                let twist = bench.twist_in_body.rotated(bench.pose.heading_rad);
                let off = (twist.vy_m_s.atan2(twist.vx_m_s) - wished).sin().abs().to_degrees();
                let saturation = bench.robot.record().commands.saturation;
                // Behind the saturation the loop alone brings it back.
                let most = if saturation < 1.0 { 0.1 } else { 0.2 };
                assert!(off < most, "{law}: {off}° off in cycle {cycle}, saturation {saturation}");
            }
        }
    }
    assert!(saturated > 2000, "{law}: {saturated}");
}

#[test]
fn the_adaptive_law_learns_the_mass_and_stays_bounded() {
    // 170 kg where 85 kg were expected: half.
    let eight = "\n[reference]\nkind = \"eight\"\nhalf_length_m = 0.8\nturns = 5\nduration_s = 75\nheading = \"fixed\"\n";
    let text = controlled(BMM, "adaptive_torque", eight)
        .replace("mass_kg = 70.0            #", "mass_kg = 85.0 #")
        .replace("[simulation]\nmass_kg = 70.0", "[simulation]\nmass_kg = 170.0");
    let mut bench = Bench::new(plan(&text));
    let mut after_minute = None;
    let (mut least, mut most) = ([f64::MAX; 3], [f64::MIN; 3]);
    let run = track(&mut bench, &mut |record| {
        if record.time.now_ns > 60_000_000_000 && after_minute.is_none() {
            after_minute = Some(record.grip.dynamics.mass_kg);
        }
        let Dynamics { mass_kg, inertia_kg_m2, .. } = record.grip.dynamics;
        for (axis, estimate) in [mass_kg, inertia_kg_m2, record.force_n].into_iter().enumerate() {
            least[axis] = least[axis].min(estimate);
            most[axis] = most[axis].max(estimate);
        }
        assert_eq!(record.commands.quantity, Quantity::Torque);
    });
    let learnt = after_minute.expect("longer than a minute");
    println!("learnt {learnt:.2} kg of 170, rms {:.6} m, estimates {least:?} to {most:?}", run.rms_m);
    assert!((learnt - 170.0).abs() < 17.0, "{learnt}");
    assert!(least[0] >= 8.5 && most[0] <= 850.0 && most[1] <= 70.0 && most[2] <= 100.0, "{least:?} {most:?}");
}

#[test]
fn no_force_is_learnt_while_saturated() {
    let text =
        controlled(BMM, "adaptive_torque", CIRCLE).replace("wheel_torque_nm = 21.0", "wheel_torque_nm = 0.4");
    let mut bench = Bench::new(plan(&text));
    bench.enable();
    bench.step(Some(RequestKind::Track));
    let mut before = bench.robot.record().force_n;
    let mut saturated = 0;
    for _ in 0..4000 {
        let record = bench.step(None);
        if record.phase == Phase::Tracking && record.commands.saturation < 1.0 {
            saturated += 1;
            assert_eq!(record.force_n, before);
        }
        before = record.force_n;
    }
    assert!(saturated > 500, "{saturated}");
}

#[test]
fn controllers_and_modes_are_switched_while_moving() {
    let text = BMM.replace(
        "kind = \"closed_loop_speed\"",
        "kind = \"closed_loop_speed\"\nothers = [\"adaptive_torque\"]",
    );
    let mut bench = Bench::new(plan(&(text + CIRCLE)));
    bench.enable();
    bench.step(Some(RequestKind::Track));
    let (mut before, mut greatest_jump) = (bench.twist_in_body, 0.0_f64);
    for cycle in 0..8000_u32 {
        let request = match cycle {
            2000 | 6000 => Some(RequestKind::SwitchController { index: 1 }),
            4000 => Some(RequestKind::SwitchController { index: 0 }),
            4001 => Some(RequestKind::SwitchController { index: 9 }),
            _ => None,
        };
        let record = bench.step(request);
        assert_eq!(
            (record.phase, record.stop_reason),
            (Phase::Tracking, SafetyReason::None),
            "cycle {cycle}"
        );
        let refused = record.answer == omnibase_robot::signals::RequestAnswer::Refused;
        assert_eq!(refused, cycle == 4001);
        if matches!(cycle, 3000 | 5000 | 7000) {
            let torque = cycle != 5000;
            assert!(
                record
                    .measurements
                    .present()
                    .iter()
                    .all(|drive| drive.mode_code == if torque { 10 } else { 9 })
            );
            assert_eq!(record.controller, u64::from(torque));
        }
        let error_m = record.wished.odom_from_body.distance_m(record.state.odom_from_body);
        assert!(error_m < 2e-3, "cycle {cycle}: {error_m}");
        let now = bench.twist_in_body;
        greatest_jump = greatest_jump.max((now.vx_m_s - before.vx_m_s).hypot(now.vy_m_s - before.vy_m_s));
        before = now;
    }
    // At most 10 m/s² in a cycle of 1 ms: nothing jumps.
    assert!(greatest_jump < 0.01, "{greatest_jump}");
}

#[test]
fn the_adaptive_law_learns_the_inertia_too() {
    // 14 kg·m² where 7 were expected; the heading follows a figure of eight.
    let eight = "\n[reference]\nkind = \"eight\"\nhalf_length_m = 0.8\nturns = 5\nduration_s = 130\nheading = \"follows_tangent\"\n";
    let text = controlled(BMM, "adaptive_torque", eight).replace(
        "[simulation]\nmass_kg = 70.0\ninertia_kg_m2 = 7.0",
        "[simulation]\nmass_kg = 70.0\ninertia_kg_m2 = 14.0",
    );
    let mut bench = Bench::new(plan(&text));
    let mut learnt = 0.0;
    track(&mut bench, &mut |record| learnt = record.estimates()[1]);
    println!("learnt {learnt:.2} kg·m² of 14");
    assert!((learnt - 14.0).abs() < 2.8, "{learnt}");
}
