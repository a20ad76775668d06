//! The figures of all contestants in one table, and what follows from them.

use crate::Contestant;
use crate::run::Figures;

/// The most that the busy-polling port may take of the bare ring loop's time.
const RING_LIMIT: f64 = 1.5;
/// The most that the ports which look and then sleep may take of the busy-polling one's round trip, back to back.
const LOOK_LIMIT: f64 = 1.1;
/// The most that ours may take of any peer's.
const PEER_LIMIT: f64 = 0.5;

/// A contestant, its name and its figures.
pub type Row<'a> = (Contestant, &'a str, &'a Figures);

/// Prints the table.
pub fn print(rows: &[Row]) {
    println!(
        "{:<28} {:>9} {:>9} {:>9} {:>12} {:>13} {:>14} {:>7}",
        "per cycle", "p50 us", "p99 us", "max us", "CPU us", "user instr.", "system calls", "wrong"
    );
    for (_, name, figures) in rows {
        let times = sorted(&figures.round_trips_ns);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] as f64 / 1000.0;
        let counted = |count: Option<f64>, digits: usize| {
            count.map_or("not available".to_owned(), |count| format!("{count:.digits$}"))
        };
        println!(
            "{name:<28} {:>9.1} {:>9.1} {:>9.1} {:>12.2} {:>13} {:>14} {:>7}",
            at(0.5),
            at(0.99),
            at(1.0),
            cpu_ns(figures) as f64 / 1000.0,
            counted(figures.instructions, 0),
            counted(figures.system_calls, 2),
            figures.wrong
        );
    }
    println!();
    let find = |wanted: Contestant| rows.iter().find(|(one, ..)| *one == wanted).map(|(.., of)| *of);
    if let (Some(ring), Some(bare)) = (find(Contestant::BusyRing), find(Contestant::BareRing)) {
        let round_trip = median(ring) as f64 / median(bare) as f64;
        let cpu = cpu_ns(ring) as f64 / cpu_ns(bare) as f64;
        println!(
            "PacketRing busy / bare ring: round trip {}, CPU {}",
            verdict(round_trip, RING_LIMIT),
            verdict(cpu, RING_LIMIT)
        );
    }
    for (one, name) in [(Contestant::Ring, "PacketRing"), (Contestant::Socket, "PacketSocket")] {
        if let (Some(looks), Some(busy)) = (find(one), find(Contestant::BusyRing)) {
            let round_trip = median(looks) as f64 / median(busy) as f64;
            println!("{name} / PacketRing busy: round trip {}", verdict(round_trip, LOOK_LIMIT));
        }
    }
    let peers = [Contestant::EtherCrab, Contestant::EtherCrabUring, Contestant::Pysoem];
    let ports = [Contestant::Socket, Contestant::Ring, Contestant::BusyRing];
    for (_, peer_name, peer) in rows.iter().filter(|(one, ..)| peers.contains(one)) {
        for (_, name, ours) in rows.iter().filter(|(one, ..)| ports.contains(one)) {
            let cpu = cpu_ns(ours) as f64 / cpu_ns(peer) as f64;
            let instructions = ours.instructions.zip(peer.instructions).map(|(ours, peer)| ours / peer);
            let instructions =
                instructions.map_or("not available".to_owned(), |ratio| verdict(ratio, PEER_LIMIT));
            println!(
                "{name} / {peer_name}: round trip {:.2}, CPU {}, instructions {instructions}",
                median(ours) as f64 / median(peer) as f64,
                verdict(cpu, PEER_LIMIT)
            );
        }
    }
}

fn verdict(ratio: f64, limit: f64) -> String {
    let word = if ratio <= limit { "" } else { " ABOVE" };
    format!("{ratio:.2} (aim {limit}{word})")
}

fn sorted(values: &[u64]) -> Vec<u64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable();
    sorted
}

fn median(figures: &Figures) -> u64 {
    sorted(&figures.round_trips_ns)[figures.round_trips_ns.len() / 2]
}

fn cpu_ns(figures: &Figures) -> u64 {
    sorted(&figures.cpu_ns)[figures.cpu_ns.len() / 2]
}
