//! Virtual time at the pace of the host's.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat_sim::VirtualClock;

/// So far behind the host it starts afresh in place of running after it.
const MOST_BEHIND: Duration = Duration::from_millis(100);

/// Virtual time that doesn't run ahead of the host's: a simulated robot at which people look and which they drive.
#[derive(Clone, Debug)]
pub struct PacedClock {
    clock: VirtualClock,
    is_paced: Arc<AtomicBool>,
    /// The same moment on both clocks; from the first sleep on.
    anchor: Option<(HostTime, Instant)>,
}

/// By which a clock is paced, or let go.
#[derive(Clone, Debug)]
pub struct Pace(Arc<AtomicBool>);

impl Pace {
    /// From now on the clock doesn't run ahead of the host's.
    pub fn keep(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl PacedClock {
    /// Virtual time, paced from now on.
    pub fn new(clock: VirtualClock) -> Self {
        PacedClock { clock, is_paced: Arc::new(AtomicBool::new(true)), anchor: None }
    }

    /// Virtual time that waits for nobody until it is told to keep pace.
    pub fn free(clock: VirtualClock) -> (Self, Pace) {
        let is_paced = Arc::new(AtomicBool::new(false));
        (PacedClock { clock, is_paced: is_paced.clone(), anchor: None }, Pace(is_paced))
    }
}

impl Clock for PacedClock {
    fn now(&self) -> HostTime {
        self.clock.now()
    }

    fn sleep_until(&mut self, instant: HostTime) {
        if self.is_paced.load(Ordering::Relaxed) {
            let (virtual_then, host_then) =
                *self.anchor.get_or_insert_with(|| (self.clock.now(), Instant::now()));
            let due = host_then + (instant - virtual_then);
            let now = Instant::now();
            if now < due {
                std::thread::sleep(due - now);
            } else if now - due > MOST_BEHIND {
                self.anchor = Some((instant, now));
            }
        }
        self.clock.sleep_until(instant);
    }
}
