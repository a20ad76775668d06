//! Actions: `follow_path` and `follow_joint_trajectory`, one motion at a time.

use std::time::Instant;

use omnibase_client::{Answer, Error, Seat};
use ros2_client::action::{
    ActionServer, ActionServerQosPolicies, CancelGoalResponse, GetResultResponse, GoalId, GoalInfo,
    GoalStatusEnum, SendGoalResponse,
};
use ros2_client::action_msgs::{CancelGoalResponseEnum, GoalStatus, GoalStatusArray};
use ros2_client::builtin_interfaces::Time as RosTime;
use ros2_client::{ActionTypeName, Message, RmwRequestId};
use serde_json::{Value, json};

use crate::course::{self, Point};
use crate::messages::*;
use crate::node::{Ros, latched, service, telling};
use crate::robot::Limits;

/// Goals that are over are remembered for who asks for their results; so many.
const REMEMBERED: usize = 16;

/// What is known of the robot when something is asked.
#[derive(Clone, Debug)]
pub struct Situation {
    /// x m, y m, heading rad in the fixed frame.
    pub here: [f64; 3],
    /// Of the platform, m/s.
    pub speed_m_s: f64,
    /// What it does.
    pub phase: String,
    /// What is followed: `reference`, `velocity`, `way`.
    pub course: String,
    /// It was begun and isn't at its end.
    pub is_begun: bool,
    /// Why it last stopped.
    pub stop_reason: String,
}

impl Situation {
    /// Of the robot's own word.
    pub fn of(status: &Value, columns: &[String]) -> Option<Situation> {
        let value = |name: &str| status["values"][columns.iter().position(|known| known == name)?].as_f64();
        let text = |key: &str| status[key].as_str().unwrap_or_default().to_owned();
        let speed = value("state/twist_in_body_x_m_s")?.hypot(value("state/twist_in_body_y_m_s")?);
        Some(Situation {
            here: [value("state/pose_x_m")?, value("state/pose_y_m")?, value("state/pose_heading_rad")?],
            speed_m_s: speed,
            phase: text("phase"),
            course: text("course"),
            is_begun: status["reference_begun"] == true,
            stop_reason: text("stop_reason"),
        })
    }
}

/// How a goal ended.
type Ended = Result<(), String>;

/// A kind of action.
trait Kind {
    type Goal: Message + Clone + 'static;
    type Result: Message + Clone + 'static;
    type Feedback: Message + 'static;
    /// Package and name.
    const TYPE: (&'static str, &'static str);
    const NAME: &'static str;
    fn points(goal: &Self::Goal, here: [f64; 3], facts: &RobotFacts) -> Result<Vec<Point>, String>;
    fn result(ended: &Ended) -> Self::Result;
    fn feedback(situation: &Situation, end: &Point, facts: &RobotFacts) -> Self::Feedback;
}

/// What never changes.
struct RobotFacts {
    odom_frame: String,
    limits: Limits,
}

struct FollowPath;

impl Kind for FollowPath {
    type Goal = FollowPathGoal;
    type Result = FollowPathResult;
    type Feedback = FollowPathFeedback;
    const TYPE: (&'static str, &'static str) = ("nav2_msgs", "FollowPath");
    const NAME: &'static str = "follow_path";

    fn points(goal: &FollowPathGoal, here: [f64; 3], facts: &RobotFacts) -> Result<Vec<Point>, String> {
        course::of_path(goal, here, &facts.odom_frame, &facts.limits)
    }

    fn result(ended: &Ended) -> FollowPathResult {
        // FollowPath's UNKNOWN.
        let error_code = if ended.is_ok() { 0 } else { 100 };
        let error_msg = ended.clone().err().unwrap_or_default();
        FollowPathResult { result: Empty::default(), error_code, error_msg }
    }

    fn feedback(situation: &Situation, end: &Point, _: &RobotFacts) -> FollowPathFeedback {
        let [x, y, _] = situation.here;
        let distance_to_goal = (end[1] - x).hypot(end[2] - y) as f32;
        FollowPathFeedback { distance_to_goal, speed: situation.speed_m_s as f32 }
    }
}

struct FollowTrajectory;

impl Kind for FollowTrajectory {
    type Goal = FollowJointTrajectoryGoal;
    type Result = FollowJointTrajectoryResult;
    type Feedback = FollowJointTrajectoryFeedback;
    const TYPE: (&'static str, &'static str) = ("control_msgs", "FollowJointTrajectory");
    const NAME: &'static str = "follow_joint_trajectory";

    fn points(
        goal: &FollowJointTrajectoryGoal,
        here: [f64; 3],
        _: &RobotFacts,
    ) -> Result<Vec<Point>, String> {
        course::of_trajectory(goal, here)
    }

    fn result(ended: &Ended) -> FollowJointTrajectoryResult {
        // PATH_TOLERANCE_VIOLATED is the nearest to "it was stopped on its way".
        let error_code = if ended.is_ok() { 0 } else { -4 };
        FollowJointTrajectoryResult { error_code, error_string: ended.clone().err().unwrap_or_default() }
    }

    fn feedback(situation: &Situation, _: &Point, facts: &RobotFacts) -> FollowJointTrajectoryFeedback {
        FollowJointTrajectoryFeedback {
            header: Header { frame_id: facts.odom_frame.clone(), ..Header::default() },
            joint_names: course::JOINTS.map(str::to_owned).into(),
            actual: JointTrajectoryPoint {
                positions: situation.here.into(),
                ..JointTrajectoryPoint::default()
            },
            ..FollowJointTrajectoryFeedback::default()
        }
    }
}

/// A goal that was accepted.
struct Goal {
    id: GoalId,
    stamp: RosTime,
    status: GoalStatusEnum,
    ended: Option<Ended>,
    asked: Vec<RmwRequestId>,
}

impl Goal {
    fn info(&self) -> GoalInfo {
        GoalInfo { goal_id: self.id, stamp: self.stamp }
    }
}

/// An action's server with its goals.
struct Action<K: Kind> {
    server: ActionServer<K::Goal, K::Result, K::Feedback>,
    goals: Vec<Goal>,
}

/// What the server of either action is asked by the motion.
trait Port {
    /// The next goal that was accepted, with its points; refusals in words.
    fn next_goal(
        &mut self,
        situation: &Situation,
        facts: &RobotFacts,
    ) -> Option<Result<(GoalId, Vec<Point>), String>>;
    /// Whether somebody wants the goal that is followed cancelled; all else is answered.
    fn cancelled(&mut self, now: Option<GoalId>) -> bool;
    fn end(&mut self, id: GoalId, ended: Ended, is_cancelled: bool);
    fn feedback(&self, id: GoalId, situation: &Situation, end: &Point, facts: &RobotFacts);
    fn answer_results(&mut self);
}

impl<K: Kind> Action<K> {
    fn new(ros: &mut Ros) -> anyhow::Result<Self> {
        let qos = ActionServerQosPolicies {
            goal_service: service(),
            result_service: service(),
            cancel_service: service(),
            feedback_publisher: telling(),
            status_publisher: latched(),
        };
        let server = ros.action_server(K::NAME, &ActionTypeName::new(K::TYPE.0, K::TYPE.1), qos)?;
        Ok(Action { server, goals: Vec::new() })
    }

    fn tell_statuses(&self) {
        let status = |goal: &Goal| GoalStatus { goal_info: goal.info(), status: goal.status };
        // Nobody may listen.
        let _ = self
            .server
            .send_goal_statuses(GoalStatusArray { status_list: self.goals.iter().map(status).collect() });
    }
}

impl<K: Kind> Port for Action<K> {
    fn next_goal(
        &mut self,
        situation: &Situation,
        facts: &RobotFacts,
    ) -> Option<Result<(GoalId, Vec<Point>), String>> {
        let (request, asked) = self.server.receive_goal().ok().flatten()?;
        let points = match situation.phase.as_str() {
            "holding" | "tracking" => K::points(&asked.goal, situation.here, facts),
            other => Err(format!("the robot is {other}")),
        };
        let stamp = RosTime::now();
        let accepted = points.is_ok();
        // Whoever asked may be gone.
        let _ = self.server.send_goal_response(request, SendGoalResponse { accepted, stamp });
        Some(points.map_err(|words| format!("{} is refused: {words}", K::NAME)).map(|points| {
            let (id, status) = (asked.goal_id, GoalStatusEnum::Executing);
            let over = self.goals.iter().position(|goal| goal.ended.is_some());
            if self.goals.len() >= REMEMBERED
                && let Some(over) = over
            {
                self.goals.remove(over);
            }
            self.goals.push(Goal { id, stamp, status, ended: None, asked: Vec::new() });
            self.tell_statuses();
            (id, points)
        }))
    }

    fn cancelled(&mut self, now: Option<GoalId>) -> bool {
        let mut is_cancelled = false;
        while let Ok(Some((request, asked))) = self.server.receive_cancel_request() {
            // The fields of this request can't be read but by what it is written as.
            let asked = serde_json::to_value(&asked).unwrap_or_default();
            let is_of =
                |id: &GoalId| serde_json::to_value(id).ok().as_ref() == Some(&asked["goal_info"]["goal_id"]);
            let is_known = self.goals.iter().any(|goal| is_of(&goal.id));
            let (return_code, goals_canceling) = match self.goals.iter_mut().find(|goal| Some(goal.id) == now)
            {
                Some(goal) if is_of(&goal.id) || is_of(&GoalId::ZERO) => {
                    (is_cancelled, goal.status) = (true, GoalStatusEnum::Canceling);
                    (CancelGoalResponseEnum::None, vec![goal.info()])
                }
                _ if is_known => (CancelGoalResponseEnum::GoalTerminated, vec![]),
                _ => (CancelGoalResponseEnum::UnknownGoal, vec![]),
            };
            let _ = self
                .server
                .send_cancel_response(request, CancelGoalResponse { return_code, goals_canceling });
        }
        if is_cancelled {
            self.tell_statuses();
        }
        is_cancelled
    }

    fn end(&mut self, id: GoalId, ended: Ended, is_cancelled: bool) {
        if let Some(goal) = self.goals.iter_mut().find(|goal| goal.id == id) {
            goal.status = match (&ended, is_cancelled) {
                (_, true) => GoalStatusEnum::Canceled,
                (Ok(()), false) => GoalStatusEnum::Succeeded,
                (Err(_), false) => GoalStatusEnum::Aborted,
            };
            goal.ended = Some(ended);
            self.tell_statuses();
            self.answer_results();
        }
    }

    fn feedback(&self, id: GoalId, situation: &Situation, end: &Point, facts: &RobotFacts) {
        let _ = self.server.send_feedback(id, K::feedback(situation, end, facts));
    }

    fn answer_results(&mut self) {
        while let Ok(Some((request, asked))) = self.server.receive_result_request() {
            match self.goals.iter_mut().find(|goal| goal.id == asked.goal_id) {
                Some(goal) => goal.asked.push(request),
                None => {
                    let result = K::result(&Err("nobody knows this goal".to_owned()));
                    let _ = self
                        .server
                        .send_result(request, GetResultResponse { status: GoalStatusEnum::Unknown, result });
                }
            }
        }
        for goal in &mut self.goals {
            let Some(ended) = &goal.ended else { continue };
            for request in goal.asked.drain(..) {
                let response = GetResultResponse { status: goal.status, result: K::result(ended) };
                let _ = self.server.send_result(request, response);
            }
        }
    }
}

/// Where a motion is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// The robot checks its path.
    Loads(u64),
    /// It is asked to begin.
    Begins(u64),
    /// It was begun; whether it was seen moving on it.
    Follows(bool),
}

struct Motion {
    action: usize,
    id: GoalId,
    end: Point,
    stage: Stage,
    is_cancelled: bool,
}

/// Both actions, and the one motion that is followed.
pub struct Actions {
    ports: Vec<Box<dyn Port>>,
    facts: RobotFacts,
    motion: Option<Motion>,
}

impl Actions {
    /// Serves them.
    pub fn new(ros: &mut Ros, odom_frame: String, limits: Limits) -> anyhow::Result<Actions> {
        let ports: Vec<Box<dyn Port>> =
            vec![Box::new(Action::<FollowPath>::new(ros)?), Box::new(Action::<FollowTrajectory>::new(ros)?)];
        Ok(Actions { ports, facts: RobotFacts { odom_frame, limits }, motion: None })
    }

    fn end(&mut self, ended: Ended) {
        if let Some(Motion { action, id, is_cancelled, .. }) = self.motion.take() {
            self.ports[action].end(id, ended, is_cancelled);
        }
    }

    /// Takes what is asked now; words about what is refused.
    pub fn take(&mut self, seat: &mut Seat, situation: &Situation) -> Result<Vec<String>, Error> {
        let mut refused = Vec::new();
        for action in 0..self.ports.len() {
            self.ports[action].answer_results();
            let now = self.motion.as_ref().filter(|motion| motion.action == action).map(|motion| motion.id);
            if self.ports[action].cancelled(now)
                && let Some(motion) = &mut self.motion
            {
                motion.is_cancelled = true;
                if matches!(motion.stage, Stage::Begins(_) | Stage::Follows(_)) {
                    seat.ask(json!({ "do": "end_motion" }), Instant::now())?;
                }
            }
            match self.ports[action].next_goal(situation, &self.facts) {
                None => {}
                Some(Err(words)) => refused.push(words),
                Some(Ok((id, points))) => {
                    self.end(Err("another goal came".to_owned()));
                    let reference = json!({
                        "kind": "path", "frame": "odom", "interpolation": "cubic_mean_slope", "points": points,
                    });
                    let number = seat.ask(json!({ "do": "load", "reference": reference }), Instant::now())?;
                    let end = points[points.len() - 1];
                    self.motion =
                        Some(Motion { action, id, end, stage: Stage::Loads(number), is_cancelled: false });
                }
            }
        }
        Ok(refused)
    }

    /// Hands an answer to the motion; whether it waited for it.
    pub fn answer(&mut self, seat: &mut Seat, answer: &Answer) -> Result<bool, Error> {
        let Some(motion) = &mut self.motion else { return Ok(false) };
        match motion.stage {
            Stage::Loads(number) if number == answer.number => {
                if motion.is_cancelled || !answer.done {
                    self.end(Err(answer.text.clone()));
                } else {
                    motion.stage = Stage::Begins(seat.ask(json!({ "do": "track" }), Instant::now())?);
                }
            }
            Stage::Begins(number) if number == answer.number => {
                if answer.done {
                    motion.stage = Stage::Follows(false);
                } else {
                    self.end(Err(answer.text.clone()));
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Looks how far it is.
    pub fn look(&mut self, situation: &Situation) {
        let Some(motion) = &mut self.motion else { return };
        let Stage::Follows(was_seen) = motion.stage else { return };
        let is_followed =
            situation.phase == "tracking" && ["reference", "onto"].contains(&situation.course.as_str());
        if is_followed {
            motion.stage = Stage::Follows(true);
            self.ports[motion.action].feedback(motion.id, situation, &motion.end, &self.facts);
        } else if was_seen {
            let has_left = situation.is_begun && situation.phase != "stopping";
            match situation.phase.as_str() {
                // It comes to rest yet.
                "stopping" | "quick stopping" => {}
                _ if motion.is_cancelled => self.end(Err("cancelled".to_owned())),
                "holding" if !has_left => self.end(Ok(())),
                _ => self.end(Err(format!("the robot left the path: {}", situation.stop_reason))),
            }
        }
    }
}
