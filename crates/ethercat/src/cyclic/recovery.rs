//! Bringing one SubDevice back to OP while all others go on: find, address, identify, replay its start-up list.

mod identity;
mod outcome;
mod parts;

use alloc::vec::Vec;
use core::cmp::Ordering;
use core::ops::Range;
use core::time::Duration;

use super::sync::Sync0;
use crate::config::{DcConfig, Match};
use crate::eeprom::{SiiExtent, SiiReader};
use crate::found::Target;
use crate::image::Turn;
use crate::mailbox::Mailbox;
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::start_up::{StartUpRunner, StartUpStep};
use crate::subdevice::{DcWidth, SubDevice};
use crate::wire::bytes::{u16_at, u32_at};
use crate::wire::sii::Identity;
use crate::wire::{Address, AlState, AlStatusCode, Command, DcTime, HostTime, register};

pub use outcome::{Comeback, RecoveryError};
use parts::{arming, clearing, is_clock, setting_clock};

/// How long a SubDevice is looked for at its place.
const SEARCH: Duration = Duration::from_secs(5);
/// Its clock must be nearer to the reference than this before SYNC0 is armed, ns.
const LOCK_LIMIT_NS: u32 = 1000;
/// Looks in a row that must be within the limit.
const LOCK_ROUNDS: u32 = 10;
/// The longest wait for that.
const LOCK_TIMEOUT: Duration = Duration::from_secs(10);
/// SYNC0 has come so many times before OP is asked; less often where it comes less often.
const SYNC_CYCLES: u32 = 10;
/// The longest wait for that.
const SYNC_TIMEOUT: Duration = Duration::from_secs(2);
/// How far ahead of the present the first SYNC0 is put.
const SYNC_MARGIN: Duration = Duration::from_millis(100);

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
    /// Does it answer at its station address, and is it in OP?
    Find,
    /// It is in OP with an error: acknowledging that.
    Acknowledge,
    /// It kept its station address: is it at its place still? What its clock was told depends on that.
    Surroundings,
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

/// Where a SubDevice is, as far as those that answer tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Surroundings {
    /// In an unbranched line from the MainDevice: who is missing stands behind everybody who answers.
    InLine,
    /// Behind a branch: who is missing may shift its position.
    Branched,
}

/// What the cycle knows of the segment when an answer comes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observed {
    /// The segment's time in the frame with the answer.
    pub time: Option<DcTime>,
    /// Whether that time was distributed: then the clocks know how far they are from it.
    pub is_distributed: bool,
    /// SubDevices that answered; `None` where nobody could be counted.
    pub answered: Option<u16>,
    /// SubDevices that were set up.
    pub expected: u16,
    /// Number of the cycle.
    pub cycle: u64,
}

impl Observed {
    /// How many there are, against how many there were.
    fn crowd(&self) -> Option<Ordering> {
        self.answered.map(|answered| answered.cmp(&self.expected))
    }
}

/// The way back of one SubDevice, from whatever happened to it to OP, as often as it is needed.
///
/// All its memory is asked for when it is made: the steps, the buffer of its SDOs, and what is read of its EEPROM.
#[derive(Debug)]
pub(super) struct Recovery {
    target: Target,
    identity: Identity,
    /// Its alias, where the configuration knows it by that.
    alias: Option<u16>,
    place: Surroundings,
    sync: DcConfig,
    /// In which cycles its process data go.
    turn: Turn,
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
    seen: Observed,
    /// Its clock has the segment's time.
    has_time: bool,
    /// Why it isn't found, where that is known.
    doubt: Option<RecoveryError>,
    /// When SYNC0 has come a few times.
    synced_at: Option<DcTime>,
    /// Until it is back: one that started anew may take several attempts.
    comeback: Comeback,
    outcome: Option<Result<Comeback, RecoveryError>>,
}

impl Recovery {
    /// The way back of `subdevice` as set-up left it.
    pub fn new(subdevice: &SubDevice, turn: Turn) -> Self {
        let list = &subdevice.start_up.steps;
        let cut = list.iter().position(StartUpStep::needs_cycle).unwrap_or(list.len());
        let (before, after) = (list[..cut].to_vec(), list[cut..].to_vec());
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
            alias: match subdevice.config.place {
                Some(Match::Alias(alias)) => Some(alias),
                _ => None,
            },
            place: Surroundings::InLine,
            sync: subdevice.config.dc,
            turn,
            clock: subdevice.dc.map(|dc| dc.width),
            runner: StartUpRunner::new(subdevice.target(), subdevice.application, steps, None),
            start_time: parts[Part::Arm as usize].end.saturating_sub(2),
            parts,
            entered: 0,
            reader: SiiReader::new(subdevice.target(), SiiExtent::Fixed),
            stage: Stage::Rest,
            since: None,
            seen: Observed { time: None, is_distributed: false, answered: None, expected: 0, cycle: 0 },
            has_time: false,
            doubt: None,
            synced_at: None,
            comeback: Comeback::KeptPower,
            outcome: None,
        }
    }

    /// Sets out; the mailbox is given back by [`Recovery::take_mailbox`] when it is over.
    pub fn begin(&mut self, mailbox: Option<Mailbox>, place: Surroundings) {
        *self.runner.mailbox_mut() = mailbox;
        (self.stage, self.place) = (Stage::Find, place);
        (self.since, self.synced_at) = (None, None);
        (self.entered, self.has_time) = (0, false);
        (self.doubt, self.outcome) = (None, None);
    }

    /// Ends it where nothing was changed yet; `false` where it has to go on.
    pub fn call_off(&mut self) -> bool {
        let is_searching = matches!(self.stage, Stage::Find | Stage::Look | Stage::Surroundings);
        if is_searching {
            self.stage = Stage::Rest;
        }
        is_searching
    }

    /// Whether it has begun and isn't over.
    pub fn is_under_way(&self) -> bool {
        !matches!(self.stage, Stage::Rest)
    }

    /// The segment as the frame shows it whose answer is given next.
    pub fn set_seen(&mut self, seen: Observed) {
        self.seen = seen;
        if let (Stage::Run(_), Some(time)) = (&self.stage, seen.time) {
            self.runner.set_reference_time(time);
        }
    }

    /// Whether its clock is just being set.
    pub fn is_setting_clock(&self) -> bool {
        matches!(self.stage, Stage::Run(Part::Clock))
    }

    /// Whether its clock was set on this way: it has the segment's time.
    pub fn has_time(&self) -> bool {
        self.has_time
    }

    /// Gives the mailbox back, with nothing in hand.
    pub fn take_mailbox(&mut self) -> Option<Mailbox> {
        self.runner.give_up()
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
        let sync0 = Sync0::of(self.sync)?;
        let start = sync0.start(self.turn, self.seen.cycle, self.seen.time?, SYNC_MARGIN);
        let syncs = (SYNC_CYCLES / u32::from(self.turn.every)).max(1);
        self.synced_at = Some(start + Duration::from_nanos(u64::from(sync0.cycle_ns)) * syncs);
        let registers = self.runner.registers_mut(self.start_time);
        let length = registers.len().min(8);
        registers[..length].copy_from_slice(&start.0.to_le_bytes()[..length]);
        Some(self.run(Part::Arm))
    }

    fn succeed(&mut self, comeback: Comeback) {
        self.outcome = Some(Ok(comeback));
        self.comeback = Comeback::KeptPower;
    }

    fn fail(&mut self, error: RecoveryError) {
        self.outcome = Some(Err(error));
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
            Stage::Run(Part::Clock) => {
                self.has_time = self.clock.is_some();
                match Sync0::of(self.sync).filter(|_| self.has_time) {
                    Some(_) => Stage::Lock { good: 0, since: now },
                    None => self.run(Part::Enter),
                }
            }
            Stage::Run(Part::Arm) => self.run(Part::Enter),
            Stage::Run(Part::Enter) => {
                self.entered += 1;
                if self.entered >= self.parts[Part::Enter as usize].len() {
                    return self.succeed(self.comeback);
                }
                Stage::AwaitSync { since: now }
            }
            Stage::Rest | Stage::Find | Stage::Acknowledge | Stage::Surroundings => return,
            Stage::Look | Stage::Address => return,
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
                Stage::Find | Stage::Look | Stage::Surroundings | Stage::Acknowledge
                    if now - since >= SEARCH =>
                {
                    let after = now - since;
                    let error = self.doubt.take().unwrap_or(RecoveryError::NotThere { position, after });
                    return self.over(Err(error));
                }
                Stage::AwaitSync { since } => {
                    let has_come = match (self.synced_at, self.seen.time) {
                        (Some(synced_at), Some(time)) => time >= synced_at,
                        (synced_at, _) => synced_at.is_none(),
                    };
                    // Without a clock to tell the drive itself is to say what is missing.
                    if has_come || now - *since >= SYNC_TIMEOUT {
                        self.stage = self.run(Part::Enter);
                        continue;
                    }
                    return Next::Send(DatagramRequest::read(station, register::AL_STATUS, 2));
                }
                Stage::Find => return Next::Send(DatagramRequest::read(station, register::AL_STATUS, 6)),
                Stage::Acknowledge => {
                    return Next::Send(DatagramRequest::write(station, register::AL_CONTROL, 2));
                }
                Stage::Look | Stage::Surroundings | Stage::Address => {
                    let writes = matches!(self.stage, Stage::Address);
                    // Its alias stands behind its address.
                    let (command, length) = if writes { (Command::Apwr, 2) } else { (Command::Aprd, 4) };
                    let address = Address::position(position, register::STATION_ADDRESS);
                    return Next::Send(DatagramRequest { command, address, length });
                }
                Stage::Lock { .. } => {
                    return Next::Send(DatagramRequest::read(
                        station,
                        register::DC_SYSTEM_TIME_DIFFERENCE,
                        4,
                    ));
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
            Stage::Acknowledge => {
                let word = AlState::Op.bits() | AlState::ERROR;
                data.copy_from_slice(&word.to_le_bytes());
            }
            Stage::Identify => self.reader.fill(data),
            Stage::Run(_) => self.runner.fill(data),
            Stage::Rest | Stage::Find | Stage::Surroundings | Stage::Look => {}
            Stage::Lock { .. } | Stage::AwaitSync { .. } => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let position = self.target.position;
        if let Answer::Returned { working_counter: answered @ 2.., .. } = answer {
            return self.fail(RecoveryError::NotAlone { position, answered });
        }
        match &mut self.stage {
            Stage::Identify => return self.reader.answer(answer, now),
            Stage::Run(_) => return self.runner.answer(answer, now),
            _ => {}
        }
        let Answer::Returned { working_counter, data } = answer else { return };
        match &mut self.stage {
            Stage::Find if working_counter == 1 && data.len() >= 6 => {
                self.found(u16_at(data, 0), AlStatusCode(u16_at(data, 4)));
            }
            Stage::Find => self.stage = Stage::Look,
            Stage::Surroundings if working_counter == 1 && data.len() >= 4 => self.placed(u16_at(data, 0)),
            Stage::Look if working_counter == 1 && data.len() >= 4 => {
                self.looked(u16_at(data, 0), u16_at(data, 2));
            }
            // It is found at its address, or the whole is begun again.
            Stage::Look | Stage::Surroundings | Stage::Address | Stage::Acknowledge => {
                self.stage = Stage::Find
            }
            Stage::Lock { good, since } if working_counter == 1 && data.len() >= 4 => {
                let difference_ns = register::signed_difference(u32_at(data, 0));
                let is_near = difference_ns.unsigned_abs() < LOCK_LIMIT_NS && self.seen.is_distributed;
                *good = if is_near { *good + 1 } else { 0 };
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
