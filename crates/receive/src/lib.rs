//! What the receivers of a robot's sources hear: motion capture by plain datagrams or NatNet, and optical mice by evdev.
//!
//! - [`datagram`]: [`PoseDatagram`](datagram::PoseDatagram), the plain form, and what becomes of one.
//! - [`natnet`]: the stream of OptiTrack's Motive: its frames, who is in them, and the talk with it.
//! - [`mouse`]: from the events of a mouse to its way.
//! - [`clock`]: [`ClockMap`], instants of another clock on ours, with a measured bound.
//! - [`receiver`]: [`Receiver`], one of them with its socket or device.
//! - [`threads`]: [`Receivers`], a thread each, beside the cycle.
//!
//! Bytes from outside become a value once, behind a length check. Whoever dies, hangs or lies here is a source that is
//! silent or refused; the cycle never waits for it. Time is an argument but in `threads`.
#![forbid(unsafe_code)]

pub mod clock;
mod cursor;
pub mod datagram;
pub mod mouse;
mod moving;
pub mod natnet;
mod numbers;
pub mod receiver;
pub mod threads;

pub use clock::{ClockMap, Mapped};
pub use receiver::Receiver;
pub use threads::{Receivers, Seat};
