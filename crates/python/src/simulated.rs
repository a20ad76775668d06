//! One simulated robot, as one and many of them use it.

use std::sync::LazyLock;

use omnibase_platform::{Pose2, Twist2};
use omnibase_record::run::{RunSchema, fits};
use omnibase_robot::config::{StopName, choice_names, nearest};
use omnibase_robot::signals::{Frame, Phase, RequestAnswer};
use omnibase_robot::{Registry, Request, RequestKind, RobotPlan};
use omnibase_run::live::Answer;
use omnibase_run::stepped::{Leader, Stepped};

use crate::failure::Failure;
use crate::law::Law;

/// All kinds that are built in.
pub static REGISTRY: LazyLock<Registry> = LazyLock::new(Registry::with_built_in);

/// How long drives may take to enable, s: as long as the slowest check of a brake.
const LONGEST_ENABLING_S: f64 = 5.0;

/// A simulated robot, and the twist at which it is held.
pub struct Simulated {
    stepped: Stepped,
    manner: Manner,
    twist: Option<(Twist2, Frame)>,
}

/// How a robot is simulated.
#[derive(Clone)]
pub struct Manner {
    /// Who leads it.
    pub leader: Leader,
    /// Whether its cycles wait for the host's clock.
    pub realtime: bool,
    /// The user's own control law, where there is one.
    pub law: Option<Law>,
}

impl From<Leader> for Manner {
    /// As fast as it can be, by the control law of its file.
    fn from(leader: Leader) -> Self {
        Manner { leader, realtime: false, law: None }
    }
}

impl Simulated {
    /// Brings it to OP and through its first cycle.
    pub fn begin(plan: RobotPlan, manner: Manner) -> Result<Self, Failure> {
        let own = manner.law.as_ref().map(Law::registry);
        let registry = own.as_ref().unwrap_or(&REGISTRY);
        let stepped = Stepped::begin(plan, registry, manner.leader, &mut drop).map_err(Failure::of)?;
        if manner.realtime {
            stepped.keep_pace();
        }
        let mut robot = Simulated { stepped, manner, twist: None };
        robot.cycle(None)?;
        Ok(robot)
    }

    /// The same robot at its beginning.
    pub fn begin_again(&mut self) -> Result<(), Failure> {
        *self = Simulated::begin(self.stepped.plan().clone(), self.manner.clone())?;
        Ok(())
    }

    /// Whether its cycles wait for the host's clock.
    pub fn keeps_pace(&self) -> bool {
        self.manner.realtime
    }

    /// What it is made of, and what became of it.
    pub fn stepped(&self) -> &Stepped {
        &self.stepped
    }

    fn cycle(&mut self, asked: Option<RequestKind>) -> Result<RequestAnswer, Failure> {
        let held = self.twist.map(|(twist, frame)| RequestKind::Velocity { twist, frame });
        let request = asked.or(held).map(Request::lasting);
        let answer = self.stepped.step(request).map_err(Failure::of)?.answer;
        match self.manner.law.as_ref().and_then(Law::raised) {
            // The robot stops by it.
            Some(raised) => {
                self.twist = None;
                Err(Failure::Raised(raised))
            }
            None => Ok(answer),
        }
    }

    /// One cycle. A twist that isn't taken is held no longer: whoever drove must look why, and enable the robot again.
    pub fn step(&mut self) -> Result<(), Failure> {
        let answer = self.cycle(None)?;
        if self.twist.is_some() && answer != RequestAnswer::Taken {
            self.twist = None;
            return Err(self.refused("drive", answer));
        }
        Ok(())
    }

    /// One cycle in which something is asked.
    pub fn ask(&mut self, name: &str, kind: RequestKind) -> Result<(), Failure> {
        if self.manner.leader == Leader::Plan {
            let words =
                format!("{name}: refused: this robot follows its plan: make one without path and reference");
            return Err(Failure::Refused(words));
        }
        self.twist = None;
        match self.cycle(Some(kind))? {
            RequestAnswer::Taken => Ok(()),
            answer => Err(self.refused(name, answer)),
        }
    }

    fn refused(&self, name: &str, answer: RequestAnswer) -> Failure {
        let mut words =
            format!("{name}: {}; the robot is {}", Answer::Robot(answer).text(), self.phase().name());
        if let Some(reason) = self.stop_reason() {
            words += &format!(": {reason}");
        }
        let problems = self.stepped.drive_problems().map(|(name, problem)| format!("\n  {name}: {problem}"));
        words.extend(problems);
        Failure::Refused(words)
    }

    /// Acknowledges a fault where there is one, enables the drives, and steps until the robot holds.
    pub fn enable(&mut self) -> Result<(), Failure> {
        if self.phase() == Phase::Fault {
            self.ask("enable", RequestKind::Acknowledge)?;
        }
        self.ask("enable", RequestKind::Enable)?;
        let cycle_s = self.cycle_s();
        for _ in 0..(LONGEST_ENABLING_S / cycle_s) as u64 {
            match self.phase() {
                Phase::Holding => return Ok(()),
                Phase::Enabling => self.step()?,
                _ => break,
            }
        }
        Err(self.refused("enable", RequestAnswer::WrongPhase))
    }

    /// Holds a twist from the next cycle on.
    pub fn drive(&mut self, [vx_m_s, vy_m_s, w_rad_s]: [f64; 3], frame: Frame) {
        self.twist = Some((Twist2::new(vx_m_s, vy_m_s, w_rad_s), frame));
    }

    /// The straight way to a pose.
    pub fn go_to(&mut self, [x_m, y_m, heading_rad]: [f64; 3]) -> Result<(), Failure> {
        self.ask("go_to", RequestKind::GoTo { odom_from_body: Pose2::new(x_m, y_m, heading_rad) })
    }

    /// A stop, by its category of IEC 60204-1.
    pub fn stop(&mut self, category: &str) -> Result<(), Failure> {
        let Ok(name) = serde_json::from_value::<StopName>(category.into()) else {
            let names = choice_names::<StopName>().join(", ");
            return Err(Failure::Broken(format!("stop: expected one of {names}, found `{category}`")));
        };
        self.ask("stop", RequestKind::Stop(name.into()))
    }

    /// What it does.
    pub fn phase(&self) -> Phase {
        self.stepped.phase()
    }

    /// Why it stopped, where it did.
    pub fn stop_reason(&self) -> Option<&'static str> {
        use omnibase_robot::signals::SafetyReason;
        let reason = self.stepped.record().stop_reason;
        (reason != SafetyReason::None).then(|| reason.text())
    }

    /// The time of a cycle, s.
    pub fn cycle_s(&self) -> f64 {
        self.stepped.plan().bus.cycle_ns as f64 * 1e-9
    }

    /// Where these signals stand in a row.
    pub fn columns(&self, signals: &[String]) -> Result<Vec<usize>, Failure> {
        columns(self.stepped.schema(), signals)
    }

    /// Adds these of the last cycle's signals.
    pub fn values(&mut self, columns: &[usize], values: &mut Vec<f64>) {
        let row = self.stepped.row();
        values.extend(columns.iter().map(|&column| row[column]));
    }
}

/// Where signals stand in a row, in the order in which they are named; `*` stands for any characters.
pub fn columns(schema: &RunSchema, signals: &[String]) -> Result<Vec<usize>, Failure> {
    let names: Vec<String> = schema.names().collect();
    let mut columns = Vec::new();
    for signal in signals {
        let before = columns.len();
        columns.extend((0..names.len()).filter(|&column| fits(signal, &names[column])));
        if columns.len() == before {
            let near = nearest(signal, names.iter().map(String::as_str));
            let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
            return Err(Failure::Broken(format!("`{signal}`: no signal has this name{near}")));
        }
    }
    Ok(columns)
}

/// A frame by its name.
pub fn frame(name: &str) -> Result<Frame, Failure> {
    match name {
        "body" => Ok(Frame::Body),
        "odom" => Ok(Frame::Odom),
        _ => Err(Failure::Broken(format!("frame: expected `body` or `odom`, found `{name}`"))),
    }
}
