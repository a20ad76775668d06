//! Axes beside the wheels, on the simulated bus: homed, moved by csp and pp while the base drives, stopped with the robot.

use std::time::Duration;

use omnibase_cia402::Mode;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat_sim::device::panel::IoPanel;
use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_robot::config::AxisMode;
use omnibase_robot::signals::{AxisAsk, AxisState, Phase, RequestAnswer, SafetyReason, StopCategory};
use omnibase_robot::{CycleRecord, ImageBuffer, Registry, RequestKind, Robot, RobotPlan};
use omnibase_robot_sim::{SharedMachine, SharedSlide};
use omnibase_run::{RobotText, simulated};

use crate::bench::Bench;

const LIFT: &str = include_str!("../../../../robots/bmm_lift.toml");
/// Places in the robot's file, and on the bus.
const AXIS: u32 = 1;
const AXIS_ON_BUS: usize = 4;

pub fn plan(changes: &[(&str, &str)]) -> RobotPlan {
    let text = changes.iter().fold(LIFT.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    RobotText { text, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap().plan
}

/// A robot with its lift, its true position and its button at hand.
struct Lifted {
    bench: Bench,
    lift: SharedSlide,
    machine: SharedMachine,
    buttons: IoPanel,
    records: Vec<CycleRecord>,
    m_per_rad: f64,
}

/// What the axis says.
#[derive(Clone, Copy, Debug)]
struct AxisSignals {
    position: f64,
    speed: f64,
    set_point: f64,
    state: AxisState,
    is_homed: bool,
    mode: i8,
}

impl Lifted {
    fn new(plan: &RobotPlan) -> Self {
        let simulated::Simulated { segment, machine, panels, axes } = simulated::robot(plan).unwrap();
        let (link, clock) = in_process(segment);
        let scale = plan.devices[AXIS as usize].axis.as_ref().unwrap().scale;
        let m_per_rad =
            f64::from(scale.counts_per_revolution) / std::f64::consts::TAU / scale.counts_per_unit;
        let bench = Bench::with(plan, link, clock);
        let (lift, buttons) = (axes[0].clone(), panels[0].clone());
        let mut lifted = Lifted { bench, lift, machine, buttons, records: Vec::new(), m_per_rad };
        lifted.step(None);
        lifted.step(Some(RequestKind::Enable));
        lifted.until(2000, |one| one.bench.robot.phase() == Phase::Holding);
        lifted
    }

    fn step(&mut self, request: Option<RequestKind>) -> AxisSignals {
        self.bench.cycle(request);
        self.records.push(*self.bench.robot.record());
        self.said()
    }

    fn said(&self) -> AxisSignals {
        let record = self.bench.robot.record();
        let at = record.signals.shape.inputs - 7;
        let [position, speed, _, set_point, state, homed, mode] =
            record.signals.inputs[at..at + 7].try_into().unwrap();
        let state = AxisState::from_code(state as u64).unwrap();
        AxisSignals { position, speed, set_point, state, is_homed: homed == 1.0, mode: mode as i8 }
    }

    /// Where it truly is, m.
    fn truth_m(&self) -> f64 {
        self.lift.state().position_rad * self.m_per_rad
    }

    #[track_caller]
    fn ask(&mut self, ask: AxisAsk) -> RequestAnswer {
        self.step(Some(RequestKind::Axis { device: AXIS, ask }));
        self.bench.robot.record().answer
    }

    #[track_caller]
    fn move_to(&mut self, position: f64, mode: AxisMode) {
        assert_eq!(self.ask(AxisAsk::Move { position, mode }), RequestAnswer::Taken);
    }

    fn stop(&mut self, category: StopCategory) {
        self.step(Some(RequestKind::Stop(category)));
    }

    fn run(&mut self, cycles: usize) {
        (0..cycles).for_each(|_| {
            self.step(None);
        });
    }

    #[track_caller]
    fn until(&mut self, most: usize, is_so: impl Fn(&Lifted) -> bool) -> usize {
        for cycle in 0..most {
            if is_so(self) {
                return cycle;
            }
            self.step(None);
        }
        let problems: Vec<_> = self.bench.robot.device_problems().collect();
        let record = self.bench.robot.record();
        panic!(
            "{:?} {:?} {:?} {problems:?} {:?}",
            self.said(),
            record.phase,
            record.stop_reason,
            self.bench.events
        )
    }

    #[track_caller]
    fn rests(&mut self) {
        self.run(40);
        self.until(20_000, |one| one.said().state == AxisState::Holding);
    }

    #[track_caller]
    fn home(&mut self) {
        assert_eq!(self.ask(AxisAsk::Home), RequestAnswer::Taken);
        self.rests();
        assert!(self.said().is_homed, "{:?}", self.said());
    }
}

#[test]
fn an_axis_is_homed_and_moved_by_csp_and_by_pp() {
    let mut robot = Lifted::new(&plan(&[]));
    assert_eq!((robot.said().state, robot.said().is_homed), (AxisState::Holding, false));
    let refused = robot.ask(AxisAsk::Move { position: 0.2, mode: AxisMode::Csp });
    assert_eq!(refused, RequestAnswer::NotHomed);
    robot.home();
    // Its count is 0 where it left the switch; the servo stops a little behind it.
    assert!((robot.said().position - robot.truth_m()).abs() < 1e-4, "{} {:?}", robot.truth_m(), robot.said());
    for (to, mode) in [(0.3, AxisMode::Csp), (0.1, AxisMode::Pp), (0.25, AxisMode::Csp), (0.55, AxisMode::Pp)]
    {
        robot.move_to(to, mode);
        robot.run(50);
        assert_eq!((robot.said().state, robot.said().mode), (AxisState::Moving, mode.mode().code()));
        robot.rests();
        assert!((robot.truth_m() - to).abs() < 2e-4, "{mode:?}: {to} {}", robot.truth_m());
        assert!((robot.said().set_point - to).abs() < 2e-4, "{mode:?}: {:?}", robot.said());
        assert_eq!(robot.said().mode, Mode::CyclicSynchronousPosition.code());
        assert_eq!(robot.bench.robot.phase(), Phase::Holding);
    }
    // Outside of its limits nothing goes, nor anywhere that is no number.
    for position in [0.0, 0.7, f64::NAN, f64::INFINITY] {
        assert_eq!(robot.ask(AxisAsk::Move { position, mode: AxisMode::Csp }), RequestAnswer::Refused);
    }
}

/// How far the platform ever was from where its circle led it, m, from beginning to end.
fn circled(robot: &mut Lifted, mut beside: impl FnMut(&mut Lifted, usize)) -> f64 {
    robot.step(Some(RequestKind::Track));
    let mut worst_m: f64 = 0.0;
    for cycle in 0..20_000 {
        beside(robot, cycle);
        robot.step(None);
        let wished = robot.bench.robot.record().setpoint.odom_from_body;
        let truth = robot.machine.truth().pose;
        worst_m = worst_m.max((wished.x_m - truth.x_m).hypot(wished.y_m - truth.y_m));
        if robot.bench.robot.phase() != Phase::Tracking {
            assert_eq!(robot.bench.robot.phase(), Phase::Holding);
            return worst_m;
        }
    }
    panic!("{:?}", robot.bench.robot.phase());
}

const CIRCLE: (&str, &str) =
    ("[controller]", "[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 8.0\n[controller]");

/// The last inputs, outputs and signals that were recorded come out again, bit by bit.
fn replayed(plan: &RobotPlan, records: &[CycleRecord]) {
    let mut robot = Robot::build(plan, &Registry::with_built_in()).unwrap();
    let mut buffer = ImageBuffer::new(plan);
    let layout = plan.record_layout();
    for record in records {
        let mut values = Vec::new();
        record.values(&mut values);
        let read = CycleRecord::from_values(&layout, &values).unwrap();
        assert_eq!(robot.replay(&read, &mut buffer), record, "cycle {}", record.time.index);
    }
}

#[test]
fn an_axis_is_homed_and_moved_while_the_base_drives_as_well_as_alone_and_all_is_computed_again() {
    let plan = plan(&[CIRCLE]);
    let alone_m = circled(&mut Lifted::new(&plan), |_, _| {});
    let mut robot = Lifted::new(&plan);
    let mut last = Vec::new();
    let beside_m = circled(&mut robot, |robot, cycle| match cycle {
        500 => assert_eq!(robot.ask(AxisAsk::Home), RequestAnswer::Taken),
        4000 => robot.move_to(0.3, AxisMode::Csp),
        6500 => {
            last.push(robot.truth_m());
            robot.move_to(0.5, AxisMode::Pp);
        }
        _ => {}
    });
    robot.rests();
    last.push(robot.truth_m());
    assert!((last[0] - 0.3).abs() < 2e-4 && (last[1] - 0.5).abs() < 2e-4, "{last:?}");
    println!(
        "from its set point at most {alone_m:.6} m alone, {beside_m:.6} m beside an axis at {last:?} m (0.3 by csp, 0.5 by pp)"
    );
    // The same machine, the same commands: the axis takes nothing from the base.
    assert_eq!(beside_m, alone_m);
    assert!((1e-5..3e-3).contains(&alone_m), "{alone_m}");
    replayed(&plan, &robot.records);
}

/// A stop, by whom, and what the robot is after it.
type Stops = (&'static str, fn(&mut Lifted), Phase);

#[test]
fn whatever_stops_the_robot_stops_its_axes_and_nothing_goes_on_by_itself() {
    const BUTTON: ObjectAddress = ObjectAddress::new(0x6010, 1);
    let stops: [Stops; 4] = [
        ("button", |robot| assert!(robot.buttons.set_input(BUTTON, 1)), Phase::Fault),
        ("category 2", |robot| robot.stop(StopCategory::RampAndHold), Phase::Holding),
        ("category 1", |robot| robot.stop(StopCategory::RampThenRemove), Phase::Disabled),
        ("category 0", |robot| robot.stop(StopCategory::RemoveTorque), Phase::Disabled),
    ];
    for (by, stop, after) in stops {
        for ask in [
            AxisAsk::Move { position: 0.5, mode: AxisMode::Csp },
            AxisAsk::Move { position: 0.5, mode: AxisMode::Pp },
            AxisAsk::Run { speed: 0.15 },
            AxisAsk::Home,
        ] {
            let mut robot = Lifted::new(&plan(&[CIRCLE]));
            robot.home();
            robot.move_to(0.2, AxisMode::Csp);
            robot.rests();
            robot.step(Some(RequestKind::Track));
            assert_eq!(robot.ask(ask), RequestAnswer::Taken);
            robot.run(600);
            assert!(robot.said().speed.abs() > 0.04, "{by} {ask:?}: {:?}", robot.said());
            let (begun, before_m) = (robot.records.len(), robot.truth_m());
            stop(&mut robot);
            robot.until(3000, |one| one.bench.robot.phase() == after);
            robot.run(2000);
            // v²/2a, half the time in which the deceleration comes, and some cycles; without torque friction alone stops it.
            let most_m = if by == "category 0" { 0.1 } else { 0.15 * 0.15 / 2.0 + 0.15 * 0.1 / 2.0 + 0.001 };
            let stopped_m = robot.truth_m();
            assert!((stopped_m - before_m).abs() < most_m, "{by} {ask:?}: {before_m} {stopped_m}");
            // The base too waits for the axis: no torque is taken before it stands.
            let left = robot.records[begun..].iter().find(|record| record.phase == after).unwrap();
            assert!(by == "category 0" || left.signals.inputs[2].abs() < 0.01, "{by} {ask:?}");
            assert!(robot.buttons.set_input(BUTTON, 0));
            robot.step(Some(RequestKind::Acknowledge));
            if after != Phase::Holding {
                robot.run(20);
                robot.step(Some(RequestKind::Enable));
                robot.until(2000, |one| one.bench.robot.phase() == Phase::Holding);
            }
            robot.run(1000);
            assert!((robot.truth_m() - stopped_m).abs() < 1e-4, "{by} {ask:?}: it went on");
            assert_eq!(robot.bench.robot.phase(), Phase::Holding);
            // A person asks again.
            if matches!(ask, AxisAsk::Move { .. }) {
                assert_eq!(robot.ask(ask), RequestAnswer::Taken);
                robot.rests();
                assert!((robot.truth_m() - 0.5).abs() < 2e-4);
            }
        }
    }
}

#[test]
fn an_axis_stops_when_it_is_told_to_and_the_base_goes_on() {
    for mode in [AxisMode::Csp, AxisMode::Pp] {
        let mut robot = Lifted::new(&plan(&[CIRCLE]));
        robot.home();
        robot.step(Some(RequestKind::Track));
        robot.move_to(0.5, mode);
        robot.run(1000);
        // What waits for the axis to rest is over too.
        let other = if mode == AxisMode::Csp { AxisMode::Pp } else { AxisMode::Csp };
        robot.move_to(0.55, other);
        assert_eq!(robot.ask(AxisAsk::Stop), RequestAnswer::Taken);
        robot.rests();
        let stopped_m = robot.truth_m();
        assert!((0.1..0.2).contains(&stopped_m), "{stopped_m}");
        robot.run(500);
        assert!((robot.truth_m() - stopped_m).abs() < 1e-5);
        assert_eq!(robot.bench.robot.phase(), Phase::Tracking);
    }
}

#[test]
fn what_doesnt_fit_a_motion_waits_until_the_axis_rests() {
    let mut robot = Lifted::new(&plan(&[]));
    robot.home();
    robot.move_to(0.5, AxisMode::Csp);
    robot.run(800);
    // Another mode: it comes to rest first. The same mode: it turns round on its way.
    robot.move_to(0.1, AxisMode::Pp);
    robot.run(30);
    assert_eq!((robot.said().state, robot.said().mode), (AxisState::Stopping, 8));
    robot.until(1000, |one| one.said().mode == 1);
    assert!(robot.said().speed.abs() < 0.01);
    robot.run(300);
    robot.move_to(0.4, AxisMode::Pp);
    robot.rests();
    assert!((robot.truth_m() - 0.4).abs() < 2e-4, "{}", robot.truth_m());
    robot.move_to(0.3, AxisMode::Csp);
    robot.run(300);
    robot.move_to(0.5, AxisMode::Csp);
    robot.rests();
    assert!((robot.truth_m() - 0.5).abs() < 2e-4);
    // Nobody moves an axis that looks for its home.
    robot.ask(AxisAsk::Home);
    let answer = robot.ask(AxisAsk::Move { position: 0.3, mode: AxisMode::Csp });
    assert_eq!(answer, RequestAnswer::Homing);
}

#[test]
fn an_axis_runs_at_a_speed_as_far_as_its_limits() {
    let mut robot = Lifted::new(&plan(&[]));
    assert_eq!(robot.ask(AxisAsk::Run { speed: 0.1 }), RequestAnswer::NotHomed);
    robot.home();
    for speed in [0.16, -0.16, f64::NAN] {
        assert_eq!(robot.ask(AxisAsk::Run { speed }), RequestAnswer::Refused);
    }
    assert_eq!(robot.ask(AxisAsk::Run { speed: 0.1 }), RequestAnswer::Taken);
    robot.run(1000);
    assert_eq!((robot.said().state, robot.said().mode), (AxisState::Moving, 3));
    assert!((robot.said().speed - 0.1).abs() < 1e-3, "{:?}", robot.said());
    // Slower, and the other way, without a rest between.
    assert_eq!(robot.ask(AxisAsk::Run { speed: -0.05 }), RequestAnswer::Taken);
    robot.run(1000);
    assert!((robot.said().speed + 0.05).abs() < 1e-3 && robot.said().mode == 3, "{:?}", robot.said());
    for (speed, limit) in [(0.15, 0.6), (-0.15, 0.01)] {
        assert_eq!(robot.ask(AxisAsk::Run { speed }), RequestAnswer::Taken);
        robot.rests();
        let short_m = (robot.truth_m() - limit) * -speed.signum();
        assert!((-1e-4..5e-3).contains(&short_m), "{speed}: {}", robot.truth_m());
        // There is nothing further that way.
        assert_eq!(robot.ask(AxisAsk::Run { speed }), RequestAnswer::Taken);
        robot.rests();
        assert!((robot.truth_m() - limit).abs() < 5e-3, "{speed}: {}", robot.truth_m());
    }
    assert_eq!(robot.bench.robot.phase(), Phase::Holding);
}

/// The robot stopped by itself, and why, in words.
#[track_caller]
fn failed(robot: &mut Lifted) -> String {
    robot.until(30_000, |one| one.bench.robot.phase() == Phase::Fault);
    let record = robot.bench.robot.record();
    assert_eq!((record.stop_reason, record.stop_where), (SafetyReason::Axis, 8 + u64::from(AXIS)));
    let problems: Vec<_> = robot.bench.robot.device_problems().collect();
    assert_eq!(problems.len(), 1);
    problems[0].1.clone()
}

#[test]
fn an_axis_that_doesnt_follow_stops_the_robot() {
    let mut robot = Lifted::new(&plan(&[CIRCLE]));
    robot.home();
    robot.step(Some(RequestKind::Track));
    robot.move_to(0.5, AxisMode::Csp);
    robot.run(500);
    robot.lift.jam(true);
    let words = failed(&mut robot);
    assert!(words.contains("from its set point, at most 0.005 m"), "{words}");
    assert!(robot.bench.robot.record().measurements.present().iter().all(|drive| drive.stands()));
    robot.lift.jam(false);
    robot.run(500);
    let stood_m = robot.truth_m();
    robot.step(Some(RequestKind::Acknowledge));
    robot.run(20);
    robot.step(Some(RequestKind::Enable));
    robot.until(2000, |one| one.bench.robot.phase() == Phase::Holding);
    robot.run(200);
    assert!((robot.truth_m() - stood_m).abs() < 1e-4 && robot.said().is_homed);
    // In pp the drive looks itself (0x6065), and its fault stops the robot.
    robot.move_to(0.5, AxisMode::Pp);
    robot.run(500);
    robot.lift.jam(true);
    let words = failed(&mut robot);
    assert!(words.contains("fault") && words.contains("8611"), "{words}");
}

#[test]
fn the_loss_of_an_axis_stops_the_robot_and_its_home_is_lost_with_its_supply() {
    for (encoder, kept) in [("", false), ("encoder = \"absolute\"\n", true)] {
        let mut robot =
            Lifted::new(&plan(&[CIRCLE, ("unit = \"m\"\n", &format!("unit = \"m\"\n{encoder}"))]));
        robot.home();
        robot.step(Some(RequestKind::Track));
        robot.move_to(0.5, AxisMode::Csp);
        robot.run(500);
        robot.bench.inject(AXIS_ON_BUS, Fault::PowerCycle { off_for: Duration::from_millis(300) });
        robot.until(3000, |one| one.bench.robot.phase() == Phase::Fault);
        let record = robot.bench.robot.record();
        assert_eq!((record.stop_reason, record.stop_where), (SafetyReason::DeviceLost, 8 + u64::from(AXIS)));
        robot.run(6000);
        let stood_m = robot.truth_m();
        assert_eq!(robot.bench.al_status(AXIS_ON_BUS), 8, "{:?}", robot.bench.events);
        assert_eq!(robot.said().is_homed, kept);
        robot.step(Some(RequestKind::Acknowledge));
        robot.run(20);
        robot.step(Some(RequestKind::Enable));
        robot.until(3000, |one| one.bench.robot.phase() == Phase::Holding);
        robot.run(500);
        assert!((robot.truth_m() - stood_m).abs() < 1e-4, "it went on");
        let expected = if kept { RequestAnswer::Taken } else { RequestAnswer::NotHomed };
        assert_eq!(robot.ask(AxisAsk::Move { position: 0.1, mode: AxisMode::Csp }), expected);
    }
}

#[test]
fn what_a_silent_subdevice_said_last_grows_old_from_its_first_missed_exchange() {
    let mut robot = Lifted::new(&plan(&[CIRCLE]));
    robot.run(100);
    robot.bench.inject(AXIS_ON_BUS, Fault::PowerOff);
    let mut age_s = 0.0;
    for cycle in 0..40 {
        robot.step(None);
        let now_s = robot.bench.robot.record().signals.ages_s[AXIS as usize];
        // The supply lasts some cycles.
        assert!(
            now_s > age_s || (now_s == 0.0 && age_s == 0.0 && cycle < 10),
            "{cycle}: {age_s} s, then {now_s} s"
        );
        age_s = now_s;
    }
}

#[test]
fn a_home_that_isnt_found_in_time_leaves_the_axis_holding_and_the_base_driving() {
    for (from, to) in [("timeout_s = 20.0", "timeout_s = 0.5"), ("method = 17", "method = 99")] {
        let mut robot = Lifted::new(&plan(&[CIRCLE, (from, to), ("= 0.05\n\n", "= 0.5\n\n")]));
        robot.step(Some(RequestKind::Track));
        assert_eq!(robot.ask(AxisAsk::Home), RequestAnswer::Taken);
        robot.until(2000, |one| one.said().state == AxisState::HomingFailed);
        assert!(!robot.said().is_homed);
        let stood_m = robot.truth_m();
        robot.run(500);
        assert!((robot.truth_m() - stood_m).abs() < 1e-3, "{stood_m} {}", robot.truth_m());
        assert_eq!(robot.bench.robot.phase(), Phase::Tracking);
        let answer = robot.ask(AxisAsk::Move { position: 0.1, mode: AxisMode::Csp });
        assert_eq!(answer, RequestAnswer::NotHomed);
    }
}

#[test]
fn a_home_of_before_isnt_taken_for_a_new_one() {
    let mut robot = Lifted::new(&plan(&[]));
    robot.home();
    robot.move_to(0.2, AxisMode::Csp);
    robot.rests();
    // The drive shows the old home when it comes to hm.
    robot.ask(AxisAsk::Home);
    robot.run(200);
    assert_eq!((robot.said().state, robot.said().is_homed), (AxisState::Homing, false));
    robot.rests();
    assert!(robot.said().is_homed && robot.truth_m().abs() < 1e-3, "{}", robot.truth_m());
}

#[test]
fn set_points_keep_the_limits_of_the_file_whatever_is_lost() {
    let mut robot = Lifted::new(&plan(&[]));
    robot.home();
    robot.move_to(0.5, AxisMode::Csp);
    let begun = robot.records.len();
    for _ in 0..400 {
        robot.run(9);
        // Two exchanges in a row: fewer than are tolerated.
        robot.bench.link.1.borrow_mut().down = 2;
        robot.run(2);
    }
    robot.rests();
    assert!((robot.truth_m() - 0.5).abs() < 2e-4);
    let points: Vec<f64> = robot.records[begun..]
        .iter()
        .filter(|record| record.exchange == omnibase_robot::Exchange::Complete)
        .map(|record| record.signals.inputs[4])
        .collect();
    // Between two that were heard lie three cycles at most.
    let fastest = points.windows(2).fold(0.0, |most: f64, pair| most.max((pair[1] - pair[0]).abs()));
    assert!(fastest <= 3.0 * 0.15e-3 + 1e-9, "{fastest}");
}
