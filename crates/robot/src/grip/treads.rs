//! Treads that give way: while a wheel's push grows its tread yields, and the rim runs ahead of a platform that it takes along.
//!
//! A spring of k N/m gives way by a force over k, so a gripping rim is ahead by the force's gain in a second over k, whatever the platform
//! weighs (K. L. Johnson, *Contact Mechanics*, 1985, section 7.2). Where a motion turns around the softest treads let go of what they
//! held: 0.1 m/s ahead for 10 ms. A wheel that slides is given μ·N: there nothing grows.

use omnibase_platform::PerWheel;

use crate::config::RobotPlan;
use crate::decay::Decay;
use crate::torque_loop::TREAD_STIFFNESS_N_M;

/// How fast a push's gain is followed, 1/s: an encoder's counts tell it coarsely.
const FOLLOWED_1_S: f64 = 200.0;

/// One of them.
#[derive(Clone, Copy, Debug, Default)]
struct Tread {
    /// The least that its rim feels it resist by, N/m.
    stiffness_n_m: f64,
    /// What the rim pushed the floor with last, N; `None` before the first look. And what that gains, N/s.
    push_n: Option<f64>,
    gains_n_s: f64,
}

/// The treads of all wheels.
#[derive(Clone, Debug)]
pub(super) struct Treads {
    followed: Decay,
    treads: PerWheel<Tread>,
}

impl Treads {
    /// As soft as the file says, or as any is.
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let [softest_n_m, _] = plan.controller.tread_stiffness_n_m.unwrap_or(TREAD_STIFFNESS_N_M);
        let wheels = plan.kinematics.wheels();
        // A rim feels a part of its wheel's force, and moves by a part of what its tread gives way.
        let of_rim = |at: usize| softest_n_m.max(f64::MIN_POSITIVE) * wheels[at].rim_share().powi(2);
        let tread = |at: usize| Tread { stiffness_n_m: of_rim(at), ..Tread::default() };
        Treads { followed: Decay::new(FOLLOWED_1_S), treads: PerWheel::from_fn(wheels.len(), tread) }
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        self.treads.iter_mut().for_each(|tread| (tread.push_n, tread.gains_n_s) = (None, 0.0));
    }

    /// Takes in what a wheel's rim pushes the floor with, N, so long after the last look.
    pub(super) fn take(&mut self, wheel: usize, push_n: f64, span_s: f64) {
        let keep = self.followed.kept(span_s);
        let tread = &mut self.treads[wheel];
        let before_n = tread.push_n.replace(push_n).unwrap_or(push_n);
        tread.gains_n_s = keep * tread.gains_n_s + (1.0 - keep) * (push_n - before_n) / span_s;
    }

    /// By how much a rim that grips may be ahead of the platform by it in a direction, forwards or backwards, m/s.
    pub(super) fn ahead_m_s(&self, wheel: usize, direction: f64) -> f64 {
        let Tread { stiffness_n_m, gains_n_s, .. } = self.treads[wheel];
        (direction * gains_n_s / stiffness_n_m).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn treads(stiffness_n_m: f64) -> Treads {
        let tread = |_: usize| Tread { stiffness_n_m, ..Tread::default() };
        Treads { followed: Decay::new(FOLLOWED_1_S), treads: PerWheel::from_fn(2, tread) }
    }

    #[test]
    fn a_rim_is_ahead_by_what_its_force_gains_over_the_stiffness() {
        let mut treads = treads(1e5);
        // The first look tells no gain.
        treads.take(0, 500.0, PERIOD_S);
        assert_eq!([1.0, -1.0].map(|direction| treads.ahead_m_s(0, direction)), [0.0; 2]);
        for cycle in 1..100 {
            treads.take(0, 500.0 - 8.0 * f64::from(cycle), PERIOD_S);
        }
        // 8 kN/s over 1e5 N/m; none of the other wheel's.
        assert!((treads.ahead_m_s(0, -1.0) - 0.08).abs() < 1e-6, "{treads:?}");
        assert_eq!([treads.ahead_m_s(0, 1.0), treads.ahead_m_s(1, -1.0)], [0.0; 2]);
        // What slides is given the same; in 30 ms nothing is left of what grew.
        for _ in 0..30 {
            treads.take(0, -292.0, PERIOD_S);
        }
        assert!(treads.ahead_m_s(0, -1.0) < 3e-4, "{treads:?}");
        treads.forget();
        treads.take(0, 90.0, PERIOD_S);
        assert_eq!(treads.ahead_m_s(0, 1.0), 0.0);
    }
}
