//! Where calls are checked, translated, and handed to the robot.

mod named;
mod taught_paths;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{AxisMode, BestWay, Limits, ReferenceTable, Source};
use omnibase_robot::guard::{Obstacle, check_fence};
use omnibase_robot::signals::AxisAsk;
use omnibase_robot::stages::Reference;
use omnibase_robot::{RequestKind, RobotPlan};
use omnibase_run::live::{Answer, Ask, Asker, Client, Live, SdoPlace, StickWish};
use omnibase_run::teach::Sampling;
use omnibase_trajectory::PathPoints;
use omnibase_trajectory::path_points::nearest_turn_rad;

use crate::bus::{BusCall, NewValue};
use crate::call::{Call, CallResult, unknown};
use crate::drive_to::DriveTo;
use crate::planned::{Drawn, Planned};
use crate::robot_info::RobotInfo;
use crate::work::Waiting;

/// Drawings of references that are kept: the robot's own, and those that were loaded last.
const MOST_DRAWN: usize = 8;
/// Faster than this no robot drives, m/s and rad/s: what is asked beyond it is a mistake, what is below is limited.
const FASTEST: f64 = 100.0;
/// Farther than this from the origin no robot drives, m.
const GREATEST: f64 = 1e4;

/// How well a person knows a pose who says nothing about it: a tape measure and marks on the floor, m and rad.
const SET_POSE_SIGMA_M: f64 = 0.02;
const SET_POSE_SIGMA_RAD: f64 = 0.02;

/// What came of a call at once.
#[derive(Debug)]
pub(crate) enum Reply {
    /// It is over.
    CallResult(CallResult),
    /// The robot will answer to this ticket; what to say where it does what was asked.
    Ticket(u64, String),
    /// The bus will answer, by the robot's plan.
    Bus(BusCall, Arc<RobotPlan>),
    /// Nobody waits for an answer.
    Nothing,
}

/// A checked reference, and its whole table.
type Checked = (ReferenceTable, Box<dyn Reference>);

/// One desk for all clients of a robot. Its locks are held for a moment; nothing is computed under them.
pub(crate) struct CallHandler {
    pub(crate) live: Live,
    pub(crate) about: RobotInfo,
    teaching: Mutex<Option<(f64, Sampling)>>,
    drawn: Mutex<BTreeMap<u32, Arc<Drawn>>>,
    pub(crate) drive_to: DriveTo,
    /// Among those that save paths alone: of one name both files belong together.
    saving: Mutex<()>,
}

/// A guard whose holder panicked still guards a whole value.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl CallHandler {
    pub(crate) fn new(live: Live, about: RobotInfo) -> Self {
        CallHandler {
            live,
            about,
            teaching: Mutex::default(),
            drawn: Mutex::default(),
            drive_to: DriveTo::default(),
            saving: Mutex::default(),
        }
    }

    pub(crate) fn teaching_since_s(&self) -> Option<f64> {
        lock(&self.teaching).map(|(since_s, _)| since_s)
    }

    /// Carries a call out, as far as that needs no answer of the robot.
    pub(crate) fn take(&self, asker: Asker, call: Call, waiting: &Waiting) -> Reply {
        match self.try_take(asker, call, waiting) {
            Ok(reply) => reply,
            Err(why) => Reply::CallResult(CallResult::refused(why)),
        }
    }

    fn try_take(&self, asker: Asker, call: Call, waiting: &Waiting) -> Result<Reply, String> {
        let robot = |kind| Ask::Robot(kind);
        let stops = matches!(call, Call::Stop { .. } | Call::EmergencyStop | Call::Pause);
        let ends = stops || call == Call::EndMotion;
        let ask = match call {
            Call::Enable => robot(RequestKind::Enable),
            Call::Acknowledge => robot(RequestKind::Acknowledge),
            Call::Track => robot(RequestKind::Track),
            Call::Pause => robot(RequestKind::Pause),
            Call::Resume => robot(RequestKind::Resume),
            Call::GoTo { pose } => robot(RequestKind::GoTo { odom_from_body: pose_of(pose) }),
            Call::DriveTo { pose, best } => return self.drive_to(asker, waiting, pose, best),
            Call::SetWalls { polygons_m } => {
                let text = self.drive_to.draw_walls(polygons_m)?;
                return Ok(Reply::CallResult(CallResult::done(text)));
            }
            Call::SetFence { corners_m } => return self.set_fence(asker, &corners_m),
            Call::SetPose { pose, sigma_m, sigma_rad } => robot(RequestKind::SetPose {
                odom_from_body: pose_of(pose),
                sigma_m: sigma_m.unwrap_or(SET_POSE_SIGMA_M),
                sigma_rad: sigma_rad.unwrap_or(SET_POSE_SIGMA_RAD),
            }),
            Call::GoToStart => robot(RequestKind::GoTo { odom_from_body: self.start()? }),
            Call::Stop { category: name } => robot(RequestKind::Stop(name.into())),
            Call::EndMotion => Ask::EndMotion,
            Call::EmergencyStop => Ask::EmergencyStop,
            Call::Release => Ask::ReleaseEmergencyStop,
            Call::Controller { name } => {
                robot(RequestKind::SwitchController { index: self.controller(&name)? })
            }
            Call::DriveMode { name, mode } => robot(self.drive_mode(&name, mode)?),
            Call::SetObstacle { index, centre_m, radius_m, velocity_m_s } => {
                robot(RequestKind::SetObstacle {
                    index,
                    obstacle: Obstacle { centre_m, radius_m, velocity_m_s },
                })
            }
            Call::RemoveObstacle { index } => robot(RequestKind::RemoveObstacle { index }),
            Call::SetOutput { name, value } => robot(self.output(&name, value)?),
            Call::SendInputs { source, values, instant_ms } => {
                self.send_inputs(asker.stamp, &source, &values, instant_ms)?;
                return Ok(Reply::Nothing);
            }
            Call::HomeAxis { name } => robot(self.axis(&name, AxisAsk::Home)?),
            Call::MoveAxis { name, position, mode } => {
                let mode = mode.unwrap_or(AxisMode::Csp);
                robot(self.axis(&name, AxisAsk::Move { position, mode })?)
            }
            Call::RunAxis { name, speed } => robot(self.axis(&name, AxisAsk::Run { speed })?),
            Call::StopAxis { name } => robot(self.axis(&name, AxisAsk::Stop)?),
            Call::Set { values } => return self.set(asker, &values),
            Call::Stick { x, y, turn, frame } => {
                let twist = self.stick([x, y, turn])?;
                return self.send_silently(asker, Ask::Stick(StickWish::Held { twist, frame: frame.into() }));
            }
            Call::Drive { twist, frame } => {
                let twist = twist_of(twist)?;
                return self.send_silently(asker, Ask::Stick(StickWish::Held { twist, frame: frame.into() }));
            }
            Call::ReleaseStick => Ask::Stick(StickWish::Released),
            Call::LoseStick => return self.send_silently(asker, Ask::Stick(StickWish::Lost)),
            Call::RecoverStick => return self.send_silently(asker, Ask::RecoverStick),
            Call::Alive => return self.send_silently(asker, Ask::Alive),
            Call::EnableStick => Ask::EnableStick(asker.client),
            Call::EnableJoystick => Ask::EnableStick(Client::Joystick),
            Call::Load { reference } => {
                let checked = self.about.check(Source::read_json(reference), &no_files)?;
                return self.load(asker, checked, "loaded");
            }
            Call::LoadPoints { text } => {
                let points = PathPoints::parse(&text).map_err(|error| error.to_string())?;
                let checked = self.about.check(ReferenceTable::through(&points).into(), &no_files)?;
                return self.load(asker, checked, "path loaded");
            }
            Call::LoadSaved { name } => return self.load(asker, self.saved(&name)?, "path loaded"),
            Call::Scan => return Ok(self.bus(BusCall::Scan)),
            Call::SdoList { subdevice } => return Ok(self.bus(BusCall::List(subdevice))),
            Call::SdoRead { subdevice, object } => return self.sdo(subdevice, &object, BusCall::Read),
            Call::SdoObject { subdevice, object } => return self.sdo(subdevice, &object, BusCall::Object),
            Call::SdoType { subdevice, object } => return self.sdo(subdevice, &object, BusCall::Type),
            Call::SdoWrite { subdevice, object, value, data } => {
                self.check_age(asker)?;
                let value = NewValue::new(value.as_ref(), data.as_deref())?;
                return self.sdo(subdevice, &object, |place| BusCall::Write(place, value));
            }
            Call::Teach { by } => return self.teach(by),
            Call::TeachPoint => {
                self.check_age(asker)?;
                let count = self.live.remember_point().map_err(|why| why.to_string())?;
                return Ok(Reply::CallResult(CallResult::done(format!("remembered point {count}"))));
            }
            Call::TeachEnd { name, tolerance_m } => return self.teach_end(asker, &name, tolerance_m),
        };
        let reply = self.send(asker, ask, "done");
        if ends && reply.is_ok() {
            // The stop itself waits for nothing.
            self.drive_to.stop(&self.live, (!stops).then_some(asker.client));
        }
        reply
    }

    fn drive_to(
        &self,
        asker: Asker,
        waiting: &Waiting,
        pose: [f64; 3],
        best: Option<BestWay>,
    ) -> Result<Reply, String> {
        if let Some(wrong) = pose.iter().find(|part| !part.is_finite() || part.abs() > GREATEST) {
            return Err(format!("pose: expected numbers from -{GREATEST} to {GREATEST}, found {wrong}"));
        }
        let goal = pose_of(pose);
        let Some(begun) = self.drive_to.begin(&self.live, &self.about, asker, waiting, goal, best)? else {
            return Ok(Reply::CallResult(CallResult::done("it stands there already")));
        };
        if let Ok(drawn) = self.about.drawn(&begun.table) {
            self.keep(begun.number, drawn);
        }
        Ok(Reply::Ticket(begun.ticket, format!("on the way: {}", begun.text)))
    }

    /// What is wrong with a fence is told here in words; the cycle looks again, and at where the platform stands.
    fn set_fence(&self, asker: Asker, corners_m: &[[f64; 2]]) -> Result<Reply, String> {
        check_fence(corners_m).map_err(|wrong| format!("corners_m: {wrong}"))?;
        let ticket = self.live.set_fence(asker, corners_m).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, format!("the fence has {} corners now", corners_m.len())))
    }

    /// Looks after a way to a pose that is under way.
    pub(crate) fn look_after_drive(&self) {
        if let Some(begun) = self.drive_to.look(&self.live, &self.about)
            && let Ok(drawn) = self.about.drawn(&begun.table)
        {
            self.keep(begun.number, drawn);
        }
    }

    fn send(&self, asker: Asker, ask: Ask, text: &str) -> Result<Reply, String> {
        let ticket = self.live.send(asker, ask).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, text.to_owned()))
    }

    fn bus(&self, call: BusCall) -> Reply {
        Reply::Bus(call, Arc::new(self.about.robot.plan.clone()))
    }

    fn sdo(
        &self,
        subdevice: u16,
        object: &str,
        call: impl FnOnce(SdoPlace) -> BusCall,
    ) -> Result<Reply, String> {
        Ok(self.bus(call(place(subdevice, object)?)))
    }

    /// Refuses what was asked too long ago.
    fn check_age(&self, asker: Asker) -> Result<(), String> {
        self.live.check_age(asker.stamp).map_err(|why| Answer::Refused(why).text().into_owned())
    }

    fn stick(&self, [x, y, turn]: [f64; 3]) -> Result<Twist2, String> {
        if [x, y, turn].iter().any(|share| !(-1.0..=1.0).contains(share)) {
            return Err(format!("a stick's shares: expected -1 to 1, found {x}, {y}, {turn}"));
        }
        Ok(wish([x, y, turn], &self.about.robot.plan.limits))
    }

    /// What comes many times a second needs no answer.
    fn send_silently(&self, asker: Asker, ask: Ask) -> Result<Reply, String> {
        self.live.send(asker, ask);
        Ok(Reply::Nothing)
    }

    /// All of the values, or none: each is checked before the first is sent, and the robot takes them in one cycle.
    fn set(&self, asker: Asker, values: &BTreeMap<String, f64>) -> Result<Reply, String> {
        let snapshot = self.live.snapshot();
        let mut changes = Vec::new();
        for (name, value) in values {
            let known = snapshot.settings.iter().flatten().map(|gain| gain.name);
            let (index, gain) = snapshot.setting(name).ok_or_else(|| unknown("setting", name, known))?;
            if gain.least == gain.greatest && *value != gain.value {
                return Err(format!(
                    "{name}: it is {} and can't be changed while the robot runs: a drive is told it at start-up only",
                    gain.value
                ));
            }
            if !(gain.least..=gain.greatest).contains(value) {
                return Err(format!("{name}: expected {} to {}, found {value}", gain.least, gain.greatest));
            }
            changes.push((index, *value));
        }
        if changes.is_empty() {
            return Err("expected at least one value".to_owned());
        }
        let ticket = self.live.set(asker, &changes).ok_or("too much was asked at once")?;
        Ok(Reply::Ticket(ticket, "set".to_owned()))
    }

    fn load(&self, asker: Asker, checked: Checked, text: &str) -> Result<Reply, String> {
        let (table, made) = checked;
        let drawn = self.about.drawn(&table)?;
        let far = match made.start_pose() {
            Some(pose) => format!("; it begins at x {:.3} m, y {:.3} m", pose.x_m, pose.y_m),
            None => "; it begins where the platform stands".to_owned(),
        };
        let (number, ticket) = self.live.load(asker, table, made).ok_or("too much was asked at once")?;
        self.keep(number, drawn);
        Ok(Reply::Ticket(ticket, text.to_owned() + &far))
    }

    fn start(&self) -> Result<Pose2, String> {
        let snapshot = self.live.snapshot();
        let drawn = self.drawn(snapshot.record.reference_next as u32)?;
        let start = drawn.start_pose.ok_or("the path begins where the platform stands")?;
        Ok(turned_least(start, &snapshot.record.setpoint.odom_from_body))
    }

    /// The drawing of a reference, made where it is asked for first.
    fn drawn(&self, number: u32) -> Result<Arc<Drawn>, String> {
        if let Some(drawn) = lock(&self.drawn).get(&number) {
            return Ok(drawn.clone());
        }
        let loaded = self.live.reference(number);
        let table = loaded.as_deref().unwrap_or(&self.about.robot.plan.reference);
        Ok(self.keep(number, self.about.drawn(table)?))
    }

    fn keep(&self, number: u32, drawn: Drawn) -> Arc<Drawn> {
        let drawn = Arc::new(drawn);
        let mut all = lock(&self.drawn);
        all.insert(number, drawn.clone());
        while all.len() > MOST_DRAWN {
            // The robot's own is number 0.
            let Some(oldest) = all.keys().copied().find(|number| *number != 0) else { break };
            all.remove(&oldest);
        }
        drawn
    }

    /// The path of the present reference, laid where it began, or would begin now.
    pub(crate) fn planned(&self) -> Option<Planned> {
        let snapshot = self.live.snapshot();
        let drawn = self.drawn(snapshot.reference).ok()?;
        let begin = snapshot.reference_start.map(|start| start.odom_from_body);
        Some(drawn.laid(snapshot.reference, begin.unwrap_or(snapshot.record.state.odom_from_body)))
    }
}

/// Who asks from elsewhere names no files of this computer.
fn no_files(_: &str) -> Result<String, String> {
    Err("names a file of this computer: expected `points`".to_owned())
}

fn place(subdevice: u16, object: &str) -> Result<SdoPlace, String> {
    SdoPlace::new(subdevice, object).map_err(|error| error.to_string())
}

/// A pose with its heading told so that it is the shortest turn: the same heading may be some turns away.
fn turned_least(pose: Pose2, here: &Pose2) -> Pose2 {
    Pose2 { heading_rad: nearest_turn_rad(pose.heading_rad, here.heading_rad), ..pose }
}

fn pose_of([x_m, y_m, heading_rad]: [f64; 3]) -> Pose2 {
    Pose2 { x_m, y_m, heading_rad }
}

fn twist_of(twist: [f64; 3]) -> Result<Twist2, String> {
    if twist.iter().any(|speed| !(-FASTEST..=FASTEST).contains(speed)) {
        return Err(format!("a twist: expected at most {FASTEST} m/s and rad/s, found {twist:?}"));
    }
    let [vx_m_s, vy_m_s, w_rad_s] = twist;
    Ok(Twist2 { vx_m_s, vy_m_s, w_rad_s })
}

/// A stick's wish: full speed is full speed in every direction, though the stick may reach further in its corners.
fn wish([x, y, turn]: [f64; 3], limits: &Limits) -> Twist2 {
    let speed_m_s = limits.speed_m_s / x.hypot(y).max(1.0);
    Twist2::new(x * speed_m_s, y * speed_m_s, turn * limits.turn_speed_rad_s)
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
