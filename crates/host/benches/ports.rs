//! Round trip and CPU per cycle of both ports beside bare loops without any of their checks, over a veth pair whose
//! far end echoes: `cargo bench -p omnibase-host`. Needs root (a network namespace); says so and ends without.
//!
//! The candidates take turns, so that what else the machine does hits all of them.

use omnibase_ethercat_wire::frame::FrameBuilder;
use omnibase_ethercat_wire::{Address, Clock, Command, HostTime, Link};
use omnibase_host::{MonotonicClock, Namespace, PacketRing, PacketSocket, Waiting};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Rounds, and cycles of each candidate in one round.
const ROUNDS: usize = 40;
const CYCLES: usize = 1000;
const SLOT: usize = 2048;
const SLOTS: usize = 256;

/// A packet socket with mapped rings and nothing else: no bounds, no deadline, no drop counts.
struct BareRing {
    socket: i32,
    map: *mut u8,
    receive: usize,
    send: usize,
}

fn bare_socket(interface: &str, rings: bool) -> (i32, *mut u8) {
    let name = std::ffi::CString::new(interface).unwrap();
    // SAFETY: plain system calls on a socket of our own with live values; each result is checked.
    unsafe {
        let socket = libc::socket(libc::AF_PACKET, libc::SOCK_RAW, 0);
        assert!(socket >= 0);
        let set = |name: i32, value: *const libc::c_void, length: usize| {
            assert_eq!(libc::setsockopt(socket, libc::SOL_PACKET, name, value, length as u32), 0);
        };
        set(libc::PACKET_QDISC_BYPASS, (&raw const ONE).cast(), 4);
        let mut map: *mut u8 = std::ptr::null_mut();
        if rings {
            set(libc::PACKET_VERSION, (&raw const ONE).cast(), 4);
            let ring = libc::tpacket_req {
                tp_block_size: 65536,
                tp_block_nr: (SLOTS * SLOT / 65536) as u32,
                tp_frame_size: SLOT as u32,
                tp_frame_nr: SLOTS as u32,
            };
            set(libc::PACKET_RX_RING, (&raw const ring).cast(), size_of_val(&ring));
            set(libc::PACKET_TX_RING, (&raw const ring).cast(), size_of_val(&ring));
            let protection = libc::PROT_READ | libc::PROT_WRITE;
            let length = 2 * SLOTS * SLOT;
            map = libc::mmap(std::ptr::null_mut(), length, protection, libc::MAP_SHARED, socket, 0).cast();
            assert_ne!(map.cast::<libc::c_void>(), libc::MAP_FAILED);
        }
        let mut address: libc::sockaddr_ll = std::mem::zeroed();
        address.sll_family = libc::AF_PACKET as u16;
        address.sll_protocol = 0x88A4u16.to_be();
        address.sll_ifindex = libc::if_nametoindex(name.as_ptr()) as i32;
        let length = size_of::<libc::sockaddr_ll>() as u32;
        assert_eq!(libc::bind(socket, (&raw const address).cast(), length), 0);
        (socket, map)
    }
}

static ONE: i32 = 1;

impl BareRing {
    fn open(interface: &str) -> Self {
        let (socket, map) = bare_socket(interface, true);
        BareRing { socket, map, receive: 0, send: 0 }
    }

    fn slot(&self, number: usize) -> (*mut u8, &AtomicU32) {
        // SAFETY: numbers are below the slots that were mapped; the status word stands first and is aligned.
        unsafe {
            let start = self.map.add(number * SLOT);
            (start, AtomicU32::from_ptr(start.cast()))
        }
    }

    fn send(&mut self, frame: &[u8]) {
        let (start, status) = self.slot(SLOTS + self.send);
        // SAFETY: the slot was given back by the kernel many sends ago; the frame fits.
        unsafe {
            (&raw mut (*start.cast::<libc::tpacket2_hdr>()).tp_len).write(frame.len() as u32);
            start.add(32).copy_from_nonoverlapping(frame.as_ptr(), frame.len());
            status.store(libc::TP_STATUS_SEND_REQUEST, Ordering::Release);
            libc::send(self.socket, std::ptr::null(), 0, libc::MSG_DONTWAIT);
        }
        self.send = (self.send + 1) % SLOTS;
    }

    fn poll(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let (start, status) = self.slot(self.receive);
        if status.load(Ordering::Acquire) & libc::TP_STATUS_USER == 0 {
            std::hint::spin_loop();
            return None;
        }
        // SAFETY: the slot is ours until its status is given back.
        let length = unsafe {
            let header = &*start.cast::<libc::tpacket2_hdr>();
            let length = header.tp_snaplen as usize;
            buffer.as_mut_ptr().copy_from_nonoverlapping(start.add(usize::from(header.tp_mac)), length);
            length
        };
        status.store(libc::TP_STATUS_KERNEL, Ordering::Release);
        self.receive = (self.receive + 1) % SLOTS;
        Some(length)
    }
}

/// One way of sending a frame and waiting for its echo.
trait Candidate {
    fn cycle(&mut self, frame: &[u8], buffer: &mut [u8]);
}

impl Candidate for BareRing {
    fn cycle(&mut self, frame: &[u8], buffer: &mut [u8]) {
        self.send(frame);
        while self.poll(buffer).is_none() {}
    }
}

// An open socket gets a copy of every echo: candidates that have had their turn must be gone.
impl Drop for BareRing {
    fn drop(&mut self) {
        // SAFETY: mapping and socket are this value's own.
        unsafe {
            libc::munmap(self.map.cast(), 2 * SLOTS * SLOT);
            libc::close(self.socket);
        }
    }
}

struct BareSocket(i32);

impl Drop for BareSocket {
    fn drop(&mut self) {
        // SAFETY: the socket is this value's own.
        unsafe { libc::close(self.0) };
    }
}

impl Candidate for BareSocket {
    fn cycle(&mut self, frame: &[u8], buffer: &mut [u8]) {
        // SAFETY: pointers and lengths are those of live slices.
        unsafe {
            libc::send(self.0, frame.as_ptr().cast(), frame.len(), 0);
            libc::recv(self.0, buffer.as_mut_ptr().cast(), buffer.len(), 0);
        }
    }
}

struct Ours(Box<dyn Link>);

impl Candidate for Ours {
    fn cycle(&mut self, frame: &[u8], buffer: &mut [u8]) {
        self.0.send(frame).unwrap();
        let deadline = HostTime(MonotonicClock.now().0 + 1_000_000_000);
        self.0.receive(buffer, deadline).unwrap().expect("an echo within a second");
    }
}

/// CPU time of this thread, ns: in the program and in the kernel.
fn cpu_ns() -> u64 {
    // SAFETY: timespec is plain data that clock_gettime fills.
    let time = unsafe {
        let mut time: libc::timespec = std::mem::zeroed();
        libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time);
        time
    };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

fn measure() {
    let near = Namespace::NEAR;
    let mut names = vec![
        "bare ring, polled",
        "PacketRing, busy poll",
        "PacketRing, sleep",
        "bare send + recv",
        "PacketSocket",
    ];
    let open = |name: &str| -> Box<dyn Candidate> {
        match name {
            "bare ring, polled" => Box::new(BareRing::open(near)),
            "PacketRing, busy poll" => {
                Box::new(Ours(Box::new(PacketRing::open(near, Waiting::BusyPoll).unwrap())))
            }
            "PacketRing, sleep" => Box::new(Ours(Box::new(PacketRing::open(near, Waiting::Sleep).unwrap()))),
            "bare send + recv" => Box::new(BareSocket(bare_socket(near, false).0)),
            _ => Box::new(Ours(Box::new(PacketSocket::open(near).unwrap()))),
        }
    };
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Frmw, 0, Address::station(0x1001, 0x0910), 8).unwrap();
    frame.push_zeros(Command::Lwr, 1, Address::Logical(0), 60).unwrap();
    frame.push_zeros(Command::Lrd, 2, Address::Logical(60), 60).unwrap();
    let mut buffer = [0; SLOT];
    let mut round_trips = vec![Vec::with_capacity(ROUNDS * CYCLES); names.len()];
    let mut cpu = vec![Vec::with_capacity(ROUNDS); names.len()];
    for _ in 0..ROUNDS {
        for (number, name) in names.iter().enumerate() {
            let mut candidate = open(name);
            for _ in 0..50 {
                candidate.cycle(frame.bytes(), &mut buffer);
            }
            let before = cpu_ns();
            for _ in 0..CYCLES {
                let start = MonotonicClock.now();
                candidate.cycle(frame.bytes(), &mut buffer);
                round_trips[number].push(MonotonicClock.now().0 - start.0);
            }
            cpu[number].push((cpu_ns() - before) / CYCLES as u64);
        }
    }
    println!("one frame of {} bytes", frame.bytes().len());
    println!("{:<24} {:>10} {:>10} {:>10} {:>14}", "", "min us", "p50 us", "p99 us", "CPU us/cycle");
    for (number, name) in names.drain(..).enumerate() {
        let times = &mut round_trips[number];
        times.sort_unstable();
        cpu[number].sort_unstable();
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] as f64 / 1000.0;
        let cpu = cpu[number][ROUNDS / 2] as f64 / 1000.0;
        println!("{name:<24} {:>10.2} {:>10.2} {:>10.2} {cpu:>14.2}", at(0.0), at(0.5), at(0.99));
    }
}

fn main() {
    let namespace = match Namespace::new() {
        Ok(namespace) => namespace,
        Err(error) => {
            println!("SKIPPED: {error}");
            return;
        }
    };
    let (stop, ready) = (AtomicBool::new(false), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            namespace.run(|| {
                let mut echo = BareRing::open(Namespace::FAR);
                ready.store(true, Ordering::Release);
                let mut buffer = [0; SLOT];
                while !stop.load(Ordering::Relaxed) {
                    if let Some(length) = echo.poll(&mut buffer) {
                        echo.send(&buffer[..length]);
                    }
                }
            });
        });
        while !ready.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
        let measured = std::panic::catch_unwind(|| namespace.run(measure));
        stop.store(true, Ordering::Relaxed);
        if let Err(panic) = measured {
            std::panic::resume_unwind(panic);
        }
    });
}
