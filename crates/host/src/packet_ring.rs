//! The memory-mapped port: PACKET_RX_RING and PACKET_TX_RING.
//!
//! Layout of the mapping (TPACKET_V2; version 3 hands frames over in blocks with a timer of milliseconds, which
//! is good for throughput and bad for a cycle):
//!
//! ```text
//! | receive slot 0 | ... | receive slot n-1 | send slot 0 | ... | send slot m-1 |      each SLOT bytes
//! slot: | tpacket2_hdr: status, len, snaplen, mac, ... | frame |
//! ```
//!
//! A slot belongs to the kernel or to the process, and its status word says to whom. Who gives a slot away writes
//! the status with release order, who takes it reads the status with acquire order; nobody touches the rest of a
//! slot that isn't theirs.

use crate::clock::MonotonicClock;
use crate::interface::LinkState;
use crate::look::{Look, LooksFirst};
use crate::raw::{DropCounts, OpenError, RawSocket, check_length, open_error, remaining_ns};
use omnibase_ethercat_wire::frame::{ETHERNET_HEADER, MAX_FRAME};
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};
use std::marker::PhantomData;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};

/// Bytes of a slot: header, address, alignment and the largest frame.
const SLOT: usize = 2048;
/// Bytes of a ring's block, which the kernel allocates in one piece.
const BLOCK: usize = 65536;
/// Slots of the receive ring.
const RECEIVE_SLOTS: usize = 512;
/// Slots of the send ring. Over a veth the partner reads a frame from its send slot: this many sends later the
/// slot is used again.
const SEND_SLOTS: usize = 256;
/// Where a frame stands in a send slot.
const SEND_OFFSET: usize = libc::TPACKET2_HDRLEN - size_of::<libc::sockaddr_ll>();
/// How a receive waits for its frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Waiting {
    /// Looks at the ring for as long as frames usually take, a quarter of the time until the deadline at most, then sleeps
    /// in `ppoll` until the frame or the deadline comes: one system call per cycle with the send where the frame comes as
    /// usual, else two. Where looking doesn't pay, it sleeps at once.
    #[default]
    Sleep,
    /// Looks at the ring until the frame or the deadline comes: no system call, and a CPU fully used meanwhile.
    BusyPoll,
}

/// Sends and receives frames through rings shared with the kernel.
#[derive(Debug)]
pub struct PacketRing {
    // Before the mapping: the socket may be closed first, the mapping keeps the rings alive.
    socket: RawSocket,
    map: Mapping,
    receive_slot: usize,
    send_slot: usize,
    waiting: Waiting,
    look: Look,
    /// The kernel's stamp of the frame that was taken last, ns since 1970-01-01 UTC.
    stamp_unix_ns: Option<u64>,
}

impl PacketRing {
    /// Lets tcpdump and the like on this machine see the frames that leave, too; sending takes a little longer.
    pub fn let_taps_see(&self) {
        self.socket.let_taps_see();
    }

    /// Opens `interface` for EtherCAT frames, promiscuously, with mapped rings (1.5 MiB of kernel memory).
    pub fn open(interface: &str, waiting: Waiting) -> Result<Self, OpenError> {
        let socket = RawSocket::open(interface)?;
        let version = libc::tpacket_versions::TPACKET_V2 as i32;
        socket.require_option(libc::PACKET_VERSION, &version, "choosing ring version 2")?;
        // A frame that the kernel finds malformed shall not block the slots behind it.
        let _ = socket.set_option(libc::SOL_PACKET, libc::PACKET_LOSS, &1i32);
        let ring = |slots: usize| libc::tpacket_req {
            tp_block_size: BLOCK as u32,
            tp_block_nr: (slots * SLOT / BLOCK) as u32,
            tp_frame_size: SLOT as u32,
            tp_frame_nr: slots as u32,
        };
        socket.require_option(libc::PACKET_RX_RING, &ring(RECEIVE_SLOTS), "making the receive ring")?;
        socket.require_option(libc::PACKET_TX_RING, &ring(SEND_SLOTS), "making the send ring")?;
        let map = Mapping::new(&socket, (RECEIVE_SLOTS + SEND_SLOTS) * SLOT)?;
        socket.bind()?;
        Ok(PacketRing {
            socket,
            map,
            receive_slot: 0,
            send_slot: 0,
            waiting,
            look: Look::default(),
            stamp_unix_ns: None,
        })
    }

    /// The interface's name.
    pub fn interface(&self) -> &str {
        self.socket.interface()
    }

    /// Whether frames can pass at this moment.
    pub fn link_state(&self) -> LinkState {
        self.socket.link_state()
    }

    /// Frames lost in this host so far.
    pub fn drop_counts(&mut self) -> DropCounts {
        self.socket.drop_counts()
    }

    /// Takes the frame in the next receive slot, if the kernel has filled it.
    #[inline]
    fn taken(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let slot = self.map.receive_slot(self.receive_slot);
        if !slot.is_filled() {
            return None;
        }
        let frame = slot.received();
        let fits = frame.len() <= buffer.len().min(MAX_FRAME);
        let length = frame.len();
        self.stamp_unix_ns = Some(slot.stamp_unix_ns());
        if fits {
            buffer[..length].copy_from_slice(frame);
        }
        slot.status().store(libc::TP_STATUS_KERNEL, Ordering::Release);
        self.receive_slot = (self.receive_slot + 1) % RECEIVE_SLOTS;
        if !fits {
            self.socket.drops.oversized += 1;
            return self.taken(buffer);
        }
        Some(length)
    }
}

impl LooksFirst for PacketRing {
    /// A look at the clock costs about ten at the ring: half a microsecond to three, by the processor's pause.
    const LOOKS_PER_CLOCK: u32 = 64;
    const PAUSES_PER_LOOK: u32 = 1;

    fn learnt(&mut self) -> &mut Look {
        &mut self.look
    }

    #[inline]
    fn take(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, LinkError> {
        Ok(self.taken(buffer))
    }

    fn sleep(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        while let Some(remaining) = remaining_ns(deadline) {
            let events = self.socket.wait(remaining)?;
            if let Some(length) = self.taken(buffer) {
                return Ok(Some(length));
            }
            if events & (libc::POLLERR | libc::POLLHUP) != 0 {
                // The poll would come back at once for ever: fetch the error.
                self.socket.receive_failed(self.socket.take_error())?;
            }
        }
        Ok(None)
    }
}

impl Link for PacketRing {
    fn is_connected(&self) -> Option<bool> {
        Some(self.socket.link_state() == LinkState::Up)
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        check_length(frame)?;
        if frame.len() < ETHERNET_HEADER {
            return Err(LinkError::System {
                operation: "sending a frame without header",
                code: libc::EINVAL,
            });
        }
        let slot = self.map.send_slot(self.send_slot);
        let busy = libc::TP_STATUS_SEND_REQUEST | libc::TP_STATUS_SENDING;
        if slot.status().load(Ordering::Acquire) & busy != 0 {
            self.socket.drops.send_queue_full += 1;
            return Ok(());
        }
        slot.fill(frame);
        slot.status().store(libc::TP_STATUS_SEND_REQUEST, Ordering::Release);
        let send = || {
            // SAFETY: no data is passed; the kernel sends what the ring holds.
            unsafe { libc::send(self.socket.raw(), std::ptr::null(), 0, libc::MSG_DONTWAIT) >= 0 }
        };
        let sent = send() || (self.socket.send_again() && send());
        let result = if sent { Ok(()) } else { self.socket.send_failed(frame.len()) };
        // A refused frame stays in its slot and would leave with the next send, as stale outputs: take it back.
        // The kernel then still waits at this slot, else it has gone on to the next one.
        let taken_back = !sent
            && slot
                .status()
                .compare_exchange(
                    libc::TP_STATUS_SEND_REQUEST,
                    libc::TP_STATUS_AVAILABLE,
                    Ordering::AcqRel,
                    Ordering::Acquire,
                )
                .is_ok();
        if !taken_back {
            self.send_slot = (self.send_slot + 1) % SEND_SLOTS;
        }
        result
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        if let Some(length) = self.taken(buffer) {
            return Ok(Some(length));
        }
        let now = &mut || MonotonicClock.now();
        let wait = [now(), deadline];
        if wait[0] >= deadline {
            return Ok(None);
        }
        let received = match self.waiting {
            Waiting::BusyPoll => self.spin(buffer, wait, now)?,
            Waiting::Sleep => self.look_then_sleep(buffer, wait, now)?,
        };
        if received.is_none() {
            self.socket.check_link(MonotonicClock.now())?;
        }
        Ok(received)
    }

    fn arrival(&self) -> Option<HostTime> {
        self.stamp_unix_ns.map(|stamp| MonotonicClock.instant_of_unix(stamp))
    }
}

/// The memory of both rings.
#[derive(Debug)]
struct Mapping {
    start: NonNull<u8>,
    length: usize,
}

// SAFETY: the mapping belongs to one value; no thread-local state of the kernel hangs on it.
unsafe impl Send for Mapping {}

impl Mapping {
    fn new(socket: &RawSocket, length: usize) -> Result<Self, OpenError> {
        // SAFETY: a new mapping at an address that the kernel chooses; failure is looked at before use.
        let start = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                length,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                socket.raw(),
                0,
            )
        };
        match NonNull::new(start.cast()) {
            Some(pointer) if start != libc::MAP_FAILED => Ok(Mapping { start: pointer, length }),
            _ => Err(open_error("mapping the rings", socket.interface())),
        }
    }

    /// Slot `index` of the receive ring.
    #[inline]
    fn receive_slot(&self, index: usize) -> Slot<'_> {
        assert!(index < RECEIVE_SLOTS);
        self.slot(index)
    }

    /// Slot `index` of the send ring.
    #[inline]
    fn send_slot(&self, index: usize) -> Slot<'_> {
        assert!(index < SEND_SLOTS);
        self.slot(RECEIVE_SLOTS + index)
    }

    fn slot(&self, index: usize) -> Slot<'_> {
        // SAFETY: both callers keep the index below the number of slots that were mapped.
        Slot { start: unsafe { self.start.add(index * SLOT) }, map: PhantomData }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was made with this start and length, and nothing borrows it any more.
        unsafe { libc::munmap(self.start.as_ptr().cast(), self.length) };
    }
}

/// One slot of a ring, while the mapping lives.
struct Slot<'a> {
    start: NonNull<u8>,
    map: PhantomData<&'a Mapping>,
}

impl<'a> Slot<'a> {
    /// The word that says whose the slot is. It stands first in the header.
    #[inline]
    fn status(&self) -> &'a AtomicU32 {
        const { assert!(std::mem::offset_of!(libc::tpacket2_hdr, tp_status) == 0) };
        // SAFETY: slots start at multiples of SLOT in a page-aligned mapping, so the word is aligned and mapped.
        // The kernel changes it at the same time, which is what an atomic is for.
        unsafe { AtomicU32::from_ptr(self.start.as_ptr().cast()) }
    }

    /// Whether the kernel has handed this receive slot over.
    #[inline]
    fn is_filled(&self) -> bool {
        self.status().load(Ordering::Acquire) & libc::TP_STATUS_USER != 0
    }

    /// The frame in a receive slot that the kernel has handed over (the caller looked at the status).
    #[inline]
    fn received(&self) -> &'a [u8] {
        // SAFETY: the slot is ours until its status is given back, so the header and the frame don't change. The
        // kernel writes offset and length so that the frame lies in the slot; they are bounded here all the same.
        unsafe {
            let header = &*self.start.as_ptr().cast::<libc::tpacket2_hdr>();
            let offset = usize::from(header.tp_mac).min(SLOT);
            let length = (header.tp_snaplen as usize).min(SLOT - offset);
            std::slice::from_raw_parts(self.start.as_ptr().add(offset), length)
        }
    }

    /// When the kernel took in the frame of a receive slot that it has handed over, ns since 1970-01-01 UTC.
    #[inline]
    fn stamp_unix_ns(&self) -> u64 {
        // SAFETY: as in `received`: the header of a slot that is ours.
        let (seconds, nanoseconds) = unsafe {
            let header = &*self.start.as_ptr().cast::<libc::tpacket2_hdr>();
            (header.tp_sec, header.tp_nsec)
        };
        u64::from(seconds) * 1_000_000_000 + u64::from(nanoseconds)
    }

    /// Puts a frame of at most `MAX_FRAME` bytes into a send slot that is ours (the caller looked at the status).
    #[inline]
    fn fill(&self, frame: &[u8]) {
        const { assert!(SEND_OFFSET + MAX_FRAME <= SLOT) };
        let length = frame.len().min(MAX_FRAME);
        // SAFETY: the slot is ours, the frame fits behind its header, and a slice of the caller can't overlap the
        // mapping, which is private to this module. The status word is left to the caller's release store.
        unsafe {
            (&raw mut (*self.start.as_ptr().cast::<libc::tpacket2_hdr>()).tp_len).write(length as u32);
            std::ptr::copy_nonoverlapping(frame.as_ptr(), self.start.as_ptr().add(SEND_OFFSET), length);
        }
    }
}
