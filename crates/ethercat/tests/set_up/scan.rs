//! Finding SubDevices on the simulated bus.

use crate::segment::{obedient, recorded_sii};
use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::{EscConfig, Segment, in_process};

#[test]
fn a_line_of_recorded_devices_is_found_and_named() {
    let names = ["ek1100-sii.bin", "el2828-sii.bin", "el2889-sii.bin", "akd-sii.bin"];
    let Some(images) = names.map(recorded_sii).into_iter().collect::<Option<Vec<_>>>() else { return };
    let devices = images.iter().map(|sii| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
    let (link, clock) = in_process(Segment::line(devices.collect()).unwrap());
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    let found: Vec<_> = bus.scan().unwrap().iter().map(|one| (one.name.clone(), one.parent)).collect();
    println!("{found:?} after {:?}", clock.now());
    assert_eq!(bus.warnings(), []);
    assert_eq!(bus.read_sii(3).unwrap(), images[3]);
}

#[test]
fn an_empty_segment_says_why() {
    let (link, clock) = in_process(Segment::line(vec![]).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    let error = bus.scan().unwrap_err();
    println!("{error}");
    assert!(matches!(error, SetUpError::NoSubDevices(_)));
}

#[test]
fn a_thousand_subdevices_are_found() {
    let Some(sii) = recorded_sii("el2828-sii.bin") else { return };
    let devices = (0..1000).map(|_| obedient(EscConfig { sii: sii.clone(), ..EscConfig::default() }));
    let (link, clock) = in_process(Segment::line(devices.collect()).unwrap());
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    assert_eq!(bus.scan().unwrap().len(), 1000);
    println!("scanned at {:?}", clock.now());
    bus.configure(&[]).unwrap();
    println!("PRE-OP at {:?}", clock.now());
    assert!(clock.now() < HostTime(60_000_000_000));
    println!("{:?}", bus.transactor().counters);
}
