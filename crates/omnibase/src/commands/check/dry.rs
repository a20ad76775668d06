//! The part of `omnibase check` that plans a motion dry.

use std::io::{self, Write};

use omnibase_robot::config::{HeadingName, ReferenceTable};
use omnibase_robot::dry::{Asked, DryRun, Passed, limit_name};
use omnibase_robot::{Ability, Registry};
use omnibase_run::LoadedRobot;
use serde_json::{Value, json};

/// The motion of a robot, planned dry.
pub(super) fn plan(robot: &LoadedRobot, registry: &Registry) -> anyhow::Result<DryRun> {
    let plan = &robot.plan;
    let mut reference = registry.make_reference(&plan.reference, &Ability::of(plan))?;
    Ok(DryRun::of(plan, &mut *reference)?)
}

/// How long a motion with a free heading would take with its own, s; `None` for another motion.
pub(super) fn as_given_s(robot: &LoadedRobot, registry: &Registry) -> anyhow::Result<Option<f64>> {
    let table = &robot.plan.reference;
    if table.heading != Some(HeadingName::Free) {
        return Ok(None);
    }
    let given = ReferenceTable { heading: Some(HeadingName::Given), ..table.clone() };
    Ok(registry.make_reference(&given, &Ability::of(&robot.plan))?.duration_s())
}

/// What stands in a table of limits.
fn is_asked(asked: &&Asked) -> bool {
    asked.most.0 > 0.005
}

/// The ends of a way, in words.
const ENDS: [&str; 2] = ["start", "end"];

pub(super) fn print(run: &DryRun, as_given_s: Option<f64>, output: &mut dyn Write) -> io::Result<()> {
    let DryRun { duration_s, way_m, friction, .. } = run;
    writeln!(output, "\nThe motion, planned dry")?;
    writeln!(output, "  time                 {duration_s:.3} s for {way_m:.3} m")?;
    if let Some(given_s) = as_given_s {
        let sooner_s = given_s - duration_s;
        writeln!(
            output,
            "  heading              free: {sooner_s:.3} s sooner than as given, {given_s:.3} s"
        )?;
    }
    for (end, passed) in ENDS.into_iter().zip(&run.passed) {
        let Some(Passed { time_s, speed_m_s, run_m }) = passed else { continue };
        let run = if end == ENDS[0] { "from" } else { "to" };
        writeln!(
            output,
            "  passes its {end:<9} at {time_s:.3} s with {speed_m_s:.3} m/s; a run of {run_m:.3} m {run} rest"
        )?;
    }
    writeln!(output, "  grip needed          friction {:.3}, at {:.3} s", friction.0, friction.1)?;
    if let Some(heat) = run.heat {
        let percent = 100.0 * heat;
        writeln!(
            output,
            "  motors' heat         {percent:.0} % of what they bear, begun cold; it goes slower where they are warm"
        )?;
    }
    for (what, room) in [("room to the fence", run.fence_room_m), ("room to obstacles", run.obstacle_room_m)]
    {
        if let Some((room_m, time_s)) = room {
            writeln!(output, "  {what:<20} {room_m:.3} m at least, at {time_s:.3} s")?;
        }
    }
    writeln!(output, "  limit                binds    most of it")?;
    for asked in run.asked.iter().filter(is_asked) {
        let (load, time_s) = asked.most;
        let (share, load) = (100.0 * asked.share, 100.0 * load);
        writeln!(output, "  {:<20} {share:4.0} %   {load:3.0} % at {time_s:.3} s", limit_name(asked.limit))?;
    }
    Ok(())
}

pub(super) fn json(run: &DryRun, as_given_s: Option<f64>) -> Value {
    let room =
        |room: Option<(f64, f64)>| room.map(|(room_m, time_s)| json!({ "room_m": room_m, "time_s": time_s }));
    let passed = |passed: Option<Passed>| {
        passed.map(
            |passed| json!({ "time_s": passed.time_s, "speed_m_s": passed.speed_m_s, "run_m": passed.run_m }),
        )
    };
    let [start, end] = run.passed.map(passed);
    let limits: Vec<Value> = run
        .asked
        .iter()
        .filter(is_asked)
        .map(|asked| {
            let (load, time_s) = asked.most;
            json!({ "limit": limit_name(asked.limit), "binds": asked.share, "most": load, "time_s": time_s })
        })
        .collect();
    json!({
        "duration_s": run.duration_s, "as_given_s": as_given_s, "way_m": run.way_m, "start": start, "end": end,
        "heat": run.heat, "friction": run.friction.0, "friction_time_s": run.friction.1,
        "fence": room(run.fence_room_m), "obstacles": room(run.obstacle_room_m), "limits": limits,
    })
}
