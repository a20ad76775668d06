//! Files of robots: the shipped ones, and broken ones whose problems all come at once with their places.

mod axes;
mod clocks;
mod devices;
mod doubts;
mod joystick;
mod kinds;
mod receivers;
mod sensors;
mod simulation;
mod torque_gains;

use super::*;
use crate::registry::{Kind, Registry};
use omnibase_ethercat::start_up::SdoWrite;

const BMM: &str = include_str!("../../../../robots/bmm.toml");
const MECANUM: &str = include_str!("../../../../robots/mecanum.toml");

fn no_files(name: &str) -> Result<String, String> {
    Err(format!("no file {name}"))
}

fn check(text: &str) -> Result<RobotPlan, Vec<Problem>> {
    RobotPlan::from_toml(text, &Registry::with_built_in(), &no_files)
}

fn problems(text: &str) -> Vec<Problem> {
    check(text).expect_err("the file is broken")
}

/// The problem of a setting, its kind, line and column.
fn found<'p>(problems: &'p [Problem], setting: &str) -> (&'p Problem, ProblemKind, usize, usize) {
    let problem = problems.iter().find(|problem| problem.setting == setting);
    let problem = problem.unwrap_or_else(|| panic!("nothing about {setting} in {problems:#?}"));
    let place = problem.place.as_ref().expect("a place");
    (problem, problem.kind, place.line, place.column)
}

fn show(problems: &[Problem]) -> String {
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

#[test]
fn shipped_robots_are_short_and_resolve() {
    for (name, text, wheels) in [("bmm", BMM, 3), ("mecanum", MECANUM, 4)] {
        assert!(text.lines().count() < 60, "{name}");
        let plan = check(text).unwrap_or_else(|problems| panic!("{name}: {}", show(&problems)));
        assert_eq!(plan.name, name);
        assert_eq!(plan.drives.len(), wheels);
        assert_eq!(plan.kinematics.wheel_count(), wheels);
        assert_eq!(plan.bus.cycle_ns, 1_000_000);
    }
}

#[test]
fn the_sgdv_brings_its_own_maps() {
    let plan = check(BMM).unwrap();
    let drive = &plan.drives[2];
    assert_eq!((drive.output_bytes(), drive.input_bytes()), (20, 18));
    assert_eq!(drive.identity.vendor_id, Some(0x0539));
    let config = drive.subdevice_config(&plan.bus);
    assert_eq!(config.identity.product_code, Some(0x0220_0001));
    assert_eq!(config.pdos.len(), 2);
    assert_eq!(config.dc, omnibase_ethercat::DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 500_000 });
    // One PDO of the drive holds at most eight objects.
    assert!(config.pdos.iter().flat_map(|sm| &sm.pdos).all(|pdo| pdo.entries.as_ref().unwrap().len() <= 8));
}

#[test]
fn the_drives_watchdog_is_set_on_purpose_and_never_rounded() {
    let watchdog = |config: &omnibase_ethercat::SubDeviceConfig| {
        (config.watchdogs.divider, config.watchdogs.process_data, config.watchdogs.pdi)
    };
    let registers = |plan: &RobotPlan| watchdog(&plan.drives[0].subdevice_config(&plan.bus));
    assert_eq!(registers(&check(BMM).unwrap()), (Some(2498), Some(1000), None), "100 ms");
    let with = |us: u32| format!("{BMM}\n[safety]\ndrive_watchdog_us = {us}\n");
    assert_eq!(registers(&check(&with(20_000)).unwrap()), (Some(2498), Some(200), None));
    let all = problems(&with(20_050));
    let (problem, kind, ..) = found(&all, "safety.drive_watchdog_us");
    assert_eq!(kind, ProblemKind::OutOfRange);
    assert_eq!(problem.value.as_deref(), Some("20050"));
    assert_eq!(problem.limit.as_deref(), Some("20000 or 20100"));
    assert!(check(&with(6_553_600)).is_err(), "more steps than the register counts");
    // 1 ms and three exchanges that may be lost.
    assert!(check(&with(5_000)).is_ok());
    let all = problems(&with(4_900));
    assert_eq!(found(&all, "safety.drive_watchdog_us").1, ProblemKind::Contradiction);
}

#[test]
fn all_problems_come_at_once_with_their_places() {
    let broken = BMM
        .replace("cycle_us = 1000", "cycle_ms = 1")
        .replace("layout = \"bmm\"", "layout = \"bm\"")
        .replace("position = 2", "position = 1")
        .replace("jerk_m_s3 = 40.0\n", "")
        .replace("peak_torque_nm = 21.0", "peak_torque_nm = \"much\"")
        .replace("inertia_kg_m2 = 7.0\n\n", "inertia_kg_m2 = 7.0\nkp_1_s = [8.0, 8.0]\n\n")
        .replace("synchronisation", "syncronisation")
        .replace("wheel_speed_rad_s = 15.0", "wheel_speed = 15.0");
    let problems = problems(&broken);
    let text = show(&problems);
    let line = |needle: &str| broken.lines().position(|line| line.contains(needle)).unwrap() + 1;

    let (problem, kind, at, column) = found(&problems, "bus.cycle_ms");
    assert_eq!((kind, at, column), (ProblemKind::WrongUnit, line("cycle_ms"), 1));
    assert!(problem.reason.contains("us, not ms"), "{text}");
    assert!(!problems.iter().any(|problem| problem.setting == "bus.cycle_us"), "told once: {text}");

    let (problem, kind, at, _) = found(&problems, "platform.layout");
    assert_eq!((kind, at), (ProblemKind::UnknownName, line("\"bm\"")));
    assert!(problem.reason.contains("`bmm`") && problem.value.as_deref() == Some("\"bm\""), "{text}");

    let (problem, kind, at, _) = found(&problems, "drive[2].position");
    assert_eq!(
        (kind, at),
        (
            ProblemKind::Duplicate,
            broken.lines().count() - broken.lines().rev().position(|l| l == "position = 1").unwrap()
        )
    );
    assert!(problem.reason.contains("drive[1]"), "{text}");

    let (_, kind, at, _) = found(&problems, "limits.jerk_m_s3");
    assert_eq!((kind, at), (ProblemKind::Missing, line("[limits]")));

    let (_, kind, ..) = found(&problems, "drive_defaults.peak_torque_nm");
    assert_eq!(kind, ProblemKind::WrongType);
    let (problem, kind, ..) = found(&problems, "controller.kp_1_s");
    assert_eq!((kind, problem.limit.as_deref()), (ProblemKind::WrongType, Some("3 values")));
    let (problem, kind, ..) = found(&problems, "bus.syncronisation");
    assert_eq!(kind, ProblemKind::UnknownKey);
    assert!(problem.reason.contains("`synchronisation`"), "{text}");
    let (_, kind, ..) = found(&problems, "limits.wheel_speed");
    assert_eq!(kind, ProblemKind::WrongUnit);
    assert_eq!(problems.len(), 8, "{text}");
}

#[test]
fn problems_come_in_the_order_of_the_file() {
    let broken = BMM.replace("cycle_us = 1000", "cycle_us = 1").replace("speed_m_s = 1.0", "speed_m_s = -1");
    let problems = problems(&broken);
    assert_eq!(problems[0].setting, "bus.cycle_us");
    assert_eq!(problems[0].limit.as_deref(), Some("at least 50 and at most 100000"));
    assert_eq!(
        (problems[1].setting.as_str(), problems[1].value.as_deref()),
        ("limits.speed_m_s", Some("-1"))
    );
    assert_eq!(problems.len(), 2, "{}", show(&problems));
}

#[test]
fn every_missing_limit_is_told() {
    let start = BMM.find("[limits]").unwrap();
    let end = BMM.find("[controller]").unwrap();
    let problems = problems(&format!("{}{}", &BMM[..start], &BMM[end..]));
    let missing: Vec<&str> = problems.iter().map(|problem| problem.setting.as_str()).collect();
    assert_eq!(missing.len(), 8, "{missing:?}");
    assert!(missing.iter().all(|setting| setting.starts_with("limits.")));
}

#[test]
fn no_file_at_all_names_what_is_needed() {
    let problems = problems("");
    for setting in ["name", "bus.cycle_us", "drive", "platform.layout", "controller.kind", "limits.speed_m_s"]
    {
        assert!(problems.iter().any(|problem| problem.setting == setting), "{setting}: {}", show(&problems));
    }
    let said = show(&problems);
    let layout = said.lines().find(|line| line.starts_with("platform.layout")).unwrap();
    assert!(layout.contains("where the wheels stand (allowed: ") && layout.contains("mecanum"), "{said}");
}

#[test]
fn a_pdo_of_the_other_direction_is_told_with_what_is_expected_and_found() {
    let other = "outputs = [{ pdo = \"0x1A00\", map = \"6040:16\" }]\ninputs = [{ pdo = \"0x1600\", map = \"6041:16\" }]\n";
    let problems = problems(&BMM.replacen("[[drive]]\n", &format!("[[drive]]\n{other}"), 1));
    for (key, direction, allowed) in [
        ("outputs", "which the SubDevice receives", "\"0x1600\" to \"0x17FF\""),
        ("inputs", "which the SubDevice sends", "\"0x1A00\" to \"0x1BFF\""),
    ] {
        let (problem, kind, ..) = found(&problems, &format!("drive[0].{key}[0].pdo"));
        assert_eq!((kind, problem.limit.as_deref()), (ProblemKind::OutOfRange, Some(allowed)));
        assert!(problem.reason.contains(direction), "{problem}");
    }
}

#[test]
fn text_that_is_no_toml_says_where() {
    let problems = problems(&BMM.replace("speed_m_s = 1.0", "speed_m_s = 1.0 m/s"));
    let problem =
        problems.iter().find(|problem| problem.kind == ProblemKind::Syntax).expect("a syntax problem");
    let line = BMM.lines().position(|line| line == "speed_m_s = 1.0").unwrap() + 1;
    assert_eq!(problem.place.as_ref().unwrap().line, line);
}

#[test]
fn a_broken_header_is_told_alone_for_nobody_knows_what_follows() {
    for (whole, broken) in
        [("[limits]", "[limits"), ("[[drive]]", "[[drive]"), ("[drive_defaults]", "[drive_defaults")]
    {
        let problems = problems(&BMM.replacen(whole, broken, 1));
        assert_eq!((problems.len(), problems[0].kind), (1, ProblemKind::Header), "{}", show(&problems));
        let line = BMM.lines().position(|line| line == whole).unwrap() + 1;
        assert_eq!(problems[0].place.as_ref().unwrap().line, line);
    }
}

#[test]
fn what_is_wrong_in_the_defaults_is_told_once() {
    let problems = problems(
        &BMM.replace("device = \"sgdv\"", "device = \"sgdw\"\nrated_torque_nm = -7.0")
            .replace("\nrated_torque_nm = 7.0", ""),
    );
    let told: Vec<&str> = problems.iter().map(|problem| problem.setting.as_str()).collect();
    assert_eq!(told, ["drive_defaults.device", "drive_defaults.rated_torque_nm"], "{}", show(&problems));
}

#[test]
fn values_that_are_no_numbers_are_refused() {
    for wrong in ["nan", "inf", "-inf", "true", "\"1\"", "[1]"] {
        let problems = problems(&BMM.replace("speed_m_s = 1.0", &format!("speed_m_s = {wrong}")));
        assert_eq!(problems[0].kind, ProblemKind::WrongType, "{wrong}: {}", show(&problems));
        assert_eq!(problems.len(), 1, "{wrong}: {}", show(&problems));
    }
}

#[test]
fn maps_and_parameters_name_their_place() {
    let broken = MECANUM
        .replace("6040:16 6060:8", "6040 6060:8")
        .replace("6041:16 6061:8", "6061:8")
        .replace("gear_ratio = 10.0", "parameters = [{ object = \"0x6065\", type = \"u8\", value = 300 }]");
    let problems = problems(&broken);
    let (problem, kind, ..) = found(&problems, "drive_defaults.outputs[0].map");
    assert_eq!(kind, ProblemKind::WrongType);
    assert!(problem.reason.contains("found `6040`"), "{}", show(&problems));
    let (problem, kind, ..) = found(&problems, "drive_defaults.inputs");
    assert_eq!((kind, problem.limit.as_deref()), (ProblemKind::Missing, Some("6041:16")));
    let (problem, ..) = found(&problems, "drive_defaults.parameters[0].value");
    assert_eq!(problem.limit.as_deref(), Some("0 to 255"));
}

#[test]
fn a_controller_needs_its_target_in_the_map() {
    let problems = problems(&MECANUM.replace(" 60FF:32", ""));
    assert_eq!(problems.len(), 4, "{}", show(&problems));
    assert_eq!(problems[2].setting, "drive[2].outputs");
    assert_eq!(problems[2].limit.as_deref(), Some("60FF:32"));
}

#[test]
fn a_parameter_says_in_which_state_it_is_written() {
    let of = |state: &str| {
        let all = format!(
            "parameters = [{{ object = \"0x2100\", type = \"u8\", value = 1{state} }}, \
             {{ object = \"0x2101\", type = \"u8\", value = 2 }}, "
        );
        MECANUM.replace("parameters = [", &all)
    };
    let indices = |state| {
        let plan = RobotPlan::from_toml(&of(state), &Registry::with_built_in(), &no_files).unwrap();
        let config = plan.drives[0].subdevice_config(&plan.bus);
        let maker = |sdos: Vec<SdoWrite>| {
            let indices = sdos.into_iter().map(|sdo| sdo.object.index);
            indices.filter(|index| (0x2100..0x2200).contains(index)).collect::<Vec<_>>()
        };
        [maker(config.sdos), maker(config.safe_op_sdos)]
    };
    assert_eq!(indices(""), [vec![0x2100, 0x2101], vec![]]);
    assert_eq!(indices(", state = \"pre_op\""), [vec![0x2100, 0x2101], vec![]]);
    assert_eq!(indices(", state = \"safe_op\""), [vec![0x2101], vec![0x2100]]);
    let problems = problems(&of(", state = \"op\""));
    assert!(show(&problems).contains("(allowed: pre_op, safe_op)"), "{}", show(&problems));
}

#[test]
fn parameters_come_from_a_file_too() {
    let own = "parameters = [{ object = \"6085\", type = \"u32\", value = 2_500_000 }]";
    let text = BMM.replace(
        own,
        "parameters_file = \"servo.toml\"\nparameters = [{ object = \"60C2.1\", type = \"u8\", value = 1 }]",
    );
    let files = |name: &str| match name {
        "servo.toml" => Ok("[[parameter]]\nobject = \"0x6065\"\ntype = \"u32\"\nvalue = 5000\n".to_string()),
        other => no_files(other),
    };
    let plan = RobotPlan::from_toml(&text, &Registry::with_built_in(), &files).unwrap();
    // Behind the device's own.
    let parameters = &plan.drives[1].parameters[2..];
    assert_eq!((parameters[0].index, parameters[0].data.as_slice()), (0x6065, &[0x88, 0x13, 0, 0][..]));
    assert_eq!(parameters[0].origin, "servo.toml line 2");
    assert_eq!((parameters[1].index, parameters[1].subindex), (0x60C2, 1));

    let broken =
        |_: &str| Ok("[[parameter]]\nobject = \"0x6065\"\ntype = \"u32\"\nvalu = 5000\n".to_string());
    let problems = RobotPlan::from_toml(&text, &Registry::with_built_in(), &broken).expect_err("broken");
    let place = problems.iter().find(|p| p.kind == ProblemKind::UnknownKey).unwrap().place.clone().unwrap();
    assert_eq!((place.file.as_deref(), place.line), (Some("servo.toml"), 4));
    let problems = check(&text).expect_err("no such file");
    assert_eq!(problems[0].kind, ProblemKind::File);
}

/// The BMM's file with other wheels.
fn with_layout(layout: &str) -> String {
    let text = BMM.replace("p1_m = 0.38\np_m = 0.40\n", "");
    assert_ne!(text, BMM);
    text.replace("layout = \"bmm\"", layout)
}

#[test]
fn layouts_that_cannot_be_driven_are_refused_with_the_reason() {
    let wheels = "layout = \"wheels\"\nwheel = [\n { position_m = [0.3, 0.0], rolling_angle_rad = 0.0 },\n \
                  { position_m = [-0.3, 0.0], rolling_angle_rad = 0.0 },\n { position_m = [0.0, 0.3], rolling_angle_rad = 0.0 },\n]";
    let problems = problems(&with_layout(wheels));
    assert_eq!(problems[0].setting, "platform");
    assert_eq!(problems[0].kind, ProblemKind::Contradiction);
}

#[test]
fn wheels_and_drives_are_counted() {
    let problems = problems(&with_layout("layout = \"omni4\"\ncentre_distance_m = 0.4"));
    let (problem, kind, ..) = found(&problems, "platform.layout");
    assert_eq!((kind, problem.value.as_deref()), (ProblemKind::Contradiction, Some("4 wheels")));
}

#[test]
fn the_schema_names_every_key_with_its_bounds() {
    let schema = Registry::with_built_in().json_schema();
    let limits = &schema["$defs"]["LimitsTable"]["properties"];
    assert_eq!(limits["speed_m_s"]["exclusiveMinimum"], 0.0);
    assert!(limits["speed_m_s"]["description"].as_str().unwrap().contains("m/s"));
    assert_eq!(schema["$defs"]["BusTable"]["properties"]["cycle_us"]["minimum"], 50);
}

#[test]
fn the_shipped_schema_is_the_present_one() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/robot.schema.json");
    let present = serde_json::to_string_pretty(&Registry::with_built_in().json_schema()).unwrap() + "\n";
    if std::env::var_os("UPDATE_SCHEMA").is_some() {
        std::fs::write(path, &present).unwrap();
    }
    let shipped = std::fs::read_to_string(path).unwrap_or_default();
    assert!(shipped == present, "run `UPDATE_SCHEMA=1 cargo test -p omnibase-robot shipped_schema`");
}

#[test]
fn a_torque_limit_that_nothing_would_hold_is_refused() {
    let mapped = |map: &str| MECANUM.replace("6071:16 6072:16", map);
    for (map, limit) in [
        ("6071:16 pad:4 6072:16 pad:4", "6072:16"),
        ("6071:16 6072:8", "6072:16"),
        ("60E0:32 6071:16 6072:16", "60E0:16"),
    ] {
        let all = problems(&mapped(map));
        let (problem, kind, ..) = found(&all, "drive_defaults.outputs");
        assert_eq!(
            (kind, problem.limit.as_deref()),
            (ProblemKind::OutOfRange, Some(limit)),
            "{}",
            show(&all)
        );
    }
    let both =
        MECANUM.replace("gear_ratio = 10.0", "gear_ratio = 10.0\ntorque_limit = \"positive_and_negative\"");
    let all = problems(&both.replace("6071:16 6072:16", "6071:16 60E0:16"));
    let (problem, kind, ..) = found(&all, "drive_defaults.outputs");
    assert_eq!((kind, problem.limit.as_deref()), (ProblemKind::Missing, Some("60E0:16 60E1:16")));
    // Less than the drive's unit.
    let all = problems(&BMM.replace("wheel_torque_nm = 21.0", "wheel_torque_nm = 0.006"));
    let (problem, kind, ..) = found(&all, "limits.wheel_torque_nm");
    assert_eq!(
        (kind, problem.limit.as_deref()),
        (ProblemKind::OutOfRange, Some("at least 0.007")),
        "{}",
        show(&all)
    );
}

#[test]
fn a_parameter_that_contradicts_the_torque_limit_is_refused() {
    let with = |object: &str| {
        BMM.replace(
            "parameters = [",
            &format!("parameters = [{{ object = \"{object}\", type = \"u16\", value = 3000 }}, "),
        )
    };
    let all = problems(&with("6072"));
    let (problem, kind, ..) = found(&all, "drive_defaults.parameters");
    assert_eq!(kind, ProblemKind::Contradiction);
    assert!(problem.value.as_deref().unwrap().starts_with("6072 (line"), "{}", show(&all));
    // A further limit of the drive's own is the user's business.
    assert!(check(&with("60E0")).is_ok());
}

#[test]
fn motions_that_nobody_sees_the_end_of_are_refused() {
    let circle = format!("{BMM}\n[reference]\nkind = \"circle\"\nradius_m = 0.5\n");
    let all = problems(&(circle.clone() + "duration_s = 1e18\n"));
    let (problem, kind, ..) = found(&all, "reference.duration_s");
    assert_eq!(kind, ProblemKind::OutOfRange);
    assert!(
        problem.reason.contains("it takes 1000000000000000000 s, expected at most 1000000 s"),
        "{problem}"
    );
    // As long as the limits make it, and as many turns.
    assert!(show(&problems(&(circle.clone() + "turns = 1e15\n"))).contains("expected at most 1000000 s"));
    let fastest = format!("{circle}timing = \"fastest\"\nturns = 1e15\n");
    assert!(show(&problems(&fastest)).contains("expected at most 10000 for the fastest motion"));
    let slow = circle.replace("speed_m_s = 1.0", "speed_m_s = 1e-12");
    assert_ne!(slow, circle);
    assert!(show(&problems(&slow)).contains("expected at most 1000000 s"));
    let path = format!("{BMM}\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [1e18, 1, 0, 0]]\n");
    assert!(show(&problems(&path)).contains("found 1000000000000000000 s"), "{}", show(&problems(&path)));
}

#[test]
fn a_registered_motion_without_a_reachable_end_is_refused() {
    struct Endless(f64);
    impl crate::stages::Reference for Endless {
        fn start(&mut self, _: &crate::signals::Setpoint) {}
        fn sample(&mut self, _: f64) -> crate::signals::Setpoint {
            crate::signals::Setpoint::default()
        }
        fn duration_s(&self) -> Option<f64> {
            Some(self.0)
        }
    }
    let built = |duration_s: f64| {
        let mut registry = Registry::with_built_in();
        let kind = Kind { name: "endless", meaning: "For a test", keys: Vec::new() };
        registry.references.add(kind, move |_, _| Ok(Endless(duration_s)));
        let text = format!("{BMM}\n[reference]\nkind = \"endless\"\n");
        RobotPlan::from_toml(&text, &registry, &no_files).map(|_| ()).map_err(|problems| show(&problems))
    };
    assert_eq!(built(60.0), Ok(()));
    for duration_s in [1e18, f64::INFINITY, f64::NAN, -1.0] {
        let refusal = built(duration_s).unwrap_err();
        assert!(refusal.contains("expected 0 to 1000000 s"), "{duration_s}: {refusal}");
    }
}
