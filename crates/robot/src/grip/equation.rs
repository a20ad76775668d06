//! The platform's equation of motion as a line in its parameters, and the Kalman filter that solves it.
//!
//! In body axes, with the centre of mass at c, F = M(c)·a + (−ω²·m·c, 0) + c_spin·w_spin + c_roller·w_roller (B. Siciliano and
//! others, *Robotics*, 2009, section 7.2), linear in θ = (m, J, c_spin, c_roller, m·cx, m·cy, …); θ is a random walk (L. Ljung,
//! *System Identification*, 1999, section 11.2).

/// The parameters of the body itself: mass, inertia, the friction of wheels and rollers, and mass times the centre's place.
pub(crate) const BODY: usize = 6;

/// The centre of mass lies within this part of the wheels' lever.
const MOST_CENTRE: f64 = 0.6;

/// What each parameter of the body makes of the wrench, at an acceleration, m/s² and rad/s², a turn, rad/s, and wrenches of 1 N on
/// every wheel against its spin and its rollers.
pub(crate) fn body_rows(
    [ax, ay, gain]: [f64; 3],
    turn_rad_s: f64,
    [spin, roller]: [[f64; 3]; 2],
) -> [[f64; BODY]; 3] {
    let square = turn_rad_s * turn_rad_s;
    [
        [ax, 0.0, spin[0], roller[0], -square, -gain],
        [ay, 0.0, spin[1], roller[1], gain, -square],
        [0.0, gain, spin[2], roller[2], ay, -ax],
    ]
}

/// What the parameters are held to be, of which the first are the body's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate<const N: usize> {
    pub(crate) theta: [f64; N],
    /// Symmetric to the bit.
    pub(crate) covariance: [[f64; N]; N],
}

impl<const N: usize> Estimate<N> {
    /// Each with a variance of its own.
    pub(crate) fn new(theta: [f64; N], variances: [f64; N]) -> Self {
        let mut covariance = [[0.0; N]; N];
        for (index, variance) in variances.into_iter().enumerate() {
            covariance[index][index] = variance;
        }
        Estimate { theta, covariance }
    }

    /// The wrench's component that `row` tells.
    pub(crate) fn told(&self, row: &[f64; N]) -> f64 {
        row.iter().zip(&self.theta).map(|(row, theta)| row * theta).sum()
    }

    /// The variance of what `row` tells, and how each parameter goes with it.
    pub(crate) fn spread(&self, row: &[f64; N]) -> (f64, [f64; N]) {
        // Line by line, all parameters at once: symmetric as it is, the bits are those of each one's own sum.
        let mut spread = self.covariance[0].map(|covariance| covariance * row[0]);
        for (line, row) in self.covariance[1..].iter().zip(&row[1..]) {
            for (spread, covariance) in spread.iter_mut().zip(line) {
                *spread += covariance * row;
            }
        }
        (row.iter().zip(&spread).map(|(row, spread)| row * spread).sum(), spread)
    }

    /// The variance of what a row tells that has only the first parts.
    pub(crate) fn variance_of_first<const M: usize>(&self, row: &[f64; M]) -> f64 {
        let mut spread = [0.0; M];
        for (line, row) in self.covariance[..M].iter().zip(row) {
            for (spread, covariance) in spread.iter_mut().zip(line) {
                *spread += covariance * row;
            }
        }
        row.iter().zip(&spread).map(|(row, spread)| row * spread).sum()
    }

    /// The variance of what a row tells that has only these two parts, of mass times the centre's place; with the bits that
    /// [`Estimate::spread`] gives for the whole row.
    pub(crate) fn variance_of_centre(&self, row: [f64; 2]) -> f64 {
        let spread = |index: usize| self.covariance[index][4] * row[0] + self.covariance[index][5] * row[1];
        row[0] * spread(4) + row[1] * spread(5)
    }

    /// Takes an equation that is `off`, by how much the wrench exceeds what is told, with its whole variance.
    pub(crate) fn take(&mut self, spread: &[f64; N], whole: f64, off: f64) {
        // Quotients cost most: what is symmetric is divided once, from an even place on, for two go at a time.
        for index in 0..N {
            self.theta[index] += spread[index] / whole * off;
            for other in (index & !1)..N {
                self.covariance[index][other] -= spread[index] * spread[other] / whole;
            }
        }
        for index in 0..N {
            for other in 0..(index & !1) {
                self.covariance[index][other] = self.covariance[other][index];
            }
        }
    }

    /// To the nearest that the bounds of mass, inertia and frictions allow, as the covariance measures distance: what one
    /// parameter may not be, those that belong with it make up for (D. Simon, *IET Control Theory and Applications* 4, 2010,
    /// section 2.3).
    pub(crate) fn bound(&mut self, bounds: [[f64; 2]; 4], lever_m: f64) {
        for (index, [low, high]) in bounds.into_iter().enumerate() {
            let off = self.theta[index].clamp(low, high) - self.theta[index];
            let variance = self.covariance[index][index];
            if off != 0.0 && variance > 0.0 {
                for (theta, line) in self.theta.iter_mut().zip(&self.covariance) {
                    *theta += line[index] / variance * off;
                }
            }
        }
        for (theta, [low, high]) in self.theta.iter_mut().zip(bounds) {
            *theta = theta.clamp(low, high);
        }
        let [mass_kg, inertia_kg_m2] = [self.theta[0], self.theta[1]];
        // Of a body whose inertia about its own centre is some of all.
        let most = (MOST_CENTRE * lever_m * mass_kg).min((0.5 * mass_kg * inertia_kg_m2).sqrt());
        let moment = omnibase_platform::length([self.theta[4], self.theta[5]]);
        if moment > most {
            self.theta[4] *= most / moment;
            self.theta[5] *= most / moment;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_leaves_it_symmetric_and_sums_have_the_bits_of_each_ones_own() {
        let mut estimate = Estimate::new([70.0, 5.0, 3.0, 2.0, 0.1, -0.2], [30.0, 4.0, 9.0, 8.0, 2.0, 1.0]);
        for step in 0..50 {
            let row: [f64; BODY] = std::array::from_fn(|index| {
                if (step + index) % 4 == 0 { 0.0 } else { (f64::from(7 * step as u32 + index as u32)).sin() }
            });
            let (known, spread) = estimate.spread(&row);
            let [first, second, ..] = row;
            let alone = estimate.spread(&[first, second, 0.0, 0.0, 0.0, 0.0]).0;
            assert_eq!(estimate.variance_of_first(&[first, second]), alone);
            for (line, spread) in estimate.covariance.iter().zip(spread) {
                let own: f64 = line.iter().zip(row).map(|(covariance, row)| covariance * row).sum();
                assert_eq!(own.to_bits(), spread.to_bits());
            }
            estimate.take(&spread, known + 0.3, 0.1 * f64::from(step as u32));
            for (index, line) in estimate.covariance.iter().enumerate() {
                assert!(line.iter().zip(&estimate.covariance).all(|(one, other)| *one == other[index]));
            }
        }
    }
}
