//! What a device is and has, and where its axes and buttons are.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::event::{EV_ABS, EV_KEY, RawEvent};

/// What an axis can say (`struct input_absinfo`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisRange {
    /// Least value.
    pub minimum: i32,
    /// Greatest value.
    pub maximum: i32,
    /// Values about the centre that count as rest.
    pub flat: i32,
    /// Noise that the kernel takes away.
    pub fuzz: i32,
}

/// A device as the kernel describes it; axes and buttons by their evdev codes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// Its name.
    pub name: String,
    /// USB vendor.
    pub vendor_id: u16,
    /// USB product.
    pub product_id: u16,
    /// Its absolute axes.
    pub axes: BTreeMap<u16, AxisRange>,
    /// Its buttons.
    pub buttons: BTreeSet<u16>,
}

/// Where axes and buttons are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct State {
    /// Raw values of the axes.
    pub axes: BTreeMap<u16, i32>,
    /// Buttons that are pressed.
    pub pressed: BTreeSet<u16>,
}

impl State {
    /// Takes an event in, as far as the device has such an axis or button.
    pub fn take(&mut self, event: RawEvent, device: &Description) {
        match event.kind {
            EV_ABS if device.axes.contains_key(&event.code) => {
                self.axes.insert(event.code, event.value);
            }
            EV_KEY if device.buttons.contains(&event.code) && event.value != 0 => {
                self.pressed.insert(event.code);
            }
            EV_KEY => {
                self.pressed.remove(&event.code);
            }
            _ => {}
        }
    }

    /// The events, at one moment, that lead to this state; the end of the report is the last one.
    pub fn as_events(&self, time_us: u64, device: &Description) -> Vec<RawEvent> {
        let axes = self.axes.iter().map(|(code, value)| RawEvent::axis(time_us, *code, *value));
        let buttons = device
            .buttons
            .iter()
            .map(|code| RawEvent::button(time_us, *code, i32::from(self.pressed.contains(code))));
        axes.chain(buttons).chain([RawEvent::report(time_us)]).collect()
    }
}
