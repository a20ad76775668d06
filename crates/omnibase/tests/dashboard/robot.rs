//! A simulated robot with its page, in a process of its own.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How the robot refuses what was asked too long ago, on its way or while it waited for the cycle.
const TOO_OLD: [&str; 2] = ["s ago, and counts for", "too busy to plan it in time"];

/// Whether it refused something for that.
pub fn is_too_old(said: &str) -> bool {
    TOO_OLD.iter().any(|words| said.contains(words))
}

pub const TOKEN: &str = "token-of-the-test";
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");

/// A simulated robot with its page.
pub struct Robot {
    process: Child,
    /// `http://address:port`.
    pub at: String,
    pub folder: tempfile::TempDir,
}

impl Robot {
    /// Starts it.
    pub fn start(more: &[&str]) -> Robot {
        Robot::start_file(ROBOT, more)
    }

    /// Starts the robot of a file.
    pub fn start_file(file: &str, more: &[&str]) -> Robot {
        let folder = tempfile::tempdir().unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["run", file, "--dashboard=127.0.0.1:0", "--json", "--paths"])
            .arg(folder.path())
            .args(more)
            .env("XDG_RUNTIME_DIR", folder.path())
            .env("OMNIBASE_TOKEN", TOKEN)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let found = lines
            .by_ref()
            .map_while(Result::ok)
            .find_map(|line| Some(line.strip_prefix("dashboard: ")?.split_once("/?token=")?.0.to_owned()));
        std::thread::spawn(move || lines.for_each(drop));
        let robot = Robot { process, at: found.expect("it says where its page is"), folder };
        robot.wait("its cycle runs", |robot| robot.read("now")["counts"][0].as_u64() > Some(0));
        robot
    }

    pub fn url(&self) -> String {
        format!("{}/?token={TOKEN}", self.at)
    }

    pub fn read(&self, what: &str) -> Value {
        let mut answer = ureq::get(&format!("{}/api/{what}", self.at)).call().unwrap();
        serde_json::from_str(&answer.body_mut().read_to_string().unwrap()).unwrap()
    }

    pub fn value(&self, name: &str) -> f64 {
        self.read("now")["values"][name].as_f64().unwrap_or(f64::NAN)
    }

    pub fn speed_m_s(&self) -> f64 {
        self.value("state/twist_in_body_x_m_s").hypot(self.value("state/twist_in_body_y_m_s"))
    }

    pub fn wait(&self, what: &str, holds: impl FnMut(&Robot) -> bool) {
        let came_true = self.is_true_within(holds, Duration::from_secs(60));
        assert!(came_true, "never came true: {what}: {}", self.read("now"));
    }

    /// Whether something becomes true in time.
    pub fn is_true_within(&self, mut holds: impl FnMut(&Robot) -> bool, within: Duration) -> bool {
        let begin = Instant::now();
        while !holds(self) {
            if begin.elapsed() > within {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }

    /// Asks with the newest stamp, again where a busy machine made it old on its way.
    pub fn call(&self, call: &Value) -> (u16, Value) {
        loop {
            let mut stamped = call.clone();
            stamped["stamp"] = self.read("now")["stamp"].take();
            let (status, said) = self.post(&stamped);
            if !said["text"].as_str().is_some_and(is_too_old) {
                return (status, said);
            }
        }
    }

    fn post(&self, call: &Value) -> (u16, Value) {
        let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let request = agent.post(&format!("{}/api/call", self.at));
        let mut answer =
            request.header("Authorization", format!("Bearer {TOKEN}")).send(call.to_string()).unwrap();
        let text = answer.body_mut().read_to_string().unwrap();
        (answer.status().as_u16(), serde_json::from_str(&text).unwrap_or(json!(text)))
    }

    /// What a command of the same person's says: its exit code, its output, its errors; again where a busy machine made
    /// what it asks old on its way.
    pub fn command(&self, arguments: &[&str]) -> (Option<i32>, String, String) {
        loop {
            let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
            let output = command.args(arguments).env("XDG_RUNTIME_DIR", self.folder.path()).output().unwrap();
            let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
            let said = (output.status.code(), text(output.stdout), text(output.stderr));
            if !is_too_old(&said.2) {
                return said;
            }
        }
    }

    /// Ends it as Ctrl-C does; what it says at its end.
    pub fn end(mut self) -> Value {
        let pid = self.process.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let mut text = String::new();
        std::io::Read::read_to_string(&mut self.process.stdout.take().unwrap(), &mut text).unwrap();
        assert!(self.process.wait().unwrap().success());
        serde_json::from_str(&text).unwrap()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = self.folder.path();
    }
}
