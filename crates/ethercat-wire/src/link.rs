//! The link to the segment: two functions.

use crate::time::HostTime;

/// Why the link can't do it. A frame that doesn't come back isn't an error of the link.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// The interface is down, unplugged, or its cable is out: what is sent is lost, until it is back.
    #[error("the link is down")]
    Down,
    /// The operating system refused; `code` is its error number.
    #[error("{operation} failed with operating system error {code}")]
    System {
        /// What was tried.
        operation: &'static str,
        /// `errno`.
        code: i32,
    },
    /// The frame is longer than Ethernet carries.
    #[error("frame of {found} bytes is longer than {limit}")]
    FrameTooLong {
        /// The largest frame.
        limit: usize,
        /// The frame's length.
        found: usize,
    },
}

/// How a ring is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RingState {
    /// Nothing came back yet.
    #[default]
    Unknown,
    /// Frames go all the way round.
    Whole,
    /// Frames turn at a break. With one break both numbers are the same: it is before the SubDevice at that position.
    Broken {
        /// SubDevices before the break, as seen from the primary interface.
        before: u16,
        /// Position of the first SubDevice behind it; those between are reached by nobody.
        behind: u16,
    },
}

/// Sends and receives whole Ethernet frames, without the checksum.
///
/// Recording, fault injection and replay are wrappers of a link.
pub trait Link {
    /// Hands one frame over; doesn't wait for the answer.
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError>;

    /// The next frame that arrived, copied into `buffer` (at least [`crate::frame::MAX_FRAME`] bytes); its length.
    ///
    /// Waits until `deadline`, then gives `None`; a deadline in the past looks once and doesn't wait. Frames
    /// come in the order of their arrival, foreign ones included: matching is the caller's work.
    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError>;

    /// When the frame that was received last came in, by the host's clock; `None` where the link doesn't know.
    ///
    /// Earlier than the end of [`Link::receive`] where the frame had to wait for its reader.
    fn arrival(&self) -> Option<HostTime> {
        None
    }

    /// How the ring is whose both ends this link holds; `None` where it has one end alone.
    fn ring(&self) -> Option<RingState> {
        None
    }

    /// Whether anything is at the other end of the cable; `None` where the link can't tell.
    ///
    /// May ask the operating system: for when nothing comes back, not for every cycle.
    fn is_connected(&self) -> Option<bool> {
        None
    }
}

impl<L: Link + ?Sized> Link for &mut L {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        (**self).send(frame)
    }
    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        (**self).receive(buffer, deadline)
    }
    fn arrival(&self) -> Option<HostTime> {
        (**self).arrival()
    }
    fn ring(&self) -> Option<RingState> {
        (**self).ring()
    }
    fn is_connected(&self) -> Option<bool> {
        (**self).is_connected()
    }
}

impl<L: Link + ?Sized> Link for alloc::boxed::Box<L> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        (**self).send(frame)
    }
    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        (**self).receive(buffer, deadline)
    }
    fn arrival(&self) -> Option<HostTime> {
        (**self).arrival()
    }
    fn ring(&self) -> Option<RingState> {
        (**self).ring()
    }
    fn is_connected(&self) -> Option<bool> {
        (**self).is_connected()
    }
}
