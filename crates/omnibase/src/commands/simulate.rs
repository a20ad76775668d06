//! `omnibase simulate`: a segment behind a network interface.

mod fault;

use crate::progress::note;
use crate::robot_file::{Changes, RobotSource};
use crate::target::{Port, Target, finish_recording};
use crate::{Outcome, segment};
use fault::TimedFault;
use omnibase_ethercat_sim::{Segment, Served, serve};
use omnibase_ethercat_wire::sii::Image;
use omnibase_ethercat_wire::{Clock, HostTime, LinkError};
use omnibase_host::{LinkState, Waiting, interface, stop_on_signals};
use omnibase_robot::Registry;
use omnibase_run::simulated;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Simulates a segment, or a whole robot, behind a network interface, in real time, for any MainDevice. Ctrl-C ends it.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true), after_help = "Examples:
  omnibase simulate segments/three-sgdv.toml --interface veth1
  omnibase simulate robots/bmm.toml --interface veth1                the robot of a robot file: drives, wheels, floor
  omnibase simulate --sii ek1100.bin,el2828.bin --interface veth1    devices from SII images, in a line
  omnibase simulate segments/three-sgdv.toml --interface veth1 --fault power-cycle@1:5 --record run.pcapng

A virtual cable: sudo ip link add veth0 type veth peer name veth1; sudo ip link set veth0 up; the same for veth1.

Faults, `<fault>@<position>:<seconds after the start>[:<argument>]`:
  power-off@1:5   power-on@1:8   power-cycle@1:5:0.5 (off for so many seconds, default 1)
  cable-cut@1:5:2 (port, default 1)   cable-restored@1:8:2   crc-errors@1:5:10 (frames at port 0, default 1)
  al-error@1:5:0x1b (AL status code)   drive-fault@1:5:0x7500 (error code)
  mailbox-silence@1:5   mailbox-back@1:8   freeze@1:5   unfreeze@1:8")]
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
    /// Something that goes wrong, and when; may be given several times.
    #[arg(long, value_name = "FAULT@POSITION:SECONDS")]
    fault: Vec<TimedFault>,
    /// Record all frames into this pcapng file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let (mut segment, machine) = match &arguments.file {
        Some(path) if segment::is_robot(path)? => {
            let source = RobotSource::read(path, &arguments.changes)?;
            let robot = source.load_or_explain(&Registry::with_built_in())?;
            let (segment, machine) = simulated::segment(&robot.plan)?;
            (segment, Some(machine))
        }
        Some(path) => (segment::load(path)?, None),
        None => (segment::from_images(&arguments.sii)?, None),
    };
    let count = segment.sub_devices().len();
    for fault in &arguments.fault {
        anyhow::ensure!(
            fault.position < count,
            "fault `{fault}`: there is no SubDevice {}, the segment has {count}",
            fault.position
        );
    }
    let stop = stop_on_signals()?;
    let target = Target::Interface(arguments.interface.clone());
    // Sleeps to the microsecond: the SubDevices' own events are due between frames.
    let mut cable = target.open(Port::Ring(Waiting::Sleep))?;
    let mut recorder = None;
    if let Some(path) = &arguments.record {
        let (recorded, running) = cable.record(path)?;
        (cable, recorder) = (recorded, Some((running, path)));
    }
    describe(output, &segment, &arguments.interface)?;
    let mut faults = arguments.fault.clone();
    faults.sort_by_key(|fault| fault.after);
    let start = cable.clock.now();
    let mut server = Server { segment: &mut segment, cable: &mut cable, stop, served: Served::default() };
    for fault in &faults {
        server.serve_until(Some(start + fault.after), &arguments.interface)?;
        if stop.load(Ordering::Relaxed) {
            break;
        }
        match server.segment.inject(fault.position, fault.fault.clone()) {
            Ok(()) => note(format_args!("fault: {fault}")),
            Err(error) => note(format_args!("fault {fault} is not possible: {error}")),
        }
    }
    if !stop.load(Ordering::Relaxed) {
        server.serve_until(None, &arguments.interface)?;
    }
    let served = server.served;
    writeln!(output, "{} frames, {} answered, {} ignored", served.frames, served.answered, served.ignored)?;
    if let Some(machine) = machine {
        let pose = machine.truth().pose;
        writeln!(
            output,
            "true pose: x {:.6} m, y {:.6} m, heading {:.6} rad",
            pose.x_m, pose.y_m, pose.heading_rad
        )?;
    }
    drop(cable);
    if let Some((recorder, path)) = recorder {
        finish_recording(recorder, path)?;
    }
    Ok(Outcome::Done)
}

fn describe(output: &mut dyn Write, segment: &Segment, interface: &str) -> anyhow::Result<()> {
    let count = segment.sub_devices().len();
    writeln!(output, "simulating {count} SubDevices on {interface}; Ctrl-C ends")?;
    for (position, one) in segment.sub_devices().iter().enumerate() {
        match Image::parse(one.esc().sii_image()) {
            Ok((image, _)) => {
                let (name, identity) = (image.name().unwrap_or_default(), image.header.identity);
                let (vendor, product) = (identity.vendor_id, identity.product_code);
                writeln!(output, "{position:>4} {name:<40} vendor 0x{vendor:08x} product 0x{product:08x}")?;
            }
            Err(error) => writeln!(output, "{position:>4} {error}")?,
        }
    }
    // A script that waits for this line must not wait for the buffer to fill.
    output.flush()?;
    Ok(())
}

/// A segment that is being served.
struct Server<'a> {
    segment: &'a mut Segment,
    cable: &'a mut crate::target::Cable,
    stop: &'static AtomicBool,
    served: Served,
}

impl Server<'_> {
    /// Answers frames until the instant or until a signal; waits while the link is down.
    fn serve_until(&mut self, until: Option<HostTime>, interface: &str) -> anyhow::Result<()> {
        let pause = AtomicBool::new(false);
        let done = AtomicBool::new(false);
        let (clock, stop) = (self.cable.clock.clone(), self.stop);
        let ended = || stop.load(Ordering::Relaxed) || until.is_some_and(|until| clock.now() >= until);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) && !ended() {
                    std::thread::sleep(Duration::from_millis(5));
                }
                pause.store(true, Ordering::Relaxed);
            });
            let result = loop {
                match serve(self.segment, &mut *self.cable.link, &self.cable.clock, &pause) {
                    Ok(served) => {
                        self.served.frames += served.frames;
                        self.served.answered += served.answered;
                        self.served.ignored += served.ignored;
                        break Ok(());
                    }
                    Err(LinkError::Down) => {
                        note(format_args!("{interface}: the link is down, waiting for it"));
                        while interface::link_state(interface) != LinkState::Up && !ended() {
                            std::thread::sleep(Duration::from_millis(20));
                        }
                        if ended() {
                            break Ok(());
                        }
                        note(format_args!("{interface}: the link is up"));
                    }
                    Err(error) => break Err(error.into()),
                }
            };
            done.store(true, Ordering::Relaxed);
            result
        })
    }
}
