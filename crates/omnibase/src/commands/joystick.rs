//! `omnibase joystick`: the devices that are there, the map, and live values.

mod view;

use crate::Outcome;
use crate::joystick::{JoystickOptions, Source};
use crate::progress::note;
use crate::robot_file::{Changes, RobotSource};
use omnibase_host::stop_on_signals;
use omnibase_joystick::port::Happened;
use omnibase_joystick::{Map, Recorder, find};
use omnibase_robot::Registry;
use omnibase_robot::config::{JoystickTable, Limits};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use view::View;

/// Between two looks at the device.
const TURN: Duration = Duration::from_millis(5);
/// Between two pictures on a terminal.
const PICTURE: Duration = Duration::from_millis(50);
/// Between two looks at events that are played as fast as they can be, ns.
const PLAYED_TURN_NS: u64 = 5_000_000;

/// Shows which joysticks are there, what their axes and buttons do, and live values: raw, shaped, and as speeds.
///
/// Without a robot file the maps are the ready ones, and speeds are parts of the greatest ones.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase joystick --list                              devices that are there
  omnibase joystick robots/bmm.toml                     the map and live values of the first one that fits
  omnibase joystick --record joystick.events               keep its events
  omnibase joystick --events joystick.events --json        play them, without any device

Ctrl-C ends. Exit code 1 where there is no device.")]
pub struct Arguments {
    /// Robot file (TOML) with a `joystick` table.
    robot: Option<PathBuf>,
    #[command(flatten)]
    changes: Changes,
    /// The device, as /dev/input/event5.
    #[arg(long, value_name = "DEVICE", conflicts_with = "events")]
    device: Option<PathBuf>,
    /// List all input devices, and which map fits them.
    #[arg(long, conflicts_with_all = ["device", "events", "record"])]
    list: bool,
    /// Play recorded events in place of a device.
    #[arg(long, value_name = "FILE")]
    events: Option<PathBuf>,
    /// Record the events.
    #[arg(long, value_name = "FILE", conflicts_with = "events")]
    record: Option<PathBuf>,
    /// Print one JSON object per line: per device, and per change.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let (table, limits) = match &arguments.robot {
        Some(path) => {
            let robot = RobotSource::read(path, &arguments.changes)?.load_or_explain(registry)?;
            (robot.plan.joystick, Some(robot.plan.limits))
        }
        None => (JoystickTable::default(), None),
    };
    if arguments.list {
        return list(&table, arguments.json, output);
    }
    let path = arguments.device.clone().or_else(|| arguments.events.clone());
    let source = Source::open(&JoystickOptions { path, table: table.clone() })?;
    if let Source::Installed(finder) = &source
        && finder.path().is_none()
    {
        writeln!(
            output,
            "no joystick that a map fits is there; plug one in, or look at `omnibase joystick --list`"
        )?;
        return Ok(Outcome::Failed);
    }
    watch(arguments, source, &table, limits, output)
}

fn list(table: &JoystickTable, json: bool, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let listed = find::list(Path::new(find::FOLDER))?;
    if listed.is_empty() && !json {
        writeln!(output, "no input devices: there is nothing in {}", find::FOLDER)?;
    }
    for listed in &listed {
        let path = listed.path.display();
        match &listed.description {
            Ok(device) => {
                let map = Map::of(table, device);
                if json {
                    let line = view::device_json(Some(&listed.path), device, &map);
                    writeln!(output, "{line}")?;
                    continue;
                }
                let fit = match &map {
                    Ok(map) => format!("fits: {}", map.ready.name()),
                    Err(_) => "no map fits".to_owned(),
                };
                writeln!(
                    output,
                    "{path:<20} {:04x}:{:04x}  {} ({} axes, {} buttons; {fit})",
                    device.vendor_id,
                    device.product_id,
                    device.name,
                    device.axes.len(),
                    device.buttons.len(),
                )?;
            }
            Err(error) if json => {
                writeln!(output, "{}", serde_json::json!({"path": listed.path, "error": error.to_string()}))?;
            }
            Err(error) => writeln!(output, "{path:<20} can't be opened: {error}")?,
        }
    }
    Ok(Outcome::Done)
}

/// Plays or reads until Ctrl-C, or the recording's end.
fn watch(
    arguments: &Arguments,
    source: Source,
    table: &JoystickTable,
    limits: Option<Limits>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let stop = stop_on_signals()?;
    let is_played = matches!(source, Source::Recorded(_));
    let is_picture = !arguments.json && std::io::stdout().is_terminal();
    // Lines of a recording don't depend on who waits for them: no time passes but its own.
    let is_paced = is_picture || !is_played;
    let mut port = source.port(table);
    let mut view = View::new(limits, arguments.json, is_picture);
    let mut recorder: Option<Recorder> = None;
    let began = Instant::now();
    let (mut now_ns, mut shown) = (0, began - PICTURE);
    while !stop.load(Ordering::Relaxed) {
        now_ns = if is_paced { began.elapsed().as_nanos() as u64 } else { now_ns + PLAYED_TURN_NS };
        let (command, happened) = port.turn(now_ns);
        match &happened {
            Some(Happened::Plugged(device, state)) => {
                if let Some(path) = &arguments.record
                    && recorder.is_none()
                {
                    let file = Box::new(omnibase_record::create(path)?);
                    recorder = Some(Recorder::start(file, device, state)?);
                }
                if let Some(map) = port.joystick().map() {
                    view.map(map, output)?;
                }
            }
            Some(Happened::Events(events)) => {
                if let Some(recorder) = &mut recorder {
                    recorder.write(events)?;
                }
            }
            Some(Happened::Unplugged) if recorder.take().is_some() => {
                note("the device is gone: the recording ends here");
            }
            Some(Happened::Unplugged) | None => {}
        }
        if !is_picture {
            view.line(now_ns, &command, port.joystick(), happened.as_ref(), output)?;
            if is_paced {
                output.flush()?;
            }
        } else if shown.elapsed() >= PICTURE {
            view.picture(&command, port.joystick(), output)?;
            shown = Instant::now();
        }
        if is_played && happened == Some(Happened::Unplugged) {
            break;
        }
        if is_paced {
            std::thread::sleep(TURN);
        }
    }
    output.flush()?;
    Ok(Outcome::Done)
}
