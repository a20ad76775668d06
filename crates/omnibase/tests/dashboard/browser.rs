//! Headless Chromium, driven by its DevTools protocol.

use super::chromium::{Chromium, Protocol};
use serde_json::{Value, json};
use std::cell::Cell;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The longest wait for anything in the page; only a failure takes so long.
pub const LONGEST: Duration = Duration::from_secs(60);

/// Runs in the page before its own code: what the robot says passes through `tamper`, which may change it, or swallow
/// it by giving nothing.
const TAMPER: &str = "(() => { const Real = WebSocket; window.tamper = (message) => message; \
    window.WebSocket = class extends Real { set onmessage(hear) { super.onmessage = hear && ((event) => { \
    const message = window.tamper(JSON.parse(event.data)); \
    if (message) hear({ data: JSON.stringify(message) }); }); } }; \
    const frame = requestAnimationFrame; window.requestAnimationFrame = (draw) => frame((now_ms) => { \
    draw(now_ms); window.drawn += window.changed > 0; }); })()";

/// How many tests have browsers now.
static TESTS: (Mutex<usize>, Condvar) = (Mutex::new(0), Condvar::new());

thread_local! {
    /// How many browsers this test has.
    static MINE: Cell<usize> = const { Cell::new(0) };
}

/// A test's leave to have browsers: one test more than there are processors at a time. With many a page hears its robot too
/// late, and what is asked by it is refused, as it shall be.
struct Turn;

impl Turn {
    fn take() -> Turn {
        if MINE.replace(MINE.get() + 1) == 0 {
            let most = 1 + std::thread::available_parallelism().map_or(1, usize::from);
            let tests = TESTS.0.lock().unwrap_or_else(PoisonError::into_inner);
            let tests = TESTS.1.wait_while(tests, |tests| *tests >= most);
            *tests.unwrap_or_else(PoisonError::into_inner) += 1;
        }
        Turn
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if MINE.replace(MINE.get() - 1) == 1 {
            *TESTS.0.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
            TESTS.1.notify_one();
        }
    }
}

/// A page in a browser.
pub struct Browser {
    page: Protocol,
    /// What its page keeps, apart from all others.
    context: String,
    chromium: Arc<Chromium>,
    _turn: Turn,
}

impl Browser {
    /// Opens a page in a window of so many pixels; `None` where Chromium isn't installed.
    pub fn start(width: u32, height: u32) -> Option<Browser> {
        let turn = Turn::take();
        Browser::of(Chromium::shared()?, turn, width, height)
    }

    /// As [`Browser::start`], in a process of its own, which is killed with the value.
    pub fn alone(width: u32, height: u32) -> Option<Browser> {
        let turn = Turn::take();
        Browser::of(Arc::new(Chromium::start()?), turn, width, height)
    }

    fn of(chromium: Arc<Chromium>, turn: Turn, width: u32, height: u32) -> Option<Browser> {
        let (context, page) = chromium.page();
        let mut browser = Browser { page, context, chromium, _turn: turn };
        for domain in ["Page.enable", "Runtime.enable"] {
            browser.ask(domain, json!({}));
        }
        // Whoever opens another page beside it takes no focus from it.
        browser.ask("Emulation.setFocusEmulationEnabled", json!({"enabled": true}));
        browser.resize(width, height);
        Some(browser)
    }

    /// From now on the window has so many pixels; a narrow one is a phone's.
    pub fn resize(&mut self, width: u32, height: u32) {
        let metrics =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600});
        self.ask("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// One command of the protocol.
    pub fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.page.ask(method, parameters)
    }

    /// Opens an address.
    pub fn open(&mut self, url: &str) {
        self.ask("Page.navigate", json!({"url": url}));
    }

    /// From the next page on, what the robot says can be changed or swallowed.
    pub fn tamper(&mut self) {
        self.ask("Page.addScriptToEvaluateOnNewDocument", json!({"source": TAMPER}));
    }

    /// What the robot says it sees, `seen`, is changed by these words of JavaScript on its way; waits until it is drawn.
    pub fn change(&mut self, how: &str) {
        self.value(&format!(
            "void (window.changed = window.drawn = 0, window.tamper = (seen) => {{ if (!('phase' in seen)) return seen; \
             window.changed += 1; {how}; return seen; }})"
        ));
        self.wait("window.drawn > 0");
    }

    /// From now on the page sees nothing any more of what the robot says it sees.
    pub fn swallow(&mut self) {
        self.value("void (window.tamper = (seen) => 'phase' in seen ? null : seen)");
    }

    /// The value of an expression in the page.
    pub fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let answer = self.ask("Runtime.evaluate", parameters);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait(&mut self, expression: &str) {
        let begin = Instant::now();
        while self.value(&format!("Boolean({expression})")) != json!(true) {
            let seen = "document.body?.innerText.slice(0, 2000)";
            assert!(begin.elapsed() < LONGEST, "never came true: {expression}\n{}", self.value(seen));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Whether an expression becomes true in time.
    pub fn is_true_within(&mut self, expression: &str, within: Duration) -> bool {
        let begin = Instant::now();
        while self.value(&format!("Boolean({expression})")) != json!(true) {
            if begin.elapsed() > within {
                return false;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        true
    }

    /// Where the middle of an element is.
    pub fn middle(&mut self, selector: &str) -> [f64; 2] {
        let script = format!(
            "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{block: 'center'}}); \
             const r = e.getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
        );
        let place = self.value(&script);
        [place[0].as_f64().unwrap(), place[1].as_f64().unwrap()]
    }

    /// Presses the mouse's button, moves it, or lets it go.
    pub fn mouse(&mut self, what: &str, [x, y]: [f64; 2]) {
        let buttons = i32::from(what != "mouseReleased");
        let parameters =
            json!({"type": what, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1});
        self.ask("Input.dispatchMouseEvent", parameters);
    }

    /// Clicks an element.
    pub fn click(&mut self, selector: &str) {
        let place = self.middle(selector);
        self.mouse("mousePressed", place);
        self.mouse("mouseReleased", place);
    }

    /// Whether pictures are kept.
    pub fn are_pictures_kept() -> bool {
        std::env::var_os("OMNIBASE_SCREENSHOTS").is_some()
    }

    /// A picture of the window, kept where `OMNIBASE_SCREENSHOTS` names a folder.
    pub fn picture(&mut self, name: &str) {
        self.capture(name, json!({"captureBeyondViewport": false}));
    }

    /// A picture of the whole page; it takes long, and a page that drives would be missed meanwhile.
    pub fn whole_picture(&mut self, name: &str) {
        self.capture(name, json!({"captureBeyondViewport": true}));
    }

    fn capture(&mut self, name: &str, how: Value) {
        let Some(folder) = std::env::var_os("OMNIBASE_SCREENSHOTS") else { return };
        let answer = self.ask("Page.captureScreenshot", how);
        let bytes = decoded(answer["data"].as_str().unwrap());
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(std::path::Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        self.chromium.close(&self.context);
    }
}

/// Base64.
fn decoded(text: &str) -> Vec<u8> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let (mut bits, mut count, mut bytes) = (0u32, 0, Vec::new());
    for digit in text.bytes().filter_map(digit) {
        bits = bits << 6 | u32::from(digit);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}
