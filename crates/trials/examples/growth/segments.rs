//! A cycle of the MainDevice and of the simulated segment, in one process, by SubDevices.

use omnibase_ethercat::cyclic::{ClockDirection, Goal, TransitionOptions};
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::{Bus, BusOptions, DcConfig, SubDeviceConfig};
use omnibase_ethercat_sim::{SegmentFile, in_process};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::{Growth, median_us};

/// Long enough for a thousand SubDevices on the cable.
const CYCLE: Duration = Duration::from_millis(8);
const CYCLES: usize = 1000;

/// By SubDevices.
pub(super) fn growth() -> Growth {
    let rows = [1, 3, 10, 30, 100, 300, 1000].map(|count| {
        let took_us = cycle_us(count);
        (count as f64, vec![took_us, took_us / count as f64])
    });
    Growth {
        title: "A cycle of the MainDevice with simulated servos, chips and firmware",
        across: "SubDevices",
        curves: vec!["us", "us by SubDevice"],
        rows: rows.into(),
    }
}

/// The median of a cycle, us.
fn cycle_us(count: usize) -> f64 {
    let text = format!("[[subdevice]]\nkind = \"servo\"\nname = \"servo\"\ncount = {count}\nserial = 1\n");
    let segment = SegmentFile::parse(&text).and_then(|file| file.build(Path::new("."))).expect("servos");
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().expect("they are there");
    let dc = DcConfig::Sync0 { cycle_ns: CYCLE.as_nanos() as u32, shift_ns: 0 };
    bus.configure(&vec![SubDeviceConfig { dc, ..SubDeviceConfig::default() }; count]).expect("servos");
    let ready = bus.into_cyclic(ClockDirection::CycleFollowsDc).expect("they follow the clock");
    let mut image = ready.bus.plan().image();
    let pace = Pace { cycle: CYCLE, timeout: CYCLE / 2, leader: Leader::ReferenceClock, sync0_shift_ns: 0 };
    let mut paced = PacedBus::new(ready.bus, ready.clock, pace);
    let never = AtomicBool::new(false);
    paced
        .reach(Goal::Op, TransitionOptions::default(), &never, |paced| paced.exchange(&mut image).map(drop))
        .expect("operational");
    let took_us = median_us(CYCLES, || {
        paced.exchange(&mut image).expect("an exchange");
    });
    assert_eq!(paced.bus().counters().frames_lost, 0);
    took_us
}
