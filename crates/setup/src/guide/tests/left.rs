//! What jogs left in drives, and what of it is put back.

use super::*;

/// The program was killed in a jog and all drives are found again: what a jog left in them isn't taken for what was there before.
#[test]
fn what_was_there_before_the_first_jog_is_remembered_where_drives_are_found_again() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let max_torque = |record: &Record| {
        let of =
            |drive: &FoundDrive| drive.was.iter().find(|(index, ..)| *index == at_start::MAX_TORQUE).cloned();
        record.drives.iter().map(|drive| of(drive).map(|(.., bytes)| bytes)).collect::<Vec<_>>()
    };
    let as_found = vec![Some(3000_u16.to_le_bytes().to_vec()); 3];
    let mut kept = String::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        assert_eq!(max_torque(&guide.record), as_found);
        kept = guide.record.to_json();
    });
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        assert_eq!(max_torque(&guide.record), vec![None; 3], "without the record nobody knows it any more");
    });
    with_record(BASE, Record::from_json(&kept).unwrap(), &mut open, &mut Nobody, |guide| {
        guide.record.done.clear();
        assert!(guide.find().unwrap());
        assert_eq!((max_torque(&guide.record), guide.record.jogged.len()), (as_found.clone(), 0));
        guide.operational().unwrap();
        // Another drive in the place of one that was jogged isn't touched, and the set-up knows that one is left.
        let serial = std::mem::replace(&mut guide.record.drives[2].serial, 99);
        guide.leave_as_found();
        let words = guide.record.findings.join("\n");
        assert!(words.contains("SubDevice 2 isn't the drive that was jogged"), "{words}");
        assert_eq!(guide.record.jogged.len(), 1, "the others have what they held");
        guide.record.drives[2].serial = serial;
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        assert!(guide.find().unwrap());
        assert_eq!(max_torque(&guide.record), as_found, "as the drives have it now");
    });
}

/// Left in order, then one was set by the maker's tool, and the file got a parameter more: both are as somebody had them in the end.
#[test]
fn what_was_set_while_the_set_up_was_left_is_what_is_put_back() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        record = guide.record.clone();
    });
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    by_tool(&link, &clock).sdo_write(1, torque, &2000_u16.to_le_bytes()).unwrap();
    let more = "parameters = [{ object = \"6065\", type = \"u32\", value = 77 }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let window = ObjectAddress::new(0x6065, 0);
    let before = by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap();
    with_record(&base, record, &mut open, &mut Nobody, |guide| {
        guide.compare().unwrap();
        guide.operational().unwrap();
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
    });
    assert_eq!(max_torques(&link, &clock), [3000, 2000, 3000]);
    assert_eq!(by_tool(&link, &clock).sdo_read(1, window, SdoAccess::Entry).unwrap(), before);
}

/// What an earlier jog left in a drive isn't taken for its own where it is looked at again.
#[test]
fn what_a_jog_left_is_not_seen_again() {
    let drive = |was: &[(u16, u16)]| FoundDrive {
        was: was.iter().map(|(index, value)| (*index, 0, value.to_le_bytes().to_vec())).collect(),
        ..FoundDrive::default()
    };
    let mut now = drive(&[(at_start::MAX_TORQUE, 100), (0x6065, 7), (0x6085, 9)]);
    let mut was = drive(&[(0x6085, 8)]);
    before::see_again(&[drive(&[(0x6085, 8)])], &mut was, &mut now);
    assert_eq!(was, drive(&[(0x6085, 8), (0x6065, 7)]), "0x6072 was none that anybody knows");
    let mut now = drive(&[(at_start::MAX_TORQUE, 100)]);
    let mut was = drive(&[(at_start::MAX_TORQUE, 3000)]);
    let known = [was.clone()];
    before::see_again(&known, &mut was, &mut now);
    assert_eq!(was, drive(&[(at_start::MAX_TORQUE, 3000)]));
}

/// Nobody knows what a drive's max torque was before it was jogged: what the jog left there isn't stored for ever.
#[test]
fn what_a_jog_left_in_a_drive_is_not_stored() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    // As whoever mapped it left it at its end.
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    by_tool(&link, &clock).sdo_write(0, torque, &[0, 0]).unwrap();
    with_found(BASE, &mut open, &mut Says("store"), |guide| {
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
        }
        guide.operational().unwrap();
        assert!(guide.parameters().unwrap());
        let Record { findings, log, .. } = &guide.record;
        let stored: Vec<&String> = log.iter().filter(|line| line.contains(": stored (0x1010)")).collect();
        assert_eq!(stored, ["wheel_2: stored (0x1010)", "wheel_3: stored (0x1010)"], "{findings:?}");
        assert!(findings.join("\n").contains("wheel_1: not stored: 6072:00 is "), "{findings:?}");
    });
}

/// A file that has drives store what they hold at each start has them store nothing while a jog's torque may be there.
#[test]
fn what_the_file_has_drives_store_is_not_asked_for_by_a_jog() {
    let more = "parameters = [{ object = \"1010.1\", type = \"u32\", value = 1_702_257_011 }, ";
    let base = BASE.replacen("parameters = [", more, 1);
    let plan = robot_file::plan(&base, &Registry::with_built_in()).unwrap();
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = omnibase_ethercat_sim::in_process(segment);
        Ok((Box::new(link), clock))
    };
    with_found(&base, &mut open, &mut Says("write"), |guide| {
        let at_start = at_start::AtStart::of_drive(&guide.plan, &guide.plan.bus, &guide.record.drives[0]);
        let objects: Vec<u16> = at_start.objects().map(|(index, _)| index).collect();
        assert!(objects.contains(&0x6085) && !objects.contains(&at_start::STORE), "{objects:x?}");
        for drive in &mut guide.record.drives {
            drive.wheel = Some(format!("wheel_{}", drive.position + 1));
        }
        assert!(guide.parameters().unwrap());
        let of_store: Vec<&String> = guide.record.log.iter().filter(|line| line.contains("1010")).collect();
        assert!(
            of_store.len() == 3 && of_store.iter().all(|line| line.contains("can't be compared and stored"))
        );
    });
}

/// A drive that took a jogged one's place before all were found again is remembered, too; the one that is gone isn't forgotten.
#[test]
fn a_drive_in_the_place_of_a_jogged_one_is_remembered_and_that_one_is_told() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let gone = FoundDrive { serial: 12_345, position: 2, ..FoundDrive::default() };
    let record = Record { jogged: vec![gone.clone()], ..Record::default() };
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        assert!(guide.find().unwrap());
        guide.operational().unwrap();
        assert_eq!(guide.record.jogged.len(), 4);
        guide.operational().unwrap();
        assert_eq!(guide.record.jogged.len(), 4, "once each");
        guide.leave_as_found();
        let words = guide.record.findings.join("\n");
        assert!(words.contains("serial 12345 was jogged and isn't among the drives"), "{words}");
        assert_eq!(guide.record.jogged, [gone], "the others have what they held");
        // What nobody knows isn't put back, so it stays remembered.
        guide.operational().unwrap();
        guide.record.jogged.remove(0);
        let was = guide.record.drives[0].was.clone();
        guide.record.drives[0].was.retain(|(index, ..)| *index != at_start::MAX_TORQUE);
        guide.leave_as_found();
        assert!(guide.record.findings.join("\n").contains("SubDevice 0: not all that it held before"));
        assert_eq!(guide.record.jogged.len(), 1);
        guide.record.drives[0].was = was;
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
        // What somebody had written is what is put back.
        let drive = guide.record.drives[1].clone();
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        guide.keep_wished(&drive, torque, &[0xD0, 0x07]);
        let of = |drive: &FoundDrive| {
            drive.was.iter().find(|(index, ..)| *index == at_start::MAX_TORQUE).unwrap().2.clone()
        };
        let torques: Vec<Vec<u8>> = guide.record.drives.iter().map(of).collect();
        assert_eq!(torques, [vec![0xB8, 0x0B], vec![0xD0, 0x07], vec![0xB8, 0x0B]]);
    });
}

/// Its alias is written after its first jog: it is the same drive all the same.
#[test]
fn what_a_drive_was_before_is_remembered_where_it_got_an_alias_since() {
    let drive = |alias, torque: u16| FoundDrive {
        alias,
        was: vec![(at_start::MAX_TORQUE, 0, torque.to_le_bytes().to_vec())],
        ..FoundDrive::default()
    };
    let mut named = drive(Some(77), 100);
    assert!(before::recall(&[drive(None, 3000)], &mut named).is_empty());
    assert_eq!(named, drive(Some(77), 3000));
    // Where one of them has it, the others aren't meant.
    let mut named = drive(Some(77), 100);
    assert!(before::recall(&[drive(None, 2500), drive(Some(77), 3000)], &mut named).is_empty());
    assert_eq!(named, drive(Some(77), 3000));
}

/// Of drives that look alike and were different before nobody knows whose is whose: it is told, and nothing is written.
#[test]
fn what_drives_that_look_alike_were_before_is_not_guessed() {
    let drive = |torques: [u8; 2]| FoundDrive {
        was: vec![(at_start::MAX_TORQUE, 0, torques.to_vec()), (0x6060, 0, vec![3])],
        ..FoundDrive::default()
    };
    let jogged = [drive([0xB8, 0x0B]), drive([0xC4, 0x09])];
    let mut of_jog = FoundDrive {
        was: vec![(at_start::MAX_TORQUE, 0, vec![100, 0]), (0x6060, 0, vec![9])],
        ..FoundDrive::default()
    };
    let words = before::recall(&jogged, &mut of_jog);
    assert_eq!(words.len(), 1);
    assert!(words[0].contains("was 3000 or 2500 before it was jogged"), "{words:?}");
    assert_eq!(of_jog.was, [(0x6060, 0, vec![3])]);
    let mut as_found = drive([0xC4, 0x09]);
    assert!(before::recall(&jogged, &mut as_found).is_empty());
    assert_eq!(as_found, drive([0xC4, 0x09]));
}

/// Drives that look alike and held different torques; the program was killed in a jog, and whoever takes it up again doesn't know
/// whether they were swapped: nothing is written into the wrong one until somebody says that they weren't.
#[test]
fn what_was_in_drives_that_look_alike_is_put_back_once_their_places_are_known() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    let as_found = [1100_u16, 1200, 1300];
    let mut bus = by_tool(&link, &clock);
    for (position, value) in (0..).zip(as_found) {
        bus.sdo_write(position, torque, &value.to_le_bytes()).unwrap();
    }
    drop(bus);
    let mut kept = String::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        guide.record.done = vec![Step::Find];
        kept = guide.record.to_json();
    });
    let left = max_torques(&link, &clock);
    assert!(left.iter().zip(as_found).all(|(left, was)| *left != was), "{left:?}");
    // Asked where they are, he leaves.
    with_record(
        BASE,
        Record::from_json(&kept).unwrap(),
        &mut open,
        &mut Says("nothing that is asked"),
        |guide| {
            assert_eq!(guide.run().unwrap(), Ended::Left(None));
            let words = guide.record.findings.join("\n");
            assert!(words.contains("SubDevice 0: nobody said that it is where it was"), "{words}");
            assert_eq!(guide.record.jogged.len(), 3);
        },
    );
    assert_eq!(max_torques(&link, &clock), left);
    with_record(BASE, Record::from_json(&kept).unwrap(), &mut open, &mut Says("as before"), |guide| {
        guide.compare().unwrap();
        assert!(guide.are_in_their_places().unwrap());
        guide.leave_as_found();
        assert_eq!(guide.record.jogged, []);
    });
    assert_eq!(max_torques(&link, &clock), as_found);
}

/// Of drives that look alike one is gone when the set-up is begun anew: the others get back what they held, and that one isn't forgotten.
#[test]
fn one_that_is_gone_of_those_that_look_alike_stays_remembered() {
    use omnibase_ethercat_sim::Fault;
    let (link, clock, injector) = faulty_segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let as_found = max_torques(&link, &clock);
    let mut jogged = Vec::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        jogged = guide.record.jogged.clone();
    });
    injector.inject(2, Fault::PowerOff);
    let record = Record { jogged, ..Record::default() };
    with_record(BASE, record, &mut open, &mut Says("same"), |guide| {
        assert!(matches!(guide.run(), Err(SetupError::TooFewDrives { wheels: 3, drives: 2 })));
        let words: Vec<&String> =
            guide.record.findings.iter().filter(|words| words.contains("isn't among the drives")).collect();
        assert_eq!(words.len(), 1, "{:?}", guide.record.findings);
        assert_eq!(guide.record.jogged.len(), 3);
    });
    let mut bus = by_tool(&link, &clock);
    for (position, was) in (0..2).zip(as_found) {
        let now = bus.sdo_read(position, ObjectAddress::new(at_start::MAX_TORQUE, 0), SdoAccess::Entry);
        assert_eq!(now.unwrap(), was.to_le_bytes());
    }
}

/// A drive that was jogged is replaced for good: what it held is remembered until somebody has it forgotten, and never told again then.
/// Those that are there have back what they held before anybody is asked.
#[test]
fn a_drive_that_is_gone_is_told_until_somebody_has_it_forgotten() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let gone = FoundDrive { serial: 12_345, position: 2, ..FoundDrive::default() };
    let mut record = Record { jogged: vec![gone.clone()], ..Record::default() };
    with_record(BASE, record.clone(), &mut open, &mut Nobody, |guide| {
        assert!(guide.find().unwrap());
        // Killed in a jog.
        guide.operational().unwrap();
        record.jogged = guide.record.jogged.clone();
    });
    assert_ne!(max_torques(&link, &clock), [3000; 3]);
    let is_told = |texts: &[String]| texts.iter().any(|words| words.contains("serial 12345 was jogged"));
    for (hand, is_kept) in
        [(&mut Nobody as &mut dyn Hand, true), (&mut Says("remember"), true), (&mut Says("forget"), false)]
    {
        record.log.clear();
        with_record(BASE, record.clone(), &mut open, hand, |guide| {
            assert_eq!(guide.run().unwrap(), Ended::Left(None));
            let Record { jogged, log, findings, .. } = &guide.record;
            assert_eq!(*jogged, if is_kept { vec![gone.clone()] } else { Vec::new() });
            let by_wish: Vec<&String> =
                log.iter().filter(|line| line.starts_with("forgotten, as was said: ")).collect();
            assert_eq!(by_wish.len(), usize::from(!is_kept), "{log:?}");
            assert!(is_told(log) && findings.len() == usize::from(is_kept), "{findings:?}");
            record = guide.record.clone();
        });
        assert_eq!(max_torques(&link, &clock), [3000; 3]);
    }
    record.log.clear();
    with_record(BASE, record, &mut open, &mut Nobody, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert!(!is_told(&guide.record.log), "{:?}", guide.record.log);
    });
}

/// Nobody knows what each of drives that look alike held, and the maker's tool set them: once that is said, what they hold is their own.
#[test]
fn what_the_makers_tool_set_is_a_drives_own_once_somebody_says_so() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut jogged = Vec::new();
    with_found(BASE, &mut open, &mut Nobody, |guide| {
        guide.operational().unwrap();
        jogged = guide.record.jogged.clone();
    });
    for (drive, torque) in jogged.iter_mut().zip([1100_u16, 1200, 1300]) {
        drive.was.iter_mut().find(|was| was.0 == at_start::MAX_TORQUE).unwrap().2 =
            torque.to_le_bytes().to_vec();
    }
    let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
    let mut bus = by_tool(&link, &clock);
    for (position, value) in (0..).zip([1900_u16, 2000, 2100]) {
        bus.sdo_write(position, torque, &value.to_le_bytes()).unwrap();
    }
    drop(bus);
    let record = Record { jogged, ..Record::default() };
    with_record(BASE, record, &mut open, &mut Says("forget"), |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert_eq!(guide.record.jogged, []);
    });
    assert_eq!(max_torques(&link, &clock), [1900, 2000, 2100]);
}

/// Cheap drives have one serial number, all of them: each keeps what it held, and gets that of none of the others.
#[test]
fn drives_with_one_serial_number_keep_what_each_held() {
    for aliases in [[0, 0, 0], [1, 2, 3]] {
        let table = |alias: u16| match alias {
            0 => "[[subdevice]]\nkind = \"servo\"\nserial = 7\n".to_owned(),
            alias => format!("[[subdevice]]\nkind = \"servo\"\nserial = 7\nalias = {alias}\n"),
        };
        let (link, clock) = segment_of(&aliases.map(table).concat());
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        let torque = ObjectAddress::new(at_start::MAX_TORQUE, 0);
        let as_found = [3000_u16, 2500, 2500];
        for (position, value) in (0..).zip(as_found) {
            by_tool(&link, &clock).sdo_write(position, torque, &value.to_le_bytes()).unwrap();
        }
        let mut record = Record::default();
        with_found(BASE, &mut open, &mut Nobody, |guide| {
            guide.operational().unwrap();
            guide.record.done = vec![Step::Find];
            record = guide.record.clone();
        });
        let left = max_torques(&link, &clock);
        assert!(left.iter().zip(as_found).all(|(left, was)| *left != was), "{left:?}");
        assert_eq!(record.jogged.len(), 3);
        assert!(record.jogged.iter().all(|one| one.has_twins));
        // Begun anew, and left at the first question after that for the robot.
        let anew = Record { jogged: record.jogged.clone(), robot: record.robot.clone(), ..Record::default() };
        with_record(BASE, anew, &mut open, &mut Says("same"), |guide| {
            assert!(matches!(guide.run(), Ok(Ended::Left(_))));
            assert_eq!(guide.record.jogged.is_empty(), aliases[0] != 0, "{:?}", guide.record.findings);
        });
        let expected = if aliases[0] == 0 { left } else { as_found.to_vec() };
        assert_eq!(max_torques(&link, &clock), expected, "{aliases:?}");
        // It is asked whether this is that robot.
        let anew = Record { jogged: record.jogged.clone(), ..Record::default() };
        with_record(BASE, anew, &mut open, &mut Says("another"), |guide| {
            assert!(matches!(guide.run(), Err(SetupError::OtherJogged)));
        });
        // Taken up where it was left, each in its place.
        with_record(BASE, record.clone(), &mut open, &mut Says("as before"), |guide| {
            guide.compare().unwrap();
            assert!(guide.are_in_their_places().unwrap());
            guide.leave_as_found();
            assert_eq!(guide.record.jogged, []);
        });
        assert_eq!(max_torques(&link, &clock), as_found, "{aliases:?}");
    }
    // One alone has its number for itself, until another came that has it, too.
    let drive = |position, value: u8| FoundDrive {
        position,
        serial: 7,
        was: vec![(1, 0, vec![value])],
        ..FoundDrive::default()
    };
    let mut record = Record { drives: vec![drive(0, 1)], ..Record::default() };
    assert!(before::remember(&mut record) && !record.jogged[0].has_twins);
    record.drives = vec![drive(0, 1), drive(1, 2)];
    assert!(before::remember(&mut record) && record.jogged.len() == 2 && record.jogged[1].has_twins);
    // The one that is left isn't taken for both.
    record.drives = vec![drive(0, 3)];
    assert!(before::remember(&mut record));
    assert_eq!(record.jogged.len(), 3);
}
