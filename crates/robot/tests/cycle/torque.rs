//! The torque limit: what drives are told of it, what is set lower while the robot runs, what a torque above it does.

use omnibase_platform::Twist2;
use omnibase_robot::config::TorqueLimitTold;
use omnibase_robot::signals::{Batch, Frame, RequestAnswer, SafetyReason};
use omnibase_robot::{CycleRecord, Exchange, Phase, RequestKind};

use super::support::{BMM, Bench, MECANUM, laws, laws_of_torque, plan};

/// Max torque, positive and negative torque limit value.
const MAX_TORQUE: u16 = 0x6072;
const POSITIVE: u16 = 0x60E0;
const NEGATIVE: u16 = 0x60E1;

fn with_limit(robot: &str, limit_nm: f64) -> String {
    let line = robot.lines().find(|line| line.starts_with("wheel_torque_nm")).unwrap();
    robot.replace(line, &format!("wheel_torque_nm = {limit_nm:?}"))
}

fn with_law(robot: &str, law: &str) -> String {
    let more = format!("kind = \"{law}\"\nmass_kg = 70.0\ninertia_kg_m2 = 7.0\n");
    let begin = robot.find("[controller]").unwrap();
    let end = robot.find("[simulation]").unwrap();
    format!("{}[controller]\n{more}\n{}", &robot[..begin], &robot[end..])
}

fn told(bench: &Bench, object: u16) -> Vec<i64> {
    (0..bench.plan.drives.len()).map(|wheel| bench.output(wheel, object)).collect()
}

fn set(bench: &mut Bench, name: &str, value: f64) -> RequestAnswer {
    let index = bench.robot.settings().find(|(_, setting)| setting.name == name).unwrap().0;
    bench.step(Some(RequestKind::Set { index, value, batch: Batch::ALONE })).answer
}

fn forward(bench: &mut Bench, speed_m_s: f64, cycles: u32) -> Vec<CycleRecord> {
    let twist = Twist2::new(speed_m_s, 0.0, 0.0);
    (0..cycles).map(|_| bench.step(Some(RequestKind::Velocity { twist, frame: Frame::Body }))).collect()
}

#[test]
fn every_drive_is_told_its_limit_in_every_cycle_under_every_law() {
    for law in laws() {
        // 7 N·m rated; and 1.3 N·m with a gear of 10: 13 N·m at the wheel. Never rounded up.
        for (robot, limit_nm, per_mille) in [
            (BMM, 1.0, 142),
            (BMM, 2.0, 285),
            (BMM, 21.0, 3000),
            (MECANUM, 1.0, 76),
            (MECANUM, 2.0, 153),
            (MECANUM, 21.0, 1615),
        ] {
            let mut bench = Bench::new(plan(&with_limit(&with_law(robot, law), limit_nm)));
            for cycle in 0..50 {
                bench.step(if cycle == 10 { Some(RequestKind::Enable) } else { None });
                assert!(
                    told(&bench, MAX_TORQUE).iter().all(|told| *told == per_mille),
                    "{law} {limit_nm} N·m"
                );
            }
            let scale = bench.plan.drives[0].scale;
            let told_nm = per_mille as f64 * scale.rated_torque_nm * scale.gear_ratio / 1000.0;
            assert!(told_nm <= limit_nm * (1.0 + 1e-12) && limit_nm - told_nm < 0.014, "{told_nm}");
        }
    }
}

#[test]
fn a_target_torque_is_never_rounded_above_the_limit() {
    // Half of the drive's unit above 142 of it: the nearest would be 143.
    let mut bench = Bench::new(plan(&with_limit(&with_law(BMM, "adaptive_torque"), 0.9975)));
    bench.enable();
    let mut greatest = 0;
    for _ in 0..600 {
        forward(&mut bench, 0.9, 1);
        greatest = greatest.max(told(&bench, 0x6071).iter().map(|torque| torque.abs()).max().unwrap());
    }
    assert_eq!(greatest, 142, "saturated");
}

#[test]
fn a_drive_with_limits_for_either_direction_is_told_both() {
    let text = with_limit(MECANUM, 2.0)
        .replace("device = \"cia402\"", "device = \"cia402\"\ntorque_limit = \"positive_and_negative\"")
        .replace("6072:16", "60E0:16 60E1:16");
    let mut bench = Bench::new(plan(&text));
    assert_eq!(bench.plan.drives[0].torque_limit.told, TorqueLimitTold::EveryCycle);
    bench.step(None);
    assert!([POSITIVE, NEGATIVE].iter().all(|object| told(&bench, *object) == [153; 4]));
}

#[test]
fn a_limit_that_is_not_mapped_is_a_parameter_and_stays_as_it_is() {
    let mut bench = Bench::new(plan(&with_limit(MECANUM, 2.0).replace(" 6072:16", "")));
    for drive in &bench.plan.drives {
        assert_eq!(drive.torque_limit.told, TorqueLimitTold::AtStartUp);
        let last = drive.parameters.last().unwrap();
        assert_eq!((last.index, last.subindex, &last.data[..]), (MAX_TORQUE, 0, &153_u16.to_le_bytes()[..]));
        assert!(last.origin.contains("limits.wheel_torque_nm = 2"), "{}", last.origin);
    }
    bench.enable();
    assert_eq!(set(&mut bench, "wheel_torque_nm", 1.0), RequestAnswer::AtStartUpOnly);
    assert_eq!(set(&mut bench, "wheel_torque_nm", 2.0), RequestAnswer::Taken, "nothing changes");
}

#[test]
fn a_lower_limit_reaches_the_drives_in_the_cycle_and_none_above_the_file() {
    for law in laws() {
        let mut bench = Bench::new(plan(&with_law(BMM, law)));
        bench.enable();
        assert_eq!(set(&mut bench, "wheel_torque_nm", 2.0), RequestAnswer::Taken);
        assert_eq!(told(&bench, MAX_TORQUE), [285; 3], "{law}");
        for (wrong, why) in [(21.001, "above the file"), (0.0, "no torque"), (f64::NAN, "no number")] {
            assert_eq!(set(&mut bench, "wheel_torque_nm", wrong), RequestAnswer::Refused, "{why}");
        }
        assert_eq!(told(&bench, MAX_TORQUE), [285; 3]);
        let records = forward(&mut bench, 0.8, 300);
        let torque = records
            .iter()
            .filter(|record| record.commands.quantity == omnibase_robot::signals::Quantity::Torque);
        for record in torque {
            assert!(
                record.commands.values[..3].iter().all(|torque| torque.abs() <= 2.0 + 1e-9),
                "{law}: the law knows"
            );
        }
        assert_eq!(set(&mut bench, "wheel_torque_nm", 21.0), RequestAnswer::Taken, "back to the file's");
        assert_eq!(told(&bench, MAX_TORQUE), [3000; 3]);
    }
}

/// For how many cycles of 1 ms a drive of a driven robot may show so much before it stops; at most 400.
fn cycles_until_stop(robot: &str, shows: impl Fn(u32) -> f64) -> Option<(u32, CycleRecord)> {
    let mut bench = Bench::new(plan(robot));
    bench.enable();
    (0..3).for_each(|wheel| bench.lie_about_torque(wheel, 0.0));
    forward(&mut bench, 0.2, 300);
    for cycle in 0..400 {
        bench.lie_about_torque(2, shows(cycle));
        let record = forward(&mut bench, 0.2, 1)[0];
        if record.allowed.reason == SafetyReason::WheelTorque {
            return Some((cycle, record));
        }
    }
    None
}

#[test]
fn a_torque_above_its_limit_stops_when_it_lasts() {
    let limited = with_limit(BMM, 2.0) + "\n[safety]\noscillation_share = 1.0\nslip_m = 1e6\n";
    // 2 N·m and the margin of a twentieth of 7: 2.35.
    assert!(cycles_until_stop(&limited, |_| 2.34).is_none(), "noise of a sensor");
    let (cycle, record) = cycles_until_stop(&limited, |_| -2.37).expect("it lasts");
    assert_eq!((cycle, record.allowed.where_index), (51, 2), "more than 50 ms, and which wheel");
    // Shorter peaks don't stop, nor do those that are rarer than their pauses; others do, however they are cut up.
    assert!(cycles_until_stop(&limited, |cycle| if cycle % 100 < 45 { 6.0 } else { 0.0 }).is_none());
    assert!(cycles_until_stop(&limited, |cycle| if cycle % 5 < 2 { 6.0 } else { 0.0 }).is_none());
    assert!(cycles_until_stop(&limited, |cycle| if cycle % 5 < 3 { 6.0 } else { 0.0 }).is_some());
    // A tenth of a higher limit.
    let higher = with_limit(BMM, 14.0) + "\n[safety]\nslip_m = 1e6\n";
    assert!(cycles_until_stop(&higher, |_| 15.3).is_none());
    assert!(cycles_until_stop(&higher, |_| 15.5).is_some());
    let told = format!("{limited}wheel_torque_margin_nm = 1.0\nwheel_torque_time_ms = 10\n");
    assert!(cycles_until_stop(&told, |_| 2.9).is_none());
    assert_eq!(cycles_until_stop(&told, |_| 3.1).unwrap().0, 11);
}

#[test]
fn time_above_a_limit_counts_and_not_cycles() {
    let slow =
        with_limit(BMM, 2.0).replace("cycle_us = 1000", "cycle_us = 4000") + "\n[safety]\nslip_m = 1e6\n";
    assert_eq!(cycles_until_stop(&slow, |_| 5.0).unwrap().0, 13, "52 ms");
}

#[test]
fn a_torque_above_its_limit_does_what_the_file_names() {
    for (name, phase) in [("category_0", Phase::Disabled), ("category_2", Phase::Stopping)] {
        let text = format!("{}\n[safety]\nwheel_torque_stop = \"{name}\"\n", with_limit(BMM, 2.0));
        let mut bench = Bench::new(plan(&text));
        bench.enable();
        forward(&mut bench, 0.2, 300);
        bench.lie_about_torque(1, 6.0);
        while bench.robot.record().stop_reason != SafetyReason::WheelTorque {
            forward(&mut bench, 0.2, 1);
            assert!(bench.index < 2000, "it stops");
        }
        let now = bench.robot.phase();
        let expected =
            if name == "category_0" { matches!(now, Phase::Fault | Phase::Disabled) } else { now == phase };
        assert!(expected, "{name}: {now:?}");
    }
}

#[test]
fn a_lower_limit_counts_for_what_is_measured() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    bench.lie_about_torque(0, 5.0);
    bench.run(200);
    assert_eq!(bench.robot.phase(), Phase::Holding, "5 of 21 N·m");
    assert_eq!(set(&mut bench, "wheel_torque_nm", 2.0), RequestAnswer::Taken);
    bench.run(60);
    assert_eq!(bench.robot.record().stop_reason, SafetyReason::WheelTorque);
}

#[test]
fn a_lower_wheel_speed_slows_without_a_jump() {
    for law in ["closed_loop_speed", "adaptive_torque"] {
        let mut bench = Bench::new(plan(&with_law(BMM, law)));
        bench.enable();
        forward(&mut bench, 0.9, 1500);
        let fastest = |record: &CycleRecord| {
            record.measurements.present().iter().map(|drive| drive.speed_rad_s.abs()).fold(0.0, f64::max)
        };
        let mut before = fastest(bench.robot.record());
        assert!(before > 7.0, "{law}: {before}");
        assert_eq!(set(&mut bench, "wheel_speed_rad_s", 2.0), RequestAnswer::Taken);
        for record in forward(&mut bench, 0.9, 2500) {
            // 1.5 m/s² at 0.1 m, with what feedback adds: no wheel brakes harder.
            assert!(before - fastest(&record) < 0.04, "{law}: {before} to {}", fastest(&record));
            assert_eq!(record.allowed.reason, SafetyReason::None, "{law}");
            before = fastest(&record);
        }
        assert!(before <= 2.0 + 1e-3 && before > 1.5, "{law}: {before}");
        assert_eq!(bench.robot.phase(), Phase::Tracking);
        assert_eq!(set(&mut bench, "wheel_speed_rad_s", 15.1), RequestAnswer::Refused);
        assert_eq!(set(&mut bench, "wheel_speed_rad_s", 15.0), RequestAnswer::Taken);
        let last = *forward(&mut bench, 0.9, 2500).last().unwrap();
        assert!(fastest(&last) > 7.0, "{law}: up again");
    }
}

#[test]
fn limits_have_the_same_places_with_every_law() {
    let laws = laws();
    let kind = format!("kind = \"{}\"", laws[0]);
    let text = with_law(BMM, laws[0]).replace(&kind, &format!("{kind}\nothers = {laws:?}"));
    let mut bench = Bench::new(plan(&text));
    let places = |bench: &Bench| -> Vec<(u32, &str)> {
        let of_wheels = |name: &str| name.starts_with("wheel_");
        bench
            .robot
            .settings()
            .filter(|(_, gain)| of_wheels(gain.name))
            .map(|(index, gain)| (index, gain.name))
            .collect()
    };
    let first = places(&bench);
    assert_eq!(first, [(46, "wheel_speed_rad_s"), (47, "wheel_torque_nm")]);
    for index in 1..=laws.len() as u32 {
        assert_eq!(bench.step(Some(RequestKind::SwitchController { index })).answer, RequestAnswer::Taken);
        assert_eq!(places(&bench), first);
    }
}

#[test]
fn nothing_is_learnt_while_a_drive_holds_back_by_a_limit_of_its_own() {
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 8.0\n";
    for law in laws_of_torque() {
        let mut bench = Bench::new(plan(&(with_law(BMM, law) + circle)));
        bench.enable();
        bench.step(Some(RequestKind::Track));
        bench.run(500);
        let learnt = |bench: &mut Bench, is_limited| {
            bench.limit_drive(2, is_limited);
            bench.step(None);
            let learnt = |record: &CycleRecord| (record.grip.dynamics, record.force_n);
            let before = learnt(bench.robot.record());
            bench.run(500);
            assert_eq!(bench.robot.phase(), Phase::Tracking, "{law}");
            let after = learnt(bench.robot.record());
            (after.0 != before.0, after.1 != before.1)
        };
        assert_eq!(learnt(&mut bench, true), (false, false), "{law}");
        assert_eq!(learnt(&mut bench, false), (true, true), "{law}");
    }
}

#[test]
fn no_mass_is_learnt_while_every_tenth_exchange_is_lost() {
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 8.0\n";
    let mut bench = Bench::new(plan(&(with_law(BMM, "adaptive_torque") + circle)));
    bench.enable();
    let learnt = |record: CycleRecord| [record.estimates()[0], record.estimates()[1]];
    let first = learnt(bench.step(Some(RequestKind::Track)));
    for cycle in 0..1500_u32 {
        bench.exchange = if cycle.is_multiple_of(10) { Exchange::Lost } else { Exchange::Complete };
        bench.step(None);
    }
    let record = bench.robot.record();
    assert_eq!((record.phase, learnt(*record)), (Phase::Tracking, first));
    assert_ne!(learnt(bench.run(500)), first);
}
