//! The plain port: `send` and `recv` on a packet socket.

use crate::clock::MonotonicClock;
use crate::interface::LinkState;
use crate::look::{Look, LooksFirst};
use crate::raw::{DropCounts, OpenError, RawSocket, check_length, last_code, remaining_ns};
use omnibase_ethercat_wire::frame::MAX_FRAME;
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};

/// One `send` for each frame, and `recv` again and again for as long as frames usually take, a quarter of the time until the
/// deadline at most; then `ppoll` waits. Where looking doesn't pay, `ppoll` and `recv` once.
///
/// The wait has a system call of its own because the kernel counts the time-out of a receive in its own ticks (1 to
/// 10 ms): without it the first lost frame would stop the cycle for several periods. [`crate::PacketRing`] needs no
/// `recv`.
#[derive(Debug)]
pub struct PacketSocket {
    socket: RawSocket,
    look: Look,
}

impl PacketSocket {
    /// Opens `interface` for EtherCAT frames, promiscuously.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let socket = RawSocket::open(interface)?;
        socket.bind()?;
        Ok(PacketSocket { socket, look: Look::default() })
    }

    /// Lets tcpdump and the like on this machine see the frames that leave, too; sending takes a little longer.
    pub fn let_taps_see(&self) {
        self.socket.let_taps_see();
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
}

impl LooksFirst for PacketSocket {
    // A look is a system call, which costs ten times as much as the clock.
    const LOOKS_PER_CLOCK: u32 = 1;
    const PAUSES_PER_LOOK: u32 = 4;

    fn learnt(&mut self) -> &mut Look {
        &mut self.look
    }

    fn take(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, LinkError> {
        loop {
            let flags = libc::MSG_TRUNC | libc::MSG_DONTWAIT;
            // SAFETY: pointer and length are those of the live slice `buffer`; with MSG_TRUNC the result may be
            // larger than the buffer, but no more than the buffer is written.
            let received =
                unsafe { libc::recv(self.socket.raw(), buffer.as_mut_ptr().cast(), buffer.len(), flags) };
            match usize::try_from(received) {
                Ok(length) if length <= buffer.len().min(MAX_FRAME) => return Ok(Some(length)),
                Ok(_) => self.socket.drops.oversized += 1,
                Err(_) => {
                    let code = last_code();
                    self.socket.receive_failed(code)?;
                    if code == libc::EAGAIN {
                        return Ok(None);
                    }
                }
            }
        }
    }

    fn sleep(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        while let Some(remaining) = remaining_ns(deadline) {
            self.socket.wait(remaining)?;
            let taken = self.take(buffer)?;
            if taken.is_some() {
                return Ok(taken);
            }
        }
        Ok(None)
    }
}

impl Link for PacketSocket {
    fn is_connected(&self) -> Option<bool> {
        Some(self.socket.link_state() == LinkState::Up)
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        check_length(frame)?;
        let send = || {
            // SAFETY: pointer and length are those of the live slice `frame`.
            unsafe { libc::send(self.socket.raw(), frame.as_ptr().cast(), frame.len(), libc::MSG_DONTWAIT) }
        };
        if send() >= 0 || (self.socket.send_again() && send() >= 0) {
            return Ok(());
        }
        self.socket.send_failed(frame.len())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let now = &mut || MonotonicClock.now();
        let wait = [now(), deadline];
        let received = match wait[0] < deadline {
            true => self.look_then_sleep(buffer, wait, now)?,
            false => return self.take(buffer),
        };
        if received.is_none() {
            self.socket.check_link(now())?;
        }
        Ok(received)
    }
}
