//! The paced cycle: sleeps until its instant, exchanges, keeps cycle and distributed clocks together, and plans the
//! next instant. Whoever cycles a segment in time does it by this.

use alloc::boxed::Box;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use crate::cyclic::{
    CyclicBus, DcFollower, Exchange, FollowerGains, Goal, HostToDc, TransitionError, TransitionOptions,
    TransitionStatus,
};
use crate::image::ProcessImage;
use crate::wire::frame::FrameBuilder;
use crate::wire::{Address, AlState, Clock, Command, DcTime, HostTime, Link, LinkError, register};

/// Frames that ask for INIT where the orderly way there failed.
const BROADCAST_ATTEMPTS: u32 = 3;
/// The longest wait for each state on the way back.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// Who leads whom in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Leader {
    /// Nobody: the cycle runs by the host's clock, and no SYNC0 stands against it.
    #[default]
    Nobody,
    /// The reference clock: the cycle follows it.
    ReferenceClock,
    /// The host's clock: the reference clock follows it.
    Host,
}

/// When a cycle's frames go, and how long they are waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    /// The cycle.
    pub cycle: Duration,
    /// From a cycle's begin until its frames are given up.
    pub timeout: Duration,
    /// Who leads whom; nobody does where the segment has no clock.
    pub leader: Leader,
    /// Shift of SYNC0 against the multiples of the cycle, ns. Frames pass half a cycle away from it.
    pub sync0_shift_ns: i32,
}

impl Pace {
    /// Where in the DC cycle frames pass: half a cycle before SYNC0, and behind it.
    fn frame_phase(&self) -> Duration {
        let cycle_ns = (self.cycle.as_nanos() as i64).max(1);
        let phase_ns = (i64::from(self.sync0_shift_ns) + cycle_ns / 2).rem_euclid(cycle_ns);
        Duration::from_nanos(phase_ns as u64)
    }
}

/// What one cycle's times were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Periods of the cycle since the one before: more than one where cycles were left out.
    pub periods: u64,
    /// The instant of its period: the one nearest to its begin.
    pub wake: HostTime,
    /// How long after the instant that was planned for it it began, ns.
    pub late_ns: u64,
    /// From the send until all frames were back or given up, ns.
    pub round_trip_ns: u64,
    /// How far its frame was behind (positive) or before its place in the DC cycle, ns; `None` without a reading.
    pub dc_phase_ns: Option<i64>,
}

/// Why a state wasn't reached.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReachError {
    /// The port is broken.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A SubDevice didn't follow.
    #[error("on the way to {}: {error}", goal.state().name())]
    Transition {
        /// Where to.
        goal: Goal,
        /// Who didn't follow, and why.
        error: Box<TransitionError>,
    },
}

#[derive(Debug)]
enum Following {
    Nobody,
    ReferenceClock(DcFollower),
    /// The follower tells the first phase.
    Host(DcFollower, HostToDc),
}

/// A segment that is cycled in time.
///
/// One that goes without its [`PacedBus::end`] (a panic) asks everyone for INIT all the same, where nobody has to wait
/// for the drives' watchdogs.
#[derive(Debug)]
pub struct PacedBus<L: Link, C: Clock> {
    bus: CyclicBus<L>,
    clock: C,
    cycle: Duration,
    timeout: Duration,
    following: Following,
    /// The instant of the next cycle.
    wake: HostTime,
    last_reading: Option<DcTime>,
    dc_phase_ns: Option<i64>,
    has_ended: bool,
}

impl<L: Link, C: Clock> Drop for PacedBus<L, C> {
    fn drop(&mut self) {
        if !self.has_ended {
            self.broadcast_init();
        }
    }
}

impl<L: Link, C: Clock> PacedBus<L, C> {
    /// A segment in PRE-OP, its first cycle one cycle from now.
    pub fn new(bus: CyclicBus<L>, clock: C, pace: Pace) -> Self {
        let Pace { cycle, timeout, leader, .. } = pace;
        let follower = || DcFollower::new(cycle, pace.frame_phase(), FollowerGains::default());
        let following = match leader {
            _ if bus.clock_use().reference().is_none() => Following::Nobody,
            Leader::Nobody => Following::Nobody,
            Leader::ReferenceClock => Following::ReferenceClock(follower()),
            Leader::Host => Following::Host(follower(), HostToDc::new()),
        };
        let wake = clock.now() + cycle;
        let (last_reading, dc_phase_ns) = (None, None);
        PacedBus { bus, clock, cycle, timeout, following, wake, last_reading, dc_phase_ns, has_ended: false }
    }

    /// One cycle: sleeps until its instant, exchanges, and plans the next instant. `Err` only where the port is broken:
    /// a link that is down loses the exchange.
    pub fn exchange(&mut self, image: &mut ProcessImage) -> Result<(Exchange, Times), LinkError> {
        self.exchange_and(image, |_, _| {})
    }

    /// As [`PacedBus::exchange`]; behind the exchange `beside` may use the bus until the deadline that it is told.
    ///
    /// Whoever comes late belongs to the period whose instant is nearest; the periods before it are left out, and no
    /// burst catches up. Frames pass half a cycle away from SYNC0: one that comes later than that serves the next
    /// SYNC0, which another frame must not serve again.
    pub fn exchange_and(
        &mut self,
        image: &mut ProcessImage,
        beside: impl FnOnce(&mut CyclicBus<L>, HostTime),
    ) -> Result<(Exchange, Times), LinkError> {
        self.clock.sleep_until(self.wake);
        let woke = self.clock.now();
        let late_ns = (woke - self.wake).as_nanos() as u64;
        let left_out = self.leave_out(late_ns);
        self.bus.leave_out(left_out);
        // Where the host overslept the frame still needs its time to come back.
        let deadline = self.wake.max(woke) + self.timeout;
        if let Following::Host(_, host) = &self.following {
            self.bus.steer_clock(host.time_at(woke));
        }
        let exchange = self.bus.exchange(image, deadline)?;
        beside(&mut self.bus, deadline);
        let back = self.clock.now();
        let (wake, round_trip_ns) = (self.wake, (back - woke).as_nanos() as u64);
        self.dc_phase_ns = self.plan_next(woke);
        let dc_phase_ns = self.dc_phase_ns;
        Ok((exchange, Times { periods: 1 + left_out, wake, late_ns, round_trip_ns, dc_phase_ns }))
    }

    /// Cycles by `cycle` until everyone is in the goal's state; `false` where `stop` came first.
    pub fn reach(
        &mut self,
        goal: Goal,
        options: TransitionOptions,
        stop: &AtomicBool,
        mut cycle: impl FnMut(&mut Self) -> Result<(), LinkError>,
    ) -> Result<bool, ReachError> {
        self.bus.request(goal, options, self.clock.now());
        loop {
            match self.bus.transition() {
                TransitionStatus::Reached(_) => return Ok(true),
                TransitionStatus::Failed(error) => {
                    return Err(ReachError::Transition { goal, error: Box::new(error.clone()) });
                }
                TransitionStatus::Standby => return Ok(false),
                TransitionStatus::Moving { .. } => {}
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            cycle(self)?;
        }
    }

    /// Brings everyone back to INIT by `cycle`; who doesn't go there in order is asked by broadcast.
    pub fn end(&mut self, cycle: impl FnMut(&mut Self) -> Result<(), LinkError>) -> Result<(), ReachError> {
        // A segment that is gone is not waited for.
        let options = TransitionOptions { state_timeout: END_TIMEOUT, ..TransitionOptions::default() };
        let ended = self.reach(Goal::Init, options, &AtomicBool::new(false), cycle);
        if ended.is_err() {
            self.broadcast_init();
        }
        self.has_ended = true;
        ended.map(drop)
    }

    /// The bus, for what happens between two cycles.
    pub fn bus(&self) -> &CyclicBus<L> {
        &self.bus
    }

    /// The bus, for what happens between two cycles.
    pub fn bus_mut(&mut self) -> &mut CyclicBus<L> {
        &mut self.bus
    }

    /// The cycle, and how long its frames are awaited.
    pub fn pace(&self) -> (Duration, Duration) {
        (self.cycle, self.timeout)
    }

    /// The clock.
    pub fn clock(&self) -> &C {
        &self.clock
    }

    /// How far the last cycle's frame was behind (positive) or before its place in the DC cycle, ns; `None` without a
    /// reading.
    pub fn dc_phase_ns(&self) -> Option<i64> {
        self.dc_phase_ns
    }

    /// Goes on to the period whose instant is nearest to the present. How many periods were left out.
    fn leave_out(&mut self, late_ns: u64) -> u64 {
        let cycle_ns = self.cycle.as_nanos().max(1) as u64;
        let missed = late_ns.saturating_add(cycle_ns / 2) / cycle_ns;
        self.wake = HostTime(self.wake.0.saturating_add(missed.saturating_mul(cycle_ns)));
        missed
    }

    /// Plans the next instant; the phase error of this cycle's frame, where it brought a reading.
    fn plan_next(&mut self, woke: HostTime) -> Option<i64> {
        // A reading that didn't change is that of an earlier frame.
        let reading = self.bus.clock().filter(|time| self.last_reading != Some(*time));
        self.last_reading = self.bus.clock();
        let planned = self.wake + self.cycle;
        // How long after the period's instant the frame left: negative where an earlier one was left out for it.
        let off_ns = woke.0.wrapping_sub(self.wake.0) as i64;
        match &mut self.following {
            Following::Nobody => {
                self.wake = planned;
                None
            }
            // The reading as it were, had the host woken at the instant: its lateness says nothing about the clocks.
            Following::ReferenceClock(follower) => {
                let on_time = reading.map(|clock| DcTime(clock.0.wrapping_add_signed(-off_ns)));
                self.wake = follower.next_wake(self.wake, on_time);
                reading.map(|clock| follower.phase_error(clock))
            }
            Following::Host(follower, host) => {
                let is_first = host.time_at(woke).is_none();
                if let Some(clock) = reading {
                    host.read(woke, clock);
                }
                let phase_ns = reading.map(|clock| follower.phase_error(clock));
                // Once, before any SYNC0: from then on both pass alike.
                let shift_ns = phase_ns.filter(|_| is_first).map_or(0, |phase_ns| off_ns - phase_ns);
                self.wake = HostTime(planned.0.saturating_add_signed(shift_ns));
                phase_ns
            }
        }
    }

    /// Asks everyone who still listens for INIT: one that is gone must not keep the others in OP.
    fn broadcast_init(&mut self) {
        let mut frame = FrameBuilder::new();
        let ask = [AlState::Init.bits() as u8 | AlState::ERROR as u8, 0];
        if frame.push(Command::Bwr, 0, Address::broadcast(register::AL_CONTROL), &ask).is_ok() {
            for _ in 0..BROADCAST_ATTEMPTS {
                // Where the link is gone nobody hears it; the drives' watchdogs stop them.
                let _ = self.bus.link_mut().send(frame.bytes());
            }
        }
    }
}
