//! For how long a port looks for a frame before it sleeps: as long as frames usually take, which is learnt.

use omnibase_ethercat_wire::{HostTime, LinkError};

/// The part of the time until a deadline that may be looked, as a divisor: with the usual time-out of half a cycle, an eighth
/// of the cycle.
const SHARE: u64 = 4;
/// The longest look, whatever the deadline, ns.
const MOST_NS: u64 = 200_000;
/// Less than this isn't worth a look at the clock, let alone at the ring, ns.
const LEAST_NS: u64 = 1000;
/// What a frame is taken to need before one was seen, ns.
const AT_FIRST_NS: u64 = 10_000;
/// The balance of looks in vain beyond which pauses grow no longer: 1023 waits.
const MOST_IN_VAIN: u32 = 11;

/// A port that looks for its frame before it sleeps.
pub(crate) trait LooksFirst {
    /// Looks between two looks at the clock.
    const LOOKS_PER_CLOCK: u32;
    /// Pauses of the processor between two looks.
    const PAUSES_PER_LOOK: u32;

    /// What was learnt of this port's waits.
    fn learnt(&mut self) -> &mut Look;

    /// The next frame, if one has come.
    fn take(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, LinkError>;

    /// Sleeps until a frame or the deadline comes.
    fn sleep(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError>;

    /// Looks from `begin`, which is now, until a frame or the instant `until` comes.
    #[inline]
    fn spin(
        &mut self,
        buffer: &mut [u8],
        [begin, until]: [HostTime; 2],
        now: &mut impl FnMut() -> HostTime,
    ) -> Result<Option<usize>, LinkError> {
        // A look takes a nanosecond on any processor: their number ends it beside a clock that stands, too.
        let most = until.0.saturating_sub(begin.0) / u64::from(Self::LOOKS_PER_CLOCK);
        for _ in 0..=most {
            for _ in 0..Self::LOOKS_PER_CLOCK {
                let taken = self.take(buffer)?;
                if taken.is_some() {
                    return Ok(taken);
                }
                for _ in 0..Self::PAUSES_PER_LOOK {
                    std::hint::spin_loop();
                }
            }
            if now() >= until {
                break;
            }
        }
        Ok(None)
    }

    /// Looks for as long as frames usually take, then sleeps.
    #[inline]
    fn look_then_sleep(
        &mut self,
        buffer: &mut [u8],
        [begin, deadline]: [HostTime; 2],
        now: &mut impl FnMut() -> HostTime,
    ) -> Result<Option<usize>, LinkError> {
        if let Some(until) = self.learnt().begin(begin, deadline) {
            if let Some(length) = self.spin(buffer, [begin, until], now)? {
                self.learnt().found(now());
                return Ok(Some(length));
            }
            self.learnt().in_vain(now());
        }
        let slept = self.sleep(buffer, deadline)?;
        if slept.is_some() {
            self.learnt().slept(now());
        }
        Ok(slept)
    }
}

/// What was learnt of a port's waits.
///
/// Looking pays where frames come soon. It doesn't where they take long, and where the look itself keeps them away: it has
/// the CPU that the other end or the card's interrupt needs. So looks that find nothing for once thin out looks: they go on
/// as long as at least every second one finds its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Look {
    /// What some nine of ten waits take at most, ns.
    usual_ns: u64,
    /// Looks in vain less those that found their frame.
    in_vain: u32,
    /// Waits that are slept through before the next look.
    pause: u32,
    /// When this wait began.
    begin: HostTime,
    /// The deadline that was waited for last, and how much may still be looked until then: many frames within one deadline,
    /// or a flood of foreign ones, share it.
    deadline: HostTime,
    left_ns: u64,
}

impl Default for Look {
    fn default() -> Self {
        Look {
            usual_ns: AT_FIRST_NS,
            in_vain: 0,
            pause: 0,
            begin: HostTime(0),
            deadline: HostTime(0),
            left_ns: 0,
        }
    }
}

impl Look {
    /// A wait begins; until when it looks before it sleeps, `None` where it sleeps at once.
    pub(crate) fn begin(&mut self, now: HostTime, deadline: HostTime) -> Option<HostTime> {
        self.begin = now;
        if deadline != self.deadline {
            self.deadline = deadline;
            self.left_ns = (deadline.0.saturating_sub(now.0) / SHARE).min(MOST_NS);
        }
        if self.pause > 0 {
            self.pause -= 1;
            return None;
        }
        // Twice, as what is usual is exceeded now and then.
        let look_ns = (2 * self.usual_ns).min(self.left_ns);
        (look_ns >= LEAST_NS).then(|| HostTime(now.0 + look_ns))
    }

    /// The look found a frame.
    pub(crate) fn found(&mut self, now: HostTime) {
        self.in_vain = self.in_vain.saturating_sub(1);
        self.looked(now);
        self.learn(now);
    }

    /// The look found nothing: the wait goes on asleep.
    pub(crate) fn in_vain(&mut self, now: HostTime) {
        self.in_vain = (self.in_vain + 1).min(MOST_IN_VAIN);
        self.pause = (1 << (self.in_vain - 1)) - 1;
        self.looked(now);
    }

    /// A frame ended the sleep.
    pub(crate) fn slept(&mut self, now: HostTime) {
        // Waking up is counted in: too long, until looks find how soon frames really come.
        self.learn(now);
    }

    fn looked(&mut self, now: HostTime) {
        self.left_ns = self.left_ns.saturating_sub(now.0.saturating_sub(self.begin.0));
    }

    /// One step up or down, whose sizes have a ninth of the waits take longer: a single one moves it no further, however late.
    fn learn(&mut self, now: HostTime) {
        if now.0.saturating_sub(self.begin.0) > self.usual_ns {
            self.usual_ns += self.usual_ns / 8;
        } else {
            self.usual_ns -= self.usual_ns / 64;
        }
        self.usual_ns = self.usual_ns.clamp(LEAST_NS, MOST_NS);
    }
}

#[cfg(test)]
mod tests;
