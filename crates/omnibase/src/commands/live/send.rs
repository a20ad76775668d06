//! `omnibase send`: what a program outside knows, on its way to a running robot.

use super::{Line, Which, lines};
use crate::Outcome;
use crate::every::Every;
use crate::progress::note;
use omnibase_client::Inputs;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

/// Looked for news of the robot at least so often.
const LOOK: Duration = Duration::from_millis(5);
/// So often at most it is told what was refused.
const TELL: Duration = Duration::from_secs(1);

/// Sends inputs to a running robot, as a `[[source]]` of its file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase send gate open=1                      once
  omnibase send gate open=1 --every 50ms         again and again, until Ctrl-C
  my_tracker | omnibase send mocap               a line for each measurement: x=1.2 y=0.4 heading=0.1 ..., or one JSON
                                                 object

Each line counts as measured when it is read here; what takes longer than the source's max_age_ms to the robot is not
believed there.")]
pub struct Send {
    /// The source's name.
    source: String,
    /// Its values; without any, lines of standard input are sent.
    #[arg(value_name = "NAME=VALUE", value_parser = parse_value)]
    values: Vec<(String, Option<f64>)>,
    /// Send the values again and again, as 50ms.
    #[arg(long, value_name = "TIME", requires = "values")]
    every: Option<Every>,
    #[command(flatten)]
    which: Which,
}

type Values = Map<String, Value>;

fn parse_value(text: &str) -> Result<(String, Option<f64>), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as open=1")?;
    let number: f64 = value.trim().parse().map_err(|_| format!("expected a number, found `{value}`"))?;
    // JSON, in which it is sent, has no other numbers; what isn't known is null there.
    Ok((name.trim().to_owned(), Some(number).filter(|number| number.is_finite())))
}

/// A line of standard input: `x=1 y=2`, or one JSON object.
fn parse_line(line: &str) -> Result<Values, String> {
    if line.trim_start().starts_with('{') {
        return serde_json::from_str(line).map_err(|error| error.to_string());
    }
    line.split_whitespace().map(|part| parse_value(part).map(|(name, value)| (name, json!(value)))).collect()
}

/// Tells the user what is refused, once a second.
struct Telling {
    refused: u64,
    at: Instant,
}

impl Telling {
    fn tell(&mut self, inputs: &Inputs) {
        let (heard, refused, why) = inputs.told();
        if refused > self.refused && (self.refused == 0 || self.at.elapsed() > TELL) {
            note(format_args!("{heard} heard, {refused} refused; the last: {why}"));
            (self.refused, self.at) = (refused, Instant::now());
        }
    }
}

/// Runs `omnibase send`.
pub fn send(arguments: &Send, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    // Lines are read, and grow old, while the robot is reached.
    let lines = arguments.values.is_empty().then(lines);
    let mut inputs = Inputs::open(&Line::new(&arguments.which)?.robot)?;
    let mut telling = Telling { refused: 0, at: Instant::now() };
    let source = &arguments.source;
    if let Some(lines) = lines {
        loop {
            match lines.recv_timeout(LOOK) {
                Ok((measured, line)) => {
                    let line = line?;
                    let values = parse_line(&line).map_err(|why| anyhow::anyhow!("`{line}`: {why}"))?;
                    inputs.send(source, &values, measured)?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            inputs.look(Duration::ZERO)?;
            telling.tell(&inputs);
        }
    } else {
        let values: Values =
            arguments.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
        let period = match arguments.every {
            None => None,
            Some(Every::Ns(ns)) => Some(Duration::from_nanos(ns)),
            Some(Every::Cycles(_)) => anyhow::bail!("--every: expected a time, as 50ms"),
        };
        loop {
            inputs.send(source, &values, Instant::now())?;
            let Some(period) = period else { break };
            std::thread::sleep(period);
            inputs.look(Duration::ZERO)?;
            telling.tell(&inputs);
        }
    }
    let untold = inputs.finish()?;
    let (heard, refused, why) = inputs.told();
    anyhow::ensure!(untold == 0, "the robot says nothing of {untold} messages");
    anyhow::ensure!(refused == 0, "{heard} of {} heard; refused: {why}", heard + refused);
    writeln!(output, "{heard} heard")?;
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_pairs_or_json() {
        let both = ["x=1 y=-2.5 heading=nan", r#"{"x": 1.0, "y": -2.5, "heading": null}"#];
        let [pairs, object] = both.map(|line| Value::Object(parse_line(line).unwrap()));
        assert_eq!(pairs, object);
        for wrong in ["x", "x=one", "{", "[1]"] {
            assert!(parse_line(wrong).is_err(), "{wrong}");
        }
    }
}
