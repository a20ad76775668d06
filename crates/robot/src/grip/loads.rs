//! How a platform rests on its wheels.

use nalgebra::{Matrix3, Vector3};
use omnibase_platform::{Kinematics, MAX_WHEELS};

/// The least load of a wheel over the mean: a place that was found isn't known to a millimetre.
const LEAST_LOAD: f64 = 0.1;

/// The wheels' loads over the mean: exact for three wheels, and for more those that differ least (a stiff body on equal springs).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loads {
    /// What a wheel has at all, and by metres of the centre of mass in x and y.
    shares: [[f64; 3]; MAX_WHEELS],
}

impl Loads {
    pub(crate) fn new(kinematics: &Kinematics) -> Self {
        let wheels = kinematics.wheels();
        let place = |at: usize| {
            let [x, y] = wheels[at].position_m;
            Vector3::new(1.0, x, y)
        };
        let moments: Matrix3<f64> = (0..wheels.len()).map(|at| place(at) * place(at).transpose()).sum();
        let mut shares = [[1.0, 0.0, 0.0]; MAX_WHEELS];
        // On one line nothing is known of how a platform rests across it.
        if let Some(inverse) = moments.try_inverse() {
            for (at, share) in shares.iter_mut().enumerate().take(wheels.len()) {
                *share = (wheels.len() as f64 * inverse * place(at)).into();
            }
        }
        Loads { shares }
    }

    /// By how much that load over the mean grows with each metre that the centre of mass is further along x and y, 1/m.
    pub(crate) fn shift(&self, wheel: usize) -> [f64; 2] {
        let [_, by_x, by_y] = self.shares[wheel];
        [by_x, by_y]
    }

    /// The load on a wheel over the mean, with the centre of mass at a place in base_link, m: never none.
    pub(crate) fn of(&self, wheel: usize, [x, y]: [f64; 2]) -> f64 {
        let [always, by_x, by_y] = self.shares[wheel];
        (always + by_x * x + by_y * y).max(LEAST_LOAD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::layout;

    #[test]
    fn loads_bear_the_centre_of_mass() {
        for wheels in [layout::omni(3, 0.4, 0.1, 0.3), layout::mecanum4(0.24, 0.21, 0.076)] {
            let loads = Loads::new(&Kinematics::new(wheels.clone()).unwrap());
            let centre_m = [0.07, -0.04];
            let count = wheels.len() as f64;
            let mut rests = [0.0; 3];
            for (at, wheel) in wheels.iter().enumerate() {
                let load = loads.of(at, centre_m) / count;
                let [x, y] = wheel.position_m;
                rests = [rests[0] + load, rests[1] + load * x, rests[2] + load * y];
            }
            let off = [rests[0] - 1.0, rests[1] - centre_m[0], rests[2] - centre_m[1]];
            assert!(off.iter().all(|off| off.abs() < 1e-12), "{off:?}");
            // Far outside of its wheels a platform would fall: no load below none.
            assert!((0..wheels.len()).all(|at| loads.of(at, [9.0, 9.0]) >= LEAST_LOAD));
        }
    }
}
