//! What can happen to the simulated robot by time: one kind each.

use crate::config::{EventTable, Happening, Problem, ProblemKind, PushFrame, SLIDING_SHARE, nearest};
use crate::registry::{Effect, Kind, Made, Registry, given, needed, optional};

/// Adds the built-in kinds.
pub(crate) fn register(registry: &mut Registry) {
    let mut add = |name, meaning, keys, make: fn(&EventTable, &[&str]) -> Made<Effect>| {
        registry.events.add(Kind { name, meaning, keys }, make);
    };
    let push = vec![optional("force_n"), optional("moment_nm"), optional("frame"), needed("duration_s")];
    add("push", "A force on the centre of mass, or a moment", push, |table, _| {
        if table.force_n.is_none() && table.moment_nm.is_none() {
            return Err(Problem::missing("force_n", "a push has a force, a moment, or both").into());
        }
        let push = |force_n, moment_nm| Happening::Push {
            force_n,
            moment_nm,
            frame: table.frame.unwrap_or(PushFrame::Odom),
        };
        let begin = push(table.force_n.unwrap_or_default(), table.moment_nm.unwrap_or_default());
        Ok(Effect { begin, end: Some(push([0.0; 2], 0.0)) })
    });
    let payload = ["inertia_kg_m2", "position_m", "height_m", "duration_s"].map(optional);
    let payload = [vec![needed("mass_kg")], payload.to_vec()].concat();
    add("payload", "Another payload on the platform", payload, |table, _| {
        let begin = Happening::Payload {
            mass_kg: given(table.mass_kg, "mass_kg")?,
            inertia_kg_m2: table.inertia_kg_m2,
            position_m: table.position_m.unwrap_or_default(),
            height_m: table.height_m,
        };
        Ok(Effect { begin, end: Some(Happening::PayloadOfFile) })
    });
    let floor = vec![needed("static_friction"), optional("sliding_friction"), optional("duration_s")];
    add("floor", "Another friction of the whole floor", floor, |table, _| {
        let static_friction = given(table.static_friction, "static_friction")?;
        let sliding_friction = table.sliding_friction.unwrap_or(SLIDING_SHARE * static_friction);
        if sliding_friction > static_friction {
            let reason = "a wheel slides more easily than it breaks away";
            let problem = Problem::new(ProblemKind::Contradiction, "sliding_friction", reason);
            let limit = Some(format!("at most static_friction = {static_friction}"));
            return Err(Problem { value: Some(sliding_friction.to_string()), limit, ..problem }.into());
        }
        let begin = Happening::Floor { static_friction, sliding_friction };
        Ok(Effect { begin, end: Some(Happening::FloorOfFile) })
    });
    let weak = vec![needed("drive"), needed("torque_ratio"), optional("duration_s")];
    add(
        "weak_motor",
        "A motor that gives another torque than its current promises",
        weak,
        |table, drives| {
            let wheel = wheel(table, drives)?;
            let begin = Happening::TorqueRatio { wheel, ratio: given(table.torque_ratio, "torque_ratio")? };
            Ok(Effect { begin, end: Some(Happening::TorqueRatioOfFile { wheel }) })
        },
    );
    let fault = vec![needed("drive"), needed("error_code")];
    add("drive_fault", "A drive that fails with an error code", fault, |table, drives| {
        let error_code = given(table.error_code, "error_code")?;
        let error_code =
            u16::try_from(error_code).map_err(|_| Problem::refused("error_code", "it has 16 bits"))?;
        Ok(Effect { begin: Happening::DriveFault { wheel: wheel(table, drives)?, error_code }, end: None })
    });
    let of_drive = || vec![needed("drive"), optional("duration_s")];
    add("sto", "A drive whose safety input takes its torque away (STO)", of_drive(), |table, drives| {
        let wheel = wheel(table, drives)?;
        let sto = |is_off| Happening::SafeTorqueOff { wheel, is_off };
        Ok(Effect { begin: sto(true), end: Some(sto(false)) })
    });
    add("lose_power", "A drive that loses its supply", of_drive(), |table, drives| {
        let wheel = wheel(table, drives)?;
        let supply = |is_on| Happening::Supply { wheel, is_on };
        Ok(Effect { begin: supply(false), end: Some(supply(true)) })
    });
    add("return_power", "A drive that has its supply again", vec![needed("drive")], |table, drives| {
        Ok(Effect { begin: Happening::Supply { wheel: wheel(table, drives)?, is_on: true }, end: None })
    });
}

/// The wheel of the drive that a table names.
fn wheel(table: &EventTable, drives: &[&str]) -> Made<usize> {
    let name = given(table.drive.as_deref(), "drive")?;
    if let Some(wheel) = drives.iter().position(|drive| *drive == name) {
        return Ok(wheel);
    }
    let near = nearest(name, drives.iter().copied());
    let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
    let problem = Problem::new(ProblemKind::UnknownName, "drive", format!("no drive has this name{near}"));
    Err(Problem { value: Some(format!("\"{name}\"")), limit: Some(drives.join(", ")), ..problem }.into())
}
