//! What receivers hear: on purpose wrong, late, twice, and by sockets of this machine.

mod captured;
mod clock;
mod datagram;
mod motive;
mod mouse;
mod natnet;
mod sockets;
