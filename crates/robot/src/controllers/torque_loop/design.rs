//! The search for gains: of all low-passes and Kp the greatest K that leaves margins on every plant.
//!
//! The stiffest candidate that nothing speaks against yet is looked at first, so that few are looked at on every plant. Of a plant and
//! a law z = plant·law is drawn, and the loop is 1 + K·z. The places where z crosses the real axis don't depend on K: as
//! 1 + K·z turns about the origin by 2π for each of them beyond −1/K, they tell for every K whether it is stable.

use nalgebra::Complex;
use std::f64::consts::TAU;

use super::{LoopGains, MOST_SENSITIVE, TorqueLoop, is_stable};

/// From which the design chooses.
pub(super) const FILTERS_1_S: [f64; 9] = [10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 100.0, 200.0, 400.0];
pub(super) const KP_1_S: [f64; 14] =
    [0.3, 0.5, 0.7, 0.85, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0];
/// The greatest K that is tried, over the heaviest platform, 1/s, and steps between those that are.
pub(super) const GREATEST_1_S: f64 = 60.0;
pub(super) const GAIN_STEP: f64 = 0.93;
/// Stiffnesses that differ by less, over themselves, are the same.
const ROUNDING: f64 = 1e-9;

/// A low-pass and a Kp, with the greatest K that nothing speaks against yet.
struct Candidate {
    gains: LoopGains,
    law: Vec<Complex<f64>>,
    /// K below which it is none: that of the proof.
    least: f64,
    quarter_turns: f64,
}

/// One plant.
struct Looked {
    /// From force to way, by frequency.
    plant: Vec<Complex<f64>>,
    /// The frequency at which a gain was last too much: mostly it is again.
    worst: usize,
}

impl TorqueLoop {
    /// The gains that hold the platform most stiffly against a force, K·Kp, with margins on every plant.
    ///
    /// Beside the margins K ≥ m·Kp for the heaviest platform: then what the law loses in a cycle exceeds what its own
    /// correction puts in, whatever it has learnt (J.-J. E. Slotine and W. Li, *Applied Nonlinear Control*, 1991, section 9.2).
    pub fn design(&self) -> Option<LoopGains> {
        let frequencies = self.frequencies();
        let looked = |plant| Looked { plant: self.response(&plant, &frequencies), worst: 0 };
        let mut plants: Vec<Looked> = self.plants().into_iter().map(looked).collect();
        let mut candidates = Vec::new();
        for filter_1_s in FILTERS_1_S {
            let low_pass = self.low_pass(filter_1_s, &frequencies);
            candidates.extend(KP_1_S.map(|kp_1_s| Candidate {
                gains: LoopGains { damping: GREATEST_1_S * self.body[1], kp_1_s, filter_1_s },
                law: self.law(kp_1_s, &low_pass, &frequencies),
                least: self.body[1] * kp_1_s,
                quarter_turns: self.quarter_turns(),
            }));
        }
        let mut borne: Vec<(usize, LoopGains)> = Vec::new();
        let mut stiffest = 0.0_f64;
        while let Some(at) = next(&candidates, (1.0 - ROUNDING) * stiffest) {
            let candidate = &mut candidates[at];
            match plants.iter_mut().position(|plant| plant.lowers(candidate)) {
                // Where one failed the next fails, most of the time.
                Some(failed) => plants.swap(0, failed),
                None => {
                    stiffest = stiffest.max(candidate.stiffness());
                    borne.push((at, candidate.gains));
                    candidate.gains.damping = 0.0;
                }
            }
        }
        // Of those that are equally stiff the first.
        borne.sort_by_key(|(at, _)| *at);
        borne.into_iter().fold(None, |best: Option<LoopGains>, (_, gains)| {
            let least = best.map_or(0.0, |best| best.damping * best.kp_1_s / gains.kp_1_s);
            if gains.damping > least { Some(gains) } else { best }
        })
    }
}

/// The place of the candidate that may be the stiffest, where one may be so stiff.
fn next(candidates: &[Candidate], least: f64) -> Option<usize> {
    let stiffness = |at: &usize| candidates[*at].stiffness();
    let most = (0..candidates.len()).max_by(|one, other| stiffness(one).total_cmp(&stiffness(other)));
    most.filter(|at| stiffness(at) > 0.0 && stiffness(at) >= least)
}

impl Candidate {
    /// By how much force it holds the platform at its place, N/m.
    fn stiffness(&self) -> f64 {
        self.gains.damping * self.gains.kp_1_s
    }
}

impl Looked {
    /// Takes steps off a candidate's K until it leaves margins on this plant, or is 0; whether it took any.
    fn lowers(&mut self, candidate: &mut Candidate) -> bool {
        let Candidate { gains, law, least, quarter_turns } = candidate;
        let before = gains.damping;
        let mut drawn = None;
        while gains.damping > 0.0 {
            let closed = |at: usize| 1.0 + gains.damping * self.plant[at] * law[at];
            let is_near = |at: usize| closed(at).norm_sqr() * MOST_SENSITIVE * MOST_SENSITIVE < 1.0;
            let bears = !is_near(self.worst) && {
                let beyond = drawn
                    .get_or_insert_with(|| crossings(&self.plant, law))
                    .iter()
                    .filter(|(place, _)| 1.0 + gains.damping * place < 0.0);
                let jumps: f64 = beyond.map(|(_, jump)| jump).sum();
                is_stable(closed(law.len() - 1).arg() - closed(0).arg() + jumps, *quarter_turns)
            };
            if bears {
                let Some(near) = (0..law.len()).find(|at| is_near(*at)) else { break };
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

/// Where a drawn loop crosses the real axis left of the origin, and by what its argument jumps back there.
fn crossings(plant: &[Complex<f64>], law: &[Complex<f64>]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    let mut before: Option<Complex<f64>> = None;
    for now in plant.iter().zip(law).map(|(plant, law)| plant * law) {
        if let Some(from) = before.filter(|from| (from.im < 0.0) != (now.im < 0.0)) {
            let place = from.re + (now.re - from.re) * from.im / (from.im - now.im);
            if place < 0.0 {
                // From above to below it has turned on to the left.
                found.push((place, if now.im < 0.0 { TAU } else { -TAU }));
            }
        }
        before = Some(now);
    }
    found
}
