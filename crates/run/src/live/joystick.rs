//! From the stick at the robot's computer to what is asked of the robot.

use omnibase_joystick::{Block, Hold, Presence, Stick, StickCommand, StickFrame};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::config::Limits;
use omnibase_robot::signals::{Frame, Phase, StopCategory};

use super::command::{Ask, Pad};
use super::snapshot::Snapshot;

/// The joystick among the [blocked sticks](crate::channels::Say::blocked_sticks).
const JOYSTICK_BIT: u64 = 1;

/// Scales a stick's wish to a robot's limits, turns its fixed frame, and keeps both sides agreed on whether it is
/// blocked: the [`Operator`](super::Operator) has the last word.
#[derive(Clone, Debug)]
pub struct JoystickDriver {
    speed_m_s: f64,
    turn_speed_rad_s: f64,
    /// The platform's heading when the fixed frame was set; until then odom's own, the heading at the start.
    fixed_heading_rad: f64,
    /// The block that the robot was told of.
    told: Option<Block>,
    /// Whether the operator blocked it when it was looked at last.
    was_blocked: bool,
}

impl JoystickDriver {
    /// A driver within a robot's limits.
    pub fn new(limits: &Limits) -> Self {
        JoystickDriver {
            speed_m_s: limits.speed_m_s,
            turn_speed_rad_s: limits.turn_speed_rad_s,
            fixed_heading_rad: 0.0,
            told: None,
            was_blocked: false,
        }
    }

    /// Tells the stick what became of it at the robot: blocked there, or enabled by somebody elsewhere.
    pub fn agree(&mut self, stick: &mut Stick, seen: &Snapshot) {
        let is_blocked = seen.beside.say.blocked_sticks & JOYSTICK_BIT != 0;
        match (self.was_blocked, is_blocked) {
            (false, true) => stick.block(Block::Lost),
            (true, false) => stick.enable(),
            _ => {}
        }
        self.was_blocked = is_blocked;
    }

    /// What to ask, in this order. A wish is repeated with every call: its silence is a loss.
    pub fn asks(&mut self, command: &StickCommand, seen: &Snapshot) -> Vec<Ask> {
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
                Some(Block::Lost) => Some(Ask::Pad(Pad::Lost)),
                Some(Block::Stopped) => Some(Ask::Pad(Pad::Withdrawn)),
                None => None,
            });
        }
        if command.requests.enable {
            asks.push(Ask::EnablePad);
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
        if command.block.is_none() && command.presence == Presence::Present {
            asks.push(Ask::Pad(match command.hold {
                Hold::Held => self.wish(command),
                Hold::Released => Pad::Released,
            }));
        }
        asks
    }

    fn wish(&self, command: &StickCommand) -> Pad {
        let [x, y, turn] = command.twist;
        let twist = Twist2 {
            vx_m_s: x * self.speed_m_s,
            vy_m_s: y * self.speed_m_s,
            w_rad_s: turn * self.turn_speed_rad_s,
        };
        match command.frame {
            StickFrame::Platform => Pad::Held { twist, frame: Frame::Body },
            StickFrame::Fixed => {
                let twist = twist.rotated(self.fixed_heading_rad);
                Pad::Held { twist, frame: Frame::Odom }
            }
        }
    }
}
