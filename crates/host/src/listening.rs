//! Whether another MainDevice's frames pass at an interface, before anything is sent there.

use crate::clock::MonotonicClock;
use crate::raw::{OpenError, RawSocket, last_code, open_error, remaining_ns};
use omnibase_ethercat_wire::frame::ETHERTYPE;
use omnibase_ethercat_wire::{Clock, HostTime};
use std::mem::size_of;
use std::time::Duration;

/// How long is listened before the first frame: longer than the cycle of any MainDevice that drives something.
pub const LISTENING: Duration = Duration::from_millis(100);
/// Addresses that are told apart.
const MOST_SOURCES: usize = 8;
/// Bytes of a frame that are looked at.
const LOOKED_AT: usize = 64;

/// Where frames came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A program of this computer sent them.
    ThisComputer,
    /// They came in by the cable: another computer's, or answers to another program's.
    Cable,
}

/// EtherCAT frames that passed while nobody here had sent any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// The source address that was seen most.
    pub source: [u8; 6],
    /// Where those frames came from.
    pub origin: Origin,
    /// How many there were.
    pub frames: u32,
    /// In this time.
    pub within: Duration,
}

impl Heard {
    /// How many a second.
    pub fn rate_hz(&self) -> f64 {
        f64::from(self.frames) / self.within.as_secs_f64().max(1e-9)
    }
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b, c, d, e, g] = self.source;
        let origin = match self.origin {
            Origin::ThisComputer => "sent by this computer",
            Origin::Cable => "from the cable",
        };
        write!(
            f,
            "{} EtherCAT frames in {} ms ({:.0} a second), source {a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}, {origin}",
            self.frames,
            self.within.as_millis(),
            self.rate_hz(),
        )
    }
}

/// Listens at `interface` for EtherCAT frames of anybody, those that other programs of this computer send included;
/// `None` where there are none. Sends nothing.
pub fn listen(interface: &str, within: Duration) -> Result<Option<Heard>, OpenError> {
    let socket = RawSocket::open(interface)?;
    let _ = socket.set_option(libc::SOL_PACKET, libc::PACKET_IGNORE_OUTGOING, &0i32);
    only_ethercat(&socket).map_err(|()| open_error("choosing EtherCAT frames", interface))?;
    // Frames that leave are shown to sockets of every protocol alone.
    socket.bind_to(libc::ETH_P_ALL as u16).map_err(|operation| open_error(operation, interface))?;
    let until = HostTime(MonotonicClock.now().0 + within.as_nanos() as u64);
    let mut seen: [Option<Heard>; MOST_SOURCES] = [None; MOST_SOURCES];
    while let Some(remaining) = remaining_ns(until) {
        // Who is down hears nothing; that is said by whoever sends.
        if socket.wait(remaining).is_err() {
            break;
        }
        while let Some((source, origin)) = take(&socket) {
            let known =
                |one: &Option<Heard>| one.is_none_or(|one| (one.source, one.origin) == (source, origin));
            if let Some(place) = seen.iter_mut().find(|one| known(one)) {
                place.get_or_insert(Heard { source, origin, frames: 0, within }).frames += 1;
            }
            if remaining_ns(until).is_none() {
                break;
            }
        }
    }
    Ok(seen.into_iter().flatten().max_by_key(|one| one.frames))
}

/// The next EtherCAT datagram frame that waits at the socket: its source, and where it came from.
fn take(socket: &RawSocket) -> Option<([u8; 6], Origin)> {
    let mut frame = [0u8; LOOKED_AT];
    loop {
        // SAFETY: sockaddr_ll is plain data for which zero bytes are valid.
        let mut from: libc::sockaddr_ll = unsafe { std::mem::zeroed() };
        let mut length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
        // SAFETY: both pointers and their lengths are those of live values; no more than that is written.
        let received = unsafe {
            libc::recvfrom(
                socket.raw(),
                frame.as_mut_ptr().cast(),
                frame.len(),
                libc::MSG_DONTWAIT,
                (&raw mut from).cast(),
                &mut length,
            )
        };
        if received < 0 {
            if last_code() == libc::EINTR {
                continue;
            }
            return None;
        }
        // Type 1: datagrams. Others are no MainDevice's.
        let is_ours = received >= 16 && frame[12..14] == ETHERTYPE.to_be_bytes() && frame[15] >> 4 == 1;
        if !is_ours {
            continue;
        }
        let mut source = [0; 6];
        source.copy_from_slice(&frame[6..12]);
        let is_outgoing = from.sll_pkttype == libc::PACKET_OUTGOING;
        return Some((source, if is_outgoing { Origin::ThisComputer } else { Origin::Cable }));
    }
}

/// Has the kernel drop everything else: on a busy network the queue would be full of it.
fn only_ethercat(socket: &RawSocket) -> Result<(), ()> {
    let step = |code: u32, k: u32, jt, jf| libc::sock_filter { code: code as u16, jt, jf, k };
    let mut program = [
        step(libc::BPF_LD | libc::BPF_H | libc::BPF_ABS, 12, 0, 0),
        step(libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K, ETHERTYPE.into(), 0, 1),
        step(libc::BPF_RET | libc::BPF_K, LOOKED_AT as u32, 0, 0),
        step(libc::BPF_RET | libc::BPF_K, 0, 0, 0),
    ];
    let filter = libc::sock_fprog { len: program.len() as u16, filter: program.as_mut_ptr() };
    socket.set_option(libc::SOL_SOCKET, libc::SO_ATTACH_FILTER, &filter).map_err(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{InterfaceLock, LockError, Namespace};
    use std::sync::atomic::{AtomicBool, Ordering};

    /// A socket as other programs have it: what it sends is shown to others of this computer.
    fn another(interface: &str) -> RawSocket {
        let socket = RawSocket::open(interface).unwrap();
        socket.set_option(libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS, &0i32).unwrap();
        socket.bind_to(ETHERTYPE).unwrap();
        socket
    }

    fn send(socket: &RawSocket, frame: &[u8]) {
        // SAFETY: pointer and length are those of the live slice `frame`.
        let sent = unsafe { libc::send(socket.raw(), frame.as_ptr().cast(), frame.len(), 0) };
        assert_eq!(sent, frame.len() as isize);
    }

    #[test]
    fn frames_that_leave_and_frames_that_come_are_heard_and_others_are_not() {
        let Some(namespace) = Namespace::for_test("frames_that_leave_and_frames_that_come") else { return };
        let mut frame = [0u8; 60];
        frame[..6].fill(0xFF);
        frame[6..12].copy_from_slice(&[0x10, 0x10, 0x10, 0x10, 0x10, 0x10]);
        frame[12..16].copy_from_slice(&[0x88, 0xA4, 0x0E, 0x10]);
        let mut other = frame;
        other[12..14].copy_from_slice(&[0x08, 0x06]);
        // EtherCAT's variables for the network, of no MainDevice.
        let mut variables = frame;
        variables[15] = 0x40;
        let cases = [
            (Namespace::NEAR, frame, Some(Origin::ThisComputer)),
            (Namespace::FAR, frame, Some(Origin::Cable)),
            (Namespace::NEAR, other, None),
            (Namespace::FAR, variables, None),
        ];
        for (from, frame, expected) in cases {
            let stop = AtomicBool::new(false);
            let heard = std::thread::scope(|scope| {
                scope.spawn(|| {
                    namespace.run(|| {
                        let socket = another(from);
                        while !stop.load(Ordering::Relaxed) {
                            send(&socket, &frame);
                            std::thread::sleep(Duration::from_millis(1));
                        }
                    })
                });
                let heard = namespace.run(|| listen(Namespace::NEAR, Duration::from_millis(500)).unwrap());
                stop.store(true, Ordering::Relaxed);
                heard
            });
            assert_eq!(heard.map(|heard| heard.origin), expected, "{heard:?}");
            assert!(heard.is_none_or(|heard| heard.source == [0x10; 6] && heard.frames > 1), "{heard:?}");
        }
    }

    #[test]
    fn a_lock_is_of_one_interface_in_one_namespace_and_goes_with_its_holder() {
        let tests = "a_lock_is_of_one_interface";
        let (Some(one), Some(other)) = (Namespace::for_test(tests), Namespace::for_test(tests)) else {
            return;
        };
        let held = one.run(|| InterfaceLock::take(Namespace::NEAR).unwrap());
        let refused = one.run(|| InterfaceLock::take(Namespace::NEAR).unwrap_err());
        let LockError::Held { holder: Some(holder), .. } = &refused else { panic!("{refused}") };
        assert_eq!(holder.pid, std::process::id());
        assert!(
            refused.to_string().starts_with(&format!("`veth0` is in use by process {}", holder.pid)),
            "{refused}"
        );
        one.run(|| InterfaceLock::take(Namespace::FAR).unwrap());
        other.run(|| InterfaceLock::take(Namespace::NEAR).unwrap());
        drop(held);
        one.run(|| InterfaceLock::take(Namespace::NEAR).unwrap());
    }
}
