//! Whether every wheel stops in time, whatever is lost, in which state, at which instant.
//!
//! One robot lives through case after case: it is brought into a state, at a random speed in a random direction, for a
//! random time; then something is lost, mostly something more while it stops, and its simulated wheels are watched until
//! they stand.

mod allowed;
mod comeback;
mod losses;
mod row;

use omnibase_robot::signals::{SafetyAction, StopCategory};
use omnibase_run::live::Ages;
use omnibase_run::live::command::Client;

pub use row::Stops;

/// Slower than this a wheel stands, rad/s: 2 mm/s at a radius of 0.1 m.
pub const STANDING_RAD_S: f64 = 0.02;
/// What a drive's own loop and the body take beyond the commands, s: the wheels follow with a lag.
pub const LAG_S: f64 = 0.05;
/// Time of the drives' process-data watchdog, as it is after power-on.
pub const WATCHDOG_NS: u64 = 100_000_000;
/// How long sources may be silent.
const AGES: Ages = Ages { stick_ns: 200_000_000, session_ns: 500_000_000 };
/// Longer than this no stop takes; then it counts as none.
const NEVER_S: f64 = 20.0;
/// Once it stands it has to stay so, cycles.
const STAYS: u32 = 20;

/// What the robot does when something is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// The drives are on their way to operation.
    Enabling,
    /// It holds.
    Holding,
    /// Driven by the joystick.
    Joystick,
    /// Driven by a page's stick.
    PageStick,
    /// It follows the reference that a page started.
    PageReference,
    /// It follows the reference that the command line started.
    Reference,
    /// On its way to a pose, for a page.
    Way,
    /// It pauses on the reference.
    Paused,
    /// It ramps down already, gently.
    Stopping,
}

/// What is lost, or asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// The stick is let go.
    LetGo,
    /// The stick is unplugged.
    StickGone,
    /// The stick falls silent.
    StickSilent,
    /// The page is closed.
    PageClosed,
    /// The page falls silent.
    PageSilent,
    /// The line to the page becomes slow: what it says comes, and was said long ago.
    LineSlow,
    /// A stop of category 0 is asked for.
    Category0,
    /// A stop of category 1.
    Category1,
    /// A stop of category 2.
    Category2,
    /// The emergency stop.
    Emergency,
    /// The process dies: nothing is computed or sent any more.
    Killed,
    /// The cable is cut: what is computed reaches no drive.
    CableCut,
    /// The interface loses its carrier, and has it again before drives miss it.
    CarrierLost,
    /// Obstacles all around: what is followed leads nowhere any more.
    WayBlocked,
    /// One drive loses its power: its wheel turns freely.
    DrivePower,
    /// One drive loses its process data: it goes on until its watchdog expires.
    DriveData,
    /// A drive fails by itself.
    DriveFault,
    /// An emergency stop cuts the supply of all drives.
    SupplyCut,
}

/// All states.
pub const STATES: [State; 9] = [
    State::Enabling,
    State::Holding,
    State::Joystick,
    State::PageStick,
    State::PageReference,
    State::Reference,
    State::Way,
    State::Paused,
    State::Stopping,
];
/// All losses; those from the eighth on can come on top of others.
pub const LOSSES: [Loss; 18] = [
    Loss::LetGo,
    Loss::StickGone,
    Loss::StickSilent,
    Loss::PageClosed,
    Loss::PageSilent,
    Loss::LineSlow,
    Loss::WayBlocked,
    Loss::Category0,
    Loss::Category1,
    Loss::Category2,
    Loss::Emergency,
    Loss::Killed,
    Loss::CableCut,
    Loss::CarrierLost,
    Loss::DrivePower,
    Loss::DriveData,
    Loss::DriveFault,
    Loss::SupplyCut,
];
/// What can come on top of a stop that is under way.
const ON_TOP: &[Loss] = LOSSES.split_at(7).1;

impl State {
    /// Who commands in it.
    fn client(self) -> Client {
        match self {
            State::Joystick => Client::Joystick,
            State::PageStick | State::PageReference | State::Way | State::Paused => Client::Page(0),
            State::Enabling | State::Holding | State::Reference | State::Stopping => Client::Command,
        }
    }
}

impl Loss {
    /// Whether it has to stop a robot in that state: the loss of a page stops what that page commands, and no more.
    pub fn concerns(self, state: State) -> bool {
        match self {
            Loss::LetGo | Loss::StickGone | Loss::StickSilent => {
                matches!(state, State::Joystick | State::PageStick)
            }
            Loss::PageClosed | Loss::PageSilent | Loss::LineSlow => {
                matches!(state, State::PageStick | State::PageReference | State::Way | State::Paused)
            }
            Loss::WayBlocked => matches!(state, State::PageReference | State::Reference | State::Way),
            _ => true,
        }
    }

    /// Whether one drive is lost.
    fn is_drive(self) -> bool {
        matches!(self, Loss::DrivePower | Loss::DriveData)
    }

    /// Whether a wheel is left that no drive brakes, where the file says so for lost drives.
    fn leaves_unbraked(self, lost_device_stop: SafetyAction) -> bool {
        match self {
            Loss::DriveFault | Loss::SupplyCut => true,
            Loss::CarrierLost => lost_device_stop == SafetyAction::Stop(StopCategory::RemoveTorque),
            _ => self.is_drive(),
        }
    }

    /// Whether whoever drove by it has to be enabled by a person.
    fn blocks(self) -> bool {
        matches!(
            self,
            Loss::StickGone | Loss::StickSilent | Loss::PageClosed | Loss::PageSilent | Loss::LineSlow
        )
    }

    /// How hard a stop it leads to, where the file says so for a lost drive; without a program drives do what they do.
    fn severity(self, lost_device_stop: SafetyAction) -> u8 {
        let action = match self {
            Loss::LetGo
            | Loss::StickGone
            | Loss::StickSilent
            | Loss::PageClosed
            | Loss::PageSilent
            | Loss::LineSlow
            | Loss::WayBlocked
            | Loss::Category2 => SafetyAction::Stop(StopCategory::RampAndHold),
            Loss::Category1 | Loss::Emergency => SafetyAction::Stop(StopCategory::RampThenRemove),
            Loss::Category0 => SafetyAction::Stop(StopCategory::RemoveTorque),
            Loss::DrivePower | Loss::DriveData => lost_device_stop,
            Loss::DriveFault => SafetyAction::QuickStop,
            // A ramp that nobody hears is none.
            Loss::CarrierLost if lost_device_stop.severity() < SafetyAction::QuickStop.severity() => {
                SafetyAction::QuickStop
            }
            Loss::CarrierLost => lost_device_stop,
            Loss::Killed | Loss::CableCut | Loss::SupplyCut => return u8::MAX,
        };
        action.severity()
    }
}

/// One case and what came of it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The seed that makes it, in its row of cases.
    pub seed: u64,
    /// The state.
    pub state: State,
    /// What was lost.
    pub loss: Loss,
    /// What came on top of it, and when, s.
    pub then: Option<(Loss, f64)>,
    /// The fastest wheel at the instant of the loss, rad/s.
    pub from_rad_s: f64,
    /// Until the last wheel stood for good, s; infinite where that never came.
    pub stopped_s: f64,
    /// What limits, ages and watchdogs allow, s.
    pub allowed_s: f64,
    /// Where one drive was lost and nothing came on top: until no drive had torque any more, and until when it had to
    /// be so, s. Wheels that are heard brake until then; a platform on three wheels has one motion left that two can't.
    pub torque_off_s: Option<(f64, f64)>,
    /// Whether a stick or page that was lost commanded again before a person enabled it, or not even then.
    pub blocking: Blocking,
    /// Whether anything moved once what was lost was back.
    pub comeback: Comeback,
}

/// What happened by itself when what was lost was back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comeback {
    /// Nothing was lost on the bus.
    NotConcerned,
    /// It stayed without torque.
    Stayed,
    /// Its drives were enabled, and it holds.
    Held,
    /// It moved where the file says so, behind a loss alone, with a person there, and warned for long enough.
    MovedAsWarned,
    /// It moved, or was enabled, and must not have been.
    WithoutPerson,
}

/// What became of a source that was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blocking {
    /// It isn't about one.
    NotConcerned,
    /// It was blocked until a person enabled it.
    Kept,
    /// It drove before a person enabled it.
    Broken,
    /// It didn't drive afterwards either.
    ForEver,
}

impl Case {
    /// Whether every wheel stopped in time, torque was off in time, and nobody drove who had to be enabled.
    pub fn is_in_time(&self) -> bool {
        self.stopped_s <= self.allowed_s
            && self.torque_off_s.is_none_or(|(found_s, allowed_s)| found_s <= allowed_s)
            && matches!(self.blocking, Blocking::NotConcerned | Blocking::Kept)
    }

    /// Where one drive was lost, and nothing else ended a motion: how. A way that is blocked ends none before it is given up,
    /// and nothing comes on top of it as late as that.
    fn lost_drive(&self) -> Option<Loss> {
        let loss = match (self.loss, self.then) {
            (Loss::WayBlocked, Some((on_top, _))) => on_top,
            (loss, None) => loss,
            (_, Some(_)) => return None,
        };
        loss.is_drive().then_some(loss)
    }

    /// Whether anything moved, or was enabled, that needs a person.
    pub fn moves_without_person(&self) -> bool {
        self.comeback == Comeback::WithoutPerson
    }
}
