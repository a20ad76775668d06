//! Faults on request.

use crate::pdi::ApplicationFault;
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Something that goes wrong with one SubDevice, its cables or its firmware.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Supply voltage off: its links go down and its registers forget everything.
    PowerOff,
    /// Supply voltage on: it starts as from the factory, with what its SII holds.
    PowerOn,
    /// Off now, and on again after a while.
    PowerCycle {
        /// How long it stays off.
        off_for: Duration,
    },
    /// The cable at this port is cut: both ends lose their link.
    CableCut {
        /// Port 0 to 3.
        port: u8,
    },
    /// The cable at this port carries a link and no frames: behind it is a switch, or a device that isn't ready, as after a wrong
    /// order of power. Chips close their loops there.
    LinkAlone {
        /// Port 0 to 3.
        port: u8,
    },
    /// The cable at this port is whole again.
    CableRestored {
        /// Port 0 to 3.
        port: u8,
    },
    /// The next frames that arrive at this port are damaged: they are counted and destroyed.
    CrcErrors {
        /// Port 0 to 3.
        port: u8,
        /// Number of frames.
        frames: u32,
    },
    /// The firmware misbehaves.
    Application(ApplicationFault),
}

impl From<ApplicationFault> for Fault {
    fn from(fault: ApplicationFault) -> Self {
        Fault::Application(fault)
    }
}

/// A hand on a segment that is behind a link: faults that happen when the segment moves on next. Clones share it.
#[derive(Clone, Debug)]
pub struct Injector(Arc<Mutex<VecDeque<(usize, Fault)>>>);

/// Faults for which there is room from the start.
const INJECTOR_ROOM: usize = 64;

impl Injector {
    pub(crate) fn new() -> Self {
        Injector(Arc::new(Mutex::new(VecDeque::with_capacity(INJECTOR_ROOM))))
    }

    /// A fault for the SubDevice at `position`; one that it doesn't know, or of no SubDevice, changes nothing.
    pub fn inject(&self, position: usize, fault: Fault) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push_back((position, fault));
    }

    pub(crate) fn take(&self) -> Option<(usize, Fault)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }
}

/// Why a fault could not be injected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultError {
    /// No such SubDevice.
    #[error("no SubDevice at position {position}, the segment has {count}")]
    NoSuchSubDevice {
        /// Position asked for.
        position: usize,
        /// SubDevices there.
        count: usize,
    },
    /// No cable is plugged into that port.
    #[error("no cable at port {port} of the SubDevice at position {position}")]
    NoCable {
        /// Position of the SubDevice.
        position: usize,
        /// Its port.
        port: u8,
    },
    /// The firmware does not know this fault.
    #[error("the firmware of the SubDevice at position {position} does not know {fault:?}")]
    UnknownToApplication {
        /// Position of the SubDevice.
        position: usize,
        /// The fault.
        fault: ApplicationFault,
    },
}
