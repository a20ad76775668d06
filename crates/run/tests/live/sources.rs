//! A program that sends a thousand times a second: late, lost, out of order, no number; and one that falls silent.

use std::sync::{Arc, Mutex};

use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Heard, Phase, RequestAnswer, SafetyReason};
use omnibase_run::RobotText;
use omnibase_run::live::{Answer, Ask, Client, Live, NotHeard, SourceCounts};

use crate::hands::{Hands, Played, played_by};

const TEXT: &str = concat!(
    include_str!("../../../../robots/bmm.toml"),
    "
[reference]
kind = \"circle\"
radius_m = 0.3
duration_s = 8.0

[safety]
enable_input = \"gate.open\"

[[source]]
name = \"gate\"
max_age_ms = 20
[[source.input]]
name = \"open\"
[[source.input]]
name = \"count\"
"
);
const BY: Client = Client::Command;
const TAKEN: Answer = Answer::Robot(RequestAnswer::Taken);
const MS: u64 = 1_000_000;

fn played(until_s: f64, prepare: impl FnOnce(&mut Hands)) -> Played {
    let played = played_by(RobotText { text: TEXT.into(), ..RobotText::default() }, until_s, prepare);
    assert!(played.replayed.difference.is_none(), "{:?}", played.replayed);
    played
}

fn send(live: &Live, age_ns: u64, values: [f64; 2]) -> Result<(), NotHeard> {
    let mut heard = Heard { instant_ns: live.clock_ns() - age_ns, ..Heard::NOTHING };
    heard.values[..2].copy_from_slice(&values);
    live.send_inputs(0, &heard)
}

#[test]
fn a_thousand_a_second_are_heard_and_the_robot_stops_when_they_end() {
    let run = played(8.0, |hands| {
        // It dies at 4 s, and is there again at 5 s.
        for ms in (100..4000_u32).chain(5000..7900) {
            hands.at(f64::from(ms) * 1e-3, move |live, _| {
                send(live, 0, [1.0, f64::from(ms)]).unwrap();
            });
        }
        hands.ask(0.05, BY, Ask::Robot(RequestKind::Enable), Answer::Robot(RequestAnswer::EnableInput));
        hands.ask(0.5, BY, Ask::Robot(RequestKind::Enable), TAKEN);
        hands.ask(1.0, BY, Ask::Robot(RequestKind::Track), TAKEN);
        hands.at(4.0, |_, seen| assert_eq!(seen.phase, Phase::Tracking));
        hands.at(4.025, |_, seen| {
            assert_eq!((seen.phase, seen.record.stop_reason), (Phase::Stopping, SafetyReason::EnableInput));
        });
        hands.at(7.5, |_, seen| {
            assert_eq!(
                (seen.phase, seen.record.signals.believed),
                (Phase::Fault, 0b11),
                "nobody acknowledged"
            );
        });
    });
    let SourceCounts { heard, late, out_of_order } = run.live.source_counts()[0];
    assert_eq!((heard, late, out_of_order), (3900 + 2900, 0, 0));
    let column = run.recorded.column("/source", "heard").unwrap();
    let cycles = column.filter(|heard| *heard == 1.0).count() as u64;
    println!("{heard} heard, in {cycles} cycles; {late} late, {out_of_order} out of order");
    assert!(cycles > heard * 95 / 100, "{cycles} cycles heard one of {heard}");
}

#[test]
fn a_burst_that_ends_well_hides_no_demand_in_it() {
    played(3.0, |hands| {
        for ms in (100..2900_u32).step_by(5) {
            hands.at(f64::from(ms) * 1e-3, move |live, _| {
                send(live, 4 * MS, [1.0, 0.0]).unwrap();
                // What a line kept back comes at once.
                if ms == 1500 {
                    send(live, 2 * MS, [0.0, 0.0]).unwrap();
                }
                send(live, MS, [1.0, 0.0]).unwrap();
            });
        }
        hands.ask(0.5, BY, Ask::Robot(RequestKind::Enable), TAKEN);
        hands.at(1.499, |_, seen| assert_eq!(seen.phase, Phase::Holding));
        hands.at(1.51, |_, seen| {
            assert_eq!((seen.phase, seen.record.stop_reason), (Phase::Fault, SafetyReason::EnableInput));
        });
    });
}

#[test]
fn what_is_late_overtaken_or_of_the_future_is_counted_and_never_seen() {
    let counts: Arc<Mutex<Vec<f64>>> = Arc::default();
    let run = played(3.0, |hands| {
        for ms in 105..2905_u32 {
            let seen_counts = counts.clone();
            hands.at(f64::from(ms) * 1e-3, move |live, seen| {
                let sent = |age_ns, count| send(live, age_ns, [1.0, count]);
                seen_counts.lock().unwrap().push(seen.record.signals.inputs[1]);
                match ms % 10 {
                    // Lost.
                    0 => {}
                    1 => assert!(matches!(sent(21 * MS, -1.0), Err(NotHeard::TooOld { .. }))),
                    2 => assert!(matches!(sent(15 * MS, -1.0), Err(NotHeard::Overtaken { .. }))),
                    3 => {
                        let ahead = Heard { instant_ns: live.clock_ns() + 11 * MS, ..Heard::NOTHING };
                        assert!(matches!(live.send_inputs(0, &ahead), Err(NotHeard::Future { .. })));
                    }
                    4 => sent(0, f64::NAN).unwrap(),
                    // Between two cycles the robot's clock stands.
                    5 => {
                        let instant_ns = live.clock_ns() + MS / 2;
                        live.send_inputs(0, &Heard { instant_ns, ..Heard::NOTHING }).unwrap();
                        assert!(seen.record.signals.instants_ns[0] <= live.clock_ns());
                    }
                    _ => sent(0, f64::from(ms)).unwrap(),
                }
                assert_eq!(live.send_inputs(1, &Heard::NOTHING), Err(NotHeard::Unknown));
            });
        }
    });
    let SourceCounts { heard, late, out_of_order } = run.live.source_counts()[0];
    println!("{heard} heard, {late} late, {out_of_order} out of order or of the future");
    assert_eq!((heard, late, out_of_order), (6 * 280, 280, 2 * 280));
    let seen = counts.lock().unwrap();
    assert!(seen.iter().all(|count| count.is_nan() || *count >= 0.0), "what was refused was seen");
    assert!(seen.iter().any(|count| count.is_nan()) && seen.iter().any(|count| *count > 2800.0));
}
