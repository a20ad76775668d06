//! A robot's life: enabling, holding, moving, every way to stop, and back.

use crate::support::{BMM, Bench, MECANUM, plan};
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, RequestAnswer, SafetyReason, Stage, StopCategory};
use omnibase_robot::{Exchange, Phase, RequestKind};

fn forward(speed_m_s: f64) -> RequestKind {
    RequestKind::Velocity { twist: Twist2::new(speed_m_s, 0.0, 0.0), frame: Frame::Body }
}

/// Drives forward at a speed for so many cycles, the command renewed in each.
fn drive(bench: &mut Bench, speed_m_s: f64, cycles: u64) {
    for _ in 0..cycles {
        bench.step(Some(forward(speed_m_s)));
    }
}

#[test]
fn enabling_does_not_move_the_platform() {
    for robot in [BMM, MECANUM] {
        let mut bench = Bench::new(plan(robot));
        bench.enable();
        let record = bench.run(1000);
        assert_eq!(record.phase, Phase::Holding);
        assert!(bench.pose.x_m.abs() < 1e-12 && bench.pose.heading_rad.abs() < 1e-12, "{:?}", bench.pose);
        assert!(record.measurements.present().iter().all(|drive| drive.status.0 & 0x6F == 0x27));
    }
}

#[test]
fn a_velocity_command_moves_and_its_end_ramps_to_hold() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    drive(&mut bench, 0.3, 1000);
    let record = *bench.robot.record();
    assert_eq!(record.phase, Phase::Tracking);
    assert!((bench.twist_in_body.vx_m_s - 0.3).abs() < 1e-3, "{:?}", bench.twist_in_body);
    // Nobody renews it: after 200 ms it no longer counts.
    let record = bench.run(1500);
    assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::CommandAge));
    assert!(bench.twist_in_body.speed_m_s() < 1e-3);
    assert!((record.state.odom_from_body.x_m - bench.pose.x_m).abs() < 1e-6, "odometry knows where it is");
}

#[test]
fn stop_categories_end_as_they_say() {
    for (category, phase, word) in [
        (StopCategory::RemoveTorque, Phase::Disabled, 0x00),
        (StopCategory::RampThenRemove, Phase::Disabled, 0x00),
        (StopCategory::RampAndHold, Phase::Holding, 0x0F),
    ] {
        let mut bench = Bench::new(plan(BMM));
        bench.enable();
        drive(&mut bench, 0.3, 1000);
        bench.step(Some(RequestKind::Stop(category)));
        if category == StopCategory::RemoveTorque {
            assert_eq!(bench.control_word(0), 0, "torque is removed in the same cycle");
        } else {
            assert_eq!(bench.robot.phase(), Phase::Stopping);
            assert_eq!(bench.control_word(0), 0x0F, "torque stays while it ramps");
        }
        let record = bench.run(2000);
        assert_eq!((record.phase, record.stop_reason), (phase, SafetyReason::Requested), "{category:?}");
        assert_eq!(bench.control_word(2) & 0x0F, word, "{category:?}");
        if category != StopCategory::RemoveTorque {
            assert!(bench.twist_in_body.speed_m_s() < 1e-3, "{category:?}");
        }
    }
}

#[test]
fn a_drives_fault_stops_all_drives_and_waits_for_a_person() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    drive(&mut bench, 0.3, 500);
    bench.fail_drive(1);
    bench.run(2);
    assert_eq!(bench.robot.phase(), Phase::QuickStopping);
    assert_eq!(bench.control_word(0), 0x02, "the healthy drives brake by themselves");
    let record = bench.run(6000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::Drive));
    assert_eq!(record.stop_where, 1);
    assert_eq!(bench.step(Some(RequestKind::Enable)).answer, RequestAnswer::WrongPhase, "never by itself");
    bench.repair_drive(1);
    bench.step(Some(RequestKind::Acknowledge));
    bench.run(10);
    bench.enable();
    assert_eq!(bench.robot.phase(), Phase::Holding);
}

#[test]
fn lost_exchanges_are_tolerated_then_stop() {
    let short = Exchange::ShortCount { expected: 9, received: 6 };
    for (lost, reason) in [(Exchange::Lost, SafetyReason::ExchangeLost), (short, SafetyReason::DeviceLost)] {
        let mut bench = Bench::new(plan(BMM));
        bench.enable();
        drive(&mut bench, 0.3, 500);
        bench.exchange = lost;
        drive(&mut bench, 0.3, 3);
        assert_eq!(bench.robot.phase(), Phase::Tracking, "three are tolerated");
        bench.exchange = Exchange::Complete;
        drive(&mut bench, 0.3, 100);
        let record = bench.robot.record();
        assert!((record.state.odom_from_body.x_m - bench.pose.x_m).abs() < 1e-3, "the gap was made up for");
        bench.exchange = lost;
        drive(&mut bench, 0.3, 4);
        assert_eq!(bench.robot.phase(), Phase::QuickStopping);
        assert_eq!(bench.control_word(0), 0x02);
        let record = bench.run(6000);
        assert_eq!((record.phase, record.stop_reason), (Phase::Fault, reason));
        assert_eq!(bench.control_word(0), 0x00);
    }
}

#[test]
fn the_loss_of_a_subdevice_leads_where_the_file_says() {
    let short = Exchange::ShortCount { expected: 9, received: 6 };
    let file = |name: &str| format!("{BMM}\n[safety]\non_lost_device = \"{name}\"\nstop_timeout_ms = 1000\n");
    for (name, phase, control) in [
        ("quick_stop", Phase::QuickStopping, 0x02),
        ("ramp", Phase::Stopping, 0x0F),
        ("remove_torque", Phase::Fault, 0x00),
    ] {
        let mut bench = Bench::new(plan(&file(name)));
        bench.enable();
        drive(&mut bench, 0.3, 500);
        bench.exchange = short;
        drive(&mut bench, 0.3, 4);
        assert_eq!((bench.robot.phase(), bench.control_word(0)), (phase, control), "{name}");
        // Whatever the way: in the end no torque, and nothing moves without a person.
        let record = bench.run(3000);
        assert_eq!((record.phase, bench.control_word(0)), (Phase::Fault, 0x00), "{name}");
        bench.exchange = Exchange::Complete;
        bench.run(1000);
        assert_eq!((bench.robot.phase(), bench.control_word(0)), (Phase::Fault, 0x00), "{name}");
        bench.step(Some(RequestKind::Acknowledge));
        bench.run(10);
        bench.enable();
        assert_eq!(bench.robot.phase(), Phase::Holding, "{name}");
    }
}

#[test]
fn a_drive_that_started_anew_stops_whatever_is_tolerated_and_counts_from_a_new_origin() {
    let text = format!("{BMM}\n[safety]\nlost_exchanges_tolerated = 1000\n");
    let mut bench = Bench::new(plan(&text));
    bench.enable();
    drive(&mut bench, 0.3, 500);
    bench.exchange = Exchange::ShortCount { expected: 9, received: 6 };
    drive(&mut bench, 0.3, 10);
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    let before = bench.robot.record().state.odom_from_body;
    bench.exchange = Exchange::Restarted { wheels: 0b111 };
    bench.step(None);
    assert_eq!(bench.robot.phase(), Phase::QuickStopping);
    bench.exchange = Exchange::Complete;
    let after = bench.step(None).state.odom_from_body;
    assert!(after.distance_m(before) < 1e-9, "{after:?} after {before:?}");
}

#[test]
fn a_command_beyond_the_wheels_limit_is_held_to_it() {
    let text = BMM.replace("wheel_speed_rad_s = 15.0", "wheel_speed_rad_s = 2.0");
    let mut bench = Bench::new(plan(&text));
    bench.enable();
    for _ in 0..3000 {
        bench.step(Some(forward(0.9)));
        assert!(
            bench.robot.record().measurements.present().iter().all(|d| d.speed_rad_s.abs() <= 2.0 + 1e-4)
        );
    }
    assert_eq!(
        bench.robot.record().stop_reason,
        SafetyReason::TrackingError,
        "held to the wheels' limit, it lags"
    );
}

#[test]
fn a_wished_speed_above_its_limit_stops() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let record = bench.step(Some(forward(1.2)));
    assert_eq!(record.allowed.reason, SafetyReason::ReferenceSpeed);
    let record = bench.run(1000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::ReferenceSpeed));
}

#[test]
fn the_rectangle_blocks_only_the_way_out() {
    let fence = "\n[fence]\nrectangle_m = [-1.0, -1.0, 1.0, 1.0]\n";
    let mut bench = Bench::new(plan(&format!("{BMM}{fence}")));
    bench.enable();
    let mut furthest = 0.0_f64;
    for _ in 0..4000 {
        bench.step(Some(forward(0.6)));
        furthest = furthest.max(bench.pose.x_m);
    }
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    assert!((0.5..0.8).contains(&furthest), "{furthest}");
    drive(&mut bench, -0.3, 1000);
    assert!(bench.pose.x_m < furthest - 0.2, "back is free");
}

#[test]
fn a_wheel_whose_drive_sends_no_speed_is_watched_by_its_counts() {
    let silent = MECANUM.replace("606C:32 ", "");
    assert_ne!(silent, MECANUM);
    let mut bench = Bench::new(plan(&silent));
    bench.enable();
    drive(&mut bench, 0.4, 2000);
    let speeds = bench.robot.record().measurements.drives.map(|drive| drive.speed_rad_s);
    let expected = bench.plan.kinematics.wheel_speeds_rad_s(Twist2::new(0.4, 0.0, 0.0));
    for (wheel, expected) in expected.iter().enumerate() {
        assert!((speeds[wheel] - expected).abs() < 0.02 * expected.abs(), "{speeds:?}");
    }
}

#[test]
fn a_velocity_that_is_no_number_is_refused() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    assert_eq!(bench.step(Some(forward(f64::NAN))).answer, RequestAnswer::Refused);
    assert_eq!(bench.robot.phase(), Phase::Holding);
    assert_eq!(Stage::from_code(Stage::Controller.code()), Some(Stage::Controller));
}
