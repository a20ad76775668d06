//! The state machine of a joystick: from events and time to what a person wishes.

use crate::description::State;
use crate::event::{EV_KEY, EV_SYN, RawEvent, SYN_DROPPED, SYN_REPORT};
use crate::map::Map;
use omnibase_robot::JoystickShape;
use omnibase_robot::config::ButtonCode;

/// The frame in which a joystick drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JoystickFrame {
    /// Forward is the platform's own forward.
    #[default]
    Platform,
    /// Forward is where the platform's forward was when the frame was set last.
    Fixed,
}

/// Whether somebody holds the joystick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hold {
    /// The dead-man button is held; where none is required: an axis is out of its dead zone.
    Held,
    /// Nobody drives.
    #[default]
    Released,
}

/// Whether there is a joystick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Presence {
    /// There is one, and the reading thread confirmed it within the age.
    Present,
    /// There is none, or nobody reads it any more.
    #[default]
    Absent,
}

/// Why a joystick commands nothing until a person enables it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Block {
    /// It was unplugged, or nobody read it for longer than its age.
    Lost,
    /// Its stop button was pressed.
    Stopped,
}

/// What was asked by buttons since the last command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    /// Stop the robot and take the command back.
    pub stop: bool,
    /// The fixed frame becomes the platform's present one.
    pub reset_frame: bool,
    /// A person enables the joystick, and what it drives.
    pub enable: bool,
    /// Remember the pose where the robot stands.
    pub teach_point: bool,
}

/// What a person at a joystick wishes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JoystickCommand {
    /// Parts of the greatest speeds forward, to the left and about the vertical axis, −1..1; 0 unless it is held.
    pub twist: [f64; 3],
    /// The frame of the twist.
    pub frame: JoystickFrame,
    /// Whether somebody drives; never while it is blocked or absent.
    pub hold: Hold,
    /// Whether there is a joystick.
    pub presence: Presence,
    /// Why it is blocked, where it is.
    pub block: Option<Block>,
    /// What was asked by buttons.
    pub requests: Requests,
    /// Since the reading thread confirmed the values, ns; `None` where no joystick was ever there.
    pub age_ns: Option<u64>,
}

/// What must follow an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Nothing.
    GoOn,
    /// Events were lost: when all that is at hand was taken, give the device's state by [`Joystick::reread`].
    Reread,
}

/// A joystick that may come and go.
///
/// evdev says nothing while nothing moves, so a silence of events is no loss: the last values count on. What must
/// not fall silent is the thread that reads: it confirms by [`Joystick::heard`], many times within the age. A gap
/// longer than the age means that values may be stale; then the joystick counts as lost, as when it is unplugged.
#[derive(Clone, Debug)]
pub struct Joystick {
    age_ns: u64,
    plugged: Option<Plugged>,
    heard_ns: Option<u64>,
    block: Option<Block>,
    /// It must be let go and rest once before it drives: after it came, and after it was enabled.
    must_release: bool,
    frame: JoystickFrame,
    requests: Requests,
}

#[derive(Clone, Debug)]
struct Plugged {
    map: Map,
    /// At the end of the last report.
    state: State,
    /// With the events of the report that isn't at its end yet.
    coming: State,
    drops: Drops,
}

impl Plugged {
    /// Somebody wants to drive.
    fn is_held(&self) -> bool {
        match self.map.dead_man {
            Some(button) => self.state.pressed.contains(&button.0),
            None => self.map.twist(&self.state) != [0.0; 3],
        }
    }

    /// The dead-man button is up and all axes rest.
    fn is_let_go(&self) -> bool {
        !self.is_held() && self.map.is_at_rest(&self.state)
    }
}

/// Whether events were lost in this report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Drops {
    No,
    UntilReport,
}

impl Joystick {
    /// No joystick yet; `age_ns` is how long its reader may be silent.
    pub fn new(age_ns: u64) -> Self {
        Joystick {
            age_ns,
            plugged: None,
            heard_ns: None,
            block: None,
            must_release: true,
            frame: JoystickFrame::Platform,
            requests: Requests::default(),
        }
    }

    /// The map of the device that is there.
    pub fn map(&self) -> Option<&Map> {
        self.plugged.as_ref().map(|plugged| &plugged.map)
    }

    /// Where its axes and buttons are.
    pub fn state(&self) -> Option<&State> {
        self.plugged.as_ref().map(|plugged| &plugged.state)
    }

    /// A device is there. One that was lost before stays blocked, and whatever is held has to be let go first.
    pub fn plug(&mut self, now_ns: u64, map: Map, state: State) {
        if self.heard_ns.is_none() {
            self.frame = map.frame;
        }
        self.plugged = Some(Plugged { map, coming: state.clone(), state, drops: Drops::No });
        self.heard_ns = Some(now_ns);
        self.must_release = true;
    }

    /// The device is gone.
    pub fn unplug(&mut self) {
        if self.plugged.take().is_some() {
            self.lose();
        }
    }

    /// The reader confirms that nothing else came until now.
    pub fn heard(&mut self, now_ns: u64) {
        if self.plugged.is_some() {
            self.look_at_age(now_ns);
            self.heard_ns = Some(now_ns);
        }
    }

    /// Takes an event in.
    pub fn take(&mut self, event: RawEvent) -> Next {
        let Some(plugged) = &mut self.plugged else { return Next::GoOn };
        match (event.kind, event.code) {
            (EV_SYN, SYN_DROPPED) => {
                // Half a report is none.
                plugged.coming.clone_from(&plugged.state);
                plugged.drops = Drops::UntilReport;
            }
            (EV_SYN, SYN_REPORT) if plugged.drops == Drops::UntilReport => {
                plugged.drops = Drops::No;
                return Next::Reread;
            }
            (EV_SYN, SYN_REPORT) => {
                let coming = plugged.coming.clone();
                self.come_to(coming);
            }
            _ if plugged.drops == Drops::UntilReport => {}
            _ => {
                plugged.coming.take(event, &plugged.map.device);
                // Who lets go and grasps again within one report has let go.
                let is_released = event.kind == EV_KEY
                    && event.value == 0
                    && plugged.map.dead_man == Some(ButtonCode(event.code));
                if is_released && plugged.map.is_at_rest(&plugged.coming) {
                    self.must_release = false;
                }
            }
        }
        Next::GoOn
    }

    /// The device's state, asked of the kernel after events were lost.
    pub fn reread(&mut self, state: State) {
        if let Some(plugged) = &mut self.plugged {
            plugged.coming.clone_from(&state);
            self.come_to(state);
        }
    }

    /// A person allows the joystick to command again: by its own button, or elsewhere. One that isn't there can't be.
    pub fn enable(&mut self) {
        if self.plugged.is_some() && self.block.take().is_some() {
            self.must_release = true;
        }
    }

    /// Shapes it anew, as a whole. One that nobody holds must not begin to drive by that.
    pub fn reshape(&mut self, shape: &JoystickShape) {
        if let Some(plugged) = &mut self.plugged {
            self.must_release |= !plugged.is_held();
            plugged.map.reshape(shape);
        }
    }

    /// Whoever it drives took the command from it: it is blocked until it is enabled.
    pub fn block(&mut self, why: Block) {
        self.block.get_or_insert(why);
    }

    /// What a person wishes now; what was asked by buttons is given once.
    pub fn command(&mut self, now_ns: u64) -> JoystickCommand {
        self.look_at_age(now_ns);
        let age_ns = self.heard_ns.map(|heard_ns| now_ns.saturating_sub(heard_ns));
        let is_fresh = age_ns.is_some_and(|age_ns| age_ns <= self.age_ns);
        let mut command = JoystickCommand {
            frame: self.frame,
            block: self.block,
            requests: std::mem::take(&mut self.requests),
            age_ns,
            ..JoystickCommand::default()
        };
        let Some(plugged) = self.plugged.as_ref().filter(|_| is_fresh) else { return command };
        command.presence = Presence::Present;
        let is_held = plugged.is_held();
        self.must_release &= !plugged.is_let_go();
        if is_held && !self.must_release && self.block.is_none() {
            (command.hold, command.twist) = (Hold::Held, plugged.map.twist(&plugged.state));
        }
        command
    }

    /// A new state: buttons that went down ask for what they are there for.
    fn come_to(&mut self, state: State) {
        let Some(plugged) = &mut self.plugged else { return };
        let before = std::mem::replace(&mut plugged.state, state);
        self.must_release &= !plugged.is_let_go();
        let (map, state) = (&plugged.map, &plugged.state);
        let went_down = |button: Option<ButtonCode>| {
            button.is_some_and(|ButtonCode(code)| {
                state.pressed.contains(&code) && !before.pressed.contains(&code)
            })
        };
        if went_down(map.platform_frame) {
            self.frame = JoystickFrame::Platform;
        }
        if went_down(map.fixed_frame) {
            self.frame = JoystickFrame::Fixed;
        }
        if went_down(map.toggle_frame) {
            self.frame = match self.frame {
                JoystickFrame::Platform => JoystickFrame::Fixed,
                JoystickFrame::Fixed => JoystickFrame::Platform,
            };
        }
        self.requests.reset_frame |= went_down(map.reset_frame);
        self.requests.teach_point |= went_down(map.teach_point);
        let (stop, enable) = (went_down(map.stop), went_down(Some(map.enable)));
        if enable {
            self.requests.enable = true;
            self.enable();
        }
        // Who presses both wants to stop.
        if stop {
            self.requests = Requests { stop: true, enable: false, ..self.requests };
            self.block(Block::Stopped);
        }
    }

    fn look_at_age(&mut self, now_ns: u64) {
        let heard_ns = self.heard_ns.unwrap_or(now_ns);
        if self.plugged.is_some() && now_ns.saturating_sub(heard_ns) > self.age_ns {
            self.lose();
        }
    }

    fn lose(&mut self) {
        self.block = Some(Block::Lost);
        self.must_release = true;
        // What was asked before the loss must not happen after it; a stop may.
        self.requests.enable = false;
        self.requests.reset_frame = false;
        self.requests.teach_point = false;
    }
}
