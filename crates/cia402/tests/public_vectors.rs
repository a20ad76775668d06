//! Numbers of public test suites, from a file outside the repository.

use omnibase_cia402::{DriveState, StatusWord};
use serde_json::Value;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/vectors/public-test-vectors.json");

fn state_named(name: &str) -> DriveState {
    let wanted = name.replace('_', " ");
    DriveState::ALL.into_iter().find(|state| state.name().eq_ignore_ascii_case(&wanted)).expect(name)
}

#[test]
fn status_words_decode_as_public_suites_say() {
    let Ok(text) = std::fs::read_to_string(PATH) else {
        eprintln!("SKIPPED: {PATH} is missing");
        return;
    };
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let group = vectors["groups"].as_array().unwrap().iter().find(|group| group["id"] == "cia402").unwrap();
    let mut applied = 0;
    for case in group["cases"].as_array().unwrap() {
        if let Some(table) = case["expected"]["mask_value_state"].as_array() {
            assert_eq!(table.len(), 8);
            for row in table {
                let number = |at: usize| u16::from_str_radix(&row[at].as_str().unwrap()[2..], 16).unwrap();
                assert_eq!(state_named(row[2].as_str().unwrap()).mask_and_value(), (number(0), number(1)));
            }
        } else {
            let word = case["input"]["statusword"].as_u64().unwrap() as u16;
            let expected = state_named(case["expected"]["state"].as_str().unwrap());
            assert_eq!(StatusWord(word).state(), Some(expected), "status word {word}");
        }
        applied += 1;
    }
    assert_eq!(applied, 12, "cases of the group");
}
