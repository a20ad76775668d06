//! Just enough of a MainDevice to bring generic servos to OP and run them, by hand and without any of the product's.

use omnibase_ethercat_sim::Segment;
use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// Bytes of outputs and of inputs of a generic servo.
const BYTES: usize = 16;
const LOGICAL: u32 = 0x0001_0000;
const PRE_OP: u16 = 2;
const SAFE_OP: u16 = 4;
const OP: u16 = 8;

/// What a servo is told: csv where `speed_counts_s` counts, cst where `torque_permille` does.
#[derive(Clone, Copy, Debug, Default)]
pub struct Output {
    pub control: u16,
    pub mode: i8,
    pub speed_counts_s: i32,
    pub torque_permille: i16,
}

/// What a servo says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Input {
    pub status: u16,
    pub position: i32,
    pub speed_counts_s: i32,
    pub torque_permille: i16,
}

pub struct MainDevice {
    pub segment: Segment,
    pub outputs: Vec<Output>,
    pub inputs: Vec<Input>,
    pub now_ns: u64,
    cycle_ns: u64,
    frame: FrameBuilder,
}

impl MainDevice {
    /// Brings every servo to "operation enabled" in mode `mode`.
    pub fn bring_up(segment: Segment, mode: i8, cycle_ns: u64) -> Self {
        let count = segment.sub_devices().len();
        let mut main = Self {
            segment,
            outputs: vec![Output { mode, ..Output::default() }; count],
            inputs: vec![Input::default(); count],
            now_ns: 20_000_000,
            cycle_ns,
            frame: FrameBuilder::new(),
        };
        for position in 0..count as u16 {
            main.write(position, reg::SM, &sync_manager(0x1000, 256, 0x26));
            main.write(position, reg::SM + 8, &sync_manager(0x1400, 256, 0x22));
            main.request(position, PRE_OP);
            main.write(position, reg::SM + 16, &sync_manager(0x1800, BYTES as u16, 0x64));
            main.write(position, reg::SM + 24, &sync_manager(0x1C00, BYTES as u16, 0x20));
            let logical = LOGICAL + u32::from(position) * BYTES as u32;
            main.write(position, reg::FMMU, &fmmu(logical, 0x1800, 2));
            main.write(position, reg::FMMU + 16, &fmmu(logical, 0x1C00, 1));
            main.request(position, SAFE_OP);
        }
        for position in 0..count as u16 {
            main.cycle();
            main.write(position, reg::AL_CONTROL, &OP.to_le_bytes());
        }
        for control in [0x06, 0x07, 0x0F] {
            main.outputs.iter_mut().for_each(|output| output.control = control);
            (0..20).for_each(|_| main.cycle());
        }
        for (position, input) in main.inputs.iter().enumerate() {
            assert_eq!(input.status & 0x6F, 0x27, "servo {position} isn't enabled: {input:?}");
        }
        main
    }

    /// One exchange at the next point of the cycle: outputs go, inputs of the time before come.
    pub fn cycle(&mut self) {
        self.now_ns += self.cycle_ns;
        let mut image = vec![0; self.outputs.len() * BYTES];
        for (bytes, output) in image.chunks_exact_mut(BYTES).zip(&self.outputs) {
            bytes[0..2].copy_from_slice(&output.control.to_le_bytes());
            bytes[6..10].copy_from_slice(&output.speed_counts_s.to_le_bytes());
            bytes[10..12].copy_from_slice(&output.torque_permille.to_le_bytes());
            bytes[12..14].copy_from_slice(&3000_u16.to_le_bytes());
            bytes[14] = output.mode as u8;
        }
        self.frame.clear();
        self.frame.push(Command::Lwr, 1, Address::Logical(LOGICAL), &image).expect("room");
        self.frame.push_zeros(Command::Lrd, 2, Address::Logical(LOGICAL), image.len()).expect("room");
        self.segment.process(self.frame.bytes_mut(), HostTime(self.now_ns)).expect("the frame comes back");
        let read = Datagrams::new(self.frame.bytes()).expect("a frame").nth(1).expect("two").expect("whole");
        assert_eq!(usize::from(read.working_counter), self.outputs.len());
        for (bytes, input) in read.data.chunks_exact(BYTES).zip(&mut self.inputs) {
            let word = |at| [bytes[at], bytes[at + 1]];
            let long = |at| i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
            *input = Input {
                status: u16::from_le_bytes(word(0)),
                position: long(2),
                speed_counts_s: long(6),
                torque_permille: i16::from_le_bytes(word(10)),
            };
        }
    }

    fn transfer(&mut self, command: Command, address: Address, data: &mut [u8]) {
        self.now_ns += 100_000;
        self.frame.clear();
        self.frame.push(command, 7, address, data).expect("room");
        self.segment.process(self.frame.bytes_mut(), HostTime(self.now_ns)).expect("the frame comes back");
        let answer =
            Datagrams::new(self.frame.bytes()).expect("a frame").next().expect("one").expect("whole");
        assert_eq!(answer.working_counter, 1, "{address:?}");
        data.copy_from_slice(answer.data);
    }

    fn write(&mut self, position: u16, register: u16, data: &[u8]) {
        let mut data = data.to_vec();
        self.transfer(Command::Apwr, Address::position(position, register), &mut data);
    }

    fn request(&mut self, position: u16, state: u16) {
        self.write(position, reg::AL_CONTROL, &state.to_le_bytes());
        let mut status = [0; 6];
        for _ in 0..1000 {
            self.transfer(Command::Aprd, Address::position(position, reg::AL_STATUS), &mut status);
            if u16::from_le_bytes([status[0], status[1]]) == state {
                return;
            }
        }
        panic!("servo {position} doesn't reach state {state}: {status:?}");
    }
}

fn sync_manager(start: u16, length: u16, control: u8) -> [u8; 8] {
    let ([a, b], [c, d]) = (start.to_le_bytes(), length.to_le_bytes());
    [a, b, c, d, control, 0, 1, 0]
}

fn fmmu(logical: u32, physical: u16, direction: u8) -> [u8; 16] {
    let ([a, b, c, d], [e, f]) = (logical.to_le_bytes(), physical.to_le_bytes());
    [a, b, c, d, BYTES as u8, 0, 0, 7, e, f, 0, direction, 1, 0, 0, 0]
}
