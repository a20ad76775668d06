//! Who of the drives turns no wheel is never jogged: the file's devices, and those of whom somebody says so.

use omnibase_robot::config::BusPlace;

use super::*;

const LIFT: &str = include_str!("../../../../../robots/bmm_lift.toml");

fn positions(record: &Record) -> Vec<u16> {
    record.drives.iter().map(|drive| drive.position).collect()
}

/// 0x6072 and 0x6060 of one drive.
fn max_torque_and_mode(link: &Powered, clock: &VirtualClock, position: u16) -> [Vec<u8>; 2] {
    let mut bus = by_tool(link, clock);
    [at_start::MAX_TORQUE, 0x6060]
        .map(|index| bus.sdo_read(position, ObjectAddress::new(index, 0), SdoAccess::Entry).unwrap())
}

/// The lift of the file has the product of its wheels' drives: it is told, nothing of a jog is written into it, and the file has it as it
/// was.
#[test]
fn a_lift_of_the_file_is_no_wheel() {
    let (link, clock) = drives_of(LIFT);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let before = max_torque_and_mode(&link, &clock, 4);
    let mut hand = Notes::new(|_| None);
    with_found(LIFT, &mut open, &mut hand, |guide| {
        assert_eq!(positions(&guide.record), [1, 2, 3]);
        let others = guide.record.others.iter().map(|one| (one.position, one.name.clone().unwrap()));
        assert_eq!(others.collect::<Vec<_>>(), [(0, "buttons".to_owned()), (4, "lift".to_owned())]);
        let operational = guide.operational().unwrap();
        assert_eq!(operational.maps.len(), 3);
        drop(operational);
        assert_eq!(max_torque_and_mode(&link, &clock, 4), before);
        assert_ne!(max_torque_and_mode(&link, &clock, 3), before);
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
            drive.wheel = Some(wheel.to_owned());
        }
        let plan = robot_file::plan(&guide.text().unwrap(), &Registry::with_built_in()).unwrap();
        let devices: Vec<_> = plan.devices.iter().map(|one| (one.name.as_str(), one.place)).collect();
        assert_eq!(devices, [("buttons", BusPlace::Position(0)), ("lift", BusPlace::Position(4))]);
    });
    let told = "SubDevice 4 is `lift` of the file, an axis: not turned here";
    assert!(hand.told.iter().any(|text| text == told), "{:?}", hand.told);
}

/// Jogged by a file that doesn't have the lift, and killed there: the lift is turned no more, its wheel has no drive, and nothing is
/// written into it.
#[test]
fn a_lift_that_was_seen_to_turn_a_wheel_turns_no_more() {
    let (link, clock) = drives_of(LIFT);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut record = Record::default();
    let mut document: toml_edit::DocumentMut = LIFT.parse().unwrap();
    let devices = document["device"].as_array_of_tables_mut().unwrap();
    devices.retain(|device| device["name"].as_str() != Some("lift"));
    with_found(&document.to_string(), &mut open, &mut Says("wheel"), |guide| {
        guide.record.robot = Some(guide.robot());
        guide.operational().unwrap();
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3", "wheel_3"])
        {
            drive.wheel = Some(wheel.to_owned());
        }
        guide.record.drives[2].wheel = None;
        guide.record.done = vec![Step::Find, Step::Jog, Step::Name];
        record = guide.record.clone();
    });
    let left = max_torque_and_mode(&link, &clock, 4);
    let mut hand = Notes::new(|id| (id == "jogged").then_some("go on"));
    with_record(LIFT, record, &mut open, &mut hand, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert_eq!((positions(&guide.record), &guide.record.done), (vec![1, 2, 3], &vec![Step::Find]));
        let words = guide.record.findings.join("\n");
        assert!(words.contains("SubDevice 4 was seen to turn wheel_3, and is `lift` of the file"), "{words}");
        assert!(
            words.contains("gone on though SubDevices 1, 2, 3, 4 weren't switched off and on"),
            "{words}"
        );
    });
    assert_eq!(max_torque_and_mode(&link, &clock, 4), left);
    let turned: Vec<&String> = hand.keys.iter().filter(|words| words.contains(" turns")).collect();
    assert!(turned.len() == 1 && turned[0].contains("SubDevice 3 turns"), "{:?}", hand.keys);
}

/// What the file says of devices' places is compared with who is there before anything turns.
#[test]
fn devices_that_are_not_where_the_file_has_them_are_told_before_anything_turns() {
    let (link, clock) = drives_of(BASE);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let identity = robot_file::plan(BASE, &Registry::with_built_in()).unwrap().drives[0].identity;
    let product = format!("vendor_id = \"0x{:X}\"\nproduct_code = ", identity.vendor_id.unwrap());
    let wheels = format!("{product}\"0x{:X}\"", identity.product_code.unwrap());
    for (place, numbers, expected) in [
        ("position = 7", "", "`one` is at position 7 in the file, the bus has SubDevices 0 to 2"),
        (
            "alias = 40",
            wheels.as_str(),
            "`one` is at alias 40 in the file, and nobody has that; its product is that of SubDevice 0, 1, 2.",
        ),
        ("identification = 3", "", "`one` is at identification 3 in the file, and nobody has that."),
        (
            "position = 0",
            "vendor_id = \"0x2\"\nproduct_code = \"0x3\"",
            "at position 0 in the file (vendor 0x00000002 product 0x00000003), and there is vendor 0x",
        ),
        (
            "position = 0",
            "revision = \"0x4D\"",
            "at position 0 in the file (revision 0x0000004d), and there is vendor 0x",
        ),
        // Whatever it may be, it is the file's: two are left for three wheels.
        ("position = 0", "", "the file has 3 wheels, on the bus are 2 drives"),
    ] {
        let base = BASE.replacen("position = 0", "position = 9", 1);
        let base = format!("{base}\n[[device]]\nname = \"one\"\nkind = \"ignore\"\n{place}\n{numbers}\n");
        let mut hand = Notes::new(|_| None);
        with_record(&base, Record::default(), &mut open, &mut hand, |guide| {
            let error = guide.run().unwrap_err().to_string();
            assert!(error.contains(expected), "{place} {numbers}: {error}");
            assert!(!guide.record.done.contains(&Step::Find));
        });
        assert_eq!((hand.keys, hand.asked), (Vec::<String>::new(), Vec::<String>::new()), "{place}");
    }
    // Of a hot-connect group that isn't there nothing is missing.
    let group = "[[device]]\nname = \"one\"\nkind = \"ignore\"\nalias = 40\ngroup = \"tool\"\n";
    with_found(&format!("{BASE}\n{group}"), &mut open, &mut Nobody, |guide| {
        assert!(guide.record.others.is_empty());
    });
}

/// With a drive too many nobody but whoever stands there knows which is no wheel's: it is asked before anything is enabled, and nothing said
/// chooses nothing.
#[test]
fn with_more_drives_than_wheels_it_is_asked_who_turns_none() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 4\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    for silent in [None, Some("")] {
        let mut hand = Notes::new(|_| silent);
        with_record(BASE, Record::default(), &mut open, &mut hand, |guide| {
            assert_eq!(guide.run().unwrap(), Ended::Left(None));
            assert!(guide.record.done.is_empty());
        });
        assert!(hand.asked.iter().all(|id| id == "role 0") && hand.keys.is_empty(), "{:?}", hand.keys);
    }
    let mut hand = Notes::new(|id| match id {
        "role 1" => Some("no wheel"),
        "places" => Some("as before"),
        id => id.starts_with("role").then_some("wheel"),
    });
    with_record(BASE, Record::default(), &mut open, &mut hand, |guide| {
        assert_eq!(guide.run().unwrap(), Ended::Left(None));
        assert_eq!((positions(&guide.record), &guide.record.done), (vec![0, 2, 3], &vec![Step::Find]));
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
            drive.wheel = Some(wheel.to_owned());
        }
        let plan = robot_file::plan(&guide.text().unwrap(), &Registry::with_built_in()).unwrap();
        let devices: Vec<_> = plan.devices.iter().map(|one| (one.kind.as_str(), one.place)).collect();
        assert_eq!(devices, [("ignore", BusPlace::Position(1))]);
        // Taken up again nobody is asked.
        assert!(guide.is_as_it_was().unwrap());
    });
    // Once one is no wheel's, as many are left as there are wheels.
    assert_eq!(hand.asked, ["role 0", "role 1", "places"]);
    assert_eq!(hand.keys.len(), 1, "the first wheel's jog: {:?}", hand.keys);
}

/// One of another product than the file's wheels have, where not all are alike, may be a lift though there are as many as wheels.
#[test]
fn one_of_another_product_is_asked_for() {
    let tables = "[[subdevice]]\nkind = \"sgdv\"\ncount = 2\n[[subdevice]]\nkind = \"servo\"\n";
    let (link, clock) = segment_of(tables);
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut hand = Notes::new(|_| Some("no wheel"));
    with_record(BASE, Record::default(), &mut open, &mut hand, |guide| {
        assert!(matches!(guide.run(), Err(SetupError::TooFewDrives { wheels: 3, drives: 2 })));
    });
    assert_eq!((hand.asked.as_slice(), hand.keys.as_slice()), (&["role 2".to_owned()][..], &[][..]));
}

/// Who is left over when each wheel has its drive isn't turned.
#[test]
fn who_is_left_over_is_not_jogged() {
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> { panic!("nothing is opened") };
    let wheels = [None, Some("wheel_1"), Some("wheel_2"), Some("wheel_3")];
    let drives = (0..).zip(wheels).map(|(position, wheel)| FoundDrive {
        position,
        wheel: wheel.map(str::to_owned),
        ..FoundDrive::default()
    });
    let record = Record { drives: drives.collect(), ..Record::default() };
    with_record(BASE, record, &mut open, &mut Nobody, |guide| assert!(guide.jog_all().unwrap()));
}

/// A lift that looks like a wheel's drive may have been plugged in its place while the set-up was left.
#[test]
fn a_wheel_that_looks_like_the_lift_is_asked_for_its_place() {
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> { panic!("nothing is opened") };
    let drive = FoundDrive { product_code: 5, wheel: Some("wheel_1".to_owned()), ..FoundDrive::default() };
    let lift = |serial| crate::FoundDevice { position: 4, product_code: 5, serial, ..Default::default() };
    for (serial, asked) in [(0, vec!["places".to_owned()]), (9, Vec::new())] {
        let record = Record { drives: vec![drive.clone()], others: vec![lift(serial)], ..Record::default() };
        let mut hand = Notes::new(|_| None);
        with_record(BASE, record, &mut open, &mut hand, |guide| {
            assert_eq!(guide.are_in_their_places().unwrap(), serial != 0);
        });
        assert_eq!(hand.asked, asked);
    }
}

/// Whom no table has would be named by its place, and that shifts with a hot-connect group: told before anything moves.
#[test]
fn who_is_in_no_table_has_an_alias_where_there_is_a_hot_connect_group() {
    let base =
        format!("{BASE}\n[[device]]\nname = \"arm\"\nalias = 77\nkind = \"ignore\"\ngroup = \"arm\"\n");
    let servos = "[[subdevice]]\nkind = \"servo\"\ncount = 3\n";
    let io = |alias: &str| format!("[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n{alias}");
    let arm = io("alias = 77\n");
    for (tables, is_told) in [
        (format!("{arm}{servos}{}", io("")), true),
        (format!("{arm}{servos}{}", io("alias = 9\n")), false),
        // Another has it, too, or may be plugged in.
        (format!("{arm}{servos}{0}{0}", io("alias = 9\n")), true),
        (format!("{arm}{servos}{arm}"), true),
        // In front of the group, or where it isn't plugged in, a position is as good.
        (format!("{}{arm}{servos}", io("")), false),
        (format!("{servos}{0}{0}", io("alias = 9\n")), false),
    ] {
        let (link, clock) = segment_of(&tables);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        with_record(&base, Record::default(), &mut open, &mut Nobody, |guide| match guide.find() {
            Ok(is_found) => assert!(is_found && !is_told, "{tables}"),
            Err(error) => assert!(is_told && matches!(error, SetupError::Devices(_)), "{tables}: {error}"),
        });
    }
}

/// Behind a hot-connect group no place is kept that a start of the robot refuses: what drives are found by is asked again.
#[test]
fn a_drive_behind_a_hot_connect_group_is_not_found_by_its_position() {
    let group = "[[device]]\nname = \"arm\"\nalias = 77\nkind = \"ignore\"\ngroup = \"arm\"\n";
    let io = |alias: u16| format!("[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\nalias = {alias}\n");
    let servos = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\n";
    let base = format!("{BASE}\n{group}");
    for (tables, is_kept) in [
        (format!("{}{servos}", io(77)), false),
        // One more that is always there: no position is too great.
        (format!("{}{servos}{}", io(77), io(78)), false),
        (format!("{servos}{}", io(77)), true),
    ] {
        let (link, clock) = segment_of(&tables);
        let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
            Ok((Box::new(link.clone()), clock.clone()))
        };
        // Each wheel once, then it is left.
        let mut answers = 3;
        let mut hand = Notes::new(|_| {
            answers -= 1;
            (answers >= 0).then_some("position")
        });
        with_found(&base, &mut open, &mut hand, |guide| {
            for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
                drive.wheel = Some(wheel.to_owned());
            }
            assert_eq!(guide.name_all().unwrap(), is_kept, "{tables}");
        });
        let refused =
            hand.told.iter().filter(|text| text.starts_with("a robot's file by that wouldn't start"));
        assert_eq!(refused.count(), usize::from(!is_kept), "{:?}", hand.told);
    }
}

/// Who was named by its place in the file that comes of it isn't left out of it without a word.
#[test]
fn a_subdevice_that_is_gone_when_the_set_up_is_taken_up_is_asked_for() {
    let servos = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\nserial = 1\n";
    let io = "[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n";
    let with_io = format!("{servos}{io}");
    let mut record = Record::default();
    let opened = |tables: &str| -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (link, clock) = segment_of(tables);
        Ok((Box::new(link), clock))
    };
    with_found(BASE, &mut || opened(&with_io), &mut Nobody, |guide| {
        guide.record.done = vec![Step::Find];
        record = guide.record.clone();
    });
    let is_back = std::cell::Cell::new(false);
    for (said, goes_on, others) in [(None, false, 1), (Some("gone"), true, 0), (Some("there"), true, 1)] {
        let mut hand = Notes::new(|_| {
            is_back.set(said == Some("there"));
            said
        });
        let mut open = || opened(if is_back.get() { &with_io } else { servos });
        with_record(BASE, record.clone(), &mut open, &mut hand, |guide| {
            assert_eq!(guide.is_as_it_was().unwrap(), goes_on, "{said:?}");
            assert_eq!(guide.record.others.len(), others, "{said:?}");
        });
        assert_eq!(hand.asked, ["gone 3"]);
    }
}

/// Who turns no wheel, for each has another, may get an alias while the set-up is left; while wheels have none it may be another one.
#[test]
fn who_is_left_over_may_get_an_alias() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"sgdv\"\nalias = 11\ncount = 4\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    with_found(BASE, &mut open, &mut Says("wheel"), |guide| {
        guide.record.drives[3].alias = None;
        assert!(matches!(guide.compare(), Err(SetupError::Changed { position: 3, .. })));
        for (drive, wheel) in guide.record.drives.iter_mut().zip(["wheel_1", "wheel_2", "wheel_3"]) {
            drive.wheel = Some(wheel.to_owned());
        }
        guide.compare().unwrap();
        assert_eq!(guide.record.drives[3].alias, Some(14));
        guide.record.drives[0].alias = None;
        assert!(matches!(guide.compare(), Err(SetupError::Changed { position: 0, .. })));
    });
}

/// The file's wheels have an SGDV, on the bus are other servos: that is told with what and where, and asked once.
#[test]
fn drives_that_no_wheel_of_the_file_has_are_asked_about() {
    let (link, clock) = segment_of("[[subdevice]]\nkind = \"servo\"\ncount = 3\n");
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Ok((Box::new(link.clone()), clock.clone())) };
    let mut goes_on = false;
    let mut hand = Notes::new(|_| std::mem::replace(&mut goes_on, true).then_some("go on"));
    let (mut keep, mut back_up) = (|_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
    let outside =
        Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(Wished::new(BASE.to_owned()), Record::default(), &mut open, outside).unwrap();
    assert!(!guide.find().unwrap(), "it is left");
    assert_eq!(guide.record.drives, []);
    for _ in 0..2 {
        assert!(guide.find().unwrap());
        assert_eq!(guide.record.drives.len(), 3);
    }
    let findings = guide.record.findings.join("\n");
    assert!(
        findings.contains("SubDevice 2 is vendor 0x00000f0f product 0x00000402, and no wheel"),
        "{findings}"
    );
    drop(guide);
    assert_eq!(hand.asked, ["products", "products"]);
    for part in [
        "the file's wheels have `sgdv` (vendor 0x00000539 product 0x02200001), and on the bus are SubDevice 0 (",
        "SubDevice 2 (CiA402-Servo): vendor 0x00000f0f product 0x00000402",
    ] {
        assert!(hand.texts[0].contains(part), "{}", hand.texts[0]);
    }
}
