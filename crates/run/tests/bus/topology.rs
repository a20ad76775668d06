//! Who is plugged in where, and doesn't come along: what is harmless is named, what matters is refused.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::segment_file::SegmentFile;
use omnibase_ethercat_sim::{Fault, Segment, in_process};
use omnibase_robot::Exchange;
use omnibase_robot::signals::Phase;
use omnibase_robot_sim::RobotSim;
use omnibase_run::simulated;
use omnibase_session::session::Session;

use crate::bench::{Bench, plan, plan_with};

const OP: u8 = 8;

/// The BMM with one drive more beside it, whose cable isn't plugged in behind SubDevice `behind` yet.
fn with_a_stranger(behind: usize) -> Bench {
    let plan = plan("");
    let mut robot = RobotSim::new(&simulated::description(&plan)).unwrap();
    let stranger = Drive::new(DriveKind::Generic).build(&Piece::default(), Load::default());
    robot.sub_devices.insert(behind + 1, stranger);
    let mut segment = Segment::line(robot.sub_devices).unwrap();
    segment.inject(behind, Fault::CableCut { port: 1 }).unwrap();
    Bench::on(&plan, segment)
}

#[test]
fn one_that_is_plugged_in_is_named_and_changes_nothing() {
    let mut bench = with_a_stranger(2);
    bench.enable();
    bench.inject(2, Fault::CableRestored { port: 1 });
    let plugged_in = bench.cycles + 1;
    bench.run(2);
    let named = bench.told("4 SubDevices answer, 3 were set up");
    assert_eq!(named.len(), 1, "{:?}", bench.events);
    assert!(named[0].0 < plugged_in + 2, "{named:?}");
    for _ in 0..1000 {
        assert_eq!(bench.cycle(None), Exchange::Complete);
    }
    assert_eq!(bench.robot.phase(), Phase::Holding);
    assert_eq!(bench.session.figures().surplus, 1);
    bench.inject(2, Fault::CableCut { port: 1 });
    bench.run(10);
    assert_eq!(bench.told("no more than 3 SubDevices answer again").len(), 1, "{:?}", bench.events);
    assert_eq!((bench.session.figures().surplus, bench.session.figures().losses), (0, 0));
}

/// Whoever was told as silent is told anew where others begin to answer at its address: something else has to be done.
#[test]
fn others_at_a_silent_ones_address_are_told() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    let address = bench.peek(2, 0x0010, 2);
    bench.inject(2, Fault::PowerOff);
    bench.run(20);
    assert_eq!(bench.told("lost: it does not answer").len(), 1, "{:?}", bench.events);
    bench.write_register(0, 0x0010, &address);
    bench.write_register(1, 0x0010, &address);
    bench.run(200);
    let told = bench.told("another SubDevice answers at its address");
    assert!(told.len() == 1 && told[0].1.contains("(SubDevice 2)"), "{:?}", bench.events);
}

#[test]
fn with_one_more_plugged_in_nobody_is_taken_back_by_position() {
    let mut bench = with_a_stranger(2);
    bench.enable();
    bench.inject(2, Fault::CableRestored { port: 1 });
    bench.run(100);
    // So quick that those behind it stay connected.
    bench.inject(2, Fault::PowerOff);
    bench.inject(2, Fault::PowerOn);
    bench.run(3000);
    let refused = bench.told("not taken back: 4 SubDevices answer, 3 were set up");
    assert_eq!(refused.len(), 1, "{:?}", bench.events);
    assert_eq!(bench.peek(2, 0x0010, 2), [0, 0], "nothing was written to it");
    // Without the stranger it is.
    bench.inject(2, Fault::CableCut { port: 1 });
    bench.run(3000);
    assert_eq!((0..3).map(|one| bench.al_status(one)).collect::<Vec<_>>(), [OP; 3], "{:?}", bench.events);
}

#[test]
fn two_that_kept_power_and_changed_places_are_refused() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.run(100);
    // As the bus sees two drives whose cables were changed over: each answers where the other was.
    let [one, other] = [1, 2].map(|position| bench.peek(position, 0x0010, 2));
    bench.write_register(1, 0x0010, &other);
    bench.write_register(2, 0x0010, &one);
    assert_eq!([1, 2].map(|position| bench.peek(position, 0x0010, 2)), [other, one]);
    for position in [1, 2] {
        bench.inject(position, Fault::Application(ApplicationFault::AlError(0x001B)));
    }
    bench.run(3000);
    let refused = bench.told("not taken back: at position");
    assert_eq!(refused.len(), 2, "{:?}", bench.events);
    assert!(refused[0].1.contains("stands station 0x100"), "{refused:?}");
    assert_ne!((bench.al_status(1), bench.al_status(2)), (OP, OP));
}

/// Three drives of the BMM that take 11 s for each change of state.
const SLOW: &str = "[[subdevice]]\nkind = \"sgdv\"\ncount = 3\nservo = { transition_us = 11_000_000 }\n";

#[test]
fn a_drive_that_is_too_slow_is_told_with_the_key_that_gives_it_longer() {
    for (timeouts, told, key) in [
        ("", "PRE-OP not reached within 3 s", "pre_op_ms"),
        ("pre_op_ms = 12_000, init_ms = 12_000", "still in PRE-OP after 10 s", "safe_op_op_ms"),
    ] {
        let plan = plan_with(&[&format!("drive_defaults.timeouts = {{ {timeouts} }}")]);
        let (link, clock) = in_process(SegmentFile::parse(SLOW).unwrap().build(Path::new(".")).unwrap());
        let session = Session::prepare(link, clock, &plan, &mut |_| ());
        let reached = session.and_then(|mut session| session.reach_op(&AtomicBool::new(false)));
        let text = reached.unwrap_err().to_string();
        let way_out =
            format!("`timeouts = {{ {key} = … }}` in its table of the robot's file gives it longer");
        assert!(text.contains(told) && text.ends_with(&way_out), "{text}");
    }
}
