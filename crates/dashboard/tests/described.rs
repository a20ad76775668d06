//! What the WebSockets' addresses answer is what the API's description names: no less, and no more.

mod bench;

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use bench::{Bench, Page, TOKEN};
use serde_json::{Value, json};

const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
/// At once an address may ask less often.
const FLOOD: usize = 500;

/// Status and content type of the answer to a request, and its body.
fn answer(line: &mut BufReader<TcpStream>) -> (u16, Option<String>, Vec<u8>) {
    heard(line).unwrap()
}

/// The same of one that may be cut off.
fn heard(line: &mut BufReader<TcpStream>) -> std::io::Result<(u16, Option<String>, Vec<u8>)> {
    let mut head = Vec::new();
    let mut next = || {
        let mut text = String::new();
        line.read_line(&mut text).map(|_| text.trim_end().to_owned())
    };
    loop {
        let text = next()?;
        if text.is_empty() {
            break;
        }
        head.push(text.to_ascii_lowercase());
    }
    let field = |name: &str| {
        let found = head.iter().find_map(|text| text.strip_prefix(name)?.strip_prefix(": "));
        found.map(|value| value.split(';').next().unwrap_or_default().to_owned())
    };
    let status = head[0].split(' ').nth(1).unwrap().parse().unwrap();
    let mut body = vec![0; field("content-length").map_or(0, |length| length.parse().unwrap())];
    line.read_exact(&mut body)?;
    Ok((status, field("content-type"), body))
}

fn asked(to: SocketAddr, requests: &str) -> BufReader<TcpStream> {
    let mut stream = TcpStream::connect(to).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream.write_all(requests.as_bytes()).unwrap();
    BufReader::new(stream)
}

fn request(path: &str, version: &str, host: &str, more: &str) -> String {
    format!("GET {path} HTTP/{version}\r\nHost: {host}\r\n{more}\r\n")
}

/// Every answer of an address that can be had, in a server of its own.
fn answers(path: &str, token: Option<&str>) -> (Value, Vec<(u16, Option<String>)>) {
    let bench = Bench::new();
    let to = bench.dashboard.address;
    let token = token.map_or(String::new(), |token| format!("Authorization: Bearer {token}\r\n"));
    let upgrade = format!("{token}{UPGRADE}");
    let once = |text: String| {
        let (status, kind, _) = answer(&mut asked(to, &text));
        (status, kind)
    };
    let described = request("/api/openapi.json", "1.1", "127.0.0.1", "");
    let (_, _, described) = answer(&mut asked(to, &described));
    let mut all = vec![
        once(request(path, "1.1", "127.0.0.1", &upgrade)),
        once(request(path, "1.1", "127.0.0.1", &token)),
        once(request(path, "1.0", "127.0.0.1", &upgrade)),
        once(request(path, "1.1", "somebody.example", &upgrade)),
    ];
    if path == "/api/live" {
        let lookers: Vec<_> = (0..32).map(|_| Page::looking(to)).collect();
        all.push(once(request(path, "1.1", "127.0.0.1", UPGRADE)));
        drop(lookers);
    }
    if path == "/api/states" {
        all.push(once(request("/api/states?every_ms=0", "1.1", "127.0.0.1", &upgrade)));
        let mut followers: Vec<_> =
            (0..9).map(|_| asked(to, &request(path, "1.1", "127.0.0.1", &upgrade))).collect();
        all.extend(followers.iter_mut().map(answer).map(|(status, kind, _)| (status, kind)));
    }
    let flood = request("/api/planned", "1.1", "127.0.0.1", &token).repeat(FLOOD);
    // A busy machine may answer so slowly that nobody asks too often, or cut off before the answer was read.
    let refused = std::iter::repeat_with(|| {
        let mut line = asked(to, &flood);
        let is_too_often = (0..FLOOD).map_while(|_| heard(&mut line).ok()).any(|(status, ..)| status == 429);
        is_too_often.then(|| once(request(path, "1.1", "127.0.0.1", &upgrade)))
    });
    all.extend(refused.take(3).flatten().find(|(status, _)| *status == 429));
    (serde_json::from_slice(&described).unwrap(), all)
}

#[test]
fn the_websockets_answer_as_the_description_says_and_it_names_nothing_else() {
    for (path, token) in [("/api/live", None), ("/api/inputs", Some(TOKEN)), ("/api/states", Some(TOKEN))] {
        let (description, answers) = answers(path, token);
        let described = &description["paths"][path]["get"]["responses"];
        for (status, kind) in &answers {
            let one = &described[status.to_string()];
            assert!(one["description"].is_string(), "{path}: {status} isn't described");
            let is_of_kind = match kind {
                Some(kind) => one["content"].get(kind).is_some(),
                None => one.get("content").is_none(),
            };
            assert!(is_of_kind, "{path}: {status} is {kind:?}, described: {one}");
        }
        let mut found: BTreeSet<_> = answers.iter().map(|(status, _)| status.to_string()).collect();
        if found.insert("429".to_owned()) {
            println!("SKIPPED: 429, for this machine is too busy to be asked too often");
        }
        let named: BTreeSet<_> = described.as_object().unwrap().keys().cloned().collect();
        assert_eq!(found, named, "{path}");
    }
}

#[test]
fn what_is_not_there_is_told_in_words() {
    let bench = Bench::new();
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let url = |path: &str| format!("http://{}{path}", bench.dashboard.address);
    let told = |mut answer: ureq::http::Response<ureq::Body>| {
        let text = answer.body_mut().read_to_string().unwrap();
        (answer.status().as_u16(), serde_json::from_str::<Value>(&text).unwrap()["text"].clone())
    };
    let why = |words: &str| json!(format!("refused: {words}: /api tells what there is"));
    let nothing = told(agent.get(url("/api/nothing")).call().unwrap());
    assert_eq!(nothing, (404, why("there is no `/api/nothing`")));
    let another = told(agent.delete(url("/api/now")).call().unwrap());
    assert_eq!(another, (405, why("`/api/now` takes no DELETE")));
}
