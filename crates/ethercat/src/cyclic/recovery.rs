//! Bringing one SubDevice back to OP while all others go on: find, address, identify, replay its start-up list.

use alloc::vec::Vec;
use core::ops::Range;
use core::time::Duration;

use super::transition::{signed_difference, start_time, sync0};
use crate::config::{CyclicControl, DcConfig};
use crate::eeprom::{EepromError, SiiExtent, SiiReader};
use crate::mailbox::Mailbox;
use crate::procedure::{Answer, Next, Procedure, Request};
use crate::start_up::{Refusal, StartUpError, StartUpRunner, StartUpStep};
use crate::subdevice::{DcWidth, SubDevice};
use crate::transaction::Target;
use crate::wire::bytes::{u16_at, u32_at};
use crate::wire::sii::Identity;
use crate::wire::{Address, AlState, Command, DcTime, HostTime, register};

/// How long a SubDevice is looked for at its place.
const SEARCH: Duration = Duration::from_secs(5);
/// Its clock must be nearer to the reference than this before SYNC0 is armed, ns.
const LOCK_LIMIT_NS: u32 = 1000;
/// Looks in a row that must be within the limit.
const LOCK_ROUNDS: u32 = 10;
/// The longest wait for that.
const LOCK_TIMEOUT: Duration = Duration::from_secs(10);
/// SYNC0 has come so many times before OP is asked.
const SYNC_CYCLES: u32 = 10;
/// The longest wait for that.
const SYNC_TIMEOUT: Duration = Duration::from_secs(2);
/// How far ahead of the present the first SYNC0 is put.
const SYNC_MARGIN: Duration = Duration::from_millis(100);

/// Why a SubDevice could not be brought back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecoveryError {
    /// Nobody answers at its place.
    #[error("nobody answers at position {position} after {after:?}")]
    NotThere {
        /// Position.
        position: u16,
        /// How long it was looked for.
        after: Duration,
    },
    /// Another SubDevice stands at its place.
    #[error("at position {position} stands station 0x{found:04x}, 0x{expected:04x} was expected")]
    OtherStation {
        /// Position.
        position: u16,
        /// Station address that it should have, or none.
        expected: u16,
        /// Station address that it has.
        found: u16,
    },
    /// It is another product.
    #[error(
        "at position {position} is vendor 0x{:08x} product 0x{:08x}, vendor 0x{:08x} product 0x{:08x} was there",
        .found.0, .found.1, .expected.0, .expected.1
    )]
    OtherProduct {
        /// Position.
        position: u16,
        /// Vendor and product that were there at first.
        expected: (u32, u32),
        /// Vendor and product now.
        found: (u32, u32),
    },
    /// It is the same product, but another piece: swapped with another, or replaced.
    #[error("at position {position} is the piece with serial number {found}, {expected} was there")]
    OtherPiece {
        /// Position.
        position: u16,
        /// Serial number that was there at first.
        expected: u32,
        /// Serial number now.
        found: u32,
    },
    /// Its EEPROM can't be read.
    #[error(transparent)]
    Eeprom(#[from] EepromError),
    /// A step of its start-up list failed.
    #[error(transparent)]
    StartUp(#[from] StartUpError),
    /// Its clock did not come near enough to the reference.
    #[error("the clock of SubDevice {position} is {difference_ns} ns from the reference after {after:?}")]
    NotLocked {
        /// Position.
        position: u16,
        /// Register 0x092C.
        difference_ns: i32,
        /// How long it was tried.
        after: Duration,
    },
}

/// How a SubDevice was found that is in OP again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comeback {
    /// It still had its station address: it had power all the time, and what it counted goes on.
    KeptPower,
    /// It had to be given its address: it started anew, and so did what it counts.
    Restarted,
}

/// Steps of the list that are run together, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// To INIT, everything off, its EEPROM to the MainDevice.
    Clear,
    /// The start-up list up to where process data must flow, but for the clock.
    SetUp,
    /// Its clock's control loop begins anew at the reference's time.
    Clock,
    /// SYNC0.
    Arm,
    /// SAFE-OP and OP, one at a time.
    Enter,
}

/// The stages.
#[derive(Debug)]
enum Stage {
    /// It is not on its way.
    Rest,
    /// Does it answer at its station address?
    Find,
    /// Who stands at its place?
    Look,
    /// Give it its address.
    Address,
    /// Steps of the list.
    Run(Part),
    /// Is it the same product? Between [`Part::Clear`] and [`Part::SetUp`].
    Identify,
    /// Until its clock agrees: between [`Part::Clock`] and [`Part::Arm`].
    Lock { good: u32, since: HostTime },
    /// Between SAFE-OP and OP: until SYNC0 comes, for a drive in OP without it is in error at once.
    AwaitSync { since: HostTime },
}

/// The way back of one SubDevice, from whatever happened to it to OP, as often as it is needed.
///
/// All its memory is asked for when it is made: the steps, the buffer of its SDOs, and what is read of its EEPROM.
#[derive(Debug)]
pub(super) struct Recovery {
    target: Target,
    identity: Identity,
    sync: DcConfig,
    clock: Option<DcWidth>,
    /// Every step, with the mailbox while it is on its way.
    runner: StartUpRunner,
    /// Which steps belong to each [`Part`].
    parts: [Range<usize>; 5],
    /// The step that writes when SYNC0 comes first.
    start_time: usize,
    /// States of [`Part::Enter`] that are behind it.
    entered: usize,
    reader: SiiReader,
    stage: Stage,
    since: Option<HostTime>,
    time: Option<DcTime>,
    /// When SYNC0 has come a few times.
    synced_at: Option<DcTime>,
    comeback: Comeback,
    outcome: Option<Result<Comeback, RecoveryError>>,
}

fn registers(what: &'static str, register: u16, data: &[u8], refusal: Refusal) -> StartUpStep {
    StartUpStep::Registers { register, data: data.to_vec(), what, refusal }
}

/// To INIT and everything off: what is switched on can't be written, and the list switches on what it needs.
fn clearing(set_up: &[StartUpStep]) -> Vec<StartUpStep> {
    let off = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsTolerated);
    let mut steps = Vec::from([
        StartUpStep::State { state: AlState::Init, timeout: SEARCH },
        off("SYNC off", register::DC_ACTIVATION, &[0]),
        off("taking the EEPROM", register::SII_CONFIG, &[2]),
        off("taking the EEPROM", register::SII_CONFIG, &[0]),
    ]);
    let managers = set_up.iter().filter_map(|step| match step {
        StartUpStep::Registers { register, data, .. } if (0x0800..0x0880).contains(register) => {
            Some((*register, data.len() as u16 / register::SM_SIZE))
        }
        _ => None,
    });
    for (first, count) in managers {
        for number in 0..count {
            steps.push(off("a SyncManager off", first + number * register::SM_SIZE + 6, &[0]));
        }
    }
    steps
}

/// Setting its clock, where the list does.
fn setting_clock(steps: &[StartUpStep]) -> Vec<StartUpStep> {
    // Writing the speed counter's start makes the control loop forget what it was told before.
    let loop_anew = registers(
        "the clock's control loop",
        register::DC_SPEED_COUNTER_START,
        &crate::clock_setup::SPEED_COUNTER_START.to_le_bytes(),
        Refusal::IsTolerated,
    );
    let mut clock: Vec<_> = steps.iter().filter(|step| is_clock(step)).cloned().collect();
    if !clock.is_empty() {
        clock.insert(0, loop_anew.clone());
        // Once more behind the offset: what came between was told to a clock with another time.
        clock.push(loop_anew);
    }
    clock
}

fn is_clock(step: &StartUpStep) -> bool {
    matches!(step, StartUpStep::ClockOffset { .. })
}

/// SYNC0 (and SYNC1) on; the start time, last but one, is still to be filled in.
fn arming(subdevice: &SubDevice) -> Vec<StartUpStep> {
    let config = &subdevice.config;
    let Some((cycle_ns, _)) = sync0(config.dc) else { return Vec::new() };
    let must = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsError);
    let mut steps = Vec::from([must("SYNC off", register::DC_ACTIVATION, &[0])]);
    if config.cyclic_control == CyclicControl::Write {
        let refusal = Refusal::IsTolerated;
        steps.push(registers("the SYNC unit", register::DC_CYCLIC_CONTROL, &[0], refusal));
    }
    steps.push(must("the SYNC0 cycle", register::DC_SYNC0_CYCLE, &cycle_ns.to_le_bytes()));
    let mut activation = 3;
    if let DcConfig::Sync0And1 { sync1_cycle_ns, .. } = config.dc {
        steps.push(must("the SYNC1 cycle", register::DC_SYNC1_CYCLE, &sync1_cycle_ns.to_le_bytes()));
        activation = 7;
    }
    let is_short = subdevice.dc.is_some_and(|dc| dc.width == DcWidth::Bits32);
    let length = if is_short { 4 } else { 8 };
    steps.push(must("the start time", register::DC_START_TIME, &[0; 8][..length]));
    steps.push(must("SYNC on", register::DC_ACTIVATION, &[activation]));
    steps
}

impl Recovery {
    /// The way back of `subdevice` as set-up left it.
    pub fn new(subdevice: &SubDevice) -> Self {
        let list = &subdevice.start_up.steps;
        let (after, before): (Vec<_>, Vec<_>) = list.iter().cloned().partition(StartUpStep::needs_cycle);
        let clock = setting_clock(&before);
        let set_up: Vec<_> = before.into_iter().filter(|step| !is_clock(step)).collect();
        let enter = after.into_iter().filter(|step| !matches!(step, StartUpStep::ArmSync)).collect();
        let mut steps = Vec::new();
        let parts = [clearing(&set_up), set_up, clock, arming(subdevice), enter].map(|part| {
            let first = steps.len();
            steps.extend(part);
            first..steps.len()
        });
        Recovery {
            target: subdevice.target(),
            identity: subdevice.identity,
            sync: subdevice.config.dc,
            clock: subdevice.dc.map(|dc| dc.width),
            runner: StartUpRunner::new(subdevice.target(), subdevice.application, steps, None),
            start_time: parts[Part::Arm as usize].end.saturating_sub(2),
            parts,
            entered: 0,
            reader: SiiReader::new(subdevice.target(), SiiExtent::Fixed),
            stage: Stage::Rest,
            since: None,
            time: None,
            synced_at: None,
            comeback: Comeback::KeptPower,
            outcome: None,
        }
    }

    /// Sets out; the mailbox is given back by [`Recovery::take_mailbox`] when it is over.
    pub fn begin(&mut self, mailbox: Option<Mailbox>) {
        *self.runner.mailbox_mut() = mailbox;
        self.stage = Stage::Find;
        (self.since, self.time, self.synced_at) = (None, None, None);
        (self.entered, self.comeback, self.outcome) = (0, Comeback::KeptPower, None);
    }

    /// Whether it has begun and isn't over.
    pub fn is_under_way(&self) -> bool {
        !matches!(self.stage, Stage::Rest)
    }

    /// The segment's time in the frame whose answer is given next.
    pub fn set_reference_time(&mut self, time: Option<DcTime>) {
        self.time = time;
        if let (Stage::Run(_), Some(time)) = (&self.stage, time) {
            self.runner.set_reference_time(time);
        }
    }

    /// Whether its clock is just being set.
    pub fn is_setting_clock(&self) -> bool {
        matches!(self.stage, Stage::Run(Part::Clock))
    }

    /// Gives the mailbox back.
    pub fn take_mailbox(&mut self) -> Option<Mailbox> {
        self.runner.mailbox_mut().take()
    }

    fn run(&mut self, part: Part) -> Stage {
        let mut steps = self.parts[part as usize].clone();
        if part == Part::Enter {
            steps.start = (steps.start + self.entered).min(steps.end);
            steps.end = (steps.start + 1).min(steps.end);
        }
        self.runner.run(steps);
        Stage::Run(part)
    }

    fn arm(&mut self) -> Option<Stage> {
        let (cycle_ns, shift_ns) = sync0(self.sync)?;
        let start = start_time(self.time? + SYNC_MARGIN, cycle_ns, shift_ns);
        self.synced_at = Some(start + Duration::from_nanos(u64::from(cycle_ns)) * SYNC_CYCLES);
        let registers = self.runner.registers_mut(self.start_time);
        let length = registers.len().min(8);
        registers[..length].copy_from_slice(&start.0.to_le_bytes()[..length]);
        Some(self.run(Part::Arm))
    }

    fn fail(&mut self, error: RecoveryError) {
        self.outcome = Some(Err(error));
    }

    /// The same product, and the same piece where it has a number?
    fn identify(&self) -> Result<(), RecoveryError> {
        let image = Some(self.reader.image()).filter(|image| image.len() >= 32);
        let [vendor, product, serial] =
            image.map_or([0; 3], |image| [u32_at(image, 16), u32_at(image, 20), u32_at(image, 28)]);
        let position = self.target.position;
        let expected = (self.identity.vendor_id, self.identity.product_code);
        if (vendor, product) != expected {
            return Err(RecoveryError::OtherProduct { position, expected, found: (vendor, product) });
        }
        // Where neither has a number they can't be told apart.
        if serial != self.identity.serial {
            let (expected, found) = (self.identity.serial, serial);
            return Err(RecoveryError::OtherPiece { position, expected, found });
        }
        Ok(())
    }

    /// Goes on behind a stage that is a procedure of its own.
    fn ended(&mut self, result: Result<(), RecoveryError>, now: HostTime) {
        if let Err(error) = result {
            return self.fail(error);
        }
        self.stage = match self.stage {
            Stage::Run(Part::Clear) => {
                self.reader.restart();
                Stage::Identify
            }
            Stage::Identify => match self.identify() {
                Ok(()) => self.run(Part::SetUp),
                Err(error) => return self.fail(error),
            },
            Stage::Run(Part::SetUp) => self.run(Part::Clock),
            Stage::Run(Part::Clock) if self.clock.is_some() && sync0(self.sync).is_some() => {
                Stage::Lock { good: 0, since: now }
            }
            Stage::Run(Part::Clock | Part::Arm) => self.run(Part::Enter),
            Stage::Run(Part::Enter) => {
                self.entered += 1;
                if self.entered >= self.parts[Part::Enter as usize].len() {
                    self.outcome = Some(Ok(self.comeback));
                    return;
                }
                Stage::AwaitSync { since: now }
            }
            Stage::Rest | Stage::Find | Stage::Look | Stage::Address => return,
            Stage::Lock { .. } | Stage::AwaitSync { .. } => return,
        };
    }

    /// Ends the way.
    fn over(&mut self, outcome: Result<Comeback, RecoveryError>) -> Next<Result<Comeback, RecoveryError>> {
        self.stage = Stage::Rest;
        Next::Done(outcome)
    }
}

impl Procedure for Recovery {
    type Output = Result<Comeback, RecoveryError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        let Target { position, station } = self.target;
        let since = *self.since.get_or_insert(now);
        loop {
            if let Some(outcome) = self.outcome.take() {
                return self.over(outcome);
            }
            let ended = match &mut self.stage {
                Stage::Find | Stage::Look if now - since >= SEARCH => {
                    let after = now - since;
                    return self.over(Err(RecoveryError::NotThere { position, after }));
                }
                Stage::AwaitSync { since } => {
                    let has_come = match (self.synced_at, self.time) {
                        (Some(synced_at), Some(time)) => time >= synced_at,
                        (synced_at, _) => synced_at.is_none(),
                    };
                    // Without a clock to tell the drive itself is to say what is missing.
                    if has_come || now - *since >= SYNC_TIMEOUT {
                        self.stage = self.run(Part::Enter);
                        continue;
                    }
                    return Next::Send(Request::read(station, register::AL_STATUS, 2));
                }
                Stage::Find => return Next::Send(Request::read(station, register::STATION_ADDRESS, 2)),
                Stage::Look | Stage::Address => {
                    let looks = matches!(self.stage, Stage::Look);
                    let command = if looks { Command::Aprd } else { Command::Apwr };
                    let address = Address::position(position, register::STATION_ADDRESS);
                    return Next::Send(Request { command, address, length: 2 });
                }
                Stage::Lock { .. } => {
                    return Next::Send(Request::read(station, register::DC_SYSTEM_TIME_DIFFERENCE, 4));
                }
                Stage::Identify => match self.reader.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(result) => result.map_err(RecoveryError::Eeprom),
                },
                Stage::Run(_) => match self.runner.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(result) => result.map_err(RecoveryError::StartUp),
                },
                // Nobody asks before it begins.
                Stage::Rest => return Next::WaitUntil(now),
            };
            self.ended(ended, now);
        }
    }

    fn fill(&self, data: &mut [u8]) {
        match &self.stage {
            Stage::Address => data.copy_from_slice(&self.target.station.to_le_bytes()),
            Stage::Identify => self.reader.fill(data),
            Stage::Run(_) => self.runner.fill(data),
            Stage::Rest | Stage::Find | Stage::Look | Stage::Lock { .. } | Stage::AwaitSync { .. } => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let Target { position, station } = self.target;
        match &mut self.stage {
            Stage::Identify => return self.reader.answer(answer, now),
            Stage::Run(_) => return self.runner.answer(answer, now),
            _ => {}
        }
        let Answer::Returned { working_counter, data } = answer else { return };
        match &mut self.stage {
            Stage::Find => {
                self.stage = if working_counter == 1 { self.run(Part::Clear) } else { Stage::Look }
            }
            Stage::Look if working_counter == 1 && data.len() >= 2 => {
                let found = u16_at(data, 0);
                if found == 0 || found == station {
                    self.comeback = Comeback::Restarted;
                    self.stage = Stage::Address;
                } else {
                    self.fail(RecoveryError::OtherStation { position, expected: station, found });
                }
            }
            // It is found at its address, or the whole is begun again.
            Stage::Look | Stage::Address => self.stage = Stage::Find,
            Stage::Lock { good, since } if working_counter == 1 && data.len() >= 4 => {
                let difference_ns = signed_difference(u32_at(data, 0));
                *good = if difference_ns.unsigned_abs() < LOCK_LIMIT_NS { *good + 1 } else { 0 };
                let (good, after) = (*good, now - *since);
                if good >= LOCK_ROUNDS
                    && let Some(stage) = self.arm()
                {
                    self.stage = stage;
                } else if after >= LOCK_TIMEOUT {
                    self.fail(RecoveryError::NotLocked { position, difference_ns, after });
                }
            }
            Stage::Lock { since, .. } if now - *since >= LOCK_TIMEOUT => {
                let after = now - *since;
                self.fail(RecoveryError::NotThere { position, after });
            }
            _ => {}
        }
    }
}
