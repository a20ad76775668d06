//! Mass, inertia, centre of mass and friction from what wrenches did: the platform's equation of motion, read backwards.
//!
//! The equation of motion ([`super::equation`]), both sides behind one low-pass: three linear equations a cycle. Unlike a gradient
//! on the tracking error it needs no error of the path, and feeds nothing back into the loop but what feeds forward. An equation
//! that is far off (a wheel that slips, a push) counts less by the square of how far.

use super::FirstEstimates;
use super::equation::{BODY, Estimate, body_rows};
use crate::decay::Decay;
use crate::signals::Dynamics;

/// The low-pass on both sides, 1/s: slower than treads swing, faster than platforms speed up.
const LOW_PASS_1_S: f64 = 20.0;
/// After so many of its time constants nothing is left of what was before.
const FORGOTTEN: f64 = 3.0;
/// What one equation may be off, N, and for how long such an error stays, s; that of moments more, for a load that is thrown to
/// and fro rubs unevenly.
const NOISE_N: f64 = 5.0;
const MOMENT_NOISE: f64 = 2.0;
const NOISE_S: f64 = 0.1;
/// From where an equation counts less, N.
const FAR_N: f64 = 25.0;
/// Mass, inertia and centre are learnt only above these, m/s² and rad/s² (and rad²/s²): below, the little of friction that
/// no model tells would look like mass.
const LEAST_ACCELERATION: [f64; 2] = [0.1, 0.15];
/// Uncertainty at start of each friction, N, and of the centre of mass, over the wheels' lever.
const FIRST_N: f64 = 10.0;
const FIRST_CENTRE: f64 = 0.5;
/// What each may change by in the root of a second, likewise.
const WALK_SHARE: f64 = 0.01;
const WALK_N: f64 = 0.2;
/// A platform at rest may be loaded and unloaded: after so long what was known of its mass is forgotten, s.
const LOADED_S: f64 = 10.0;
/// The parameters that a load changes.
const LOADS: [usize; 4] = [0, 1, 4, 5];

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Identification {
    estimate: Estimate<BODY>,
    /// Variances: the most of each, and what it gains in a second.
    most: [f64; BODY],
    walk_1_s: [f64; BODY],
    bounds: [[f64; 2]; 4],
    /// By what a force becomes a moment, m.
    lever_m: f64,
    past: Past,
    low_pass: Decay,
    /// For how long all that is behind the low-pass may be learnt from, s.
    trusted_s: f64,
}

/// What the equations are made of, behind the low-pass: the wrench, and what each parameter makes of it, by axis.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    wrench: [f64; 3],
    rows: [[f64; BODY]; 3],
}

/// What was measured in a cycle, in body axes.
pub(super) struct Motion {
    /// The acceleration of base_link over the floor, m/s² and rad/s².
    pub(super) acceleration: [f64; 3],
    pub(super) turn_rad_s: f64,
    /// The wrench that the motors' torques made, as old as the acceleration.
    pub(super) wrench: [f64; 3],
    /// Wrenches of 1 N on every wheel against its spin and its rollers.
    pub(super) friction_per_newton: [[f64; 3]; 2],
    /// Whether the wheels grip and their torques are told; what they did otherwise is distrusted until the low-pass has
    /// forgotten it.
    pub(super) is_trusted: bool,
    /// Whether the platform is under way: at rest friction has no direction.
    pub(super) moves: bool,
    pub(super) period_s: f64,
}

impl Motion {
    /// What each parameter makes of the wrench.
    fn rows(&self) -> [[f64; BODY]; 3] {
        body_rows(self.acceleration, self.turn_rad_s, self.friction_per_newton)
    }
}

impl Identification {
    /// From first estimates with their bounds.
    pub(super) fn new(first: &FirstEstimates, lever_m: f64) -> Self {
        let FirstEstimates { mass, inertia, share, friction_max_n } = *first;
        let friction = [0.0, friction_max_n];
        let scales = |share: f64, newton: f64, centre: f64| {
            let moment = centre * lever_m * mass.0;
            [share * mass.0, share * inertia.0, newton, newton, moment, moment]
        };
        let most = scales(share, FIRST_N, FIRST_CENTRE).map(|deviation| deviation * deviation);
        Identification {
            estimate: Estimate::new([mass.0, inertia.0, 0.0, 0.0, 0.0, 0.0], most),
            most,
            walk_1_s: scales(WALK_SHARE, WALK_N, WALK_SHARE).map(|deviation| deviation * deviation),
            bounds: [mass.1, inertia.1, friction, friction],
            lever_m,
            past: Past::default(),
            low_pass: Decay::new(LOW_PASS_1_S),
            // It begins at rest: there is nothing to forget.
            trusted_s: f64::INFINITY,
        }
    }

    pub(super) fn dynamics(&self) -> Dynamics {
        let [mass_kg, inertia_kg_m2, spin_n, roller_n, x, y] = self.estimate.theta;
        Dynamics { mass_kg, inertia_kg_m2, friction_n: [spin_n, roller_n], mass_moment_kg_m: [x, y] }
    }

    /// How uncertain the mass is, one standard deviation, kg.
    pub(super) fn mass_sigma_kg(&self) -> f64 {
        let mut row = [0.0; BODY];
        row[0] = 1.0;
        self.estimate.spread(&row).0.max(0.0).sqrt()
    }

    /// By how much less than it tells a motion may resist, one standard deviation, N and N·m: what is told as little as can be
    /// has nothing to lose.
    pub(super) fn doubts_n(&self, motion: &Motion) -> [f64; 3] {
        let sigma = |row: &[f64; BODY]| self.estimate.spread(row).0.max(0.0).sqrt();
        motion.rows().map(|row| {
            let bounded = row.iter().zip(self.estimate.theta).zip(self.bounds);
            let lost_n: f64 = bounded.map(|((row, theta), [low, _])| row * (theta - low)).sum();
            let of_centre = self.estimate.variance_of_centre([row[4], row[5]]).max(0.0).sqrt();
            sigma(&row).min(lost_n.abs() + of_centre)
        })
    }

    /// Learns from a cycle.
    pub(super) fn learn(&mut self, motion: &Motion) {
        let told = [
            motion.acceleration,
            motion.wrench,
            motion.friction_per_newton[0],
            motion.friction_per_newton[1],
        ];
        if !(told.as_flattened().iter().all(|number| number.is_finite()) && motion.turn_rad_s.is_finite()) {
            (self.past, self.trusted_s) = (Past::default(), 0.0);
            return;
        }
        if !motion.moves {
            // A floor holds what stands against any wrench: no equation tells that, and none may begin with it.
            (self.past, self.trusted_s) = (Past::default(), f64::INFINITY);
            for index in LOADS {
                self.grow(index, self.most[index] * motion.period_s / LOADED_S);
            }
            return;
        }
        self.trusted_s = if motion.is_trusted { self.trusted_s + motion.period_s } else { 0.0 };
        let keep = self.low_pass.kept(motion.period_s);
        let low_pass = |old: &mut f64, new: f64| *old = keep * *old + (1.0 - keep) * new;
        self.past.wrench.iter_mut().zip(motion.wrench).for_each(|(old, new)| low_pass(old, new));
        let (rows, new) = (self.past.rows.as_flattened_mut(), motion.rows());
        rows.iter_mut().zip(new.as_flattened()).for_each(|(old, new)| low_pass(old, *new));
        if self.trusted_s > FORGOTTEN / LOW_PASS_1_S {
            let Past { wrench, rows } = self.past;
            let along = omnibase_platform::length([rows[0][0], rows[1][0]]) > LEAST_ACCELERATION[0];
            let turns = [rows[2][1], rows[0][4]].iter().any(|turn| turn.abs() > LEAST_ACCELERATION[1]);
            for (axis, (mut row, wrench)) in rows.into_iter().zip(wrench).enumerate() {
                let told = self.estimate.told(&row);
                let shows = if axis == 2 { [false, turns, along] } else { [along, false, turns] };
                for (index, shows) in [(0, shows[0]), (1, shows[1]), (4, shows[2]), (5, shows[2])] {
                    if !shows {
                        row[index] = 0.0;
                    }
                }
                let lever = if axis == 2 { MOMENT_NOISE * self.lever_m } else { 1.0 };
                self.take(&row, wrench - told, lever, motion.period_s);
            }
            for index in 0..BODY {
                self.grow(index, self.walk_1_s[index] * motion.period_s);
            }
            self.estimate.bound(self.bounds, self.lever_m);
        }
    }

    fn grow(&mut self, index: usize, variance: f64) {
        let held = &mut self.estimate.covariance[index][index];
        *held = (*held + variance).min(self.most[index].max(*held));
    }

    /// One equation, `off` by how much the wrench exceeds what θ tells.
    fn take(&mut self, row: &[f64; BODY], off: f64, lever: f64, period_s: f64) {
        let far = (off / (FAR_N * lever)).powi(2).max(1.0);
        let noise = (NOISE_N * lever).powi(2) * NOISE_S / period_s * far;
        let (known, spread) = self.estimate.spread(row);
        let whole = noise + known;
        if whole.is_finite() && whole > 0.0 && off.is_finite() {
            self.estimate.take(&spread, whole, off);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn first(mass: (f64, [f64; 2]), inertia: (f64, [f64; 2])) -> FirstEstimates {
        FirstEstimates { mass, inertia, share: 0.5, friction_max_n: 100.0 }
    }

    /// A platform whose speeds follow the wrenches of a motion; what is learnt after so many seconds. `push_n` acts beside them.
    fn learnt(seconds: f64, push_n: &dyn Fn(f64) -> f64, trusted: &dyn Fn(f64) -> bool) -> [f64; BODY] {
        let (mass_kg, inertia_kg_m2, friction_n) = (173.0, 11.3, [4.0, 7.0]);
        let [cx, cy] = [0.08, -0.05];
        let mut one = Identification::new(&first((85.0, [28.0, 255.0]), (6.0, [2.0, 18.0])), 0.4);
        let wished = |t: f64| [0.4 * (0.9 * t).sin(), 0.3 * (0.5 * t).cos(), 0.5 * (0.7 * t).sin()];
        for cycle in 0..(seconds / PERIOD_S) as u32 {
            let t = f64::from(cycle) * PERIOD_S;
            let [vx, vy, turn] = wished(t);
            let (before, after) = (wished(t - 1e-6), wished(t + 1e-6));
            let [gx, gy, gain] = std::array::from_fn(|axis| (after[axis] - before[axis]) / 2e-6);
            let (ax, ay) = (gx - turn * vy, gy + turn * vx);
            // The spin resists along x and about the vertical, the rollers along y.
            let spin = [2.0 * vx.signum(), 0.0, 1.2 * turn.signum()];
            let roller = [0.0, 2.0 * vy.signum(), 0.0];
            // By Newton and Euler for the centre of mass itself, its inertia by Steiner.
            let (cax, cay) = (ax - gain * cy - turn * turn * cx, ay + gain * cx - turn * turn * cy);
            let own_kg_m2 = inertia_kg_m2 - mass_kg * (cx * cx + cy * cy);
            let rubs: [f64; 3] =
                std::array::from_fn(|axis| friction_n[0] * spin[axis] + friction_n[1] * roller[axis]);
            let wrench = [
                mass_kg * cax + rubs[0] + push_n(t),
                mass_kg * cay + rubs[1],
                own_kg_m2 * gain + mass_kg * (cx * cay - cy * cax) + rubs[2],
            ];
            one.learn(&Motion {
                acceleration: [ax, ay, gain],
                turn_rad_s: turn,
                wrench,
                friction_per_newton: [spin, roller],
                is_trusted: trusted(t),
                moves: true,
                period_s: PERIOD_S,
            });
        }
        one.estimate.theta
    }

    fn off([mass_kg, inertia_kg_m2, spin_n, roller_n, x, y]: [f64; BODY]) -> [f64; BODY] {
        let centre = [x / (173.0 * 0.08) - 1.0, y / (173.0 * -0.05) - 1.0];
        let [x, y] = centre;
        [mass_kg / 173.0 - 1.0, inertia_kg_m2 / 11.3 - 1.0, spin_n / 4.0 - 1.0, roller_n / 7.0 - 1.0, x, y]
    }

    #[test]
    fn mass_inertia_centre_and_friction_are_read_from_what_wrenches_did() {
        let found = off(learnt(60.0, &|_| 0.0, &|_| true));
        assert!(found.iter().all(|off| off.abs() < 0.03), "{found:?}");
        // Half of the mass is made up for within two seconds.
        let early = off(learnt(2.0, &|_| 0.0, &|_| true));
        assert!(early[0].abs() < 0.1, "{early:?}");
    }

    #[test]
    fn a_push_of_a_second_moves_the_mass_by_a_twentieth_at_most() {
        let push = |t: f64| if (5.0..6.0).contains(&t) { 400.0 } else { 0.0 };
        let (pushed, alone) = (learnt(6.0, &push, &|_| true), learnt(6.0, &|_| 0.0, &|_| true));
        assert!((pushed[0] - alone[0]).abs() < 0.05 * 173.0, "{pushed:?} {alone:?}");
        assert_ne!(pushed, alone);
    }

    #[test]
    fn what_a_platform_was_held_by_at_rest_tells_nothing_of_its_mass() {
        let after_rest = |wrench_n: f64| {
            let mut one = Identification::new(&first((70.0, [25.0, 200.0]), (7.0, [2.0, 20.0])), 0.4);
            let seen = |moves: bool, wrench_n: f64, t: f64| Motion {
                acceleration: [if moves { 0.8 * (4.0 * t).sin() } else { 0.0 }, 0.0, 0.0],
                turn_rad_s: 0.0,
                wrench: [wrench_n, 0.0, 0.0],
                friction_per_newton: [[0.0; 3]; 2],
                is_trusted: true,
                moves,
                period_s: PERIOD_S,
            };
            (0..300).for_each(|_| one.learn(&seen(false, wrench_n, 0.0)));
            for cycle in 0..100 {
                let t = f64::from(cycle) * PERIOD_S;
                one.learn(&seen(true, 70.0 * 0.8 * (4.0 * t).sin(), t));
            }
            one.estimate.theta
        };
        assert_eq!(after_rest(300.0), after_rest(0.0));
        assert!((after_rest(300.0)[0] - 70.0).abs() < 0.1, "{:?}", after_rest(300.0));
    }

    #[test]
    fn nothing_is_learnt_while_the_wheels_do_something_else_nor_from_what_is_no_number() {
        let unlearnt = [85.0, 6.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(learnt(5.0, &|_| 0.0, &|_| false), unlearnt);
        // A drive that holds back for a moment in every tenth of a second leaves nothing that could be trusted.
        assert_eq!(learnt(5.0, &|_| 0.0, &|t| (10.0 * t).fract() > 0.1), unlearnt);
        assert_eq!(learnt(5.0, &|_| f64::NAN, &|_| true)[0..1], unlearnt[0..1]);
    }
}
