//! How old what is asked may be: it counts from what whoever asked had last from the robot.

use omnibase_robot::RequestKind;
use omnibase_robot::signals::AxisAsk;

use super::command::{Ask, Refusal, StickWish};

/// The oldest that what begins a motion, or lets one begin, may be when it is heard, ns.
pub const BEGINNING_AGE_NS: u64 = 500_000_000;

/// When something was asked, on the robot's own clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamp {
    /// At the robot's own computer, with no line between: when it is heard.
    #[default]
    Here,
    /// By the robot itself, for somebody who asked before: it doesn't tell that they are still there.
    OnBehalf,
    /// Over a line, by somebody to whom the robot's clock was last told like this, ns.
    Told(u64),
    /// Over a line, and nobody knows when.
    Missing,
}

/// Which age counts for what is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Counts {
    /// None: it ends a motion, or changes none.
    Never,
    /// Where it is known: it changes a motion that is under way.
    WhereKnown,
    /// Always: it begins a motion, or lets one begin.
    Always,
}

impl Stamp {
    /// When it was asked, ns, as far as its age lets it count; `stick_ns` is what a stick's wish may have.
    pub(super) fn judge(self, now_ns: u64, ask: &Ask, stick_ns: u64) -> Result<u64, Refusal> {
        let most_ns = if matches!(ask, Ask::Stick(_)) { stick_ns } else { BEGINNING_AGE_NS };
        match (counts(ask), self) {
            (Counts::Never, _) | (Counts::WhereKnown, Stamp::Missing) => Ok(now_ns),
            (Counts::WhereKnown | Counts::Always, stamp) => stamp.within(now_ns, most_ns),
        }
    }

    /// When it was asked, ns, where that is no longer ago than so many ns.
    pub(super) fn within(self, now_ns: u64, most_ns: u64) -> Result<u64, Refusal> {
        match self {
            Stamp::Here | Stamp::OnBehalf => Ok(now_ns),
            Stamp::Missing => Err(Refusal::Unstamped),
            Stamp::Told(told_ns) => match now_ns.checked_sub(told_ns) {
                None => Err(Refusal::OfAnotherRun),
                Some(age_ns) if age_ns > most_ns => Err(Refusal::TooOld { age_ns, most_ns }),
                Some(_) => Ok(told_ns),
            },
        }
    }
}

/// Whether it begins a motion, or lets one begin.
pub(super) fn begins_or_allows(ask: &Ask) -> bool {
    counts(ask) == Counts::Always
}

fn counts(ask: &Ask) -> Counts {
    match ask {
        Ask::Robot(kind) => match kind {
            RequestKind::Enable
            | RequestKind::Acknowledge
            | RequestKind::Track
            | RequestKind::Resume
            | RequestKind::GoTo { .. }
            // Where the robot was then is not where it is.
            | RequestKind::SetPose { .. }
            | RequestKind::SetOutput { .. }
            | RequestKind::Axis { ask: AxisAsk::Home | AxisAsk::Move { .. } | AxisAsk::Run { .. }, .. }
            | RequestKind::Velocity { .. } => Counts::Always,
            RequestKind::Set { .. }
            | RequestKind::SwitchController { .. }
            | RequestKind::SetDriveMode { .. }
            | RequestKind::SetObstacle { .. }
            | RequestKind::SetFence { .. }
            | RequestKind::RemoveObstacle { .. } => Counts::WhereKnown,
            RequestKind::Stop(_)
            | RequestKind::Pause
            | RequestKind::UseReference { .. }
            | RequestKind::Axis { ask: AxisAsk::Stop, .. }
            | RequestKind::ResetOutput { .. } => Counts::Never,
        },
        Ask::ReleaseEmergencyStop | Ask::EnableStick(_) | Ask::Stick(StickWish::Held { .. }) => {
            Counts::Always
        }
        Ask::Stick(StickWish::Released | StickWish::Lost | StickWish::Withdrawn | StickWish::Blocked)
        | Ask::Load { .. }
        | Ask::EmergencyStop
        | Ask::RecoverStick
        | Ask::EndMotion
        | Ask::Alive
        | Ask::Begun
        | Ask::Gone
        | Ask::PagesLost => Counts::Never,
    }
}
