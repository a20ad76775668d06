//! What a cycle costs in the simulated hardware: FRMW + LWR + LRD + BRD in one frame, firmware that does nothing.
//!
//! `cargo bench -p omnibase-ethercat-sim`

use divan::Bencher;
use omnibase_ethercat_sim::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};
use omnibase_ethercat_wire::frame::{FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command, HostTime};

fn main() {
    divan::main();
}

/// Copies outputs to inputs when they come.
struct Mirror;

impl Application for Mirror {
    fn power_on(&mut self, _pdi: &mut dyn Pdi, _now: HostTime) {}

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, _now: HostTime) -> Option<HostTime> {
        if event.0 & reg::al_event::sync_manager(2) != 0 {
            let mut data = [0; 16];
            pdi.read(0x1800, &mut data);
            pdi.write(0x1C00, &data);
        }
        None
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

fn registers(start: u16, control: u8) -> [u8; 8] {
    let [a, b] = start.to_le_bytes();
    [a, b, 16, 0, control, 0, 1, 0]
}

fn fmmu(logical: u32, physical: u16, kind: u8) -> [u8; 16] {
    let mut registers = [0; 16];
    registers[0..4].copy_from_slice(&logical.to_le_bytes());
    registers[4] = 16;
    registers[7] = 7;
    registers[8..10].copy_from_slice(&physical.to_le_bytes());
    (registers[11], registers[12]) = (kind, 1);
    registers
}

/// A line of servos with 16 bytes each way, the clock running, and the frame of its cycle.
fn operational(count: u16) -> (Segment, Vec<u8>) {
    let devices = (0..count).map(|_| SubDevice::new(EscConfig::default(), Box::new(Mirror))).collect();
    let mut segment = Segment::line(devices).unwrap();
    let bytes = 16 * count;
    let mut send = |frame: &FrameBuilder| {
        segment.process(&mut frame.bytes().to_vec(), HostTime(0)).unwrap();
    };
    for n in 0..count {
        let mut frame = FrameBuilder::new();
        let offset = u32::from(n) * 16;
        let writes: [(u16, &[u8]); 5] = [
            (reg::STATION_ADDRESS, &(0x1001 + n).to_le_bytes()),
            (reg::SM + 16, &registers(0x1800, 0x64)),
            (reg::SM + 24, &registers(0x1C00, 0x20)),
            (reg::FMMU, &fmmu(0x1_0000 + offset, 0x1800, 2)),
            (reg::FMMU + 16, &fmmu(0x1_0000 + u32::from(bytes) + offset, 0x1C00, 1)),
        ];
        for (register, data) in writes {
            frame.push(Command::Apwr, 0, Address::position(n, register), data).unwrap();
        }
        send(&frame);
    }
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Frmw, 0, Address::station(0x1001, reg::DC_SYSTEM_TIME), 8).unwrap();
    let per_datagram = usize::from(bytes).min(640);
    frame.push_zeros(Command::Lwr, 0, Address::Logical(0x1_0000), per_datagram).unwrap();
    frame.push_zeros(Command::Lrd, 0, Address::Logical(0x1_0000 + u32::from(bytes)), per_datagram).unwrap();
    frame.push_zeros(Command::Brd, 0, Address::broadcast(reg::AL_STATUS), 2).unwrap();
    (segment, frame.bytes().to_vec())
}

#[divan::bench(args = [1, 3, 20, 40])]
fn cycle(bencher: Bencher<'_, '_>, count: u16) {
    let (mut segment, frame) = operational(count);
    let mut buffer = [0; MAX_FRAME];
    let mut now = HostTime(1_000_000);
    bencher.bench_local(|| {
        now.0 += 1_000_000;
        buffer[..frame.len()].copy_from_slice(&frame);
        segment.process(&mut buffer[..frame.len()], now)
    });
    let answer = &buffer[..frame.len()];
    // All counted: clock, outputs, inputs, status.
    assert_eq!(u16::from_le_bytes([answer[34], answer[35]]), count);
    assert_eq!(u16::from_le_bytes([answer[frame.len() - 2], answer[frame.len() - 1]]), count);
}

/// A frame for one SubDevice of a long line, as start-up sends them.
#[divan::bench(args = [1, 100, 1000])]
fn one_of_many(bencher: Bencher<'_, '_>, count: u16) {
    let devices = (0..count).map(|_| SubDevice::new(EscConfig::default(), Box::new(Mirror))).collect();
    let mut segment = Segment::line(devices).unwrap();
    let mut number = FrameBuilder::new();
    number.push(Command::Apwr, 0, Address::position(count - 1, reg::STATION_ADDRESS), &[1, 0x10]).unwrap();
    segment.process(number.bytes_mut(), HostTime(0)).unwrap();
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Fprd, 0, Address::station(0x1001, reg::AL_STATUS), 2).unwrap();
    let frame = frame.bytes().to_vec();
    let mut buffer = [0; MAX_FRAME];
    let mut now = HostTime(1_000_000);
    bencher.bench_local(|| {
        now.0 += 1_000_000;
        buffer[..frame.len()].copy_from_slice(&frame);
        segment.process(&mut buffer[..frame.len()], now)
    });
    assert_eq!(buffer[frame.len() - 2], 1);
}
