//! What a person or a program asks of a running robot.

use std::borrow::Cow;

use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{AxisAsk, Frame, RequestAnswer};
use omnibase_robot::stages::Reference;

use super::stamp::Stamp;

/// Clients that can hold a session at the same time.
pub const MAX_SESSIONS: usize = 16;

/// Whom a command comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Client {
    /// The joystick at the robot's computer.
    Joystick,
    /// A page in a browser, by the number of its session, below [`MAX_SESSIONS`]; what it started ends with it.
    Page(u8),
    /// The command line or a program: it asks and goes; what it started goes on.
    Command,
}

/// What a stick wishes: what somebody holds to drive by hand, the [joystick](Client::Joystick) or a page's. A resting stick repeats its wish; silence is a loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StickWish {
    /// Its dead-man button is held.
    Held {
        /// Wished speed.
        twist: Twist2,
        /// The frame of that speed.
        frame: Frame,
    },
    /// It is there, and nobody holds it.
    Released,
    /// It is gone.
    Lost,
    /// Who holds it stopped and gave the command back: it is blocked until it is enabled.
    Withdrawn,
    /// It is there and wishes nothing, for it waits to be enabled.
    Blocked,
}

/// What has become of the joystick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JoystickState {
    /// None was ever there.
    #[default]
    Absent,
    /// It is there, and may drive.
    Present,
    /// It is gone, or silent; when it is back it is blocked.
    Lost,
    /// It is there, and blocked until a person enables it.
    Blocked,
}

impl JoystickState {
    /// The number by which recordings hold it: 0 absent, 1 present, 2 lost, 3 blocked.
    pub fn code(self) -> u64 {
        self as u64
    }
}

/// What is asked.
pub enum Ask {
    /// A request that the robot itself answers. Velocities come from sticks.
    Robot(RequestKind),
    /// Take this reference in place of the present one.
    Load {
        /// Its number, by which recordings know it.
        number: u32,
        /// The reference.
        reference: Box<dyn Reference>,
    },
    /// Stop, and let nothing begin until that is released.
    EmergencyStop,
    /// Motion may be asked for again.
    ReleaseEmergencyStop,
    /// A stick's wish.
    Stick(StickWish),
    /// The stick of this client, which was lost or withdrawn, may command again once it was let go.
    EnableStick(Client),
    /// From now on the session's stick drives again by itself after a silence; whatever else stops the robot blocks it.
    RecoverStick,
    /// The motion that the session began shall end, and nobody else's.
    EndMotion,
    /// The session is alive.
    Alive,
    /// A session begins under this number.
    Begun,
    /// The session has ended.
    Gone,
    /// The server of all pages is no more.
    PagesLost,
}

impl Ask {
    /// Whether it ends a motion, and begins none.
    pub(super) fn stops(&self) -> bool {
        matches!(
            self,
            Ask::EmergencyStop
                | Ask::EndMotion
                | Ask::Gone
                | Ask::PagesLost
                | Ask::Robot(RequestKind::Stop(_))
                | Ask::Stick(StickWish::Released | StickWish::Lost | StickWish::Withdrawn)
        )
    }

    /// Whether it stops an axis.
    pub(super) fn stops_axis(&self) -> bool {
        matches!(self, Ask::Robot(RequestKind::Axis { ask: AxisAsk::Stop, .. }))
    }
}

/// A command on its way to the cycle.
pub struct Command {
    /// Whom it comes from.
    pub client: Client,
    /// The number by which its answer is found; 0 where nobody waits for one.
    pub ticket: u64,
    /// What is asked.
    pub ask: Ask,
    /// When.
    pub stamp: Stamp,
}

/// What became of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The robot's own answer.
    Robot(RequestAnswer),
    /// Done.
    Done,
    /// Refused before the robot was asked.
    Refused(Refusal),
}

/// Why a command never reached the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The emergency stop is set.
    EmergencyStop,
    /// Somebody with more say commands.
    Commanded,
    /// The motion that somebody else asked for is under way.
    Led,
    /// Too much was asked at once.
    Busy,
    /// Velocities come from sticks.
    NotAStick,
    /// The run follows its plan, and nobody leads it.
    Planned,
    /// A stop or a pause came first, or whoever asked is gone.
    Stopped,
    /// It is a way that was planned for what was in the way then.
    LookedAfter,
    /// There is no stick that could be enabled.
    NoStick,
    /// It was asked too long ago.
    TooOld {
        /// How long ago, ns.
        age_ns: u64,
        /// How long ago it may be, ns.
        most_ns: u64,
    },
    /// Nobody knows how old it is.
    Unstamped,
    /// Its stamp is later than the robot's clock.
    OfAnotherRun,
}

impl Answer {
    /// The answer in words.
    pub fn text(self) -> Cow<'static, str> {
        if let Answer::Refused(Refusal::TooOld { age_ns, most_ns }) = self {
            let [age_s, most_s] = [age_ns, most_ns].map(|ns| ns as f64 * 1e-9);
            return format!(
                "refused: it was asked {age_s:.2} s ago, and counts for {most_s} s: the line is slow; ask again"
            )
            .into();
        }
        Cow::Borrowed(self.fixed_text())
    }

    fn fixed_text(self) -> &'static str {
        match self {
            Answer::Done | Answer::Robot(RequestAnswer::Taken | RequestAnswer::None) => "done",
            Answer::Robot(RequestAnswer::TooOld) => "refused: it came too late",
            Answer::Robot(RequestAnswer::WrongPhase) => "refused: it doesn't fit what the robot is doing",
            Answer::Robot(RequestAnswer::Refused) => {
                "refused: the value is outside what is allowed, or there is nothing that it could be about"
            }
            Answer::Robot(RequestAnswer::TooFar) => {
                "refused: the platform stands too far from the path's start"
            }
            Answer::Robot(RequestAnswer::AtStartUpOnly) => {
                "refused: a drive takes its torque limit at start-up only, for its object isn't mapped"
            }
            Answer::Robot(RequestAnswer::PoseUnknown) => {
                "refused: nobody knows where the platform stands: set its pose first (set_pose); \
                 a stick leads it slowly, in its own frame"
            }
            Answer::Robot(RequestAnswer::StopInput) => {
                "refused: the input that stops the robot (safety.stop_input) is set, or isn't heard"
            }
            Answer::Robot(RequestAnswer::EnableInput) => {
                "refused: the input that enables the robot (safety.enable_input) is off, or isn't heard"
            }
            Answer::Robot(RequestAnswer::NotHomed) => {
                "refused: nobody knows where the axis is: home it first (home_axis)"
            }
            Answer::Robot(RequestAnswer::Homing) => "refused: the axis looks for its home",
            Answer::Robot(RequestAnswer::DriveMode) => {
                "refused: the drive can't follow every control law of the robot's file so: its map, or its speed \
                 loop's gain and integral time, are missing, or a law commands torques"
            }
            Answer::Robot(RequestAnswer::Blocked) => {
                "refused: an obstacle is too near to where the motion would begin or end"
            }
            Answer::Robot(RequestAnswer::OutsideFence) => {
                "refused: the platform wouldn't fit inside the fence where the motion would begin or end, or on the way there \
                 from the motion that is under way"
            }
            Answer::Robot(RequestAnswer::Moving) => {
                "refused: the platform moves so that nothing leads onto the first seconds of the path: stop it first"
            }
            Answer::Refused(Refusal::EmergencyStop) => "refused: the emergency stop is set",
            Answer::Refused(Refusal::Commanded) => "refused: somebody drives by hand",
            Answer::Refused(Refusal::Led) => {
                "refused: the motion that somebody else asked for is under way: stop it first"
            }
            Answer::Refused(Refusal::Busy) => "refused: too much was asked at once",
            Answer::Refused(Refusal::Planned) => {
                "refused: this run follows its plan to the end; it can be stopped, and its settings and obstacles changed"
            }
            Answer::Refused(Refusal::NotAStick) => "refused: a velocity comes from a stick",
            Answer::Refused(Refusal::Stopped) => "refused: a stop or a pause came first",
            Answer::Refused(Refusal::LookedAfter) => {
                "refused: this way was planned for what was in the way then: drive there again (drive_to)"
            }
            Answer::Refused(Refusal::NoStick) => "refused: the stick isn't there, so it can't be enabled",
            Answer::Refused(Refusal::TooOld { .. }) => "refused: it was asked too long ago",
            Answer::Refused(Refusal::Unstamped) => {
                "refused: nobody knows how old it is: expected with it, as `stamp`, the newest one of the robot's \
                 messages, or of /api/now"
            }
            Answer::Refused(Refusal::OfAnotherRun) => {
                "refused: its stamp is later than the robot's clock, so it isn't of this run: expected the newest one \
                 of the robot's messages, or of /api/now"
            }
        }
    }

    /// Whether it was carried out.
    pub fn is_done(self) -> bool {
        matches!(self, Answer::Done | Answer::Robot(RequestAnswer::Taken))
    }
}

/// Who commands the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Commander {
    /// Nobody: the robot rests.
    #[default]
    Nobody,
    /// A stick drives.
    Stick(Client),
    /// A reference is followed, or a way, that this client asked for.
    Reference(Client),
}

impl std::fmt::Display for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Client::Joystick => f.write_str("joystick"),
            Client::Page(number) => write!(f, "page {}", number + 1),
            Client::Command => f.write_str("command line"),
        }
    }
}

impl Client {
    /// The number by which recordings hold it: 1 the joystick, 2 a command, 16 and up the pages.
    pub fn code(self) -> u64 {
        match self {
            Client::Joystick => 1,
            Client::Command => 2,
            Client::Page(number) => 16 + u64::from(number),
        }
    }
}

impl Commander {
    /// The number by which recordings hold it: 0 nobody, 100 and up a stick, 200 and up a reference, plus the client's.
    pub fn code(self) -> u64 {
        match self {
            Commander::Nobody => 0,
            Commander::Stick(client) => 100 + client.code(),
            Commander::Reference(client) => 200 + client.code(),
        }
    }
}

/// Requests that begin a motion.
pub(super) fn begins_motion(kind: &RequestKind) -> bool {
    matches!(kind, RequestKind::Track | RequestKind::Resume | RequestKind::GoTo { .. })
}

/// What may change the motion that is under way: whoever asked for that alone does so.
pub(super) fn redirects(kind: &RequestKind) -> bool {
    begins_motion(kind) || matches!(kind, RequestKind::UseReference { .. })
}

/// What must not begin while the robot shall stand: motion, and what moves beside it.
pub(super) fn begins(kind: &RequestKind) -> bool {
    let is_of_an_axis = matches!(kind, RequestKind::Axis { ask, .. } if *ask != AxisAsk::Stop);
    begins_motion(kind)
        || is_of_an_axis
        || matches!(kind, RequestKind::Enable | RequestKind::SetOutput { .. })
}

/// What only those ask who lead a robot.
pub(super) fn is_of_a_leader(ask: &Ask) -> bool {
    match ask {
        Ask::Robot(RequestKind::Stop(_) | RequestKind::Axis { ask: AxisAsk::Stop, .. }) => false,
        Ask::Robot(RequestKind::Axis { .. }) => true,
        // What moves beside it is the plan's, too.
        Ask::Robot(RequestKind::SetOutput { .. }) => true,
        Ask::Robot(kind) => leads(kind),
        Ask::Stick(_) | Ask::EnableStick(_) | Ask::Load { .. } => true,
        Ask::RecoverStick | Ask::EndMotion => false,
        Ask::Alive | Ask::Begun | Ask::Gone | Ask::PagesLost => false,
        Ask::EmergencyStop | Ask::ReleaseEmergencyStop => false,
    }
}

/// What decides about motion: who asks for that leads the robot.
pub(super) fn leads(kind: &RequestKind) -> bool {
    !matches!(
        kind,
        RequestKind::Set { .. }
            | RequestKind::SetObstacle { .. }
            | RequestKind::RemoveObstacle { .. }
            | RequestKind::SetFence { .. }
            | RequestKind::SetOutput { .. }
            | RequestKind::ResetOutput { .. }
            | RequestKind::Axis { .. }
    )
}
