//! Stops on top of stops: a harder one takes over in every phase, a gentler one never weakens.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, RequestAnswer, SafetyReason, StopCategory};
use omnibase_robot::{CycleRecord, Exchange, Phase, RequestKind};

use crate::support::{BMM, Bench, plan};

const SHORT: Exchange = Exchange::ShortCount { expected: 9, received: 6 };

fn forward(speed_m_s: f64) -> RequestKind {
    RequestKind::Velocity { twist: Twist2::new(speed_m_s, 0.0, 0.0), frame: Frame::Body }
}

/// A robot with more in its file, driven forward for half a second.
fn driven(more: &str) -> Bench {
    driven_by(BMM, more)
}

fn driven_by(robot: &str, more: &str) -> Bench {
    let mut bench = Bench::new(plan(&format!("{robot}\n[safety]\n{more}\n")));
    bench.enable();
    for _ in 0..500 {
        bench.step(Some(forward(0.3)));
    }
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    bench
}

/// A robot whose wheels can be turned from outside: its drives give torque, and no more than friction brakes it.
fn pushed(more: &str) -> Bench {
    driven_by(&BMM.replace("\"closed_loop_speed\"", "\"adaptive_torque\""), more)
}

/// Somebody pushes: faster than any command could.
fn push(bench: &mut Bench) {
    bench.twist_in_body = Twist2::new(0.0, 0.0, 6.0);
}

fn found(bench: &Bench) -> (Phase, SafetyReason) {
    (bench.robot.phase(), bench.robot.record().stop_reason)
}

fn lose(bench: &mut Bench, cycles: u64) -> CycleRecord {
    bench.exchange = SHORT;
    bench.run(cycles)
}

#[test]
fn a_loss_during_a_ramp_does_what_the_file_says() {
    for category in [StopCategory::RampThenRemove, StopCategory::RampAndHold] {
        for (policy, phase, control) in [
            ("remove_torque", Phase::Fault, 0x00),
            ("quick_stop", Phase::QuickStopping, 0x02),
            ("ramp", Phase::Stopping, 0x0F),
        ] {
            let mut bench = driven(&format!("on_lost_device = \"{policy}\""));
            bench.step(Some(RequestKind::Stop(category)));
            bench.run(20);
            assert_eq!(found(&bench), (Phase::Stopping, SafetyReason::Requested));
            lose(&mut bench, 4);
            let what = format!("{policy} on {category:?}");
            assert_eq!(found(&bench), (phase, SafetyReason::DeviceLost), "{what}");
            assert_eq!(bench.control_word(0), control, "{what}");
            bench.run(6000);
            assert_eq!(found(&bench), (Phase::Fault, SafetyReason::DeviceLost), "{what}: a loss is a fault");
        }
    }
}

#[test]
fn a_wheel_too_fast_stops_as_the_file_says_in_every_phase() {
    let cases = [
        ("category_0", Phase::Fault, Phase::Fault, 0x00),
        ("category_1", Phase::Stopping, Phase::Fault, 0x0F),
        ("category_2", Phase::Stopping, Phase::Holding, 0x0F),
    ];
    for (category, first, end, control) in cases {
        let mut bench = pushed(&format!("slip_m = 1e6\nwheel_speed_stop = \"{category}\""));
        push(&mut bench);
        bench.run(2);
        assert_eq!(found(&bench), (first, SafetyReason::WheelSpeed), "{category} while tracking");
        assert_eq!(bench.control_word(0), control, "{category}");
        bench.twist_in_body = Twist2::default();
        bench.run(4000);
        assert_eq!(found(&bench), (end, SafetyReason::WheelSpeed), "{category}");
    }
    let file = "wheel_speed_stop = \"category_0\"";
    let mut bench = pushed(file);
    bench.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
    bench.run(20);
    push(&mut bench);
    bench.run(2);
    assert_eq!(found(&bench), (Phase::Fault, SafetyReason::WheelSpeed), "while ramping down");
    assert_eq!(bench.control_word(0), 0x00);

    let mut bench = pushed(file);
    bench.fail_drive(1);
    bench.run(2);
    assert_eq!(found(&bench), (Phase::QuickStopping, SafetyReason::Drive));
    push(&mut bench);
    bench.run(2);
    assert_eq!(found(&bench), (Phase::Fault, SafetyReason::WheelSpeed), "in the drives' quick stop");
    assert_eq!(bench.control_word(0), 0x00);

    for (category, phase) in [("category_0", Phase::Fault), ("category_1", Phase::QuickStopping)] {
        let mut bench = Bench::new(plan(&format!("{BMM}\n[safety]\nwheel_speed_stop = \"{category}\"\n")));
        bench.step(None);
        bench.step(Some(RequestKind::Enable));
        push(&mut bench);
        bench.run(2);
        assert_eq!(found(&bench), (phase, SafetyReason::WheelSpeed), "{category} while enabling");
    }
}

#[test]
fn category_0_removes_torque_out_of_a_quick_stop() {
    let mut bench = driven("");
    bench.fail_drive(1);
    bench.run(2);
    assert_eq!((bench.robot.phase(), bench.control_word(0)), (Phase::QuickStopping, 0x02));
    let record = bench.step(Some(RequestKind::Stop(StopCategory::RemoveTorque)));
    assert_eq!((record.answer, bench.control_word(0)), (RequestAnswer::Taken, 0x00));
    assert_eq!(found(&bench), (Phase::Fault, SafetyReason::Drive), "it stays a fault, of the drive");
}

#[test]
fn a_gentler_stop_never_weakens() {
    // Asked for on top of a fault's stop: neither its way nor its end changes.
    let all = [StopCategory::RampAndHold, StopCategory::RampThenRemove, StopCategory::RemoveTorque];
    for category in all {
        let mut bench = driven("on_lost_device = \"ramp\"");
        lose(&mut bench, 10);
        assert_eq!(found(&bench), (Phase::Stopping, SafetyReason::DeviceLost));
        bench.step(Some(RequestKind::Stop(category)));
        let phase = if category == StopCategory::RemoveTorque { Phase::Fault } else { Phase::Stopping };
        assert_eq!(found(&bench), (phase, SafetyReason::DeviceLost), "{category:?}");
        bench.run(3000);
        assert_eq!(found(&bench), (Phase::Fault, SafetyReason::DeviceLost), "{category:?}");
    }
    for category in [StopCategory::RampAndHold, StopCategory::RampThenRemove] {
        let mut bench = driven("");
        bench.fail_drive(1);
        bench.run(2);
        bench.step(Some(RequestKind::Stop(category)));
        assert_eq!(found(&bench), (Phase::QuickStopping, SafetyReason::Drive), "{category:?}");
        assert_eq!(bench.control_word(0), 0x02, "{category:?}");
    }
    // Safety's ramp on top of a drive's quick stop.
    let mut bench = driven("on_lost_device = \"ramp\"\nwheel_speed_stop = \"category_2\"");
    bench.fail_drive(1);
    bench.run(2);
    push(&mut bench);
    bench.run(3);
    lose(&mut bench, 10);
    assert_eq!(found(&bench), (Phase::QuickStopping, SafetyReason::Drive));
    // A person's gentle stop after a harder one.
    let mut bench = driven("");
    bench.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
    bench.step(Some(RequestKind::Stop(StopCategory::RampAndHold)));
    bench.run(2000);
    assert_eq!(found(&bench), (Phase::Disabled, SafetyReason::Requested));
}

#[test]
fn of_two_causes_in_one_cycle_the_harder_stop_wins() {
    // Frames are lost while the file says that a lost device costs the torque, and the other way round.
    for (policy, lost, phase, reason) in [
        ("remove_torque", Exchange::Lost, Phase::Fault, SafetyReason::ExchangeLost),
        ("quick_stop", Exchange::Lost, Phase::QuickStopping, SafetyReason::ExchangeLost),
        ("ramp", Exchange::Lost, Phase::QuickStopping, SafetyReason::ExchangeLost),
        ("remove_torque", Exchange::Restarted { wheels: 2 }, Phase::Fault, SafetyReason::DeviceLost),
        ("ramp", Exchange::Restarted { wheels: 2 }, Phase::QuickStopping, SafetyReason::DeviceLost),
    ] {
        let mut bench = driven(&format!("on_lost_device = \"{policy}\"\nlost_exchanges_tolerated = 0"));
        bench.exchange = lost;
        bench.step(Some(forward(0.3)));
        assert_eq!(found(&bench), (phase, reason), "{policy}, {lost:?}");
    }
    // A wheel too fast in the very cycle in which a loss is too much.
    let mut bench = pushed("lost_exchanges_tolerated = 1\nwheel_speed_stop = \"category_0\"");
    bench.exchange = Exchange::Without { wheels: 0b010, devices: 0 };
    push(&mut bench);
    bench.run(2);
    assert_eq!(found(&bench), (Phase::Fault, SafetyReason::WheelSpeed));
    // A torque controller has no ramp without inputs: its drives brake.
    let mut bench = pushed("on_lost_device = \"ramp\"");
    lose(&mut bench, 4);
    assert_eq!(found(&bench), (Phase::QuickStopping, SafetyReason::DeviceLost));
    // A drive's fault asks for a quick stop, its loss for less or more.
    for (policy, phase, reason) in [
        ("remove_torque", Phase::Fault, SafetyReason::DeviceLost),
        ("ramp", Phase::QuickStopping, SafetyReason::Drive),
    ] {
        let mut bench = driven(&format!("on_lost_device = \"{policy}\""));
        bench.fail_drive(1);
        bench.run(2);
        assert_eq!(found(&bench), (Phase::QuickStopping, SafetyReason::Drive));
        lose(&mut bench, 4);
        assert_eq!(found(&bench), (phase, reason), "{policy}");
    }
}

#[test]
fn the_wheels_that_are_heard_decide_when_a_stop_is_over() {
    // Wheel 1 is away and never heard again; its last speed must not keep the torque on.
    for (policy, before) in [("ramp", Phase::Stopping), ("quick_stop", Phase::QuickStopping)] {
        let mut bench = driven(&format!("on_lost_device = \"{policy}\""));
        bench.exchange = Exchange::Without { wheels: 0b010, devices: 0 };
        bench.run(4);
        assert_eq!(found(&bench), (before, SafetyReason::DeviceLost), "{policy}");
        assert_eq!(bench.robot.record().stop_where, 1, "the wheel that is missing");
        bench.run(600);
        assert_eq!(found(&bench), (Phase::Fault, SafetyReason::DeviceLost), "{policy}");
    }
}

#[test]
fn what_wheels_turned_while_another_was_away_counts_when_it_is_back() {
    // A cable that is out for a moment: no drive started anew, so odometry misses nothing.
    let mut bench = driven("lost_exchanges_tolerated = 1000");
    for lost in [Exchange::Without { wheels: 0b010, devices: 0 }, SHORT, Exchange::Lost] {
        bench.exchange = lost;
        for _ in 0..20 {
            bench.step(Some(forward(0.3)));
        }
        bench.exchange = Exchange::Complete;
        let record = bench.step(Some(forward(0.3)));
        // Its measurement is one cycle old.
        let gap_m = record.state.odom_from_body.distance_m(bench.pose);
        assert!(gap_m < 1e-3, "{lost:?}: {gap_m} m");
    }
}
