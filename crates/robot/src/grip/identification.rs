//! Mass, inertia, centre of mass and friction from what wrenches did: the platform's equation of motion, read backwards.
//!
//! The equation of motion ([`super::equation`]), both sides behind one low-pass: three linear equations a cycle. Unlike a gradient
//! on the tracking error it needs no error of the path, and feeds nothing back into the loop but what feeds forward. An equation
//! that is far off (a wheel that slips, a push) counts less by the square of how far.
//!
//! A second filter over the same equations knows slopes, too, for the watches of slip: F = … − Rotᵀ·g, g the slope's part of the weight in
//! axes that don't turn. What rubs turns with the motion and what slips lies along it; a slope stays where it is, and is what wheels that
//! stand hold against. It is known from there and learnt slowly, or slides would be taken for it.

use omnibase_platform::wrap_angle_rad;

use super::equation::{BODY, Estimate, body_rows};
use super::{FirstEstimates, GRAVITY_M_S2};
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

/// The parameters of the watches: the body's, and a slope's force.
const WATCHED: usize = BODY + 2;
/// How uncertain that force is at rest, over the weight, for friction holds a part of it; what it may change by in the root of a second;
/// and steeper than the most no floor is. What is less than the least the watches allow for by themselves.
const RESTING_SLOPE: f64 = 0.01;
const WALK_SLOPE: f64 = 0.002;
const MOST_SLOPE: f64 = 0.1;
const LEAST_SLOPE: f64 = 0.01;
/// What friction holds of a slope at least, where nothing is known of it.
const HELD_SLOPE: f64 = 0.025;
/// So steep a level floor may look while wheels slide; motions count with steeper ones, and from there on with so much more for each part
/// more until they count with all of it.
const LOOKS_STEEP: f64 = 0.02;
const STEEPER: f64 = 2.0;
/// How fast it is drawn to what wheels that stand hold against, 1/s.
const RESTING_1_S: f64 = 20.0;

/// The filter.
#[derive(Clone, Debug)]
pub(super) struct Identification {
    estimate: Estimate<BODY>,
    /// The same with a slope, for the watches of slip and what motions may take: the law's mass learns quicker and truer without one.
    watched: Estimate<WATCHED>,
    /// A slope's force is kept in axes that don't turn.
    turned: Turned,
    resting: Decay,
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

/// How far the platform turned.
#[derive(Clone, Copy, Debug)]
struct Turned {
    rad: f64,
    sin: f64,
    cos: f64,
}

impl Turned {
    fn to(rad: f64) -> Self {
        let rad = wrap_angle_rad(rad);
        let (sin, cos) = rad.sin_cos();
        Turned { rad, sin, cos }
    }

    /// A vector in axes that don't turn, in those of the body.
    fn in_body(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x + self.sin * y, self.cos * y - self.sin * x]
    }

    /// A vector in axes of the body, in those that don't turn.
    fn out_of_body(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }
}

/// What the equations are made of, behind the low-pass: the wrench, and what each parameter makes of it, by axis.
#[derive(Clone, Copy, Debug, Default)]
struct Past {
    wrench: [f64; 3],
    rows: [[f64; WATCHED]; 3],
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

/// What the watches of slip believe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    pub(super) dynamics: Dynamics,
    pub(super) mass_sigma_kg: f64,
    /// A slope's force in body axes, N, as far as it is more than the watches allow for.
    pub(super) slope_n: [f64; 2],
}

/// What is said of the body, and of a slope.
fn beside([mass, inertia, spin, roller, x, y]: [f64; BODY], [along, across]: [f64; 2]) -> [f64; WATCHED] {
    [mass, inertia, spin, roller, x, y, along, across]
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
        let body = [mass.0, inertia.0, 0.0, 0.0, 0.0, 0.0];
        let slope = (RESTING_SLOPE * mass.0 * GRAVITY_M_S2).powi(2);
        Identification {
            estimate: Estimate::new(body, most),
            watched: Estimate::new(beside(body, [0.0; 2]), beside(most, [slope; 2])),
            turned: Turned::to(0.0),
            resting: Decay::new(RESTING_1_S),
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
        dynamics(&self.estimate)
    }

    /// What the watches of slip go by.
    pub(super) fn watched(&self) -> Watched {
        let [mass_kg, .., x, y] = self.watched.theta;
        let least_n = LEAST_SLOPE * GRAVITY_M_S2 * mass_kg;
        let told = 1.0 - (least_n / omnibase_platform::length([x, y])).min(1.0);
        Watched {
            dynamics: dynamics(&self.watched),
            mass_sigma_kg: self.watched.covariance[0][0].max(0.0).sqrt(),
            slope_n: self.turned.in_body([x, y]).map(|force_n| told * force_n),
        }
    }

    /// How hard a slope may pull the platform in body axes, m/s²: with a standard deviation of what isn't known of it, and not at all
    /// where a level floor on which wheels slide may look so.
    pub(super) fn slope_m_s2(&self) -> [f64; 2] {
        let [mass_kg, .., along_n, across_n] = self.watched.theta;
        let [x, y] = self.turned.in_body([along_n, across_n]);
        let slope = omnibase_platform::length([x, y]);
        if slope <= LOOKS_STEEP * GRAVITY_M_S2 * mass_kg {
            return [0.0; 2];
        }
        let variance = self.watched.covariance[BODY][BODY].max(self.watched.covariance[BODY + 1][BODY + 1]);
        let most_n = slope + variance.max(0.0).sqrt();
        let sure_n = STEEPER * (slope - LOOKS_STEEP * GRAVITY_M_S2 * mass_kg);
        [x, y].map(|axis| axis / slope * sure_n.min(most_n) / mass_kg)
    }

    /// What wheels that stand push with, and what friction is known to hold of it, by axis in body axes, N: nothing moves by what is
    /// beyond, so it is a slope's.
    pub(super) fn rest(&mut self, pushes_n: [f64; 2], held_n: [f64; 2], span_s: f64) {
        if !pushes_n.iter().chain(&held_n).all(|force_n| force_n.is_finite()) {
            return;
        }
        let share = 1.0 - self.resting.kept(span_s);
        let [mass_kg, .., along_n, across_n] = self.watched.theta;
        let slope_n = self.turned.in_body([along_n, across_n]);
        let least_n = HELD_SLOPE * GRAVITY_M_S2 * mass_kg;
        let [x, y] = std::array::from_fn(|axis| {
            let left_n: f64 = pushes_n[axis] + slope_n[axis];
            share * (left_n - left_n.clamp(-held_n[axis].max(least_n), held_n[axis].max(least_n)))
        });
        let by_n = self.turned.out_of_body([x, y]);
        let variance = (RESTING_SLOPE * self.watched.theta[0] * GRAVITY_M_S2).powi(2);
        for (index, by_n) in (BODY..WATCHED).zip(by_n) {
            self.watched.theta[index] -= by_n;
            for other in 0..WATCHED {
                (self.watched.covariance[index][other], self.watched.covariance[other][index]) = (0.0, 0.0);
            }
            self.watched.covariance[index][index] = variance;
        }
        self.bound_slope();
    }

    /// No steeper than floors are.
    fn bound_slope(&mut self) {
        let most_n = MOST_SLOPE * GRAVITY_M_S2 * self.watched.theta[0];
        let [.., x, y] = &mut self.watched.theta;
        let steep = omnibase_platform::length([*x, *y]) / most_n;
        if steep > 1.0 {
            (*x, *y) = (*x / steep, *y / steep);
        }
    }

    /// How uncertain the mass is, one standard deviation, kg.
    pub(super) fn mass_sigma_kg(&self) -> f64 {
        self.estimate.covariance[0][0].max(0.0).sqrt()
    }

    /// By how much less than it tells a motion may resist, one standard deviation, N and N·m: what is told as little as can be
    /// has nothing to lose.
    pub(super) fn doubts_n(&self, motion: &Motion) -> [f64; 3] {
        let mut doubts_n = [0.0; 3];
        for (doubt_n, row) in doubts_n.iter_mut().zip(&motion.rows()) {
            let bounded = row.iter().zip(&self.watched.theta).zip(&self.bounds);
            let lost_n: f64 = bounded.map(|((row, theta), [low, _])| row * (theta - low)).sum();
            let of_centre = self.watched.variance_of_centre([row[4], row[5]]).max(0.0).sqrt();
            let sigma_n = self.watched.variance_of_first(row).max(0.0).sqrt();
            *doubt_n = sigma_n.min(lost_n.abs() + of_centre);
        }
        doubts_n
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
        self.turned = Turned::to(self.turned.rad + motion.period_s * motion.turn_rad_s);
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
        let Turned { sin, cos, .. } = self.turned;
        let [x, y, turn] = motion.rows();
        let new = [beside(x, [-cos, -sin]), beside(y, [sin, -cos]), beside(turn, [0.0; 2])];
        let rows = self.past.rows.as_flattened_mut();
        rows.iter_mut().zip(new.as_flattened()).for_each(|(old, new)| low_pass(old, *new));
        if self.trusted_s > FORGOTTEN / LOW_PASS_1_S {
            let Past { wrench, rows } = self.past;
            let along = omnibase_platform::length([rows[0][0], rows[1][0]]) > LEAST_ACCELERATION[0];
            let turns = [rows[2][1], rows[0][4]].iter().any(|turn| turn.abs() > LEAST_ACCELERATION[1]);
            for (axis, (mut row, wrench)) in rows.into_iter().zip(wrench).enumerate() {
                let body = |row: &[f64; WATCHED]| std::array::from_fn(|index| row[index]);
                let off_n = wrench - self.estimate.told(&body(&row));
                let off_beside_n = wrench - self.watched.told(&row);
                let shows = if axis == 2 { [false, turns, along] } else { [along, false, turns] };
                for (index, shows) in [(0, shows[0]), (1, shows[1]), (4, shows[2]), (5, shows[2])] {
                    if !shows {
                        row[index] = 0.0;
                    }
                }
                let lever = if axis == 2 { MOMENT_NOISE * self.lever_m } else { 1.0 };
                take(&mut self.estimate, &body(&row), off_n, lever, motion.period_s);
                take(&mut self.watched, &row, off_beside_n, lever, motion.period_s);
            }
            for index in 0..BODY {
                self.grow(index, self.walk_1_s[index] * motion.period_s);
            }
            let walk = (WALK_SLOPE * self.watched.theta[0] * GRAVITY_M_S2).powi(2);
            for index in BODY..WATCHED {
                self.watched.covariance[index][index] += walk * motion.period_s;
            }
            self.estimate.bound(self.bounds, self.lever_m);
            self.watched.bound(self.bounds, self.lever_m);
            self.bound_slope();
        }
    }

    fn grow(&mut self, index: usize, variance: f64) {
        for held in [&mut self.estimate.covariance[index][index], &mut self.watched.covariance[index][index]]
        {
            *held = (*held + variance).min(self.most[index].max(*held));
        }
    }
}

/// What an estimate tells of the body.
fn dynamics<const N: usize>(estimate: &Estimate<N>) -> Dynamics {
    let [mass_kg, inertia_kg_m2, spin_n, roller_n, x, y] = std::array::from_fn(|index| estimate.theta[index]);
    Dynamics { mass_kg, inertia_kg_m2, friction_n: [spin_n, roller_n], mass_moment_kg_m: [x, y] }
}

/// One equation, `off` by how much the wrench exceeds what θ tells.
fn take<const N: usize>(estimate: &mut Estimate<N>, row: &[f64; N], off: f64, lever: f64, period_s: f64) {
    let far = (off / (FAR_N * lever)).powi(2).max(1.0);
    let noise = (NOISE_N * lever).powi(2) * NOISE_S / period_s * far;
    let (known, spread) = estimate.spread(row);
    let whole = noise + known;
    if whole.is_finite() && whole > 0.0 && off.is_finite() {
        estimate.take(&spread, whole, off);
    }
}

#[cfg(test)]
mod tests;
