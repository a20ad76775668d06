//! `omnibase setup`: from drives on a bus to a robot's file, step by step.

mod heard;
mod lines;
mod page;
mod person;
#[cfg(test)]
mod tests;

use super::DASHBOARD;
use super::calibrate::{Known, write};
use crate::Outcome;
use crate::progress::note;
use crate::real_time::RealTime;
use crate::small_file;
use crate::target::{AnyClock, Manners, Port, Target};
use crate::token;
use anyhow::Context;
use lines::Over;
use omnibase_dashboard::Access;
use omnibase_ethercat::wire::Link;
use omnibase_host::{FileLock, stop_on_signals};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::pace::PacedClock;
use omnibase_setup::{
    Calibrated, Ended, Guide, Hand, MOST_JOG_TORQUE_PER_MILLE, Outside, Record, SetupError, Step, Wished,
    robot_file,
};
use std::convert::Infallible;
use std::io::{BufReader, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How the record for people begins.
const RECORD_HEAD: &str = "# Set-up\n\n";

/// Sets a robot up: which drive turns which wheel, which way and how far, with a held key; ends in its file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml      begun with a file whose platform is right
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml      the same again: taken up where it was left
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml --dashboard   on a page, with a button to be held
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml --lines   a program answers, line by line (JSON)

ALL WHEELS OFF THE GROUND, one hand on the emergency stop. A drive turns only while the space bar, or the page's button, is held,
at a tenth of its rated torque and half a radian per second; a key that isn't heard for a quarter of a second, or a terminal or page
that is gone, stops it. Drives that the file has as a [[device]] (a lift) are never turned, and with more drives than wheels you are
asked first which turn none. Steps: find, jog each wheel (which, which way, how far), alias or switch of each drive, enable without moving, brakes,
emergency stop, parameters, file; then on the floor the first metre, and a calibration by a tape. With --lines
each line is a JSON object. Out: {\"tell\": text}, {\"question\": {id, text, choices, default}}, {\"hold\": what}; in: {\"answer\": text},
{\"key\": true} for each beat of the held key, {\"key\": false} where it is let go, {\"leave\": true}; in the end
{\"over\": {is_whole, findings, text}}. A key that is still down when a motion begins is none of its own: let it go first. What was
found and done stands beside the file, as .state.json and .record.md, and what was passed over: the same command offers it again; another file of that name is left alone. `omnibase run` and `calibrate` go on from there.
[guide: docs/guides/any-device.md]")]
pub struct Arguments {
    /// Network interface, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    #[command(flatten)]
    manners: Manners,
    #[command(flatten)]
    real_time: RealTime,
    /// A robot's file whose platform, limits and names of wheels hold; what it says of drives is confirmed.
    #[arg(long, value_name = "FILE")]
    robot: PathBuf,
    /// The robot's file that is written.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Speed of a jogged wheel, rad/s.
    #[arg(long, value_name = "RAD_S", default_value_t = 0.5)]
    wheel_speed_rad_s: f64,
    /// Torque of a jogged wheel, per mille of its motor's rated.
    #[arg(long, value_name = "PER_MILLE", default_value_t = 100)]
    torque_per_mille: u16,
    /// Questions on the standard output, answers on the standard input, a JSON object each line.
    #[arg(long)]
    lines: bool,
    /// Serve a page on which the questions are answered and a button is held, in place of the terminal. Elsewhere than on
    /// loopback nobody gets in without the token.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = DASHBOARD,
        conflicts_with = "lines"
    )]
    dashboard: Option<SocketAddr>,
    /// A file of mode 0600 with the page's secret. Otherwise the environment variable OMNIBASE_TOKEN says it, or a new one
    /// is made.
    #[arg(long, value_name = "FILE", requires = "dashboard")]
    token_file: Option<PathBuf>,
    /// Refused: everybody would see it.
    #[arg(long, hide = true, value_parser = token::refused)]
    token: Option<Infallible>,
    /// Begin anew, whatever was done before.
    #[arg(long)]
    anew: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let speed = arguments.wheel_speed_rad_s;
    anyhow::ensure!(
        (0.01..=5.0).contains(&speed),
        "--wheel-speed-rad-s {speed}: expected 0.01 to 5, for somebody must see it"
    );
    let torque = arguments.torque_per_mille;
    anyhow::ensure!(
        (1..=MOST_JOG_TORQUE_PER_MILLE).contains(&torque),
        "--torque-per-mille {torque}: expected 1 to {MOST_JOG_TORQUE_PER_MILLE}"
    );
    let base = small_file::text(&arguments.robot)?;
    let (state, told) = (beside(&arguments.output, "state.json"), beside(&arguments.output, "record.md"));
    let plan = robot_file::plan(&base, &Registry::with_built_in())?;
    // Two that write one state would each lose what the other found.
    let _sole = FileLock::take(&state)?;
    let before = match kept_record(&state) {
        // Nobody needs what can't be read to begin anew; it is set aside all the same.
        Err(_) if arguments.anew => None,
        before => before?,
    };
    is_own(&arguments.output, &told, before.as_ref())?;
    let record = match before {
        Some(record) if !arguments.anew => {
            note(format_args!("taken up from `{}`; --anew begins anew", state.display()));
            with_file(record, &arguments.output)?
        }
        before => {
            if let Some(aside) = set_aside(&arguments.output, &state)? {
                note(format_args!("begun anew; what was found before is in `{}`", aside.display()));
            }
            anew(before.unwrap_or_default())
        }
    };
    let wished = Wished {
        cycle: Duration::from_nanos(plan.bus.cycle_ns),
        wheel_speed_rad_s: speed,
        torque_per_mille: torque,
        ..Wished::new(base)
    };
    // What can't be kept is better known before anything turns.
    write_whole(&state, record.to_json())?;
    let mut open = || -> Result<(Box<dyn Link>, AnyClock), String> {
        let cable =
            arguments.manners.enter(&arguments.target, Port::Socket).map_err(|error| format!("{error:#}"))?;
        // Somebody holds a key in real time.
        let clock = match cable.clock {
            AnyClock::Virtual(clock) => AnyClock::Paced(PacedClock::new(clock)),
            other => other,
        };
        Ok((cable.link, clock))
    };
    let mut keep =
        |record: &Record| write_whole(&state, record.to_json()).map_err(|error| format!("{error:#}"));
    let mut hand = Operator::of(arguments, &plan, &record)?;
    // The page's thread is there by now.
    let _granted = arguments.real_time.apply(wished.cycle)?;
    let mut back_up = |position: u16, bytes: &[u8]| {
        back_up(&arguments.output, position, bytes).map_err(|error| format!("{error:#}"))
    };
    let mut write = |record: &Record, text: &str| {
        write_own(&arguments.output, &told, record, text).map_err(|error| format!("{error:#}"))
    };
    let outside = Outside { hand: hand.as_hand(), keep: &mut keep, back_up: &mut back_up, write: &mut write };
    let mut guide = Guide::new(wished, record, &mut open, outside)?;
    let ended = guide.run();
    let calibrated = if guide.record.takes_calibration { guide.calibrated() } else { Ok(None) };
    let finished = ended
        .map_err(Into::into)
        .and_then(|ended| finished(ended, calibrated, &mut |text| guide.write_file(text)));
    let record = guide.record.clone();
    let finish = || {
        write_whole(&state, record.to_json())?;
        write_whole(&told, in_words(&record))?;
        finished
    };
    let finished = finish();
    let words = match &finished {
        Ok(true) => {
            let (file, told) = (arguments.output.display(), told.display());
            let passed_over = passed_over(&record).map_or(String::new(), |words| {
                format!("\nPASSED OVER, and offered again by the same command: {words}")
            });
            format!(
                "{file} is written; {} findings, in {told}{passed_over}\nnext: omnibase check {file}, and what a tape can't show: omnibase calibrate {file}",
                record.findings.len()
            )
        }
        Ok(false) => format!("left; the same command takes it up again (`{}`)", state.display()),
        Err(error) => format!("{error:#}"),
    };
    let findings = record.findings.len();
    hand.end(&Over { is_whole: matches!(finished, Ok(true)), findings, text: words.clone() });
    match finished {
        Ok(true) if arguments.lines => Ok(Outcome::Done),
        Ok(true) => {
            writeln!(output, "{words}")?;
            Ok(Outcome::Done)
        }
        Ok(false) => {
            note(format_args!("{words}"));
            Ok(Outcome::Failed)
        }
        Err(error) => Err(error),
    }
}

/// What a set-up was left with; the step that writes the robot's file is to be done again where that isn't there.
fn with_file(mut record: Record, output: &Path) -> anyhow::Result<Record> {
    if record.done.contains(&Step::File) && what_is_there(output)?.is_none() {
        note(format_args!("`{}` isn't there: it is written again", output.display()));
        record.done.retain(|step| *step != Step::File);
    }
    Ok(record)
}

/// Writes the robot's file, unless it is somebody else's by now: a set-up takes its time.
fn write_own(output: &Path, told: &Path, record: &Record, text: &str) -> anyhow::Result<()> {
    is_own(output, told, Some(record))
        .context("what was found is kept: put that file elsewhere, and take the set-up up again")?;
    write_whole(output, text)
}

/// Writes what it came to; whether it is the whole file.
fn finished(
    ended: Ended,
    calibrated: Result<Option<Calibrated>, SetupError>,
    write: &mut dyn FnMut(&str) -> Result<(), SetupError>,
) -> anyhow::Result<bool> {
    let (text, is_whole) = match ended {
        Ended::Left(text) => (text, false),
        Ended::File(text) => (Some(text), true),
    };
    let Some(text) = text else { return Ok(is_whole) };
    let with_wheels = match calibrated {
        Ok(Some(calibrated)) => with_wheels(&text, &calibrated),
        Ok(None) => Ok(text.clone()),
        Err(error) => Err(error.into()),
    };
    // Whatever came of the tape, the file is there.
    let text = with_wheels.as_ref().unwrap_or(&text);
    write(text)?;
    with_wheels.context("the file is written without the wheels that the tape found: measure again")?;
    Ok(is_whole)
}

/// Keeps what an EEPROM holds beside the robot's file; what was kept before stays as it is.
fn back_up(output: &Path, position: u16, bytes: &[u8]) -> anyhow::Result<()> {
    for path in paths(output, &format!("eeprom-{position}"), "bin") {
        match what_is_there(&path)? {
            None => return write_whole(&path, bytes),
            Some(kept) if kept == bytes => return Ok(()),
            Some(_) => {}
        }
    }
    anyhow::bail!("no name is free beside `{}`", output.display())
}

/// Names beside a file: `mine.name.end`, `mine.name.2.end`, and so on.
fn paths(file: &Path, name: &str, end: &str) -> impl Iterator<Item = PathBuf> {
    let numbered = (2..).map(move |number: u32| format!("{name}.{number}.{end}"));
    std::iter::once(format!("{name}.{end}")).chain(numbered).map(move |end| beside(file, &end))
}

/// The first of them that nobody has: what was set aside before stays.
fn free(file: &Path, name: &str, end: &str) -> anyhow::Result<PathBuf> {
    for path in paths(file, name, end) {
        if what_is_there(&path)?.is_none() {
            return Ok(path);
        }
    }
    anyhow::bail!("no name is free beside `{}`", file.display())
}

/// What a set-up that is begun anew must know of the one before: files, an EEPROM and drives that it didn't leave whole.
fn anew(Record { written, to_be_written, writing, jogged, .. }: Record) -> Record {
    Record { written, to_be_written, writing, jogged, ..Record::default() }
}

/// Keeps a state beside itself; it stays what it is until a new one is written over it.
fn set_aside(output: &Path, state: &Path) -> anyhow::Result<Option<PathBuf>> {
    let Some(bytes) = what_is_there(state)? else { return Ok(None) };
    let aside = free(output, "state.before", "json")?;
    write_whole(&aside, bytes)?;
    Ok(Some(aside))
}

/// Whoever is asked and holds the key.
enum Operator {
    /// At the terminal.
    Person(person::Person),
    /// A program.
    Lines(lines::Lines<std::io::Stdout>),
    /// At the page.
    Page(Box<page::Page>),
}

impl Operator {
    fn of(arguments: &Arguments, plan: &RobotPlan, record: &Record) -> anyhow::Result<Self> {
        // Whoever ends the program ends a motion in order: the drive is disabled before the program is gone.
        let stop = stop_on_signals().context("signals")?;
        if arguments.lines {
            let input = BufReader::new(std::io::stdin());
            return Ok(Operator::Lines(lines::Lines::new(input, std::io::stdout(), stop)));
        }
        let Some(address) = arguments.dashboard else {
            return Ok(Operator::Person(person::Person::new(stop)));
        };
        let mut access = Access::new(address).context("making a token")?;
        if let Some(token) = token::given(arguments.token_file.as_deref())? {
            access.token = token;
        }
        let page = page::Page::start(access.clone(), plan, record, stop)?;
        note(format_args!("dashboard: {}", access.url(page.address())));
        Ok(Operator::Page(Box::new(page)))
    }

    fn as_hand(&mut self) -> &mut dyn Hand {
        match self {
            Operator::Person(person) => person,
            Operator::Lines(lines) => lines,
            Operator::Page(page) => page.as_mut(),
        }
    }

    /// Is told how it ended.
    fn end(self, over: &Over) {
        match self {
            Operator::Person(_) => {}
            Operator::Lines(lines) => lines.end(over),
            Operator::Page(page) => page.end(over.text.clone()),
        }
    }
}

/// A file beside the one that is written.
fn beside(file: &Path, end: &str) -> PathBuf {
    file.with_extension(end)
}

/// What a set-up that was left has kept.
fn kept_record(state: &Path) -> anyhow::Result<Option<Record>> {
    let Some(bytes) = what_is_there(state)? else { return Ok(None) };
    let record = Record::from_json(&String::from_utf8_lossy(&bytes));
    record.map(Some).map_err(|error| anyhow::anyhow!("`{}`: {error}; --anew begins anew", state.display()))
}

/// What a file holds; `None` where there is none. One that is there and can't be read is an error: it would be written over.
fn what_is_there(path: &Path) -> anyhow::Result<Option<Vec<u8>>> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("reading `{}`", path.display())),
    }
}

/// The files that are written are none that somebody else wrote, or changed since.
fn is_own(file: &Path, told: &Path, before: Option<&Record>) -> anyhow::Result<()> {
    if let Some(found) = what_is_there(file)? {
        let has_written = before.is_some_and(|record| record.done.contains(&Step::File));
        let known = before
            .map_or([None, None], |record| [&record.written, &record.to_be_written].map(Option::as_ref));
        let mut known = known.into_iter().flatten().peekable();
        let is_known = known.peek().is_some();
        anyhow::ensure!(
            is_known || has_written,
            "`{}` exists, and no set-up wrote it: give --output another name",
            file.display()
        );
        anyhow::ensure!(
            !is_known || known.any(|text| text.as_bytes() == found),
            "`{0}` was changed since the set-up wrote it, and would be written over: give --output another name, with --robot {0} \
             where you want to go on from there",
            file.display()
        );
    }
    if let Some(found) = what_is_there(told)? {
        anyhow::ensure!(
            found.starts_with(RECORD_HEAD.as_bytes()),
            "`{}` exists, and no set-up wrote it: give --output another name",
            told.display()
        );
    }
    Ok(())
}

/// Writes a file that is whole at every instant: beside its place, and renamed.
fn write_whole(path: &Path, text: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let write = || {
        let mut file = std::fs::File::create(&beside)?;
        file.write_all(text.as_ref())?;
        file.sync_all()?;
        std::fs::rename(&beside, path)
    };
    write().with_context(|| format!("writing `{}`", path.display()))
}

/// The robot's file with the wheels that a tape found, checked.
fn with_wheels(text: &str, calibrated: &Calibrated) -> anyhow::Result<String> {
    let Calibrated { expected, tolerances, solution } = calibrated;
    let known = Known { build: expected.clone(), tolerances: *tolerances };
    let registry = Registry::with_built_in();
    let text = write::changed(text, &known, solution, write::SensorNames::default(), &registry)?;
    robot_file::plan(&text, &registry)?;
    Ok(text)
}

/// What of the steps that are over somebody went on without, in words.
fn passed_over(record: &Record) -> Option<String> {
    let all: Vec<String> = record.done.iter().filter_map(|step| record.passed_over_of(*step)).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// The record for people.
fn in_words(record: &Record) -> String {
    let mut text = String::from(RECORD_HEAD);
    let over = || record.done.iter().map(|step| (step.words(), record.passed_over_of(*step)));
    let done: Vec<&str> =
        over().filter(|(_, passed_over)| passed_over.is_none()).map(|(words, _)| words).collect();
    text +=
        &format!("Done: {}.\n\n", if done.is_empty() { "nothing yet".to_owned() } else { done.join("; ") });
    if let Some(passed_over) = passed_over(record) {
        text += &format!("PASSED OVER, and offered again by the same command: {passed_over}.\n\n");
    }
    for (head, lines) in
        [("## Not as the file had it", &record.findings), ("## What was done, in order", &record.log)]
    {
        text += &format!("{head}\n\n{}", if lines.is_empty() { "Nothing.\n" } else { "" });
        lines.iter().for_each(|line| text += &format!("- {}\n", line.replace(char::is_control, " ")));
        text.push('\n');
    }
    text
}
