//! A recording in several files, of a robot to which references are loaded.

use omnibase_record::run::RecordedRun;
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::{Phase, RequestAnswer};
use omnibase_run::live::{Answer, Ask, Client, Live};

use crate::hands::{Hands, played};

/// Which loaded references a file has.
fn references(file: &RecordedRun) -> Vec<u32> {
    let numbers = file.description.keys().filter_map(|key| key.strip_prefix("reference/")?.parse().ok());
    let mut numbers: Vec<u32> = numbers.collect();
    numbers.sort_unstable();
    numbers
}

#[test]
fn a_later_file_carries_the_references_in_use_and_next_and_none_that_was_replaced_or_refused() {
    let run = played(9.0, |hands: &mut Hands| {
        hands.file_bytes = Some(200_000);
        hands.send(0.5, Client::Page(1), Ask::Robot(RequestKind::Enable));
        hands.alive(0.4, 9.0, Client::Page(1));
        let load = |live: &Live| {
            let points = "points = [[0.0, 0.0, 0.0, 0.0], [6.0, 0.4, 0.0, 0.0]]";
            let table = format!("kind = \"path\"\nframe = \"start\"\n{points}");
            let table: ReferenceTable = toml::from_str(&table).unwrap();
            let made = crate::hands::reference(&table);
            live.load(Client::Page(1), table, made).unwrap();
        };
        (0..10).for_each(|number| hands.at(1.0 + f64::from(number) * 0.02, move |live, _| load(live)));
        let track = Ask::Robot(RequestKind::Track);
        hands.ask(1.5, Client::Page(1), track, Answer::Robot(RequestAnswer::Taken));
        // While it is tracked the others are only the next one by turns.
        (0..10).for_each(|number| hands.at(2.0 + f64::from(number) * 0.02, move |live, _| load(live)));
        hands.at(2.5, |live, seen| {
            assert_eq!((seen.phase, seen.reference), (Phase::Tracking, 10));
            assert_eq!(live.references().into_keys().collect::<Vec<_>>(), [10, 20]);
        });
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    assert!(run.later_files.len() > 3, "{} files", run.later_files.len());
    let loaded_in: Vec<_> = [&run.recorded].into_iter().chain(&run.later_files).map(references).collect();
    let starts_s = |file: &RecordedRun| file.times_ns[0] as f64 * 1e-9;
    for file in run.later_files.iter().filter(|file| starts_s(file) > 2.6) {
        assert_eq!(
            references(file),
            [10, 20],
            "of a file that begins at {} s; all: {loaded_in:?}",
            starts_s(file)
        );
    }
    assert!(run.later_files.iter().any(|file| starts_s(file) > 2.6));
    // Those that were loaded in it, and what a writer that is late was told before it ended.
    assert!(loaded_in[0].starts_with(&Vec::from_iter(1..=10)), "{loaded_in:?}");
}
