//! The mailbox: counter, repeat, refusals, emergencies.

use crate::rig::{FIRST, Rig, SERVO};
use omnibase_ethercat_sim::Fault;
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_sim::pdi::ApplicationFault;

/// CoE: upload of the device type.
const DEVICE_TYPE: [u8; 10] = [0, 0x20, 0x40, 0x00, 0x10, 0, 0, 0, 0, 0];

fn rig() -> Rig {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_pre_op(FIRST);
    rig
}

fn has_mail(rig: &mut Rig) -> bool {
    rig.read(FIRST, 0x080D, 1)[0] & 8 != 0
}

#[test]
fn answers_count_from_1_to_7() {
    let mut rig = rig();
    for expected in [1, 2, 3, 4, 5, 6, 7, 1, 2] {
        rig.post(FIRST, 3, &DEVICE_TYPE);
        let (protocol, counter, data) = rig.fetch(FIRST).unwrap();
        assert_eq!((protocol, counter), (3, expected));
        assert_eq!(data[..10], [0, 0x30, 0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0x00]);
    }
}

#[test]
fn a_request_with_the_counter_of_the_last_is_the_last_one_again() {
    let mut rig = rig();
    let mut area = vec![0; 256];
    area[0] = 10;
    area[5] = 0x53;
    area[6..16].copy_from_slice(&DEVICE_TYPE);
    rig.post_area(FIRST, &area);
    assert!(rig.fetch(FIRST).is_some());
    rig.post_area(FIRST, &area);
    assert_eq!(rig.fetch(FIRST), None);
    area[5] = 0x03;
    for _ in 0..2 {
        rig.post_area(FIRST, &area);
        assert!(rig.fetch(FIRST).is_some(), "no counter, no repetition");
    }
}

#[test]
fn a_lost_answer_comes_again_on_request() {
    let mut rig = rig();
    for round in 0..4u8 {
        rig.post(FIRST, 3, &DEVICE_TYPE);
        let first = rig.fetch(FIRST).unwrap();
        assert!(!has_mail(&mut rig));
        let toggle = if round % 2 == 0 { 3 } else { 1 };
        rig.write(FIRST, 0x080E, &[toggle]);
        rig.wait_us(10);
        assert_eq!(rig.read(FIRST, 0x080F, 1)[0] & 2, toggle & 2, "acknowledged");
        assert_eq!(rig.fetch(FIRST), Some(first), "the same with the same counter");
    }
}

#[test]
fn a_repeat_goes_before_what_came_after() {
    let mut rig = rig();
    rig.post(FIRST, 3, &DEVICE_TYPE);
    let first = rig.fetch(FIRST).unwrap();
    rig.post(FIRST, 2, &[1, 2, 3, 4]);
    rig.wait_us(100);
    assert!(has_mail(&mut rig));
    rig.write(FIRST, 0x080E, &[3]);
    rig.wait_us(10);
    assert_eq!(rig.fetch(FIRST), Some(first));
    let (protocol, counter, _) = rig.fetch(FIRST).unwrap();
    assert_eq!((protocol, counter), (0, 2), "then the later one, with its own counter");
}

/// The answer to the repeat is lost, too: the MainDevice asks once more while it lies there unread.
#[test]
fn a_repeat_that_is_asked_twice_loses_nothing() {
    let mut rig = rig();
    rig.post(FIRST, 3, &DEVICE_TYPE);
    let first = rig.fetch(FIRST).unwrap();
    rig.post(FIRST, 2, &[1, 2, 3, 4]);
    rig.wait_us(100);
    for toggle in [3, 1, 3] {
        rig.write(FIRST, 0x080E, &[toggle]);
        rig.wait_us(10);
        assert_eq!(rig.read(FIRST, 0x080F, 1)[0] & 2, toggle & 2, "acknowledged");
    }
    assert_eq!(rig.fetch(FIRST), Some(first));
    let (protocol, counter, _) = rig.fetch(FIRST).unwrap();
    assert_eq!((protocol, counter), (0, 2), "then the later one, with its own counter");
}

#[test]
fn what_the_device_does_not_speak_is_refused() {
    let mut rig = rig();
    let mut refused = |protocol, data: &[u8]| {
        rig.post(FIRST, protocol, data);
        let (protocol, _, data) = rig.fetch(FIRST).unwrap();
        assert_eq!((protocol, &data[..2]), (0, &[1, 0][..]));
        u16::from_le_bytes([data[2], data[3]])
    };
    assert_eq!(refused(4, &[0; 12]), 6, "no FoE message");
    for protocol in [1, 2, 5, 15, 7] {
        assert_eq!(refused(protocol, &[0; 12]), 2, "protocol {protocol}");
    }
    assert_eq!(refused(3, &[0, 0x50, 0, 0]), 4, "a CoE service that a server doesn't have");
    assert_eq!(refused(3, &[0, 0x20, 0x40, 0]), 6, "half an SDO request");
    assert_eq!(refused(3, &[0]), 6, "half a CoE header");
    assert_eq!(refused(3, &[]), 6, "nothing");
    assert_eq!(refused(3, &[0, 0x80, 1, 0, 0, 0]), 6, "a list request without its kind");
    let mut area = vec![0; 256];
    area[0..2].copy_from_slice(&251u16.to_le_bytes());
    area[5] = 0x03;
    rig.post_area(FIRST, &area);
    assert_eq!(rig.fetch(FIRST).unwrap().2, [1, 0, 1, 0], "longer than the mailbox");
}

#[test]
fn requests_wait_while_answers_do() {
    let mut rig = rig();
    let mut taken = 0;
    let mut area = vec![0; 256];
    area[0] = 10;
    area[6..16].copy_from_slice(&DEVICE_TYPE);
    for _ in 0..20 {
        area[5] = 0x03;
        if rig
            .send(
                omnibase_ethercat_wire::Command::Fpwr,
                omnibase_ethercat_wire::Address::station(FIRST, 0x1000),
                &area,
            )
            .1
            == 0
        {
            break;
        }
        taken += 1;
    }
    assert!((4..10).contains(&taken), "{taken} requests were taken");
    for number in 0..taken {
        assert!(rig.fetch(FIRST).is_some(), "answer {number}");
    }
    assert_eq!(rig.fetch(FIRST), None);
    rig.post(FIRST, 3, &DEVICE_TYPE);
    assert!(rig.fetch(FIRST).is_some());
}

#[test]
fn a_drive_fault_sends_an_emergency() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    rig.segment.inject(0, Fault::Application(ApplicationFault::DriveFault(0x3210))).unwrap();
    let (service, data) = rig.answer(FIRST);
    assert_eq!((service, &data[..8]), (1, &[0x10, 0x32, 0x01, 0, 0, 0, 0, 0][..]));
    assert_eq!(rig.upload(FIRST, (0x603F, 0)), Ok(0x3210));
    assert_eq!(rig.upload(FIRST, (0x1001, 0)), Ok(1));
    // The fault reset says so too.
    for control in [0x00, 0x80] {
        let mut outputs = [0; 16];
        outputs[0] = control;
        rig.outputs(FIRST, &outputs);
        rig.wait_us(1000);
    }
    assert_eq!(rig.answer(FIRST), (1, vec![0; 8]));
    assert_eq!(rig.upload(FIRST, (0x603F, 0)), Ok(0));
}

#[test]
fn a_silent_mailbox_takes_requests_and_says_nothing() {
    let mut rig = rig();
    rig.segment.inject(0, Fault::Application(ApplicationFault::MailboxSilence(true))).unwrap();
    rig.post(FIRST, 3, &DEVICE_TYPE);
    assert_eq!(rig.fetch(FIRST), None);
    rig.segment.inject(0, Fault::Application(ApplicationFault::MailboxSilence(false))).unwrap();
    rig.post(FIRST, 3, &DEVICE_TYPE);
    assert!(rig.fetch(FIRST).is_some());
}

#[test]
fn init_empties_the_mailbox() {
    let mut rig = rig();
    for _ in 0..3 {
        rig.post(FIRST, 3, &DEVICE_TYPE);
    }
    assert_eq!(rig.request(FIRST, 1), (1, 0));
    rig.write(FIRST, 0x0806, &[0]);
    rig.write(FIRST, 0x080E, &[0]);
    rig.bring_to_pre_op(FIRST);
    assert_eq!(rig.fetch(FIRST), None);
}
