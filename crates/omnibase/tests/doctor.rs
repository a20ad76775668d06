//! `omnibase doctor` on whatever machine this is, and on a virtual cable whose settings can be changed.

use omnibase_host::Namespace;
use serde_json::Value;
use std::os::unix::process::CommandExt;
use std::process::{Command, Output};

fn doctor(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .arg("doctor")
        .args(arguments)
        .args(["--pauses-s", "0"])
        .output()
        .unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = doctor(arguments);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn every_finding_has_its_reason_and_the_exit_code_is_the_verdict() {
    let output = doctor(&["--json"]);
    let page: Value = serde_json::from_slice(&output.stdout).unwrap();
    let findings = page["findings"].as_array().unwrap();
    assert!(findings.len() >= 10, "{page:#}");
    for finding in findings {
        for key in ["check", "verdict", "found", "why"] {
            assert!(finding[key].as_str().is_some_and(|text| !text.is_empty()), "{key} in {finding:#}");
        }
        let is_wrong = matches!(finding["verdict"].as_str(), Some("degraded" | "bad"));
        assert!(!is_wrong || finding["mend"].is_string(), "what mends it? {finding:#}");
    }
    assert_eq!(output.status.code(), Some(i32::from(page["verdict"] == "bad")));
    let text = doctor(&[]);
    let text = String::from_utf8_lossy(&text.stdout);
    assert!(text.contains("clock source") && text.contains(" good, "), "{text}");
}

#[test]
fn an_interface_that_is_not_there_is_bad() {
    let output = doctor(&["nope0"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("no network interface `nope0`; there are: "), "{text}");
}

#[test]
fn without_root_fix_is_refused_and_changes_nothing() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    command.args(["doctor", "eth7", "--fix"]);
    if omnibase_host::is_root() {
        // Nobody.
        command.uid(65534).gid(65534);
    }
    let output = match command.output() {
        Ok(output) => output,
        Err(error) => {
            eprintln!(
                "SKIPPED: without_root_fix_is_refused: as nobody the program can't be started: {error}"
            );
            return;
        }
    };
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(error.contains("only root") && error.contains("sudo omnibase doctor eth7 --fix"), "{error}");
    assert!(output.stdout.is_empty());
}

/// The settings of the machine itself are left alone: a test must not change them. The cable is the test's own.
#[test]
fn settings_of_a_cable_are_found() {
    let Some(namespace) = Namespace::for_test("settings_of_a_cable_are_found") else { return };
    namespace.run(|| {
        let page = json(&[Namespace::NEAR, "--json"]);
        let finding = |check: &str| {
            let findings = page["findings"].as_array().unwrap();
            findings.iter().find(|finding| finding["check"] == check).unwrap().clone()
        };
        assert_eq!(finding("network driver")["verdict"], "degraded");
        assert!(finding("network driver")["found"].as_str().unwrap().contains("`veth`"));
        assert_eq!(finding("other traffic")["verdict"], "good");
        assert!(finding("offloads")["found"].as_str().unwrap().contains("gro"));
    });
}
