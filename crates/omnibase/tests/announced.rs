//! Which robot a command reaches where several run, or ran, on this machine.

use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::net::{SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, chown, symlink};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");

/// A simulated robot with its page.
struct Robot {
    process: Child,
    address: SocketAddr,
    /// What it says after its address.
    says: Receiver<String>,
}

impl Robot {
    fn start(folder: &Path, token: &str) -> Robot {
        let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["run", ROBOT, "--dashboard=127.0.0.1:0", "--json"])
            .env("OMNIBASE_TOKEN", token)
            .env("XDG_RUNTIME_DIR", folder)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let said =
            |line: String| Some(line.strip_prefix("dashboard: http://")?.split_once('/')?.0.to_owned());
        let address = lines.by_ref().map_while(Result::ok).find_map(said).expect("it says where its page is");
        let (heard, says) = mpsc::channel();
        // To the end: a robot whose words nobody takes would wait.
        std::thread::spawn(move || lines.map_while(Result::ok).for_each(|line| drop(heard.send(line))));
        let address: SocketAddr = address.parse().unwrap();
        Robot { process, address, says }
    }

    /// The line with these words.
    fn wait_for(&self, words: &str) -> String {
        loop {
            let line = self.says.recv_timeout(Duration::from_secs(60)).expect("it says so");
            if line.contains(words) {
                return line;
            }
        }
    }

    /// As `kill -9` does: without a last word.
    fn kill(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn omnibase(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(arguments)
        .env("XDG_RUNTIME_DIR", folder)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Waits until a robot says that its emergency stop is set: what it shows is a moment old.
fn is_stopped(folder: &Path, at: &str) -> bool {
    let says = || omnibase(folder, &["get", "emergency_stop", "--at", at]).1.contains("true");
    (0..100).any(|_| {
        let says = says();
        if !says {
            std::thread::sleep(Duration::from_millis(50));
        }
        says
    })
}

#[test]
fn a_robot_that_died_without_a_word_takes_no_command_from_one_that_runs_and_its_token_goes_to_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut first = Robot::start(folder, "token-of-the-first");
    let mut second = Robot::start(folder, "token-of-the-second");
    // As long as both run, the latest is meant.
    let at = second.address.to_string();
    let (code, _, error) = omnibase(folder, &["call", "emergency_stop"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(is_stopped(folder, &at));

    second.kill();
    // Somebody else takes its port.
    let listener = TcpListener::bind(second.address).unwrap();
    listener.set_nonblocking(true).unwrap();
    let (code, _, error) = omnibase(folder, &["call", "emergency_stop"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(is_stopped(folder, &first.address.to_string()));
    assert_eq!(listener.accept().unwrap_err().kind(), ErrorKind::WouldBlock, "somebody called there");

    // Called by its address, it is shown no token.
    listener.set_nonblocking(false).unwrap();
    let heard = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = [0; 4096];
        let length = stream.read(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes[..length]).into_owned()
    });
    assert_eq!(omnibase(folder, &["call", "emergency_stop", "--at", &at]).0, Some(1));
    let heard = heard.join().unwrap();
    assert!(heard.starts_with("POST") && !heard.contains("token-of"), "{heard}");

    first.kill();
    let (code, _, error) = omnibase(folder, &["call", "emergency_stop"]);
    assert!(code == Some(1) && error.contains("no robot runs"), "{error}");
}

/// A robot that somebody announces: a lock on its file, and a listener that takes every connection.
fn announced(folder: &Path, token: &str) -> (std::fs::File, TcpListener) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let address = listener.local_addr().unwrap();
    std::fs::create_dir_all(folder).unwrap();
    let path = folder.join(format!("{}.json", address.port()));
    let text = format!(r#"{{"robot": "foreign", "address": "{address}", "token": "{token}"}}"#);
    std::fs::write(&path, text).unwrap();
    let file = std::fs::File::open(path).unwrap();
    file.lock().unwrap();
    (file, listener)
}

type Spoil = fn(&Path);

/// Ways in which a folder is no longer this user's alone, and what is said of each.
fn spoiled() -> Vec<(&'static str, Spoil)> {
    let by_mode: Spoil = |folder| set_mode(folder, 0o777);
    let by_a_link: Spoil = |folder| {
        let elsewhere = folder.with_file_name("elsewhere");
        std::fs::rename(folder, &elsewhere).unwrap();
        symlink(elsewhere, folder).unwrap();
    };
    let by_its_owner: Spoil = |folder| chown(folder, Some(65534), None).unwrap();
    let mut spoiled = vec![("mode 0777", by_mode), ("a link or file", by_a_link)];
    // Only root gives a folder away.
    if std::fs::metadata("/proc/self").unwrap().uid() == 0 {
        spoiled.push(("one of user 65534", by_its_owner));
    }
    spoiled
}

fn set_mode(folder: &Path, mode: u32) {
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(mode)).unwrap();
}

#[test]
fn a_folder_in_which_others_can_write_announces_no_robot() {
    for (found, spoil) in spoiled() {
        let runtime = tempfile::tempdir().unwrap();
        let folder = runtime.path().join("omnibase");
        let (_lock, listener) = announced(&folder, "token-of-a-stranger");
        set_mode(&folder, 0o700);
        spoil(&folder);
        let (code, _, error) = omnibase(runtime.path(), &["call", "emergency_stop"]);
        assert_eq!(code, Some(1), "{found}: {error}");
        assert!(error.contains("expected a folder of this user alone") && error.contains(found), "{error}");
        assert_eq!(listener.accept().unwrap_err().kind(), ErrorKind::WouldBlock, "{found}: it was called");
    }
}

#[test]
fn a_robot_writes_its_token_where_nobody_else_reads_it_or_nowhere() {
    let own = tempfile::tempdir().unwrap();
    let robot = Robot::start(own.path(), "token-of-its-own");
    let written = own.path().join("omnibase").join(format!("{}.json", robot.address.port()));
    // Its page may be said first.
    let began = Instant::now();
    while !written.exists() {
        assert!(began.elapsed() < Duration::from_secs(60), "it announces itself");
        std::thread::yield_now();
    }
    assert!(std::fs::read_to_string(&written).unwrap().contains("token-of-its-own"));
    assert_eq!(std::fs::metadata(&written).unwrap().mode() & 0o777, 0o600);
    for (found, spoil) in spoiled() {
        let runtime = tempfile::tempdir().unwrap();
        let folder = runtime.path().join("omnibase");
        std::fs::create_dir(&folder).unwrap();
        set_mode(&folder, 0o700);
        spoil(&folder);
        let robot = Robot::start(runtime.path(), "token-of-its-own");
        let said = robot.wait_for("won't find this robot");
        assert!(said.contains("expected a folder of this user alone") && said.contains(found), "{said}");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0, "{found}");
    }
}

/// What stands in the folder where robots are announced.
fn left(runtime: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(runtime.join("omnibase")).unwrap();
    entries.map(|entry| entry.unwrap().path()).collect()
}

fn is_socket(path: &PathBuf) -> bool {
    std::fs::metadata(path).unwrap().file_type().is_socket()
}

/// A simulated robot that a stick leads, without a page; `first` is done before by a process of the same number.
fn start_without_page(runtime: &Path, first: &str) -> WithoutPage {
    let stick = crate::joystick_recording::recording(runtime, &[(100, 1, 130)]);
    let robot = Command::new("sh")
        .args(["-c", &format!("{first} exec \"$0\" \"$@\"")])
        .args([env!("CARGO_BIN_EXE_omnibase"), "run", ROBOT, "--json", "--joystick"])
        .arg(stick)
        .env("XDG_RUNTIME_DIR", runtime)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut robot = WithoutPage(robot);
    let began = Instant::now();
    while omnibase(runtime, &["get", "phase"]).0 != Some(0) {
        assert!(began.elapsed() < Duration::from_secs(60), "it answers");
        assert!(robot.0.try_wait().unwrap().is_none(), "it runs");
    }
    robot
}

/// A robot without a page, killed when it is dropped.
struct WithoutPage(Child);

impl Drop for WithoutPage {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_robot_without_a_page_that_died_leaves_no_socket_behind() {
    let runtime = tempfile::tempdir().unwrap();
    let runtime = runtime.path();
    let robot = start_without_page(runtime, "");
    assert_eq!(left(runtime).iter().filter(|path| is_socket(path)).count(), 1);
    drop(robot);
    let (code, _, error) = omnibase(runtime, &["call", "emergency_stop"]);
    assert!(code == Some(1) && error.contains("no robot runs"), "{error}");
    assert_eq!(left(runtime), [] as [PathBuf; 0]);
}

#[test]
fn a_robot_takes_nothing_from_another_one_of_its_processs_number() {
    let runtime = tempfile::tempdir().unwrap();
    let runtime = runtime.path();
    std::fs::create_dir(runtime.join("omnibase")).unwrap();
    set_mode(&runtime.join("omnibase"), 0o700);
    // As one of another container that shares the folder.
    let first = r#"cd "$XDG_RUNTIME_DIR/omnibase"; touch $$.socket $$.json process-$$.json $$.new;"#;
    let robot = start_without_page(runtime, first);
    let number = robot.0.id();
    for name in ["{}.socket", "{}.json", "process-{}.json", "{}.new"] {
        let path = runtime.join("omnibase").join(name.replace("{}", &number.to_string()));
        assert_eq!(std::fs::metadata(&path).map(|found| found.len()).ok(), Some(0), "{name}");
    }
}

#[test]
fn a_robot_that_takes_nobody_any_more_holds_up_no_command() {
    let runtime = tempfile::tempdir().unwrap();
    let folder = runtime.path().join("omnibase");
    std::fs::create_dir(&folder).unwrap();
    set_mode(&folder, 0o700);
    let socket = folder.join("hung.socket");
    let listener = UnixListener::bind(&socket).unwrap();
    // One waits; there is room for no more.
    rustix::net::listen(listener.as_fd(), 0).unwrap();
    let _waiting = std::os::unix::net::UnixStream::connect(&socket).unwrap();
    let path = folder.join("hung.json");
    let text = format!(r#"{{"robot": "hung", "socket": "{}", "token": ""}}"#, socket.display());
    std::fs::write(&path, text).unwrap();
    let file = std::fs::File::open(path).unwrap();
    file.lock().unwrap();
    for command in [&["call", "emergency_stop"][..], &["send", "gate", "open=1"]] {
        let mut asking = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(command)
            .env("XDG_RUNTIME_DIR", runtime.path())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let began = Instant::now();
        while asking.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = asking.kill();
        let output = asking.wait_with_output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(1) && error.contains("no robot answers"),
            "{command:?}: {error}"
        );
    }
    // Meanwhile another one is reached.
    drop(start_without_page(runtime.path(), ""));
}
