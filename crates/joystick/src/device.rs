//! What a joystick's events come from.

use std::io;
use std::path::Path;

use evdev::raw_stream::RawDevice;
use evdev::{AbsoluteAxisCode, KeyCode, RelativeAxisCode};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::Timespec;

use crate::description::{AxisRange, Description, State};
use crate::event::RawEvent;

/// What a joystick's events come from; nothing of it waits.
pub trait Device: Send {
    /// What it is and has.
    fn description(&self) -> &Description;

    /// Where its axes and buttons are, asked anew.
    ///
    /// # Errors
    /// The device is gone.
    fn state(&mut self) -> io::Result<State>;

    /// Adds the events that came until `now_ns` to `events`, in their order.
    ///
    /// # Errors
    /// The device is gone.
    fn events(&mut self, now_ns: u64, events: &mut Vec<RawEvent>) -> io::Result<()>;
}

/// A device of the kernel, `/dev/input/event…`.
pub struct EvdevDevice {
    raw: RawDevice,
    description: Description,
}

impl EvdevDevice {
    /// Opens a device.
    ///
    /// # Errors
    /// There is no such device, or this user may not read it (group `input`).
    pub fn open(path: &Path) -> io::Result<Self> {
        let raw = RawDevice::open(path)?;
        let id = raw.input_id();
        let axes = raw.get_absinfo()?.map(|(axis, info)| {
            let range = AxisRange {
                minimum: info.minimum(),
                maximum: info.maximum(),
                flat: info.flat(),
                fuzz: info.fuzz(),
            };
            (axis.0, range)
        });
        let description = Description {
            name: raw.name().unwrap_or("without a name").to_owned(),
            vendor_id: id.vendor(),
            product_id: id.product(),
            axes: axes.collect(),
            buttons: raw
                .supported_keys()
                .into_iter()
                .flat_map(|keys| keys.iter())
                .map(KeyCode::code)
                .collect(),
        };
        Ok(EvdevDevice { raw, description })
    }

    /// Whether it tells how far it is moved, in both directions.
    pub fn moves_as_a_mouse(&self) -> bool {
        self.raw.supported_relative_axes().is_some_and(|axes| {
            axes.contains(RelativeAxisCode::REL_X) && axes.contains(RelativeAxisCode::REL_Y)
        })
    }

    /// From now on nobody else hears it: no pointer moves by it.
    ///
    /// # Errors
    /// Somebody else has it.
    pub fn grab(&mut self) -> io::Result<()> {
        self.raw.grab()
    }

    /// Whether the kernel has something to say: events, or that the device is gone.
    fn has_news(&self) -> io::Result<bool> {
        let mut fds = [PollFd::new(&self.raw, PollFlags::IN)];
        let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
        match poll(&mut fds, Some(&at_once)) {
            Err(rustix::io::Errno::INTR) => Ok(false),
            result => Ok(result? > 0),
        }
    }
}

impl Device for EvdevDevice {
    fn description(&self) -> &Description {
        &self.description
    }

    fn state(&mut self) -> io::Result<State> {
        let values = self.raw.get_abs_state()?;
        let value = |code: &u16| {
            let value = values.get(usize::from(AbsoluteAxisCode(*code).0));
            (*code, value.map_or(0, |info| info.value))
        };
        Ok(State {
            axes: self.description.axes.keys().map(value).collect(),
            pressed: self.raw.get_key_state()?.iter().map(KeyCode::code).collect(),
        })
    }

    fn events(&mut self, _: u64, events: &mut Vec<RawEvent>) -> io::Result<()> {
        // A batch holds at most what the kernel's buffer holds; more comes with the next turn.
        if !self.has_news()? {
            return Ok(());
        }
        let before = events.len();
        events.extend(self.raw.fetch_events()?.map(|event| {
            RawEvent {
                time_us: event
                    .timestamp()
                    .duration_since(std::time::UNIX_EPOCH)
                    .map_or(0, |since| u64::try_from(since.as_micros()).unwrap_or(u64::MAX)),
                kind: event.event_type().0,
                code: event.code(),
                value: event.value(),
            }
        }));
        if events.len() == before {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(())
    }
}
