//! Mass, inertia and friction from what wrenches did: the platform's equation of motion, read backwards.
//!
//! In odom, F = M·Z̈ + Rot(ψ)·(c_spin·w_spin + c_roller·w_roller), both sides behind one low-pass, so that Z̈ is a difference of
//! measured speeds: three linear equations a cycle in θ = (m, J, c_spin, c_roller). A Kalman filter with θ as a random walk
//! solves them (L. Ljung, *System Identification*, 1999, section 11.2). Unlike a gradient on the tracking error it needs no
//! error of the path, and feeds nothing back into the loop but what feeds forward. An equation that is far off (a wheel
//! that slips, a push) counts by the square of its distance less (Huber).

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
    /// Whether the wheels did what was commanded, and moved.
    pub(super) is_true: bool,
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
        let mut one = Identification {
            theta: [mass.0, inertia.0, 0.0, 0.0],
            covariance: [[0.0; PARAMETERS]; PARAMETERS],
            bounds: [mass.1, inertia.1, friction, friction],
            lever_m,
            past: Past::default(),
            trusted_s: 0.0,
        };
        let scales = one.scales(FIRST_SHARE, FIRST_N);
        for (index, scale) in scales.into_iter().enumerate() {
            one.covariance[index][index] = scale * scale;
        }
        one
    }

    fn scales(&self, share: f64, newton: f64) -> [f64; PARAMETERS] {
        [share * self.theta[0], share * self.theta[1], newton, newton]
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

    /// Learns from a cycle; what each equation was off by before, N and N·m.
    pub(super) fn learn(&mut self, seen: &Seen) -> [f64; 3] {
        self.trusted_s = if seen.is_true { self.trusted_s + seen.period_s } else { 0.0 };
        let counts = self.trusted_s > FORGOTTEN / LOW_PASS_1_S;
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
        let walk = self.scales(WALK_SHARE, WALK_N);
        let first = self.scales(FIRST_SHARE, FIRST_N);
        let mut off = [0.0; 3];
        for axis in 0..3 {
            let mut row = [0.0; PARAMETERS];
            row[if axis == 2 { 1 } else { 0 }] = acceleration[axis];
            row[2] = self.past.friction[0][axis];
            row[3] = self.past.friction[1][axis];
            let told: f64 = row.iter().zip(&self.theta).map(|(row, theta)| row * theta).sum();
            off[axis] = self.past.wrench[axis] - told;
            if counts {
                let lever = if axis == 2 { self.lever_m } else { 1.0 };
                self.take(&row, off[axis], lever, seen.period_s);
            }
        }
        if counts {
            for index in 0..PARAMETERS {
                let [low, high] = self.bounds[index];
                self.theta[index] = self.theta[index].clamp(low, high);
                let grown = self.covariance[index][index] + walk[index] * walk[index] * seen.period_s;
                self.covariance[index][index] = grown.min(first[index] * first[index]);
            }
        }
        off
    }

    /// One equation, `off` by how much the wrench exceeds what θ tells.
    fn take(&mut self, row: &[f64; PARAMETERS], off: f64, lever: f64, period_s: f64) {
        let far = (off / (FAR_N * lever)).powi(2).max(1.0);
        let noise = (NOISE_N * lever).powi(2) * NOISE_S / period_s * far;
        let spread: [f64; PARAMETERS] = std::array::from_fn(|index| {
            self.covariance[index].iter().zip(row).map(|(covariance, row)| covariance * row).sum()
        });
        let whole: f64 = noise + row.iter().zip(&spread).map(|(row, spread)| row * spread).sum::<f64>();
        if !(whole.is_finite() && off.is_finite()) {
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
