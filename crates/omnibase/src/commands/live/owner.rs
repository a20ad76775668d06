//! HTTP over the socket that only a robot's own user can open: one request, one answer.

use anyhow::Context;
use omnibase_client::robots::connect;
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

/// The longest answer that is read, bytes.
const MOST: u64 = 64 << 20;

/// Asks for something of the API, with or without a body: whether it succeeded, and what was answered.
pub fn exchange(
    socket: &Path,
    what: &str,
    body: Option<&str>,
    longest: Duration,
) -> anyhow::Result<(bool, String)> {
    let mut stream = connect(socket, longest)?;
    stream.set_read_timeout(Some(longest))?;
    stream.set_write_timeout(Some(longest))?;
    let (method, body) = body.map_or(("GET", ""), |body| ("POST", body));
    // HTTP/1.0: the answer ends with the connection, and isn't cut into chunks.
    let head =
        format!("{method} /api/{what} HTTP/1.0\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", body.len());
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())?;
    let mut answer = Vec::new();
    stream.take(MOST).read_to_end(&mut answer)?;
    parsed(&answer).context("the answer is none of HTTP")
}

/// Whether an answer is a success, and its body.
fn parsed(answer: &[u8]) -> Option<(bool, String)> {
    let text = String::from_utf8_lossy(answer);
    let (head, body) = text.split_once("\r\n\r\n")?;
    let status = head.strip_prefix("HTTP/1.")?.split(' ').nth(1)?;
    Some((status.starts_with('2'), body.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_its_status_and_its_body() {
        let parsed = |text: &str| parsed(text.as_bytes());
        let ok = "HTTP/1.0 200 OK\r\ncontent-length: 2\r\n\r\n{}";
        assert_eq!(parsed(ok), Some((true, "{}".to_owned())));
        assert_eq!(
            parsed("HTTP/1.1 409 Conflict\r\n\r\nno\r\n\r\nno"),
            Some((false, "no\r\n\r\nno".to_owned()))
        );
        for wrong in ["", "HTTP/1.1 200 OK", "hello\r\n\r\n"] {
            assert_eq!(parsed(wrong), None, "{wrong}");
        }
    }
}
