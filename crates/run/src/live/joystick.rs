//! From the joystick at the robot's computer to what is asked of the robot.

use omnibase_joystick::{Block, Hold, Joystick, JoystickCommand, JoystickFrame, Map, Presence};
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Phase, StopCategory};
use omnibase_robot::{JoystickShape, RequestKind, RobotPlan};

use super::command::{Ask, Client, StickWish};
use super::snapshot::Snapshot;

/// The joystick among the [blocked sticks](crate::channels::Authority::blocked_sticks).
const JOYSTICK_BIT: u64 = 1;

/// Scales a joystick's wish to a robot's limits, turns its fixed frame, and keeps both sides agreed on whether it is
/// blocked: the [`Operator`](super::Operator) has the last word.
pub struct JoystickDriver {
    speed_m_s: f64,
    turn_speed_rad_s: f64,
    /// The platform's heading when the fixed frame was set; until then odom's own, the heading at the start.
    fixed_heading_rad: f64,
    /// The block that the robot was told of.
    told: Option<Block>,
    /// Whether the operator blocked it when it was looked at last.
    was_blocked: bool,
    /// How the robot's file shapes it, before anybody changed that.
    at_start: JoystickShape,
    /// How the robot shaped it when it was looked at last.
    shape: JoystickShape,
    /// Whether a device was there when it was looked at last, or ever before.
    was_plugged: bool,
    was_ever_plugged: bool,
    /// What a device's own map makes of the shape, to be told to the robot.
    to_tell: Vec<(u32, f64)>,
}

impl JoystickDriver {
    /// A driver within a robot's limits.
    pub fn new(plan: &RobotPlan) -> Self {
        let shape = JoystickShape::of(&plan.joystick);
        JoystickDriver {
            speed_m_s: plan.limits.speed_m_s,
            turn_speed_rad_s: plan.limits.turn_speed_rad_s,
            fixed_heading_rad: 0.0,
            told: None,
            was_blocked: false,
            at_start: shape,
            shape,
            was_plugged: false,
            was_ever_plugged: false,
            to_tell: Vec::new(),
        }
    }

    /// Tells the joystick what became of it at the robot: blocked there, enabled by somebody elsewhere, shaped anew.
    pub fn agree(&mut self, joystick: &mut Joystick, seen: &Snapshot) {
        let is_blocked = seen.extras.authority.blocked_sticks & JOYSTICK_BIT != 0;
        match (self.was_blocked, is_blocked) {
            (false, true) => joystick.block(Block::Lost),
            (true, false) => joystick.enable(),
            _ => {}
        }
        self.was_blocked = is_blocked;
        // Before its first cycle a robot shows nothing.
        if seen.cycles > 0 {
            self.agree_on_shape(joystick, seen);
        }
    }

    /// What is set at the robot holds for the joystick. The first device that comes tells the robot what it asks for
    /// itself, as its dead zone, wherever neither the file nor a person said otherwise.
    fn agree_on_shape(&mut self, joystick: &mut Joystick, seen: &Snapshot) {
        let own = joystick.map().map(Map::shape);
        let is_new = own.is_some() && !self.was_plugged;
        match own {
            Some(own) if is_new && !self.was_ever_plugged => {
                self.to_tell = differences(&own, &self.at_start, seen);
                self.was_ever_plugged = true;
            }
            _ if is_new || seen.joystick != self.shape => joystick.reshape(&seen.joystick),
            _ => {}
        }
        (self.shape, self.was_plugged) = (seen.joystick, own.is_some());
    }

    /// What the device asks to be set, by the settings' indices: for [`Live::set`](super::Live::set).
    pub fn changes(&mut self) -> Vec<(u32, f64)> {
        std::mem::take(&mut self.to_tell)
    }

    /// What to ask, in this order. A wish is repeated with every call: its silence is a loss.
    pub fn asks(&mut self, command: &JoystickCommand, seen: &Snapshot) -> Vec<Ask> {
        let mut asks = Vec::new();
        if command.requests.stop {
            asks.push(Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)));
        }
        if command.requests.reset_frame {
            self.fixed_heading_rad = seen.record.state.odom_from_body.heading_rad;
        }
        if command.block != self.told {
            self.told = command.block;
            asks.extend(match command.block {
                Some(Block::Lost) => Some(Ask::Stick(StickWish::Lost)),
                Some(Block::Stopped) => Some(Ask::Stick(StickWish::Withdrawn)),
                None => None,
            });
        }
        if command.requests.enable {
            asks.push(Ask::EnableStick(Client::Joystick));
            // A person at the robot asks for torque; what a fault left is acknowledged first.
            asks.extend(match seen.phase {
                Phase::Fault => Some(Ask::Robot(RequestKind::Acknowledge)),
                Phase::Disabled => Some(Ask::Robot(RequestKind::Enable)),
                Phase::Enabling
                | Phase::Holding
                | Phase::Tracking
                | Phase::Stopping
                | Phase::QuickStopping => None,
            });
        }
        if command.presence == Presence::Present {
            asks.push(Ask::Stick(match (command.block, command.hold) {
                (Some(_), _) => StickWish::Blocked,
                (None, Hold::Held) => self.wish(command),
                (None, Hold::Released) => StickWish::Released,
            }));
        }
        asks
    }

    fn wish(&self, command: &JoystickCommand) -> StickWish {
        let [x, y, turn] = command.twist;
        let twist = Twist2 {
            vx_m_s: x * self.speed_m_s,
            vy_m_s: y * self.speed_m_s,
            w_rad_s: turn * self.turn_speed_rad_s,
        };
        match command.frame {
            JoystickFrame::Platform => StickWish::Held { twist, frame: Frame::Body },
            JoystickFrame::Fixed => {
                let twist = twist.rotated(self.fixed_heading_rad);
                StickWish::Held { twist, frame: Frame::Odom }
            }
        }
    }
}

/// Settings of the robot's that a device asks otherwise for, and nobody changed; they change as a whole.
fn differences(own: &JoystickShape, at_start: &JoystickShape, seen: &Snapshot) -> Vec<(u32, f64)> {
    let robot = &seen.joystick;
    let value = |shape: &JoystickShape, place| shape.setting(place).map(|setting| setting.value);
    let wanted = (0..JoystickShape::SETTINGS).filter_map(|place| {
        let setting = own.setting(place)?;
        let is_free =
            value(robot, place) == value(at_start, place) && value(robot, place) != Some(setting.value);
        let (index, _) = seen.setting(setting.name)?;
        is_free.then_some((index, setting.value))
    });
    wanted.collect()
}
