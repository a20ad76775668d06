//! Plans that use what wheels and floor give: only a platform that goes as planned is let do more than is carried in whatever direction.

use omnibase_platform::Twist2;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Course, LimitedBy, SafetyReason};
use omnibase_robot::{CycleRecord, Phase, RequestKind};

use super::support::{BMM, Bench, plan};

/// The file's acceleration limit, which no longer binds, m/s².
const ACCELERATION_M_S2: f64 = 6.0;
/// What jerk adds while a setpoint comes down to other limits, m/s².
const COMES_DOWN_M_S2: f64 = 1e-6;

/// A square of 2 m with its corners cut.
const SQUARE: &str = "[reference]\nkind = \"path\"\ntiming = \"fastest\"\ncorner_m = 0.05\n\
                      points = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]\n";

fn bench(mass_kg: f64, more: &str) -> Bench {
    let high = [
        ("speed_m_s", "1.5"),
        ("acceleration_m_s2", "6.0"),
        ("jerk_m_s3", "400.0"),
        ("turn_acceleration_rad_s2", "20.0"),
        ("turn_jerk_rad_s3", "1600.0"),
    ];
    let mut text = BMM.to_owned();
    for (key, value) in high {
        let line = text.lines().find(|line| line.starts_with(&format!("{key} ="))).unwrap().to_owned();
        text = text.replace(&format!("\n{line}\n"), &format!("\n{key} = {value}\n"));
    }
    let (begin, end) = (text.find("[controller]").unwrap(), text.find("[simulation]").unwrap());
    let law =
        format!("[controller]\nkind = \"closed_loop_speed\"\nmass_kg = {mass_kg:?}\ninertia_kg_m2 = 7.0\n\n");
    let text = format!("{}{law}{}", &text[..begin], &text[end..]);
    let grip = "\n[grip]\ncentre_of_mass_height_m = 0.25\nfriction = 0.5\n";
    let mut bench = Bench::new(plan(&format!("{text}{grip}{SQUARE}{more}")));
    bench.mass_kg = 70.0;
    bench.inertia_kg_m2 = 7.0;
    bench.enable();
    bench
}

/// How much more than is carried in every direction a setpoint takes, m/s².
fn more_m_s2(record: &CycleRecord) -> f64 {
    let Twist2 { vx_m_s, vy_m_s, .. } = record.setpoint.acceleration_in_odom;
    vx_m_s.hypot(vy_m_s) - record.traction.share * ACCELERATION_M_S2
}

/// Drives until the platform stands; the last cycle.
fn drive(bench: &mut Bench, look: &mut dyn FnMut(u64, &mut Bench, &CycleRecord)) -> CycleRecord {
    bench.step(Some(RequestKind::Track));
    for cycle in 0..60_000 {
        let record = bench.step(None);
        look(cycle, bench, &record);
        if bench.robot.phase() != Phase::Tracking {
            return record;
        }
    }
    panic!("it doesn't end");
}

#[test]
fn who_goes_as_planned_may_do_more_than_every_direction_carries() {
    let mut bench = bench(70.0, "");
    let (mut cycles, mut most_m_s2, mut lag_m) = (0, 0.0_f64, 0.0_f64);
    let last = drive(&mut bench, &mut |cycle, _, record| {
        cycles = cycle;
        most_m_s2 = most_m_s2.max(more_m_s2(record));
        lag_m = lag_m.max(record.wished.odom_from_body.distance_m(record.setpoint.odom_from_body));
    });
    assert_eq!(last.stop_reason, SafetyReason::None);
    let planned_s = bench.robot.reference_duration_s().unwrap();
    assert!(most_m_s2 > 0.5, "{most_m_s2}");
    assert!(lag_m < 1e-6 && (1e-3 * cycles as f64 - planned_s).abs() < 0.01, "{lag_m} {cycles} {planned_s}");
}

#[test]
fn a_way_around_an_obstacle_keeps_to_what_every_direction_carries() {
    let mut bench = bench(70.0, "");
    // It comes out of nowhere, beside the first side.
    let obstacle = Obstacle { centre_m: [1.5, 0.35], radius_m: 0.2, velocity_m_s: [0.0; 2] };
    let (mut around, mut more) = (0, 0.0_f64);
    let mut since = 0;
    drive(&mut bench, &mut |cycle, bench, record| {
        if cycle == 300 {
            bench.step(Some(RequestKind::SetObstacle { index: 0, obstacle }));
        }
        // It comes down from what was planned within A/J and a cycle.
        since = if record.guard.limited_by == LimitedBy::Nothing { 0 } else { since + 1 };
        if since > 20 {
            around += 1;
            more = more.max(more_m_s2(record));
        }
    });
    assert!(around > 100, "{around}");
    assert!(more < COMES_DOWN_M_S2, "{more} m/s² more than is carried");
}

#[test]
fn who_is_off_the_plan_keeps_to_it_too_until_the_plan_needs_no_more() {
    let mut bench = bench(70.0, "");
    let obstacle = Obstacle { centre_m: [1.5, 0.35], radius_m: 0.2, velocity_m_s: [0.0; 2] };
    let (mut behind, mut more) = (0, 0.0_f64);
    drive(&mut bench, &mut |cycle, bench, record| {
        if cycle == 300 {
            bench.step(Some(RequestKind::SetObstacle { index: 0, obstacle }));
        }
        if cycle == 900 {
            bench.step(Some(RequestKind::RemoveObstacle { index: 0 }));
        }
        if cycle > 920 && record.course == Course::Onto {
            behind += 1;
            more = more.max(more_m_s2(record));
        }
    });
    assert!(behind > 100, "{behind}");
    assert!(more < COMES_DOWN_M_S2, "{more} m/s² more than is carried");
}

#[test]
fn a_payload_that_was_found_takes_the_plan_back_to_what_every_direction_carries() {
    // Told without its payload of 30 kg.
    let mut bench = bench(40.0, "");
    let (mut found, mut more) = (0, 0.0_f64);
    let mut since = 0;
    let last = drive(&mut bench, &mut |_, _, record| {
        since = if record.grip.dynamics.mass_kg - 3.0 * record.grip.mass_sigma_kg > 1.06 * 40.0 {
            since + 1
        } else {
            0
        };
        if since > 20 {
            found += 1;
            more = more.max(more_m_s2(record));
        }
    });
    assert_eq!(last.stop_reason, SafetyReason::None);
    assert!(found > 1000, "{found}: {:?}", last.grip.dynamics);
    assert!(more < COMES_DOWN_M_S2, "{more} m/s² more than is carried");
}

#[test]
fn a_pause_and_going_on_ask_for_little_more_than_was_planned_with() {
    for at in [500, 700, 900, 1100, 1300, 1500, 1700, 2100] {
        let mut bench = bench(70.0, "");
        let ability = omnibase_robot::Ability::of(&bench.plan);
        let (mut friction, mut off_m) = (0.0_f64, 0.0_f64);
        let mut look = |record: &CycleRecord| {
            friction = friction.max(ability.friction_needed(&record.setpoint));
            off_m = off_m.max(record.wished.odom_from_body.distance_m(record.setpoint.odom_from_body));
        };
        drive(&mut bench, &mut |cycle, bench, record| {
            look(record);
            if cycle == at {
                look(&bench.step(Some(RequestKind::Pause)));
            }
        });
        bench.run(10);
        assert_eq!(bench.robot.phase(), Phase::Holding);
        bench.step(Some(RequestKind::Resume));
        while bench.robot.phase() == Phase::Tracking {
            look(&bench.step(None));
        }
        println!("paused after {at}: friction {friction:.3}, {:.1} mm off", 1e3 * off_m);
        assert!(friction < 0.45, "at {at}: friction {friction}, {off_m} m off");
    }
}

#[test]
fn motors_that_are_warm_bear_a_plan_at_less_than_its_rate() {
    let mut bench = bench(70.0, "");
    // Every motor gives a fifth more than it bears for ever, while the platform stands.
    for wheel in 0..3 {
        bench.lie_about_torque(wheel, 1.2 * 7.0);
    }
    bench.run(20_000);
    for wheel in 0..3 {
        bench.lie_about_torque(wheel, None);
    }
    let mut most = 0.0_f64;
    drive(&mut bench, &mut |_, _, record| most = most.max(record.reference_rate));
    assert!((0.5..0.9).contains(&most), "{most}");
}
