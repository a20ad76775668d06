//! What both ports share: opening, binding and watching a packet socket.

use crate::clock::{MonotonicClock, timespec};
use crate::interface::{self, LinkState};
use omnibase_ethercat_wire::frame::{ETHERTYPE, MAX_FRAME};
use omnibase_ethercat_wire::{Clock, HostTime, LinkError};
use std::io;
use std::mem::size_of;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

/// Why a port could not be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// The process may not open packet sockets.
    #[error(
        "no right to send raw frames on `{interface}`: the capability CAP_NET_RAW is missing; \
         grant it with `{}` or run as root",
        crate::real_time::grant(program)
    )]
    MissingRights {
        /// The interface that was wanted.
        interface: String,
        /// The program to which the capability has to be given.
        program: String,
    },
    /// There is no interface of this name.
    #[error("no network interface `{interface}`; there are: {}", listed(.existing))]
    NoSuchInterface {
        /// The interface that was wanted.
        interface: String,
        /// The interfaces that exist.
        existing: Vec<String>,
    },
    /// The operating system refused a step.
    #[error("{operation} on `{interface}` failed: {}", io::Error::from_raw_os_error(*.code))]
    System {
        /// The step.
        operation: &'static str,
        /// The interface that was wanted.
        interface: String,
        /// `errno`.
        code: i32,
    },
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// Frames that this port lost, and where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DropCounts {
    /// Sends that the driver's queue had no room for.
    pub send_queue_full: u64,
    /// Received frames longer than EtherCAT allows.
    pub oversized: u64,
    /// Received frames that the kernel dropped because the receive buffer was full.
    pub receive_buffer_full: u64,
}

/// How often a link is asked for its state while frames stay away.
const LINK_CHECK_INTERVAL_NS: u64 = 10_000_000;

/// A bound packet socket for EtherCAT frames of one interface.
#[derive(Debug)]
pub(crate) struct RawSocket {
    descriptor: OwnedFd,
    interface: String,
    index: i32,
    next_link_check: HostTime,
    pub(crate) drops: DropCounts,
}

impl RawSocket {
    /// Opens the socket, not yet bound: until [`RawSocket::bind`] no frame comes in.
    pub(crate) fn open(interface: &str) -> Result<Self, OpenError> {
        // The protocol comes with the bind; with it here, frames of every interface would be queued until then.
        // SAFETY: socket has no memory arguments; a negative result isn't wrapped.
        let descriptor = unsafe {
            let descriptor = libc::socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_CLOEXEC, 0);
            if descriptor < 0 {
                return Err(open_error("opening a packet socket", interface));
            }
            OwnedFd::from_raw_fd(descriptor)
        };
        let Some(index) = interface::index(descriptor.as_raw_fd(), interface) else {
            return Err(OpenError::NoSuchInterface {
                interface: interface.to_owned(),
                existing: interface::names(),
            });
        };
        let socket = RawSocket {
            descriptor,
            interface: interface.to_owned(),
            index,
            next_link_check: HostTime(0),
            drops: DropCounts::default(),
        };
        // Both only save work, and old kernels or drivers may lack them.
        let _ = socket.set_option(libc::SOL_PACKET, libc::PACKET_IGNORE_OUTGOING, &1i32);
        let _ = socket.set_option(libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &1i32);
        Ok(socket)
    }

    /// Sends through the kernel's queueing layer, where other programs on this machine see frames leave.
    pub(crate) fn let_taps_see(&self) {
        // A kernel that lacks the option doesn't bypass either.
        let _ = self.set_option(libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &0i32);
    }

    /// Binds the socket to the interface and to EtherCAT frames, and lets frames of any address in.
    pub(crate) fn bind(&self) -> Result<(), OpenError> {
        self.bind_to(ETHERTYPE).map_err(|operation| open_error(operation, &self.interface))
    }

    /// Binds the socket to the interface and to a protocol, promiscuously; where it fails, the step, for which no
    /// memory is taken.
    pub(crate) fn bind_to(&self, protocol: u16) -> Result<(), &'static str> {
        // SAFETY: sockaddr_ll and packet_mreq are plain data for which zero bytes are valid.
        let (mut address, mut membership): (libc::sockaddr_ll, libc::packet_mreq) =
            unsafe { (std::mem::zeroed(), std::mem::zeroed()) };
        address.sll_family = libc::AF_PACKET as u16;
        address.sll_protocol = protocol.to_be();
        address.sll_ifindex = self.index;
        // SAFETY: the address is a whole sockaddr_ll and its length is given.
        let result = unsafe {
            libc::bind(self.raw(), (&raw const address).cast(), size_of::<libc::sockaddr_ll>() as _)
        };
        if result != 0 {
            return Err("binding the packet socket");
        }
        membership.mr_ifindex = self.index;
        membership.mr_type = libc::PACKET_MR_PROMISC as u16;
        self.set_option(libc::SOL_PACKET, libc::PACKET_ADD_MEMBERSHIP, &membership)
            .map_err(|_| "switching to promiscuous reception")
    }

    /// Sets a socket option whose value is plain data.
    pub(crate) fn set_option<T: Copy>(&self, level: i32, name: i32, value: &T) -> io::Result<()> {
        // SAFETY: the pointer and the length are those of one live value.
        let result = unsafe {
            libc::setsockopt(self.raw(), level, name, (value as *const T).cast(), size_of::<T>() as u32)
        };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }

    /// As [`RawSocket::set_option`], failing with the step's name.
    pub(crate) fn require_option<T: Copy>(
        &self,
        name: i32,
        value: &T,
        operation: &'static str,
    ) -> Result<(), OpenError> {
        self.set_option(libc::SOL_PACKET, name, value).map_err(|_| open_error(operation, &self.interface))
    }

    pub(crate) fn raw(&self) -> i32 {
        self.descriptor.as_raw_fd()
    }

    pub(crate) fn interface(&self) -> &str {
        &self.interface
    }

    pub(crate) fn link_state(&self) -> LinkState {
        interface::link_state_with(self.raw(), &self.interface)
    }

    /// What an error of a send means: a full queue is a lost frame, not a lost link.
    pub(crate) fn send_failed(&mut self, length: usize) -> Result<(), LinkError> {
        match last_code() {
            libc::ENOBUFS | libc::EAGAIN | libc::EINTR => {
                self.drops.send_queue_full += 1;
                Ok(())
            }
            libc::EMSGSIZE => Err(LinkError::FrameTooLong { limit: MAX_FRAME, found: length }),
            code if is_down(code) => Err(LinkError::Down),
            code => Err(LinkError::System { operation: "sending a frame", code }),
        }
    }

    /// What an error of a receive means; `Ok` for one that only says "nothing yet".
    ///
    /// The kernel tells once that the interface went down, even when it is up again by then: only a link that
    /// is down now is an error.
    pub(crate) fn receive_failed(&self, code: i32) -> Result<(), LinkError> {
        match code {
            0 | libc::EAGAIN | libc::EINTR => Ok(()),
            code if is_down(code) && self.link_state() == LinkState::Up => Ok(()),
            code if is_down(code) => Err(LinkError::Down),
            code => Err(LinkError::System { operation: "receiving a frame", code }),
        }
    }

    /// Sleeps until a frame or an error has come, `remaining_ns` at most; the events of `poll`, 0 for none.
    pub(crate) fn wait(&self, remaining_ns: u64) -> Result<libc::c_short, LinkError> {
        let mut poll = libc::pollfd { fd: self.raw(), events: libc::POLLIN, revents: 0 };
        let wait = timespec(remaining_ns);
        let wait = libc::timespec { tv_sec: wait.tv_sec, tv_nsec: wait.tv_nsec };
        // SAFETY: one live pollfd and a live timespec; no signal mask.
        if unsafe { libc::ppoll(&mut poll, 1, &wait, std::ptr::null()) } < 0 {
            self.receive_failed(last_code())?;
            return Ok(0);
        }
        Ok(poll.revents)
    }

    /// The error that waits at the socket, which is thereby cleared; 0 where there is none.
    pub(crate) fn take_error(&self) -> i32 {
        let mut code = 0i32;
        let mut length = size_of::<i32>() as libc::socklen_t;
        // SAFETY: pointer and length are those of one live integer.
        unsafe {
            libc::getsockopt(
                self.raw(),
                libc::SOL_SOCKET,
                libc::SO_ERROR,
                (&raw mut code).cast(),
                &mut length,
            )
        };
        code
    }

    /// Whether a send that just failed should be tried again: the error was the late note that the interface
    /// had been down (see [`RawSocket::receive_failed`]).
    pub(crate) fn send_again(&self) -> bool {
        is_down(last_code()) && self.link_state() == LinkState::Up
    }

    /// Says that the link is down, where it is; called when a frame stayed away, and asks the kernel now and then.
    ///
    /// An interface that was pulled out and is in again (USB) is another one for the kernel: the socket moves to it.
    pub(crate) fn check_link(&mut self, now: HostTime) -> Result<(), LinkError> {
        if now < self.next_link_check {
            return Ok(());
        }
        self.next_link_check = HostTime(now.0 + LINK_CHECK_INTERVAL_NS);
        if self.link_state() != LinkState::Up {
            return Err(LinkError::Down);
        }
        match interface::index(self.raw(), &self.interface) {
            Some(index) if index != self.index => {
                let before = std::mem::replace(&mut self.index, index);
                self.bind_to(ETHERTYPE).map_err(|_| {
                    self.index = before;
                    LinkError::Down
                })
            }
            _ => Ok(()),
        }
    }

    /// The counts, with those that the kernel kept since it was last asked.
    pub(crate) fn drop_counts(&mut self) -> DropCounts {
        // SAFETY: tpacket_stats is plain data, its length is given, and the kernel writes no more than that.
        unsafe {
            let mut statistics: libc::tpacket_stats = std::mem::zeroed();
            let mut length = size_of::<libc::tpacket_stats>() as libc::socklen_t;
            let result = libc::getsockopt(
                self.raw(),
                libc::SOL_PACKET,
                libc::PACKET_STATISTICS,
                (&raw mut statistics).cast(),
                &mut length,
            );
            if result == 0 {
                self.drops.receive_buffer_full += u64::from(statistics.tp_drops);
            }
        }
        self.drops
    }
}

/// The error number of the call that just failed.
pub(crate) fn last_code() -> i32 {
    io::Error::last_os_error().raw_os_error().unwrap_or(0)
}

fn is_down(code: i32) -> bool {
    matches!(code, libc::ENETDOWN | libc::ENETUNREACH | libc::ENXIO | libc::ENODEV)
}

/// Refuses frames that Ethernet can't carry before the kernel has to.
#[inline]
pub(crate) fn check_length(frame: &[u8]) -> Result<(), LinkError> {
    if frame.len() > MAX_FRAME {
        return Err(LinkError::FrameTooLong { limit: MAX_FRAME, found: frame.len() });
    }
    Ok(())
}

/// Nanoseconds until `deadline`; `None` where it has passed.
#[inline]
pub(crate) fn remaining_ns(deadline: HostTime) -> Option<u64> {
    deadline.0.checked_sub(MonotonicClock.now().0).filter(|remaining| *remaining > 0)
}

/// The error of a step that just failed.
pub(crate) fn open_error(operation: &'static str, interface: &str) -> OpenError {
    let code = last_code();
    let interface = interface.to_owned();
    match code {
        libc::EPERM | libc::EACCES => {
            let program = std::env::current_exe()
                .map_or_else(|_| "<this program>".to_owned(), |path| path.display().to_string());
            OpenError::MissingRights { interface, program }
        }
        code => OpenError::System { operation, interface, code },
    }
}
