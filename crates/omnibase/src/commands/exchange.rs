//! `omnibase exchange`: to OP and cycle.

mod report;
mod runner;

use crate::real_time::RealTime;
use crate::target::{Manners, Port, Target, finish_recording};
use crate::{Outcome, commands};
use anyhow::ensure;
use omnibase_ethercat::config::WatchdogConfig;
use omnibase_ethercat::cyclic::ClockDirection;
use omnibase_ethercat::image::CycleFit;
use omnibase_ethercat::paced::{self, Pace};
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::wire::sii::{self, Identity, SyncManagerUsage};
use omnibase_ethercat::{DcConfig, Match, SubDeviceConfig};
use omnibase_host::{Waiting, stop_on_signals};
use runner::{Plan, Runner};
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Brings a segment to OP, exchanges process data cycle by cycle, and measures. Ctrl-C ends it cleanly.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase exchange sim:segments/three-sgdv.toml --dc                  a simulated segment in virtual time
  omnibase exchange eth1 --cycle-us 500 --cycles 100000 --realtime     five hundred microseconds, real-time thread
  omnibase exchange eth1 --dc --ring --busy-poll --json                SYNC0, mapped rings, no sleeping receive
  omnibase exchange eth1 --dc --clock host                             the distributed clocks follow this host
  omnibase exchange eth1 --record run.pcapng                           with a recording for Wireshark

All outputs are zero and no drive is enabled, but the segment goes to OP: wheels off the ground. At the end it is
brought back to INIT. Exit code 1 where OP was not reached or not kept.")]
pub struct Arguments {
    /// Network interface, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    #[command(flatten)]
    manners: Manners,
    /// Cycle time, microseconds, from 10 to 100000: clocks that hear of each other less often don't lock.
    #[arg(long, default_value = "1000", value_name = "MICROSECONDS", value_parser = parse_cycle)]
    cycle_us: Duration,
    /// Cycles in OP.
    #[arg(long, default_value_t = 10_000, value_name = "N")]
    cycles: u64,
    /// Synchronise by distributed clocks: SYNC0 at the cycle, and the cycle follows the reference clock.
    #[arg(long)]
    dc: bool,
    /// Whose time leads with --dc: the reference clock's (the cycle follows it) or this host's (it follows the cycle).
    #[arg(long, value_enum, default_value_t = Leader::Dc, requires = "dc")]
    clock: Leader,
    /// Shift of SYNC0 against the multiples of the cycle, microseconds (frames pass half a cycle before and behind it).
    #[arg(
        long,
        default_value_t = 0,
        value_name = "MICROSECONDS",
        requires = "dc",
        allow_negative_numbers = true
    )]
    shift_us: i32,
    /// Use mapped rings (PACKET_RX_RING, PACKET_TX_RING) in place of send and recv.
    #[arg(long)]
    ring: bool,
    /// Look at the ring until the frame is back; uses up a CPU. Without it, it is looked at for as long as frames usually take, a
    /// quarter of the time-out at most, and then slept.
    #[arg(long, requires = "ring")]
    busy_poll: bool,
    #[command(flatten)]
    real_time: RealTime,
    /// Process-data watchdog written to all that have outputs, ms, at least two cycles; 0 switches it off. Default: 100, or three
    /// cycles where these are longer.
    #[arg(long, value_name = "MS", value_parser = parse_watchdog)]
    watchdog_ms: Option<u16>,
    /// Record all frames into this pcapng file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Print one JSON object: {"operational", "cycles", "lost_frames", ...}.
    #[arg(long)]
    json: bool,
}

/// Register 0x0400: steps of 100 us.
const WATCHDOG_DIVIDER: u16 = 2498;
const STEPS_PER_MS: u16 = 10;
/// The watchdog by default, ms.
const WATCHDOG_MS: u16 = 100;

/// Whose time leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Leader {
    /// The reference clock.
    Dc,
    /// The host's clock.
    Host,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    run_until(arguments, stop_on_signals()?, output)
}

/// Runs it until it is over or `stop` is set.
pub fn run_until(
    arguments: &Arguments,
    stop: &AtomicBool,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    arguments.check()?;
    let mut cable = arguments.manners.enter(&arguments.target, arguments.port())?;
    let mut recorder = None;
    if let Some(path) = &arguments.record {
        let (recorded, running) = cable.record(path)?;
        (cable, recorder) = (recorded, Some((running, path)));
    }
    let mut bus = cable.into_bus();
    commands::scan_bus(&mut bus, &arguments.target)?;
    let configs: Vec<SubDeviceConfig> = bus.subdevices().iter().map(|one| arguments.config(one)).collect();
    let configured = bus.configure(&configs);
    commands::note_warnings(&bus);
    configured?;
    if !arguments.json {
        list(bus.subdevices(), output)?;
    }
    let (leader, direction) = match (arguments.dc, arguments.clock) {
        (false, _) => (paced::Leader::Nobody, ClockDirection::CycleFollowsDc),
        (true, Leader::Dc) => (paced::Leader::ReferenceClock, ClockDirection::CycleFollowsDc),
        (true, Leader::Host) => (paced::Leader::Host, ClockDirection::DcFollowsHost),
    };
    let fit = bus.cycle_fit()?;
    check_fit(fit, arguments.cycle_us)?;
    let handover = bus.into_cyclic(direction)?;

    // Until the end of the cycle.
    let _granted = arguments.real_time.apply(arguments.cycle_us)?;
    let plan = Plan {
        pace: Pace {
            cycle: arguments.cycle_us,
            timeout: arguments.cycle_us * 9 / 10,
            leader,
            sync0_shift_ns: arguments.sync0_shift_ns(),
        },
        cycles: arguments.cycles,
        paced: matches!(arguments.target, Target::Interface(_)),
    };
    let mut runner = Runner::new(handover, plan);
    let ended = runner.run(stop);
    let report = runner.report();
    drop(runner);
    if arguments.json {
        serde_json::to_writer_pretty(&mut *output, &report.json())?;
        writeln!(output)?;
    } else {
        report.print(output)?;
    }
    if let Some((recorder, path)) = recorder {
        finish_recording(recorder, path)?;
    }
    ended?;
    Ok(if report.operational { Outcome::Done } else { Outcome::Failed })
}

impl Arguments {
    /// An exchange for a program of this process: JSON, and no wish for real time.
    pub fn of_program(target: Target, manners: Manners, cycle_us: Duration, cycles: u64, dc: bool) -> Self {
        Arguments {
            target,
            manners,
            cycle_us,
            cycles,
            dc,
            clock: Leader::Dc,
            shift_us: 0,
            ring: false,
            busy_poll: false,
            real_time: RealTime::default(),
            watchdog_ms: None,
            record: None,
            json: true,
        }
    }

    fn port(&self) -> Port {
        match (self.ring, self.busy_poll) {
            (false, _) => Port::Socket,
            (true, false) => Port::Ring(Waiting::Sleep),
            (true, true) => Port::Ring(Waiting::BusyPoll),
        }
    }

    fn watchdog_ms(&self) -> u16 {
        let cycles_ms = (3 * self.cycle_us).as_millis() as u16;
        self.watchdog_ms.unwrap_or(cycles_ms.max(WATCHDOG_MS))
    }

    /// What would never work, told before anything is sent.
    fn check(&self) -> anyhow::Result<()> {
        let cycle_us = self.cycle_us.as_micros();
        ensure!(
            u128::from(self.shift_us.unsigned_abs()) < cycle_us,
            "--shift-us {}: a place in the cycle, less than --cycle-us {cycle_us} either way",
            self.shift_us
        );
        let (watchdog_ms, least_ms) = (self.watchdog_ms(), (2 * self.cycle_us).as_micros().div_ceil(1000));
        ensure!(
            watchdog_ms == 0 || u128::from(watchdog_ms) >= least_ms,
            "--watchdog-ms {watchdog_ms}: SubDevices would go safe by themselves between two frames {cycle_us} us apart; at least \
             {least_ms}, or 0 for none"
        );
        Ok(())
    }

    fn sync0_shift_ns(&self) -> i32 {
        self.shift_us.saturating_mul(1000)
    }

    fn config(&self, one: &SubDevice) -> SubDeviceConfig {
        let dc = if self.dc && wants_sync(one) {
            DcConfig::Sync0 { cycle_ns: self.cycle_us.as_nanos() as u32, shift_ns: self.sync0_shift_ns() }
        } else {
            DcConfig::Off
        };
        // Who is written to goes safe by itself when this program says nothing any more, as a robot's drives do.
        let is_written =
            one.sii.sync_managers.iter().any(|manager| manager.usage == SyncManagerUsage::Outputs);
        let watchdogs = if is_written {
            WatchdogConfig {
                divider: Some(WATCHDOG_DIVIDER),
                process_data: Some(self.watchdog_ms().saturating_mul(STEPS_PER_MS)),
                pdi: None,
            }
        } else {
            WatchdogConfig::default()
        };
        SubDeviceConfig {
            place: Some(Match::Position(one.position)),
            dc,
            watchdogs,
            ..SubDeviceConfig::default()
        }
    }
}

/// A line for each SubDevice that is about to be driven.
fn list(subdevices: &[SubDevice], output: &mut dyn Write) -> std::io::Result<()> {
    for one in subdevices {
        let Identity { vendor_id, product_code, .. } = one.identity;
        let (out, back) = (one.bit_length(Direction::Outputs), one.bit_length(Direction::Inputs));
        let refuses = if one.lrw_allowed { "" } else { ", no LRW" };
        writeln!(
            output,
            "{:>3} {:<24} vendor 0x{vendor_id:08x} product 0x{product_code:08x}, {out} bits out, {back} in{refuses}",
            one.position, one.name
        )?;
    }
    writeln!(output)
}

/// Refuses a cycle within which its frames can't be back.
fn check_fit(fit: CycleFit, cycle: Duration) -> anyhow::Result<()> {
    ensure!(
        fit.shortest() <= cycle,
        "--cycle-us {}: the shortest cycle that fits is {fit}; choose a longer cycle",
        cycle.as_micros()
    );
    Ok(())
}

/// Milliseconds that the chips can count.
fn parse_watchdog(text: &str) -> Result<u16, String> {
    match text.parse() {
        Ok(ms @ 0..=6553) => Ok(ms),
        _ => Err("expected milliseconds from 0 (off) to 6553".to_owned()),
    }
}

/// Whether SYNC0 makes sense: a clock, process data, and an application that may use it. A SubDevice without a
/// mailbox (a digital terminal) uses it only where its SII says so.
fn wants_sync(one: &SubDevice) -> bool {
    let offers =
        one.sii.dc_modes.iter().any(|mode| mode.assign_activate & DcConfig::SYNC0 == DcConfig::SYNC0);
    let speaks_coe = one.sii.header.mailbox_protocols & sii::PROTOCOL_COE != 0;
    let has_pdos = !(one.sii.tx_pdos.is_empty() && one.sii.rx_pdos.is_empty());
    one.dc.is_some() && (speaks_coe || (offers && has_pdos))
}

/// A cycle in words, microseconds.
pub fn parse_cycle(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(microseconds) if (10.0..=1e5).contains(&microseconds) => {
            Ok(Duration::from_nanos((microseconds * 1000.0).round() as u64))
        }
        _ => Err("expected microseconds from 10 to 100000".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_are_microseconds_within_bounds() {
        assert_eq!(parse_cycle("62.5"), Ok(Duration::from_nanos(62_500)));
        for wrong in ["9.9", "100001", "x", "NaN", "-1"] {
            assert!(parse_cycle(wrong).is_err(), "{wrong}");
        }
    }
}
