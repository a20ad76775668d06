//! How a joystick is shaped, as far as that may change while the robot runs.

use crate::config::{JoystickAxisTable, JoystickTable};
use crate::stages::Gain;

/// The names of an axis's settings, as in a robot's file, and what is allowed.
const NAMES: [[&str; 4]; 3] = [
    [
        "joystick.forward.offset",
        "joystick.forward.dead_zone",
        "joystick.forward.gain",
        "joystick.forward.expo",
    ],
    ["joystick.left.offset", "joystick.left.dead_zone", "joystick.left.gain", "joystick.left.expo"],
    ["joystick.turn.offset", "joystick.turn.dead_zone", "joystick.turn.gain", "joystick.turn.expo"],
];
const BOUNDS: [[f64; 2]; 4] = [[-0.5, 0.5], [0.0, 0.9], [0.0, 1.0], [0.0, 1.0]];
const LEAST_NAME: &str = "joystick.speed.least";
/// Settings of one axis.
const OF_AXIS: usize = 4;

/// How one axis is shaped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisShape {
    /// Where it rests, as a part of its half range.
    pub offset: f64,
    /// Part of its half range that counts as rest.
    pub dead_zone: f64,
    /// Part of the greatest speed at full deflection.
    pub gain: f64,
    /// From straight (0) to cubic (1).
    pub expo: f64,
}

/// How a joystick is shaped: what a robot holds, changes between cycles and records, and the joystick's reader follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoystickShape {
    /// Forward, left and turn.
    pub axes: [AxisShape; 3],
    /// Part of the speed at the slow end of the slider.
    pub least: f64,
}

impl Default for AxisShape {
    fn default() -> Self {
        AxisShape { offset: 0.0, dead_zone: 0.05, gain: 1.0, expo: 0.3 }
    }
}

impl Default for JoystickShape {
    fn default() -> Self {
        JoystickShape { axes: [AxisShape::default(); 3], least: 0.1 }
    }
}

impl JoystickShape {
    /// How many settings there are.
    pub const SETTINGS: usize = 3 * OF_AXIS + 1;

    /// What a table says; where it says nothing, what its ready map says, or the default.
    pub fn of(table: &JoystickTable) -> Self {
        let table = &match table.map {
            Some(ready) => table.over(ready),
            None => table.clone(),
        };
        let default = AxisShape::default();
        let axis = |table: &JoystickAxisTable| AxisShape {
            offset: table.offset.unwrap_or(default.offset),
            dead_zone: table.dead_zone.unwrap_or(default.dead_zone),
            gain: table.gain.unwrap_or(default.gain),
            expo: table.expo.unwrap_or(default.expo),
        };
        JoystickShape {
            axes: [axis(&table.forward), axis(&table.left), axis(&table.turn)],
            least: table.speed.least.unwrap_or(JoystickShape::default().least),
        }
    }

    /// The setting of a place, below [`JoystickShape::SETTINGS`].
    pub fn setting(&self, index: usize) -> Option<Gain> {
        let (axis, place) = (index / OF_AXIS, index % OF_AXIS);
        let Some(shape) = self.axes.get(axis) else {
            let least = Gain { name: LEAST_NAME, value: self.least, least: 0.0, greatest: 1.0 };
            return (index < Self::SETTINGS).then_some(least);
        };
        let AxisShape { offset, dead_zone, gain, expo } = *shape;
        let [least, greatest] = BOUNDS[place];
        Some(Gain {
            name: NAMES[axis][place],
            value: [offset, dead_zone, gain, expo][place],
            least,
            greatest,
        })
    }

    /// Changes the setting of a place.
    pub fn set(&mut self, index: usize, value: f64) {
        let Some(shape) = self.axes.get_mut(index / OF_AXIS) else {
            self.least = value;
            return;
        };
        let AxisShape { offset, dead_zone, gain, expo } = shape;
        *[offset, dead_zone, gain, expo][index % OF_AXIS] = value;
    }
}
