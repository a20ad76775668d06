//! One datagram of the start-up is spoiled, each in turn: the outcome is the right one or a named error, and it
//! comes in time.

use std::fmt::Debug;
use std::time::Duration;

use crate::sabotage::{Sabotage, SabotagedLink};
use crate::segment::{obedient, recorded_sii};
use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::{EscConfig, Segment, SimLink, VirtualClock, in_process};

/// What must be the same whatever was spoiled.
type Table = Vec<String>;

fn start_up(
    segment: (SimLink, VirtualClock),
    sabotage: Sabotage,
    victim: u64,
) -> (Result<Table, SetUpError>, u64, HostTime) {
    let (link, clock) = segment;
    let mut link = SabotagedLink::new(link, sabotage, victim);
    let mut bus = Bus::new(&mut link, clock.clone(), BusOptions::default());
    let result = bus.scan().map(drop).and_then(|()| bus.configure(&[])).map(|()| table(&bus));
    drop(bus);
    (result, link.seen(), clock.now())
}

fn table<L, C>(bus: &Bus<L, C>) -> Table
where
    Bus<L, C>: Debug,
    L: omnibase_ethercat::wire::Link,
    C: Clock,
{
    bus.subdevices()
        .iter()
        .map(|one| {
            format!(
                "{} {:04x} {} {:?} {:?} {:?} {:?}",
                one.position,
                one.station_address,
                one.name,
                one.parent,
                one.sync_managers,
                one.fmmus,
                one.dc.map(|dc| dc.delay_ns)
            )
        })
        .collect()
}

fn fire(make: impl Fn() -> (SimLink, VirtualClock)) {
    let (right, datagrams, took) = start_up(make(), Sabotage::LostOut, u64::MAX);
    let right = right.unwrap();
    let mut errors = Vec::new();
    for sabotage in Sabotage::ALL {
        for victim in 0..datagrams {
            let (result, _, now) = start_up(make(), sabotage, victim);
            let case = format!("{sabotage:?} of datagram {victim}");
            assert!(now < took + Duration::from_secs(30), "{case} took until {now:?}");
            match result {
                Ok(table) => assert_eq!(table, right, "{case}: wrong success"),
                Err(error) => errors.push(format!("{case}: {error}")),
            }
        }
    }
    println!("{datagrams} datagrams, {} cases, {} named errors", datagrams * 4, errors.len());
    errors.iter().for_each(|error| println!("{error}"));
    // One spoiled datagram is no reason to fail: everything is tried again.
    assert_eq!(errors, Vec::<String>::new());
}

#[test]
fn terminals() {
    let names = ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin"];
    let Some(images) = names.map(recorded_sii).into_iter().collect::<Option<Vec<_>>>() else { return };
    fire(|| {
        let devices =
            images.iter().map(|sii| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
        in_process(Segment::line(devices.collect()).unwrap())
    });
}
