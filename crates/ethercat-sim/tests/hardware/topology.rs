//! Cables, ports, loops, power, and what faults in them look like.

use crate::bench::{Bench, firmware, idle};
use core::time::Duration;
use omnibase_ethercat_sim::{
    Attachment, EscConfig, Fault, FaultError, Parent, Segment, SubDevice, TopologyError,
};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command};

fn chip() -> SubDevice {
    SubDevice::new(EscConfig::default(), idle())
}

fn on(position: usize, port: u8) -> Attachment {
    Attachment { parent: Parent::SubDevice { position, port }, entry_port: 0, cable_delay_ns: 100 }
}

const ROOT: Attachment = Attachment { parent: Parent::MainDevice, entry_port: 0, cable_delay_ns: 100 };

/// Position 0 with branches at port 3 (positions 1, 2), port 1 (3) and port 2 (4).
fn star() -> Bench {
    let attachments = vec![ROOT, on(0, 3), on(1, 1), on(0, 1), on(0, 2)];
    let mut bench = Bench::new(Segment::new((0..5).map(|_| chip()).collect(), attachments).unwrap());
    bench.number(5);
    bench
}

fn count(bench: &mut Bench) -> u16 {
    bench.send(Command::Brd, Address::broadcast(0), &[0]).counter
}

#[test]
fn dl_status_shows_links_and_closed_loops() {
    let mut bench = Bench::line(3);
    // No EEPROM here, so bit 0 is 0; the firmware is there, so bit 1 is 1. First: ports 0 and 1 linked and communicating, 2 and 3 closed.
    assert_eq!(bench.number_at(0x1001, reg::DL_STATUS, 2), 0x5A32);
    assert_eq!(bench.number_at(0x1003, reg::DL_STATUS, 2), 0x5612);
    let mut bench = star();
    assert_eq!(bench.number_at(0x1001, reg::DL_STATUS, 2), 0xAAF2);
}

#[test]
fn a_tree_is_passed_by_port_3_then_1_then_2() {
    let mut bench = star();
    assert_eq!(count(&mut bench), 5);
    // Positions are counted along the way of the frame: cut off the branch at port 3, and 3 becomes 1.
    bench.segment.inject(0, Fault::CableCut { port: 3 }).unwrap();
    assert_eq!(count(&mut bench), 3);
    let read = bench.send(Command::Aprd, Address::position(1, reg::STATION_ADDRESS), &[0, 0]);
    assert_eq!(read.data, [0x04, 0x10]);
}

#[test]
fn wrong_segments_are_refused_by_name() {
    let new = |attachments: Vec<Attachment>| {
        Segment::new((0..attachments.len()).map(|_| chip()).collect(), attachments).map(|_| ()).unwrap_err()
    };
    assert_eq!(
        Segment::new(vec![chip()], vec![]).unwrap_err(),
        TopologyError::Count { sub_devices: 1, attachments: 0 }
    );
    assert_eq!(new(vec![ROOT, on(0, 1), on(0, 3)]), TopologyError::Order { position: 1, found: 2 });
    assert_eq!(new(vec![ROOT, on(0, 1), on(0, 1)]), TopologyError::PortTaken { position: 0, port: 1 });
    assert_eq!(new(vec![ROOT, on(0, 0)]), TopologyError::PortTaken { position: 0, port: 0 });
    assert_eq!(new(vec![ROOT, on(0, 4)]), TopologyError::NoSuchPort { position: 0, port: 4 });
    assert_eq!(new(vec![ROOT, on(7, 1)]), TopologyError::NoSuchParent { position: 1, parent: 7 });
    assert_eq!(new(vec![ROOT, ROOT]), TopologyError::MainDeviceCable { found: 2 });
    assert_eq!(new(vec![on(1, 1), on(0, 1)]), TopologyError::MainDeviceCable { found: 0 });
    assert_eq!(new(vec![ROOT, on(2, 1), on(1, 1)]), TopologyError::Unreachable { position: 1 });
    let two_ports = EscConfig { port_descriptor: 0x0F, ..EscConfig::default() };
    let error =
        Segment::new(vec![SubDevice::new(two_ports, idle()), chip()], vec![ROOT, on(0, 3)]).unwrap_err();
    assert_eq!(error, TopologyError::NoSuchPort { position: 0, port: 3 });
}

#[test]
fn an_empty_segment_answers_nothing() {
    let mut bench = Bench::new(Segment::line(Vec::new()).unwrap());
    assert!(!bench.segment.link_up());
    assert_eq!(bench.try_send(Command::Brd, Address::broadcast(0), &[0]), None);
}

#[test]
fn a_cut_cable_turns_the_frame_back_and_both_ends_count_it() {
    let mut bench = Bench::line(3);
    bench.segment.inject(2, Fault::CableCut { port: 0 }).unwrap();
    assert_eq!(count(&mut bench), 2);
    assert_eq!(bench.number_at(0x1002, reg::DL_STATUS, 2), 0x5612);
    assert_eq!(bench.number_at(0x1002, reg::LOST_LINK_COUNTERS, 4), 0x0000_0100);
    assert_eq!(bench.segment.sub_devices()[2].esc().peek(reg::LOST_LINK_COUNTERS, 4).unwrap(), [1, 0, 0, 0]);
    bench.segment.inject(1, Fault::CableRestored { port: 1 }).unwrap();
    assert_eq!(count(&mut bench), 3);
    assert_eq!(bench.fpwr(0x1003, reg::LOST_LINK_COUNTERS + 3, &[9]), 1);
    assert_eq!(bench.number_at(0x1003, reg::LOST_LINK_COUNTERS, 4), 0, "a write clears them all");
    assert_eq!(
        bench.segment.inject(2, Fault::CableCut { port: 1 }),
        Err(FaultError::NoCable { position: 2, port: 1 })
    );
    assert_eq!(
        bench.segment.inject(9, Fault::PowerOff),
        Err(FaultError::NoSuchSubDevice { position: 9, count: 3 })
    );
    bench.segment.inject(0, Fault::CableCut { port: 0 }).unwrap();
    assert!(!bench.segment.link_up());
    assert_eq!(bench.try_send(Command::Brd, Address::broadcast(0), &[0]), None);
}

#[test]
fn a_link_alone_turns_the_frame_back_and_is_still_a_link() {
    let mut bench = Bench::line(3);
    bench.segment.inject(1, Fault::LinkAlone { port: 1 }).unwrap();
    assert_eq!(count(&mut bench), 2);
    assert_eq!(bench.number_at(0x1002, reg::DL_STATUS, 2), 0x5632);
    assert_eq!(bench.segment.sub_devices()[2].esc().peek(reg::DL_STATUS, 2).unwrap(), [0x12, 0x55]);
    assert_eq!(bench.number_at(0x1002, reg::LOST_LINK_COUNTERS, 4), 0, "no link was lost");
    bench.segment.inject(2, Fault::CableRestored { port: 0 }).unwrap();
    assert_eq!(count(&mut bench), 3);
    bench.segment.inject(0, Fault::LinkAlone { port: 0 }).unwrap();
    assert!(bench.segment.link_up());
    assert_eq!(bench.try_send(Command::Brd, Address::broadcast(0), &[0]), None);
}

#[test]
fn loop_control_opens_and_closes_ports() {
    let mut bench = Bench::line(2);
    // Port 1 of the first closed (3): the second is out of reach, though its link is up.
    assert_eq!(bench.fpwr(0x1001, reg::DL_CONTROL_PORTS, &[0x0C]), 1);
    assert_eq!(count(&mut bench), 1);
    assert_eq!(bench.number_at(0x1001, reg::DL_STATUS, 2), 0x5632);
    assert_eq!(bench.fpwr(0x1001, reg::DL_CONTROL_PORTS, &[0x00]), 1);
    assert_eq!(count(&mut bench), 2);
    // Port 1 of the second open (2) without a cable: frames leave and never come back.
    assert_eq!(bench.fpwr(0x1002, reg::DL_CONTROL_PORTS, &[0x08]), 1);
    assert_eq!(bench.try_send(Command::Brd, Address::broadcast(0), &[0]), None);
}

#[test]
fn auto_close_stays_closed_until_it_is_opened() {
    let mut bench = Bench::line(2);
    assert_eq!(bench.fpwr(0x1001, reg::DL_CONTROL_PORTS, &[0x04]), 1);
    assert_eq!(count(&mut bench), 2);
    bench.segment.inject(0, Fault::CableCut { port: 1 }).unwrap();
    bench.segment.inject(0, Fault::CableRestored { port: 1 }).unwrap();
    assert_eq!(count(&mut bench), 1);
    assert_eq!(bench.fpwr(0x1001, reg::DL_CONTROL_PORTS, &[0x04]), 1);
    assert_eq!(count(&mut bench), 2);
}

#[test]
fn a_reversed_last_sub_device_marks_frames_as_circulating_once() {
    let reversed = Attachment { entry_port: 1, ..on(0, 1) };
    let mut bench = Bench::new(Segment::new(vec![chip(), chip()], vec![ROOT, reversed]).unwrap());
    bench.number(2);
    let answer = bench.send(Command::Brd, Address::broadcast(0), &[0]);
    assert_eq!((answer.counter, answer.circulating), (2, true));
    assert_eq!(bench.number_at(0x1002, reg::DL_STATUS, 2), 0x5922);
    // A frame that is marked already is caught there.
    let mut frame = omnibase_ethercat_wire::frame::FrameBuilder::new();
    frame.push(Command::Brd, 1, Address::broadcast(0), &[0]).unwrap();
    frame.bytes_mut()[23] |= 0x40;
    let mut bytes = frame.bytes().to_vec();
    bench.wait_us(100);
    assert_eq!(bench.segment.process(&mut bytes, bench.now), None);
}

#[test]
fn power_off_closes_the_neighbours_and_power_on_starts_from_nothing() {
    let starts = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let log = starts.clone();
    let watched = SubDevice::new(
        EscConfig::default(),
        firmware(move |_, _, now| {
            log.lock().unwrap().push(now.0);
            None
        }),
    );
    let mut bench = Bench::new(Segment::line(vec![chip(), watched, chip()]).unwrap());
    bench.number(3);
    bench.segment.inject(1, Fault::PowerCycle { off_for: Duration::from_micros(300) }).unwrap();
    let off_at = bench.segment.now().0;
    assert_eq!(count(&mut bench), 1);
    bench.wait_us(279);
    assert_eq!(count(&mut bench), 1);
    assert_eq!(count(&mut bench), 3);
    assert_eq!(starts.lock().unwrap().last(), Some(&(off_at + 300_000)));
    assert_eq!(bench.fprd(0x1002, 0, 1), None, "its station address is gone");
    assert!(bench.fprd(0x1003, 0, 1).is_some());
    let station = bench.send(Command::Aprd, Address::position(1, reg::STATION_ADDRESS), &[1, 1]);
    assert_eq!((station.counter, station.data), (1, vec![0, 0]));
}

#[test]
fn damaged_frames_are_counted_where_they_arrive_and_act_no_further() {
    let mut bench = Bench::line(3);
    bench.segment.inject(1, Fault::CrcErrors { port: 0, frames: 1 }).unwrap();
    assert_eq!(bench.try_send(Command::Bwr, Address::broadcast(0x0F80), &[1]), None);
    assert_eq!(bench.fprd(0x1001, 0x0F80, 1), Some(vec![1]), "it passed the first undamaged");
    assert_eq!(bench.fprd(0x1002, 0x0F80, 1), Some(vec![0]));
    assert_eq!(bench.fprd(0x1003, 0x0F80, 1), Some(vec![0]));
    assert_eq!(bench.number_at(0x1002, reg::RX_ERROR_COUNTERS, 8), 0x0101);
    assert_eq!(bench.number_at(0x1002, reg::FORWARDED_ERROR_COUNTERS, 4), 0x0100, "and on its way back");
    assert_eq!(bench.number_at(0x1003, reg::FORWARDED_ERROR_COUNTERS, 4), 0x0001);
    assert_eq!(bench.number_at(0x1001, reg::FORWARDED_ERROR_COUNTERS, 4), 0x0100);
    // Damage on the way back: everything was done, the answer is lost.
    bench.segment.inject(0, Fault::CrcErrors { port: 1, frames: 2 }).unwrap();
    assert_eq!(bench.try_send(Command::Bwr, Address::broadcast(0x0F80), &[2]), None);
    assert_eq!(bench.try_send(Command::Bwr, Address::broadcast(0x0F81), &[2]), None);
    assert_eq!(bench.fprd(0x1003, 0x0F80, 2), Some(vec![2, 2]));
    assert_eq!(bench.number_at(0x1001, reg::RX_ERROR_COUNTERS, 8), 0x0202_0000);
    assert_eq!(bench.fpwr(0x1001, reg::RX_ERROR_COUNTERS + 5, &[0]), 1);
    assert_eq!(bench.number_at(0x1001, reg::RX_ERROR_COUNTERS, 8), 0);
}
