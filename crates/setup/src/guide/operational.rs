//! The segment in OP for a motion of a set-up.

use std::sync::atomic::AtomicBool;

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::config::{DcConfig, Match, SubDeviceConfig, SyncMode};
use omnibase_ethercat::cyclic::{
    AcyclicCompletion, AcyclicRequest, AcyclicWork, ClockDirection, Goal, Handover, TransitionOptions,
};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions, ProcessImage};
use omnibase_session::session::check_watchdogs;

use super::at_start::{AtStart, MAX_TORQUE};
use super::before::remember;
use super::{AnyBus, Guide, SetupError, in_words, is_it, seen, who};
use crate::drive::DriveMap;
use crate::jog::JOGGED_IN;
use crate::record::FoundDrive;

/// Where a drive says by what it failed; and how long it is waited for that, cycles.
const ERROR_CODE: ObjectAddress = ObjectAddress::new(0x603F, 0);
const ASKING_CYCLES: u32 = 500;
const MODE: ObjectAddress = ObjectAddress::new(0x6060, 0);

/// The segment in OP, every drive disabled.
pub(super) struct Operational<C: Clock> {
    pub(super) paced: PacedBus<Box<dyn Link>, C>,
    pub(super) image: ProcessImage,
    pub(super) maps: Vec<DriveMap>,
}

impl<C: Clock> Operational<C> {
    /// A drive's error code, asked by SDO; `None` where it has none, or doesn't answer.
    pub(super) fn error_code(&mut self, position: u16) -> Result<Option<ErrorCode>, LinkError> {
        let work = AcyclicWork::Mailbox(MailboxRequest::upload(ERROR_CODE, Vec::with_capacity(2)));
        if self.paced.bus_mut().submit(AcyclicRequest { tag: 0, position, work }).is_err() {
            return Ok(None);
        }
        for _ in 0..ASKING_CYCLES {
            self.paced.exchange(&mut self.image)?;
            if let Some(AcyclicCompletion { work: AcyclicWork::Mailbox(answer), result, .. }) =
                self.paced.bus_mut().poll_completion()
            {
                let bytes = answer.data.first_chunk().filter(|_| result.is_ok());
                let error = bytes.map(|bytes| ErrorCode(u16::from_le_bytes(*bytes)));
                return Ok(error.filter(|error| *error != ErrorCode::NONE));
            }
        }
        Ok(None)
    }
}

impl<C: Clock> Guide<'_, C> {
    /// To OP with the maps that the drives have, torques limited before anything else.
    pub(super) fn operational(&mut self) -> Result<Operational<C>, SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().map_err(|error| in_words(&error))?;
        self.are_those_found(&bus)?;
        if remember(&mut self.record) {
            // Nobody could put back what is in no state.
            (self.keep)(&self.record).map_err(SetupError::Unkept)?;
        }
        let cycle_ns = self.wished.cycle.as_nanos() as u32;
        let limit = SdoWrite {
            object: ObjectAddress::new(MAX_TORQUE, 0),
            data: self.wished.torque_per_mille.to_le_bytes().to_vec(),
            access: SdoAccess::Entry,
            refusal: Refusal::IsError,
            read_back: ReadBack::Compare,
            origin: Some("nothing else would hold the drive to a low torque while it is jogged".into()),
        };
        let mode = SdoWrite {
            object: MODE,
            data: vec![JOGGED_IN.code() as u8],
            access: SdoAccess::Entry,
            // Who maps it is told in each cycle.
            refusal: Refusal::IsTolerated,
            read_back: ReadBack::Skip,
            origin: None,
        };
        let config = |found: &SubDevice| {
            let position = found.position;
            let place = Some(Match::Position(position));
            let Some(drive) = self.record.drives.iter().find(|drive| drive.position == position) else {
                let AtStart { pre_op, safe_op, watchdogs } = AtStart::of_device(&self.plan, found);
                return SubDeviceConfig {
                    place,
                    sdos: pre_op,
                    safe_op_sdos: safe_op,
                    watchdogs,
                    ..SubDeviceConfig::default()
                };
            };
            let AtStart { pre_op, safe_op, watchdogs } =
                AtStart::of_drive(&self.plan, drive).of_known(&drive.was);
            SubDeviceConfig {
                place,
                sdos: [vec![limit.clone(), mode.clone()], pre_op].concat(),
                safe_op_sdos: safe_op,
                watchdogs,
                own_bytes: true,
                dc: DcConfig::Sync0 { cycle_ns, shift_ns: 0 },
                sync_mode: Some(SyncMode::Sync0),
                ..SubDeviceConfig::default()
            }
        };
        let configs: Vec<SubDeviceConfig> = bus.subdevices().iter().map(config).collect();
        bus.configure(&configs).map_err(|error| in_words(&error))?;
        check_watchdogs(&mut bus, &self.plan.bus).map_err(|error| in_words(&error))?;
        self.are_in_their_mode(&mut bus)?;
        let handover = bus.into_cyclic(ClockDirection::CycleFollowsDc).map_err(|error| in_words(&error))?;
        let Handover { bus, clock, subdevices } = handover;
        let map = |drive: &FoundDrive| DriveMap::of(&subdevices[usize::from(drive.position)], bus.plan());
        let maps = self
            .record
            .drives
            .iter()
            .map(map)
            .collect::<Result<Vec<_>, _>>()
            .map_err(|error| in_words(&error))?;
        let mut image = bus.plan().image();
        let timeout = self.wished.cycle * 9 / 10;
        let pace =
            Pace { cycle: self.wished.cycle, timeout, leader: Leader::ReferenceClock, sync0_shift_ns: 0 };
        let mut paced = PacedBus::new(bus, clock, pace);
        let never = AtomicBool::new(false);
        paced
            .reach(Goal::Op, TransitionOptions::default(), &never, |paced| {
                paced.exchange(&mut image).map(drop)
            })
            .map_err(|error| in_words(&error))?;
        Ok(Operational { paced, image, maps })
    }

    /// A drive that isn't told its mode in each cycle is in that of a jog by now: in another one it would go where nobody told it,
    /// to position 0 for one.
    fn are_in_their_mode(&self, bus: &mut AnyBus<C>) -> Result<(), SetupError> {
        let wanted = JOGGED_IN.code() as u8;
        for drive in &self.record.drives {
            let one = &bus.subdevices()[usize::from(drive.position)];
            let is_mapped = one
                .process_data(Direction::Outputs)
                .flat_map(|manager| &manager.pdos)
                .flat_map(|pdo| &pdo.entries)
                .any(|entry| (entry.object, entry.bit_length) == (MODE, 8));
            if is_mapped {
                continue;
            }
            let found =
                bus.sdo_read(drive.position, MODE, SdoAccess::Entry).map_err(|error| in_words(&error))?;
            if found != [wanted] {
                return Err(SetupError::Bus(format!(
                    "SubDevice {}: its map has no {MODE}, and it doesn't take mode {wanted} (velocity) by SDO: write a map with it",
                    drive.position
                )));
            }
        }
        Ok(())
    }

    /// Each drive is where it was found: another one in its place would be turned for it.
    pub(super) fn are_those_found(&self, bus: &AnyBus<C>) -> Result<(), SetupError> {
        for was in &self.record.drives {
            let now = bus.subdevices().get(usize::from(was.position)).map(seen);
            if !now.as_ref().is_some_and(|now| is_it(was, now)) {
                let found = now.as_ref().map_or("nobody".to_owned(), who);
                return Err(SetupError::Changed { position: was.position, expected: who(was), found });
            }
        }
        Ok(())
    }
}
