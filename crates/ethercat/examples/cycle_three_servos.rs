//! Three servos to OP with SYNC0, then a thousand cycles at 1 kHz that follow the distributed clock.

use omnibase_ethercat::cyclic::{ClockDirection, Goal, TransitionOptions};
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::{Bus, BusOptions, DcConfig, SubDeviceConfig};
use omnibase_ethercat_sim::{SegmentFile, in_process};
use std::error::Error;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const CYCLE: Duration = Duration::from_millis(1);

/// Runs the cycle in virtual time; with a real clock it really sleeps.
pub fn main() -> Result<(), Box<dyn Error>> {
    let text = include_str!("../../../segments/three-servos.toml");
    let (link, clock) = in_process(SegmentFile::parse(text)?.build(Path::new("segments"))?);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan()?;
    let dc = DcConfig::Sync0 { cycle_ns: CYCLE.as_nanos() as u32, shift_ns: 0 };
    bus.configure(&vec![SubDeviceConfig { dc, ..SubDeviceConfig::default() }; 3])?;

    // Set-up is over: from here on nothing allocates or blocks, and one frame a cycle carries everything.
    let ready = bus.into_cyclic(ClockDirection::CycleFollowsDc)?;
    let mut image = ready.bus.plan().image();
    let pace = Pace { cycle: CYCLE, timeout: CYCLE / 2, leader: Leader::ReferenceClock, sync0_shift_ns: 0 };
    let mut paced = PacedBus::new(ready.bus, ready.clock, pace);
    paced.reach(Goal::Op, TransitionOptions::default(), &AtomicBool::new(false), |paced| {
        paced.exchange(&mut image).map(drop)
    })?;
    for _ in 0..1000 {
        // A controller would read image.inputs here, and write image.outputs for the next exchange.
        paced.exchange(&mut image)?;
    }
    println!("{:?}", paced.bus().counters());
    assert_eq!(paced.bus().counters().frames_lost, 0);
    paced.end(|paced| paced.exchange(&mut image).map(drop))?;
    Ok(())
}
