//! `omnibase check`: what it says of sound files and of mistakes.

use super::{Folder, bmm, json, omnibase, prints, refused, root};
use serde_json::Value;

#[test]
fn a_sound_file_is_checked_to_a_plan_with_units() {
    let text = prints(&["check", "robots/bmm.toml"]);
    for words in ["wheel_1", "position 2", "process image", "6041:00@0:16", "1 m/s", "N·m", "cycle 1000 us"]
    {
        assert!(text.contains(words), "{words} in {text}");
    }
    let plan = json(&["check", "robots/mecanum.toml", "--json"]);
    assert_eq!(plan["problems"], Value::Array(Vec::new()));
    assert_eq!(plan["wheels"].as_array().unwrap().len(), 4);
    assert_eq!(plan["limits"]["speed"]["unit"], "m/s");
    let folder = Folder::new("robot-resolved");
    let more = "\n[safety]\non_lost_device = \"ramp\"\n[fence]\nrectangle_m = [-1, -1, 2, 1.5]\n\
                [[obstacle]]\ncentre_m = [1.2, 0.9]\nradius_m = 0.1\n";
    let file =
        folder.file("robot.toml", &(std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap() + more));
    let text = prints(&["check", &file]);
    for words in [
        "on_lost_device       category 1",
        "fence                (-1, -1) (2, -1) (2, 1.5) (-1, 1.5) m, margin 0.05 m",
        "obstacle             at (1.2, 0.9) m, radius 0.1 m",
    ] {
        assert!(text.contains(words), "{words} in {text}");
    }
    // Events of clocks and waits are told where they are asked for.
    assert!(!text.contains("SYNC0 a cycle") && !text.contains("waited for"), "{text}");
    let dc = "drive_defaults.dc={ assign_activate = \"0x0700\", sync0_per_cycle = 4, sync1_every = 4, sync1_shift_us = 20 }";
    let waits = "drive_defaults.timeouts={ pre_op_ms = 4000, mailbox_ms = 500 }";
    let text = prints(&["check", "robots/bmm.toml", "--set", dc, "--set", waits]);
    for words in [
        "clock        4 SYNC0 a cycle, the first at 500 us, SYNC1 20 us behind one in 4; 0x0980 and 0x0981: 0x0700",
        "waited for   PRE-OP 4000 ms, mailbox 500 ms at most",
    ] {
        assert!(text.contains(words), "{words} in {text}");
    }
    let slow = "\n[[device]]\nname = \"valves\"\nalias = 7\ngroup = \"arm\"\nevery = 10\nkind = \"io\"\n\
                outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n";
    let file =
        folder.file("slow.toml", &(std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap() + slow));
    let told = "valves: io, alias 7, its process data in one of 10 cycles, hot-connect group `arm`";
    assert!(prints(&["check", &file]).contains(told));
    assert_eq!(json(&["check", &file, "--json"])["devices"][0]["every"], 10);
    let schema = json(&["check", "--schema"]);
    let kept = std::fs::read_to_string(root().join("robots/robot.schema.json")).unwrap();
    assert_eq!(schema, serde_json::from_str::<Value>(&kept).unwrap(), "robots/robot.schema.json is old");
}

#[test]
fn kinds_and_their_keys_are_told_by_the_registry() {
    let registry = omnibase_robot::Registry::with_built_in();
    let (text, help) = (prints(&["check", "--kinds"]), prints(&["run", "--help"]));
    let told = json(&["check", "--kinds", "--json"]);
    for ((sort, kinds), told) in registry.sorts().into_iter().zip(told.as_array().unwrap()) {
        assert_eq!((&told["table"], &told["key"]), (&sort.table.into(), &sort.key.into()));
        for (kind, told) in kinds.iter().zip(told["kinds"].as_array().unwrap()) {
            let line = text.lines().find(|line| line.trim_start().starts_with(&format!("{} ", kind.name)));
            assert!(line.is_some_and(|line| line.contains(kind.meaning)), "{} in {text}", kind.name);
            let names: Vec<&str> =
                told["keys"].as_array().unwrap().iter().map(|key| key["name"].as_str().unwrap()).collect();
            assert_eq!(
                (&told["name"], names),
                (&kind.name.into(), kind.keys.iter().map(|key| key.name).collect())
            );
        }
    }
    let line = |start: &str| text.lines().find(|line| line.trim_start().starts_with(start)).unwrap();
    assert!(line("* mass_kg").ends_with("First estimate of the mass, kg. Allowed: above 0."), "{text}");
    assert!(line("heading").ends_with("Allowed: given, fixed, follows_tangent, free."), "{text}");
    assert!(line("turns").ends_with("Allowed: above 0, or endless."), "{text}");
    let shape = help.split("--ellipse <KEY=VALUE,...>").nth(1).unwrap().trim_start();
    let shape = shape.split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, references) = registry.sorts().into_iter().find(|(sort, _)| sort.table == "reference").unwrap();
    let ellipse = references.iter().find(|kind| kind.name == "ellipse").unwrap();
    let keys = ellipse.keys.iter().map(|key| key.name).collect::<Vec<_>>().join(", ");
    assert!(keys.starts_with("semi_axis_x_m, semi_axis_y_m, "), "{keys}");
    assert!(shape.starts_with(&format!("An ellipse to the left; takes {keys}")), "{help}");
}

/// The file of the BMM with four mistakes, and what is to be said of each: line, column, expected, found.
fn four_mistakes() -> (String, [(String, &'static str); 4]) {
    let sound = bmm();
    let text = sound
        .replace("position = 2", "position = 1")
        .replace("\nspeed_m_s = 1.0", "\nspeed_mm_s = 1.0")
        .replace("rated_torque_nm", "rated_torqe_nm")
        .replace("wheel_radius_m = 0.10", "wheel_radius_m = \"big\"");
    let place = |start: &str, column: usize| {
        let found = text.lines().enumerate().filter(|(_, line)| line.starts_with(start)).last();
        format!("{}:{column}", found.expect("the line").0 + 1)
    };
    let mistakes = [
        (place("position = 1", 1), "drive[2].position = 1: drive[1] has the same position"),
        (place("speed_mm_s", 1), "the unit of this setting is m_s, not mm_s: write `speed_m_s`"),
        (place("rated_torqe_nm", 1), "did you mean `rated_torque_nm`?"),
        (
            place("wheel_radius_m", 1),
            "wheel_radius_m = \"big\": the value has another type than number (allowed: number)",
        ),
    ];
    (text, mistakes)
}

#[test]
fn all_mistakes_of_a_file_are_told_at_once_with_their_places() {
    let folder = Folder::new("robot-mistakes");
    let (text, mistakes) = four_mistakes();
    let file = folder.file("robot.toml", &text);
    for command in [
        &["check", &file][..],
        &["run", &file, "--circle", "radius_m=0.5"],
        &["kinematics", &file, "--twist", "1 0 0"],
    ] {
        let (code, says) = refused(command);
        assert_eq!(code, Some(1), "{says}");
        for (place, what) in &mistakes {
            let line = says.lines().find(|line| line.starts_with(&format!("{file}:{place}:")));
            let line = line.unwrap_or_else(|| panic!("{command:?}: {place} in {says}"));
            assert!(line.contains(what), "{what} in {line}");
        }
    }
    let output = omnibase(&["check", &file, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let places: Vec<String> = told["problems"]
        .as_array()
        .unwrap()
        .iter()
        .map(|problem| format!("{}:{}", problem["line"], problem["column"]))
        .collect();
    for (place, _) in &mistakes {
        assert!(places.contains(place), "{place} in {places:?}");
    }
}

#[test]
fn ends_that_are_passed_with_a_speed_are_told_with_their_runs_whatever_the_heading() {
    let circle = "radius_m=0.5,turns=0.5,start_speed_m_s=0.4,end_speed_m_s=0.6";
    for heading in [&[] as &[&str], &["--heading", "follows_tangent"], &["--heading", "free"]] {
        let words = ["check", "robots/bmm.toml", "--circle", circle, "--timing", "fastest"];
        let words: Vec<&str> = words.iter().chain(heading).copied().collect();
        let text = prints(&words);
        let told = json(&[words.as_slice(), &["--json"]].concat())["motion"].clone();
        let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{heading:?}: {told}"));
        for (end, speed_m_s, run) in [("start", 0.4, "from rest"), ("end", 0.6, "to rest")] {
            let [time_s, found_m_s, run_m] =
                ["time_s", "speed_m_s", "run_m"].map(|key| number(&told[end][key]));
            assert!((found_m_s / speed_m_s - 1.0).abs() < 3e-3, "{heading:?}: {told}");
            // v²/2a at 1.5 m/s² at least.
            assert!((speed_m_s * speed_m_s / 3.0..0.3).contains(&run_m), "{heading:?}: {told}");
            let line = format!(
                "  passes its {end:<9} at {time_s:.3} s with {found_m_s:.3} m/s; a run of {run_m:.3} m {run}"
            );
            assert!(text.lines().any(|told| told == line), "{line}: {text}");
        }
        // Half of the circle, and both runs.
        let [way_m, begin_m, end_m] =
            [&told["way_m"], &told["start"]["run_m"], &told["end"]["run_m"]].map(number);
        assert!((way_m - begin_m - end_m - 0.5 * std::f64::consts::PI).abs() < 0.01, "{heading:?}: {told}");
        assert_eq!(text.contains("free:"), heading.contains(&"free"), "{text}");
    }
    // Who passes no end is told of none.
    let text = prints(&["check", "robots/bmm.toml", "--circle", "radius_m=0.5", "--timing", "fastest"]);
    assert!(!text.contains("passes its"), "{text}");
}

#[test]
fn a_picture_of_a_motion_says_where_it_begins_and_ends() {
    let folder = Folder::new("check-picture");
    let picture = folder.path("motion.svg");
    let drawn = |path: &str| {
        prints(&["check", "robots/bmm.toml", "--path", path, "--picture", &picture]);
        std::fs::read_to_string(&picture).unwrap()
    };
    let square = drawn("robots/square.dat");
    assert!(
        square.matches(">start, end</text>").count() == 1 && !square.contains(">start</text>"),
        "{square}"
    );
    let straight = drawn(&folder.file("straight.dat", "0 0 0 0\n4 1 0 0\n"));
    assert!(straight.contains(">start</text>") && straight.contains(">end</text>"), "{straight}");
}

#[test]
fn the_map_is_looked_at_as_a_run_does_and_told() {
    let map = folder_of_a_map();
    let told = prints(&[
        "check",
        "robots/bmm.toml",
        "--set",
        &format!("map.file={}", map.path("room.yaml")),
        "--set",
        "map.blocked_m=[[[1,0],[2,0],[1,1]]]",
    ]);
    assert!(told.contains("map         4 x 3 cells of 0.05 m, 1 polygon\n"), "{told}");
    for (file, why) in [("nope.yaml", "No such file"), ("broken.yaml", "resolution")] {
        let set = format!("map.file={}", map.path(file));
        let (code, said) = refused(&["check", "robots/bmm.toml", "--set", &set]);
        assert!(code == Some(1) && said.contains("map.file") && said.contains(why), "{file}: {said}");
        let (_, run) =
            refused(&["run", "robots/bmm.toml", "--dashboard=127.0.0.1:0", "--simulated", "--set", &set]);
        assert!(run.contains(why), "{run}");
    }
}

fn folder_of_a_map() -> Folder {
    let folder = Folder::new("check-map");
    let yaml = "image: room.pgm\nresolution: 0.05\norigin: [-0.1, -0.1, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    folder.file("room.yaml", yaml);
    folder.file("broken.yaml", &yaml.replace("0.05", "wide"));
    std::fs::write(folder.path("room.pgm"), [&b"P5\n4 3\n255\n"[..], &[254; 12]].concat()).unwrap();
    folder
}

#[test]
fn a_picture_has_the_name_of_what_it_is() {
    for command in [&["check", "robots/bmm.toml"][..], &["plan", "robots/bmm.toml", "--to", "1 0 0"]] {
        let (code, said) = refused(&[command, &["--picture", "way.png"]].concat());
        assert!(code == Some(2) && said.contains("expected a name that ends in .svg"), "{said}");
    }
}
