//! `omnibase get`, `set`, `call`, `send`, `drive`, `watch` and `top`: a running robot from the command line, by its API.

mod drive;
mod lines;
mod owner;
mod send;
mod top;
mod watch;

use lines::lines;

pub use drive::{Drive, drive};
pub use send::{Send, send};
pub use watch::{Watch, watch};

use crate::Outcome;
use crate::running;
use crate::token;
use anyhow::Context;
use omnibase_client::robots::{Endpoint, Found};
use serde_json::{Map, Value, json};
use std::convert::Infallible;
use std::io::{ErrorKind, Write};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// The longest wait for a robot's answer.
const LONGEST: Duration = Duration::from_secs(15);

/// Which running robot is meant.
#[derive(Debug, clap::Args)]
pub struct Which {
    /// Where its dashboard listens; default: the robot that was started last on this machine by this user, with or without
    /// a dashboard.
    #[arg(long, value_name = "ADDRESS")]
    at: Option<SocketAddr>,
    /// A file of mode 0600 with its token, which the environment variable OMNIBASE_TOKEN may hold too; neither is needed
    /// for one's own robots on this machine.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Refused: everybody would see it.
    #[arg(long, hide = true, value_parser = token::refused)]
    token: Option<Infallible>,
}

/// Shows values of a running robot.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase get                       everything
  omnibase get state error           all values whose names begin so
  omnibase get settings              what may be set, with its bounds
  omnibase get phase state/pose_x_m --json")]
pub struct Get {
    /// Names, or beginnings of names.
    names: Vec<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// Changes settings of a running robot: all of them in one cycle, or none.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  omnibase set speed_factor=0.5 kp_x_1_s=10 kp_y_1_s=10
  omnibase set joystick.forward.gain=0.4 joystick.forward.expo=0.6")]
pub struct Set {
    /// New values.
    #[arg(required = true, value_name = "NAME=VALUE", value_parser = parse_setting)]
    values: Vec<(String, f64)>,
    /// Print what came of it as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// Asks a running robot for something.
#[derive(Debug, clap::Args)]
#[command(after_help = "What can be asked:
  enable, acknowledge, track, pause, resume, go_to_start, emergency_stop, release
  enable_joystick                          the joystick at the robot's computer, after it was lost or stopped
  stop category=category_1                 category_0, category_1, category_2 (IEC 60204-1)
  go_to pose=[1.0,0.5,0.0]                 x m, y m, heading rad; while it moves too, for whoever asked for that motion
  drive_to pose=[7.5,4.0,1.57]             the same through the room: around walls, fence and obstacles; best=ridge: in the middle
  set_walls polygons_m=[[[1,0],[2,0],[2,1]]]   walls that drive_to goes around, in place of those drawn before
  set_pose pose=[1.0,0.5,0.0]              where it stands, after a loss; sigma_m=0.02 sigma_rad=0.02: how well that is known
  controller name=adaptive_torque
  drive_mode name=wheel_2 mode=torque      or speed; without a mode: what the control law commands
  teach, teach_end name=round              remember where it is driven; save it as a path
  teach by=points, teach_point             remember single poses; then teach_end
  load_saved name=round
  set_fence corners_m=[[-3,-3],[3,-3],[3,3],[-3,3]]
                                           the guard keeps it from now on; only while the robot stands, and inside
  set_obstacle index=0 centre_m=[1.5,0.2] radius_m=0.3 velocity_m_s=[0,-0.1]
  remove_obstacle index=0
  send_inputs source=gate values={\"open\":1} what a program knows, as a `[[source]]`; `omnibase send` does so many times a second
  set_output name=lamps.green value=1      an output of a `[[device]]`, until the robot stops
  home_axis name=lift                      an axis of a `[[device]]` looks for its home
  move_axis name=lift position=0.3         mode=pp: the drive plans the way; it stops where the robot does
  run_axis name=lift speed=-0.05           by pv, until it is told something else or comes to its limits
  stop_axis name=lift
  scan                                     what hangs at its bus, and in which state
  sdo_read subdevice=0 object=6041:00      by SDO, beside its cycle
  sdo_write subdevice=0 object=6083:00 value=20000
                                           while no drive is enabled, or where [bus] sdo_write_while_enabled allows
  load reference={\"kind\":\"circle\",\"radius_m\":0.5}

What a command begins goes on when the command has ended; `omnibase call emergency_stop` ends it.")]
pub struct Call {
    /// What is asked.
    what: String,
    /// Its arguments; values as JSON, or text.
    #[arg(value_name = "NAME=VALUE", value_parser = parse_argument)]
    arguments: Vec<(String, Value)>,
    /// Print what came of it as one JSON object: whether it was done, in words, and data where there are any.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    which: Which,
}

/// Shows a running robot in the terminal: state, who commands, the joystick, pose, wheels, timing, events.
#[derive(Debug, clap::Args)]
pub struct Top {
    #[command(flatten)]
    which: Which,
    /// Print one view as text and end.
    #[arg(long)]
    once: bool,
}

fn parse_setting(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as speed_factor=0.5")?;
    let number: Option<f64> = value.trim().parse().ok();
    // JSON, in which it is sent, knows no other numbers; and no setting takes them.
    let number = number.filter(|number| number.is_finite());
    Ok((name.trim().to_owned(), number.ok_or_else(|| format!("expected a finite number, found `{value}`"))?))
}

fn parse_argument(text: &str) -> Result<(String, Value), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as name=adaptive_torque")?;
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.to_owned()));
    Ok((name.to_owned(), value))
}

/// A running robot at the other end of a line.
pub struct Line {
    robot: Found,
    agent: ureq::Agent,
}

impl Line {
    fn new(which: &Which) -> anyhow::Result<Self> {
        let robot = running::robot(which.at, which.token_file.as_deref())?;
        let config = ureq::Agent::config_builder().http_status_as_error(false).timeout_global(Some(LONGEST));
        Ok(Line { robot, agent: config.build().into() })
    }

    fn read(&self, what: &str) -> anyhow::Result<Value> {
        let (is_success, text) = self.exchange(what, None)?;
        anyhow::ensure!(is_success, "{text}");
        Ok(serde_json::from_str(&text)?)
    }

    /// Asks for something of the API, with or without a body: whether it succeeded, and what was answered.
    fn exchange(&self, what: &str, body: Option<&str>) -> anyhow::Result<(bool, String)> {
        let address = match &self.robot.place {
            Endpoint::Socket(path) => {
                return owner::exchange(path, what, body, LONGEST).map_err(|error| {
                    let is_late = error.downcast_ref::<std::io::Error>().is_some_and(|error| {
                        matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
                    });
                    error.context(if is_late { self.late() } else { self.nobody() })
                });
            }
            Endpoint::Address(address) => address,
        };
        let url = format!("http://{address}/api/{what}");
        let token = format!("Bearer {}", self.robot.token);
        let answer = match body {
            None => self.agent.get(&url).header("Authorization", token).call(),
            Some(body) => self.agent.post(&url).header("Authorization", token).send(body),
        };
        let is_late = matches!(answer, Err(ureq::Error::Timeout(_)));
        let mut answer = answer.with_context(|| if is_late { self.late() } else { self.nobody() })?;
        let text = answer.body_mut().read_to_string()?;
        Ok((answer.status().is_success(), text))
    }

    /// The robot that runs at `address`, or that was started last.
    pub fn to(address: Option<SocketAddr>) -> anyhow::Result<Self> {
        Line::new(&Which { at: address, token_file: None, token: None }).context(
            "a robot answers for its segment where it runs at an interface, or with --dashboard or --joystick",
        )
    }

    /// What a call brought for programs; an error where it wasn't done.
    pub fn data(&self, call: &Value) -> anyhow::Result<Value> {
        let mut said = self.ask(call)?;
        anyhow::ensure!(said["done"] == true, "{}", said["text"].as_str().unwrap_or("no answer"));
        Ok(said["data"].take())
    }

    /// The same of a question about a SubDevice's object; the inner error is the SubDevice's own refusal, in words.
    pub fn of_object(&self, call: &Value) -> anyhow::Result<Result<Value, String>> {
        of_object(self.ask(call)?)
    }

    fn ask(&self, call: &Value) -> anyhow::Result<Value> {
        let mut call = call.clone();
        // What begins something counts from here, and the robot refuses what took too long on its way. A stop waits
        // for nothing, and a question changes nothing.
        let begins_nothing = matches!(
            call["do"].as_str(),
            Some("stop" | "emergency_stop" | "scan" | "sdo_list" | "sdo_object" | "sdo_type" | "sdo_read")
        );
        if let Some(call) = call.as_object_mut().filter(|_| !begins_nothing) {
            call.insert("stamp".to_owned(), self.read("now")?["stamp"].take());
        }
        let (_, text) = self.exchange("call", Some(&call.to_string()))?;
        Ok(serde_json::from_str(&text).unwrap_or_else(|_| json!({ "done": false, "text": text })))
    }

    fn late(&self) -> String {
        format!("the robot at {} gave no answer in {} s", self.robot.place, LONGEST.as_secs())
    }

    fn nobody(&self) -> String {
        format!("no robot answers at {}", self.robot.place)
    }
}

fn of_object(mut said: Value) -> anyhow::Result<Result<Value, String>> {
    let text = said["text"].as_str().unwrap_or("no answer").to_owned();
    let is_refusal = said["data"]["refused_by_subdevice"] == true;
    anyhow::ensure!(said["done"] == true || is_refusal, "{text}");
    Ok(if is_refusal { Err(text) } else { Ok(said["data"].take()) })
}

/// Asks for something and prints what came of it.
fn said(which: &Which, call: &Value, as_json: bool, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let said = Line::new(which)?.ask(call)?;
    let (done, text) = (said["done"] == true, said["text"].as_str().unwrap_or("no answer"));
    if as_json {
        writeln!(output, "{said}")?;
        return Ok(if done { Outcome::Done } else { Outcome::Failed });
    }
    anyhow::ensure!(done, "{text}");
    writeln!(output, "{text}")?;
    Ok(Outcome::Done)
}

/// Runs `omnibase get`.
pub fn get(arguments: &Get, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut all = Line::new(&arguments.which)?.read("now")?;
    let mut flat: Map<String, Value> = Map::new();
    let values = all["values"].take();
    let settings = all["settings"].take();
    for (name, value) in all.as_object().into_iter().flatten() {
        if !value.is_null() && name != "events" {
            flat.insert(name.clone(), value.clone());
        }
    }
    for setting in settings.as_array().into_iter().flatten() {
        let name = format!("settings/{}", setting["name"].as_str().unwrap_or_default());
        let value = if arguments.json { setting["value"].clone() } else { setting.clone() };
        flat.insert(name, value);
    }
    flat.extend(values.as_object().cloned().unwrap_or_default());
    let names = &arguments.names;
    for name in names {
        let known = flat.keys().any(|key| key.starts_with(name.as_str()));
        anyhow::ensure!(known, "no value is called `{name}`: `omnibase get` shows all");
    }
    flat.retain(|key, _| names.is_empty() || names.iter().any(|name| key.starts_with(name.as_str())));
    if arguments.json {
        writeln!(output, "{}", serde_json::to_string_pretty(&flat)?)?;
        return Ok(Outcome::Done);
    }
    let width = flat.keys().map(String::len).max().unwrap_or(0);
    for (name, value) in &flat {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Object(setting) if setting.contains_key("range") => {
                format!("{}   {} to {}", setting["value"], setting["range"][0], setting["range"][1])
            }
            other => other.to_string(),
        };
        writeln!(output, "{name:width$}  {text}")?;
    }
    Ok(Outcome::Done)
}

/// Runs `omnibase set`.
pub fn set(arguments: &Set, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let values: Map<String, Value> =
        arguments.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    said(&arguments.which, &json!({"do": "set", "values": values}), arguments.json, output)
}

/// Runs `omnibase call`.
pub fn call(arguments: &Call, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut call: Map<String, Value> = arguments.arguments.iter().cloned().collect();
    call.insert("do".to_owned(), json!(arguments.what));
    said(&arguments.which, &Value::Object(call), arguments.json, output)
}

/// Runs `omnibase top`.
pub fn top(arguments: &Top, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let line = Line::new(&arguments.which)?;
    if arguments.once {
        let view = top::View::read(&line)?;
        writeln!(output, "{}", top::text(&view))?;
        return Ok(Outcome::Done);
    }
    top::show(&line)?;
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subdevice_that_is_lost_refuses_nothing() {
        let found = of_object(json!({ "done": true, "text": "", "data": { "data": "01" } })).unwrap();
        assert_eq!(found, Ok(json!({ "data": "01" })));
        let refused =
            json!({ "done": false, "text": "no such object", "data": { "refused_by_subdevice": true } });
        assert_eq!(of_object(refused).unwrap(), Err("no such object".to_owned()));
        let lost = of_object(json!({ "done": false, "text": "SubDevice 1 is away" }));
        assert_eq!(lost.unwrap_err().to_string(), "SubDevice 1 is away");
    }

    #[test]
    fn arguments_are_json_or_text() {
        assert_eq!(parse_argument("pose=[1,2,3]").unwrap(), ("pose".into(), json!([1, 2, 3])));
        assert_eq!(parse_argument("name=round").unwrap(), ("name".into(), json!("round")));
        assert_eq!(parse_setting("speed_factor=0.5").unwrap(), ("speed_factor".into(), 0.5));
        for wrong in ["fast", "nan", "-inf", "1e999", ""] {
            let refusal = parse_setting(&format!("speed_factor={wrong}")).unwrap_err();
            assert_eq!(refusal, format!("expected a finite number, found `{wrong}`"));
        }
        assert!(parse_argument("name").is_err());
    }
}
