//! `omnibase margins` as a user runs it.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const BMM: [&str; 2] = ["margins", "robots/bmm.toml"];
const MECANUM: [&str; 6] = [
    "margins",
    "robots/mecanum.toml",
    "--set",
    "controller.mass_kg=60",
    "--set",
    "controller.inertia_kg_m2=4",
];

fn omnibase(arguments: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    command.args(arguments).current_dir(root).stdin(Stdio::null()).output().unwrap()
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn both_robots_keep_6_db_and_30_degrees_on_every_axis() {
    for robot in [&BMM[..], &MECANUM] {
        let output = omnibase(&[robot, &["--json"]].concat());
        assert!(output.status.success(), "{}", words(&output.stderr));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(told["suffices"], true, "{told}");
        assert_eq!(told["known"]["tread_stiffness_n_m"]["from_file"], false, "{told}");
        let axes = told["axes"].as_array().unwrap();
        let names: Vec<&str> = axes.iter().filter_map(|axis| axis["axis"].as_str()).collect();
        assert_eq!(names, ["x", "y", "heading"]);
        for axis in axes {
            let margins = axis["margins"].as_array().unwrap();
            // Fourteen stiffnesses (1.6 decades) by four ratios of damping, and none is worse than the worst.
            assert_eq!(margins.len(), 56);
            let worst = &axis["worst"];
            assert!(number(&worst["gain_db"]) >= 6.0 && number(&worst["phase_deg"]) >= 30.0, "{worst}");
            for one in margins {
                assert!(number(&one["gain_db"]) >= number(&worst["gain_db"]), "{one} {worst}");
                assert!(number(&one["sensitivity"]) <= number(&worst["sensitivity"]), "{one} {worst}");
            }
        }
        let [damping, kp, error] =
            ["damping_n_s_m", "kp_1_s", "mm_per_n"].map(|key| number(&axes[0]["gains"][key]));
        assert!((error * damping * kp - 1000.0).abs() < 1e-6, "{told}");
        // A tread that is known to be stiff and damped is held more stiffly than one that may be anything.
        let declared = |row: usize| number(&axes[0]["declared_treads"][row]["gains"]["mm_per_n"]);
        assert!(declared(5) < declared(0), "{told}");
    }
}

#[test]
fn words_say_what_the_file_gives_and_the_picture_draws_each_damping() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("margins.svg");
    let picture_name = picture.to_str().unwrap();
    std::fs::write(&picture, "of before").unwrap();
    let declared = ["--set", "controller.tread_damping_ratio=0.3", "--plot", picture_name];
    let output = omnibase(&[&BMM[..], &declared].concat());
    assert!(output.status.success(), "{}", words(&output.stderr));
    let text = words(&output.stdout);
    for line in [
        "damping           at least 0.3 of the critical (from the file)",
        "tread             1.0e5 to 4.0e6 N/m a wheel (assumed)",
        "23.333 to 210.000 kg (assumed: a third to three times the file's)",
        "suffices (6 dB, 30°)",
        "what a declared tread buys",
    ] {
        assert!(text.contains(line), "{line} in {text}");
    }
    let svg = std::fs::read_to_string(&picture).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{svg}");
    // Gain and phase of three axes, three ratios of damping each.
    assert_eq!(svg.matches("<polyline").count(), 2 * 3 * 3);
}

#[test]
fn what_nothing_can_be_designed_of_is_refused_in_words() {
    let unsafe_gain = ["--set", "controller.damping_n_s_m=1e5"];
    for (arguments, what) in [
        (vec!["margins", "robots/mecanum.toml"], "[controller] gives no mass_kg and no inertia_kg_m2"),
        ([&BMM[..], &unsafe_gain].concat(), "damping_n_s_m"),
    ] {
        let output = omnibase(&arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let says = words(&output.stderr);
        assert!(says.contains(what), "{what} in {says}");
    }
    let help = words(&omnibase(&["margins", "--help"]).stdout);
    assert!(help.contains("Examples:"), "{help}");
}
