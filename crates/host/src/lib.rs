//! Linux under the bus: packet sockets, clocks, the real-time thread.
//!
//! - [`PacketSocket`]: frames by `send` and `recv`; works everywhere.
//! - [`PacketRing`]: frames through rings that are mapped into the process; a receive that needn't sleep needs no
//!   system call at all.
//! - [`FileLock`]: one program of ours that writes a file at a time.
//! - [`InterfaceLock`]: one program of ours at an interface at a time; [`listen`]: whether somebody else drives it.
//! - [`MonotonicClock`]: the clock that runners own.
//! - [`real_time`]: priority, locked memory and CPU of the cyclic thread, each granted or refused in words.
//! - [`doctor`]: whether the machine is fit for that, and what mends it.
//! - [`ends_with_this`]: a program of ours that doesn't outlive us, however we end.
//! - [`stop_on_signals`]: a clean end on Ctrl-C; [`typed_lines`]: what is typed meanwhile.
//! - [`interface`]: which network interfaces there are, and whether their cables are in.
//! - [`CountingAllocator`], [`Namespace`] and [`skipped`]: for tests and benches that count allocations, need a cable, or can't run.
//!
//! All `unsafe` of the project stands here, each block with the reason why it is sound. Nothing here knows what a
//! frame means.

mod allocator;
mod child;
mod clock;
pub mod doctor;
mod ethtool;
mod file_lock;
pub mod interface;
mod interface_lock;
mod listening;
mod look;
mod namespace;
mod packet_ring;
mod packet_socket;
mod raw;
pub mod real_time;
mod skipped;
mod stop;
mod typed;

pub use allocator::CountingAllocator;
pub use child::ends_with_this;
pub use clock::MonotonicClock;
pub use ethtool::EthtoolError;
pub use file_lock::{FileLock, FileLockError};
pub use interface::LinkState;
pub use interface_lock::{Holder, InterfaceLock, LockError};
pub use listening::{Heard, LISTENING, Origin, listen};
pub use namespace::{Namespace, NamespaceError};
pub use packet_ring::{PacketRing, Waiting};
pub use packet_socket::PacketSocket;
pub use raw::{DropCounts, OpenError};
pub use skipped::skipped;
pub use stop::stop_on_signals;
pub use typed::typed_lines;

/// Whether this program runs as root.
pub fn is_root() -> bool {
    rustix::process::geteuid().is_root()
}
