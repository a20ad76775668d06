//! The server: routes, rights, and the message that goes to all pages thirty times a second.

use std::any::Any;
use std::net::SocketAddr;
use std::panic::AssertUnwindSafe;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{ConnectInfo, DefaultBodyLimit, Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use omnibase_run::channels::Rows;
use omnibase_run::live::{Client, Live};
use serde::{Deserialize, Serialize};
use tokio::net::TcpListener;
use tokio::sync::{oneshot, watch};

use crate::about::About;
use crate::access::{Access, COOKIE, Denied, Right};
use crate::call::{Call, Said};
use crate::connections::Bounded;
use crate::desk::{Desk, Reply};
use crate::page;
use crate::seen::{Counters, EventSeen, Seen};
use crate::socket;
use crate::streams::{self, Streams};

/// Between two messages to the pages.
const TICK: Duration = Duration::from_nanos(33_333_333);
/// The longest body of a request, such as a path.
const LONGEST_BODY: usize = 256 * 1024;
/// The longest wait for the robot's answer.
const ANSWER: Duration = Duration::from_secs(2);
/// How often an answer is looked for.
const LOOK: Duration = Duration::from_millis(5);

/// Why there is no dashboard.
#[derive(Debug, thiserror::Error)]
pub enum DashboardError {
    /// Its address can't be had.
    #[error("the dashboard's address {address}: {error}")]
    Address {
        /// The address.
        address: SocketAddr,
        /// Why.
        error: std::io::Error,
    },
    /// Its thread can't be started.
    #[error("the dashboard's thread: {0}")]
    Thread(std::io::Error),
}

/// A running dashboard; it ends when it is dropped.
pub struct Dashboard {
    /// Where it listens.
    pub address: SocketAddr,
    counters: Arc<Counters>,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    kept: Kept,
}

/// What is kept as long as the server lives.
type Kept = Arc<Mutex<Vec<Box<dyn Any + Send>>>>;

/// How a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    /// As it was told.
    AsTold,
    /// By itself: there should be one.
    ByItself,
}

impl Dashboard {
    /// Serves a robot's page.
    pub fn start(access: Access, live: Live, about: About) -> Result<Dashboard, DashboardError> {
        let failed = |error| DashboardError::Address { address: access.address, error };
        let listener = std::net::TcpListener::bind(access.address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(DashboardError::Thread)?;
        let counters = Arc::new(Counters::default());
        let (end, ended) = oneshot::channel();
        let kept = Kept::default();
        let (shared, kept_there) = (counters.clone(), kept.clone());
        let thread = std::thread::Builder::new().name("dashboard".into()).spawn(move || {
            watched(&live.clone(), || {
                runtime.block_on(serve(listener, Shared::new(access, live, about, shared), ended))
            });
            kept_there.lock().unwrap_or_else(PoisonError::into_inner).clear();
        });
        Ok(Dashboard {
            address,
            counters,
            end: Some(end),
            thread: Some(thread.map_err(DashboardError::Thread)?),
            kept,
        })
    }

    /// Keeps something as long as the server lives, such as the word where it listens.
    pub fn keep(&self, kept: impl Any + Send) {
        let is_over = self.thread.as_ref().is_none_or(JoinHandle::is_finished);
        if !is_over {
            self.kept.lock().unwrap_or_else(PoisonError::into_inner).push(Box::new(kept));
        }
    }

    /// What came in and was not carried out: crowded, denied, malformed, oversized, flooding.
    pub fn counts(&self) -> [u64; 5] {
        self.counters.all()
    }
}

/// Serves; where that ends by itself, or by a panic, what pages command ends with it, and the run says so.
fn watched(live: &Live, serve: impl FnOnce() -> Ended) {
    // What the panic left half done is never looked at again.
    let ended = std::panic::catch_unwind(AssertUnwindSafe(serve));
    if !matches!(ended, Ok(Ended::AsTold)) {
        live.lose_pages();
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            let _ = end.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What all requests share.
#[derive(Clone)]
pub(crate) struct Shared {
    access: Arc<Access>,
    desk: Arc<Mutex<Desk>>,
    pub(crate) live: Live,
    pub(crate) counters: Arc<Counters>,
    /// The latest message, to all pages.
    sender: watch::Sender<Arc<str>>,
}

impl Shared {
    fn new(access: Access, live: Live, about: About, counters: Arc<Counters>) -> Self {
        let (sender, _) = watch::channel(Arc::from("{}"));
        let desk = Arc::new(Mutex::new(Desk::new(live.clone(), about)));
        Shared { access: Arc::new(access), desk, live, counters, sender }
    }

    pub(crate) fn desk(&self) -> MutexGuard<'_, Desk> {
        self.desk.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// The right of a request, or the answer that refuses it.
    fn right(
        &self,
        peer: SocketAddr,
        headers: &HeaderMap,
        token: Option<&str>,
    ) -> Result<Right, Box<Response>> {
        self.access.right(peer.ip(), headers, token).map_err(|denied| Box::new(self.refuse(denied)))
    }

    fn refuse(&self, denied: Denied) -> Response {
        Counters::count(&self.counters.denied);
        (StatusCode::FORBIDDEN, denied.text()).into_response()
    }

    /// Takes a call, in the order in which calls came.
    pub(crate) fn take(&self, client: Client, call: Call) -> Reply {
        self.desk().take(client, call)
    }

    /// The messages from now on.
    pub(crate) fn subscribe(&self) -> watch::Receiver<Arc<str>> {
        self.sender.subscribe()
    }

    /// What came of a call, once the robot answered.
    pub(crate) async fn finish(&self, reply: Reply) -> Said {
        match reply {
            Reply::Nothing => Said::done("done"),
            Reply::Said(said) => said,
            Reply::Ticket(ticket, text) => self.answer(ticket, text).await,
        }
    }

    async fn answer(&self, ticket: u64, text: String) -> Said {
        let mut waited = Duration::ZERO;
        while waited < ANSWER {
            if let Some(answer) = self.live.answer(ticket) {
                return if answer.is_done() {
                    Said::done(text)
                } else {
                    Said { done: false, text: answer.text().to_owned() }
                };
            }
            tokio::time::sleep(LOOK).await;
            waited += LOOK;
        }
        Said::refused("the robot's cycle doesn't answer")
    }
}

async fn serve(listener: std::net::TcpListener, shared: Shared, ended: oneshot::Receiver<()>) -> Ended {
    let Ok(listener) = TcpListener::from_std(listener) else { return Ended::ByItself };
    let listener = Bounded::new(listener, shared.counters.clone());
    let ticking = tokio::spawn(tick(shared.clone()));
    let (rows, streams) = {
        let desk = shared.desk();
        (desk.about.rows(), desk.about.streams)
    };
    if streams != Streams::default() {
        tokio::spawn(streams::send(shared.live.clone(), rows, streams));
    }
    let routes = Router::new()
        .route("/api/robot", get(robot))
        .route("/api/now", get(now))
        .route("/api/planned", get(planned))
        .route("/api/trace", get(trace))
        .route("/api/events", get(events))
        .route("/api/call", post(call))
        .route("/api/live", get(socket))
        .route("/", get(file))
        .route("/{name}", get(file))
        .layer(DefaultBodyLimit::max(LONGEST_BODY))
        .with_state(shared);
    let service = routes.into_make_service_with_connect_info::<Peer>();
    let over = async {
        let _ = ended.await;
    };
    // Connections that stay open don't hold the end up.
    tokio::select! {
        _ = async { axum::serve(listener, service).await } => Ended::ByItself,
        // It never ends but by a panic; without it pages see nothing any more.
        _ = ticking => Ended::ByItself,
        () = over => Ended::AsTold,
    }
}

impl axum::extract::connect_info::Connected<axum::serve::IncomingStream<'_, Bounded>> for Peer {
    fn connect_info(stream: axum::serve::IncomingStream<'_, Bounded>) -> Self {
        Peer(*stream.remote_addr())
    }
}

/// Who is at the other end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Peer(SocketAddr);

/// Makes the message for all pages, once for all of them.
async fn tick(shared: Shared) {
    let mut rows: Rows = shared.desk().about.rows();
    let mut interval = tokio::time::interval(TICK);
    interval.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut last_event = 0;
    loop {
        interval.tick().await;
        let events = shared.live.events_after(last_event);
        last_event = events.last().map_or(last_event, |event| event.number);
        // Events are remembered, messages are not: without a page nothing is made.
        if shared.sender.receiver_count() == 0 {
            continue;
        }
        let mut seen = Seen::new(&shared.live.snapshot(), &mut rows);
        seen.teaching_since_s = shared.desk().teaching_since_s();
        seen.events = events.into_iter().map(EventSeen::from).collect();
        seen.server = shared.counters.all();
        if let Ok(text) = serde_json::to_string(&seen) {
            shared.sender.send_replace(Arc::from(text));
        }
    }
}

#[derive(Deserialize)]
struct Token {
    token: Option<String>,
}

async fn file(
    State(shared): State<Shared>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    name: Option<Path<String>>,
    Query(Token { token }): Query<Token>,
    headers: HeaderMap,
) -> Response {
    let right = match shared.right(peer, &headers, token.as_deref()) {
        Ok(right) => right,
        Err(refusal) => return *refusal,
    };
    if let (Some(token), Right::Command) = (&token, right) {
        // The token leaves the address, so that it isn't shown, kept or sent on.
        let cookie = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict; Path=/");
        return (StatusCode::SEE_OTHER, [(header::SET_COOKIE, cookie.as_str()), (header::LOCATION, "/")])
            .into_response();
    }
    let name = name.map_or(String::new(), |Path(name)| name);
    match page::FILES.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, text)) => {
            let headers = [
                (header::CONTENT_TYPE, *kind),
                (header::CONTENT_SECURITY_POLICY, page::POLICY),
                (header::CACHE_CONTROL, "no-store"),
                (header::REFERRER_POLICY, "no-referrer"),
            ];
            (headers, *text).into_response()
        }
        None => (StatusCode::NOT_FOUND, format!("there is no `/{name}`")).into_response(),
    }
}

/// A request that only reads.
macro_rules! reading {
    ($name:ident, $shared:ident, $right:ident, $value:expr) => {
        async fn $name(
            State($shared): State<Shared>,
            ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
            headers: HeaderMap,
        ) -> Response {
            match $shared.right(peer, &headers, None) {
                Ok($right) => Json($value).into_response(),
                Err(refusal) => *refusal,
            }
        }
    };
}

reading!(robot, shared, right, {
    let desk = shared.desk();
    let facts = desk.about.facts(right == Right::Command);
    serde_json::to_value(Robot { facts, saved_paths: desk.saved_names() }).unwrap_or_default()
});
reading!(planned, shared, _right, shared.desk().planned());
reading!(events, shared, _right, {
    shared.live.events_after(0).into_iter().map(EventSeen::from).collect::<Vec<_>>()
});
reading!(now, shared, _right, {
    let mut rows = shared.desk().about.rows();
    let mut seen = Seen::new(&shared.live.snapshot(), &mut rows);
    seen.server = shared.counters.all();
    let columns = shared.desk().about.columns();
    let named = columns.into_iter().zip(&seen.values).map(|(name, value)| (name, serde_json::json!(value)));
    let named: serde_json::Map<String, serde_json::Value> = named.collect();
    let mut all = serde_json::to_value(&seen).unwrap_or_default();
    all["values"] = named.into();
    all
});
reading!(trace, shared, _right, {
    let trace = shared.live.trace_since(-1.0);
    // As many points as a page can draw.
    let step = trace.len().div_ceil(3000).max(1);
    let point = |point: &omnibase_run::live::TracePoint| (point.time_s, point.believed, point.truth);
    trace.iter().step_by(step).map(point).collect::<Vec<_>>()
});

#[derive(Serialize)]
struct Robot<'a> {
    #[serde(flatten)]
    facts: crate::about::Facts<'a>,
    saved_paths: Vec<String>,
}

async fn call(
    State(shared): State<Shared>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    match shared.right(peer, &headers, None) {
        Ok(Right::Command) => {}
        Ok(Right::Read) => return shared.refuse(Denied::Token),
        Err(refusal) => return *refusal,
    }
    let body = match body {
        Ok(body) => body,
        Err(rejection) => {
            Counters::count(&shared.counters.oversized);
            return rejection.into_response();
        }
    };
    let call: Call = match serde_json::from_slice(&body) {
        Ok(call) => call,
        Err(error) => {
            Counters::count(&shared.counters.malformed);
            return (StatusCode::BAD_REQUEST, Json(Said::refused(error))).into_response();
        }
    };
    // A program that asks and goes can't hold a stick.
    let is_pad =
        matches!(call, Call::Pad { .. } | Call::ReleasePad | Call::LosePad | Call::EnablePad | Call::Alive);
    if is_pad {
        let why = "a stick belongs to a page: expected a WebSocket at /api/live";
        return (StatusCode::CONFLICT, Json(Said::refused(why))).into_response();
    }
    let reply = shared.take(Client::Command, call);
    let said = shared.finish(reply).await;
    let status = if said.done { StatusCode::OK } else { StatusCode::CONFLICT };
    (status, Json(said)).into_response()
}

async fn socket(
    State(shared): State<Shared>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let right = match shared.right(peer, &headers, None) {
        Ok(right) => right,
        Err(refusal) => return *refusal,
    };
    upgrade
        .max_message_size(LONGEST_BODY)
        .max_frame_size(LONGEST_BODY)
        .max_write_buffer_size(4 * 1024 * 1024)
        .on_upgrade(move |socket| socket::talk(socket, shared, right))
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::signals::{CycleRecord, Phase, StopCategory};
    use omnibase_robot::{Request, RequestKind};
    use omnibase_run::live::{Ages, Ask, LiveEnd, Pad, live};

    /// A page drives, and then its server ends so; what the robot is asked in the cycle after it, and what is said.
    fn after(serve: impl FnOnce() -> Ended) -> (Option<RequestKind>, Option<&'static str>) {
        let ages = Ages { pad_ns: u64::MAX, session_ns: u64::MAX };
        let (live, mut end): (Live, LiveEnd) = live(ages, StopCategory::RampThenRemove);
        let page = live.begin_session().unwrap();
        let held = Pad::Held { twist: Default::default(), frame: Default::default() };
        for pad in [Pad::Released, held] {
            live.send(page, Ask::Pad(pad)).unwrap();
        }
        let record = CycleRecord::default();
        let asked = |request: Option<Request>| request.map(|request| request.kind);
        let driven = asked(end.turn(1, &record, Phase::Holding).request);
        assert!(matches!(driven, Some(RequestKind::Velocity { .. })), "{driven:?}");
        while end.take_note().is_some() {}
        watched(&live, serve);
        let request = asked(end.turn(2, &record, Phase::Tracking).request);
        (request, end.take_note().map(|note| note.text))
    }

    #[test]
    fn a_server_that_dies_ends_what_its_pages_commanded_and_the_run_says_so() {
        let (stopped, said) =
            (Some(RequestKind::Stop(StopCategory::RampAndHold)), "the server of the pages died");
        for (serve, is_dead) in [
            ((|| panic!("as a test wishes")) as fn() -> Ended, true),
            (|| Ended::ByItself, true),
            (|| Ended::AsTold, false),
        ] {
            let (request, note) = after(serve);
            assert_eq!(request == stopped, is_dead, "{request:?}");
            assert_eq!(note.is_some_and(|note| note.starts_with(said)), is_dead, "{note:?}");
        }
    }
}
