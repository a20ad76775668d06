//! What an SII says of its SyncManagers and its identification, and devices that hold themselves to it.

use omnibase_ethercat::config::{Match, WatchdogConfig};
use omnibase_ethercat::cyclic::Exchange;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::sii::{self, FmmuUsage, General, Image, Pdo, PdoEntry, SyncManagerUsage};
use omnibase_ethercat::wire::{Clock, HostTime, register};
use omnibase_ethercat::{Bus, BusOptions, Presence, SubDeviceConfig, Warning};
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::device::generic::Generic;
use omnibase_ethercat_sim::{Fault, Segment, in_process};

use crate::operational::{to_op, unconfigured};

/// A SyncManager with these flags.
fn manager(usage: SyncManagerUsage, start: u16, length: u16, enable: u8) -> sii::SyncManager {
    let control = if usage == SyncManagerUsage::Outputs { 0x64 } else { 0x20 };
    sii::SyncManager { start, length, control, status: 0, enable, usage }
}

fn pdo(index: u16, sync_manager: u8, bits: u8) -> Pdo {
    let object = ObjectAddress::new(if index < 0x1A00 { 0x7000 } else { 0x6000 }, sync_manager + 1);
    let entry = PdoEntry { object, name: 0, data_type: 0, bit_length: bits, flags: 0 };
    Pdo {
        index,
        sync_manager: Some(sync_manager),
        synchronization: 0,
        name: 0,
        flags: 0,
        entries: vec![entry],
    }
}

fn device(sync_managers: Vec<sii::SyncManager>, rx_pdos: Vec<Pdo>, tx_pdos: Vec<Pdo>) -> Generic {
    let mut image =
        Image { sync_managers, rx_pdos, tx_pdos, general: Some(General::default()), ..Image::default() };
    image.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs];
    image.header.checksum = u16::from(image.header.computed_checksum());
    Generic::from_sii(&image.emit(), &Piece::default()).unwrap()
}

fn activated(bus: &Segment, number: u16) -> u8 {
    bus.sub_devices()[0].esc().peek(register::SM + 8 * number + 6, 1).unwrap()[0] & 1
}

/// As many drives have it, outputs that trigger no watchdog: they would go on for ever when nobody says anything any more.
#[test]
fn outputs_trigger_the_watchdog_of_who_is_given_one_whatever_the_sii_says() {
    let mut outputs = manager(SyncManagerUsage::Outputs, 0x1000, 4, sii::SM_ENABLE);
    outputs.control = 0x24;
    for (process_data, control) in [(None, 0x24), (Some(0), 0x24), (Some(1000), 0x64)] {
        let generic = device(vec![outputs], vec![pdo(0x1600, 0, 32)], vec![]);
        let (link, clock) = in_process(Segment::line(vec![generic.sub_device]).unwrap());
        let watched = |_: &[_]| {
            let watchdogs = WatchdogConfig { process_data, ..WatchdogConfig::default() };
            vec![SubDeviceConfig { place: Some(Match::Position(0)), watchdogs, ..SubDeviceConfig::default() }]
        };
        let operational = to_op(link, clock, watched).unwrap();
        assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
        let bus = operational.paced.bus().link().segment();
        assert_eq!(bus.sub_devices()[0].esc().peek(register::SM + 4, 1), Some(&[control][..]));
    }
}

/// As an EL2262 has it: outputs, and a virtual SyncManager over the registers of the distributed clock.
#[test]
fn a_virtual_syncmanager_is_mapped_but_never_switched_on() {
    const OUTPUTS: SyncManagerUsage = SyncManagerUsage::Outputs;
    let managers = vec![
        manager(OUTPUTS, 0x1000, 4, sii::SM_ENABLE),
        manager(OUTPUTS, register::DC_START_TIME, 8, sii::SM_VIRTUAL),
    ];
    let generic = device(managers, vec![pdo(0x1600, 0, 32), pdo(0x1601, 1, 64)], vec![]);
    let (link, clock) = in_process(Segment::line(vec![generic.sub_device]).unwrap());
    let operational = to_op(link, clock, unconfigured).unwrap();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    assert_eq!(operational.paced.bus().plan().image().outputs.len(), 12);
    let segment = operational.paced.bus().link().segment();
    assert_eq!((activated(segment, 0), activated(segment, 1)), (1, 0));
    let physical: Vec<u16> = operational.subdevices[0].fmmus.iter().map(|fmmu| fmmu.physical_start).collect();
    assert_eq!(physical, [0x1000, register::DC_START_TIME]);
}

/// The device checks it: off before, on from OP on; and again when it lost power.
#[test]
fn a_syncmanager_for_op_alone_is_switched_on_between_safe_op_and_op() {
    let flags = sii::SM_ENABLE | sii::SM_OP_ONLY;
    let managers = vec![
        manager(SyncManagerUsage::Outputs, 0x1000, 4, flags),
        manager(SyncManagerUsage::Inputs, 0x1100, 4, sii::SM_ENABLE),
    ];
    let generic = device(managers, vec![pdo(0x1600, 0, 32)], vec![pdo(0x1A00, 1, 32)]);
    let (link, clock) = in_process(Segment::line(vec![generic.sub_device]).unwrap());
    let mut operational = to_op(link, clock.clone(), unconfigured).unwrap();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    assert_eq!(activated(operational.paced.bus().link().segment(), 0), 1);
    // SAFE-OP without outputs isn't waited for as for a fault.
    assert!(clock.now() < HostTime(1_000_000_000), "{:?}", clock.now());

    for fault in [Fault::PowerOff, Fault::PowerOn] {
        operational.paced.bus_mut().link_mut().segment_mut().inject(0, fault).unwrap();
    }
    let mut recovered = None;
    for cycle in 0..20_000 {
        if cycle == 20 {
            assert!(operational.paced.bus_mut().recover(0));
        }
        operational.paced.exchange(&mut operational.image).unwrap();
        recovered = operational.paced.bus_mut().poll_recovered();
        if recovered.is_some() {
            break;
        }
    }
    let (position, result) = recovered.expect("it comes back");
    assert_eq!((position, result.map(drop)), (0, Ok(())));
    operational.paced.exchange(&mut operational.image).unwrap();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);

    operational.paced.end(|paced| paced.exchange(&mut operational.image).map(drop)).unwrap();
    assert_eq!(activated(operational.paced.bus().link().segment(), 0), 0);
}

/// Every one of them: a device with more than four, too.
#[test]
fn six_syncmanagers_for_op_alone_are_all_switched_on_and_off_again() {
    let flags = sii::SM_ENABLE | sii::SM_OP_ONLY;
    let places = (0u8..6).map(|number| (number, 0x1000 + 0x100 * u16::from(number)));
    let managers = places.clone().map(|(_, start)| manager(SyncManagerUsage::Outputs, start, 4, flags));
    let pdos = places.map(|(number, _)| pdo(0x1600 + u16::from(number), number, 32)).collect();
    let generic = device(managers.collect(), pdos, vec![]);
    let (link, clock) = in_process(Segment::line(vec![generic.sub_device]).unwrap());
    let mut operational = to_op(link, clock, unconfigured).unwrap();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    let all = |bus: &Segment| [0, 1, 2, 3, 4, 5].map(|number| activated(bus, number));
    assert_eq!(all(operational.paced.bus().link().segment()), [1; 6]);
    operational.paced.end(|paced| paced.exchange(&mut operational.image).map(drop)).unwrap();
    assert_eq!(all(operational.paced.bus().link().segment()), [0; 6]);
}

#[test]
fn a_length_without_pdos_is_warned_of_and_cycled_as_the_device_expects_it() {
    let managers = vec![
        manager(SyncManagerUsage::Outputs, 0x1000, 200, sii::SM_ENABLE),
        manager(SyncManagerUsage::Inputs, 0x1800, 3, sii::SM_ENABLE),
    ];
    let segment = || Segment::line(vec![device(managers.clone(), vec![], vec![]).sub_device]).unwrap();
    let (link, clock) = in_process(segment());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let warning = |sync_manager, bytes| Warning::NoPdos { position: 0, sync_manager, bytes };
    assert_eq!(bus.warnings(), [warning(0, 200), warning(1, 3)]);
    let words = bus.warnings()[0].to_string();
    assert!(words.contains("the SII says 200 bytes"), "{words}");

    let (link, clock) = in_process(segment());
    let operational = to_op(link, clock, unconfigured).unwrap();
    assert_eq!(operational.paced.bus().last_exchange(), Exchange::Complete);
    assert_eq!(operational.paced.bus().plan().image().outputs.len(), 200);
}

#[test]
fn a_subdevice_is_found_by_its_identification_wherever_it_is() {
    let drive = Drive::new(DriveKind::Generic);
    let piece = |identification| Piece { identification, alias: 5, ..Piece::default() };
    let drives = [None, Some(11), Some(7)].map(|number| drive.build(&piece(number), Load::default()));
    let (link, clock) = in_process(Segment::line(drives.into()).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    let found: Vec<_> = bus.subdevices().iter().map(|one| one.identification).collect();
    assert_eq!(found, [None, Some(11), Some(7)]);
    let config = |place, name: &str| SubDeviceConfig {
        place: Some(place),
        name: Some(name.into()),
        ..SubDeviceConfig::default()
    };
    let wanted = [
        config(Match::Identification(7), "right"),
        config(Match::Identification(11), "left"),
        config(Match::Position(0), "first"),
    ];
    bus.configure(&wanted).unwrap();
    let names: Vec<_> = bus.subdevices().iter().map(|one| one.config.name.clone().unwrap()).collect();
    assert_eq!(names, ["first", "left", "right"]);
    let missing = [config(Match::Identification(8), "eight")];
    let words = bus.configure(&missing).unwrap_err().to_string();
    assert_eq!(words, "no SubDevice has identification 8 (eight), but there are 11, 7: look at its switch");
}

#[test]
fn lost_links_are_counted_from_the_start_of_a_set_up() {
    let drive = Drive::new(DriveKind::Generic);
    let drives = (0..2).map(|_| drive.build(&Piece::default(), Load::default())).collect();
    let mut segment = Segment::line(drives).unwrap();
    for fault in [Fault::CableCut { port: 1 }, Fault::CableRestored { port: 1 }] {
        segment.inject(0, fault).unwrap();
    }
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    let lost = |bus: &mut Bus<omnibase_ethercat_sim::SimLink, _>| {
        let esc = bus.transactor().link.segment().sub_devices()[0].esc();
        esc.peek(register::LOST_LINK_COUNTERS, 4).unwrap().to_vec()
    };
    assert_eq!(lost(&mut bus), [0, 1, 0, 0]);
    bus.scan().unwrap();
    assert_eq!(lost(&mut bus), [0; 4]);
}

#[test]
fn the_segments_time_is_the_hosts_since_2000_where_it_is_known() {
    const EPOCH_NS: u64 = 850_000_000_000_000_000;
    struct Dated(omnibase_ethercat_sim::VirtualClock);
    impl Clock for Dated {
        fn now(&self) -> HostTime {
            self.0.now()
        }
        fn since_2000_ns(&self) -> Option<u64> {
            Some(EPOCH_NS)
        }
        fn sleep_until(&mut self, instant: HostTime) {
            self.0.sleep_until(instant);
        }
    }
    let drive = Drive::new(DriveKind::Generic);
    let (link, clock) =
        in_process(Segment::line(vec![drive.build(&Piece::default(), Load::default())]).unwrap());
    let mut bus = Bus::new(link, Dated(clock.clone()), BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let now = clock.now();
    let shown = bus.transactor().link.segment().sub_devices()[0].esc().system_time(now).unwrap();
    assert!(shown.0.abs_diff(EPOCH_NS + now.0) < 100_000, "{shown:?} at {now:?}");
}

/// Where the clock has a chance, two starts of the same segment, each behind a power-on, give other addresses, whatever the date.
#[test]
fn another_start_of_a_segment_gives_other_addresses() {
    struct Chancy(omnibase_ethercat_sim::VirtualClock, u64);
    impl Clock for Chancy {
        fn now(&self) -> HostTime {
            self.0.now()
        }
        fn sleep_until(&mut self, instant: HostTime) {
            self.0.sleep_until(instant);
        }
        fn since_2000_ns(&self) -> Option<u64> {
            Some(850_000_000_000_000_000)
        }
        fn chance(&self) -> Option<u64> {
            Some(self.1)
        }
    }
    let first = |chance| {
        let drive = Drive::new(DriveKind::Generic).build(&Piece::default(), Load::default());
        let (link, clock) = in_process(Segment::line(vec![drive]).unwrap());
        let mut bus = Bus::new(link, Chancy(clock, chance), BusOptions::default());
        bus.scan().unwrap()[0].station_address
    };
    let given: std::collections::BTreeSet<u16> = (0..100).map(first).collect();
    assert!(given.len() > 95, "{given:x?}");
}

/// A gripper of two SubDevices that may be there or not: everything else is known by its alias.
#[test]
fn a_hot_connect_group_is_there_as_a_whole_or_not_at_all() {
    let drive = Drive::new(DriveKind::Generic);
    let alias = |alias, presence| SubDeviceConfig {
        place: Some(Match::Alias(alias)),
        name: Some(format!("alias {alias}")),
        presence,
        ..SubDeviceConfig::default()
    };
    let group = || Presence::Group("gripper".into());
    let wanted =
        [alias(1, Presence::Required), alias(2, group()), alias(3, group()), alias(4, Presence::Required)];
    let configured = |aliases: &[u16]| {
        let piece = |alias: &u16| Piece { alias: *alias, ..Piece::default() };
        let drives = aliases.iter().map(|one| drive.build(&piece(one), Load::default())).collect();
        let (link, clock) = in_process(Segment::line(drives).unwrap());
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().unwrap();
        bus.configure(&wanted).map_err(|error| error.to_string())
    };
    assert_eq!(configured(&[1, 2, 3, 4]), Ok(()));
    assert_eq!(configured(&[1, 4]), Ok(()));
    let part = "hot-connect group `gripper`: SubDevices [1] of it are there, `alias 3` is not; connect all of it, or none";
    assert_eq!(configured(&[1, 2, 4]), Err(part.to_owned()));
    // Who isn't of the group has to be there all the same.
    let missing = configured(&[1, 2, 3]).unwrap_err();
    let told = "no SubDevice has alias 0x0004 (alias 4), but there are 0x0001, 0x0002, 0x0003";
    assert_eq!(missing, told);
}

#[test]
fn a_modular_device_tells_where_another_module_is_plugged_in() {
    use omnibase_ethercat_sim::dictionary::{Entry, Object};
    let list = |index, idents: &[u32]| {
        let entries =
            (1..).zip(idents).map(|(slot, ident)| Entry::unsigned32(slot, "Module", *ident)).collect();
        Object::array(index, "Modules", entries)
    };
    let found = |objects: Vec<Object>| {
        let sii = crate::segment::with_mailbox(crate::segment::sii_of(sii::Identity::default(), 0));
        let generic = Generic::with_objects(&sii, &Piece::default(), objects).unwrap();
        let (link, clock) = in_process(Segment::line(vec![generic.sub_device]).unwrap());
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().unwrap();
        bus.configure(&[]).unwrap();
        bus.read_modules(0).unwrap()
    };
    assert_eq!(found(vec![]), None);
    let modules = found(vec![list(0xF030, &[7, 9, 0]), list(0xF050, &[7, 8, 5])]).unwrap();
    assert_eq!((&modules.configured[..], &modules.detected[..]), (&[7, 9, 0][..], &[7, 8, 5][..]));
    let told: Vec<String> = modules.differences().iter().map(ToString::to_string).collect();
    let other = "slot 2 holds module 0x00000008, 0x00000009 is expected there: plug that in, or put the one that is there into the \
                 list (0xF030)";
    let surplus = "slot 3 holds module 0x00000005, none is expected there: take it out, or put it into the list (0xF030)";
    assert_eq!(told, [other, surplus]);
    // One that isn't configured takes what it finds.
    assert_eq!(found(vec![list(0xF050, &[7, 8, 5])]).unwrap().differences(), []);
}

/// Damage is told of the cable on which it happens, and a mailbox protocol of what is to be done about it.
#[test]
fn damaged_frames_are_told_by_port_and_neighbour() {
    use omnibase_ethercat::trouble::Trouble;
    let drive = Drive::new(DriveKind::Generic);
    let drives = (0..3).map(|_| drive.build(&Piece::default(), Load::default())).collect();
    let (link, clock) = in_process(Segment::line(drives).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    assert_eq!(bus.look_for_trouble(), Ok(vec![]));
    bus.transactor().link.segment_mut().inject(1, Fault::CrcErrors { port: 0, frames: 5 }).unwrap();
    let trouble = bus.look_for_trouble().unwrap();
    let [Trouble::LostFrames { lost: 5, .. }, damaged @ Trouble::Damaged { position: 1, port: 0, .. }] =
        &trouble[..]
    else {
        panic!("{trouble:?}")
    };
    let words = damaged.to_string();
    assert!(words.contains("arrived first at its port 0, from SubDevice 0 (its port 1), since"), "{words}");
    // The next scan tells what was counted before it, once.
    bus.scan().unwrap();
    let told = |bus: &mut Bus<_, _>| {
        let trouble = bus.look_for_trouble().unwrap();
        trouble.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let words = told(&mut bus);
    assert!(words.contains("SubDevice 1: 5 damaged frames") && words.contains("before this scan"), "{words}");
    bus.scan().unwrap();
    assert_eq!(told(&mut bus), "");
}

/// Who isn't ready behind a cable with a link, as after a wrong order of power: its neighbour's port is named, and what to do.
#[test]
fn a_cable_with_a_link_through_which_no_frames_pass_is_told() {
    use omnibase_ethercat::trouble::Trouble;
    let drive = Drive::new(DriveKind::Generic);
    let drives = (0..3).map(|_| drive.build(&Piece::default(), Load::default())).collect();
    let mut segment = Segment::line(drives).unwrap();
    segment.inject(1, Fault::LinkAlone { port: 1 }).unwrap();
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    assert_eq!(bus.subdevices().len(), 2);
    assert_eq!(bus.look_for_trouble(), Ok(vec![Trouble::Closed { position: 1, port: 1 }]));
    // Ready now, it is there with the next scan, and nothing is wrong.
    bus.transactor().link.segment_mut().inject(1, Fault::CableRestored { port: 1 }).unwrap();
    bus.scan().unwrap();
    assert_eq!((bus.subdevices().len(), bus.look_for_trouble()), (3, Ok(vec![])));
}

/// Who fell silent since the scan is told, and those before it are looked at all the same.
#[test]
fn a_silent_device_is_told_and_the_others_are_still_looked_at() {
    use omnibase_ethercat::trouble::Trouble;
    let drive = Drive::new(DriveKind::Generic);
    let drives = (0..3).map(|_| drive.build(&Piece::default(), Load::default())).collect();
    let (link, clock) = in_process(Segment::line(drives).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    let segment = bus.transactor().link.segment_mut();
    segment.inject(0, Fault::CrcErrors { port: 0, frames: 5 }).unwrap();
    segment.inject(1, Fault::PowerOff).unwrap();
    let trouble = bus.look_for_trouble().unwrap();
    let damaged = |one: &Trouble| matches!(one, Trouble::Damaged { position: 0, port: 0, .. });
    assert!(trouble.iter().any(damaged), "{trouble:?}");
    let silent: Vec<u16> = trouble
        .iter()
        .filter_map(|one| if let Trouble::Silent { position, .. } = one { Some(*position) } else { None })
        .collect();
    assert_eq!(silent, [1, 2]);
    let words = trouble.last().unwrap().to_string();
    assert!(words.starts_with("SubDevice 2: ") && words.contains("it was found, and now"), "{words}");
}
