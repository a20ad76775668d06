//! One datagram of the start-up is spoiled, each in turn: the outcome is the right one or a named error, and it
//! comes in time.

use std::time::Duration;

use omnibase_ethercat::cyclic::Exchange;
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_sim::fault_link::{FaultAction, FaultLink, Injection, Target};
use omnibase_ethercat_sim::{EscConfig, Segment, in_process};

use crate::operational::{to_op, with_sync0};
use crate::segment::{drives, obedient, recorded_sii};

/// What happens to the chosen datagram: its frame is lost before or after the SubDevices saw it, or its working
/// counter comes back as 0 without or although they took part.
const ACTIONS: [FaultAction; 4] = [
    FaultAction::DropRequest,
    FaultAction::DropAnswer,
    FaultAction::NotProcessed,
    FaultAction::WorkingCounter(0),
];
/// Registers that the set-up programs, and that don't change by themselves.
const PROGRAMMED: [(u16, usize); 7] =
    [(0x0010, 2), (0x0101, 1), (0x0400, 2), (0x0410, 2), (0x0420, 2), (0x0600, 0x80), (0x0934, 2)];

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
            // Latches have a granularity of some ns.
            let delay_10_ns = one.dc.map(|dc| (dc.delay_ns + 5) / 10);
            format!("{place:?} {name} {:?} {:?} {delay_10_ns:?}", one.sync_managers, one.fmmus)
        });
        known.collect::<Vec<_>>()
    });
    drop(bus);
    let result = result.map(|mut table| {
        for subdevice in link.inner().segment().sub_devices() {
            let esc = subdevice.esc();
            let registers = PROGRAMMED.map(|(start, length)| esc.peek(start, length));
            table.push(format!("{registers:02x?}"));
            // Without status, and without the repeat bits that a lost mailbox message leaves behind.
            let managers = (0..8).map(|n| (esc.peek(0x0800 + 8 * n, 5), esc.peek(0x0806 + 8 * n, 1)));
            let managers = managers.map(|(set, activate)| (set, activate.map(|activate| activate[0] & 1)));
            table.push(format!("{:02x?}", managers.collect::<Vec<_>>()));
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
            let differing = table.iter().zip(&right).find(|(found, right)| found != right);
            assert_eq!(differing, None, "{injection:?}: wrong success (found, right)");
            assert_eq!(table.len(), right.len());
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

#[test]
fn servos() {
    fire(|| drives(DriveKind::Sgdv, 2));
}

fn quick_stop_deceleration() -> SdoWrite {
    SdoWrite {
        object: ObjectAddress::new(0x6085, 0),
        data: 1000_u32.to_le_bytes().to_vec(),
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: None,
    }
}

/// All the way to OP, SYNC0 and an SDO in SAFE-OP included; what is spoiled while cycling may end as a named error, but nothing else.
#[test]
fn servos_to_op() {
    let run = |injection: Option<Injection>| {
        let (link, clock) = in_process(drives(DriveKind::Sgdv, 2));
        let mut link = FaultLink::new(link, 0);
        if let Some(injection) = injection {
            link.inject(injection);
        }
        let configs = |found: &[SubDevice]| {
            let mut configs = with_sync0(found);
            configs.iter_mut().for_each(|config| config.safe_op_sdos.push(quick_stop_deceleration()));
            configs
        };
        let result = to_op(&mut link, clock.clone(), configs).map(|operational| {
            assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
            let devices = operational.paced.bus().link().inner().segment().sub_devices();
            let mut states = devices.iter().flat_map(|one| one.esc().peek(0x0130, 1));
            states.all(|state| state == [8])
        });
        (result, link.counts().datagrams, clock.now())
    };
    let (result, datagrams, at) = run(None);
    assert_eq!(result, Ok(true));
    let limit = at + Duration::from_secs(3);
    let mut errors = Vec::new();
    for action in ACTIONS {
        for number in 0..datagrams {
            let injection = Injection { target: Target::Datagram(number), action };
            let (result, _, at) = run(Some(injection));
            assert!(at < limit, "{injection:?}: took until {at:?}");
            match result {
                Ok(in_op) => assert!(in_op, "{injection:?}: wrong success"),
                Err(error) => {
                    assert_ne!(error, "hung", "{injection:?}");
                    errors.push(format!("{injection:?}: {error}"));
                }
            }
        }
    }
    println!(
        "{datagrams} datagrams to OP, each spoiled in {} ways, {} named errors",
        ACTIONS.len(),
        errors.len()
    );
    errors.iter().for_each(|error| println!("{error}"));
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
