//! What a cycle costs in the simulated hardware: FRMW + LWR + LRD + BRD in one frame, firmware that does nothing.
//!
//! `cargo bench -p omnibase-ethercat-sim`

#[path = "../tests/hardware/cycle.rs"]
mod cycle;

use cycle::{Cycle, Mirror};
use divan::Bencher;
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};
use omnibase_ethercat_wire::frame::{FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Command, HostTime};

/// SubDevices in a line whose cycle is measured.
const COUNTS: [u16; 4] = [1, 3, 20, 100];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, flag, count, cycles] = &arguments[..]
        && flag == "--run"
    {
        let mut cycle = Cycle::new(count.parse().unwrap());
        (0..cycles.parse::<u64>().unwrap()).for_each(|_| cycle.run());
        return;
    }
    divan::main();
    println!("servos  user instructions/cycle");
    for count in COUNTS {
        let counted = instructions(count).map_or("perf is not here".into(), |count| format!("{count:.0}"));
        println!("{count:6}  {counted:>23}");
    }
}

/// User instructions per cycle: the difference of two runs of different length, so that set-up cancels out.
fn instructions(count: u16) -> Option<f64> {
    let measure = |cycles: u64| -> Option<f64> {
        let output = std::process::Command::new("perf")
            .args(["stat", "-x", ",", "-e", "instructions:u"])
            .arg(std::env::current_exe().ok()?)
            .args(["--run", &count.to_string(), &cycles.to_string()])
            .output()
            .ok()?;
        let text = String::from_utf8(output.stderr).ok()?;
        text.lines().find(|line| line.contains("instructions"))?.split(',').next()?.parse().ok()
    };
    Some((measure(40_000)? - measure(20_000)?) / 20_000.0)
}

#[divan::bench(args = COUNTS)]
fn whole_cycle(bencher: Bencher<'_, '_>, count: u16) {
    let mut cycle = Cycle::new(count);
    bencher.bench_local(|| cycle.run());
}

/// A frame for one SubDevice of a long line, as start-up sends them.
#[divan::bench(args = [1, 100, 1000])]
fn one_of_many(bencher: Bencher<'_, '_>, count: u16) {
    let devices = (0..count).map(|_| SubDevice::new(EscConfig::default(), Box::new(Mirror))).collect();
    let mut segment = Segment::line(devices).unwrap();
    let mut number = FrameBuilder::new();
    number.push(Command::Apwr, 0, Address::position(count - 1, reg::STATION_ADDRESS), &[1, 0x10]).unwrap();
    segment.process(number.bytes_mut(), HostTime(0)).unwrap();
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Fprd, 0, Address::station(0x1001, reg::AL_STATUS), 2).unwrap();
    let frame = frame.bytes().to_vec();
    let mut buffer = [0; MAX_FRAME];
    let mut now = HostTime(1_000_000);
    bencher.bench_local(|| {
        now.0 += 1_000_000;
        buffer[..frame.len()].copy_from_slice(&frame);
        segment.process(&mut buffer[..frame.len()], now)
    });
    assert_eq!(buffer[frame.len() - 2], 1);
}
