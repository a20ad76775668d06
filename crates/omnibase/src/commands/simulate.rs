//! `omnibase simulate`: a segment behind a network interface.

mod fault;
mod logbook;

use crate::progress::note;
use crate::real_time::RealTime;
use crate::robot_file::{Changes, RobotSource};
use crate::target::{Cable, Port, Target, finish_recording};
use crate::{Outcome, segment};
use fault::{FaultSource, TimedFault};
use logbook::{Arrival, Entry, Logbook, Standstill, TruePose, WatchdogStop};
use omnibase_ethercat_sim::{Fault, MainPort, Pace, RingEnds, Segment, Served, serve, serve_ring};
use omnibase_ethercat_wire::sii::Image;
use omnibase_ethercat_wire::{HostTime, LinkError};
use omnibase_host::interface::LinkWatch;
use omnibase_host::{InterfaceLock, LinkState, Waiting, interface, stop_on_signals, typed_lines};
use omnibase_robot::Registry;
use omnibase_robot_sim::SharedMachine;
use omnibase_run::simulated::{self, Script};
use serde::Serialize;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

/// Simulates a segment, or a whole robot, behind a network interface, in real time, for any MainDevice. Ctrl-C ends it.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true), after_help = "Examples:
  omnibase simulate segments/three-sgdv.toml --interface veth1
  omnibase simulate robots/bmm.toml --interface veth1                the robot of a robot file: drives, wheels, floor
  omnibase simulate segments/two-foreign.toml --interface veth1       firmware in programs of its own (C, SOES and the like)
  omnibase simulate --sii ek1100.bin,el2828.bin --interface veth1    devices from SII images, in a line
  omnibase simulate segments/three-sgdv.toml --interface veth1 --fault power-cycle@1:5 --record run.pcapng
  omnibase simulate robots/bmm.toml --interface veth1 --redundant veth3 --fault cable-cut@0:5:1    a ring that breaks

Frames count from their arrival: pauses of this program are not the bus's. States, watchdogs and standstills are
noted by the segment's own time; the end says where the robot really is.

A virtual cable: sudo ip link add veth0 type veth peer name veth1; sudo ip link set veth0 up; the same for veth1.

Faults, `<fault>@<position>:<seconds after the start>[:<argument>]`:
  power-off@1:5   power-on@1:8   power-cycle@1:5:0.5 (off for so many seconds, default 1)
  cable-cut@1:5:2 (port, default 1)   cable-restored@1:8:2   crc-errors@1:5:10 (frames at port 0, default 1)
  link-alone@1:5:2 (a cable with a link that no frame passes: a switch, or a neighbour that isn't ready)
  al-error@1:5:0x1b (AL status code)   drive-fault@1:5:0x7500 (error code)
  mailbox-silence@1:5   mailbox-back@1:8   freeze@1:5   unfreeze@1:8
  sto@1:5 (the safety input takes the torque)   sto-over@1:8
  brake@1:0:1500 (its motor has a brake that holds so many per mille of the rated torque; 50 is a worn one)
  push@1:5:300 (somebody turns its shaft by so many per mille of the rated torque)   push@1:8 (lets go)
With --fault - they are typed meanwhile, a line each; their seconds count from the line, and without any they come at
once: sto@1, push@1:0:300, push@1, power-off@2

What happens to the robot itself (pushes, payloads, the floor) is in its file, [[simulation.event]], counted from the start here.")]
pub struct Arguments {
    /// Segment file or robot file (TOML); which of them, its tables tell.
    #[arg(group = "what")]
    file: Option<PathBuf>,
    #[command(flatten)]
    changes: Changes,
    /// SII images in place of a segment file: a line of devices.
    #[arg(long, value_delimiter = ',', value_name = "IMAGE,IMAGE", group = "what")]
    sii: Vec<PathBuf>,
    /// Network interface on which to answer.
    #[arg(long)]
    interface: String,
    /// Network interface at the other end of a ring: its cable is plugged into port 1 of the last SubDevice.
    #[arg(long, value_name = "INTERFACE", conflicts_with = "record")]
    redundant: Option<String>,
    /// Something that goes wrong, and when; may be given several times. `-` reads them from standard input meanwhile.
    #[arg(long, value_name = "FAULT@POSITION:SECONDS")]
    fault: Vec<FaultSource>,
    /// Record all frames into this pcapng file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    real_time: RealTime,
    /// Print one JSON object at the end: {"frames", "true_pose", "events", "watchdogs", "standstills", "arrivals", ...}.
    #[arg(long)]
    json: bool,
}

/// What a simulation was, as `--json` prints it.
#[derive(Debug, Serialize)]
struct Report {
    /// Frames of a MainDevice.
    frames: u64,
    /// Of them, those that were answered.
    answered: u64,
    /// Foreign frames, and own ones that came back.
    ignored: u64,
    /// The longest time that a frame waited for this program, ms.
    longest_wait_ms: f64,
    /// The most by which the segment's time was behind the clock, ms.
    longest_behind_ms: f64,
    /// Looks at the segment, and those at which it was behind by more than 1 ms.
    looks: u64,
    looks_behind: u64,
    /// Where the robot really is; null for a segment without one.
    true_pose: Option<TruePose>,
    /// What happened.
    events: Vec<Entry>,
    /// Process-data watchdogs that expired.
    watchdogs: Vec<WatchdogStop>,
    /// Stops that no MainDevice led.
    standstills: Vec<Standstill>,
    /// SubDevices that reached OP, each time, with SYNC0 and clock.
    arrivals: Vec<Arrival>,
}

/// The period of a budget under SCHED_DEADLINE: whose cycle is served isn't known.
const SERVICE_PERIOD: Duration = Duration::from_millis(1);

impl Report {
    fn of(served: &Served, logbook: Logbook) -> Report {
        Report {
            frames: served.frames,
            answered: served.answered,
            ignored: served.ignored,
            longest_wait_ms: served.longest_wait_ns as f64 * 1e-6,
            longest_behind_ms: served.longest_behind_ns as f64 * 1e-6,
            looks: served.looks,
            looks_behind: served.looks_behind,
            true_pose: logbook.true_pose(),
            events: logbook.entries,
            watchdogs: logbook.watchdogs,
            standstills: logbook.standstills,
            arrivals: logbook.arrivals,
        }
    }
}

/// What is served.
struct Simulated {
    segment: Segment,
    /// The machine behind a robot's drives, and what happens to it.
    machine: Option<SharedMachine>,
    script: Option<Script>,
}

impl Simulated {
    fn of(arguments: &Arguments, registry: &Registry) -> anyhow::Result<Simulated> {
        let segment = match &arguments.file {
            Some(path) if segment::is_robot(path)? => {
                let source = RobotSource::read(path, &arguments.changes)?;
                let robot = source.load_or_explain(registry)?;
                let (mut segment, machine) = simulated::segment(&robot.plan)?;
                let script = Script::new(&robot.plan, &mut segment, &machine);
                return Ok(Simulated { segment, machine: Some(machine), script });
            }
            Some(path) => segment::load(path, Pace::Free)?,
            None => segment::from_images(&arguments.sii)?,
        };
        Ok(Simulated { segment, machine: None, script: None })
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Simulated { mut segment, machine, script } = Simulated::of(arguments, registry)?;
    let count = segment.sub_devices().len();
    if arguments.redundant.is_some() {
        segment.close_ring(count.saturating_sub(1), 1)?;
    }
    let mut faults = Vec::new();
    for source in &arguments.fault {
        let FaultSource::Timed(fault) = source else { continue };
        fault.expect_within(count).map_err(|why| anyhow::anyhow!("fault `{fault}`: {why}"))?;
        faults.push(fault.clone());
    }
    faults.sort_by_key(|fault| fault.after);
    let typed = arguments.fault.contains(&FaultSource::Lines).then(typed_lines);
    let stop = stop_on_signals()?;
    // Two simulators would both answer every frame.
    let interfaces = std::iter::once(&arguments.interface).chain(&arguments.redundant);
    let _locks = interfaces.map(|name| InterfaceLock::take(name)).collect::<Result<Vec<_>, _>>()?;
    let target = Target::Interface(arguments.interface.clone());
    // Sleeps to the microsecond: the SubDevices' own events are due between frames.
    let mut cable = target.open(Port::Ring(Waiting::Sleep))?;
    let mut other_end = None;
    if let Some(name) = &arguments.redundant {
        other_end = Some(Target::Interface(name.clone()).open(Port::Ring(Waiting::Sleep))?);
    }
    let mut recorder = None;
    if let Some(path) = &arguments.record {
        let (recorded, running) = cable.record(path)?;
        (cable, recorder) = (recorded, Some((running, path)));
    }
    let lines = describe(&segment, arguments);
    if arguments.json {
        lines.iter().for_each(note);
    } else {
        lines.iter().try_for_each(|line| writeln!(output, "{line}"))?;
        // A script that waits for these lines must not wait for the buffer to fill.
        output.flush()?;
    }
    let logbook = Logbook::new(&segment, machine);
    let interfaces = std::iter::once(&arguments.interface).chain(&arguments.redundant);
    let ports = [MainPort::Primary, MainPort::Redundant].into_iter().zip(interfaces);
    let ends = ports.map(|(port, name)| End { name: name.clone(), port, is_out: false }).collect();
    let links = LinkWatch::new()?;
    let mut watch = Watch { logbook, faults, typed, script, start: segment.now(), stop, ends, links };
    // Until the end of the service.
    let granted = arguments.real_time.apply(SERVICE_PERIOD)?;
    let served = watch.serve(&mut segment, &mut cable, other_end.as_mut())?;
    drop(granted);
    let report = Report::of(&served, watch.logbook);
    if arguments.json {
        serde_json::to_writer_pretty(&mut *output, &report)?;
        writeln!(output)?;
    } else {
        print(&report, output)?;
    }
    drop(cable);
    if let Some((recorder, path)) = recorder {
        finish_recording(recorder, path)?;
    }
    Ok(Outcome::Done)
}

fn print(report: &Report, output: &mut dyn Write) -> std::io::Result<()> {
    let Report { frames, answered, ignored, longest_wait_ms, longest_behind_ms, looks, looks_behind, .. } =
        report;
    writeln!(output, "{frames} frames, {answered} answered, {ignored} ignored")?;
    writeln!(output, "a frame waited {longest_wait_ms:.3} ms for this program at most")?;
    writeln!(
        output,
        "the segment's time was {longest_behind_ms:.3} ms behind the clock at most; by more than 1 ms at {looks_behind} of {looks} looks"
    )?;
    if let Some(pose) = report.true_pose {
        let TruePose { x_m, y_m, heading_rad } = pose;
        writeln!(output, "true pose: x {x_m:.6} m, y {y_m:.6} m, heading {heading_rad:.6} rad")?;
    }
    Ok(())
}

/// What is simulated, and where: a line for the segment, and one for each SubDevice.
fn describe(segment: &Segment, arguments: &Arguments) -> Vec<String> {
    let count = segment.sub_devices().len();
    let redundant = arguments.redundant.iter().map(|name| format!(" and {name}, a ring")).next();
    let interfaces = format!("{}{}", arguments.interface, redundant.unwrap_or_default());
    let mut lines = vec![format!("simulating {count} SubDevices on {interfaces}; Ctrl-C ends")];
    lines.extend(segment.sub_devices().iter().enumerate().map(|(position, one)| {
        match Image::parse(one.esc().sii_image()) {
            Ok((image, _)) => {
                let (name, identity) = (image.name().unwrap_or_default(), image.header.identity);
                let (vendor, product) = (identity.vendor_id, identity.product_code);
                format!("{position:>4} {name:<40} vendor 0x{vendor:08x} product 0x{product:08x}")
            }
            Err(error) => format!("{position:>4} {error}"),
        }
    }));
    lines
}

/// Looks on while a segment is served, and does to it what the command line asks for.
struct Watch {
    logbook: Logbook,
    /// Faults that are still to come, the next one first.
    faults: Vec<TimedFault>,
    /// Faults that are typed.
    typed: Option<Receiver<String>>,
    /// What happens to the robot, by its file.
    script: Option<Script>,
    start: HostTime,
    stop: &'static AtomicBool,
    /// The MainDevice's interfaces.
    ends: Vec<End>,
    links: LinkWatch,
}

/// One of the MainDevice's interfaces.
struct End {
    name: String,
    port: MainPort,
    /// Its cable is taken out of the segment, as it is out of the interface.
    is_out: bool,
}

impl Watch {
    /// Answers frames until a signal; waits while all links are down.
    fn serve(
        &mut self,
        segment: &mut Segment,
        cable: &mut Cable,
        mut other_end: Option<&mut Cable>,
    ) -> anyhow::Result<Served> {
        let mut all = Served::default();
        let stop = self.stop;
        let ended = || stop.load(Ordering::Relaxed);
        let names: Vec<String> = self.ends.iter().map(|end| end.name.clone()).collect();
        let interfaces = names.join(", ");
        let are_down = || names.iter().all(|name| interface::link_state(name) != LinkState::Up);
        loop {
            let watch = &mut |segment: &mut Segment| self.look(segment);
            let (link, clock) = (&mut *cable.link, &cable.clock);
            let result = match &mut other_end {
                None => serve(segment, link, clock, watch),
                Some(other) => {
                    let ends = RingEnds { primary: link, redundant: &mut *other.link };
                    serve_ring(segment, ends, clock, watch)
                }
            };
            match result {
                Ok(served) => {
                    all.frames += served.frames;
                    all.answered += served.answered;
                    all.ignored += served.ignored;
                    all.longest_wait_ns = all.longest_wait_ns.max(served.longest_wait_ns);
                    all.longest_behind_ns = all.longest_behind_ns.max(served.longest_behind_ns);
                    all.looks += served.looks;
                    all.looks_behind += served.looks_behind;
                    return Ok(all);
                }
                Err(LinkError::Down) => {
                    note(format_args!("{interfaces}: the link is down, waiting for it"));
                    while are_down() && !ended() {
                        std::thread::sleep(Duration::from_millis(20));
                    }
                    if ended() {
                        return Ok(all);
                    }
                    note(format_args!("{interfaces}: the link is up"));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Takes a ring's cable out of the segment where it is out of its interface: the chip there notices it at once.
    fn look_at_ends(&mut self, segment: &mut Segment) {
        if self.ends.len() < 2 {
            return;
        }
        let now = segment.now();
        for end in &mut self.ends {
            let is_out = self.links.state(&end.name) != LinkState::Up;
            if std::mem::replace(&mut end.is_out, is_out) == is_out {
                continue;
            }
            let Some((position, port)) = segment.main_plug(end.port) else { continue };
            let fault = if is_out { Fault::CableCut { port } } else { Fault::CableRestored { port } };
            let what = if is_out { "is out" } else { "is in again" };
            match segment.inject(position, fault) {
                Ok(()) => self.logbook.note(now, format!("the cable of {} {what}", end.name)),
                Err(error) => self.logbook.note(now, format!("the cable of {} {what}: {error}", end.name)),
            }
        }
    }

    /// Takes what was typed.
    fn hear(&mut self, now: HostTime, count: usize) {
        while let Some(typed) = &self.typed {
            let line = match typed.try_recv() {
                Ok(line) => line,
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    note("standard input has ended: no more faults are read");
                    self.typed = None;
                    return;
                }
            };
            match TimedFault::typed(&line, count, now - self.start) {
                Ok(fault) => {
                    let at = self.faults.partition_point(|earlier| earlier.after <= fault.after);
                    self.faults.insert(at, fault);
                }
                Err(error) => note(format_args!("`{line:.60}`: {error}")),
            }
        }
    }

    fn look(&mut self, segment: &mut Segment) -> ControlFlow<()> {
        self.logbook.look(segment);
        let now = segment.now();
        self.look_at_ends(segment);
        self.hear(now, segment.sub_devices().len());
        for fault in self.faults.extract_if(.., |fault| self.start + fault.after <= now) {
            match segment.inject(fault.position, fault.fault.clone()) {
                Ok(()) => self.logbook.note(now, format!("fault: {fault}")),
                Err(error) => self.logbook.note(now, format!("fault {fault} is not possible: {error}")),
            }
        }
        let since_start_ns = (now - self.start).as_nanos() as u64;
        while let Some(words) = self.script.as_mut().and_then(|script| script.next(since_start_ns)) {
            self.logbook.note(now, words.to_string());
        }
        match self.stop.load(Ordering::Relaxed) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}
