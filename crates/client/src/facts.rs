//! What a robot tells of itself once.

use std::io::{Read, Write};

use serde_json::Value;

use crate::Error;
use crate::connection::reach;
use crate::robots::Found;

/// The longest answer that is read, bytes.
const LONGEST: u64 = 16 * 1024 * 1024;

impl Found {
    /// What the robot answers at an address of its API that only reads, as `robot`, which doesn't change while it runs.
    pub fn read(&self, what: &str) -> Result<Value, Error> {
        let broken = |error: std::io::Error| Error::NoAnswer(format!("{}: {error}", self.place));
        let (mut stream, host) = reach(self).map_err(broken)?;
        let token = match self.token.as_str() {
            "" => String::new(),
            token => format!("Authorization: Bearer {token}\r\n"),
        };
        let request = format!("GET /api/{what} HTTP/1.1\r\nHost: {host}\r\n{token}Connection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).map_err(broken)?;
        let mut answer = Vec::new();
        stream.take(LONGEST).read_to_end(&mut answer).map_err(broken)?;
        body(&answer)
    }
}

/// What an answer says, where it is one.
fn body(answer: &[u8]) -> Result<Value, Error> {
    let answer = String::from_utf8_lossy(answer);
    let Some((head, body)) = answer.split_once("\r\n\r\n") else {
        return Err(Error::Words(format!("{} bytes without a header", answer.len())));
    };
    let status = head.lines().next().unwrap_or_default();
    if status.split(' ').nth(1) != Some("200") {
        return Err(Error::Refused(format!("{status} {body}").trim().to_owned()));
    }
    serde_json::from_str(body).map_err(|error| Error::Words(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_has_a_status_and_a_body() {
        let read = |text: &str| body(text.as_bytes());
        assert_eq!(read("HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\n[]").unwrap(), Value::Array(vec![]));
        assert!(
            matches!(read("HTTP/1.1 403 Forbidden\r\n\r\nno"), Err(Error::Refused(why)) if why.ends_with("no"))
        );
        assert!(matches!(read("HTTP/1.1 200 OK\r\n\r\n{"), Err(Error::Words(_))));
        assert!(matches!(read(""), Err(Error::Words(_))));
    }
}
