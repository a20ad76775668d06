//! AL states: every check has its code.

use crate::rig::{FIRST, Lengths, Rig, SERVO, SGDV, fmmu, sync_manager};
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::device::{Device, Moment, Piece};
use omnibase_ethercat_sim::dictionary::Dictionary;
use omnibase_ethercat_sim::firmware::{
    Firmware, FirmwareConfig, PdoRules, StateControl, SyncMonitoring, Synchronization, TransitionTimes,
};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{EscConfig, Fault, SubDevice};
use omnibase_ethercat_wire::HostTime;
use omnibase_ethercat_wire::sii::MailboxArea;

const INIT: u16 = 1;
const PRE_OP: u16 = 2;
const BOOT: u16 = 3;
const SAFE_OP: u16 = 4;
const OP: u16 = 8;
const ERROR: u16 = 0x10;

/// A servo in PRE-OP.
fn in_pre_op(kind: DriveKind) -> Rig {
    let mut rig = Rig::drive(kind);
    rig.bring_to_pre_op(FIRST);
    rig
}

/// A servo in PRE-OP whose SyncManagers and FMMUs are right.
fn configured(kind: DriveKind, lengths: Lengths) -> Rig {
    let mut rig = in_pre_op(kind);
    rig.process_data_on(FIRST, lengths);
    rig
}

/// An SGDV in OP with SYNC0 every millisecond.
fn in_op_with_sync0() -> Rig {
    let mut rig = configured(DriveKind::Sgdv, SGDV);
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    rig.write(FIRST, 0x0120, &OP.to_le_bytes());
    cycle(&mut rig, 20);
    assert_eq!(rig.state(FIRST), (OP, 0));
    rig
}

/// Milliseconds with outputs in each.
fn cycle(rig: &mut Rig, cycles: u32) {
    for _ in 0..cycles {
        rig.outputs(FIRST, &[0; 20]);
        rig.wait_us(990);
    }
}

#[test]
fn a_servo_goes_up_and_down_and_exchanges_process_data() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    for _ in 0..20 {
        rig.outputs(FIRST, &[6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xE8, 3, 8, 0]);
        rig.wait_us(1000);
    }
    let inputs = rig.inputs(FIRST, 16);
    assert_eq!(u16::from_le_bytes([inputs[0], inputs[1]]) & 0x6F, 0x21, "ready to switch on");
    assert_eq!(inputs[14], 8, "csp");
    for state in [SAFE_OP, PRE_OP, INIT] {
        assert_eq!(rig.request(FIRST, state), (state, 0));
    }
    rig.bring_to_op(FIRST, SERVO);
    assert_eq!(rig.request(FIRST, INIT), (INIT, 0), "from OP at once");
}

#[test]
fn a_transition_takes_its_time() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.mailbox_on(FIRST);
    rig.write(FIRST, 0x0120, &PRE_OP.to_le_bytes());
    rig.wait_us(450);
    assert_eq!(rig.state(FIRST), (INIT, 0));
    rig.wait_us(100);
    assert_eq!(rig.state(FIRST), (PRE_OP, 0));
}

#[test]
fn skipped_unknown_and_unsupported_states_are_refused() {
    for (request, code) in [(SAFE_OP, 0x11), (OP, 0x11), (5, 0x12), (BOOT, 0x15)] {
        let mut rig = Rig::drive(DriveKind::Generic);
        assert_eq!(rig.request(FIRST, request), (INIT | ERROR, code), "INIT to {request}");
    }
    let mut rig = in_pre_op(DriveKind::Generic);
    assert_eq!(rig.request(FIRST, OP), (PRE_OP | ERROR, 0x11));
    assert_eq!(rig.request(FIRST, BOOT | ERROR), (PRE_OP | ERROR, 0x11));
}

#[test]
fn an_error_stays_until_it_is_acknowledged() {
    let mut rig = configured(DriveKind::Generic, SERVO);
    assert_eq!(rig.request(FIRST, OP), (PRE_OP | ERROR, 0x11));
    rig.write(FIRST, 0x0120, &SAFE_OP.to_le_bytes());
    rig.wait_us(5000);
    assert_eq!(rig.state(FIRST), (PRE_OP | ERROR, 0x11), "without acknowledge nothing goes up");
    rig.write(FIRST, 0x0120, &(PRE_OP | ERROR).to_le_bytes());
    rig.wait_us(1000);
    assert_eq!(rig.state(FIRST), (PRE_OP, 0));
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    // Acknowledge and request in one.
    assert_eq!(rig.request(FIRST, 5), (SAFE_OP | ERROR, 0x12));
    rig.write(FIRST, 0x0120, &(PRE_OP | ERROR).to_le_bytes());
    rig.wait_us(1000);
    assert_eq!(rig.state(FIRST), (PRE_OP, 0));
    assert_eq!(rig.request(FIRST, 5), (PRE_OP | ERROR, 0x12));
    assert_eq!(rig.request(FIRST, INIT | ERROR), (INIT, 0));
}

#[test]
fn mailbox_sync_managers_must_be_those_of_the_device() {
    let right = (sync_manager(0x1000, 256, 0x26), sync_manager(0x1400, 256, 0x22));
    let mut off = right.0;
    off[6] = 0;
    for (name, sm0, sm1) in [
        ("length of SM0", sync_manager(0x1000, 128, 0x26), right.1),
        ("length of SM1", right.0, sync_manager(0x1400, 255, 0x22)),
        ("address of SM0", sync_manager(0x1100, 256, 0x26), right.1),
        ("address of SM1", right.0, sync_manager(0x1500, 256, 0x22)),
        ("direction of SM0", sync_manager(0x1000, 256, 0x22), right.1),
        ("mode of SM1", right.0, sync_manager(0x1400, 256, 0x20)),
        ("SM0 off", off, right.1),
    ] {
        let mut rig = Rig::drive(DriveKind::Generic);
        rig.write(FIRST, 0x0800, &sm0);
        rig.write(FIRST, 0x0808, &sm1);
        assert_eq!(rig.request(FIRST, PRE_OP), (INIT | ERROR, 0x16), "{name}");
    }
    let mut rig = Rig::drive(DriveKind::Generic);
    assert_eq!(rig.request(FIRST, PRE_OP), (INIT | ERROR, 0x16), "nothing set");
}

#[test]
fn process_data_sync_managers_and_fmmus_must_fit_the_mapping() {
    let mut off = sync_manager(0x1800, 16, 0x64);
    off[6] = 0;
    let mut off_fmmu = fmmu(0x2_0000, 16, 0x1C00, 1);
    off_fmmu[12] = 0;
    for (name, register, bytes, code) in [
        ("length of SM2", 0x0810, sync_manager(0x1800, 15, 0x64).to_vec(), 0x1D),
        ("address of SM2", 0x0810, sync_manager(0x1900, 16, 0x64).to_vec(), 0x1D),
        ("direction of SM2", 0x0810, sync_manager(0x1800, 16, 0x60).to_vec(), 0x1D),
        ("SM2 off", 0x0810, off.to_vec(), 0x1D),
        ("mode of SM2", 0x0810, sync_manager(0x1800, 16, 0x66).to_vec(), 0x17),
        ("length of SM3", 0x0818, sync_manager(0x1C00, 17, 0x20).to_vec(), 0x1E),
        ("address of SM3", 0x0818, sync_manager(0x1D00, 16, 0x20).to_vec(), 0x1E),
        ("mode of SM3", 0x0818, sync_manager(0x1C00, 16, 0x22).to_vec(), 0x17),
        ("SM4 over SM3", 0x0820, sync_manager(0x1C10, 4, 0x20).to_vec(), 0x17),
        ("no FMMU for outputs", 0x0600, vec![0; 16], 0x1D),
        ("no FMMU for inputs", 0x0610, vec![0; 16], 0x1E),
        ("an FMMU that is off", 0x0610, off_fmmu.to_vec(), 0x1E),
        ("half an FMMU for outputs", 0x0600, fmmu(0x1_0000, 8, 0x1800, 2).to_vec(), 0x1D),
        ("an FMMU of the wrong direction", 0x0610, fmmu(0x2_0000, 16, 0x1C00, 2).to_vec(), 0x1E),
    ] {
        let mut rig = configured(DriveKind::Generic, SERVO);
        rig.rewrite(FIRST, register, &bytes);
        assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, code), "{name}");
    }
}

#[test]
fn two_fmmus_may_share_a_sync_manager() {
    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.write(FIRST, 0x0600, &fmmu(0x1_0000, 8, 0x1800, 2));
    rig.write(FIRST, 0x0620, &fmmu(0x3_0000, 8, 0x1808, 2));
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
}

#[test]
fn assignments_of_the_wrong_direction_are_refused() {
    for (assignment, pdo, code) in [(0x1C12, 0x1A00_u16, 0x25), (0x1C13, 0x1600, 0x24)] {
        let mut rig = configured(DriveKind::Generic, SERVO);
        rig.download(FIRST, (assignment, 0), &[0]).unwrap();
        rig.download(FIRST, (assignment, 1), &pdo.to_le_bytes()).unwrap();
        rig.download(FIRST, (assignment, 0), &[1]).unwrap();
        assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, code));
    }
}

#[test]
fn an_empty_assignment_wants_its_sync_manager_off() {
    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.download(FIRST, (0x1C12, 0), &[0]).unwrap();
    assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, 0x1D));
    rig.rewrite(FIRST, 0x0810, &[0; 8]);
    assert_eq!(rig.request(FIRST, SAFE_OP | ERROR), (SAFE_OP, 0));
    assert_eq!(rig.request(FIRST, OP), (OP, 0), "no outputs to wait for");
}

#[test]
fn the_mode_that_was_written_must_fit_sync0() {
    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.download(FIRST, (0x1C32, 1), &[2, 0]).unwrap();
    assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, 0x30), "SYNC0 wanted, none there");
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP | ERROR), (SAFE_OP, 0));

    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.download(FIRST, (0x1C32, 1), &[0, 0]).unwrap();
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, 0x30), "free run wanted, SYNC0 there");

    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.download(FIRST, (0x1C32, 1), &[3, 0]).unwrap();
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, 0x30), "SYNC1 wanted, none there");
}

#[test]
fn the_mode_that_the_device_chose_binds_nobody() {
    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(2));
    assert_eq!(rig.upload(FIRST, (0x1C32, 2)), Ok(1_000_000));
    assert_eq!(rig.request(FIRST, PRE_OP), (PRE_OP, 0));
    rig.write(FIRST, 0x0981, &[0]);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(1));
}

#[test]
fn an_sgdv_runs_with_multiples_of_125_us_only() {
    for cycle_us in [125, 250, 1000, 4000] {
        let mut rig = configured(DriveKind::Sgdv, SGDV);
        rig.sync0_on(FIRST, cycle_us * 1000, 50_000_000);
        assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0), "{cycle_us} us");
        assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(2));
    }
    for (cycle_ns, code) in [(100_000, 0x35), (300_000, 0x35), (8_000_000, 0x35), (0, 0x36)] {
        let mut rig = configured(DriveKind::Sgdv, SGDV);
        rig.sync0_on(FIRST, cycle_ns, 50_000_000);
        assert_eq!(rig.request(FIRST, SAFE_OP), (PRE_OP | ERROR, code), "{cycle_ns} ns");
    }
}

#[test]
fn a_drive_on_sync1_takes_from_one_to_the_next_for_its_cycle() {
    // SYNC1 is counted from the first SYNC0 behind the one before; a rest is a shift.
    for (sync1_ns, cycle_ns) in [
        (0_u32, 1_000_000),
        (300_000, 1_000_000),
        (1_000_000, 2_000_000),
        (1_500_000, 2_000_000),
        (3_000_000, 4_000_000),
    ] {
        let mut rig = configured(DriveKind::Generic, SERVO);
        rig.download(FIRST, (0x1C32, 1), &[3, 0]).unwrap();
        rig.write(FIRST, 0x09A4, &sync1_ns.to_le_bytes());
        rig.sync0_on(FIRST, 1_000_000, 50_000_000);
        rig.write(FIRST, 0x0981, &[7]);
        assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0), "{sync1_ns} ns");
        assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(3));
        assert_eq!(rig.upload(FIRST, (0x1C32, 2)), Ok(cycle_ns), "{sync1_ns} ns");
    }
}

#[test]
fn op_wants_outputs_first() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_safe_op(FIRST, SERVO);
    assert_eq!(rig.request(FIRST, OP), (SAFE_OP | ERROR, 0x19));
    rig.outputs(FIRST, &[0; 16]);
    assert_eq!(rig.request(FIRST, OP | ERROR), (OP, 0));
}

#[test]
fn op_waits_for_outputs_that_come_late() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_safe_op(FIRST, SERVO);
    rig.write(FIRST, 0x0120, &OP.to_le_bytes());
    rig.wait_us(50_000);
    assert_eq!(rig.state(FIRST), (SAFE_OP, 0));
    rig.outputs(FIRST, &[0; 16]);
    rig.wait_us(1000);
    assert_eq!(rig.state(FIRST), (OP, 0));
}

#[test]
fn op_wants_sync0_to_have_come() {
    let mut rig = configured(DriveKind::Sgdv, SGDV);
    rig.sync0_on(FIRST, 1_000_000, 10_000_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    rig.outputs(FIRST, &[0; 20]);
    assert_eq!(rig.request(FIRST, OP), (SAFE_OP | ERROR, 0x2D));
}

#[test]
fn the_watchdog_takes_op_away() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    rig.wait_us(99_000);
    assert_eq!(rig.state(FIRST), (OP, 0));
    rig.wait_us(2_000);
    assert_eq!(rig.state(FIRST), (SAFE_OP | ERROR, 0x1B));
    rig.outputs(FIRST, &[0; 16]);
    assert_eq!(rig.request(FIRST, SAFE_OP | ERROR), (SAFE_OP, 0));
    rig.outputs(FIRST, &[0; 16]);
    assert_eq!(rig.request(FIRST, OP), (OP, 0));
}

#[test]
fn outputs_that_stay_away_under_sync0_are_a_synchronization_error() {
    let mut rig = in_op_with_sync0();
    // 3 for each missing set and a limit of 9: the fourth is one too many.
    rig.wait_us(3_000);
    assert_eq!(rig.state(FIRST), (OP, 0));
    rig.wait_us(2_000);
    assert_eq!(rig.state(FIRST), (SAFE_OP | ERROR, 0x1A));
    assert!(rig.upload(FIRST, (0x1C32, 11)).unwrap() >= 4, "missed events are counted");
}

#[test]
fn a_sync0_that_ends_is_a_fatal_synchronization_error() {
    let mut rig = in_op_with_sync0();
    rig.write(FIRST, 0x0981, &[0]);
    cycle(&mut rig, 3);
    assert_eq!(rig.state(FIRST), (OP, 0));
    cycle(&mut rig, 3);
    assert_eq!(rig.state(FIRST), (SAFE_OP | ERROR, 0x2C));
}

#[test]
fn an_sgdv_alarms_where_sync0_runs_before_outputs_do() {
    let mut rig = configured(DriveKind::Sgdv, SGDV);
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    rig.wait_us(20_000);
    assert_eq!(rig.state(FIRST), (SAFE_OP | ERROR, 0x1A));
    let (service, emergency) = rig.answer(FIRST);
    assert_eq!((service, &emergency[..5]), (1, &[0x00, 0xFF, 0x01, 0x12, 0x0A][..]));
    assert_eq!(rig.upload(FIRST, (0x603F, 0)), Ok(0x0A12));
    assert_eq!(rig.upload(FIRST, (0x6041, 0)).unwrap() & 0x4F, 0x08, "fault");
    // The generic servo is patient in SAFE-OP.
    let mut rig = configured(DriveKind::Generic, SERVO);
    rig.sync0_on(FIRST, 1_000_000, 5_000_000);
    assert_eq!(rig.request(FIRST, SAFE_OP), (SAFE_OP, 0));
    rig.wait_us(20_000);
    assert_eq!(rig.state(FIRST), (SAFE_OP, 0));
}

#[test]
fn sync_managers_switched_off_take_the_state_away() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    rig.write(FIRST, 0x0816, &[0]);
    rig.wait_us(100);
    assert_eq!(rig.state(FIRST), (PRE_OP | ERROR, 0x1D));

    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    rig.write(FIRST, 0x081E, &[0]);
    rig.wait_us(100);
    assert_eq!(rig.state(FIRST), (PRE_OP | ERROR, 0x1E));

    let mut rig = in_pre_op(DriveKind::Generic);
    rig.write(FIRST, 0x0806, &[0]);
    rig.wait_us(100);
    assert_eq!(rig.state(FIRST), (INIT | ERROR, 0x16));

    let mut rig = in_pre_op(DriveKind::Generic);
    rig.write(FIRST, 0x0120, &INIT.to_le_bytes());
    rig.write(FIRST, 0x0806, &[0]);
    rig.wait_us(1000);
    assert_eq!(rig.state(FIRST), (INIT, 0), "on the way to INIT they may go off");
}

#[test]
fn a_control_word_may_ask_for_the_alias() {
    let piece = Piece { alias: 0x1234, ..Piece::default() };
    let mut rig = Rig::of(Drive::new(DriveKind::Generic).build(&piece, Load::default()));
    rig.bring_to_pre_op(FIRST);
    rig.write(FIRST, 0x0120, &(PRE_OP | 0x20).to_le_bytes());
    rig.wait_us(100);
    assert_eq!(rig.state(FIRST), (PRE_OP | 0x20, 0x1234));
    assert_eq!(rig.request(FIRST, PRE_OP), (PRE_OP, 0));
}

#[test]
fn faults_of_the_firmware_show() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    rig.segment.inject(0, Fault::Application(ApplicationFault::AlError(0x8001))).unwrap();
    assert_eq!(rig.state(FIRST), (SAFE_OP | ERROR, 0x8001));

    let mut rig = in_pre_op(DriveKind::Generic);
    rig.segment.inject(0, Fault::Application(ApplicationFault::Frozen(true))).unwrap();
    rig.write(FIRST, 0x0120, &INIT.to_le_bytes());
    rig.wait_us(10_000);
    assert_eq!(rig.state(FIRST), (PRE_OP, 0));
    rig.segment.inject(0, Fault::Application(ApplicationFault::Frozen(false))).unwrap();
    rig.wait_us(1_000);
    assert_eq!(rig.state(FIRST), (INIT, 0));
}

#[test]
fn a_power_cycle_forgets_everything() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_pre_op(FIRST);
    rig.download(FIRST, (0x2F04, 1), &[9, 9]).unwrap();
    rig.segment.inject(0, Fault::PowerOff).unwrap();
    rig.segment.inject(0, Fault::PowerOn).unwrap();
    let mut rig = Rig::new(rig.segment);
    assert_eq!(rig.state(FIRST), (INIT, 0));
    rig.bring_to_pre_op(FIRST);
    assert_eq!(rig.upload(FIRST, (0x2F04, 1)), Ok(1));
}

/// A device that does nothing.
struct Nothing;

impl Device for Nothing {
    fn power_on(&mut self, _: &mut Dictionary, _: HostTime) {}
    fn run(&mut self, _: &mut Dictionary, _: Moment) {}
}

/// A device without process data and mailbox; BOOT has one.
fn with_boot() -> Rig {
    let area = MailboxArea { receive_offset: 0x1000, receive_size: 64, send_offset: 0x1100, send_size: 64 };
    let config = FirmwareConfig {
        identification: None,
        state_control: StateControl::Firmware,
        mailbox: None,
        bootstrap: Some(area),
        process_data: Vec::new(),
        pdo_rules: PdoRules::default(),
        synchronization: Synchronization {
            supported: Synchronization::FREE_RUN,
            cycle_step_ns: 1,
            shortest_cycle_ns: 1,
            longest_cycle_ns: 1,
            monitoring: SyncMonitoring::Op,
        },
        times: TransitionTimes::default(),
    };
    let firmware = Firmware::new(config, Dictionary::new(Vec::new()), Box::new(Nothing));
    Rig::of(SubDevice::new(EscConfig::default(), Box::new(firmware)))
}

#[test]
fn boot_wants_its_own_mailbox_and_leads_to_init_only() {
    let mut rig = with_boot();
    rig.write(FIRST, 0x0800, &sync_manager(0x1000, 128, 0x26));
    rig.write(FIRST, 0x0808, &sync_manager(0x1100, 64, 0x22));
    assert_eq!(rig.request(FIRST, BOOT), (INIT | ERROR, 0x15));
    rig.rewrite(FIRST, 0x0800, &sync_manager(0x1000, 64, 0x26));
    assert_eq!(rig.request(FIRST, BOOT | ERROR), (BOOT, 0));
    assert_eq!(rig.request(FIRST, PRE_OP), (BOOT | ERROR, 0x11));
    assert_eq!(rig.request(FIRST, INIT | ERROR), (INIT, 0));
}
