//! The search for gains: of all low-passes and Kp the greatest K that leaves margins on every plant.
//!
//! The stiffest candidate that nothing speaks against yet is looked at first, so that few are looked at on
//! every plant.
//!
//! Of a plant and a law z = plant·law is drawn, and the loop is 1 + K·z. The places where z crosses the real
//! axis don't depend on K: as 1 + K·z turns about the origin by 2π for each of them beyond −1/K, they tell for
//! every K whether it is stable.
//!
//! An observer's part o isn't in K: the loop is (1 + plant·o)·(1 + K·z) then, with z = plant·law/(1 + plant·o).

use nalgebra::Complex;
use std::f64::consts::TAU;

use super::{Law, LoopGains, MOST_SENSITIVE, TorqueLoop, is_stable};

/// From which the design chooses.
pub(super) const FILTERS_1_S: [f64; 9] = [10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 100.0, 200.0, 400.0];
const KP_1_S: [f64; 14] = [0.3, 0.5, 0.7, 0.85, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0];
pub(super) const OBSERVERS_1_S: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// And for heavy platforms: M·g passes by the low-pass, and what a tread bears of it doesn't grow with M.
const SLOW_OBSERVERS_1_S: [f64; 2] = [0.25, 0.5];
/// A quick one takes a push that a stiff loop bears alone: it is taken where it leaves this part of the stiffness with a slow one.
const LEFT_BY_A_QUICK_ONE: f64 = 0.5;
/// The greatest K that is tried, over the heaviest platform, 1/s, and steps between those that are.
pub(super) const GREATEST_1_S: f64 = 60.0;
pub(super) const GAIN_STEP: f64 = 0.93;
/// Stiffnesses that differ by less, over themselves, are the same.
const ROUNDING: f64 = 1e-9;

/// A low-pass and a Kp, with the greatest K that nothing speaks against yet.
struct Candidate {
    gains: LoopGains,
    law: Law,
    /// K below which it is none: that of the proof.
    least: f64,
    quarter_turns: f64,
}

/// A loop as far as it doesn't depend on K.
struct Drawn {
    crossings: Vec<(f64, f64)>,
    /// z at both ends.
    ends: [Complex<f64>; 2],
    /// By what 1 + plant·o turns.
    turned_rad: f64,
}

/// One plant.
struct Looked {
    /// From force to way, by frequency.
    plant: Vec<Complex<f64>>,
    /// The frequency at which a gain was last too much: mostly it is again.
    worst: usize,
}

impl TorqueLoop {
    /// The gains that hold the platform most stiffly against a force, K·(Kp + g), with margins on every plant.
    ///
    /// Without an observer, beside the margins, K ≥ m·Kp for the heaviest platform: then what the law loses in a cycle exceeds what its own
    /// correction puts in, whatever it has learnt (J.-J. E. Slotine and W. Li, *Applied Nonlinear Control*, 1991, section 9.2).
    pub fn design(&self) -> Option<LoopGains> {
        if self.observed_body <= 0.0 {
            return self.stiffest(&[0.0]);
        }
        let (quick, slow) = (self.stiffest(&OBSERVERS_1_S), self.stiffest(&SLOW_OBSERVERS_1_S));
        let least = slow.map_or(0.0, |slow| LEFT_BY_A_QUICK_ONE * slow.stiffness());
        quick.filter(|quick| quick.stiffness() >= least).or(slow)
    }

    /// The stiffest gains with one of these rates of an observer.
    fn stiffest(&self, observers_1_s: &[f64]) -> Option<LoopGains> {
        let frequencies = self.frequencies();
        let looked = |plant| Looked { plant: self.response(&plant, &frequencies), worst: 0 };
        let mut plants: Vec<Looked> = self.plants().into_iter().map(looked).collect();
        let mut candidates = Vec::new();
        for filter_1_s in FILTERS_1_S {
            let low_pass = self.low_pass(filter_1_s, &frequencies);
            for (kp_1_s, observer_1_s) in rates(observers_1_s) {
                let damping = GREATEST_1_S * self.body[1];
                let gains = LoopGains { damping, kp_1_s, filter_1_s, observer_1_s };
                candidates.push(Candidate {
                    law: self.law(&gains, &low_pass, &frequencies),
                    least: self.least(kp_1_s),
                    quarter_turns: self.quarter_turns(),
                    gains,
                });
            }
        }
        let mut borne: Vec<(usize, LoopGains)> = Vec::new();
        let mut stiffest = 0.0_f64;
        while let Some(at) = next(&candidates, (1.0 - ROUNDING) * stiffest) {
            let candidate = &mut candidates[at];
            match plants.iter_mut().position(|plant| plant.lowers(candidate)) {
                // Where one failed the next fails, most of the time.
                Some(failed) => plants.swap(0, failed),
                None => {
                    stiffest = stiffest.max(candidate.gains.stiffness());
                    borne.push((at, candidate.gains));
                    candidate.gains.damping = 0.0;
                }
            }
        }
        // Of those that are equally stiff the first.
        borne.sort_by_key(|(at, _)| *at);
        borne.into_iter().fold(None, |best: Option<LoopGains>, (_, gains)| {
            let least = best.map_or(0.0, |best| best.stiffness() / (gains.kp_1_s + gains.observer_1_s));
            if gains.damping > least { Some(gains) } else { best }
        })
    }

    /// The K below which a Kp isn't looked at: m·Kp of the heaviest platform, below which nothing is proved of a law that learns; of the
    /// lightest with an observer, which is as linear as the rest of the loop.
    pub(crate) fn least(&self, kp_1_s: f64) -> f64 {
        let [light, heavy] = self.body;
        kp_1_s * if self.observed_body > 0.0 { light } else { heavy }
    }
}

/// The rates of which each is looked at, 1/s: Kp and an observer's.
pub(super) fn rates(observers_1_s: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    KP_1_S
        .into_iter()
        .flat_map(move |kp_1_s| observers_1_s.iter().map(move |observer_1_s| (kp_1_s, *observer_1_s)))
}

/// The place of the candidate that may be the stiffest, where one may be so stiff.
fn next(candidates: &[Candidate], least: f64) -> Option<usize> {
    let stiffness = |at: &usize| candidates[*at].gains.stiffness();
    let most = (0..candidates.len()).max_by(|one, other| stiffness(one).total_cmp(&stiffness(other)));
    most.filter(|at| stiffness(at) > 0.0 && stiffness(at) >= least)
}

impl Looked {
    /// Takes steps off a candidate's K until it leaves margins on this plant, or is 0; whether it took any.
    fn lowers(&mut self, candidate: &mut Candidate) -> bool {
        let Candidate { gains, law, least, quarter_turns } = candidate;
        let before = gains.damping;
        let mut drawn = None;
        while gains.damping > 0.0 {
            let closed = |at: usize| 1.0 + self.plant[at] * law.whole(at, gains.damping);
            let is_near = |at: usize| closed(at).norm_sqr() * MOST_SENSITIVE * MOST_SENSITIVE < 1.0;
            let bears = !is_near(self.worst) && {
                let Drawn { crossings, ends, turned_rad } =
                    drawn.get_or_insert_with(|| Drawn::of(&self.plant, law));
                let beyond = crossings.iter().filter(|(place, _)| 1.0 + gains.damping * place < 0.0);
                let jumps: f64 = beyond.map(|(_, jump)| jump).sum();
                let [first, last] = ends.map(|end| (1.0 + gains.damping * end).arg());
                is_stable(last - first + jumps + *turned_rad, *quarter_turns)
            };
            if bears {
                let Some(near) = (0..law.part.len()).find(|at| is_near(*at)) else { break };
                self.worst = near;
            }
            gains.damping *= GAIN_STEP;
            if gains.damping <= *least {
                gains.damping = 0.0;
            }
        }
        gains.damping != before
    }
}

impl Drawn {
    fn of(plant: &[Complex<f64>], law: &Law) -> Self {
        let of_observer = |at: usize| 1.0 + plant[at] * law.beside(at);
        let z: Vec<Complex<f64>> =
            (0..plant.len()).map(|at| plant[at] * law.part[at] / of_observer(at)).collect();
        // Where there is none it stands still at 1.
        let turns = (1..law.beside.len()).map(|at| (of_observer(at) * of_observer(at - 1).conj()).arg());
        Drawn { turned_rad: turns.sum(), ends: [z[0], z[z.len() - 1]], crossings: crossings(&z) }
    }
}

/// Where z crosses the real axis left of the origin, and by what the argument of 1 + K·z jumps back there.
fn crossings(z: &[Complex<f64>]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for pair in z.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        if (from.im < 0.0) != (to.im < 0.0) {
            let place = from.re + (to.re - from.re) * from.im / (from.im - to.im);
            if place < 0.0 {
                // From above to below it has turned on to the left.
                found.push((place, if to.im < 0.0 { TAU } else { -TAU }));
            }
        }
    }
    found
}
