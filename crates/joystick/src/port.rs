//! A device that may come and go, joined with its joystick.

use crate::description::{Description, State};
use crate::device::Device;
use crate::event::RawEvent;
use crate::find::Finder;
use crate::joystick::{Joystick, JoystickCommand, Next};

/// Between two looks for a device, ns.
pub const SEARCH_NS: u64 = 1_000_000_000;

/// What happened in a turn.
#[derive(Clone, Debug, PartialEq)]
pub enum Happened {
    /// A device came, in this state.
    Plugged(Description, State),
    /// These events came. Where the kernel lost some, the state that was read instead stands at their end.
    Events(Vec<RawEvent>),
    /// The device is gone.
    Unplugged,
}

/// A joystick and what it reads. Its owner gives it a turn many times within the joystick's age.
pub struct Port<F> {
    finder: F,
    device: Option<Box<dyn Device>>,
    joystick: Joystick,
    search_ns: u64,
}

impl<F: Finder> Port<F> {
    /// A port at which nothing is yet.
    pub fn new(finder: F, joystick: Joystick) -> Self {
        Port { finder, device: None, joystick, search_ns: 0 }
    }

    /// The joystick.
    pub fn joystick(&self) -> &Joystick {
        &self.joystick
    }

    /// The joystick, to enable or block it.
    pub fn joystick_mut(&mut self) -> &mut Joystick {
        &mut self.joystick
    }

    /// Reads what came until now, or looks for a device once a second; then the wish.
    pub fn turn(&mut self, now_ns: u64) -> (JoystickCommand, Option<Happened>) {
        let happened = match &mut self.device {
            None if now_ns >= self.search_ns => {
                self.search_ns = now_ns.saturating_add(SEARCH_NS);
                self.search(now_ns)
            }
            None => None,
            Some(device) => match read(device.as_mut(), &mut self.joystick, now_ns) {
                Ok(events) => (!events.is_empty()).then_some(Happened::Events(events)),
                Err(_) => {
                    self.device = None;
                    self.joystick.unplug();
                    Some(Happened::Unplugged)
                }
            },
        };
        (self.joystick.command(now_ns), happened)
    }

    fn search(&mut self, now_ns: u64) -> Option<Happened> {
        let (mut device, map) = self.finder.find()?;
        let state = device.state().ok()?;
        let description = device.description().clone();
        self.joystick.plug(now_ns, map, state.clone());
        self.device = Some(device);
        Some(Happened::Plugged(description, state))
    }
}

/// What a device says goes to its joystick. Lost events are made up for when all that was at hand is taken: the state
/// is newer than those.
fn read(device: &mut dyn Device, joystick: &mut Joystick, now_ns: u64) -> std::io::Result<Vec<RawEvent>> {
    let mut events = Vec::new();
    device.events(now_ns, &mut events)?;
    joystick.heard(now_ns);
    let mut must_reread = false;
    for event in &events {
        must_reread |= joystick.take(*event) == Next::Reread;
    }
    if must_reread {
        let state = device.state()?;
        let time_us = events.last().map_or(0, |event| event.time_us);
        events.extend(state.as_events(time_us, device.description()));
        joystick.reread(state);
    }
    Ok(events)
}
