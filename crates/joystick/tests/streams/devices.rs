//! Devices as the kernel shows them, and streams of their events as bytes.

use std::sync::{Arc, Mutex};

use omnibase_joystick::event::{EV_SYN, EVENT_BYTES, SYN_DROPPED};
use omnibase_joystick::{
    AxisRange, Description, Device, Finder, Joystick, Map, Port, RawEvent, Recorded, Recorder, State,
};
use omnibase_robot::config::JoystickTable;

pub const MS: u64 = 1_000_000;
/// The joystick's age in these tests, ns.
pub const AGE_NS: u64 = 200 * MS;

pub const ABS_X: u16 = 0;
pub const ABS_Y: u16 = 1;
pub const ABS_RX: u16 = 3;
pub const ABS_RZ: u16 = 5;
pub const ABS_THROTTLE: u16 = 6;
pub const BTN_TRIGGER: u16 = 0x120;
pub const BTN_THUMB: u16 = 0x121;
pub const BTN_THUMB2: u16 = 0x122;
pub const BTN_TOP: u16 = 0x123;
pub const BTN_TOP2: u16 = 0x124;
pub const BTN_BASE6: u16 = 0x12B;
pub const BTN_EAST: u16 = 0x131;
pub const BTN_TL: u16 = 0x136;

fn device(
    name: &str,
    [vendor_id, product_id]: [u16; 2],
    axes: &[(u16, i32, i32, i32)],
    buttons: &[u16],
) -> Description {
    let range = |&(code, minimum, maximum, flat)| (code, AxisRange { minimum, maximum, flat, fuzz: 0 });
    Description {
        name: name.into(),
        vendor_id,
        product_id,
        axes: axes.iter().map(range).collect(),
        buttons: buttons.iter().copied().collect(),
    }
}

/// The joystick of the thesis: 8 bits an axis, a hat, twelve buttons.
pub fn t_flight() -> Description {
    let axes = [
        (ABS_X, 0, 255, 15),
        (ABS_Y, 0, 255, 15),
        (ABS_RZ, 0, 255, 15),
        (ABS_THROTTLE, 0, 255, 15),
        (0x10, -1, 1, 0),
        (0x11, -1, 1, 0),
    ];
    device("Thrustmaster T.Flight Stick X", [0x044F, 0xB106], &axes, &(0x120..=0x12B).collect::<Vec<_>>())
}

const GAMEPAD_BUTTONS: [u16; 11] =
    [0x130, 0x131, 0x133, 0x134, BTN_TL, 0x137, 0x13A, 0x13B, 0x13C, 0x13D, 0x13E];

/// An Xbox One S gamepad as `xpad` shows it.
pub fn xbox() -> Description {
    let joystick = |code| (code, -32_768, 32_767, 128);
    let axes = [
        joystick(ABS_X),
        joystick(ABS_Y),
        (2, 0, 1023, 0),
        joystick(ABS_RX),
        joystick(4),
        (ABS_RZ, 0, 1023, 0),
        (0x10, -1, 1, 0),
        (0x11, -1, 1, 0),
    ];
    device("Microsoft X-Box One S pad", [0x045E, 0x02EA], &axes, &GAMEPAD_BUTTONS)
}

/// A DualSense as `hid-playstation` shows it.
pub fn dual_sense() -> Description {
    let axis = |code| (code, 0, 255, 0);
    let axes = [axis(0), axis(1), axis(2), axis(3), axis(4), axis(5), (0x10, -1, 1, 0), (0x11, -1, 1, 0)];
    let buttons: Vec<u16> = GAMEPAD_BUTTONS.into_iter().chain([0x138, 0x139]).collect();
    device("Sony Interactive Entertainment DualSense", [0x054C, 0x0CE6], &axes, &buttons)
}

/// The same gamepad's second device, with the same ids: no buttons.
pub fn motion_sensors() -> Description {
    let axis = |code| (code, -32_768, 32_768, 0);
    let axes: Vec<_> = (0..6).map(axis).collect();
    device("Sony Interactive Entertainment DualSense Motion Sensors", [0x054C, 0x0CE6], &axes, &[])
}

/// All axes in the middle, nothing pressed.
pub fn at_rest(device: &Description) -> State {
    let middle = |(code, range): (&u16, &AxisRange)| (*code, range.minimum.midpoint(range.maximum));
    State { axes: device.axes.iter().map(middle).collect(), pressed: [].into() }
}

/// Builds a stream.
#[derive(Clone, Default)]
pub struct Stream {
    now_us: u64,
    pub bytes: Vec<u8>,
}

impl Stream {
    pub fn event(mut self, event: RawEvent) -> Self {
        self.bytes.extend(RawEvent { time_us: 1_700_000_000_000_000 + self.now_us, ..event }.to_bytes());
        self
    }

    pub fn axis(self, code: u16, value: i32) -> Self {
        self.event(RawEvent::axis(0, code, value))
    }

    pub fn press(self, code: u16) -> Self {
        self.event(RawEvent::button(0, code, 1))
    }

    pub fn release(self, code: u16) -> Self {
        self.event(RawEvent::button(0, code, 0))
    }

    pub fn report(self) -> Self {
        self.event(RawEvent::report(0))
    }

    pub fn dropped(self) -> Self {
        self.event(RawEvent { time_us: 0, kind: EV_SYN, code: SYN_DROPPED, value: 0 })
    }

    pub fn wait_ms(mut self, ms: u64) -> Self {
        self.now_us += ms * 1000;
        self
    }

    /// The stream as a recording of a device at rest.
    pub fn recorded(&self, device: &Description) -> Recorded {
        let file = Shared::default();
        let mut recorder =
            Recorder::start(Box::new(file.clone()), device, &at_rest(device)).expect("a vector takes all");
        let events = omnibase_joystick::event::events_in(&self.bytes).0;
        recorder.write(&events).expect("a vector takes all");
        let bytes = file.0.lock().unwrap().clone();
        assert!(bytes.ends_with(&self.bytes) && self.bytes.len().is_multiple_of(EVENT_BYTES));
        Recorded::from_bytes(&bytes).expect("a recording")
    }
}

/// A file in memory.
#[derive(Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<u8>>>);

impl std::io::Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Gives recordings one after the other, as a device that is plugged in again and again.
pub struct Plugs(pub JoystickTable, pub Vec<Recorded>);

impl Finder for Plugs {
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)> {
        let device = (!self.1.is_empty()).then(|| self.1.remove(0))?;
        let map = Map::of(&self.0, device.description()).expect("the map fits");
        Some((Box::new(device), map))
    }
}

/// A port at which a stream is plugged in, with the file's table.
pub fn port(table: &JoystickTable, device: &Description, stream: &Stream) -> Port<Plugs> {
    Port::new(Plugs(table.clone(), vec![stream.recorded(device)]), Joystick::new(AGE_NS))
}
