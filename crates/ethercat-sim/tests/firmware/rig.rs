//! A MainDevice reduced to what a test says byte by byte: raw frames into a segment.

use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::{Segment, SubDevice};
use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder};
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// Station address of the first SubDevice.
pub const FIRST: u16 = 0x1001;
/// Logical address of a station's outputs and inputs.
const OUTPUTS: u32 = 0x1_0000;
const INPUTS: u32 = 0x2_0000;

/// Bytes of process data.
#[derive(Clone, Copy)]
pub struct Lengths {
    pub outputs: u16,
    pub inputs: u16,
}

/// Default maps of the generic servo and of the SGDV.
pub const SERVO: Lengths = Lengths { outputs: 16, inputs: 16 };
pub const SGDV: Lengths = Lengths { outputs: 20, inputs: 20 };

pub struct Rig {
    pub segment: Segment,
    pub now: HostTime,
    counter: u8,
}

impl Rig {
    pub fn new(segment: Segment) -> Self {
        let mut rig = Rig { segment, now: HostTime(1_000_000), counter: 0 };
        for n in 0..rig.segment.sub_devices().len() as u16 {
            let answer = rig.send(Command::Apwr, Address::position(n, 0x0010), &(FIRST + n).to_le_bytes());
            assert_eq!(answer.1, 1);
        }
        rig
    }

    pub fn of(sub_device: SubDevice) -> Self {
        Rig::new(Segment::line(vec![sub_device]).expect("one device is a line"))
    }

    pub fn drive(kind: DriveKind) -> Self {
        Rig::of(Drive::new(kind).build(&Piece::default(), Load::default()))
    }

    pub fn wait_us(&mut self, us: u64) {
        self.now = HostTime(self.now.0 + us * 1000);
        self.segment.advance(self.now);
    }

    /// One datagram, 10 us after the last: data and working counter.
    pub fn send(&mut self, command: Command, address: Address, data: &[u8]) -> (Vec<u8>, u16) {
        let mut frame = FrameBuilder::new();
        frame.push(command, 1, address, data).expect("data fit into a frame");
        let mut bytes = frame.bytes().to_vec();
        self.now = HostTime(self.now.0 + 10_000);
        self.segment.process(&mut bytes, self.now).expect("the frame comes back");
        let datagram = Datagrams::new(&bytes).expect("frame").next().expect("one").expect("whole");
        (datagram.data.to_vec(), datagram.working_counter)
    }

    pub fn read(&mut self, station: u16, register: u16, length: usize) -> Vec<u8> {
        let (data, counter) = self.send(Command::Fprd, Address::station(station, register), &vec![0; length]);
        assert_eq!(counter, 1, "FPRD 0x{register:04X}");
        data
    }

    pub fn word(&mut self, station: u16, register: u16) -> u16 {
        let data = self.read(station, register, 2);
        u16::from_le_bytes([data[0], data[1]])
    }

    pub fn write(&mut self, station: u16, register: u16, data: &[u8]) {
        let (_, counter) = self.send(Command::Fpwr, Address::station(station, register), data);
        assert_eq!(counter, 1, "FPWR 0x{register:04X}");
    }

    /// Writes registers that an active SyncManager locks: switches it off first.
    pub fn rewrite(&mut self, station: u16, register: u16, data: &[u8]) {
        if register >= 0x0800 {
            self.write(station, register + 6, &[0]);
        }
        self.write(station, register, data);
    }

    /// AL status and status code.
    pub fn state(&mut self, station: u16) -> (u16, u16) {
        (self.word(station, 0x0130), self.word(station, 0x0134))
    }

    /// Asks for a state; status and code after at most 200 ms.
    pub fn request(&mut self, station: u16, control: u16) -> (u16, u16) {
        self.write(station, 0x0120, &control.to_le_bytes());
        for _ in 0..400 {
            self.wait_us(500);
            let (status, code) = self.state(station);
            if status & 0x10 != 0 || status & 0x0F == control & 0x0F {
                return (status, code);
            }
        }
        self.state(station)
    }

    pub fn mailbox_on(&mut self, station: u16) {
        self.write(station, 0x0800, &sync_manager(0x1000, 256, 0x26));
        self.write(station, 0x0808, &sync_manager(0x1400, 256, 0x22));
    }

    pub fn process_data_on(&mut self, station: u16, lengths: Lengths) {
        let shift = u32::from(station - FIRST) * 0x100;
        self.write(station, 0x0810, &sync_manager(0x1800, lengths.outputs, 0x64));
        self.write(station, 0x0818, &sync_manager(0x1C00, lengths.inputs, 0x20));
        self.write(station, 0x0600, &fmmu(OUTPUTS + shift, lengths.outputs, 0x1800, 2));
        self.write(station, 0x0610, &fmmu(INPUTS + shift, lengths.inputs, 0x1C00, 1));
    }

    pub fn bring_to_pre_op(&mut self, station: u16) {
        self.mailbox_on(station);
        assert_eq!(self.request(station, 2), (2, 0));
    }

    pub fn bring_to_safe_op(&mut self, station: u16, lengths: Lengths) {
        self.bring_to_pre_op(station);
        self.process_data_on(station, lengths);
        assert_eq!(self.request(station, 4), (4, 0));
    }

    /// To OP in free run or with SyncManager events, outputs all zero.
    pub fn bring_to_op(&mut self, station: u16, lengths: Lengths) {
        self.bring_to_safe_op(station, lengths);
        self.outputs(station, &vec![0; usize::from(lengths.outputs)]);
        assert_eq!(self.request(station, 8), (8, 0));
    }

    pub fn outputs(&mut self, station: u16, data: &[u8]) {
        let address = Address::Logical(OUTPUTS + u32::from(station - FIRST) * 0x100);
        assert_eq!(self.send(Command::Lwr, address, data).1, 1, "LWR");
    }

    pub fn inputs(&mut self, station: u16, length: u16) -> Vec<u8> {
        let address = Address::Logical(INPUTS + u32::from(station - FIRST) * 0x100);
        let (data, counter) = self.send(Command::Lrd, address, &vec![0; usize::from(length)]);
        assert_eq!(counter, 1, "LRD");
        data
    }

    /// Programs SYNC0 with this cycle, its first pulse `ahead_ns` from now.
    pub fn sync0_on(&mut self, station: u16, cycle_ns: u32, ahead_ns: u64) {
        let time = self.read(station, 0x0910, 8);
        let time = u64::from_le_bytes(time.try_into().expect("eight bytes"));
        self.write(station, 0x09A0, &cycle_ns.to_le_bytes());
        self.write(station, 0x0990, &(time + ahead_ns).to_le_bytes());
        self.write(station, 0x0981, &[3]);
    }

    /// Puts a message into the mailbox: protocol and service data.
    pub fn post(&mut self, station: u16, protocol: u8, data: &[u8]) {
        self.counter = self.counter % 7 + 1;
        let mut area = vec![0; 256];
        area[0..2].copy_from_slice(&(data.len() as u16).to_le_bytes());
        area[5] = protocol | self.counter << 4;
        area[6..6 + data.len()].copy_from_slice(data);
        self.post_area(station, &area);
    }

    /// The same, all bytes as they are.
    pub fn post_area(&mut self, station: u16, area: &[u8]) {
        self.write(station, 0x1000, area);
    }

    /// The next message from the mailbox: protocol, counter, service data; `None` where none comes.
    pub fn fetch(&mut self, station: u16) -> Option<(u8, u8, Vec<u8>)> {
        for _ in 0..20 {
            if self.read(station, 0x080D, 1)[0] & 8 != 0 {
                let area = self.read(station, 0x1400, 256);
                let length = usize::from(u16::from_le_bytes([area[0], area[1]]));
                return Some((area[5] & 15, area[5] >> 4 & 7, area[6..6 + length].to_vec()));
            }
            self.wait_us(100);
        }
        None
    }

    /// A CoE request's answer behind the CoE header, with the service.
    pub fn coe(&mut self, station: u16, service: u16, body: &[u8]) -> (u16, Vec<u8>) {
        let mut data = (service << 12).to_le_bytes().to_vec();
        data.extend_from_slice(body);
        self.post(station, 3, &data);
        self.answer(station)
    }

    /// The next CoE message.
    pub fn answer(&mut self, station: u16) -> (u16, Vec<u8>) {
        let (protocol, _, data) = self.fetch(station).expect("an answer comes");
        assert_eq!(protocol, 3, "{data:02X?}");
        (u16::from_le_bytes([data[0], data[1]]) >> 12, data[2..].to_vec())
    }

    /// Writes up to four bytes; the abort code where it is refused.
    pub fn download(&mut self, station: u16, object: (u16, u8), data: &[u8]) -> Result<(), u32> {
        let mut body = vec![0x23 | ((4 - data.len()) as u8) << 2];
        body.extend_from_slice(&object.0.to_le_bytes());
        body.push(object.1);
        body.extend_from_slice(data);
        body.resize(8, 0);
        let (_, answer) = self.coe(station, 2, &body);
        result(&answer).map(|_| ())
    }

    /// Reads up to four bytes.
    pub fn upload(&mut self, station: u16, object: (u16, u8)) -> Result<u32, u32> {
        let [low, high] = object.0.to_le_bytes();
        let (_, answer) = self.coe(station, 2, &[0x40, low, high, object.1, 0, 0, 0, 0]);
        result(&answer)
    }
}

fn result(answer: &[u8]) -> Result<u32, u32> {
    let value = u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]]);
    if answer[0] == 0x80 { Err(value) } else { Ok(value) }
}

pub fn sync_manager(start: u16, length: u16, control: u8) -> [u8; 8] {
    let ([a, b], [c, d]) = (start.to_le_bytes(), length.to_le_bytes());
    [a, b, c, d, control, 0, 1, 0]
}

pub fn fmmu(logical: u32, length: u16, physical: u16, kind: u8) -> [u8; 16] {
    let mut registers = [0; 16];
    registers[0..4].copy_from_slice(&logical.to_le_bytes());
    registers[4..6].copy_from_slice(&length.to_le_bytes());
    registers[7] = 7;
    registers[8..10].copy_from_slice(&physical.to_le_bytes());
    registers[11] = kind;
    registers[12] = 1;
    registers
}
