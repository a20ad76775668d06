//! One SubDevice's start-up list, run again after it lost power or fell back.

use omnibase_ethercat::config::{PdoConfig, SyncManagerPdos, WatchdogConfig};
use omnibase_ethercat::mailbox::Mailbox;
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite, StartUpRunner};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, HostTime, register};
use omnibase_ethercat::{Bus, BusOptions, StartUpStep, SubDeviceConfig};
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_sim::{Fault, SimLink, VirtualClock, in_process};

use crate::segment::drives;

const VICTIM: u16 = 1;
const PARAMETER: ObjectAddress = ObjectAddress::new(0x607F, 0);

type SimBus = Bus<SimLink, VirtualClock>;

fn config() -> SubDeviceConfig {
    let parameter = SdoWrite {
        object: PARAMETER,
        data: 9_000u32.to_le_bytes().to_vec(),
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: None,
    };
    let entries = [0x6040, 0x6071].map(|index| (ObjectAddress::new(index, 0), 16)).to_vec();
    let outputs = SyncManagerPdos {
        sync_manager: 2,
        direction: Direction::Outputs,
        pdos: vec![PdoConfig { index: 0x1600, entries: Some(entries) }],
        origin: None,
    };
    SubDeviceConfig {
        sdos: vec![parameter],
        pdos: vec![outputs],
        watchdogs: WatchdogConfig { process_data: Some(321), ..WatchdogConfig::default() },
        ..SubDeviceConfig::default()
    }
}

/// What the list programs: watchdog, FMMUs, SyncManagers without status, the clock's delay and filters.
fn programmed(bus: &mut SimBus) -> String {
    let segment = bus.transactor().link.segment_mut();
    let esc = segment.sub_devices()[usize::from(VICTIM)].esc();
    let managers: Vec<_> =
        (0..8).map(|n| (esc.peek(0x0800 + 8 * n, 5), esc.peek(0x0806 + 8 * n, 1))).collect();
    let state = esc.peek(register::AL_STATUS, 1);
    let clock = (esc.peek(0x0928, 4), esc.peek(0x0934, 2));
    format!(
        "{state:02x?} {:02x?} {:02x?} {managers:02x?} {clock:02x?}",
        esc.peek(0x0420, 2),
        esc.peek(0x0600, 48)
    )
}

/// Runs the list as far as it needs no cycle, and without what needs the reference clock in the same frame.
fn replay(bus: &mut SimBus) {
    let subdevice = bus.subdevice(VICTIM).unwrap().clone();
    let steps = subdevice.start_up.steps.iter().filter(|step| !step.needs_cycle());
    let steps = steps.filter(|step| !matches!(step, StartUpStep::ClockOffset { .. })).cloned().collect();
    let mailbox = subdevice.mailbox.map(|config| Mailbox::new(subdevice.station_address, config).unwrap());
    let runner = StartUpRunner::new(subdevice.target(), subdevice.application, steps, mailbox);
    let result = bus.transactor().drive(&mut [runner]).unwrap().swap_remove(0);
    result.unwrap();
}

fn configured() -> SimBus {
    let (link, clock) = in_process(drives(DriveKind::Generic, 3));
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[SubDeviceConfig::default(), config(), SubDeviceConfig::default()]).unwrap();
    bus
}

#[test]
fn a_power_cycled_subdevice_is_as_it_was() {
    let mut bus = configured();
    let before = programmed(&mut bus);
    let off_ns = 200_000_000;
    let fault = Fault::PowerCycle { off_for: std::time::Duration::from_nanos(off_ns) };
    bus.transactor().link.segment_mut().inject(usize::from(VICTIM), fault).unwrap();
    let back = HostTime(bus.transactor().clock.now().0 + 2 * off_ns);
    bus.transactor().clock.sleep_until(back);
    assert_ne!(programmed(&mut bus), before, "it forgot everything");
    let station = bus.subdevice(VICTIM).unwrap().station_address.to_le_bytes();
    let address = Access::write_at("the station address", VICTIM, register::STATION_ADDRESS, &station);
    bus.transactor().perform_one(address).unwrap();
    replay(&mut bus);
    assert_eq!(programmed(&mut bus), before);
    // The bus's own mailbox does not know of the power cut, and works all the same.
    assert_eq!(bus.sdo_read(VICTIM, PARAMETER, SdoAccess::Entry).unwrap(), 9_000u32.to_le_bytes());
}

#[test]
fn a_subdevice_that_is_not_fresh_is_as_it_was() {
    let mut bus = configured();
    let before = programmed(&mut bus);
    // Somebody else mapped other objects and set another watchdog.
    let target = bus.subdevice(VICTIM).unwrap().target();
    bus.sdo_write(VICTIM, PARAMETER, &1u32.to_le_bytes()).unwrap();
    let wrong = Access::write("another watchdog", target, register::WATCHDOG_PROCESS_DATA, &[1, 0]);
    bus.transactor().perform_one(wrong).unwrap();
    assert_ne!(programmed(&mut bus), before);
    replay(&mut bus);
    assert_eq!(programmed(&mut bus), before);
    assert_eq!(bus.sdo_read(VICTIM, PARAMETER, SdoAccess::Entry).unwrap(), 9_000u32.to_le_bytes());
}
