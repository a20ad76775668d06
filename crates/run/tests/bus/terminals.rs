//! SubDevices without a wheel on the bus: named or refused, mapped as their file says, lost and back.

use std::time::Duration;

use omnibase_ethercat::wire::coe::AbortCode;
use omnibase_ethercat_sim::{Fault, in_process};

use omnibase_robot::signals::{Phase, RequestAnswer, SafetyReason};
use omnibase_robot::{CycleRecord, Exchange, ImageBuffer, Registry, Request, RequestKind, Robot, RobotPlan};
use omnibase_run::{RobotText, simulated};
use omnibase_session::session::Session;

use crate::bench::{BMM, Bench, plan, plan_with};

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

/// What is wrong with a file that has this more.
fn refused_text(more: &str) -> String {
    let text = RobotText { text: format!("{BMM}\n{more}"), ..RobotText::default() };
    let problems = text.load(&Registry::with_built_in()).unwrap_err();
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
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

const GRIPPER: &str = "[[device]]\nname = \"gripper\"\nalias = 77\ngroup = \"arm\"\nkind = \"io\"\n\
    inputs = [{ pdo = \"0x1A00\", map = \"6000.1:1 6000.2:1\" }]\n\
    outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
    input = [{ name = \"closed\", object = \"6000.1\", simulated = 1 }, { name = \"full\", object = \"6000.2\" }]\n\
    output = [{ name = \"force\", object = \"7000.1\", type = \"u16\", on_stop = 3 }]\n";

/// A group that isn't plugged in is no loss: the robot is enabled and drives, and nothing of it is believed. What ran is computed
/// again to the bit.
#[test]
fn a_hot_connect_group_that_is_absent_is_told_and_stops_nobody() {
    let with = plan(GRIPPER);
    let mut told = Vec::new();
    let (link, clock) = in_process(simulated::segment(&plan("")).unwrap().0);
    Session::prepare(link, clock, &with, &mut |words| told.push(words)).unwrap();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("hot-connect group `arm` isn't plugged in"), "{told:?}");

    let (link, clock) = in_process(simulated::segment(&plan("")).unwrap().0);
    let mut bench = Bench::with(&with, link, clock);
    bench.enable();
    bench.run(100);
    let record = *bench.robot.record();
    assert_eq!((bench.robot.phase(), record.exchange), (Phase::Holding, Exchange::Complete));
    assert_eq!((record.signals.believed, record.signals.ages_s[0]), (0, f64::INFINITY));
    assert_eq!(record.signals.output_bytes[..2], [0, 0]);
    // The same inputs give the same record, in a buffer that has room for what wasn't there.
    let mut again = Robot::build(&with, &Registry::with_built_in()).unwrap();
    let mut image = ImageBuffer::new(&with);
    let computed = *again.replay(&record, &mut image);
    assert!(image.device_inputs[0].is_empty());
    assert_eq!((computed.signals.ages_s[0], computed.signals.believed), (f64::INFINITY, 0));
    assert_eq!(computed.signals.output_bytes, record.signals.output_bytes);
}

/// Valves of a gripper say nothing of themselves: they are written where they are there, and whoever sets those that aren't is refused.
#[test]
fn a_hot_connect_group_of_outputs_alone_may_be_absent() {
    let inputs = |line: &&str| !line.starts_with("input");
    let valves: Vec<&str> = GRIPPER.split_inclusive('\n').filter(inputs).collect();
    let with = plan(&valves.concat());
    for is_there in [true, false] {
        let bus_of = if is_there { with.clone() } else { plan("") };
        let simulated::Simulated { segment, panels, .. } = simulated::robot(&bus_of).unwrap();
        let (link, clock) = in_process(segment);
        let mut bench = Bench::with(&with, link, clock);
        bench.enable();
        let set = RequestKind::SetOutput { index: 0, value: 500.0 };
        bench.cycle(Some(set));
        let record = *bench.robot.record();
        assert_eq!(
            (record.answer == RequestAnswer::Refused, record.exchange),
            (!is_there, Exchange::Complete)
        );
        bench.run(5);
        let object = omnibase_ethercat::wire::coe::ObjectAddress::new(0x7000, 1);
        let written = panels.first().and_then(|panel| panel.output(object));
        assert_eq!(written, is_there.then_some(500), "{:?}", bench.robot.record().signals);
        // A replay knows it by the record alone.
        let record = CycleRecord { request: Some(Request::lasting(set)), ..*bench.robot.record() };
        let mut again = Robot::build(&with, &Registry::with_built_in()).unwrap();
        let computed = again.replay(&record, &mut ImageBuffer::new(&with));
        assert_eq!(computed.answer == RequestAnswer::Refused, !is_there);
    }
}

/// What comes later is told, and left alone until the next start: whoever drives goes on.
#[test]
fn a_hot_connect_group_that_comes_later_is_told_and_disturbs_nobody() {
    let with = plan(GRIPPER);
    let mut segment = simulated::segment(&with).unwrap().0;
    segment.inject(3, Fault::PowerOff).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(&with, link, clock);
    bench.enable();
    bench.run(10);
    bench.inject(3, Fault::PowerOn);
    bench.run(1000);
    let told = bench.events.iter().filter(|(_, event)| event.contains("hot-connect group arm?")).count();
    assert_eq!(told, 1, "{:?}", bench.events);
    assert_eq!((bench.robot.phase(), bench.robot.record().exchange), (Phase::Holding, Exchange::Complete));
    assert_eq!((bench.robot.record().signals.believed, bench.al_status(3)), (0, 1));
}

/// Plugged in at the start it is as any other: what is lost of it stops the robot.
#[test]
fn a_hot_connect_group_that_is_there_is_missed_when_it_goes() {
    let plan = plan(GRIPPER);
    let (link, clock) = in_process(simulated::segment(&plan).unwrap().0);
    let mut bench = Bench::with(&plan, link, clock);
    bench.enable();
    bench.run(10);
    assert_eq!(bench.robot.record().signals.believed, 0b11);
    bench.inject(3, Fault::PowerOff);
    bench.run(200);
    assert_eq!(
        (bench.robot.phase(), bench.robot.record().stop_reason),
        (Phase::Fault, SafetyReason::DeviceLost)
    );
}

/// Half of a group is refused by what is missing; that the robot runs without it isn't said before.
#[test]
fn a_part_of_a_hot_connect_group_is_not_called_absent() {
    let lamp = GRIPPER.replace("gripper", "lamp").replace("alias = 77", "alias = 78");
    let there = plan(&GRIPPER.replace("group = \"arm\"\n", ""));
    let (link, clock) = in_process(simulated::segment(&there).unwrap().0);
    let mut told = Vec::new();
    let both = plan(&format!("{GRIPPER}{lamp}"));
    let refused = Session::prepare(link, clock, &both, &mut |words| told.push(words)).err().unwrap();
    assert!(refused.to_string().contains("`lamp` is not; connect all of it, or none"), "{refused}");
    assert_eq!(told, Vec::<String>::new());
}

#[test]
fn a_hot_connect_group_never_shifts_a_position_that_others_are_known_by() {
    // The file expects the buttons where the gripper is plugged in.
    let alias = |device: &str, alias: &str| device.replace("position = 3", alias);
    let in_front = GRIPPER.replace("group = \"arm\"\n", "");
    let bus_of = plan(&format!("{in_front}{}", alias(BUTTONS, "alias = 78")));
    let words = refused(&bus_of, &plan(&format!("{BUTTONS}{GRIPPER}")));
    assert!(words.contains("`gripper` is of a hot-connect group and at position 3"), "{words}");
    assert!(words.contains("give these an alias"), "{words}");
    let words = refused_text(&GRIPPER.replace("alias = 77", "position = 3"));
    assert!(words.contains("who may be absent is found by `alias` or `identification`"), "{words}");
    let words = refused_text(&format!("{GRIPPER}{}", BUTTONS.replace("position = 3", "position = 4")));
    assert!(words.contains("it would shift with a hot-connect group"), "{words}");
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

/// More in each direction than has room between the usual places of outputs and inputs.
#[test]
fn a_terminal_with_much_process_data_is_simulated() {
    let map =
        |object: u16| (1..=5).map(|entry| format!("{object:04X}.{entry}:240")).collect::<Vec<_>>().join(" ");
    let pdos = |first: u16, object: u16| {
        let all = (0..6)
            .map(|pdo| format!("{{ pdo = \"0x{:04X}\", map = \"{}\" }}", first + pdo, map(object + pdo)));
        all.collect::<Vec<_>>().join(", ")
    };
    let text = format!(
        "[[device]]\nname = \"gateway\"\nposition = 3\nkind = \"io\"\noutputs = [{}]\ninputs = [{}]\n\
         input = [{{ name = \"far\", object = \"6005.5\", byte = 28, type = \"i16\", simulated = -7 }}]\n\
         output = [{{ name = \"told\", object = \"7005.5\", byte = 29, type = \"u8\", on_stop = 9 }}]\n\
         parameters = [{{ object = \"8010\", type = \"u8\", value = 1 }}]\n",
        pdos(0x1600, 0x7000),
        pdos(0x1A00, 0x6000)
    );
    let mut bench = Bench::new(&plan(&text));
    bench.enable();
    bench.run(100);
    let signals = bench.robot.record().signals;
    assert_eq!((signals.believed, signals.inputs[0], signals.outputs[0]), (1, -7.0, 9.0));
    assert_eq!((signals.shape.input_bytes, signals.shape.output_bytes), (2, 1));
    let number = |register: u16| u16::from_le_bytes(bench.peek(3, register, 2).try_into().unwrap());
    let [start, length] = [0x0810, 0x0812].map(number);
    assert_eq!((length, number(0x081A)), (900, 900));
    assert!(number(0x0818) >= start + 3 * length, "{} behind {start}", number(0x0818));
}

/// What a maker's file has written into objects of its own range is taken by simulated drives, too; what the standard has and
/// they haven't is refused.
#[test]
fn objects_of_a_drives_maker_are_taken_and_unknown_ones_of_the_standard_are_not() {
    let parameters = |list: &str| plan_with(&[&format!("drive_defaults.parameters = [{list}]")]);
    let own = "{ object = \"2200.1\", type = \"u16\", value = 7 }, \
               { object = \"2201\", type = \"u8\", value = 1, state = \"safe_op\" }, \
               { object = \"2300\", bytes = \"0200 0A00 1400\", complete_access = true }";
    let mut bench = Bench::new(&parameters(own));
    bench.enable();
    bench.run(10);
    assert_eq!(bench.robot.phase(), Phase::Holding);
    for (key, state) in [("", ""), (", state = \"safe_op\"", "Sdo(StartUpError")] {
        let unknown = std::panic::catch_unwind(|| {
            Bench::new(&parameters(&format!("{{ object = \"6FFF.1\", type = \"u16\", value = 7{key} }}")));
        });
        let told = unknown.unwrap_err();
        let told = told.downcast_ref::<String>().unwrap();
        assert!(told.contains(&AbortCode::NO_SUCH_OBJECT.0.to_string()) && told.contains(state), "{told}");
    }
}
