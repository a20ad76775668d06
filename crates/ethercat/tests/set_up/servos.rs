//! Servo drives up to PRE-OP: mailbox, parameters, PDO maps, synchronisation modes.

use std::time::Duration;

use omnibase_ethercat::config::{
    DcConfig, LrwPermission, PdoConfig, SyncManagerPdos, SyncMode, Timeouts, WatchdogConfig,
};
use omnibase_ethercat::mailbox::{MailboxError, ObjectDescription};
use omnibase_ethercat::mapping::MappingFailure;
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite, StartUpFailure};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::wire::coe::{AbortCode, ObjectAddress};
use omnibase_ethercat::wire::{AlState, Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, SetUpError, StartUpStep, SubDeviceConfig};
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_sim::{Fault, SimLink, VirtualClock, in_process};

use crate::segment::drives;

type SimBus = Bus<SimLink, VirtualClock>;

fn start_up(kind: DriveKind, count: u16, configs: &[SubDeviceConfig]) -> (SimBus, Result<(), SetUpError>) {
    let (link, clock) = in_process(drives(kind, count));
    let mut bus = Bus::new(link, clock, BusOptions::default());
    let result = bus.scan().map(drop).and_then(|()| bus.configure(configs));
    (bus, result)
}

fn object(index: u16, subindex: u8) -> ObjectAddress {
    ObjectAddress::new(index, subindex)
}

fn parameter(object: ObjectAddress, data: &[u8]) -> SdoWrite {
    SdoWrite {
        object,
        data: data.to_vec(),
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: Some("robot.toml line 7".into()),
    }
}

#[test]
fn three_sgdv_have_the_tables_of_their_manual() {
    let (mut bus, result) = start_up(DriveKind::Sgdv, 3, &[]);
    result.unwrap();
    assert_eq!(bus.warnings(), []);
    for (position, one) in (0..).zip(bus.subdevices()) {
        let identity = (one.identity.vendor_id, one.identity.product_code);
        assert_eq!((one.position, identity, &*one.name), (position, (0x0539, 0x0220_0001), "SGDV-OCA01A"));
        assert!(!one.lrw_allowed);
        let map = |direction| -> Vec<String> {
            let entries = one.process_data(direction).flat_map(|manager| &manager.pdos);
            let entries = entries.flat_map(|pdo| &pdo.entries);
            entries.map(|entry| format!("{}:{}", entry.object, entry.bit_length)).collect()
        };
        let outputs = "6040:00:16 607a:00:32 60ff:00:32 6071:00:16 6072:00:16 6060:00:8 0000:00:8 60c1:01:32";
        assert_eq!(map(Direction::Outputs).join(" "), outputs);
        let inputs = "6041:00:16 6064:00:32 6077:00:16 60f4:00:32 6061:00:8 0000:00:8 60b9:00:16 60ba:00:32";
        assert_eq!(map(Direction::Inputs).join(" "), inputs);
        assert_eq!(one.sync_managers[2].registers(), [0x00, 0x18, 20, 0, 0x64, 0, 1, 0]);
    }
    let now = bus.transactor().clock.now();
    assert!(now < HostTime(100_000_000), "PRE-OP after {now:?} of bus time");
    println!("three SGDV: ready for SAFE-OP after {now:?}");
}

#[test]
fn a_hundred_servos_are_ready_in_a_second_of_bus_time() {
    let (mut bus, result) = start_up(DriveKind::Generic, 100, &[]);
    result.unwrap();
    assert!(bus.subdevices().iter().all(|one| one.lrw_allowed && one.bit_length(Direction::Inputs) == 128));
    let (now, counters) = (bus.transactor().clock.now(), bus.transactor().counters);
    assert!(now < HostTime(1_000_000_000), "PRE-OP after {now:?} of bus time");
    println!("100 servos: ready for SAFE-OP after {now:?}, {counters:?}");
}

#[test]
fn objects_are_read_written_and_described() {
    let (mut bus, result) = start_up(DriveKind::Generic, 2, &[]);
    result.unwrap();
    let name = bus.sdo_read(1, object(0x1008, 0), SdoAccess::Entry).unwrap();
    assert_eq!(String::from_utf8_lossy(&name), bus.subdevices()[1].name);
    bus.sdo_write(1, object(0x607F, 0), &5_000u32.to_le_bytes()).unwrap();
    assert_eq!(bus.sdo_read(1, object(0x607F, 0), SdoAccess::Entry).unwrap(), 5_000u32.to_le_bytes());
    let whole = bus.sdo_read(1, object(0x1018, 0), SdoAccess::Complete).unwrap();
    assert_eq!(whole.len(), 2 + 4 * 4);
    let objects = bus.object_list(1).unwrap();
    assert!(objects.contains(&0x6040) && objects.contains(&0x1C12));
    let described = bus.describe_object(1, 0x6064).unwrap();
    let described = ObjectDescription::read(&described).unwrap();
    assert_eq!((described.index, described.data_type), (0x6064, 4));
    assert!(!bus.describe_entry(1, object(0x6064, 0), 0).unwrap().is_empty());
    let error = bus.sdo_read(1, object(0x5FFF, 0), SdoAccess::Entry).unwrap_err();
    let text = "SubDevice 1: SDO read of 5fff:00: 5fff:00 aborted: 0x06020000 the object does not exist in the \
                object dictionary";
    assert_eq!(error.to_string(), text);
    let error = bus.sdo_read(2, object(0x1000, 0), SdoAccess::Entry).unwrap_err();
    assert_eq!(error, SetUpError::NoSuchPosition { position: 2, count: 2 });
}

#[test]
fn parameters_are_written_and_read_back() {
    let sdos = vec![parameter(object(0x607F, 0), &9_000u32.to_le_bytes())];
    let config = SubDeviceConfig { sdos, ..SubDeviceConfig::default() };
    let (mut bus, result) = start_up(DriveKind::Generic, 1, &[config]);
    result.unwrap();
    assert_eq!(bus.sdo_read(0, object(0x607F, 0), SdoAccess::Entry).unwrap(), 9_000u32.to_le_bytes());
}

/// What was stored (0x1010) outlasts power, what was only written doesn't, and any other word than "save" stores nothing.
#[test]
fn stored_parameters_outlast_power() {
    let (quick_stop, halt, store) = (object(0x605A, 0), object(0x605D, 0), object(0x1010, 1));
    let (mut bus, result) = start_up(DriveKind::Sgdv, 1, &[]);
    result.unwrap();
    bus.sdo_write(0, quick_stop, &6u16.to_le_bytes()).unwrap();
    let refused = bus.sdo_write(0, store, b"load").unwrap_err().to_string();
    assert!(refused.contains("0x08000020"), "{refused}");
    bus.sdo_write(0, store, b"save").unwrap();
    assert_eq!(bus.sdo_read(0, store, SdoAccess::Entry).unwrap(), 1u32.to_le_bytes());
    bus.sdo_write(0, halt, &2u16.to_le_bytes()).unwrap();
    for fault in [Fault::PowerOff, Fault::PowerOn] {
        bus.transactor().link.segment_mut().inject(0, fault).unwrap();
    }
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let mut read = |object| bus.sdo_read(0, object, SdoAccess::Entry).unwrap();
    assert_eq!((read(quick_stop), read(halt)), (vec![6, 0], vec![1, 0]));
}

#[test]
fn a_refused_parameter_names_the_abort_code_and_the_line() {
    let refused = |sdo: SdoWrite| {
        let config = SubDeviceConfig { sdos: vec![sdo], ..SubDeviceConfig::default() };
        start_up(DriveKind::Generic, 1, &[config]).1.unwrap_err().to_string()
    };
    assert_eq!(
        refused(parameter(object(0x1008, 0), b"other")),
        "SubDevice 0: SDO write to 1008:00: 1008:00 aborted: 0x06010002 attempt to write a read-only object \
         (robot.toml line 7)"
    );
    let length = refused(parameter(object(0x607F, 0), &[1, 2]));
    assert!(length.starts_with("SubDevice 0: SDO write to 607f:00: 607f:00 aborted: 0x06070"), "{length}");
    // Tolerated, but then it must have the value.
    let tolerated =
        |data: &[u8]| SdoWrite { refusal: Refusal::IsTolerated, ..parameter(object(0x1000, 0), data) };
    assert_eq!(
        refused(tolerated(&[1, 0, 0, 0])),
        "SubDevice 0: SDO 1000:00: 0x00000001 was written, 0x00020192 read back; the writing was refused: \
         1000:00 aborted: 0x06010002 attempt to write a read-only object (robot.toml line 7)"
    );
    let sdos = vec![tolerated(&0x0002_0192u32.to_le_bytes())];
    let config = SubDeviceConfig { sdos, ..SubDeviceConfig::default() };
    start_up(DriveKind::Generic, 1, &[config]).1.unwrap();
}

fn map(sync_manager: u8, direction: Direction, index: u16, entries: &[(u16, u8)]) -> SyncManagerPdos {
    let entries = entries.iter().map(|&(index, bits)| (object(index, 0), bits)).collect();
    SyncManagerPdos {
        sync_manager,
        direction,
        pdos: vec![PdoConfig { index, entries: Some(entries) }],
        origin: Some("robot.toml line 20".into()),
    }
}

#[test]
fn the_users_map_is_written_entry_by_entry_and_measured() {
    let pdos = vec![
        map(2, Direction::Outputs, 0x1600, &[(0x6040, 16), (0x6071, 16)]),
        map(3, Direction::Inputs, 0x1A00, &[(0x6041, 16), (0x6064, 32), (0x606C, 32)]),
    ];
    let config = SubDeviceConfig { pdos, ..SubDeviceConfig::default() };
    let (mut bus, result) = start_up(DriveKind::Sgdv, 2, &[config.clone(), SubDeviceConfig::default()]);
    result.unwrap();
    let bits = |bus: &SimBus, n: usize| {
        let one = &bus.subdevices()[n];
        (one.bit_length(Direction::Outputs), one.bit_length(Direction::Inputs))
    };
    assert_eq!(bits(&bus, 0), (32, 80));
    assert_eq!(bits(&bus, 1), (160, 160));
    assert_eq!(bus.sdo_read(0, object(0x1A00, 3), SdoAccess::Entry).unwrap(), 0x606C_0020u32.to_le_bytes());
    assert_eq!(bus.subdevices()[0].sync_managers[3].area.length, 10);
}

#[test]
fn a_map_that_cannot_be_is_refused_with_the_line() {
    let with = |pdos| {
        let config = SubDeviceConfig { pdos: vec![pdos], ..SubDeviceConfig::default() };
        start_up(DriveKind::Generic, 1, &[config]).1.unwrap_err()
    };
    // No such object: the device refuses the entry, and has none there.
    let text = with(map(2, Direction::Outputs, 0x1600, &[(0x5FFF, 16)])).to_string();
    assert!(text.starts_with("SubDevice 0: SDO 1600:01: 0x5fff0010 was written"), "{text}");
    assert!(text.contains("the writing was refused") && text.ends_with("(robot.toml line 20)"), "{text}");
    match with(map(3, Direction::Outputs, 0x1600, &[(0x6040, 16)])) {
        SetUpError::Mapping(error) => {
            assert!(matches!(error.cause, MappingFailure::NoSuchSyncManager { sync_manager: 3, .. }));
            let text = "SubDevice 0: PDO map: SyncManager 3 is not one for outputs (the controller has 8) \
                        (robot.toml line 20)";
            assert_eq!(error.to_string(), text);
        }
        other => panic!("{other}"),
    }
}

#[test]
fn synchronisation_watchdogs_and_lrw_are_as_configured() {
    let config = SubDeviceConfig {
        sync_mode: Some(SyncMode::Sync0),
        dc: DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 0 },
        watchdogs: WatchdogConfig { divider: Some(2498), process_data: Some(500), pdi: None },
        lrw: Some(LrwPermission::Barred),
        ..SubDeviceConfig::default()
    };
    let (mut bus, result) = start_up(DriveKind::Generic, 1, &[config]);
    result.unwrap();
    assert!(!bus.subdevices()[0].lrw_allowed);
    assert_eq!(bus.sdo_read(0, object(0x1C32, 1), SdoAccess::Entry).unwrap(), [2, 0]);
    let segment = bus.transactor().link.segment_mut();
    let esc = segment.sub_devices()[0].esc();
    assert_eq!(esc.peek(0x0400, 2), Some(&2498u16.to_le_bytes()[..]));
    assert_eq!(esc.peek(0x0420, 2), Some(&500u16.to_le_bytes()[..]));
    let steps = &bus.subdevices()[0].start_up.steps;
    let tail: Vec<_> = steps.iter().filter(|step| step.needs_cycle()).collect();
    let state = |state| StartUpStep::State { state, timeout: Duration::from_secs(10) };
    assert_eq!(tail, [&StartUpStep::ArmSync, &state(AlState::SafeOp), &state(AlState::Op)]);
}

#[test]
fn a_parameter_for_a_silent_mailbox_ends_in_time() {
    let timeouts = Timeouts { mailbox: Some(Duration::from_millis(300)), ..Timeouts::default() };
    let asked = SubDeviceConfig { timeouts, ..SubDeviceConfig::default() };
    for (configs, most) in [(Vec::new(), 5.0), (vec![asked], 0.4)] {
        let (waited, error) = silent(&configs);
        assert!(error.contains("timeout after"), "{error}");
        assert!(waited.as_secs_f64() < most, "{waited:?}");
    }
}

/// How long a mailbox that says nothing is listened to, and what is said then.
fn silent(configs: &[SubDeviceConfig]) -> (Duration, String) {
    use omnibase_ethercat_sim::Fault;
    use omnibase_ethercat_sim::pdi::ApplicationFault;
    let (mut bus, result) = start_up(DriveKind::Generic, 1, configs);
    result.unwrap();
    let silence = Fault::from(ApplicationFault::MailboxSilence(true));
    bus.transactor().link.segment_mut().inject(0, silence).unwrap();
    let before = bus.transactor().clock.now();
    let error = bus.sdo_read(0, object(0x1000, 0), SdoAccess::Entry).unwrap_err();
    assert!(matches!(error, SetUpError::Request { cause: MailboxError::Timeout { .. }, .. }), "{error}");
    (bus.transactor().clock.now() - before, error.to_string())
}

#[test]
fn abort_codes_survive_as_values() {
    let sdos = vec![parameter(object(0x5FFF, 0), &[0])];
    let config = SubDeviceConfig { sdos, ..SubDeviceConfig::default() };
    match start_up(DriveKind::Generic, 1, &[config]).1.unwrap_err() {
        SetUpError::StartUp(error) => assert!(matches!(
            error.cause,
            StartUpFailure::Sdo {
                error: MailboxError::Aborted { code: AbortCode::NO_SUCH_OBJECT, .. },
                origin: Some(_),
                ..
            }
        )),
        other => panic!("{other}"),
    }
}
