//! Programs that send inputs: who may, what is told of what isn't taken, and how much is too much.

mod bench;

use std::net::TcpStream;

use bench::{Bench, Page, TOKEN};
use omnibase_robot::Registry;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Error, Message, WebSocket};

const SOURCE: &str = "source=[{name=\"gate\",input=[{name=\"open\"},{name=\"force\",unit=\"N\"}]}]";

fn open(bench: &Bench, token: Option<&str>) -> Result<WebSocket<MaybeTlsStream<TcpStream>>, Error> {
    let mut request = format!("ws://{}/api/inputs", bench.dashboard.address).into_client_request().unwrap();
    if let Some(token) = token {
        request.headers_mut().insert("Authorization", format!("Bearer {token}").parse().unwrap());
    }
    tungstenite::connect(request).map(|(socket, _)| socket)
}

/// What the program is told once so many of its messages were looked at.
fn news(program: &mut Page, messages: u64) -> Value {
    loop {
        let news = program.hear("clock_ms");
        if news["heard"].as_u64().unwrap() + news["refused"].as_u64().unwrap() >= messages {
            return news;
        }
    }
}

#[test]
fn only_who_may_command_sends_inputs() {
    let bench = Bench::with(Registry::with_built_in(), &[SOURCE]);
    for token in [None, Some("another")] {
        let refused = open(&bench, token).unwrap_err();
        assert!(matches!(&refused, Error::Http(answer) if answer.status() == 403), "{refused}");
    }
    assert!(open(&bench, Some(TOKEN)).is_ok());
}

#[test]
fn what_isnt_taken_is_told_with_its_reason() {
    let bench = Bench::with(Registry::with_built_in(), &[SOURCE]);
    let mut program = Page(open(&bench, Some(TOKEN)).unwrap());
    let sent = |values: Value| json!({"source": "gate", "values": values, "instant_ms": 0.0});
    program.send(&sent(json!({"open": 1.0, "force": null})));
    let said = news(&mut program, 1);
    assert_eq!((&said["heard"], &said["refused"], &said["why"]), (&json!(1), &json!(0), &Value::Null));
    let other = json!({"source": "door", "values": {}, "instant_ms": 0.0});
    for (number, (message, why)) in [
        (sent(json!({"oben": 1.0})), "gate: no value is called `oben`; did you mean `open`?"),
        (sent(json!({"open": "yes"})), "invalid type"),
        (other, "no source is called `door`: there is only `gate`"),
        (json!({"source": "gate", "values": {}}), "instant_ms"),
        (json!({"source": "gate", "values": {}, "instant_ms": -1.0}), "expected ms of the robot's clock"),
        (json!({"source": "gate", "values": {}, "instant_ms": 1e9}), "ahead of the robot's clock"),
        (json!({"do": "enable"}), "unknown field"),
        (json!([]), "invalid"),
    ]
    .into_iter()
    .enumerate()
    {
        program.send(&message);
        let said = news(&mut program, 2 + number as u64);
        assert!(said["why"].as_str().unwrap().contains(why), "{message}: expected `{why}`, found {said}");
        assert_eq!(said["heard"], 1);
    }
    // The same by a call, where a stamp may stand for the instant.
    let mut page = bench.page();
    page.send(&json!({"number": 1, "do": "send_inputs", "source": "gate", "values": {"open": 1.0}}));
    let said = page.hear("answer");
    assert!(said["text"].as_str().unwrap().contains("nobody knows how old it is"), "{said}");
}

#[test]
fn a_flood_is_refused_and_the_connection_stays() {
    let bench = Bench::with(Registry::with_built_in(), &[SOURCE]);
    let mut program = Page(open(&bench, Some(TOKEN)).unwrap());
    let message = json!({"source": "gate", "values": {}, "instant_ms": 0.0});
    let mut refused_all = 0;
    let mut sent = 0;
    // As long as it takes: a slow machine may take them all for a while.
    for _ in 0..20 {
        (0..10_000).for_each(|_| program.send(&message));
        sent += 10_000;
        let said = news(&mut program, sent);
        if said["why"].as_str().unwrap_or_default().contains("too many messages") {
            refused_all = said["refused"].as_u64().unwrap();
            break;
        }
    }
    assert!(refused_all > 0, "{sent} messages, and none was too much");
    // A message that is longer than any can be ends it.
    let long = json!({"source": "g".repeat(20_000), "values": {}, "instant_ms": 0.0});
    let _ = program.0.send(Message::text(long.to_string()));
    // What was told before may still be on its way.
    let ended = (0..1000).map(|_| program.0.read()).find_map(Result::err);
    assert!(ended.is_some(), "the connection goes on");
}
