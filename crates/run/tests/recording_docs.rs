//! The manual's page on recordings names every signal, and no other.

use std::collections::BTreeSet;
use std::path::Path;

use omnibase_robot::Registry;
use omnibase_robot::signals::{RecordLayout, SafetyReason};
use omnibase_run::RobotText;
use omnibase_run::channels::{Known, Rows};

fn page() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/recording.md")).unwrap()
}

/// The names in backticks in the first column of the tables below the heading of a topic.
fn told(page: &str, topic: &str) -> BTreeSet<String> {
    let section = page.split("\n### ").find(|section| section.starts_with(&format!("`{topic}`")));
    let section = section.unwrap_or_else(|| panic!("docs/recording.md has no heading for {topic}"));
    let rows =
        section.split("\n## ").next().unwrap_or_default().lines().filter_map(|line| line.strip_prefix("| `"));
    let first_columns = rows.filter_map(|row| row.split(" | ").next());
    first_columns.flat_map(|names| names.split(", ").map(|name| name.trim_matches('`').to_owned())).collect()
}

#[test]
fn every_signal_stands_in_the_manual_and_no_other() {
    let page = page();
    let rows = Rows::new(&RecordLayout::of_wheels(1), Known::Truth);
    for topic in &rows.schema().topics {
        let recorded: BTreeSet<String> = topic.signals.iter().map(|signal| signal.name.clone()).collect();
        assert_eq!(told(&page, &topic.name), recorded, "docs/recording.md on {}", topic.name);
    }
}

#[test]
fn what_is_recorded_of_terminals_stands_in_the_manual() {
    let text = include_str!("../../../robots/bmm_io.toml").into();
    let robot = RobotText { text, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap();
    let rows = Rows::new(&robot.plan.record_layout(), Known::BeliefAlone);
    let of = |topic: &str| -> BTreeSet<String> {
        let topic = rows.schema().topics.iter().find(|one| one.name == topic).expect("its topic");
        topic.signals.iter().map(|signal| signal.name.clone()).collect()
    };
    let mut told = told(&page(), "/device");
    // Seven bytes of inputs.
    assert!(told.remove("input_1"));
    assert_eq!(told, of("/device"));
    assert_eq!(of("/supply"), ["age_s", "voltage_v"].map(str::to_owned).into());
    assert_eq!(of("/lamps"), ["age_s", "green", "red", "horn"].map(str::to_owned).into());
}

#[test]
fn every_reason_to_stop_stands_in_the_manual_and_no_other() {
    let page = page();
    let table = page.split("| code of `reason` | why |\n|---|---|\n").nth(1).expect("its heading");
    let told: Vec<&str> = table.lines().take_while(|line| line.starts_with('|')).collect();
    // Codes may have gaps: those of reasons that are no more aren't given to others.
    let known = (1..100).filter_map(SafetyReason::from_code);
    let known: Vec<String> =
        known.map(|reason| format!("| {} | {} |", reason.code(), reason.text())).collect();
    assert_eq!(told, known, "docs/recording.md");
}
