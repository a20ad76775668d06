//! Whose clock is off, and by how much.
//!
//! A reading whose instant is δ too early tells what will be: it is off by δ times the change of what it tells. What that makes of
//! all that is estimated is followed along with it, reading by reading, so that of each reading is known what such a fault would
//! make of it, and what all of them tell of δ together (generalized likelihood ratio: Willsky and Jones, *IEEE Trans. Automatic
//! Control* 21, 1976). Wheels that lag, as those do that slip while they are accelerated, count as one whose clock is off: where they
//! explain what is seen about as well, no sensor is named, nor where two sensors explain it alike. In even motion nothing changes, and
//! nothing can be seen.

use super::{Knowledge, rates};
use crate::belief::{Along, Innovation, STATES};
use crate::sensor::{MAX_RATES, Sensor, SensorKind};
use crate::standing::Verdict;

/// By so much clocks are off, where they are, s.
const USUAL_S: f64 = 0.05;
/// What was seen is remembered so long, s.
const MEMORY_S: f64 = 1.0;
/// Clocks that are off by less are never named, s.
const LEAST_OFF_S: f64 = 0.02;
/// What is seen is beyond chance by so much: chi² with one degree of freedom.
const SURE: f64 = 25.0;
/// What is so far beyond chance counts in the covariance of the pose.
const SEEMS: f64 = 7.0;
/// And explains so much more of it than any other clock, as chi².
const MARGIN: f64 = 10.0;
/// Of what sensors are off beyond chance a clock explains so much.
const EXPLAINED: f64 = 0.5;
/// The places of the wheels' clocks behind those of the sensors: as their way and as their turn lag.
pub(super) const WHEELS: [usize; 2] = [MAX_RATES, MAX_RATES + 1];
/// All clocks.
pub const CLOCKS: usize = MAX_RATES + 2;

/// By how much a reading changes with each clock in a second.
pub(super) type Changes<const M: usize> = [Option<[f64; M]>; CLOCKS];

/// What readings tell of a clock: weight times seconds, and weight, 1/s and 1/s²; and how much they are off beyond chance, as chi².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Told {
    seconds: f64,
    weight: f64,
    beyond: f64,
}

impl Told {
    fn add(&mut self, other: Told) {
        self.seconds += other.seconds;
        self.weight += other.weight;
        self.beyond += other.beyond;
    }
}

/// What is known of a clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// What a second makes of all that is estimated by which its instants are too early.
    pub(super) drawn: Along,
    told: Told,
}

impl Default for Clock {
    fn default() -> Self {
        Clock { drawn: [0.0; STATES], told: Told::default() }
    }
}

impl Clock {
    /// How much too early its instants are, s; negative where they are too late. Until it is told better, by nothing much.
    fn early_s(&self) -> f64 {
        self.told.seconds * self.variance_s2()
    }

    /// The variance of that.
    fn variance_s2(&self) -> f64 {
        1.0 / (self.told.weight + USUAL_S.powi(-2))
    }

    /// How much of what is seen it explains: chi².
    fn explains(&self) -> f64 {
        self.told.seconds * self.early_s()
    }

    /// How a whitened reading changes with it, beside what it made of all that is estimated.
    fn change<const M: usize>(&self, innovation: &Innovation<M>, change: [f64; M]) -> [f64; M] {
        let mut change = change;
        for (change, known) in change.iter_mut().zip(innovation.rows.of(&self.drawn)) {
            *change -= known;
        }
        innovation.whiten(change)
    }
}

fn told<const M: usize>(change: [f64; M], innovation: &Innovation<M>) -> Told {
    let off = innovation.whiten(innovation.off());
    let sum = |one: [f64; M], other: [f64; M]| -> f64 {
        one.iter().zip(other).map(|(one, other)| one * other).sum()
    };
    Told { seconds: sum(change, off), weight: sum(change, change), beyond: innovation.nis - M as f64 }
}

impl Knowledge {
    /// What is known of a sensor's clock: how much too early its instants are, and the standard deviation of that, s.
    pub(crate) fn clock_s(&self, rate: usize) -> Option<[f64; 2]> {
        self.clocks.get(rate).map(|clock| [clock.early_s(), clock.variance_s2().sqrt()])
    }

    /// What clocks that seem to be off may have made of the pose: its covariance, xx, xy, xψ, yy, yψ, ψψ.
    pub(crate) fn by_clocks(&self) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for clock in self.clocks.iter().filter(|clock| clock.explains() > SEEMS) {
            let [x, y, turn, ..] = clock.drawn;
            let off_s2 = clock.early_s().powi(2) + clock.variance_s2();
            for (sum, product) in sum.iter_mut().zip([x * x, x * y, x * turn, y * y, y * turn, turn * turn]) {
                *sum += off_s2 * product;
            }
        }
        sum
    }

    /// Time passes.
    pub(super) fn forget_clocks(&mut self, time_s: f64) {
        let keep = (-time_s / MEMORY_S).exp();
        for Clock { drawn, told, .. } in &mut self.clocks {
            *told =
                Told { seconds: keep * told.seconds, weight: keep * told.weight, beyond: keep * told.beyond };
            drawn.iter_mut().for_each(|drawn| *drawn *= keep);
        }
    }

    /// Takes a reading in. `is_new`: what it tells of clocks isn't known yet.
    pub(super) fn take_in<const M: usize>(
        &mut self,
        innovation: &Innovation<M>,
        changes: Changes<M>,
        is_new: bool,
    ) {
        let whitened = innovation.whitened();
        for (clock, change) in self.clocks.iter_mut().zip(changes) {
            let changes = clock.change(innovation, change.unwrap_or([0.0; M]));
            if is_new {
                clock.told.add(told(changes, innovation));
            }
            for (change, moves) in changes.iter().zip(&whitened.moves) {
                for (drawn, moved) in clock.drawn.iter_mut().zip(moves) {
                    *drawn += change * moved;
                }
            }
        }
        self.belief.correct(&whitened);
    }

    /// A reading that isn't taken in tells of its own clock alone.
    pub(super) fn leave_out<const M: usize>(
        &mut self,
        rate: usize,
        innovation: &Innovation<M>,
        changes: Changes<M>,
    ) {
        let clock = &mut self.clocks[rate];
        let change = clock.change(innovation, changes[rate].unwrap_or([0.0; M]));
        clock.told.add(told(change, innovation));
    }

    /// Names a sensor whose clock is off. What that made is undone where poses agree, and counts in the covariance elsewhere.
    pub(super) fn judge_clocks(&mut self, sensors: &[Sensor], end_ns: u64) {
        let is_placed_by_poses = sensors
            .iter()
            .zip(&self.standings)
            .any(|(sensor, standing)| sensor.kind == SensorKind::Pose && standing.agrees_now(end_ns));
        for (rate, (place, _)) in rates(sensors) {
            let clock = &self.clocks[rate];
            let off_s = clock.early_s();
            if !self.standings[place].is_new() {
                continue;
            }
            if !self.standings[place].is_believed() {
                if off_s.abs() > 0.5 * LEAST_OFF_S && clock.explains() > SURE {
                    self.standings[place].name(end_ns, Verdict::Contradicts);
                }
                continue;
            }
            let explain = |clock: usize| self.clocks[clock].explains();
            let others = (0..MAX_RATES).filter(|other| *other != rate).map(explain).fold(0.0, f64::max);
            let most = others.max(explain(WHEELS[0]) + explain(WHEELS[1]));
            let is_off = off_s.abs() > LEAST_OFF_S
                && clock.explains() > SURE.max(most + MARGIN)
                && clock.explains() > EXPLAINED * clock.told.beyond;
            if !is_off {
                continue;
            }
            let clock = *clock;
            let mut left_s2 = clock.variance_s2();
            if is_placed_by_poses {
                self.belief.shift(&clock.drawn.map(|drawn| -off_s * drawn));
            } else {
                // Nobody would see it if that were wrong.
                left_s2 += off_s * off_s;
            }
            self.belief.widen_along(&clock.drawn, left_s2);
            self.clocks = Default::default();
            self.clocks[rate] = Clock { drawn: [0.0; STATES], ..clock };
            self.standings[place].name(end_ns, Verdict::Contradicts);
        }
    }
}
