//! What can be asked by HTTP.

use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{DefaultBodyLimit, FromRequest, Query, Request, State};
use axum::http::{HeaderMap, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Json, Router};
use omnibase_run::live::{Client, Stamp};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::access::{Denied, Right};
use crate::call::{Call, CallResult, Message};
use crate::connections::{Peer, READ_AT_ONCE};
use crate::inputs;
use crate::openapi;
use crate::page;
use crate::room_seen::MapSeen;
use crate::shared::{SaidNow, Shared, stamp_of};
use crate::socket;
use crate::states::{self, Chosen, Wanted};
use crate::status::{Counters, EventSeen, StatusMessage};
use crate::work::{For, NotComputed, Waiting};

/// The longest body of a request, such as a path.
const LONGEST_BODY: usize = 256 * 1024;
/// The longest message of a program that sends inputs, bytes.
const LONGEST_INPUTS: usize = 16 * 1024;
/// The longest time that a body may take.
const BODY: Duration = Duration::from_secs(10);
/// So long what `/api/now` says is said again.
const NOW_KEPT: Duration = Duration::from_millis(10);

/// All of it.
pub(crate) fn all(shared: Shared) -> Router {
    Router::new()
        .route("/api", get(described))
        .route("/api/openapi.json", get(description))
        .route("/api/robot", get(robot))
        .route("/api/now", get(now))
        .route("/api/planned", get(planned))
        .route("/api/map", get(map))
        .route("/api/trace", get(trace))
        .route("/api/events", get(events))
        .route("/api/call", post(call))
        .route("/api/live", get(socket))
        .route("/api/inputs", get(programs))
        .route("/api/states", get(follow))
        .merge(page::routes(page::FILES, shared.gate.clone()))
        .fallback(nothing_there)
        .method_not_allowed_fallback(another_method)
        .layer(DefaultBodyLimit::max(LONGEST_BODY))
        .with_state(shared)
}

async fn nothing_there(uri: Uri) -> Response {
    let why = CallResult::refused(format!("there is no `{}`: /api tells what there is", uri.path()));
    (StatusCode::NOT_FOUND, Json(why)).into_response()
}

async fn another_method(method: Method, uri: Uri) -> Response {
    let why = CallResult::refused(format!("`{}` takes no {method}: /api tells what there is", uri.path()));
    (StatusCode::METHOD_NOT_ALLOWED, Json(why)).into_response()
}

/// A request that only reads, and computes for it elsewhere.
macro_rules! reading {
    ($name:ident, $shared:ident, $right:ident, $value:expr) => {
        async fn $name(
            State($shared): State<Shared>,
            Extension(peer): Extension<Peer>,
            headers: HeaderMap,
        ) -> Response {
            let ($right, _underway) = match $shared.gate.begun(&peer, &headers, None).await {
                Ok(begun) => begun,
                Err(refusal) => return refusal,
            };
            let whom = if $right == Right::Command { For::Commander } else { For::Reader };
            let work = $shared.work.clone();
            let computed = work.run(whom, move || serde_json::to_vec(&$value).unwrap_or_default()).await;
            computed.map_or_else(IntoResponse::into_response, json_text)
        }
    };
}

reading!(robot, shared, right, {
    let facts = shared.desk.about.facts(right == Right::Command);
    serde_json::to_value(Robot { facts, saved_paths: shared.desk.saved_names() }).unwrap_or_default()
});
reading!(planned, shared, _right, shared.desk.planned());
reading!(map, shared, _right, MapSeen::of(&shared.desk.about.room, &shared.desk.drive_to.walls_m()));
reading!(events, shared, _right, {
    shared.live.events_after(0).into_iter().map(EventSeen::from).collect::<Vec<_>>()
});
reading!(trace, shared, _right, {
    let trace = shared.live.trace_since(-1.0);
    // As many points as a page can draw.
    let step = trace.len().div_ceil(3000).max(1);
    let point = |point: &omnibase_run::live::TracePoint| (point.time_s, point.believed, point.truth);
    trace.iter().step_by(step).map(point).collect::<Vec<_>>()
});

reading!(description, shared, _right, {
    let _ = &shared;
    openapi::description()
});

/// The description for people.
async fn described(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
) -> Response {
    let _underway = match shared.gate.begun(&peer, &headers, None).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    match shared.work.run(For::Reader, || openapi::page(&openapi::description())).await {
        Ok(text) => page::answer("text/html; charset=utf-8", text),
        Err(busy) => busy.into_response(),
    }
}

/// Said at once, for a stamp must be fresh; and made once for all who ask at the same time.
async fn now(State(shared): State<Shared>, Extension(peer): Extension<Peer>, headers: HeaderMap) -> Response {
    let _underway = match shared.gate.begun(&peer, &headers, None).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    if let Some(text) = shared.said_now(NOW_KEPT) {
        return json_text(text.as_bytes().to_vec());
    }
    let about = &shared.desk.about;
    let mut seen = StatusMessage::new(&shared.live.snapshot(), &mut about.rows());
    shared.complete(&mut seen);
    let named = about.columns().into_iter().zip(&seen.values).map(|(name, value)| (name, json!(value)));
    let named: Map<String, Value> = named.collect();
    let mut all = serde_json::to_value(&seen).unwrap_or_default();
    all["values"] = named.into();
    let text: Arc<str> = all.to_string().into();
    *shared.now.lock().unwrap_or_else(PoisonError::into_inner) =
        Some(SaidNow { at: Instant::now(), text: text.clone() });
    json_text(text.as_bytes().to_vec())
}

fn json_text(text: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Robot<'a> {
    #[serde(flatten)]
    facts: crate::robot_info::Facts<'a>,
    saved_paths: Vec<String>,
}

async fn call(State(shared): State<Shared>, Extension(peer): Extension<Peer>, request: Request) -> Response {
    let headers = request.headers().clone();
    let right = shared.gate.right(&peer, &headers, None);
    // Whoever may not even stop sends no body.
    let right_to_stop = match shared.gate.right_to_stop(&peer, &headers) {
        Ok(right) => right,
        Err(denied) => return shared.gate.refuse(right.err().unwrap_or(denied)),
    };
    let body = match tokio::time::timeout(BODY, Bytes::from_request(request, &())).await {
        Ok(Ok(body)) => body,
        Ok(Err(rejection)) => {
            Counters::count(&shared.gate.counters.oversized);
            return rejection.into_response();
        }
        Err(_) => {
            Counters::count(&shared.gate.counters.malformed);
            let why = CallResult::refused("the body didn't come");
            return (StatusCode::REQUEST_TIMEOUT, [(header::CONNECTION, "close")], Json(why)).into_response();
        }
    };
    // From here on a stop ends it, whatever it needs to be computed.
    let asker = shared.live.asker(Client::Command, Stamp::Missing);
    if let Some(Message { stamp_ms, call, .. }) = socket::at_once(&body)
        && (call.stops() || right_to_stop == Right::Command)
    {
        // Not after anything: neither a turn of others, nor how much its address asked.
        let reply = shared.desk.take(asker.stamped(stamp_of(stamp_ms)), call, &Waiting::here());
        return said(shared.finish(reply).await);
    }
    tokio::task::yield_now().await;
    match right {
        Ok(Right::Command) => {}
        Ok(Right::Read) => return shared.gate.refuse(Denied::Token),
        Err(denied) => return shared.gate.refuse(denied),
    }
    let _underway = match shared.gate.begin(&peer) {
        Ok(underway) => underway,
        Err(too_much) => return too_much.into_response(),
    };
    let message = match read(&shared, body).await {
        Ok(Ok(message)) => message,
        Ok(Err(error)) => {
            Counters::count(&shared.gate.counters.malformed);
            return (StatusCode::BAD_REQUEST, Json(CallResult::refused(error))).into_response();
        }
        Err(busy) => return busy.into_response(),
    };
    let Message { stamp_ms, call, .. } = message;
    // A program that asks and goes can't hold a stick.
    let is_stick = matches!(
        call,
        Call::Stick { .. }
            | Call::Drive { .. }
            | Call::ReleaseStick
            | Call::LoseStick
            | Call::RecoverStick
            | Call::EnableStick
            | Call::Alive
    );
    if is_stick {
        let why = "a stick belongs to a page: expected a WebSocket at /api/live";
        return (StatusCode::CONFLICT, Json(CallResult::refused(why))).into_response();
    }
    let reply = shared.take(asker.stamped(stamp_of(stamp_ms)), call).await;
    said(shared.finish(reply).await)
}

fn said(said: CallResult) -> Response {
    let status = if said.done { StatusCode::OK } else { StatusCode::CONFLICT };
    (status, Json(said)).into_response()
}

/// Reads a message, elsewhere where it is long.
async fn read(shared: &Shared, body: Bytes) -> Result<Result<Message, String>, NotComputed> {
    if body.len() <= READ_AT_ONCE {
        return Ok(Message::read(&body));
    }
    shared.work.run(For::Commander, move || Message::read(&body)).await
}

impl IntoResponse for NotComputed {
    fn into_response(self) -> Response {
        (StatusCode::SERVICE_UNAVAILABLE, [(header::RETRY_AFTER, "1")], Json(CallResult::refused(self)))
            .into_response()
    }
}

async fn socket(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let (right, _underway) = match shared.gate.begun(&peer, &headers, None).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    if !peer.seat.look() {
        Counters::count(&shared.gate.counters.crowded);
        let why = CallResult::refused("too many pages look on without the token");
        return (StatusCode::SERVICE_UNAVAILABLE, Json(why)).into_response();
    }
    upgrade
        .max_message_size(LONGEST_BODY)
        .max_frame_size(LONGEST_BODY)
        .max_write_buffer_size(4 * 1024 * 1024)
        .on_upgrade(move |socket| socket::talk(socket, shared, right))
}

/// For programs that may command: what they say may move the robot.
async fn programs(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    match shared.gate.begun(&peer, &headers, None).await {
        Ok((Right::Command, _)) => {}
        Ok((Right::Read, _)) => return shared.gate.refuse(Denied::Token),
        Err(refusal) => return refusal,
    }
    peer.seat.look();
    upgrade
        .max_message_size(LONGEST_INPUTS)
        .max_frame_size(LONGEST_INPUTS)
        .on_upgrade(move |socket| inputs::listen(socket, shared))
}

/// For programs that follow.
async fn follow(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    Query(wanted): Query<Wanted>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    let (right, _underway) = match shared.gate.begun(&peer, &headers, None).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    let chosen = match Chosen::new(&wanted, &shared) {
        Ok(chosen) => chosen,
        Err(why) => return (StatusCode::BAD_REQUEST, Json(CallResult::refused(why))).into_response(),
    };
    let rows = peer.seat.look().then(|| shared.followers.join(&shared, right)).flatten();
    let Some(rows) = rows else {
        Counters::count(&shared.gate.counters.crowded);
        let why = CallResult::refused("too many programs follow");
        return (StatusCode::SERVICE_UNAVAILABLE, Json(why)).into_response();
    };
    // Beside what hears stops.
    let work = shared.work.clone();
    upgrade.max_message_size(READ_AT_ONCE).on_upgrade(async move |socket| {
        let _ = work.spawn(states::stream(socket, rows, chosen, shared)).await;
    })
}
