//! How much each wheel's tread resists: by that, wheels that say different things share it out.
//!
//! A contact with force `f` under load `N` slips at `c·|v|·f/N` against the direction of `f` (Carter's law for small forces,
//! K. L. Johnson, *Contact Mechanics*, 1985, chapter 8), `v` the velocity of the wheel's hub. Whatever the creep `c` is, a
//! platform whose wheels contradict each other moves as the squares of what they slip, each times N/|v|, are least.

use nalgebra::{Matrix3, Vector3};

use crate::wheel::{MAX_WHEELS, PerWheel, Wheel};

/// The treads of a platform whose centre of mass is over the origin of base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Treads {
    load_shares: PerWheel,
    /// Of each wheel: its share of the load times the square of what its rim feels of a force.
    shares: PerWheel,
    positions_m: PerWheel<[f64; 2]>,
}

impl Treads {
    /// Those of wheels.
    pub fn new(wheels: &[Wheel]) -> Treads {
        let load_shares = load_shares(wheels);
        let count = load_shares.len();
        Treads {
            load_shares,
            shares: PerWheel::from_fn(count, |at| wheels[at].rim_share().powi(2) * load_shares[at]),
            positions_m: PerWheel::from_fn(count, |at| wheels[at].position_m),
        }
    }

    /// Each wheel's share of the platform's weight: the most even ones that hold it level.
    pub fn load_shares(&self) -> &PerWheel {
        &self.load_shares
    }

    /// How much each resists while the platform moves by x, y and a turn (m and rad, or per second), over the weight: one
    /// over the way of its hub, or over `least` where that is less.
    pub fn resistances(&self, [x, y, turn]: [f64; 3], least: f64) -> PerWheel {
        PerWheel::from_fn(self.shares.len(), |at| {
            let [place_x_m, place_y_m] = self.positions_m[at];
            let hub = (x - turn * place_y_m).hypot(y + turn * place_x_m);
            self.shares[at] / hub.max(least)
        })
    }

    /// The same where all hubs go one unit.
    pub(crate) fn alike(&self) -> &PerWheel {
        &self.shares
    }

    /// The greatest distance of a wheel's place from the origin, by which hubs may go unalike, for each wheel, m.
    pub(crate) fn arms_m(&self) -> PerWheel {
        self.positions_m.map(|[x_m, y_m]| x_m.hypot(y_m))
    }
}

/// How much wheels with these rows and resistances resist a motion of the platform, each axis.
pub fn resistance(rows: &[[f64; 3]], resistances: &PerWheel) -> Matrix3<f64> {
    let each = rows.iter().zip(resistances.iter());
    each.map(|(row, resists)| Vector3::from(*row) * Vector3::from(*row).transpose() * *resists).sum()
}

/// A way of the platform per way of each wheel's surface, where wheels resist so; `None` where they hold it in less than three
/// directions.
pub(crate) fn fit(rows: &[[f64; 3]], resistances: &PerWheel) -> Option<[Vector3<f64>; MAX_WHEELS]> {
    let gives = resistance(rows, resistances).try_inverse()?;
    let mut fit = [Vector3::zeros(); MAX_WHEELS];
    for (column, (row, resists)) in fit.iter_mut().zip(rows.iter().zip(resistances.iter())) {
        *column = gives * Vector3::from(*row) * *resists;
    }
    Some(fit)
}

fn load_shares(wheels: &[Wheel]) -> PerWheel {
    let places = wheels.iter().take(MAX_WHEELS).map(|wheel| {
        let [x_m, y_m] = wheel.position_m;
        Vector3::new(1.0, x_m, y_m)
    });
    let even = 1.0 / places.clone().count().max(1) as f64;
    let gram: Matrix3<f64> = places.clone().map(|place| place * place.transpose()).sum();
    let carried: Vector3<f64> = places.clone().sum::<Vector3<f64>>() * even;
    let lacking = Vector3::new(1.0, 0.0, 0.0) - carried;
    let by_place = gram.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * lacking);
    let mut places = places;
    // A wheel that would be lifted carries next to nothing.
    PerWheel::from_fn(wheels.len(), |_| {
        places.next().map_or(even, |place| (even + place.dot(&by_place)).max(0.05 * even))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{bmm, mecanum4};

    #[test]
    fn loads_hold_the_platform_level_and_a_hub_that_goes_further_resists_less() {
        for wheels in [bmm(0.38, 0.40, 0.10), mecanum4(0.24, 0.21, 0.076)] {
            let treads = Treads::new(&wheels);
            let loads = treads.load_shares();
            assert!((loads.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{loads:?}");
            for axis in 0..2 {
                let moment: f64 =
                    loads.iter().zip(&wheels).map(|(load, wheel)| load * wheel.position_m[axis]).sum();
                assert!(moment.abs() < 1e-12, "{loads:?}");
            }
            // Turning about a place behind it: a wheel twice as far from there resists half as much for its load.
            let [turn_rad, behind_m] = [0.3, 0.5];
            let resists = treads.resistances([0.0, turn_rad * behind_m, turn_rad], 1e-9);
            for (at, wheel) in wheels.iter().enumerate() {
                let way_m = turn_rad * (wheel.position_m[0] + behind_m).hypot(wheel.position_m[1]);
                let expected = loads[at] * wheel.rim_share().powi(2) / way_m;
                assert!((resists[at] / expected - 1.0).abs() < 1e-12, "{resists:?}");
            }
            assert!(treads.resistances([0.0; 3], 1e-9).iter().all(|resists| resists.is_finite()));
        }
    }
}
