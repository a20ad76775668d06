//! What is no loss isn't treated as one, and what is lost is told, whoever else is away.

use std::time::Duration;

use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Target, in_process};
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Phase};
use omnibase_robot::{Exchange, RequestKind};
use omnibase_run::simulated;

use crate::bench::{Bench, plan};

const OP: u8 = 8;
const BY_HAND: RequestKind =
    RequestKind::Velocity { twist: Twist2 { vx_m_s: 0.3, vy_m_s: 0.1, w_rad_s: 0.2 }, frame: Frame::Body };

/// Drives by hand through short counts in so many frames; the lowest speed of the fastest wheel from then on, rad/s,
/// and whether every drive stayed in OP.
fn by_hand_through(action: FaultAction, frames: u64) -> (Bench, f64) {
    let plan = plan("");
    let (segment, machine) = simulated::segment(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(&plan, link, clock);
    bench.enable();
    for _ in 0..1500 {
        bench.cycle_for(BY_HAND, 200_000_000);
    }
    {
        let mut link = bench.link.0.borrow_mut();
        let next = link.counts().frames;
        for frame in next..next + frames {
            link.inject(Injection { target: Target::Frame(frame), action });
        }
    }
    let mut slowest = f64::INFINITY;
    for cycle in 0..3000 {
        bench.cycle_for(BY_HAND, 200_000_000);
        for position in 0..3 {
            let status = bench.al_status(position);
            assert_eq!(status, OP, "{action:?} {frames}: drive {position} in cycle {cycle}");
        }
        let machine = machine.lock();
        let speeds = (0..3).map(|wheel| machine.shaft(wheel).speed_rad_s.abs());
        slowest = slowest.min(speeds.fold(0.0, f64::max));
    }
    (bench, slowest)
}

#[test]
fn drives_that_miss_a_few_frames_and_are_in_op_all_the_time_go_on() {
    // Three exchanges, each with the questions beside it, are five frames and tolerated.
    for action in [FaultAction::ShortCount, FaultAction::NotProcessed] {
        for frames in 1..=5 {
            let (bench, slowest) = by_hand_through(action, frames);
            assert_eq!(bench.robot.phase(), Phase::Tracking, "{action:?} {frames}: {:?}", bench.events);
            assert!(slowest > 1.0, "{action:?} {frames}: down to {slowest} rad/s, {:?}", bench.events);
            let figures = bench.session.figures();
            assert_eq!(figures.losses, figures.recoveries, "{:?}", bench.events);
        }
    }
}

#[test]
fn drives_that_miss_many_frames_stop_the_robot_and_are_never_taken_to_init() {
    for frames in [6, 10, 30, 90] {
        let (bench, _) = by_hand_through(FaultAction::ShortCount, frames);
        assert!(bench.told("in OP again by itself").len() >= 3, "{frames}: {:?}", bench.events);
        assert!(bench.told("not taken back").is_empty(), "{frames}: {:?}", bench.events);
    }
}

#[test]
fn nothing_behind_the_interface_is_named_within_two_cycles_and_so_is_its_end() {
    for fault in [Fault::PowerOff, Fault::CableCut { port: 0 }] {
        let mut bench = Bench::new(&plan(""));
        bench.enable();
        bench.run(100);
        bench.inject(0, fault.clone());
        let lost_in = bench.cycles + 1;
        bench.run(2);
        let named = bench.told("nothing behind the interface answers");
        assert_eq!(named.len(), 1, "{fault:?}: {:?}", bench.events);
        assert!(named[0].0 < lost_in + 2, "{named:?}");
        let words = "(SubDevice 0), its cable or its power; the interface sees no link";
        assert!(named[0].1.contains(words), "{named:?}");
        bench.run(500);
        let restored = match fault {
            Fault::PowerOff => Fault::PowerOn,
            _ => Fault::CableRestored { port: 0 },
        };
        bench.inject(0, restored);
        let back = (0..20_000).find(|_| bench.cycle(None) == Exchange::Complete);
        assert!(back.is_some(), "{:?}", bench.events);
        assert_eq!(bench.told("nothing behind the interface answers").len(), 1, "{:?}", bench.events);
        assert_eq!(bench.told("something behind the interface answers again after 0.5").len(), 1);
        assert_eq!(bench.session.figures().silences, 1);
    }
}

/// A silence whose frames come late was a pause of who answers: what is said of a cable at its begin isn't left standing. One of
/// many proves nothing.
#[test]
fn a_silence_whose_frames_come_late_is_told_as_a_pause() {
    for (delayed, frames, is_told) in [(3, 3, true), (0, 3, false), (1, 10, false)] {
        let plan = plan("");
        let (link, clock) = in_process(simulated::segment(&plan).unwrap().0);
        let mut bench = Bench::with(&plan, link, clock);
        bench.enable();
        bench.run(100);
        {
            let mut link = bench.link.0.borrow_mut();
            let next = link.counts().frames;
            for frame in 0..frames {
                let is_late = frame < delayed;
                let action = if is_late { FaultAction::Delay { frames } } else { FaultAction::DropAnswer };
                link.inject(Injection { target: Target::Frame(next + frame), action });
            }
        }
        bench.run(100);
        let told = bench.told("something behind the interface answers again after ");
        assert_eq!(told.len(), 1, "{:?}", bench.events);
        assert_eq!(told[0].1.contains("frames came late, so who answers was held up"), is_told, "{told:?}");
    }
}

#[test]
fn a_single_lost_frame_is_no_silence() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(0, Fault::CrcErrors { port: 0, frames: 1 });
    bench.run(100);
    assert_eq!(bench.session.figures().silences, 0);
    assert!(bench.told("nothing behind").is_empty());
}

#[test]
fn emergencies_arrive_while_somebody_else_is_away() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(2, Fault::PowerOff);
    bench.run(100);
    bench.inject(1, Fault::Application(ApplicationFault::DriveFault(0x7500)));
    bench.run(200);
    assert_eq!(bench.told("(SubDevice 1): emergency").len(), 1, "{:?}", bench.events);
}

#[test]
fn what_was_counted_is_not_counted_again_after_a_way_back_that_kept_power() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(1, Fault::CrcErrors { port: 0, frames: 2 });
    bench.run(1000);
    assert_eq!(bench.session.figures().crc_errors, 2);
    bench.inject(1, Fault::Application(ApplicationFault::AlError(0x001A)));
    bench.run(6000);
    assert_eq!(bench.al_status(1), OP);
    assert_eq!(bench.session.figures().crc_errors, 2, "{:?}", bench.told("damaged"));
    // One that started anew counts from nothing.
    bench.inject(1, Fault::PowerCycle { off_for: Duration::from_millis(50) });
    bench.run(6000);
    bench.inject(1, Fault::CrcErrors { port: 0, frames: 1 });
    bench.run(1000);
    assert_eq!(bench.session.figures().crc_errors, 3, "{:?}", bench.told("damaged"));
}
