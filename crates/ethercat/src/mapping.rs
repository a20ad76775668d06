//! PDO mapping: the steps that write it, and reading it from a device.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use crate::config::{SubDeviceConfig, SyncManagerPdos, SyncMode};
use crate::mailbox::{Mailbox, MailboxError, MailboxRequest};
use crate::procedure::{Answer, Next, Procedure};
use crate::process_data::{Direction, MappedObject, MappedPdo, SyncManager};
use crate::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite, StartUpStep};
use crate::sync_manager::ASSIGNMENT;
use crate::wire::HostTime;
use crate::wire::bytes::u32_at;
use crate::wire::coe::ObjectAddress;

/// Objects that say how the application is synchronised, for SM2 and SM3.
const SYNC_OUTPUTS: u16 = 0x1C32;
const SYNC_INPUTS: u16 = 0x1C33;

/// One SDO write that must end in this value, whether the device takes it or has it already.
fn must_be(object: ObjectAddress, data: &[u8], origin: Option<&Arc<str>>) -> StartUpStep {
    StartUpStep::Sdo(SdoWrite {
        object,
        data: data.to_vec(),
        access: SdoAccess::Entry,
        refusal: Refusal::IsTolerated,
        read_back: ReadBack::Compare,
        origin: origin.cloned(),
    })
}

/// Empties a list by its subindex 0; a device with a fixed list may refuse, for the entries decide.
fn empty(index: u16, origin: Option<&Arc<str>>) -> StartUpStep {
    StartUpStep::Sdo(SdoWrite {
        object: ObjectAddress::new(index, 0),
        data: Vec::from([0]),
        access: SdoAccess::Entry,
        refusal: Refusal::IsTolerated,
        read_back: ReadBack::Skip,
        origin: origin.cloned(),
    })
}

/// The steps that write the user's PDO map: each list emptied, filled entry by entry, and closed.
pub fn mapping_steps(config: &SubDeviceConfig) -> Vec<StartUpStep> {
    let mut steps = Vec::new();
    for wanted in &config.pdos {
        let origin = wanted.origin.as_ref();
        let assignment = ASSIGNMENT + u16::from(wanted.sync_manager);
        steps.push(empty(assignment, origin));
        for pdo in &wanted.pdos {
            let Some(entries) = &pdo.entries else { continue };
            steps.push(empty(pdo.index, origin));
            for (subindex, (object, bit_length)) in (1..).zip(entries) {
                let value =
                    u32::from(object.index) << 16 | u32::from(object.subindex) << 8 | u32::from(*bit_length);
                steps.push(must_be(ObjectAddress::new(pdo.index, subindex), &value.to_le_bytes(), origin));
            }
            steps.push(must_be(ObjectAddress::new(pdo.index, 0), &[entries.len() as u8], origin));
        }
        for (subindex, pdo) in (1..).zip(&wanted.pdos) {
            let object = ObjectAddress::new(assignment, subindex);
            steps.push(must_be(object, &pdo.index.to_le_bytes(), origin));
        }
        steps.push(must_be(ObjectAddress::new(assignment, 0), &[wanted.pdos.len() as u8], origin));
    }
    steps
}

/// The steps that write the synchronisation mode to 0x1C32 and 0x1C33, subindex 1 (ETG.1020).
pub fn sync_mode_steps(mode: SyncMode, managers: &[SyncManager]) -> Vec<StartUpStep> {
    let has = |direction| managers.iter().any(|manager| manager.direction() == Some(direction));
    let (outputs, inputs) = match mode {
        SyncMode::FreeRun => (0u16, 0u16),
        SyncMode::SyncManagerEvent if has(Direction::Outputs) => (1, 0x22),
        SyncMode::SyncManagerEvent => (1, 1),
        SyncMode::Sync0 => (2, 2),
    };
    let mut steps = Vec::new();
    for (direction, index, value) in
        [(Direction::Outputs, SYNC_OUTPUTS, outputs), (Direction::Inputs, SYNC_INPUTS, inputs)]
    {
        if has(direction) {
            steps.push(must_be(ObjectAddress::new(index, 1), &value.to_le_bytes(), None));
        }
    }
    steps
}

/// Why a PDO map can't be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MappingError {
    /// The SubDevice.
    pub position: u16,
    /// Why.
    pub cause: MappingFailure,
}

/// What is wrong with a PDO map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MappingFailure {
    /// An object of the map could not be read.
    Unreadable {
        /// The object.
        object: ObjectAddress,
        /// Why.
        error: MailboxError,
    },
    /// An object of the map has another size than the standard says.
    Malformed {
        /// The object.
        object: ObjectAddress,
        /// Bytes that were expected.
        expected: usize,
        /// Bytes that came.
        found: usize,
    },
    /// The device has another map than the user wants.
    Differs {
        /// The SyncManager.
        sync_manager: u8,
        /// Bits wanted.
        wanted_bits: u32,
        /// Bits that the device has.
        given_bits: u32,
        /// Where it was asked.
        origin: Option<Arc<str>>,
    },
    /// The user maps to a SyncManager that the device doesn't have, or that goes the other way.
    NoSuchSyncManager {
        /// The SyncManager.
        sync_manager: u8,
        /// The direction that was asked.
        direction: Direction,
        /// SyncManagers that the controller has.
        count: u8,
        /// Where it was asked.
        origin: Option<Arc<str>>,
    },
    /// A map longer than its subindices can count.
    TooMany {
        /// PDO or assignment.
        index: u16,
        /// Entries asked.
        found: usize,
    },
}

impl fmt::Display for MappingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SubDevice {}: ", self.position)?;
        let origin = match &self.cause {
            MappingFailure::Unreadable { object, error } => {
                write!(f, "PDO map: reading {object}: {error}")?;
                &None
            }
            MappingFailure::Malformed { object, expected, found } => {
                write!(f, "PDO map: {object} has {found} bytes, expected {expected}")?;
                &None
            }
            MappingFailure::Differs { sync_manager, wanted_bits, given_bits, origin } => {
                write!(
                    f,
                    "PDO map of SyncManager {sync_manager}: wanted {wanted_bits} bits, the device has {given_bits}"
                )?;
                origin
            }
            MappingFailure::NoSuchSyncManager { sync_manager, direction, count, origin } => {
                let way = match direction {
                    Direction::Outputs => "outputs",
                    Direction::Inputs => "inputs",
                };
                write!(
                    f,
                    "PDO map: SyncManager {sync_manager} is not one for {way} (the controller has {count})"
                )?;
                origin
            }
            MappingFailure::TooMany { index, found } => {
                write!(f, "PDO map: {found} entries in {index:04x}, at most 254 fit")?;
                &None
            }
        };
        match origin {
            Some(origin) => write!(f, " ({origin})"),
            None => Ok(()),
        }
    }
}

impl core::error::Error for MappingError {}

/// The most entries of one list.
const LIST_LIMIT: usize = 254;

/// Checks what can be checked of the user's map before anything is written.
pub fn check_config(
    position: u16,
    config: &SubDeviceConfig,
    managers: &[SyncManager],
    count: u8,
) -> Result<(), MappingError> {
    let error = |cause| Err(MappingError { position, cause });
    for wanted in &config.pdos {
        let SyncManagerPdos { sync_manager, direction, origin, .. } = wanted;
        let (sync_manager, direction) = (*sync_manager, *direction);
        let there = managers.iter().find(|manager| manager.index == sync_manager);
        if there.and_then(SyncManager::direction) != Some(direction) {
            let origin = origin.clone();
            return error(MappingFailure::NoSuchSyncManager { sync_manager, direction, count, origin });
        }
        let assignment = (ASSIGNMENT + u16::from(sync_manager), wanted.pdos.len());
        let lists = wanted.pdos.iter().map(|pdo| (pdo.index, pdo.entries.as_ref().map_or(0, Vec::len)));
        for (index, found) in lists.chain([assignment]) {
            if found > LIST_LIMIT {
                return error(MappingFailure::TooMany { index, found });
            }
        }
    }
    Ok(())
}

/// Compares the device's map with the user's by size; the entries were compared as they were written.
pub fn check_sizes(
    position: u16,
    config: &SubDeviceConfig,
    managers: &[SyncManager],
) -> Result<(), MappingError> {
    for wanted in &config.pdos {
        let Some(manager) = managers.iter().find(|manager| manager.index == wanted.sync_manager) else {
            continue;
        };
        let given_bits = manager.bit_length();
        let wanted_bits = wanted
            .pdos
            .iter()
            .map(|pdo| match &pdo.entries {
                Some(entries) => entries.iter().map(|(_, bits)| u32::from(*bits)).sum(),
                None => manager
                    .pdos
                    .iter()
                    .find(|given| given.index == pdo.index)
                    .map_or(0, MappedPdo::bit_length),
            })
            .sum();
        if given_bits != wanted_bits {
            let (sync_manager, origin) = (wanted.sync_manager, wanted.origin.clone());
            let cause = MappingFailure::Differs { sync_manager, wanted_bits, given_bits, origin };
            return Err(MappingError { position, cause });
        }
    }
    Ok(())
}

/// What is read next.
#[derive(Clone, Copy, Debug)]
enum Job {
    /// Number of PDOs assigned to a SyncManager.
    AssignedCount,
    /// One of them.
    Assigned(u8),
    /// Number of entries of the last PDO.
    EntryCount,
    /// One of them.
    Entry(u8),
}

/// The PDOs of one SyncManager as the device has them; `None` where it has no such assignment.
pub type ReadMap = (u8, Option<Vec<MappedPdo>>);

/// Reads the PDO map of a device's process-data SyncManagers by CoE, entry by entry.
#[derive(Debug)]
pub struct MappingReader {
    position: u16,
    mailbox: Mailbox,
    /// SyncManagers still to be read, the present one last.
    left: Vec<u8>,
    done: Vec<ReadMap>,
    /// Jobs of the present SyncManager, the next one last.
    jobs: Vec<Job>,
    /// PDOs assigned to the present SyncManager, their entries so far.
    pdos: Vec<MappedPdo>,
    asked: Option<ObjectAddress>,
    outcome: Option<Result<(), MappingFailure>>,
}

impl MappingReader {
    /// A reader of the map of `sync_managers` through `mailbox`.
    pub fn new(position: u16, mailbox: Mailbox, mut sync_managers: Vec<u8>) -> Self {
        sync_managers.reverse();
        MappingReader {
            position,
            mailbox,
            left: sync_managers,
            done: Vec::new(),
            jobs: Vec::new(),
            pdos: Vec::new(),
            asked: None,
            outcome: None,
        }
    }

    /// Gives the mailbox back.
    pub fn into_mailbox(self) -> Mailbox {
        self.mailbox
    }

    fn object(&self, job: Job) -> ObjectAddress {
        let assignment = ASSIGNMENT + u16::from(self.left.last().copied().unwrap_or(0));
        let pdo = self.pdos.last().map_or(0, |pdo| pdo.index);
        match job {
            Job::AssignedCount => ObjectAddress::new(assignment, 0),
            Job::Assigned(subindex) => ObjectAddress::new(assignment, subindex),
            Job::EntryCount => ObjectAddress::new(pdo, 0),
            Job::Entry(subindex) => ObjectAddress::new(pdo, subindex),
        }
    }

    /// Starts the next upload; ends where nothing is left.
    fn advance(&mut self, now: HostTime) {
        if self.jobs.is_empty() {
            if self.left.is_empty() {
                self.outcome = Some(Ok(()));
                return;
            }
            self.jobs.push(Job::AssignedCount);
        }
        let Some(&job) = self.jobs.last() else { return };
        let object = self.object(job);
        self.asked = Some(object);
        // Some devices answer bytes with four bytes; more than eight is no count and no entry.
        if self.mailbox.start(MailboxRequest::upload(object, Vec::with_capacity(8)), now).is_err() {
            self.outcome = Some(Err(MappingFailure::Unreadable { object, error: MailboxError::Reset }));
        }
    }

    fn end_manager(&mut self) {
        if let Some(manager) = self.left.pop() {
            self.done.push((manager, Some(core::mem::take(&mut self.pdos))));
        }
    }

    fn take(&mut self, object: ObjectAddress, result: Result<Vec<u8>, MailboxError>) {
        let Some(job) = self.jobs.pop() else { return };
        let data = match (result, job) {
            (Ok(data), _) => data,
            // No assignment to be read: what the SII says holds.
            (Err(MailboxError::Aborted { .. }), Job::AssignedCount) => {
                if let Some(manager) = self.left.pop() {
                    self.done.push((manager, None));
                }
                return;
            }
            (Err(error), _) => {
                self.outcome = Some(Err(MappingFailure::Unreadable { object, error }));
                return;
            }
        };
        let expected = match job {
            Job::AssignedCount | Job::EntryCount => 1,
            Job::Assigned(_) => 2,
            Job::Entry(_) => 4,
        };
        if data.len() < expected {
            let found = data.len();
            self.outcome = Some(Err(MappingFailure::Malformed { object, expected, found }));
            return;
        }
        match job {
            Job::AssignedCount => self.jobs.extend((1..=data[0]).rev().map(Job::Assigned)),
            Job::Assigned(_) => {
                let index = u16::from_le_bytes([data[0], data[1]]);
                // Index 0 is an empty place in the list.
                if index != 0 {
                    self.pdos.push(MappedPdo { index, name: None, entries: Vec::new() });
                    self.jobs.push(Job::EntryCount);
                }
            }
            Job::EntryCount => self.jobs.extend((1..=data[0]).rev().map(Job::Entry)),
            Job::Entry(_) => {
                let value = u32_at(&data, 0);
                if let Some(pdo) = self.pdos.last_mut() {
                    pdo.entries.push(MappedObject {
                        object: ObjectAddress::new((value >> 16) as u16, (value >> 8) as u8),
                        bit_length: value as u8,
                        data_type: None,
                        name: None,
                    });
                }
            }
        }
        if self.jobs.is_empty() {
            self.end_manager();
        }
    }
}

impl Procedure for MappingReader {
    type Output = Result<Vec<ReadMap>, MappingError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        loop {
            if let Some(outcome) = self.outcome.take() {
                let position = self.position;
                let done = core::mem::take(&mut self.done);
                return Next::Done(match outcome {
                    Ok(()) => Ok(done),
                    Err(cause) => Err(MappingError { position, cause }),
                });
            }
            let Some(object) = self.asked else {
                self.advance(now);
                continue;
            };
            match self.mailbox.next(now) {
                Next::Send(request) => return Next::Send(request),
                Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                Next::Done(completion) => {
                    self.asked = None;
                    let result = match completion {
                        Some(completion) => completion.result.map(|()| completion.request.data),
                        None => Err(MailboxError::Reset),
                    };
                    self.take(object, result);
                }
            }
        }
    }

    fn fill(&self, data: &mut [u8]) {
        self.mailbox.fill(data);
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        self.mailbox.answer(answer, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::PdoConfig;
    use crate::subdevice::MemoryArea;
    use crate::wire::sii::SyncManagerUsage;

    #[test]
    fn a_map_of_another_size_is_refused_with_both_sizes() {
        let entry = |bit_length| MappedObject {
            object: ObjectAddress::new(0x6041, 0),
            bit_length,
            data_type: None,
            name: None,
        };
        let pdo = |index, bits| MappedPdo { index, name: None, entries: vec![entry(bits)] };
        let manager = SyncManager {
            index: 3,
            area: MemoryArea { start: 0x1C00, length: 4 },
            control: 0x20,
            enabled: true,
            activation: Default::default(),
            usage: SyncManagerUsage::Inputs,
            pdos: vec![pdo(0x1A00, 16), pdo(0x1A01, 8)],
            logical: None,
        };
        let wanted = |entries| SyncManagerPdos {
            sync_manager: 3,
            direction: Direction::Inputs,
            pdos: vec![PdoConfig { index: 0x1A00, entries }, PdoConfig { index: 0x1A01, entries: None }],
            origin: Some("robot.toml line 9".into()),
        };
        let check = |entries| {
            let config = SubDeviceConfig { pdos: vec![wanted(entries)], ..SubDeviceConfig::default() };
            check_sizes(5, &config, core::slice::from_ref(&manager))
        };
        assert_eq!(check(None), Ok(()));
        assert_eq!(check(Some(vec![(ObjectAddress::new(0x6041, 0), 16)])), Ok(()));
        assert_eq!(
            check(Some(vec![(ObjectAddress::new(0x6064, 0), 32)])).unwrap_err().to_string(),
            "SubDevice 5: PDO map of SyncManager 3: wanted 40 bits, the device has 24 (robot.toml line 9)"
        );
    }
}
