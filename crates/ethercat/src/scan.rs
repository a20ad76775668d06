//! Finding the SubDevices: reset, count, addresses, controllers, EEPROMs, topology.

use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use crate::address_range;
use crate::bus::{Bus, MAX_SUBDEVICES, Warning};
use crate::clock_setup;
use crate::config::SubDeviceConfig;
use crate::eeprom::{EepromError, EepromFailure, SiiExtent, SiiReader};
use crate::error::{NoSubDevices, SetUpError};
use crate::found::{AccessError, Found};
use crate::start_up::StartUpList;
use crate::state::{Application, StateChange};
use crate::subdevice::{DcClock, DcWidth, Esc, Port, SubDevice};
use crate::topology::{self, TopologyError};
use crate::transaction::{Access, Expect, Target};
use crate::trouble;
use crate::wire::bytes::{u16_at, u32_at};
use crate::wire::sii::{self, Image};
use crate::wire::{AlState, Clock, Link, LinkError, register};

/// DL status: the EEPROM was loaded, and the processor is served.
const EEPROM_LOADED: u16 = 1;
/// What an EEPROM is whose checksum is wrong.
const WRONG_CHECKSUM: &str = "the checksum of its EEPROM is wrong: it was left half-written, or never written right; write \
                              the whole (`omnibase eeprom write`)";
/// What an EEPROM is that nobody wrote yet.
const ERASED: &str =
    "its EEPROM is erased: write its maker's image (`omnibase eeprom write --other-product`)";
/// What a chip is whose EEPROM was made right behind its power-on, or came too late.
const NOT_LOADED: &str = "its EEPROM is right and its chip didn't load it: power it off and on";
/// Counts that must agree one after another, and how often that is tried.
const COUNT_ATTEMPTS: u32 = 10;
/// Pause after the ports were opened: a link needs it to be taken into the path of frames.
const PORT_PAUSE: Duration = Duration::from_millis(2);

/// Loop control (0x0101): port 1, by which the last SubDevice of a ring leads to the redundant interface, closed.
const RING_PORT_CLOSED: u8 = 0x0C;

/// What stands for an EEPROM that doesn't answer: no identity, no mailbox, no category.
const BLANK_IMAGE: [u8; sii::HEADER + 2] = {
    let mut image = [0; sii::HEADER + 2];
    // Checksum of seven words of zero.
    image[14] = 0x30;
    image[sii::HEADER] = 0xFF;
    image[sii::HEADER + 1] = 0xFF;
    image
};

/// What an EEPROM is that is missing or dead.
fn unreadable(EepromError { word, cause, .. }: &EepromError) -> String {
    format!(
        "its EEPROM can't be read (word 0x{word:04x}: {cause}): power it off and on; where that doesn't help, its EEPROM is dead"
    )
}

/// What the controllers' registers said of one SubDevice.
struct Identified {
    target: Target,
    esc: Esc,
    alias: Option<u16>,
    ports: [Port; 4],
    application: Application,
    /// Its EEPROM was loaded; else nobody ever hears its requests.
    is_loaded: bool,
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Resets the whole segment to INIT and finds out what is there. Any earlier knowledge is dropped.
    pub fn scan(&mut self) -> Result<&[SubDevice], SetUpError> {
        self.subdevices.clear();
        self.warnings.clear();
        self.counters_before.clear();
        match self.find_all() {
            Err(SetUpError::Link(LinkError::Down)) => Err(SetUpError::NoSubDevices(NoSubDevices::LinkDown)),
            Err(other) => Err(other),
            Ok(()) => Ok(&self.subdevices),
        }
    }

    fn find_all(&mut self) -> Result<(), SetUpError> {
        self.count()?;
        self.open_ports()?;
        let count = self.count()?;
        self.keep_counters(count)?;
        self.reset_to_init(count)?;
        if self.transactor.link.ring().is_some() {
            self.turn_at(count - 1)?;
        }
        let targets = self.give_addresses(count)?;
        let identified = self.identify(&targets)?;
        self.wait_for_init(&identified)?;
        self.reset_registers(&identified)?;
        let ports: Vec<_> = identified.iter().map(|one| one.ports).collect();
        self.find_swapped(&identified)?;
        let parents = topology::find_parents(&ports)?;
        let images = self.read_images(&targets)?;
        for ((one, (image, broken)), parent) in identified.into_iter().zip(images).zip(parents) {
            let broken = broken.or_else(|| (!one.is_loaded).then(|| NOT_LOADED.to_owned()));
            let entry_port = topology::entry_port(&one.ports);
            if entry_port != 0 {
                let position = one.target.position;
                self.warnings.push(Warning::EntersAtPort { position, port: entry_port });
            }
            self.subdevices.push(SubDevice {
                position: one.target.position,
                station_address: one.target.station,
                alias: one.alias,
                identification: None,
                identity: image.header.identity,
                name: image.name().unwrap_or_default(),
                esc: one.esc,
                application: one.application,
                ports: one.ports,
                entry_port,
                parent,
                mailbox: None,
                coe_details: image.general.as_ref().map_or(0, |general| general.coe_details),
                sii: image,
                sync_managers: Vec::new(),
                fmmus: Vec::new(),
                lrw_allowed: false,
                dc: DcWidth::of(&one.esc).map(DcClock::new),
                config: SubDeviceConfig::default(),
                start_up: StartUpList::default(),
                broken,
            });
        }
        self.read_identifications()?;
        self.warn_of_duplicates();
        Ok(())
    }

    /// How many SubDevices answer, counted until two counts agree; an error where nobody does. They are left as they are.
    pub fn count(&mut self) -> Result<u16, SetUpError> {
        let before = self.transactor.counters;
        let mut last = None;
        for _ in 0..COUNT_ATTEMPTS {
            let mut found = None;
            let read = Access::broadcast_read("counting", register::TYPE, 1, Expect::Any);
            match self.transactor.perform_one(read) {
                Ok(Access { found: Found::WorkingCounter(count), .. }) => found = Some(count),
                Ok(_) | Err(SetUpError::Access(_)) => {}
                Err(other) => return Err(other),
            }
            match found {
                Some(count) if count > MAX_SUBDEVICES => {
                    return Err(SetUpError::TooManySubDevices { limit: MAX_SUBDEVICES, found: count });
                }
                Some(count) if count > 0 && last == found => return Ok(count),
                None if last.is_none() => break,
                _ => last = found,
            }
        }
        let counters = self.transactor.counters;
        Err(match last {
            Some(0) => SetUpError::NoSubDevices(NoSubDevices::Unanswered),
            Some(last) => SetUpError::UnstableCount { last, attempts: COUNT_ATTEMPTS },
            None if counters.reflected > before.reflected => {
                SetUpError::NoSubDevices(NoSubDevices::Reflected)
            }
            None if counters.foreign > before.foreign => {
                SetUpError::NoSubDevices(NoSubDevices::AnotherMainDevice)
            }
            None => SetUpError::NoSubDevices(NoSubDevices::NothingBack),
        })
    }

    /// Opens the loops: what a MainDevice before this one closed is part of the segment.
    fn open_ports(&mut self) -> Result<(), SetUpError> {
        let open = "opening the ports";
        self.transactor.perform(&mut [Access::broadcast_write(
            open,
            register::DL_CONTROL_PORTS,
            &[0],
            Expect::AtLeast(1),
        )])?;
        self.transactor.pause(PORT_PAUSE);
        Ok(())
    }

    /// Has frames turn at the last SubDevice of a ring while it is set up: only what comes back the way it went
    /// measures propagation delays. [`Bus::into_cyclic`] closes the ring.
    fn turn_at(&mut self, last: u16) -> Result<(), SetUpError> {
        self.transactor.perform(&mut [Access::write_at(
            "opening the ring",
            last,
            register::DL_CONTROL_PORTS,
            &[RING_PORT_CLOSED],
        )])?;
        self.transactor.pause(PORT_PAUSE);
        Ok(())
    }

    /// What the error counters show before they are cleared: damage that comes now and then was counted there.
    fn keep_counters(&mut self, count: u16) -> Result<(), SetUpError> {
        let what = "reading the error counters";
        let length = trouble::COUNTERS;
        let all = Access::broadcast_read(what, register::RX_ERROR_COUNTERS, length, Expect::Any);
        // All of them, or-ed: zeros nearly always. Nothing of this is worth a scan that fails.
        match self.transactor.perform_one(all) {
            Ok(all) if all.data.iter().any(|byte| *byte != 0) => {}
            Ok(_) | Err(SetUpError::Access(_)) => return Ok(()),
            Err(other) => return Err(other),
        }
        for position in 0..count {
            let read = Access::read_at(what, position, register::RX_ERROR_COUNTERS, length);
            self.counters_before.push(match self.transactor.perform_one(read) {
                Ok(Access { data, .. }) => data,
                Err(SetUpError::Access(_)) => Vec::new(),
                Err(other) => return Err(other),
            });
        }
        Ok(())
    }

    /// Everything that every controller has.
    fn reset_to_init(&mut self, count: u16) -> Result<(), SetUpError> {
        let all = Expect::Exactly(count);
        let init_and_acknowledge = (AlState::Init.bits() | AlState::ERROR).to_le_bytes();
        let init = AlState::Init.bits().to_le_bytes();
        let write = Access::broadcast_write;
        self.ask_for_init(&init_and_acknowledge, count)?;
        self.transactor.perform(&mut [
            write("opening the ports", register::DL_CONTROL_PORTS, &[0], all),
            write("switching the alias off", register::DL_CONTROL_ALIAS, &[0], all),
            write("masking events", register::ECAT_EVENT_MASK, &[0, 0], all),
            write("clearing the error counters", register::RX_ERROR_COUNTERS, &[0; 8], all),
            // Not every chip has these.
            write("clearing the lost-link counters", register::LOST_LINK_COUNTERS, &[0; 4], Expect::Any),
        ])?;
        // Then without the acknowledge bit, so that its echo in an emulated status is gone again.
        self.ask_for_init(&init, count)?;
        for value in [2, 0] {
            self.transactor.perform(&mut [write(
                "taking the EEPROM",
                register::SII_CONFIG,
                &[value],
                all,
            )])?;
        }
        Ok(())
    }

    /// INIT for all. Who takes no request has a processor that has yet to read the one before: it is asked again as long as INIT
    /// may take. Behind a chip that didn't load its EEPROM none ever reads it, and such a device is there all the same.
    fn ask_for_init(&mut self, request: &[u8], count: u16) -> Result<(), SetUpError> {
        const WHAT: &str = "asking for INIT";
        let all = Access::broadcast_write(WHAT, register::AL_CONTROL, request, Expect::Exactly(count));
        match self.transactor.perform_one(all) {
            // Some didn't take it: one by one.
            Err(SetUpError::Access(AccessError { found: Found::WorkingCounter(taken), .. }))
                if taken < count => {}
            other => return other.map(drop),
        }
        let deadline = self.transactor.clock.now() + self.options.timeouts.init;
        for position in 0..count {
            let ask = || Access::write_at(WHAT, position, register::AL_CONTROL, request);
            loop {
                match self.transactor.perform_one(ask()) {
                    Err(SetUpError::Access(AccessError { found: Found::WorkingCounter(0), .. })) => {}
                    other => break other.map(drop)?,
                }
                let read = Access::read_at("reading DL status", position, register::DL_STATUS, 2);
                if u16_at(&self.transactor.perform_one(read)?.data, 0) & EEPROM_LOADED == 0 {
                    break;
                }
                if self.transactor.clock.now() >= deadline {
                    return Err(SetUpError::NoFirmware { position });
                }
            }
        }
        Ok(())
    }

    fn give_addresses(&mut self, count: u16) -> Result<Vec<Target>, SetUpError> {
        let read = |what, position| Access::read_at(what, position, register::STATION_ADDRESS, 2);
        let mut before: Vec<_> =
            (0..count).map(|position| read("reading the station address", position)).collect();
        self.transactor.perform(&mut before)?;
        let taken = before.iter().map(|read| u16_at(&read.data, 0));
        let is_fresh = taken.clone().all(|station| station == 0);
        let clock = &self.transactor.clock;
        let chance = clock.chance().unwrap_or(if is_fresh { 0 } else { clock.now().0 });
        let first = address_range::first_station(taken, count, chance);
        let targets: Vec<Target> =
            (0..count).map(|position| Target { position, station: first + position }).collect();
        let mut writes: Vec<_> = targets
            .iter()
            .map(|target| {
                let station = target.station.to_le_bytes();
                Access::write_at(
                    "giving the station address",
                    target.position,
                    register::STATION_ADDRESS,
                    &station,
                )
            })
            .collect();
        self.transactor.perform(&mut writes)?;
        let mut reads: Vec<_> =
            targets.iter().map(|target| read("reading the station address back", target.position)).collect();
        self.transactor.perform(&mut reads)?;
        for (target, read) in targets.iter().zip(&reads) {
            let found = u16_at(&read.data, 0);
            if found != target.station {
                let (position, expected) = (target.position, target.station);
                return Err(SetUpError::StationAddress { position, expected, found });
            }
        }
        Ok(targets)
    }

    fn identify(&mut self, targets: &[Target]) -> Result<Vec<Identified>, SetUpError> {
        const READS: usize = 4;
        let mut reads = Vec::with_capacity(targets.len() * READS);
        for &target in targets {
            reads.push(Access::read("reading the controller's type", target, register::TYPE, 10));
            reads.push(Access::read("reading the alias", target, register::STATION_ALIAS, 2));
            reads.push(Access::read("reading DL status", target, register::DL_STATUS, 2));
            reads.push(Access::read("reading the configuration", target, register::ESC_CONFIGURATION, 1));
        }
        self.transactor.perform(&mut reads)?;
        let mut identified = Vec::with_capacity(targets.len());
        for (&target, reads) in targets.iter().zip(reads.chunks_exact(READS)) {
            let esc = Esc::read(&reads[0].data).unwrap_or_default();
            let emulated = reads[3].data[0] & 1 != 0;
            identified.push(Identified {
                target,
                esc,
                alias: Some(u16_at(&reads[1].data, 0)).filter(|&alias| alias != 0),
                ports: topology::read_ports(esc.port_descriptor, u16_at(&reads[2].data, 0)),
                is_loaded: u16_at(&reads[2].data, 0) & EEPROM_LOADED != 0,
                application: if emulated { Application::Emulated } else { Application::Controller },
            });
        }
        Ok(identified)
    }

    fn wait_for_init(&mut self, identified: &[Identified]) -> Result<(), SetUpError> {
        let timeout = self.options.timeouts.init;
        let mut changes: Vec<_> = identified
            .iter()
            .filter(|one| one.is_loaded)
            .map(|one| StateChange::new(one.target, one.application, AlState::Init, timeout))
            .collect();
        for result in self.transactor.drive(&mut changes)? {
            result?;
        }
        Ok(())
    }

    /// Everything of which not every controller has the same: the working counters are known by now.
    fn reset_registers(&mut self, identified: &[Identified]) -> Result<(), SetUpError> {
        let having = |has: &dyn Fn(&Esc) -> bool| {
            Expect::AtLeast(identified.iter().filter(|one| has(&one.esc)).count() as u16)
        };
        let mut writes = Vec::new();
        let mut write = |what, register, data: &[u8], expect| {
            if expect != Expect::AtLeast(0) {
                writes.push(Access::broadcast_write(what, register, data, expect));
            }
        };
        for number in 0..16u16 {
            let expect = having(&|esc| u16::from(esc.fmmu_count) > number);
            write("clearing an FMMU", register::FMMU + number * register::FMMU_SIZE, &[0; 16], expect);
        }
        for number in 0..16u16 {
            let expect = having(&|esc| u16::from(esc.sync_manager_count) > number);
            write("clearing a SyncManager", register::SM + number * register::SM_SIZE, &[0; 8], expect);
        }
        let clocks = having(&|esc| esc.has(register::FEATURE_DC));
        write("switching SYNC off", register::DC_ACTIVATION, &[0], clocks);
        write("clearing SYNC0's cycle", register::DC_SYNC0_CYCLE, &[0; 4], clocks);
        write("clearing the clock's offset", register::DC_SYSTEM_TIME_OFFSET, &[0; 8], clocks);
        write("clearing the clock's delay", register::DC_SYSTEM_TIME_DELAY, &[0; 4], clocks);
        write("setting the clock's filters", register::DC_FILTER_DEPTHS, &0x0C00u16.to_le_bytes(), clocks);
        write(
            "starting the clock's control",
            register::DC_SPEED_COUNTER_START,
            &0x1000u16.to_le_bytes(),
            clocks,
        );
        self.transactor.perform(&mut writes)
    }

    /// Cables that are swapped in the middle of the segment: ports alone don't show them, and the tree would be another one.
    fn find_swapped(&mut self, identified: &[Identified]) -> Result<(), SetUpError> {
        let clocks: Vec<&Identified> =
            identified.iter().filter(|one| DcWidth::of(&one.esc).is_some()).collect();
        if clocks.is_empty() {
            return Ok(());
        }
        let latch = clock_setup::latch(clocks.len());
        self.transactor.perform_one(latch)?;
        let read = |one: &&Identified| {
            Access::read("reading the receive times", one.target, register::DC_RECEIVE_TIMES, 16)
        };
        let mut reads: Vec<Access> = clocks.iter().map(read).collect();
        self.transactor.perform(&mut reads)?;
        for (one, read) in clocks.iter().zip(&reads) {
            let times_ns = core::array::from_fn(|port| u32_at(&read.data, 4 * port));
            if let Some(port) = topology::swapped_port(&one.ports, times_ns) {
                let position = one.target.position;
                return Err(TopologyError::Swapped { position, port, alias: one.alias }.into());
            }
        }
        Ok(())
    }

    fn read_images(&mut self, targets: &[Target]) -> Result<Vec<(Image, Option<String>)>, SetUpError> {
        let mut readers: Vec<_> =
            targets.iter().map(|&target| SiiReader::new(target, SiiExtent::Needed)).collect();
        let mut images = Vec::with_capacity(targets.len());
        let results = self.transactor.drive(&mut readers)?;
        for ((result, reader), target) in results.into_iter().zip(&readers).zip(targets) {
            let position = target.position;
            let (bytes, broken) = match result {
                // A device whose EEPROM is missing, dead or erased is still there; it has no identity.
                Err(
                    error @ EepromError {
                        cause: EepromFailure::NotAcknowledged { .. } | EepromFailure::Busy(_),
                        ..
                    },
                ) => {
                    self.warnings.push(Warning::NoEeprom(error));
                    (&BLANK_IMAGE[..], Some(unreadable(&error)))
                }
                other => {
                    other?;
                    match reader.image() {
                        image if image.iter().take(sii::HEADER).all(|byte| *byte == 0xFF) => {
                            self.warnings.push(Warning::ErasedEeprom { position });
                            (&BLANK_IMAGE[..], Some(ERASED.to_owned()))
                        }
                        image => (image, None),
                    }
                }
            };
            let (image, problems) =
                Image::parse(bytes).map_err(|cause| SetUpError::Sii { position, cause })?;
            let warnings = problems.into_iter().map(|problem| Warning::Eeprom { position, problem });
            self.warnings.extend(warnings);
            // Whoever writes an EEPROM makes its checksum right last.
            let is_whole = image.header.checksum as u8 == image.header.computed_checksum();
            let broken = broken.or_else(|| (!is_whole).then(|| WRONG_CHECKSUM.to_owned()));
            images.push((image, broken));
        }
        Ok(images)
    }

    fn warn_of_duplicates(&mut self) {
        for (alias, positions) in self.shared(|one| one.alias) {
            self.warnings.push(Warning::DuplicateAlias { alias, positions });
        }
        for (identification, positions) in self.shared(|one| one.identification) {
            self.warnings.push(Warning::DuplicateIdentification { identification, positions });
        }
    }

    /// Numbers that several SubDevices have, and who.
    fn shared(&self, number: impl Fn(&SubDevice) -> Option<u16>) -> BTreeMap<u16, Vec<u16>> {
        let mut having: BTreeMap<u16, Vec<u16>> = BTreeMap::new();
        for one in &self.subdevices {
            if let Some(number) = number(one) {
                having.entry(number).or_default().push(one.position);
            }
        }
        having.retain(|_, positions| positions.len() > 1);
        having
    }
}
