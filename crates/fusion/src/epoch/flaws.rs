//! What of a sensor is off, and by how much: its clock, or how much it tells of what it measures.
//!
//! A reading whose instant is δ too early tells what will be: it is off by δ times the change of what it tells;
//! one that tells a share κ too little is off by κ times that itself.
//!
//! What such a flaw makes of all that is estimated is followed along with it, reading by reading, so that of
//! each reading is known what it would make of it, and what all of them tell of it together (generalized
//! likelihood ratio: Willsky and Jones, *IEEE Trans. Automatic Control* 21, 1976).
//!
//! Wheels that lag, as those do that slip while they are accelerated, count as one more: where they explain
//! what is seen about as well, no sensor is named, nor where two sensors explain it alike. In even motion
//! nothing tells of clocks, and at rest nothing of shares.

use nalgebra::{Matrix3, Vector3};

use super::lags::sees;
use super::{Fading, Knowledge, Mounted, rates};
use crate::belief::{Change, FLAWS, Innovation, STATES, WHEELS};
use crate::standing::Verdict;

/// By so much clocks are off, where they are, s; what is told too little, where it is, as a share; and clocks of poses. As weights.
const USUAL: [f64; 3] = [1.0 / (0.05 * 0.05), 1.0, 1.0 / (0.05 * 0.05)];
/// So many times as great it is something else: a gyro that jumps isn't one whose clock is off by seconds.
const MOST_USUAL: f64 = 4.0;
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
/// Wheels that grip lag by so much while they are accelerated gently, where they do, s, as a weight: treads creep by a millisecond.
const LAG: f64 = 1.0 / (0.01 * 0.01);
/// Of what sensors are off beyond chance a clock explains so much.
const EXPLAINED: f64 = 0.5;

/// What kinds of flaws there are, in the order of what is usual and remembered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum FlawKind {
    #[default]
    Clock,
    Share,
    ClockOfPoses,
}

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

    fn fade(&mut self, left: f64) {
        self.times_size *= left;
        self.weight *= left;
        self.beyond *= left;
    }
}

/// What is known of a flaw; what one of it makes of all that is estimated stands beside their covariance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flaw {
    kind: FlawKind,
    told: Told,
    /// What was told of it while wheels gripped for sure.
    gripping: Told,
    /// There is such a sensor, and it spoke.
    is_followed: bool,
    /// What it made is in the belief's covariance: its sensor was named, and isn't believed since.
    is_counted: bool,
}

impl Flaw {
    /// Those of wheels and a company of sensors, of which nothing is known.
    pub(crate) fn all(sensors: &[Mounted]) -> [Flaw; FLAWS] {
        let mut all = [Flaw::default(); FLAWS];
        for sensor in sensors {
            if sensor.is_pose() {
                all[sensor.clock].kind = FlawKind::ClockOfPoses;
            } else if sensor.rate.is_some() {
                all[sensor.share].kind = FlawKind::Share;
            }
        }
        for wheels in WHEELS {
            all[wheels].is_followed = true;
        }
        all
    }

    /// How great it is: by how much instants are too early, s, or which share isn't told. Until it is told better, by nothing much.
    fn size(&self) -> f64 {
        self.told.times_size * self.variance()
    }

    /// The variance of that.
    fn variance(&self) -> f64 {
        1.0 / (self.told.weight + USUAL[self.kind as usize])
    }

    /// Whether wheels that lag, which look alike, explain it less well, while they gripped for sure.
    fn is_no_lag(&self) -> bool {
        let Told { times_size, weight, .. } = self.gripping;
        let by = |likely: f64| times_size * times_size / (weight + likely);
        by(USUAL[self.kind as usize]) > SURE.max(by(LAG) + MARGIN)
    }

    /// Whether it can be as great as it seems to be.
    fn is_possible(&self) -> bool {
        self.size().powi(2) * USUAL[self.kind as usize] <= MOST_USUAL * MOST_USUAL
    }

    /// How much of what is seen it explains: chi².
    fn explains(&self) -> f64 {
        self.told.times_size * self.size()
    }

    /// How much of it wheels explain that lag: where they grip for sure, by little.
    fn explains_as_lag(&self) -> f64 {
        let Told { times_size, weight, .. } = self.gripping;
        let (slips, slips_weight) = (self.told.times_size - times_size, (self.told.weight - weight).max(0.0));
        times_size * times_size / (weight + LAG)
            + slips * slips / (slips_weight + USUAL[FlawKind::Clock as usize])
    }
}

/// What a reading tells of a flaw.
fn told<const M: usize>(flaw: usize, innovation: &Innovation<M>) -> Told {
    let change = innovation.change(flaw);
    let sum = |one: &[f64; M], other: &[f64; M]| -> f64 {
        one.iter().zip(other).map(|(one, other)| one * other).sum()
    };
    Told {
        times_size: sum(&change, &innovation.off),
        weight: sum(&change, &change),
        beyond: innovation.nis - M as f64,
    }
}

/// What something of such a variance makes of the pose along this.
fn of_pose(&[x, y, turn, ..]: &[f64; STATES], variance: f64) -> Matrix3<f64> {
    let pose = Vector3::new(x, y, turn);
    pose * pose.transpose() * variance
}

impl Knowledge {
    /// What is known of a sensor's clock: how much too early its instants are, and the standard deviation of that, s.
    pub(crate) fn clock_s(&self, sensor: &Mounted) -> [f64; 2] {
        let clock = &self.flaws[sensor.clock];
        [clock.size(), clock.variance().sqrt()]
    }

    /// Whether a sensor was seen lately to tell all of what it measures.
    pub(super) fn is_shown(&self, sensor: &Mounted) -> bool {
        let share = &self.flaws[sensor.share];
        share.size().abs().max(share.variance().sqrt()) < SHOWN
    }

    /// What flaws that there seem to be may have made of the pose: its covariance, x, y and heading in map.
    fn by_flaws(&self) -> Matrix3<f64> {
        let mut sum = Matrix3::zeros();
        for (place, flaw) in self.flaws.iter().enumerate() {
            let seems = flaw.is_followed && flaw.explains() > SEEMS && flaw.is_possible();
            if !seems || flaw.is_counted {
                continue;
            }
            let off2 = flaw.size().powi(2) + flaw.variance();
            sum += of_pose(&self.belief.drawn(place), off2);
        }
        sum
    }

    /// That, and what was kept of it.
    pub(crate) fn made_by_flaws(&self) -> [f64; 6] {
        let mut all = self.kept;
        all.is_at_least(&self.by_flaws());
        all.covariance()
    }

    /// What they may have made stays, until a pose takes it away.
    pub(super) fn keep_by_flaws(&mut self) {
        let by_flaws = self.by_flaws();
        self.kept.is_at_least(&by_flaws);
    }

    /// Time passes. The share of each that is left.
    pub(super) fn forget_flaws(&mut self, fading: &Fading) -> [f64; FLAWS] {
        for flaw in &mut self.flaws {
            let left = fading.flaws[flaw.kind as usize];
            flaw.told.fade(left);
            flaw.gripping.fade(left);
        }
        self.flaws.map(|flaw| fading.flaws[flaw.kind as usize])
    }

    /// Takes a reading in that changes with flaws. `is_new`: what it tells of them isn't known yet.
    pub(super) fn take_in<const M: usize>(
        &mut self,
        innovation: &Innovation<M>,
        changes: &[Change<M>],
        is_new: bool,
    ) {
        for (flaw, _) in changes {
            self.flaws[*flaw].is_followed = true;
        }
        let followed = self.flaws.iter_mut().enumerate().filter(|(_, flaw)| is_new && flaw.is_followed);
        for (place, flaw) in followed {
            let told = told(place, innovation);
            flaw.told.add(told);
            if self.strained_s == 0.0 {
                flaw.gripping.add(told);
            }
        }
        self.belief.correct(innovation);
    }

    /// A reading that isn't taken in tells of its own flaws alone.
    pub(super) fn leave_out<const M: usize>(&mut self, own: &[usize], innovation: &Innovation<M>) {
        for place in own {
            let flaw = &mut self.flaws[*place];
            flaw.is_followed = true;
            flaw.told.add(told(*place, innovation));
        }
    }

    /// Names a sensor that has a flaw. What that made is undone where poses agree, and counts in the covariance elsewhere.
    pub(super) fn judge_flaws(&mut self, sensors: &[Mounted], end_ns: u64) {
        let of_rates = rates(sensors).map(|(_, (place, _))| place);
        let of_poses = (0..sensors.len()).filter(|place| sensors[*place].is_pose());
        for place in of_rates.chain(of_poses) {
            let (sensor, standing) = (&sensors[place], &self.standings[place]);
            if standing.is_believed() {
                [sensor.clock, sensor.share].into_iter().for_each(|own| self.flaws[own].is_counted = false);
            }
            if !standing.is_new() {
                continue;
            }
            if !standing.is_believed() {
                let clock = &self.flaws[sensor.clock];
                let is_off = clock.size().abs() > 0.5 * LEAST_OFF_S && clock.explains() > SURE;
                // A gyro agrees whenever nothing turns; others are held against every way.
                if is_off || sensor.model.kind.is_gyro() && !self.is_shown(sensor) {
                    self.standings[place].name(end_ns, Verdict::Contradicts);
                }
                continue;
            }
            let agrees = |is: &dyn Fn(usize, &Mounted) -> bool| {
                let mut all = sensors.iter().zip(&self.standings).enumerate();
                all.any(|(place, (sensor, standing))| is(place, sensor) && standing.agrees_now(end_ns))
            };
            let Some(at) = self.flaw_of(sensor) else { continue };
            let flaw = self.flaws[at];
            // Without one that sees the floor it may be the wheels that lag while they are accelerated, each time alike.
            if sensor.is_pose() && !flaw.is_no_lag() && !agrees(&|_, sensor| sees(&sensor.model)[0]) {
                continue;
            }
            let off = flaw.size();
            let mut left = flaw.variance();
            let drawn = self.belief.drawn(at);
            let is_undone = agrees(&|other, sensor| other != place && sensor.is_pose());
            if is_undone {
                self.belief.shift(&drawn.map(|drawn| -off * drawn));
            } else {
                // Nobody would see it if that were wrong.
                left += off * off;
            }
            self.belief.widen_along(&drawn, left);
            self.kept.is_counted(&of_pose(&drawn, left));
            self.belief.forget_flaws();
            if !is_undone {
                // It is in there yet: else it would agree with itself by and by.
                self.belief.draw(at, &drawn);
            }
            self.flaws = Flaw::all(sensors);
            self.flaws[at] = Flaw { is_counted: !is_undone, ..flaw };
            self.standings[place].name(end_ns, Verdict::Contradicts);
        }
    }

    /// The flaw that a sensor has, where it explains what is seen better than any other of another sensor, or of the wheels.
    fn flaw_of(&self, sensor: &Mounted) -> Option<usize> {
        let least = if sensor.is_pose() { LEAST_OFF_S } else { LEAST_OFF };
        let own = [(sensor.clock, LEAST_OFF_S), (sensor.share, least)];
        let explain = |flaw: usize| self.flaws[flaw].explains();
        let others = || {
            let is_others = |flaw: &usize| !WHEELS.contains(flaw) && own.iter().all(|(own, _)| flaw != own);
            let most = (0..FLAWS).filter(is_others).map(explain).fold(0.0, f64::max);
            most.max(WHEELS.map(|wheels| self.flaws[wheels].explains_as_lag()).iter().sum())
        };
        let is_off = |(place, least): &(usize, f64)| {
            let flaw = &self.flaws[*place];
            flaw.size().abs() > *least
                && flaw.is_possible()
                && flaw.explains() > SURE
                && flaw.explains() > EXPLAINED * flaw.told.beyond
                && flaw.explains() > others() + MARGIN
        };
        own.into_iter().find(is_off).map(|(place, _)| place)
    }
}
