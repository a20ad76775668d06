//! Round trip and CPU per cycle of both ports beside bare loops without any of their checks, over a veth pair whose
//! far end echoes: `cargo bench -p omnibase-host`. Needs root (a network namespace); says so and ends without.
//!
//! The candidates take turns, so that what else the machine does hits all of them.

mod bare;

use bare::{BareRing, BareSocket};
use omnibase_ethercat_wire::frame::FrameBuilder;
use omnibase_ethercat_wire::{Address, Clock, Command, HostTime, Link};
use omnibase_host::{MonotonicClock, Namespace, PacketRing, PacketSocket, Waiting};
use std::sync::atomic::{AtomicBool, Ordering};

/// Rounds, and cycles of each candidate in one round.
const ROUNDS: usize = 40;
const CYCLES: usize = 1000;

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

impl Candidate for BareSocket {
    fn cycle(&mut self, frame: &[u8], buffer: &mut [u8]) {
        self.send(frame);
        self.receive(buffer);
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
    let mut names =
        vec!["bare ring, polled", "PacketRing, busy poll", "PacketRing", "bare send + recv", "PacketSocket"];
    let open = |name: &str| -> Box<dyn Candidate> {
        match name {
            "bare ring, polled" => Box::new(BareRing::open(near)),
            "PacketRing, busy poll" => {
                Box::new(Ours(Box::new(PacketRing::open(near, Waiting::BusyPoll).unwrap())))
            }
            "PacketRing" => Box::new(Ours(Box::new(PacketRing::open(near, Waiting::Sleep).unwrap()))),
            "bare send + recv" => Box::new(BareSocket::open(near)),
            _ => Box::new(Ours(Box::new(PacketSocket::open(near).unwrap()))),
        }
    };
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Frmw, 0, Address::station(0x1001, 0x0910), 8).unwrap();
    frame.push_zeros(Command::Lwr, 1, Address::Logical(0), 60).unwrap();
    frame.push_zeros(Command::Lrd, 2, Address::Logical(60), 60).unwrap();
    let mut buffer = [0; 2048];
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
                let mut buffer = [0; 2048];
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
