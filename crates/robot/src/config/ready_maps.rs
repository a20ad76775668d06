//! The maps of known joysticks: what does what on them, and which axes and buttons they can have.
//!
//! Axes and buttons are those that the kernel's drivers give: `hid-generic` for the T-Flight Stick X, `xpad` for
//! Xbox gamepads on a cable or their own receiver, `hid-playstation` and `hid-sony` for PlayStation gamepads. An Xbox gamepad by
//! Bluetooth has other axes, so it isn't listed.

use super::joystick::{
    AxisCode, AxisDirection, ButtonCode, JoystickAxisTable, JoystickButtonsTable, JoystickSliderTable,
    JoystickTable, ReadyMapName,
};

const ABS_X: AxisCode = AxisCode(0);
const ABS_Y: AxisCode = AxisCode(1);
const ABS_RX: AxisCode = AxisCode(3);
const ABS_RZ: AxisCode = AxisCode(5);
const ABS_THROTTLE: AxisCode = AxisCode(6);
const BTN_TRIGGER: ButtonCode = ButtonCode(0x120);
const BTN_THUMB: ButtonCode = ButtonCode(0x121);
const BTN_THUMB2: ButtonCode = ButtonCode(0x122);
const BTN_TOP: ButtonCode = ButtonCode(0x123);
const BTN_TOP2: ButtonCode = ButtonCode(0x124);
const BTN_BASE6: ButtonCode = ButtonCode(0x12B);
const BTN_SOUTH: ButtonCode = ButtonCode(0x130);
const BTN_EAST: ButtonCode = ButtonCode(0x131);
const BTN_NORTH: ButtonCode = ButtonCode(0x133);
const BTN_WEST: ButtonCode = ButtonCode(0x134);
const BTN_PINKIE: ButtonCode = ButtonCode(0x125);
const BTN_TL: ButtonCode = ButtonCode(0x136);
const BTN_TR: ButtonCode = ButtonCode(0x137);
const BTN_START: ButtonCode = ButtonCode(0x13B);

impl ReadyMapName {
    /// The maps of known devices.
    pub const KNOWN: [ReadyMapName; 3] =
        [ReadyMapName::TFlightStickX, ReadyMapName::Xbox, ReadyMapName::Playstation];

    /// Its name in a robot's file.
    pub fn name(self) -> &'static str {
        match self {
            ReadyMapName::TFlightStickX => "t_flight_stick_x",
            ReadyMapName::Xbox => "xbox",
            ReadyMapName::Playstation => "playstation",
            ReadyMapName::None => "none",
        }
    }

    /// The map, as the table that a robot's file would hold.
    ///
    /// On all of them forward and left are the device's own forward and left, which evdev counts down.
    pub fn table(self) -> JoystickTable {
        match self {
            ReadyMapName::TFlightStickX => JoystickTable {
                forward: reversed(ABS_Y),
                left: reversed(ABS_X),
                turn: reversed(ABS_RZ),
                // Its throttle counts down towards the front, where it is fast.
                speed: slider(ABS_THROTTLE, AxisDirection::Reversed, 0.1),
                buttons: JoystickButtonsTable {
                    dead_man: Some(BTN_TRIGGER),
                    stop: Some(BTN_THUMB),
                    enable: Some(BTN_BASE6),
                    platform_frame: Some(BTN_THUMB2),
                    fixed_frame: Some(BTN_TOP),
                    toggle_frame: None,
                    reset_frame: Some(BTN_TOP2),
                    teach_point: Some(BTN_PINKIE),
                },
                ..Default::default()
            },
            // Left stick and right stick; the right trigger gives the full speed.
            ReadyMapName::Xbox => gamepad(BTN_WEST, BTN_NORTH),
            ReadyMapName::Playstation => gamepad(BTN_NORTH, BTN_WEST),
            ReadyMapName::None => JoystickTable::default(),
        }
    }

    /// Whether any device that its driver serves can have this axis.
    pub fn can_have_axis(self, AxisCode(code): AxisCode) -> bool {
        let is_hat = (0x10..=0x17).contains(&code);
        match self {
            // What `hid-input` gives to a joystick.
            ReadyMapName::TFlightStickX => code <= 0x08 || is_hat,
            // Two sticks, two triggers, the cross.
            ReadyMapName::Xbox | ReadyMapName::Playstation => code <= 0x05 || is_hat,
            ReadyMapName::None => true,
        }
    }

    /// Whether any device that its driver serves can have this button.
    pub fn can_have_button(self, ButtonCode(code): ButtonCode) -> bool {
        // BTN_TRIGGER_HAPPY: buttons beyond the sixteenth of a joystick, paddles of a pad.
        let is_extra = (0x2C0..=0x2C7).contains(&code);
        match self {
            ReadyMapName::TFlightStickX => (0x120..=0x12F).contains(&code) || is_extra,
            ReadyMapName::Xbox | ReadyMapName::Playstation => {
                (0x130..=0x13E).contains(&code) || (0x220..=0x223).contains(&code) || is_extra
            }
            ReadyMapName::None => true,
        }
    }
}

impl JoystickTable {
    /// These settings before those of a ready map.
    pub fn over(&self, ready: ReadyMapName) -> JoystickTable {
        let ready = ready.table();
        let axis = |own: &JoystickAxisTable, ready: &JoystickAxisTable| JoystickAxisTable {
            axis: own.axis.or(ready.axis),
            // Another axis of one's own choice counts as the file says, not as the ready map's did.
            direction: own.direction.or(ready.direction.filter(|_| own.axis.is_none())),
            offset: own.offset.or(ready.offset),
            dead_zone: own.dead_zone.or(ready.dead_zone),
            gain: own.gain.or(ready.gain),
            expo: own.expo.or(ready.expo),
        };
        let buttons = &self.buttons;
        JoystickTable {
            forward: axis(&self.forward, &ready.forward),
            left: axis(&self.left, &ready.left),
            turn: axis(&self.turn, &ready.turn),
            speed: JoystickSliderTable {
                axis: self.speed.axis.or(ready.speed.axis),
                direction: self
                    .speed
                    .direction
                    .or(ready.speed.direction.filter(|_| self.speed.axis.is_none())),
                least: self.speed.least.or(ready.speed.least),
            },
            buttons: JoystickButtonsTable {
                dead_man: buttons.dead_man.or(ready.buttons.dead_man),
                stop: buttons.stop.or(ready.buttons.stop),
                enable: buttons.enable.or(ready.buttons.enable),
                platform_frame: buttons.platform_frame.or(ready.buttons.platform_frame),
                fixed_frame: buttons.fixed_frame.or(ready.buttons.fixed_frame),
                toggle_frame: buttons.toggle_frame.or(ready.buttons.toggle_frame),
                reset_frame: buttons.reset_frame.or(ready.buttons.reset_frame),
                teach_point: buttons.teach_point.or(ready.buttons.teach_point),
            },
            ..self.clone()
        }
    }
}

/// Both families differ in the names of their upper and their left button alone: `xpad` calls the left one, X,
/// `BTN_NORTH`, and the upper one, Y, `BTN_WEST`.
fn gamepad(upper: ButtonCode, left: ButtonCode) -> JoystickTable {
    JoystickTable {
        forward: reversed(ABS_Y),
        left: reversed(ABS_X),
        turn: reversed(ABS_RX),
        speed: slider(ABS_RZ, AxisDirection::Normal, 0.4),
        buttons: JoystickButtonsTable {
            dead_man: Some(BTN_TL),
            stop: Some(BTN_EAST),
            enable: Some(BTN_START),
            platform_frame: Some(BTN_SOUTH),
            fixed_frame: Some(upper),
            toggle_frame: None,
            reset_frame: Some(left),
            teach_point: Some(BTN_TR),
        },
        ..Default::default()
    }
}

fn slider(axis: AxisCode, direction: AxisDirection, least: f64) -> JoystickSliderTable {
    JoystickSliderTable { axis: Some(axis), direction: Some(direction), least: Some(least) }
}

fn reversed(axis: AxisCode) -> JoystickAxisTable {
    JoystickAxisTable { axis: Some(axis), direction: Some(AxisDirection::Reversed), ..Default::default() }
}
