//! What a robot's file resolves to, as text and as JSON.

use omnibase_description::Body;
use omnibase_ethercat::config::Timeouts;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{
    Coding, DcPlan, DrivePlan, FootprintSource, InputOwner, ParameterPlan, ParameterState, PdoPlan,
    TorqueLimit, TorqueLimitTold,
};
use omnibase_run::room::Room;
use serde_json::{Value, json};
use std::io::{self, Write};

use super::rows::{deployment, limits, safety};

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

pub fn print(plan: &RobotPlan, room: &Room, output: &mut dyn Write) -> io::Result<()> {
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
    print_map(plan, room, output)?;
    print_sensors(plan, output)?;
    print_wheels(plan, output)?;
    writeln!(output, "\nprocess image, bytes from the start of each drive's data")?;
    for drive in &plan.drives {
        print_drive(drive, output)?;
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

fn print_map(plan: &RobotPlan, room: &Room, output: &mut dyn Write) -> io::Result<()> {
    if plan.map.is_none() {
        return Ok(());
    }
    let cells = room.map().map(|map| format!("{} x {} cells of {} m", map.width, map.height, map.cell_m));
    let polygons = match room.blocked_m().len() {
        1 => "1 polygon".to_owned(),
        count => format!("{count} polygons"),
    };
    let all: Vec<String> = cells.into_iter().chain([polygons]).collect();
    writeln!(output, "map         {}", all.join(", "))
}

fn print_sensors(plan: &RobotPlan, output: &mut dyn Write) -> io::Result<()> {
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
    Ok(())
}

/// The body, and where the wheels stand.
fn print_wheels(plan: &RobotPlan, output: &mut dyn Write) -> io::Result<()> {
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
            drive.place,
            drive.device
        )?;
    }
    Ok(())
}

fn print_drive(drive: &DrivePlan, output: &mut dyn Write) -> io::Result<()> {
    let scale = &drive.scale;
    writeln!(
        output,
        "  {}: {} counts/rev, gear {}, {} N·m rated, {} N·m peak",
        drive.name,
        scale.counts_per_revolution,
        scale.gear_ratio,
        scale.rated_torque_nm,
        scale.peak_torque_nm
    )?;
    writeln!(output, "    torque limit {}", torque_limit(drive))?;
    print_start(drive.dc.as_ref(), &drive.timeouts, output)?;
    print_parameters(&drive.parameters, output)?;
    for (name, pdos, bytes) in
        [("out", &drive.outputs, drive.output_bytes()), ("in", &drive.inputs, drive.input_bytes())]
    {
        let list: Vec<String> = objects(pdos)
            .into_iter()
            .map(|(object, bit, bits)| format!("{object}@{}", position(bit, bits)))
            .collect();
        writeln!(output, "    {name:<4}{bytes:>3} bytes  {}", list.join(" "))?;
    }
    Ok(())
}

/// Events of a SubDevice's clock and the longest waits for it, where its table asks for others than every device has.
fn print_start(dc: Option<&DcPlan>, timeouts: &Timeouts, output: &mut dyn Write) -> io::Result<()> {
    if let Some(dc) = dc.filter(|dc| **dc != DcPlan::sync0(dc.sync0_shift_ns)) {
        let sync1 = if dc.has_sync1() {
            let shift_us = f64::from(dc.sync1_shift_ns) * 1e-3;
            format!(", SYNC1 {shift_us} us behind one in {}", dc.sync1_every)
        } else {
            String::new()
        };
        writeln!(
            output,
            "    clock        {} SYNC0 a cycle, the first at {} us{sync1}; 0x0980 and 0x0981: 0x{:04X}",
            dc.sync0_per_cycle,
            f64::from(dc.sync0_shift_ns) * 1e-3,
            dc.assign_activate
        )?;
    }
    let all = [
        ("INIT", timeouts.init),
        ("PRE-OP", timeouts.pre_op),
        ("SAFE-OP and OP", timeouts.safe_op_op),
        ("mailbox", timeouts.mailbox),
    ];
    let given =
        all.iter().filter_map(|(name, time)| time.map(|time| format!("{name} {} ms", time.as_millis())));
    let given: Vec<String> = given.collect();
    if !given.is_empty() {
        writeln!(output, "    waited for   {} at most", given.join(", "))?;
    }
    Ok(())
}

/// The objects that are written at a start, by the state in which they are.
fn print_parameters(parameters: &[ParameterPlan], output: &mut dyn Write) -> io::Result<()> {
    for state in [ParameterState::PreOp, ParameterState::SafeOp] {
        let those = parameters.iter().filter(|one| one.state == state).map(parameter);
        let those: Vec<String> = those.collect();
        if !those.is_empty() {
            writeln!(output, "    written in {:<7} {}", state_name(state), those.join(" "))?;
        }
    }
    Ok(())
}

/// A parameter's object: `6060:00`.
fn parameter(one: &ParameterPlan) -> String {
    ObjectAddress::new(one.index, one.subindex).to_string()
}

fn state_name(state: ParameterState) -> &'static str {
    match state {
        ParameterState::PreOp => "PRE-OP",
        ParameterState::SafeOp => "SAFE-OP",
    }
}

fn json_parameters(parameters: &[ParameterPlan]) -> Vec<Value> {
    parameters.iter().map(|one| json!({ "object": parameter(one), "state": one.state })).collect()
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
        let every = match device.every.cycles() {
            1 => String::new(),
            n => format!(", its process data in one of {n} cycles"),
        };
        writeln!(output, "  {}: {}, {}{every}{group}", device.name, device.kind, device.place)?;
        print_start(device.dc.as_ref(), &device.timeouts, output)?;
        print_parameters(&device.parameters, output)?;
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

pub fn json(plan: &RobotPlan) -> Value {
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
            "place": drive.place.to_string(),
            "device": drive.device,
            "parameters": json_parameters(&drive.parameters),
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
            "place": device.place.to_string(),
            "group": device.group,
            "every": device.every.cycles(),
            "parameters": json_parameters(&device.parameters),
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
