//! What is done to a SubDevice where it stands: its EEPROM written, files read and written (FoE).

use alloc::vec::Vec;
use core::time::Duration;

use crate::bus::Bus;
use crate::eeprom::{self, SiiExtent, SiiReader, SiiWriter};
use crate::error::SetUpError;
use crate::found::Found;
use crate::mailbox::{Completion, DEFAULT_TIMEOUT, Mailbox, MailboxError, MailboxRequest};
use crate::procedure::{Answer, Next, Procedure};
use crate::process_data::{MailboxConfig, MemoryArea};
use crate::state::{Application, StateChange};
use crate::subdevice::SyncManager;
use crate::sync_manager;
use crate::transaction::{Access, Expect, Target};
use crate::wire::bytes::u16_at;
use crate::wire::{AlState, Clock, HostTime, Link, register, sii};

/// How long one message of a file waits for its answer: devices erase their memory behind the first.
pub const FILE_TIMEOUT: Duration = Duration::from_secs(30);

impl<L: Link, C: Clock> Bus<L, C> {
    /// All SubDevices' AL statuses ORed, before anything is changed; `None` where nobody answers.
    ///
    /// What shows OP or SAFE-OP here is driven by someone, or was until a moment ago. Where the frames are lost nobody knows, and
    /// that is an error.
    pub fn present_states(&mut self) -> Result<Option<u16>, SetUpError> {
        let read = Access::broadcast_read("reading AL status", register::AL_STATUS, 2, Expect::Any);
        let Access { found, data, .. } = self.transactor.perform_one(read)?;
        Ok(matches!(found, Found::WorkingCounter(1..)).then(|| u16_at(&data, 0)))
    }

    /// The first `length` bytes of the EEPROM of the SubDevice at `position`, whatever size it announces.
    pub fn read_sii_first(&mut self, position: u16, length: usize) -> Result<Vec<u8>, SetUpError> {
        let target = self.target(position)?;
        self.take_eeprom(target)?;
        let read = self.read_extent(target, SiiExtent::First(length));
        self.give_eeprom_back(target);
        read
    }

    /// Makes `after` of the EEPROM of the SubDevice at `position`, which holds `before`; how many words that took.
    ///
    /// The checksum in `after` is right already ([`eeprom::with_checksum`]). It is spoiled first and set right last, each
    /// word is read back before the next, and in the end the whole. The SubDevice should be in INIT.
    pub fn write_sii(&mut self, position: u16, before: &[u8], after: &[u8]) -> Result<usize, SetUpError> {
        let target = self.target(position)?;
        let steps = eeprom::plan(before, after);
        let words = steps.len();
        self.take_eeprom(target)?;
        let written = self.write_words(target, SiiWriter::new(target, steps), after);
        self.give_eeprom_back(target);
        written.map(|()| words)
    }

    /// What the EEPROM of the SubDevice at `position` begins with once it has this alias, with its checksum, for
    /// [`Bus::write_sii`]; 0 takes the alias away. `None` where its checksum is wrong: then only the whole can be written.
    pub fn sii_with_alias(&mut self, position: u16, alias: u16) -> Result<Option<Vec<u8>>, SetUpError> {
        let mut image = self.read_sii_first(position, sii::HEADER)?;
        if image.first_chunk().is_none_or(|begin| image.get(14) != Some(&sii::checksum(begin))) {
            return Ok(None);
        }
        image[8..10].copy_from_slice(&alias.to_le_bytes());
        Ok(Some(eeprom::with_checksum(image)))
    }

    fn write_words(&mut self, target: Target, writer: SiiWriter, after: &[u8]) -> Result<(), SetUpError> {
        for result in self.transactor.drive(&mut [writer])? {
            result?;
        }
        let found = self.read_extent(target, SiiExtent::First(after.len()))?;
        let words = after.chunks_exact(2).zip(found.chunks_exact(2));
        match (0u32..).zip(words).find(|(_, (expected, found))| expected != found) {
            None => Ok(()),
            Some((word, (expected, found))) => {
                let differs = SetUpError::EepromDiffers {
                    position: target.position,
                    word,
                    expected: u16_at(expected, 0),
                    found: u16_at(found, 0),
                };
                // What isn't right isn't called good: its checksum is spoiled again. An error here would hide that one.
                let spoil = SiiWriter::new(target, alloc::vec![eeprom::spoiled_checksum(after)]);
                let _ = self.transactor.drive(&mut [spoil]);
                Err(differs)
            }
        }
    }

    fn read_extent(&mut self, target: Target, extent: SiiExtent) -> Result<Vec<u8>, SetUpError> {
        let mut readers = [SiiReader::new(target, extent)];
        for result in self.transactor.drive(&mut readers)? {
            result?;
        }
        let [reader] = readers;
        Ok(reader.into_image())
    }

    fn take_eeprom(&mut self, target: Target) -> Result<(), SetUpError> {
        for value in [2, 0] {
            let take = Access::write("taking the EEPROM", target, register::SII_CONFIG, &[value]);
            self.transactor.perform_one(take)?;
        }
        Ok(())
    }

    /// The next start-up gives it back, too; an error here would hide what became of the EEPROM.
    fn give_eeprom_back(&mut self, target: Target) {
        let give = Access::write("giving the EEPROM back", target, register::SII_CONFIG, &[1]);
        let _ = self.transactor.perform_one(give);
    }

    /// Brings the SubDevice at `position` by INIT to BOOT, where files are exchanged through the mailbox that its SII
    /// has for that.
    pub fn enter_boot(&mut self, position: u16) -> Result<(), SetUpError> {
        let target = self.target(position)?;
        let subdevice = self.subdevice(position)?;
        // Where its mailbox in BOOT is stands in the EEPROM, too.
        if let Some(cause) = &subdevice.broken {
            return Err(SetUpError::Broken { position, cause: cause.clone() });
        }
        let config = boot_mailbox(position, &subdevice.sii.header)?;
        let count = subdevice.esc.sync_manager_count;
        let managers = sync_manager::from_sii(&subdevice.sii, Some(config), count);
        let registers: Vec<u8> = managers.iter().take(2).flat_map(SyncManager::registers).collect();
        let mailbox =
            Mailbox::new(target.station, config).map_err(|cause| SetUpError::Mailbox { position, cause })?;
        self.change_state(position, AlState::Init)?;
        let off = alloc::vec![0; usize::from(register::SM_SIZE) * usize::from(count)];
        self.transactor.perform(&mut [Access::write(
            "switching the SyncManagers off",
            target,
            register::SM,
            &off,
        )])?;
        self.transactor.perform(&mut [
            Access::write("the mailboxes in BOOT", target, register::SM, &registers),
            Access::write("giving the EEPROM to the application", target, register::SII_CONFIG, &[1]),
        ])?;
        self.change_state(position, AlState::Bootstrap)?;
        self.mailboxes.resize(self.subdevices.len(), None);
        self.mailboxes[usize::from(position)] = Some(mailbox);
        Ok(())
    }

    /// Brings it back to INIT.
    pub fn leave_boot(&mut self, position: u16) -> Result<(), SetUpError> {
        if let Some(mailbox) = self.mailboxes.get_mut(usize::from(position)) {
            *mailbox = None;
        }
        self.change_state(position, AlState::Init)
    }

    fn change_state(&mut self, position: u16, state: AlState) -> Result<(), SetUpError> {
        let timeout = self.options.timeouts.of(state);
        let application: Application = self.subdevice(position)?.application;
        let change = StateChange::new(self.target(position)?, application, state, timeout);
        for result in self.transactor.drive(&mut [change])? {
            result?;
        }
        Ok(())
    }

    /// Reads or writes a file through the mailbox of the SubDevice at `position`, which is in BOOT or PRE-OP; what was
    /// read. `progress` is told now and then how many bytes were carried.
    pub fn transfer_file(
        &mut self,
        position: u16,
        request: MailboxRequest,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Vec<u8>, SetUpError> {
        let operation = request.operation;
        let failed = |cause| SetUpError::Request { position, operation, cause };
        let now = self.transactor.clock.now();
        self.target(position)?;
        let Some(mailbox) = self.mailboxes.get_mut(usize::from(position)).and_then(Option::as_mut) else {
            let (state, lacks) = (AlState::PreOp, "it has no mailbox");
            return Err(SetUpError::NoFiles { position, state, lacks });
        };
        if mailbox.is_busy() {
            mailbox.cancel();
            let _ = mailbox.next(now);
        }
        if mailbox.start(request, now).is_err() {
            return Err(failed(MailboxError::Reset));
        }
        let completion = self.transactor.drive(&mut [Watched { mailbox, progress }])?.pop().flatten();
        match completion {
            Some(Completion { request, result }) => result.map(|()| request.data).map_err(failed),
            None => Err(failed(MailboxError::Reset)),
        }
    }
}

/// The mailbox in BOOT; an error says what the SII lacks.
fn boot_mailbox(position: u16, header: &sii::Header) -> Result<MailboxConfig, SetUpError> {
    let areas = header.bootstrap_mailbox;
    let no_files = |lacks| SetUpError::NoFiles { position, state: AlState::Bootstrap, lacks };
    if header.mailbox_protocols & sii::PROTOCOL_FOE == 0 {
        return Err(no_files("its SII names no FoE among the mailbox protocols (word 0x1c)"));
    }
    if areas.receive_size == 0 || areas.send_size == 0 {
        return Err(no_files("its SII has no mailbox for BOOT (words 0x14 to 0x17)"));
    }
    Ok(MailboxConfig {
        write: MemoryArea { start: areas.receive_offset, length: areas.receive_size },
        read: MemoryArea { start: areas.send_offset, length: areas.send_size },
        protocols: sii::PROTOCOL_FOE,
        answer_timeout: DEFAULT_TIMEOUT,
    })
}

/// A mailbox of which is told how far it is.
struct Watched<'a> {
    mailbox: &'a mut Mailbox,
    progress: &'a mut dyn FnMut(usize),
}

impl Procedure for Watched<'_> {
    type Output = Option<Completion>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        self.mailbox.next(now)
    }

    fn fill(&self, data: &mut [u8]) {
        self.mailbox.fill(data);
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        self.mailbox.answer(answer, now);
        if let Some(bytes) = self.mailbox.file_bytes() {
            (self.progress)(bytes);
        }
    }
}
