//! What drives are found by wherever they are plugged in: aliases and switches.

use omnibase_robot::config::BusPlace;

use super::*;

/// What a switch shows is taken where nobody else's shows the same; who shares a number is told with whom.
#[test]
fn a_switch_finds_a_drive_that_has_its_number_alone() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let by_switch = |numbers: [u16; 3]| {
        let places = Some(numbers.map(BusPlace::Identification));
        let named = Circumstances { places, ..Circumstances::default() };
        set_up_where(named, &robot, &mut |question| question.id.starts_with("name ").then(|| said("switch")))
    };
    let found = by_switch([7, 8, 9]);
    for number in [7, 8, 9] {
        assert!(found.text.contains(&format!("identification = {number} ")), "{}", found.text);
    }
    let found = by_switch([7, 8, 7]);
    assert!(found.text.contains("identification = 8 ") && !found.text.contains("identification = 7"));
    assert_eq!(found.text.matches("\nposition = ").count(), 2, "{}", found.text);
    let told = found.told.join("\n");
    for text in
        ["the switch of SubDevice 2 shows the same number", "the switch of SubDevice 0 shows the same"]
    {
        assert!(told.contains(text), "{told}");
    }
}

/// Two drives with one alias, as used ones come: each gets another, and the file is right.
#[test]
fn an_alias_that_two_drives_have_is_written_anew() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let places = Some([5, 6, 5].map(BusPlace::Alias));
    let named = Circumstances { places, ..Circumstances::default() };
    let found =
        set_up_where(named, &robot, &mut |question| question.id.starts_with("name ").then(|| said("alias")));
    let asked: Vec<&str> =
        found.asked.iter().map(|(id, _)| id.as_str()).filter(|id| id.starts_with("name ")).collect();
    assert_eq!(asked, ["name 0", "name 2"]);
    for alias in [1, 6, 3] {
        assert!(found.text.contains(&format!("alias = {alias} ")), "{}", found.text);
    }
    assert!(found.told.join("\n").contains("its drive has alias 5, as SubDevice 2 has"), "{:?}", found.told);
    // Nobody switched anything off: the old ones still show, and neither drive is found by them.
    let (mut texts, mut dark) = (Vec::new(), once("dark", said("again")));
    let found = set_up_where(named, &robot, &mut |question| match question.id.as_str() {
        "power" => {
            texts.push(question.text.clone());
            Some(said("done"))
        }
        "dark" => {
            texts.push(question.text.clone());
            dark(question)
        }
        id => id.starts_with("name ").then(|| said("alias")),
    });
    // What was seen is said, and shortly.
    let seen = "SubDevice 0, 2 never lost its supply since that was asked: switch it off and on, or go on with what counts until then?";
    assert_eq!(texts[1..], [seen, "say it once they were dark and are up again", seen], "{texts:?}");
    assert!(found.text.contains("alias = 6 ") && !found.text.contains("alias = 5"), "{}", found.text);
    assert_eq!(found.text.matches("\nposition = ").count(), 2, "{}", found.text);
}

/// Two drives with one alias that nobody writes anew: by it neither is found, so their places are in the file, which can be driven.
#[test]
fn an_alias_that_two_drives_have_is_in_no_file() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let places = Some([5, 6, 5].map(BusPlace::Alias));
    let named = Circumstances { places, ..Circumstances::default() };
    let found = set_up_where(named, &robot, &mut |_| None);
    assert!(found.text.contains("alias = 6 ") && !found.text.contains("alias = 5"), "{}", found.text);
    assert_eq!(found.text.matches("\nposition = ").count(), 2, "{}", found.text);
}

/// A switch that was chosen before the set-up was left, and isn't any more.
#[test]
fn who_chooses_otherwise_when_asked_again_is_believed() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let places = Some([7, 8, 9].map(BusPlace::Identification));
    let named = Circumstances { places, ..Circumstances::default() };
    let mut is_left = false;
    let found = set_up_where(named, &robot, &mut |question| match question.id.as_str() {
        "name 0" => Some(said(if is_left { "position" } else { "switch" })),
        "name 1" if !std::mem::replace(&mut is_left, true) => Some(Answer::Leave),
        _ => None,
    });
    assert!(!found.text.contains("identification = "), "{}", found.text);
}

/// A program that says an alias that another has, again and again, isn't asked for ever.
#[test]
fn an_alias_that_another_has_is_refused_a_few_times_and_then_left() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let places = Some([5, 6, 5].map(BusPlace::Alias));
    let named = Circumstances { places, ..Circumstances::default() };
    let mut asked = 0;
    let mut says_six = |question: &Question| match question.id.as_str() {
        "alias 0" => {
            asked += 1;
            assert!(asked <= 100, "asked for ever");
            Some(said("6"))
        }
        id => id.starts_with("name ").then(|| said("alias")),
    };
    let left = set_up_in(&robot, named, &mut says_six, &mut |_, _| Ok(()));
    assert!(left.is_err_and(|words| words.contains("that nobody has, found 6")));
    // Left, taken up again, and left again.
    assert_eq!(asked, 40);
}

/// Aliases are written with what was there kept before, and believed once the drives show them; without a backup nothing is written.
#[test]
fn an_alias_is_believed_once_the_drive_shows_it() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let mut name = |question: &Question| match question.id.as_str() {
        "name 0" | "name 1" => Some(said("alias")),
        "alias 1" => Some(said("77")),
        _ => None,
    };
    let remembers = Circumstances::default();
    let mut backups = Vec::new();
    let mut back_up = |position: u16, bytes: &[u8]| {
        assert!(bytes.len() >= 128, "the whole of it");
        backups.push(position);
        if position == 0 { Err("no room".to_owned()) } else { Ok(()) }
    };
    let found = set_up_in(&robot, remembers, &mut name, &mut back_up).unwrap();
    assert_eq!(backups, [0, 1]);
    assert!(found.text.contains("alias = 77"), "{}", found.text);
    assert_eq!(found.text.matches("alias = ").count(), 1, "{}", found.text);
    let findings = found.record.findings.join("\n");
    assert!(
        findings.contains("SubDevice 0: its EEPROM couldn't be kept, so it isn't written: no room"),
        "{findings}"
    );
    // A drive that wasn't switched off shows its old one: it is found by its position.
    let found = set_up_where(remembers, &robot, &mut |question| match question.id.as_str() {
        "power" => Some(said("done")),
        _ => name(question),
    });
    assert!(!found.text.contains("alias = "), "{}", found.text);
    assert!(found.record.findings.join("\n").contains("alias 77 was written, its drive shows none"));
}

/// An alias that was written before the set-up was left waits for its power-on: it needn't be written again.
#[test]
fn an_alias_that_waits_for_its_power_on_is_kept() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    let remembers = Circumstances::default();
    let (mut backups, mut leaves) = (0, once("name 1", Answer::Leave));
    let mut back_up = |_: u16, _: &[u8]| {
        backups += 1;
        Ok(())
    };
    let found = set_up_in(
        &robot,
        remembers,
        &mut |question| match question.id.as_str() {
            "name 0" => Some(said(if question.choices[0] == "keep" { "keep" } else { "alias" })),
            "alias 0" => Some(said("77")),
            _ => leaves(question),
        },
        &mut back_up,
    );
    let text = found.unwrap().text;
    assert!(text.contains("alias = 77"), "{text}");
    assert_eq!(backups, 1, "it is written once");
}

/// An alias that another drive's EEPROM has, but not the drive yet, is neither proposed nor taken.
#[test]
fn an_alias_of_another_eeprom_is_taken() {
    let robot = Unknown { positions: [0, 1, 2], turned_encoder: None, ..Unknown::of(2) };
    let remembers = Circumstances::default();
    let (mut is_left, mut tried, mut proposed) = (false, false, Vec::new());
    let found = set_up_where(remembers, &robot, &mut |question| match question.id.as_str() {
        // The first drive's EEPROM gets alias 2, and nobody is switched off before the set-up is taken up again.
        "name 0" => Some(said(if is_left { "position" } else { "alias" })),
        "alias 0" => Some(said("2")),
        "name 1" if !is_left => {
            is_left = true;
            Some(Answer::Leave)
        }
        "name 1" => Some(said("alias")),
        "alias 1" => {
            proposed.extend(question.default.clone());
            (!std::mem::replace(&mut tried, true)).then(|| said("2"))
        }
        _ => None,
    });
    assert_eq!(proposed, ["3", "3"], "{:?}", found.asked);
    assert!(found.told.join("\n").contains("expected a whole number up to 65535 that nobody has, found 2"));
    assert!(found.text.contains("alias = 3 "), "{}", found.text);
}

/// An alias that a drive didn't show yet is its name once it does, also another day.
#[test]
fn an_alias_that_shows_later_is_believed_when_the_set_up_is_taken_up_again() {
    let robot = Unknown { turned_encoder: None, ..Unknown::of(2) };
    for is_switched_between in [false, true] {
        let circumstances = Circumstances { is_switched_between, ..Circumstances::default() };
        let mut leaves = once("parameters 0", Answer::Leave);
        let found = set_up_where(circumstances, &robot, &mut |question| match question.id.as_str() {
            "name 0" => Some(said("alias")),
            "alias 0" => Some(said("77")),
            // Nobody switched anything off.
            "power" => Some(said("done")),
            _ => leaves(question),
        });
        assert_eq!(found.text.contains("alias = 77"), is_switched_between, "{}", found.text);
        let waits =
            found.record.findings.iter().any(|finding| finding.contains("until it was switched off and on"));
        assert_eq!(waits, !is_switched_between, "{:?}", found.record.findings);
    }
}
