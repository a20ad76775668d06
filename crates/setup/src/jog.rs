//! One drive turned slowly with little torque, while the key is held.

mod end;

use omnibase_cia402::{
    ControlWord, DriveRequest, Enabling, ErrorCode, Feedback, Mode, Progress, Settings, StatusWord, Targets,
    Wanted,
};
use omnibase_ethercat::ProcessImage;
use omnibase_ethercat::cyclic::Exchange;
use omnibase_ethercat::paced::PacedBus;
use omnibase_ethercat::wire::{Clock, Link, LinkError};

use crate::dead_man::DeadMan;
use crate::drive::DriveMap;
use crate::hand::{Hand, Key};

pub(crate) use end::astray;
use end::away;
pub use end::{JogEnd, Still};

/// Cycles that a drive may take to be disabled again.
const END_CYCLES: u32 = 1000;
/// How long a wheel that was turned may roll on when nobody drives it, ns: who looks at it sees that, too.
const ROLLING_NS: u64 = 10_000_000_000;
/// What of its speed in a jog a wheel that stands has at most.
const STANDING: f64 = 0.02;
/// Cycles in which somebody may begin to hold the key: a minute at 1 ms.
const WAITING_CYCLES: u32 = 60_000;
/// Cycles over which speed is looked at: single ones show a count more or less.
const WINDOW_CYCLES: usize = 50;
/// Cycles without an answer after which nothing is moved any more.
const LOST_CYCLES: u32 = 3;
/// A position is still that didn't follow what was told for so long at the jog's speed, ns; and for so many counts.
const STILL_NS: f64 = 5e8;
const LEAST_STILL: f64 = 10.0;
/// Cycles in which everybody is asked who doesn't answer.
const ASKED_CYCLES: u32 = 200;

/// How a drive is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogPlan {
    /// Speed in the drive's units; 0 enables it without moving.
    pub speed_units: i32,
    /// That of a jog in counts per cycle, to watch over what comes back; also where the drive shall stand.
    pub counts_per_cycle: f64,
    /// Max torque, per mille of rated.
    pub torque_per_mille: u16,
    /// Cycles until the speed is reached. It begins at a 64th of it and doubles six times: where the encoder has fewer counts
    /// than was thought the wheel turns that much faster, and whoever looks lets go in time.
    pub ramp_cycles: u32,
    /// The longest motion, cycles.
    pub most_cycles: u32,
    /// How long a beat of the key counts, and how far its first two may be apart, cycles.
    pub key_cycles: [u32; 2],
}

/// The mode in which it is turned.
pub(crate) const JOGGED_IN: Mode = Mode::CyclicSynchronousVelocity;
/// How often the speed doubles until it is reached.
const DOUBLINGS: f64 = 6.0;

impl JogPlan {
    /// The share of the speed after so many cycles.
    fn share(&self, cycles: u32) -> f64 {
        let done = f64::from(cycles) / f64::from(self.ramp_cycles.max(1));
        (-DOUBLINGS * (1.0 - done.min(1.0))).exp2()
    }
}

/// How a jog went.
#[derive(Clone, Debug, PartialEq)]
pub struct Jog {
    /// Why it ended.
    pub end: JogEnd,
    /// Counts from its beginning to its end.
    pub travel_counts: i64,
    /// Cycles in which the drive was enabled.
    pub enabled_cycles: u32,
    /// Cycles in which a speed was told.
    pub moving_cycles: u32,
    /// The position didn't change any more.
    pub still: Option<Still>,
    /// Cycles in whose frames the drive was told to be in operation though no key was held, by the bytes themselves, until it was
    /// disabled; must be 0.
    pub unheld_cycles: u32,
}

/// One drive of a bus that is in OP.
pub struct Jogger<'a, L: Link, C: Clock> {
    /// The bus.
    pub paced: &'a mut PacedBus<L, C>,
    /// Its image.
    pub image: &'a mut ProcessImage,
    /// Its outputs while nobody is told anything: control words are zero, so drives are disabled.
    pub rest: &'a [u8],
    /// Where the drive's objects stand.
    pub map: &'a DriveMap,
    /// The cycle, ns.
    pub cycle_ns: u64,
}

/// When the key was let go.
struct Ended {
    cycles: u32,
    position: i32,
}

/// Since when the position stays the same.
#[derive(Default)]
struct Stillness {
    cycles: u32,
    /// What was told meanwhile, counts.
    told: f64,
    others_changed: bool,
    /// Those of the cycle before.
    inputs: Vec<u8>,
}

impl Stillness {
    fn cycle(&mut self, step: i64, told: f64, inputs: &[u8], others: &[std::ops::Range<usize>]) {
        if step != 0 {
            (self.cycles, self.told, self.others_changed) = (0, 0.0, false);
        } else if told != 0.0 {
            self.cycles += 1;
            self.told += told.abs();
            self.others_changed |=
                others.iter().any(|range| inputs[range.clone()] != self.inputs[range.clone()]);
        }
        self.inputs.copy_from_slice(inputs);
    }

    /// Whether it is worth a word: a wheel takes a while until it follows.
    fn end(&self, plan: &JogPlan, cycle_ns: u64, position: i32) -> Option<Still> {
        let least = plan.counts_per_cycle.abs() * STILL_NS / cycle_ns as f64;
        let seconds = f64::from(self.cycles) * cycle_ns as f64 / 1e9;
        (self.cycles > 0 && self.told >= least.max(LEAST_STILL)).then_some(Still {
            seconds,
            position,
            others_changed: self.others_changed,
        })
    }
}

/// What the drive is told in a cycle.
#[derive(Clone, Copy)]
struct Told {
    wanted: Wanted,
    speed_units: i32,
    torque_per_mille: u16,
}

/// What the drive said in a cycle.
#[derive(Clone, Copy)]
struct DriveInputs {
    feedback: Feedback,
    position: i32,
}

impl<L: Link, C: Clock> Jogger<'_, L, C> {
    /// Turns the drive while `hand` holds its key; however it ends the drive is disabled, but where the port itself fails: then
    /// the drive's own watchdog does that.
    pub fn run(&mut self, plan: &JogPlan, hand: &mut dyn Hand) -> Result<Jog, LinkError> {
        let mut key = DeadMan::new(plan.key_cycles[0], plan.key_cycles[1]);
        let mut enabling = Enabling::new(Settings::default());
        let mut jog = Jog {
            end: JogEnd::NeverHeld,
            travel_counts: 0,
            enabled_cycles: 0,
            moving_cycles: 0,
            still: None,
            unheld_cycles: 0,
        };
        let mut stillness = Stillness { inputs: self.image.inputs.to_vec(), ..Stillness::default() };
        let mut speeds = [0.0; WINDOW_CYCLES];
        let (mut lost, mut ramp, mut cycles, mut was_held, mut is_told) = (0, 0, 0u32, false, false);
        let (mut last, mut periods) = (self.inputs().position, 1);
        let end = loop {
            let held = key.cycle(hand.key(), periods);
            cycles += 1;
            if held && !was_held {
                // What it failed by before was told.
                enabling.acknowledge();
            }
            was_held |= held;
            if key.is_gone() {
                break JogEnd::Gone;
            }
            if !held && (was_held || cycles > WAITING_CYCLES) {
                break if was_held { JogEnd::LetGo } else { JogEnd::NeverHeld };
            }
            if jog.enabled_cycles >= plan.most_cycles {
                break JogEnd::Longest;
            }
            let inputs = self.inputs();
            let wanted = if held { Wanted::OperationEnabled } else { Wanted::SwitchOnDisabled };
            let running = held && jog.enabled_cycles > 0;
            ramp = if running { (ramp + 1).min(plan.ramp_cycles.max(1)) } else { 0 };
            let share = if ramp == 0 { 0.0 } else { plan.share(ramp) };
            let speed = (f64::from(plan.speed_units) * share).round() as i32;
            let told = Told { wanted, speed_units: speed, torque_per_mille: plan.torque_per_mille };
            let progress = self.advance(&mut enabling, u64::from(cycles), told, inputs);
            match progress {
                Progress::Running => {
                    jog.enabled_cycles += 1;
                    jog.moving_cycles += u32::from(speed != 0);
                }
                // While others are lost it may be by them: that is told then.
                Progress::Stopped(problem) if was_held && lost == 0 => {
                    break JogEnd::Drive(problem.to_string());
                }
                Progress::Stopped(problem) if !was_held && !is_told => {
                    hand.remark(&format!("{problem}; whoever holds the key acknowledges that"));
                    is_told = true;
                }
                _ => {}
            }
            jog.unheld_cycles += u32::from(!key.is_held() && self.is_enabled_by());
            let (exchange, times) = self.paced.exchange(self.image)?;
            periods = times.periods;
            lost = if exchange == Exchange::Complete { 0 } else { lost + 1 };
            if lost > LOST_CYCLES {
                break JogEnd::Lost(String::new());
            }
            let position = self.inputs().position;
            let step = i64::from(position.wrapping_sub(last));
            last = position;
            jog.travel_counts += step;
            hand.moves(progress == Progress::Running, jog.travel_counts as f64);
            if progress == Progress::Running && exchange == Exchange::Complete {
                let told = if speed == 0 { 0.0 } else { plan.counts_per_cycle * share };
                stillness.cycle(step, told, &self.image.inputs, &self.map.others);
            }
            speeds[cycles as usize % WINDOW_CYCLES] = step as f64;
            let told = if plan.speed_units == 0 { 0.0 } else { plan.counts_per_cycle * share };
            let seen = runs_away(&speeds, told).or_else(|| {
                let stands = running && told == 0.0;
                stands.then(|| leaves_its_place(&speeds, plan.counts_per_cycle)).flatten()
            });
            if let Some(seen) = seen {
                break JogEnd::Runaway { told, seen };
            }
        };
        jog.end = end;
        jog.still = stillness.end(plan, self.cycle_ns, last);
        let from = Ended { cycles, position: last };
        self.end(plan, hand, &mut enabling, from, &mut jog)?;
        if let JogEnd::Lost(words) = &mut jog.end {
            *words = self.who_is_away()?;
        }
        hand.moves(false, jog.travel_counts as f64);
        Ok(jog)
    }

    /// Enables the drive without moving it, as long as `hand` holds its key and at most as long as the plan says.
    pub fn hold(&mut self, plan: &JogPlan, hand: &mut dyn Hand) -> Result<Jog, LinkError> {
        self.run(&JogPlan { speed_units: 0, ..*plan }, hand)
    }

    /// Tells the drive nothing for so many cycles, so it stays disabled; how far it moved all the same, counts from the least
    /// to the greatest position; in words who didn't answer where frames were lost, for then nobody saw it.
    pub fn watch(&mut self, cycles: u32) -> Result<Result<i64, String>, LinkError> {
        self.image.outputs.copy_from_slice(self.rest);
        self.paced.exchange(self.image)?;
        let mut last = self.inputs().position;
        let (mut travel, mut least, mut greatest, mut lost) = (0i64, 0, 0, 0);
        for _ in 0..cycles {
            let (exchange, _) = self.paced.exchange(self.image)?;
            lost = if exchange == Exchange::Complete { 0 } else { lost + 1 };
            if lost > LOST_CYCLES {
                return Ok(Err(self.who_is_away()?));
            }
            let position = self.inputs().position;
            travel += i64::from(position.wrapping_sub(last));
            last = position;
            (least, greatest) = (travel.min(least), travel.max(greatest));
        }
        Ok(Ok(greatest - least))
    }

    /// Who doesn't answer, or isn't in OP any more, in words; nobody is told anything meanwhile.
    fn who_is_away(&mut self) -> Result<String, LinkError> {
        self.image.outputs.copy_from_slice(self.rest);
        let mut last = Exchange::Complete;
        for _ in 0..ASKED_CYCLES {
            (last, _) = self.paced.exchange(self.image)?;
        }
        Ok(away(self.paced.bus(), last))
    }

    /// Whether the drive is told to be in operation by the frame that leaves next.
    fn is_enabled_by(&self) -> bool {
        let at = self.map.control.start;
        enables([self.image.outputs[at], self.image.outputs[at + 1]])
    }

    fn inputs(&self) -> DriveInputs {
        let inputs = &self.image.inputs;
        let word = |range: &std::ops::Range<usize>| {
            u16::from_le_bytes([inputs[range.start], inputs[range.start + 1]])
        };
        let map = self.map;
        let at = map.position.start;
        let position = i32::from_le_bytes([inputs[at], inputs[at + 1], inputs[at + 2], inputs[at + 3]]);
        let feedback = Feedback {
            status: StatusWord(word(&map.status)),
            mode_code: map.mode_shown.as_ref().map(|range| inputs[range.start] as i8),
            actual: Targets { position_counts: position, ..Targets::default() },
            error: map.error.as_ref().map(|range| ErrorCode(word(range))),
        };
        DriveInputs { feedback, position }
    }

    fn advance(&mut self, enabling: &mut Enabling, cycle: u64, told: Told, inputs: DriveInputs) -> Progress {
        let Told { wanted, speed_units, torque_per_mille } = told;
        let targets = Targets { velocity_units: speed_units, ..Targets::default() };
        let request = DriveRequest { wanted, mode: JOGGED_IN, targets };
        let output = enabling.advance(cycle * self.cycle_ns, &inputs.feedback, &request);
        let map = self.map;
        let mut put = |range: &std::ops::Range<usize>, bytes: &[u8]| {
            self.image.outputs[range.clone()].copy_from_slice(bytes);
        };
        put(&map.control, &output.control.0.to_le_bytes());
        // What isn't running is told to stand, whatever fades.
        let velocity = if output.progress == Progress::Running { output.targets.velocity_units } else { 0 };
        put(&map.velocity, &velocity.to_le_bytes());
        if let Some(mode) = &map.mode {
            put(mode, &output.mode.code().to_le_bytes());
        }
        if let Some(limit) = &map.torque_limit {
            put(limit, &torque_per_mille.to_le_bytes());
        }
        output.progress
    }

    /// Until the drive is disabled and its wheel stands; how far it went on, and whether a frame enabled it all the same, counts for the
    /// jog.
    fn end(
        &mut self,
        plan: &JogPlan,
        hand: &mut dyn Hand,
        enabling: &mut Enabling,
        Ended { cycles, position: mut last }: Ended,
        jog: &mut Jog,
    ) -> Result<(), LinkError> {
        let rolling = if plan.speed_units == 0 { 0 } else { (ROLLING_NS / self.cycle_ns.max(1)) as u32 };
        let mut steps = [0; WINDOW_CYCLES];
        for cycle in 1..=END_CYCLES.max(rolling) {
            let inputs = self.inputs();
            let step = i64::from(inputs.position.wrapping_sub(last));
            jog.travel_counts += step;
            last = inputs.position;
            steps[cycle as usize % WINDOW_CYCLES] = step;
            let nothing = Told { wanted: Wanted::SwitchOnDisabled, speed_units: 0, torque_per_mille: 0 };
            let progress = self.advance(enabling, u64::from(cycles + cycle), nothing, inputs);
            jog.unheld_cycles += u32::from(self.is_enabled_by());
            self.paced.exchange(self.image)?;
            let is_disabled = matches!(progress, Progress::Holding(_) | Progress::Stopped(_));
            let rolls = steps.iter().sum::<i64>().abs() as f64;
            let stands = rolls <= (STANDING * WINDOW_CYCLES as f64 * plan.counts_per_cycle.abs()).max(1.0);
            let may_roll = cycle < rolling && !stands && hand.key() != Key::Gone;
            let is_over = if is_disabled { !may_roll } else { cycle >= END_CYCLES };
            if cycle > WINDOW_CYCLES as u32 && is_over {
                break;
            }
        }
        self.image.outputs.copy_from_slice(self.rest);
        self.paced.exchange(self.image)?;
        Ok(())
    }
}

/// Whether the two bytes of a control word tell a drive to be in operation.
pub(crate) fn enables(control: [u8; 2]) -> bool {
    ControlWord(u16::from_le_bytes(control)).contains(ControlWord::COMMAND_ENABLE_OPERATION)
}

/// The counts per cycle of a drive that turns three times as fast as it is told, or as fast the other way.
fn runs_away(speeds: &[f64; WINDOW_CYCLES], told: f64) -> Option<f64> {
    let seen = speeds.iter().sum::<f64>() / WINDOW_CYCLES as f64;
    let along = seen * told.signum();
    let bound = told.abs().max(0.2);
    (told != 0.0 && (along > 3.0 * bound || along < -bound)).then_some(seen)
}

/// The counts per cycle of a drive that turns three times as fast as in a jog though it shall stand.
fn leaves_its_place(speeds: &[f64; WINDOW_CYCLES], usual: f64) -> Option<f64> {
    let seen = speeds.iter().sum::<f64>() / WINDOW_CYCLES as f64;
    (seen.abs() > 3.0 * usual.abs().max(0.2)).then_some(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_that_shall_stand_runs_away_in_either_direction() {
        for speed in [31.0, -31.0] {
            assert_eq!(leaves_its_place(&[speed; WINDOW_CYCLES], 10.0), Some(speed));
            assert_eq!(runs_away(&[speed; WINDOW_CYCLES], 0.0), None);
        }
        assert_eq!(leaves_its_place(&[-29.0; WINDOW_CYCLES], 10.0), None);
    }

    #[test]
    fn a_drive_that_turns_runs_away_against_its_way_and_far_beyond_its_speed() {
        assert_eq!(runs_away(&[-11.0; WINDOW_CYCLES], 10.0), Some(-11.0));
        assert_eq!(runs_away(&[31.0; WINDOW_CYCLES], 10.0), Some(31.0));
        assert_eq!(runs_away(&[29.0; WINDOW_CYCLES], 10.0), None);
    }
}
