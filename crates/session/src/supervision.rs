//! Who is missing, who comes back, and what the bus counts: done in the spare time of cycles, one step each.
//!
//! The supervisor looks at what the cyclic bus knows after each exchange. It names SubDevices that were lost, starts
//! their way back to OP, reads their error counters in turn, and takes their emergencies. It never waits.

mod faults;
mod figures;
mod firmware;
mod health_words;
mod registers;

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use omnibase_cia402::{DriveState, ErrorCode};
use omnibase_ethercat::cyclic::{
    AcyclicCompletion, CAPACITY, Comeback, CycleCounters, CyclicBus, Goal, Health, RecoveryError,
    TransitionStatus,
};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::{HostTime, Link, RingState};
use omnibase_robot::signals::{DriveMeasurement, MAX_DEVICES, MAX_WHEELS};

use crate::words::Words;

use faults::{ERROR_CODE_BYTES, Fault};
use firmware::FirmwareWatch;
use registers::{COUNTERS, ClockDeviation, Look};

pub use figures::{BusFigures, DatagramFigures, SubDeviceFigures};
pub use health_words::HealthWords;

/// The bit in the tags of what others have done beside the cycle; the supervisor's own are without it.
pub const OTHERS: u64 = 1 << 63;
/// Events that wait to be taken.
const MOST_WAITING: usize = 64;
/// After its way back a SubDevice gets so long until the cycle sees it in OP.
const SETTLE: Duration = Duration::from_millis(500);
/// So many exchanges in a row of which nothing comes back are told.
const SILENCE: u64 = 2;
/// Emergencies of the manufacturer's own (CiA 301, table 26).
const OWN_ERROR: u16 = 0xFF00;
/// Pause before another attempt.
const PAUSE: Duration = Duration::from_millis(500);

/// Where one SubDevice is on its way back.
#[derive(Clone, Debug, PartialEq)]
enum RecoveryState {
    /// In OP, or missing for no longer than is tolerated.
    None,
    /// On its way.
    Coming,
    /// Its way ended; the cycle has to see it in OP.
    Settling { until: HostTime, comeback: Comeback },
    /// It failed; the next attempt.
    Waiting { until: HostTime },
}

/// What a SubDevice is to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The drive of a wheel.
    Wheel(usize),
    /// A SubDevice without a wheel, by its place in the robot's file.
    Device(usize),
    /// Nothing.
    Nobody,
}

/// One SubDevice.
#[derive(Debug)]
struct Supervised {
    subdevice: SubDevice,
    /// Its wheel, where it has one.
    wheel: Option<usize>,
    /// Its place among the SubDevices without a wheel, where it is one.
    device: Option<usize>,
    health: Health,
    way: RecoveryState,
    since: HostTime,
    /// Exchanges since it was named.
    exchanges: u32,
    /// Why the last attempt failed; told once.
    failure: Option<RecoveryError>,
    counters: [u8; COUNTERS],
    clock: ClockDeviation,
    faulty: bool,
    fault: Fault,
    /// Its chip's watchdog of its firmware ran at the start.
    is_watched: bool,
    /// Its firmware doesn't run, though its chip is in OP.
    is_hung: bool,
    hung_since: HostTime,
    figures: SubDeviceFigures,
}

/// Looks after all SubDevices of a cyclic bus.
#[derive(Debug)]
pub struct Supervisor {
    all: Vec<Supervised>,
    totals: BusFigures,
    events: VecDeque<Words>,
    events_dropped: u64,
    next_look: HostTime,
    looking_at: usize,
    look: Option<Look>,
    next: Look,
    buffer: Vec<u8>,
    firmware: FirmwareWatch,
    restarted: u16,
    /// What drives said by emergencies, by wheel.
    said: VecDeque<(usize, ErrorCode)>,
    /// Room for an answer.
    error_code: Vec<u8>,
    reference: Option<u16>,
    ring: RingState,
    /// Exchanges in a row that may be incomplete before anything is done.
    tolerated: u32,
    /// SubDevices beyond those that were set up, as the last exchange showed it.
    surplus: u16,
    /// Hot-connect groups that weren't there at the start; empty where all were.
    absent: String,
    /// Since when nothing comes back.
    silent_since: Option<HostTime>,
    /// What was counted when that began.
    counted_before: CycleCounters,
    /// That the interface sees no link was said of this silence.
    link_told: bool,
    /// What others had done beside the cycle, and has ended.
    ended: VecDeque<AcyclicCompletion>,
}

impl Supervisor {
    /// A supervisor of what set-up found; `role_of` tells what a SubDevice is to the robot.
    ///
    /// Who is silent in up to `tolerated` exchanges in a row is named, but neither are its outputs taken from it nor is it
    /// brought back. `absent` names the hot-connect groups that may still come.
    pub fn new(
        subdevices: Vec<SubDevice>,
        tolerated: u32,
        absent: String,
        role_of: impl Fn(&SubDevice) -> Role,
    ) -> Self {
        let supervised = |subdevice: SubDevice| {
            let position = subdevice.position;
            let name = match (&subdevice.config.name, subdevice.name.as_str()) {
                (Some(name), _) => format!("`{name}` (SubDevice {position})"),
                (None, "") => format!("SubDevice {position}"),
                (None, name) => format!("SubDevice {position} ({name})"),
            };
            let role = role_of(&subdevice);
            Supervised {
                wheel: match role {
                    Role::Wheel(wheel) if wheel < MAX_WHEELS => Some(wheel),
                    _ => None,
                },
                device: match role {
                    Role::Device(device) if device < MAX_DEVICES => Some(device),
                    _ => None,
                },
                subdevice,
                health: Health::Operational,
                way: RecoveryState::None,
                since: HostTime(0),
                exchanges: 0,
                failure: None,
                counters: [0; COUNTERS],
                clock: ClockDeviation::Near,
                faulty: false,
                fault: Fault::Told,
                is_watched: false,
                is_hung: false,
                hung_since: HostTime(0),
                figures: SubDeviceFigures { name, ..SubDeviceFigures::default() },
            }
        };
        Supervisor {
            all: subdevices.into_iter().map(supervised).collect(),
            totals: BusFigures::default(),
            events: VecDeque::with_capacity(MOST_WAITING),
            events_dropped: 0,
            next_look: HostTime(0),
            looking_at: 0,
            look: None,
            next: Look::Counters,
            buffer: Vec::with_capacity(COUNTERS),
            firmware: FirmwareWatch::default(),
            restarted: 0,
            said: VecDeque::with_capacity(MOST_WAITING),
            error_code: Vec::with_capacity(ERROR_CODE_BYTES),
            reference: None,
            ring: RingState::Unknown,
            tolerated,
            surplus: 0,
            absent,
            silent_since: None,
            counted_before: CycleCounters::default(),
            link_told: false,
            ended: VecDeque::with_capacity(CAPACITY),
        }
    }

    /// One step after an exchange at `now`.
    pub fn after<L: Link>(&mut self, bus: &mut CyclicBus<L>, now: HostTime) {
        if *bus.transition() != TransitionStatus::Reached(Goal::Op) {
            return;
        }
        self.listen(bus, now);
        self.count_heads(bus);
        self.compare(bus, now);
        while let Some((position, ended)) = bus.poll_recovered() {
            self.recovery_ended(position, ended, now);
        }
        self.start_recovery(bus, now);
        while let Some((position, received)) = bus.take_emergency() {
            self.emergency(position, received.emergency);
        }
        self.look_at_registers(bus, now);
        self.look_at_firmware(bus, now);
        self.ask_for_faults(bus);
        self.watch_reference(bus);
        self.watch_ring(bus.link().ring());
    }

    /// Where the ring is broken, and that it is whole again.
    fn watch_ring(&mut self, ring: Option<RingState>) {
        let Some(state) = ring.filter(|state| self.ring != *state) else { return };
        let before = std::mem::replace(&mut self.ring, state);
        let name = |number: usize| self.all.get(number).map(|one| one.figures.name.as_str());
        let words = match state {
            RingState::Unknown => return,
            RingState::Whole if matches!(before, RingState::Broken { .. }) => {
                "the ring is whole again".into()
            }
            RingState::Whole => return,
            RingState::Broken { before, behind } => {
                let left = usize::from(before).checked_sub(1).and_then(name);
                let left = left.unwrap_or("the primary interface");
                let right = name(usize::from(behind)).unwrap_or("the redundant interface");
                self.totals.ring_breaks += 1;
                Words::new(format_args!("the ring is broken between {left} and {right}"))
            }
        };
        self.say(words);
    }

    /// Whether anything comes back at all.
    fn listen<L: Link>(&mut self, bus: &CyclicBus<L>, now: HostTime) {
        let cycles = bus.nothing_back();
        if cycles >= SILENCE && self.silent_since.is_none() {
            self.silent_since = Some(now);
            self.counted_before = bus.counters();
            self.totals.silences += 1;
            let first = self.all.first().map_or("SubDevice 0", |one| one.figures.name.as_str());
            // That it sees one proves nothing: drivers notice late that it went.
            self.link_told = bus.is_link_down() || bus.link().is_connected() == Some(false);
            let link = if self.link_told { "; the interface sees no link" } else { "" };
            let words = format_args!(
                "nothing behind the interface answers for {cycles} cycles: {first}, its cable or its power{link}"
            );
            self.say(Words::new(words));
        } else if self.silent_since.is_some() && bus.is_link_down() && !self.link_told {
            self.link_told = true;
            self.say("the interface sees no link".into());
        } else if cycles == 0
            && let Some(since) = self.silent_since.take()
        {
            let after = (now - since).as_secs_f64();
            let words = format_args!("something behind the interface answers again after {after:.3} s");
            let (counted, before) = (bus.counters(), self.counted_before);
            let [late, lost] = [counted.late - before.late, counted.frames_lost - before.frames_lost];
            // What comes late was on its way; a few of many may be what waited somewhere for a cable.
            let is_pause = late > 0 && 2 * late >= lost && !self.link_told;
            self.say(match is_pause {
                false => Words::new(words),
                true => {
                    Words::new(format_args!("{words}: frames came late, so who answers was held up ({late})"))
                }
            });
        }
    }

    /// Whether more answer than were set up.
    fn count_heads<L: Link>(&mut self, bus: &CyclicBus<L>) {
        let Some(answered) = bus.status().map(|status| status.answered) else { return };
        let expected = self.all.len() as u16;
        let surplus = answered.saturating_sub(expected);
        let is_new = self.surplus != surplus;
        self.surplus = surplus;
        // Once may be a SubDevice that had begun to answer or ended in the midst of a frame.
        if is_new || u64::from(surplus) == self.totals.surplus {
            return;
        }
        self.totals.surplus = surplus.into();
        self.say(match surplus {
            _ if surplus > 0 && !self.absent.is_empty() => Words::new(format_args!(
                "{answered} SubDevices answer, {expected} were set up: hot-connect group {}? End the robot and start it anew to take \
                 it in",
                self.absent
            )),
            0 => Words::new(format_args!("no more than {expected} SubDevices answer again")),
            _ => Words::new(format_args!(
                "{answered} SubDevices answer, {expected} were set up: {surplus} plugged in since then, left alone; \
                 who loses power now isn't taken back by its position"
            )),
        });
    }

    /// What was lost or came back since the last exchange.
    fn compare<L: Link>(&mut self, bus: &mut CyclicBus<L>, now: HostTime) {
        for number in 0..self.all.len() {
            let Some(&health) = bus.health().get(number) else { continue };
            let one = &mut self.all[number];
            one.exchanges = one.exchanges.saturating_add(1);
            // The cycle may see it in OP a moment before its way is over.
            if one.health == health
                || (one.way == RecoveryState::Coming
                    && health == Health::Operational
                    && !bus.call_off(one.subdevice.position))
            {
                continue;
            }
            let before = std::mem::replace(&mut one.health, health);
            match (before, health) {
                (Health::Operational, _) => {
                    (one.since, one.exchanges, one.clock) = (now, 1, ClockDeviation::Near);
                    one.figures.losses += 1;
                    self.totals.losses += 1;
                    self.tell(number, format_args!("lost: {}", HealthWords(health)));
                }
                (_, Health::Operational) => {
                    // By itself, or at the end of its way.
                    let by_itself = match one.way {
                        RecoveryState::Settling { comeback, .. } => comeback == Comeback::Stayed,
                        _ => true,
                    };
                    one.way = RecoveryState::None;
                    one.failure = None;
                    let after = now - one.since;
                    one.figures.recoveries += 1;
                    self.totals.recoveries += 1;
                    let how = if by_itself { "in OP again by itself" } else { "back in OP" };
                    self.tell(number, format_args!("{how} after {:.3} s", after.as_secs_f64()));
                }
                // What was said of it before is no longer what has to be done.
                (_, Health::NotAlone) => self.tell(number, format_args!("{}", HealthWords(health))),
                _ => {}
            }
        }
        let not_operational =
            self.all.iter().filter(|one| one.is_away() || one.health != Health::Operational);
        self.totals.not_operational = not_operational.count() as u64;
    }

    /// Starts the way back of whoever needs it.
    fn start_recovery<L: Link>(&mut self, bus: &mut CyclicBus<L>, now: HostTime) {
        // Where another answers, too, nobody knows whom a way back would take.
        let is_to_come =
            |one: &&mut Supervised| !matches!(one.health, Health::Operational | Health::NotAlone);
        for one in self.all.iter_mut().filter(is_to_come) {
            let position = one.subdevice.position;
            let due = match one.way {
                // Who says itself that it isn't in OP has left it, whatever is tolerated. Who is silent is named one
                // exchange after the first that it missed.
                RecoveryState::None => {
                    let is_tolerated = one.health == Health::Silent && one.exchanges < self.tolerated;
                    !is_tolerated && bus.is_certain(position)
                }
                RecoveryState::Coming => false,
                RecoveryState::Settling { until, .. } | RecoveryState::Waiting { until } => now >= until,
            };
            if due {
                one.way = if bus.recover(position) {
                    RecoveryState::Coming
                } else {
                    RecoveryState::Waiting { until: now }
                };
            }
        }
    }

    fn recovery_ended(&mut self, position: u16, ended: Result<Comeback, RecoveryError>, now: HostTime) {
        let number = usize::from(position);
        let Some(one) = self.all.get_mut(number) else { return };
        let error = match ended {
            Ok(comeback) => {
                one.way = RecoveryState::Settling { until: now + SETTLE, comeback };
                if comeback == Comeback::Restarted {
                    one.counters = [0; COUNTERS];
                    self.restarted |= one.wheel.map_or(0, |wheel| 1 << wheel);
                }
                return;
            }
            Err(error) => error,
        };
        let nobody = matches!(error, RecoveryError::NotThere { .. });
        one.way = RecoveryState::Waiting { until: if nobody { now } else { now + PAUSE } };
        if !nobody && one.failure.as_ref() != Some(&error) {
            let words = Words::new(format_args!("not taken back: {error}"));
            one.failure = Some(error);
            self.tell(number, format_args!("{words}"));
        }
    }

    fn emergency(&mut self, position: u16, emergency: omnibase_ethercat::wire::coe::Emergency) {
        let number = usize::from(position);
        let Some(one) = self.all.get_mut(number) else { return };
        one.figures.emergencies += 1;
        self.totals.emergencies += 1;
        let omnibase_ethercat::wire::coe::Emergency { code, register, data } = emergency;
        // One of the manufacturer's own carries its alarm in the data.
        let error = if code & 0xFF00 == OWN_ERROR { u16::from_le_bytes([data[0], data[1]]) } else { code };
        self.drive_says(number, ErrorCode(error));
        self.tell(
            number,
            format_args!("emergency 0x{code:04x}, error register 0x{register:02x}, data {data:02x?}"),
        );
    }

    /// Drives that show a fault in their status word.
    pub fn look_at_drives(&mut self, drives: &[DriveMeasurement]) {
        for number in 0..self.all.len() {
            let one = &mut self.all[number];
            let Some(drive) = one.wheel.and_then(|wheel| drives.get(wheel)) else { continue };
            let faulty =
                matches!(drive.status.state(), Some(DriveState::Fault | DriveState::FaultReactionActive));
            if faulty && !std::mem::replace(&mut one.faulty, faulty) {
                one.figures.faults += 1;
                self.totals.drive_faults += 1;
                one.fault = if drive.error == ErrorCode::NONE { Fault::Untold } else { Fault::Told };
                match drive.error {
                    ErrorCode::NONE => self.tell(number, format_args!("drive fault")),
                    error => self.tell(number, format_args!("drive fault, error code {error}")),
                }
            }
            let one = &mut self.all[number];
            one.faulty = faulty;
            if !faulty && one.fault == Fault::Untold {
                one.fault = Fault::Told;
            }
        }
    }

    fn watch_reference<L: Link>(&mut self, bus: &CyclicBus<L>) {
        let reference = bus.clock_use().reference();
        let before = std::mem::replace(&mut self.reference, reference);
        if let (Some(position), true) = (reference, before.is_some() && before != reference) {
            self.totals.reference_changes += 1;
            self.tell(usize::from(position), format_args!("is the reference clock from now on"));
        }
    }

    fn tell(&mut self, number: usize, what: fmt::Arguments<'_>) {
        let name = self.all.get(number).map_or("?", |one| one.figures.name.as_str());
        self.say(Words::new(format_args!("{name}: {what}")));
    }

    fn say(&mut self, words: Words) {
        if self.events.len() < MOST_WAITING {
            self.events.push_back(words);
        } else {
            self.events_dropped += 1;
        }
    }

    /// The next thing that happened.
    pub fn take_event(&mut self) -> Option<Words> {
        if let Some(words) = self.events.pop_front() {
            return Some(words);
        }
        let dropped = std::mem::take(&mut self.events_dropped);
        (dropped > 0).then(|| Words::new(format_args!("{dropped} more events of the bus found no room")))
    }

    /// The next of what a drive said by an emergency: its wheel, and its error.
    pub fn take_said(&mut self) -> Option<(usize, ErrorCode)> {
        self.said.pop_front()
    }

    /// All SubDevices.
    pub fn subdevices(&self) -> impl Iterator<Item = &SubDevice> {
        self.all.iter().map(|one| &one.subdevice)
    }

    /// What somebody else had done beside the cycle by this tag, once it has ended.
    pub fn take_ended(&mut self, tag: u64) -> Option<AcyclicCompletion> {
        let at = self.ended.iter().position(|done| done.tag == tag)?;
        self.ended.remove(at)
    }

    /// Whether the SubDevice at `position` is lost or still on its way back: its outputs have to be safe.
    pub fn is_away(&self, position: u16) -> bool {
        self.all.get(usize::from(position)).is_some_and(Supervised::is_away)
    }

    /// Wheels whose SubDevices are away; bit n for wheel n.
    pub fn away_wheels(&self) -> u16 {
        let away = self.all.iter().filter(|one| one.is_away()).filter_map(|one| one.wheel);
        away.fold(0, |wheels, wheel| wheels | 1 << wheel)
    }

    /// The same of SubDevices without a wheel; bit n for the n-th of the robot's file.
    pub fn away_devices(&self) -> u16 {
        let away = self.all.iter().filter(|one| one.is_away()).filter_map(|one| one.device);
        away.fold(0, |devices, device| devices | 1 << device)
    }

    /// SubDevices without a wheel that aren't operational, away or not; bit n for the n-th of the robot's file.
    pub fn not_operational_devices(&self) -> u16 {
        let devices = self
            .all
            .iter()
            .filter(|one| one.health != Health::Operational || one.is_hung)
            .filter_map(|one| one.device);
        devices.fold(0, |bits, device| bits | 1 << device)
    }

    /// Wheels whose drives started anew since this was last asked; bit n for wheel n.
    pub fn take_restarted(&mut self) -> u16 {
        std::mem::take(&mut self.restarted)
    }

    /// What was counted of all together; what the bus itself counts isn't in it.
    pub fn totals(&self) -> &BusFigures {
        &self.totals
    }

    /// What was counted of each SubDevice.
    pub fn figures(&self) -> impl Iterator<Item = &SubDeviceFigures> {
        self.all.iter().map(|one| &one.figures)
    }
}

impl Supervised {
    /// Lost, on its way back, or without firmware that runs.
    fn is_away(&self) -> bool {
        self.is_on_its_way() || self.is_hung
    }

    fn is_on_its_way(&self) -> bool {
        self.way != RecoveryState::None
    }
}
