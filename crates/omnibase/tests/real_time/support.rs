//! Both processes, and what they say.

use omnibase_host::Namespace;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

/// The longest wait for a line; only a test that fails waits so long.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often it is looked whether a program has ended.
const POLL: Duration = Duration::from_millis(50);

/// What a test needs whose machine is busy with other things and pauses any program for hundreds of milliseconds: drives
/// that take outputs whenever they come (with SYNC0 an SGDV bears five cycles without, and no more can be set), a
/// second's patience of the robot and more of the drives.
pub const PATIENT: [&str; 12] = [
    "--set",
    "bus.cycle_us=4000",
    "--set",
    "bus.receive_timeout_us=3800",
    "--set",
    "bus.synchronisation=sync_manager_event",
    "--set",
    "safety.lost_exchanges_tolerated=250",
    // Drives that go on by themselves in a pause, and are told another speed after it, make wheels slip.
    "--set",
    "safety.slip_m=0.5",
    "--set",
    "safety.drive_watchdog_us=1500000",
];

/// A circle that ends by no machine's pauses, and on which the robot moves after a second.
pub const ENDLESS: &str = "radius_m=0.5,period_s=10,turns=endless";

/// What a test needs that looks at SYNC0 or counts lost frames: as much patience as such drives can be told to have. To
/// be used in [`undisturbed`] runs alone.
pub const WITH_SYNC0: [&str; 8] = [
    "--set",
    "bus.cycle_us=4000",
    "--set",
    "bus.receive_timeout_us=3800",
    "--set",
    "drive_defaults.parameters=[{object = \"0x10F1.2\", type = \"u16\", value = 15}]",
    "--set",
    "safety.lost_exchanges_tolerated=5",
];

/// A file of the repository.
pub fn repository(path: &str) -> String {
    format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"))
}

/// A program whose lines are read as they come. It is killed with the value.
pub struct Program {
    child: Child,
    lines: Receiver<String>,
    /// Lines that were read already.
    pub said: Vec<String>,
    output: Option<JoinHandle<String>>,
}

impl Program {
    /// Starts `omnibase`. To be called inside the namespace.
    pub fn omnibase(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
        command.args(arguments);
        Self::start(command)
    }

    /// Starts a command whose standard error is read line by line, and whose standard output at the end.
    pub fn start(mut command: Command) -> Self {
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = mpsc::channel();
        let errors = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || {
            errors.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        let mut output = child.stdout.take().unwrap();
        let output = std::thread::spawn(move || {
            let mut text = String::new();
            output.read_to_string(&mut text).map(|_| text).unwrap_or_default()
        });
        Program { child, lines, said: Vec::new(), output: Some(output) }
    }

    /// The simulated robot behind the far end, ready to answer.
    pub fn simulate(arguments: &[&str]) -> Self {
        let fixed = ["--interface", Namespace::FAR, "--realtime", "--json"];
        let mut program = Self::omnibase(&[&["simulate"], arguments, &fixed].concat());
        program.wait_for("SCHED_FIFO");
        program
    }

    /// A run at the near end.
    pub fn run(arguments: &[&str]) -> Self {
        let fixed = ["--interface", Namespace::NEAR, "--realtime", "--json"];
        Self::omnibase(&[&["run"], arguments, &fixed].concat())
    }

    /// Waits for a line with these words.
    pub fn wait_for(&mut self, words: &str) {
        loop {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(line) => {
                    let found = line.contains(words);
                    self.said.push(line);
                    if found {
                        return;
                    }
                }
                Err(error) => panic!("`{words}`: {error}\n{}", self.said.join("\n")),
            }
        }
    }

    /// Waits for a line with these words; `false` where `other` ended before one came.
    pub fn wait_for_while_runs(&mut self, words: &str, other: &mut Program) -> bool {
        loop {
            match self.lines.recv_timeout(POLL) {
                Ok(line) => {
                    let found = line.contains(words);
                    self.said.push(line);
                    if found {
                        return true;
                    }
                }
                Err(RecvTimeoutError::Timeout) if other.has_ended() => return false,
                Err(RecvTimeoutError::Timeout) => {}
                Err(error) => panic!("`{words}`: {error}\n{}", self.said.join("\n")),
            }
        }
    }

    /// Of a simulator: whether the robot of `run` moves before a fault with these words, which comes by the simulator's own
    /// clock. A robot that the machine gave no time to start before it shows nothing of the fault.
    pub fn moves_before(&mut self, fault: &str, run: &mut Program) -> bool {
        let moves = self.wait_for_while_runs("the robot moves", run);
        let is_early = self.said.iter().any(|line| line.contains(fault));
        assert!(moves || is_early, "it never moved: {:?}", run.lines.try_iter().collect::<Vec<_>>());
        !is_early
    }

    /// Whether it has ended.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal, as `INT`.
    pub fn signal(&self, name: &str) {
        let status = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status();
        assert!(status.unwrap().success());
    }

    /// Waits for the end; how it ended, and what went to the standard output.
    pub fn end(mut self) -> Ended {
        let status = self.child.wait().unwrap();
        self.said.extend(self.lines.iter());
        let output = self.output.take().map(|output| output.join().unwrap()).unwrap_or_default();
        Ended { status, output, said: self.said.join("\n") }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A program that has ended.
#[derive(Debug)]
pub struct Ended {
    pub status: ExitStatus,
    pub output: String,
    /// Lines of the standard error.
    pub said: String,
}

impl Ended {
    /// Its JSON; null where it ended without.
    pub fn json_if_any(&self) -> Value {
        serde_json::from_str(&self.output).unwrap_or_default()
    }

    /// Its JSON.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.output)
            .unwrap_or_else(|error| panic!("{error}: {:?}\n{}\n{}", self.status, self.output, self.said))
    }
}

/// What both processes of a run say.
pub struct BothReports {
    /// The run's exit code.
    pub ended: Option<i32>,
    /// What `omnibase run` says.
    pub report: Value,
    /// What `omnibase simulate` says.
    pub simulated: Value,
}

impl BothReports {
    /// Waits for the end of the run, then ends the simulator.
    pub fn of(run: Program, simulator: Program) -> Self {
        let run = run.end();
        simulator.signal("INT");
        let simulated = simulator.end().json();
        // A run that the machine kept from its start reports nothing.
        let report = if is_late(&simulated) { run.json_if_any() } else { run.json() };
        BothReports { ended: run.status.code(), report, simulated }
    }

    /// Whether this machine served cycle and simulator in time: what it disturbed shows nothing of the bus.
    pub fn is_undisturbed(&self) -> bool {
        self.report["overruns"].as_u64() == Some(0) && !is_late(&self.simulated)
    }

    /// Figures of the bus.
    pub fn bus(&self, what: &str) -> f64 {
        number(&self.report["bus"][what])
    }

    /// The states of a SubDevice, from start to end, and what else is told of it meanwhile. In its last INIT it is left alone: how
    /// long the simulator then waits for its own end is the machine's affair.
    pub fn states(&self, position: usize) -> Vec<&str> {
        let name = format!("SubDevice {position}: ");
        let told = events(&self.simulated).into_iter();
        let mut told: Vec<&str> = told.filter_map(|text| text.strip_prefix(&name)).collect();
        told.truncate(told.iter().rposition(|text| *text == "INIT").map_or(told.len(), |last| last + 1));
        told
    }
}

/// The states of a SubDevice that was in OP all the time.
pub const IN_OP: [&str; 5] = ["PRE-OP", "SAFE-OP", "OP", "PRE-OP", "INIT"];
/// A frame that waited so long for the simulator is answered too late for a cycle of 4 ms, ms.
const LATE_MS: f64 = 2.0;
/// Without frames for so long a robot with [`PATIENT`] may stop, ms: 250 cycles of 4 ms, less the cycle in which a pause begins.
const BORNE_MS: f64 = 990.0;
/// Runs until one is seen that the machine didn't disturb.
pub const ATTEMPTS: u32 = 3;

/// Whether the machine kept frames waiting for the simulator.
pub fn is_late(simulated: &Value) -> bool {
    number(&simulated["longest_wait_ms"]) >= LATE_MS
}

/// Whether a run failed and this machine kept one of both programs from its time for longer than [`PATIENT`] bears: to stop then is
/// right.
pub fn was_paused(run: &Ended, simulated: &Ended) -> bool {
    let (report, simulated) = (run.json_if_any(), simulated.json_if_any());
    let pauses_ms =
        ["own", "other"].map(|who| report["pauses"][who]["longest_ns"].as_f64().map(|ns| 1e-6 * ns));
    let waited_ms = simulated["longest_wait_ms"].as_f64();
    let paused_ms = pauses_ms.into_iter().chain([waited_ms]).flatten().fold(0.0, f64::max);
    !run.status.success() && paused_ms >= BORNE_MS
}

/// Runs until the machine kept its time in one of them; where it never did, says loudly that `test` is skipped.
pub fn undisturbed(test: &str, mut attempt: impl FnMut() -> BothReports) -> Option<BothReports> {
    for number in 1..=ATTEMPTS {
        let seen = attempt();
        let BothReports { report, simulated, .. } = &seen;
        eprintln!(
            "{test}, attempt {number}: {} frames lost, {} cycles left out, a frame waited {} ms for the simulator",
            report["lost_frames"], report["overruns"], simulated["longest_wait_ms"]
        );
        if seen.is_undisturbed() {
            return Some(seen);
        }
    }
    eprintln!("SKIPPED: {test}: this machine kept its time in none of {ATTEMPTS} attempts");
    None
}

/// A number of a report.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The words of all events of a report.
pub fn events(report: &Value) -> Vec<&str> {
    report["events"].as_array().unwrap().iter().filter_map(|event| event["text"].as_str()).collect()
}

/// Whether all SubDevices were led out of OP without an error after they had been in it.
pub fn left_op_in_order(simulated: &Value) -> bool {
    let events = events(simulated);
    let ends = |words: &str| events.iter().filter(|text| text.ends_with(words)).count();
    ends(": OP") > 0 && ends(": INIT") >= ends(": OP") && !events.iter().any(|text| text.contains("error"))
}

/// A file that goes with the value.
pub struct Scratch(pub PathBuf);

impl Scratch {
    /// A file of this test's own.
    pub fn new(name: &str) -> Self {
        Scratch(std::env::temp_dir().join(format!("omnibase-real-time-{}-{name}", std::process::id())))
    }

    /// Its path.
    pub fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
