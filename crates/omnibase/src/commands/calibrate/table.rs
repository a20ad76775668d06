//! What was found, in words and as JSON.

use super::Known;
use crate::terminal::fixed;
use omnibase_calibrate::observed::unseen;
use omnibase_calibrate::{Build, Dataset, Drift, Found, Solution, Unknown, WheelErrors};
use omnibase_platform::Pose2;
use serde_json::{Value, json};
use std::io::{self, Write};

/// A number as a person reads it.
struct Shown {
    expected: f64,
    found: f64,
    sigma: f64,
    unit: &'static str,
    decimals: usize,
}

/// Prints the table.
pub(super) fn print(
    dataset: &Dataset,
    known: &Known,
    solution: &Solution,
    drifts: &[[Drift; 2]],
    output: &mut dyn Write,
) -> io::Result<()> {
    for fact in facts(dataset, solution) {
        writeln!(output, "{fact}")?;
    }
    let [head, rows @ ..] = &rows(known, solution)[..] else { return Ok(()) };
    for [what, expected, found, sigma, unit, note] in std::iter::once(head).chain(rows) {
        let line = format!("{what:<34} {expected:>12} {found:>12} {sigma:>10} {unit:<4}{note}");
        writeln!(output, "{}", line.trim_end())?;
    }
    let unseen = unseen(solution, &known.build);
    if !unseen.is_empty() {
        writeln!(output, "\nnot observed, so that the file's tolerances decide:")?;
        for one in &unseen {
            writeln!(output, "  {}", one.words)?;
        }
    }
    writeln!(output, "\ndead reckoning against the truth        by the file              by what was found")?;
    for (run, [before, after]) in dataset.runs.iter().zip(drifts) {
        let figures = |drift: &Drift| {
            format!(
                "{:>8} mm RMS {:>8} mm",
                fixed(1e3 * drift.rms_m(), 2),
                fixed(1e3 * drift.greatest_m(), 2)
            )
        };
        writeln!(output, "{:<32} {} {}", run.name, figures(before), figures(after))?;
    }
    Ok(())
}

/// What was read, and how well all of it fits.
pub(super) fn facts(dataset: &Dataset, solution: &Solution) -> Vec<String> {
    let time_s: f64 = dataset.runs.iter().map(|run| run.end_s() - run.begin_s).sum();
    let count = |of: fn(&omnibase_calibrate::Run) -> usize| dataset.runs.iter().map(of).sum::<usize>();
    let doubted: usize = solution.runs.iter().map(|run| run.doubted).sum();
    let mut facts = vec![format!(
        "{} over {} s: {} poses, {} turns of a gyro, {} places on the floor",
        plural(dataset.runs.len(), "run"),
        fixed(time_s, 1),
        count(|run| run.poses.len()),
        count(|run| run.turns.len()),
        count(|run| run.places.len())
    )];
    if doubted > 0 {
        facts.push(format!("{} far off and counted for less", plural(doubted, "pose")));
    }
    facts.push(format!(
        "residuals: chi² of {} per freedom, 1 where all is as it is said to be; the floor {} times as uneven as the file says",
        fixed(solution.reduced_chi_square(), 2),
        fixed(solution.unevenness.sqrt(), 3)
    ));
    facts
}

/// The table: its head, and a row for each unknown, of what, in the file, found, ±, unit, and whether it was observed.
pub(super) fn rows(known: &Known, solution: &Solution) -> Vec<[String; 6]> {
    let names: Vec<String> = known.build.wheels.iter().map(|wheel| wheel.name.clone()).collect();
    let mut rows = vec![["", "in the file", "found", "±", "", ""].map(str::to_owned)];
    for found in &solution.found {
        let Shown { expected, found: value, sigma, unit, decimals } =
            shown(found, &known.build, &solution.build);
        let note = if found.is_observed() { "" } else { "not observed" };
        rows.push([
            found.unknown.words(&names),
            fixed(expected, decimals),
            fixed(value, decimals),
            fixed(sigma, decimals),
            unit.to_owned(),
            note.to_owned(),
        ]);
    }
    rows
}

/// What is still wrong with each wheel of a rehearsed robot, as far as it moves the platform.
pub(super) fn errors(truth: &Build, known: &Known, solution: &Solution) -> anyhow::Result<Vec<WheelErrors>> {
    let has_sensor = solution.of(Unknown::SensorX).is_some();
    let frame = if has_sensor {
        truth.sensor.base_from_sensor.then(solution.build.sensor.base_from_sensor.inverse())
    } else {
        Pose2::default()
    };
    let errors = WheelErrors::of(&solution.build.wheels, &truth.wheels, frame);
    Ok(WheelErrors::that_move(&errors, &known.build.wheels, &known.tolerances)?)
}

/// Prints them.
pub(super) fn print_errors(errors: &[WheelErrors], known: &Known, output: &mut dyn Write) -> io::Result<()> {
    writeln!(output, "\nthe rehearsed robot: found less true, as far as it moves the platform")?;
    writeln!(output, "{:<16} {:>10} {:>12} {:>10}", "", "radius %", "direction °", "across mm")?;
    for (wheel, error) in known.build.wheels.iter().zip(errors) {
        writeln!(
            output,
            "{:<16} {:>10} {:>12} {:>10}",
            wheel.name,
            fixed(100.0 * error.radius_share, 4),
            fixed(error.direction_rad.to_degrees(), 4),
            fixed(1e3 * error.across_m, 3)
        )?;
    }
    Ok(())
}

fn plural(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// In the unit in which a person measures it.
fn shown(found: &Found, expected: &Build, build: &Build) -> Shown {
    let degrees = |build: &Build, wheel: usize| {
        let [x, y] = build.wheels[wheel].rolling_direction;
        y.atan2(x).to_degrees()
    };
    let amount = found.amount;
    let of = |expected: f64, scale: f64, unit, decimals| Shown {
        expected: scale * expected,
        found: scale * (expected + amount),
        sigma: scale * found.sigma_told(),
        unit,
        decimals,
    };
    match found.unknown {
        Unknown::Radius(wheel) => {
            let radius_m = expected.wheels[wheel].radius_m;
            Shown {
                expected: 1e3 * radius_m,
                found: 1e3 * radius_m * (1.0 + amount),
                sigma: 1e3 * radius_m * found.sigma_told(),
                unit: "mm",
                decimals: 3,
            }
        }
        Unknown::Direction(wheel) => Shown {
            expected: degrees(expected, wheel),
            found: degrees(build, wheel),
            sigma: found.sigma_told().to_degrees(),
            unit: "°",
            decimals: 3,
        },
        Unknown::Across(_) | Unknown::Along(_) => of(0.0, 1e3, "mm", 2),
        Unknown::Creep => of(expected.creep, 1.0, "", 4),
        Unknown::SensorX => of(expected.sensor.base_from_sensor.x_m, 1e3, "mm", 2),
        Unknown::SensorY => of(expected.sensor.base_from_sensor.y_m, 1e3, "mm", 2),
        Unknown::SensorHeading => {
            of(expected.sensor.base_from_sensor.heading_rad, 180.0 / std::f64::consts::PI, "°", 3)
        }
        Unknown::Delay => of(expected.sensor.delay_s, 1e3, "ms", 2),
        Unknown::GyroScale => of(expected.gyro_scale, 100.0, "%", 3),
        Unknown::GyroBias(_) => of(0.0, 180.0 / std::f64::consts::PI, "°/s", 4),
    }
}

/// What is still wrong with each wheel, as JSON.
pub(super) fn errors_json(errors: &[WheelErrors]) -> Value {
    let one = |error: &WheelErrors| {
        json!({
            "radius_share": error.radius_share, "direction_rad": error.direction_rad, "across_m": error.across_m,
        })
    };
    errors.iter().map(one).collect()
}

/// All of it as one object; SI units.
pub(super) fn json(dataset: &Dataset, known: &Known, solution: &Solution, drifts: &[[Drift; 2]]) -> Value {
    let names: Vec<String> = known.build.wheels.iter().map(|wheel| wheel.name.clone()).collect();
    let unknown = |found: &Found| {
        json!({
            "name": found.unknown.words(&names),
            "change": found.amount,
            "sigma": found.sigma_told(),
            "sigma_in_base": found.sigma,
            "sigma_before": found.sigma_before,
            "is_observed": found.is_observed(),
        })
    };
    let wheel = |wheel: &omnibase_platform::Wheel| {
        let [ux, uy] = wheel.rolling_direction;
        let [ax, ay] = wheel.force_direction;
        json!({
            "name": wheel.name, "radius_m": wheel.radius_m, "position_m": wheel.position_m,
            "rolling_angle_rad": uy.atan2(ux), "force_angle_rad": ay.atan2(ax),
        })
    };
    let drift = |drift: &Drift| json!({ "rms_m": drift.rms_m(), "greatest_m": drift.greatest_m() });
    let run = |(run, [before, after]): (&omnibase_calibrate::Run, &[Drift; 2])| {
        json!({
            "name": run.name, "duration_s": run.end_s() - run.begin_s, "poses": run.poses.len(),
            "turns": run.turns.len(), "places": run.places.len(),
            "by_file": drift(before), "by_found": drift(after),
        })
    };
    let sensor = solution.build.sensor;
    let mount = sensor.base_from_sensor;
    json!({
        "chi_square": solution.chi_square,
        "freedoms": solution.freedoms,
        "unknowns": solution.found.iter().map(unknown).collect::<Vec<_>>(),
        "not_observed": unseen(solution, &known.build).into_iter().map(|one| one.words).collect::<Vec<_>>(),
        "wheels": solution.build.wheels.iter().map(wheel).collect::<Vec<_>>(),
        "creep": solution.build.creep,
        "sensor": { "pose": [mount.x_m, mount.y_m, mount.heading_rad], "delay_s": sensor.delay_s },
        "gyro_scale": solution.build.gyro_scale,
        "unevenness": solution.unevenness.sqrt(),
        "runs": dataset.runs.iter().zip(drifts).map(run).collect::<Vec<_>>(),
    })
}
