//! A segment behind a network interface, in real time, for any MainDevice.

use crate::segment::Segment;
use core::time::Duration;
use omnibase_ethercat_wire::frame::{ETHERTYPE, FIRST_DATAGRAM, MAX_FRAME, PROCESSED_BIT};
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// How long a wait lasts at most, so that `stop` is seen.
const LONGEST_WAIT: Duration = Duration::from_millis(50);
/// Answers that are remembered, to know them when the interface shows us what we sent.
const REMEMBERED: usize = 8;

/// What a served segment did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Frames of a MainDevice.
    pub frames: u64,
    /// Of them, those that were answered; the others were lost in the segment.
    pub answered: u64,
    /// Foreign frames, and own ones that came back.
    pub ignored: u64,
}

/// Answers the frames that come in by `link` until `stop` is set.
///
/// The segment's time goes on with `clock` from where it stands, also between frames. Answers leave at once:
/// the times of cables and chips are in the clocks of the SubDevices, but nobody waits for them here.
pub fn serve(
    segment: &mut Segment,
    link: &mut dyn Link,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> Result<Served, LinkError> {
    let (origin, start) = (clock.now(), segment.now());
    let in_segment = |host: HostTime| start + (host - origin);
    let mut served = Served::default();
    let mut sent: VecDeque<Vec<u8>> = VecDeque::with_capacity(REMEMBERED);
    let mut buffer = [0; MAX_FRAME];
    while !stop.load(Ordering::Relaxed) {
        let now = clock.now();
        segment.advance(in_segment(now));
        let wait =
            segment.next_wake().map_or(LONGEST_WAIT, |wake| (wake - in_segment(now)).min(LONGEST_WAIT));
        let Some(length) = link.receive(&mut buffer, now + wait)? else { continue };
        let frame = &mut buffer[..length.min(MAX_FRAME)];
        if !carries_datagrams(frame) || forget(&mut sent, frame) {
            served.ignored += 1;
            continue;
        }
        served.frames += 1;
        if segment.process(frame, in_segment(clock.now())).is_none() {
            continue;
        }
        served.answered += 1;
        if sent.len() == REMEMBERED {
            sent.pop_front();
        }
        sent.push_back(frame.to_vec());
        link.send(frame)?;
    }
    Ok(served)
}

fn carries_datagrams(frame: &[u8]) -> bool {
    frame.len() >= FIRST_DATAGRAM && frame[12..14] == ETHERTYPE.to_be_bytes()
}

/// Whether `frame` is one that we sent. A MainDevice may have a locally administered address itself, so the bit
/// in the source address isn't enough.
fn forget(sent: &mut VecDeque<Vec<u8>>, frame: &[u8]) -> bool {
    if frame[6] & PROCESSED_BIT == 0 {
        return false;
    }
    match sent.iter().position(|own| own == frame) {
        Some(at) => sent.remove(at).is_some(),
        None => false,
    }
}
