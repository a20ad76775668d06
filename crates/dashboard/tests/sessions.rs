//! Pages at the API, with a cycle that the test turns by hand: who is heard, and what of it reaches the robot.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use omnibase_dashboard::{About, Access, Dashboard, Streams};
use omnibase_robot::signals::{CycleRecord, Phase, StopCategory};
use omnibase_robot::{Registry, Request, RequestKind};
use omnibase_run::RobotText;
use omnibase_run::channels::Known;
use omnibase_run::live::{Ages, LiveEnd, live};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const TOKEN: &str = "token-of-the-test";
/// Nobody grows old in a test.
const AGES: Ages = Ages { pad_ns: u64::MAX, session_ns: u64::MAX };

/// A page's server, and the cycle behind it.
struct Bench {
    dashboard: Dashboard,
    end: LiveEnd,
    cycle: u64,
}

impl Bench {
    fn new() -> Self {
        let text =
            RobotText { text: include_str!("../../../robots/bmm.toml").into(), ..RobotText::default() };
        let registry = Registry::with_built_in();
        let robot = text.load(&registry).unwrap();
        let (live, end) = live(AGES, StopCategory::RampThenRemove);
        let access = Access { address: "127.0.0.1:0".parse().unwrap(), token: TOKEN.into() };
        let paths = std::env::temp_dir();
        let about = About { text, robot, registry, known: Known::Truth, paths, streams: Streams::default() };
        Bench { dashboard: Dashboard::start(access, live, about).unwrap(), end, cycle: 0 }
    }

    /// Turns cycles until one of them asks the robot for what is looked for.
    fn until<T>(&mut self, what: &str, look: impl Fn(&LiveEnd, Option<Request>) -> Option<T>) -> T {
        let begin = Instant::now();
        loop {
            self.cycle += 1;
            let turn = self.end.turn(self.cycle, &CycleRecord::default(), Phase::Holding);
            if let Some(found) = look(&self.end, turn.request) {
                return found;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "never came: {what}");
            std::thread::yield_now();
        }
    }

    fn page(&self) -> Page {
        let address = self.dashboard.address;
        let mut request = format!("ws://{address}/api/live").into_client_request().unwrap();
        request.headers_mut().insert("Authorization", format!("Bearer {TOKEN}").parse().unwrap());
        Page(tungstenite::connect(request).unwrap().0)
    }
}

struct Page(WebSocket<MaybeTlsStream<TcpStream>>);

impl Page {
    fn send(&mut self, call: &Value) {
        self.0.send(Message::text(call.to_string())).unwrap();
    }

    /// The next message that has this field.
    fn hear(&mut self, field: &str) -> Value {
        loop {
            let Message::Text(text) = self.0.read().unwrap() else { continue };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message.get(field).is_some() {
                return message;
            }
        }
    }
}

#[test]
fn where_all_sessions_are_taken_a_stop_is_heard_and_the_rest_is_refused_by_its_true_reason() {
    let mut bench = Bench::new();
    let mut taken: Vec<Page> = (0..16)
        .map(|_| {
            let mut page = bench.page();
            assert_eq!(page.hear("may")["may"], "command");
            bench.until("its cycle takes it in", |_, _| Some(()));
            page
        })
        .collect();
    let mut page = bench.page();
    let welcome = page.hear("may");
    assert_eq!((&welcome["may"], &welcome["you"]), (&json!("stop"), &Value::Null));
    page.send(&json!({"number": 1, "do": "enable"}));
    let said = page.hear("answer");
    assert_eq!((&said["answer"], &said["done"]), (&json!(1), &json!(false)));
    assert!(said["text"].as_str().unwrap().contains("all sessions are taken"), "{said}");
    page.send(&json!({"number": 2, "do": "emergency_stop"}));
    bench.until("the emergency stop", |end, _| end.say().is_emergency.then_some(()));
    page.send(&json!({"number": 3, "do": "stop", "category": "category_0"}));
    bench.until("the stop", |_, request| {
        (request?.kind == RequestKind::Stop(StopCategory::RemoveTorque)).then_some(())
    });
    // Somebody goes: there is a session for it.
    taken.remove(4).0.close(None).unwrap();
    let begin = Instant::now();
    loop {
        page.send(&json!({"do": "alive"}));
        page.send(&json!({"number": 4, "do": "pad", "x": 2.0, "y": 0.0, "turn": 0.0}));
        bench.until("a cycle", |_, _| Some(()));
        let Message::Text(text) = page.0.read().unwrap() else { continue };
        let message: Value = serde_json::from_str(&text).unwrap();
        if message["may"] == "command" {
            assert_eq!(message["you"], "page 5");
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "there is no session for it");
    }
}

#[test]
fn a_stick_in_its_corner_asks_for_full_speed_and_no_more() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    page.send(&json!({"do": "release_pad"}));
    page.send(&json!({"do": "pad", "x": 1.0, "y": 1.0, "turn": 0.0}));
    let twist = bench.until("its wish", |_, request| match request?.kind {
        RequestKind::Velocity { twist, .. } => Some(twist),
        _ => None,
    });
    // The robot's file says 1 m/s.
    assert!(
        (twist.speed_m_s() - 1.0).abs() < 1e-12 && (twist.vx_m_s - twist.vy_m_s).abs() < 1e-12,
        "{twist:?}"
    );
}

#[test]
fn a_page_gone_wild_may_still_be_stopped_by_the_person_before_it() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    for _ in 0..2000 {
        page.send(&json!({"do": "alive"}));
    }
    page.send(&json!({"number": 1, "do": "emergency_stop"}));
    bench.until("the emergency stop", |end, _| end.say().is_emergency.then_some(()));
    assert!(bench.dashboard.counts()[4] > 1000, "{:?}", bench.dashboard.counts());
}
