//! Each command of the protocol, at the level of bytes.

use crate::bench::{Bench, fmmu, idle};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// BRD of register 0 as a capture shows it, shorter than Ethernet's minimum.
const BRD: [u8; 29] = [
    0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x10, 0x6f, 0x6d, 0x6e, 0x69, 0x01, 0x88, 0xa4, 0x0d, 0x10, 0x07,
    0x2a, 0x00, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
];

#[test]
fn a_short_broadcast_read_comes_back_counted_marked_and_as_long_as_it_was() {
    let mut bench = Bench::line(3);
    let mut frame = BRD.to_vec();
    let back = bench.segment.process(&mut frame, HostTime(50_000_000)).unwrap();
    let mut expected = BRD.to_vec();
    expected[6] |= 0x02; // source address: passed a SubDevice
    expected[18] = 3; // ADP: three passed
    expected[26] = 0x11; // ESC type
    expected[27] = 3; // working counter
    assert_eq!(frame, expected);
    // 72 byte times of 80 ns, 6 cable passes of 100 ns, 5 chip crossings of 300 ns.
    assert_eq!(back, HostTime(50_000_000 + 72 * 80 + 6 * 100 + 5 * 300));
}

#[test]
fn slack_behind_the_datagrams_comes_back_untouched() {
    let mut bench = Bench::line(1);
    let mut frame = BRD.to_vec();
    frame.resize(200, 0xA5);
    bench.segment.process(&mut frame, HostTime(50_000_000)).unwrap();
    assert_eq!((frame.len(), frame[27]), (200, 1));
    assert!(frame[29..].iter().all(|byte| *byte == 0xA5));
}

#[test]
fn foreign_and_malformed_frames_are_destroyed_and_the_malformed_counted() {
    let mut bench = Bench::line(1);
    let mut foreign = BRD.to_vec();
    (foreign[12], foreign[13]) = (0x08, 0x00);
    assert_eq!(bench.segment.process(&mut foreign, HostTime(50_000_000)), None);
    let mut long = BRD.to_vec();
    long[22] = 9;
    assert_eq!(bench.segment.process(&mut long, HostTime(50_000_000)), None);
    bench.now = HostTime(60_000_000);
    assert_eq!(bench.number_at(0x1001, reg::PROCESSING_ERROR_COUNTER, 1), 1);
}

#[test]
fn position_addressing_reaches_one_and_increments_in_all() {
    let mut bench = Bench::line(3);
    let write = bench.send(Command::Apwr, Address::position(1, 0x0F80), &[7, 8]);
    assert_eq!((write.counter, write.adp), (1, 2));
    let read = bench.send(Command::Aprd, Address::position(1, 0x0F80), &[0, 0]);
    assert_eq!((read.counter, read.data), (1, vec![7, 8]));
    let read = bench.send(Command::Aprd, Address::position(2, 0x0F80), &[0, 0]);
    assert_eq!((read.counter, read.data), (1, vec![0, 0]));
    let both = bench.send(Command::Aprw, Address::position(1, 0x0F80), &[1, 2]);
    assert_eq!((both.counter, both.data), (3, vec![7, 8]));
    assert_eq!(bench.send(Command::Aprd, Address::position(3, 0x0F80), &[0]).counter, 0);
}

#[test]
fn station_addressing_reaches_station_and_enabled_alias() {
    let mut bench = Bench::line(2);
    assert_eq!(bench.fpwr(0x1002, 0x0F80, &[0x77]), 1);
    let both = bench.send(Command::Fprw, Address::station(0x1002, 0x0F80), &[0x88]);
    assert_eq!((both.counter, both.data[0], both.adp), (3, 0x77, 0x1002));
    assert_eq!(bench.fprd(0x1002, 0x0F80, 1), Some(vec![0x88]));
    assert_eq!(bench.fprd(0x1003, 0x0F80, 1), None);

    // The alias comes from the SII, and answers only while DL control bit 24 is set.
    let mut sii = vec![0; 128];
    sii[8..10].copy_from_slice(&0x0ABCu16.to_le_bytes());
    sii[14] = omnibase_ethercat_wire::sii::checksum(sii.first_chunk().unwrap());
    let mut bench = Bench::single(EscConfig { sii, ..EscConfig::default() }, idle());
    assert_eq!(bench.number_at(0x1001, reg::STATION_ALIAS, 2), 0x0ABC);
    assert_eq!(bench.fprd(0x0ABC, 0x0000, 1), None);
    assert_eq!(bench.fpwr(0x1001, reg::DL_CONTROL_ALIAS, &[1]), 1);
    assert_eq!(bench.fprd(0x0ABC, 0x0000, 1), Some(vec![0x11]));
}

#[test]
fn broadcasts_or_what_they_read_and_count_everyone() {
    let mut bench = Bench::line(3);
    for (station, value) in [(0x1001, 0x01), (0x1002, 0x10), (0x1003, 0x80)] {
        bench.fpwr(station, 0x0F80, &[value]);
    }
    let read = bench.send(Command::Brd, Address::broadcast(0x0F80), &[0x02]);
    assert_eq!((read.data[0], read.counter, read.adp), (0x93, 3, 3));
    let write = bench.send(Command::Bwr, Address::broadcast(0x0F81), &[0x55]);
    assert_eq!((write.counter, write.adp), (3, 3));
    let both = bench.send(Command::Brw, Address::broadcast(0x0F80), &[0x00]);
    assert_eq!((both.data[0], both.counter), (0x91, 9));
    let long = bench.send(Command::Brd, Address::broadcast(0x0F80), &[0; 100]);
    // The first SubDevice was written 0x00, the second got 0x01, the third 0x11: BRW carries the ORed data on.
    assert_eq!((long.data[0], long.data[1], long.counter), (0x11, 0x55, 3));
}

#[test]
fn multiple_writes_read_one_and_write_the_others() {
    let mut bench = Bench::line(3);
    bench.fpwr(0x1002, 0x0F80, &[0x42]);
    let frmw = bench.send(Command::Frmw, Address::station(0x1002, 0x0F80), &[0x11]);
    // The one before it gets what the frame carried then, the one behind it what was read.
    assert_eq!((frmw.counter, frmw.data[0]), (3, 0x42));
    assert_eq!(bench.fprd(0x1001, 0x0F80, 1), Some(vec![0x11]));
    assert_eq!(bench.fprd(0x1003, 0x0F80, 1), Some(vec![0x42]));
    let armw = bench.send(Command::Armw, Address::position(0, 0x0F80), &[0]);
    assert_eq!((armw.counter, armw.data[0], armw.adp), (3, 0x11, 3));
    assert_eq!(bench.fprd(0x1003, 0x0F80, 1), Some(vec![0x11]));
}

#[test]
fn nop_and_unknown_commands_change_nothing() {
    let mut bench = Bench::line(1);
    let nop = bench.send(Command::Nop, Address::broadcast(0), &[9]);
    assert_eq!((nop.counter, nop.adp, nop.data[0]), (0, 0, 9));
    let mut unknown = BRD.to_vec();
    unknown[16] = 0x33;
    let mut expected = unknown.clone();
    expected[6] |= 0x02;
    bench.segment.process(&mut unknown, HostTime(50_000_000)).unwrap();
    assert_eq!(unknown, expected);
}

#[test]
fn chips_without_read_write_commands_pass_them_on_unchanged() {
    let config =
        EscConfig { features: reg::FEATURE_NO_LRW | reg::FEATURE_NO_READ_WRITE, ..EscConfig::default() };
    let mut bench = Bench::new(Segment::line(vec![SubDevice::new(config, idle())]).unwrap());
    bench.number(1);
    for (command, address) in [
        (Command::Aprw, Address::position(0, 0x0F80)),
        (Command::Fprw, Address::station(0x1001, 0x0F80)),
        (Command::Brw, Address::broadcast(0x0F80)),
    ] {
        let answer = bench.send(command, address, &[0x5A]);
        assert_eq!(
            (answer.counter, answer.adp, answer.data[0]),
            (0, address.raw() as u16, 0x5A),
            "{command}"
        );
    }
    bench.fpwr(0x1001, 0x0600, &fmmu(0x1_0000, 1, [0, 7], 0x0F80, 0, 3));
    let lrw = bench.send(Command::Lrw, Address::Logical(0x1_0000), &[0x5A]);
    assert_eq!((lrw.counter, lrw.data[0]), (0, 0x5A));
    assert_eq!(bench.send(Command::Lwr, Address::Logical(0x1_0000), &[0x5A]).counter, 1);
    assert_eq!(bench.send(Command::Lrd, Address::Logical(0x1_0000), &[0]).data, [0x5A]);
    assert_eq!(bench.fprd(0x1001, reg::FEATURES, 2), Some(vec![0x00, 0x06]));
}

#[test]
fn read_only_and_missing_registers_do_not_count() {
    let mut bench = Bench::single(
        EscConfig { fmmu_count: 3, sm_count: 4, ram_kib: 1, features: 0, ..EscConfig::default() },
        idle(),
    );
    for register in
        [reg::TYPE, reg::STATION_ALIAS, reg::DL_STATUS, reg::AL_STATUS, reg::AL_EVENT, 0x0805, 0x0807]
    {
        assert_eq!(bench.fpwr(0x1001, register, &[0xFF]), 0, "0x{register:04x}");
        assert!(bench.fprd(0x1001, register, 1).is_some(), "0x{register:04x}");
    }
    for register in [0x0630, 0x0820, 0x0900, 0x0910, 0x0981, 0x000A, 0x1400, 0xFFFF] {
        assert_eq!(bench.fprd(0x1001, register, 1), None, "0x{register:04x}");
        assert_eq!(bench.fpwr(0x1001, register, &[0xFF]), 0, "0x{register:04x}");
    }
    assert_eq!(bench.fprd(0x1001, 0x13FF, 1), Some(vec![0]));
    // A write that reaches past the last FMMU counts for what is there.
    assert_eq!(bench.fpwr(0x1001, reg::FMMU, &[0; 256]), 1);
}

#[test]
fn masked_ecat_events_are_ored_into_the_datagrams() {
    let mut bench = Bench::line(2);
    // DL status changed at power-on in both; only the second lets it through.
    assert_eq!(bench.send(Command::Nop, Address::broadcast(0), &[]).event, 0);
    assert_eq!(bench.fpwr(0x1002, reg::ECAT_EVENT_MASK, &[0x04, 0x00]), 1);
    assert_eq!(bench.send(Command::Nop, Address::broadcast(0), &[]).event, 4);
    assert_eq!(bench.number_at(0x1002, reg::ECAT_EVENT, 2), 4);
    // Reading DL status acknowledges.
    assert!(bench.fprd(0x1002, reg::DL_STATUS, 2).is_some());
    assert_eq!(bench.send(Command::Nop, Address::broadcast(0), &[]).event, 0);
}
