//! The plain port: `send` and `recv` on a packet socket.

use crate::clock::MonotonicClock;
use crate::interface::LinkState;
use crate::raw::{DropCounts, OpenError, RawSocket, check_length, last_code, remaining_ns};
use omnibase_ethercat_wire::frame::MAX_FRAME;
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError};

/// Sends and receives frames with one system call each.
///
/// The kernel counts a receive time-out in its own ticks (1 to 10 ms) and rounds it up. So the time-out is set only
/// when the wanted one needs more ticks than are set, or at least two fewer: in a steady cycle never. The price is
/// that a receive whose frame was *lost* returns up to two ticks after its deadline (one that finds its frame is
/// not delayed). [`crate::PacketRing`] keeps deadlines to the microsecond.
#[derive(Debug)]
pub struct PacketSocket {
    socket: RawSocket,
    tick_us: u64,
    timeout_ticks: u64,
}

impl PacketSocket {
    /// Opens `interface` for EtherCAT frames, promiscuously.
    pub fn open(interface: &str) -> Result<Self, OpenError> {
        let socket = RawSocket::open(interface)?;
        socket.bind()?;
        let mut port = PacketSocket { socket, tick_us: 1000, timeout_ticks: 0 };
        // The kernel hands the rounded time-out back: one microsecond becomes one tick.
        port.set_timeout_us(1).map_err(|code| OpenError::System {
            operation: "setting the receive time-out",
            interface: interface.to_owned(),
            code,
        })?;
        port.tick_us = port.timeout_us().max(1);
        port.timeout_ticks = 1;
        Ok(port)
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

    fn set_timeout_us(&self, timeout_us: u64) -> Result<(), i32> {
        let value = libc::timeval {
            tv_sec: (timeout_us / 1_000_000) as libc::time_t,
            tv_usec: (timeout_us % 1_000_000) as libc::suseconds_t,
        };
        self.socket
            .set_option(libc::SOL_SOCKET, libc::SO_RCVTIMEO, &value)
            .map_err(|error| error.raw_os_error().unwrap_or(0))
    }

    fn timeout_us(&self) -> u64 {
        // SAFETY: timeval is plain data, its length is given, and the kernel writes no more than that.
        unsafe {
            let mut value: libc::timeval = std::mem::zeroed();
            let mut length = size_of::<libc::timeval>() as libc::socklen_t;
            libc::getsockopt(
                self.socket.raw(),
                libc::SOL_SOCKET,
                libc::SO_RCVTIMEO,
                (&raw mut value).cast(),
                &mut length,
            );
            value.tv_sec as u64 * 1_000_000 + value.tv_usec as u64
        }
    }

    /// Makes a blocking receive last at least `remaining_ns`, and not two ticks longer than needed.
    fn prepare_timeout(&mut self, remaining_ns: u64) -> Result<(), LinkError> {
        let wanted = remaining_ns.div_ceil(self.tick_us * 1000).max(1);
        if self.timeout_ticks == wanted || self.timeout_ticks == wanted + 1 {
            return Ok(());
        }
        self.set_timeout_us(wanted * self.tick_us)
            .map_err(|code| LinkError::System { operation: "setting the receive time-out", code })?;
        self.timeout_ticks = wanted;
        Ok(())
    }
}

impl Link for PacketSocket {
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
        let mut waited = false;
        loop {
            let flags = match remaining_ns(deadline) {
                Some(remaining) => {
                    self.prepare_timeout(remaining)?;
                    waited = true;
                    libc::MSG_TRUNC
                }
                None if waited => {
                    self.socket.check_link(MonotonicClock.now())?;
                    return Ok(None);
                }
                None => libc::MSG_TRUNC | libc::MSG_DONTWAIT,
            };
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
                    if flags & libc::MSG_DONTWAIT != 0 && code == libc::EAGAIN {
                        return Ok(None);
                    }
                }
            }
        }
    }
}
