//! A person at a terminal sets a robot up: the real program behind a pseudo-terminal, its keys as a keyboard sends them.
//!
//! `script` (util-linux) holds the terminal. Nothing here depends on how fast the machine is: what must not happen is looked for in
//! the program's own record, and what must happen is waited for.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A keyboard's repeats.
const REPEAT: Duration = Duration::from_millis(30);
/// Whoever says nothing for so long is stuck.
const STUCK: Duration = Duration::from_secs(120);

struct Terminal {
    script: Child,
    keyboard: ChildStdin,
    screen: Arc<Mutex<String>>,
    /// What of the screen was read.
    read: usize,
}

impl Terminal {
    fn new(output: &Path) -> Self {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        // As under nohup: a terminal that is gone doesn't end it by a signal.
        let command = format!(
            "trap '' HUP; exec {} setup sim:{root}/segments/three-servos.toml --robot {root}/robots/bmm.toml -o {}",
            env!("CARGO_BIN_EXE_omnibase"),
            output.display()
        );
        let mut script = Command::new("script")
            .args(["-q", "-f", "-e", "-c", &command, "/dev/null"])
            .env("TERM", "xterm")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("`script` of util-linux");
        let screen: Arc<Mutex<String>> = Arc::default();
        let (mut shown, seen) = (script.stdout.take().unwrap(), Arc::clone(&screen));
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(length @ 1..) = shown.read(&mut bytes) {
                seen.lock().unwrap().push_str(&String::from_utf8_lossy(&bytes[..length]));
            }
        });
        let keyboard = script.stdin.take().unwrap();
        Terminal { script, keyboard, screen, read: 0 }
    }

    /// One in which its servos, another product than the file has, are gone on with.
    fn begun(output: &Path) -> Self {
        let mut terminal = Terminal::new(output);
        terminal.wait(&["or go on with these drives?"], |_| {});
        terminal.press("go on\r");
        terminal
    }

    /// Whether one of these words came since the last that was waited for.
    fn seen(&mut self, words: &[&str]) -> Option<String> {
        let screen = self.screen.lock().unwrap();
        let found = words.iter().filter_map(|word| Some((screen[self.read..].find(word)?, *word)));
        let (at, word) = found.min()?;
        self.read += at + word.len();
        Some(word.to_owned())
    }

    /// Waits for one of these words; `beside` is done meanwhile.
    fn wait(&mut self, words: &[&str], mut beside: impl FnMut(&mut ChildStdin)) -> String {
        let begun = Instant::now();
        loop {
            if let Some(word) = self.seen(words) {
                return word;
            }
            assert!(begun.elapsed() < STUCK, "{words:?} never came:\n{}", self.screen.lock().unwrap());
            beside(&mut self.keyboard);
            std::thread::sleep(REPEAT);
        }
    }

    fn press(&mut self, keys: &str) {
        self.keyboard.write_all(keys.as_bytes()).unwrap();
    }
}

fn hold(keyboard: &mut ChildStdin) {
    // A program that has ended takes no key, and what it said may not be on the screen yet.
    let _ = keyboard.write_all(b" ");
}

/// How each jog ended, for how many cycles the drive was enabled, and how many set points left without a held key.
fn jogs(output: &Path) -> Vec<(String, u64, u64)> {
    let state = std::fs::read_to_string(output.with_extension("state.json")).unwrap();
    let state: serde_json::Value = serde_json::from_str(&state).unwrap();
    let log = state["log"].as_array().unwrap().iter().filter_map(|line| line.as_str());
    let number = |line: &str, before: &str| {
        let (head, _) = line.split_once(before).unwrap();
        head.rsplit(' ').next().unwrap().parse().unwrap()
    };
    log.filter(|line| line.contains("without a held key"))
        .map(|line| (line.to_owned(), number(line, " cycles, "), number(line, " without a held key")))
        .collect()
}

/// The program that writes this file; `script` around it isn't it.
fn running(output: &Path) -> Option<String> {
    let output = output.to_str().unwrap();
    let mut all = std::fs::read_dir("/proc").unwrap().map_while(Result::ok);
    let is_it = |one: &std::fs::DirEntry| {
        let said = std::fs::read(one.path().join("cmdline")).unwrap_or_default();
        said.starts_with(env!("CARGO_BIN_EXE_omnibase").as_bytes())
            && String::from_utf8_lossy(&said).contains(output)
    };
    all.find(is_it).map(|one| one.file_name().to_string_lossy().into_owned())
}

#[test]
fn a_drive_turns_while_the_space_bar_is_held_and_no_other_key_moves_it() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let mut terminal = Terminal::begun(&output);
    terminal.wait(&["hold the key: SubDevice 0 turns"], |_| {});

    // Other keys, Enter, and the bar once with another key behind it: nothing is enabled.
    terminal.press("xyz\r \rq");
    std::thread::sleep(Duration::from_secs(1));
    assert!(jogs(&output).is_empty(), "{:?}", jogs(&output));
    // Held by repeats until the drive was enabled for a while, then another key; again where the machine was too slow for a keyboard.
    let choice = "jog it again, or leave it out";
    let mut has_turned = false;
    for _ in 0..20 {
        let begun = Instant::now();
        let asked = terminal.wait(&["which wheel turned", choice], |keyboard| {
            if begun.elapsed() < Duration::from_secs(3) {
                hold(keyboard);
            } else {
                keyboard.write_all(b"x").unwrap();
            }
        });
        let was_enabled = jogs(&output).iter().any(|(_, enabled, _)| *enabled > 0);
        has_turned = was_enabled && asked != choice;
        if has_turned {
            // Enter alone is no answer where there is a choice. What was typed while the drive turned is none either.
            terminal.press("\n");
            terminal.wait(&["expected one of"], |_| {});
            break;
        }
        // Keys that are left over from holding are refused as an answer first.
        terminal.press("\nagain\n");
        terminal.wait(&["hold the key"], |_| {});
    }
    assert!(has_turned, "{:?}", jogs(&output));
    // What was typed before a question was there doesn't answer it.
    terminal.press("wheel_1\nforward\n");
    terminal.wait(&["lines typed before this question are dropped: 1"], |_| {});
    terminal.wait(&["which way did wheel_1 turn?"], |_| {});
    terminal.press("backward\n");
    terminal.wait(&["how many turns did wheel_1 make?"], |_| {});
    terminal.press("leave\n");
    terminal.wait(&["the same command takes it up again"], |_| {});
    let screen = terminal.screen.lock().unwrap().clone();
    assert!(!screen.contains("found \"backward\""), "{screen}");
    let ended = terminal.script.wait().unwrap();
    assert_eq!(ended.code(), Some(1), "left, not done");
    for (line, _, unheld) in jogs(&output) {
        assert_eq!(unheld, 0, "{line}");
        assert!(line.contains("let go") || line.contains("never held"), "another key ends it: {line}");
    }
    assert!(!output.exists(), "no file before its step");

    // Taken up again: who is on the bus isn't looked for anew, and the drive waits for its key.
    let before = jogs(&output).len();
    let mut again = Terminal::new(&output);
    again.wait(&["done before: who is on the bus"], |_| {});
    again.wait(&["hold the key: SubDevice 0 turns"], |_| {});
    again.script.kill().unwrap();
    again.script.wait().unwrap();
    let begun = Instant::now();
    while running(&output).is_some() {
        assert!(begun.elapsed() < STUCK, "the terminal is gone, and it goes on");
        std::thread::sleep(REPEAT);
    }
    assert!(
        jogs(&output)
            .iter()
            .skip(before)
            .all(|(line, enabled, _)| *enabled == 0 && line.contains("was gone"))
    );
}

/// Whoever ends the program in the middle of a motion has the drive disabled first, and what was found is kept.
#[test]
fn a_signal_ends_a_motion_as_leaving_does() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    // Again where the machine was too slow for a keyboard.
    for _ in 0..5 {
        let mut terminal = Terminal::begun(&output);
        terminal.wait(&["hold the key: SubDevice 0 turns"], |_| {});
        let (begun, mut is_ended) = (Instant::now(), false);
        terminal.wait(&["the same command takes it up again"], |keyboard| {
            hold(keyboard);
            if begun.elapsed() > Duration::from_secs(2) && !std::mem::replace(&mut is_ended, true) {
                let program = running(&output).expect("it runs");
                assert!(Command::new("kill").args(["-TERM", &program]).status().unwrap().success());
            }
        });
        assert_eq!(terminal.script.wait().unwrap().code(), Some(1), "left, not killed");
        let last = jogs(&output).pop();
        if let Some((_, _, unheld)) =
            last.filter(|(line, enabled, _)| line.contains("was gone") && *enabled > 0)
        {
            assert_eq!(unheld, 0);
            return;
        }
    }
    panic!("{:?}", jogs(&output));
}

/// A program that says nothing leaves, and is told in its last line how it ended.
#[test]
fn a_program_is_told_how_its_set_up_ended() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let left = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["setup", &format!("sim:{root}/segments/three-servos.toml"), "--lines"])
        .args(["--robot", &format!("{root}/robots/bmm.toml"), "-o", output.to_str().unwrap()])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&left.stdout);
    let over: serde_json::Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
    assert_eq!((left.status.code(), &over["over"]["is_whole"]), (Some(1), &false.into()), "{said}");
    let words = over["over"]["text"].as_str().unwrap();
    assert!(
        words.starts_with("left; the same command takes it up again") && over["over"]["findings"].is_u64()
    );
}

/// Two that write one file would each lose what the other found: the second is refused, and says who writes it.
#[test]
fn a_second_set_up_of_one_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let first = omnibase_host::FileLock::take(&output.with_extension("state.json")).unwrap();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let second = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["setup", &format!("sim:{root}/segments/three-servos.toml"), "--lines"])
        .args(["--robot", &format!("{root}/robots/bmm.toml"), "-o", output.to_str().unwrap()])
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&second.stderr);
    assert_eq!(second.status.code(), Some(1), "{words}");
    let told = format!("mine.state.json` is in use by process {}", std::process::id());
    assert!(words.contains(&told), "{words}");
    drop(first);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was written");
}
