//! One run of a contestant's process, and what came out of it.

use crate::far_end::FarEnd;
use crate::{Contestant, Course};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Events of `perf`.
const INSTRUCTIONS: &str = "instructions:u";
const SYSTEM_CALLS: &str = "raw_syscalls:sys_enter";

/// The events that `perf` can count here.
pub fn countable_events() -> Vec<&'static str> {
    let counts = |event: &&str| {
        let output = Command::new("perf").args(["stat", "-e", event, "true"]).output();
        output.is_ok_and(|output| {
            let text = String::from_utf8_lossy(&output.stderr);
            output.status.success() && !text.contains("<not supported>")
        })
    };
    [INSTRUCTIONS, SYSTEM_CALLS].into_iter().filter(counts).collect()
}

/// What was measured of one contestant, over all runs.
#[derive(Debug, Default)]
pub struct Figures {
    /// Round trips of all rounds, ns.
    pub round_trips_ns: Vec<u64>,
    /// CPU time per cycle of each round, ns.
    pub cpu_ns: Vec<u64>,
    /// Cycles that were not right: lost, or with a wrong working counter.
    pub wrong: u64,
    /// User instructions per cycle; `None` without `perf`.
    pub instructions: Option<f64>,
    /// System calls per cycle; `None` without `perf` or its trace points.
    pub system_calls: Option<f64>,
}

/// What all runs share.
pub struct Arena {
    /// A Python with `pysoem`.
    pub python: Option<PathBuf>,
    /// Kind of drive.
    pub kind: String,
    /// What `perf` can count here.
    pub events: Vec<&'static str>,
}

impl Arena {
    /// Runs a contestant for its times.
    pub fn time(&self, contestant: Contestant, course: Course, figures: &mut Figures) {
        let control = Control::file();
        let output = self.run(contestant, Command::new("env"), &control, course);
        let mut lines =
            output.lines().map(|line| line.split(' ').filter_map(|word| word.parse::<u64>().ok()));
        let mut first = lines.next().expect("a first line");
        figures.cpu_ns.push(first.next().expect("the CPU time"));
        figures.wrong += first.next().expect("the wrong cycles");
        figures.round_trips_ns.extend(lines.next().expect("the round trips"));
    }

    /// Runs a contestant for its user instructions and system calls between the marks, as far as `perf` is here.
    pub fn count(&self, contestant: Contestant, course: Course, figures: &mut Figures) {
        if self.events.is_empty() {
            return;
        }
        let control = Control::fifo();
        let counts = control.beside("counts");
        let mut perf = Command::new("perf");
        perf.args(["stat", "-x", ",", "-e", &self.events.join(","), "--delay=-1", "--control"])
            .arg(format!("fifo:{},{}.ack", control.path(), control.path()))
            .arg("-o")
            .arg(&counts)
            .arg("--");
        self.run(contestant, perf, &control, course);
        let text = fs::read_to_string(&counts).unwrap_or_default();
        let fewest = |before: Option<f64>, event: &str| {
            // Where an event isn't supported, perf says so in place of the number.
            let line = text.lines().find(|line| line.contains(event))?;
            let counted = line.split(',').next()?.parse::<f64>().ok()? / course.cycles as f64;
            Some(before.map_or(counted, |before| before.min(counted)))
        };
        figures.instructions = fewest(figures.instructions, INSTRUCTIONS);
        figures.system_calls = fewest(figures.system_calls, SYSTEM_CALLS);
    }

    /// Runs a contestant under `program`, against a fresh segment; what it printed.
    fn run(&self, contestant: Contestant, mut program: Command, control: &Control, course: Course) -> String {
        let _far_end = FarEnd::start(&self.kind, course);
        let [drives, period_us, cycles] =
            [course.drives as u128, course.period.as_micros(), u128::from(course.cycles)]
                .map(|it| it.to_string());
        match (contestant, &self.python) {
            (Contestant::Pysoem, Some(python)) => {
                let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/soem_cycle.py");
                program.arg(python).arg(script).args([
                    omnibase_host::Namespace::NEAR,
                    &control.path(),
                    &period_us,
                    &cycles,
                ]);
            }
            _ => {
                let this = std::env::current_exe().expect("this program");
                program.arg(this).args(["--compete", &format!("{contestant:?}"), &control.path()]);
                program.args([drives, period_us, cycles]);
            }
        }
        let output = program.output();
        let output = output.unwrap_or_else(|error| panic!("{program:?}: {error}"));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{program:?} failed: {said}");
        String::from_utf8(output.stdout).expect("figures")
    }
}

/// Where a contestant marks its cycles; a folder of its own, gone with the value.
struct Control {
    folder: PathBuf,
}

impl Control {
    fn folder() -> Self {
        let folder = std::env::temp_dir().join(format!("omnibase-side-by-side-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for temporary files");
        Control { folder }
    }

    /// A file, which nobody reads.
    fn file() -> Self {
        let control = Self::folder();
        fs::write(control.path(), "").expect("a temporary file");
        control
    }

    /// Two FIFOs, as perf wants them.
    fn fifo() -> Self {
        let control = Self::folder();
        let made = Command::new("mkfifo").arg(control.path()).arg(format!("{}.ack", control.path())).status();
        assert!(made.is_ok_and(|status| status.success()), "mkfifo failed");
        control
    }

    fn path(&self) -> String {
        self.folder.join("control").display().to_string()
    }

    fn beside(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}
