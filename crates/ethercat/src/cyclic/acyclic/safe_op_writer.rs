//! Writing the SDOs of one SubDevice that are for SAFE-OP, on the way of all to OP.

use alloc::vec::Vec;

use crate::mailbox::Mailbox;
use crate::procedure::{Answer, Next, Procedure};
use crate::start_up::{StartUpError, StartUpRunner, StartUpStep};
use crate::subdevice::SubDevice;
use crate::wire::HostTime;

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Rest,
    /// What the mailbox has in hand comes first.
    Waits,
    Writes,
}

/// The SDOs, with the mailbox while they are written.
#[derive(Debug)]
pub(super) struct SafeOpWriter {
    runner: StartUpRunner,
    count: usize,
    stage: Stage,
}

impl SafeOpWriter {
    /// `None` where the SubDevice has none of them.
    pub fn new(subdevice: &SubDevice) -> Option<Self> {
        let sdos = subdevice.config.safe_op_sdos.iter().cloned();
        let steps: Vec<StartUpStep> = sdos.map(StartUpStep::Sdo).collect();
        let count = steps.len();
        let runner = StartUpRunner::new(subdevice.target(), subdevice.application, steps, None);
        (count > 0).then_some(SafeOpWriter { runner, count, stage: Stage::Rest })
    }

    /// They are to be written as soon as the mailbox is free.
    pub fn ask(&mut self) {
        self.stage = Stage::Waits;
    }

    /// Whether they were asked for and aren't all written.
    pub fn is_due(&self) -> bool {
        self.stage != Stage::Rest
    }

    /// Whether they are being written.
    pub fn is_writing(&self) -> bool {
        self.stage == Stage::Writes
    }

    /// Sets out; the mailbox is given back by [`SafeOpWriter::end`].
    pub fn begin(&mut self, mailbox: Option<Mailbox>) {
        *self.runner.mailbox_mut() = mailbox;
        self.runner.run(0..self.count);
        self.stage = Stage::Writes;
    }

    /// Ends it, wherever it is; the mailbox has nothing in hand.
    pub fn end(&mut self) -> Option<Mailbox> {
        self.stage = Stage::Rest;
        self.runner.give_up()
    }
}

impl Procedure for SafeOpWriter {
    type Output = Result<(), StartUpError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        self.runner.next(now)
    }

    fn fill(&self, data: &mut [u8]) {
        self.runner.fill(data);
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        self.runner.answer(answer, now);
    }
}
