//! The loop that a law of torque closes along one axis, with its margins: wheel, tread, delay and filters.
//!
//! Wheels of modal mass w stand on a body of mass m through the treads, a spring k with a damper c. Collocated, force to
//! wheel speed: G = 1/(w·s + 1/(1/(c + k/s) + 1/(m·s))). A torque acts two periods after its measurement, holds for one and
//! follows with the drive's lag τ; the law's force is K·low-pass(speed + Kp·way) and `integral_1_s` times its integral.
//!
//! With the wheels' rows b, one axis has w = Σb²·j/R² and k = Σb²·(one tread's); about the vertical axis the
//! same holds in kg·m² and N·m·s/rad.
//!
//! A disturbance observer takes off Q·(M·acceleration − torque), Q = 1/(s/g + 1), from speed and torque behind one filter, a period
//! later: the law is (K·low-pass(speed + Kp·way) + Q·M·acceleration)/(1 − Q·filter·path), and path what leads from command to torque.
//!
//! Margins are counted by the peak of the sensitivity |1/(1 + L)|: at most 1.93 leaves 6.3 dB of gain and 30° of phase at
//! once (K. J. Åström and R. M. Murray, *Feedback Systems*, 2008, section 9.3). The loop is stable where 1 + L turns by a
//! quarter turn for each of its integrators from standstill to half of the sampling rate (Nyquist).

mod design;

use nalgebra::Complex;
use std::f64::consts::PI;

/// Stiffness of a tread where the file doesn't say: all that treads are known to have, N/m.
pub(crate) const TREAD_STIFFNESS_N_M: [f64; 2] = [1e5, 4e6];
/// The greatest peak of the sensitivity: 6 dB and 30°.
pub const MOST_SENSITIVE: f64 = 1.93;
/// Stiffnesses of the range that are looked at, in each of its decades.
const STIFFNESSES_A_DECADE: f64 = 8.0;
/// Frequencies that are looked at: the width of a resonance with a damping of 0.05, the least that a file may say, has four.
const FREQUENCIES: usize = 520;
/// The lowest of them, rad/s: slower than anything that the law does.
const SLOWEST_RAD_S: f64 = 0.02;

/// What is known of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueLoop {
    /// Period of the cycle, s.
    pub period_s: f64,
    /// Time constant of the drives' torque, s.
    pub lag_s: f64,
    /// The filter of the measured speed, 1/s.
    pub speed_filter_1_s: f64,
    /// Least and greatest Σb² over the wheels, by the direction in which the axis lies: where a law closes its loop in odom the
    /// platform stands in any.
    pub shares: [f64; 2],
    /// One wheel with rotor and gear, as a mass at its rim, kg.
    pub wheel_kg: f64,
    /// Least and greatest mass (or moment of inertia) of the platform.
    pub body: [f64; 2],
    /// Least and greatest stiffness of one tread, N/m.
    pub stiffness_n_m: [f64; 2],
    /// Least damping of a tread, over the critical of its wheel alone.
    pub damping_ratio: f64,
    /// How much of the law's force is added to its slow part in a second, 1/s; 0 where it has none.
    pub integral_1_s: f64,
    /// The mass (or moment of inertia) that a disturbance observer counts with; 0 where there is none.
    pub observed_body: f64,
}

/// What the law makes of its errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopGains {
    /// The whole gain from speed to force, N·s/m (about the vertical N·m·s/rad).
    pub damping: f64,
    /// From way to speed, 1/s.
    pub kp_1_s: f64,
    /// The low-pass on both, 1/s.
    pub filter_1_s: f64,
    /// How fast a disturbance observer follows, g, 1/s; 0 where there is none.
    pub observer_1_s: f64,
}

impl LoopGains {
    /// By how much force a way of the platform's is answered before anything is added up over time, N/m (N·m/rad).
    pub fn stiffness(&self) -> f64 {
        self.damping * (self.kp_1_s + self.observer_1_s)
    }
}

/// One tread on one platform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plant {
    /// Σb² over the wheels.
    pub shares: f64,
    /// Mass (or moment of inertia) of the platform.
    pub body: f64,
    /// Stiffness of one tread, N/m.
    pub stiffness_n_m: f64,
    /// Its damping over the critical.
    pub damping_ratio: f64,
}

/// What a loop leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Whether it is stable at all.
    pub is_stable: bool,
    /// Peak of the sensitivity.
    pub sensitivity: f64,
    /// By how much the gain may rise, dB.
    pub gain_db: f64,
    /// By how much the phase may fall, degrees.
    pub phase_deg: f64,
}

impl Margins {
    /// Those of a loop that nothing disturbs: the greatest that are told.
    pub const ALL: Margins = Margins { is_stable: true, sensitivity: 0.0, gain_db: 60.0, phase_deg: 180.0 };

    /// Whether 6 dB and 30° are left.
    pub fn suffice(&self) -> bool {
        self.is_stable && self.sensitivity <= MOST_SENSITIVE
    }

    /// The worse of both in each.
    pub fn worse(self, other: Margins) -> Margins {
        Margins {
            is_stable: self.is_stable && other.is_stable,
            sensitivity: self.sensitivity.max(other.sensitivity),
            gain_db: self.gain_db.min(other.gain_db),
            phase_deg: self.phase_deg.min(other.phase_deg),
        }
    }
}

/// What doesn't depend on the law: by frequency.
struct Frequency {
    rad_s: f64,
    /// One period later.
    shift: Complex<f64>,
    /// Hold, delay and lag.
    path: Complex<f64>,
    /// The measured speed's difference and filter.
    speed: Complex<f64>,
    /// The measured torque and its filter, from the command on.
    torque: Complex<f64>,
    /// What the slow part adds to the law's force.
    learnt: Complex<f64>,
}

/// From the wheels' way to the law's force, by frequency.
struct Law {
    /// In K.
    part: Vec<Complex<f64>>,
    /// Beside that: the observer's; empty without one.
    beside: Vec<Complex<f64>>,
}

impl Law {
    fn beside(&self, at: usize) -> Complex<f64> {
        self.beside.get(at).copied().unwrap_or_default()
    }

    fn whole(&self, at: usize, damping: f64) -> Complex<f64> {
        damping * self.part[at] + self.beside(at)
    }
}

impl TorqueLoop {
    fn frequencies(&self) -> Vec<Frequency> {
        let highest_rad_s = 0.999 * PI / self.period_s;
        let step = (highest_rad_s / SLOWEST_RAD_S).powf(1.0 / (FREQUENCIES - 1) as f64);
        let keep = (-self.speed_filter_1_s * self.period_s).exp();
        (0..FREQUENCIES)
            .map(|index| {
                let rad_s = SLOWEST_RAD_S * step.powi(index as i32);
                let s = Complex::new(0.0, rad_s);
                let before = (-s * self.period_s).exp();
                let hold = (1.0 - before) / (s * self.period_s);
                let speed = (1.0 - before) / self.period_s * (1.0 - keep) / (1.0 - keep * before);
                let path = hold * before * before / (s * self.lag_s + 1.0);
                let torque = path * (1.0 - keep) / (1.0 - keep * before);
                let learnt = self.integral_1_s * self.period_s / (1.0 - before) + 1.0;
                Frequency { rad_s, shift: before, path, speed, torque, learnt }
            })
            .collect()
    }

    /// From force to the way of the wheels, by frequency, with hold, delay and lag.
    fn response(&self, plant: &Plant, frequencies: &[Frequency]) -> Vec<Complex<f64>> {
        let wheel = plant.shares * self.wheel_kg;
        let spring = plant.shares * plant.stiffness_n_m;
        let damper = plant.damping_ratio * 2.0 * (spring * wheel).sqrt();
        frequencies
            .iter()
            .map(|at| {
                let s = Complex::new(0.0, at.rad_s);
                let tread = (s * damper + spring) / s;
                let body = s * plant.body;
                at.path / (s * (s * wheel + tread * body / (tread + body)))
            })
            .collect()
    }

    /// A low-pass of the law's, by frequency.
    fn low_pass(&self, filter_1_s: f64, frequencies: &[Frequency]) -> Vec<Complex<f64>> {
        let keep = (-filter_1_s * self.period_s).exp();
        frequencies.iter().map(|at| (1.0 - keep) / (1.0 - keep * at.shift)).collect()
    }

    /// From the wheels' way to the law's force, behind a low-pass.
    fn law(&self, gains: &LoopGains, low_pass: &[Complex<f64>], frequencies: &[Frequency]) -> Law {
        let part = low_pass.iter().zip(frequencies);
        let mut part: Vec<_> = part.map(|(part, at)| part * (at.speed + gains.kp_1_s) * at.learnt).collect();
        let mut beside = Vec::new();
        if self.observed_body > 0.0 {
            beside = self.low_pass(gains.observer_1_s, frequencies);
            for ((observed, part), at) in beside.iter_mut().zip(&mut part).zip(frequencies) {
                let seen = *observed * at.shift;
                let left = 1.0 - seen * at.torque;
                *part /= left;
                *observed = seen * self.observed_body * (1.0 - at.shift) / self.period_s * at.speed / left;
            }
        }
        Law { part, beside }
    }

    /// The loop's integrators: the platform's two, and what is learnt or observed.
    fn quarter_turns(&self) -> f64 {
        2.0 + [self.integral_1_s, self.observed_body].iter().filter(|slow| **slow > 0.0).count() as f64
    }

    /// The stiffnesses of the range that are looked at, N/m.
    pub fn stiffnesses_n_m(&self) -> Vec<f64> {
        let [soft, stiff] = self.stiffness_n_m;
        let steps = ((stiff / soft).log10() * STIFFNESSES_A_DECADE).ceil();
        let of = |step: u32| soft * (stiff / soft).powf(f64::from(step) / steps.max(1.0));
        (0..=steps as u32).map(of).collect()
    }

    /// The platforms that are looked at: the heaviest, the lightest and one between.
    pub fn bodies(&self) -> [f64; 3] {
        let [light, heavy] = self.body;
        [heavy, light, (light * heavy).sqrt()]
    }

    /// The directions that differ: one where the wheels share alike in all.
    pub fn directions(&self) -> &[f64] {
        let [least, greatest] = &self.shares;
        if greatest - least < 1e-9 * greatest { &self.shares[..1] } else { &self.shares }
    }

    /// Every corner of what the loop has to bear.
    pub fn plants(&self) -> Vec<Plant> {
        let stiffnesses = self.stiffnesses_n_m();
        let mut plants = Vec::new();
        for shares in self.directions() {
            for body in self.bodies() {
                for damping_ratio in [self.damping_ratio, 1.0_f64.max(self.damping_ratio)] {
                    let of = |stiffness_n_m: &f64| Plant {
                        shares: *shares,
                        body,
                        stiffness_n_m: *stiffness_n_m,
                        damping_ratio,
                    };
                    plants.extend(stiffnesses.iter().map(of));
                }
            }
        }
        plants
    }

    /// What gains leave on one plant.
    pub fn margins(&self, gains: &LoopGains, plant: &Plant) -> Margins {
        let frequencies = self.frequencies();
        let response = self.response(plant, &frequencies);
        let low_pass = self.low_pass(gains.filter_1_s, &frequencies);
        let law = self.law(gains, &low_pass, &frequencies);
        let open: Vec<Complex<f64>> =
            response.iter().enumerate().map(|(at, plant)| plant * law.whole(at, gains.damping)).collect();
        let turned_rad: f64 = open.windows(2).map(|pair| ((1.0 + pair[1]) / (1.0 + pair[0])).arg()).sum();
        let least = open.iter().map(|at| (1.0 + at).norm()).fold(f64::INFINITY, f64::min);
        let Margins { mut gain_db, mut phase_deg, .. } = Margins::ALL;
        for pair in open.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            if from.im * to.im <= 0.0 && from.re < 0.0 {
                let at = from.re + (to.re - from.re) * from.im / (from.im - to.im);
                // Where it lies beyond −1 it is less gain that would do harm.
                if at > -1.0 {
                    gain_db = gain_db.min(-20.0 * at.abs().log10());
                }
            }
            let (less, more) = (from.norm() - 1.0, to.norm() - 1.0);
            if less * more <= 0.0 && less != more {
                let at = from + (to - from) * (less / (less - more));
                phase_deg = phase_deg.min((-at).arg().to_degrees().abs());
            }
        }
        let is_stable = is_stable(turned_rad, self.quarter_turns());
        Margins { is_stable, sensitivity: 1.0 / least, gain_db, phase_deg }
    }

    /// The worst of what gains leave over all plants.
    pub fn worst(&self, gains: &LoopGains) -> Margins {
        self.plants().iter().fold(Margins::ALL, |worst, plant| worst.worse(self.margins(gains, plant)))
    }
}

fn is_stable(turned_rad: f64, quarter_turns: f64) -> bool {
    (turned_rad - quarter_turns * PI / 2.0).abs() < 1.0
}

/// A robot's loops of torque along x, y and about the vertical, and what closes them.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueDesign {
    /// What is known of each axis.
    pub loops: [TorqueLoop; 3],
    /// Its gains.
    pub gains: [LoopGains; 3],
    /// Gains for all treads, for where torques swing though the file says what the treads are: a floor on which wheels slip is as
    /// soft as none. `None` where it says nothing, or where there are none.
    pub softer: Option<[LoopGains; 3]>,
}

#[cfg(test)]
mod tests;
