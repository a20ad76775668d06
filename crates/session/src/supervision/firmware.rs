//! Whether firmware still runs. A chip answers from OP, and takes outputs, also when the processor behind it hangs: its
//! inputs stand still and look like those of a drive at rest. What tells is the chip's watchdog of its processor (PDI
//! watchdog, 0x0410): a bit of DL status (0x0110), and a counter (0x0443) of which one datagram asks all chips.

use std::time::Duration;

use omnibase_ethercat::cyclic::{AcyclicRequest, AcyclicWork, CyclicBus, RegisterAccess};
use omnibase_ethercat::wire::bytes::u16_at;
use omnibase_ethercat::wire::{HostTime, Link, register};

use super::{Supervised, Supervisor};

/// Between two looks at everybody's counters.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);
/// The same while somebody is on its way back, whose way takes nearly all spare datagrams: the robot has stopped then.
const LOOK_INTERVAL_BESIDE: Duration = Duration::from_millis(100);
/// The same behind a round that found nobody: chips without a processor may count all the time.
const LOOK_INTERVAL_IN_VAIN: Duration = Duration::from_millis(200);
/// Bytes of each of these looks: the counters of both watchdogs; DL status.
const BYTES: usize = 2;
/// By that its answers are known among others.
pub(super) const TAG: u64 = 0x0443;

/// What is asked next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Question {
    /// Does this one's watchdog run at the start? Who has no processor, or has it off, isn't watched.
    Runs(usize),
    /// Nothing: what was counted before is cleared.
    Clear,
    /// Did any watchdog expire?
    Any,
    /// Did this one's?
    Whose(usize),
    /// Does this one's run now?
    IsAlive(usize),
}

/// Looks at PDI watchdogs, one question at a time.
#[derive(Debug)]
pub(super) struct FirmwareWatch {
    question: Question,
    /// A round was begun, and found nobody yet.
    is_in_vain: bool,
    is_asked: bool,
    next: HostTime,
    buffer: Vec<u8>,
}

impl Default for FirmwareWatch {
    fn default() -> Self {
        FirmwareWatch {
            question: Question::Runs(0),
            is_in_vain: false,
            is_asked: false,
            next: HostTime(0),
            buffer: Vec::with_capacity(BYTES),
        }
    }
}

impl Supervisor {
    /// Asks the next question, where it is time for it.
    pub(super) fn look_at_firmware<L: Link>(&mut self, bus: &mut CyclicBus<L>, now: HostTime) {
        if self.firmware.is_asked || now < self.firmware.next {
            return;
        }
        let (way, register, number) = match self.firmware.question {
            Question::Clear => (RegisterAccess::WriteAll, register::WATCHDOG_COUNTER, self.anybody()),
            Question::Any => (RegisterAccess::ReadAll, register::WATCHDOG_COUNTER, self.anybody()),
            Question::Whose(number) => (RegisterAccess::Read, register::WATCHDOG_COUNTER, Some(number)),
            Question::Runs(number) | Question::IsAlive(number) => {
                (RegisterAccess::Read, register::DL_STATUS, Some(number))
            }
        };
        let Some(one) = number.and_then(|number| self.all.get(number)) else { return };
        let mut data = std::mem::take(&mut self.firmware.buffer);
        data.clear();
        data.resize(BYTES, 0);
        let work = AcyclicWork::Registers { way, register, data };
        match bus.submit(AcyclicRequest { tag: TAG, position: one.subdevice.position, work }) {
            Ok(()) => self.firmware.is_asked = true,
            Err(AcyclicRequest { work: AcyclicWork::Registers { data, .. }, .. }) => {
                self.firmware.buffer = data;
            }
            Err(_) => {}
        }
    }

    /// By way of whose share all are asked.
    fn anybody(&self) -> Option<usize> {
        self.all.iter().position(|one| !one.is_on_its_way())
    }

    /// The answer came, or didn't.
    pub(super) fn looked_at_firmware(&mut self, is_there: bool, data: Vec<u8>, now: HostTime) {
        let word = if data.len() == BYTES { u16_at(&data, 0) } else { 0 };
        self.firmware.buffer = data;
        self.firmware.is_asked = false;
        let expired = is_there && word >> 8 != 0;
        self.firmware.question = match self.firmware.question {
            Question::Runs(number) => {
                self.all[number].is_watched = is_there && word & register::PDI_WATCHDOG_RUNS != 0;
                if number + 1 < self.all.len() { Question::Runs(number + 1) } else { Question::Clear }
            }
            // Once more: nobody is judged by what was counted before.
            Question::Clear if !is_there => Question::Clear,
            Question::Any if expired => {
                self.firmware.is_in_vain = true;
                self.whose(0)
            }
            Question::Clear | Question::Any => match self.hung_from(0) {
                Some(number) => self.later(Question::IsAlive(number), now),
                None => self.later(Question::Any, now),
            },
            Question::Whose(number) if expired && self.all[number].is_watched => {
                self.firmware.is_in_vain = false;
                Question::IsAlive(number)
            }
            Question::Whose(number) => self.whose(number + 1),
            Question::IsAlive(number) => {
                let was_hung = self.all[number].is_hung;
                if is_there {
                    self.judge_firmware(number, word & register::PDI_WATCHDOG_RUNS != 0, now);
                }
                match self.hung_from(number + 1) {
                    _ if !was_hung => self.whose(number + 1),
                    Some(next) => Question::IsAlive(next),
                    None => self.later(Question::Any, now),
                }
            }
        };
    }

    fn later(&mut self, question: Question, now: HostTime) -> Question {
        let is_beside = self.all.iter().any(Supervised::is_on_its_way);
        let interval = match (is_beside, std::mem::take(&mut self.firmware.is_in_vain)) {
            (true, _) => LOOK_INTERVAL_BESIDE,
            (false, true) => LOOK_INTERVAL_IN_VAIN,
            (false, false) => LOOK_INTERVAL,
        };
        self.firmware.next = now + interval;
        question
    }

    /// Whom to ask from `number` on whether it was its watchdog; behind the last all counters are cleared.
    fn whose(&self, number: usize) -> Question {
        let there = (number..self.all.len()).find(|&number| !self.all[number].is_on_its_way());
        there.map_or(Question::Clear, Question::Whose)
    }

    fn hung_from(&self, number: usize) -> Option<usize> {
        let is_to_ask = |one: &Supervised| one.is_hung && !one.is_on_its_way();
        (number..self.all.len()).find(|&number| is_to_ask(&self.all[number]))
    }

    fn judge_firmware(&mut self, number: usize, is_alive: bool, now: HostTime) {
        let one = &mut self.all[number];
        let was_hung = std::mem::replace(&mut one.is_hung, !is_alive);
        match (was_hung, is_alive) {
            (false, false) => {
                one.hung_since = now;
                one.figures.losses += 1;
                self.totals.losses += 1;
                self.tell(
                    number,
                    format_args!(
                        "lost: its firmware hangs (its chip answers, its processor is silent for longer than its PDI watchdog, 0x0410): \
                         its motor may go on as it was: cut its power"
                    ),
                );
            }
            (false, true) => self.tell(
                number,
                format_args!(
                    "its firmware hung for longer than its PDI watchdog allows (0x0410), and runs again"
                ),
            ),
            (true, true) => {
                let after = (now - one.hung_since).as_secs_f64();
                one.figures.recoveries += 1;
                self.totals.recoveries += 1;
                self.tell(number, format_args!("its firmware runs again after {after:.3} s"));
            }
            (true, false) => {}
        }
    }
}
