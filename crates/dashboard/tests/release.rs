//! A release of the emergency stop has the stop's own way.

mod bench;
mod hostile;

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use bench::{Bench, TOKEN};
use hostile::{Hostile, connect, request};

/// Asked at the robot's beginning.
const RELEASE: &str = r#"{"do":"release","stamp":0}"#;

/// The answer to a request over a connection of its own; nothing where that ends without one.
fn answer(to: SocketAddr, request: &str) -> String {
    let Ok(mut line) = connect(to, 0) else { return String::new() };
    let _ = line.write_all(request.as_bytes());
    let mut bytes = [0; 4096];
    let length = line.read(&mut bytes).unwrap_or(0);
    String::from_utf8_lossy(&bytes[..length]).into_owned()
}

#[test]
fn a_release_waits_for_nothing_that_others_of_its_address_asked_or_guessed() {
    let mut bench = Bench::new();
    let address = bench.dashboard.address;
    let call = |token, body| request("POST", "/api/call", token, body);
    for what in ["asked too often", "guessed"] {
        let hostile = Hostile::start(2, move |number| {
            let guess =
                format!("a-guess-{number}-{:?}", Instant::now()).replace(|c: char| !c.is_alphanumeric(), "-");
            let token = (what == "guessed").then_some(&*guess);
            answer(address, &request("GET", "/api/now", token, ""));
        });
        // Until whoever else comes from there, with the token too, is told to wait.
        let begin = Instant::now();
        while !answer(address, &request("GET", "/api/now", Some(TOKEN), "")).starts_with("HTTP/1.1 429") {
            assert!(begin.elapsed() < Duration::from_secs(60), "{what}: never refused");
        }
        for round in 0..20 {
            let asked = [(None, r#"{"do":"emergency_stop"}"#, true), (Some(TOKEN), RELEASE, false)];
            for (token, body, is_set) in asked {
                let asking = std::thread::spawn({
                    let request = call(token, body);
                    move || answer(address, &request)
                });
                while !asking.is_finished() {
                    bench.until("a cycle", |_, _| Some(()));
                }
                let said = asking.join().unwrap();
                assert_eq!(bench.end.authority().is_emergency, is_set, "{what}, {round}: {said}");
            }
        }
        drop(hostile);
    }
    // Nobody else releases anything.
    for token in [None, Some("another")] {
        let said = answer(address, &call(token, RELEASE));
        assert!(said.starts_with("HTTP/1.1 403") || said.starts_with("HTTP/1.1 429"), "{token:?}: {said}");
    }
}
