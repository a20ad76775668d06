//! Objects of a running robot's SubDevices, read and written by whoever may wait: never by the cycle.

use std::time::{Duration, Instant};

use omnibase_cia402::{ObjectUnit, SiUnit, unit_of};
use omnibase_ethercat::cyclic::{AcyclicWork, RegisterAccess};
use omnibase_ethercat::mailbox::{
    EntryDescription, MailboxRequest, ObjectDescription, ObjectList, Operation, list_indices,
};
use omnibase_ethercat::wire::bytes::u16_at;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::printable::printable;
use omnibase_ethercat::wire::{AlState, register};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{SdoWriteRule, parse_object};
use serde::{Deserialize, Serialize};

use super::acyclic::{AcyclicLine, AcyclicRefusal, Lasting, Permission, SubDeviceFacts};

/// The longest wait for an answer: each message to a SubDevice has 2 s of its own.
const ANSWER: Duration = Duration::from_secs(3);
/// Between two looks for it.
const LOOK: Duration = Duration::from_millis(2);
/// Bytes of the longest list of objects: each index there is.
const LONGEST_LIST: usize = 1 << 17;
/// What kind of device it is, and the profile of drives in that.
const DEVICE_TYPE: u16 = 0x1000;
const DRIVES: u32 = 402;
/// The longest value that is read.
const LONGEST: usize = 4096;

/// An object of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoPlace {
    /// The SubDevice.
    pub position: u16,
    /// The object.
    pub object: ObjectAddress,
}

/// What a SubDevice's SDO Information says of an object.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObjectType {
    /// Its name.
    pub name: String,
    /// 7 variable, 8 array, 9 record.
    pub object_code: u8,
    /// CoE data type.
    pub data_type: u16,
    /// The highest subindex.
    pub max_subindex: u8,
}

/// What a SubDevice's SDO Information says of an entry.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntryType {
    /// Its name.
    pub name: String,
    /// CoE data type.
    pub data_type: u16,
    /// Length, bits.
    pub bit_length: u16,
    /// Access bits: 0 to 2 read in PRE-OP, SAFE-OP, OP; 3 to 5 write; 6 and 7 mappable.
    pub access: u16,
    /// What its number is a number of, where the profile or the drive says it; else empty.
    #[serde(default)]
    pub unit: String,
}

impl ObjectType {
    /// Of what [`Operation::DescribeObject`] brought; `None` where that is too short.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let ObjectDescription { name, object_code, data_type, max_subindex, .. } =
            ObjectDescription::read(bytes)?;
        Some(ObjectType { name: text(name), object_code, data_type, max_subindex })
    }
}

impl EntryType {
    /// Of what [`Operation::DescribeEntry`] brought; `None` where that is too short.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let EntryDescription { name, data_type, bit_length, access, .. } = EntryDescription::read(bytes)?;
        Some(EntryType { name: text(name), data_type, bit_length, access, unit: String::new() })
    }
}

/// What an entry's number is a number of, of a drive of the profile CiA 402; empty where nobody says it. `read` gives objects.
pub fn entry_unit(object: ObjectAddress, mut read: impl FnMut(ObjectAddress) -> Option<Vec<u8>>) -> String {
    let Some(unit) = unit_of(object.index, object.subindex) else { return String::new() };
    let mut number = |index| {
        let bytes = read(ObjectAddress::new(index, 0))?;
        Some(u32::from_le_bytes(*bytes.first_chunk()?))
    };
    if number(DEVICE_TYPE).is_none_or(|kind| kind & 0xFFFF != DRIVES) {
        return String::new();
    }
    match unit {
        ObjectUnit::Fixed(words) => words.to_owned(),
        ObjectUnit::Told(by) => {
            number(by).and_then(SiUnit::from_code).map_or(String::new(), |unit| unit.to_string())
        }
    }
}

/// A name without the zeros behind it.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    printable(&bytes[..end])
}

/// A SubDevice as a running robot knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubDeviceSeen {
    /// Since the start.
    pub facts: SubDeviceFacts,
    /// Its state just now, or why that isn't known.
    pub state: String,
}

/// Why nothing was read or written, in words.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{why}")]
pub struct SdoError {
    why: String,
    is_refusal: bool,
}

impl SdoError {
    /// In these words; nobody asked the SubDevice, or it didn't answer.
    pub fn new(why: String) -> Self {
        SdoError { why, is_refusal: false }
    }

    /// The SubDevice's own no, in these words.
    pub fn refusal(why: String) -> Self {
        SdoError { why, is_refusal: true }
    }

    /// Whether the SubDevice itself said no to what was asked.
    pub fn is_refusal(&self) -> bool {
        self.is_refusal
    }
}

impl SdoPlace {
    /// The object `text`, as `6041:00` (hexadecimal) or `60C1.1`, of the SubDevice at `position`.
    pub fn new(position: u16, text: &str) -> Result<Self, SdoError> {
        let (index, subindex) = parse_object(text).map_err(|error| SdoError::new(error.to_string()))?;
        Ok(SdoPlace { position, object: ObjectAddress::new(index, subindex) })
    }
}

fn too_short(place: SdoPlace, bytes: &[u8]) -> SdoError {
    SdoError::refusal(format!("{}: a description of {} bytes is too short", place.object, bytes.len()))
}

impl AcyclicLine {
    /// The bytes of an object.
    pub fn sdo_read(&self, place: SdoPlace) -> Result<Vec<u8>, SdoError> {
        let request = MailboxRequest::upload(place.object, Vec::with_capacity(LONGEST));
        self.mailbox(place.position, request, Permission::Always)
    }

    /// What the SubDevice says of an entry's type.
    pub fn sdo_type(&self, place: SdoPlace) -> Result<EntryType, SdoError> {
        let operation = Operation::DescribeEntry { object: place.object, value_info: 0 };
        let ObjectAddress { index, subindex } = place.object;
        let what = Lasting::Entry(self.like(place.position), index, subindex);
        let bytes = self.described(what, place.position, operation, LONGEST)?;
        let entry = EntryType::read(&bytes).ok_or_else(|| too_short(place, &bytes))?;
        let read = |object: ObjectAddress| {
            let place = SdoPlace { object, ..place };
            let what = Lasting::Value(place.position, object.index, object.subindex);
            self.remembered(what, || self.sdo_read(place)).ok()
        };
        Ok(EntryType { unit: entry_unit(place.object, read), ..entry })
    }

    /// What the SubDevice says of an object; its subindex doesn't count.
    pub fn sdo_object(&self, place: SdoPlace) -> Result<ObjectType, SdoError> {
        let index = place.object.index;
        let operation = Operation::DescribeObject { index };
        let bytes = self.described(
            Lasting::Object(self.like(place.position), index),
            place.position,
            operation,
            LONGEST,
        )?;
        ObjectType::read(&bytes).ok_or_else(|| too_short(place, &bytes))
    }

    /// The indices of all objects of a SubDevice.
    pub fn sdo_list(&self, position: u16) -> Result<Vec<u16>, SdoError> {
        let operation = Operation::List(ObjectList::All);
        let bytes = self.described(Lasting::List(position), position, operation, LONGEST_LIST)?;
        Ok(list_indices(&bytes).collect())
    }

    /// What doesn't change while the robot runs: asked for once.
    fn described(
        &self,
        what: Lasting,
        position: u16,
        operation: Operation,
        longest: usize,
    ) -> Result<Vec<u8>, SdoError> {
        self.remembered(what, || {
            let request = MailboxRequest::new(operation, Vec::with_capacity(longest));
            let mut bytes = self.mailbox(position, request, Permission::Always)?;
            bytes.shrink_to_fit();
            Ok(bytes)
        })
    }

    /// Writes an object, where and when the plan allows it.
    pub fn sdo_write(&self, plan: &RobotPlan, place: SdoPlace, data: Vec<u8>) -> Result<(), SdoError> {
        let object = place.object;
        let permission = match plan.sdo_write_rule(object) {
            SdoWriteRule::Never(why) => {
                return Err(SdoError::new(format!("{object} is not written while the robot runs: {why}")));
            }
            SdoWriteRule::Always => Permission::Always,
            SdoWriteRule::WhileDisabled => Permission::WhileDisabled,
        };
        self.mailbox(place.position, MailboxRequest::download(object, data), permission).map(drop)
    }

    /// Every SubDevice with its state.
    pub fn scan(&self) -> Vec<SubDeviceSeen> {
        let see = |facts: &SubDeviceFacts| {
            let (way, register) = (RegisterAccess::Read, register::AL_STATUS);
            let work = AcyclicWork::Registers { way, register, data: vec![0; 6] };
            let state = match self.wait(facts.position, work, Permission::Always) {
                Ok(AcyclicWork::Registers { data, .. }) => state_words(u16_at(&data, 0)),
                Ok(AcyclicWork::Mailbox(_)) => "unknown".to_owned(),
                Err(error) => error.why,
            };
            SubDeviceSeen { facts: facts.clone(), state }
        };
        self.subdevices().iter().map(see).collect()
    }

    fn mailbox(
        &self,
        position: u16,
        request: MailboxRequest,
        permission: Permission,
    ) -> Result<Vec<u8>, SdoError> {
        let operation = request.operation;
        let failed = |SdoError { why, is_refusal }| SdoError {
            why: format!("SubDevice {position}: {operation}: {why}"),
            is_refusal,
        };
        match self.wait(position, AcyclicWork::Mailbox(request), permission).map_err(failed)? {
            AcyclicWork::Mailbox(request) => Ok(request.data),
            AcyclicWork::Registers { data, .. } => Ok(data),
        }
    }

    fn wait(
        &self,
        position: u16,
        work: AcyclicWork,
        permission: Permission,
    ) -> Result<AcyclicWork, SdoError> {
        self.wait_until(position, work, permission, Instant::now() + ANSWER)
    }

    pub(super) fn wait_until(
        &self,
        position: u16,
        work: AcyclicWork,
        permission: Permission,
        until: Instant,
    ) -> Result<AcyclicWork, SdoError> {
        let count = self.subdevices().len();
        if count == 0 {
            return Err(SdoError::new("the robot's bus is not set up yet".to_owned()));
        }
        if usize::from(position) >= count {
            return Err(SdoError::new(format!("there is no SubDevice {position}: the robot has {count}")));
        }
        let (mut unasked, mut ticket) = (Some(work), None);
        while Instant::now() < until {
            if let Some(work) = unasked.take() {
                // Whoever asks beside many others waits for room.
                match self.ask(position, work, permission, until) {
                    Ok(asked) => ticket = Some(asked),
                    Err(work) => unasked = Some(work),
                }
            }
            if let Some(told) = ticket.and_then(|ticket| self.told(ticket)) {
                let failed =
                    |why: AcyclicRefusal| SdoError { why: why.to_string(), is_refusal: why.is_its_own() };
                return told.result.map(|()| told.work).map_err(failed);
            }
            std::thread::sleep(LOOK);
        }
        let waited_s = ANSWER.as_secs();
        Err(SdoError::new(match ticket {
            Some(_) => {
                format!("no answer within {waited_s} s; what was asked may have been done all the same")
            }
            None => format!("too much was asked at once for {waited_s} s: nothing was done"),
        }))
    }
}

fn state_words(status: u16) -> String {
    let state = AlState::from_bits(status).map_or("unknown state", AlState::name);
    if status & AlState::ERROR == 0 { state.to_owned() } else { format!("{state} with error") }
}
