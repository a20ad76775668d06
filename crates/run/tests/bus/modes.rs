//! Each drive its own mode: two equal drives, one commanded by torque, one by speed.

use omnibase_cia402::Mode;
use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_robot::config::DriveMode;
use omnibase_robot::signals::{Phase, RequestAnswer, SafetyAction, StopCategory};
use omnibase_robot::{CycleRecord, ImageBuffer, Registry, RequestKind, Robot, RobotPlan};
use omnibase_run::{RobotText, simulated};

use crate::bench::{self, BMM, Bench};

const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 8.0\n";

/// The BMM on a circle, so many of its equal drives commanded by torque.
fn plan(by_torque: usize) -> RobotPlan {
    let mut text = BMM.replace(
        "[drive_defaults]",
        "[drive_defaults]\nspeed_loop_gain_nm_s_rad = 20.0\nspeed_loop_integral_s = 0.05",
    );
    for wheel in 1..=by_torque {
        let name = format!("name = \"wheel_{wheel}\"");
        assert!(text.contains(&name));
        text = text.replace(&name, &format!("{name}\nmode = \"torque\""));
    }
    let text = format!("{text}\n{CIRCLE}");
    RobotText { text, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap().plan
}

/// How far the platform ever was from where its circle led it, m, and every cycle of it, with more that is asked on the
/// way.
fn circled(plan: &RobotPlan, asked: &[(usize, RequestKind)]) -> (f64, Vec<CycleRecord>) {
    let (segment, machine) = simulated::segment(plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(plan, link, clock);
    let mut records = Vec::new();
    let mut worst_m: f64 = 0.0;
    for cycle in 0..12_000 {
        let request = match cycle {
            1 => Some(RequestKind::Enable),
            1000 => Some(RequestKind::Track),
            _ => asked.iter().find(|(at, _)| *at == cycle).map(|(_, kind)| *kind),
        };
        bench.cycle(request);
        let record = *bench.robot.record();
        records.push(record);
        let (wished, truth) = (record.setpoint.odom_from_body, machine.truth().pose);
        if cycle > 1000 {
            worst_m = worst_m.max((wished.x_m - truth.x_m).hypot(wished.y_m - truth.y_m));
        }
        assert_ne!(bench.robot.phase(), Phase::Fault, "{:?}", record.stop_reason);
        if cycle > 1001 && bench.robot.phase() == Phase::Holding {
            return (worst_m, records);
        }
    }
    panic!("{:?}", bench.robot.phase());
}

/// A robot of the plan computes all of it again to the bit.
fn is_computed_again(plan: &RobotPlan, records: &[CycleRecord]) {
    let mut robot = Robot::build(plan, &Registry::with_built_in()).unwrap();
    let mut buffer = ImageBuffer::new(plan);
    for record in records {
        assert_eq!(robot.replay(record, &mut buffer), record, "cycle {}", record.time.index);
    }
}

#[test]
fn two_equal_drives_run_one_by_torque_and_one_by_speed_and_all_is_computed_again() {
    let (by_speed_m, _) = circled(&plan(0), &[]);
    let plan = plan(1);
    assert_eq!(plan.drives[0].identity, plan.drives[1].identity, "the same product");
    let (mixed_m, records) = circled(&plan, &[]);
    let modes = [Mode::CyclicSynchronousTorque, Mode::CyclicSynchronousVelocity];
    let shown = records[2000].measurements.drives;
    assert_eq!([shown[0].mode_code, shown[1].mode_code], modes.map(Mode::code));
    // The first is told torques, and its target speed is where it is; the second is told speeds.
    let word = |wheel: usize, at: usize, length: usize| {
        let bytes = &records[2000].outputs[wheel].0[at..at + length];
        bytes.iter().rev().fold(0_i64, |word, byte| word << 8 | i64::from(*byte))
    };
    assert_ne!(word(0, 10, 2), 0);
    println!(
        "from its set point at most: {by_speed_m:.6} m with all by speed, {mixed_m:.6} m with one by torque"
    );
    assert!(
        (5e-4..1.1e-3).contains(&by_speed_m) && (mixed_m - by_speed_m).abs() < 1e-4,
        "by speed {by_speed_m} m, one by torque {mixed_m} m"
    );
    is_computed_again(&plan, &records);
}

#[test]
fn one_drive_changes_its_mode_while_the_robot_moves() {
    let (by_speed_m, _) = circled(&plan(0), &[]);
    let set = |wheel, mode| RequestKind::SetDriveMode { wheel, mode };
    let asked = [
        (3000, set(0, Some(DriveMode::Torque))),
        (4000, set(1, Some(DriveMode::Torque))),
        (5000, set(0, None)),
        (6000, set(1, Some(DriveMode::Speed))),
        (6100, set(3, None)),
    ];
    let (changed_m, records) = circled(&plan(0), &asked);
    let answers = asked.map(|(cycle, _)| records[cycle].answer);
    assert_eq!(answers[..4], [RequestAnswer::Taken; 4]);
    assert_eq!(answers[4], RequestAnswer::DriveMode, "there is no fourth wheel");
    let (speed, torque) = (Mode::CyclicSynchronousVelocity.code(), Mode::CyclicSynchronousTorque.code());
    let shown = |cycle: usize| [0, 1, 2].map(|wheel| records[cycle].measurements.drives[wheel].mode_code);
    assert_eq!(shown(2999), [speed; 3]);
    assert_eq!(shown(3500), [torque, speed, speed]);
    assert_eq!(shown(4500), [torque, torque, speed]);
    assert_eq!(shown(5500), [speed, torque, speed]);
    assert_eq!(shown(6500), [speed; 3]);
    println!(
        "from its set point at most: {by_speed_m:.6} m with all by speed, {changed_m:.6} m with changes on the way"
    );
    assert!(changed_m - by_speed_m < 5e-4, "by speed {by_speed_m} m, with changes {changed_m} m");
    is_computed_again(&plan(0), &records);
}

#[test]
fn a_mode_in_which_a_law_of_the_file_cant_be_followed_is_refused() {
    let answer_of = |plan: &RobotPlan, mode| {
        let mut bench = Bench::new(plan);
        bench.enable();
        bench.cycle(Some(RequestKind::SetDriveMode { wheel: 1, mode }));
        bench.robot.record().answer
    };
    let without_loop = bench::plan(CIRCLE);
    assert_eq!(answer_of(&without_loop, Some(DriveMode::Torque)), RequestAnswer::DriveMode);
    assert_eq!(answer_of(&without_loop, Some(DriveMode::Speed)), RequestAnswer::Taken);
    let with_torques = bench::plan_changed(CIRCLE, &["controller.others = [\"adaptive_torque\"]"]);
    assert_eq!(answer_of(&with_torques, Some(DriveMode::Speed)), RequestAnswer::DriveMode);
    // While it comes to rest nothing is changed.
    let mut bench = Bench::new(&plan(0));
    bench.enable();
    bench.cycle(Some(RequestKind::Track));
    bench.run(1000);
    bench.cycle(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
    bench.cycle(Some(RequestKind::SetDriveMode { wheel: 1, mode: Some(DriveMode::Torque) }));
    assert_eq!(bench.robot.record().answer, RequestAnswer::WrongPhase);
}

#[test]
fn a_wheel_that_was_put_in_torque_and_isnt_heard_never_ramps_blindly() {
    let mut plan = plan(0);
    plan.safety.lost_device_stop = SafetyAction::Stop(StopCategory::RampThenRemove);
    let mut bench = Bench::new(&plan);
    bench.enable();
    bench.cycle(Some(RequestKind::SetDriveMode { wheel: 0, mode: Some(DriveMode::Torque) }));
    bench.cycle(Some(RequestKind::Track));
    bench.run(1000);
    bench.inject(2, Fault::PowerOff);
    let is_moving = |bench: &Bench| bench.robot.phase() == Phase::Tracking;
    while is_moving(&bench) {
        bench.cycle(None);
    }
    assert_eq!(bench.robot.phase(), Phase::QuickStopping);
}

#[test]
fn a_wheel_by_torque_that_isnt_heard_never_ramps_blindly() {
    let mut plan = plan(1);
    plan.safety.lost_device_stop = SafetyAction::Stop(StopCategory::RampThenRemove);
    let mut bench = Bench::new(&plan);
    bench.enable();
    bench.cycle(Some(RequestKind::Track));
    bench.run(1000);
    // The last one: the others are heard.
    bench.inject(2, Fault::PowerOff);
    let mut first = None;
    for _ in 0..100 {
        bench.cycle(None);
        if bench.robot.phase() != Phase::Tracking {
            first = first.or(Some(bench.robot.phase()));
        }
    }
    assert_eq!(first, Some(Phase::QuickStopping), "a torque goes on pushing whatever happens");
}
