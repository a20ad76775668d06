//! The firmware's access to the chip.

use super::Esc;
use super::sync_manager::Side;
use crate::pdi::{AlEvent, Pdi};
use omnibase_ethercat_wire::HostTime;

/// One chip seen from its firmware at one instant.
#[derive(Debug)]
pub struct PdiPort<'a> {
    esc: &'a mut Esc,
    now: HostTime,
}

impl<'a> PdiPort<'a> {
    /// The PDI of `esc` at `now`.
    pub fn new(esc: &'a mut Esc, now: HostTime) -> Self {
        PdiPort { esc, now }
    }
}

impl Pdi for PdiPort<'_> {
    fn read(&mut self, address: u16, data: &mut [u8]) -> AlEvent {
        self.esc.read_bytes(Side::Pdi, address, data, self.now.0);
        AlEvent(self.esc.al_event())
    }

    fn write(&mut self, address: u16, data: &[u8]) -> AlEvent {
        self.esc.write_bytes(Side::Pdi, address, data, self.now.0);
        AlEvent(self.esc.al_event())
    }
}
