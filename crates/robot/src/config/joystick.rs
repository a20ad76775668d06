//! A joystick that drives by hand, as the robot's file names it: axes, a slider and buttons by their evdev names.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The joystick at the robot's computer; what is missing comes from the ready map of the device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct JoystickTable {
    /// The map to begin with; default: the one that belongs to the device's vendor and product.
    pub map: Option<ReadyMapName>,
    /// The device, as `"/dev/input/event5"`; default: the first one that the map fits.
    pub device: Option<String>,
    /// Whether the robot moves only while a button is held; default: `required`.
    pub dead_man: Option<DeadManRule>,
    /// The frame at the start; default: `platform`.
    pub frame: Option<JoystickFrameName>,
    /// Age at which values that weren't confirmed by the reading thread count as lost, ms; default: 200.
    #[schemars(range(min = 20, max = 2_000))]
    pub age_ms: Option<u32>,
    /// The axis that drives forward.
    pub forward: JoystickAxisTable,
    /// The axis that drives to the left.
    pub left: JoystickAxisTable,
    /// The axis that turns counterclockwise.
    pub turn: JoystickAxisTable,
    /// The slider that scales all speeds.
    pub speed: JoystickSliderTable,
    /// Which button does what.
    pub buttons: JoystickButtonsTable,
}

/// A map of a known device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReadyMapName {
    /// Thrustmaster T-Flight Stick X.
    TFlightStickX,
    /// Xbox gamepads as the kernel's `xpad` shows them.
    Xbox,
    /// PlayStation gamepads: DualShock 4 and DualSense.
    Playstation,
    /// None: this table names all axes and buttons itself.
    None,
}

/// Whether a button must be held while the joystick drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DeadManRule {
    /// The robot moves only while the dead-man button is held.
    Required,
    /// The robot moves as soon as an axis leaves its dead zone: for machines that nobody can be near to.
    NotRequired,
}

/// The frame in which a joystick drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JoystickFrameName {
    /// Forward is the platform's own forward.
    Platform,
    /// Forward is where the platform's forward was when the frame was set last.
    Fixed,
}

/// Which way an axis counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisDirection {
    /// As the device counts.
    Normal,
    /// Against it.
    Reversed,
}

/// One axis and its shape.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct JoystickAxisTable {
    /// The axis by its evdev name, as `"ABS_Y"`.
    pub axis: Option<AxisCode>,
    /// Which way it counts; default: the ready map's, else `normal`.
    pub direction: Option<AxisDirection>,
    /// Where it rests, as a part of its half range; default: 0.
    #[schemars(range(min = -0.5, max = 0.5))]
    pub offset: Option<f64>,
    /// Part of its half range that counts as rest; default: 0.05 or what the device asks for, if that is more.
    #[schemars(range(min = 0.0, max = 0.9))]
    pub dead_zone: Option<f64>,
    /// Part of the platform's greatest speed at full deflection; default: 1.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 1.0))]
    pub gain: Option<f64>,
    /// From straight (0) to cubic (1): fine control near rest; default: 0.3.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub expo: Option<f64>,
}

/// The slider that scales all speeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct JoystickSliderTable {
    /// The axis by its evdev name, as `"ABS_THROTTLE"`.
    pub axis: Option<AxisCode>,
    /// Which way it counts; default: the ready map's, else `normal`: its greatest value is the full speed.
    pub direction: Option<AxisDirection>,
    /// Part of the speed that is left at its slow end; default: the ready map's, else 0.1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub least: Option<f64>,
}

/// Which button does what.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct JoystickButtonsTable {
    /// Held while the joystick drives.
    pub dead_man: Option<ButtonCode>,
    /// Stops the robot and gives the command back; the joystick is blocked until it is enabled.
    pub stop: Option<ButtonCode>,
    /// Enables a blocked joystick, and the drives if they are off.
    pub enable: Option<ButtonCode>,
    /// Drive in the platform's frame.
    pub platform_frame: Option<ButtonCode>,
    /// Drive in the fixed frame.
    pub fixed_frame: Option<ButtonCode>,
    /// Change from one frame to the other.
    pub toggle_frame: Option<ButtonCode>,
    /// The fixed frame becomes the platform's present one.
    pub reset_frame: Option<ButtonCode>,
    /// Remember the pose where the robot stands, while somebody teaches single points.
    pub teach_point: Option<ButtonCode>,
}

impl JoystickButtonsTable {
    /// The buttons with the names of their keys.
    pub fn named(&self) -> [(&'static str, Option<ButtonCode>); 8] {
        [
            ("dead_man", self.dead_man),
            ("stop", self.stop),
            ("enable", self.enable),
            ("platform_frame", self.platform_frame),
            ("fixed_frame", self.fixed_frame),
            ("toggle_frame", self.toggle_frame),
            ("reset_frame", self.reset_frame),
            ("teach_point", self.teach_point),
        ]
    }
}

impl JoystickTable {
    /// The axes, the slider's too, with the names of their tables.
    pub fn named_axes(&self) -> [(&'static str, Option<AxisCode>); 4] {
        [
            ("forward", self.forward.axis),
            ("left", self.left.axis),
            ("turn", self.turn.axis),
            ("speed", self.speed.axis),
        ]
    }
}

/// An absolute axis of evdev (`ABS_…` of linux/input-event-codes.h).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AxisCode(pub u16);

/// A button of evdev (`BTN_…` of linux/input-event-codes.h).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ButtonCode(pub u16);

/// Axes by name.
const AXES: [(&str, u16); 19] = [
    ("ABS_X", 0x00),
    ("ABS_Y", 0x01),
    ("ABS_Z", 0x02),
    ("ABS_RX", 0x03),
    ("ABS_RY", 0x04),
    ("ABS_RZ", 0x05),
    ("ABS_THROTTLE", 0x06),
    ("ABS_RUDDER", 0x07),
    ("ABS_WHEEL", 0x08),
    ("ABS_GAS", 0x09),
    ("ABS_BRAKE", 0x0A),
    ("ABS_HAT0X", 0x10),
    ("ABS_HAT0Y", 0x11),
    ("ABS_HAT1X", 0x12),
    ("ABS_HAT1Y", 0x13),
    ("ABS_HAT2X", 0x14),
    ("ABS_HAT2Y", 0x15),
    ("ABS_HAT3X", 0x16),
    ("ABS_HAT3Y", 0x17),
];

/// Buttons by name; where a code has two names, the one by which it is shown comes first.
const BUTTONS: [(&str, u16); 54] = [
    ("BTN_TRIGGER", 0x120),
    ("BTN_THUMB", 0x121),
    ("BTN_THUMB2", 0x122),
    ("BTN_TOP", 0x123),
    ("BTN_TOP2", 0x124),
    ("BTN_PINKIE", 0x125),
    ("BTN_BASE", 0x126),
    ("BTN_BASE2", 0x127),
    ("BTN_BASE3", 0x128),
    ("BTN_BASE4", 0x129),
    ("BTN_BASE5", 0x12A),
    ("BTN_BASE6", 0x12B),
    ("BTN_DEAD", 0x12F),
    ("BTN_SOUTH", 0x130),
    ("BTN_EAST", 0x131),
    ("BTN_C", 0x132),
    ("BTN_NORTH", 0x133),
    ("BTN_WEST", 0x134),
    ("BTN_Z", 0x135),
    ("BTN_TL", 0x136),
    ("BTN_TR", 0x137),
    ("BTN_TL2", 0x138),
    ("BTN_TR2", 0x139),
    ("BTN_SELECT", 0x13A),
    ("BTN_START", 0x13B),
    ("BTN_MODE", 0x13C),
    ("BTN_THUMBL", 0x13D),
    ("BTN_THUMBR", 0x13E),
    ("BTN_DPAD_UP", 0x220),
    ("BTN_DPAD_DOWN", 0x221),
    ("BTN_DPAD_LEFT", 0x222),
    ("BTN_DPAD_RIGHT", 0x223),
    ("BTN_A", 0x130),
    ("BTN_B", 0x131),
    ("BTN_X", 0x133),
    ("BTN_Y", 0x134),
    ("BTN_0", 0x100),
    ("BTN_1", 0x101),
    ("BTN_2", 0x102),
    ("BTN_3", 0x103),
    ("BTN_4", 0x104),
    ("BTN_5", 0x105),
    ("BTN_6", 0x106),
    ("BTN_7", 0x107),
    ("BTN_8", 0x108),
    ("BTN_9", 0x109),
    ("BTN_TRIGGER_HAPPY1", 0x2C0),
    ("BTN_TRIGGER_HAPPY2", 0x2C1),
    ("BTN_TRIGGER_HAPPY3", 0x2C2),
    ("BTN_TRIGGER_HAPPY4", 0x2C3),
    ("BTN_TRIGGER_HAPPY5", 0x2C4),
    ("BTN_TRIGGER_HAPPY6", 0x2C5),
    ("BTN_TRIGGER_HAPPY7", 0x2C6),
    ("BTN_TRIGGER_HAPPY8", 0x2C7),
];

fn name_of(table: &[(&'static str, u16)], code: u16) -> Cow<'static, str> {
    let known = table.iter().find(|(_, known)| *known == code);
    known.map_or_else(|| Cow::Owned(format!("{code:#x}")), |(name, _)| Cow::Borrowed(*name))
}

fn code_of<E: serde::de::Error>(table: &[(&str, u16)], name: &str) -> Result<u16, E> {
    let known = table.iter().find(|(known, _)| *known == name);
    known.map(|(_, code)| *code).ok_or_else(|| E::custom(format_args!("evdev knows no `{name}`")))
}

fn names(table: &[(&'static str, u16)], description: &str) -> Schema {
    let names: Vec<&str> = table.iter().map(|(name, _)| *name).collect();
    json_schema!({ "description": description, "type": "string", "enum": names })
}

impl AxisCode {
    /// Its evdev name, or its number where it has none here.
    pub fn name(self) -> Cow<'static, str> {
        name_of(&AXES, self.0)
    }
}

impl ButtonCode {
    /// Its evdev name, or its number where it has none here.
    pub fn name(self) -> Cow<'static, str> {
        name_of(&BUTTONS, self.0)
    }
}

impl Serialize for AxisCode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name())
    }
}

impl Serialize for ButtonCode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name())
    }
}

impl<'de> Deserialize<'de> for AxisCode {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        code_of(&AXES, &Cow::<str>::deserialize(deserializer)?).map(AxisCode)
    }
}

impl<'de> Deserialize<'de> for ButtonCode {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        code_of(&BUTTONS, &Cow::<str>::deserialize(deserializer)?).map(ButtonCode)
    }
}

impl JsonSchema for AxisCode {
    fn schema_name() -> Cow<'static, str> {
        "AxisCode".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        names(&AXES, "An axis of evdev.")
    }
}

impl JsonSchema for ButtonCode {
    fn schema_name() -> Cow<'static, str> {
        "ButtonCode".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        names(&BUTTONS, "A button of evdev.")
    }
}
