//! The maps of known sticks and pads, by USB vendor and product.
//!
//! Axes and buttons are those that the kernel's drivers give: `hid-generic` for the T-Flight Stick X, `xpad` for
//! Xbox pads on a cable or their own receiver, `hid-playstation` and `hid-sony` for PlayStation pads. An Xbox pad by
//! Bluetooth has other axes, so it isn't listed.

use omnibase_robot::config::{
    AxisCode, AxisDirection, ButtonCode, JoystickTable, ReadyMapName, StickAxisTable, StickButtonsTable,
    StickSliderTable,
};

/// Vendor, product and map.
const KNOWN: [(u16, u16, ReadyMapName); 16] = [
    // Thrustmaster
    (0x044F, 0xB106, ReadyMapName::TFlightStickX),
    // Microsoft, as xpad knows them: 360 (wired, v2, receivers), One, One S, Elite, Series
    (0x045E, 0x028E, ReadyMapName::Xbox),
    (0x045E, 0x028F, ReadyMapName::Xbox),
    (0x045E, 0x0291, ReadyMapName::Xbox),
    (0x045E, 0x0719, ReadyMapName::Xbox),
    (0x045E, 0x02D1, ReadyMapName::Xbox),
    (0x045E, 0x02DD, ReadyMapName::Xbox),
    (0x045E, 0x02E3, ReadyMapName::Xbox),
    (0x045E, 0x02EA, ReadyMapName::Xbox),
    (0x045E, 0x0B00, ReadyMapName::Xbox),
    (0x045E, 0x0B12, ReadyMapName::Xbox),
    // Sony: DualShock 4 (two makes, and its receiver), DualSense, DualSense Edge
    (0x054C, 0x05C4, ReadyMapName::Playstation),
    (0x054C, 0x09CC, ReadyMapName::Playstation),
    (0x054C, 0x0BA0, ReadyMapName::Playstation),
    (0x054C, 0x0CE6, ReadyMapName::Playstation),
    (0x054C, 0x0DF2, ReadyMapName::Playstation),
];

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
const BTN_TL: ButtonCode = ButtonCode(0x136);
const BTN_START: ButtonCode = ButtonCode(0x13B);

/// The map that belongs to a vendor and product.
pub fn map_for(vendor_id: u16, product_id: u16) -> Option<ReadyMapName> {
    KNOWN.iter().find(|known| (known.0, known.1) == (vendor_id, product_id)).map(|known| known.2)
}

/// A ready map, as the table that a robot's file would hold.
///
/// On all of them forward and left are the stick's own forward and left, which evdev counts down.
pub fn ready_map(name: ReadyMapName) -> JoystickTable {
    match name {
        ReadyMapName::TFlightStickX => JoystickTable {
            forward: reversed(ABS_Y),
            left: reversed(ABS_X),
            turn: reversed(ABS_RZ),
            // Its throttle counts down towards the front, where it is fast.
            speed: slider(ABS_THROTTLE, AxisDirection::Reversed, 0.1),
            buttons: StickButtonsTable {
                dead_man: Some(BTN_TRIGGER),
                stop: Some(BTN_THUMB),
                enable: Some(BTN_BASE6),
                platform_frame: Some(BTN_THUMB2),
                fixed_frame: Some(BTN_TOP),
                toggle_frame: None,
                reset_frame: Some(BTN_TOP2),
            },
            ..Default::default()
        },
        // Left stick and right stick; the right trigger gives the full speed.
        ReadyMapName::Xbox => pad(BTN_WEST, BTN_NORTH),
        ReadyMapName::Playstation => pad(BTN_NORTH, BTN_WEST),
        ReadyMapName::None => JoystickTable::default(),
    }
}

/// Both families differ in the names of their upper and their left button alone: `xpad` calls the left one, X,
/// `BTN_NORTH`, and the upper one, Y, `BTN_WEST`.
fn pad(upper: ButtonCode, left: ButtonCode) -> JoystickTable {
    JoystickTable {
        forward: reversed(ABS_Y),
        left: reversed(ABS_X),
        turn: reversed(ABS_RX),
        speed: slider(ABS_RZ, AxisDirection::Normal, 0.4),
        buttons: StickButtonsTable {
            dead_man: Some(BTN_TL),
            stop: Some(BTN_EAST),
            enable: Some(BTN_START),
            platform_frame: Some(BTN_SOUTH),
            fixed_frame: Some(upper),
            toggle_frame: None,
            reset_frame: Some(left),
        },
        ..Default::default()
    }
}

fn slider(axis: AxisCode, direction: AxisDirection, least: f64) -> StickSliderTable {
    StickSliderTable { axis: Some(axis), direction: Some(direction), least: Some(least) }
}

fn reversed(axis: AxisCode) -> StickAxisTable {
    StickAxisTable { axis: Some(axis), direction: Some(AxisDirection::Reversed), ..Default::default() }
}
