//! SubDevices without a wheel on the bus: named or refused, mapped as their file says, lost and back.

use std::time::Duration;

use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_robot::signals::{Phase, SafetyReason};
use omnibase_robot::{Exchange, RobotPlan};
use omnibase_run::simulated;
use omnibase_session::session::Session;

use crate::bench::{Bench, plan};

const BUTTONS: &str = "[[device]]\nname = \"buttons\"\nposition = 3\nkind = \"io\"\n\
    inputs = [{ pdo = \"0x1A00\", map = \"6000.1:1 6000.2:1\" }]\n\
    outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
    input = [{ name = \"stop\", object = \"6000.1\" }, { name = \"go\", object = \"6000.2\", simulated = 1 }]\n\
    output = [{ name = \"level\", object = \"7000.1\", type = \"u16\" }]\n";
const STOPS: &str = "[safety]\nstop_input = \"buttons.stop\"\nenable_input = \"buttons.go\"\n";

/// Why a robot isn't brought up on the simulated bus of another one.
fn refused(bus_of: &RobotPlan, plan: &RobotPlan) -> String {
    let (link, clock) = in_process(simulated::segment(bus_of).unwrap().0);
    match Session::prepare(link, clock, plan, &mut |warning| panic!("{warning}")) {
        Ok(_) => panic!("it was taken"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_subdevice_that_nobody_named_is_refused_with_the_way_out() {
    let error = refused(&plan(BUTTONS), &plan(""));
    assert!(error.contains("SubDevice 3 (buttons"), "{error}");
    assert!(error.contains("`[[device]]`") && error.contains("kind = \"ignore\""), "{error}");
    // One that is missing isn't helped by another table.
    let error = refused(&plan(""), &plan(BUTTONS));
    assert!(!error.contains("`[[device]]`"), "{error}");
}

#[test]
fn other_process_data_than_the_file_says_are_refused() {
    let other = BUTTONS.replace("6000.1:1 6000.2:1", "6000.2:1 6000.1:1");
    let error = refused(&plan(&other), &plan(BUTTONS));
    assert!(error.contains("`buttons` (SubDevice 3): its inputs are `6000.2:1 6000.1:1`"), "{error}");
    assert!(error.contains("`6000.1:1 6000.2:1`"), "{error}");
}

#[test]
fn what_is_ignored_is_brought_along_whatever_it_is() {
    let ignored = "[[device]]\nname = \"thing\"\nposition = 3\nkind = \"ignore\"\n";
    let plan = plan(ignored);
    for bus_of in [crate::bench::plan(BUTTONS), plan.clone()] {
        let (link, clock) = in_process(simulated::segment(&bus_of).unwrap().0);
        let mut bench = Bench::with(&plan, link, clock);
        bench.enable();
        bench.run(100);
        assert_eq!((bench.robot.phase(), bench.al_status(3)), (Phase::Holding, 8));
    }
}

#[test]
fn a_terminal_that_lost_its_power_stops_the_robot_and_finds_no_old_output_when_it_is_back() {
    let plan = plan(&format!("{BUTTONS}{STOPS}"));
    let simulated::Simulated { segment, panels, .. } = simulated::robot(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(&plan, link, clock);
    let level = || {
        let object = omnibase_ethercat::wire::coe::ObjectAddress::new(0x7000, 1);
        panels[0].output(object).unwrap()
    };
    bench.enable();
    bench.cycle(Some(omnibase_robot::RequestKind::SetOutput { index: 0, value: 500.0 }));
    bench.run(5);
    assert_eq!((level(), bench.robot.record().signals.believed), (500, 0b11));
    // Its own watchdog takes the output away when nobody says anything, as those of the drives do.
    assert_eq!(bench.peek(3, 0x0420, 2), plan.bus.drive_watchdog.steps.to_le_bytes());
    bench.inject(3, Fault::PowerCycle { off_for: Duration::from_millis(300) });
    let mut away = 0;
    for _ in 0..200 {
        if let Exchange::Without { wheels, devices } = bench.cycle(None) {
            assert_eq!((wheels, devices & !1), (0, 0));
            away += u32::from(devices);
        }
    }
    assert!(away > 150, "named for {away} cycles");
    let record = *bench.robot.record();
    assert_eq!((record.signals.believed, record.signals.inputs[1]), (0, 1.0));
    assert!(record.signals.ages_s[0] > 0.15);
    assert_eq!((bench.robot.phase(), record.stop_reason), (Phase::Fault, SafetyReason::DeviceLost));
    bench.run(5000);
    assert_eq!(bench.al_status(3), 8, "{:?}", bench.events);
    assert_eq!((level(), bench.robot.record().signals.believed), (0, 0b11));
    bench.cycle(Some(omnibase_robot::RequestKind::Acknowledge));
    bench.enable();
}

#[test]
fn a_terminal_with_a_mailbox_is_sent_its_maps_and_parameters() {
    let text = format!(
        "{BUTTONS}parameters = [{{ object = \"8000.1\", type = \"u16\", value = 5 }}, \
         {{ object = \"8010\", type = \"u8\", value = 1 }}]\n"
    );
    let mut bench = Bench::new(&plan(&text));
    bench.enable();
    assert_eq!(bench.robot.record().signals.inputs[..2], [0.0, 1.0]);
    // Its process data stand behind the mailbox's SyncManagers: 2 bytes out, 1 in.
    let length = |manager: u16| bench.peek(3, 0x0802 + 8 * manager, 2);
    assert_eq!([length(2), length(3)], [[2, 0], [1, 0]]);
    // Its maps are fixed: what differs is refused.
    let other = text.replace("6000.1:1 6000.2:1", "6000.2:1 6000.1:1");
    let error = refused(&plan(&other), &plan(&text));
    assert!(error.contains("6000") || error.contains("1a00"), "{error}");
}
