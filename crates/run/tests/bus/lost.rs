//! A moving robot loses a drive: how it stops by each policy, and when the torque goes.

use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot::{Exchange, RequestKind};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::simulated;

use crate::bench::{Bench, plan, plan_changed};

/// Slower than this a wheel stands, rad/s.
const STANDING_RAD_S: f64 = 0.02;
/// The wheel whose drive is lost.
const LOST: usize = 2;
const BY_HAND: Twist2 = Twist2 { vx_m_s: 0.3, vy_m_s: 0.1, w_rad_s: 0.2 };
const STRAIGHT: Twist2 = Twist2 { vx_m_s: 0.87, vy_m_s: 0.0, w_rad_s: 0.0 };

/// What came of a loss, in cycles of 1 ms from it on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    /// The first phase that isn't what it was.
    first: Phase,
    first_ms: u64,
    /// When the wheels first stood whose drives still answer.
    heard_stand_ms: u64,
    /// When all of them stood for good: a platform on three wheels has one motion left that two can't brake.
    all_stand_ms: u64,
    /// When the torque was off.
    torque_off_ms: u64,
    /// The fastest wheel against the fastest at the loss.
    overspeed: f64,
    way_m: f64,
    reason: SafetyReason,
    end: Phase,
}

struct Case {
    bench: Bench,
    machine: SharedMachine,
}

impl Case {
    /// The BMM driven by hand for 1.5 s.
    fn driven(more: &str, controller: &str, twist: Twist2) -> Case {
        let plan = plan_changed(more, &[&format!("controller.kind = \"{controller}\"")]);
        let (segment, machine) = simulated::segment(&plan).unwrap();
        let (link, clock) = in_process(segment);
        let mut bench = Bench::with(&plan, link, clock);
        bench.enable();
        for _ in 0..1500 {
            bench.cycle_for(RequestKind::Velocity { twist, frame: Frame::Body }, 200_000_000);
        }
        Case { bench, machine }
    }

    fn speeds(&self) -> [f64; 3] {
        let machine = self.machine.lock();
        [0, 1, 2].map(|wheel| machine.shaft(wheel).speed_rad_s.abs())
    }

    fn lose(mut self) -> Stop {
        let before = self.bench.robot.phase();
        let fastest = |speeds: [f64; 3]| speeds.into_iter().fold(0.0, f64::max);
        let first_speed = fastest(self.speeds());
        self.bench.inject(LOST, Fault::PowerOff);
        let mut stop = Stop {
            first: before,
            first_ms: 0,
            heard_stand_ms: 0,
            all_stand_ms: 0,
            torque_off_ms: 0,
            overspeed: 0.0,
            way_m: 0.0,
            reason: SafetyReason::None,
            end: before,
        };
        for ms in 1..=8000 {
            self.bench.cycle(None);
            let phase = self.bench.robot.phase();
            if stop.first == before && phase != before {
                (stop.first, stop.first_ms) = (phase, ms);
            }
            let speeds = self.speeds();
            stop.overspeed = stop.overspeed.max(fastest(speeds) / first_speed);
            let moves = |wheel: usize| speeds[wheel] >= STANDING_RAD_S;
            if stop.heard_stand_ms == 0 && !(0..3).any(|wheel| wheel != LOST && moves(wheel)) {
                stop.heard_stand_ms = ms;
            }
            if (0..3).any(moves) {
                stop.all_stand_ms = ms + 1;
            }
            if stop.torque_off_ms == 0 && matches!(phase, Phase::Disabled | Phase::Fault) {
                stop.torque_off_ms = ms;
            }
            let twist = self.machine.truth().twist_in_body;
            stop.way_m += twist.vx_m_s.hypot(twist.vy_m_s) * 1e-3;
        }
        (stop.reason, stop.end) = (self.bench.robot.record().stop_reason, self.bench.robot.phase());
        stop
    }
}

fn policy(name: &str) -> String {
    format!("[safety]\non_lost_device = \"{name}\"\n")
}

/// The fastest wheel of the BMM at a speed, rad/s.
fn wheel_rad_s(twist: Twist2) -> f64 {
    let speeds = plan("").kinematics.wheel_speeds_rad_s(twist);
    speeds.iter().fold(0.0, |most: f64, speed| most.max(speed.abs()))
}

/// Two wheels of three leave the platform one motion that they can't brake: it rolls out, whatever they do. Braking must
/// not make that worse: neither way nor time, nor any wheel faster than when it began (a tenth for the load's shift).
fn is_no_worse_than_rolling_out(stop: &Stop, controller: &str, twist: Twist2) {
    let rolling_out = Case::driven(&policy("remove_torque"), controller, twist).lose();
    println!("  rolling out: {rolling_out:?}");
    assert!(stop.overspeed < 1.1, "{stop:?}");
    assert!(stop.way_m < rolling_out.way_m, "{stop:?}, {rolling_out:?}");
    assert!(stop.all_stand_ms < rolling_out.all_stand_ms, "{stop:?}, {rolling_out:?}");
}

/// Time of a ramp to rest within the BMM's limits from a speed, ms: v/a + a/j, of what takes longer.
fn ramp_ms(twist: Twist2) -> u64 {
    let straight = twist.vx_m_s.hypot(twist.vy_m_s) / 1.5 + 1.5 / 40.0;
    let turning = twist.w_rad_s / 3.0 + 3.0 / 80.0;
    (1000.0 * straight.max(turning)).ceil() as u64
}

#[test]
fn a_ramp_after_a_loss_ends_in_its_own_time_and_torque_goes_with_it() {
    for controller in ["closed_loop_speed", "open_loop"] {
        for twist in [BY_HAND, STRAIGHT] {
            let stop = Case::driven(&policy("ramp"), controller, twist).lose();
            println!("{controller} {twist:?}: {stop:?}");
            assert_eq!((stop.first, stop.end), (Phase::Stopping, Phase::Fault), "{stop:?}");
            assert_eq!(stop.reason, SafetyReason::DeviceLost);
            assert!(stop.first_ms <= 5, "{stop:?}");
            // Until it is noticed, and what the drives lag behind.
            let latest = stop.first_ms + ramp_ms(twist) + 50;
            assert!((1..=latest).contains(&stop.heard_stand_ms), "{stop:?}, allowed {latest} ms");
            assert!(stop.torque_off_ms >= stop.heard_stand_ms, "torque stays while they brake: {stop:?}");
            assert!(stop.torque_off_ms <= stop.heard_stand_ms + 50, "{stop:?}");
            is_no_worse_than_rolling_out(&stop, controller, twist);
        }
    }
}

#[test]
fn a_torque_controller_has_no_ramp_without_inputs_its_drives_quick_stop() {
    let controller = "adaptive_torque";
    for twist in [BY_HAND, STRAIGHT] {
        let stop = Case::driven(&policy("ramp"), controller, twist).lose();
        println!("{controller} {twist:?}: {stop:?}");
        assert_eq!((stop.first, stop.end), (Phase::QuickStopping, Phase::Fault), "{stop:?}");
        assert_eq!(stop.reason, SafetyReason::DeviceLost);
        assert!(stop.first_ms <= 5, "{stop:?}");
        // The drives' own ramp: 0x6085 of the robot's file, 15 rad/s².
        let latest = stop.first_ms + (1e3 * wheel_rad_s(twist) / 15.0) as u64 + 50;
        assert!((1..=latest).contains(&stop.heard_stand_ms), "{stop:?}, allowed {latest} ms");
        assert!(stop.torque_off_ms <= stop.heard_stand_ms + 50, "{stop:?}");
        is_no_worse_than_rolling_out(&stop, controller, twist);
    }
}

#[test]
fn torque_goes_when_the_drives_that_still_answer_stand() {
    for name in ["quick_stop", "ramp"] {
        let stop = Case::driven(&policy(name), "closed_loop_speed", BY_HAND).lose();
        println!("{name}: {stop:?}");
        assert!(stop.torque_off_ms <= stop.heard_stand_ms + 50, "{name}: {stop:?}");
        assert_eq!((stop.end, stop.reason), (Phase::Fault, SafetyReason::DeviceLost), "{name}");
    }
    let stop = Case::driven(&policy("remove_torque"), "closed_loop_speed", BY_HAND).lose();
    println!("remove_torque: {stop:?}");
    assert_eq!((stop.first, stop.end), (Phase::Fault, Phase::Fault));
    assert!(stop.torque_off_ms <= 5, "{stop:?}");
}

#[test]
fn a_loss_while_a_person_stops_the_robot_does_what_the_file_says() {
    for (name, phase) in
        [("remove_torque", Phase::Fault), ("quick_stop", Phase::QuickStopping), ("ramp", Phase::Stopping)]
    {
        for category in [StopCategory::RampThenRemove, StopCategory::RampAndHold] {
            let mut case = Case::driven(&policy(name), "closed_loop_speed", STRAIGHT);
            case.bench.cycle(Some(RequestKind::Stop(category)));
            case.bench.run(20);
            assert_eq!(case.bench.robot.phase(), Phase::Stopping);
            case.bench.inject(LOST, Fault::PowerOff);
            case.bench.run(6);
            let record = case.bench.robot.record();
            let found = (case.bench.robot.phase(), record.stop_reason);
            assert_eq!(found, (phase, SafetyReason::DeviceLost), "{name} on {category:?}");
            case.bench.run(2000);
            assert_eq!(case.bench.robot.phase(), Phase::Fault, "{name} on {category:?}");
        }
    }
}

#[test]
fn a_ramp_after_a_loss_ends_though_nobody_knows_who_is_lost() {
    use omnibase_ethercat_sim::{FaultAction, Injection, Target};
    let mut case = Case::driven(&policy("ramp"), "closed_loop_speed", STRAIGHT);
    {
        let mut link = case.bench.link.0.borrow_mut();
        let next = link.counts().frames;
        for frame in next..next + 3000 {
            link.inject(Injection { target: Target::Frame(frame), action: FaultAction::ShortCount });
        }
    }
    case.bench.run(6);
    assert_eq!(case.bench.robot.phase(), Phase::Stopping);
    let latest = ramp_ms(STRAIGHT) + 500 + 50;
    case.bench.run(latest);
    let record = case.bench.robot.record();
    assert_eq!((case.bench.robot.phase(), record.stop_reason), (Phase::Fault, SafetyReason::DeviceLost));
}

#[test]
fn the_inputs_of_those_that_still_answer_are_read_and_no_others() {
    // In a line whoever is behind a lost SubDevice is lost with it.
    for (position, wheels) in [(1, 0b110), (2, 0b100)] {
        let mut case = Case::driven("", "closed_loop_speed", STRAIGHT);
        case.bench.inject(position, Fault::PowerOff);
        case.bench.run(10);
        let mut before = *case.bench.robot.record();
        for _ in 0..50 {
            case.bench.cycle(None);
            let record = *case.bench.robot.record();
            assert_eq!(record.exchange, Exchange::Without { wheels, devices: 0 }, "SubDevice {position}");
            for wheel in 0..3 {
                let is_there = wheels >> wheel & 1 == 0;
                let is_empty = record.inputs[wheel].0.iter().all(|byte| *byte == 0);
                assert_eq!(is_there, !is_empty, "wheel {wheel} of SubDevice {position}");
                let (counts, old) = (record.measurements.drives[wheel], before.measurements.drives[wheel]);
                if !is_there {
                    assert_eq!(counts.position_counts, old.position_counts, "wheel {wheel} isn't heard");
                }
                assert_eq!(counts.increment_rad, 0.0, "odometry knows nothing without one wheel");
            }
            before = record;
        }
        assert_eq!(case.bench.robot.record().stop_where, position as u64);
    }
}
