//! Homing: the drive's own way to a limit switch and back from it (CiA 402-2, methods 17 and 18), or none (35, 37).

use super::shown::{FOLLOWING_ERROR, FOLLOWS, TARGET_REACHED};
use super::{HALT, Motion, Reference};
use crate::device::servo::objects::Fields;
use crate::dictionary::Dictionary;

/// Controlword bit 4: start homing, at its rising edge.
const START: u16 = 1 << 4;
/// Slower than this the home is reached, rad/s at the motor.
const STANDING_RAD_S: f64 = 0.1;

/// How far homing is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Homing {
    step: Step,
    /// A home was found since power-on.
    is_attained: bool,
    was_asked: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Step {
    /// Not begun, interrupted, or over.
    #[default]
    Idle,
    /// Towards a switch: -1 the negative one, 1 the positive one.
    ToSwitch(f64),
    /// Back from it, until it is left.
    FromSwitch(f64),
    /// The home was passed; it comes to a stand.
    Slowing,
    Failed,
}

impl Homing {
    pub fn interrupt(&mut self) {
        (self.step, self.was_asked) = (Step::Idle, false);
    }

    /// Bits 10, 12 and 13.
    pub fn status(&self) -> u16 {
        match self.step {
            Step::Idle if self.is_attained => FOLLOWS | TARGET_REACHED,
            Step::Idle => TARGET_REACHED,
            Step::ToSwitch(_) | Step::FromSwitch(_) => 0,
            Step::Slowing => FOLLOWS,
            Step::Failed => FOLLOWING_ERROR | TARGET_REACHED,
        }
    }
}

impl Motion {
    pub(super) fn command_homing(&mut self, dictionary: &Dictionary, fields: &Fields, control: u16) {
        let asked = control & START != 0 && control & HALT == 0;
        let begins = asked && !core::mem::replace(&mut self.homing.was_asked, asked);
        if !asked && self.homing.step != Step::Failed {
            self.homing.step = Step::Idle;
        }
        if begins {
            self.homing.is_attained = false;
            self.homing.step = match dictionary.get(fields.homing_method) {
                17 => Step::ToSwitch(-1.0),
                18 => Step::ToSwitch(1.0),
                35 | 37 => {
                    self.take_for_home(dictionary.get(fields.home_offset));
                    Step::Slowing
                }
                _ => Step::Failed,
            };
        }
        let [to_switch, to_zero] = fields.homing_speeds.map(|field| f64::from(dictionary.get(field)));
        let switches = self.state.switches;
        let at = |way: f64| if way < 0.0 { switches.negative } else { switches.positive };
        self.homing.step = match self.homing.step {
            Step::ToSwitch(way) if at(-way) => Step::Failed,
            Step::ToSwitch(way) if at(way) => Step::FromSwitch(way),
            Step::FromSwitch(way) if !at(way) => {
                self.take_for_home(dictionary.get(fields.home_offset));
                Step::Slowing
            }
            Step::Slowing if self.state.speed_rad_s.abs() < STANDING_RAD_S => {
                self.homing.is_attained = true;
                Step::Idle
            }
            other => other,
        };
        let to = match self.homing.step {
            Step::ToSwitch(way) => way * to_switch,
            Step::FromSwitch(way) => -way * to_zero,
            Step::Idle | Step::Slowing | Step::Failed => 0.0,
        };
        self.reference = Reference::Speed { to, rate: f64::from(dictionary.get(fields.homing_acceleration)) };
    }

    /// Where it is now 0x6064 shows the home offset.
    fn take_for_home(&mut self, home_offset: i32) {
        self.offset = i64::from(home_offset) - self.encoder(self.state);
        self.position_demand = self.counts();
    }
}
