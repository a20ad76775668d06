//! A server of pages, with a cycle that the test turns by hand.
#![allow(dead_code, reason = "each test uses its part of it")]

use std::net::TcpStream;
use std::time::{Duration, Instant};

use omnibase_dashboard::{Access, Dashboard, RobotInfo, Streams};
use omnibase_robot::signals::{CycleRecord, Phase, StopCategory};
use omnibase_robot::{Registry, Request};
use omnibase_run::RobotText;
use omnibase_run::channels::Known;
use omnibase_run::live::{Ages, LiveEnd, live};
use omnibase_run::room::Room;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

pub const TOKEN: &str = "token-of-the-test";
/// Nobody grows old in a test.
const AGES: Ages = Ages { stick_ns: u64::MAX, session_ns: u64::MAX };

/// A page's server, and the cycle behind it.
pub struct Bench {
    pub dashboard: Dashboard,
    pub end: LiveEnd,
    pub cycle: u64,
    /// Where paths are saved.
    pub folder: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Bench::with(Registry::with_built_in(), &[])
    }

    /// The same with other kinds, and with changes of the robot's file.
    pub fn with(registry: Registry, changes: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let changes = changes.iter().map(|change| (*change).to_owned()).collect();
        let text = include_str!("../../../../robots/bmm.toml").into();
        let text = RobotText { text, changes, ..RobotText::default() };
        let robot = text.load(&registry).unwrap();
        let (live, end) = live(AGES, StopCategory::RampThenRemove, &robot.plan.sources);
        let access = Access { address: "127.0.0.1:0".parse().unwrap(), token: TOKEN.into() };
        let paths = folder.path().to_owned();
        let room = Room::of(&robot.plan, folder.path()).unwrap();
        let about = RobotInfo {
            room,
            robot,
            registry: registry.into(),
            known: Known::Truth,
            paths,
            streams: Streams::default(),
        };
        Bench { dashboard: Dashboard::start(access, live, about).unwrap(), end, cycle: 0, folder }
    }

    /// Turns cycles until one of them asks the robot for what is looked for.
    pub fn until<T>(&mut self, what: &str, look: impl Fn(&LiveEnd, Option<Request>) -> Option<T>) -> T {
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

    pub fn page(&self) -> Page {
        Page::at(self.dashboard.address)
    }
}

pub struct Page(pub WebSocket<MaybeTlsStream<TcpStream>>);

impl Page {
    pub fn send(&mut self, call: &Value) {
        self.0.send(Message::text(call.to_string())).unwrap();
    }

    /// The next message that has this field.
    pub fn hear(&mut self, field: &str) -> Value {
        loop {
            let Message::Text(text) = self.0.read().unwrap() else { continue };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message.get(field).is_some() {
                return message;
            }
        }
    }
}

impl Page {
    /// A page with the token.
    pub fn at(address: std::net::SocketAddr) -> Page {
        let mut request = format!("ws://{address}/api/live").into_client_request().unwrap();
        request.headers_mut().insert("Authorization", format!("Bearer {TOKEN}").parse().unwrap());
        Page(tungstenite::connect(request).unwrap().0)
    }

    /// A page without the token.
    pub fn looking(address: std::net::SocketAddr) -> Page {
        let request = format!("ws://{address}/api/live").into_client_request().unwrap();
        Page(tungstenite::connect(request).unwrap().0)
    }
}
