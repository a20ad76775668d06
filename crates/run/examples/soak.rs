//! Hours of a robot on a bus that suffers, in virtual time: every fault injected must be counted, and nothing may grow.
//!
//! `cargo run --release -p omnibase-run --example soak -- [hours] [seed]` (24 and 1 where nothing is given).

use std::cell::RefCell;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, SimLink, in_process};
use omnibase_robot::signals::{CycleTime, Phase};
use omnibase_robot::{Registry, Request, RequestKind, Robot};
use omnibase_run::{RobotText, simulated};
use omnibase_session::session::Session;
use omnibase_session::supervision::BusFigures;

const BMM: &str = include_str!("../../../robots/bmm.toml");

/// What happens to the next answer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Trouble {
    #[default]
    None,
    Lost,
    Late,
    Twice,
    Foreign,
}

struct Cable {
    link: SimLink,
    trouble: Trouble,
    held: Option<Vec<u8>>,
}

#[derive(Clone)]
struct Shared(Rc<RefCell<Cable>>);

impl Link for Shared {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.0.borrow_mut().link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let mut cable = self.0.borrow_mut();
        // What was held back comes with the next cycle, before its own.
        if cable.trouble == Trouble::None
            && let Some(frame) = cable.held.take()
        {
            buffer[..frame.len()].copy_from_slice(&frame);
            return Ok(Some(frame.len()));
        }
        let received = cable.link.receive(buffer, deadline)?;
        let Some(length) = received else { return Ok(None) };
        match std::mem::take(&mut cable.trouble) {
            Trouble::None => {}
            Trouble::Lost => return cable.link.receive(buffer, deadline),
            Trouble::Late => {
                // The cycle waits in vain; only then is it there.
                let frame = buffer[..length].to_vec();
                let nothing = cable.link.receive(buffer, deadline)?;
                cable.held = Some(frame);
                return Ok(nothing);
            }
            Trouble::Twice => cable.held = Some(buffer[..length].to_vec()),
            Trouble::Foreign => {
                cable.held = Some(buffer[..length].to_vec());
                // Somebody else's: another protocol.
                buffer[12] ^= 0x0F;
            }
        }
        Ok(Some(length))
    }
}

/// The next random number (splitmix64).
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Resident memory of this process, kB; 0 where the system doesn't say.
fn resident_kb() -> u64 {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    statm.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0) * 4
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let hours: f64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(24.0);
    let seed: u64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(1);
    if soak(hours, seed) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// So many hours with the faults of a seed; whether everything was counted, and nothing grew or drifted.
pub fn soak(hours: f64, seed: u64) -> bool {
    let mut state = seed;
    let registry = Registry::with_built_in();
    let text = RobotText { text: BMM.into(), ..RobotText::default() };
    let plan = text.load(&registry).expect("the shipped file").plan;
    let (segment, _machine) = simulated::segment(&plan).expect("the robot of the shipped file");
    let (link, clock) = in_process(segment);
    let cable = Rc::new(RefCell::new(Cable { link, trouble: Trouble::None, held: None }));
    let mut session =
        Session::prepare(Shared(cable.clone()), clock, &plan, &mut |_| {}).expect("its drives are there");
    session.reach_op(&AtomicBool::new(false)).expect("they go to OP");
    let mut robot = Robot::build(&plan, &registry).expect("its stages");

    let cycles = (hours * 3600.0 * 1e9 / plan.bus.cycle_ns as f64) as u64;
    let mut expected = BusFigures::default();
    let (mut next_fault, mut worst_phase_ns, mut worst_clock_ns) = (5000u64, 0u64, 0u32);
    let (mut power_cycles, mut early_kb) = (0u64, 0u64);
    let began = Instant::now();
    for cycle in 1..=cycles {
        let (exchange, _) = session.exchange().expect("the link is there");
        let phase = robot.phase();
        let request = match phase {
            // Somebody who stands by sets right what stopped the robot, in his own time.
            Phase::Fault if cycle % 2000 == 0 => Some(RequestKind::Acknowledge),
            Phase::Disabled if cycle % 100 == 0 => Some(RequestKind::Enable),
            _ => None,
        };
        let time = CycleTime::on_grid(cycle, plan.bus.cycle_ns);
        let record = robot.compute(time, exchange, request.map(Request::lasting), session.image());
        let drives = record.measurements;
        session.look_at_drives(drives.present());
        while session.take_event().is_some() {}
        if cycle % 1000 == 0 && phase == Phase::Holding {
            worst_phase_ns = worst_phase_ns.max(session.figures().dc_phase_ns.unsigned_abs());
            let cable = cable.borrow();
            for one in cable.link.segment().sub_devices() {
                let bytes = one.esc().peek(0x092C, 4).and_then(|bytes| bytes.first_chunk());
                let value = bytes.map_or(0, |bytes| u32::from_le_bytes(*bytes));
                worst_clock_ns = worst_clock_ns.max(value & 0x7FFF_FFFF);
            }
        }
        if cycle == cycles / 24 {
            early_kb = resident_kb();
        }
        // The last seconds are for what is still under way.
        if cycle < next_fault || phase != Phase::Holding || cycle + 10_000 > cycles {
            continue;
        }
        next_fault = cycle + 3000 + random(&mut state) % 12_000;
        let position = (random(&mut state) % 3) as usize;
        let mut cable = cable.borrow_mut();
        match random(&mut state) % 8 {
            0 => {
                cable.trouble = Trouble::Lost;
                expected.frames_lost += 1;
            }
            1 => {
                cable.trouble = Trouble::Late;
                expected.frames_lost += 1;
                expected.frames_late += 1;
            }
            2 => {
                cable.trouble = Trouble::Twice;
                // All frames of its cycle are back by then: the double is late, in the next one.
                expected.frames_late += 1;
            }
            3 => {
                cable.trouble = Trouble::Foreign;
                expected.frames_foreign += 1;
            }
            4 => {
                let fault = Fault::CrcErrors { port: 0, frames: 1 };
                cable.link.segment_mut().inject(position, fault).expect("it has that port");
                expected.crc_errors += 1;
                expected.frames_lost += 1;
            }
            5 => {
                let off_for = Duration::from_millis(10 + random(&mut state) % 500);
                cable.link.segment_mut().inject(2, Fault::PowerCycle { off_for }).expect("it is there");
                power_cycles += 1;
                expected.losses += 1;
                expected.recoveries += 1;
            }
            6 => {
                // Its clock had a fault, it says, and it leaves OP without losing power: what it counted goes on.
                let fault = Fault::Application(ApplicationFault::AlError(0x001A));
                cable.link.segment_mut().inject(position, fault).expect("a drive knows it");
                expected.losses += 1;
                expected.recoveries += 1;
                expected.drive_faults += 1;
            }
            _ => {
                let fault = Fault::Application(ApplicationFault::DriveFault(0x7500));
                cable.link.segment_mut().inject(position, fault).expect("a drive knows it");
                expected.drive_faults += 1;
            }
        }
    }
    let (late_kb, figures) = (resident_kb(), session.figures());
    let seconds = began.elapsed().as_secs_f64();
    println!("{cycles} cycles ({hours} h) in {seconds:.0} s, {power_cycles} power cycles");
    println!("memory: {early_kb} kB after 1/24 of the time, {late_kb} kB at the end");
    println!(
        "farthest from the phase {worst_phase_ns} ns, farthest clock {worst_clock_ns} ns, while holding"
    );
    let mut right = late_kb <= early_kb + 512 && worst_phase_ns < 1000 && worst_clock_ns < 1000;
    for (name, expected, counted) in [
        ("frames lost", expected.frames_lost, figures.frames_lost),
        ("frames late", expected.frames_late, figures.frames_late),
        ("frames foreign", expected.frames_foreign, figures.frames_foreign),
        ("damaged frames", expected.crc_errors, figures.crc_errors),
        ("SubDevices lost", expected.losses, figures.losses),
        ("SubDevices back", expected.recoveries, figures.recoveries),
        ("drive faults", expected.drive_faults, figures.drive_faults),
        ("silences", 0, figures.silences),
        ("clocks astray", 0, figures.clock_strays),
    ] {
        println!("{name:>16}: {expected} injected, {counted} counted");
        right &= expected == counted;
    }
    right
}

#[cfg(test)]
mod tests {
    #[test]
    fn six_minutes_of_faults_are_counted_one_by_one() {
        assert!(super::soak(6.0 / 60.0, 3));
    }
}
