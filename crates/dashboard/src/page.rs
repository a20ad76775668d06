//! The page: all its files are part of the program.

use axum::http::header;
use axum::response::{IntoResponse, Response};

/// Files by the end of their address, with their kind.
pub(crate) const FILES: &[(&str, &str, &str)] = &[
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
];

/// As [`FILES`], of the page on which a robot is set up.
pub(crate) const SETUP_FILES: &[(&str, &str, &str)] = &[
    ("", "text/html; charset=utf-8", include_str!("page/setup.html")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("setup.css", "text/css; charset=utf-8", include_str!("page/setup.css")),
    ("setup.js", "text/javascript; charset=utf-8", include_str!("page/setup.js")),
];

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
