//! An axis against a drive of a test's own, which takes its time, keeps old bits, or doesn't answer.

use std::collections::VecDeque;

use omnibase_platform::Twist2;
use omnibase_robot::config::AxisMode;
use omnibase_robot::signals::{AxisAsk, AxisState, Frame, Phase, RequestAnswer, SafetyReason, StopCategory};
use omnibase_robot::{Exchange, RequestKind};

use crate::support::{Bench, plan};

const LIFT: &str = include_str!("../../../../robots/bmm_lift.toml");
/// Its place in the robot's file.
const DEVICE: usize = 1;
const COUNTS_PER_M: f64 = 200.0 * 1_048_576.0;
const HALT: u16 = 1 << 8;

/// A drive in pp moves at 0.1 m/s to its set point unless it is halted, and takes none meanwhile; in csp it is where it is told;
/// in pv it changes its speed by 0.5 m/s², halted by 1 m/s²; in hm it is told what to show.
struct Drive {
    bench: Bench,
    status: u16,
    mode: i8,
    /// Modes that it was told and doesn't show yet.
    asked: VecDeque<i8>,
    counts: f64,
    pp_target: Option<f64>,
    pv_speed_m_s: f64,
    acknowledges: bool,
    homing: u16,
    /// Without torque it goes on so far in a cycle.
    coasts_m: f64,
}

impl Drive {
    /// Enabled; it shows a mode so many cycles after it was told it. Its encoder is absolute.
    fn new(delay: usize) -> Self {
        Drive::with_encoder(delay, "absolute")
    }

    fn with_encoder(delay: usize, encoder: &str) -> Self {
        let mut drive = Drive::disabled(delay, encoder);
        drive.run(3);
        drive.step(Some(RequestKind::Enable));
        drive.run(100);
        assert_eq!(drive.bench.robot.phase(), Phase::Holding);
        drive
    }

    fn disabled(delay: usize, encoder: &str) -> Self {
        let text = LIFT.replace("unit = \"m\"", &format!("unit = \"m\"\nencoder = \"{encoder}\""));
        let text = text.replace("stop_input = \"buttons.stop\"", "on_lost_device = \"ramp\"");
        Drive {
            bench: Bench::new(plan(&text)),
            status: 0x250,
            mode: 0,
            asked: VecDeque::from(vec![0; delay]),
            counts: 0.1 * COUNTS_PER_M,
            pp_target: None,
            pv_speed_m_s: 0.0,
            acknowledges: true,
            homing: 0,
            coasts_m: 0.0,
        }
    }

    fn told(&self) -> (u16, f64, i8) {
        let bytes = &self.bench.image.device_outputs[DEVICE];
        let control = u16::from_le_bytes([bytes[0], bytes[1]]);
        let target = i32::from_le_bytes(bytes[2..6].try_into().unwrap());
        (control, f64::from(target), bytes[14] as i8)
    }

    fn step(&mut self, request: Option<RequestKind>) {
        let (control, target, mode) = self.told();
        self.asked.push_back(mode);
        self.mode = self.asked.pop_front().unwrap();
        self.status = match control & 0x8F {
            _ if control & 2 == 0 => 0x250,
            0x06 => 0x231,
            0x07 => 0x233,
            0x0F => 0x237,
            _ => 0x217,
        };
        let before = self.counts;
        if self.status == 0x250 {
            self.counts += self.coasts_m * COUNTS_PER_M;
        }
        if self.status == 0x237 {
            match self.mode {
                8 => self.counts = target,
                1 => self.plan_its_way(control, target),
                3 => self.run_at_its_speed(control),
                6 => self.status |= self.homing,
                _ => {}
            }
        }
        let speed = ((self.counts - before) * 1000.0).round() as i32;
        let bytes = &mut self.bench.image.device_inputs[DEVICE];
        bytes[..2].copy_from_slice(&self.status.to_le_bytes());
        bytes[2..6].copy_from_slice(&(self.counts.round() as i32).to_le_bytes());
        bytes[6..10].copy_from_slice(&speed.to_le_bytes());
        bytes[14] = self.mode as u8;
        self.bench.step(request);
    }

    fn plan_its_way(&mut self, control: u16, target: f64) {
        if control & (0x10 | HALT) == 0x10 && self.acknowledges {
            self.pp_target = Some(target);
            self.status |= 1 << 12;
        }
        let Some(to) = self.pp_target else { return };
        if control & HALT == 0 {
            let step = 1e-4 * COUNTS_PER_M;
            self.counts += (to - self.counts).clamp(-step, step);
        }
        self.status |= u16::from(self.counts == to) << 10;
    }

    fn run_at_its_speed(&mut self, control: u16) {
        let told = &self.bench.image.device_outputs[DEVICE][6..10];
        let told_m_s = f64::from(i32::from_le_bytes(told.try_into().unwrap())) / COUNTS_PER_M;
        let (to_m_s, most) = if control & HALT == 0 { (told_m_s, 0.5e-3) } else { (0.0, 1e-3) };
        self.pv_speed_m_s += (to_m_s - self.pv_speed_m_s).clamp(-most, most);
        self.counts += self.pv_speed_m_s * 1e-3 * COUNTS_PER_M;
    }

    fn run(&mut self, cycles: usize) {
        (0..cycles).for_each(|_| self.step(None));
    }

    fn ask(&mut self, ask: AxisAsk) -> RequestAnswer {
        self.step(Some(RequestKind::Axis { device: DEVICE as u32, ask }));
        self.bench.robot.record().answer
    }

    fn state(&self) -> AxisState {
        AxisState::from_code(self.bench.robot.record().signals.inputs[5] as u64).unwrap()
    }

    fn position_m(&self) -> f64 {
        self.counts / COUNTS_PER_M
    }
}

#[test]
fn a_drive_that_was_halted_stays_so_until_it_shows_the_mode_in_which_it_holds() {
    let mut drive = Drive::new(20);
    let to = |position| AxisAsk::Move { position, mode: AxisMode::Pp };
    assert_eq!(drive.ask(to(0.5)), RequestAnswer::Taken);
    drive.run(500);
    assert!((0.11..0.4).contains(&drive.position_m()), "{}", drive.position_m());
    assert_eq!(drive.ask(AxisAsk::Stop), RequestAnswer::Taken);
    drive.run(2);
    let halted_m = drive.position_m();
    for cycle in 0..200 {
        drive.step(None);
        assert!(cycle != 10 || (drive.mode, drive.told().2) == (1, 8), "on its way to csp");
        assert!((drive.position_m() - halted_m).abs() < 1e-6, "{halted_m} {}", drive.position_m());
    }
    assert_eq!((drive.mode, drive.told().0 & HALT, drive.state()), (8, 0, AxisState::Holding));
}

#[test]
fn what_is_asked_while_the_drive_changes_its_mode_isnt_lost() {
    let mut drive = Drive::new(20);
    drive.ask(AxisAsk::Move { position: 0.11, mode: AxisMode::Pp });
    while drive.told().2 != 1 {
        drive.step(None);
    }
    while drive.told().2 == 1 {
        drive.step(None);
    }
    drive.step(None);
    assert_eq!((drive.mode, drive.state()), (1, AxisState::Stopping), "on its way back to csp");
    let to = AxisAsk::Move { position: 0.2, mode: AxisMode::Csp };
    assert_eq!(drive.ask(to), RequestAnswer::Taken);
    drive.run(2000);
    assert!((drive.position_m() - 0.2).abs() < 1e-6, "{}", drive.position_m());
}

#[test]
fn an_axis_that_coasts_without_torque_begins_nothing_when_it_is_enabled_again() {
    let mut drive = Drive::new(0);
    assert_eq!(drive.ask(AxisAsk::Move { position: 0.5, mode: AxisMode::Pp }), RequestAnswer::Taken);
    drive.run(500);
    drive.coasts_m = 5e-5;
    drive.step(Some(RequestKind::Stop(StopCategory::RemoveTorque)));
    // Longer than a halt may take.
    drive.run(2000);
    drive.coasts_m = 0.0;
    drive.run(20);
    let stood_m = drive.position_m();
    drive.step(Some(RequestKind::Enable));
    drive.run(500);
    assert_eq!((drive.bench.robot.phase(), drive.state()), (Phase::Holding, AxisState::Holding));
    assert!((drive.position_m() - stood_m).abs() < 1e-6);
}

#[test]
fn a_drive_that_doesnt_acknowledge_a_set_point_stops_the_robot() {
    let mut drive = Drive::new(0);
    drive.acknowledges = false;
    assert_eq!(drive.ask(AxisAsk::Move { position: 0.5, mode: AxisMode::Pp }), RequestAnswer::Taken);
    drive.run(900);
    assert_eq!(drive.bench.robot.phase(), Phase::Holding);
    drive.run(2000);
    let record = drive.bench.robot.record();
    assert_eq!((drive.bench.robot.phase(), record.stop_reason), (Phase::Fault, SafetyReason::Axis));
    let problems: Vec<_> = drive.bench.robot.device_problems().collect();
    assert!(problems[0].1.contains("doesn't acknowledge"), "{problems:?}");
}

#[test]
fn a_new_home_is_one_that_the_drive_shows_after_it_showed_none() {
    const ATTAINED: u16 = 1 << 12 | 1 << 10;
    let homed = |drive: &Drive| drive.bench.robot.record().signals.inputs[6];
    let mut drive = Drive::new(3);
    drive.homing = ATTAINED;
    assert_eq!(drive.ask(AxisAsk::Home), RequestAnswer::Taken);
    drive.run(500);
    assert_eq!((drive.state(), homed(&drive)), (AxisState::Homing, 0.0), "an old one");
    drive.homing = 0;
    drive.run(500);
    assert_eq!(homed(&drive), 0.0);
    // Bit 12 alone: it is still moving.
    drive.homing = 1 << 12;
    drive.run(10);
    assert_eq!(homed(&drive), 0.0);
    drive.homing = ATTAINED;
    drive.run(50);
    assert_eq!((drive.state(), homed(&drive)), (AxisState::Holding, 1.0));
    // A homing error.
    drive.homing = 0;
    drive.ask(AxisAsk::Home);
    drive.run(100);
    drive.homing = 1 << 13;
    drive.run(100);
    assert_eq!((drive.state(), homed(&drive)), (AxisState::HomingFailed, 0.0));
    let to = AxisAsk::Move { position: 0.2, mode: AxisMode::Csp };
    assert_eq!(drive.ask(to), RequestAnswer::NotHomed);
}

#[test]
fn a_drive_that_moves_by_itself_is_stopped() {
    for (what, words) in [(0.004, None), (0.006, Some("from its set point"))] {
        let mut drive = Drive::new(0);
        // In csp it is where it is told, and its count is off.
        let bytes_at = |drive: &mut Drive| {
            let counts = (drive.counts + what * COUNTS_PER_M) as i32;
            drive.bench.image.device_inputs[DEVICE][2..6].copy_from_slice(&counts.to_le_bytes());
        };
        drive.run(10);
        for _ in 0..20 {
            bytes_at(&mut drive);
            drive.bench.step(None);
        }
        let problems: Vec<_> = drive.bench.robot.device_problems().collect();
        assert_eq!(problems.is_empty(), words.is_none(), "{what}: {problems:?}");
        if let Some(words) = words {
            assert!(problems[0].1.contains(words), "{problems:?}");
        }
    }
    // Too fast, and too strong for longer than 50 ms.
    for (at, value, cycles, words) in [
        (6, (0.166 * COUNTS_PER_M) as i32, 1, "its speed was 0.166"),
        // 3 N·m of 1.27: 2362 per mille, and the margins.
        (10, 2750, 55, "its torque was 3.49"),
    ] {
        let mut drive = Drive::new(0);
        let length = if at == 6 { 4 } else { 2 };
        for cycle in 0..=cycles {
            let bytes = &mut drive.bench.image.device_inputs[DEVICE][at..at + length];
            bytes.copy_from_slice(&value.to_le_bytes()[..length]);
            drive.bench.step(None);
            let is_told = drive.bench.robot.device_problems().next().is_some();
            assert!(!is_told || cycle + 5 >= cycles, "{words}: in cycle {cycle}");
        }
        let problems: Vec<_> = drive.bench.robot.device_problems().collect();
        assert!(problems[0].1.contains(words), "{problems:?}");
        drive.run(500);
        assert_eq!(drive.bench.robot.record().stop_reason, SafetyReason::Axis);
        assert_eq!(drive.bench.robot.phase(), Phase::Fault);
    }
}

#[test]
fn a_failed_axis_loses_its_torque_in_fault_and_in_category_0() {
    for request in [None, Some(RequestKind::Stop(StopCategory::RemoveTorque))] {
        let mut drive = Drive::new(0);
        let too_fast = (0.166 * COUNTS_PER_M) as i32;
        drive.bench.image.device_inputs[DEVICE][6..10].copy_from_slice(&too_fast.to_le_bytes());
        drive.bench.step(None);
        drive.step(None);
        assert_eq!(drive.told().0 & 0x8F, 0x02, "its quick stop");
        drive.step(request);
        if request.is_none() {
            assert_eq!(drive.told().0 & 0x8F, 0x02);
            drive.run(500);
        }
        assert_eq!(drive.bench.robot.phase(), Phase::Fault);
        assert_eq!(drive.told().0 & 0x8F, 0, "{request:?}");
        drive.run(10);
        assert_eq!(drive.status, 0x250);
    }
}

#[test]
fn a_position_in_pp_may_be_asked_for_again() {
    let to = |position| AxisAsk::Move { position, mode: AxisMode::Pp };
    for delay in [0, 3] {
        let mut drive = Drive::new(delay);
        drive.ask(to(0.2));
        drive.run(500);
        // Under way, in the cycles in which it arrives, and when it is there.
        for cycles in [700, 1, 1500, 1500] {
            assert_eq!(drive.ask(to(0.2)), RequestAnswer::Taken);
            drive.run(cycles);
            assert_eq!(drive.bench.robot.phase(), Phase::Holding);
        }
        for _ in 0..1500 {
            assert_eq!(drive.ask(to(0.3)), RequestAnswer::Taken);
        }
        drive.run(1500);
        assert_eq!((drive.bench.robot.phase(), drive.state()), (Phase::Holding, AxisState::Holding));
        assert!((drive.position_m() - 0.3).abs() < 1e-6, "{}", drive.position_m());
        // There, elsewhere and there again, whatever the drive has acknowledged meanwhile.
        for [before, between] in (0..6).rev().flat_map(|before| (0..6).map(move |between| [before, between]))
        {
            drive.ask(to(0.35));
            drive.run(before);
            drive.ask(to(0.25));
            drive.run(between);
            drive.ask(to(0.35));
            drive.run(1300);
            assert_eq!(drive.bench.robot.phase(), Phase::Holding, "{before} {between}");
        }
        assert!((drive.position_m() - 0.35).abs() < 1e-6, "{}", drive.position_m());
    }
}

#[test]
fn an_axis_that_is_told_a_speed_never_runs_through_its_limits_on_the_way_to_it() {
    for next in [-0.01, 0.0, -0.15] {
        for short_m in [0.001, 0.004, 0.01, 0.02] {
            let mut drive = Drive::new(5);
            assert_eq!(drive.ask(AxisAsk::Run { speed: 0.15 }), RequestAnswer::Taken);
            while drive.position_m() < 0.6 - 0.15 * 0.15 / 2.0 - short_m {
                drive.step(None);
            }
            assert_eq!(drive.ask(AxisAsk::Run { speed: next }), RequestAnswer::Taken);
            let mut furthest_m: f64 = 0.0;
            for _ in 0..1500 {
                drive.step(None);
                furthest_m = furthest_m.max(drive.position_m());
            }
            assert!(furthest_m <= 0.6, "{next} {short_m}: {furthest_m}");
            assert_eq!(drive.bench.robot.phase(), Phase::Holding);
            if next == 0.0 {
                assert_eq!((drive.state(), drive.mode), (AxisState::Holding, 8));
            }
            // Away from there it runs.
            let stood_m = drive.position_m();
            assert_eq!(drive.ask(AxisAsk::Run { speed: -0.1 }), RequestAnswer::Taken);
            drive.run(500);
            assert!(drive.position_m() < stood_m - 0.02, "{next} {short_m}: {}", drive.position_m());
        }
    }
}

/// The set points in csp never leap, whatever is lost.
#[track_caller]
fn run_without_a_leap(drive: &mut Drive, cycles: usize) {
    for _ in 0..cycles {
        let before = drive.told();
        drive.step(None);
        let after = drive.told();
        let step_m = (after.1 - before.1).abs() / COUNTS_PER_M;
        let follows = |told: (u16, f64, i8)| told.0 & 0x0F == 0x0F && told.2 == 8;
        assert!(!follows(before) || !follows(after) || step_m <= 0.15e-3 + 1e-8, "{step_m}");
        let is_there = (drive.counts - before.1).abs() < 1.0;
        let leaves_pp = (before.2, after.2) == (1, 8) && follows((after.0, after.1, 8));
        assert!(!leaves_pp || is_there || before.0 & HALT != 0, "another mode without a halt");
    }
}

#[test]
fn an_axis_goes_on_after_a_cycle_that_came_late_and_lost_its_exchange() {
    for ask in [
        AxisAsk::Move { position: 0.3, mode: AxisMode::Csp },
        AxisAsk::Move { position: 0.3, mode: AxisMode::Pp },
    ] {
        let mut drive = Drive::with_encoder(0, "incremental");
        assert_eq!(drive.ask(AxisAsk::Home), RequestAnswer::Taken);
        drive.run(20);
        drive.homing = 1 << 12 | 1 << 10;
        drive.run(50);
        assert_eq!(drive.ask(ask), RequestAnswer::Taken);
        for _ in 0..3 {
            run_without_a_leap(&mut drive, 300);
            drive.bench.index += 5;
            drive.bench.exchange = Exchange::Lost;
            run_without_a_leap(&mut drive, 1);
            drive.bench.exchange = Exchange::Complete;
        }
        run_without_a_leap(&mut drive, 2500);
        let record = drive.bench.robot.record();
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None));
        assert!((drive.position_m() - 0.3).abs() < 1e-6, "{ask:?}: {}", drive.position_m());
        assert_eq!(record.signals.inputs[6], 1.0, "homed");
    }
}

#[test]
fn an_axis_that_isnt_heard_any_more_comes_to_rest_without_a_leap() {
    for mode in [AxisMode::Csp, AxisMode::Pp] {
        let mut drive = Drive::new(0);
        assert_eq!(drive.ask(AxisAsk::Move { position: 0.5, mode }), RequestAnswer::Taken);
        // The base drives too, so that its stop takes as long.
        let twist = Twist2::new(0.5, 0.0, 0.0);
        for _ in 0..1000 {
            drive.step(Some(RequestKind::Velocity { twist, frame: Frame::Body }));
        }
        drive.bench.exchange = Exchange::Without { wheels: 0, devices: 1 << DEVICE };
        run_without_a_leap(&mut drive, 200);
        assert_eq!(drive.bench.robot.phase(), Phase::Stopping);
        run_without_a_leap(&mut drive, 700);
        let stood_m = drive.position_m();
        drive.bench.exchange = Exchange::Complete;
        run_without_a_leap(&mut drive, 400);
        assert!((drive.position_m() - stood_m).abs() < 1e-6, "{mode:?}");
        let record = drive.bench.robot.record();
        assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::DeviceLost));
        assert_eq!(drive.bench.robot.device_problems().count(), 0);
        assert_eq!(drive.ask(AxisAsk::Stop), RequestAnswer::Taken);
    }
}

#[test]
fn a_robot_isnt_enabled_in_a_cycle_in_which_an_axis_wasnt_heard() {
    let cycles = |lost: Option<usize>| {
        let mut drive = Drive::disabled(0, "absolute");
        drive.run(3);
        drive.step(Some(RequestKind::Enable));
        (0..200).find(|cycle| {
            let is_lost = lost == Some(*cycle);
            let without = Exchange::Without { wheels: 0, devices: 1 << DEVICE };
            drive.bench.exchange = if is_lost { without } else { Exchange::Complete };
            drive.step(None);
            drive.bench.robot.phase() == Phase::Holding
        })
    };
    let last = cycles(None).unwrap();
    assert_eq!(cycles(Some(last)), Some(last + 1));
}

#[test]
fn an_axis_that_isnt_heard_keeps_its_torque_until_it_was_seen_to_stand() {
    const WITHOUT: Exchange = Exchange::Without { wheels: 0, devices: 1 << DEVICE };
    let moving = || {
        let mut drive = Drive::new(0);
        assert_eq!(drive.ask(AxisAsk::Run { speed: 0.15 }), RequestAnswer::Taken);
        drive.run(1000);
        drive
    };
    // One exchange in the middle of a stop that somebody asked for; the base stands.
    let mut drive = moving();
    drive.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
    drive.run(20);
    drive.bench.exchange = WITHOUT;
    drive.run(1);
    drive.bench.exchange = Exchange::Complete;
    while drive.bench.robot.phase() == Phase::Stopping {
        drive.run(1);
    }
    assert_eq!((drive.bench.robot.phase(), drive.pv_speed_m_s), (Phase::Disabled, 0.0));
    // Lost for good: nobody knows when it stands, so its drive is told to stop quickly, and loses its torque at last.
    let mut drive = moving();
    drive.bench.exchange = WITHOUT;
    drive.run(4900);
    assert_eq!((drive.bench.robot.phase(), drive.status), (Phase::Stopping, 0x237));
    drive.run(200);
    assert_eq!((drive.bench.robot.phase(), drive.told().0 & 0x8F), (Phase::QuickStopping, 0x02));
    drive.run(5000);
    let record = drive.bench.robot.record();
    assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::DeviceLost));
    // One that stood when it was heard last stands.
    let mut drive = Drive::new(0);
    drive.run(10);
    drive.bench.exchange = WITHOUT;
    drive.run(100);
    assert_eq!(drive.bench.robot.phase(), Phase::Fault);
}

#[test]
fn what_the_drive_acknowledged_before_doesnt_count_for_the_next_set_point() {
    let to = |position| AxisAsk::Move { position, mode: AxisMode::Pp };
    for cycles in 0..8 {
        let mut drive = Drive::new(0);
        drive.ask(to(0.5));
        drive.run(cycles);
        drive.ask(to(0.4));
        drive.acknowledges = false;
        drive.run(1200);
        let problems: Vec<_> = drive.bench.robot.device_problems().collect();
        assert!(
            problems.iter().any(|(_, why)| why.contains("doesn't acknowledge")),
            "{cycles}: {problems:?}"
        );
    }
}
