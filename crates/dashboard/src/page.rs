//! The pages: all their files are part of the program.

use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use serde::Deserialize;

use crate::access::Right;
use crate::connections::Peer;
use crate::gate::{self, Gate};

/// Files by the end of their address, with their kind.
type Files = &'static [(&'static str, &'static str, &'static str)];

/// Those of the page of a robot that runs.
pub(crate) const FILES: Files = &[
    ("", "text/html; charset=utf-8", include_str!("page/page.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("actions.js", "text/javascript; charset=utf-8", include_str!("page/actions.js")),
    ("app.js", "text/javascript; charset=utf-8", include_str!("page/app.js")),
    ("beside.js", "text/javascript; charset=utf-8", include_str!("page/beside.js")),
    ("fault.js", "text/javascript; charset=utf-8", include_str!("page/fault.js")),
    ("link.js", "text/javascript; charset=utf-8", include_str!("page/link.js")),
    ("view.js", "text/javascript; charset=utf-8", include_str!("page/view.js")),
    ("obstacles.js", "text/javascript; charset=utf-8", include_str!("page/obstacles.js")),
    ("objects.js", "text/javascript; charset=utf-8", include_str!("page/objects.js")),
    ("plots.js", "text/javascript; charset=utf-8", include_str!("page/plots.js")),
    ("shapes.js", "text/javascript; charset=utf-8", include_str!("page/shapes.js")),
    ("settings.js", "text/javascript; charset=utf-8", include_str!("page/settings.js")),
    ("stick.js", "text/javascript; charset=utf-8", include_str!("page/stick.js")),
    ("stop.js", "text/javascript; charset=utf-8", include_str!("page/stop.js")),
    ("warning.js", "text/javascript; charset=utf-8", include_str!("page/warning.js")),
    ("write.js", "text/javascript; charset=utf-8", include_str!("page/write.js")),
];

/// Those of the page on which a robot is set up.
pub(crate) const SETUP_FILES: Files = &[
    ("", "text/html; charset=utf-8", include_str!("page/setup.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("setup.css", "text/css; charset=utf-8", include_str!("page/setup.css")),
    ("setup.js", "text/javascript; charset=utf-8", include_str!("page/setup.js")),
    ("write.js", "text/javascript; charset=utf-8", include_str!("page/write.js")),
];

/// Answers files to whom the gate lets in; a right token in the address becomes a cookie.
pub(crate) fn routes<S>(files: Files, gate: Gate) -> Router<S> {
    Router::new().route("/", get(file)).route("/{name}", get(file)).with_state((files, gate))
}

#[derive(Deserialize)]
struct Token {
    token: Option<String>,
}

async fn file(
    State((files, gate)): State<(Files, Gate)>,
    Extension(peer): Extension<Peer>,
    name: Option<Path<String>>,
    Query(Token { token }): Query<Token>,
    headers: HeaderMap,
) -> Response {
    let (right, _underway) = match gate.begun(&peer, &headers, token.as_deref()).await {
        Ok(begun) => begun,
        Err(refusal) => return refusal,
    };
    if let (Some(token), Right::Command) = (&token, right) {
        return gate::to_cookie(token);
    }
    let name = name.map_or(String::new(), |Path(name)| name);
    match files.iter().find(|(known, ..)| *known == name) {
        Some((_, kind, text)) => answer(kind, *text),
        None => (StatusCode::NOT_FOUND, format!("there is no `/{name}`")).into_response(),
    }
}

/// What the page may load and connect to: itself.
pub(crate) const POLICY: &str =
    "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'";

/// An answer that a browser shows, loads nothing beside, and doesn't keep.
pub(crate) fn answer(kind: &'static str, body: impl IntoResponse) -> Response {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    (headers, body).into_response()
}
