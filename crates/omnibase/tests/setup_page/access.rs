//! Who may see a set-up and hold its button.

use super::{BMM, ROOT, TOKEN, set_up};
use std::path::Path;

/// Without the token nobody sees the state of a set-up from elsewhere, holds a button or answers.
#[test]
fn who_has_no_token_holds_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let segment = format!("sim:{ROOT}/segments/three-servos.toml");
    let (_process, at) = set_up(Path::new(BMM), &segment, &output, &[]);
    let refused = |headers: &[(&str, &str)]| {
        let mut request = tungstenite::http::Request::builder()
            .uri(format!("ws://{at}/api/setup/live"))
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", tungstenite::handshake::client::generate_key())
            .header("Host", &at);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        match tungstenite::connect(request.body(()).unwrap()) {
            Ok(_) => None,
            Err(tungstenite::Error::Http(response)) => Some(response.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    };
    let bearer = format!("Bearer {TOKEN}");
    assert_eq!(refused(&[]), Some(403));
    assert_eq!(refused(&[("Authorization", "Bearer token-of-somebody-else")]), Some(403));
    assert_eq!(refused(&[("Authorization", &bearer), ("Origin", "http://evil.example")]), Some(403));
    assert_eq!(refused(&[("Authorization", &bearer)]), None);
}
