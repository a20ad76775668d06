//! What a cycle costs in the MainDevice alone: ns, and user instructions where `perf` is installed.
//!
//! `cargo bench -p omnibase-ethercat --bench cycle`
//!
//! Servos with 16 + 16 bytes, FRMW + LWR + LRD + BRD, all working counters checked, over a link that answers from
//! memory. The same frames sent over that link alone are measured too and taken off.

mod echo;

use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

use omnibase_ethercat::Exchange;
use omnibase_ethercat::wire::frame::MAX_FRAME;
use omnibase_ethercat::wire::{HostTime, Link};

const SERVOS: [u16; 3] = [3, 20, 100];
const BYTES: u32 = 16;

/// Which loop is run.
#[derive(Clone, Copy)]
enum Loop {
    /// The whole exchange.
    Cycle,
    /// Only the link, with frames of the same lengths.
    Link,
}

fn run(kind: Loop, servos: u16, cycles: u64) -> f64 {
    let (mut bus, mut image) = echo::operational(servos, BYTES, |echo| echo);
    bus.link_mut().blind = true;
    let lengths: Vec<usize> = bus
        .plan()
        .frames
        .iter()
        .map(|frame| 16 + frame.datagrams.iter().map(|datagram| datagram.length + 12).sum::<usize>())
        .collect();
    let mut frame = [0; MAX_FRAME];
    let mut back = [0; MAX_FRAME];
    let start = Instant::now();
    for cycle in 0..cycles {
        let deadline = HostTime(1_000_000_000_000 + cycle);
        match kind {
            Loop::Cycle => {
                image.outputs[0] = cycle as u8;
                let exchange = bus.exchange(black_box(&mut image), deadline).unwrap();
                assert_eq!(exchange, Exchange::Complete);
            }
            Loop::Link => {
                frame[16] = cycle as u8;
                for length in &lengths {
                    bus.link_mut().send(black_box(&frame[..*length])).unwrap();
                }
                for _ in &lengths {
                    black_box(bus.link_mut().receive(&mut back, deadline).unwrap());
                }
            }
        }
    }
    start.elapsed().as_nanos() as f64 / cycles as f64
}

/// User instructions per cycle: the difference of two runs of different length, so that start-up cancels out.
fn instructions(kind: &str, servos: u16) -> Option<f64> {
    let measure = |cycles: u64| -> Option<f64> {
        let program = std::env::current_exe().ok()?;
        let output = Command::new("perf")
            .args(["stat", "-x", ",", "-e", "instructions:u"])
            .arg(program)
            .args(["--run", kind, &servos.to_string(), &cycles.to_string()])
            .output()
            .ok()?;
        let text = String::from_utf8(output.stderr).ok()?;
        text.lines().find(|line| line.contains("instructions"))?.split(',').next()?.parse().ok()
    };
    Some((measure(200_000)? - measure(100_000)?) / 100_000.0)
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, flag, kind, servos, cycles] = &arguments[..]
        && flag == "--run"
    {
        let kind = if kind == "cycle" { Loop::Cycle } else { Loop::Link };
        run(kind, servos.parse().unwrap(), cycles.parse().unwrap());
        return;
    }
    println!("servos  frames  ns/cycle  user instructions/cycle  (the answering link is taken off)");
    for servos in SERVOS {
        let frames = echo::operational(servos, BYTES, |echo| echo).0.frames_per_cycle();
        let best = |kind| (0..5).map(|_| run(kind, servos, 200_000)).fold(f64::INFINITY, f64::min);
        let ns = best(Loop::Cycle) - best(Loop::Link);
        let counted = instructions("cycle", servos).zip(instructions("link", servos));
        let counted =
            counted.map_or("perf is not here".into(), |(cycle, link)| format!("{:.0}", cycle - link));
        println!("{servos:6}  {frames:6}  {ns:8.0}  {counted:>23}");
    }
}
