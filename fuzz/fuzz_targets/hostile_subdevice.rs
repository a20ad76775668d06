//! A SubDevice that lies: any bytes in mailboxes, SII and registers, any counters, at any time, from bring-up to OP, with
//! SYNC0 and SDOs of its own, and on every way back that is asked for.
//!
//! Nothing may panic, nothing may hang, and what is called a success where no lie was told has to be one.
#![no_main]

use std::sync::OnceLock;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat::cyclic::{ClockDirection, Goal, TransitionOptions, TransitionStatus};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, Datagrams};
use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions, DcConfig, Exchange, SubDeviceConfig};
use omnibase_ethercat_sim::{Fault, SegmentFile, SimLink, VirtualClock, in_process};

/// SubDevices of the segment.
const COUNT: u32 = 2;
/// Cycles behind the set-up: to OP, and a way back for each.
const CYCLES: u32 = 3000;
/// Frames of set-up and cycles together, among which the lies begin.
const BEGINNING: u16 = 4000;
/// Cycles between two SubDevices that are sent for.
const SENT_FOR_EVERY: u32 = 97;
/// No set-up may take longer in virtual time, whatever is answered.
const LONGEST: Duration = Duration::from_secs(600);

/// The honest segment, and the lies that are told in its name.
struct Liar<'a> {
    inner: SimLink,
    lies: &'a [u8],
    /// Frames that come before the first lie.
    honest: u16,
    /// Bytes in which a lie was told so far.
    told: u64,
}

impl Liar<'_> {
    fn take(&mut self) -> Option<u8> {
        let (first, rest) = self.lies.split_first()?;
        self.lies = rest;
        Some(*first)
    }

    /// Which datagram, what of it, and the bytes; `None` where the truth is told.
    fn lie(&mut self, frame: &mut [u8]) -> Option<()> {
        if self.honest > 0 {
            self.honest -= 1;
            return None;
        }
        let what = self.take()?;
        if what < 0x60 {
            return None;
        }
        let places: Vec<(usize, usize)> = Datagrams::new(frame)
            .ok()?
            .map_while(Result::ok)
            .map(|datagram| (datagram.offset + DATAGRAM_HEADER, datagram.header.length))
            .collect();
        let (start, length) = *places.get(usize::from(self.take()?) % places.len().max(1))?;
        let (from, count) = match what {
            // Anything of the data.
            0x60..0xD0 => (start + usize::from(self.take()?) % length.max(1), what & 0x1F),
            // The working counter.
            0xD0..0xF0 => (start + length, 2),
            // Anything of the frame, headers included.
            _ => (usize::from(self.take()?) % frame.len().max(1), 4),
        };
        for at in from..(from + usize::from(count)).min(frame.len()) {
            let byte = self.take()?;
            self.told += u64::from(frame[at] != byte);
            frame[at] = byte;
        }
        None
    }
}

impl Link for Liar<'_> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.inner.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let received = self.inner.receive(buffer, deadline)?;
        if let Some(length) = received {
            self.lie(&mut buffer[..length]);
        }
        Ok(received)
    }
}

/// SYNC0 and an SDO that is read back.
fn config() -> SubDeviceConfig {
    let sdo = SdoWrite {
        object: ObjectAddress::new(0x6072, 0),
        data: vec![0x2C, 0x01],
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: None,
    };
    let dc = DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 0 };
    SubDeviceConfig { dc, sdos: vec![sdo], ..SubDeviceConfig::default() }
}

const NAME: ObjectAddress = ObjectAddress::new(0x1008, 0);

/// A segment that tells these lies.
fn segment(lies: &[u8]) -> (Bus<Liar<'_>, VirtualClock>, VirtualClock) {
    let text = format!("[[subdevice]]\nkind = \"servo\"\ncount = {COUNT}\n");
    let segment = SegmentFile::parse(&text).unwrap().build(std::path::Path::new(".")).unwrap();
    let (inner, clock) = in_process(segment);
    // The first two bytes say when it begins: in set-up, in OP, or on a way back.
    let (honest, lies) = match lies {
        [low, high, lies @ ..] => (u16::from_le_bytes([*low, *high]) % BEGINNING, lies),
        _ => (0, lies),
    };
    let link = Liar { inner, lies, honest, told: 0 };
    (Bus::new(link, clock.clone(), BusOptions::default()), clock)
}

/// The name that an honest SubDevice gives.
fn true_name() -> &'static [u8] {
    static TRUTH: OnceLock<Vec<u8>> = OnceLock::new();
    TRUTH.get_or_init(|| {
        let (mut bus, _) = segment(&[]);
        bus.scan().unwrap();
        bus.configure(&[]).unwrap();
        bus.sdo_read(0, NAME, SdoAccess::Entry).unwrap()
    })
}

fuzz_target!(|bytes: &[u8]| {
    let (mut bus, clock) = segment(bytes);
    let configs: Vec<_> = (0..COUNT).map(|_| config()).collect();
    let is_up = bus.scan().is_ok() && bus.configure(&configs).is_ok();
    assert!(clock.now() < HostTime(0) + LONGEST, "set-up took {:?}", clock.now());
    if !is_up {
        assert!(bus.transactor().link.told > 0, "the truth was refused");
        return;
    }
    let told = bus.transactor().link.told;
    let read = bus.sdo_read(0, NAME, SdoAccess::Entry);
    let told_in_reading = bus.transactor().link.told - told;
    match read {
        // What was written before a lie may be anything; what is read without one is what stands there.
        Ok(read) if told_in_reading == 0 => assert_eq!(read, true_name(), "{told} lies before"),
        Err(error) => assert!(told + told_in_reading > 0, "the truth was refused: {error}"),
        Ok(_) => {}
    }
    let Ok(mut ready) = bus.into_cyclic(ClockDirection::CycleFollowsDc) else { return };
    let mut image = ready.bus.plan().image();
    let mut wake = ready.clock.now();
    ready.bus.request(Goal::Op, TransitionOptions::default(), wake);
    // How many lies had been told when each was sent for.
    let mut sent_for: [Option<u64>; COUNT as usize] = [None; COUNT as usize];
    for cycle in 0..CYCLES {
        wake = wake + Duration::from_millis(1);
        ready.clock.sleep_until(wake);
        let before = image.inputs.clone();
        let exchange = ready.bus.exchange(&mut image, wake + Duration::from_micros(800)).unwrap();
        match exchange {
            // Never a stale or half-taken input.
            Exchange::Lost { .. } | Exchange::ShortCount { .. } => assert_eq!(before, image.inputs),
            Exchange::Complete | Exchange::Without { .. } => {}
        }
        match ready.bus.transition() {
            TransitionStatus::Failed(error) => {
                assert!(ready.bus.link().told > 0, "the truth was refused: {error}");
                return;
            }
            TransitionStatus::Reached(Goal::Op) if cycle % SENT_FOR_EVERY == 0 => {
                let (number, round) = (cycle / SENT_FOR_EVERY % COUNT, cycle / SENT_FOR_EVERY / COUNT);
                if ready.bus.recover(number as u16) {
                    let link = ready.bus.link_mut();
                    sent_for[number as usize] = Some(link.told);
                    // Every second time it started anew.
                    if round % 2 == 1 {
                        let segment = link.inner.segment_mut();
                        segment.inject(number as usize, Fault::PowerOff).unwrap();
                        segment.inject(number as usize, Fault::PowerOn).unwrap();
                    }
                }
            }
            _ => {}
        }
        while let Some((position, ended)) = ready.bus.poll_recovered() {
            let link = ready.bus.link();
            let is_true = sent_for[usize::from(position)].take() == Some(link.told);
            let esc = link.inner.segment().sub_devices()[usize::from(position)].esc();
            assert!(ended.is_ok() || link.told > 0, "the truth was refused: {ended:?}");
            if is_true && ended.is_ok() {
                assert_eq!(esc.peek(0x0130, 1), Some(&[8][..]), "SubDevice {position} is called back in OP");
            }
        }
        while ready.bus.take_emergency().is_some() {}
    }
});
