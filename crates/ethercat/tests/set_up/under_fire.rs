//! One datagram of the start-up is spoiled, each in turn: the outcome is the right one or a named error, and it
//! comes in time.

use std::time::Duration;

use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::fault_link::{FaultAction, FaultLink, Injection, Target};
use omnibase_ethercat_sim::{EscConfig, Segment, in_process};

use crate::segment::{obedient, recorded_sii};

/// What happens to the chosen datagram: its frame is lost before or after the SubDevices saw it, or its working
/// counter comes back as 0 without or although they took part.
const ACTIONS: [FaultAction; 4] = [
    FaultAction::DropRequest,
    FaultAction::DropAnswer,
    FaultAction::NotProcessed,
    FaultAction::WorkingCounter(0),
];
/// Registers that the set-up programs, and that don't change by themselves.
const PROGRAMMED: [(u16, usize); 9] = [
    (0x0010, 2),
    (0x0101, 1),
    (0x0400, 2),
    (0x0410, 2),
    (0x0420, 2),
    (0x0600, 0x80),
    (0x0800, 0x40),
    (0x0928, 4),
    (0x0934, 2),
];

/// How a start-up ended.
struct Outcome {
    /// What must be the same whatever was spoiled: what is known, and what stands in the registers.
    result: Result<Vec<String>, SetUpError>,
    datagrams: u64,
    at: HostTime,
}

fn start_up(segment: Segment, injection: Option<Injection>) -> Outcome {
    let (link, clock) = in_process(segment);
    let mut link = FaultLink::new(link, 0);
    if let Some(injection) = injection {
        link.inject(injection);
    }
    let mut bus = Bus::new(&mut link, clock.clone(), BusOptions::default());
    let result = bus.scan().map(drop).and_then(|()| bus.configure(&[])).map(|()| {
        let known = bus.subdevices().iter().map(|one| {
            let (place, name) = ((one.position, one.station_address, one.parent), &one.name);
            let delay_ns = one.dc.map(|dc| dc.delay_ns);
            format!("{place:?} {name} {:?} {:?} {delay_ns:?}", one.sync_managers, one.fmmus)
        });
        known.collect::<Vec<_>>()
    });
    drop(bus);
    let result = result.map(|mut table| {
        for subdevice in link.inner().segment().sub_devices() {
            let registers = PROGRAMMED.map(|(start, length)| subdevice.esc().peek(start, length));
            table.push(format!("{registers:02x?}"));
        }
        table
    });
    Outcome { result, datagrams: link.counts().datagrams, at: clock.now() }
}

/// Spoils each datagram in each way; one spoiled datagram is no reason to fail, for everything is tried again.
fn fire(make: impl Fn() -> Segment) {
    let Outcome { result, datagrams, at } = start_up(make(), None);
    let right = result.unwrap();
    let limit = at + Duration::from_secs(2);
    for action in ACTIONS {
        for number in 0..datagrams {
            let injection = Injection { target: Target::Datagram(number), action };
            let Outcome { result, at, .. } = start_up(make(), Some(injection));
            assert!(at < limit, "{injection:?}: took until {at:?}");
            let table = result.unwrap_or_else(|error| panic!("{injection:?}: {error}"));
            assert_eq!(table, right, "{injection:?}: wrong success");
        }
    }
    println!("{datagrams} datagrams, each spoiled in {} ways", ACTIONS.len());
}

#[test]
fn terminals() {
    let names = ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin"];
    let Some(images) = names.map(recorded_sii).into_iter().collect::<Option<Vec<_>>>() else { return };
    fire(|| {
        let devices =
            images.iter().map(|sii| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
        Segment::line(devices.collect()).unwrap()
    });
}

/// When every frame is lost or miscounted from some datagram on, a named error comes in time.
#[test]
fn a_segment_that_dies_during_start_up_ends_as_a_named_error() {
    let make = || Segment::line((0..3).map(|_| obedient(EscConfig::default())).collect()).unwrap();
    let datagrams = start_up(make(), None).datagrams;
    for action in [FaultAction::DropAnswer, FaultAction::WorkingCounter(0)] {
        for first in 0..datagrams {
            let (link, clock) = in_process(make());
            let mut link = FaultLink::new(link, 0);
            (first..first + 200).for_each(|n| link.inject(Injection { target: Target::Datagram(n), action }));
            let mut bus = Bus::new(&mut link, clock.clone(), BusOptions::default());
            let result = bus.scan().map(drop).and_then(|()| bus.configure(&[]));
            let error = result.expect_err("everything behind the datagram failed");
            assert!(!error.to_string().is_empty());
            assert!(clock.now() < HostTime(10_000_000_000), "{first}: took until {:?}", clock.now());
        }
    }
}
