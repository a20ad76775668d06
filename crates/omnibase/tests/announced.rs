//! Which robot a command reaches where several run, or ran, on this machine.

use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");

/// A simulated robot with its page.
struct Robot {
    process: Child,
    address: SocketAddr,
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
        std::thread::spawn(move || lines.for_each(drop));
        Robot { process, address: address.parse().unwrap() }
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

#[test]
fn a_folder_in_which_others_can_write_announces_no_robot() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
    let mode = |folder: &Path, mode| {
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    type Spoil<'a> = &'a dyn Fn(&Path);
    let spoiled: [(&str, Spoil<'_>); 3] = [
        ("mode 0777", &|folder| mode(folder, 0o777)),
        ("a link or file", &|folder| {
            let elsewhere = folder.with_file_name("elsewhere");
            std::fs::rename(folder, &elsewhere).unwrap();
            symlink(elsewhere, folder).unwrap();
        }),
        ("one of user 65534", &|folder| {
            mode(folder, 0o700);
            chown(folder, Some(65534), None).unwrap();
        }),
    ];
    // Only root gives a folder away.
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    for (found, spoil) in spoiled.into_iter().filter(|(found, _)| is_root || !found.starts_with("one of")) {
        let runtime = tempfile::tempdir().unwrap();
        let folder = runtime.path().join("omnibase");
        let (_lock, listener) = announced(&folder, "token-of-a-stranger");
        mode(&folder, 0o700);
        spoil(&folder);
        let (code, _, error) = omnibase(runtime.path(), &["call", "emergency_stop"]);
        assert_eq!(code, Some(1), "{found}: {error}");
        assert!(error.contains("expected a folder of this user alone") && error.contains(found), "{error}");
        assert_eq!(listener.accept().unwrap_err().kind(), ErrorKind::WouldBlock, "{found}: it was called");
    }
}
