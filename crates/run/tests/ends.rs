//! Every end of a run is a defined stop: whatever happens in whatever phase, the drives are led down or stop by
//! themselves, and the run says why.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use omnibase_ethercat::wire::{AlState, Clock, HostTime, Link, LinkError, register};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, SimLink, VirtualClock, in_process};
use omnibase_robot::{Registry, Robot, RobotPlan};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::{Progress, Ran, RobotText, RunError, Setup, run, simulated};
use omnibase_session::session::{Session, SessionError};

const BMM: &str = include_str!("../../../robots/bmm.toml");
const BROKEN: LinkError = LinkError::System { operation: "sending a frame", code: 5 };
/// Longer than every watchdog, quick stop and roll-out of these robots.
const AFTERWARDS: Duration = Duration::from_secs(10);

fn plan(changes: &[&str]) -> RobotPlan {
    let circle = ["reference.kind = \"circle\"", "reference.radius_m = 0.5", "reference.duration_s = 10.0"];
    let changes = circle.iter().chain(changes).map(ToString::to_string).collect();
    let text = RobotText { text: BMM.into(), changes, ..RobotText::default() };
    text.load(&Registry::with_built_in()).unwrap().plan
}

/// What happens to a run from outside.
#[derive(Clone, Debug)]
enum Deed {
    /// Somebody wants the end.
    Stop,
    /// Something breaks at a SubDevice.
    Break(usize, Fault),
    /// No frame comes through any more.
    Cut,
    /// The port itself is broken.
    BreakPort,
}

/// When it happens.
#[derive(Clone, Copy, Debug)]
enum When {
    /// Before the first frame.
    AtFirst,
    /// In this cycle of OP.
    Cycle(u64),
}

/// A link into the simulated robot at which things happen.
struct Eventful<'a> {
    link: SimLink,
    deeds: Vec<(When, Deed)>,
    stop: &'a AtomicBool,
    progress: &'a Progress,
    cut: bool,
    is_broken: bool,
}

impl Eventful<'_> {
    fn act(&mut self) {
        let cycles = self.progress.cycles.load(Ordering::Relaxed);
        while let Some((_, deed)) = self.deeds.pop_if(|(when, _)| match when {
            When::AtFirst => true,
            When::Cycle(cycle) => cycles >= *cycle,
        }) {
            match deed {
                Deed::Stop => self.stop.store(true, Ordering::Relaxed),
                Deed::Break(position, fault) => self.link.segment_mut().inject(position, fault).unwrap(),
                Deed::Cut => self.cut = true,
                Deed::BreakPort => self.is_broken = true,
            }
        }
    }
}

impl Link for Eventful<'_> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.act();
        match (self.is_broken, self.cut) {
            (true, _) => Err(BROKEN),
            (_, true) => Ok(()),
            _ => self.link.send(frame),
        }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// What came of a run, and of its robot.
struct Ended {
    ran: Result<Ran, RunError>,
    /// States of the SubDevices long after.
    states: Vec<AlState>,
    /// How fast the robot is then, m/s.
    speed_m_s: f64,
    /// States of the SubDevices when the run was over.
    states_at_end: Vec<AlState>,
}

fn states(link: &SimLink) -> Vec<AlState> {
    let status = |bytes: &[u8]| AlState::from_bits(u16::from_le_bytes([bytes[0], bytes[1]])).unwrap();
    let devices = link.segment().sub_devices().iter();
    devices.map(|one| status(one.esc().peek(register::AL_STATUS, 2).unwrap())).collect()
}

/// Runs a robot along its circle while all that happens, the latest deed first.
fn played(changes: &[&str], mut deeds: Vec<(When, Deed)>) -> Ended {
    deeds.reverse();
    let plan = plan(changes);
    let (segment, machine) = simulated::segment(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let (stop, progress) = (AtomicBool::new(false), Progress::default());
    let mut link = Eventful { link, deeds, stop: &stop, progress: &progress, cut: false, is_broken: false };
    let setup = Setup {
        plan: &plan,
        robot: Robot::build(&plan, &Registry::with_built_in()).unwrap(),
        machine: Some(machine.clone()),
        script: None,
        recording: None,
        live: None,
        stop: &stop,
        progress: &progress,
    };
    let ran = run(&mut link, clock.clone(), setup, &mut |_| ());
    let states_at_end = states(&link.link);
    afterwards(&mut link.link, &clock, &machine);
    let twist = machine.truth().twist_in_body;
    Ended {
        ran,
        states: states(&link.link),
        speed_m_s: twist.vx_m_s.hypot(twist.vy_m_s) + twist.w_rad_s.abs(),
        states_at_end,
    }
}

fn afterwards(link: &mut SimLink, clock: &VirtualClock, machine: &SharedMachine) {
    let until = clock.now() + AFTERWARDS;
    clock.advance_to(until);
    link.segment_mut().advance(until);
    machine.lock().advance(until.0);
}

impl Ended {
    /// The words of its error, with those of its causes.
    fn error(&self) -> String {
        match &self.ran {
            Ok(Ran { ended: Ok(()), .. }) => "none".to_owned(),
            Ok(Ran { ended: Err(error), .. }) | Err(error) => error.to_string(),
        }
    }

    fn events(&self) -> Vec<&str> {
        let ran = self.ran.as_ref().expect("it got into OP");
        ran.summary.events.iter().map(|event| event.text.as_str()).collect()
    }

    /// Nothing moves, and nobody is in OP.
    #[track_caller]
    fn is_safe(&self, what: &str) {
        assert!(self.speed_m_s < 1e-6, "{what}: still at {} m/s", self.speed_m_s);
        assert!(self.states.iter().all(|state| *state < AlState::Op), "{what}: {:?}", self.states);
    }
}

#[test]
fn a_stop_in_any_phase_leads_the_drives_down_in_order() {
    let cases = [
        ("before OP", When::AtFirst, None),
        ("before enabling", When::Cycle(1), Some("a stop was asked for")),
        ("while enabling", When::Cycle(4), Some("drives disabled")),
        ("while tracking", When::Cycle(3000), Some("ramping down")),
        ("while the end is held", When::Cycle(10_500), Some("ramping down")),
    ];
    for (what, when, expected) in cases {
        let ended = played(&[], vec![(when, Deed::Stop)]);
        assert_eq!(ended.error(), "none", "{what}");
        assert_eq!(ended.states_at_end, [AlState::Init; 3], "{what}");
        ended.is_safe(what);
        let ran = ended.ran.as_ref().unwrap();
        assert!(!ran.finished || when_is_late(when), "{what}");
        match expected {
            None => assert_eq!(ran.summary.cycles, 0, "{what}"),
            Some(words) => {
                let events = ended.events();
                assert!(events.contains(&words), "{what}: {events:?}");
                let last = if matches!(when, When::Cycle(1)) { words } else { "drives disabled" };
                assert_eq!(events.last(), Some(&last), "{what}: {events:?}");
            }
        }
    }
}

/// Whether the reference was at its end before.
fn when_is_late(when: When) -> bool {
    matches!(when, When::Cycle(cycle) if cycle > 10_000)
}

#[test]
fn a_drive_that_fails_in_any_phase_stops_all_and_is_named_with_its_code() {
    let fault = || Fault::Application(ApplicationFault::DriveFault(0x7500));
    for (what, cycle) in [("while enabling", 4), ("while tracking", 3000), ("while its end is held", 10_500)]
    {
        let ended = played(&[], vec![(When::Cycle(cycle), Deed::Break(1, fault()))]);
        let error = ended.error();
        assert!(error.starts_with("the robot stopped: a drive failed"), "{what}: {error}");
        assert!(error.contains("wheel_2: ") && error.contains("it says error 0x7500"), "{what}: {error}");
        assert_eq!(ended.states_at_end, [AlState::Init; 3], "{what}");
        ended.is_safe(what);
    }
}

#[test]
fn a_drive_that_does_not_get_enabled_in_time_ends_the_run() {
    // Its safety input lets nothing be switched on.
    let forbidden = Fault::Application(ApplicationFault::SafeTorqueOff(true));
    let ended = played(&[], vec![(When::Cycle(3), Deed::Break(2, forbidden))]);
    let error = ended.error();
    assert!(error.starts_with("the robot stopped: "), "{error}");
    assert!(
        error.contains("wheel_3: from Ready to switch on to Operation enabled: no step within"),
        "{error}"
    );
    assert_eq!(ended.speed_m_s, 0.0);
    assert_eq!(ended.states_at_end, [AlState::Init; 3]);
}

#[test]
fn a_drive_whose_firmware_hangs_while_it_is_enabled_ends_the_run() {
    let frozen = Fault::Application(ApplicationFault::Frozen(true));
    let ended = played(&[], vec![(When::Cycle(3), Deed::Break(2, frozen))]);
    let error = ended.error();
    assert!(error.starts_with("the robot stopped: a SubDevice was lost"), "{error}");
    // Firmware that does nothing doesn't take its state back either: its torque was never switched on.
    assert_eq!(ended.speed_m_s, 0.0);
    assert_eq!(ended.states_at_end[..2], [AlState::Init; 2], "those that listen went down");
}

#[test]
fn lost_frames_end_in_a_stop_also_while_it_ramps_down() {
    let cases: [(&str, &[(When, Deed)]); 3] = [
        ("while enabling", &[(When::Cycle(4), Deed::Cut)]),
        ("while tracking", &[(When::Cycle(3000), Deed::Cut)]),
        ("while ramping down", &[(When::Cycle(3000), Deed::Stop), (When::Cycle(3050), Deed::Cut)]),
    ];
    for (what, deeds) in cases {
        let ended = played(&[], deeds.to_vec());
        let error = ended.error();
        assert!(
            error.starts_with("the robot stopped: too many exchanges in a row were lost"),
            "{what}: {error}"
        );
        // Nobody could lead the drives down: they did it by themselves.
        ended.is_safe(what);
        assert_eq!(ended.states, [AlState::SafeOp; 3], "{what}");
    }
}

#[test]
fn a_port_that_is_broken_ends_the_run_at_once() {
    let ended = played(&[], vec![(When::Cycle(3000), Deed::BreakPort)]);
    assert!(matches!(ended.ran, Ok(Ran { ended: Err(RunError::Session(SessionError::Link(BROKEN))), .. })));
    ended.is_safe("without a port");
}

#[test]
fn a_drive_without_power_ends_the_run_and_the_others_are_led_down() {
    let ended = played(&[], vec![(When::Cycle(3000), Deed::Break(2, Fault::PowerOff))]);
    assert!(ended.error().starts_with("the robot stopped: "), "{}", ended.error());
    ended.is_safe("without power");
    assert_eq!(ended.states_at_end[..2], [AlState::Init; 2]);
}

#[test]
fn a_refused_state_is_named_and_everyone_goes_back() {
    // No SYNC0 of 5 ms for an SGDV, of which the file doesn't know that it is one.
    let changes = [
        "bus.cycle_us = 5000",
        "drive_defaults.device = \"cia402\"",
        "drive_defaults.vendor_id = \"0x0539\"",
        "drive_defaults.product_code = \"0x02200001\"",
        "drive_defaults.counts_per_revolution = 1048576",
    ];
    let ended = played(&changes, Vec::new());
    let error = ended.error();
    for expected in ["SAFE-OP", "SubDevice 0", "0x0035"] {
        assert!(error.contains(expected), "{expected}: {error}");
    }
    assert_eq!(ended.states_at_end, [AlState::Init; 3]);
    ended.is_safe("refused");
}

#[test]
fn a_session_that_goes_without_its_end_takes_the_drives_out_of_op() {
    let plan = plan(&[]);
    let (segment, _machine) = simulated::segment(&plan).unwrap();
    let (mut link, clock) = in_process(segment);
    let mut session = Session::prepare(&mut link, clock.clone(), &plan, &mut |_| ()).unwrap();
    assert!(session.reach_op(&AtomicBool::new(false)).unwrap());
    drop(session);
    let soon = clock.now() + Duration::from_millis(20);
    link.segment_mut().advance(soon);
    assert_eq!(states(&link), [AlState::Init; 3]);
}

/// Who is known to be lost isn't told as somebody who refuses a register; whose firmware hangs answers all the same.
#[test]
fn the_way_back_without_a_lost_drive_says_that_it_does_not_answer() {
    let frozen = Fault::Application(ApplicationFault::Frozen(true));
    let cases = [
        (Fault::PowerOff, "SubDevice 2 did not answer at its station address"),
        (frozen, "SubDevice 2 does not take register 0x0120"),
    ];
    for (fault, expected) in cases {
        let plan = plan(&[]);
        let (segment, _machine) = simulated::segment(&plan).unwrap();
        let (mut link, clock) = in_process(segment);
        let injector = link.segment_mut().injector();
        let mut session = Session::prepare(&mut link, clock, &plan, &mut |_| ()).unwrap();
        assert!(session.reach_op(&AtomicBool::new(false)).unwrap());
        injector.inject(2, fault);
        for _ in 0..100 {
            session.exchange().unwrap();
        }
        let words = session.end().unwrap_err().to_string();
        assert!(words.starts_with(&format!("on the way to INIT: {expected}")), "{words}");
        drop(session);
        assert_eq!(states(&link)[..2], [AlState::Init; 2]);
    }
}

/// The drives' watchdog as it was written, and chips that took another one, or none.
#[test]
fn the_drives_watchdog_is_read_back() {
    /// Changes the answer to a read of one register at one SubDevice.
    struct Lying<'a>(&'a mut SimLink, [u8; 2], u8);
    impl Link for Lying<'_> {
        fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
            self.0.send(frame)
        }
        fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
            let received = self.0.receive(buffer, deadline)?;
            let Lying(_, [low, high], by) = *self;
            // APRD (1), its position counted up by three SubDevices from that of the second.
            if buffer[16] == 1 && buffer[18..22] == [2, 0, low, high] {
                buffer[26] ^= by;
            }
            Ok(received)
        }
    }
    let plan = plan(&["safety.drive_watchdog_us = 20000"]);
    let (segment, _machine) = simulated::segment(&plan).unwrap();
    let (mut link, clock) = in_process(segment);
    drop(Session::prepare(&mut link, clock.clone(), &plan, &mut |_| ()).unwrap());
    for device in link.segment().sub_devices() {
        assert_eq!(device.esc().peek(register::WATCHDOG_DIVIDER, 2), Some(&2498u16.to_le_bytes()[..]));
        assert_eq!(device.esc().peek(register::WATCHDOG_PROCESS_DATA, 2), Some(&200u16.to_le_bytes()[..]));
    }
    for (register, by, expected) in [
        ([0x20, 0x04], 1, "its watchdog is 20100 us (registers 0x0400, 0x0420), expected 20000 us"),
        (
            [0x14, 0x08],
            0x40,
            "its outputs don't trigger its watchdog (control byte of SyncManager 2 is 0x24, expected bit 6 to be set)",
        ),
    ] {
        let lying = Lying(&mut link, register, by);
        let Err(error) = Session::prepare(lying, clock.clone(), &plan, &mut |_| ()) else {
            panic!("it read back what it hadn't written");
        };
        assert_eq!(error.to_string(), format!("`wheel_2` (SubDevice 1): {expected}"));
    }
}
