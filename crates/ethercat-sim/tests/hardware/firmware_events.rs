//! AL control and status, events, the watchdog, and when firmware runs.

use crate::bench::{Bench, firmware, fmmu, idle, sync_manager};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{EscConfig, FaultError, SegmentFile};
use omnibase_ethercat_wire::register::{self as reg, al_event};
use omnibase_ethercat_wire::{Address, Command, HostTime};
use std::sync::{Arc, Mutex};

#[test]
fn an_al_request_waits_until_the_firmware_has_read_it() {
    let mut bench = Bench::single(EscConfig::default(), idle());
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 1);
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]), 1);
    assert_eq!(bench.al_event(), al_event::AL_CONTROL);
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[4, 0]), 0, "not read yet");
    assert_eq!(bench.pdi_read(reg::AL_CONTROL, 2), [2, 0]);
    assert_eq!(bench.al_event(), 0);
    bench.pdi_write(reg::AL_STATUS, &[2, 0]);
    bench.pdi_write(reg::AL_STATUS_CODE, &[0x1E, 0]);
    assert_eq!(bench.number_at(0x1001, reg::ECAT_EVENT, 2) & 8, 8);
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 6), 0x001E_0000_0002);
    assert_eq!(bench.number_at(0x1001, reg::ECAT_EVENT, 2) & 8, 0, "reading AL status acknowledges");
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[4, 0]), 1);
}

#[test]
fn device_emulation_copies_control_to_status_with_the_acknowledge_bit() {
    let mut sii = vec![0; 128];
    sii[1] = 1;
    sii[14] = omnibase_ethercat_wire::sii::checksum(sii.first_chunk().unwrap());
    let mut bench = Bench::single(EscConfig { sii, ..EscConfig::default() }, idle());
    for control in [0x11, 0x02, 0x08] {
        assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[control, 0]), 1);
        assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 1), u64::from(control));
    }
}

#[test]
fn firmware_runs_on_events_that_its_mask_lets_through_and_when_it_asked_to() {
    let runs = Arc::new(Mutex::new(Vec::new()));
    let log = runs.clone();
    let mut bench = Bench::single(
        EscConfig::default(),
        firmware(move |pdi, event, now| {
            log.lock().unwrap().push((event.0, now.0));
            pdi.read(reg::AL_CONTROL, &mut [0; 2]);
            (log.lock().unwrap().len() == 2).then_some(HostTime(now.0 + 500_000))
        }),
    );
    let seen = || core::mem::take(&mut *runs.lock().unwrap());
    assert_eq!(seen(), [(0, 0)], "once at power-on");
    bench.fprd(0x1001, reg::AL_STATUS, 2);
    assert_eq!(seen(), [], "a read is no event");
    bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]);
    // The frame was sent at `now`; it reached the chip after 100 ns of cable.
    assert_eq!(seen(), [(1, bench.now.0 + 100)]);
    runs.lock().unwrap().push((9, 9));
    bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]);
    let asked_at = bench.now.0 + 100;
    bench.wait_us(499);
    assert_eq!(runs.lock().unwrap().len(), 2);
    bench.wait_us(10);
    assert_eq!(seen()[2], (0, asked_at + 500_000));
    bench.pdi_write(reg::AL_EVENT_MASK, &[0; 4]);
    bench.fpwr(0x1001, reg::AL_CONTROL, &[4, 0]);
    assert_eq!(seen(), []);
    bench.pdi_write(reg::AL_EVENT_MASK, &[1, 0, 0, 0]);
    bench.wait_us(1);
    bench.fprd(0x1001, reg::AL_STATUS, 2);
    assert_eq!(seen().len(), 1, "opening the mask shows what waits");
}

#[test]
fn the_watchdog_bites_when_outputs_stop() {
    let mut bench = Bench::single(EscConfig::default(), idle());
    bench.fpwr(0x1001, reg::SM + 16, &sync_manager(0x1000, 4, 0x64));
    bench.fpwr(0x1001, reg::FMMU, &fmmu(0, 4, [0, 7], 0x1000, 0, 2));
    bench.pdi_read(0x0816, 1);
    // 100 us · 10.
    assert_eq!(bench.fpwr(0x1001, reg::WATCHDOG_PROCESS_DATA, &[10, 0]), 1);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 2), 0);
    for _ in 0..3 {
        bench.wait_us(900);
        assert_eq!(bench.send(Command::Lwr, Address::Logical(0), &[0; 4]).counter, 1);
        assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 2), 1);
    }
    bench.pdi_read(0x1000, 4);
    bench.wait_us(980);
    assert_eq!(bench.al_event(), 0);
    bench.wait_us(20);
    assert_eq!(bench.al_event(), al_event::WATCHDOG);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 2), 0);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_COUNTER, 1), 1);
    bench.wait_us(10_000);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_COUNTER, 1), 1, "it bites once");
    bench.pdi_read(reg::WATCHDOG_STATUS, 2);
    assert_eq!(bench.al_event(), 0);
    assert_eq!(bench.fpwr(0x1001, reg::WATCHDOG_COUNTER, &[7]), 1);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_COUNTER, 1), 0);
    assert_eq!(bench.fpwr(0x1001, reg::WATCHDOG_PROCESS_DATA, &[0, 0]), 1);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 2), 1, "off counts as alive");
}

#[test]
fn outputs_without_the_watchdog_bit_do_not_feed_it() {
    let mut bench = Bench::single(EscConfig::default(), idle());
    bench.fpwr(0x1001, reg::SM + 16, &sync_manager(0x1000, 4, 0x24));
    bench.fpwr(0x1001, 0x1000, &[0; 4]);
    assert_eq!(bench.number_at(0x1001, reg::WATCHDOG_STATUS, 2), 0);
}

#[test]
fn frozen_firmware_leaves_the_chip_alone_until_it_thaws() {
    let app = firmware(|pdi, event, now| {
        if event.0 & al_event::AL_CONTROL != 0 {
            let mut control = [0; 2];
            pdi.read(reg::AL_CONTROL, &mut control);
            pdi.write(reg::AL_STATUS, &control);
        }
        Some(HostTime(now.0 + 1000))
    });
    let mut bench = Bench::single(EscConfig::default(), app);
    bench.segment.inject(0, ApplicationFault::Frozen(true).into()).unwrap();
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[2, 0]), 1);
    bench.wait_us(1000);
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 1);
    assert_eq!(bench.fpwr(0x1001, reg::AL_CONTROL, &[4, 0]), 0, "the first request was never read");
    bench.segment.inject(0, ApplicationFault::Frozen(false).into()).unwrap();
    assert_eq!(bench.number_at(0x1001, reg::AL_STATUS, 2), 2);
    // What the firmware doesn't know is refused by name.
    let fault = ApplicationFault::AlError(0x1B);
    assert_eq!(
        bench.segment.inject(0, fault.clone().into()),
        Err(FaultError::UnknownToApplication { position: 0, fault: fault.clone() })
    );
    // A chip without a processor has no error of its own, either.
    let terminal = "[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n";
    let mut segment = SegmentFile::parse(terminal).unwrap().build(std::path::Path::new(".")).unwrap();
    assert_eq!(
        segment.inject(0, fault.clone().into()),
        Err(FaultError::UnknownToApplication { position: 0, fault })
    );
}

#[test]
fn the_chips_watchdog_of_its_firmware_expires_while_that_hangs() {
    let mut bench = Bench::single(EscConfig::default(), firmware(|_, _, _| None));
    let shown = |bench: &mut Bench| {
        let status = bench.number_at(0x1001, reg::DL_STATUS, 2) >> 1 & 1;
        (status, bench.number_at(0x1001, reg::WATCHDOG_COUNTER + 1, 1))
    };
    bench.wait_us(1_000_000);
    assert_eq!(shown(&mut bench), (1, 0), "it is called by nobody and there all the same");
    bench.segment.inject(0, ApplicationFault::Frozen(true).into()).unwrap();
    bench.wait_us(210_000);
    assert_eq!(shown(&mut bench), (0, 1), "it expires once");
    bench.segment.inject(0, ApplicationFault::Frozen(false).into()).unwrap();
    assert_eq!(shown(&mut bench), (1, 1));
    bench.fpwr(0x1001, reg::WATCHDOG_COUNTER, &[0, 0]);
    // Ten times as long, then never.
    bench.fpwr(0x1001, reg::WATCHDOG_PDI, &10_000_u16.to_le_bytes());
    bench.wait_us(1_000_000);
    bench.segment.inject(0, ApplicationFault::Frozen(true).into()).unwrap();
    bench.wait_us(200_000);
    assert_eq!(shown(&mut bench), (1, 0));
    bench.wait_us(1_000_000);
    assert_eq!(shown(&mut bench), (0, 1));
    bench.fpwr(0x1001, reg::WATCHDOG_PDI, &[0, 0]);
    bench.segment.inject(0, ApplicationFault::Frozen(false).into()).unwrap();
    bench.segment.inject(0, ApplicationFault::Frozen(true).into()).unwrap();
    bench.wait_us(2_000_000);
    assert_eq!(shown(&mut bench).1, 1);
}
