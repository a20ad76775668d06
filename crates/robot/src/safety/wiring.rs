//! Whether the wheels are wired as the robot's file says: a drive whose wheel turns the wrong way, two that are swapped.
//!
//! With wrong wires the platform moves otherwise than its encoders say, and its mass, inertia and rollers resist otherwise than
//! they should: torques and accelerations of the wheels don't agree. Each way to be wrong is a supposition of its own
//! (`supposition.rs`); what explains the motion much better than the file's wiring, which explains it badly, is named.
//!
//! What can't be seen from within stands in `docs/control.md`.

mod supposition;
mod turn;

use crate::config::RobotPlan;
use crate::decay::Decay;
use crate::grip::FirstEstimates;
use crate::signals::{Exchange, MAX_WHEELS, ReferenceStatus};
use crate::stages::SafetyView;
use supposition::{Platform, Rims, Supposition, Wiring};
use turn::TurnWatch;

/// Three wheels never work against each other: wrong wires would show in inertia alone, as wheels do that slip a little. A gyro tells
/// them (`turn.rs`).
const LEAST_WHEELS: usize = 4;
/// Low-pass on rim speeds and forces, 1/s: slower than treads swing.
const LOW_PASS_1_S: f64 = 20.0;
/// A supposition is named from this likelihood on, over the file's and over the next one's, as its logarithm.
const SCORE: f64 = 15.0;
const MARGIN: f64 = 3.0;
/// From this on below the file's it is out of the question: wires don't change on the way, and whatever happens later has
/// another cause (A. Wald, *Sequential Analysis*, 1947).
const REFUTED: f64 = -10.0;
/// So much must the file's wiring leave unexplained, in squares of what no equation tells: where one wheel turns the wrong
/// way, and where two are swapped, which uneven loads look like.
const TURNED_MISFIT: f64 = 0.3;
const SWAPPED_MISFIT: f64 = 100.0;
/// What the supposition itself may leave: of the file's, and by itself.
const LEFT_SHARE: f64 = 0.3;
const LEFT: f64 = 0.1;
/// From where the wheels' speeds contradict each other as the file has them, m/s (the root of the mean square); other wires that
/// explain the motion leave at most this part of its square, and prove themselves where they leave that little.
const CONTRADICTION_M_S: f64 = 0.02;
const CONTRADICTION_LEFT: f64 = 0.3;
const PROVEN_LEFT: f64 = 0.1;
/// For so long they must explain it, s: a slip is over by then, or stops the robot. Proven, none lasts so long.
const LASTING_S: f64 = 0.15;
const PROVEN_S: f64 = 0.02;
/// A motion has begun only just for so long, s.
const BEGINS_S: f64 = 0.5;
/// A platform that stood for so long may have been loaded, and all begins anew, ns.
const LOADED_NS: u64 = 1_000_000_000;
/// Slower than this all wheels stand, m/s.
const STANDING_M_S: f64 = 0.005;
/// After so many periods without a complete exchange the low-pass begins anew.
const LONGEST_GAP: u32 = 10;

/// The watch: in each cycle it looks at one supposition.
#[derive(Clone, Debug)]
pub(super) struct WiringWatch {
    /// Whether there are wheels enough, and every drive tells its torque: without that forces tell nothing.
    is_told: bool,
    /// Of a robot that has a gyro, which input tells it, and what it tells; where no drive tells its torque nobody knows slip from it.
    by_turn: Option<(usize, TurnWatch)>,
    platform: Platform,
    radius_m: [f64; MAX_WHEELS],
    suppositions: Box<[Supposition]>,
    next: usize,
    rims: Rims,
    /// Periods since the last complete exchange; `None` before the first.
    periods: Option<u32>,
    low_pass: Decay,
    /// Since when it stands, ns.
    stood_ns: u64,
    /// For how long other wires explain the motion; time in which they don't counts back, s.
    explained_s: f64,
    /// For how long a motion was looked at, s.
    looked_s: f64,
    named: Option<usize>,
}

impl WiringWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let platform = Platform::new(&plan.kinematics, FirstEstimates::of(&plan.controller));
        let wheels = plan.kinematics.wheel_count();
        let pairs = (0..wheels).flat_map(|one| (one + 1..wheels).map(move |other| (one, other)));
        let ways = std::iter::once(Wiring::AsTold)
            .chain((0..wheels).map(Wiring::Turned))
            .chain(pairs.map(|(one, other)| Wiring::Swapped(one, other)));
        let suppositions: Box<[Supposition]> =
            ways.map(|wiring| Supposition::new(wiring, &platform)).collect();
        let turn = || TurnWatch::new(suppositions[1..].iter().map(|other| other.wiring));
        let gyro_input = plan.safety.gyro_input.filter(|_| plan.tells_torques());
        let mut radius_m = [0.0; MAX_WHEELS];
        for (radius_m, wheel) in radius_m.iter_mut().zip(plan.kinematics.wheels()) {
            *radius_m = wheel.radius_m;
        }
        WiringWatch {
            is_told: wheels >= LEAST_WHEELS && plan.tells_torques(),
            by_turn: gyro_input.map(|input| (input, turn())),
            suppositions,
            platform,
            radius_m,
            next: 0,
            rims: Rims::default(),
            periods: None,
            low_pass: Decay::new(LOW_PASS_1_S),
            stood_ns: 0,
            explained_s: 0.0,
            looked_s: 0.0,
            named: None,
        }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        (self.periods, self.rims) = (None, Rims::default());
        if let Some((_, turn)) = &mut self.by_turn {
            turn.reset();
        }
        self.begin_anew();
    }

    fn begin_anew(&mut self) {
        (self.next, self.named, self.stood_ns) = (0, None, 0);
        (self.explained_s, self.looked_s) = (0.0, 0.0);
        for supposition in &mut self.suppositions {
            *supposition = Supposition::new(supposition.wiring, &self.platform);
        }
    }

    /// What was learnt of the platform may no longer hold; what is refuted stays so.
    fn forget_load(&mut self) {
        (self.next, self.stood_ns, self.explained_s) = (0, 0, 0.0);
        for supposition in &mut self.suppositions {
            let is_refuted = supposition.score <= REFUTED;
            let refuted = supposition.score;
            *supposition = Supposition::new(supposition.wiring, &self.platform);
            if is_refuted {
                supposition.score = refuted;
            }
        }
    }

    /// Takes in what was measured, once a cycle.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        self.periods = self.periods.map(|periods| periods.saturating_add(1));
        let is_whole = || view.measurements.present().iter().all(|drive| drive.is_finite());
        if !(self.is_told || self.by_turn.is_some()) || view.exchange != Exchange::Complete || !is_whole() {
            return;
        }
        let periods = self.periods.replace(0).filter(|periods| *periods <= LONGEST_GAP);
        let span_s = f64::from(periods.unwrap_or(1).max(1)) * view.time.period_s();
        let keep = if periods.is_some() { self.low_pass.kept(span_s) } else { 0.0 };
        if let Some((input, turn)) = &mut self.by_turn {
            turn.hear(view.signals.believed(*input), keep);
        }
        let Rims { speed_m_s, gain_m_s2, force_n } = &mut self.rims;
        let mut stands = true;
        for (wheel, drive) in view.measurements.present().iter().enumerate() {
            let (before_m_s, radius_m) = (speed_m_s[wheel], self.radius_m[wheel]);
            let rim_m_s = radius_m * drive.increment_rad / span_s;
            speed_m_s[wheel] = keep * before_m_s + (1.0 - keep) * rim_m_s;
            gain_m_s2[wheel] = if periods.is_some() { (speed_m_s[wheel] - before_m_s) / span_s } else { 0.0 };
            force_n[wheel] = keep * force_n[wheel] + (1.0 - keep) * drive.torque_nm / radius_m;
            stands &= rim_m_s.abs() < STANDING_M_S;
        }
        if stands {
            self.stood_ns = self.stood_ns.saturating_add((span_s * 1e9) as u64);
            if self.stood_ns >= LOADED_NS && self.next != 0 {
                self.forget_load();
            }
        } else if view.setpoint.status == ReferenceStatus::Moving {
            self.stood_ns = 0;
            let period_s = view.time.period_s();
            if self.is_told {
                self.suppose(period_s);
            }
            if let Some((_, turn)) = &mut self.by_turn {
                turn.look(&self.platform, &self.rims, &self.suppositions, period_s);
            }
        }
    }

    fn suppose(&mut self, period_s: f64) {
        self.looked_s += period_s;
        let span_s = self.suppositions.len() as f64 * period_s;
        let of_file = self.suppositions[0].likelihood();
        let turn = self.next % self.suppositions.len();
        let against = (turn != 0).then_some(of_file);
        let supposition = &mut self.suppositions[turn];
        if supposition.score > REFUTED {
            supposition.look(&self.platform, &self.rims, span_s, against);
        }
        // Never 0 again before all begins anew.
        self.next = turn + 1;
        if self.named.is_none() {
            let judged = self.judge();
            let passed_s = if judged.is_some() { period_s } else { -period_s };
            self.explained_s = (self.explained_s + passed_s).max(0.0);
            self.named =
                judged.filter(|(_, lasting_s)| self.explained_s > *lasting_s).map(|(wheel, _)| wheel);
        }
    }

    /// The wheel that is the first to be looked at, where the wires are wrong, and for how long that must last, s.
    fn judge(&self) -> Option<(usize, f64)> {
        let of_file = self.suppositions[0].misfit;
        let rest = &self.suppositions[1..];
        let best = rest.iter().max_by(|one, other| one.score.total_cmp(&other.score))?;
        let (wheel, least) = match best.wiring {
            Wiring::AsTold => return None,
            Wiring::Turned(wheel) => (wheel, TURNED_MISFIT),
            Wiring::Swapped(wheel, _) => (wheel, SWAPPED_MISFIT),
        };
        let is_swap = matches!(best.wiring, Wiring::Swapped(..));
        // Which two are swapped can't be told on some layouts; that two are can.
        let others = rest.iter().filter(|other| {
            other.wiring != best.wiring && !(is_swap && matches!(other.wiring, Wiring::Swapped(..)))
        });
        let second = others.map(|other| other.score).fold(0.0, f64::max);
        let is_clear = best.score > SCORE && best.score - second > MARGIN;
        let is_explained = best.misfit < LEFT_SHARE * of_file.min((LEFT * of_file).max(1.0));
        let contradiction = self.suppositions[0].contradiction;
        let left = best.contradiction / contradiction;
        // Wheels that turn as a rigid platform's do say nothing of their wires: their drives see to it.
        let (is_consistent, lasting_s) = match contradiction > CONTRADICTION_M_S.powi(2) {
            true => (left < CONTRADICTION_LEFT, if left < PROVEN_LEFT { PROVEN_S } else { LASTING_S }),
            false => (true, LASTING_S),
        };
        (is_clear && of_file > least && is_explained && is_consistent).then_some((wheel, lasting_s))
    }

    /// Whether other wires may yet be why wheels slip: they explain the motion so far, or it has just begun.
    pub(super) fn may_explain(&self) -> bool {
        self.is_told && self.named.is_none() && (self.explained_s > 0.0 || self.looked_s < BEGINS_S)
    }

    /// Whether a gyro begins to show that a wheel is wired backwards.
    pub(super) fn may_turn(&self) -> bool {
        self.by_turn.as_ref().is_some_and(|(_, turn)| turn.begins_to_show())
    }

    /// The wheel that seems to be wired wrongly.
    pub(super) fn suspect(&self) -> Option<usize> {
        self.named.or_else(|| self.by_turn.as_ref().and_then(|(_, turn)| turn.named()))
    }
}
