//! What a jog writes over, and what of it somebody may have changed or kept.

use super::*;

/// Left in order, then the file lost a parameter and somebody set it by the maker's tool: it stays as he set it.
#[test]
fn what_the_file_no_longer_has_is_not_put_back() {
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77 }, ";
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_found(&BASE.replacen("parameters = [", more, 1), &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.leave_as_found();
        record = guide.record.clone();
    });
    let window = ObjectAddress::new(0x6065, 0);
    by_tool(&link, &clock).sdo_write(1, window, &50_u32.to_le_bytes()).unwrap();
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        guide.compare().unwrap();
        guide.operational().unwrap();
        guide.leave_as_found();
        assert_eq!(guide.record.findings, Vec::<String>::new());
    });
    let now = by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap();
    assert_eq!(now, 50_u32.to_le_bytes());
}

/// What a start writes in SAFE-OP is put back as all else that a jog writes.
#[test]
fn what_is_written_in_safe_op_is_put_back() {
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77, state = \"safe_op\" }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let window = || {
        let mut bus = by_tool(&link, &clock);
        bus.sdo_read(1, ObjectAddress::new(0x6065, 0), SdoAccess::Entry).unwrap()
    };
    let before = window();
    with_found(&base, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        assert_eq!(window(), 77_u32.to_le_bytes());
        guide.leave_as_found();
    });
    assert_eq!(window(), before);
}

/// A disk that is full keeps nothing: a jog writes nothing over that nobody could put back.
#[test]
fn what_cannot_be_kept_is_not_written_over() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let (mut keep, mut back_up) = (|_: &Record| Err("no space".to_owned()), |_: u16, _: &[u8]| Ok(()));
    let outside = Outside { hand: &mut Nobody, keep: &mut keep, back_up: &mut back_up };
    let wished = Wished::new(BASE.to_owned());
    let mut guide = Guide::new(wished, Record::default(), &mut open, outside).unwrap();
    assert!(guide.find().unwrap());
    let error = guide.operational().err().unwrap().to_string();
    assert!(error.contains("nothing is written into them: no space"), "{error}");
    drop(guide);
    assert_eq!(max_torques(&link, &clock), [3000; 3]);
}

/// Drives with serial numbers are the same wherever they are plugged in by the next start: each is remembered once, gets back what it
/// held and is forgotten then.
#[test]
fn drives_that_were_jogged_elsewhere_get_back_what_they_held() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut jogged = Vec::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert!(guide.record.drives.iter().all(|drive| drive.serial != 0));
        guide.operational().unwrap();
        jogged = guide.record.jogged.clone();
    });
    // A coupler was ahead of them.
    jogged.iter_mut().for_each(|one| one.position += 1);
    // As two set-ups have left it.
    let twice = jogged.iter().map(|one| FoundDrive { position: one.position + 1, ..one.clone() });
    let twice: Vec<FoundDrive> = jogged.iter().cloned().chain(twice).collect();
    // The file has a parameter more by now.
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77 }, ";
    let with_more = BASE.replacen("parameters = [", more, 1);
    for (base, jogged) in [(BASE, jogged), (BASE, twice.clone()), (with_more.as_str(), twice)] {
        let record = Record { jogged, ..Record::default() };
        with_record(base, record, &mut open, &mut Nobody, |guide| {
            assert!(guide.find().unwrap());
            assert_eq!(max_torques(&link, &clock), [3000; 3]);
            guide.operational().unwrap();
            assert_eq!(guide.record.jogged.len(), 3);
            guide.leave_as_found();
            assert_eq!((&guide.record.jogged, &guide.record.findings), (&Vec::new(), &Vec::new()));
        });
        assert_eq!(max_torques(&link, &clock), [3000; 3]);
    }
}

/// What drives held is compared in no order: those that look alike are remembered once, however often they are jogged.
#[test]
fn what_drives_held_is_compared_in_no_order() {
    let drive = |position, was: &[(u16, u8)]| FoundDrive {
        position,
        was: was.iter().map(|(index, value)| (*index, 0, vec![*value])).collect(),
        ..FoundDrive::default()
    };
    let jogged = vec![drive(0, &[(1, 10), (2, 20)])];
    let drives = vec![drive(1, &[(2, 20), (1, 10)])];
    let mut record = Record { drives, jogged: jogged.clone(), ..Record::default() };
    assert!(!before::remember(&mut record));
    assert_eq!(record.jogged, jogged);
    // Another that looks alike and held something else is another one.
    record.drives = vec![drive(0, &[(1, 11)])];
    assert!(before::remember(&mut record));
    assert_eq!(record.jogged.len(), 2);
    // With a serial number it is the same, and what was known of it stays known.
    let with_serial = |drive: FoundDrive| FoundDrive { serial: 7, ..drive };
    record.jogged = vec![with_serial(drive(0, &[(1, 10), (2, 20)]))];
    record.drives = vec![with_serial(drive(1, &[(1, 10), (3, 30)]))];
    assert!(before::remember(&mut record));
    assert_eq!(record.jogged, [with_serial(drive(1, &[(1, 10), (3, 30), (2, 20)]))]);
}

/// A jog was cut off, and the set-up is begun anew: what that robot's drives held is put into no other robot's.
#[test]
fn what_one_robot_held_is_not_put_into_another() {
    let drive = |serial| FoundDrive {
        serial,
        was: vec![(at_start::MAX_TORQUE, 0, 3000_u16.to_le_bytes().to_vec())],
        ..FoundDrive::default()
    };
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> { Err("it is opened".to_owned()) };
    let mut same = None;
    with_record(BASE, Record::default(), &mut open, &mut Nobody, |guide| {
        drop(guide.run());
        same = guide.record.robot.clone();
    });
    let other = Some("wheels of another".to_owned());
    for (robot, serial, is_asked) in
        [(other.clone(), 7, true), (other, 0, true), (same.clone(), 0, true), (same, 7, false)]
    {
        let record = Record { robot: robot.clone(), jogged: vec![drive(serial)], ..Record::default() };
        let mut ends = |hand: &mut dyn Hand| {
            let mut words = String::new();
            with_record(BASE, record.clone(), &mut open, hand, |guide| {
                words = guide.run().map_or_else(|error| error.to_string(), |ended| format!("{ended:?}"));
                assert_eq!(guide.record.jogged, record.jogged);
            });
            words
        };
        let opened = "it is opened".to_owned();
        assert_eq!(ends(&mut Says("same")), opened);
        let another = ends(&mut Says("another"));
        assert_eq!(another.starts_with("drives of another robot were jogged"), is_asked, "{another}");
        let left = if is_asked { "Left(None)".to_owned() } else { opened };
        assert_eq!(ends(&mut Nobody), left, "{robot:?} {serial}");
    }
}

/// A drive doesn't store what a jog left in it: torque, mode or synchronisation, whatever the torque of this set-up is.
#[test]
fn nothing_that_a_jog_left_is_stored() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        let mut bus = guide.bus().unwrap();
        assert_eq!(guide.left_by_jog(&mut bus, 0), None);
        let as_found = guide.record.drives[0].was.clone();
        assert!(as_found.iter().any(|(index, ..)| *index == 0x6085));
        for place in 0..as_found.len() {
            let (index, subindex, _) = as_found[place];
            let object = ObjectAddress::new(index, subindex).to_string();
            let is_of_jog = at_start::JOG_WRITES.contains(&(index, subindex));
            guide.record.drives[0].was.remove(place);
            let unknown = guide.left_by_jog(&mut bus, 0);
            let expected = is_of_jog.then_some(true);
            assert_eq!(
                unknown.map(|words| words.starts_with(&format!("{object} is "))),
                expected,
                "{object}"
            );
            guide.record.drives[0].was.insert(place, (index, subindex, vec![0x7F; 4]));
            let other = guide.left_by_jog(&mut bus, 0).unwrap();
            assert!(
                other.starts_with(&format!("{object} is ")) && other.contains(" before it was"),
                "{other}"
            );
            guide.record.drives[0].was = as_found.clone();
        }
    });
}
