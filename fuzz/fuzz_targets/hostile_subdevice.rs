//! A SubDevice that lies: any bytes in mailboxes, SII and registers, any counters, at any time, from bring-up to OP.
//!
//! Nothing may panic, nothing may hang, and what is called a success must have been delivered.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat::cyclic::{ClockDirection, Goal, Phase, TransitionOptions};
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, Datagrams};
use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions, Exchange};
use omnibase_ethercat_sim::{SegmentFile, SimLink, in_process};

/// Cycles behind the set-up.
const CYCLES: u32 = 400;
/// No set-up may take longer in virtual time, whatever is answered.
const LONGEST: Duration = Duration::from_secs(600);

/// The honest segment, and the lies that are told in its name.
struct Liar<'a> {
    inner: SimLink,
    lies: &'a [u8],
    delivered: usize,
    last: Vec<u8>,
}

impl Liar<'_> {
    fn take(&mut self) -> Option<u8> {
        let (first, rest) = self.lies.split_first()?;
        self.lies = rest;
        Some(*first)
    }

    /// Which datagram, what of it, and the bytes; `None` where the truth is told.
    fn lie(&mut self, frame: &mut [u8]) -> Option<()> {
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
            frame[at] = self.take()?;
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
            self.delivered += length;
            self.last = buffer[..length].to_vec();
        }
        Ok(received)
    }
}

fuzz_target!(|bytes: &[u8]| {
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
    let segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
    let (inner, clock) = in_process(segment);
    let link = Liar { inner, lies: bytes, delivered: 0, last: Vec::new() };
    let mut bus = Bus::new(link, clock.clone(), BusOptions::default());
    let is_up = bus.scan().is_ok() && bus.configure(&[]).is_ok();
    assert!(clock.now() < HostTime(0) + LONGEST, "set-up took {:?}", clock.now());
    if !is_up {
        return;
    }
    let read = bus.sdo_read(0, ObjectAddress::new(0x1008, 0), SdoAccess::Entry);
    if let Ok(name) = read {
        // Whatever it is: it came over the cable.
        assert!(name.len() <= bus.transactor().link.delivered);
    }
    let Ok(mut ready) = bus.into_cyclic(ClockDirection::CycleFollowsDc) else { return };
    let mut image = ready.bus.plan().image();
    let mut wake = ready.clock.now();
    ready.bus.request(Goal::Op, TransitionOptions::default(), wake);
    for _ in 0..CYCLES {
        wake = wake + Duration::from_millis(1);
        ready.clock.sleep_until(wake);
        let before = image.inputs.clone();
        let exchange = ready.bus.exchange(&mut image, wake + Duration::from_micros(800)).unwrap();
        match exchange {
            // Never a stale or half-taken input.
            Exchange::Lost { .. } | Exchange::ShortCount { .. } => assert_eq!(before, image.inputs),
            Exchange::Complete | Exchange::Without { .. } => {}
        }
        if ready.bus.phase() == Phase::Reached(Goal::Op) {
            ready.bus.poll_recovered();
        }
        while ready.bus.take_emergency().is_some() {}
    }
});
