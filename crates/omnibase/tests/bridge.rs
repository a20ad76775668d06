//! Programs beside a robot: started with it, started again, ended with it.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const LONGEST: Duration = Duration::from_secs(60);

/// A bridge that writes down that it runs, for which robot, and what it was told.
const BRIDGE: &str = r#"#!/bin/sh
echo "$$ $1 $OMNIBASE_ROBOT" >> "$(dirname "$0")/runs.txt"
exec sleep 1000
"#;

fn program(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// The lines that the bridge wrote.
fn runs(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("runs.txt")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn wait(what: &str, holds: impl Fn() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < LONGEST, "never: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn pid(line: &str) -> u32 {
    line.split(' ').next().unwrap().parse().unwrap()
}

fn lives(pid: u32) -> bool {
    let state = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    !state.is_empty() && !state.contains(") Z ")
}

fn kill(signal: &str, pid: u32) {
    assert!(Command::new("kill").args([signal, &pid.to_string()]).status().unwrap().success());
}

/// A simulated robot with a bridge, reached by a socket alone.
fn robot(folder: &Path) -> Child {
    let usual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    let file = folder.join("robot.toml");
    let more =
        "\n[bridge.mine]\nprogram = \"./bridge\"\narguments = [\"told\"]\n\n[bridge.not]\nenabled = false\n";
    std::fs::write(&file, std::fs::read_to_string(usual).unwrap() + more).unwrap();
    Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["run", file.to_str().unwrap(), "--json"])
        .env("XDG_RUNTIME_DIR", folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_bridge_is_started_again_and_ends_with_its_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    program(&folder.join("bridge"), BRIDGE);
    let mut run = robot(folder);
    wait("the bridge runs", || runs(folder).len() == 1);
    let first = runs(folder)[0].clone();
    assert!(first.contains(" told {\"robot\":\"bmm\",\"socket\":\""), "{first}");
    // It dies twice; the robot goes on.
    for n in 1..3 {
        kill("-KILL", pid(&runs(folder)[n - 1]));
        wait("it runs again", || runs(folder).len() == n + 1);
    }
    assert!(run.try_wait().unwrap().is_none());
    // The run itself starts nothing while the robot moves: who keeps the bridge is another process.
    let parent = |pid: u32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap();
        stat.rsplit_once(") ").unwrap().1.split(' ').nth(1).unwrap().parse::<u32>().unwrap()
    };
    let keeper = parent(pid(&runs(folder)[2]));
    assert!(keeper != run.id() && parent(keeper) == run.id());
    let last = pid(&runs(folder)[2]);
    assert!(lives(last) && !lives(pid(&first)));
    kill("-INT", run.id());
    assert!(run.wait().unwrap().success());
    wait("the bridge is gone", || !lives(last));
    // A run that is killed leaves none behind either.
    std::fs::remove_file(folder.join("runs.txt")).unwrap();
    let mut run = robot(folder);
    wait("the bridge runs", || runs(folder).len() == 1);
    run.kill().unwrap();
    run.wait().unwrap();
    wait("the bridge is gone", || !lives(pid(&runs(folder)[0])));
}

#[test]
fn a_bridge_by_hand_is_found_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let omnibase = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(["bridge", name, "--told", "so"]).env("PATH", folder.path());
        command.output().unwrap()
    };
    let missing = omnibase("nobodys");
    let said = String::from_utf8_lossy(&missing.stderr);
    assert_eq!(missing.status.code(), Some(1));
    assert!(
        said.contains("there is no bridge `nobodys`: no program `omnibase-bridge-nobodys` in "),
        "{said}"
    );
    assert!(said.contains(folder.path().to_str().unwrap()), "{said}");
    // It gets all that is behind its name, and its exit code says whether to try again.
    for (code, expected) in [(0, 0), (2, 2)] {
        let text = format!("#!/bin/sh\n[ \"$1 $2\" = \"--told so\" ] && exit {code}\nexit 2\n");
        program(&folder.path().join("omnibase-bridge-mine"), &text);
        assert_eq!(omnibase("mine").status.code(), Some(expected), "{code}");
    }
}

#[test]
fn mistakes_about_bridges_are_told_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    let usual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
    let said = |command: &str, more: &str| {
        std::fs::write(&file, std::fs::read_to_string(usual).unwrap() + more).unwrap();
        let mut omnibase = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        let output = omnibase.args([command, file.to_str().unwrap()]).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned()
    };
    let wrong = "\n[bridge.\"a b\"]\n[bridge.x]\nprogram = \"\"\n[bridge.y]\nargment = []\n";
    let said_of_check = said("check", wrong);
    for words in ["bridge.a b", "letters, digits", "bridge.x.program", "did you mean `arguments`?"] {
        assert!(said_of_check.contains(words), "{words}: {said_of_check}");
    }
    let missing = said("run", "\n[bridge.nobodys]\n");
    assert!(missing.contains("there is no bridge `nobodys`"), "{missing}");
    let missing = said("run", "\n[bridge.x]\nprogram = \"./nothing\"\n");
    assert!(missing.contains("[bridge.x] program: there is no "), "{missing}");
}

#[test]
fn what_a_bridge_says_is_printed_as_grave_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let bridge = folder.path().join("bridge");
    program(
        &bridge,
        "#!/bin/sh\nfor line in 'it runs' 'warning: look' 'error: lost'; do echo \"$line\" >&2; done\n",
    );
    for (level, expected) in [
        ("info", "it runs\nwarning: look\nerror: lost\n"),
        ("warning", "warning: look\nerror: lost\n"),
        ("error", "error: lost\n"),
    ] {
        let ran = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["bridge", "--log-level", level, "--program", bridge.to_str().unwrap(), "mine"])
            .output()
            .unwrap();
        assert_eq!(String::from_utf8_lossy(&ran.stderr), expected, "{level}");
    }
}
