//! One SubDevice: a chip, the firmware behind it, and its supply voltage.

use crate::esc::{Esc, EscConfig, PdiPort};
use crate::pdi::{AlEvent, Application, ApplicationFault};
use omnibase_ethercat_wire::HostTime;

/// Chip and firmware.
pub struct SubDevice {
    esc: Esc,
    application: Box<dyn Application>,
    powered: bool,
    /// When the firmware wants to run by itself.
    wake: Option<HostTime>,
    power_on_at: Option<HostTime>,
    /// The firmware does nothing.
    frozen: bool,
    /// Frames still to be damaged at each port.
    damage: [u32; 4],
}

impl SubDevice {
    /// A SubDevice with this chip and this firmware; it gets power when it becomes part of a segment.
    pub fn new(config: EscConfig, application: Box<dyn Application>) -> Self {
        SubDevice {
            esc: Esc::new(config),
            application,
            powered: false,
            wake: None,
            power_on_at: None,
            frozen: false,
            damage: [0; 4],
        }
    }

    /// The socket at which its firmware is waited for, where that is a program that isn't connected.
    pub fn awaited_at(&self) -> Option<&std::path::Path> {
        self.application.awaited_at()
    }

    /// The same chip with another application behind it.
    pub fn with_application(self, application: Box<dyn Application>) -> Self {
        SubDevice { application, ..self }
    }

    /// Its chip.
    pub fn esc(&self) -> &Esc {
        &self.esc
    }

    pub(crate) fn esc_mut(&mut self) -> &mut Esc {
        &mut self.esc
    }

    /// Whether it has supply voltage.
    pub fn powered(&self) -> bool {
        self.powered
    }

    pub(crate) fn power_on(&mut self, now: HostTime) {
        self.power_on_at = None;
        if self.powered {
            return;
        }
        self.powered = true;
        self.frozen = false;
        self.esc.power_on(now);
        self.application.power_on(&mut PdiPort::new(&mut self.esc, now), now);
        // What the firmware set up may be due at once; it gets the chance.
        self.run(now);
    }

    pub(crate) fn power_off(&mut self) {
        self.powered = false;
        self.application.power_off();
        self.wake = None;
        self.power_on_at = None;
        self.damage = [0; 4];
        // Its ports go dark: nothing may see the state of before.
        self.esc.power_on(HostTime(0));
    }

    pub(crate) fn power_on_at(&mut self, at: HostTime) {
        self.power_on_at = Some(at);
    }

    pub(crate) fn damage(&mut self, port: usize, frames: u32) {
        self.damage[port] = self.damage[port].saturating_add(frames);
    }

    /// Whether any frame is to be damaged here.
    pub(crate) fn damages(&self) -> bool {
        self.damage != [0; 4]
    }

    /// Whether the frame that arrives at `port` is to be damaged; counts it.
    pub(crate) fn take_damage(&mut self, port: usize) -> bool {
        let damaged = self.damage[port] > 0;
        self.damage[port] -= u32::from(damaged);
        damaged
    }

    pub(crate) fn inject(&mut self, fault: &ApplicationFault, now: HostTime) -> bool {
        // Frozen firmware is a matter of who calls it; the firmware itself need not know.
        if let ApplicationFault::Frozen(frozen) = *fault {
            if self.powered && frozen && !self.frozen && self.application.was_there() {
                self.esc.touch_pdi(now.0);
            }
            self.frozen = frozen;
            if self.powered && !frozen {
                self.run(now);
            }
            return true;
        }
        let known = self.application.inject(fault, now);
        if known && self.powered {
            self.run(now);
        }
        known
    }

    /// When something happens here by itself, host ns; `u64::MAX` for never.
    pub(crate) fn due(&self) -> u64 {
        if !self.powered {
            return self.power_on_at.map_or(u64::MAX, |at| at.0);
        }
        let wake = self.wake.filter(|_| !self.frozen).map_or(u64::MAX, |at| at.0);
        wake.min(self.esc.next_event())
    }

    /// Lets happen what is due at `now`.
    pub(crate) fn run_due(&mut self, now: HostTime) {
        if !self.powered {
            if self.power_on_at.is_some_and(|at| at <= now) {
                self.power_on(now);
            }
            return;
        }
        if self.esc.next_event() <= now.0 {
            if self.esc.misses_pdi(now.0) && !self.frozen && self.application.was_there() {
                self.esc.touch_pdi(now.0);
            }
            self.esc.run_events(now.0);
        }
        if self.wake.is_some_and(|at| at <= now) {
            self.run(now);
        }
    }

    /// Runs the firmware where the chip has something for it.
    pub(crate) fn run_raised(&mut self, now: HostTime) {
        if self.powered && self.esc.take_raised() {
            self.run(now);
        }
    }

    fn run(&mut self, now: HostTime) {
        if self.frozen {
            return;
        }
        self.esc.take_raised();
        let event = AlEvent(self.esc.al_event());
        let wake = self.application.run(&mut PdiPort::new(&mut self.esc, now), event, now);
        if self.application.was_there() {
            self.esc.touch_pdi(now.0);
        }
        // An application that wants to run at once must not hold time still.
        self.wake = wake.map(|at| at.max(HostTime(now.0 + 1)));
    }
}

impl core::fmt::Debug for SubDevice {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SubDevice").field("powered", &self.powered).finish_non_exhaustive()
    }
}
