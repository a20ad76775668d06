//! The cycle of `exchange`: to OP, cycle and measure, and back to INIT.

use super::report::Report;
use crate::progress::{bar, note, warn};
use crate::target::AnyClock;
use omnibase_ethercat::ProcessImage;
use omnibase_ethercat::cyclic::{
    AcyclicRequest, AcyclicWork, CycleCounters, Exchange as BusExchange, Goal, Handover, Health,
    RegisterAccess, Step, TransitionOptions, TransitionStatus,
};
use omnibase_ethercat::paced::{Pace, PacedBus};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::trouble::{self, Counted};
use omnibase_ethercat::wire::{AlState, Clock, Link, register};
use omnibase_measure::pauses::Pauses;
use omnibase_measure::timing::{TimedCycle, Timing};
use omnibase_robot::signals::{CycleTime, Exchange};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// After so long without any frame back nobody answers any more.
const SILENCE: Duration = Duration::from_millis(500);
/// Cycles that the search for culprits may take.
const DIAGNOSIS_CYCLES: u32 = 300;

/// Cycles that a look at one SubDevice's counters may take.
const LOOK_CYCLES: u32 = 20;

/// What to do.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// When frames go.
    pub pace: Pace,
    /// Cycles in OP.
    pub cycles: u64,
    /// Whether it takes real time, so that progress is worth showing.
    pub paced: bool,
}

/// Runs the cycle.
pub struct Runner {
    paced: PacedBus<Box<dyn Link>, AnyClock>,
    subdevices: Vec<SubDevice>,
    image: ProcessImage,
    plan: Plan,
    measured: Measured,
}

/// What is measured in OP.
struct Measured {
    timing: Timing,
    pauses: Pauses,
    cycles: u64,
    /// Cycles that were left out.
    overruns: u64,
    operational: bool,
    not_operational: Vec<String>,
    /// Where frames were damaged, links lost and firmware silent, in words.
    damage: Vec<String>,
    /// How many more answered in the end than were set up.
    surplus: usize,
    before: CycleCounters,
    after: CycleCounters,
}

impl Runner {
    /// A cycle over a segment in PRE-OP.
    pub fn new(handover: Handover<Box<dyn Link>, AnyClock>, plan: Plan) -> Self {
        let Handover { bus, clock, subdevices } = handover;
        let image = bus.plan().image();
        let paced = PacedBus::new(bus, clock, plan.pace);
        let measured = Measured {
            timing: Timing::default(),
            pauses: Pauses::new(plan.pace.cycle, plan.pace.timeout),
            cycles: 0,
            overruns: 0,
            operational: false,
            not_operational: Vec::new(),
            damage: Vec::new(),
            surplus: 0,
            before: CycleCounters::default(),
            after: CycleCounters::default(),
        };
        Runner { paced, subdevices, image, plan, measured }
    }

    /// To OP, all cycles, and back to INIT; an error says what ended it early.
    pub fn run(&mut self, stop: &AtomicBool) -> anyhow::Result<()> {
        let began = self.paced.clock().now();
        let ran = self.reach_op(stop).and_then(|reached| {
            if !reached {
                return Ok(());
            }
            let took = self.paced.clock().now() - began;
            note(format_args!("OP after {:.3} s of bus time", took.as_secs_f64()));
            // What is counted from here on counts.
            let cleared = self.look(0, RegisterAccess::WriteAll, register::WATCHDOG_COUNTER, 2)?;
            self.cycle(stop)?;
            self.measured.operational = self.is_operational();
            let answered = self.paced.bus().status().map_or(0, |status| usize::from(status.answered));
            self.measured.surplus = answered.saturating_sub(self.subdevices.len());
            if !self.measured.operational {
                self.find_culprits()?;
            }
            if cleared.is_some() {
                self.find_hung()?;
            }
            self.find_damage()
        });
        // Nobody is there to be led back; the broadcast that asks all for INIT goes out all the same.
        if is_silent(&self.paced, self.plan.pace.cycle) {
            return ran;
        }
        // Whatever happened, drives shall not be left in OP.
        let Runner { paced, image, .. } = self;
        let ended = paced.end(|paced| paced.exchange(image).map(drop));
        // Who isn't operational is named already, and may not hear the way to INIT.
        match ended {
            Err(untold) if !self.measured.not_operational.is_empty() => {
                warn(format_args!("{untold}"));
                ran
            }
            ended => ran.and(ended.map_err(anyhow::Error::from)),
        }
    }

    /// Everyone is in OP and answering. Where more answer than were set up, their states can't be told from the others' at once:
    /// the health of each tells.
    fn is_operational(&self) -> bool {
        let operational = self.paced.bus().health().iter().all(|health| *health == Health::Operational);
        operational
            && self.paced.bus().status().is_some_and(|status| {
                let (answered, expected) = (usize::from(status.answered), self.subdevices.len());
                answered > expected || answered == expected && status.bits == AlState::Op.bits()
            })
    }

    /// Goes on until it is known who isn't operational, and notes it.
    fn find_culprits(&mut self) -> anyhow::Result<()> {
        for _ in 0..DIAGNOSIS_CYCLES {
            if self.paced.bus().health().iter().any(|health| *health != Health::Operational) {
                break;
            }
            self.paced.exchange(&mut self.image)?;
        }
        let not_operational = self.paced.bus().health().iter().zip(&self.subdevices);
        self.measured.not_operational = not_operational
            .filter_map(|(health, one)| {
                let words = health_words(*health)?;
                Some(format!("SubDevice {} ({}): {words}", one.position, one.name))
            })
            .collect();
        Ok(())
    }

    /// Where frames got lost or came back incomplete: the SubDevices' error counters tell which cable damaged some.
    fn find_damage(&mut self) -> anyhow::Result<()> {
        let Measured { before, after, .. } = &self.measured;
        let missed = after.frames_lost + after.working_counter_errors;
        if missed == before.frames_lost + before.working_counter_errors {
            return Ok(());
        }
        for number in 0..self.subdevices.len() {
            let (way, counters) = (RegisterAccess::Read, register::RX_ERROR_COUNTERS);
            if let Some(data) = self.look(number, way, counters, trouble::COUNTERS)? {
                let found = trouble::of_counters(&self.subdevices, number, &data, Counted::Now);
                self.measured.damage.extend(found.iter().map(ToString::to_string));
            }
        }
        Ok(())
    }

    /// Whose firmware hangs, or did: its chip answers from OP all the same, with inputs that stand still. The chips' watchdogs
    /// of their processors tell (PDI watchdog, 0x0410); one that has it off isn't watched.
    fn find_hung(&mut self) -> anyhow::Result<()> {
        let (read, counter) = (RegisterAccess::Read, register::WATCHDOG_COUNTER);
        let times = |data: Option<Vec<u8>>| data.map_or(0, |data| data[1]);
        if times(self.look(0, RegisterAccess::ReadAll, counter, 2)?) == 0 {
            return Ok(());
        }
        for number in 0..self.subdevices.len() {
            let times = times(self.look(number, read, counter, 2)?);
            let Some(status) = self.look(number, read, register::DL_STATUS, 2)?.filter(|_| times > 0) else {
                continue;
            };
            let one = &self.subdevices[number];
            let words = format!("SubDevice {} ({}): its firmware ", one.position, one.name);
            if u16::from(status[0]) & register::PDI_WATCHDOG_RUNS == 0 {
                self.measured.operational = false;
                let words = format!(
                    "{words}hangs: its processor is silent for longer than its PDI watchdog (0x0410) allows"
                );
                self.measured.not_operational.push(words);
            } else {
                let words =
                    format!("{words}hung {times} times for longer than its PDI watchdog (0x0410) allows");
                self.measured.damage.push(words);
            }
        }
        Ok(())
    }

    /// Reads registers of one, or of all, beside the exchange; `None` where nobody answers in time.
    fn look(
        &mut self,
        number: usize,
        way: RegisterAccess,
        register: u16,
        length: usize,
    ) -> anyhow::Result<Option<Vec<u8>>> {
        let Some(one) = self.subdevices.get(number) else { return Ok(None) };
        let work = AcyclicWork::Registers { way, register, data: vec![0; length] };
        let request = AcyclicRequest { tag: 0, position: one.position, work };
        if self.paced.bus_mut().submit(request).is_err() {
            return Ok(None);
        }
        for _ in 0..LOOK_CYCLES {
            self.paced.exchange(&mut self.image)?;
            let Some(answer) = self.paced.bus_mut().poll_completion() else { continue };
            return Ok(match (answer.result, answer.work) {
                (Ok(()), AcyclicWork::Registers { data, .. }) => Some(data),
                _ => None,
            });
        }
        Ok(None)
    }

    /// Cycles until everyone is in OP; `false` where `stop` came first.
    fn reach_op(&mut self, stop: &AtomicBool) -> anyhow::Result<bool> {
        let Runner { paced, image, plan, .. } = self;
        let (mut shown, mut silent) = (None, None);
        let (cycle, gone) = (plan.pace.cycle, AtomicBool::new(false));
        let reached = paced.reach(Goal::Op, TransitionOptions::default(), &gone, |paced| {
            if let TransitionStatus::Moving { step, .. } = paced.bus().transition() {
                let stage = stage(*step);
                if shown != stage {
                    note(stage.unwrap_or("preparing SYNC0"));
                    shown = stage;
                }
            }
            if silent.is_none() && is_silent(paced, cycle) {
                silent = Some(paced.bus().nothing_back());
                gone.store(true, Ordering::Relaxed);
            }
            if stop.load(Ordering::Relaxed) {
                gone.store(true, Ordering::Relaxed);
            }
            paced.exchange(image).map(drop)
        });
        match silent {
            Some(cycles) => Err(nobody_answers(cycles, cycle)),
            None => Ok(reached?),
        }
    }

    /// The cycles in OP.
    fn cycle(&mut self, stop: &AtomicBool) -> anyhow::Result<()> {
        self.measured.before = self.paced.bus().counters();
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
        self.measured.after = self.paced.bus().counters();
        result
    }

    fn measure(&mut self, stop: &AtomicBool, done: &AtomicU64) -> anyhow::Result<()> {
        let cycle_ns = self.plan.pace.cycle.as_nanos() as u64;
        let mut index = 0;
        while self.measured.cycles < self.plan.cycles && !stop.load(Ordering::Relaxed) {
            let (exchange, times) = self.paced.exchange(&mut self.image)?;
            index += times.periods;
            let measured = &mut self.measured;
            let (time, exchange) = (CycleTime::on_grid(index, cycle_ns), without_robot(exchange));
            measured.pauses.take(&times, matches!(exchange, Exchange::Lost));
            measured.timing.take(&TimedCycle { time, exchange, times, compute_ns: None, robot: None });
            measured.cycles += 1;
            measured.overruns += times.periods - 1;
            done.store(measured.cycles, Ordering::Relaxed);
            if is_silent(&self.paced, self.plan.pace.cycle) {
                return Err(nobody_answers(self.paced.bus().nothing_back(), self.plan.pace.cycle));
            }
        }
        Ok(())
    }

    /// What was measured.
    pub fn report(&self) -> Report {
        let Measured { before, after, .. } = &self.measured;
        Report {
            operational: self.measured.operational,
            cycle: self.plan.pace.cycle,
            cycles: self.measured.cycles,
            overruns: self.measured.overruns,
            lost_frames: after.frames_lost - before.frames_lost,
            working_counter_errors: after.working_counter_errors - before.working_counter_errors,
            late_frames: after.late - before.late,
            foreign_frames: after.foreign - before.foreign,
            frames_per_cycle: self.paced.bus().frames_per_cycle(),
            subdevices: self.subdevices.len(),
            commands_used: self.paced.bus().commands_used().iter().map(|command| command.name()).collect(),
            not_operational: self.measured.not_operational.clone(),
            damage: self.measured.damage.clone(),
            surplus: self.measured.surplus,
            pauses: self.measured.pauses,
            timing: self.measured.timing.figures(&[]),
        }
    }
}

/// Whether nothing at all has come back for so long that nobody is there any more.
fn is_silent(paced: &PacedBus<Box<dyn Link>, AnyClock>, cycle: Duration) -> bool {
    let cycles = SILENCE.as_nanos().div_ceil(cycle.as_nanos().max(1)).max(2);
    u128::from(paced.bus().nothing_back()) >= cycles
}

fn nobody_answers(cycles: u64, cycle: Duration) -> anyhow::Error {
    anyhow::anyhow!(
        "no frame has come back for {} ms ({cycles} cycles): the segment lost power, its first cable is out, or the simulator \
         that answered has ended",
        cycle.as_millis() as u64 * cycles
    )
}

/// An exchange in the words of a robot's, here without one.
fn without_robot(exchange: BusExchange) -> Exchange {
    match exchange {
        BusExchange::Complete => Exchange::Complete,
        BusExchange::Lost { .. } => Exchange::Lost,
        BusExchange::ShortCount { expected, received, .. } => Exchange::ShortCount { expected, received },
        BusExchange::Without { .. } => Exchange::Without { wheels: 0, devices: 0 },
    }
}

/// What a SubDevice has; `None` where it is operational.
fn health_words(health: Health) -> Option<String> {
    match health {
        Health::Operational => None,
        Health::Silent => Some("does not answer: without power, cut off, or restarted".to_owned()),
        Health::NotAlone => Some(
            "isn't alone: another SubDevice answers at its address, which it kept of another start; switch that off and on"
                .to_owned(),
        ),
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
        Step::Sdos => Some("writing what is for SAFE-OP"),
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
