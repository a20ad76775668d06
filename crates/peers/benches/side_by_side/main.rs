//! MainDevices side by side over the same virtual cable and the same simulated segment of 3, 20 and 100 drives:
//! `cargo bench -p omnibase-peers` (or `-- sgdv 3` for as many that refuse LRW). Needs root; says so and ends without.
//!
//! - Every contestant is a process of its own and brings the segment to OP itself; so is the segment, whose CPU
//!   time isn't counted and whose end of the cable is looked at without sleeping.
//! - A cycle is one exchange of process data with the distributed clock, once back to back, once asleep until each new
//!   millisecond; ours and EtherCrab's also read the AL status. The bare loops send the very frames that ours sends, and
//!   check nothing.
//! - Rounds: every contestant runs once in each, so that what else the machine does hits all of them. Round trips
//!   are taken from one half of the cycles, CPU time from the other, where nobody looks at a clock to measure.
//! - Instructions and system calls come from runs of their own, under `perf stat`, counted between two marks around
//!   the cycles: start-up isn't in them.

mod bring_up;
mod crab;
mod far_end;
mod mark;
mod run;
mod table;

#[path = "../../../host/benches/bare/mod.rs"]
mod bare;
#[path = "../../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;

use mark::Mark;
use omnibase_host::{Namespace, PacketRing, PacketSocket, Waiting};
use run::{Arena, Figures};
use std::time::Duration;

/// Drives in the segment, where no other numbers are asked for.
const DRIVES: [usize; 3] = [3, 20, 100];
const ROUNDS: usize = 5;
/// Periods, zero for back to back, and cycles in each half of a run.
const PACES: [(Duration, u64); 2] = [(Duration::ZERO, 2000), (Duration::from_millis(1), 500)];
/// Runs whose instructions are counted; the fewest count.
const COUNTED_RUNS: usize = 2;

/// What every contestant does.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// Drives in the segment.
    pub drives: usize,
    /// From cycle to cycle; zero for back to back.
    pub period: Duration,
    /// Cycles in each half of a run.
    pub cycles: u64,
}

/// Who exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contestant {
    /// `send` and `recv` in a loop.
    BareSocket,
    /// Mapped rings in a loop.
    BareRing,
    /// Ours with [`PacketSocket`].
    Socket,
    /// Ours with [`PacketRing`], looking and then sleeping.
    Ring,
    /// Ours with [`PacketRing`], busy polling.
    BusyRing,
    /// EtherCrab with its task in the same thread.
    EtherCrab,
    /// EtherCrab with its io_uring thread.
    EtherCrabUring,
    /// SOEM in Python.
    Pysoem,
}

impl Contestant {
    const ALL: [(Contestant, &str); 8] = [
        (Contestant::BareSocket, "floor: bare send + recv"),
        (Contestant::BareRing, "floor: bare ring, polled"),
        (Contestant::Socket, "omnibase, PacketSocket"),
        (Contestant::Ring, "omnibase, PacketRing"),
        (Contestant::BusyRing, "omnibase, PacketRing, busy"),
        (Contestant::EtherCrab, "EtherCrab, tx/rx task"),
        (Contestant::EtherCrabUring, "EtherCrab, io_uring"),
        (Contestant::Pysoem, "pysoem"),
    ];

    /// Whether it can drive SubDevices that refuse LRW.
    fn can_do_without_lrw(self) -> bool {
        !matches!(self, Contestant::EtherCrab | Contestant::EtherCrabUring)
    }
}

/// What a contestant's process does.
fn compete(contestant: Contestant, mark: Mark, course: Course) {
    let near = Namespace::NEAR;
    let mut buffer = [0; 2048];
    match contestant {
        Contestant::BareSocket => {
            let frames = bring_up::frames_in_op(near, course);
            let mut link = bare::BareSocket::open(near);
            mark.measure(course, || {
                frames.iter().for_each(|frame| link.send(frame));
                frames.iter().for_each(|_| link.receive(&mut buffer));
                true
            });
        }
        Contestant::BareRing => {
            let frames = bring_up::frames_in_op(near, course);
            let mut link = bare::BareRing::open(near);
            mark.measure(course, || {
                frames.iter().for_each(|frame| link.send(frame));
                frames.iter().for_each(|_| while link.poll(&mut buffer).is_none() {});
                true
            });
        }
        Contestant::Socket => bring_up::ours(PacketSocket::open(near).unwrap(), mark, course),
        Contestant::Ring => bring_up::ours(PacketRing::open(near, Waiting::Sleep).unwrap(), mark, course),
        Contestant::BusyRing => {
            bring_up::ours(PacketRing::open(near, Waiting::BusyPoll).unwrap(), mark, course);
        }
        Contestant::EtherCrab => crab::drive(crab::Port::Task, mark, course),
        Contestant::EtherCrabUring => crab::drive(crab::Port::Uring, mark, course),
        Contestant::Pysoem => unreachable!("a Python program"),
    }
}

fn side_by_side(kind: &str, numbers: &[usize]) {
    let namespace = match Namespace::new() {
        Ok(namespace) => namespace,
        Err(error) => return println!("SKIPPED: {error}"),
    };
    let python = python_tools::python("pysoem", &["pysoem==1.1.13"], "import pysoem");
    let arena = Arena { python, kind: kind.to_owned(), events: run::countable_events() };
    for &drives in numbers {
        for (period, cycles) in PACES {
            namespace.run(|| race(&arena, Course { drives, period, cycles }));
        }
    }
}

/// All contestants by turns.
fn race(arena: &Arena, course: Course) {
    let contestants: Vec<_> = Contestant::ALL
        .into_iter()
        .filter(|(one, _)| arena.kind == "servo" || one.can_do_without_lrw())
        .filter(|(one, _)| *one != Contestant::Pysoem || arena.python.is_some())
        .collect();
    let mut figures: Vec<Figures> = contestants.iter().map(|_| Figures::default()).collect();
    for round in 0..ROUNDS {
        eprintln!("round {} of {ROUNDS}", round + 1);
        for ((contestant, _), figures) in contestants.iter().zip(&mut figures) {
            arena.time(*contestant, course, figures);
        }
    }
    eprintln!("counting instructions and system calls");
    for ((contestant, _), figures) in contestants.iter().zip(&mut figures) {
        for _ in 0..COUNTED_RUNS {
            arena.count(*contestant, course, figures);
        }
    }
    let Course { drives, period, cycles } = course;
    let pace = match period.is_zero() {
        true => "back to back".to_owned(),
        false => format!("asleep until each new {period:?}"),
    };
    println!("{drives} drives ({}), {ROUNDS} rounds of {cycles} cycles, {pace}", arena.kind);
    let rows: Vec<_> =
        contestants.into_iter().zip(&figures).map(|((one, name), of)| (one, name, of)).collect();
    table::print(&rows);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|one| one != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let number = |word: &str| word.parse::<u64>().expect("a number");
    match words[..] {
        ["--segment", kind, drives] => far_end::serve(kind, number(drives) as usize),
        ["--compete", name, mark, drives, period_us, cycles] => {
            let found = Contestant::ALL.into_iter().find(|(one, _)| format!("{one:?}") == name);
            let period = Duration::from_micros(number(period_us));
            let course = Course { drives: number(drives) as usize, period, cycles: number(cycles) };
            compete(found.expect("a contestant").0, Mark::new(mark), course);
        }
        _ => {
            let (kinds, numbers): (Vec<&str>, Vec<&str>) =
                words.into_iter().partition(|word| ["servo", "sgdv"].contains(word));
            let numbers: Option<Vec<usize>> = numbers.into_iter().map(|word| word.parse().ok()).collect();
            match (kinds[..].first(), numbers) {
                (kind, Some(numbers)) => {
                    let numbers = if numbers.is_empty() { &DRIVES[..] } else { &numbers };
                    side_by_side(kind.unwrap_or(&"servo"), numbers);
                }
                _ => eprintln!(
                    "usage: cargo bench -p omnibase-peers [-- [servo | sgdv] [number of drives]...]"
                ),
            }
        }
    }
}
