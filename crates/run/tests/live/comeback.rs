//! A motion that somebody asked for, a SubDevice that is lost amid it and comes back, and people in between.

use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{
    CycleRecord, Exchange, Frame, Phase, RequestAnswer, SafetyReason, StopCategory,
};
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
