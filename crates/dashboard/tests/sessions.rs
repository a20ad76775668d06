//! Pages at the API, with a cycle that the test turns by hand: who is heard, and what of it reaches the robot.

mod bench;

use std::time::{Duration, Instant};

use bench::{Bench, Page};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::StopCategory;
use omnibase_run::live::Snapshot;
use serde_json::{Value, json};
use tungstenite::Message;

#[test]
fn where_all_sessions_are_taken_a_stop_is_heard_and_the_rest_is_refused_by_its_true_reason() {
    let mut bench = Bench::new();
    let mut taken: Vec<Page> = (0..16)
        .map(|_| {
            let mut page = bench.page();
            assert_eq!(page.hear("may")["may"], "command");
            bench.until("its cycle takes it in", |_, _| Some(()));
            page
        })
        .collect();
    let mut page = bench.page();
    let welcome = page.hear("may");
    assert_eq!((&welcome["may"], &welcome["you"]), (&json!("stop"), &Value::Null));
    page.send(&json!({"number": 1, "do": "enable", "stamp": 0}));
    let said = page.hear("answer");
    assert_eq!((&said["answer"], &said["done"]), (&json!(1), &json!(false)));
    assert!(said["text"].as_str().unwrap().contains("all sessions are taken"), "{said}");
    page.send(&json!({"number": 2, "do": "emergency_stop"}));
    bench.until("the emergency stop", |end, _| end.authority().is_emergency.then_some(()));
    page.send(&json!({"number": 3, "do": "stop", "category": "category_0"}));
    bench.until("the stop", |_, request| {
        (request?.kind == RequestKind::Stop(StopCategory::RemoveTorque)).then_some(())
    });
    // Somebody goes: there is a session for it.
    taken.remove(4).0.close(None).unwrap();
    let begin = Instant::now();
    loop {
        page.send(&json!({"do": "alive"}));
        page.send(&json!({"number": 4, "do": "stick", "x": 2.0, "y": 0.0, "turn": 0.0}));
        bench.until("a cycle", |_, _| Some(()));
        let Message::Text(text) = page.0.read().unwrap() else { continue };
        let message: Value = serde_json::from_str(&text).unwrap();
        if message["may"] == "command" {
            assert_eq!(message["you"], "page 5");
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "there is no session for it");
    }
}

#[test]
fn a_stick_in_its_corner_asks_for_full_speed_and_no_more() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    page.send(&json!({"do": "release_stick", "stamp": 0}));
    page.send(&json!({"do": "stick", "x": 1.0, "y": 1.0, "turn": 0.0, "stamp": 0}));
    let twist = bench.until("its wish", |_, request| match request?.kind {
        RequestKind::Velocity { twist, .. } => Some(twist),
        _ => None,
    });
    // The robot's file says 1 m/s.
    assert!(
        (twist.speed_m_s() - 1.0).abs() < 1e-12 && (twist.vx_m_s - twist.vy_m_s).abs() < 1e-12,
        "{twist:?}"
    );
}

#[test]
fn a_page_gone_wild_may_still_be_stopped_by_the_person_before_it() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    for _ in 0..2000 {
        page.send(&json!({"do": "alive"}));
    }
    page.send(&json!({"number": 1, "do": "emergency_stop"}));
    bench.until("the emergency stop", |end, _| end.authority().is_emergency.then_some(()));
    assert!(bench.dashboard.counts()[4] > 1000, "{:?}", bench.dashboard.counts());
}

#[test]
fn a_page_is_told_by_how_much_it_lags_behind_the_robots_clock() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    assert_eq!(page.hear("delay_ms")["delay_ms"], Value::Null, "it said nothing yet");
    let mut snapshot = Snapshot::default();
    snapshot.record.time.now_ns = 9_000_000_000;
    bench.end.show(&snapshot);
    // What it saw last; and what no robot can have told it yet.
    for (stamp, delay_ms) in [(8300, json!(700)), (9000, json!(0)), (9001, Value::Null), (0, json!(9000))] {
        page.send(&json!({"do": "alive", "stamp": stamp}));
        let begin = Instant::now();
        while page.hear("delay_ms")["delay_ms"] != delay_ms {
            assert!(begin.elapsed() < Duration::from_secs(60), "{stamp}: never {delay_ms}");
        }
    }
}

#[test]
fn a_page_is_told_in_how_many_seconds_the_robot_moves_again_by_itself() {
    let mut bench = Bench::new();
    let mut page = bench.page();
    for moves_again_in_s in [None, Some(2.5), None] {
        let mut snapshot = Snapshot::default();
        snapshot.extras.moves_again_in_s = moves_again_in_s;
        bench.end.show(&snapshot);
        let begin = Instant::now();
        while page.hear("phase")["moves_again_in_s"] != json!(moves_again_in_s) {
            assert!(begin.elapsed() < Duration::from_secs(60), "never {moves_again_in_s:?}");
        }
    }
}
