//! MainDevices side by side over the same virtual cable and the same simulated segment of three drives:
//! `cargo bench -p omnibase-peers` (or `-- sgdv` for drives that refuse LRW). Needs root; says so and ends without.
//!
//! - Every contestant is a process of its own and brings the segment to OP itself; so is the segment, whose CPU
//!   time isn't counted and whose end of the cable is looked at without sleeping.
//! - A cycle is one exchange of process data with the distributed clock, back to back, without a sleep; ours and
//!   EtherCrab's also read the AL status. The bare loops send the very frame that ours sends, and check nothing.
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

/// Drives in the segment.
pub const DRIVES: usize = 3;
/// Rounds, and cycles in each half of a run.
const ROUNDS: usize = 7;
const CYCLES: u64 = 2000;
/// Runs whose instructions are counted; the fewest count.
const COUNTED_RUNS: usize = 3;

/// Who exchanges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contestant {
    /// `send` and `recv` in a loop.
    BareSocket,
    /// Mapped rings in a loop.
    BareRing,
    /// Ours with [`PacketSocket`].
    Socket,
    /// Ours with [`PacketRing`], sleeping.
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
        (Contestant::Ring, "omnibase, PacketRing, poll"),
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
fn compete(contestant: Contestant, mark: Mark, cycles: u64) {
    let near = Namespace::NEAR;
    match contestant {
        Contestant::BareSocket => {
            let frame = bring_up::frame_in_op(near);
            let mut link = bare::BareSocket::open(near);
            let mut buffer = [0; 2048];
            mark.measure(cycles, || {
                link.cycle(&frame, &mut buffer);
                true
            });
        }
        Contestant::BareRing => {
            let frame = bring_up::frame_in_op(near);
            let mut link = bare::BareRing::open(near);
            let mut buffer = [0; 2048];
            mark.measure(cycles, || {
                link.cycle(&frame, &mut buffer);
                true
            });
        }
        Contestant::Socket => bring_up::ours(PacketSocket::open(near).unwrap(), mark, cycles),
        Contestant::Ring => bring_up::ours(PacketRing::open(near, Waiting::Sleep).unwrap(), mark, cycles),
        Contestant::BusyRing => {
            bring_up::ours(PacketRing::open(near, Waiting::BusyPoll).unwrap(), mark, cycles);
        }
        Contestant::EtherCrab => crab::drive(crab::Port::Task, mark, cycles),
        Contestant::EtherCrabUring => crab::drive(crab::Port::Uring, mark, cycles),
        Contestant::Pysoem => unreachable!("a Python program"),
    }
}

fn side_by_side(kind: &str) {
    let namespace = match Namespace::new() {
        Ok(namespace) => namespace,
        Err(error) => return println!("SKIPPED: {error}"),
    };
    let python = python_tools::python("pysoem", &["pysoem==1.1.13"], "import pysoem");
    let arena = Arena { python, kind: kind.to_owned(), events: run::countable_events() };
    let contestants: Vec<_> = Contestant::ALL
        .into_iter()
        .filter(|(one, _)| kind == "servo" || one.can_do_without_lrw())
        .filter(|(one, _)| *one != Contestant::Pysoem || arena.python.is_some())
        .collect();
    let mut figures: Vec<Figures> = contestants.iter().map(|_| Figures::default()).collect();
    namespace.run(|| {
        for round in 0..ROUNDS {
            eprintln!("round {} of {ROUNDS}", round + 1);
            for ((contestant, _), figures) in contestants.iter().zip(&mut figures) {
                arena.time(*contestant, CYCLES, figures);
            }
        }
        eprintln!("counting instructions and system calls");
        for ((contestant, _), figures) in contestants.iter().zip(&mut figures) {
            for _ in 0..COUNTED_RUNS {
                arena.count(*contestant, CYCLES, figures);
            }
        }
    });
    println!("{DRIVES} drives ({kind}), {ROUNDS} rounds of {CYCLES} cycles, back to back");
    let rows: Vec<_> =
        contestants.into_iter().zip(&figures).map(|((one, name), of)| (one, name, of)).collect();
    table::print(&rows);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|one| one != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["--segment", kind] => far_end::serve(kind),
        ["--compete", name, cycles, mark] => {
            let found = Contestant::ALL.into_iter().find(|(one, _)| format!("{one:?}") == name);
            compete(found.expect("a contestant").0, Mark::new(mark), cycles.parse().expect("a number"));
        }
        [] => side_by_side("servo"),
        [kind @ ("servo" | "sgdv")] => side_by_side(kind),
        _ => eprintln!("usage: cargo bench -p omnibase-peers [-- servo | sgdv]"),
    }
}
