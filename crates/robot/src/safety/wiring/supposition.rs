//! One way in which the wheels may be wired, and how well the platform's equation of motion explains what was measured so.
//!
//! To the body's equation ([`crate::grip::equation`]) come slopes and pushes, as a force g that stands in odom
//! and a moment h: F = … + (Rotᵀ·g, h), θ = (…, gx, gy, h).
//!
//! The likelihood of the filter's innovations says how well the supposition explains the motion (Y. Bar-Shalom,
//! X. Rong Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, section 11.6),
//! with the tails of a Student's distribution: slip and pushes are rare and far off.
//!
//! Where wheels are wired as the file says, what slip explains is no misfit.

use omnibase_platform::{Kinematics, MAX_WHEELS};

use crate::grip::equation::{BODY, Estimate, body_rows};
use crate::grip::friction::WheelFriction;
use crate::grip::{FirstEstimates, GRAVITY_M_S2};

/// What no equation tells, over the mass, m/s², and for how long such an error stays, s.
const NOISE_M_S2: f64 = 0.04;
const NOISE_S: f64 = 0.1;
/// Squares of standard deviations from which on an equation says little more, and counts less.
const TAIL: f64 = 4.0;
const FAR: f64 = 9.0;
/// Near rest a wheel may be held by so much of its load, until it is so fast, m/s.
const HELD_SHARE: f64 = 0.04;
const HELD_M_S: f64 = 0.03;
/// Uncertainty at start of each friction, N; of the centre of mass, over the wheels' lever; and of what acts from outside, as a
/// slope, rad.
const FIRST_N: f64 = 10.0;
const FIRST_CENTRE: f64 = 0.5;
const FIRST_SLOPE_RAD: f64 = 0.05;
/// Its moment, over that force at the wheels' lever.
const FIRST_MOMENT: f64 = 0.3;
/// What each may change by in the root of a second: over its first uncertainty, of friction, N, and of what acts from outside, for
/// pushes come at once.
const WALK_SHARE: f64 = 0.01;
const WALK_N: f64 = 0.2;
const WALK_OUTSIDE: f64 = 0.3;
/// Wheels slip where forces give the platform so much less than what their rims gain, over that.
const LEAST_SLIP: f64 = 0.2;
/// How long a misfit is remembered, s.
const MISFIT_S: f64 = 0.3;

/// The body's, and what acts from outside.
const PARAMETERS: usize = BODY + 3;

/// What was measured of the wheels, behind one low-pass: rim speeds, m/s, what they gain in a second, and the motors' forces, N.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rims {
    pub(super) speed_m_s: [f64; MAX_WHEELS],
    pub(super) gain_m_s2: [f64; MAX_WHEELS],
    pub(super) force_n: [f64; MAX_WHEELS],
}

/// What all suppositions share.
#[derive(Clone, Debug)]
pub(super) struct Platform {
    wheels: usize,
    rows: [[f64; 3]; MAX_WHEELS],
    /// The twist that each rim's 1 m/s adds, by least squares.
    twist_per_rim: [[f64; 3]; MAX_WHEELS],
    friction: WheelFriction,
    first: FirstEstimates,
    lever_m: f64,
    /// Variances at start, and what each gains in a second.
    start: [f64; PARAMETERS],
    walk_1_s: [f64; PARAMETERS],
}

impl Platform {
    pub(super) fn new(kinematics: &Kinematics, first: FirstEstimates) -> Self {
        let friction = WheelFriction::new(kinematics);
        let (lever_m, (mass_kg, _)) = (friction.lever_m(), first.mass);
        let moment = FIRST_CENTRE * lever_m * mass_kg;
        let slope_n = FIRST_SLOPE_RAD * GRAVITY_M_S2 * mass_kg;
        let (mass, inertia) = (first.share * mass_kg, first.share * first.inertia.0);
        let start = [
            mass,
            inertia,
            FIRST_N,
            FIRST_N,
            moment,
            moment,
            slope_n,
            slope_n,
            FIRST_MOMENT * lever_m * slope_n,
        ];
        let walk = |index: usize| match index {
            2 | 3 => WALK_N,
            6..=8 => WALK_OUTSIDE * start[index],
            _ => WALK_SHARE * start[index],
        };
        let mut platform = Platform {
            wheels: kinematics.wheel_count(),
            rows: [[0.0; 3]; MAX_WHEELS],
            twist_per_rim: [[0.0; 3]; MAX_WHEELS],
            friction,
            first,
            lever_m,
            start: start.map(|deviation| deviation * deviation),
            walk_1_s: std::array::from_fn(|index| walk(index).powi(2)),
        };
        for (wheel, (row, rim)) in kinematics.matrix().iter().zip(kinematics.wheels()).enumerate() {
            platform.rows[wheel] = *row;
            let alone = omnibase_platform::PerWheel::from_fn(platform.wheels, |at| {
                if at == wheel { 1.0 / rim.radius_m } else { 0.0 }
            });
            platform.twist_per_rim[wheel] = omnibase_platform::axes(&kinematics.twist(&alone).twist_in_base);
        }
        platform
    }

    fn sum(&self, rows: &[[f64; 3]; MAX_WHEELS], values: &[f64; MAX_WHEELS]) -> [f64; 3] {
        let pairs = rows.iter().zip(values).take(self.wheels);
        pairs.fold([0.0; 3], |sum, (row, value)| std::array::from_fn(|axis| sum[axis] + value * row[axis]))
    }
}

/// How the wheels are wired, in one way that is thinkable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wiring {
    /// As the file says.
    AsTold,
    /// Motor and encoder of this wheel are both the other way round.
    Turned(usize),
    /// Each of these two has the other's motor and encoder.
    Swapped(usize, usize),
}

impl Wiring {
    /// The wheel that a drive truly moves, and which way.
    fn truly(self, drive: usize) -> (usize, f64) {
        match self {
            Wiring::Turned(wheel) if wheel == drive => (drive, -1.0),
            Wiring::Swapped(one, other) if drive == one => (other, 1.0),
            Wiring::Swapped(one, other) if drive == other => (one, 1.0),
            Wiring::AsTold | Wiring::Turned(_) | Wiring::Swapped(..) => (drive, 1.0),
        }
    }

    /// The turn that the wheels' speeds, or what they gain, make of the platform; and what they would if all added to it.
    pub(super) fn turn(self, platform: &Platform, rims: &[f64; MAX_WHEELS]) -> (f64, f64) {
        let turns = platform.twist_per_rim.iter().zip(self.rewired(rims)).map(|(twist, rim)| twist[2] * rim);
        turns.fold((0.0, 0.0), |(sum, most), turn| (sum + turn, most + turn.abs()))
    }

    fn rewired(self, values: &[f64; MAX_WHEELS]) -> [f64; MAX_WHEELS] {
        let mut truly = [0.0; MAX_WHEELS];
        for (drive, value) in values.iter().enumerate() {
            let (wheel, sign) = self.truly(drive);
            truly[wheel] = sign * value;
        }
        truly
    }
}

/// A supposition and what it came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Supposition {
    pub(super) wiring: Wiring,
    estimate: Estimate<PARAMETERS>,
    /// How far the platform has turned as it supposes, rad.
    heading_rad: f64,
    /// Log-likelihood of its last equations, and by how much all exceeded the file's.
    last: f64,
    pub(super) score: f64,
    /// Mean square of what it leaves unexplained, over what no equation tells.
    pub(super) misfit: f64,
    /// Mean square of what no motion of the platform explains of the wheels' speeds, m²/s².
    pub(super) contradiction: f64,
}

impl Supposition {
    pub(super) fn new(wiring: Wiring, platform: &Platform) -> Self {
        let FirstEstimates { mass, inertia, .. } = platform.first;
        let theta = [mass.0, inertia.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let estimate = Estimate::new(theta, platform.start);
        Supposition {
            wiring,
            estimate,
            heading_rad: 0.0,
            last: 0.0,
            score: 0.0,
            misfit: 0.0,
            contradiction: 0.0,
        }
    }

    /// Log-likelihood of its last equations.
    pub(super) fn likelihood(&self) -> f64 {
        self.last
    }

    /// Looks at the wheels once in so many s; `against` is the likelihood of the file's wiring, `None` for itself.
    pub(super) fn look(&mut self, platform: &Platform, rims: &Rims, span_s: f64, against: Option<f64>) {
        let (likelihood, misfit) = self.learn(platform, rims, span_s);
        self.last = likelihood;
        let keep = |lasting_s: f64| (-span_s / lasting_s).exp();
        let lasting = |before: f64, now: f64| keep(MISFIT_S) * before + (1.0 - keep(MISFIT_S)) * now;
        self.misfit = lasting(self.misfit, misfit);
        self.contradiction = lasting(self.contradiction, self.contradicts(platform, rims));
        self.score += likelihood - against.unwrap_or(likelihood);
    }

    /// What no motion of the platform explains of the wheels' speeds: the mean of its squares, m²/s².
    fn contradicts(&self, platform: &Platform, rims: &Rims) -> f64 {
        let speed_m_s = self.wiring.rewired(&rims.speed_m_s);
        let twist = platform.sum(&platform.twist_per_rim, &speed_m_s);
        let squares = platform.rows.iter().zip(speed_m_s).take(platform.wheels).map(|(row, rim_m_s)| {
            let told_m_s: f64 = row.iter().zip(twist).map(|(row, speed)| row * speed).sum();
            (rim_m_s - told_m_s).powi(2)
        });
        squares.sum::<f64>() / platform.wheels as f64
    }

    /// By how much the wrench falls short of the equations because wheels slip: rims that slip gain speed that no force gave the
    /// platform, so what is missing lies against that gain, and is no more than all of it. Less is noise.
    fn slips(&self, platform: &Platform, rows: &[[f64; PARAMETERS]; 3], wrench: &[f64; 3]) -> [f64; 3] {
        let moved = rows.map(|mut row| {
            // What rubs is no gain, nor is what acts from outside.
            (row[2], row[3]) = (0.0, 0.0);
            row[BODY..].fill(0.0);
            self.estimate.told(&row)
        });
        let arms = [1.0, 1.0, platform.lever_m];
        let dot = |one: &[f64; 3]| -> f64 {
            let parts = one.iter().zip(moved).zip(arms);
            parts.map(|((one, moved), arm)| one * moved / (arm * arm)).sum()
        };
        let short = std::array::from_fn(|axis| self.estimate.told(&rows[axis]) - wrench[axis]);
        let all = dot(&moved);
        let share = if all > 0.0 { (dot(&short) / all).min(1.0) } else { 0.0 };
        if share > LEAST_SLIP { moved.map(|moved| share * moved) } else { [0.0; 3] }
    }

    fn learn(&mut self, platform: &Platform, rims: &Rims, span_s: f64) -> (f64, f64) {
        let rewired = |values: &[f64; MAX_WHEELS]| self.wiring.rewired(values);
        let twist = platform.sum(&platform.twist_per_rim, &rewired(&rims.speed_m_s));
        let [gx, gy, gain] = platform.sum(&platform.twist_per_rim, &rewired(&rims.gain_m_s2));
        let wrench = platform.sum(&platform.rows, &rewired(&rims.force_n));
        let [vx, vy, turn] = twist;
        let [mass_kg, _, _, _, mx, my, ..] = self.estimate.theta;
        let frictions = platform.friction.per_newton(twist, [mx / mass_kg, my / mass_kg]);
        let body = body_rows([gx - turn * vy, gy + turn * vx, gain], turn, frictions);
        let (sin, cos) = self.heading_rad.sin_cos();
        self.heading_rad += turn * span_s;
        let outside = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
        let mass_kg = platform.first.mass.0;
        let held_n = HELD_SHARE * mass_kg * GRAVITY_M_S2 / platform.wheels as f64;
        let held = platform.friction.unknown_per_newton(twist, HELD_M_S);
        let rows: [[f64; PARAMETERS]; 3] = std::array::from_fn(|axis| {
            let mut row = [0.0; PARAMETERS];
            row[..BODY].copy_from_slice(&body[axis]);
            row[BODY..].copy_from_slice(&outside[axis]);
            row
        });
        // What slip explains is no reason to look for other wires.
        let slips = match self.wiring {
            Wiring::AsTold => self.slips(platform, &rows, &wrench),
            Wiring::Turned(_) | Wiring::Swapped(..) => [0.0; 3],
        };
        let (mut likelihood, mut misfit) = (0.0, 0.0);
        for (axis, row) in rows.iter().enumerate() {
            let lever_m = if axis == 2 { platform.lever_m } else { 1.0 };
            let untold = (NOISE_M_S2 * mass_kg * lever_m).powi(2) + held_n * held_n * held[axis];
            let off = wrench[axis] + slips[axis] - self.estimate.told(row);
            let (said, left) = self.take(row, off, untold, span_s);
            likelihood += said;
            misfit += left / 3.0;
        }
        self.walk(platform, span_s);
        (likelihood, misfit)
    }

    /// One equation, `off` by how much the wrench exceeds what θ tells; its likelihood, and its square over its variance.
    fn take(&mut self, row: &[f64; PARAMETERS], off: f64, untold: f64, span_s: f64) -> (f64, f64) {
        let (known, spread) = self.estimate.spread(row);
        let noise = untold * NOISE_S / span_s;
        let whole = noise + known;
        if !(whole.is_finite() && whole > 0.0 && off.is_finite()) {
            return (0.0, 0.0);
        }
        let far = off * off / whole;
        let likelihood = -0.5 * (TAIL * (far / TAIL).ln_1p() + (whole / noise).ln());
        let weighed = noise * (far / FAR).max(1.0) + known;
        self.estimate.take(&spread, weighed, off);
        (likelihood, off * off / (untold + known))
    }

    /// Time passes, and θ stays within its bounds.
    fn walk(&mut self, platform: &Platform, span_s: f64) {
        for index in 0..PARAMETERS {
            self.estimate.covariance[index][index] += platform.walk_1_s[index] * span_s;
        }
        let FirstEstimates { mass, inertia, friction_max_n, .. } = platform.first;
        let friction = [0.0, friction_max_n];
        self.estimate.bound([mass.1, inertia.1, friction, friction], platform.lever_m);
    }
}
