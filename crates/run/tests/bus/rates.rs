//! SubDevices whose process data go in each n-th cycle, and groups with an axis that aren't plugged in.

use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Target, in_process};
use omnibase_platform::Twist2;
use omnibase_robot::config::AxisMode;
use omnibase_robot::signals::{AxisAsk, AxisState, Frame, Phase, RequestAnswer};
use omnibase_robot::{CycleRecord, Exchange, ImageBuffer, Registry, RequestKind, Robot, RobotPlan};
use omnibase_run::{RobotText, simulated};

use crate::bench::{Bench, plan};

const EVERY: u64 = 10;
const PANEL: &str = "[[device]]\nname = \"panel\"\nposition = 3\nevery = 10\nkind = \"io\"\n\
    inputs = [{ pdo = \"0x1A00\", map = \"6000.1:1 6000.2:1\" }]\n\
    outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
    input = [{ name = \"full\", object = \"6000.1\" }, { name = \"closed\", object = \"6000.2\", simulated = 1 }]\n\
    output = [{ name = \"level\", object = \"7000.1\", type = \"u16\" }]\n";
const LEVEL: ObjectAddress = ObjectAddress::new(0x7000, 1);

/// The same records come of the same inputs, by a robot that was built anew.
fn computed_again(plan: &RobotPlan, records: &[CycleRecord]) {
    let mut robot = Robot::build(plan, &Registry::with_built_in()).unwrap();
    let mut image = ImageBuffer::new(plan);
    for record in records {
        let again = *robot.replay(record, &mut image);
        assert_eq!(again.signals, record.signals, "cycle {}", record.time.index);
        assert_eq!((again.phase, again.exchange), (record.phase, record.exchange));
    }
}

#[test]
fn a_slow_terminal_is_believed_between_its_turns_told_its_age_and_computed_again_to_the_bit() {
    let plan = plan(PANEL);
    let simulated::Simulated { segment, panels, .. } = simulated::robot(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(&plan, link, clock);
    let mut records = Vec::new();
    let mut step = |bench: &mut Bench, request| {
        let exchange = bench.cycle(request);
        records.push(*bench.robot.record());
        assert_eq!(exchange, Exchange::Complete);
        bench.robot.record().signals
    };
    step(&mut bench, None);
    step(&mut bench, Some(RequestKind::Enable));
    for _ in 0..2000 {
        if bench.robot.phase() == Phase::Holding {
            break;
        }
        step(&mut bench, None);
    }
    assert_eq!(bench.robot.phase(), Phase::Holding);
    let mut heard = Vec::new();
    let mut told = None;
    for cycle in 0..5 * EVERY {
        let request = (cycle == 7).then_some(RequestKind::SetOutput { index: 0, value: 500.0 });
        let signals = step(&mut bench, request);
        assert_eq!((signals.believed, signals.inputs[1]), (0b11, 1.0), "cycle {cycle}");
        assert!(signals.ages_s[0] < EVERY as f64 * 1e-3, "{} s", signals.ages_s[0]);
        heard.extend((signals.ages_s[0] == 0.0).then_some(cycle));
        told = told.or((panels[0].output(LEVEL) == Some(500)).then_some(cycle));
    }
    assert_eq!(heard.len(), 5);
    assert!(heard.windows(2).all(|two| two[1] - two[0] == EVERY), "{heard:?}");
    // What was set in cycle 7 goes at the terminal's next turn; its firmware sees it behind the frame.
    let turn = *heard.iter().find(|turn| **turn > 7).unwrap();
    assert!(told == Some(turn) || told == Some(turn + 1), "{told:?}, turn {turn}");
    computed_again(&plan, &records);
}

#[test]
fn a_slow_terminal_whose_frames_are_lost_isnt_believed_after_as_many_of_its_turns_as_are_tolerated() {
    let plan = plan(PANEL);
    let mut bench = Bench::new(&plan);
    bench.enable();
    while bench.robot.record().signals.ages_s[0] != 0.0 {
        bench.run(1);
    }
    let tolerated = u64::from(plan.safety.lost_exchanges_tolerated);
    for cycle in 1..EVERY * (tolerated + 2) {
        if cycle.is_multiple_of(EVERY) {
            // The second frame of the cycle is the terminal's.
            let next = bench.link.0.borrow().counts().frames;
            let lost = Injection { target: Target::Frame(next + 1), action: FaultAction::DropRequest };
            bench.link.0.borrow_mut().inject(lost);
        }
        let exchange = bench.cycle(None);
        assert_eq!(exchange == Exchange::Lost, cycle.is_multiple_of(EVERY), "cycle {cycle}: {exchange:?}");
        let signals = bench.robot.record().signals;
        assert_eq!(signals.believed == 0b11, cycle < EVERY * (tolerated + 1), "cycle {cycle}");
    }
    assert_eq!(bench.robot.phase(), Phase::Holding, "single lost exchanges stop nobody");
}

#[test]
fn a_slow_terminal_without_power_stops_the_robot_as_any_other() {
    let plan = plan(PANEL);
    let mut bench = Bench::new(&plan);
    bench.enable();
    bench.inject(3, Fault::PowerOff);
    bench.run(2 * EVERY);
    assert_eq!(bench.robot.phase(), Phase::Fault, "{:?}", bench.events);
    assert_eq!(bench.cycle(None), Exchange::Without { wheels: 0, devices: 1 });
}

/// It is tolerated for a while, and away all that while: also in the cycles in which nobody asks for it.
#[test]
fn a_slow_terminal_without_power_is_missing_between_its_turns_too() {
    let tolerated = 2 * EVERY as u32;
    let mut bench = Bench::new(&plan(&format!("{PANEL}[safety]\nlost_exchanges_tolerated = {tolerated}\n")));
    bench.enable();
    bench.inject(3, Fault::PowerOff);
    while bench.cycle(None) == Exchange::Complete {}
    for cycle in 0..10 * EVERY {
        let exchange = bench.cycle(None);
        assert_ne!(exchange, Exchange::Complete, "cycle {cycle}");
    }
    assert_eq!(bench.robot.phase(), Phase::Fault, "{:?}", bench.events);
}

/// An axis of a hot-connect group that isn't plugged in: the robot drives, nobody can move the axis, and nothing of it is believed.
#[test]
fn an_absent_axis_is_never_moved_nor_believed_and_the_robot_drives_without_it() {
    const LIFT: &str = include_str!("../../../../robots/bmm_lift.toml");
    let load = |text: &str| {
        let text = RobotText { text: text.to_owned(), ..RobotText::default() };
        text.load(&Registry::with_built_in()).unwrap().plan
    };
    let grouped =
        LIFT.replace("position = 4\nkind = \"axis\"", "alias = 44\ngroup = \"lift\"\nkind = \"axis\"");
    assert_ne!(grouped, LIFT);
    let begin = LIFT.find("# A spindle").unwrap();
    let end = begin + LIFT[begin..].find("[[drive]]").unwrap();
    let without = load(&format!("{}{}", &LIFT[..begin], &LIFT[end..]));
    let plan = load(&grouped);
    let (link, clock) = in_process(simulated::segment(&without).unwrap().0);
    let mut bench = Bench::with(&plan, link, clock);
    bench.enable();
    let mut records = Vec::new();
    let asks = [
        AxisAsk::Home,
        AxisAsk::Stop,
        AxisAsk::Run { speed: 0.05 },
        AxisAsk::Move { position: 0.2, mode: AxisMode::Csp },
        AxisAsk::Move { position: 0.2, mode: AxisMode::Pp },
    ];
    for ask in asks {
        bench.cycle(Some(RequestKind::Axis { device: 1, ask }));
        assert_eq!(bench.robot.record().answer, RequestAnswer::Refused, "{ask:?}");
        bench.run(20);
    }
    for _ in 0..300 {
        let twist = Twist2 { vx_m_s: 0.2, vy_m_s: 0.0, w_rad_s: 0.0 };
        bench.cycle_for(RequestKind::Velocity { twist, frame: Frame::Body }, 200_000_000);
        records.push(*bench.robot.record());
    }
    let record = records.last().unwrap();
    assert_eq!((record.phase, record.exchange), (Phase::Tracking, Exchange::Complete), "{:?}", bench.events);
    assert!(record.state.twist_in_body.vx_m_s > 0.15);
    let at = record.signals.shape.inputs - 7;
    assert_eq!(record.signals.believed >> at, 0, "nothing of the axis is believed");
    assert!(record.signals.ages_s[1].is_infinite());
    assert!(record.signals.output_bytes.iter().all(|byte| *byte == 0), "nothing is told to nobody");
    assert_eq!(AxisState::from_code(record.signals.inputs[at + 4] as u64), Some(AxisState::default()));
}

/// A slow terminal with a SYNC0 of its own: its period is ten cycles, its place in the cycle the one that the file says.
#[test]
fn a_slow_terminal_has_a_sync0_of_its_own_period_and_place() {
    const CYCLE_NS: u64 = 1_000_000;
    let panel = |keys: &str| plan(&PANEL.replace("every = 10\n", &format!("every = 10\n{keys}")));
    let enabled = |keys: &str| {
        let mut bench = Bench::new(&panel(keys));
        bench.enable();
        bench.run(5 * EVERY);
        bench
    };
    let number = |bench: &Bench, register: u16, length: usize| {
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&bench.peek(3, register, length));
        u64::from_le_bytes(bytes)
    };
    assert_eq!(number(&enabled(""), 0x0981, 1) & 0b11, 0, "none where nobody asks for one");
    let bench = enabled("dc = { sync0_shift_us = 300 }\n");
    assert_eq!(number(&bench, 0x0981, 1) & 0b11, 0b11, "cyclic operation and SYNC0");
    assert_eq!(number(&bench, 0x09A0, 4), EVERY * CYCLE_NS);
    assert_eq!(number(&bench, 0x0990, 8) % CYCLE_NS, 300_000);
}

/// A terminal with what its maker wants: objects written one by one and as a whole, and a SYNC0.
#[test]
fn a_terminal_that_is_told_parameters_takes_whole_objects_and_a_sync0() {
    let keys = "dc = { sync0_shift_us = 300 }\nparameters = [{ object = \"2200.1\", type = \"u8\", value = 1 }, \
                { object = \"2300\", bytes = \"0200 0A00 1400\", complete_access = true }]\n";
    let mut bench = Bench::new(&plan(&PANEL.replace("every = 10\n", &format!("every = 10\n{keys}"))));
    bench.enable();
    bench.run(5 * EVERY);
    assert_eq!(bench.peek(3, 0x0981, 1)[0] & 0b11, 0b11);
}
