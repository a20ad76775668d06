//! `omnibase run`, `check`, `kinematics` and `replay` as a user runs them, on virtual time.

mod check;
mod estimate;
mod found;
mod plan;

use crate::command_line::{Folder, omnibase, root, words};
use serde_json::Value;
use std::process::{Command, Stdio};

const SQUARE: [&str; 4] = ["run", "robots/bmm.toml", "--path", "robots/square.dat"];
const CIRCLE: [&str; 4] = ["run", "robots/bmm.toml", "--circle", "radius_m=0.2,duration_s=5"];

impl Folder {
    /// A file with a text, by its path.
    fn file(&self, name: &str, text: &str) -> String {
        std::fs::write(self.0.join(name), text).unwrap();
        self.path(name)
    }
}

fn bmm() -> String {
    std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap()
}

/// What a command prints, where it succeeds.
fn prints(arguments: &[&str]) -> String {
    let output = omnibase(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
    words(&output.stdout)
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&prints(arguments)).unwrap()
}

/// Exit code, and what is said on either output.
fn refused(arguments: &[&str]) -> (Option<i32>, String) {
    let output = omnibase(arguments);
    (output.status.code(), words(&output.stdout) + &words(&output.stderr))
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// A drive loses its supply after two seconds: the frames round that are there, no others, and where nothing goes wrong no file is.
#[test]
fn the_frames_of_what_went_wrong_are_kept() {
    let folder = Folder::new("frames");
    let event = "\n[[simulation.event]]\nkind = \"lose_power\"\nat_s = 2.0\ndrive = \"wheel_2\"\n";
    let robot = folder.file("robot.toml", &(bmm() + event));
    let run = |robot: &str, name: &str| {
        let kept = folder.path(name);
        let (_, said) =
            refused(&[&["run", robot], &CIRCLE[2..], &["--frames", &kept, "--frames-s", "1"]].concat());
        (kept, said)
    };
    let (kept, said) = run("robots/bmm.toml", "well.pcapng");
    assert!(said.contains("--frames: nothing went wrong, nothing was written"), "{said}");
    assert!(!std::path::Path::new(&kept).exists());
    let (kept, said) = run(&robot, "wrong.pcapng");
    assert!(said.contains(&format!("--frames: {kept}: datagram 2: working counter 1 behind 3")), "{said}");
    let summary = &json(&["decode", &kept, "--json", "--summary"])["summary"];
    let requests = number(&summary["requests"]);
    assert_eq!((&summary["lost_frames"], &summary["malformed"]), (&0.into(), &0.into()), "{summary}");
    // A second before and one behind, with what the bus asks the lost drive meanwhile.
    assert!((1000.0..3500.0).contains(&requests), "{requests} frames sent");
    let of_inputs =
        summary["working_counters"].as_array().unwrap().iter().find(|one| one["command"] == "LRD");
    let counters = &of_inputs.unwrap()["counters"];
    let [whole, broken] = ["3", "1"].map(|counter| number(&counters[counter]));
    assert!((900.0..1100.0).contains(&whole) && (900.0..1100.0).contains(&broken), "{counters}");
    // Frames tell nothing of a drive's fault: the run does, at its end, behind its recording.
    let event = "\n[[simulation.event]]\nkind = \"drive_fault\"\nat_s = 2.0\ndrive = \"wheel_1\"\nerror_code = 0x7500\n";
    let robot = folder.file("fault.toml", &(bmm() + event));
    for number in 0..4 {
        let [kept, recording] = ["pcapng", "mcap"].map(|end| folder.path(&format!("fault-{number}.{end}")));
        let more = ["--frames", &kept, "--frames-s", "1", "--record", &recording];
        let (code, said) = refused(&[&["run", &robot], &CIRCLE[2..], &more].concat());
        assert_eq!(code, Some(1), "{said}");
        assert!(
            said.contains(&format!(
                "--frames: {kept}: no frame shows it; what went wrong is in the run's own messages"
            )),
            "{said}"
        );
    }
}

#[test]
fn the_square_of_the_thesis_is_told_in_one_json_object() {
    let summary = json(&[&SQUARE[..], &["--json"]].concat());
    let wanted = [
        "final_error_m",
        "rms_error_m",
        "max_error_m",
        "final_heading_error_rad",
        "cycles",
        "lost_frames",
        "overruns",
        "records_written",
        "records_dropped",
        "realtime_factor",
        "events",
    ];
    // Others may stand beside them.
    let found = keys(&summary);
    assert!(wanted.iter().all(|key| found.contains(key)), "{found:?}");
    for key in ["final_error_m", "rms_error_m", "max_error_m"] {
        assert_eq!(keys(&summary[key]), ["believed", "true"], "{key}");
    }
    let figure = |key: &str, whose: &str| number(&summary[key][whose]);
    // What is asked: 0.5 mm believed, 3 mm true at the end, with default friction and slip.
    assert!(figure("rms_error_m", "believed") <= 5e-4 && figure("rms_error_m", "believed") > 0.0);
    assert!(figure("final_error_m", "true") <= 3e-3 && figure("final_error_m", "true") > 0.0);
    assert!(figure("max_error_m", "true") >= figure("rms_error_m", "true"));
    assert!(number(&summary["final_heading_error_rad"]).abs() < 2e-3);
    // 20 s of path and the second of the hold at 1 kHz.
    assert!((21_000..21_200).contains(&summary["cycles"].as_u64().unwrap()), "{}", summary["cycles"]);
    assert_eq!([&summary["lost_frames"], &summary["overruns"]], [0, 0]);
    assert_eq!([&summary["records_written"], &summary["records_dropped"]], [0, 0]);
    assert!(number(&summary["realtime_factor"]) > 0.0);
    let events = summary["events"].as_array().unwrap();
    let texts: Vec<&str> = events.iter().map(|event| event["text"].as_str().unwrap()).collect();
    let order = ["enabling the drives", "holding", "tracking the reference", "holding", "drives disabled"];
    let mut rest = texts.iter();
    assert!(order.iter().all(|text| rest.any(|found| found == text)), "{texts:?}");
    let times: Vec<f64> = events.iter().map(|event| number(&event["time_s"])).collect();
    assert!(times.is_sorted(), "{times:?}");
}

#[test]
fn the_square_as_text_has_its_figures_with_units() {
    let text = prints(&SQUARE);
    let row = |name: &str| -> Vec<String> {
        let line = text.lines().find(|line| line.trim_start().starts_with(name));
        let line = line.unwrap_or_else(|| panic!("{name} in {text}"));
        line.trim_start()[name.len()..].split_whitespace().map(str::to_owned).collect()
    };
    for name in ["final ", "RMS", "greatest"] {
        let row = row(name);
        assert_eq!((row.len(), row[1].as_str(), row[3].as_str()), (4, "mm", "mm"), "{row:?}");
        assert!(row[0].parse::<f64>().unwrap() < row[2].parse::<f64>().unwrap(), "slip is not seen: {row:?}");
    }
    assert_eq!(row("final heading error")[1], "mrad");
    assert_eq!(row("lost frames"), ["0"]);
    assert!(row("cycles")[0].parse::<u64>().unwrap() >= 21_000);
    assert!(text.contains(" s  tracking the reference"), "{text}");
}

#[test]
fn the_same_input_gives_the_same_bytes_and_a_replay_the_same_bits() {
    let folder = Folder::new("robot-same");
    let further = ["--controller", "adaptive_torque", "--payload-kg", "100", "--json"];
    let record = |name: &str| {
        let (mcap, columns) = (folder.path(&format!("{name}.mcap")), folder.path(&format!("{name}.txt")));
        let files = ["--record", mcap.as_str(), "--columns", columns.as_str()];
        let summary = json(&[&CIRCLE[..], &further[..], &files[..]].concat());
        assert_eq!(summary["records_written"], summary["cycles"], "{summary}");
        assert_eq!(summary["records_dropped"], 0, "{summary}");
        (mcap, std::fs::read(columns).unwrap(), summary["cycles"].as_u64().unwrap())
    };
    let (first, first_columns, cycles) = record("first");
    let (second, second_columns, _) = record("second");
    // Not `assert_eq`: nobody reads megabytes.
    assert!(first_columns == second_columns, "the column files differ");
    // The MCAP's last words tell how fast the host was, which is the one thing that differs.
    let raw = |path: &str| {
        let run = omnibase_record::run::RecordedRun::read(&std::fs::read(path).unwrap()).unwrap();
        assert!(run.truncated.is_none());
        (run.times_ns, run.raw)
    };
    assert!(raw(&first) == raw(&second), "the recordings differ");

    assert_eq!(
        prints(&["replay", &first]).trim(),
        format!("{cycles} cycles computed again, the same to the bit")
    );
    let told = json(&["replay", &first, "--json"]);
    assert_eq!((&told["cycles"], &told["same"]), (&Value::from(cycles), &Value::from(true)));
    assert!(told["difference"].is_null(), "{told}");
}

#[test]
fn a_replay_of_a_part_is_no_success_unless_it_was_asked_for() {
    let folder = Folder::new("robot-part");
    let path = folder.path("run.mcap");
    let summary = json(&[&CIRCLE[..], &["--record", &path, "--json"]].concat());
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let replay = |further: &[&str]| {
        let output = omnibase(&[&["replay", &path, "--json"], further].concat());
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), told, String::from_utf8(output.stderr).unwrap())
    };
    let (code, told, says) = replay(&[]);
    assert_eq!((code, &told["same"]), (Some(1), &Value::from(true)), "{told}");
    let cycles = told["cycles"].as_u64().unwrap();
    assert!(cycles > 0 && cycles < summary["cycles"].as_u64().unwrap(), "{told}");
    // Cycles of 1 ms from 0 on.
    let until_s = told["ends_early"]["until_s"].as_f64().unwrap();
    assert!((until_s - (cycles - 1) as f64 * 1e-3).abs() < 1e-9, "{told}");
    assert!(says.contains("ends early") && says.contains("--partial"), "{says}");
    assert!(says.contains(&format!("there are {cycles} cycles, up to {until_s:.3} s")), "{says}");
    let (code, partly, says) = replay(&["--partial"]);
    assert_eq!((code, &partly), (Some(0), &told));
    assert!(says.contains(&format!("up to {until_s:.3} s")), "{says}");
    // Of a whole one nothing is missing.
    std::fs::write(&path, &bytes).unwrap();
    let (code, told, says) = replay(&[]);
    assert_eq!((code, &told["cycles"], &told["ends_early"]), (Some(0), &summary["cycles"], &Value::Null));
    assert_eq!(says, "");
}

#[test]
fn a_run_without_an_end_is_refused() {
    let folder = Folder::new("robot-endless");
    let far = folder.file("far.dat", "0 0 0 0\n1e18 1 0 0\n");
    for motion in [["--circle", "radius_m=0.3,duration_s=1e18"], ["--path", &far]] {
        let (code, says) = refused(&[&["run", "robots/bmm.toml"], &motion[..]].concat());
        assert_eq!(code, Some(1), "{says}");
        assert!(says.contains("1000000 s") && says.contains("1000000000000000000 s"), "{says}");
    }
}

#[test]
fn a_recording_or_page_that_is_no_file_is_refused_before_the_run() {
    let folder = Folder::new("robot-pipe");
    let pipe = folder.path("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for option in ["--record", "--columns", "--report"] {
        let (code, says) = refused(&[&CIRCLE[..], &[option, &pipe]].concat());
        assert_eq!(code, Some(1), "{says}");
        assert!(says.contains(&pipe) && says.contains("expected a regular file"), "{option}: {says}");
        assert!(!says.contains("tracking"), "{says}");
    }
    let (code, says) = refused(&["exchange", "sim:segments/three-servos.toml", "--record", &pipe]);
    assert!(code == Some(1) && says.contains("expected a regular file"), "{says}");
}

#[test]
fn a_replay_of_what_is_no_recording_is_refused() {
    let (code, says) = refused(&["replay", "robots/bmm.toml"]);
    assert_eq!(code, Some(1), "{says}");
    assert!(says.contains("robots/bmm.toml") && says.contains("not MCAP"), "{says}");
    let (code, says) = refused(&["replay", "no-such.mcap"]);
    assert!(code == Some(1) && says.contains("no-such.mcap"), "{says}");
}

#[test]
fn missing_limits_are_refused_before_anything_moves() {
    let folder = Folder::new("robot-limits");
    let text: String = bmm()
        .lines()
        .filter(|line| !line.starts_with("wheel_speed_rad_s"))
        .map(|line| format!("{line}\n"))
        .collect();
    let file = folder.file("robot.toml", &text);
    let (code, says) = refused(&["run", &file, "--circle", "radius_m=0.5"]);
    assert_eq!(code, Some(1), "{says}");
    assert!(says.contains("wheel_speed_rad_s") && says.contains("must be given"), "{says}");
}

#[test]
fn wrong_words_on_the_command_line_are_refused_in_words() {
    let folder = Folder::new("robot-words");
    let letters = folder.file("letters.dat", "(0, 0, 0, 0)\n(1, 2, x, 0)\n");
    let fast = folder.file("fast.dat", "(0, 0, 0, 0)\n(1, 2, 0, 0)\n");
    let robot = "robots/bmm.toml";
    for (arguments, code, what) in [
        (vec!["run", robot], 1, "nothing to follow"),
        (vec!["run", robot, "--path", &letters], 1, "line 2, column 8: expected a number (y), found \"x\""),
        (vec!["run", robot, "--path", &fast], 1, "the limit is 1 m/s; it needs 3.000 s"),
        (vec!["run", robot, "--path", &fast], 1, "fast.dat\": "),
        (vec!["run", robot, "--path", "no-such.dat"], 1, "no-such.dat"),
        (
            vec!["run", robot, "--joystick", "/dev/input/event99"],
            1,
            "event99: No such file or directory (os error 2)\n",
        ),
        (
            vec!["run", robot, "--circle", "step_m=1"],
            2,
            "--circle takes radius_m, duration_s, period_s, turns",
        ),
        (
            vec!["run", robot, "--circle", "radius_m=0.5", "--controller", "open_lop"],
            1,
            "did you mean `open_loop`?",
        ),
        (
            vec!["run", robot, "--circle", "radius_m=0.5", "--set", "limits.speed_m_s"],
            2,
            "expected key=value",
        ),
        (vec!["run", robot, "--circle", "radius_m=0.5", "--path", &fast], 2, "cannot be used with"),
        (vec!["run", robot, "--circle", "radius=0.5"], 2, "did you mean `radius_m`?"),
        (
            vec!["run", robot, "--circle", "radius_m=0.5,turns=always"],
            2,
            "turns = \"always\": no choice has this name",
        ),
        (
            vec!["run", robot, "--circle", "radius_m=0.5,duration_s=9,period_s=9"],
            1,
            "period_s: `duration_s` says the time of the whole motion already",
        ),
        (
            vec!["run", robot, "--circle", "radius_m=0.5,duration_s=9,turns=endless"],
            1,
            "give the time of one turn, `period_s`",
        ),
        (
            vec!["run", robot, "--circle", "radius_m=0.5,period_s=1,turns=2"],
            1,
            "period_s: the trajectory's end cannot be reached in 1.000 s",
        ),
        (
            vec!["run", robot, "--holonomic", "radius_m=0.5,frame=platform,turns=endless"],
            1,
            "a motion in the platform's axes has an end",
        ),
        (vec!["run", "--circle", "radius_m=0.5"], 2, "<ROBOT>"),
        (vec!["run", "no-such.toml", "--circle", "radius_m=0.5"], 1, "no-such.toml"),
        (vec!["check"], 2, "<ROBOT>"),
        (vec!["kinematics", robot], 2, "--twist"),
        (vec!["kinematics", robot, "--twist", "1 0"], 2, "expected 3 finite numbers, found 2 words"),
        (vec!["kinematics", robot, "--twist", "1 0 nan"], 2, "expected 3 finite numbers"),
        (vec!["kinematics", robot, "--wheels", "1 1 1 1"], 2, "expected 3 finite numbers, found 4 words"),
    ] {
        let (found, says) = refused(&arguments);
        assert_eq!(found, Some(code), "{arguments:?}: {says}");
        assert!(says.contains(what), "{arguments:?}: {what} in {says}");
    }
}

#[test]
fn a_path_out_of_the_fence_ends_with_that_reason() {
    let folder = Folder::new("robot-fenced");
    let fence = "\n[fence]\nrectangle_m = [-1, -1, 1.5, 1]\n";
    let file = folder
        .file("robot.toml", &(std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap() + fence));
    let path = folder.file("out.dat", "(0, 0, 0, 0)\n(5, 2, 0, 0)\n");
    let (code, says) = refused(&["run", &file, "--path", &path]);
    assert!(code == Some(1) && says.contains("the way led out of the fence"), "{says}");
}

#[test]
fn a_run_that_never_came_to_its_path_prints_no_errors_of_it() {
    let failed = "simulation.event=[{kind=\"drive_fault\",at_s=0.002,drive=\"wheel_1\",error_code=8976}]";
    let run = ["run", "robots/bmm.toml", "--circle", "radius_m=0.3,duration_s=8", "--set", failed];
    let (code, text) = refused(&run);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("events\n") && text.contains("a drive failed"), "{text}");
    assert!(!text.contains("tracking error") && !text.contains(" -\n"), "{text}");
}

#[test]
fn a_way_that_is_blocked_ends_with_that_reason() {
    let folder = Folder::new("robot-blocked");
    let robot = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    let path = folder.file("ahead.dat", "(0, 0, 0, 0)\n(8, 3, 0, 0)\n");
    let row = |x: f64| -> String {
        let one = |y: f64| format!("[[obstacle]]\ncentre_m = [{x:?}, {y:?}]\nradius_m = 0.2\n");
        [-0.8, -0.4, 0.0, 0.4, 0.8].map(one).concat()
    };
    // At the path's end, and as a row across a corridor that it leads through.
    let corridor = "\n[fence]\nrectangle_m = [-1, -1, 5, 1]\n";
    for obstacles in [row(3.0), format!("{corridor}{}", row(1.6))] {
        let file = folder.file("robot.toml", &format!("{robot}\n{obstacles}"));
        let (code, says) = refused(&["run", &file, "--path", &path]);
        assert!(code == Some(1) && says.contains("the way is blocked"), "{code:?} {says}");
    }
}

#[test]
fn kinematics_go_both_ways_as_text_and_json() {
    let robot = "robots/bmm.toml";
    let there = json(&["kinematics", robot, "--twist", "0.5 -0.1 0.2", "--json"]);
    assert_eq!(keys(&there), ["wheel_speeds_rad_s"]);
    let speeds = &there["wheel_speeds_rad_s"];
    assert_eq!(keys(speeds), ["wheel_1", "wheel_2", "wheel_3"]);
    // R·omega = B·xi with the B of the BMM: [0, 1, -p1], [-√3/2, -1/2, -p], [√3/2, -1/2, -p]; R 0.10, p1 0.38, p 0.40.
    let half_root = 3_f64.sqrt() / 2.0;
    let wanted = [-0.1 - 0.076, -half_root * 0.5 + 0.05 - 0.08, half_root * 0.5 + 0.05 - 0.08];
    for (name, wanted) in ["wheel_1", "wheel_2", "wheel_3"].iter().zip(wanted) {
        // Rounding alone.
        assert!((number(&speeds[name]) - wanted / 0.10).abs() < 1e-12, "{name}: {speeds}");
    }
    let list = ["wheel_1", "wheel_2", "wheel_3"].map(|name| speeds[name].to_string()).join(" ");
    let back = json(&["kinematics", robot, "--wheels", &list, "--json"]);
    assert_eq!(keys(&back), ["residual_m_s", "twist"]);
    for (key, wanted) in [("vx_m_s", 0.5), ("vy_m_s", -0.1), ("w_rad_s", 0.2)] {
        assert!((number(&back["twist"][key]) - wanted).abs() < 1e-12, "{back}");
    }
    assert!(number(&back["residual_m_s"]).abs() < 1e-12);
    // Four wheels that disagree: the residual says so.
    let slip = json(&["kinematics", "robots/mecanum.toml", "--wheels", "1 1 1 2", "--json"]);
    assert!(number(&slip["residual_m_s"]) > 0.01, "{slip}");
    let text = prints(&["kinematics", robot, "--wheels", "1 1 1"]);
    // Three equal speeds turn the BMM clockwise: -R·3/(p1 + 2p).
    let turn = text.lines().find(|line| line.starts_with("w ")).expect("a line");
    assert_eq!(turn.split_whitespace().collect::<Vec<_>>(), ["w", "-0.254237", "rad/s"]);
    let text = prints(&["kinematics", robot, "--twist", "0 0 1"]);
    assert!(text.contains("wheel_1") && text.contains("-3.800000 rad/s"), "{text}");
}

#[test]
fn a_motion_without_an_end_goes_on_until_it_is_stopped() {
    let folder = Folder::new("robot-motion-without-end");
    let recording = folder.path("run.mcap");
    let mut run = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["run", "robots/bmm.toml", "--circle", "radius_m=0.3,period_s=8,turns=endless", "--json"])
        .args(["--record", &recording])
        .current_dir(root())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Some turns, on virtual time.
    while std::fs::metadata(&recording).map_or(0, |file| file.len()) < 25_000_000 {
        assert!(run.try_wait().unwrap().is_none(), "it goes on");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap().success());
    let ended = run.wait_with_output().unwrap();
    let says = String::from_utf8(ended.stderr).unwrap();
    let words = ["has no end", "faster than it would be", "Ctrl-C", "--limit-mb and --files"];
    assert!(words.iter().all(|word| says.contains(word)), "{says}");
    let summary: Value = serde_json::from_slice(&ended.stdout).unwrap();
    assert!(summary["cycles"].as_u64().unwrap() > 16_000, "two turns and more: {}", summary["cycles"]);
    assert!(summary["events"].to_string().contains("a stop was asked for"), "{}", summary["events"]);
    assert!(summary["max_error_m"]["believed"].as_f64().unwrap() < 0.005, "{}", summary["max_error_m"]);
    let replayed = omnibase(&["replay", &recording]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
}

#[test]
fn small_terminals_share_no_byte() {
    let folder = Folder::new("robot-small-terminals");
    let terminal = |position: usize, name: &str, on: u8| {
        format!(
            "\n[[device]]\nname = \"{name}\"\nposition = {position}\nkind = \"io\"\n\
             inputs = [{{ pdo = \"0x1A00\", map = \"6000.1:1 6000.2:1 6000.3:1 6000.4:1\" }}]\n\
             input = [{{ name = \"on\", object = \"6000.1\", simulated = {on} }}]\n"
        )
    };
    for (first, second, code) in [(1, 0, 1), (0, 1, 0)] {
        let text = bmm() + &terminal(3, "first", first) + &terminal(4, "second", second);
        let robot = folder.file("robot.toml", &text);
        let circle = ["--circle", "radius_m=0.2,duration_s=5", "--set", "safety.enable_input=second.on"];
        let run = omnibase(&[&["run", &robot], &circle[..]].concat());
        assert_eq!(
            run.status.code(),
            Some(code),
            "{first} {second}: {}",
            String::from_utf8_lossy(&run.stderr)
        );
    }
}
