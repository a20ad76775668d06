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
    let outside =
        Outside { hand: &mut Nobody, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let wished = Wished::new(BASE.to_owned());
    let mut guide = Guide::new(wished, Record::default(), &mut open, outside).unwrap();
    assert!(guide.find().unwrap());
    let error = guide.operational().err().unwrap().to_string();
    assert!(error.contains("nothing is written into them: no space"), "{error}");
    drop(guide);
    assert_eq!(max_torques(&link, &clock), [3000; 3]);
}

/// The robot's file is written once it is on record what it shall be, and called done behind that.
#[test]
fn the_robots_file_is_there_before_it_is_called_done() {
    let events = RefCell::new(Vec::new());
    let mut keep = |record: &Record| {
        let is_done = record.done.contains(&Step::File);
        events.borrow_mut().push((record.to_be_written.clone(), record.written.clone(), is_done));
        Ok(())
    };
    let mut can_write = false;
    let mut write = |_: &Record, text: &str| {
        if !can_write {
            can_write = true;
            return Err("no space".to_owned());
        }
        events.borrow_mut().push((None, Some(format!("the file: {text}")), false));
        Ok(())
    };
    let mut open =
        || -> Result<(Box<dyn Link>, VirtualClock), String> { Err("nothing is opened".to_owned()) };
    let mut back_up = |_: u16, _: &[u8]| Ok(());
    let outside = Outside { hand: &mut Nobody, keep: &mut keep, back_up: &mut back_up, write: &mut write };
    let mut guide = Guide::new(Wished::new(BASE.to_owned()), Record::default(), &mut open, outside).unwrap();
    let refused = guide.write_file("a").unwrap_err().to_string();
    assert_eq!(refused, "the robot's file can't be written: no space");
    assert_eq!((&guide.record.to_be_written, &guide.record.written), (&None, &None));
    guide.write_file("b").unwrap();
    guide.finish(Step::File);
    drop(guide);
    let text = |text: &str| Some(text.to_owned());
    let expected = [
        (text("a"), None, false),
        (text("b"), None, false),
        (None, text("the file: b"), false),
        (None, text("b"), true),
    ];
    assert_eq!(events.into_inner(), expected);
}
