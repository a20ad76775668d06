//! `omnibase check`: all problems of a robot's file at once, else what it resolves to; and its motion, planned dry.

mod cycle;
mod dry;
mod picture;

use super::run::reference::ReferenceChoice;
use crate::Outcome;
use crate::progress;
use crate::robot_file::{Changes, RobotSource, plural};
use anyhow::Context;
use omnibase_description::Body;
use omnibase_robot::config::{
    AvoidanceKind, BusPlace, Coding, ComebackEnd, DrivePlan, FootprintSource, InputOwner, Limits, PdoPlan,
    RunTable, SafetyPlan, Switch, TorqueLimit, TorqueLimitTold,
};
use omnibase_robot::dry::DryRun;
use omnibase_robot::signals::{SafetyAction, StopCategory};
use omnibase_robot::{Problem, Registry, RobotPlan};
use omnibase_run::LoadedRobot;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::PathBuf;

/// Checks a robot's file without any hardware: all problems at once with file, line and column, else the plan, and warnings of what
/// is allowed and probably not meant.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase check robots/bmm.toml
  omnibase check robots/bmm.toml --json
  omnibase check robots/bmm.toml --path robots/square.dat --timing fastest --picture square.svg     a motion, planned dry
  omnibase check --kinds                                 what may be chosen by name, and which keys it reads
  omnibase check --schema > robots/robot.schema.json     for editors

Exit code 1 where the file has a problem.")]
pub struct Arguments {
    /// Robot file (TOML).
    #[arg(required_unless_present_any = ["schema", "kinds"])]
    robot: Option<PathBuf>,
    #[command(flatten)]
    changes: Changes,
    #[arg(skip)]
    reference: ReferenceChoice,
    /// Draw the motion as an SVG: its way and its speed, in the colours of the limits that bind.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print JSON: {"problems": [...]} or the plan; or the kinds.
    #[arg(long)]
    json: bool,
    /// Print the JSON schema of robot files.
    #[arg(long)]
    schema: bool,
    /// Print the controllers, references, estimators, devices and layouts with the keys that they read.
    #[arg(long, conflicts_with = "schema")]
    kinds: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Some(path) = arguments.robot.as_deref().filter(|_| !arguments.schema && !arguments.kinds) else {
        let kinds = registry.describe();
        if arguments.kinds && !arguments.json {
            print_kinds(&kinds, output)?;
        } else {
            let told = if arguments.kinds { kinds } else { registry.json_schema() };
            serde_json::to_writer_pretty(&mut *output, &told)?;
            writeln!(output)?;
        }
        return Ok(Outcome::Done);
    };
    let mut source = RobotSource::read(path, &arguments.changes)?;
    source.text.reference = arguments.reference.chosen(registry)?;
    match source.load(registry) {
        Ok(robot) => {
            let motion =
                progress::meanwhile("planning the motion dry", || arguments.motion(&robot, registry))?;
            if arguments.json {
                let mut plan = plan_json(&robot.plan);
                if let Some(motion) = &motion {
                    plan["motion"] = dry::json(motion);
                }
                serde_json::to_writer_pretty(&mut *output, &plan)?;
                writeln!(output)?;
            } else {
                print(&robot.plan, output)?;
                cycle::print(&robot.plan, output)?;
                if let Some(motion) = &motion {
                    dry::print(motion, output)?;
                }
                for doubt in robot.plan.doubts() {
                    writeln!(output, "\nWARNING: {doubt}")?;
                }
            }
            Ok(Outcome::Done)
        }
        Err(problems) => {
            if arguments.json {
                let list: Vec<Value> = problems.iter().map(problem_json).collect();
                serde_json::to_writer_pretty(&mut *output, &json!({ "problems": list }))?;
                writeln!(output)?;
            } else {
                for problem in &problems {
                    writeln!(output, "{}", source.explain(problem))?;
                }
                writeln!(output, "{} in {}", plural(problems.len()), path.display())?;
            }
            Ok(Outcome::Failed)
        }
    }
}

impl Arguments {
    /// The motion that the command line chose.
    pub fn choose_motion(&mut self, matches: &clap::ArgMatches) {
        self.reference = ReferenceChoice::of(matches);
    }

    /// The motion that is asked for, planned dry and drawn; `None` where only the file is checked.
    fn motion(&self, robot: &LoadedRobot, registry: &Registry) -> anyhow::Result<Option<DryRun>> {
        if !self.reference.is_chosen() && self.picture.is_none() {
            return Ok(None);
        }
        let motion = dry::plan(robot, registry)?;
        if let Some(file) = &self.picture {
            std::fs::write(file, picture::svg(&robot.plan, &motion))
                .with_context(|| format!("writing `{}`", file.display()))?;
        }
        Ok(Some(motion))
    }
}

/// Each kind with its keys; those that must be given have a star.
fn print_kinds(sorts: &Value, output: &mut dyn Write) -> io::Result<()> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    for sort in list(sorts) {
        let default = sort["default"].as_str().map_or(String::new(), |name| format!(", default: {name}"));
        writeln!(output, "[{}] {}{default}", text(&sort["table"]), text(&sort["key"]))?;
        for kind in list(&sort["kinds"]) {
            writeln!(output, "  {:<30} {}.", text(&kind["name"]), text(&kind["meaning"]))?;
            for key in list(&kind["keys"]) {
                let star = if key["needed"] == true { '*' } else { ' ' };
                let (meaning, allowed) = (text(&key["meaning"]), text(&key["allowed"]));
                let allowed = if allowed.is_empty() { allowed } else { format!(" Allowed: {allowed}.") };
                writeln!(output, "   {star} {:<28} {meaning}{allowed}", text(&key["name"]))?;
            }
        }
        writeln!(output)?;
    }
    writeln!(output, "* must be given")
}

fn problem_json(problem: &Problem) -> Value {
    let Problem { setting, value, limit, reason, place, .. } = problem;
    json!({
        "setting": setting, "value": value, "limit": limit, "reason": reason,
        "file": place.as_ref().and_then(|place| place.file.as_ref()),
        "line": place.as_ref().map(|place| place.line),
        "column": place.as_ref().map(|place| place.column),
    })
}

fn bus_place(place: BusPlace) -> String {
    match place {
        BusPlace::Position(position) => format!("position {position}"),
        BusPlace::Alias(alias) => format!("alias {alias}"),
        BusPlace::Identification(number) => format!("identification {number}"),
    }
}

/// How a drive is held to its torque limit: `2 N·m, told as 285 in 6072, every cycle`.
fn torque_limit(drive: &DrivePlan) -> String {
    let TorqueLimit { wheel_nm, objects, told } = drive.torque_limit;
    let names: Vec<String> = objects.objects().iter().map(|object| format!("{object:04X}")).collect();
    let when = match told {
        TorqueLimitTold::EveryCycle => "every cycle",
        TorqueLimitTold::AtStartUp => "at start-up",
    };
    let per_mille = drive.scale.torque_limit_per_mille(wheel_nm);
    format!("{wheel_nm} N·m, told as {per_mille} in {}, {when}", names.join(" and "))
}

/// What `omnibase run` brings up by this file alone.
fn deployment(plan: &RobotPlan) -> Vec<(&'static str, String)> {
    let RunTable { interface, redundant, realtime, cpu, dashboard, token_file, paths, joystick } = &plan.run;
    let drives = match (interface, redundant) {
        (None, _) => "simulated, on virtual time unless somebody leads it".to_owned(),
        (Some(interface), None) => format!("THE REAL ONES, at {interface}"),
        (Some(interface), Some(redundant)) => {
            format!("THE REAL ONES, in a ring at {interface} and {redundant}")
        }
    };
    let cpu = cpu.map_or(String::new(), |cpu| format!(", on CPU {cpu}"));
    let real_time = if realtime.unwrap_or_default() { "asked for" } else { "not asked for" };
    let switch = |switch: &Option<Switch>, plain: &str| match switch.as_ref().and_then(Switch::is_on) {
        None => "no".to_owned(),
        Some(own) => own.unwrap_or(plain).to_owned(),
    };
    let mut rows = vec![
        ("drives", drives),
        ("real_time", format!("{real_time}{cpu}")),
        ("dashboard", switch(dashboard, "127.0.0.1:8400")),
        ("joystick", switch(joystick, "the first one that fits")),
    ];
    rows.extend(token_file.iter().map(|file| ("token_file", file.clone())));
    rows.extend(paths.iter().map(|folder| ("paths", folder.clone())));
    let recording = plan.recording.as_ref().map_or("no".to_owned(), |recording| {
        let signals = match &recording.signals[..] {
            [] => "all signals".to_owned(),
            patterns => patterns.join(", "),
        };
        let every = recording
            .every_ns
            .map_or("in every cycle".to_owned(), |ns| format!("every {} ms", ns as f64 / 1e6));
        let limit = recording.limit_bytes.map_or(String::new(), |bytes| {
            let kept =
                recording.files.map_or("all kept".to_owned(), |files| format!("the last {files} kept"));
            format!("; files of {} MB at most, {kept}", bytes / 1_000_000)
        });
        format!("{}: {signals}, {every}{limit}", recording.file)
    });
    rows.push(("recording", recording));
    rows
}

/// Every limit with its name and unit.
fn limits(limits: &Limits) -> [(&'static str, f64, &'static str); 8] {
    [
        ("speed", limits.speed_m_s, "m/s"),
        ("acceleration", limits.acceleration_m_s2, "m/s²"),
        ("jerk", limits.jerk_m_s3, "m/s³"),
        ("turn_speed", limits.turn_speed_rad_s, "rad/s"),
        ("turn_acceleration", limits.turn_acceleration_rad_s2, "rad/s²"),
        ("turn_jerk", limits.turn_jerk_rad_s3, "rad/s³"),
        ("wheel_speed", limits.wheel_speed_rad_s, "rad/s"),
        ("wheel_torque", limits.wheel_torque_nm, "N·m"),
    ]
}

/// What is watched and kept, and what follows, by the name of its setting.
fn safety(plan: &RobotPlan) -> Vec<(&'static str, String)> {
    let SafetyPlan {
        lost_exchanges_tolerated,
        lost_device_stop,
        comeback,
        command_age_ns,
        enabling_timeout_ns,
        stop_timeout_ns,
        tracking_error_m,
        start_distance_m,
        start_heading_rad,
        wheel_speed_stop,
        reference_speed_stop,
        fence_stop,
        tracking_error_stop,
        wheel_torque_stop,
        wheel_torque_margin_nm,
        wheel_torque_time_ns,
        oscillation_share,
        slip_m,
        slip_stop,
        gyro_input,
        enable_input,
        stop_input,
        input_stop,
    } = &plan.safety;
    let margin = wheel_torque_margin_nm.map_or("the default margin".to_owned(), |nm| format!("{nm} N·m"));
    let ms = |ns: u64| format!("{} ms", ns / 1_000_000);
    let then = |category: &StopCategory| match category {
        StopCategory::RemoveTorque => "category 0: torque removed",
        StopCategory::RampThenRemove => "category 1: ramp, then torque removed",
        StopCategory::RampAndHold => "category 2: ramp, then hold",
    };
    let inputs = plan.signals().inputs;
    let input = |place: &Option<usize>| match place.and_then(|place| inputs.get(place)) {
        Some(signal) => format!("{}; {}", signal.name, then(input_stop)),
        None => "none".to_owned(),
    };
    let gyro = gyro_input.and_then(|place| inputs.get(place)).map_or("none", |signal| signal.name.as_str());
    let lost = match lost_device_stop {
        SafetyAction::Stop(category) => then(category),
        SafetyAction::QuickStop | SafetyAction::Pass => "quick stop of the drives",
    };
    let back = comeback.map_or("stays without torque until a person".to_owned(), |plan| {
        let (within, steady) = (ms(plan.within_ns), ms(plan.steady_ns));
        match plan.end {
            ComebackEnd::Hold => format!("holds within {within}, after {steady} of rest; a person resumes"),
            ComebackEnd::MoveAgain { warning_ns } => format!(
                "MOVES AGAIN WITHOUT A PERSON within {within}, after {steady} of rest and {} of warning",
                ms(warning_ns)
            ),
        }
    });
    let guard = &plan.guard;
    let corner = |[x, y]: &[f64; 2]| format!("({x}, {y})");
    let fence = guard.fence.as_ref().map_or("none".to_owned(), |fence| {
        let corners: Vec<String> = fence.corners_m.iter().map(corner).collect();
        format!("{} m, margin {} m", corners.join(" "), fence.margin_m)
    });
    let kind = match guard.avoidance {
        AvoidanceKind::Off => "off".to_owned(),
        AvoidanceKind::Circulate => format!("circulate, {} 1/s", guard.circulate_1_s),
        AvoidanceKind::Guarded => format!("guarded, distance {} m", guard.distance_m),
    };
    let mut rows = vec![
        ("lost_exchanges", format!("{lost_exchanges_tolerated} in a row tolerated")),
        ("on_lost_device", lost.to_owned()),
        ("after_lost_device", back),
        ("command_age", ms(*command_age_ns)),
        ("enabling_timeout", ms(*enabling_timeout_ns)),
        ("stop_timeout", ms(*stop_timeout_ns)),
        ("tracking_error", format!("{tracking_error_m} m; {}", then(tracking_error_stop))),
        ("start_distance", format!("{start_distance_m} m, {start_heading_rad} rad")),
        ("wheel_speed_stop", then(wheel_speed_stop).to_owned()),
        ("reference_speed_stop", then(reference_speed_stop).to_owned()),
        (
            "wheel_torque_stop",
            format!("{} above for {}; {}", margin, ms(*wheel_torque_time_ns), then(wheel_torque_stop)),
        ),
        (
            "oscillation",
            format!(
                "{oscillation_share} of the torque limit to and fro, five times; quick stop of the drives"
            ),
        ),
        ("slip", format!("{slip_m} m of a wheel; {}", then(slip_stop))),
        ("gyro_input", gyro.to_owned()),
        ("fence_stop", then(fence_stop).to_owned()),
        ("enable_input", input(enable_input)),
        ("stop_input", input(stop_input)),
        ("fence", fence),
        ("avoidance", kind),
    ];
    rows.extend(guard.obstacles.iter().map(|obstacle| {
        let [vx, vy] = obstacle.velocity_m_s;
        let at = corner(&obstacle.centre_m);
        ("obstacle", format!("at {at} m, radius {} m, speed ({vx}, {vy}) m/s", obstacle.radius_m))
    }));
    rows
}

/// The objects of PDOs with their places: `6040:00` at byte 0, 16 bits.
fn objects(pdos: &[PdoPlan]) -> Vec<(String, u32, u8)> {
    let mut bit = 0;
    let mut list = Vec::new();
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        // Index 0 is a gap.
        if entry.index != 0 {
            list.push((format!("{:04X}:{:02X}", entry.index, entry.subindex), bit, entry.bits));
        }
        bit += u32::from(entry.bits);
    }
    list
}

fn print(plan: &RobotPlan, output: &mut dyn Write) -> io::Result<()> {
    let controllers: Vec<&str> = plan.controllers().collect();
    writeln!(output, "robot       {}", plan.name)?;
    writeln!(
        output,
        "bus         cycle {} us, answers awaited {} us, {:?}, SYNC0 shifted by {} us, paced by {:?}",
        plan.bus.cycle_ns / 1000,
        plan.bus.receive_timeout_ns / 1000,
        plan.bus.synchronisation,
        plan.bus.sync0_shift_ns / 1000,
        plan.bus.clock_source
    )?;
    writeln!(
        output,
        "watchdog    the drives stop by themselves {} us after the last process data",
        plan.bus.drive_watchdog.us()
    )?;
    writeln!(output, "controller  {}", controllers.join(", then on request "))?;
    writeln!(output, "reference   {}", plan.reference.kind.as_deref().unwrap_or_default())?;
    let source = match plan.guard.footprint_source {
        FootprintSource::Given => "as given",
        FootprintSource::Wheels => {
            "the wheels and their radius; a body that reaches further needs platform.footprint_m"
        }
    };
    writeln!(output, "footprint   {} corners: {source}", plan.guard.footprint_m.len())?;
    let frame = plan.estimator.task_frame.unwrap_or_default();
    for sensor in &plan.sensors {
        let mount = sensor.sensor.body_from_sensor;
        let owner = match sensor.from {
            InputOwner::Device(device) => &plan.devices[device].name,
            InputOwner::Source(source) => &plan.sources[source].name,
        };
        writeln!(
            output,
            "sensor      {}: {:?} by {owner}, at ({}, {}) m, {} rad, {} ms old; tasks in {frame:?}",
            sensor.name,
            sensor.kind,
            mount.x_m,
            mount.y_m,
            mount.heading_rad,
            sensor.delay_ns as f64 * 1e-6
        )?;
    }
    let described = omnibase_run::mechanics::description(plan);
    let Body { mass_kg, inertia_kg_m2, centre_m: [x_m, y_m, z_m] } = described.body;
    writeln!(
        output,
        "body        {mass_kg} kg with its payload, {inertia_kg_m2} kg·m² about the centre of mass ({x_m}, {y_m}, {z_m}) m, as simulated\n"
    )?;
    writeln!(
        output,
        "{:<14} {:>9} {:>9} {:>10} {:>10} {:>9}  {:<12} device",
        "wheel", "x m", "y m", "rolls deg", "force deg", "radius m", "on the bus"
    )?;
    for (wheel, drive) in plan.kinematics.wheels().iter().zip(&plan.drives) {
        let degrees = |[x, y]: [f64; 2]| y.atan2(x).to_degrees();
        let [x_m, y_m] = wheel.position_m;
        writeln!(
            output,
            "{:<14} {x_m:>9.4} {y_m:>9.4} {:>10.2} {:>10.2} {:>9.4}  {:<12} {}",
            drive.name,
            degrees(wheel.rolling_direction),
            degrees(wheel.force_direction),
            wheel.radius_m,
            bus_place(drive.place),
            drive.device
        )?;
    }
    writeln!(output, "\nprocess image, bytes from the start of each drive's data")?;
    for drive in &plan.drives {
        let scale = &drive.scale;
        writeln!(
            output,
            "  {}: {} counts/rev, gear {}, {} N·m rated, {} N·m peak, {} parameters",
            drive.name,
            scale.counts_per_revolution,
            scale.gear_ratio,
            scale.rated_torque_nm,
            scale.peak_torque_nm,
            drive.parameters.len()
        )?;
        writeln!(output, "    torque limit {}", torque_limit(drive))?;
        for (name, pdos, bytes) in
            [("out", &drive.outputs, drive.output_bytes()), ("in", &drive.inputs, drive.input_bytes())]
        {
            let list: Vec<String> = objects(pdos)
                .into_iter()
                .map(|(object, bit, bits)| format!("{object}@{}", position(bit, bits)))
                .collect();
            writeln!(output, "    {name:<4}{bytes:>3} bytes  {}", list.join(" "))?;
        }
    }
    print_devices(plan, output)?;
    writeln!(output, "\nrun")?;
    for (name, value) in deployment(plan) {
        writeln!(output, "  {name:<20} {value}")?;
    }
    writeln!(output, "\nlimits")?;
    for (name, value, unit) in limits(&plan.limits) {
        writeln!(output, "  {name:<20} {value:>8} {unit}")?;
    }
    writeln!(output, "\nsafety")?;
    for (name, value) in safety(plan) {
        writeln!(output, "  {name:<20} {value}")?;
    }
    Ok(())
}

/// The SubDevices without a wheel and their signals; nothing where there are none.
fn print_devices(plan: &RobotPlan, output: &mut dyn Write) -> io::Result<()> {
    if !plan.devices.is_empty() {
        writeln!(output, "\nother SubDevices, and their signals")?;
    }
    let at = |coding: &Option<Coding>| {
        coding.map_or_else(String::new, |coding| format!("@{}", position(coding.bit, coding.bits)))
    };
    for device in &plan.devices {
        let group = device.group.as_ref().map_or(String::new(), |group| {
            format!(", hot-connect group `{group}`: all of it is plugged in at the start, or none and the robot runs without it")
        });
        writeln!(output, "  {}: {}, {}{group}", device.name, device.kind, bus_place(device.place))?;
        for input in &device.input {
            writeln!(output, "    in  {}.{}{} {}", device.name, input.name, at(&input.coding), input.unit)?;
        }
        for one in &device.output {
            let (at, stop) = (at(&one.coding), one.on_stop);
            writeln!(output, "    out {}.{}{at} {}; {stop} at a stop", device.name, one.name, one.unit)?;
        }
    }
    Ok(())
}

/// Byte and length: `2:i32`-like, in bits.
fn position(bit: u32, bits: u8) -> String {
    if bit.is_multiple_of(8) {
        format!("{}:{bits}", bit / 8)
    } else {
        format!("{}.{}:{bits}", bit / 8, bit % 8)
    }
}

fn plan_json(plan: &RobotPlan) -> Value {
    let described = omnibase_run::mechanics::description(plan);
    let drives = plan.drives.iter().zip(&described.wheels);
    let wheels = plan.kinematics.wheels().iter().zip(drives).map(|(wheel, (drive, described))| {
        let image = |pdos| -> Vec<Value> {
            let object = |(object, bit, bits)| json!({ "object": object, "bit": bit, "bits": bits });
            objects(pdos).into_iter().map(object).collect()
        };
        json!({
            "name": drive.name,
            "position_m": wheel.position_m,
            "rolling_direction": wheel.rolling_direction,
            "force_direction": wheel.force_direction,
            "radius_m": wheel.radius_m,
            "inertia_kg_m2": described.inertia_kg_m2,
            "rotor_inertia_kg_m2": described.rotor_inertia_kg_m2,
            "place": bus_place(drive.place),
            "device": drive.device,
            "outputs": { "bytes": drive.output_bytes(), "objects": image(&drive.outputs) },
            "inputs": { "bytes": drive.input_bytes(), "objects": image(&drive.inputs) },
        })
    });
    let limits: serde_json::Map<String, Value> = limits(&plan.limits)
        .into_iter()
        .map(|(name, value, unit)| (name.to_owned(), json!({ "value": value, "unit": unit })))
        .collect();
    let devices = plan.devices.iter().map(|device| {
        json!({
            "name": device.name,
            "kind": device.kind,
            "place": bus_place(device.place),
            "group": device.group,
            "inputs": device.input.iter().map(|one| json!([one.name, one.unit])).collect::<Vec<_>>(),
            "outputs": device.output.iter().map(|one| json!([one.name, one.unit])).collect::<Vec<_>>(),
        })
    });
    json!({
        "problems": [],
        "warnings": plan.doubts(),
        "robot": plan.name,
        "cycle_us": plan.bus.cycle_ns / 1000,
        "controllers": plan.controllers().collect::<Vec<_>>(),
        "body": described.body,
        "wheels": wheels.collect::<Vec<_>>(),
        "devices": devices.collect::<Vec<_>>(),
        "run": plan.run,
        "recording": plan.recording.as_ref().map(|recording| json!({
            "file": recording.file,
            "signals": recording.signals,
            "every_ms": recording.every_ns.unwrap_or(plan.bus.cycle_ns) as f64 / 1e6,
            "format": recording.format,
            "limit_bytes": recording.limit_bytes,
            "files": recording.files,
        })),
        "limits": limits,
        "safety": safety(plan).into_iter().map(|(name, value)| json!([name, value])).collect::<Vec<_>>(),
    })
}
