//! A segment on the bench: frames written by hand, answers taken apart, firmware made of closures.

use omnibase_ethercat_sim::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};
use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder};
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// Firmware that is a closure.
pub struct Firmware<F>(pub F);

impl<F> Application for Firmware<F>
where
    F: FnMut(&mut dyn Pdi, AlEvent, HostTime) -> Option<HostTime> + Send,
{
    fn power_on(&mut self, _pdi: &mut dyn Pdi, _now: HostTime) {}

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> Option<HostTime> {
        (self.0)(pdi, event, now)
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

/// Firmware that never does anything.
pub fn idle() -> Box<dyn Application> {
    Box::new(Firmware(|_: &mut dyn Pdi, _, _| None))
}

/// Firmware as a closure, boxed.
pub fn firmware<F>(run: F) -> Box<dyn Application>
where
    F: FnMut(&mut dyn Pdi, AlEvent, HostTime) -> Option<HostTime> + Send + 'static,
{
    Box::new(Firmware(run))
}

/// What came back for one datagram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    pub adp: u16,
    pub event: u16,
    pub counter: u16,
    pub data: Vec<u8>,
    pub circulating: bool,
    pub source: u8,
}

/// A segment and the time on the bench.
pub struct Bench {
    pub segment: Segment,
    pub now: HostTime,
}

impl Bench {
    /// A segment at time 1 ms.
    pub fn new(segment: Segment) -> Self {
        Bench { segment, now: HostTime(1_000_000) }
    }

    /// A line of `count` default chips without firmware, with station addresses 0x1001 and on.
    pub fn line(count: u16) -> Self {
        let mut bench = Bench::new(
            Segment::line((0..count).map(|_| SubDevice::new(EscConfig::default(), idle())).collect())
                .unwrap(),
        );
        bench.number(count);
        bench
    }

    /// One SubDevice with this chip and firmware at station address 0x1001.
    pub fn single(config: EscConfig, application: Box<dyn Application>) -> Self {
        let mut bench = Bench::new(Segment::line(vec![SubDevice::new(config, application)]).unwrap());
        bench.number(1);
        bench
    }

    /// Gives station addresses 0x1001 and on.
    pub fn number(&mut self, count: u16) {
        for n in 0..count {
            let set = self.apwr(n, 0x0010, &(0x1001 + n).to_le_bytes());
            assert_eq!(set, 1);
        }
    }

    /// Lets time pass.
    pub fn wait_us(&mut self, us: u64) {
        self.now = HostTime(self.now.0 + us * 1000);
        self.segment.advance(self.now);
    }

    /// Sends a frame with one datagram, 10 us after the last; `None` where it is lost.
    pub fn try_send(&mut self, command: Command, address: Address, data: &[u8]) -> Option<Answer> {
        let mut frame = FrameBuilder::new();
        frame.push(command, 0x5A, address, data).unwrap();
        let mut bytes = frame.bytes().to_vec();
        self.now = HostTime(self.now.0 + 10_000);
        self.segment.process(&mut bytes, self.now)?;
        let datagram = Datagrams::new(&bytes).unwrap().next().unwrap().unwrap();
        Some(Answer {
            adp: datagram.header.address as u16,
            event: datagram.header.event,
            counter: datagram.working_counter,
            data: datagram.data.to_vec(),
            circulating: datagram.header.circulating,
            source: bytes[6],
        })
    }

    /// Like [`Bench::try_send`], for frames that come back.
    pub fn send(&mut self, command: Command, address: Address, data: &[u8]) -> Answer {
        self.try_send(command, address, data).expect("the frame comes back")
    }

    /// Reads as the firmware of the first SubDevice.
    pub fn pdi_read(&mut self, address: u16, length: usize) -> Vec<u8> {
        let mut data = vec![0; length];
        self.segment.pdi(0).expect("it has power").read(address, &mut data);
        data
    }

    /// Writes as the firmware of the first SubDevice.
    pub fn pdi_write(&mut self, address: u16, data: &[u8]) {
        self.segment.pdi(0).expect("it has power").write(address, data);
    }

    /// The AL event word of the first SubDevice.
    pub fn al_event(&self) -> u32 {
        self.segment.sub_devices()[0].esc().al_event()
    }

    /// FPRD; the data if the working counter is 1.
    pub fn fprd(&mut self, station: u16, register: u16, length: usize) -> Option<Vec<u8>> {
        let answer = self.send(Command::Fprd, Address::station(station, register), &vec![0; length]);
        (answer.counter == 1).then_some(answer.data)
    }

    /// FPRD of a number of up to 8 bytes, of a register that must be there.
    pub fn number_at(&mut self, station: u16, register: u16, length: usize) -> u64 {
        let data = self.fprd(station, register, length).expect("register is there");
        data.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
    }

    /// FPWR; its working counter.
    pub fn fpwr(&mut self, station: u16, register: u16, data: &[u8]) -> u16 {
        self.send(Command::Fpwr, Address::station(station, register), data).counter
    }

    /// APWR; its working counter.
    pub fn apwr(&mut self, position: u16, register: u16, data: &[u8]) -> u16 {
        self.send(Command::Apwr, Address::position(position, register), data).counter
    }
}

/// The eight registers of a SyncManager.
pub fn sync_manager(start: u16, length: u16, control: u8) -> [u8; 8] {
    let ([a, b], [c, d]) = (start.to_le_bytes(), length.to_le_bytes());
    [a, b, c, d, control, 0, 1, 0]
}

/// The sixteen registers of an FMMU: logical start, length, its bits, physical start, its bit, type.
pub fn fmmu(logical: u32, length: u16, bits: [u8; 2], physical: u16, physical_bit: u8, kind: u8) -> [u8; 16] {
    let mut registers = [0; 16];
    registers[0..4].copy_from_slice(&logical.to_le_bytes());
    registers[4..6].copy_from_slice(&length.to_le_bytes());
    (registers[6], registers[7]) = bits.into();
    registers[8..10].copy_from_slice(&physical.to_le_bytes());
    (registers[10], registers[11], registers[12]) = (physical_bit, kind, 1);
    registers
}
