//! Which axis and button of a device does what.

use std::fmt;

use omnibase_robot::config::{
    AxisCode, AxisDirection, ButtonCode, DeadManRule, JoystickAxisTable, JoystickFrameName, JoystickTable,
    ReadyMapName,
};
use omnibase_robot::{AxisShape, JoystickShape};

use crate::description::{AxisRange, Description, State};
use crate::joystick::JoystickFrame;
use crate::ready::map_for;
use crate::shaping::{Shaping, normalise};

/// The widest dead zone that a device's own `flat` is granted.
const WIDEST_DEAD_ZONE: f64 = 0.9;

/// One axis that drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMap {
    /// The axis.
    pub axis: AxisCode,
    /// What it can say.
    pub range: AxisRange,
    /// How it is shaped.
    pub shaping: Shaping,
}

/// The slider that scales all speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliderMap {
    /// The axis.
    pub axis: AxisCode,
    /// What it can say.
    pub range: AxisRange,
    /// 1, or −1 where its least value is the full speed.
    pub sign: f64,
    /// Part of the speed at its slow end.
    pub least: f64,
}

/// What a device's axes and buttons do.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The ready map that it began with.
    pub ready: ReadyMapName,
    /// The device.
    pub device: Description,
    /// Forward, left and turn.
    pub axes: [Option<AxisMap>; 3],
    /// The slider.
    pub slider: Option<SliderMap>,
    /// Held while the joystick drives; `None` where none is required.
    pub dead_man: Option<ButtonCode>,
    /// Stops the robot and gives the command back.
    pub stop: Option<ButtonCode>,
    /// Enables a blocked joystick.
    pub enable: ButtonCode,
    /// Drive in the platform's frame.
    pub platform_frame: Option<ButtonCode>,
    /// Drive in the fixed frame.
    pub fixed_frame: Option<ButtonCode>,
    /// Change from one frame to the other.
    pub toggle_frame: Option<ButtonCode>,
    /// The fixed frame becomes the platform's present one.
    pub reset_frame: Option<ButtonCode>,
    /// Remember the pose where the robot stands.
    pub teach_point: Option<ButtonCode>,
    /// The frame at the start.
    pub frame: JoystickFrame,
}

/// Why a map doesn't fit a device.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JoystickMapError {
    /// Nobody knows the device.
    #[error(
        "no ready map belongs to {name} ({vendor_id:04x}:{product_id:04x}): choose one by `map` in [joystick], or \
         `map = \"none\"` and name its axes and buttons"
    )]
    Unknown {
        /// Its name.
        name: String,
        /// Its vendor.
        vendor_id: u16,
        /// Its product.
        product_id: u16,
    },
    /// The device has no such axis.
    #[error("joystick.{what}.axis = {axis}: the device has no such axis (it has {has})")]
    NoAxis {
        /// `forward`, `left`, `turn` or `speed`.
        what: &'static str,
        /// The axis.
        axis: String,
        /// What there is.
        has: String,
    },
    /// The device has no such button.
    #[error("joystick.buttons.{what} = {button}: the device has no such button (it has {has})")]
    NoButton {
        /// The button's task.
        what: &'static str,
        /// The button.
        button: String,
        /// What there is.
        has: String,
    },
    /// One axis or button has two tasks.
    #[error("{name} would be both {first} and {second}: give one of them another one")]
    Twice {
        /// The axis or button.
        name: String,
        /// One task.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A task that nobody has.
    #[error("joystick.{what}: must be given")]
    Missing {
        /// The setting.
        what: &'static str,
    },
    /// A value that no map can have.
    #[error("joystick.{what}: {value} is not within {least} to {greatest}")]
    OutOfRange {
        /// The setting.
        what: String,
        /// Its value.
        value: String,
        /// Least.
        least: f64,
        /// Greatest.
        greatest: f64,
    },
}

impl Map {
    /// The map of a device: the one that the file names, else the device's own, with the file's changes.
    pub fn of(table: &JoystickTable, device: &Description) -> Result<Map, Vec<JoystickMapError>> {
        let Some(ready) = table.map.or_else(|| map_for(device.vendor_id, device.product_id)) else {
            let Description { name, vendor_id, product_id, .. } = device.clone();
            return Err(vec![JoystickMapError::Unknown { name, vendor_id, product_id }]);
        };
        let merged = table.over(ready);
        let mut problems = Vec::new();
        fits(&merged, device, &mut problems);
        let ranges = [("forward", &merged.forward), ("left", &merged.left), ("turn", &merged.turn)];
        let axes = ranges.map(|(what, table)| axis(what, table, device, &mut problems));
        let slider = merged.speed.axis.and_then(|axis| {
            let range = *device.axes.get(&axis.0)?;
            let least = merged.speed.least.unwrap_or(JoystickShape::default().least);
            within("speed.least", least, [0.0, 1.0], &mut problems);
            Some(SliderMap { axis, range, sign: sign(merged.speed.direction), least })
        });
        let dead_man = match merged.dead_man {
            Some(DeadManRule::NotRequired) => None,
            Some(DeadManRule::Required) | None => {
                let missing = JoystickMapError::Missing { what: "buttons.dead_man" };
                problems.extend(merged.buttons.dead_man.is_none().then_some(missing));
                merged.buttons.dead_man
            }
        };
        let Some(enable) = merged.buttons.enable else {
            problems.push(JoystickMapError::Missing { what: "buttons.enable" });
            return Err(problems);
        };
        if axes.iter().all(Option::is_none) && problems.is_empty() {
            problems.push(JoystickMapError::Missing { what: "forward.axis" });
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        let buttons = merged.buttons;
        Ok(Map {
            ready,
            device: device.clone(),
            axes,
            slider,
            dead_man,
            stop: buttons.stop,
            enable,
            platform_frame: buttons.platform_frame,
            fixed_frame: buttons.fixed_frame,
            toggle_frame: buttons.toggle_frame,
            reset_frame: buttons.reset_frame,
            teach_point: buttons.teach_point,
            frame: match merged.frame {
                Some(JoystickFrameName::Fixed) => JoystickFrame::Fixed,
                Some(JoystickFrameName::Platform) | None => JoystickFrame::Platform,
            },
        })
    }

    /// The wish at a state: parts of the greatest speeds forward, to the left and about the vertical axis, −1..1,
    /// the first two together at most 1 long.
    pub fn twist(&self, state: &State) -> [f64; 3] {
        let factor = self.speed_factor(state);
        let [x, y, turn] = self.axes.map(|axis| {
            let raw = axis.and_then(|axis| Some((axis, *state.axes.get(&axis.axis.0)?)));
            raw.map_or(0.0, |(axis, raw)| axis.shaping.shape(raw, axis.range)) * factor
        });
        let length = x.hypot(y).max(1.0);
        [x / length, y / length, turn]
    }

    /// Whether no axis is out of its dead zone.
    pub fn is_at_rest(&self, state: &State) -> bool {
        let is_out = |axis: &AxisMap| {
            let raw = state.axes.get(&axis.axis.0);
            raw.is_some_and(|raw| axis.shaping.shape(*raw, axis.range) != 0.0)
        };
        !self.axes.iter().flatten().any(is_out)
    }

    /// How it is shaped; an axis that isn't mapped has the default.
    pub fn shape(&self) -> JoystickShape {
        let default = JoystickShape::default();
        JoystickShape {
            axes: self.axes.map(|axis| axis.map_or(AxisShape::default(), |axis| axis.shaping.shape)),
            least: self.slider.map_or(default.least, |slider| slider.least),
        }
    }

    /// Shapes it anew, as a whole.
    pub fn reshape(&mut self, shape: &JoystickShape) {
        for (axis, shape) in self.axes.iter_mut().zip(shape.axes) {
            if let Some(axis) = axis {
                axis.shaping.shape = shape;
            }
        }
        if let Some(slider) = &mut self.slider {
            slider.least = shape.least;
        }
    }

    /// What the slider leaves of the speed: 1 without one, its slow end where its value isn't known.
    pub fn speed_factor(&self, state: &State) -> f64 {
        let Some(slider) = self.slider else { return 1.0 };
        let raw = state.axes.get(&slider.axis.0);
        let part = raw.map_or(0.0, |raw| (1.0 + slider.sign * normalise(*raw, slider.range)) / 2.0);
        slider.least + (1.0 - slider.least) * part
    }
}

/// Whether the device has all that is named, each for one task.
fn fits(table: &JoystickTable, device: &Description, problems: &mut Vec<JoystickMapError>) {
    let list = |names: Vec<String>| if names.is_empty() { "none".into() } else { names.join(", ") };
    let mut axes: Vec<(AxisCode, &'static str)> = Vec::new();
    for (what, axis) in table.named_axes() {
        let Some(axis) = axis else { continue };
        let name = axis.name().into_owned();
        if !device.axes.contains_key(&axis.0) {
            let has = list(device.axes.keys().map(|code| AxisCode(*code).name().into_owned()).collect());
            problems.push(JoystickMapError::NoAxis { what, axis: name, has });
        } else if let Some((_, first)) = axes.iter().find(|(other, _)| *other == axis) {
            problems.push(JoystickMapError::Twice { name, first, second: what });
        }
        axes.push((axis, what));
    }
    let mut buttons: Vec<(ButtonCode, &'static str)> = Vec::new();
    for (what, button) in table.buttons.named() {
        // Where no dead-man button is required, the ready map's is free.
        let is_free = what == "dead_man" && table.dead_man == Some(DeadManRule::NotRequired);
        let Some(button) = button.filter(|_| !is_free) else { continue };
        let name = button.name().into_owned();
        if !device.buttons.contains(&button.0) {
            let has = list(device.buttons.iter().map(|code| ButtonCode(*code).name().into_owned()).collect());
            problems.push(JoystickMapError::NoButton { what, button: name, has });
        } else if let Some((_, first)) = buttons.iter().find(|(other, _)| *other == button) {
            problems.push(JoystickMapError::Twice { name, first, second: what });
        }
        buttons.push((button, what));
    }
}

fn axis(
    what: &'static str,
    table: &JoystickAxisTable,
    device: &Description,
    problems: &mut Vec<JoystickMapError>,
) -> Option<AxisMap> {
    let axis = table.axis?;
    let range = *device.axes.get(&axis.0)?;
    let default = AxisShape::default();
    let shape = AxisShape {
        offset: table.offset.unwrap_or(default.offset),
        // What the device itself calls flat, where that is more.
        dead_zone: table
            .dead_zone
            .unwrap_or_else(|| flat_part(range).clamp(default.dead_zone, WIDEST_DEAD_ZONE)),
        gain: table.gain.unwrap_or(default.gain),
        expo: table.expo.unwrap_or(default.expo),
    };
    let bounds = [
        ("offset", shape.offset, [-0.5, 0.5]),
        ("dead_zone", shape.dead_zone, [0.0, WIDEST_DEAD_ZONE]),
        ("gain", shape.gain, [0.0, 1.0]),
        ("expo", shape.expo, [0.0, 1.0]),
    ];
    for (key, value, bounds) in bounds {
        within(format_args!("{what}.{key}"), value, bounds, problems);
    }
    Some(AxisMap { axis, range, shaping: Shaping { sign: sign(table.direction), shape } })
}

/// Tables that are made in code haven't been through the file's own checks.
fn within(
    what: impl fmt::Display,
    value: f64,
    [least, greatest]: [f64; 2],
    problems: &mut Vec<JoystickMapError>,
) {
    if !(least..=greatest).contains(&value) {
        let (what, value) = (what.to_string(), value.to_string());
        problems.push(JoystickMapError::OutOfRange { what, value, least, greatest });
    }
}

/// What the device calls flat, as a part of its half range.
fn flat_part(range: AxisRange) -> f64 {
    let half = (f64::from(range.maximum) - f64::from(range.minimum)) / 2.0;
    if half > 0.0 { f64::from(range.flat.max(0)) / half } else { 0.0 }
}

fn sign(direction: Option<AxisDirection>) -> f64 {
    match direction {
        Some(AxisDirection::Reversed) => -1.0,
        Some(AxisDirection::Normal) | None => 1.0,
    }
}
