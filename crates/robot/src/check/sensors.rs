//! Sensors: their names, where what they say comes in, and how well they know.

use omnibase_fusion::{MAX_RATES, MAX_SENSORS, Sensor, SensorKind};
use omnibase_platform::Pose2;

use super::Check;
use crate::config::{
    Coding, DevicePlan, InputOwner, ProblemKind, SensorName, SensorPlan, SensorTable, SimulatedSensorTable,
    SourcePlan, has_padding, nearest,
};
use crate::signals::SignalLayout;

/// Covariance of a pose, as sources that carry one call it.
const COVARIANCE: [&str; 6] =
    ["covariance_xx", "covariance_xy", "covariance_xh", "covariance_yy", "covariance_yh", "covariance_hh"];

pub(super) fn resolve(
    check: &mut Check,
    tables: &[SensorTable],
    signals: Option<&SignalLayout>,
) -> Option<Vec<SensorPlan>> {
    if tables.is_empty() {
        return Some(Vec::new());
    }
    let rates = tables.iter().filter(|table| table.kind.is_some_and(|kind| kind != SensorName::Pose)).count();
    for (count, most, what) in
        [(tables.len(), MAX_SENSORS, "sensors"), (rates, MAX_RATES, "sensors that tell speeds")]
    {
        if count > most {
            let problem = check.report(ProblemKind::OutOfRange, "sensor", format!("too many {what}"));
            (problem.value, problem.limit) = (Some(count.to_string()), Some(format!("at most {most}")));
        }
    }
    let mut names: Vec<&str> = Vec::new();
    let plans: Vec<Option<SensorPlan>> = tables
        .iter()
        .enumerate()
        .map(|(n, table)| {
            let setting = format!("sensor[{n}]");
            let name = check.signal_name(table.name.as_deref(), &format!("{setting}.name"));
            if let Some(own) = table.name.as_deref() {
                if names.contains(&own) {
                    let reason = "another sensor has the same name";
                    check.report(ProblemKind::Duplicate, &format!("{setting}.name"), reason).value =
                        Some(format!("\"{own}\""));
                }
                names.push(own);
            }
            let kind = check.need(table.kind, &format!("{setting}.kind"), "what it tells");
            let from = check.need(table.from.as_deref(), &format!("{setting}.from"), "where that comes in");
            unread(check, &setting, table, kind?);
            let (inputs, owner) = inputs(check, &format!("{setting}.from"), from?, kind?, signals?)?;
            Some(SensorPlan {
                name: name?,
                kind: kind?,
                inputs,
                from: owner,
                delay_ns: (table.delay_ms.unwrap_or(0.0) * 1e6) as u64,
                scale: table.scale.unwrap_or(1.0),
                sensor: sensor(table, kind?),
            })
        })
        .collect();
    plans.into_iter().collect()
}

/// Poses find their place by their instants: their programs may send them in any order.
pub(super) fn take_in_any_order(sources: &mut [SourcePlan], sensors: &[SensorPlan]) {
    for sensor in sensors.iter().filter(|sensor| sensor.kind == SensorName::Pose) {
        if let InputOwner::Source(place) = sensor.from {
            sources[place].any_order = true;
        }
    }
}

/// Sensors of the simulation are sensors of the robot: what they say comes as if from a program, or from the simulated SubDevice.
pub(super) fn simulated(
    check: &mut Check,
    tables: &[SimulatedSensorTable],
    sensors: &[SensorPlan],
    devices: &[DevicePlan],
) {
    let mut seen: Vec<&str> = Vec::new();
    for (n, table) in tables.iter().enumerate() {
        let setting = format!("simulation.sensor[{n}].name");
        let Some(name) = check.need(table.name.as_deref(), &setting, "it is one of the robot's sensors")
        else {
            continue;
        };
        let found = sensors.iter().find(|sensor| sensor.name == name);
        let (kind, reason) = match found {
            None => (ProblemKind::UnknownName, "no `[[sensor]]` has this name"),
            Some(SensorPlan { from: InputOwner::Device(device), inputs, .. })
                if !is_in_objects(devices, *device, inputs) =>
            {
                let reason = "it stands in padding, or the SubDevice's kind reads it in a way of its own: the simulated robot can't say it";
                (ProblemKind::Contradiction, reason)
            }
            Some(SensorPlan { from: InputOwner::Device(_), .. }) if table.clock_drift_ppm.is_some() => {
                let setting = format!("simulation.sensor[{n}].clock_drift_ppm");
                let reason = "what a SubDevice says has the instants of the bus, whose clock is the robot's";
                check.report(ProblemKind::Contradiction, &setting, reason).limit = Some("no such key".into());
                continue;
            }
            Some(_) if seen.contains(&name) => (ProblemKind::Duplicate, "it is simulated already"),
            Some(_) => {
                seen.push(name);
                continue;
            }
        };
        let problem = check.report(kind, &setting, reason);
        problem.value = Some(format!("\"{name}\""));
        problem.limit =
            Some(sensors.iter().map(|sensor| sensor.name.as_str()).collect::<Vec<_>>().join(", "));
    }
}

/// Whether all inputs of a sensor stand in objects of its SubDevice, and it is known how.
fn is_in_objects(devices: &[DevicePlan], owner: usize, inputs: &[usize]) -> bool {
    let in_object = |device: &DevicePlan, coding: Option<Coding>| {
        coding.is_some_and(|coding| !has_padding(&device.inputs, coding.bit_range()))
    };
    let devices = devices.iter().take(owner + 1);
    let all: Vec<bool> = devices
        .flat_map(|device| device.input.iter().map(move |input| in_object(device, input.coding)))
        .collect();
    inputs.iter().all(|input| all.get(*input).is_none_or(|in_object| *in_object))
}

/// Keys of other kinds would change nothing.
fn unread(check: &mut Check, setting: &str, table: &SensorTable, kind: SensorName) {
    use SensorName::{Flow, Gyro, Imu, Pose, Twist};
    let keys: [(&str, bool, &[SensorName]); 10] = [
        ("scale", table.scale.is_some(), &[Gyro, Flow]),
        ("sigma_m", table.sigma_m.is_some(), &[Pose]),
        ("sigma_rad", table.sigma_rad.is_some(), &[Pose]),
        ("sigma_m_s", table.sigma_m_s.is_some(), &[Flow, Twist]),
        ("sigma_rad_s", table.sigma_rad_s.is_some(), &[Gyro, Imu, Twist]),
        ("sigma_m_s2", table.sigma_m_s2.is_some(), &[Imu]),
        ("bias_sigma_rad_s", table.bias_sigma_rad_s.is_some(), &[Gyro, Imu]),
        ("bias_walk_rad_s", table.bias_walk_rad_s.is_some(), &[Gyro, Imu]),
        ("scale_sigma", table.scale_sigma.is_some(), &[Gyro, Imu, Flow, Twist]),
        ("direction_sigma_rad", table.direction_sigma_rad.is_some(), &[Flow, Twist]),
    ];
    for (key, _, readers) in
        keys.iter().filter(|(_, is_given, readers)| *is_given && !readers.contains(&kind))
    {
        let name = |kind: &SensorName| format!("{kind:?}").to_lowercase();
        let reason = format!("nothing of a {} reads it", name(&kind));
        let problem = check.report(ProblemKind::Contradiction, &format!("{setting}.{key}"), reason);
        problem.limit =
            Some(format!("a key of {}", readers.iter().map(name).collect::<Vec<_>>().join(" or ")));
    }
}

/// The inputs of a sensor, by their places, and who has them.
fn inputs(
    check: &mut Check,
    setting: &str,
    from: &str,
    kind: SensorName,
    signals: &SignalLayout,
) -> Option<(Vec<usize>, InputOwner)> {
    let (owner, values): (&str, &[&str]) = match kind {
        SensorName::Gyro => match from.split_once('.') {
            Some((owner, _)) => (owner, &[]),
            None => (from, &["turn"]),
        },
        SensorName::Imu => (from, &["turn", "acceleration_x", "acceleration_y"]),
        SensorName::Flow => (from, &["x", "y"]),
        SensorName::Twist | SensorName::Pose => (from, &["x", "y", "heading"]),
    };
    let device = signals.devices.iter().position(|name| name == owner).map(InputOwner::Device);
    let source = signals.sources.iter().position(|source| source.name == owner).map(InputOwner::Source);
    let Some(place) = device.or(source) else {
        let names: Vec<&str> = signals
            .devices
            .iter()
            .map(String::as_str)
            .chain(signals.sources.iter().map(|source| source.name.as_str()))
            .collect();
        let near = nearest(owner, names.iter().copied());
        let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        let reason = format!("no `[[device]]` or `[[source]]` has this name{near}");
        let problem = check.report(ProblemKind::UnknownName, setting, reason);
        problem.value = Some(format!("\"{owner}\""));
        problem.limit =
            Some(if names.is_empty() { "a `[[device]]` or `[[source]]`".into() } else { names.join(", ") });
        return None;
    };
    let wanted: Vec<String> = match values {
        [] => vec![from.to_owned()],
        values => values.iter().map(|value| format!("{owner}.{value}")).collect(),
    };
    let found: Vec<Option<usize>> = wanted.iter().map(|name| signals.input(name)).collect();
    if let Some(missing) = found.iter().position(Option::is_none) {
        let own = signals.inputs.iter().map(|signal| signal.name.as_str());
        let own: Vec<&str> = own.filter(|name| name.starts_with(&format!("{owner}."))).collect();
        let problem = check.report(ProblemKind::UnknownName, setting, format!("{owner} has no such input"));
        problem.value = Some(format!("\"{}\"", wanted[missing]));
        problem.limit = Some(own.join(", "));
        return None;
    }
    let mut places: Vec<usize> = found.into_iter().flatten().collect();
    if kind == SensorName::Pose {
        let covariance: Option<Vec<usize>> =
            COVARIANCE.iter().map(|name| signals.input(&format!("{owner}.{name}"))).collect();
        places.extend(covariance.into_iter().flatten());
    }
    Some((places, place))
}

fn sensor(table: &SensorTable, kind: SensorName) -> Sensor {
    let ready = Sensor::of(kind.into());
    let [x_m, y_m] = table.position_m.unwrap_or_default();
    let [x, y, turn] = ready.sigma;
    let (along, about) = match ready.kind {
        SensorKind::Turn | SensorKind::Inertial => (table.sigma_rad_s, None),
        SensorKind::Flow | SensorKind::Twist => (table.sigma_m_s, table.sigma_rad_s),
        SensorKind::Pose => (table.sigma_m, table.sigma_rad),
    };
    let has_y = !ready.kind.is_gyro();
    let sigma = match ready.kind {
        SensorKind::Inertial => {
            let accelerations = table.sigma_m_s2.unwrap_or(y);
            [along.unwrap_or(x), accelerations, accelerations]
        }
        _ => [along.unwrap_or(x), along.filter(|_| has_y).unwrap_or(y), about.unwrap_or(turn)],
    };
    Sensor {
        body_from_sensor: Pose2::new(x_m, y_m, table.heading_rad.unwrap_or(0.0)),
        sigma,
        bias_sigma: table.bias_sigma_rad_s.unwrap_or(ready.bias_sigma),
        bias_walk: table.bias_walk_rad_s.unwrap_or(ready.bias_walk),
        scale_sigma: table.scale_sigma.unwrap_or(ready.scale_sigma),
        direction_sigma_rad: table.direction_sigma_rad.unwrap_or(ready.direction_sigma_rad),
        silent_ns: table.silent_ms.map_or(ready.silent_ns, |silent_ms| u64::from(silent_ms) * 1_000_000),
        ..ready
    }
}
