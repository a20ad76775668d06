//! A segment while it is being set up: everything may wait and allocate here.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::eeprom::{EepromError, SiiExtent, SiiReader};
use crate::error::SetUpError;
use crate::mailbox::{Mailbox, MailboxError, MailboxRequest, ObjectList, Operation, list_indices};
use crate::procedure::Procedure;
use crate::start_up::SdoAccess;
use crate::state::{StateChange, StateTimeouts};
use crate::subdevice::SubDevice;
use crate::transaction::{Access, Target, TransactionOptions, Transactor};
use crate::wire::coe::ObjectAddress;
use crate::wire::{AlState, Clock, Link, register};

/// The most SubDevices that one segment may have.
pub const MAX_SUBDEVICES: u16 = 1000;

/// The largest object that is read.
const READ_LIMIT: usize = 64 * 1024;

/// How the set-up works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusOptions {
    /// Frames: time-out and retries.
    pub transaction: TransactionOptions,
    /// The longest waits for states.
    pub timeouts: StateTimeouts,
}

/// Something that doesn't stop the set-up but that a person should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Warning {
    /// Several SubDevices have the same alias, so that none of them can be found by it.
    DuplicateAlias {
        /// The alias.
        alias: u16,
        /// Who has it.
        positions: Vec<u16>,
    },
    /// The switches of several SubDevices show the same number, so that none of them can be found by it.
    DuplicateIdentification {
        /// The number.
        identification: u16,
        /// Whose switches show it.
        positions: Vec<u16>,
    },
    /// Frames enter a SubDevice at another port than 0: its cables are swapped.
    EntersAtPort {
        /// The SubDevice.
        position: u16,
        /// The port.
        port: u8,
    },
    /// An EEPROM is missing or dead: the SubDevice has no identity and no mailbox.
    NoEeprom(EepromError),
    /// An EEPROM holds nothing but ones: the SubDevice has no identity and no mailbox.
    ErasedEeprom {
        /// The SubDevice.
        position: u16,
    },
    /// Something of a SubDevice is broken, and it is left out.
    LeftOut {
        /// The SubDevice.
        position: u16,
        /// Why.
        cause: String,
    },
    /// Nobody names a PDO of a SyncManager, but its SII names a length.
    NoPdos {
        /// The SubDevice.
        position: u16,
        /// The SyncManager.
        sync_manager: u8,
        /// The length that the SII names, bytes.
        bytes: u16,
    },
    /// An identification was promised by the SII, but the SubDevice doesn't tell it.
    NoIdentification {
        /// The SubDevice.
        position: u16,
    },
    /// The EEPROM could be read but not all of it makes sense.
    Eeprom {
        /// The SubDevice.
        position: u16,
        /// What, and where in the image.
        problem: crate::wire::sii::SiiDefect,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::DuplicateAlias { alias, positions } => {
                write!(
                    f,
                    "alias 0x{alias:04x} belongs to SubDevices {positions:?}: none can be found by it; give all but one another \
                     (`omnibase eeprom alias`)"
                )
            }
            Warning::DuplicateIdentification { identification, positions } => {
                write!(
                    f,
                    "identification {identification} is shown by SubDevices {positions:?}: none of them can be found by it"
                )
            }
            Warning::EntersAtPort { position, port } => {
                write!(
                    f,
                    "frames enter SubDevice {position} at port {port}, not 0: its cables are swapped (IN and OUT), so that the order of \
                     positions isn't that of the cables; plug the cable from the MainDevice into IN"
                )
            }
            Warning::NoEeprom(error) => write!(f, "{error}; nobody knows what it is"),
            Warning::ErasedEeprom { position } => {
                write!(f, "SubDevice {position}: the EEPROM is erased; nobody knows what it is")
            }
            Warning::NoPdos { position, sync_manager, bytes } => write!(
                f,
                "SubDevice {position}: no PDO is named for SyncManager {sync_manager}, neither by its SII nor by CoE, yet \
                 the SII says {bytes} bytes there: these are cycled without a meaning; name the PDOs in its table"
            ),
            Warning::NoIdentification { position } => write!(
                f,
                "SubDevice {position}: its SII promises an identification in AL status code (0x0134), but none came"
            ),
            Warning::LeftOut { position, cause } => {
                write!(f, "SubDevice {position} can't be used and is left out: {cause}")
            }
            Warning::Eeprom { position, problem } => {
                write!(f, "SubDevice {position}: EEPROM: {problem}")
            }
        }
    }
}

/// What becomes of a SubDevice that can't be set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// It is named, and the others are set up without it.
    LeftOut,
    /// The whole set-up fails.
    IsError,
}

/// A segment while it is being set up.
#[derive(Debug)]
pub struct Bus<L, C> {
    pub(crate) transactor: Transactor<L, C>,
    pub(crate) options: BusOptions,
    pub(crate) subdevices: Vec<SubDevice>,
    pub(crate) warnings: Vec<Warning>,
    pub(crate) unusable: Unusable,
    /// Mailboxes by position; `None` where a SubDevice has none, or none yet.
    pub(crate) mailboxes: Vec<Option<Mailbox>>,
    /// How long a frame takes there and back, as the clocks measured it.
    pub(crate) propagation: Option<core::time::Duration>,
    /// What the error counters showed before the scan cleared them, by position; empty where all were zero.
    pub(crate) counters_before: Vec<Vec<u8>>,
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// A segment behind `link`, nothing known of it yet.
    pub fn new(link: L, clock: C, options: BusOptions) -> Self {
        let transactor = Transactor::new(link, clock, options.transaction);
        Bus {
            transactor,
            options,
            subdevices: Vec::new(),
            warnings: Vec::new(),
            unusable: Unusable::IsError,
            mailboxes: Vec::new(),
            propagation: None,
            counters_before: Vec::new(),
        }
    }

    /// The SubDevices found by [`Bus::scan`], by position.
    pub fn subdevices(&self) -> &[SubDevice] {
        &self.subdevices
    }

    /// What a person should know, as found so far.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// How long a frame takes through all cables and chips, there and back, as the distributed clocks measured it when
    /// the segment was configured; `None` where there are none.
    pub fn propagation(&self) -> Option<core::time::Duration> {
        self.propagation
    }

    /// The exchange below: counters, link and clock.
    pub fn transactor(&mut self) -> &mut Transactor<L, C> {
        &mut self.transactor
    }

    /// The whole EEPROM of the SubDevice at `position`, as bytes.
    ///
    /// The EEPROM is taken from the SubDevice's application for the time of the reading.
    pub fn read_sii(&mut self, position: u16) -> Result<Vec<u8>, SetUpError> {
        let target = self.target(position)?;
        for value in [2, 0] {
            self.transactor.perform_one(Access::write(
                "taking the EEPROM",
                target,
                register::SII_CONFIG,
                &[value],
            ))?;
        }
        let mut readers = [SiiReader::new(target, SiiExtent::Whole)];
        let read = self.transactor.drive(&mut readers)?;
        self.transactor.perform_one(Access::write(
            "giving the EEPROM back",
            target,
            register::SII_CONFIG,
            &[1],
        ))?;
        read.into_iter().collect::<Result<(), _>>()?;
        let [reader] = readers;
        Ok(reader.into_image())
    }

    /// Takes the SubDevices at `positions` to `state` side by side; the first that fails is the error.
    pub fn request_state(&mut self, positions: &[u16], state: AlState) -> Result<(), SetUpError> {
        let timeout = self.options.timeouts.of(state);
        let mut changes = Vec::with_capacity(positions.len());
        for &position in positions {
            let application = self.subdevice(position)?.application;
            changes.push(StateChange::new(self.target(position)?, application, state, timeout));
        }
        for result in self.transactor.drive(&mut changes)? {
            result?;
        }
        Ok(())
    }

    /// Takes a SubDevice out of everything that follows: it stays where it is, and says why.
    pub(crate) fn leave_out(&mut self, position: u16, why: &SetUpError) {
        let number = usize::from(position);
        if let Some(mailbox) = self.mailboxes.get_mut(number) {
            *mailbox = None;
        }
        let Some(one) = self.subdevices.get_mut(number) else { return };
        one.mailbox = None;
        one.sync_managers.clear();
        one.fmmus.clear();
        one.start_up.steps.clear();
        let cause = why.to_string();
        self.warnings.push(Warning::LeftOut { position, cause: cause.clone() });
        one.broken = Some(cause);
    }

    /// The SubDevice at `position`.
    pub fn subdevice(&self, position: u16) -> Result<&SubDevice, SetUpError> {
        let count = self.subdevices.len();
        self.subdevices.get(usize::from(position)).ok_or(SetUpError::NoSuchPosition { position, count })
    }

    /// Puts one request through a SubDevice's mailbox and waits for its end; gives the result's bytes.
    ///
    /// The mailbox works from PRE-OP on. The request's buffer limits the length of what is accepted.
    pub fn request(&mut self, position: u16, request: MailboxRequest) -> Result<Vec<u8>, SetUpError> {
        let operation = request.operation;
        if let Some(cause) = &self.subdevice(position)?.broken {
            return Err(SetUpError::Broken { position, cause: cause.clone() });
        }
        let now = self.transactor.clock.now();
        let Some(mailbox) = self.mailboxes.get_mut(usize::from(position)).and_then(Option::as_mut) else {
            return Err(SetUpError::NoCoe { position, operation });
        };
        if mailbox.is_busy() {
            // What an error of the link left unfinished is nobody's any more.
            mailbox.cancel();
            let _ = mailbox.next(now);
        }
        if mailbox.start(request, now).is_err() {
            return Err(SetUpError::NoCoe { position, operation });
        }
        let completion = self.transactor.drive(core::slice::from_mut(mailbox))?.pop().flatten();
        let failed = |cause| SetUpError::Request { position, operation, cause };
        match completion {
            Some(completion) => completion.result.map(|()| completion.request.data).map_err(failed),
            None => Err(failed(MailboxError::Reset)),
        }
    }

    /// Reads an object, an entry or the whole of it.
    pub fn sdo_read(
        &mut self,
        position: u16,
        object: ObjectAddress,
        access: SdoAccess,
    ) -> Result<Vec<u8>, SetUpError> {
        let operation = Operation::Upload { object, access };
        self.request(position, MailboxRequest::new(operation, Vec::with_capacity(READ_LIMIT)))
    }

    /// Writes an entry of an object.
    pub fn sdo_write(&mut self, position: u16, object: ObjectAddress, data: &[u8]) -> Result<(), SetUpError> {
        self.request(position, MailboxRequest::download(object, data.to_vec())).map(drop)
    }

    /// The indices of all objects.
    pub fn object_list(&mut self, position: u16) -> Result<Vec<u16>, SetUpError> {
        let operation = Operation::List(ObjectList::All);
        let data = self.request(position, MailboxRequest::new(operation, Vec::with_capacity(READ_LIMIT)))?;
        Ok(list_indices(&data).collect())
    }

    /// What an object is: the bytes that [`crate::mailbox::ObjectDescription::read`] makes sense of.
    pub fn describe_object(&mut self, position: u16, index: u16) -> Result<Vec<u8>, SetUpError> {
        let operation = Operation::DescribeObject { index };
        self.request(position, MailboxRequest::new(operation, Vec::with_capacity(READ_LIMIT)))
    }

    /// What an entry is: the bytes that [`crate::mailbox::EntryDescription::read`] makes sense of.
    pub fn describe_entry(
        &mut self,
        position: u16,
        object: ObjectAddress,
        value_info: u8,
    ) -> Result<Vec<u8>, SetUpError> {
        let operation = Operation::DescribeEntry { object, value_info };
        self.request(position, MailboxRequest::new(operation, Vec::with_capacity(READ_LIMIT)))
    }

    pub(crate) fn target(&self, position: u16) -> Result<Target, SetUpError> {
        self.subdevice(position).map(SubDevice::target)
    }
}
