//! Files of a set-up: whose they are, and what stays whole.

use super::*;

#[test]
fn a_file_that_no_set_up_wrote_is_left_alone_and_a_state_is_whole_or_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let told = beside(&file, "record.md");
    let left = Record { done: vec![Step::Find], ..Record::default() };
    let ended = Record { done: Step::ALL.to_vec(), ..Record::default() };
    assert!(is_own(&file, &told, None).is_ok());
    // What is there and can't be read is somebody's.
    std::fs::create_dir(&file).unwrap();
    assert!(is_own(&file, &told, None).unwrap_err().to_string().contains("mine.toml"));
    std::fs::remove_dir(&file).unwrap();
    std::fs::write(&file, "by hand").unwrap();
    for before in [None, Some(&left)] {
        let words = is_own(&file, &told, before).unwrap_err().to_string();
        assert!(words.contains("mine.toml` exists, and no set-up wrote it"), "{words}");
    }
    assert!(is_own(&file, &told, Some(&ended)).is_ok());
    // Begun anew it is still one that a set-up wrote; changed since, it isn't.
    let anew = |written: &str| Record { written: Some(written.to_owned()), ..Record::default() };
    assert!(is_own(&file, &told, Some(&anew("by hand"))).is_ok());
    let words = is_own(&file, &told, Some(&anew("by a set-up"))).unwrap_err().to_string();
    assert!(words.contains("mine.toml` was changed since the set-up wrote it"), "{words}");
    std::fs::write(&told, "precious").unwrap();
    let words = is_own(&file, &told, Some(&ended)).unwrap_err().to_string();
    assert!(words.contains("mine.record.md` exists"), "{words}");
    std::fs::write(&told, in_words(&ended)).unwrap();
    assert!(is_own(&file, &told, Some(&ended)).is_ok());

    let state = beside(&file, "state.json");
    assert_eq!(kept_record(&state).unwrap(), None);
    write_whole(&state, left.to_json()).unwrap();
    assert_eq!(kept_record(&state).unwrap(), Some(left));
    // Where the new one can't be written the old one stays.
    std::fs::create_dir(folder.path().join("mine.state.json.new")).unwrap();
    assert!(write_whole(&state, "half").is_err());
    assert!(kept_record(&state).unwrap().is_some());
    std::fs::write(&state, "half").unwrap();
    assert!(kept_record(&state).unwrap_err().to_string().contains("mine.state.json"));
}

#[test]
fn ways_that_no_wheels_fit_keep_no_file_back() {
    // Left, too: one that was whole before mustn't lose its wheels in silence.
    for ended in [Ended::File("name = 1".to_owned()), Ended::Left(Some("name = 1".to_owned()))] {
        let mut written = Vec::new();
        let calibrated = Err(SetupError::Bus("no wheels fit".to_owned()));
        let ended = finished(ended, calibrated, &mut |text| {
            written.push(text.to_owned());
            Ok(())
        });
        let words = format!("{:#}", ended.unwrap_err());
        assert!(words.contains("without the wheels") && words.contains("no wheels fit"), "{words}");
        assert_eq!(written, ["name = 1"]);
    }
}

#[test]
fn a_set_up_begun_anew_twice_has_both_that_were_before() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    for expected in ["mine.state.before.json", "mine.state.before.2.json", "mine.state.before.3.json"] {
        let path = free(&file, "state.before", "json").unwrap();
        assert_eq!(path, folder.path().join(expected));
        std::fs::write(&path, expected).unwrap();
    }
}

#[test]
fn an_eeprom_is_kept_beside_what_was_kept_before() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let kept = |end: &str| std::fs::read(beside(&file, end)).ok();
    std::fs::write(beside(&file, "eeprom-1.bin"), "something else").unwrap();
    for _ in 0..2 {
        back_up(&file, 1, b"first").unwrap();
    }
    back_up(&file, 1, b"second").unwrap();
    assert_eq!(kept("eeprom-1.bin").unwrap(), b"something else");
    assert_eq!(kept("eeprom-1.2.bin").unwrap(), b"first");
    assert_eq!(kept("eeprom-1.3.bin").unwrap(), b"second");
    assert_eq!(kept("eeprom-1.4.bin"), None);
}

#[test]
fn a_state_is_there_at_every_instant_of_beginning_anew() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let state = beside(&file, "state.json");
    assert_eq!(set_aside(&file, &state).unwrap(), None);
    std::fs::write(&state, "what was jogged").unwrap();
    let aside = set_aside(&file, &state).unwrap().unwrap();
    for path in [state, aside] {
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "what was jogged", "{path:?}");
    }
}

#[test]
fn a_file_that_somebody_writes_while_the_set_up_runs_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let told = beside(&file, "record.md");
    let written = |text: &str| Record { written: Some(text.to_owned()), ..Record::default() };
    for record in [Record::default(), written("name = 1")] {
        std::fs::write(&file, "name = 2").unwrap();
        let words = format!("{:#}", write_own(&file, &told, &record, "name = 3").unwrap_err());
        assert!(words.contains("put that file elsewhere") && words.contains("mine.toml` "), "{words}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "name = 2");
    }
    write_own(&file, &told, &written("name = 2"), "name = 3").unwrap();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "name = 3");
}

/// The program is gone between the robot's file and the record of it: the file is known as the set-up's own. One that is gone since is
/// written again.
#[test]
fn a_file_whose_writing_broke_off_is_taken_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let told = beside(&file, "record.md");
    let begun = Record {
        written: Some("old".to_owned()),
        to_be_written: Some("new".to_owned()),
        ..Record::default()
    };
    for text in ["old", "new"] {
        std::fs::write(&file, text).unwrap();
        is_own(&file, &told, Some(&begun)).unwrap();
        is_own(&file, &told, Some(&anew(begun.clone()))).unwrap();
    }
    std::fs::write(&file, "by hand").unwrap();
    assert!(is_own(&file, &told, Some(&begun)).is_err());

    let over = Record { done: Step::ALL.to_vec(), ..Record::default() };
    assert_eq!(with_file(over.clone(), &file).unwrap(), over);
    std::fs::remove_file(&file).unwrap();
    let again = with_file(over, &file).unwrap();
    assert!(!again.done.contains(&Step::File) && again.done.len() + 1 == Step::ALL.len());
}

#[test]
fn what_a_jog_left_is_known_when_a_set_up_is_begun_anew() {
    let jogged = vec![omnibase_setup::FoundDrive::default()];
    let before = Record { jogged, done: vec![Step::Find], ..Record::default() };
    let expected = Record { done: Vec::new(), ..before.clone() };
    assert_eq!(anew(before), expected);
}

/// What somebody went on without isn't called done in the record for people.
#[test]
fn what_was_passed_over_is_not_called_done() {
    let mut record = Record { done: Step::ALL.to_vec(), ..Record::default() };
    assert!(!in_words(&record).contains("PASSED OVER"));
    record.pass_over(Step::SafeTorqueOff, Some("wheel_2"), "wheel_2: not tried");
    record.pass_over(Step::FirstMetre, None, "not driven");
    let words = in_words(&record);
    let done = words.lines().find(|line| line.starts_with("Done: ")).unwrap();
    assert!(done.contains("brakes; parameters; the robot's file; calibration by a tape."), "{done}");
    let passed_over =
        "PASSED OVER, and offered again by the same command: emergency stop of wheel_2; the first metre.";
    assert!(words.lines().any(|line| line == passed_over), "{words}");
    assert!(words.contains("- wheel_2: not tried\n"), "{words}");
    // Begun again, all is done anew: what is found then counts.
    record.begin_again();
    assert_eq!((record.findings, record.passed_over), (Vec::new(), Vec::new()));
}
