//! Mass, inertia and friction from what wrenches did: the platform's equation of motion, read backwards.
//!
//! In odom, F = M·Z̈ + Rot(ψ)·(c_spin·w_spin + c_roller·w_roller), both sides behind one low-pass, so that Z̈ is a difference of
//! measured speeds: three linear equations a cycle in θ = (m, J, c_spin, c_roller). A Kalman filter with θ as a random walk
//! solves them (L. Ljung, *System Identification*, 1999, section 11.2). Unlike a gradient on the tracking error it needs no
//! error of the path, and feeds nothing back into the loop but what feeds forward. An equation that is far off (a wheel
//! that slips, a push) counts less by the square of how far.

use super::friction::WheelForces;

/// The low-pass on both sides, 1/s: slower than treads swing, faster than platforms speed up.
const LOW_PASS_1_S: f64 = 20.0;
/// After so many of its time constants nothing is left of what was before.
const FORGOTTEN: f64 = 3.0;
/// What one equation may be off, N, and for how long such an error stays, s.
const NOISE_N: f64 = 4.0;
const NOISE_S: f64 = 0.1;
/// From where an equation counts less, N.
const FAR_N: f64 = 25.0;
/// Mass and inertia are learnt only above these, m/s² and rad/s²: below, the little of friction that no model tells would
/// look like mass.
const LEAST_ACCELERATION: [f64; 2] = [0.1, 0.15];
/// Uncertainty at start: of mass and inertia over their first estimates, and of each friction, N.
const FIRST_SHARE: f64 = 0.5;
const FIRST_N: f64 = 10.0;
/// What each may change by in the root of a second, likewise.
const WALK_SHARE: f64 = 0.01;
const WALK_N: f64 = 0.2;
/// Periods from a command to the middle of its effect.
const DELAY: usize = 3;

/// Mass, inertia, and the friction of wheels and rollers.
const PARAMETERS: usize = 4;

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Identification {
    theta: [f64; PARAMETERS],
    covariance: [[f64; PARAMETERS]; PARAMETERS],
    /// Variances: the most of each, and what it gains in a second.
    most: [f64; PARAMETERS],
    walk_1_s: [f64; PARAMETERS],
    bounds: [[f64; 2]; PARAMETERS],
    /// By what a force becomes a moment, m.
    lever_m: f64,
    past: Past,
    /// For how long all that is behind the low-pass may be learnt from, s.
    trusted_s: f64,
}

/// What the equations are made of: wrenches on their way, and everything behind the low-pass.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    on_the_way: [[f64; 3]; DELAY],
    /// The wrench behind the speed's own filter.
    aged: [f64; 3],
    wrench: [f64; 3],
    speed: Option<[f64; 3]>,
    friction: [[f64; 3]; 2],
}

/// What was seen in a cycle, in odom.
pub(super) struct Seen {
    /// Measured speed, and how old it is, s.
    pub(super) speed: [f64; 3],
    pub(super) speed_age_s: f64,
    /// The wrench that was commanded in this cycle.
    pub(super) wrench: [f64; 3],
    /// Wrenches of 1 N on every wheel against its spin and its rollers.
    pub(super) friction_per_newton: [[f64; 3]; 2],
    /// Whether the wheels do what is commanded; what they did otherwise is distrusted until the low-pass has forgotten it.
    pub(super) is_obeyed: bool,
    /// Whether the platform is under way: at rest friction has no direction.
    pub(super) moves: bool,
    pub(super) period_s: f64,
}

impl Identification {
    pub(super) fn new(
        mass: (f64, [f64; 2]),
        inertia: (f64, [f64; 2]),
        friction_max_n: f64,
        lever_m: f64,
    ) -> Self {
        let friction = [0.0, friction_max_n];
        let scales = |share: f64, newton: f64| [share * mass.0, share * inertia.0, newton, newton];
        let most = scales(FIRST_SHARE, FIRST_N).map(|deviation| deviation * deviation);
        let mut covariance = [[0.0; PARAMETERS]; PARAMETERS];
        for (index, most) in most.into_iter().enumerate() {
            covariance[index][index] = most;
        }
        Identification {
            theta: [mass.0, inertia.0, 0.0, 0.0],
            covariance,
            most,
            walk_1_s: scales(WALK_SHARE, WALK_N).map(|deviation| deviation * deviation),
            bounds: [mass.1, inertia.1, friction, friction],
            lever_m,
            past: Past::default(),
            // It begins at rest: there is nothing to forget.
            trusted_s: f64::INFINITY,
        }
    }

    pub(super) fn mass_kg(&self) -> f64 {
        self.theta[0]
    }

    pub(super) fn inertia_kg_m2(&self) -> f64 {
        self.theta[1]
    }

    pub(super) fn friction_n(&self) -> WheelForces {
        [self.theta[2], self.theta[3]]
    }

    /// Learns from a cycle.
    pub(super) fn learn(&mut self, seen: &Seen) {
        let told = [seen.speed, seen.wrench, seen.friction_per_newton[0], seen.friction_per_newton[1]];
        if !told.as_flattened().iter().all(|number| number.is_finite()) {
            (self.past, self.trusted_s) = (Past::default(), 0.0);
            return;
        }
        self.trusted_s = if seen.is_obeyed { self.trusted_s + seen.period_s } else { 0.0 };
        let counts = seen.moves && self.trusted_s > FORGOTTEN / LOW_PASS_1_S;
        let past = &mut self.past;
        let keep = (-LOW_PASS_1_S * seen.period_s).exp();
        let kept = (-seen.period_s / seen.speed_age_s.max(1e-9)).exp();
        let acted = past.on_the_way[DELAY - 1];
        past.on_the_way.rotate_right(1);
        past.on_the_way[0] = seen.wrench;
        let low_pass = |old: &mut [f64; 3], new: &[f64; 3], keep: f64| {
            for (old, new) in old.iter_mut().zip(new) {
                *old = keep * *old + (1.0 - keep) * new;
            }
        };
        low_pass(&mut past.aged, &acted, kept);
        let aged = past.aged;
        low_pass(&mut past.wrench, &aged, keep);
        for (old, new) in past.friction.iter_mut().zip(&seen.friction_per_newton) {
            low_pass(old, new, keep);
        }
        let slow = past.speed.get_or_insert(seen.speed);
        let before = *slow;
        low_pass(slow, &seen.speed, keep);
        let after = *slow;
        let acceleration: [f64; 3] = std::array::from_fn(|axis| (after[axis] - before[axis]) / seen.period_s);
        let shows = [
            acceleration[0].hypot(acceleration[1]) > LEAST_ACCELERATION[0],
            acceleration[2].abs() > LEAST_ACCELERATION[1],
        ];
        for (axis, along) in acceleration.into_iter().enumerate() {
            let mut row = [0.0; PARAMETERS];
            let mass = if axis == 2 { 1 } else { 0 };
            row[mass] = along;
            row[2] = self.past.friction[0][axis];
            row[3] = self.past.friction[1][axis];
            let told: f64 = row.iter().zip(&self.theta).map(|(row, theta)| row * theta).sum();
            let off = self.past.wrench[axis] - told;
            if !shows[mass] {
                row[mass] = 0.0;
            }
            if counts {
                let lever = if axis == 2 { self.lever_m } else { 1.0 };
                self.take(&row, off, lever, seen.period_s);
            }
        }
        if counts {
            for index in 0..PARAMETERS {
                let [low, high] = self.bounds[index];
                self.theta[index] = self.theta[index].clamp(low, high);
                let grown = self.covariance[index][index] + self.walk_1_s[index] * seen.period_s;
                self.covariance[index][index] = grown.min(self.most[index]);
            }
        }
    }

    /// One equation, `off` by how much the wrench exceeds what θ tells.
    fn take(&mut self, row: &[f64; PARAMETERS], off: f64, lever: f64, period_s: f64) {
        let far = (off / (FAR_N * lever)).powi(2).max(1.0);
        let noise = (NOISE_N * lever).powi(2) * NOISE_S / period_s * far;
        let spread: [f64; PARAMETERS] = std::array::from_fn(|index| {
            self.covariance[index].iter().zip(row).map(|(covariance, row)| covariance * row).sum()
        });
        let whole: f64 = noise + row.iter().zip(&spread).map(|(row, spread)| row * spread).sum::<f64>();
        if !(whole.is_finite() && whole > 0.0 && off.is_finite()) {
            return;
        }
        for index in 0..PARAMETERS {
            self.theta[index] += spread[index] / whole * off;
            for other in 0..PARAMETERS {
                self.covariance[index][other] -= spread[index] * spread[other] / whole;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    /// A platform whose speeds follow the wrenches that `Seen` tells, five periods late as on the bus; what is learnt after
    /// so many seconds. `push_n` acts beside them.
    fn learnt(seconds: f64, push_n: &dyn Fn(f64) -> f64, trusted: &dyn Fn(f64) -> bool) -> [f64; PARAMETERS] {
        let (mass_kg, inertia_kg_m2, friction_n) = (173.0, 11.3, [4.0, 7.0]);
        let mut one = Identification::new((85.0, [28.0, 255.0]), (6.0, [2.0, 18.0]), 100.0, 0.4);
        let wished = |t: f64| [0.4 * (0.9 * t).sin(), 0.3 * (0.5 * t).cos(), 0.5 * (0.7 * t).sin()];
        let wrench = |t: f64| {
            let (before, after) = (wished(t - 1e-6), wished(t + 1e-6));
            let resists = [2.0, 2.0, 1.2].map(|share| share * (friction_n[0] + friction_n[1]));
            let masses = [mass_kg, mass_kg, inertia_kg_m2];
            std::array::from_fn(|axis| {
                masses[axis] * (after[axis] - before[axis]) / 2e-6 + resists[axis] * wished(t)[axis].signum()
            })
        };
        for cycle in 0..(seconds / PERIOD_S) as u32 {
            let t = f64::from(cycle) * PERIOD_S;
            let signs = wished(t).map(f64::signum);
            // The spin resists along x and about the vertical, the rollers along y.
            let spin = [2.0 * signs[0], 0.0, 1.2 * signs[2]];
            let roller = [0.0, 2.0 * signs[1], 0.0];
            let mut wrench: [f64; 3] = wrench(t);
            wrench[0] +=
                2.0 * (friction_n[0] * signs[0] - (friction_n[0] + friction_n[1]) * signs[0]) + push_n(t);
            wrench[1] += 2.0 * (friction_n[1] - friction_n[0] - friction_n[1]) * signs[1];
            wrench[2] -= 1.2 * friction_n[1] * signs[2];
            one.learn(&Seen {
                speed: wished(t - 5.0 * PERIOD_S),
                speed_age_s: 2.0 * PERIOD_S,
                wrench,
                friction_per_newton: [spin, roller],
                is_obeyed: trusted(t),
                moves: true,
                period_s: PERIOD_S,
            });
        }
        one.theta
    }

    fn off([mass_kg, inertia_kg_m2, spin_n, roller_n]: [f64; PARAMETERS]) -> [f64; 4] {
        [mass_kg / 173.0 - 1.0, inertia_kg_m2 / 11.3 - 1.0, spin_n / 4.0 - 1.0, roller_n / 7.0 - 1.0]
    }

    #[test]
    fn mass_inertia_and_friction_are_read_from_what_wrenches_did() {
        let found = off(learnt(20.0, &|_| 0.0, &|_| true));
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
    fn nothing_is_learnt_while_the_wheels_do_something_else_nor_from_what_is_no_number() {
        let first = [85.0, 6.0, 0.0, 0.0];
        assert_eq!(learnt(5.0, &|_| 0.0, &|_| false), first);
        // A drive that holds back for a moment in every tenth of a second leaves nothing that could be trusted.
        assert_eq!(learnt(5.0, &|_| 0.0, &|t| (10.0 * t).fract() > 0.1), first);
        assert_eq!(learnt(5.0, &|_| f64::NAN, &|_| true)[0..1], first[0..1]);
    }
}
