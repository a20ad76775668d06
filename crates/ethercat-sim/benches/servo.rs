//! What a cycle costs in the firmware of a simulated servo: outputs in, loops of 1 ms, inputs out.
//!
//! `cargo bench -p omnibase-ethercat-sim --bench servo`

use divan::Bencher;
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::{Load, SingleAxis};
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::firmware::Firmware;
use omnibase_ethercat_sim::pdi::{AlEvent, Application, Pdi};
use omnibase_ethercat_wire::HostTime;
use omnibase_ethercat_wire::register::{self as reg, al_event};

fn main() {
    divan::main();
}

/// A chip that is nothing but memory.
struct Memory(Box<[u8; 0x1_0000]>);

impl Pdi for Memory {
    fn read(&mut self, address: u16, data: &mut [u8]) -> AlEvent {
        let start = usize::from(address);
        data.copy_from_slice(&self.0[start..start + data.len()]);
        AlEvent(0)
    }

    fn write(&mut self, address: u16, data: &[u8]) -> AlEvent {
        let start = usize::from(address);
        self.0[start..start + data.len()].copy_from_slice(data);
        AlEvent(0)
    }
}

/// A servo in OP, its beat the outputs' SyncManager, enabled in csp.
struct Running {
    memory: Memory,
    firmware: Firmware,
    now: HostTime,
    wake: Option<HostTime>,
}

impl Running {
    fn new() -> Self {
        let axis = Box::new(SingleAxis::new(Load::default()));
        let firmware = Drive::new(DriveKind::Generic).firmware(&Piece::default(), axis);
        let memory = Memory(Box::new([0; 0x1_0000]));
        let mut running = Running { memory, firmware, now: HostTime(0), wake: None };
        let set = |memory: &mut Memory, address: u16, data: &[u8]| {
            memory.write(address, data);
        };
        let memory = &mut running.memory;
        set(memory, reg::FMMU_COUNT, &[8, 4]);
        set(memory, reg::SM, &[0x00, 0x10, 0x00, 0x01, 0x26, 0, 1, 0]);
        set(memory, reg::SM + 8, &[0x00, 0x14, 0x00, 0x01, 0x22, 0, 1, 0]);
        set(memory, reg::SM + 16, &[0x00, 0x18, 16, 0, 0x64, 0, 1, 0]);
        set(memory, reg::SM + 24, &[0x00, 0x1C, 16, 0, 0x20, 0, 1, 0]);
        set(memory, reg::FMMU, &[0, 0, 0, 0, 16, 0, 0, 7, 0x00, 0x18, 0, 2, 1, 0, 0, 0]);
        set(memory, reg::FMMU + 16, &[0, 0, 0, 0, 16, 0, 0, 7, 0x00, 0x1C, 0, 1, 1, 0, 0, 0]);
        running.firmware.power_on(&mut running.memory, HostTime(0));
        for state in [2, 4, 8] {
            running.memory.write(reg::AL_CONTROL, &[state, 0]);
            running.beat(al_event::AL_CONTROL);
            running.cycle(0);
        }
        assert_eq!(running.memory.0[usize::from(reg::AL_STATUS)], 8);
        for control in [6, 7, 15] {
            for _ in 0..20 {
                running.cycle(control);
            }
        }
        assert_eq!(running.memory.0[0x1C00] & 0x6F, 0x27);
        running
    }

    /// A millisecond passes, with the inner loops between; then this event.
    fn beat(&mut self, event: u32) {
        let end = HostTime(self.now.0 + 1_000_000);
        while let Some(wake) = self.wake.filter(|wake| *wake < end) {
            self.wake = self.firmware.run(&mut self.memory, AlEvent(0), wake);
        }
        self.now = end;
        self.wake = self.firmware.run(&mut self.memory, AlEvent(event), end);
    }

    fn cycle(&mut self, control: u8) {
        let mut outputs = [0; 16];
        outputs[0] = control;
        outputs[12..14].copy_from_slice(&3000u16.to_le_bytes());
        outputs[14] = 8;
        self.memory.write(0x1800, &outputs);
        self.beat(al_event::sync_manager(2));
    }
}

#[divan::bench]
fn cycle_of_1_ms(bencher: Bencher) {
    let mut running = Running::new();
    bencher.bench_local(|| running.cycle(15));
}

/// The process data alone, without the loops between.
#[divan::bench]
fn process_data(bencher: Bencher) {
    let mut running = Running::new();
    bencher.bench_local(|| {
        running.now = HostTime(running.now.0 + 125_000);
        let event = AlEvent(al_event::sync_manager(2));
        running.wake = running.firmware.run(&mut running.memory, event, running.now);
    });
}
