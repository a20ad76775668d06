//! What was lost comes back: what happens by itself then, for each value of `after_lost_device`.

use std::time::Duration;

use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_robot::signals::Phase;
use omnibase_run::conductor::{Conductor, Wish};
use omnibase_run::simulated;

use super::CIRCLE;
use super::case::{Case, STANDING_RAD_S, STATES, State, words};
use crate::bench::{Bench, Shared, plan_changed};

/// Cycles until everything is back, has rested, was warned of, and moves.
const WATCHED: u64 = 12_000;
/// Cycles after which nothing more comes where nothing is on its way.
const QUIET: u64 = 4000;
const OFF: Duration = Duration::from_millis(300);

/// What happens: its name, the encoders, what breaks in which ms, and what may come of it where the path is followed.
struct Row {
    name: &'static str,
    encoder: &'static str,
    happen: fn(&mut Bench, u64),
    may: May,
}

/// How far a comeback may go.
#[derive(Clone, Copy, Debug, PartialEq)]
enum May {
    Stay,
    Hold,
    Move,
}

fn power_cycle(bench: &mut Bench, drive: usize) {
    bench.inject(drive, Fault::PowerCycle { off_for: OFF });
}

fn fail(bench: &mut Bench, drive: usize) {
    bench.inject(drive, Fault::Application(ApplicationFault::DriveFault(0x2310)));
}

const ROWS: &[Row] = &[
    Row {
        name: "a drive is power-cycled",
        encoder: "incremental",
        happen: |bench, ms| {
            if ms == 0 {
                power_cycle(bench, 2);
            }
        },
        may: May::Hold,
    },
    Row {
        name: "a drive with an absolute encoder is power-cycled",
        encoder: "absolute",
        happen: |bench, ms| {
            if ms == 0 {
                power_cycle(bench, 2);
            }
        },
        may: May::Move,
    },
    Row {
        name: "the cable behind drive 1 is pulled for 0.3 s",
        encoder: "incremental",
        happen: |bench, ms| match ms {
            0 => bench.inject(0, Fault::CableCut { port: 1 }),
            300 => bench.inject(0, Fault::CableRestored { port: 1 }),
            _ => {}
        },
        may: May::Move,
    },
    Row {
        name: "a drive fails during the loss of another",
        encoder: "absolute",
        happen: |bench, ms| match ms {
            0 => power_cycle(bench, 2),
            100 => fail(bench, 1),
            _ => {}
        },
        may: May::Stay,
    },
    Row {
        name: "a drive is lost during the fault of another",
        encoder: "absolute",
        happen: |bench, ms| match ms {
            0 => fail(bench, 1),
            20 => power_cycle(bench, 2),
            _ => {}
        },
        may: May::Stay,
    },
    Row {
        name: "the emergency stop cuts the supply for 1 s",
        encoder: "absolute",
        happen: |bench, ms| {
            if ms == 0 {
                let off_for = Duration::from_secs(1);
                (0..3).for_each(|drive| bench.inject(drive, Fault::PowerCycle { off_for }));
            }
        },
        may: May::Stay,
    },
    Row {
        name: "the emergency stop cuts the supply during the loss of a drive",
        encoder: "absolute",
        happen: |bench, ms| match ms {
            0 => power_cycle(bench, 2),
            200 => (0..3).for_each(|drive| power_cycle(bench, drive)),
            _ => {}
        },
        may: May::Stay,
    },
];

fn suffer(row: &Row, state: State, after: &str) -> String {
    let policy = format!("after_lost_device = \"{after}\"\nmove_again_warning_ms = 3000\n");
    let encoder = format!("drive_defaults.encoder = \"{}\"", row.encoder);
    let plan = plan_changed(&format!("{CIRCLE}\n[safety]\n{policy}"), &[&encoder]);
    let (segment, machine) = simulated::segment(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let mut case: Case<Shared> = Case::new(Bench::with(&plan, link, clock.clone()), machine, clock, state);
    let what = format!("{}, {after}, {state:?}", row.name);
    // What a person began who is there: as the live operator leads it.
    let comeback = plan.safety.comeback.filter(|_| state == State::Tracking);
    let mut conductor = comeback.map(Conductor::following);
    let (mut stopped_ms, mut held_ms, mut warned_ms, mut moved_ms) = (None, None, 0, None);
    for ms in 0..WATCHED {
        (row.happen)(&mut case.bench, ms);
        let (record, phase) = (*case.bench.robot.record(), case.bench.robot.phase());
        let request = conductor.as_mut().and_then(|one| one.next(&record, phase, Wish::GoOn));
        match request {
            Some(kind) => drop(case.bench.cycle(Some(kind))),
            None => case.cycle(),
        }
        while let Some((wheel, error)) = case.bench.session.take_said() {
            conductor.iter_mut().for_each(|one| one.drive_said(wheel, error));
        }
        case.watch();
        let now_ns = record.time.now_ns;
        warned_ms += u64::from(conductor.as_ref().is_some_and(|one| one.moves_again_in_s(now_ns).is_some()));
        match case.bench.robot.phase() {
            Phase::Fault if stopped_ms.is_none() => stopped_ms = Some(ms),
            Phase::Holding if stopped_ms.is_some() && held_ms.is_none() => held_ms = Some(ms),
            Phase::Tracking if stopped_ms.is_some() => {
                moved_ms = Some(ms);
                break;
            }
            _ => {}
        }
        let comes = conductor.as_ref().is_some_and(Conductor::is_coming_back);
        if ms > QUIET && !comes {
            break;
        }
    }
    assert!(stopped_ms.is_some(), "{what}: it never stopped");
    let may = match (state, after) {
        (State::Tracking, "move_again_unattended") => row.may,
        (State::Tracking, "hold") if row.may != May::Stay => May::Hold,
        _ => May::Stay,
    };
    let found = match (held_ms, moved_ms) {
        (_, Some(_)) => May::Move,
        (Some(_), None) => May::Hold,
        (None, None) => May::Stay,
    };
    assert_eq!(found, may, "{what}: {:?}", case.bench.events);
    if found != May::Move {
        assert!(case.fastest_rad_s() < STANDING_RAD_S, "{what}: {} rad/s", case.fastest_rad_s());
    }
    match (held_ms, moved_ms) {
        (_, Some(ms)) => {
            assert!(warned_ms >= 3000, "{what}: warned for {warned_ms} ms");
            format!("**moves again** after {ms} ms, warned for {warned_ms} ms")
        }
        (Some(ms), None) => format!("holds after {ms} ms; a person resumes"),
        (None, None) => format!("stays: {}", words(case.bench.robot.phase())),
    }
}

/// The rows of what is back, for each value of `after_lost_device`.
pub fn rows() -> String {
    let mut text = String::new();
    for row in ROWS {
        for after in ["stay", "hold", "move_again_unattended"] {
            let cells = STATES.map(|state| suffer(row, state, after));
            text +=
                &format!("| {}, `{after}` | nothing is enabled yet | {} |\n", row.name, cells.join(" | "));
        }
    }
    text
}
