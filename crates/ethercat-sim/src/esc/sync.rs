//! The SYNC0/SYNC1 generator of a distributed-clock unit (registers 0x0980 to 0x09A7).

/// The shortest SYNC0 cycle that is generated, ns; shorter ones are drawn out to it.
const SHORTEST_CYCLE_NS: u32 = 1000;

/// Which pulses came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pulses {
    /// SYNC0.
    pub sync0: bool,
    /// SYNC1.
    pub sync1: bool,
}

/// How many bits of the system time the start time is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeWidth {
    /// A start time in the past comes again after 4.29 s.
    Bits32,
    /// A start time in the past never comes.
    Bits64,
}

/// The generator; all times are system time, ns.
#[derive(Clone, Debug, Default)]
pub struct SyncUnit {
    running: bool,
    outputs: Pulses,
    next0: Option<u64>,
    next1: Option<u64>,
    /// SYNC1 waits for the next SYNC0 to count from.
    waiting1: bool,
    /// The first SYNC0 hasn't come yet.
    pending0: bool,
    pending1: bool,
    cycle0: u32,
    cycle1: u32,
}

impl SyncUnit {
    /// Activation register written: `outputs` are enabled; starts at `start` where it wasn't running.
    pub fn activate(&mut self, outputs: Pulses, start: u64, now: u64, width: TimeWidth) {
        self.outputs = outputs;
        if self.running {
            return;
        }
        let first = next_match(start, now, width);
        let cycles = (self.cycle0, self.cycle1);
        *self = SyncUnit { running: true, outputs, next0: first, waiting1: true, ..SyncUnit::default() };
        (self.cycle0, self.cycle1) = cycles;
        (self.pending0, self.pending1) = (outputs.sync0, outputs.sync1);
    }

    /// The system time was set to `now`: pulses that were jumped over are missed, as a comparator misses them.
    pub fn step(&mut self, now: u64, width: TimeWidth) {
        self.next0 = self.next0.and_then(|next| next_match(next, now, width));
        self.next1 = self.next1.and_then(|next| next_match(next, now, width));
    }

    /// Activation register written with bit 0 clear.
    pub fn stop(&mut self) {
        let cycles = (self.cycle0, self.cycle1);
        *self = SyncUnit { cycle0: cycles.0, cycle1: cycles.1, ..SyncUnit::default() };
    }

    /// Cycle times: between SYNC0 pulses (0: one pulse), and from SYNC0 to SYNC1.
    pub fn set_cycles(&mut self, cycle0: u32, cycle1: u32) {
        (self.cycle0, self.cycle1) = (cycle0, cycle1);
    }

    /// Whether it is activated.
    pub fn running(&self) -> bool {
        self.running
    }

    /// Register 0x0984: first pulses pending.
    pub fn status(&self) -> u8 {
        u8::from(self.pending0) | u8::from(self.pending1) << 1
    }

    /// Time of the next SYNC0.
    pub fn next0(&self) -> Option<u64> {
        self.next0
    }

    /// Time of the next SYNC1.
    pub fn next1(&self) -> Option<u64> {
        self.next1
    }

    /// When something happens next.
    pub fn next(&self) -> Option<u64> {
        match (self.next0, self.next1) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Fires what is due at system time `now`, one instant of pulses per call; `None` when nothing is left.
    pub fn fire(&mut self, now: u64) -> Option<Pulses> {
        let due = self.next().filter(|&due| due <= now)?;
        let mut fired = Pulses::default();
        if self.next0 == Some(due) {
            fired.sync0 = true;
            self.pending0 = false;
            self.next0 =
                due.checked_add(u64::from(self.cycle0.max(SHORTEST_CYCLE_NS))).filter(|_| self.cycle0 > 0);
            if self.waiting1 {
                self.waiting1 = false;
                self.next1 = due.checked_add(u64::from(self.cycle1));
            }
        }
        if self.next1 == Some(due) {
            fired.sync1 = true;
            self.pending1 = false;
            self.waiting1 = true;
            self.next1 = None;
        }
        Some(Pulses { sync0: fired.sync0 && self.outputs.sync0, sync1: fired.sync1 && self.outputs.sync1 })
    }
}

/// When the system time, `now`, next equals `target`.
fn next_match(target: u64, now: u64, width: TimeWidth) -> Option<u64> {
    match width {
        TimeWidth::Bits64 => (target > now).then_some(target),
        TimeWidth::Bits32 => {
            let ahead = (target as u32).wrapping_sub(now as u32);
            now.checked_add(if ahead == 0 { 1 << 32 } else { u64::from(ahead) })
        }
    }
}
