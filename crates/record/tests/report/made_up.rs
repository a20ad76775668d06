//! A run of a robot that drives a square, made up from formulas.

use omnibase_record::run::{RecordedRun, RunEvent, RunSchema};

/// Side of the square, m.
pub const SIDE_M: f64 = 2.0;
/// Time for each side, s.
pub const SIDE_S: f64 = 4.0;
/// Time at rest before and after, s.
pub const REST_S: f64 = 1.0;
/// The believed pose is off by this everywhere, m.
pub const BELIEVED_OFF_M: f64 = 0.000_3;
/// The true pose is off by this times the part of the path that is done, m.
pub const TRUE_OFF_M: f64 = 0.002;
/// The heading is off by this everywhere, rad.
pub const HEADING_OFF_RAD: f64 = 0.001;

const TRACKING: f64 = 3.0;

/// A schema as the recorder of a robot makes it, by the names that a robot's signals have.
pub fn schema(wheels: usize) -> RunSchema {
    let mut schema = RunSchema::default();
    let names = |group: &str, ends: &[&str]| -> Vec<String> {
        ends.iter().map(|end| format!("{group}.{end}")).collect()
    };
    let axes = ["x", "y", "heading"];
    schema.push("/cycle", ["period_ns", "phase"]);
    schema.push("/exchange", ["result"]);
    schema.push("/bus", ["frames_lost", "dc_phase_ns"]);
    let both = |one: &str, other: &str| [names(one, &axes), names(other, &axes)].concat();
    schema.push("/state", [both("pose", "twist_in_body"), vec!["slip_residual_m_s".into()]].concat());
    schema.push("/wished", both("pose", "twist"));
    schema.push("/truth", both("pose", "twist"));
    schema.push("/estimate", ["mass_kg", "inertia_kg_m2", "force_n"]);
    schema.push("/command", ["saturation"]);
    schema.push("/allowed", ["saturation", "action"]);
    schema.push("/timing", ["round_trip_ns", "wake_up_ns", "compute_ns"]);
    for wheel in 1..=wheels {
        schema.push(&format!("/wheel_{wheel}"), ["position_counts", "speed_rad_s", "torque_nm"]);
    }
    schema
}

/// Planned place and speed at a time: once around the square, at rest in each corner.
fn planned(time: f64) -> ([f64; 2], [f64; 2]) {
    let driven = (time - REST_S).clamp(0.0, 4.0 * SIDE_S);
    let side = ((driven / SIDE_S) as usize).min(3);
    let part = driven / SIDE_S - side as f64;
    // A quintic from rest to rest.
    let way = SIDE_M * part.powi(3) * (10.0 - 15.0 * part + 6.0 * part * part);
    let speed = SIDE_M / SIDE_S * 30.0 * part * part * (1.0 - part) * (1.0 - part);
    let corner = [[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]][side];
    let direction = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][side];
    let place = [0, 1].map(|axis| corner[axis] + way * direction[axis]);
    (place, direction.map(|axis: f64| axis * speed))
}

/// A noise without chance, in (-1, 1).
fn noise(seed: usize) -> f64 {
    let mixed = (seed as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The run of a robot with so many wheels, a cycle each millisecond; its square is driven as often as there is time.
pub fn square(wheels: usize, cycles: usize) -> RecordedRun {
    let mut run = RecordedRun { schema: schema(wheels), ..RecordedRun::default() };
    let lap = 4.0 * SIDE_S + 2.0 * REST_S;
    for cycle in 0..cycles {
        let run_time = cycle as f64 * 1e-3;
        let time = run_time % lap;
        let (place, speed) = planned(time);
        let done = (time - REST_S).clamp(0.0, 4.0 * SIDE_S) / (4.0 * SIDE_S);
        let phase = match time {
            time if time < 0.4 => 1.0,
            time if time < REST_S => 2.0,
            time if time < lap - REST_S => TRACKING,
            _ => 2.0,
        };
        let heading = 0.0;
        run.times_ns.push(1_700_000_000_000_000_000 + cycle as u64 * 1_000_000);
        let values = &mut run.values;
        values.extend([1e6, phase, if cycle % 4000 == 3999 { 1.0 } else { 0.0 }]);
        values.extend([(cycle / 4000) as f64, 300.0 * noise(11 * cycle)]);
        let believed = [place[0] + BELIEVED_OFF_M, place[1], heading + HEADING_OFF_RAD];
        values.extend(believed);
        values.extend([speed[0] + 0.002 * noise(cycle), speed[1] + 0.002 * noise(cycle + 7), 0.0]);
        values.push(0.001 * noise(3 * cycle).abs() * (0.1 + speed[0].hypot(speed[1])));
        values.extend([place[0], place[1], heading, speed[0], speed[1], 0.0]);
        let truth = [place[0] - TRUE_OFF_M * done, place[1], heading - 2.0 * HEADING_OFF_RAD];
        values.extend(truth);
        values.extend([speed[0], speed[1], 0.0]);
        values.extend([70.0 + 100.0 * (1.0 - (-run_time / 3.0).exp()), 7.0 + 2.0 * done, 0.0]);
        let is_fast = speed[0].hypot(speed[1]) > 0.93;
        values.extend([if is_fast { 0.8 } else { 1.0 }, 1.0, 0.0]);
        let late = if cycle == 9000 { 900_000.0 } else { 0.0 };
        values.extend([
            60_000.0 + 8_000.0 * noise(cycle) + late,
            5_000.0 + 4_000.0 * noise(2 * cycle),
            900.0 + 50.0 * noise(5 * cycle),
        ]);
        for wheel in 0..wheels {
            let angle = std::f64::consts::TAU * wheel as f64 / wheels as f64;
            let surface = -angle.sin() * speed[0] + angle.cos() * speed[1];
            values.extend([0.0, surface / 0.1, 4.0 * surface + 0.4 * noise(cycle + 1000 * wheel)]);
        }
    }
    for (time_ms, text) in [(0, "enabling"), (400, "in operation: holding"), (1000, "tracking square")] {
        let time_ns = 1_700_000_000_000_000_000 + time_ms * 1_000_000;
        run.events.push(RunEvent { time_ns, text: text.to_owned() });
    }
    let description = [
        ("robot", "bmm"),
        ("reference", "square of 2 m"),
        ("mode", "closed_loop_speed"),
        ("version", "0.1.0"),
        ("date", "2025-11-21 01:40 UTC"),
        ("footprint_m", "0.35 0.3; -0.35 0.3; -0.35 -0.3; 0.35 -0.3"),
        ("wheels_m", "0.3 0 1.5708 0.1; -0.15 0.26 3.665 0.1; -0.15 -0.26 5.76 0.1"),
        ("limit.wheel_speed_rad_s", "15"),
        ("limit.wheel_torque_nm", "21"),
        ("wheel_rated_torque_nm", "7"),
        ("overruns", "0"),
        ("records_dropped", "0"),
        ("realtime_factor", "412.3"),
    ];
    run.description = description.into_iter().map(|(key, text)| (key.to_owned(), text.to_owned())).collect();
    run
}
