//! The page on which a robot is set up: what the set-up shows and asks, and what whoever stands before it says.
//!
//! A button moves a drive only while it is held: the page says so twenty times a second, each time with the newest stamp of
//! this server that it has. What comes with an older stamp than [`LATE`] counts for nothing, so neither a slow network nor one that
//! delivers late can hold a drive; how long a beat counts that came in time is the set-up's to know.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{Message as Frame, WebSocket, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Json, Router};
use serde::{Deserialize, Serialize};
use tokio::sync::{oneshot, watch};

use crate::access::{Access, Denied, Right};
use crate::call::CallResult;
use crate::connections::{Peer, STUCK};
use crate::gate::Gate;
use crate::page;
use crate::server::{self, DashboardError};
use crate::status::Counters;
use crate::strangers::Allowance;

/// A beat of a held button whose stamp is older doesn't count.
pub const LATE: Duration = Duration::from_millis(250);
/// How often pages are told the time, and what moves.
const TICK: Duration = Duration::from_millis(50);
/// The longest message of a page, bytes.
const LONGEST: usize = 4096;
/// Messages over what may come, after which the connection ends.
const MOST_DROPPED: u32 = 1000;

/// What of a set-up all pages show.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SetupShown {
    /// The robot's name.
    pub robot: String,
    /// All steps, in order.
    pub steps: Vec<StepShown>,
    /// The platform from above.
    pub platform: PlatformShown,
    /// What was said, the newest last.
    pub said: Vec<String>,
    /// What is asked.
    pub question: Option<QuestionShown>,
    /// For what a button is to be held.
    pub hold: Option<HoldShown>,
    /// How it ended, once it did.
    pub over: Option<String>,
}

/// A step.
#[derive(Clone, Debug, Serialize)]
pub struct StepShown {
    /// In words.
    pub words: String,
    /// It is over.
    pub is_done: bool,
    /// Somebody went on without it, or a part of it.
    pub is_passed_over: bool,
    /// It is under way.
    pub is_now: bool,
}

/// The platform from above: its x points up.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PlatformShown {
    /// The corners of its footprint, x and y in m.
    pub footprint_m: Vec<[f64; 2]>,
    /// Its wheels.
    pub wheels: Vec<WheelShown>,
}

/// A wheel from above.
#[derive(Clone, Debug, Serialize)]
pub struct WheelShown {
    /// Its name.
    pub name: String,
    /// Where it touches the ground, x and y in m.
    pub position_m: [f64; 2],
    /// The way that it rolls when it turns forward.
    pub rolls: [f64; 2],
    /// m.
    pub radius_m: f64,
}

/// A question.
#[derive(Clone, Debug, Serialize)]
pub struct QuestionShown {
    /// Which one: its answer says it.
    pub number: u64,
    /// What it is about, for programs.
    pub id: String,
    /// In words.
    pub text: String,
    /// What may be answered; empty for numbers and text.
    pub choices: Vec<String>,
    /// What is likely.
    pub default: Option<String>,
}

/// A time in which a held button moves something.
#[derive(Clone, Debug, Serialize)]
pub struct HoldShown {
    /// Which one: each beat says it.
    pub number: u64,
    /// What it does.
    pub text: String,
}

/// Whoever hears what pages say, by the server's thread: doesn't wait.
pub trait HearsSetup: Send + Sync + 'static {
    /// An answer to the question of this number.
    fn answer(&self, question: u64, said: String);
    /// The button of this number is held, and that was said in time.
    fn beat(&self, hold: u64);
    /// It was let go, or whoever held it can't be heard any more.
    fn let_go(&self);
    /// Enough for now; also where the server itself dies.
    fn leave(&self);
}

/// What moves now, written in the cycle and read by pages.
#[derive(Debug, Default)]
pub struct MovesNow {
    is_enabled: AtomicBool,
    /// In thousandths.
    travel: AtomicI64,
}

impl MovesNow {
    /// Whether the drive is enabled, and how far it went.
    pub fn set(&self, is_enabled: bool, travel: f64) {
        self.is_enabled.store(is_enabled, Ordering::Relaxed);
        self.travel.store((travel * 1e3) as i64, Ordering::Relaxed);
    }
}

/// What a page says.
#[derive(Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum PageMessage {
    Answer { question: u64, answer: String },
    Beat { beat: u64, stamp: u64 },
    LetGo { let_go: bool },
    Leave { leave: bool },
}

/// What a page is told twenty times a second.
#[derive(Debug, Serialize)]
struct Tick {
    /// This server's clock, ms.
    stamp: u64,
    /// A drive is enabled.
    enabled: bool,
    /// How far it went.
    travel: f64,
    /// This page holds the button, as far as was heard.
    held: bool,
    /// How old the last beat's stamp was when it came, ms.
    delay_ms: Option<u64>,
    /// Beats of this page that came too late.
    late: u32,
}

/// All that connections share.
#[derive(Clone)]
struct Common {
    gate: Gate,
    hears: Arc<dyn HearsSetup>,
    shown: watch::Receiver<Arc<str>>,
    moves: Arc<MovesNow>,
    holder: Arc<Holder>,
    next: Arc<AtomicU64>,
}

/// The button that is shown, and which connection holds it: the first one whose beat came.
#[derive(Debug, Default)]
struct Holder(Mutex<(Option<u64>, Option<u64>)>);

impl Holder {
    /// This button is shown from now on, or none; another one than before is held by nobody yet.
    fn shows(&self, hold: Option<u64>) {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if held.0 != hold {
            *held = (hold, None);
        }
    }

    /// Whether a beat of this connection counts for this button: none does for one that isn't shown.
    fn takes(&self, hold: u64, connection: u64) -> bool {
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.0 == Some(hold) && *held.1.get_or_insert(connection) == connection
    }

    /// Whether it counts where this connection lets go: not where another one holds the button that is shown by now.
    fn hears_from(&self, connection: u64) -> bool {
        let held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        held.1.is_none_or(|by| by == connection)
    }
}

/// Whether a beat with this stamp counts now, both ms by this server's clock.
fn is_in_time(now_ms: u64, stamp_ms: u64) -> bool {
    now_ms.checked_sub(stamp_ms).is_some_and(|age_ms| age_ms <= LATE.as_millis() as u64)
}

/// A running page; it ends when it is dropped.
pub struct SetupPage {
    /// Where it listens.
    pub address: SocketAddr,
    /// What moves now.
    pub moves: Arc<MovesNow>,
    shown: watch::Sender<Arc<str>>,
    holder: Arc<Holder>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl SetupPage {
    /// Serves it.
    pub fn start(access: Access, hears: Arc<dyn HearsSetup>) -> Result<SetupPage, DashboardError> {
        let (listener, address) = server::listen(access.address)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(DashboardError::Thread)?;
        let (end, ended) = oneshot::channel();
        let (shown, seen) = watch::channel(Arc::from("{}"));
        let moves = Arc::new(MovesNow::default());
        let counters = Arc::new(Counters::default());
        let holder: Arc<Holder> = Arc::default();
        let common = Common {
            gate: Gate::new(access, counters.clone()),
            hears: hears.clone(),
            shown: seen,
            moves: moves.clone(),
            holder: holder.clone(),
            next: Arc::default(),
        };
        let thread = std::thread::Builder::new().name("setup page".into()).spawn(move || {
            let serve = async {
                let accepting = tokio::spawn(server::accept_network(listener, counters, routes(common)));
                tokio::select! { _ = accepting => {}, _ = ended => {} }
            };
            // However it ends, a panic too: nobody holds anything any more.
            let _ = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| runtime.block_on(serve)));
            hears.leave();
        });
        let thread = Some(thread.map_err(DashboardError::Thread)?);
        Ok(SetupPage { address, moves, shown, holder, end: Some(end), thread })
    }

    /// From now on pages show this.
    pub fn show(&self, shown: &SetupShown) {
        self.holder.shows(shown.hold.as_ref().map(|hold| hold.number));
        let text = serde_json::to_string(shown).unwrap_or_default();
        self.shown.send_replace(text.into());
    }

    /// Waits until what was shown last may be seen: for its last word.
    pub fn linger(&self) {
        std::thread::sleep(4 * TICK);
    }
}

impl Drop for SetupPage {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            let _ = end.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn routes(common: Common) -> Router {
    Router::new()
        .route("/api/setup", get(state))
        .route("/api/setup/live", get(socket))
        .merge(page::routes(page::SETUP_FILES, common.gate.clone()))
        .with_state(common)
}

/// What pages show, for programs.
async fn state(
    State(common): State<Common>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
) -> Response {
    match common.gate.begun(&peer, &headers, None).await {
        Ok(_) => page::answer("application/json", common.shown.borrow().to_string()),
        Err(refusal) => refusal,
    }
}

async fn socket(
    State(common): State<Common>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let (right, _underway) = match common.gate.begun(&peer, &headers, None).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    if right != Right::Command {
        return common.gate.refuse(Denied::Token);
    }
    if !peer.seat.look() {
        Counters::count(&common.gate.counters.crowded);
        let why = CallResult::refused("too many pages");
        return (StatusCode::SERVICE_UNAVAILABLE, Json(why)).into_response();
    }
    upgrade
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .on_upgrade(move |socket| async move { talk(socket, &common).await })
}

/// A connection, which lets go of what it held however it ends.
struct Page<'a> {
    common: &'a Common,
    connection: u64,
    held: bool,
    delay_ms: Option<u64>,
    late: u32,
}

impl Drop for Page<'_> {
    fn drop(&mut self) {
        self.let_go();
    }
}

impl Page<'_> {
    fn now_ms(&self) -> u64 {
        self.common.gate.elapsed().as_millis() as u64
    }

    fn let_go(&mut self) {
        if std::mem::take(&mut self.held) && self.common.holder.hears_from(self.connection) {
            self.common.hears.let_go();
        }
    }

    fn tick(&self) -> Tick {
        let moves = &self.common.moves;
        Tick {
            stamp: self.now_ms(),
            enabled: moves.is_enabled.load(Ordering::Relaxed),
            travel: moves.travel.load(Ordering::Relaxed) as f64 / 1e3,
            held: self.held,
            delay_ms: self.delay_ms,
            late: self.late,
        }
    }

    fn hear(&mut self, text: &str) {
        let Ok(said) = serde_json::from_str(text) else {
            return Counters::count(&self.common.gate.counters.malformed);
        };
        match said {
            PageMessage::Answer { question, answer } => self.common.hears.answer(question, answer),
            PageMessage::Beat { beat, stamp } => {
                let now_ms = self.now_ms();
                self.delay_ms = now_ms.checked_sub(stamp);
                if !is_in_time(now_ms, stamp) {
                    self.late = self.late.saturating_add(1);
                } else if self.common.holder.takes(beat, self.connection) {
                    self.held = true;
                    self.common.hears.beat(beat);
                }
            }
            PageMessage::LetGo { let_go } if let_go => self.let_go(),
            PageMessage::Leave { leave } if leave => self.common.hears.leave(),
            PageMessage::LetGo { .. } | PageMessage::Leave { .. } => {}
        }
    }
}

/// Talks with a page until it is gone.
async fn talk(mut socket: WebSocket, common: &Common) {
    let connection = common.next.fetch_add(1, Ordering::Relaxed);
    let mut page = Page { common, connection, held: false, delay_ms: None, late: 0 };
    let (mut shown, mut tick) = (common.shown.clone(), tokio::time::interval(TICK));
    let (mut allowance, mut dropped) = (Allowance::new(common.gate.elapsed()), 0);
    shown.mark_changed();
    tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            // What a page says goes before what it is told.
            biased;
            received = socket.recv() => {
                let text = match received {
                    Some(Ok(Frame::Text(text))) => text,
                    Some(Ok(Frame::Ping(_) | Frame::Pong(_))) => continue,
                    _ => return,
                };
                tokio::task::yield_now().await;
                if allowance.takes(common.gate.elapsed()) {
                    page.hear(&text);
                } else {
                    Counters::count(&common.gate.counters.flooding);
                    dropped += 1;
                    if dropped > MOST_DROPPED {
                        return;
                    }
                }
            }
            changed = shown.changed() => {
                let text = shown.borrow_and_update().to_string();
                if changed.is_err() || !send(&mut socket, text).await {
                    return;
                }
            }
            _ = tick.tick() => {
                let text = serde_json::to_string(&page.tick()).unwrap_or_default();
                if !send(&mut socket, text).await {
                    return;
                }
            }
        }
    }
}

/// Sends; `false` where the page is gone or takes nothing any more.
async fn send(socket: &mut WebSocket, text: String) -> bool {
    matches!(tokio::time::timeout(STUCK, socket.send(Frame::text(text))).await, Ok(Ok(())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beat_counts_for_a_quarter_of_a_second_after_its_stamp_and_none_of_the_future_does() {
        assert!(is_in_time(1000, 1000) && is_in_time(1000, 750));
        assert!(!is_in_time(1000, 749) && !is_in_time(1000, 1001) && !is_in_time(1000, u64::MAX));
    }

    #[test]
    fn one_page_holds_a_button_and_what_is_over_is_held_by_nobody() {
        let holder = Holder::default();
        assert!(!holder.takes(3, 1), "none is shown");
        holder.shows(Some(3));
        // Nobody has shown that one yet, and nobody ever will.
        assert!(!holder.takes(4, 1) && !holder.takes(u64::MAX, 1));
        assert!(holder.takes(3, 1) && holder.takes(3, 1) && !holder.takes(3, 2));
        // More is said while it is held.
        holder.shows(Some(3));
        assert!(holder.hears_from(1) && !holder.hears_from(2));
        holder.shows(Some(4));
        // Who held the one before lets go of it only now.
        assert!(holder.hears_from(1));
        assert!(holder.takes(4, 2) && !holder.takes(3, 1) && !holder.takes(4, 1));
        assert!(holder.hears_from(2) && !holder.hears_from(1));
        holder.shows(None);
        assert!(!holder.takes(4, 2));
    }

    #[test]
    fn what_a_page_says_is_one_of_four_things() {
        for text in [
            r#"{"question":1,"answer":"left"}"#,
            r#"{"beat":2,"stamp":12}"#,
            r#"{"let_go":true}"#,
            r#"{"leave":true}"#,
        ] {
            assert!(serde_json::from_str::<PageMessage>(text).is_ok(), "{text}");
        }
        for text in ["{}", "[]", r#"{"beat":2}"#, r#"{"beat":-1,"stamp":0}"#, r#"{"leave":true,"more":1}"#] {
            assert!(serde_json::from_str::<PageMessage>(text).is_err(), "{text}");
        }
    }
}
