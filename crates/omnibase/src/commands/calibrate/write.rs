//! A robot file with what was found in it, everything else as it was, comments and all.

use super::Known;
use anyhow::{Context, bail};
use omnibase_calibrate::{Found, Solution, Unknown};
use omnibase_platform::Wheel;
use omnibase_robot::Registry;
use omnibase_run::RobotText;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, TableLike, value};

/// No wheel is known better than this afterwards: tread, load and warmth change it.
const LEAST_SIGMAS: [f64; 3] = [2e-4, 2e-4, 1e-4];

/// The file's sensors that were calibrated, by their names.
#[derive(Clone, Copy, Default)]
pub struct SensorNames<'a> {
    pub tracker: Option<&'a str>,
    pub gyro: Option<&'a str>,
}

/// Why a file that is there isn't written.
pub(super) fn is_there(path: &Path) -> anyhow::Error {
    anyhow::anyhow!("`{}` is there already: give another name, or --overwrite", path.display())
}

/// Writes the file; refuses to write over one unless that is told.
pub(super) fn write(
    path: &Path,
    may_overwrite: bool,
    text: &str,
    known: &Known,
    solution: &Solution,
    names: SensorNames<'_>,
    registry: &Registry,
) -> anyhow::Result<()> {
    let new = changed(text, known, solution, names, registry)?;
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    if let Err(problems) = (RobotText { text: new.clone(), folder, ..RobotText::default() }).load(registry) {
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        bail!(
            "`{}`: the new file isn't one that a robot can be made of: {}",
            path.display(),
            words.join("; ")
        );
    }
    let mut options = OpenOptions::new();
    options.write(true).truncate(true).create(may_overwrite).create_new(!may_overwrite);
    let opened = options.open(path);
    if opened.as_ref().is_err_and(|error| error.kind() == std::io::ErrorKind::AlreadyExists) {
        return Err(is_there(path));
    }
    let mut file = opened.with_context(|| format!("creating `{}`", path.display()))?;
    file.write_all(new.as_bytes()).with_context(|| format!("writing `{}`", path.display()))
}

/// The text of a robot file with what was found.
pub fn changed(
    text: &str,
    known: &Known,
    solution: &Solution,
    names: SensorNames<'_>,
    registry: &Registry,
) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse().context("reading the robot file as TOML")?;
    let platform = document.get_mut("platform").context("the robot file has no table `platform`")?;
    let Some(platform) = platform.as_table_mut() else {
        bail!("the robot file's `platform` is no table with a heading: write it as [platform]");
    };
    let layout = platform.get("layout").and_then(Item::as_str).unwrap_or_default().to_owned();
    let mut was = vec![format!("layout = \"{layout}\"")];
    let (kind, _) = registry.layouts.find(Some(&layout))?;
    for key in kind.keys.iter().map(|key| key.name) {
        if let Some(old) = platform.remove(key).filter(|old| old.is_value()) {
            was.push(format!("{key} = {}", old.to_string().trim()));
        }
    }
    set(platform, "layout", value("wheels"));
    if layout != "wheels"
        && let Some(mut key) = platform.key_mut("layout")
    {
        let before =
            key.leaf_decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default().to_owned();
        let words = format!("{before}# Wheel by wheel, by omnibase calibrate; before: {}\n", was.join(", "));
        key.leaf_decor_mut().set_prefix(words);
    }
    let mut wheels = ArrayOfTables::new();
    for wheel in &solution.build.wheels {
        wheels.push(table_of(wheel));
    }
    platform.insert("wheel", Item::ArrayOfTables(wheels));
    estimator(&mut document, known, solution)?;
    sensors(&mut document, solution, names);
    Ok(document.to_string())
}

/// Where the sensor of poses is and how late, and what a gyro's numbers are worth.
fn sensors(document: &mut DocumentMut, solution: &Solution, names: SensorNames<'_>) {
    let Some(tables) = document.get_mut("sensor").and_then(Item::as_array_of_tables_mut) else { return };
    for table in tables.iter_mut() {
        let name = table.get("name").and_then(Item::as_str).map(str::to_owned);
        if name.is_some() && name.as_deref() == names.tracker && solution.of(Unknown::SensorX).is_some() {
            let mount = solution.build.sensor.base_from_sensor;
            let position: Array =
                [mount.x_m, mount.y_m].into_iter().map(|coordinate| rounded(coordinate, 6)).collect();
            set(table, "position_m", value(position));
            set(table, "heading_rad", value(rounded(mount.heading_rad, 6)));
            // Nobody tells what hasn't happened yet.
            set(table, "delay_ms", value(rounded(1e3 * solution.build.sensor.delay_s.max(0.0), 3)));
        }
        let scale = solution.of(Unknown::GyroScale).filter(|found| found.is_observed());
        if let (Some(_), true) = (scale, name.is_some() && name.as_deref() == names.gyro) {
            let before = table.get("scale").and_then(number).unwrap_or(1.0);
            set(table, "scale", value(rounded(before / (1.0 + solution.build.gyro_scale), 12)));
        }
    }
}

fn number(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

fn set(table: &mut dyn TableLike, key: &str, new: Item) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        // What stands behind it, as a comment, stays.
        Some(old) => {
            let decor = old.decor().clone();
            if let Item::Value(new) = new {
                *old = new;
                *old.decor_mut() = decor;
            }
        }
        None => {
            table.insert(key, new);
        }
    }
}

/// What is far below what anybody measures isn't written.
fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

fn table_of(wheel: &Wheel) -> Table {
    let angle = |[x, y]: [f64; 2]| rounded(y.atan2(x), 7);
    let (rolling, force) = (angle(wheel.rolling_direction), angle(wheel.force_direction));
    let mut table = Table::new();
    table.decor_mut().set_prefix(format!("\n# {}\n", wheel.name));
    let position: Array = wheel.position_m.iter().map(|coordinate| rounded(*coordinate, 6)).collect();
    table.insert("position_m", value(position));
    table.insert("rolling_angle_rad", value(rolling));
    if force != rolling {
        table.insert("force_angle_rad", value(force));
    }
    table.insert("radius_m", value(rounded(wheel.radius_m, 7)));
    table
}

/// How well the wheels are known from now on, and their creep.
fn estimator(document: &mut DocumentMut, known: &Known, solution: &Solution) -> anyhow::Result<()> {
    let item = document.entry("estimator").or_insert_with(|| Item::Table(Table::new()));
    let table = item.as_table_like_mut().context("the robot file's `estimator` is no table")?;
    let [radius, direction, place] = LEAST_SIGMAS;
    let worst = |is_such: fn(&Found) -> bool, least: f64| {
        let sigmas = solution.found.iter().filter(|found| is_such(found)).map(|found| found.sigma_held);
        let worst = sigmas.fold(least, f64::max);
        value(rounded(worst, 6))
    };
    set(table, "radius_share", worst(|found| matches!(found.unknown, Unknown::Radius(_)), radius));
    let sigma = worst(|found| matches!(found.unknown, Unknown::Direction(_)), direction);
    set(table, "wheel_direction_sigma_rad", sigma);
    set(table, "wheel_position_sigma_m", worst(|found| matches!(found.unknown, Unknown::Across(_)), place));
    let creep = solution.of(Unknown::Creep).filter(|creep| creep.is_observed() && solution.build.creep > 0.0);
    if creep.is_some() || known.build.creep > 0.0 {
        set(table, "creep", value(rounded(solution.build.creep.max(0.0), 5)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_calibrate::{Build, Dataset, PoseSample, Run, SensorMount, Step, Tolerances, solve};
    use omnibase_platform::{PerWheel, Pose2};
    use omnibase_robot::RobotPlan;

    /// A solution of a robot that stood still: what is in the file stays.
    fn nothing_found(text: &str) -> (Known, Solution) {
        let no_files = |name: &str| Err(name.to_owned());
        let plan = RobotPlan::from_toml(text, &Registry::with_built_in(), &no_files).unwrap();
        let build = Build {
            wheels: plan.kinematics.wheels().to_vec(),
            creep: 0.0,
            roller_resistance: 0.0,
            sensor: SensorMount::default(),
            gyro_scale: 0.0,
        };
        let tolerances = Tolerances::default();
        let count = build.wheels.len();
        let step =
            |number: u8| Step { end_s: f64::from(number), turned_rad: PerWheel::from_fn(count, |_| 0.0) };
        let pose = |number: u8| PoseSample {
            instant_s: f64::from(number),
            world_from_sensor: Pose2::default(),
            sigma_m: 1e-3,
            sigma_rad: 1e-3,
        };
        let run =
            Run { steps: (1..=3).map(step).collect(), poses: (1..=3).map(pose).collect(), ..Run::default() };
        let solution = solve(&Dataset { runs: vec![run] }, &build, &tolerances).unwrap();
        (Known { build, tolerances }, solution)
    }

    #[test]
    fn every_layout_is_written_wheel_by_wheel_and_the_rest_stays() {
        for (text, comment) in [
            (include_str!("../../../../../robots/bmm.toml"), "# NOT in the thesis, so measure yours"),
            (
                include_str!("../../../../../robots/mecanum.toml"),
                "# of the order of data sheets of 400 W servos",
            ),
            (include_str!("../../../../../robots/omni4.toml"), "# Four omni wheels 90° apart"),
        ] {
            let registry = Registry::with_built_in();
            let (mut known, mut solution) = nothing_found(text);
            solution.build.wheels[1].radius_m = 0.101_234_5;
            let new = changed(text, &known, &solution, SensorNames::default(), &registry).unwrap();
            assert!(new.contains(comment), "{new}");
            let no_files = |name: &str| Err(name.to_owned());
            let plan = RobotPlan::from_toml(&new, &registry, &no_files);
            let plan = plan.unwrap_or_else(|problems| panic!("{problems:?}\n{new}"));
            assert_eq!(plan.kinematics.wheels()[1].radius_m, 0.101_234_5);
            for (found, wheel) in solution.build.wheels.iter().zip(plan.kinematics.wheels()) {
                let close = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6;
                assert!(close(found.position_m, wheel.position_m), "{found:?} {wheel:?}");
                assert!(close(found.force_direction, wheel.force_direction), "{found:?} {wheel:?}");
                assert!(close(found.rolling_direction, wheel.rolling_direction), "{found:?} {wheel:?}");
            }
            // Once more, from what was written.
            known.build.wheels = plan.kinematics.wheels().to_vec();
            let again = changed(&new, &known, &solution, SensorNames::default(), &registry).unwrap();
            assert_eq!(again, new);
        }
    }
}
