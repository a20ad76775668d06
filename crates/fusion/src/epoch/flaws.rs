//! What of a sensor is off, and by how much: its clock, or how much it tells of what it measures.
//!
//! A reading whose instant is δ too early tells what will be: it is off by δ times the change of what it tells; one that tells a share κ
//! too little is off by κ times that itself. What such a flaw makes of all that is estimated is followed along with it, reading by
//! reading, so that of each reading is known what it would make of it, and what all of them tell of it together (generalized
//! likelihood ratio: Willsky and Jones, *IEEE Trans. Automatic Control* 21, 1976). Wheels that lag, as those do that slip while they
//! are accelerated, count as one more: where they explain what is seen about as well, no sensor is named, nor where two sensors explain
//! it alike. In even motion nothing tells of clocks, and at rest nothing of shares.

use super::lags::sees;
use super::{Knowledge, rates};
use crate::belief::{Along, Innovation, STATES};
use crate::sensor::{MAX_RATES, MAX_SENSORS, Sensor, SensorKind};
use crate::standing::Verdict;

/// By so much clocks are off, where they are, s; what is told too little, where it is, as a share; and clocks of poses.
const USUAL: [f64; 3] = [0.05, 1.0, 0.05];
/// What was seen of them is remembered so long, s. In even motion nothing is seen of a clock, but poses stay as wrong by it.
const MEMORY_S: [f64; 3] = [1.0, 8.0, 20.0];
/// Clocks that are off by less are never named, s.
const LEAST_OFF_S: f64 = 0.02;
/// Shares of what is measured that are off by less are never named.
const LEAST_OFF: f64 = 0.5;
/// A gyro that was named is believed again, and counts in full, when it is known to tell all of what it measures but so much.
const SHOWN: f64 = 0.25;
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
/// The places behind them, of what each sensor tells too little.
pub(super) const SHARES: usize = MAX_RATES + 2;
/// The places behind them, of the clocks of poses: sensor by sensor.
pub(super) const POSES: usize = SHARES + MAX_RATES;
/// All flaws.
pub const FLAWS: usize = POSES + MAX_SENSORS;

/// Which kind of flaw has a place.
fn kind_of(place: usize) -> usize {
    usize::from(place >= SHARES) + usize::from(place >= POSES)
}

/// By how much a reading changes with one of each flaw: with a second, or with all that it measures.
pub(super) type Changes<const M: usize> = [Option<[f64; M]>; FLAWS];

/// What readings tell of a flaw: weight times its size, and weight; and how much they are off beyond chance, as chi².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Told {
    times_size: f64,
    weight: f64,
    beyond: f64,
}

impl Told {
    fn add(&mut self, other: Told) {
        self.times_size += other.times_size;
        self.weight += other.weight;
        self.beyond += other.beyond;
    }
}

/// What is known of a flaw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flaw {
    /// What one of it makes of all that is estimated.
    pub(super) drawn: Along,
    told: Told,
    usual: f64,
    /// There is such a sensor, and it spoke.
    pub(super) is_followed: bool,
}

impl Flaw {
    /// That of a place of which nothing is known.
    pub(crate) fn new(place: usize) -> Flaw {
        Flaw {
            drawn: [0.0; STATES],
            told: Told::default(),
            usual: USUAL[kind_of(place)],
            is_followed: WHEELS.contains(&place),
        }
    }

    /// How great it is: by how much instants are too early, s, or which share isn't told. Until it is told better, by nothing much.
    fn size(&self) -> f64 {
        self.told.times_size * self.variance()
    }

    /// The variance of that.
    fn variance(&self) -> f64 {
        1.0 / (self.told.weight + self.usual.powi(-2))
    }

    /// How much of what is seen it explains: chi².
    fn explains(&self) -> f64 {
        self.told.times_size * self.size()
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

/// Of a reading that is off by so much, and by so much beyond chance.
fn told<const M: usize>(change: [f64; M], off: [f64; M], beyond: f64) -> Told {
    let sum = |one: [f64; M], other: [f64; M]| -> f64 {
        one.iter().zip(other).map(|(one, other)| one * other).sum()
    };
    Told { times_size: sum(change, off), weight: sum(change, change), beyond }
}

impl Knowledge {
    /// What is known of a sensor's clock: how much too early its instants are, and the standard deviation of that, s.
    pub(crate) fn clock_s(&self, rate: usize) -> Option<[f64; 2]> {
        (rate < MAX_RATES).then(|| [self.flaws[rate].size(), self.flaws[rate].variance().sqrt()])
    }

    /// Whether a sensor was seen lately to tell all of what it measures.
    pub(super) fn is_shown(&self, rate: usize) -> bool {
        let share = &self.flaws[SHARES + rate];
        share.size().abs().max(share.variance().sqrt()) < SHOWN
    }

    /// What flaws that there seem to be may have made of the pose: its covariance, xx, xy, xψ, yy, yψ, ψψ.
    pub(crate) fn by_flaws(&self) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for flaw in self.flaws.iter().filter(|flaw| flaw.is_followed && flaw.explains() > SEEMS) {
            let [x, y, turn, ..] = flaw.drawn;
            let off2 = flaw.size().powi(2) + flaw.variance();
            for (sum, product) in sum.iter_mut().zip([x * x, x * y, x * turn, y * y, y * turn, turn * turn]) {
                *sum += off2 * product;
            }
        }
        sum
    }

    /// Time passes.
    pub(super) fn forget_flaws(&mut self, time_s: f64) {
        let keep = MEMORY_S.map(|memory_s| (-time_s / memory_s).exp());
        let followed = self.flaws.iter_mut().enumerate().filter(|(_, flaw)| flaw.is_followed);
        for (place, Flaw { drawn, told, .. }) in followed {
            let keep = keep[kind_of(place)];
            *told = Told {
                times_size: keep * told.times_size,
                weight: keep * told.weight,
                beyond: keep * told.beyond,
            };
            drawn.iter_mut().for_each(|drawn| *drawn *= keep);
        }
    }

    /// Takes a reading in. `is_new`: what it tells of flaws isn't known yet.
    pub(super) fn take_in<const M: usize>(
        &mut self,
        innovation: &Innovation<M>,
        changes: Changes<M>,
        is_new: bool,
    ) {
        let whitened = innovation.whitened();
        let (off, beyond) = (innovation.whiten(innovation.off()), innovation.nis - M as f64);
        for (flaw, change) in self.flaws.iter_mut().zip(changes) {
            flaw.is_followed |= change.is_some();
            if !flaw.is_followed {
                continue;
            }
            let changes = flaw.change(innovation, change.unwrap_or([0.0; M]));
            if is_new {
                flaw.told.add(told(changes, off, beyond));
            }
            for (change, moves) in changes.iter().zip(&whitened.moves) {
                for (drawn, moved) in flaw.drawn.iter_mut().zip(moves) {
                    *drawn += change * moved;
                }
            }
        }
        self.belief.correct(&whitened);
    }

    /// A reading that isn't taken in tells of its own flaws alone.
    pub(super) fn leave_out<const M: usize>(
        &mut self,
        own: &[usize],
        innovation: &Innovation<M>,
        changes: Changes<M>,
    ) {
        let (off, beyond) = (innovation.whiten(innovation.off()), innovation.nis - M as f64);
        for place in own {
            let flaw = &mut self.flaws[*place];
            flaw.is_followed = true;
            let change = flaw.change(innovation, changes[*place].unwrap_or([0.0; M]));
            flaw.told.add(told(change, off, beyond));
        }
    }

    /// Names a sensor that has a flaw. What that made is undone where poses agree, and counts in the covariance elsewhere.
    pub(super) fn judge_flaws(&mut self, sensors: &[Sensor], end_ns: u64) {
        let agreeing = self.standings.map(|standing| standing.agrees_now(end_ns));
        let agrees = |is: &dyn Fn(usize, &Sensor) -> bool| {
            sensors.iter().enumerate().any(|(place, sensor)| agreeing[place] && is(place, sensor))
        };
        // Without one that sees the floor it may be the wheels that lag while they are accelerated, each time alike.
        let is_floor_seen = agrees(&|_, sensor| sees(sensor)[0]);
        let of_poses = sensors.iter().enumerate().filter(|(_, sensor)| sensor.kind == SensorKind::Pose);
        let of_poses = of_poses.map(|(place, _)| (None, place));
        let of_rates = rates(sensors).map(|(rate, (place, _))| (Some(rate), place));
        for (rate, place) in of_rates.chain(of_poses) {
            if !self.standings[place].is_new() {
                continue;
            }
            let own = match rate {
                Some(rate) => [(rate, LEAST_OFF_S), (SHARES + rate, LEAST_OFF)],
                None => [(POSES + place, LEAST_OFF_S); 2],
            };
            if !self.standings[place].is_believed() {
                let clock = &self.flaws[own[0].0];
                let is_off = clock.size().abs() > 0.5 * LEAST_OFF_S && clock.explains() > SURE;
                // A gyro agrees whenever nothing turns; others are held against every way.
                let gyro = rate.filter(|_| sensors[place].kind.is_gyro());
                if is_off || gyro.is_some_and(|rate| !self.is_shown(rate)) {
                    self.standings[place].name(end_ns, Verdict::Contradicts);
                }
                continue;
            }
            if rate.is_none() && !is_floor_seen {
                continue;
            }
            let explain = |flaw: usize| self.flaws[flaw].explains();
            let is_others = |flaw: &usize| !WHEELS.contains(flaw) && own.iter().all(|(own, _)| flaw != own);
            let others = (0..FLAWS).filter(is_others).map(explain).fold(0.0, f64::max);
            let most = others.max(explain(WHEELS[0]) + explain(WHEELS[1]));
            let is_off = |(place, least): &(usize, f64)| {
                let flaw = &self.flaws[*place];
                flaw.size().abs() > *least
                    && flaw.explains() > SURE.max(most + MARGIN)
                    && flaw.explains() > EXPLAINED * flaw.told.beyond
            };
            let Some((at, _)) = own.into_iter().find(is_off) else { continue };
            let flaw = self.flaws[at];
            let off = flaw.size();
            let mut left = flaw.variance();
            if agrees(&|other, sensor| other != place && sensor.kind == SensorKind::Pose) {
                self.belief.shift(&flaw.drawn.map(|drawn| -off * drawn));
            } else {
                // Nobody would see it if that were wrong.
                left += off * off;
            }
            self.belief.widen_along(&flaw.drawn, left);
            self.flaws = std::array::from_fn(Flaw::new);
            self.flaws[at] = Flaw { drawn: [0.0; STATES], ..flaw };
            self.standings[place].name(end_ns, Verdict::Contradicts);
        }
    }
}
