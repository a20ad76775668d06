//! `omnibase run`: the whole robot, from its file to the error at the end.

mod calendar;
mod joystick_thread;
mod operated;
mod page;
mod receivers;
mod recording;
pub(crate) mod reference;
mod report;

use crate::cli::{Cli, Command, joined};
use crate::progress::{bar, error, note, warn};
use crate::real_time::RealTime;
use crate::robot_file::{Changes, RobotSource};
use crate::target::{AnyClock, Manners, Port, Target};
use crate::{Outcome, WrongUsage};
use anyhow::Context;
use omnibase_ethercat::RedundantLink;
use omnibase_ethercat_sim::in_process;
use omnibase_ethercat_wire::Link;
use omnibase_host::{Waiting, real_time, stop_on_signals};
use omnibase_measure::Summary;
use omnibase_measure::measured::{FloorPose, Measured};
use omnibase_record::run::{OnFull, RunDescriber, RunFiles, RunRecorder};
use omnibase_record::{KeepFrames, LastFrames, RecordingLink, WhenFull};
use omnibase_robot::{Registry, Robot};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::channels::{Known, Rows};
use omnibase_run::floor_memory;
use omnibase_run::pace::PacedClock;
use omnibase_run::room::Room;
use omnibase_run::simulated::Script;
use omnibase_run::{LoadedRobot, Progress, Ran, RunError, Setup, simulated};
use page::Page;
use reference::ReferenceChoice;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Runs a robot along a reference: drives up, tracked to the end, drives down, and says how well it went.
///
/// The robot's file says how, in its tables `run` and `recording`; options have the last word. Without an interface the robot
/// is simulated in the process, on virtual time.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase run robots/bmm.toml --path robots/square.dat                 the 2 m square, simulated
  omnibase run robots/bmm.toml --circle radius_m=0.5,duration_s=10 --controller adaptive_torque --payload-kg 100
  omnibase run robots/bmm.toml --path robots/square.dat --record run.mcap --report run.html
  omnibase run robots/bmm.toml --dashboard                              driven by hand, seen live in a browser
  omnibase run robots/bmm.toml --joystick                               driven by the stick at this computer
  omnibase run robots/bmm.toml --path robots/square.dat --measured      asks at the end where it stands on the floor
  omnibase run robots/bmm.toml --simulated                              whatever interface the file names
  omnibase run robots/bmm.toml --path robots/square.dat --interface eth1 --realtime      real drives: wheels move!

Ctrl-C ramps down, disables the drives and closes the files; a second one stops at once.
Exit code 1 where the reference was not followed to its end.")]
pub struct Arguments {
    /// Robot file (TOML).
    robot: PathBuf,
    #[arg(skip)]
    reference: ReferenceChoice,
    #[command(flatten)]
    changes: Changes,
    #[command(flatten)]
    operated: operated::Options,
    /// Network interface with the drives (or `omnibase simulate`), in real time.
    #[arg(long, value_name = "NIC")]
    interface: Option<String>,
    /// Simulate the robot, whatever interface its file names.
    #[arg(long, conflicts_with_all = ["interface", "redundant"])]
    simulated: bool,
    /// Second network interface, at the other end of a ring: one break of a cable loses no cycle.
    #[arg(long, value_name = "NIC")]
    redundant: Option<String>,
    #[command(flatten)]
    manners: Manners,
    #[command(flatten)]
    real_time: RealTime,
    /// Ask for no real time, whatever the robot's file says.
    #[arg(long, conflicts_with_all = ["realtime", "cpu"])]
    no_realtime: bool,
    /// Use mapped rings (PACKET_RX_RING, PACKET_TX_RING) in place of send and recv.
    #[arg(long)]
    ring: bool,
    /// Look at the ring until the frame is back; uses up a CPU meanwhile. Without it, it is looked at for as long as frames usually
    /// take, a quarter of bus.receive_timeout_us at most, and then slept.
    #[arg(long, requires = "ring")]
    busy_poll: bool,
    #[command(flatten)]
    recording: recording::RecordingChoice,
    /// Keep the last seconds of frames, and write them into this pcapng file when something goes wrong: a lost frame, a working
    /// counter that falls, an AL error, a fault of the robot, a run that ends early. Later ones are called x-2.pcapng and so on.
    #[arg(long, value_name = "FILE")]
    frames: Option<PathBuf>,
    /// How many seconds --frames keeps.
    #[arg(long, value_name = "SECONDS", default_value = "10", requires = "frames", value_parser = clap::value_parser!(u16).range(1..=3600))]
    frames_s: u16,
    /// Show the run on this page of HTML.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Compare with where the platform stands on the floor, measured in odom: "x y heading" in m, m and rad (or 90deg); without it
    /// you are asked when the robot stands.
    #[arg(long, value_name = "POSE", num_args = 0..=1, require_equals = true)]
    measured: Option<Option<FloorPose>>,
    /// Print the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// `omnibase run` with a motion from a reference file and a recording; everything else is as its own options and the robot's file say.
pub(crate) fn recorded_run(
    robot: &Path,
    changes: &Changes,
    options: &[String],
    reference: &Path,
    recording: &Path,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let mut words = vec!["omnibase".to_owned(), "run".to_owned(), text(robot)];
    words.extend(["--reference".to_owned(), text(reference), "--record".to_owned(), text(recording)]);
    words.extend(changes.as_options());
    words.extend(options.iter().cloned());
    let matches = Cli::command_with(registry).try_get_matches_from(joined(words.into_iter().map(Into::into)));
    let matches = matches.map_err(|error| WrongUsage(anyhow::anyhow!("behind `--`: {error}")))?;
    let Command::Run(arguments) = Cli::from_matches(&matches)?.command else {
        anyhow::bail!("behind `--`: expected options of run")
    };
    run(&arguments, registry, output)
}

/// Runs the command.
pub fn run(
    arguments: &Arguments,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let mut source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    source.text.reference = arguments.reference.chosen(registry)?;
    let robot = source.load_or_explain(registry)?;
    crate::correction_file::warn_of_anothers(&robot.plan, &source.text.folder, registry);
    let arguments = &arguments.deployed(&robot, &source.text.folder)?;
    let is_operated = arguments.operated.is_wanted();
    anyhow::ensure!(
        is_operated || robot.plan.reference.kind.as_deref() != registry.references.sort.default,
        "nothing to follow: give --path, --reference or a shape such as --circle, or a [reference] in {}; or \
         --dashboard or --joystick to drive by hand",
        arguments.robot.display()
    );
    let room = Room::of(&robot.plan, &source.text.folder)?;
    let stop = stop_on_signals()?;
    let (way, frames) = arguments.keep_frames(arguments.open(&robot)?)?;
    let stages = Robot::build(&robot.plan, registry)?;
    let known = if way.machine.is_some() { Known::Truth } else { Known::BeliefAlone };
    let files = arguments.recording.files(&robot, &source.text.folder)?;
    if way.machine.is_some() && !is_operated && stages.reference_duration_s().is_none() {
        note(endless(files.as_ref()));
    }
    let mut page = arguments.page(files.as_ref())?;
    let (recorder, recording) =
        arguments.recorder(&robot, &room, known, files, page.as_ref(), registry)?.unzip();
    // Without people a fault ends the run, and its end is told with the last frame there is.
    let fault = frames.as_ref().filter(|_| is_operated).map(LastFrames::told).unwrap_or_default();
    let progress = Progress { fault, ..Progress::default() };
    let describer = recorder.as_ref().map(RunRecorder::describer);
    // Its thread starts before this one asks for a higher priority.
    let (operated, live) =
        arguments.operated.start(&robot, room, Arc::clone(registry), known, describer.clone())?.unzip();
    let setup = Setup {
        plan: &robot.plan,
        robot: stages,
        machine: way.machine,
        script: way.script,
        recording,
        live,
        stop,
        progress: &progress,
    };
    let (ran, share) = match arguments.drive(way.link, way.clock, setup, describer) {
        Ok(ran) => ran,
        Err(failure) => {
            // It never came to a cycle: what the bus said is all that there is.
            if let Err(untold) = frames.map_or(Ok(()), |frames| tell_frames(frames, true)) {
                error(format_args!("{}", crate::words(&untold)));
            }
            return Err(failure);
        }
    };
    page.iter_mut().for_each(Page::keep);
    arguments.keep_floor(&robot, &source.text.folder, &ran);
    let mut summary: Summary = ran.summary;
    let floor_pose =
        arguments.measured.map(|pose| pose.map_or_else(ask_where_it_stands, |pose| Ok(Some(pose))));
    let floor_pose = floor_pose.transpose()?.flatten();
    summary.measured =
        floor_pose.map(|pose| Measured::after(pose, ran.wished_end, ran.last.state.odom_from_body));
    summary.cpu_share = arguments.interface.is_some().then_some(share);
    let lost = recorder.and_then(|recorder| end_recording(recorder, &mut summary, &ran.ended));
    let is_wrong = ran.ended.is_err() || (!ran.finished && !is_operated);
    let frames = frames.map_or(Ok(()), |frames| tell_frames(frames, is_wrong));
    let told = arguments.tell(&summary, output);
    drop(operated);
    let page = page.map_or(Ok(()), |page| page.write(registry));
    // Each is said, why the run ended early before why its page can't be; the last is the command's own.
    let failures = [told.err(), ran.ended.err().map(Into::into), lost, frames.err(), page.err()];
    let mut failures: Vec<anyhow::Error> = failures.into_iter().flatten().collect();
    if let Some(last) = failures.pop() {
        failures.iter().for_each(|failure| error(format_args!("{}", crate::words(failure))));
        return Err(last);
    }
    Ok(if ran.finished || is_operated { Outcome::Done } else { Outcome::Failed })
}

/// Ends a recording, with how much of the run it has; why it ended early.
fn end_recording(
    recorder: RunRecorder,
    summary: &mut Summary,
    ended: &Result<(), RunError>,
) -> Option<anyhow::Error> {
    let recorded = recorder.finish_with(|recorded| page::last_words(summary, ended, recorded));
    (summary.records_written, summary.records_dropped) = (recorded.written, recorded.dropped);
    if recorded.removed > 0 {
        note(format_args!("recording: {} cycles went with the oldest files", recorded.removed));
    }
    recorded.failure.map(|failure| anyhow::Error::from(failure).context("the recording ended early"))
}

/// What a person says of where the platform stands.
pub(super) enum Told {
    /// There.
    Pose(FloorPose),
    /// An empty line.
    Nothing,
    /// Nobody says anything any more.
    End,
}

/// Asks a person by these words where the platform stands, until it is a pose or nothing.
pub(super) fn ask_for_pose(words: &str) -> anyhow::Result<Told> {
    loop {
        eprint!("{words}: ");
        let mut line = String::new();
        let read = std::io::stdin().read_line(&mut line).context("reading where the platform stands")?;
        match line.trim() {
            "" if read == 0 => return Ok(Told::End),
            "" => return Ok(Told::Nothing),
            text => match text.parse() {
                Ok(pose) => return Ok(Told::Pose(pose)),
                Err(words) => warn(words),
            },
        }
    }
}

fn ask_where_it_stands() -> anyhow::Result<Option<FloorPose>> {
    let told = ask_for_pose("measured on the floor, x y heading [m m rad, or 90deg; empty: not measured]")?;
    Ok(if let Told::Pose(pose) = told { Some(pose) } else { None })
}

/// The way to the drives.
struct Connection {
    link: Box<dyn Link>,
    clock: AnyClock,
    /// The machine behind drives that are simulated in the process.
    machine: Option<SharedMachine>,
    /// What happens to it.
    script: Option<Script>,
}

impl Arguments {
    /// The motion that the command line chose.
    pub fn choose_motion(&mut self, matches: &clap::ArgMatches) {
        self.reference = ReferenceChoice::of(matches);
    }

    /// Drives, and shows how far that is where nobody operates the robot; how it went, and how much of a CPU it took.
    fn drive(
        &self,
        link: Box<dyn Link>,
        clock: AnyClock,
        setup: Setup<'_>,
        describer: Option<RunDescriber>,
    ) -> anyhow::Result<(Ran, f64)> {
        let (progress, stop) = (setup.progress, setup.stop);
        std::thread::scope(|scope| {
            // Drawing may block: not in the thread of the cycle.
            let shown = (!self.operated.is_wanted()).then(|| scope.spawn(|| show(progress, stop)));
            let ended = EndedAtLast(progress);
            // Until the end of the cycle; behind the start of other threads, which would inherit the CPU.
            let granted = self.real_time.apply(Duration::from_nanos(setup.plan.bus.cycle_ns))?;
            if let (Some(describer), Some(granted)) = (describer, &granted) {
                let words: Vec<String> = granted.outcomes.iter().map(ToString::to_string).collect();
                describer.describe("real_time".to_owned(), words.join("; "));
            }
            let share = CpuShare::new();
            let ran = omnibase_run::run(link, clock, setup, &mut |text| warn(text));
            let share = share.so_far();
            drop(ended);
            // A bar that died is no reason to lose the figures.
            if let Some(shown) = shown
                && shown.join().is_err()
            {
                warn("the progress bar died");
            }
            Ok((ran?, share))
        })
    }

    /// What was found of the floor; a try in simulation leaves what the real robot found.
    fn keep_floor(&self, robot: &LoadedRobot, folder: &Path, ran: &Ran) {
        let is_try = self.simulated && robot.plan.run.interface.is_some();
        let Some(name) = robot.plan.grip.memory.as_ref().filter(|_| !is_try) else { return };
        let path = folder.join(name);
        if let Err(error) = floor_memory::keep(&path, &ran.last.grip) {
            warn(format_args!("{}: what was found of the floor isn't kept: {error}", path.display()));
        }
    }

    /// With what the robot's file says where the command line says nothing; paths begin at the file's folder.
    fn deployed(&self, robot: &LoadedRobot, folder: &Path) -> anyhow::Result<Arguments> {
        let mut all = self.clone();
        let table = &robot.plan.run;
        if let Some(interface) =
            table.interface.as_ref().filter(|_| !self.simulated && self.interface.is_none())
        {
            // Nobody who tries something in simulation moves a robot by it.
            usage(
                !self.changes.are_for_simulation(),
                format_args!(
                    "--payload-kg, --events-file and `simulation` are of the simulated robot, and [run] interface = \"{interface}\" of {} is where the \
                     real one is: give --simulated, or --interface {interface}",
                    self.robot.display()
                ),
            )?;
            note(format_args!(
                "the real robot, at {interface} as [run] in {} says: wheels move; --simulated leaves it alone",
                self.robot.display()
            ));
            all.interface = Some(interface.clone());
            all.redundant = all.redundant.or_else(|| table.redundant.clone());
        }
        if self.simulated && table.interface.is_some() {
            // A try writes over nothing that the real robot recorded.
            all.recording.leave_file();
        }
        let is_real = all.interface.is_some();
        if is_real && !self.no_realtime {
            all.real_time.fill(table);
        }
        usage(
            is_real || !(all.redundant.is_some() || all.ring),
            "--redundant and --ring are for --interface, and the robot is simulated",
        )?;
        usage(
            is_real || !all.real_time.is_wished(),
            "--realtime and --cpu are for --interface: without it time is virtual",
        )?;
        all.operated.fill(&robot.plan, folder)?;
        Ok(all)
    }

    fn open(&self, robot: &LoadedRobot) -> anyhow::Result<Connection> {
        let Some(interface) = &self.interface else {
            let (mut segment, machine) = simulated::segment(&robot.plan)?;
            let script = Script::new(&robot.plan, &mut segment, &machine);
            let (link, clock) = in_process(segment);
            let clock = if self.operated.is_wanted() {
                AnyClock::Paced(PacedClock::new(clock))
            } else {
                AnyClock::Virtual(clock)
            };
            return Ok(Connection { link: Box::new(link), clock, machine: Some(machine), script });
        };
        let port = match (self.ring, self.busy_poll) {
            (false, _) => Port::Socket,
            (true, false) => Port::Ring(Waiting::Sleep),
            (true, true) => Port::Ring(Waiting::BusyPoll),
        };
        let cable = self.manners.enter(&Target::Interface(interface.clone()), port)?;
        let link = match &self.redundant {
            None => cable.link,
            Some(other) => {
                let end = self.manners.enter(&Target::Interface(other.clone()), port)?;
                Box::new(RedundantLink::new(cable.link, end.link, cable.clock.clone()))
            }
        };
        Ok(Connection { link, clock: cable.clock, machine: None, script: None })
    }

    /// The same way, its last frames kept where that is wished.
    fn keep_frames(&self, way: Connection) -> anyhow::Result<(Connection, Option<LastFrames>)> {
        let Some(path) = &self.frames else { return Ok((way, None)) };
        let unix_offset_ns = match &way.clock {
            AnyClock::Host(clock) => clock.unix_offset_ns(),
            AnyClock::Virtual(_) | AnyClock::Paced(_) => 0,
        };
        let (frames, sink) = LastFrames::start(KeepFrames {
            path: path.clone(),
            interface: self.interface.clone().unwrap_or_else(|| "simulated".to_owned()),
            seconds: Duration::from_secs(self.frames_s.into()),
            when_full: if self.interface.is_some() { WhenFull::Drop } else { WhenFull::Wait },
        })
        .context("--frames")?;
        let clock = Box::new(way.clock.clone());
        let link = Box::new(RecordingLink::new(way.link, clock, unix_offset_ns, sink));
        Ok((Connection { link, ..way }, Some(frames)))
    }

    fn tell(&self, summary: &Summary, output: &mut dyn Write) -> anyhow::Result<()> {
        if self.json {
            serde_json::to_writer_pretty(&mut *output, summary)?;
            writeln!(output)?;
        } else {
            report::print(summary, output)?;
        }
        Ok(output.flush()?)
    }

    fn page(&self, files: Option<&RunFiles>) -> anyhow::Result<Option<Page>> {
        let Some(path) = self.report.as_deref() else { return Ok(None) };
        anyhow::ensure!(
            files.is_none_or(|files| files.rotation.is_none()),
            "--report shows a run in one file: give --no-recording, or show the files one by one by `omnibase report`"
        );
        Page::begin(path, files.and_then(|files| files.mcap.as_deref())).map(Some)
    }

    fn recorder(
        &self,
        robot: &LoadedRobot,
        room: &Room,
        known: Known,
        files: Option<RunFiles>,
        page: Option<&Page>,
        registry: &Registry,
    ) -> anyhow::Result<Option<(RunRecorder, (Rows, omnibase_record::run::RunSink))>> {
        let Some(mut files) = files.or_else(|| page.map(|_| RunFiles::default())) else { return Ok(None) };
        files.mcap = files.mcap.or_else(|| page.map(|page| page.recording().to_owned()));
        let rows = Rows::new(&robot.plan.record_layout(), known);
        files.description = omnibase_run::describe::description(robot, registry);
        files.description.extend(omnibase_run::describe::of_room(room));
        files.description.extend(page::first_words());
        anyhow::ensure!(
            !files.selection.columns(rows.schema()).is_empty(),
            "none of the chosen signals is there on hardware: expected others beside `truth`"
        );
        if let Some(words) = recording::words(&files, rows.schema()) {
            note(words);
        }
        let on_full =
            if self.interface.is_some() || self.operated.is_wanted() { OnFull::Drop } else { OnFull::Wait };
        let (recorder, sink) =
            RunRecorder::start(&files, rows.schema(), on_full).context("starting the recording")?;
        Ok(Some((recorder, (rows, sink))))
    }
}

/// Says which files hold the frames of what went wrong, the run's own end with them.
fn tell_frames(frames: LastFrames, is_wrong: bool) -> anyhow::Result<()> {
    let kept = frames.finish(is_wrong).context("--frames")?;
    if kept.files.is_empty() {
        note("--frames: nothing went wrong, nothing was written");
    }
    for (path, words) in &kept.files {
        note(format_args!("--frames: {}: {words}", path.display()));
    }
    if kept.untold > 0 {
        warn(format_args!(
            "--frames: {} times more something went wrong, without a file of its own",
            kept.untold
        ));
    }
    if kept.dropped > 0 {
        warn(format_args!("--frames: {} frames found no room and are missing", kept.dropped));
    }
    Ok(())
}

/// What to know of a motion without an end on virtual time.
fn endless(files: Option<&RunFiles>) -> String {
    let words = "warning: the motion has no end, and time is virtual: it goes on, faster than it would be, until Ctrl-C";
    let is_bounded = |files: &RunFiles| files.rotation.is_some_and(|rotation| rotation.files.is_some());
    let grows = files.is_some_and(|files| !is_bounded(files));
    let bound =
        if grows { "; its recording grows as fast, unless --limit-mb and --files bound it" } else { "" };
    format!("{words}{bound}")
}

/// An error of the command line's own where it isn't right.
fn usage(is_right: bool, words: impl std::fmt::Display) -> anyhow::Result<()> {
    if is_right { Ok(()) } else { Err(WrongUsage(anyhow::anyhow!("{words}")).into()) }
}

/// Says that a run is over, in whatever way its scope is left: its bar must not go on.
struct EndedAtLast<'a>(&'a Progress);

impl Drop for EndedAtLast<'_> {
    fn drop(&mut self) {
        self.0.ended.store(true, Ordering::Relaxed);
    }
}

/// The CPU time of a thread against time.
struct CpuShare {
    cpu: Duration,
    began: Instant,
}

impl CpuShare {
    fn new() -> Self {
        CpuShare { cpu: real_time::thread_cpu_time(), began: Instant::now() }
    }

    /// Of one CPU, by the calling thread.
    fn so_far(&self) -> f64 {
        let cpu = real_time::thread_cpu_time().saturating_sub(self.cpu);
        cpu.as_secs_f64() / self.began.elapsed().as_secs_f64().max(1e-9)
    }
}

/// Draws until the run is over; says once that a stop was asked for.
fn show(progress: &Progress, stop: &AtomicBool) {
    let bar = bar(progress.total.load(Ordering::Relaxed), "cycles");
    let mut told = false;
    while !progress.ended.load(Ordering::Relaxed) {
        let (done, total) = (progress.cycles.load(Ordering::Relaxed), progress.total.load(Ordering::Relaxed));
        bar.set_length(total.max(done));
        bar.set_position(done);
        if stop.load(Ordering::Relaxed) && !told {
            told = true;
            bar.suspend(|| note("stopping: the robot ramps down; another Ctrl-C ends at once"));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    bar.finish_and_clear();
}
