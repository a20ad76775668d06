//! Three servos to OP with SYNC0, then a thousand cycles at 1 kHz that follow the distributed clock.

use omnibase_ethercat::cyclic::{ClockDirection, DcFollower, FollowerGains, Goal, Phase, TransitionOptions};
use omnibase_ethercat::wire::Clock;
use omnibase_ethercat::{Bus, BusOptions, DcConfig, SubDeviceConfig};
use omnibase_ethercat_sim::{SegmentFile, in_process};
use std::error::Error;
use std::path::Path;
use std::time::Duration;

const CYCLE: Duration = Duration::from_millis(1);

/// Runs the cycle in virtual time; with a real clock `sleep_until` really sleeps.
pub fn main() -> Result<(), Box<dyn Error>> {
    let text = include_str!("../../../segments/three-servos.toml");
    let (link, clock) = in_process(SegmentFile::parse(text)?.build(Path::new("segments"))?);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan()?;
    let dc = DcConfig::Sync0 { cycle_ns: CYCLE.as_nanos() as u32, shift_ns: 0 };
    bus.configure(&vec![SubDeviceConfig { dc, ..SubDeviceConfig::default() }; 3])?;

    // Set-up is over: from here on nothing allocates or blocks, and one frame a cycle carries everything.
    let mut ready = bus.into_cyclic(ClockDirection::CycleFollowsDc)?;
    let mut image = ready.bus.plan().image();
    let mut follower = DcFollower::new(CYCLE, CYCLE / 2, FollowerGains::default());
    let mut wake = ready.clock.now();
    ready.bus.request(Goal::Op, TransitionOptions::default(), wake);
    let mut cycles_in_op = 0;
    while cycles_in_op < 1000 {
        ready.clock.sleep_until(wake);
        // A controller would write image.outputs here, and read image.inputs behind the exchange.
        let _exchange = ready.bus.exchange(&mut image, wake + CYCLE / 2)?;
        match ready.bus.phase() {
            Phase::Reached(Goal::Op) => cycles_in_op += 1,
            Phase::Failed(error) => return Err(error.into()),
            _ => {}
        }
        wake = follower.next_wake(wake, ready.bus.clock());
    }
    println!("{:?}", ready.bus.counters());
    assert_eq!(ready.bus.counters().frames_lost, 0);
    Ok(())
}
