//! Chromium's process, shared by all tests that have pages at a time: its start costs more than most pages.

use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::os::unix::fs::MetadataExt;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Pages of Chromium's own that it keeps ready beside ours, in processes of their own.
const UNUSED: &str =
    "WebUIOmniboxPopup,WebUIOmniboxAimPopup,WebUIOmniboxFullPopup,SpareRendererForSitePerProcess";

/// What it was started with: a page that lies under another one is drawn and has its timers as if it lay above.
const ALL_ALIKE: [&str; 3] = [
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    "--disable-background-timer-throttling",
];

/// One end of its protocol.
pub struct Protocol {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    number: u64,
}

impl Protocol {
    fn to(address: &str) -> Protocol {
        let (socket, _) = tungstenite::connect(format!("ws://{address}")).unwrap();
        Protocol { socket, number: 0 }
    }

    /// One command.
    pub fn ask(&mut self, method: &str, parameters: Value) -> Value {
        let answer = self.answer(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"));
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }

    fn answer(&mut self, method: &str, parameters: Value) -> tungstenite::Result<Value> {
        self.number += 1;
        let number = self.number;
        let text = json!({"id": number, "method": method, "params": parameters}).to_string();
        self.socket.send(Message::text(text))?;
        loop {
            let Message::Text(text) = self.socket.read()? else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == number {
                return Ok(answer);
            }
            assert!(answer["method"] != "Runtime.exceptionThrown", "the page failed: {answer}");
        }
    }
}

/// The process. It is killed with the value.
pub struct Chromium {
    process: Child,
    /// Where its protocol is.
    host: String,
    whole: Mutex<Protocol>,
    profile: tempfile::TempDir,
}

impl Chromium {
    /// The one that is there in this network, or a new one; `None` where it isn't installed.
    pub fn shared() -> Option<Arc<Chromium>> {
        static SHARED: Mutex<Option<HashMap<u64, Weak<Chromium>>>> = Mutex::new(None);
        let network = std::fs::metadata("/proc/thread-self/ns/net").unwrap().ino();
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let shared = shared.get_or_insert_default();
        if let Some(chromium) = shared.get(&network).and_then(Weak::upgrade) {
            return Some(chromium);
        }
        let chromium = Arc::new(Chromium::start()?);
        shared.insert(network, Arc::downgrade(&chromium));
        Some(chromium)
    }

    /// Starts it; `None` where it isn't installed.
    pub fn start() -> Option<Chromium> {
        let profile = tempfile::tempdir().unwrap();
        let mut process = ["chromium", "chromium-browser", "google-chrome"].iter().find_map(|name| {
            Command::new(name)
                .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
                .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
                .args(["--hide-scrollbars", "--disable-dev-shm-usage", "--remote-debugging-port=0"])
                .arg(format!("--disable-features={UNUSED}"))
                .args(ALL_ALIKE)
                .arg(format!("--user-data-dir={}", profile.path().display()))
                .arg("--no-startup-window")
                .stderr(Stdio::piped())
                .stdout(Stdio::null())
                .spawn()
                .ok()
        })?;
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let address = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| line.strip_prefix("DevTools listening on ws://").map(str::to_owned))
            .expect("Chromium says where it listens");
        // What it says later must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let host = address.split('/').next().unwrap().to_owned();
        Some(Chromium { process, host, whole: Mutex::new(Protocol::to(&address)), profile })
    }

    /// An empty page that shares nothing with others, and what it keeps.
    pub fn page(&self) -> (String, Protocol) {
        let mut whole = self.whole.lock().unwrap_or_else(PoisonError::into_inner);
        let mut told = |method: &str, parameters: Value, what: &str| {
            whole.ask(method, parameters)[what].as_str().unwrap().to_owned()
        };
        let context = told("Target.createBrowserContext", json!({}), "browserContextId");
        let about = json!({"url": "about:blank", "browserContextId": context, "newWindow": true});
        let page = told("Target.createTarget", about, "targetId");
        let address = format!("{}/devtools/page/{page}", self.host);
        (context, Protocol::to(&address))
    }

    /// Closes a page, without a word to it.
    pub fn close(&self, context: &str) {
        let mut whole = self.whole.lock().unwrap_or_else(PoisonError::into_inner);
        // One that is gone has no pages.
        let _ = whole.answer("Target.disposeBrowserContext", json!({"browserContextId": context}));
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = self.profile.path();
    }
}
