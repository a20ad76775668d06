//! The cycle of `exchange`: to OP, cycle and measure, and back to INIT.

use super::report::Report;
use crate::progress::{bar, note};
use crate::target::AnyClock;
use anyhow::Context;
use omnibase_ethercat::cyclic::TransitionOptions;
use omnibase_ethercat::cyclic::{
    CycleCounters, DcFollower, FollowerGains, Goal, Handover, Health, HostToDc, Phase, Step,
};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::frame::FrameBuilder;
use omnibase_ethercat::wire::{Address, AlState, Clock, Command, DcTime, HostTime, Link, register};
use omnibase_ethercat::{CyclicBus, ProcessImage};
use omnibase_run::quantiles::Distribution;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Cycles that the search for culprits may take.
const DIAGNOSIS_CYCLES: u32 = 300;

/// The longest wait for each state on the way back.
const END_TIMEOUT: Duration = Duration::from_secs(1);

/// Frames that ask for INIT where the orderly way there failed.
const BROADCAST_ATTEMPTS: u32 = 3;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Cycle time.
    pub cycle: Duration,
    /// Cycles in OP.
    pub cycles: u64,
    /// Who leads whom in time.
    pub pace: Pace,
    /// Whether it takes real time, so that progress is worth showing.
    pub paced: bool,
}

/// Who leads whom in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Nobody: the cycle runs by the host's clock, and no SYNC0 stands against it.
    Free,
    /// The cycle follows the reference clock.
    FollowDc,
    /// The reference clock follows the host's clock.
    LeadDc,
}

/// Runs the cycle.
pub struct Runner {
    bus: CyclicBus<Box<dyn Link>>,
    clock: AnyClock,
    subdevices: Vec<SubDevice>,
    image: ProcessImage,
    plan: Plan,
    follower: Option<DcFollower>,
    leader: Option<HostToDc>,
    last_clock: Option<DcTime>,
    wake: HostTime,
    measured: Measured,
}

/// What is measured in OP.
struct Measured {
    round_trip: Distribution,
    wake_up: Distribution,
    phase: Distribution,
    cycles: u64,
    /// Cycles that began a whole cycle late or more.
    overruns: u64,
    operational: bool,
    unwell: Vec<String>,
    before: CycleCounters,
    after: CycleCounters,
}

/// What one cycle's times were.
struct Times {
    late_ns: u64,
    round_trip_ns: u64,
    phase_ns: Option<u64>,
    overrun: bool,
}

impl Runner {
    /// A cycle over a segment in PRE-OP.
    pub fn new(handover: Handover<Box<dyn Link>, AnyClock>, plan: Plan) -> Self {
        let Handover { bus, clock, subdevices } = handover;
        let has_clock = bus.clock_use().reference().is_some();
        // SYNC0 stands at the multiples of the cycle: frames pass half a cycle before and after it.
        let follower = (has_clock && plan.pace != Pace::Free)
            .then(|| DcFollower::new(plan.cycle, plan.cycle / 2, FollowerGains::default()));
        let leader = (has_clock && plan.pace == Pace::LeadDc).then(HostToDc::new);
        let image = bus.plan().image();
        let wake = clock.now() + plan.cycle;
        let measured = Measured {
            round_trip: Distribution::new(),
            wake_up: Distribution::new(),
            phase: Distribution::new(),
            cycles: 0,
            overruns: 0,
            operational: false,
            unwell: Vec::new(),
            before: CycleCounters::default(),
            after: CycleCounters::default(),
        };
        Runner { bus, clock, subdevices, image, plan, follower, leader, last_clock: None, wake, measured }
    }

    /// To OP, all cycles, and back to INIT; an error says what ended it early.
    pub fn run(&mut self, stop: &AtomicBool) -> anyhow::Result<()> {
        let began = self.clock.now();
        let ran = self.reach(Goal::Op, stop).context("on the way to OP").and_then(|reached| {
            if !reached {
                return Ok(());
            }
            let took = self.clock.now() - began;
            note(format_args!("OP after {:.3} s of bus time", took.as_secs_f64()));
            self.cycle(stop)?;
            self.measured.operational = self.is_operational();
            if !self.measured.operational {
                self.find_culprits()?;
            }
            Ok(())
        });
        // Whatever happened, drives shall not be left in OP.
        let ended = self.reach(Goal::Init, &AtomicBool::new(false)).context("on the way back to INIT");
        if ended.is_err() {
            self.broadcast_init();
        }
        ran.and(ended.map(drop))
    }

    /// Everyone is in OP and well.
    fn is_operational(&self) -> bool {
        let well = self.bus.health().iter().all(|health| *health == Health::Well);
        well && self.bus.status().is_some_and(|status| {
            usize::from(status.answered) == self.subdevices.len() && status.bits == AlState::Op.bits()
        })
    }

    /// Asks everyone who still listens for INIT: one that is gone must not keep the others in OP.
    fn broadcast_init(&mut self) {
        let mut frame = FrameBuilder::new();
        let ask = [AlState::Init.bits() as u8 | AlState::ERROR as u8, 0];
        if frame.push(Command::Bwr, 0, Address::broadcast(register::AL_CONTROL), &ask).is_ok() {
            for _ in 0..BROADCAST_ATTEMPTS {
                // Where the link is gone nobody hears it; their watchdogs stop them.
                let _ = self.bus.link_mut().send(frame.bytes());
            }
        }
    }

    /// Goes on until it is known who isn't well, and notes it.
    fn find_culprits(&mut self) -> anyhow::Result<()> {
        for _ in 0..DIAGNOSIS_CYCLES {
            if self.bus.health().iter().any(|health| *health != Health::Well) {
                break;
            }
            self.one_cycle()?;
        }
        let unwell = self.bus.health().iter().zip(&self.subdevices);
        self.measured.unwell = unwell
            .filter_map(|(health, one)| {
                let words = health_words(*health)?;
                Some(format!("SubDevice {} ({}): {words}", one.position, one.name))
            })
            .collect();
        Ok(())
    }

    /// Cycles until the goal is reached; `false` where `stop` came first.
    fn reach(&mut self, goal: Goal, stop: &AtomicBool) -> anyhow::Result<bool> {
        let mut options = TransitionOptions::default();
        if goal != Goal::Op {
            // A segment that is gone is not waited for; who still hears is asked by broadcast.
            options.state_timeout = END_TIMEOUT;
        }
        self.bus.request(goal, options, self.clock.now());
        let mut shown = None;
        loop {
            match self.bus.phase() {
                Phase::Reached(_) => return Ok(true),
                Phase::Failed(error) => return Err(error.into()),
                Phase::Standby => return Ok(false),
                Phase::Moving { step, .. } => {
                    let stage = stage(step);
                    if goal == Goal::Op && shown != stage {
                        note(stage.unwrap_or("preparing SYNC0"));
                        shown = stage;
                    }
                }
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            self.one_cycle()?;
        }
    }

    /// The cycles in OP.
    fn cycle(&mut self, stop: &AtomicBool) -> anyhow::Result<()> {
        self.measured.before = self.bus.counters();
        let done = AtomicU64::new(0);
        let ended = AtomicBool::new(false);
        let (cycles, paced) = (self.plan.cycles, self.plan.paced);
        let result = std::thread::scope(|scope| {
            if paced {
                // Drawing may block: not in the thread of the cycle.
                scope.spawn(|| show_progress(cycles, &done, &ended));
            }
            let result = self.measure(stop, &done);
            ended.store(true, Ordering::Relaxed);
            result
        });
        self.measured.after = self.bus.counters();
        result
    }

    fn measure(&mut self, stop: &AtomicBool, done: &AtomicU64) -> anyhow::Result<()> {
        while self.measured.cycles < self.plan.cycles && !stop.load(Ordering::Relaxed) {
            let times = self.one_cycle()?;
            let measured = &mut self.measured;
            measured.cycles += 1;
            measured.wake_up.record(times.late_ns);
            measured.round_trip.record(times.round_trip_ns);
            if let Some(phase_ns) = times.phase_ns {
                measured.phase.record(phase_ns);
            }
            measured.overruns += u64::from(times.overrun);
            done.store(measured.cycles, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Sleeps until the cycle's instant, exchanges, and plans the next instant.
    fn one_cycle(&mut self) -> anyhow::Result<Times> {
        self.clock.sleep_until(self.wake);
        let woke = self.clock.now();
        // Where the host overslept the frame still needs its time to come back.
        let deadline = self.wake.max(woke) + self.plan.cycle * 9 / 10;
        if let Some(leader) = &self.leader {
            self.bus.steer_clock(leader.time_at(woke));
        }
        self.bus.exchange(&mut self.image, deadline)?;
        let back = self.clock.now();
        // A reading that didn't change is that of an earlier frame.
        let reading = self.bus.clock().filter(|time| self.last_clock != Some(*time));
        self.last_clock = self.bus.clock();
        let mut phase_ns = None;
        let planned = match (&mut self.follower, &mut self.leader) {
            (Some(follower), None) => {
                let next = follower.next_wake(self.wake, reading);
                phase_ns = reading.and_then(|_| follower.last_error_ns()).map(i64::unsigned_abs);
                next
            }
            (Some(follower), Some(leader)) => {
                let first = leader.time_at(woke).is_none();
                let phase = reading.map(|clock| follower.phase_error(clock));
                if let Some(clock) = reading {
                    leader.read(woke, clock);
                }
                phase_ns = phase.map(i64::unsigned_abs);
                // Once, before any SYNC0: from then on both pass alike.
                let shift = phase.filter(|_| first).map_or(0, |phase| -phase);
                let late = i64::try_from((woke - self.wake).as_nanos()).unwrap_or(0);
                let shift = if first { shift + late } else { 0 };
                HostTime((self.wake + self.plan.cycle).0.saturating_add_signed(shift))
            }
            (None, _) => self.wake + self.plan.cycle,
        };
        let times = Times {
            late_ns: (woke - self.wake).as_nanos() as u64,
            round_trip_ns: (back - woke).as_nanos() as u64,
            phase_ns,
            overrun: back > planned + self.plan.cycle,
        };
        // Missed cycles are left out, not caught up by a burst; the phase stays.
        let missed = (back - planned).as_nanos() / self.plan.cycle.as_nanos().max(1);
        self.wake = planned + self.plan.cycle * missed as u32;
        Ok(times)
    }

    /// What was measured.
    pub fn report(&self) -> Report {
        let Measured { before, after, .. } = &self.measured;
        Report {
            operational: self.measured.operational,
            cycle: self.plan.cycle,
            cycles: self.measured.cycles,
            overruns: self.measured.overruns,
            lost_frames: after.frames_lost - before.frames_lost,
            working_counter_errors: after.working_counter_errors - before.working_counter_errors,
            late_frames: after.late - before.late,
            foreign_frames: after.foreign - before.foreign,
            frames_per_cycle: self.bus.frames_per_cycle(),
            subdevices: self.subdevices.len(),
            commands_used: self.bus.commands_used().iter().map(|command| command.name()).collect(),
            unwell: self.measured.unwell.clone(),
            round_trip: (self.measured.round_trip.quantiles(), self.measured.round_trip.bars(12)),
            wake_up: (self.measured.wake_up.quantiles(), self.measured.wake_up.bars(12)),
            phase: (self.measured.phase.quantiles(), self.measured.phase.bars(12)),
        }
    }
}

/// What a SubDevice has; `None` where it is well.
fn health_words(health: Health) -> Option<String> {
    match health {
        Health::Well => None,
        Health::Silent => Some("does not answer: without power, cut off, or restarted".to_owned()),
        Health::NotOperational { status, code } => {
            let state = AlState::from_bits(status).map_or("an unknown state", AlState::name);
            Some(format!("is in {state}: {code} ({})", code.probable_cause()))
        }
    }
}

/// The stages of the way to OP that a person knows; `None` for the small steps in between.
fn stage(step: Step) -> Option<&'static str> {
    match step {
        Step::LockClocks => Some("waiting for the clocks to agree"),
        Step::Ask(AlState::SafeOp) | Step::Await(AlState::SafeOp) | Step::Settle(AlState::SafeOp) => {
            Some("to SAFE-OP")
        }
        Step::Ask(AlState::Op) | Step::Await(AlState::Op) | Step::Settle(AlState::Op) => Some("to OP"),
        _ => None,
    }
}

fn show_progress(cycles: u64, done: &AtomicU64, ended: &AtomicBool) {
    let bar = bar(cycles, "cycles");
    while !ended.load(Ordering::Relaxed) {
        bar.set_position(done.load(Ordering::Relaxed));
        std::thread::sleep(Duration::from_millis(50));
    }
    bar.finish_and_clear();
}
