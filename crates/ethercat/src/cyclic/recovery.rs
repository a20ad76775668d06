//! Bringing one SubDevice back to OP while all others go on: find, address, identify, replay its start-up list.

use alloc::vec::Vec;
use core::time::Duration;

use super::transition::{signed_difference, start_time, sync0};
use crate::config::{CyclicControl, DcConfig};
use crate::eeprom::{EepromError, SiiExtent, SiiReader};
use crate::mailbox::Mailbox;
use crate::procedure::{Answer, Next, Procedure, Request};
use crate::start_up::{Refusal, StartUpError, StartUpRunner, StartUpStep};
use crate::state::Application;
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

/// The stages, in their order.
#[derive(Debug)]
enum Stage {
    /// Does it answer at its station address?
    Find,
    /// Who stands at its place?
    Look,
    /// Give it its address.
    Address,
    /// To INIT, everything off, its EEPROM to the MainDevice.
    Clear(StartUpRunner),
    /// Is it the same product?
    Identify(SiiReader),
    /// The start-up list up to where process data must flow, but for the clock.
    SetUp(StartUpRunner),
    /// Its clock's control loop begins anew at the reference's time.
    Clock(StartUpRunner),
    /// Until its clock agrees.
    Lock { good: u32, since: HostTime },
    /// SYNC0.
    Arm(StartUpRunner),
    /// The next of SAFE-OP and OP.
    Enter(StartUpRunner),
    /// Between the two: until SYNC0 comes, for a drive in OP without it is in error at once.
    AwaitSync { since: HostTime },
}

/// One SubDevice on its way back.
#[derive(Debug)]
pub(super) struct Recovery {
    target: Target,
    application: Application,
    identity: Identity,
    sync: DcConfig,
    cyclic_control: CyclicControl,
    clock: Option<DcWidth>,
    set_up: Vec<StartUpStep>,
    set_clock: Vec<StartUpStep>,
    enter: Vec<StartUpStep>,
    mailbox: Option<Mailbox>,
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

impl Recovery {
    /// The way back of `subdevice` as set-up left it; `mailbox` is given back by [`Recovery::into_mailbox`].
    pub fn new(subdevice: &SubDevice, mailbox: Option<Mailbox>) -> Self {
        let steps = &subdevice.start_up.steps;
        let before = || steps.iter().take_while(|step| !step.needs_cycle()).cloned();
        let is_clock = |step: &StartUpStep| matches!(step, StartUpStep::ClockOffset { .. });
        let set_up = before().filter(|step| !is_clock(step)).collect();
        // Writing the speed counter's start makes the control loop forget what it was told before.
        let loop_anew = registers(
            "the clock's control loop",
            register::DC_SPEED_COUNTER_START,
            &crate::clock_setup::SPEED_COUNTER_START.to_le_bytes(),
            Refusal::IsTolerated,
        );
        let mut set_clock: Vec<_> = before().filter(is_clock).collect();
        if !set_clock.is_empty() {
            set_clock.insert(0, loop_anew.clone());
            // Once more behind the offset: what came between was told to a clock with another time.
            set_clock.push(loop_anew);
        }
        let states = steps.iter().filter(|step| step.needs_cycle() && !matches!(step, StartUpStep::ArmSync));
        Recovery {
            target: subdevice.target(),
            application: subdevice.application,
            identity: subdevice.identity,
            sync: subdevice.config.dc,
            cyclic_control: subdevice.config.cyclic_control,
            clock: subdevice.dc.map(|dc| dc.width),
            set_up,
            set_clock,
            enter: states.cloned().collect(),
            mailbox,
            stage: Stage::Find,
            since: None,
            time: None,
            synced_at: None,
            comeback: Comeback::KeptPower,
            outcome: None,
        }
    }

    /// The segment's time in the frame whose answer is given next.
    pub fn set_reference_time(&mut self, time: Option<DcTime>) {
        self.time = time;
        let runner = match &mut self.stage {
            Stage::Clear(runner)
            | Stage::SetUp(runner)
            | Stage::Clock(runner)
            | Stage::Arm(runner)
            | Stage::Enter(runner) => runner,
            _ => return,
        };
        if let Some(time) = time {
            runner.set_reference_time(time);
        }
    }

    /// Whether its clock is just being set.
    pub fn is_setting_clock(&self) -> bool {
        matches!(self.stage, Stage::Clock(_))
    }

    /// Gives the mailbox back.
    pub fn into_mailbox(self) -> Option<Mailbox> {
        match self.stage {
            Stage::SetUp(runner) => runner.into_mailbox(),
            _ => self.mailbox,
        }
    }

    fn runner(&self, steps: Vec<StartUpStep>, mailbox: Option<Mailbox>) -> StartUpRunner {
        StartUpRunner::new(self.target, self.application, steps, mailbox)
    }

    fn clear(&self) -> Stage {
        let off = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsTolerated);
        let mut steps = Vec::from([
            StartUpStep::State { state: AlState::Init, timeout: SEARCH },
            off("SYNC off", register::DC_ACTIVATION, &[0]),
            off("taking the EEPROM", register::SII_CONFIG, &[2]),
            off("taking the EEPROM", register::SII_CONFIG, &[0]),
        ]);
        // What is switched on can't be written; the list switches on what it needs.
        let managers = self.set_up.iter().filter_map(|step| match step {
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
        Stage::Clear(self.runner(steps, None))
    }

    fn set_up(&mut self) -> Stage {
        let (steps, mailbox) = (core::mem::take(&mut self.set_up), self.mailbox.take());
        Stage::SetUp(self.runner(steps, mailbox))
    }

    fn arm(&mut self) -> Option<Stage> {
        let (cycle_ns, shift_ns) = sync0(self.sync)?;
        let start = start_time(self.time? + SYNC_MARGIN, cycle_ns, shift_ns);
        self.synced_at = Some(start + Duration::from_nanos(u64::from(cycle_ns)) * SYNC_CYCLES);
        let must = |what, register, data: &[u8]| registers(what, register, data, Refusal::IsError);
        let mut steps = Vec::from([must("SYNC off", register::DC_ACTIVATION, &[0])]);
        if self.cyclic_control == CyclicControl::Write {
            let refusal = Refusal::IsTolerated;
            steps.push(registers("the SYNC unit", register::DC_CYCLIC_CONTROL, &[0], refusal));
        }
        steps.push(must("the SYNC0 cycle", register::DC_SYNC0_CYCLE, &cycle_ns.to_le_bytes()));
        let mut activation = 3;
        if let DcConfig::Sync0And1 { sync1_cycle_ns, .. } = self.sync {
            steps.push(must("the SYNC1 cycle", register::DC_SYNC1_CYCLE, &sync1_cycle_ns.to_le_bytes()));
            activation = 7;
        }
        let length = if self.clock == Some(DcWidth::Bits32) { 4 } else { 8 };
        steps.push(must("the start time", register::DC_START_TIME, &start.0.to_le_bytes()[..length]));
        steps.push(must("SYNC on", register::DC_ACTIVATION, &[activation]));
        Some(Stage::Arm(self.runner(steps, None)))
    }

    fn enter(&mut self) -> Stage {
        let steps = self.enter.split_off(self.enter.len().min(1));
        let step = core::mem::replace(&mut self.enter, steps);
        Stage::Enter(self.runner(step, None))
    }

    fn fail(&mut self, error: RecoveryError) {
        self.outcome = Some(Err(error));
    }

    /// Goes on behind a stage that is a procedure of its own.
    fn ended(&mut self, result: Result<Option<Vec<u8>>, RecoveryError>, now: HostTime) {
        let image = match result {
            Ok(image) => image,
            Err(error) => return self.fail(error),
        };
        self.stage = match core::mem::replace(&mut self.stage, Stage::Find) {
            Stage::Clear(_) => Stage::Identify(SiiReader::new(self.target, SiiExtent::Needed)),
            Stage::Identify(_) => {
                let expected = (self.identity.vendor_id, self.identity.product_code);
                let found = image.filter(|image| image.len() >= 32);
                let [vendor, product, serial] = found
                    .map_or([0; 3], |image| [u32_at(&image, 16), u32_at(&image, 20), u32_at(&image, 28)]);
                let position = self.target.position;
                if (vendor, product) != expected {
                    let found = (vendor, product);
                    return self.fail(RecoveryError::OtherProduct { position, expected, found });
                }
                // Where neither has a number they can't be told apart.
                if serial != self.identity.serial {
                    let (expected, found) = (self.identity.serial, serial);
                    return self.fail(RecoveryError::OtherPiece { position, expected, found });
                }
                self.set_up()
            }
            Stage::SetUp(runner) => {
                self.mailbox = runner.into_mailbox();
                let steps = core::mem::take(&mut self.set_clock);
                Stage::Clock(self.runner(steps, None))
            }
            Stage::Clock(_) => {
                if self.clock.is_some() && sync0(self.sync).is_some() {
                    Stage::Lock { good: 0, since: now }
                } else {
                    self.enter()
                }
            }
            Stage::Arm(_) => self.enter(),
            Stage::Enter(_) if !self.enter.is_empty() => Stage::AwaitSync { since: now },
            Stage::Enter(runner) => {
                self.outcome = Some(Ok(self.comeback));
                Stage::Enter(runner)
            }
            other => other,
        };
    }
}

impl Procedure for Recovery {
    type Output = Result<Comeback, RecoveryError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        let Target { position, station } = self.target;
        let since = *self.since.get_or_insert(now);
        loop {
            if let Some(outcome) = self.outcome.take() {
                return Next::Done(outcome);
            }
            let ended = match &mut self.stage {
                Stage::Find | Stage::Look if now - since >= SEARCH => {
                    let after = now - since;
                    return Next::Done(Err(RecoveryError::NotThere { position, after }));
                }
                Stage::AwaitSync { since } => {
                    let has_come = match (self.synced_at, self.time) {
                        (Some(synced_at), Some(time)) => time >= synced_at,
                        (synced_at, _) => synced_at.is_none(),
                    };
                    // Without a clock to tell the drive itself is to say what is missing.
                    if has_come || now - *since >= SYNC_TIMEOUT {
                        self.stage = self.enter();
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
                Stage::Identify(reader) => match reader.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(result) => result.map(Some).map_err(RecoveryError::Eeprom),
                },
                Stage::Clear(runner)
                | Stage::SetUp(runner)
                | Stage::Clock(runner)
                | Stage::Arm(runner)
                | Stage::Enter(runner) => match runner.next(now) {
                    Next::Send(request) => return Next::Send(request),
                    Next::WaitUntil(instant) => return Next::WaitUntil(instant),
                    Next::Done(result) => result.map(|()| None).map_err(RecoveryError::StartUp),
                },
            };
            self.ended(ended, now);
        }
    }

    fn fill(&self, data: &mut [u8]) {
        match &self.stage {
            Stage::Address => data.copy_from_slice(&self.target.station.to_le_bytes()),
            Stage::Identify(reader) => reader.fill(data),
            Stage::Clear(runner)
            | Stage::SetUp(runner)
            | Stage::Clock(runner)
            | Stage::Arm(runner)
            | Stage::Enter(runner) => {
                runner.fill(data);
            }
            Stage::Find | Stage::Look | Stage::Lock { .. } | Stage::AwaitSync { .. } => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let Target { position, station } = self.target;
        match &mut self.stage {
            Stage::Identify(reader) => return reader.answer(answer, now),
            Stage::Clear(runner)
            | Stage::SetUp(runner)
            | Stage::Clock(runner)
            | Stage::Arm(runner)
            | Stage::Enter(runner) => {
                return runner.answer(answer, now);
            }
            _ => {}
        }
        let Answer::Returned { working_counter, data } = answer else { return };
        match &mut self.stage {
            Stage::Find => self.stage = if working_counter == 1 { self.clear() } else { Stage::Look },
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
