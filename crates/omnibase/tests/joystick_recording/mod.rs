//! Recordings of a joystick, in place of one.

use omnibase_joystick::{AxisRange, Description, RawEvent, Recorder, State};
use std::path::{Path, PathBuf};

const ABS_Y: u16 = 1;

/// A recording of the thesis's joystick: each change (ms, axis or button, value) with its report.
pub fn recording(folder: &Path, changes: &[(u64, u16, i32)]) -> PathBuf {
    let range = AxisRange { minimum: 0, maximum: 255, flat: 15, fuzz: 0 };
    let device = Description {
        name: "Thrustmaster T.Flight Stick X".into(),
        vendor_id: 0x044F,
        product_id: 0xB106,
        axes: [0, ABS_Y, 5, 6].map(|axis| (axis, range)).into(),
        buttons: (0x120..=0x12B).collect(),
    };
    let state = State { axes: [(0, 128), (ABS_Y, 128), (5, 128), (6, 0)].into(), pressed: [].into() };
    let path = folder.join("joystick.events");
    let file = Box::new(std::fs::File::create(&path).unwrap());
    let mut recorder = Recorder::start(file, &device, &state).unwrap();
    recorder.write(&[RawEvent::report(0)]).unwrap();
    for &(ms, code, value) in changes {
        let (time_us, is_axis) = (ms * 1000, code < 0x100);
        let change = if is_axis { RawEvent::axis } else { RawEvent::button };
        recorder.write(&[change(time_us, code, value), RawEvent::report(time_us)]).unwrap();
    }
    path
}
