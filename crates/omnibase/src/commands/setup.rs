//! `omnibase setup`: from drives on a bus to a robot's file, step by step.

mod heard;
mod lines;
mod person;

use super::calibrate::{Known, write};
use crate::Outcome;
use crate::progress::note;
use crate::target::{AnyClock, Manners, Port, Target};
use anyhow::Context;
use omnibase_ethercat::wire::Link;
use omnibase_robot::Registry;
use omnibase_run::pace::PacedClock;
use omnibase_setup::{Calibrated, Ended, Guide, Hand, Outside, Record, Step, Wished};
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};

/// Sets a robot up: which drive turns which wheel, which way and how far, with a held key; ends in its file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml      begun with a file whose platform is right
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml      the same again: taken up where it was left
  omnibase setup eth1 --robot robots/bmm.toml -o mine.toml --lines   a program answers, line by line (JSON)

ALL WHEELS OFF THE GROUND, one hand on the emergency stop. A drive turns only while the space bar is held, at a tenth of its
rated torque and half a radian per second; a key that isn't heard for a quarter of a second, or a terminal that is gone, stops
it. Steps: find, jog each wheel (which, which way, how far), alias or switch of each drive, enable without moving, brakes,
emergency stop, parameters, file; then on the floor the first metre, and a calibration by a tape. What was
found and done stands beside the file, as .state.json and .record.md; another file of that name is left alone. `omnibase run` and `calibrate` go on from there.
[guide: docs/guides/any-device.md]")]
pub struct Arguments {
    /// Network interface, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    #[command(flatten)]
    manners: Manners,
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
    anyhow::ensure!((1..=500).contains(&arguments.torque_per_mille), "--torque-per-mille: expected 1 to 500");
    let base = std::fs::read_to_string(&arguments.robot)
        .with_context(|| format!("reading `{}`", arguments.robot.display()))?;
    let (state, told) = (beside(&arguments.output, "state.json"), beside(&arguments.output, "record.md"));
    let before = kept_record(&state)?;
    is_own(&arguments.output, before.as_ref())?;
    let record = match before {
        Some(record) if !arguments.anew => {
            note(format_args!("taken up from `{}`; --anew begins anew", state.display()));
            record
        }
        _ => Record::default(),
    };
    let wished = Wished {
        wheel_speed_rad_s: speed,
        torque_per_mille: arguments.torque_per_mille,
        ..Wished::new(base)
    };
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
    let mut kept = Ok(());
    let mut keep = |record: &Record| kept = write_whole(&state, record.to_json());
    let mut hand: Box<dyn Hand> = if arguments.lines {
        Box::new(lines::Lines::new(BufReader::new(std::io::stdin()), std::io::stdout()))
    } else {
        Box::new(person::Person::default())
    };
    let mut back_up = |position: u16, bytes: &[u8]| {
        let path = beside(&arguments.output, &format!("eeprom-{position}.bin"));
        // What it held at first is what may be wanted back.
        if path.exists() { Ok(()) } else { write_whole(&path, bytes).map_err(|error| format!("{error:#}")) }
    };
    let outside = Outside { hand: hand.as_mut(), keep: &mut keep, back_up: &mut back_up };
    let mut guide = Guide::new(wished, record, &mut open, outside)?;
    let ended = guide.run();
    let record = guide.record.clone();
    let calibrated = if record.takes_calibration { guide.calibrated()? } else { None };
    drop(hand);
    write_whole(&state, record.to_json())?;
    write_whole(&told, in_words(&record))?;
    kept?;
    match ended? {
        Ended::Left(text) => {
            if let Some(text) = text {
                write_whole(&arguments.output, text)?;
            }
            note(format_args!("left; the same command takes it up again (`{}`)", state.display()));
            Ok(Outcome::Failed)
        }
        Ended::File(text) => {
            let text = match &calibrated {
                Some(calibrated) => with_wheels(&text, calibrated)?,
                None => text,
            };
            write_whole(&arguments.output, text)?;
            let file = arguments.output.display();
            if !arguments.lines {
                writeln!(
                    output,
                    "{file} is written; {} findings, in {}",
                    record.findings.len(),
                    told.display()
                )?;
                writeln!(
                    output,
                    "next: omnibase check {file}, and what a tape can't show: omnibase calibrate {file}"
                )?;
            }
            Ok(Outcome::Done)
        }
    }
}

/// A file beside the one that is written.
fn beside(file: &Path, end: &str) -> PathBuf {
    file.with_extension(end)
}

/// What a set-up that was left has kept.
fn kept_record(state: &Path) -> anyhow::Result<Option<Record>> {
    match std::fs::read_to_string(state) {
        Ok(text) => Record::from_json(&text)
            .map(Some)
            .map_err(|error| anyhow::anyhow!("`{}`: {error}", state.display())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("reading `{}`", state.display())),
    }
}

/// The file that is written is none that somebody else wrote.
fn is_own(file: &Path, before: Option<&Record>) -> anyhow::Result<()> {
    let has_written = before.is_some_and(|record| record.done.contains(&Step::File));
    anyhow::ensure!(
        has_written || !file.exists(),
        "`{}` exists, and no set-up wrote it: give --output another name",
        file.display()
    );
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

/// The robot's file with the wheels that a tape found.
fn with_wheels(text: &str, calibrated: &Calibrated) -> anyhow::Result<String> {
    let Calibrated { expected, tolerances, solution } = calibrated;
    let known = Known { build: expected.clone(), tolerances: *tolerances };
    write::changed(text, (&known, solution, write::SensorNames::default()), &Registry::with_built_in())
}

/// The record for people.
fn in_words(record: &Record) -> String {
    let mut text = String::from("# Set-up\n\n");
    let done: Vec<&str> = record.done.iter().map(|step| step.words()).collect();
    text +=
        &format!("Done: {}.\n\n", if done.is_empty() { "nothing yet".to_owned() } else { done.join("; ") });
    for (head, lines) in
        [("## Not as the file had it", &record.findings), ("## What was done, in order", &record.log)]
    {
        text += &format!("{head}\n\n");
        lines.iter().for_each(|line| text += &format!("- {}\n", line.replace(char::is_control, " ")));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_no_set_up_wrote_is_left_alone_and_a_state_is_whole_or_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        let left = Record { done: vec![Step::Find], ..Record::default() };
        let ended = Record { done: Step::ALL.to_vec(), ..Record::default() };
        assert!(is_own(&file, None).is_ok());
        std::fs::write(&file, "by hand").unwrap();
        for before in [None, Some(&left)] {
            let words = is_own(&file, before).unwrap_err().to_string();
            assert!(words.contains("mine.toml` exists, and no set-up wrote it"), "{words}");
        }
        assert!(is_own(&file, Some(&ended)).is_ok());

        let state = beside(&file, "state.json");
        assert_eq!(kept_record(&state).unwrap(), None);
        write_whole(&state, left.to_json()).unwrap();
        assert_eq!(kept_record(&state).unwrap(), Some(left));
        // Where the new one can't be written the old one stays.
        std::fs::create_dir(folder.path().join("mine.state.json.new")).unwrap();
        assert!(write_whole(&state, "half").is_err());
        assert!(kept_record(&state).unwrap().is_some());
        std::fs::write(&state, "half").unwrap();
        assert!(kept_record(&state).unwrap_err().to_string().contains("mine.state.json"));
    }
}
