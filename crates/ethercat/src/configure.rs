//! From what was found and what is asked to SubDevices in PRE-OP, ready for SAFE-OP.

use alloc::string::String;
use alloc::vec::Vec;

use crate::bus::{Bus, Unusable, Warning};
use crate::clock_setup;
use crate::config::{DcConfig, ExpectedIdentity, LrwPermission, Match, Presence, SubDeviceConfig};
use crate::error::{Mismatch, SetUpError};
use crate::fmmu;
use crate::image::{ClockUse, CycleFit, ImagePlan, Member, PlanError};
use crate::mailbox::{Mailbox, MailboxError, Operation, UnusableMailbox};
use crate::mapping::{self, MappingReader};
use crate::mismatch::quoted;
use crate::start_up::{Refusal, StartUpError, StartUpFailure, StartUpRunner, StartUpStep};
use crate::state::StateTimeouts;
use crate::subdevice::{Activation, SubDevice, SyncManager};
use crate::sync_manager::{self, ACTIVATE};
use crate::watchdog;
use crate::wire::sii::{self, Identity, SyncManagerUsage};
use crate::wire::{AlState, Clock, Link, register};

fn is_expected(expected: &ExpectedIdentity, found: &Identity) -> bool {
    let same = |expected: Option<u32>, found| expected.is_none_or(|expected| expected == found);
    same(expected.vendor_id, found.vendor_id)
        && same(expected.product_code, found.product_code)
        && same(expected.revision, found.revision)
        && same(expected.serial, found.serial)
}

/// Whether the SubDevice that a configuration is for is there, as far as it is known by a name of its own.
fn is_there(subdevices: &[SubDevice], config: &SubDeviceConfig) -> bool {
    match config.place {
        Some(Match::Alias(alias)) => subdevices.iter().any(|one| one.alias == Some(alias)),
        Some(Match::Identification(number)) => {
            subdevices.iter().any(|one| one.identification == Some(number))
        }
        Some(Match::Position(position)) => usize::from(position) < subdevices.len(),
        None => true,
    }
}

/// The configurations of those who have to be there, and of the hot-connect groups that are; a group is there as a whole.
fn present<'a>(
    subdevices: &[SubDevice],
    configs: &'a [SubDeviceConfig],
) -> Result<Vec<&'a SubDeviceConfig>, Mismatch> {
    let mut present = Vec::with_capacity(configs.len());
    for config in configs {
        let Presence::Group(group) = &config.presence else {
            present.push(config);
            continue;
        };
        let members = || configs.iter().filter(|other| other.presence == config.presence);
        let there = members().filter(|other| is_there(subdevices, other)).count();
        if there == 0 {
            continue;
        }
        if let Some(missing) = members().find(|other| !is_there(subdevices, other)) {
            let words = missing
                .name
                .clone()
                .map_or_else(|| alloc::format!("{:?}", missing.place), |name| alloc::format!("`{name}`"));
            return Err(Mismatch::PartOfGroup {
                group: String::from(&**group),
                present: members().filter_map(|one| position_of(subdevices, one)).collect(),
                missing: words,
            });
        }
        present.push(config);
    }
    Ok(present)
}

/// Where the SubDevice of a configuration is, where that is known by a name of its own.
fn position_of(subdevices: &[SubDevice], config: &SubDeviceConfig) -> Option<u16> {
    let is_it = |one: &&SubDevice| match config.place {
        Some(Match::Alias(alias)) => one.alias == Some(alias),
        Some(Match::Identification(number)) => one.identification == Some(number),
        Some(Match::Position(position)) => one.position == position,
        None => false,
    };
    subdevices.iter().find(is_it).map(|one| one.position)
}

/// The position of the SubDevice that each configuration is for.
fn find_places(subdevices: &[SubDevice], configs: &[&SubDeviceConfig]) -> Result<Vec<u16>, Mismatch> {
    let count = subdevices.len();
    let mut places = Vec::with_capacity(configs.len());
    for (number, config) in (0u16..).zip(configs.iter().copied()) {
        let position = match config.place {
            Some(Match::Alias(alias)) => {
                let having = subdevices.iter().filter(|one| one.alias == Some(alias));
                let positions: Vec<u16> = having.map(|one| one.position).collect();
                match positions[..] {
                    [] => {
                        let found = subdevices.iter().filter_map(|one| one.alias).collect();
                        return Err(Mismatch::NoSuchAlias { alias, found, name: config.name.clone() });
                    }
                    [position] => position,
                    _ => return Err(Mismatch::AmbiguousAlias { alias, positions }),
                }
            }
            Some(Match::Identification(identification)) => {
                let having = subdevices.iter().filter(|one| one.identification == Some(identification));
                let positions: Vec<u16> = having.map(|one| one.position).collect();
                match positions[..] {
                    [position] => position,
                    _ => {
                        let found = subdevices.iter().filter_map(|one| one.identification).collect();
                        let name = config.name.clone();
                        return Err(Mismatch::Identification { identification, positions, found, name });
                    }
                }
            }
            Some(Match::Position(position)) => position,
            None => number,
        };
        if usize::from(position) >= count && configs.len() == count {
            return Err(Mismatch::NoSuchPosition { position, count, name: config.name.clone() });
        }
        if places.contains(&position) {
            return Err(Mismatch::ConfiguredTwice { position });
        }
        if let Some(subdevice) = subdevices.get(usize::from(position))
            && !is_expected(&config.identity, &subdevice.identity)
        {
            return Err(Mismatch::Identity {
                position,
                name: config.name.clone(),
                expected: config.identity,
                found: subdevice.identity,
                elsewhere: subdevices
                    .iter()
                    .find(|one| is_expected(&config.identity, &one.identity))
                    .map(|one| one.position),
            });
        }
        places.push(position);
    }
    if configs.len() != count {
        let unconfigured = subdevices.iter().find(|one| !places.contains(&one.position));
        let missing = (places.iter().zip(configs)).find(|(position, _)| usize::from(**position) >= count);
        let first = match (unconfigured, missing) {
            (Some(one), _) => alloc::format!(
                "SubDevice {} ({}, vendor 0x{:08x}, product 0x{:08x}) has no configuration",
                one.position,
                one.name,
                one.identity.vendor_id,
                one.identity.product_code
            ),
            (None, Some((position, config))) => {
                alloc::format!("SubDevice {position}{} is missing", quoted(&config.name))
            }
            (None, None) => String::new(),
        };
        return Err(Mismatch::Count { expected: configs.len(), found: count, first });
    }
    Ok(places)
}

fn registers(what: &'static str, register: u16, data: &[u8]) -> StartUpStep {
    StartUpStep::Registers { register, data: data.to_vec(), what, refusal: Refusal::IsError }
}

/// Mailbox, SyncManagers and the steps to PRE-OP and in it of one SubDevice.
fn prepare(subdevice: &mut SubDevice, timeouts: StateTimeouts) -> Result<Option<Mailbox>, SetUpError> {
    let (position, config) = (subdevice.position, &subdevice.config);
    let timeout = |state| config.timeouts.of(state).unwrap_or(timeouts.of(state));
    let count = subdevice.esc.sync_manager_count;
    subdevice.mailbox = sync_manager::mailbox_config(&subdevice.sii, config);
    let usable = |cause: UnusableMailbox| SetUpError::Mailbox { position, cause };
    let mailbox = match subdevice.mailbox {
        Some(mailbox) => Some(Mailbox::new(subdevice.station_address, mailbox).map_err(usable)?),
        None => None,
    };
    if let (None, Some(sdo)) = (&mailbox, config.safe_op_sdos.first()) {
        // Those in PRE-OP tell it by themselves; these would only on the way to OP.
        let cause = StartUpFailure::NoMailbox { object: sdo.object, origin: sdo.origin.clone() };
        return Err(StartUpError { position, cause }.into());
    }
    subdevice.sync_managers = sync_manager::from_sii(&subdevice.sii, subdevice.mailbox, count);
    if config.watchdogs.process_data.is_some_and(|steps| steps > 0) {
        sync_manager::watch(&mut subdevice.sync_managers);
    }
    subdevice.fmmus.clear();
    subdevice.lrw_allowed = match config.lrw {
        Some(permission) => permission == LrwPermission::Allowed,
        None => {
            let flags = subdevice.sii.general.as_ref().map_or(0, |general| general.flags);
            !subdevice.esc.has(register::FEATURE_NO_LRW) && flags & sii::FLAG_NO_LRW == 0
        }
    };
    mapping::check_config(position, config, &subdevice.sync_managers, count)?;

    let steps = &mut subdevice.start_up.steps;
    steps.clear();
    // A SubDevice that comes back may be in any state; its SyncManagers take nothing while they are on.
    steps.push(StartUpStep::State { state: AlState::Init, timeout: timeout(AlState::Init) });
    for (what, register, size, count) in [
        ("switching the SyncManagers off", register::SM, register::SM_SIZE, count),
        ("switching the FMMUs off", register::FMMU, register::FMMU_SIZE, subdevice.esc.fmmu_count),
    ] {
        let length = usize::from(size) * usize::from(count);
        if length > 0 {
            steps.push(registers(what, register, &alloc::vec![0; length]));
        }
    }
    if subdevice.mailbox.is_some() {
        let mailboxes: Vec<u8> =
            subdevice.sync_managers.iter().take(2).flat_map(SyncManager::registers).collect();
        steps.push(registers("the mailboxes", register::SM, &mailboxes));
    }
    steps.push(registers("giving the EEPROM to the application", register::SII_CONFIG, &[1]));
    steps.push(StartUpStep::State { state: AlState::PreOp, timeout: timeout(AlState::PreOp) });
    steps.extend(config.sdos.iter().cloned().map(StartUpStep::Sdo));
    steps.extend(mapping::mapping_steps(config));
    if let Some(mode) = config.sync_mode {
        steps.extend(mapping::sync_mode_steps(mode, &subdevice.sync_managers));
    }
    Ok(mailbox)
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Compares the segment with `configs`, brings every SubDevice to PRE-OP, writes what is asked, and makes
    /// everything ready for SAFE-OP. Without any configuration each SubDevice is taken as it describes itself. One that is
    /// [`SubDevice::broken`] is refused, whether it is configured or not: nobody knows who it is.
    pub fn configure(&mut self, configs: &[SubDeviceConfig]) -> Result<(), SetUpError> {
        if configs.is_empty() {
            self.refuse_broken()?;
        } else {
            for (position, config) in self.places(configs)? {
                let subdevice = &mut self.subdevices[usize::from(position)];
                subdevice.config = config.clone();
                if config.dc != DcConfig::Off && subdevice.dc.is_none() {
                    let name = config.name.clone();
                    return Err(Mismatch::NoClock { position, name }.into());
                }
            }
        }
        self.set_up(Unusable::IsError)
    }

    /// Where the SubDevices are that `configs` are for, behind [`Bus::scan`]: of those who have to be there, and of the hot-connect groups
    /// that are. Nothing is asked of the segment; refused is what [`Bus::configure`] refuses.
    pub fn places<'a>(
        &self,
        configs: &'a [SubDeviceConfig],
    ) -> Result<Vec<(u16, &'a SubDeviceConfig)>, SetUpError> {
        self.refuse_broken()?;
        let configs = present(&self.subdevices, configs)?;
        let places = find_places(&self.subdevices, &configs)?;
        Ok(places.into_iter().zip(configs).collect())
    }

    /// What says of itself that it isn't right is believed in nothing else, its identity and alias neither.
    fn refuse_broken(&self) -> Result<(), SetUpError> {
        let mut all = self.subdevices.iter();
        match all.find_map(|one| Some((one.position, one.broken.clone()?))) {
            Some((position, cause)) => Err(SetUpError::Broken { position, cause }),
            None => Ok(()),
        }
    }

    /// Which cycle the segment's frames fit into, behind [`Bus::configure`].
    pub fn cycle_fit(&self) -> Result<CycleFit, PlanError> {
        let members: Vec<Member> = self.subdevices.iter().map(Member::from).collect();
        let clock = match clock_setup::reference_clock(&self.subdevices) {
            Some(one) => ClockUse::Distribute { reference: one.position },
            None => ClockUse::None,
        };
        Ok(ImagePlan::new(&members, clock)?.fit(members.len(), self.propagation))
    }

    /// As [`Bus::configure`] without any configuration, for those who don't need everybody: a SubDevice that can't be
    /// set up is [left out](crate::bus::Warning::LeftOut), with the reason in [`SubDevice::broken`].
    pub fn configure_sound(&mut self) -> Result<(), SetUpError> {
        self.set_up(Unusable::LeftOut)
    }

    fn set_up(&mut self, unusable: Unusable) -> Result<(), SetUpError> {
        self.unusable = unusable;
        self.prepare_lists()?;
        self.run_lists()?;
        self.read_mappings()?;
        self.place_process_data()?;
        self.run_rest()
    }

    /// Leaves the SubDevice out that an error is about, where the others are wanted without it.
    fn without(&mut self, error: impl Into<SetUpError>) -> Result<(), SetUpError> {
        let error = error.into();
        match error.culprit() {
            Some(position) if self.unusable == Unusable::LeftOut => {
                self.leave_out(position, &error);
                Ok(())
            }
            _ => Err(error),
        }
    }

    /// Mailboxes and the steps to PRE-OP and in it.
    fn prepare_lists(&mut self) -> Result<(), SetUpError> {
        let timeouts = self.options.timeouts;
        self.mailboxes.clear();
        let mut unusable = Vec::new();
        for subdevice in &mut self.subdevices {
            // One that is known to be broken needs no attempt.
            if self.unusable == Unusable::LeftOut && subdevice.broken.is_some() {
                subdevice.mailbox = None;
                subdevice.start_up.steps.clear();
                self.mailboxes.push(None);
                continue;
            }
            match prepare(subdevice, timeouts) {
                Ok(mailbox) => self.mailboxes.push(mailbox),
                Err(error) => {
                    self.mailboxes.push(None);
                    unusable.push(error);
                }
            }
        }
        unusable.into_iter().try_for_each(|error| self.without(error))
    }

    /// Runs the lists as they stand.
    fn run_lists(&mut self) -> Result<(), SetUpError> {
        let from = Vec::from_iter(self.subdevices.iter().map(|_| 0));
        self.run_from(&from)
    }

    /// Runs each list from the given step on, all side by side.
    ///
    /// Clock offsets are left out (all are set at once by [`Bus::set_clocks`]), and so is what needs process data.
    fn run_from(&mut self, from: &[usize]) -> Result<(), SetUpError> {
        let mut runners = Vec::with_capacity(self.subdevices.len());
        for ((subdevice, &from), mailbox) in self.subdevices.iter().zip(from).zip(&mut self.mailboxes) {
            let steps = subdevice.start_up.steps.iter().skip(from);
            let steps = steps
                .take_while(|step| !step.needs_cycle())
                .filter(|step| !matches!(step, StartUpStep::ClockOffset { .. }));
            runners.push(StartUpRunner::new(
                subdevice.target(),
                subdevice.application,
                steps.cloned().collect(),
                mailbox.take(),
            ));
        }
        let mut results = self.transactor.drive(&mut runners)?;
        for ((mailbox, runner), result) in self.mailboxes.iter_mut().zip(runners).zip(&mut results) {
            if let Err(StartUpError { cause: StartUpFailure::State { programmed, .. }, .. }) = result {
                *programmed = runner.programmed();
            }
            *mailbox = runner.into_mailbox();
        }
        results.into_iter().filter_map(Result::err).try_for_each(|mut error| {
            self.look_into_slot(&mut error);
            self.without(error)
        })
    }

    /// What is in the slot, where the module that was asked for is refused.
    fn look_into_slot(&mut self, error: &mut StartUpError) {
        if let StartUpError { position, cause: StartUpFailure::Sdo { operation, error, slot, .. } } = error
            && let (Operation::Download { object, .. }, MailboxError::Aborted { .. }) = (operation, error)
        {
            *slot = self.mismatched_slot(*position, *object);
        }
    }

    /// Reads the PDO maps of those that speak CoE; the others have them from their SII.
    fn read_mappings(&mut self) -> Result<(), SetUpError> {
        let mut readers = Vec::new();
        let mut read = Vec::new();
        for (number, subdevice) in self.subdevices.iter().enumerate() {
            let speaks_coe = subdevice.mailbox.is_some_and(|mailbox| mailbox.speaks_coe());
            let managers = subdevice.sync_managers.iter().filter(|manager| manager.direction().is_some());
            let managers: Vec<u8> = managers.map(|manager| manager.index).collect();
            if !speaks_coe || managers.is_empty() {
                continue;
            }
            if let Some(mailbox) = self.mailboxes[number].take() {
                readers.push(MappingReader::new(subdevice.position, mailbox, managers));
                read.push(number);
            }
        }
        let results = self.transactor.drive(&mut readers)?;
        for (&number, reader) in read.iter().zip(readers) {
            self.mailboxes[number] = Some(reader.into_mailbox());
        }
        for (&number, maps) in read.iter().zip(results) {
            let maps = match maps {
                Ok(maps) => maps,
                Err(error) => {
                    self.without(error)?;
                    continue;
                }
            };
            let subdevice = &mut self.subdevices[number];
            for (index, pdos) in maps {
                let Some(mut pdos) = pdos else { continue };
                pdos.iter_mut().for_each(|pdo| sync_manager::name_from_sii(&subdevice.sii, pdo));
                let manager = subdevice.sync_managers.iter_mut().find(|manager| manager.index == index);
                if let Some(manager) = manager {
                    sync_manager::map(manager, pdos);
                }
            }
        }
        self.take_listed_lengths();
        let check =
            |one: &SubDevice| mapping::check_sizes(one.position, &one.config, &one.sync_managers).err();
        let unusable: Vec<_> = self.subdevices.iter().filter_map(check).collect();
        unusable.into_iter().try_for_each(|error| self.without(error))
    }

    /// SyncManagers for which nobody names a PDO, but whose SII names a length: the device expects that length.
    fn take_listed_lengths(&mut self) {
        for subdevice in self.subdevices.iter_mut().filter(|one| one.broken.is_none()) {
            for manager in subdevice.sync_managers.iter_mut().filter(|one| one.direction().is_some()) {
                let listed = subdevice.sii.sync_managers.get(usize::from(manager.index));
                let bytes = listed.filter(|one| one.enable & sii::SM_ENABLE != 0).map_or(0, |one| one.length);
                let is_asked = subdevice.config.pdos.iter().any(|asked| asked.sync_manager == manager.index);
                if bytes == 0 || !manager.pdos.is_empty() || is_asked {
                    continue;
                }
                sync_manager::map(manager, Vec::from([sync_manager::gaps(bytes)]));
                let (position, sync_manager) = (subdevice.position, manager.index);
                self.warnings.push(Warning::NoPdos { position, sync_manager, bytes });
            }
        }
    }

    /// The process image, and the FMMUs that follow from it.
    fn place_process_data(&mut self) -> Result<(), SetUpError> {
        let members: Vec<Member> = self.subdevices.iter().map(Member::from).collect();
        ImagePlan::new(&members, ClockUse::None)?.apply(&mut self.subdevices);
        let mut unusable = Vec::new();
        for subdevice in &mut self.subdevices {
            match fmmu::of_subdevice(subdevice) {
                Ok(fmmus) => subdevice.fmmus = fmmus,
                Err(error) => unusable.push(error),
            }
        }
        unusable.into_iter().try_for_each(|error| self.without(error))
    }

    /// SyncManagers, FMMUs, watchdogs and clocks; then what the cycle does is put at the lists' ends.
    fn run_rest(&mut self) -> Result<(), SetUpError> {
        let from: Vec<usize> = self.subdevices.iter().map(|one| one.start_up.steps.len()).collect();
        for subdevice in self.subdevices.iter_mut().filter(|one| !one.start_up.steps.is_empty()) {
            let steps = &mut subdevice.start_up.steps;
            for manager in &subdevice.sync_managers {
                let is_mailbox =
                    matches!(manager.usage, SyncManagerUsage::MailboxOut | SyncManagerUsage::MailboxIn);
                if !is_mailbox && manager.area.length > 0 && manager.activation != Activation::Never {
                    let register = register::SM + register::SM_SIZE * u16::from(manager.index);
                    steps.push(registers("a SyncManager", register, &manager.registers()));
                }
            }
            for (number, fmmu) in (0..).zip(&subdevice.fmmus) {
                let register = register::FMMU + register::FMMU_SIZE * number;
                steps.push(registers("an FMMU", register, &fmmu.registers()));
            }
            steps.extend(watchdog::steps(&subdevice.config.watchdogs));
        }
        self.run_from(&from)?;
        self.set_clocks()?;
        let timeouts = self.options.timeouts;
        for subdevice in self.subdevices.iter_mut().filter(|one| !one.start_up.steps.is_empty()) {
            let steps = &mut subdevice.start_up.steps;
            if let Some(clock) = &subdevice.dc {
                steps.extend(clock_setup::steps(clock));
            }
            if subdevice.config.dc != DcConfig::Off {
                steps.push(StartUpStep::ArmSync);
            }
            let own = subdevice.config.timeouts;
            let state =
                |state| StartUpStep::State { state, timeout: own.of(state).unwrap_or(timeouts.of(state)) };
            steps.push(state(AlState::SafeOp));
            steps.extend(subdevice.config.safe_op_sdos.iter().cloned().map(StartUpStep::Sdo));
            for index in subdevice.sync_managers.iter().filter_map(SyncManager::op_only) {
                let register = register::SM + register::SM_SIZE * u16::from(index) + ACTIVATE;
                steps.push(registers("switching a SyncManager on", register, &[1]));
            }
            steps.push(state(AlState::Op));
        }
        Ok(())
    }
}
