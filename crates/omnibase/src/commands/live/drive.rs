//! `omnibase drive`: twists of a program outside, driven by a running robot.

use super::{Line, Which, lines};
use crate::Outcome;
use crate::progress::note;
use omnibase_client::{Frame, Heard, Seat};
use std::io::Write;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

/// Looked for lines and for news of the robot at least so often.
const LOOK: Duration = Duration::from_millis(5);
/// The program says so often that it lives.
const LIVE: Duration = Duration::from_millis(100);
/// The longest wait at the end for the robot to come to rest.
const REST: Duration = Duration::from_secs(10);

/// Drives a running robot by lines of standard input: `vx vy turn`, in m/s and rad/s.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  my_planner | omnibase drive                     a line for each twist: 0.2 0 0.1
  my_planner | omnibase drive --frame odom --hold 150ms

Each line counts from when it is read here. Where none follows it for --hold the robot comes to rest, and drives again with
the next line; so it does at the end of the input. What stops the robot otherwise ends this program: a person looks, enables
the robot, and starts it again. Limits, fence and obstacles keep the last word.")]
pub struct Drive {
    /// The frame of the twists: body or odom.
    #[arg(long, value_parser = parse_frame, default_value = "body")]
    frame: Frame,
    /// For how long a line counts, as 100ms; by 50 ms or more below the robot's safety.command_age_ms.
    #[arg(long, value_name = "TIME", value_parser = parse_hold, default_value = "100ms")]
    hold: Duration,
    #[command(flatten)]
    which: Which,
}

fn parse_frame(text: &str) -> Result<Frame, String> {
    match text {
        "body" => Ok(Frame::Body),
        "odom" => Ok(Frame::Odom),
        _ => Err(format!("expected body or odom, found `{text}`")),
    }
}

fn parse_hold(text: &str) -> Result<Duration, String> {
    let ms = text.strip_suffix("ms").and_then(|number| number.parse::<u64>().ok());
    let hold = ms.filter(|ms| (1..=10_000).contains(ms)).map(Duration::from_millis);
    hold.ok_or_else(|| format!("expected a time from 1ms to 10000ms, found `{text}`"))
}

/// A line: vx vy turn.
fn parse_twist(line: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("`{line}`: expected three finite numbers, vx vy turn");
    let numbers: Option<Vec<f64>> = line.split_whitespace().map(|part| part.parse().ok()).collect();
    let twist: [f64; 3] = numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(wrong)?;
    if twist.iter().all(|speed| speed.is_finite()) { Ok(twist) } else { Err(wrong()) }
}

/// Runs `omnibase drive`.
pub fn drive(arguments: &Drive, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut seat = Seat::take(&Line::new(&arguments.which)?.robot)?;
    note(format_args!("the robot knows this program as {}", seat.name()));
    let driven = drive_lines(arguments, &mut seat);
    // Whatever ended it: nobody drives any more, and the robot is told so before the connection ends.
    let rests = rest(&mut seat);
    writeln!(output, "{} twists", driven?)?;
    rests?;
    Ok(Outcome::Done)
}

/// Lets go, and waits until the robot no longer follows.
fn rest(seat: &mut Seat) -> anyhow::Result<()> {
    seat.let_go()?;
    let begun = Instant::now();
    while begun.elapsed() < REST {
        match seat.hear(LIVE)? {
            Some(Heard::Status(status)) if status["commander"] != seat.name() => return Ok(()),
            _ => seat.live()?,
        }
    }
    Ok(())
}

/// Drives until the input ends; how many twists there were.
fn drive_lines(arguments: &Drive, seat: &mut Seat) -> anyhow::Result<u64> {
    let lines = lines();
    let (mut twists, mut held, mut said) = (0, None::<Instant>, Instant::now());
    loop {
        match lines.recv_timeout(LOOK) {
            Ok((read, line)) => {
                let twist = parse_twist(&line?).map_err(anyhow::Error::msg)?;
                seat.drive(twist, arguments.frame, read)?;
                (twists, held, said) = (twists + 1, Some(read), Instant::now());
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(twists),
        }
        if held.is_some_and(|read| read.elapsed() > arguments.hold) {
            seat.let_go()?;
            (held, said) = (None, Instant::now());
        }
        if said.elapsed() > LIVE {
            seat.live()?;
            said = Instant::now();
        }
        while let Some(heard) = seat.hear(Duration::ZERO)? {
            tell(&heard, seat.name())?;
        }
        anyhow::ensure!(!seat.is_blocked(), "the stick was lost: twists came too late, or none came");
    }
}

/// Tells the user what the robot says of this program; an error where it refuses what it was told.
fn tell(heard: &Heard, name: &str) -> anyhow::Result<()> {
    match heard {
        Heard::Answer(answer) => anyhow::ensure!(answer.done, "{}", answer.text),
        Heard::Status(status) => {
            let events = status["events"].as_array().into_iter().flatten();
            let texts = events.filter_map(|event| event["text"].as_str());
            for text in texts.filter_map(|text| text.strip_suffix(&format!(" ({name})"))) {
                note(format_args!("{text}"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_three_finite_numbers() {
        assert_eq!(parse_twist("0.2 -1e-1\t0"), Ok([0.2, -0.1, 0.0]));
        for wrong in ["", "1 2", "1 2 3 4", "1 2 x", "nan 0 0", "0 inf 0", "1,2,3"] {
            let refused = parse_twist(wrong).unwrap_err();
            assert_eq!(refused, format!("`{wrong}`: expected three finite numbers, vx vy turn"));
        }
    }

    #[test]
    fn a_line_counts_for_some_ms() {
        assert_eq!(parse_hold("150ms"), Ok(Duration::from_millis(150)));
        for wrong in ["", "150", "0ms", "1s", "-5ms", "10001ms", "1.5ms"] {
            assert!(parse_hold(wrong).is_err(), "{wrong}");
        }
    }
}
