//! Where calls are checked, translated, and handed to the robot.

use std::collections::BTreeMap;
use std::path::Path;

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::config::{Limits, ReferenceTable};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::references::reference;
use omnibase_robot::signals::Setpoint;
use omnibase_robot::stages::Reference;
use omnibase_run::live::{Ask, Client, Live, Pad, TRACE_KEPT_S};
use omnibase_run::teach::{Sampling, lines, taught};
use omnibase_trajectory::PathPoints;
use omnibase_trajectory::path_points::nearest_turn_rad;
use serde::Serialize;

use crate::about::About;
use crate::call::{Call, Said, TeachBy, category};

/// How far a taught path may be from where the robot was, m, where nobody says.
const TOLERANCE_M: f64 = 0.001;
/// Points of a planned path as the page draws it.
const DRAWN: u32 = 400;

/// What came of a call at once.
#[derive(Debug)]
pub(crate) enum Reply {
    /// It is over.
    Said(Said),
    /// The robot will answer to this ticket; what to say where it does what was asked.
    Ticket(u64, String),
    /// Nobody waits for an answer.
    Nothing,
}

/// One desk for all clients of a robot.
pub(crate) struct Desk {
    pub(crate) live: Live,
    pub(crate) about: About,
    teaching: Option<(f64, Sampling)>,
}

/// The planned path, for drawing.
#[derive(Serialize)]
pub(crate) struct Planned {
    number: u32,
    name: String,
    duration_s: Option<f64>,
    /// x m, y m, heading rad.
    poses: Vec<[f64; 3]>,
}

impl Desk {
    pub(crate) fn new(live: Live, about: About) -> Self {
        Desk { live, about, teaching: None }
    }

    pub(crate) fn teaching_since_s(&self) -> Option<f64> {
        self.teaching.map(|(since_s, _)| since_s)
    }

    /// Carries a call out, as far as that needs no answer of the robot.
    pub(crate) fn take(&mut self, client: Client, call: Call) -> Reply {
        match self.try_take(client, call) {
            Ok(reply) => reply,
            Err(why) => Reply::Said(Said::refused(why)),
        }
    }

    fn try_take(&mut self, client: Client, call: Call) -> Result<Reply, String> {
        let robot = |kind| Ask::Robot(kind);
        let ask = match call {
            Call::Enable => robot(RequestKind::Enable),
            Call::Acknowledge => robot(RequestKind::Acknowledge),
            Call::Track => robot(RequestKind::Track),
            Call::Pause => robot(RequestKind::Pause),
            Call::Resume => robot(RequestKind::Resume),
            Call::GoTo { pose: [x_m, y_m, heading_rad] } => {
                robot(RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } })
            }
            Call::GoToStart => robot(RequestKind::GoTo { odom_from_body: self.start()? }),
            Call::Stop { category: name } => robot(RequestKind::Stop(category(name))),
            Call::EmergencyStop => Ask::EmergencyStop,
            Call::Release => Ask::ReleaseEmergencyStop,
            Call::Controller { name } => {
                robot(RequestKind::SwitchController { index: self.controller(&name)? })
            }
            Call::SetObstacle { index, centre_m, radius_m, velocity_m_s } => {
                robot(RequestKind::SetObstacle {
                    index,
                    obstacle: Obstacle { centre_m, radius_m, velocity_m_s },
                })
            }
            Call::RemoveObstacle { index } => robot(RequestKind::RemoveObstacle { index }),
            Call::Set { values } => return self.set(client, &values),
            Call::Pad { x, y, turn, frame } => {
                let limits = &self.about.robot.plan.limits;
                if [x, y, turn].iter().any(|share| !(-1.0..=1.0).contains(share)) {
                    return Err(format!("a stick's shares: expected -1 to 1, found {x}, {y}, {turn}"));
                }
                let twist = wish([x, y, turn], limits);
                return self.send_silently(client, Ask::Pad(Pad::Held { twist, frame: frame.into() }));
            }
            Call::ReleasePad => return self.send_silently(client, Ask::Pad(Pad::Released)),
            Call::LosePad => return self.send_silently(client, Ask::Pad(Pad::Lost)),
            Call::Alive => return self.send_silently(client, Ask::Alive),
            Call::EnablePad => Ask::EnablePad(client),
            Call::EnableJoystick => Ask::EnablePad(Client::Joystick),
            Call::Load { reference } => return self.load(client, *reference, "loaded"),
            Call::LoadPoints { text } => {
                let points = PathPoints::parse(&text).map_err(|error| error.to_string())?;
                return self.load(client, path_of(&points), "path loaded");
            }
            Call::LoadSaved { name } => {
                let text = self.saved(&name)?;
                let table: ReferenceTable = toml::from_str(&text).map_err(|error| error.to_string())?;
                return self.load(client, table, "path loaded");
            }
            Call::Teach { by } => return self.teach(by),
            Call::TeachEnd { name, tolerance_m } => return self.teach_end(client, &name, tolerance_m),
        };
        self.send(client, ask, "done")
    }

    fn send(&self, client: Client, ask: Ask, text: &str) -> Result<Reply, String> {
        let ticket = self.live.send(client, ask).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, text.to_owned()))
    }

    /// What comes many times a second needs no answer.
    fn send_silently(&self, client: Client, ask: Ask) -> Result<Reply, String> {
        self.live.send(client, ask);
        Ok(Reply::Nothing)
    }

    fn controller(&self, name: &str) -> Result<u32, String> {
        let plan = &self.about.robot.plan;
        let found = plan.controllers().position(|known| known == name);
        let known = || plan.controllers().collect::<Vec<_>>().join(", ");
        found
            .map(|index| index as u32)
            .ok_or_else(|| format!("controller: expected one of {}, found `{name}`", known()))
    }

    /// All of the values, or none: each is checked before the first is sent, and the robot takes them in one cycle.
    fn set(&self, client: Client, values: &BTreeMap<String, f64>) -> Result<Reply, String> {
        let settings = self.live.snapshot().settings;
        let mut changes = Vec::new();
        for (name, value) in values {
            let known = || settings.iter().flatten().map(|gain| gain.name).collect::<Vec<_>>().join(", ");
            let found = settings.iter().flatten().position(|gain| gain.name == name);
            let index = found.ok_or_else(|| format!("expected one of {}, found `{name}`", known()))?;
            let gain = settings[index].ok_or("it is gone")?;
            if !(gain.least..=gain.greatest).contains(value) {
                return Err(format!("{name}: expected {} to {}, found {value}", gain.least, gain.greatest));
            }
            changes.push((index as u32, *value));
        }
        if changes.is_empty() {
            return Err("expected at least one value".to_owned());
        }
        let ticket = self.live.set(client, &changes).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, "set".to_owned()))
    }

    fn load(&self, client: Client, table: ReferenceTable, text: &str) -> Result<Reply, String> {
        let (table, made) = self.about.check(table)?;
        let far = match made.start_pose() {
            Some(pose) => format!("; it begins at x {:.3} m, y {:.3} m", pose.x_m, pose.y_m),
            None => "; it begins where the platform stands".to_owned(),
        };
        let (_, ticket) = self.live.load(client, table, made).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, text.to_owned() + &far))
    }

    fn teach(&mut self, by: TeachBy) -> Result<Reply, String> {
        let sampling = match by {
            TeachBy::PeriodS(period_s) => Sampling::Period { period_s },
            TeachBy::Change { distance_m, angle_rad } => Sampling::Change { distance_m, angle_rad },
        };
        let since_s = self.live.snapshot().record.time.now_ns as f64 * 1e-9;
        self.teaching = Some((since_s, sampling));
        Ok(Reply::Said(Said::done(format!(
            "remembering where the robot is driven, for {:.0} minutes at most",
            TRACE_KEPT_S / 60.0
        ))))
    }

    fn teach_end(&mut self, client: Client, name: &str, tolerance_m: Option<f64>) -> Result<Reply, String> {
        let (since_s, sampling) =
            self.teaching.ok_or("expected `teach` before it: nothing was remembered")?;
        self.check_name(name)?;
        let trace = self.live.whole_trace_since(since_s).map_err(|gap| {
            // What is missing doesn't come back: teaching begins anew.
            self.teaching = None;
            format!("{gap}; teach it again, or in parts")
        })?;
        let limits = &self.about.robot.plan.limits;
        let taught = taught(&trace, sampling, tolerance_m.unwrap_or(TOLERANCE_M), limits)
            .map_err(|error| error.to_string())?;
        self.save(name, &taught.reference).map_err(|error| format!("saving: {error}"))?;
        self.teaching = None;
        let points = taught.reference.points.as_ref().map_or(0, Vec::len);
        let text = format!(
            "taught {points} points of {}, within {:.2} mm; saved as {}",
            taught.remembered,
            1e3 * taught.deviation_m,
            self.about.paths.join(format!("{name}.toml")).display(),
        );
        self.load(client, taught.reference, &text)
    }

    fn check_name(&self, name: &str) -> Result<(), String> {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_');
        if (1..=64).contains(&name.len()) && name.bytes().all(plain) {
            return Ok(());
        }
        Err(format!("a path's name: expected letters, digits, - and _, found `{name}`"))
    }

    /// The points as a file of their own, and the reference that names it.
    fn save(&self, name: &str, table: &ReferenceTable) -> std::io::Result<()> {
        let folder: &Path = &self.about.paths;
        std::fs::create_dir_all(folder)?;
        let points = format!("{name}.dat");
        std::fs::write(folder.join(&points), lines(table))?;
        let named = ReferenceTable { points: None, points_file: Some(points), ..table.clone() };
        let text = toml::to_string(&named).map_err(std::io::Error::other)?;
        std::fs::write(folder.join(format!("{name}.toml")), text)
    }

    /// A saved path, with its points in it.
    fn saved(&self, name: &str) -> Result<String, String> {
        self.check_name(name)?;
        let read = |end: &str| {
            let path = self.about.paths.join(format!("{name}.{end}"));
            std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
        };
        let mut table: ReferenceTable = toml::from_str(&read("toml")?).map_err(|error| error.to_string())?;
        let points = PathPoints::parse(&read("dat")?).map_err(|error| error.to_string())?;
        table.points = path_of(&points).points;
        table.points_file = None;
        toml::to_string(&table).map_err(|error| error.to_string())
    }

    /// Names of the saved paths.
    pub(crate) fn saved_names(&self) -> Vec<String> {
        let Ok(entries) = std::fs::read_dir(&self.about.paths) else { return Vec::new() };
        let name = |entry: std::fs::DirEntry| {
            let name = entry.file_name().into_string().ok()?.strip_suffix(".toml")?.to_owned();
            self.check_name(&name).ok()?;
            self.about.paths.join(format!("{name}.dat")).is_file().then_some(name)
        };
        let mut names: Vec<String> = entries.flatten().filter_map(name).collect();
        names.sort();
        names
    }

    fn table(&self, number: u32) -> ReferenceTable {
        self.live.references().remove(&number).unwrap_or_else(|| self.about.robot.plan.reference.clone())
    }

    fn start(&self) -> Result<Pose2, String> {
        let snapshot = self.live.snapshot();
        let table = self.table(snapshot.reference);
        let made = reference(&table, &self.about.robot.plan.limits).map_err(|_| "there is no reference")?;
        let start = made.start_pose().ok_or("the path begins where the platform stands")?;
        Ok(turned_least(start, &snapshot.record.setpoint.odom_from_body))
    }

    /// The path of the present reference, laid where it began, or would begin now.
    pub(crate) fn planned(&self) -> Planned {
        let snapshot = self.live.snapshot();
        let table = self.table(snapshot.reference);
        let mut poses = Vec::new();
        let mut duration_s = None;
        if let Ok(mut made) = reference(&table, &self.about.robot.plan.limits) {
            let here = Setpoint::at_rest(snapshot.record.state.odom_from_body);
            made.start(&snapshot.reference_start.unwrap_or(here));
            duration_s = made.duration_s();
            if let Some(duration_s) = duration_s {
                poses = (0..=DRAWN)
                    .map(|n| drawn(&mut *made, duration_s * f64::from(n) / f64::from(DRAWN)))
                    .collect();
            }
        }
        let name = table.kind.unwrap_or_else(|| "hold".to_owned());
        Planned { number: snapshot.reference, name, duration_s, poses }
    }
}

/// A pose with its heading told so that it is the shortest turn: the same heading may be some turns away.
fn turned_least(pose: Pose2, here: &Pose2) -> Pose2 {
    Pose2 { heading_rad: nearest_turn_rad(pose.heading_rad, here.heading_rad), ..pose }
}

fn drawn(made: &mut dyn Reference, time_s: f64) -> [f64; 3] {
    let pose = made.sample(time_s).odom_from_body;
    [pose.x_m, pose.y_m, pose.heading_rad]
}

/// A stick's wish: full speed is full speed in every direction, though the stick may reach further in its corners.
fn wish([x, y, turn]: [f64; 3], limits: &Limits) -> Twist2 {
    let speed_m_s = limits.speed_m_s / x.hypot(y).max(1.0);
    Twist2::new(x * speed_m_s, y * speed_m_s, turn * limits.turn_speed_rad_s)
}

/// Points as a reference, by the rules that a robot's file has where it says nothing.
fn path_of(points: &PathPoints) -> ReferenceTable {
    let rows = points.as_slice().iter().map(|point| {
        let Pose2 { x_m, y_m, heading_rad } = point.odom_from_base;
        [point.time_s, x_m, y_m, heading_rad]
    });
    ReferenceTable {
        kind: Some("path".to_owned()),
        points: Some(rows.collect()),
        ..ReferenceTable::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::Registry;
    use omnibase_run::RobotText;
    use std::f64::consts::TAU;

    #[test]
    fn nobody_sees_whole_turns_unwound_on_the_way_to_a_start() {
        let start = Pose2 { x_m: 1.0, y_m: 2.0, heading_rad: 0.5 };
        for turns in [-3.0, 0.0, 2.0] {
            let here = Pose2 { heading_rad: turns * TAU + 0.4, ..Pose2::default() };
            let target = turned_least(start, &here);
            assert!((target.heading_rad - here.heading_rad - 0.1).abs() < 1e-9, "{target:?}");
            assert_eq!((target.x_m, target.y_m), (1.0, 2.0));
        }
    }

    #[test]
    fn a_stick_in_its_corner_wishes_full_speed_and_no_more() {
        // The robot's file says 1 m/s and 1.5 rad/s.
        let text = include_str!("../../../robots/bmm.toml").into();
        let robot = RobotText { text, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap();
        let limits = robot.plan.limits;
        for (shares, speed_m_s) in [
            ([1.0, 1.0, 1.0], 1.0),
            ([-1.0, 0.5, -1.0], 1.0),
            ([0.0, -1.0, 1.0], 1.0),
            ([0.3, 0.4, 0.0], 0.5),
            ([0.0, 0.0, 0.5], 0.0),
        ] {
            let [x, y, turn] = shares;
            let twist = wish(shares, &limits);
            assert!((twist.speed_m_s() - speed_m_s).abs() < 1e-12, "{shares:?}: {twist:?}");
            assert!((twist.vx_m_s * y - twist.vy_m_s * x).abs() < 1e-12, "another direction: {twist:?}");
            assert_eq!(twist.w_rad_s, 1.5 * turn);
        }
    }
}
