//! A motion that somebody asked for, a SubDevice that is lost amid it and comes back, and people in between.

use crate::hands::{BMM, Hands, played_by};
use omnibase_cia402::{ErrorCode, StatusWord};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::config::{ComebackEnd, ComebackPlan, ReferenceTable};
use omnibase_robot::signals::{
    CycleRecord, Exchange, Frame, MAX_WHEELS, Phase, RequestAnswer, SafetyReason, StopCategory,
};
use omnibase_run::RobotText;
use omnibase_run::live::Stamp;
use omnibase_run::live::command::Command;
use omnibase_run::live::{Ages, Answer, Ask, Client, Commander, Operator, StickWish};

const MS: u64 = 1_000_000;
const UNATTENDED: ComebackEnd = ComebackEnd::MoveAgain { warning_ns: 3000 * MS };

/// By which errors of its own each drive says that the bus failed: the second one as an SGDV does.
const OF_THE_BUS: [&[ErrorCode]; MAX_WHEELS] = {
    let mut all: [&[ErrorCode]; MAX_WHEELS] = [&[]; MAX_WHEELS];
    all[1] = &[ErrorCode(0x0A12)];
    all
};

/// A second of rest, then what the end says.
fn plan(within_ns: u64, end: ComebackEnd) -> ComebackPlan {
    ComebackPlan {
        end,
        within_ns,
        steady_ns: 1000 * MS,
        lost_exchanges_tolerated: 3,
        enable_input: None,
        stop_input: None,
        bus_errors: OF_THE_BUS,
    }
}

/// The operator of a robot whose phases the test plays; every request is taken.
struct Bench {
    operator: Operator,
    record: CycleRecord,
    phase: Phase,
}

impl Bench {
    /// A robot that follows what this client asked for, and goes on after a loss within 10 s.
    fn following(client: Client, within_ns: Option<u64>) -> Self {
        Bench::following_by(client, within_ns.map(|within_ns| plan(within_ns, UNATTENDED)))
    }

    /// The same, with another plan.
    fn following_by(client: Client, plan: Option<ComebackPlan>) -> Self {
        let ages = Ages { stick_ns: 200 * MS, session_ns: 1000 * MS };
        let mut operator = Operator::new(ages, StopCategory::RampThenRemove);
        operator.comes_back(plan);
        let mut bench = Bench { operator, record: CycleRecord::default(), phase: Phase::Holding };
        bench.record.exchange = Exchange::Complete;
        bench.record.measurements.wheels = 3;
        bench.record.time.period_ns = MS;
        bench.hear(client, Ask::Robot(RequestKind::Track));
        assert_eq!(bench.cycle(), Some(RequestKind::Track));
        bench.phase = Phase::Tracking;
        bench.cycle();
        assert_eq!(bench.operator.commander(), Commander::Reference(client));
        bench
    }

    fn hear(&mut self, client: Client, ask: Ask) {
        self.operator.hear(self.record.time.now_ns, Command { client, ticket: 0, ask, stamp: Stamp::Here });
    }

    fn cycle(&mut self) -> Option<RequestKind> {
        self.operator.discarded().for_each(drop);
        self.record.time.now_ns += MS;
        let turn = self.operator.turn(self.record.time.now_ns, &self.record, self.phase);
        self.record.answer = if turn.request.is_some() { RequestAnswer::Taken } else { RequestAnswer::None };
        turn.request.map(|request| request.kind)
    }

    /// A SubDevice is lost for 100 cycles, and the drives' own stop ends in a fault.
    fn lose(&mut self) {
        self.record.exchange = Exchange::Without { wheels: 0b100, devices: 0 };
        self.record.stop_reason = SafetyReason::DeviceLost;
        for phase in [Phase::QuickStopping, Phase::Fault] {
            self.phase = phase;
            for _ in 0..50 {
                assert_eq!(self.cycle(), None);
            }
        }
        self.record.exchange = Exchange::Complete;
    }

    /// As [`Bench::asked`], with the page there.
    fn asked_alive(&mut self, cycles: u32) -> Vec<RequestKind> {
        let mut all = Vec::new();
        for _ in 0..cycles {
            self.hear(Client::Page(3), Ask::Alive);
            all.extend(self.asked(1));
        }
        all
    }

    /// What is asked in so many cycles, while the robot does as it is asked.
    fn asked(&mut self, cycles: u32) -> Vec<RequestKind> {
        let mut all = Vec::new();
        for _ in 0..cycles {
            let kind = self.cycle();
            match kind {
                Some(RequestKind::Acknowledge) => {
                    (self.phase, self.record.stop_reason) = (Phase::Disabled, SafetyReason::None);
                }
                Some(RequestKind::Enable) => self.phase = Phase::Holding,
                Some(RequestKind::Resume) => {
                    (self.phase, self.record.stop_reason) = (Phase::Tracking, SafetyReason::None);
                }
                _ => {}
            }
            all.extend(kind);
        }
        all
    }
}

const SET_POSE: RequestKind = RequestKind::SetPose {
    odom_from_body: Pose2 { x_m: 1.0, y_m: 0.0, heading_rad: 0.0 },
    sigma_m: 0.02,
    sigma_rad: 0.02,
};
const BACK: [RequestKind; 3] = [RequestKind::Acknowledge, RequestKind::Enable, RequestKind::Resume];

#[test]
fn a_motion_goes_on_by_itself_where_the_file_says_so_after_a_second_of_rest_and_three_of_warning() {
    let page = Client::Page(3);
    let mut bench = Bench::following(page, Some(10_000 * MS));
    for _ in 0..2 {
        bench.lose();
        // Steadiness in time, whatever the period is.
        assert_eq!(bench.asked_alive(990), []);
        assert_eq!(bench.asked_alive(60), BACK[..2]);
        let left_s = bench.operator.moves_again_in_s(bench.record.time.now_ns).expect("it warns");
        assert!((2.9..=3.0).contains(&left_s), "{left_s} s");
        let notes: Vec<&str> = bench.operator.notes().map(|note| note.text).collect();
        assert!(notes.iter().any(|text| text.starts_with("WARNING")), "{notes:?}");
        assert_eq!(bench.asked_alive(2900), []);
        assert_eq!(bench.asked_alive(200), BACK[2..]);
        assert_eq!(bench.operator.commander(), Commander::Reference(page));
    }
    // Its end is its end.
    bench.phase = Phase::Holding;
    assert_eq!(bench.asked_alive(6000), []);
    let mut bench = Bench::following(page, None);
    bench.lose();
    assert_eq!(bench.asked_alive(6000), []);
    // Too late.
    let mut bench = Bench::following(page, Some(50 * MS));
    bench.lose();
    assert_eq!(bench.asked_alive(6000), []);
}

#[test]
fn a_way_that_took_the_place_of_a_path_is_not_gone_on_with_by_itself() {
    let page = Client::Page(3);
    let mut bench = Bench::following(page, Some(10_000 * MS));
    let go = RequestKind::GoTo { odom_from_body: Pose2 { x_m: 1.0, y_m: 0.0, heading_rad: 0.0 } };
    bench.hear(page, Ask::Robot(go));
    assert_eq!(bench.asked_alive(100), [go]);
    bench.lose();
    // What it would go on with is the path that was left.
    assert_eq!(bench.asked_alive(20_000), []);
}

#[test]
fn hold_ends_in_holding_and_a_person_resumes() {
    let page = Client::Page(3);
    let mut bench = Bench::following(page, None);
    bench.operator.comes_back(Some(plan(10_000 * MS, ComebackEnd::Hold)));
    bench.cycle();
    bench.lose();
    assert_eq!(bench.asked_alive(20_000), BACK[..2]);
    assert_eq!(bench.phase, Phase::Holding);
    assert_eq!(bench.operator.moves_again_in_s(bench.record.time.now_ns), None);
    bench.hear(page, Ask::Robot(RequestKind::Resume));
    assert_eq!(bench.asked_alive(10), BACK[2..]);
}

/// Something that happens beside the loss, and at which of the cycles since.
type Event = (&'static str, fn(&mut Bench));

#[test]
fn nothing_comes_by_itself_where_more_than_a_loss_happened() {
    const EVENTS: [Event; 8] = [
        ("a drive's own fault", |bench| set_fault(bench, 1, 0x2310)),
        ("a fault that no drive explains", |bench| set_fault(bench, 1, 0)),
        ("a fault that only an emergency tells", |bench| bench.operator.drive_said(1, ErrorCode(0x4310))),
        ("the high voltage is gone", |bench| bench.record.measurements.drives[0].status = StatusWord(0x0040)),
        ("all drives vanish", |bench| {
            bench.record.exchange = Exchange::Without { wheels: 0b111, devices: 0 }
        }),
        ("no frame comes back", |bench| bench.record.exchange = Exchange::Lost),
        ("all drives start anew", |bench| bench.record.exchange = Exchange::Restarted { wheels: 0b111 }),
        ("another reason", |bench| bench.record.stop_reason = SafetyReason::Drive),
    ];
    let page = Client::Page(3);
    for (what, event) in EVENTS {
        for after in [0, 400, 1500] {
            let mut bench = Bench::following(page, Some(20_000 * MS));
            for drive in &mut bench.record.measurements.drives {
                drive.status = StatusWord(0x0050);
            }
            bench.cycle();
            bench.lose();
            let before = bench.asked_alive(after);
            let well = bench.record;
            event(&mut bench);
            let mut during = bench.asked_alive(5);
            bench.record =
                CycleRecord { time: bench.record.time, stop_reason: bench.record.stop_reason, ..well };
            during.extend(bench.asked_alive(8000));
            assert!(!during.contains(&RequestKind::Resume), "{what} after {after}: {before:?}, {during:?}");
        }
    }
    // What the loss itself makes; the same number means something else where another kind of drive says it.
    for (wheel, goes_on) in [(1, true), (2, false)] {
        let mut bench = Bench::following(page, Some(20_000 * MS));
        bench.lose();
        set_fault(&mut bench, wheel, 0x0A12);
        assert_eq!(bench.asked_alive(8000).contains(&RequestKind::Resume), goes_on, "wheel {wheel}");
    }
    // A motion that a command began: nobody living stands behind it.
    let mut bench = Bench::following(Client::Command, Some(20_000 * MS));
    bench.lose();
    assert_eq!(bench.asked(8000), []);
    // Nobody knows where it stands.
    let mut bench = Bench::following(page, Some(20_000 * MS));
    bench.lose();
    bench.record.state.pose_known = false;
    assert_eq!(bench.asked_alive(8000), BACK[..2]);
}

fn set_fault(bench: &mut Bench, wheel: usize, error: u16) {
    let drive = &mut bench.record.measurements.drives[wheel];
    (drive.status, drive.error) = (StatusWord(0x0018), ErrorCode(error));
}

/// What, who, what they ask, and whether the motion goes on all the same.
type Deed = (&'static str, Client, fn() -> Ask, bool);

#[test]
fn a_person_who_does_anything_about_motion_meanwhile_comes_first() {
    let page = Client::Page(3);
    const HELD: StickWish =
        StickWish::Held { twist: Twist2 { vx_m_s: 0.1, vy_m_s: 0.0, w_rad_s: 0.0 }, frame: Frame::Body };
    let deeds: [Deed; 10] = [
        ("nothing", page, || Ask::Alive, true),
        ("an obstacle", Client::Command, || Ask::Robot(RequestKind::RemoveObstacle { index: 0 }), true),
        ("a stick that rests", page, || Ask::Stick(StickWish::Released), true),
        ("a stick in hand", Client::Joystick, || Ask::Stick(HELD), false),
        ("a stop", Client::Page(5), || Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)), false),
        ("the emergency stop", Client::Command, || Ask::EmergencyStop, false),
        ("somebody enables", Client::Command, || Ask::Robot(RequestKind::Enable), false),
        ("the page goes", page, || Ask::Gone, false),
        ("the joystick is lost", Client::Joystick, || Ask::Stick(StickWish::Lost), false),
        ("somebody sets the pose", Client::Page(5), || Ask::Robot(SET_POSE), false),
    ];
    for (what, client, deed, goes_on) in deeds {
        // While it waits, and while it warns.
        for after in [0, 600, 2500] {
            let mut bench = Bench::following(page, Some(10_000 * MS));
            bench.lose();
            assert!(!bench.asked_alive(after).contains(&RequestKind::Resume));
            bench.hear(client, deed());
            let resumes = bench.asked_alive(6000).contains(&RequestKind::Resume);
            assert_eq!(resumes, goes_on, "{what} after {after} cycles");
        }
    }
    // A page that falls silent meanwhile, too.
    let mut bench = Bench::following(page, Some(10_000 * MS));
    bench.lose();
    bench.record.exchange = Exchange::Without { wheels: 0b100, devices: 0 };
    assert_eq!(bench.asked(1100), []);
    bench.record.exchange = Exchange::Complete;
    assert_eq!(bench.asked(6000), []);
}

/// What was in the way when it was planned isn't what is there now.
#[test]
fn a_way_that_is_looked_after_is_never_gone_on_with_by_itself() {
    let table: ReferenceTable = toml::from_str(
        "kind = \"path\"\nframe = \"start\"\npoints = [[0.0, 0.0, 0.0, 0.0], [4.0, 0.5, 0.0, 0.0]]",
    )
    .unwrap();
    for (stamp, asked) in [(Stamp::OnBehalf, &[][..]), (Stamp::Here, &BACK[..])] {
        let page = Client::Page(3);
        let mut bench = Bench::following(page, Some(10_000 * MS));
        let ask = Ask::Load { number: 5, reference: crate::hands::reference(&table) };
        bench.operator.hear(bench.record.time.now_ns, Command { client: page, ticket: 0, ask, stamp });
        assert_eq!(bench.cycle(), Some(RequestKind::UseReference { number: 5 }));
        (bench.record.reference, bench.record.reference_next) = (5, 5);
        bench.asked_alive(10);
        bench.lose();
        assert_eq!(bench.asked_alive(9000), asked, "{stamp:?}");
    }
}

#[test]
fn a_path_that_a_pulled_cable_ended_is_gone_to_its_end_once_a_person_resumes() {
    for person_resumes in [true, false] {
        let changes = vec!["safety.after_lost_device=\"move_again_unattended\"".to_owned()];
        let robot = RobotText { text: BMM.into(), changes, ..RobotText::default() };
        let run = played_by(robot, 24.0, |hands: &mut Hands| {
            let page = Client::Page(0);
            hands.alive(0.4, 24.0, page);
            hands.send(0.5, page, Ask::Robot(RequestKind::Enable));
            hands.at(1.0, move |live, _| {
                let table: ReferenceTable = toml::from_str(
                    "kind = \"path\"\nframe = \"start\"\npoints = [[0.0, 0.0, 0.0, 0.0], [4.0, 0.5, 0.0, 0.0]]",
                )
                .unwrap();
                let path = crate::hands::reference(&table);
                live.load(page, table, path).unwrap();
                live.send(page, Ask::Robot(RequestKind::Track)).unwrap();
            });
            // The cable of the first drive: nobody can tell that from a supply that was cut.
            hands.pull_cable(2.5, 3.0);
            hands.at(14.0, |_, seen| assert_eq!(seen.phase, Phase::Fault));
            if person_resumes {
                hands.send(14.1, page, Ask::Robot(RequestKind::Acknowledge));
                hands.send(14.2, page, Ask::Robot(RequestKind::Enable));
                hands.send(15.0, page, Ask::Robot(RequestKind::Resume));
            }
        });
        let x_m = run.last.record.state.odom_from_body.x_m;
        let events: Vec<&str> = run.ran.summary.events.iter().map(|event| event.text.as_str()).collect();
        assert!(events.iter().any(|text| text.starts_with("all drives vanished")), "{events:#?}");
        assert_eq!((x_m - 0.5).abs() < 2e-3, person_resumes, "{x_m} m, {events:#?}");
        assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    }
}

#[test]
fn a_person_sets_the_pose_of_a_robot_that_stands() {
    let robot = RobotText { text: BMM.into(), ..RobotText::default() };
    let run = played_by(robot, 4.0, |hands: &mut Hands| {
        let page = Client::Page(0);
        hands.alive(0.4, 4.0, page);
        let set = |x_m: f64, heading_rad: f64| {
            let odom_from_body = Pose2 { x_m, y_m: -2.0, heading_rad };
            Ask::Robot(RequestKind::SetPose { odom_from_body, sigma_m: 0.1, sigma_rad: 0.2 })
        };
        hands.ask(0.5, page, set(1.0, 7.0), Answer::Robot(RequestAnswer::Taken));
        hands.ask(0.7, page, set(f64::NAN, 0.0), Answer::Robot(RequestAnswer::Refused));
        hands.send(0.9, page, Ask::Robot(RequestKind::Enable));
        hands.ask(1.5, page, set(3.0, 0.5), Answer::Robot(RequestAnswer::Taken));
        hands.send(2.0, page, Ask::Robot(RequestKind::GoTo { odom_from_body: Pose2::new(3.5, -2.0, 0.5) }));
        hands.ask(2.3, page, set(0.0, 0.0), Answer::Robot(RequestAnswer::WrongPhase));
    });
    let state = run.last.record.state;
    let pose = state.odom_from_body;
    assert!((pose.x_m - 3.5).abs() < 2e-3 && (pose.y_m + 2.0).abs() < 2e-3, "{pose:?}");
    assert!((pose.heading_rad - 0.5).abs() < 2e-3, "{pose:?}");
    let [xx, .., hh] = state.covariance;
    assert!((0.1..0.15).contains(&xx.sqrt()) && (0.2..0.21).contains(&hh.sqrt()), "{state:?}");
    // It only moved half a metre.
    let truth = run.last.extras.truth.unwrap().odom_from_body;
    assert!((truth.x_m.hypot(truth.y_m) - 0.5).abs() < 5e-3, "{truth:?}");
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn an_input_that_forbade_only_between_two_cycles_ends_the_comeback_too() {
    for (zeroed, comes_back) in [(0, true), (1, false)] {
        let by_input = ComebackPlan { enable_input: Some(0), ..plan(10_000 * MS, UNATTENDED) };
        let mut bench = Bench::following_by(Client::Page(3), Some(by_input));
        let signals = &mut bench.record.signals;
        (signals.shape.inputs, signals.inputs[0], signals.believed) = (1, 1.0, 1);
        bench.lose();
        bench.record.signals.zeroed = zeroed;
        assert_eq!(bench.cycle(), None);
        bench.record.signals.zeroed = 0;
        assert_eq!(!bench.asked_alive(6000).is_empty(), comes_back, "{zeroed}");
    }
}
