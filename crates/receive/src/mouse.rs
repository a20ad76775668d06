//! From the events of an optical mouse to the way that it went over the floor.

use std::io;
use std::path::PathBuf;

use omnibase_joystick::event::{EV_REL, EV_SYN, REL_X, REL_Y, RawEvent, SYN_DROPPED};
use omnibase_joystick::{Device, EvdevDevice};
use omnibase_robot::signals::Heard;

/// Between two readings, ns: what a count is of a shorter way is no speed any more.
pub const PERIOD_NS: u64 = 8_000_000;
/// After events were lost, or the mouse came back, nothing is said for so long, ns: nobody takes a speed across that
/// (a flow sensor's readings that lie a tenth of a second apart tell nothing of a moment).
pub const PAUSE_NS: u64 = 120_000_000;
/// Between two looks for a mouse that is gone, ns.
const SEARCH_NS: u64 = 1_000_000_000;

/// Where a mouse comes from.
pub trait MouseFinder: Send {
    /// The mouse, with nobody else hearing it.
    ///
    /// # Errors
    /// There is none, it is somebody else's, or it is no mouse.
    fn find(&mut self) -> io::Result<Box<dyn Device>>;
}

/// A mouse by its path.
#[derive(Clone, Debug)]
pub struct MouseAt(pub PathBuf);

impl MouseFinder for MouseAt {
    fn find(&mut self) -> io::Result<Box<dyn Device>> {
        let mut device = EvdevDevice::open(&self.0)?;
        if !device.moves_as_a_mouse() {
            let words = format!("{} has no REL_X and REL_Y: it is no mouse", self.0.display());
            return Err(io::Error::new(io::ErrorKind::InvalidInput, words));
        }
        device.grab()?;
        Ok(Box::new(device))
    }
}

/// What happened in a turn.
#[derive(Debug)]
pub enum Happened {
    /// Nothing that is to be said.
    Nothing,
    /// It is there.
    Plugged(String),
    /// It is gone.
    Unplugged,
    /// It can't be taken.
    Refused(io::Error),
}

/// A mouse that may come and go.
pub struct Mouse<F> {
    finder: F,
    device: Option<Box<dyn Device>>,
    counts: [i64; 2],
    search_ns: u64,
    due_ns: u64,
    events: Vec<RawEvent>,
}

impl<F: MouseFinder> Mouse<F> {
    /// One that isn't there yet.
    pub fn new(finder: F) -> Self {
        Mouse { finder, device: None, counts: [0; 2], search_ns: 0, due_ns: 0, events: Vec::new() }
    }

    /// Takes what came until now; its way since it was switched on, in counts, where a reading is due.
    pub fn turn(&mut self, now_ns: u64) -> (Option<Heard>, Happened) {
        let Some(device) = &mut self.device else { return (None, self.search(now_ns)) };
        self.events.clear();
        if device.events(now_ns, &mut self.events).is_err() {
            self.device = None;
            return (None, Happened::Unplugged);
        }
        for event in &self.events {
            match (event.kind, event.code) {
                (EV_REL, REL_X) => self.counts[0] += i64::from(event.value),
                // It counts towards whoever holds it; its axes are x to the right and y forward, as axes turn.
                (EV_REL, REL_Y) => self.counts[1] -= i64::from(event.value),
                (EV_SYN, SYN_DROPPED) => self.due_ns = now_ns.saturating_add(PAUSE_NS),
                _ => {}
            }
        }
        if now_ns < self.due_ns {
            return (None, Happened::Nothing);
        }
        self.due_ns = self.due_ns.max(now_ns.saturating_sub(PERIOD_NS)).saturating_add(PERIOD_NS);
        let mut heard = Heard { instant_ns: now_ns, ..Heard::NOTHING };
        for (value, counts) in heard.values.iter_mut().zip(self.counts) {
            *value = counts as f64;
        }
        (Some(heard), Happened::Nothing)
    }

    fn search(&mut self, now_ns: u64) -> Happened {
        if now_ns < self.search_ns {
            return Happened::Nothing;
        }
        self.search_ns = now_ns.saturating_add(SEARCH_NS);
        match self.finder.find() {
            Ok(device) => {
                let name = device.description().name.clone();
                (self.device, self.due_ns) = (Some(device), now_ns.saturating_add(PAUSE_NS));
                Happened::Plugged(name)
            }
            Err(error) => Happened::Refused(error),
        }
    }
}
