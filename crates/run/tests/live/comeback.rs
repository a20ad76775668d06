//! A motion that somebody asked for, a SubDevice that is lost amid it and comes back, and people in between.

use crate::hands::{BMM, Hands, played_by};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::references::reference;
use omnibase_robot::signals::{
    CycleRecord, Exchange, Frame, Phase, RequestAnswer, SafetyReason, StopCategory,
};
use omnibase_run::RobotText;
use omnibase_run::live::command::Command;
use omnibase_run::live::{Ages, Ask, Client, Commander, Operator, Pad};

const MS: u64 = 1_000_000;

/// The operator of a robot whose phases the test plays; every request is taken.
struct Bench {
    operator: Operator,
    record: CycleRecord,
    phase: Phase,
}

impl Bench {
    /// A robot that follows what this client asked for, and goes on after a loss within 10 s.
    fn following(client: Client, within_ns: Option<u64>) -> Self {
        let ages = Ages { pad_ns: 200 * MS, session_ns: 1000 * MS };
        let mut operator = Operator::new(ages, StopCategory::RampThenRemove);
        operator.resume_within(within_ns);
        let mut bench = Bench { operator, record: CycleRecord::default(), phase: Phase::Holding };
        bench.record.exchange = Exchange::Complete;
        bench.hear(client, Ask::Robot(RequestKind::Track));
        assert_eq!(bench.cycle(), Some(RequestKind::Track));
        bench.phase = Phase::Tracking;
        bench.cycle();
        assert_eq!(bench.operator.commander(), Commander::Reference(client));
        bench
    }

    fn hear(&mut self, client: Client, ask: Ask) {
        self.operator.hear(self.record.time.now_ns, Command { client, ticket: 0, ask });
    }

    fn cycle(&mut self) -> Option<RequestKind> {
        self.record.time.now_ns += MS;
        let turn = self.operator.turn(self.record.time.now_ns, &self.record, self.phase);
        self.record.answer = if turn.request.is_some() { RequestAnswer::Taken } else { RequestAnswer::None };
        turn.request.map(|request| request.kind)
    }

    /// A SubDevice is lost for 100 cycles, and the drives' own stop ends in a fault.
    fn lose(&mut self) {
        (self.record.exchange, self.record.stop_reason) = (Exchange::Lost, SafetyReason::DeviceLost);
        for phase in [Phase::QuickStopping, Phase::Fault] {
            self.phase = phase;
            for _ in 0..50 {
                assert_eq!(self.cycle(), None);
            }
        }
        self.record.exchange = Exchange::Complete;
    }

    /// What is asked in so many cycles, while the robot does as it is asked.
    fn asked(&mut self, cycles: u32) -> Vec<RequestKind> {
        let mut all = Vec::new();
        for _ in 0..cycles {
            let kind = self.cycle();
            match kind {
                Some(RequestKind::Acknowledge) => self.phase = Phase::Disabled,
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

const BACK: [RequestKind; 3] = [RequestKind::Acknowledge, RequestKind::Enable, RequestKind::Resume];

#[test]
fn a_motion_goes_on_by_itself_where_the_file_says_so_and_as_whose_it_was() {
    let mut bench = Bench::following(Client::Command, Some(10_000 * MS));
    for _ in 0..2 {
        bench.lose();
        // Not before a hundred steady cycles.
        assert_eq!(bench.asked(90), []);
        assert_eq!(bench.asked(200), BACK);
        assert_eq!(bench.operator.commander(), Commander::Reference(Client::Command));
    }
    // Its end is its end.
    bench.phase = Phase::Holding;
    assert_eq!(bench.asked(3000), []);
    let mut bench = Bench::following(Client::Command, None);
    bench.lose();
    assert_eq!(bench.asked(3000), []);
    // Too late.
    let mut bench = Bench::following(Client::Command, Some(50 * MS));
    bench.lose();
    assert_eq!(bench.asked(3000), []);
}

/// What, who, what they ask, and whether the motion goes on all the same.
type Deed = (&'static str, Client, fn() -> Ask, bool);

#[test]
fn a_person_who_does_anything_about_motion_meanwhile_comes_first() {
    let page = Client::Page(3);
    const HELD: Pad =
        Pad::Held { twist: Twist2 { vx_m_s: 0.1, vy_m_s: 0.0, w_rad_s: 0.0 }, frame: Frame::Body };
    let deeds: [Deed; 8] = [
        ("nothing", page, || Ask::Alive, true),
        ("an obstacle", Client::Command, || Ask::Robot(RequestKind::RemoveObstacle { index: 0 }), true),
        ("a stick that rests", Client::Joystick, || Ask::Pad(Pad::Released), true),
        ("a stick in hand", Client::Joystick, || Ask::Pad(HELD), false),
        ("a stop", Client::Page(5), || Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)), false),
        ("the emergency stop", Client::Command, || Ask::EmergencyStop, false),
        ("somebody enables", Client::Command, || Ask::Robot(RequestKind::Enable), false),
        ("the page goes", page, || Ask::Gone, false),
    ];
    for (what, client, deed, goes_on) in deeds {
        for after in [0, 60] {
            let mut bench = Bench::following(page, Some(10_000 * MS));
            bench.lose();
            assert_eq!(bench.asked(after), []);
            bench.hear(client, deed());
            bench.phase = Phase::Fault;
            let resumes = bench.asked(600).contains(&RequestKind::Resume);
            assert_eq!(resumes, goes_on, "{what} after {after} cycles");
        }
    }
    // A page that falls silent meanwhile, too.
    let mut bench = Bench::following(page, Some(10_000 * MS));
    bench.lose();
    bench.record.exchange = Exchange::Lost;
    assert_eq!(bench.asked(1100), []);
    bench.record.exchange = Exchange::Complete;
    assert_eq!(bench.asked(600), []);
}

#[test]
fn a_way_that_a_pulled_cable_ended_is_gone_to_its_end_once_it_is_put_back() {
    for page_stays in [true, false] {
        let changes = vec!["safety.after_lost_device=\"resume\"".to_owned()];
        let robot = RobotText { text: BMM.into(), changes, ..RobotText::default() };
        let run = played_by(robot, 16.0, |hands: &mut Hands| {
            let page = Client::Page(0);
            hands.alive(0.4, if page_stays { 16.0 } else { 2.9 }, page);
            hands.send(0.5, page, Ask::Robot(RequestKind::Enable));
            hands.at(1.0, move |live, _| {
                let table: ReferenceTable = toml::from_str(
                    "kind = \"path\"\nframe = \"start\"\npoints = [[0.0, 0.0, 0.0, 0.0], [4.0, 0.5, 0.0, 0.0]]",
                )
                .unwrap();
                let path = reference(&table, &crate::hands::plan().limits).unwrap();
                live.load(page, table, path).unwrap();
                live.send(page, Ask::Robot(RequestKind::Track)).unwrap();
            });
            hands.pull_cable(2.5, 3.0);
            hands.at(3.0, |_, seen| assert_ne!(seen.phase, Phase::Tracking));
        });
        let x_m = run.last.record.state.odom_from_body.x_m;
        let events: Vec<&str> = run.ran.summary.events.iter().map(|event| event.text.as_str()).collect();
        let said = events.iter().any(|text| text.starts_with("what was lost is back"));
        assert_eq!((said, (x_m - 0.5).abs() < 2e-3), (page_stays, page_stays), "{x_m} m, {events:#?}");
        assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    }
}
