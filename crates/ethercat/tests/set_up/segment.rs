//! Small simulated SubDevices for the tests of the set-up.

use std::time::Duration;

use omnibase_ethercat::wire::bytes::{put_u16, put_u32};
use omnibase_ethercat::wire::sii::{Identity, checksum};
use omnibase_ethercat::wire::{AlState, HostTime, register};
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::pdi::{AlEvent, Application, ApplicationFault, Pdi};
use omnibase_ethercat_sim::{EscConfig, Segment, SubDevice};

/// Firmware that enters every state it is asked for, and has no mailbox.
pub struct Obedient;

impl Application for Obedient {
    fn power_on(&mut self, pdi: &mut dyn Pdi, _now: HostTime) {
        pdi.write(register::AL_STATUS, &AlState::Init.bits().to_le_bytes());
    }

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, _now: HostTime) -> Option<HostTime> {
        if event.0 & register::al_event::AL_CONTROL != 0 {
            let mut control = [0; 2];
            pdi.read(register::AL_CONTROL, &mut control);
            pdi.write(register::AL_STATUS, &[control[0] & 0x0F, 0]);
        }
        None
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

/// The same, but it looks for requests only so often.
pub struct Seldom {
    pub every: Duration,
    pub next: HostTime,
}

impl Application for Seldom {
    fn power_on(&mut self, pdi: &mut dyn Pdi, now: HostTime) {
        self.next = now + self.every;
        Obedient.power_on(pdi, now);
    }

    fn run(&mut self, pdi: &mut dyn Pdi, event: AlEvent, now: HostTime) -> Option<HostTime> {
        if now >= self.next {
            self.next = now + self.every;
            Obedient.run(pdi, event, now);
        }
        Some(self.next)
    }

    fn inject(&mut self, _fault: &ApplicationFault, _now: HostTime) -> bool {
        false
    }
}

/// A SubDevice of this chip with obedient firmware; without an image of its own its EEPROM is that of nobody in particular.
pub fn obedient(mut config: EscConfig) -> SubDevice {
    if config.sii.is_empty() {
        config.sii = sii_of(Identity::default(), 0);
    }
    SubDevice::new(config, Box::new(Obedient))
}

/// The same, whose EEPROM holds these bytes; none where it is dead.
pub fn with_eeprom(sii: Vec<u8>) -> SubDevice {
    SubDevice::new(EscConfig { sii, ..EscConfig::default() }, Box::new(Obedient))
}

/// A recorded SII image; `None` (and a loud note) where the recordings aren't there.
pub fn recorded_sii(name: &str) -> Option<Vec<u8>> {
    let path = format!("{}/../../../shared/captures/{name}", env!("CARGO_MANIFEST_DIR"));
    match std::fs::read(&path) {
        Ok(bytes) => Some(bytes),
        Err(error) => {
            eprintln!("SKIPPED: {path}: {error}");
            None
        }
    }
}

/// A small SII image: this identity and alias, no mailbox, no category.
pub fn sii_of(identity: Identity, alias: u16) -> Vec<u8> {
    let mut sii = vec![0; 256];
    put_u16(&mut sii, 8, alias);
    for (offset, value) in [
        (16, identity.vendor_id),
        (20, identity.product_code),
        (24, identity.revision),
        (28, identity.serial),
    ] {
        put_u32(&mut sii, offset, value);
    }
    let first_words: &[u8; 14] = sii[..14].try_into().unwrap();
    sii[14] = checksum(first_words);
    sii[0x7C] = 1;
    sii[128..].fill(0xFF);
    sii
}

/// The image with mailboxes of 128 bytes at 0x1000 and 0x1080, for CoE.
pub fn with_mailbox(mut sii: Vec<u8>) -> Vec<u8> {
    for (word, value) in [(0x18, 0x1000), (0x19, 128), (0x1A, 0x1080), (0x1B, 128), (0x1C, 4)] {
        put_u16(&mut sii, 2 * word, value);
    }
    sii
}

/// A line of drives with aliases from 1 on, whose clocks differ and drift.
pub fn drives(kind: DriveKind, count: u16) -> Segment {
    let drive = Drive::new(kind);
    let piece = |n: u16| Piece {
        alias: n + 1,
        dc_offset_ns: u64::from(n) * 77_000_001,
        dc_drift_ppm: f64::from(n % 5) * 25.0 - 50.0,
        ..Piece::default()
    };
    Segment::line((0..count).map(|n| drive.build(&piece(n), Load::default())).collect()).unwrap()
}
