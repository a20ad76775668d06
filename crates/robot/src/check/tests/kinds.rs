//! Kinds, built-in and of one's own: what they need, what nobody reads, and what the registry tells.

use super::*;
use crate::registry::{Key, needed, optional};
use crate::signals::{Commands, CycleTime, PlatformState, Quantity, Setpoint};
use crate::stages::{Controller, Reference};

/// A controller that commands something, and nothing more.
struct Commanding(Quantity);

impl Controller for Commanding {
    fn quantity(&self) -> Quantity {
        self.0
    }
    fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
        Commands::default()
    }
}

/// A reference that stays where it is.
struct Still;

impl Reference for Still {
    fn sample(&mut self, _: f64) -> Setpoint {
        Setpoint::default()
    }
}

/// The problems of a file where users added kinds of every sort.
fn with_own_kinds(text: &str) -> Result<RobotPlan, Vec<Problem>> {
    let mut registry = Registry::with_built_in();
    let kind = |name, keys: &[Key]| Kind { name, meaning: "For a test", keys: keys.to_vec() };
    let gain = needed("gain_1_s").number("Gain, 1/s", 0.0..=10.0);
    for (name, quantity) in [("own_speed", Quantity::Speed), ("own_torque", Quantity::Torque)] {
        let keys = [gain.clone(), optional("law").value("Anything")];
        registry.controllers.add(kind(name, &keys), move |_| Ok(Commanding(quantity)));
    }
    let keys = [needed("rows").number("Wheels on either side", 2.0..=4.0), optional("half_width_m")];
    registry.layouts.add(kind("own_layout", &keys), |table| {
        assert_eq!(table.custom.number("rows")?, 2.0);
        Ok(omnibase_platform::layout::omni(3, 0.4, 0.1, 0.0))
    });
    RobotPlan::from_toml(text, &registry, &no_files)
}

/// A reference of one's own reads a file as the built-in ones do, and what is wrong in it is said of the file.
#[test]
fn a_users_reference_may_have_a_file() {
    let file = optional("speeds_file").value("A file in place of `speeds`").file("speeds", |text, table| {
        let speeds = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>();
        table.custom.0.insert("speeds".into(), speeds.map_err(|error| error.to_string())?.into());
        Ok(())
    });
    let keys = vec![needed("speeds").value("Speeds, m/s"), file];
    let mut registry = Registry::with_built_in();
    registry.references.add(Kind { name: "own", meaning: "For a test", keys }, |table, _| {
        match table.custom.0.get("speeds").and_then(|speeds| speeds[0].as_f64()) {
            Some(0.0) => Ok(Still),
            // Another key that begins alike.
            Some(1.0) => Err(Problem::refused("custom.speeds_most", "1 is too much").into()),
            found => Err(Problem::refused("custom.speeds", format!("expected 0, found {found:?}")).into()),
        }
    });
    let read = |name: &str| match name {
        "still.dat" => Ok("0 0".to_owned()),
        "fast.dat" => Ok("3".to_owned()),
        "most.dat" => Ok("1".to_owned()),
        "words.dat" => Ok("three".to_owned()),
        other => Err(format!("no file {other}")),
    };
    let of = |custom: &str| {
        let text = format!("{BMM}\n[reference]\nkind = 'own'\ncustom = {{ {custom} }}\n");
        RobotPlan::from_toml(&text, &registry, &read).map_err(|problems| show(&problems))
    };
    let plan = of("speeds_file = 'still.dat'").unwrap();
    assert_eq!(plan.reference.custom.0["speeds"], serde_json::json!([0.0, 0.0]));
    let names = |table: ReferenceTable| table.custom.0.get("speeds_file").cloned();
    let beside = |name: &str| Some(format!("there/{name}"));
    assert_eq!(names(registry.with_files(plan.reference.clone(), beside)), Some("there/still.dat".into()));
    assert_eq!(names(registry.with_files(plan.reference, |_| None)), None);
    for (custom, setting, says) in [
        ("speeds_file = 'none.dat'", "speeds_file = \"none.dat\"", "no file none.dat"),
        ("speeds_file = 'words.dat'", "speeds_file = \"words.dat\"", "invalid float literal"),
        ("speeds_file = 'fast.dat'", "speeds_file = \"fast.dat\"", "expected 0, found Some(3.0)"),
        ("speeds_file = 'most.dat'", "speeds_most", "1 is too much"),
        ("speeds_file = 1", "speeds_file = 1", "expected a file's name"),
        (
            "speeds = [0], speeds_file = 'still.dat'",
            "speeds_file",
            "give `custom.speeds` or `custom.speeds_file`, not both",
        ),
        ("speeds = [3]", "speeds", "expected 0, found Some(3.0)"),
    ] {
        let told = of(custom).expect_err(custom);
        assert!(told.contains(&format!("reference.custom.{setting}: {says}")), "{custom}: {told}");
    }
}

#[test]
fn a_users_controller_needs_its_target_in_the_map_too() {
    for (law, unmapped, limit) in
        [("own_speed", " 60FF:32", "60FF:32"), ("own_torque", " 6071:16", "6071:16")]
    {
        let text = MECANUM
            .replace("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\"\ncustom.gain_1_s = 1"));
        assert!(with_own_kinds(&text).is_ok(), "{law}");
        let problems = with_own_kinds(&text.replace(unmapped, "")).expect_err(law);
        let told = problems.iter().filter(|problem| problem.limit.as_deref() == Some(limit));
        assert_eq!(told.clone().count(), 4, "{law}: {}", show(&problems));
        assert!(told.clone().all(|problem| problem.reason.starts_with(law)), "{law}: {}", show(&problems));
    }
}

#[test]
fn what_a_kind_needs_is_told_once_with_its_place() {
    let problems = problems(
        &BMM.replace("kind = \"closed_loop_speed\"", "kind = \"adaptive_torque\"")
            .replace("inertia_kg_m2 = 7.0\n\n", "\n"),
    );
    let (problem, kind, ..) = found(&problems, "controller.inertia_kg_m2");
    assert_eq!(kind, ProblemKind::Missing);
    assert_eq!(problem.reason, "must be given: `adaptive_torque` needs it");
    assert_eq!(problems.len(), 1, "{}", show(&problems));
    // Also of one to which it may be switched; and a value that was refused is not missing.
    let other = "kind = \"closed_loop_speed\"\nothers = [\"adaptive_torque\"]";
    let text = BMM
        .replace("kind = \"closed_loop_speed\"", other)
        .replace("inertia_kg_m2 = 7.0\n\n", "inertia_kg_m2 = -7.0\n\n");
    let problems = check(&text).expect_err("refused");
    assert_eq!((problems.len(), problems[0].kind), (1, ProblemKind::OutOfRange), "{}", show(&problems));
    let wheels = "layout = \"wheels\"\nwheel = [{ position_m = [0.3, 0.0] }, {}, { rolling_angle_rad = 1 }]";
    let problems = check(&with_layout(wheels)).expect_err("refused");
    let settings: Vec<&str> = problems.iter().map(|problem| problem.setting.as_str()).collect();
    let expected = ["wheel[0].rolling_angle_rad", "wheel[1].position_m", "wheel[2].position_m"];
    assert_eq!(settings, expected.map(|key| format!("platform.{key}")));
}

#[test]
fn what_no_chosen_kind_reads_is_refused_with_what_it_reads() {
    let unread = |text: &str, setting: &str| {
        let problems = with_own_kinds(text).expect_err(setting);
        let (problem, kind, ..) = found(&problems, setting);
        assert_eq!((kind, problems.len()), (ProblemKind::UnknownKey, 1), "{}", show(&problems));
        (problem.value.clone().unwrap(), problem.reason.clone(), problem.limit.clone().unwrap())
    };
    let circle = format!("{BMM}\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nstep_m = 0.1\n");
    let (value, reason, limit) = unread(&circle, "reference.step_m");
    assert_eq!((value.as_str(), reason.as_str()), ("0.1", "the reference `circle` doesn't read it"));
    assert_eq!(
        limit,
        "correction, correction_file, duration_s, end_speed_m_s, frame, heading, obstacles, period_s, radius_m, speed_m_s, \
         start_speed_m_s, timing, turn_speed_rad_s, turns"
    );
    let hold = format!("{BMM}\n[reference]\npoints = [[0, 0, 0, 0]]\n");
    let (value, reason, limit) = unread(&hold, "reference.points");
    assert_eq!(
        [value.as_str(), reason.as_str(), limit.as_str()],
        ["a list of 1", "the reference `hold` doesn't read it", "none"]
    );
    unread(&BMM.replace("p_m = 0.40", "p_m = 0.40\nhalf_width_m = 0.2"), "platform.half_width_m");
    // Keys of every controller may stand there, for one may be switched to another; what none of them reads may not.
    let law = |keys: &str| BMM.replace("[simulation]", &format!("{keys}\n[simulation]"));
    assert!(with_own_kinds(&law("damping_n_s_m = 5.0\ncustom.gain_1_s = 3")).is_ok());
    let (_, reason, limit) = unread(&law("custom.gains_1_s = 3"), "controller.custom.gains_1_s");
    assert_eq!(reason, "no controller reads it; did you mean `custom.gain_1_s`?");
    assert!(limit.contains("custom.gain_1_s, custom.law") && limit.contains("mass_kg"), "{limit}");
    // A drive's own key, and one of the defaults.
    unread(
        &BMM.replace("position = 1", "position = 1\ncustom = { filter_1_s = 1 }"),
        "drive[1].custom.filter_1_s",
    );
    let shared = BMM.replace("device = \"sgdv\"", "device = \"sgdv\"\ncustom = { filter_1_s = 1 }");
    unread(&shared, "drive_defaults.custom.filter_1_s");
}

#[test]
fn first_estimates_lie_within_their_bounds_under_the_law_that_learns_them() {
    let with = |law: &str, keys: &str| {
        let text = BMM.replace("\"closed_loop_speed\"", &format!("\"{law}\"\n{keys}"));
        check(&text).map(|_| ()).map_err(|problems| show(&problems))
    };
    for (keys, setting, limit) in [
        ("mass_bounds_kg = [80, 90]", "controller.mass_kg = 70", "80 to 90"),
        ("mass_bounds_kg = [90, 50]", "controller.mass_kg = 70", "90 to 50"),
        ("inertia_bounds_kg_m2 = [1, 6]", "controller.inertia_kg_m2 = 7", "1 to 6"),
    ] {
        let told = with("adaptive_torque", keys).expect_err(keys);
        assert!(told.contains(setting) && told.contains(limit) && told.lines().count() == 1, "{told}");
        assert_eq!(with("open_loop", keys), Ok(()));
    }
    for keys in ["mass_bounds_kg = [0, 90]", "kp_1_s = [8.0, -1.0, 8.0]"] {
        let told = with("open_loop", keys).expect_err(keys);
        assert!(told.contains("the value is outside its bounds"), "{told}");
    }
}

#[test]
fn what_the_platform_weighs_is_more_than_nothing() {
    let with = |mass_kg: &str| BMM.replacen("mass_kg = 70.0 ", &format!("mass_kg = {mass_kg} "), 1);
    assert_eq!(check(&with("82.5")).expect("a heavier one").mass_kg, Some(82.5));
    for mass_kg in ["0.0", "-70.0"] {
        let told = show(&check(&with(mass_kg)).expect_err(mass_kg));
        assert!(told.contains("platform.mass_kg") && told.contains("outside its bounds"), "{told}");
    }
}

#[test]
fn own_keys_of_a_kind_are_within_their_bounds() {
    let of = |custom: &str| {
        let text = BMM
            .replace("\"closed_loop_speed\"", "\"own_speed\"")
            .replace("[simulation]", &format!("{custom}\n[simulation]"));
        with_own_kinds(&text).map_err(|problems| show(&problems))
    };
    assert!(of("custom = { gain_1_s = 10, law = [\"of\", 1] }").is_ok());
    for (custom, says) in [
        (
            "custom.gain_1_s = 10.5",
            "controller.custom.gain_1_s = 10.5: expected a number within its bounds (allowed: 0 to 10)",
        ),
        ("custom.gain_1_s = \"much\"", "controller.custom.gain_1_s = \"much\": expected a number"),
        ("custom.law = 1", "controller.custom.gain_1_s: must be given: `own_speed` needs it"),
    ] {
        let told = of(custom).expect_err(custom);
        assert!(told.contains(says) && told.lines().count() == 1, "{told}");
    }
}

#[test]
fn a_users_layout_stands_in_the_file_and_in_the_schema_like_any_other() {
    let own = "layout = \"own_layout\"\nhalf_width_m = 0.2\ncustom.rows = 2";
    assert_eq!(with_own_kinds(&with_layout(own)).unwrap().kinematics.wheel_count(), 3);
    let problems = with_own_kinds(&with_layout("layout = \"own_layot\"")).expect_err("a slip");
    let (problem, kind, ..) = found(&problems, "platform.layout");
    assert_eq!((kind, problems.len()), (ProblemKind::UnknownName, 1));
    assert!(problem.reason.contains("did you mean `own_layout`?"), "{problem}");
    let mut registry = Registry::with_built_in();
    let keys = vec![needed("rows").number("Wheels on either side", 2.0..=4.0)];
    let kind = Kind { name: "own_layout", meaning: "Rows of wheels", keys };
    registry.layouts.add(kind, |_| Ok(Vec::new()));
    let schema = registry.json_schema();
    let names = schema["$defs"]["LayoutName"]["oneOf"].as_array().unwrap();
    assert_eq!(names.last().unwrap()["description"], "Rows of wheels. Needs custom.rows.");
    let rows = &schema["$defs"]["PlatformTable"]["properties"]["custom"]["properties"]["rows"];
    assert_eq!((&rows["minimum"], &rows["maximum"]), (&2.0.into(), &4.0.into()));
    assert_eq!(rows["description"], "Wheels on either side. Read by `own_layout`.");
}

#[test]
fn every_key_of_a_built_in_kind_stands_in_its_table_and_every_such_key_is_read() {
    let registry = Registry::with_built_in();
    let schema = registry.json_schema();
    for (sort, kinds) in registry.sorts() {
        let tables = schema["$defs"].as_object().unwrap().iter();
        let name = format!("{}table", sort.table.rsplit('.').next().unwrap());
        let (_, table) = tables.clone().find(|(key, _)| key.to_lowercase() == name).unwrap();
        let table = table["properties"].as_object().unwrap();
        for (kind, key) in kinds.iter().flat_map(|kind| kind.keys.iter().map(move |key| (kind, key))) {
            assert!(table.contains_key(key.name), "{} {} reads {}", sort.name, kind.name, key.name);
        }
        for key in table.keys().filter(|key| !sort.is_common(key)) {
            assert!(kinds.iter().any(|kind| kind.reads(key)), "nobody reads {}.{key}", sort.table);
        }
    }
}
