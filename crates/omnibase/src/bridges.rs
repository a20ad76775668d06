//! Programs beside a robot: bridges to other systems, each a process of its own that is started, watched and started again.

use crate::progress::{self, LogLevel, warn};
use anyhow::Context;
use clap::ValueEnum;
use omnibase_client::Found;
use omnibase_host::ends_with_this;
use omnibase_robot::config::BridgeTable;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Where a bridge finds which robot it is for: [`Found`] as JSON.
const ROBOT: &str = "OMNIBASE_ROBOT";
/// Between two looks at a bridge.
const LOOK: Duration = Duration::from_millis(50);
/// The wait before the first new start, and the longest: each is twice the one before.
const WAITS: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];
/// Whoever lived so long begins with the first wait again.
const LIVED: Duration = Duration::from_secs(10);
/// How long a bridge may take to end when it is asked to.
const LAST: Duration = Duration::from_secs(1);
/// How a program says that its arguments mean nothing: starting it again would change nothing.
const WRONG_USAGE: i32 = 2;

/// A bridge's program, found.
#[derive(Clone, Debug)]
pub struct Bridge {
    name: String,
    program: PathBuf,
    arguments: Vec<String>,
}

impl Bridge {
    /// The program of a bridge's name: beside this one, or in PATH.
    pub fn find(name: &str, arguments: Vec<String>) -> anyhow::Result<Bridge> {
        Bridge::of_program(name, &format!("omnibase-bridge-{name}"), arguments)
    }

    fn of_program(name: &str, program: &str, arguments: Vec<String>) -> anyhow::Result<Bridge> {
        let beside = std::env::current_exe().ok().and_then(|own| Some(own.parent()?.to_owned()));
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders: Vec<PathBuf> = beside.into_iter().chain(std::env::split_paths(&path)).collect();
        let found = folders.iter().map(|folder| folder.join(program)).find(|file| file.is_file());
        let program = found.with_context(|| {
            let places: Vec<_> = folders.iter().map(|folder| folder.display().to_string()).collect();
            format!(
                "there is no bridge `{name}`: no program `{program}` in {}. ROS 2's is built by `cargo build --release -p \
                 omnibase-bridge-ros2`",
                places.join(", ")
            )
        })?;
        Ok(Bridge { name: name.to_owned(), program, arguments })
    }

    /// The bridge of a table of the robot's file, whose paths begin at this folder.
    fn of_table(name: &str, table: &BridgeTable, folder: &Path) -> anyhow::Result<Bridge> {
        let arguments = table.arguments.clone();
        match table.program.as_deref() {
            None => Bridge::find(name, arguments),
            Some(program) if program.contains('/') => {
                let program = folder.join(program);
                anyhow::ensure!(
                    program.is_file(),
                    "[bridge.{name}] program: there is no {}",
                    program.display()
                );
                Ok(Bridge { name: name.to_owned(), program, arguments })
            }
            Some(program) => Bridge::of_program(name, program, arguments),
        }
    }

    /// A program that is there, under a bridge's name.
    pub fn at(name: &str, program: PathBuf, arguments: Vec<String>) -> Bridge {
        Bridge { name: name.to_owned(), program, arguments }
    }

    /// What starts it and looks after it in a process of its own: `omnibase bridge`. A process that forks copies each page
    /// that it writes to next, which no cycle has time for.
    fn keeper(&self) -> anyhow::Result<Bridge> {
        let program = self.program.to_str().context("the bridge's program has a name that is no text")?;
        let level = progress::level().to_possible_value().expect("each level has a name");
        let own = ["bridge", "--log-level", level.get_name(), "--program", program, &self.name];
        let arguments = own.map(str::to_owned).into_iter().chain(self.arguments.iter().cloned()).collect();
        Ok(Bridge::at(&self.name, std::env::current_exe()?, arguments))
    }

    fn start(&self, robot: Option<&Found>) -> anyhow::Result<Child> {
        let mut command = Command::new(&self.program);
        // A Ctrl-C is for the run, which ends its bridges.
        command.args(&self.arguments).process_group(0);
        if let Some(robot) = robot {
            command.env(ROBOT, serde_json::to_string(robot)?);
        }
        // A run's own child is the keeper, which chooses already.
        let chooses = robot.is_none() && progress::level() < LogLevel::Info;
        if chooses {
            command.stderr(Stdio::piped());
        }
        ends_with_this(&mut command).spawn().with_context(|| self.program.display().to_string())
    }

    /// Starts it, and stays until it ends, as [`watch`] has it.
    fn run(&self, robot: Option<&Found>, ends: &AtomicBool) -> anyhow::Result<Option<ExitStatus>> {
        let mut child = self.start(robot)?;
        let lines = child.stderr.take().map(|errors| BufReader::new(errors).lines().map_while(Result::ok));
        let passes_on = lines.map(|lines| std::thread::spawn(move || lines.for_each(progress::pass_on)));
        let ended = watch(&mut child, ends);
        // Its last lines; a child of its own may hold them open for ever.
        let until = Instant::now() + LAST;
        while passes_on.as_ref().is_some_and(|thread| !thread.is_finished()) && Instant::now() < until {
            std::thread::sleep(LOOK);
        }
        Ok(ended?)
    }

    /// Starts it again and again, until it is over by its own will or ours; false where its arguments are wrong.
    pub fn supervise(&self, robot: Option<&Found>, ends: &AtomicBool) -> bool {
        let mut wait = WAITS[0];
        loop {
            let began = Instant::now();
            let why = match self.run(robot, ends) {
                Ok(None) => return true,
                Ok(Some(status)) if status.success() => return true,
                Ok(Some(status)) if status.code() == Some(WRONG_USAGE) => return false,
                Ok(Some(status)) => how(status),
                Err(error) => format!("{error:#}"),
            };
            if began.elapsed() > LIVED {
                wait = WAITS[0];
            }
            let seconds = wait.as_secs_f64();
            warn(format_args!("bridge {}: it is gone ({why}): started again in {seconds} s", self.name));
            let until = Instant::now() + wait;
            while Instant::now() < until {
                if ends.load(Ordering::Relaxed) {
                    return true;
                }
                std::thread::sleep(LOOK);
            }
            wait = (wait * 2).min(WAITS[1]);
        }
    }
}

/// Waits for a bridge's end, or ends it; nothing where it was we who did.
fn watch(child: &mut Child, ends: &AtomicBool) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if ends.load(Ordering::Relaxed) {
            break;
        }
        std::thread::sleep(LOOK);
    }
    if let Some(pid) = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw) {
        rustix::process::kill_process(pid, rustix::process::Signal::TERM)?;
    }
    let until = Instant::now() + LAST;
    while Instant::now() < until {
        if child.try_wait()?.is_some() {
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
    child.kill()?;
    child.wait()?;
    Ok(None)
}

fn how(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => format!("signal {signal}"),
        (None, None) => status.to_string(),
    }
}

/// The bridges of a run, each with a keeper, and a thread that looks after that; they end with it.
pub struct Bridges {
    ends: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Bridges {
    /// The bridges that a robot's file wants.
    pub fn wanted(tables: &BTreeMap<String, BridgeTable>, folder: &Path) -> anyhow::Result<Vec<Bridge>> {
        let wanted = tables.iter().filter(|(_, table)| table.enabled != Some(false));
        wanted.map(|(name, table)| Bridge::of_table(name, table, folder)).collect()
    }

    /// Starts them for a robot that listens already.
    pub fn start(bridges: Vec<Bridge>, robot: &Found) -> anyhow::Result<Bridges> {
        let mut all = Bridges { ends: Arc::default(), threads: Vec::new() };
        for bridge in bridges {
            let (ends, robot, keeper) = (Arc::clone(&all.ends), robot.clone(), bridge.keeper()?);
            let thread = std::thread::Builder::new().name(format!("bridge {}", bridge.name));
            let thread = thread.spawn(move || _ = keeper.supervise(Some(&robot), &ends));
            all.threads.push(thread.context("starting a thread for a bridge")?);
        }
        Ok(all)
    }
}

impl Drop for Bridges {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // One that died has ended its bridge with it.
            let _ = thread.join();
        }
    }
}
