//! The usual trouble with a segment: damaged frames by port, links that come and go, loops, chips without their EEPROM,
//! mailbox protocols that nobody here speaks; each with what to do.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use crate::bus::Bus;
use crate::error::SetUpError;
use crate::found::AccessError;
use crate::subdevice::{PortKind, SubDevice};
use crate::transaction::{Access, Expect};
use crate::wire::{Clock, Link, register, sii};

/// Frames that pass before counters are read: at one damaged bit in 10^9 none is hit, at a bad plug some are.
const FRAMES: u32 = 200;
/// Bytes of each of them: long ones meet more.
const BYTES: usize = 256;
/// Bytes from 0x0300 to the lost-link counters' end.
pub const COUNTERS: usize = 0x14;

/// When something was counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counted {
    /// Since the scan began.
    Now,
    /// Before it: since the SubDevice was powered, or a MainDevice took the segment and cleared its counters.
    Before,
}

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Counted::Now => "since the scan began",
            Counted::Before => "before this scan (since it was powered, or the last program began)",
        })
    }
}

/// Something that is wrong with a segment, or will be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Frames arrive damaged at a port: here first, so the fault is between it and its neighbour.
    Damaged {
        /// The SubDevice.
        position: u16,
        /// Its port.
        port: u8,
        /// Frames with a wrong checksum.
        frames: u8,
        /// Signs that were no code at all.
        signs: u8,
        /// Who is at the other end.
        neighbour: String,
        /// When.
        counted: Counted,
    },
    /// A link was lost.
    LostLink {
        /// The SubDevice.
        position: u16,
        /// Its port.
        port: u8,
        /// How often.
        times: u8,
        /// When.
        counted: Counted,
    },
    /// A cable is plugged in, and no frames pass there.
    Closed {
        /// The SubDevice.
        position: u16,
        /// Its port.
        port: u8,
    },
    /// Frames that were sent through the segment weren't answered in time.
    LostFrames {
        /// Frames that didn't come back.
        lost: u64,
        /// Of so many.
        of: u32,
    },
    /// It answered when it was found, and doesn't answer now.
    Silent {
        /// The SubDevice.
        position: u16,
        /// What it was asked, and what came of that.
        cause: AccessError,
    },
    /// The chip didn't load its EEPROM: its application gets no process data.
    NotLoaded {
        /// The SubDevice.
        position: u16,
        /// What stands there by now is right: it was written since then, or its supply came up too slowly.
        is_right: bool,
    },
    /// A mailbox protocol of the SubDevice that isn't spoken here.
    NotSpoken {
        /// The SubDevice.
        position: u16,
        /// The protocol.
        protocol: &'static str,
        /// What to do.
        remedy: &'static str,
        /// It speaks CoE, too.
        speaks_coe: bool,
    },
}

impl Trouble {
    /// Whether nothing that is done here lacks for it: it may stay as it is.
    pub fn is_remark(&self) -> bool {
        matches!(self, Trouble::NotSpoken { speaks_coe: true, .. })
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::Damaged { position, port, frames, signs, neighbour, counted } => write!(
                f,
                "SubDevice {position}: {frames} damaged frames ({signs} invalid signs) arrived first at its port {port}, from \
                 {neighbour}, {counted}: that cable, its plugs, its shield or the port there; change the cable first"
            ),
            Trouble::LostLink { position, port, times, counted } => write!(
                f,
                "SubDevice {position}: its port {port} lost the link {times} times {counted}: a loose plug, or a \
                 neighbour whose supply comes and goes"
            ),
            Trouble::Closed { position, port } => write!(
                f,
                "SubDevice {position}: a cable with a link is in its port {port}, but no frames pass there: it leads to the segment's \
                 own beginning (a loop at IN), to a switch, or to a device that isn't ready; pull it, or power that device up \
                 before this one"
            ),
            Trouble::LostFrames { lost, of } => write!(
                f,
                "{lost} of {of} frames didn't come back: a loose plug, a switch or other traffic on the way, or a network card that \
                 saves energy (`omnibase doctor` looks at that)"
            ),
            Trouble::Silent { cause, .. } => write!(
                f,
                "{cause}: it was found, and now it doesn't answer: look at its supply and its cables"
            ),
            Trouble::NotLoaded { position, is_right: true } => write!(
                f,
                "SubDevice {position}: its EEPROM is right and its chip didn't load it (it was written since then, or its supply came \
                 up too slowly): power it off and on, before or together with its neighbours"
            ),
            Trouble::NotLoaded { position, is_right: false } => write!(
                f,
                "SubDevice {position}: its chip has no valid EEPROM content (checksum): write its EEPROM (`omnibase eeprom write`), \
                 then power it off and on"
            ),
            Trouble::NotSpoken { position, protocol, remedy, .. } => {
                write!(f, "SubDevice {position}: speaks {protocol}, which isn't supported: {remedy}")
            }
        }
    }
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Sends some frames through the segment as [`Bus::scan`] found it, and looks at every SubDevice's counters and ports.
    pub fn look_for_trouble(&mut self) -> Result<Vec<Trouble>, SetUpError> {
        let before = self.transactor.counters.frames_lost;
        for _ in 0..FRAMES {
            let read =
                Access::broadcast_read("looking for damage", register::PROCESS_DATA, BYTES, Expect::Any);
            match self.transactor.perform_one(read) {
                Ok(_) | Err(SetUpError::Access(_)) => {}
                Err(other) => return Err(other),
            }
        }
        let mut trouble = Vec::new();
        let lost = self.transactor.counters.frames_lost - before;
        if lost > 0 {
            trouble.push(Trouble::LostFrames { lost, of: FRAMES });
        }
        for number in 0..self.subdevices.len() {
            let one = &self.subdevices[number];
            let target = one.target();
            let mut reads = [
                Access::read("reading the error counters", target, register::RX_ERROR_COUNTERS, COUNTERS),
                Access::read("reading DL status", target, register::DL_STATUS, 2),
            ];
            match self.transactor.perform(&mut reads) {
                Ok(()) => {}
                // Others may answer, and tell where it broke.
                Err(SetUpError::Access(cause)) => {
                    trouble.push(Trouble::Silent { position: one.position, cause });
                    continue;
                }
                Err(other) => return Err(other),
            }
            let [counters, status] = reads;
            let before = self.counters_before.get(number).map_or(&[][..], Vec::as_slice);
            trouble.extend(of_counters(&self.subdevices, number, before, Counted::Before));
            trouble.extend(of_counters(&self.subdevices, number, &counters.data, Counted::Now));
            trouble.extend(self.of_one(number, status.data.first().copied().unwrap_or(1)));
        }
        Ok(trouble)
    }

    fn of_one(&self, number: usize, status: u8) -> Vec<Trouble> {
        let one = &self.subdevices[number];
        let position = one.position;
        let mut trouble = Vec::new();
        for port in 0..4u8 {
            let seen = &one.ports[usize::from(port)];
            if seen.link && !seen.communicates && seen.kind != PortKind::None {
                trouble.push(Trouble::Closed { position, port });
            }
        }
        if status & 1 == 0 {
            let header = &one.sii.header;
            let is_whole = header.checksum as u8 == header.computed_checksum();
            let is_right = is_whole && header.identity != sii::Identity::default();
            trouble.push(Trouble::NotLoaded { position, is_right });
        }
        for (bit, protocol, remedy) in NOT_SPOKEN {
            let protocols = one.sii.header.mailbox_protocols;
            if protocols & bit != 0 {
                let speaks_coe = protocols & sii::PROTOCOL_COE != 0;
                trouble.push(Trouble::NotSpoken { position, protocol, remedy, speaks_coe });
            }
        }
        trouble
    }
}

/// What one's error counters (0x0300 and up, [`COUNTERS`] bytes) tell, damage and lost links by port.
pub fn of_counters(
    subdevices: &[SubDevice],
    number: usize,
    counters: &[u8],
    counted: Counted,
) -> Vec<Trouble> {
    let Some(one) = subdevices.get(number) else { return Vec::new() };
    let position = one.position;
    let of = |at: usize| counters.get(at).copied().unwrap_or(0);
    let mut trouble = Vec::new();
    for port in 0..4u8 {
        let at = usize::from(port);
        let (frames, signs, times) = (of(2 * at), of(2 * at + 1), of(0x10 + at));
        if frames > 0 || signs > 0 {
            let neighbour = neighbour(subdevices, one, port);
            trouble.push(Trouble::Damaged { position, port, frames, signs, neighbour, counted });
        }
        if times > 0 {
            trouble.push(Trouble::LostLink { position, port, times, counted });
        }
    }
    trouble
}

/// Who is at the other end of a port's cable, in words.
fn neighbour(subdevices: &[SubDevice], one: &SubDevice, port: u8) -> String {
    if port == one.entry_port {
        return match one.parent {
            Some(parent) => alloc::format!("SubDevice {} (its port {})", parent.position, parent.port),
            None => String::from("the MainDevice"),
        };
    }
    let behind = subdevices.iter().find(|other| {
        other.parent.is_some_and(|parent| (parent.position, parent.port) == (one.position, port))
    });
    behind.map_or_else(
        || String::from("nobody known"),
        |other| alloc::format!("SubDevice {} (its port {})", other.position, other.entry_port),
    )
}

/// Bits of the SII's mailbox protocols, their names, and what to do.
const NOT_SPOKEN: [(u16, &str, &str); 3] = [
    (
        sii::PROTOCOL_EOE,
        "EoE (Ethernet through the mailbox)",
        "its web page or its own tool is reached by its own network plug or the maker's software",
    ),
    (
        sii::PROTOCOL_SOE,
        "SoE (Sercos drive profile)",
        "choose CoE (CiA 402) as its profile where the drive offers that; without CoE it can be cycled by its SII's PDOs, but no \
         parameter can be written",
    ),
    (sii::PROTOCOL_AOE, "AoE", "devices behind it (a gateway's) can't be asked"),
];
