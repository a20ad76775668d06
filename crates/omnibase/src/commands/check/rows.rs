//! What a plan says of limits, safety and a run, each by the name of its setting.

use omnibase_robot::RobotPlan;
use omnibase_robot::config::{AvoidanceKind, ComebackEnd, Limits, RunTable, SafetyPlan, Switch};
use omnibase_robot::signals::{SafetyAction, StopCategory};

/// What `omnibase run` brings up by this file alone.
pub fn deployment(plan: &RobotPlan) -> Vec<(&'static str, String)> {
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
pub fn limits(limits: &Limits) -> [(&'static str, f64, &'static str); 8] {
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
pub fn safety(plan: &RobotPlan) -> Vec<(&'static str, String)> {
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
