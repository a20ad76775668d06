//! A cycle of a segment of servos: FRMW + LWR + LRD + BRD, firmware that copies its outputs.

use omnibase_ethercat_sim::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};
use omnibase_ethercat_wire::frame::{FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// SubDevices of 16 + 16 bytes whose data share a frame with the clock and the status.
const PER_FRAME: u16 = 40;

/// Copies outputs to inputs when they come.
pub struct Mirror;

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

/// A line of servos with 16 bytes each way, the clock running, and the frames of its cycle.
fn operational(count: u16) -> (Segment, Vec<Vec<u8>>) {
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
    let frames = (0..count).step_by(usize::from(PER_FRAME)).map(|first| {
        let length = usize::from((count - first).min(PER_FRAME)) * 16;
        let offset = 0x1_0000 + u32::from(first) * 16;
        let mut frame = FrameBuilder::new();
        if first == 0 {
            frame.push_zeros(Command::Frmw, 0, Address::station(0x1001, reg::DC_SYSTEM_TIME), 8).unwrap();
        }
        frame.push_zeros(Command::Lwr, 0, Address::Logical(offset), length).unwrap();
        frame.push_zeros(Command::Lrd, 0, Address::Logical(offset + u32::from(bytes)), length).unwrap();
        if first == 0 {
            frame.push_zeros(Command::Brd, 0, Address::broadcast(reg::AL_STATUS), 2).unwrap();
        }
        frame.bytes().to_vec()
    });
    let frames = frames.collect();
    (segment, frames)
}

/// A segment that is cycled.
pub struct Cycle {
    segment: Segment,
    frames: Vec<Vec<u8>>,
    buffer: [u8; MAX_FRAME],
    now: HostTime,
}

impl Cycle {
    /// A line of so many SubDevices, its clock and its outputs running.
    pub fn new(count: u16) -> Self {
        let (segment, frames) = operational(count);
        let mut cycle = Cycle { segment, frames, buffer: [0; MAX_FRAME], now: HostTime(1_000_000) };
        cycle.run();
        cycle.run();
        // All counted in the last frame: its outputs and inputs, or the status.
        let last = cycle.frames.last().unwrap();
        let counted = if cycle.frames.len() == 1 { count } else { (count - 1) % PER_FRAME + 1 };
        assert_eq!(cycle.buffer[last.len() - 2..last.len()], counted.to_le_bytes());
        cycle
    }

    /// A millisecond passes.
    pub fn run(&mut self) {
        self.now.0 += 1_000_000;
        for frame in &self.frames {
            let buffer = &mut self.buffer[..frame.len()];
            buffer.copy_from_slice(frame);
            self.segment.process(buffer, self.now).unwrap();
        }
    }
}
