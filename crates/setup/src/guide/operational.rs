//! The segment in OP for a motion of a set-up.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::ProcessImage;
use omnibase_ethercat::config::{SubDeviceConfig, SyncManagerPdos};
use omnibase_ethercat::cyclic::{
    AcyclicCompletion, AcyclicRequest, AcyclicWork, Goal, Handover, TransitionOptions,
};
use omnibase_ethercat::error::SetUpError;
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::paced::{PacedBus, ReachError};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::{Direction, SubDevice};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, Link, LinkError};
use omnibase_robot::config::BusPlan;
use omnibase_session::session::{check_watchdogs, clock_direction, pace, supported_modes};

use super::at_start::{AtStart, MAX_TORQUE, OFFSETS, has};
use super::reading::is_no;
use super::{AnyBus, Guide, SetupError, has_its_numbers, in_words, is_it, seen, who};
use crate::drive::{DriveMap, FIRST_OBJECT, Objects, can_be_jogged, mapped, put_bits};
use crate::jog::{JOGGED_IN, Jogger};
use crate::record::FoundDrive;

/// Where a drive says by what it failed; and how long it is waited for that, cycles.
const ERROR_CODE: ObjectAddress = ObjectAddress::new(0x603F, 0);
const ASKING_CYCLES: u32 = 500;
const MODE: ObjectAddress = ObjectAddress::new(super::at_start::MODE, 0);
const MODE_SHOWN: ObjectAddress = ObjectAddress::new(0x6061, 0);
/// Commands of CiA 402, which are nothing unless a jog gives them: control word; targets, and what is added to them.
const COMMANDS: [u16; 9] = [CONTROL_WORD, 0x6042, 0x60FF, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60C1];
const CONTROL_WORD: u16 = 0x6040;
/// How long a drive has to show its mode, cycles; and how many lie between two looks.
const MODE_CYCLES: u32 = 1000;
const LOOK_CYCLES: u32 = 10;

/// What objects of one drive hold.
type Held = Vec<(ObjectAddress, Vec<u8>)>;
/// What objects of drives hold, by the drive's position.
type Values = BTreeMap<(u16, ObjectAddress), Vec<u8>>;

/// The segment in OP, every drive disabled.
pub(super) struct Operational<C: Clock> {
    pub(super) paced: PacedBus<Box<dyn Link>, C>,
    pub(super) image: ProcessImage,
    pub(super) maps: Vec<DriveMap>,
    /// Outputs while nobody is told anything; what drives map beside what a jog needs is as it was.
    rest: Box<[u8]>,
}

impl<C: Clock> Operational<C> {
    /// One of the drives, to be turned.
    pub(super) fn jogger(&mut self, number: usize) -> Jogger<'_, Box<dyn Link>, C> {
        let Operational { paced, image, maps, rest } = self;
        let (cycle, _) = paced.pace();
        Jogger { paced, image, rest, map: &maps[number], cycle_ns: cycle.as_nanos() as u64 }
    }

    /// Back to INIT.
    pub(super) fn end(&mut self) -> Result<(), ReachError> {
        let Operational { paced, image, .. } = self;
        paced.end(|paced| paced.exchange(image).map(drop))
    }

    /// A drive's error code, asked by SDO; `None` where it has none, or doesn't answer.
    pub(super) fn error_code(&mut self, position: u16) -> Result<Option<ErrorCode>, LinkError> {
        let bytes = self.ask(position, ERROR_CODE)?;
        let error = bytes.and_then(|bytes| Some(ErrorCode(u16::from_le_bytes(*bytes.first_chunk()?))));
        Ok(error.filter(|error| *error != ErrorCode::NONE))
    }

    /// Whether a drive whose map doesn't tell its mode is in that of a jog before anybody enables it; in another one it would go where
    /// nobody told it. An error says in words what it is in.
    pub(super) fn shows_its_mode(
        &mut self,
        number: usize,
        position: u16,
    ) -> Result<Result<(), String>, LinkError> {
        let map = &self.maps[number];
        if map.mode_shown.is_some() {
            return Ok(Ok(()));
        }
        let code = JOGGED_IN.code() as u8;
        if let Some(mode) = &map.mode {
            self.image.outputs[mode.start] = code;
        }
        let (mut shown, mut cycles) = (None, 0);
        while shown.as_deref() != Some(&[code][..]) && cycles < MODE_CYCLES {
            for _ in 0..LOOK_CYCLES {
                self.paced.exchange(&mut self.image)?;
            }
            cycles += LOOK_CYCLES;
            shown = self.ask(position, MODE_SHOWN)?;
        }
        self.image.outputs.copy_from_slice(&self.rest);
        if shown.as_deref() == Some(&[code][..]) {
            return Ok(Ok(()));
        }
        let shown = shown.map_or("nothing".to_owned(), |bytes| super::reading::number(&bytes));
        Ok(Err(format!(
            "SubDevice {position}: it is told mode {code} ({}) and shows {shown} ({MODE_SHOWN}): in another mode it would go where nobody told \
             it; one that shows its mode only when it is enabled needs {MODE_SHOWN} in its map (`inputs` of its drive in the robot's file)",
            JOGGED_IN.abbreviation()
        )))
    }

    /// What a SubDevice has in an object; `None` where it has none, or doesn't answer.
    fn ask(&mut self, position: u16, object: ObjectAddress) -> Result<Option<Vec<u8>>, LinkError> {
        let work = AcyclicWork::Mailbox(MailboxRequest::upload(object, Vec::with_capacity(4)));
        if self.paced.bus_mut().submit(AcyclicRequest { tag: 0, position, work }).is_err() {
            return Ok(None);
        }
        for _ in 0..ASKING_CYCLES {
            self.paced.exchange(&mut self.image)?;
            if let Some(AcyclicCompletion { work: AcyclicWork::Mailbox(answer), result, .. }) =
                self.paced.bus_mut().poll_completion()
            {
                return Ok(result.is_ok().then_some(answer.data));
            }
        }
        Ok(None)
    }
}

impl<C: Clock> Guide<'_, C> {
    /// To OP as every start of the robot does, torques limited before anything else.
    pub(super) fn operational(&mut self) -> Result<Operational<C>, SetupError> {
        let mut bus = self.scanned_as_found()?;
        bus.configure(&[]).map_err(|error| in_words(&error))?;
        self.remember(&mut bus)?;
        let cycle_ns = self.wished.cycle.as_nanos() as u64;
        let bus_plan = BusPlan { cycle_ns, receive_timeout_ns: cycle_ns * 9 / 10, ..self.plan.bus };
        self.configure(&mut bus, &bus_plan)?;
        check_watchdogs(&mut bus, &bus_plan).map_err(|error| in_words(&error))?;
        self.are_in_their_mode(&mut bus)?;
        let as_they_were = self.as_they_were(&mut bus)?;
        let handover = bus.into_cyclic(clock_direction(&bus_plan)).map_err(|error| in_words(&error))?;
        let Handover { bus, clock, subdevices } = handover;
        let found = |drive: &FoundDrive| &subdevices[usize::from(drive.position)];
        let drives = &self.record.drives;
        let maps = drives.iter().map(|drive| DriveMap::of(found(drive), bus.plan()));
        let maps = maps.collect::<Result<Vec<_>, _>>().map_err(|error| in_words(&error))?;
        let mut image = bus.plan().image();
        for one in &subdevices {
            for (entry, bit) in mapped(one, bus.plan(), Direction::Outputs) {
                if let Some(was) = as_they_were.get(&(one.position, entry.object)) {
                    put_bits(&mut image.outputs, bit, entry.bit_length, was);
                }
            }
        }
        let rest = image.outputs.clone();
        let mut paced = PacedBus::new(bus, clock, pace(&bus_plan));
        let never = AtomicBool::new(false);
        paced
            .reach(Goal::Op, TransitionOptions::default(), &never, |paced| {
                paced.exchange(&mut image).map(drop)
            })
            .map_err(|error| in_words(&error))?;
        Ok(Operational { paced, image, maps, rest })
    }

    /// Each drive with the map that it has by itself, or, where that won't do for a jog, with the file's.
    fn configure(&mut self, bus: &mut AnyBus<C>, bus_plan: &BusPlan) -> Result<(), SetupError> {
        let limit = SdoWrite {
            object: ObjectAddress::new(MAX_TORQUE, 0),
            data: self.wished.torque_per_mille.to_le_bytes().to_vec(),
            access: SdoAccess::Entry,
            refusal: Refusal::IsError,
            read_back: ReadBack::Compare,
            origin: Some("nothing else would hold the drive to a low torque while it is jogged".into()),
        };
        // Who maps it is told in each cycle.
        let tolerated = |object, data| SdoWrite {
            object,
            data,
            access: SdoAccess::Entry,
            refusal: Refusal::IsTolerated,
            read_back: ReadBack::Skip,
            origin: None,
        };
        let mode = tolerated(MODE, vec![JOGGED_IN.code() as u8]);
        let offsets = OFFSETS.map(|(index, bytes)| tolerated(ObjectAddress::new(index, 0), vec![0; bytes]));
        let drive_at = |position| self.record.drives.iter().find(|drive| drive.position == position);
        let at_start = |found: &SubDevice| match drive_at(found.position) {
            None => AtStart::of_device(&self.plan, bus_plan, found),
            Some(drive) => {
                let mut all = AtStart::of_drive(&self.plan, bus_plan, drive);
                all.config.sdos =
                    [vec![limit.clone(), mode.clone()], offsets.to_vec(), all.config.sdos].concat();
                all.of_known(&drive.was)
            }
        };
        let (mut configs, maps): (Vec<SubDeviceConfig>, Vec<Vec<SyncManagerPdos>>) =
            bus.subdevices().iter().map(at_start).map(|AtStart { config, maps }| (config, maps)).unzip();
        bus.configure(&configs).map_err(|error| in_words(&error))?;
        let mut given = Vec::new();
        for position in self.record.drives.iter().map(|drive| drive.position) {
            let at = usize::from(position);
            let own = objects(&bus.subdevices()[at]);
            let shows_its_mode = own[1].contains(&(MODE_SHOWN, 8));
            let kept = kept(bus, position).map_err(|error| in_words(&error))?;
            let will_do = can_be_jogged(&own) && shows_its_mode && kept.is_ok();
            if !will_do && can_be_jogged(&wished_objects(&maps[at])) {
                configs[at].pdos.clone_from(&maps[at]);
                given.push(position);
            }
        }
        if given.is_empty() {
            return Ok(());
        }
        bus.configure(&configs).map_err(|error| in_words(&error))?;
        for position in given {
            let text = format!(
                "SubDevice {position}: its own map isn't one for a jog, so it has the file's, as every start of the robot writes it, until it \
                 loses its supply, or for good where it is told to store"
            );
            if !self.record.log.contains(&text) {
                self.hand.tell(&text);
                self.record.note(text);
            }
        }
        Ok(())
    }

    /// A drive has the mode of a jog; one that isn't told it in each cycle is in it by now.
    fn are_in_their_mode(&self, bus: &mut AnyBus<C>) -> Result<(), SetupError> {
        let wanted = JOGGED_IN.code() as u8;
        for position in self.record.drives.iter().map(|drive| drive.position) {
            if let Some(supported) = supported_modes(bus, position).filter(|all| !all.supports(JOGGED_IN)) {
                return Err(SetupError::Bus(format!(
                    "SubDevice {position}: its drive has no {} (0x6502 = {:#010x}), in which it would be jogged: jog it by its maker's tool",
                    JOGGED_IN.abbreviation(),
                    supported.0
                )));
            }
            let [outputs, _] = objects(&bus.subdevices()[usize::from(position)]);
            if outputs.contains(&(MODE, 8)) {
                continue;
            }
            let found = bus.sdo_read(position, MODE, SdoAccess::Entry).map_err(|error| in_words(&error))?;
            if found != [wanted] {
                return Err(SetupError::Bus(format!(
                    "SubDevice {position}: its map has no {MODE}, and it doesn't take mode {wanted} (velocity) by SDO: give its drive in the \
                     robot's file a map with it"
                )));
            }
        }
        Ok(())
    }

    /// What drives hold that they map beside what a jog tells: each frame tells all of it. A drive that turns no wheel keeps its mode
    /// and torque, too.
    fn as_they_were(&self, bus: &mut AnyBus<C>) -> Result<Values, SetupError> {
        let mut values = Values::new();
        for position in 0..bus.subdevices().len() as u16 {
            if let Some(drive) = self.record.drives.iter().find(|drive| drive.position == position) {
                let [outputs, _] = objects(&bus.subdevices()[usize::from(position)]);
                let is_unread = |object: &ObjectAddress| {
                    OFFSETS.iter().any(|(offset, _)| *offset == object.index)
                        && !has(&drive.was, (object.index, object.subindex))
                };
                if let Some(object) = outputs.into_iter().map(|(object, _)| object).find(is_unread) {
                    return Err(unreadable(position, object));
                }
                let kept = kept(bus, position).map_err(|error| in_words(&error))?;
                let kept = kept.map_err(|object| unreadable(position, object))?;
                values.extend(kept.into_iter().map(|(object, was)| ((position, object), was)));
                continue;
            }
            let [outputs, _] = objects(&bus.subdevices()[usize::from(position)]);
            if !outputs.iter().any(|(object, _)| in_first_axis(*object) == CONTROL_WORD) {
                continue;
            }
            for (object, _) in outputs.into_iter().filter(|(object, _)| !is_command(*object)) {
                match bus.sdo_read(position, object, SdoAccess::Entry) {
                    Ok(was) => drop(values.insert((position, object), was)),
                    Err(error) if is_no(&error) => {}
                    Err(error) => return Err(in_words(&error)),
                }
            }
        }
        Ok(values)
    }

    /// Each drive is where it was found: another one in its place would be turned for it.
    pub(super) fn are_those_found(&self, bus: &AnyBus<C>) -> Result<(), SetupError> {
        for was in &self.record.drives {
            let now = bus.subdevices().get(usize::from(was.position)).map(seen);
            // Who turns no wheel may have got an alias since.
            let is_same =
                |now: &FoundDrive| is_it(was, now) || self.is_left_over(was) && has_its_numbers(was, now);
            if !now.as_ref().is_some_and(is_same) {
                let found = now.as_ref().map_or("nobody".to_owned(), who);
                return Err(SetupError::Changed { position: was.position, expected: who(was), found });
            }
        }
        Ok(())
    }
}

/// The objects that a SubDevice maps and their bits: outputs, inputs.
fn objects(one: &SubDevice) -> Objects {
    [Direction::Outputs, Direction::Inputs].map(|direction| {
        let entries =
            one.process_data(direction).flat_map(|manager| &manager.pdos).flat_map(|pdo| &pdo.entries);
        let all = entries.map(|entry| (entry.object, entry.bit_length));
        all.filter(|(object, _)| object.index >= FIRST_OBJECT).collect()
    })
}

/// The same of a map that is wished.
fn wished_objects(maps: &[SyncManagerPdos]) -> Objects {
    [Direction::Outputs, Direction::Inputs].map(|direction| {
        let pdos =
            maps.iter().filter(|manager| manager.direction == direction).flat_map(|manager| &manager.pdos);
        pdos.flat_map(|pdo| pdo.entries.iter().flatten()).copied().collect()
    })
}

/// What a drive holds that it maps beside what a jog tells, or the object that can't be read; an error where it doesn't say anything.
fn kept<C: Clock>(bus: &mut AnyBus<C>, position: u16) -> Result<Result<Held, ObjectAddress>, SetUpError> {
    let [outputs, _] = objects(&bus.subdevices()[usize::from(position)]);
    let is_kept =
        |object: ObjectAddress| !is_command(object) && ![MODE.index, MAX_TORQUE].contains(&object.index);
    let mut kept = Vec::new();
    for (object, bits) in outputs.into_iter().filter(|(object, _)| is_kept(*object)) {
        match bus.sdo_read(position, object, SdoAccess::Entry) {
            Ok(was) if 8 * was.len() >= usize::from(bits) => kept.push((object, was)),
            Err(error) if !is_no(&error) => return Err(error),
            _ => return Ok(Err(object)),
        }
    }
    Ok(Ok(kept))
}

/// Why a drive isn't jogged.
fn unreadable(position: u16, object: ObjectAddress) -> SetupError {
    SetupError::Bus(format!(
        "SubDevice {position}: its map has {object}, and what stands there can't be read, so a jog would write 0 over it: give its drive in \
         the robot's file `outputs` without it, or jog it by its maker's tool"
    ))
}

fn is_command(object: ObjectAddress) -> bool {
    COMMANDS.contains(&in_first_axis(object))
}

/// The index that an object has in the first axis: those of others lie 0x800 apart (CiA 402, multi-axis).
fn in_first_axis(object: ObjectAddress) -> u16 {
    match object.index {
        index @ 0x6000..=0x9FFF => 0x6000 + (index - 0x6000) % 0x800,
        index => index,
    }
}
