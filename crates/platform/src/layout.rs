//! Named wheel layouts, and the reasons why a layout cannot be driven.

use nalgebra::SMatrix;

use crate::wheel::{MAX_WHEELS, Wheel};

/// The Barcelona Mobile Manipulator: three omni wheels; equal positive wheel speeds turn it clockwise.
///
/// Wheel 1 at (−p1, 0) rolls along y; wheels 2 and 3 at p·(1/2, ∓√3/2). `p1_m` and `p_m` are the distances
/// from the platform's centre to wheel 1 and to wheels 2 and 3.
pub fn bmm(p1_m: f64, p_m: f64, radius_m: f64) -> Vec<Wheel> {
    let half_root = 3.0_f64.sqrt() / 2.0;
    [
        ("wheel_1", [-p1_m, 0.0], [0.0, 1.0]),
        ("wheel_2", [p_m / 2.0, -p_m * half_root], [-half_root, -0.5]),
        ("wheel_3", [p_m / 2.0, p_m * half_root], [half_root, -0.5]),
    ]
    .into_iter()
    .map(|(name, position_m, direction)| Wheel {
        name: name.into(),
        position_m,
        rolling_direction: direction,
        force_direction: direction,
        radius_m,
    })
    .collect()
}

/// Omni wheels evenly on a circle; equal positive wheel speeds turn the platform counter-clockwise.
///
/// Wheel i (from 0) stands at the angle `first_angle_rad` + 2π·i/count from x.
pub fn omni(count: usize, distance_m: f64, radius_m: f64, first_angle_rad: f64) -> Vec<Wheel> {
    (0..count)
        .map(|at| {
            let (sin, cos) = (first_angle_rad + std::f64::consts::TAU * at as f64 / count as f64).sin_cos();
            Wheel {
                name: format!("wheel_{}", at + 1),
                position_m: [distance_m * cos, distance_m * sin],
                rolling_direction: [-sin, cos],
                force_direction: [-sin, cos],
                radius_m,
            }
        })
        .collect()
}

/// Four mecanum wheels with rollers at 45°: front left, front right, rear left, rear right; positive is forward.
///
/// The wheels stand at (±`half_length_m`, ±`half_width_m`); seen from above their upper rollers form an X, so
/// the force directions (of the rollers on the ground) of diagonal wheels are parallel.
pub fn mecanum4(half_length_m: f64, half_width_m: f64, radius_m: f64) -> Vec<Wheel> {
    let half_root = 0.5_f64.sqrt();
    [
        ("front_left", 1.0, 1.0, -half_root),
        ("front_right", 1.0, -1.0, half_root),
        ("rear_left", -1.0, 1.0, half_root),
        ("rear_right", -1.0, -1.0, -half_root),
    ]
    .into_iter()
    .map(|(name, along, across, force_y)| Wheel {
        name: name.into(),
        position_m: [along * half_length_m, across * half_width_m],
        rolling_direction: [1.0, 0.0],
        force_direction: [half_root, force_y],
        radius_m,
    })
    .collect()
}

/// Why a layout is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// Not enough wheels for three degrees of freedom.
    #[error("{found} wheels cannot hold a platform in all three directions: expected at least 3")]
    TooFewWheels {
        /// How many there are.
        found: usize,
    },
    /// More wheels than the fixed maximum.
    #[error("{found} wheels: expected at most {MAX_WHEELS}")]
    TooManyWheels {
        /// How many there are.
        found: usize,
    },
    /// Two wheels of one name.
    #[error("two wheels are called {name}")]
    SameName {
        /// The name.
        name: String,
    },
    /// NaN or infinity.
    #[error("wheel {wheel}: {setting} is not finite")]
    NotFinite {
        /// The wheel's name.
        wheel: String,
        /// Which setting.
        setting: &'static str,
    },
    /// A radius that is not positive.
    #[error("wheel {wheel}: radius_m is {radius_m}, expected a positive length")]
    Radius {
        /// The wheel's name.
        wheel: String,
        /// The radius found.
        radius_m: f64,
    },
    /// A direction of length zero.
    #[error("wheel {wheel}: {setting} is (0, 0), expected a direction")]
    NoDirection {
        /// The wheel's name.
        wheel: String,
        /// Which setting.
        setting: &'static str,
    },
    /// The wheel turns without pushing.
    #[error(
        "wheel {wheel}: it rolls across the direction of its force (a·u = {cosine:.3}, expected at least \
         {MIN_COSINE} in size), so turning it does not move the platform"
    )]
    RollsAcrossForce {
        /// The wheel's name.
        wheel: String,
        /// The cosine between the two directions.
        cosine: f64,
    },
    /// Some motion of the platform turns no wheel.
    #[error(
        "the wheels drive only {rank} of 3 degrees of freedom: moving by vx = {:.3} m/s, vy = {:.3} m/s, \
         w = {:.3} rad/s turns none of them", .undriven[0], .undriven[1], .undriven[2]
    )]
    Rank {
        /// How many degrees of freedom are driven.
        rank: usize,
        /// A twist that turns no wheel.
        undriven: [f64; 3],
    },
    /// Some motion of the platform hardly turns the wheels.
    #[error(
        "the wheels drive the platform too unequally: condition number {condition:.1}, expected at most \
         {MAX_CONDITION}; weakest is vx = {:.3} m/s, vy = {:.3} m/s, w = {:.3} rad/s", .weakest[0], .weakest[1], .weakest[2]
    )]
    Condition {
        /// The ratio of the strongest to the weakest direction.
        condition: f64,
        /// The twist that turns the wheels least.
        weakest: [f64; 3],
    },
}

/// The least cosine between rolling and force direction: at less, a wheel turns 20 times its share.
pub const MIN_COSINE: f64 = 0.05;
/// The largest condition number of B with lengths measured in the layout's own size; BMM and mecanum have 1 to 3.
pub const MAX_CONDITION: f64 = 50.0;
/// Below this share of the strongest direction, a direction counts as not driven at all.
///
/// The strengths are roots of eigenvalues, so rounding alone leaves about 1e-8.
const RANK_TOLERANCE: f64 = 1e-7;

/// Every reason against a layout; none if it can be driven.
pub fn problems(wheels: &[Wheel]) -> Vec<LayoutError> {
    let mut found = Vec::new();
    for (at, wheel) in wheels.iter().enumerate() {
        if wheels[..at].iter().any(|other| other.name == wheel.name) {
            found.push(LayoutError::SameName { name: wheel.name.clone() });
        }
        wheel_problems(wheel, &mut found);
    }
    if wheels.len() > MAX_WHEELS {
        found.push(LayoutError::TooManyWheels { found: wheels.len() });
    } else if wheels.len() < 3 {
        found.push(LayoutError::TooFewWheels { found: wheels.len() });
    } else if found.is_empty() {
        found.extend(shape_problem(wheels));
    }
    found
}

fn wheel_problems(wheel: &Wheel, found: &mut Vec<LayoutError>) {
    let name = || wheel.name.clone();
    let directions =
        [("rolling_direction", wheel.rolling_direction), ("force_direction", wheel.force_direction)];
    let before = found.len();
    for (setting, pair) in directions.into_iter().chain([("position_m", wheel.position_m)]) {
        if !(pair[0].is_finite() && pair[1].is_finite()) {
            found.push(LayoutError::NotFinite { wheel: name(), setting });
        }
    }
    if !wheel.radius_m.is_finite() {
        found.push(LayoutError::NotFinite { wheel: name(), setting: "radius_m" });
    } else if wheel.radius_m <= 0.0 {
        found.push(LayoutError::Radius { wheel: name(), radius_m: wheel.radius_m });
    }
    for (setting, [x, y]) in directions {
        if x == 0.0 && y == 0.0 {
            found.push(LayoutError::NoDirection { wheel: name(), setting });
        }
    }
    if found.len() == before {
        let (u, a) = (unit(wheel.rolling_direction), unit(wheel.force_direction));
        let cosine = a[0] * u[0] + a[1] * u[1];
        if cosine.abs() < MIN_COSINE {
            found.push(LayoutError::RollsAcrossForce { wheel: name(), cosine });
        }
    }
}

/// A direction as a unit vector.
pub(crate) fn unit([x, y]: [f64; 2]) -> [f64; 2] {
    let length = x.hypot(y);
    [x / length, y / length]
}

/// The row b of a wheel: its surface speed R·ω is b·(vx, vy, w).
pub(crate) fn row(wheel: &Wheel) -> [f64; 3] {
    let (u, a) = (unit(wheel.rolling_direction), unit(wheel.force_direction));
    let [x, y] = wheel.position_m;
    let cosine = a[0] * u[0] + a[1] * u[1];
    [a[0] / cosine, a[1] / cosine, (x * a[1] - y * a[0]) / cosine]
}

fn shape_problem(wheels: &[Wheel]) -> Option<LayoutError> {
    // Turning is measured at the outermost wheel, so that a small robot is judged like a large one.
    let size_m =
        wheels.iter().map(|wheel| wheel.position_m[0].hypot(wheel.position_m[1])).fold(0.0, f64::max);
    let scale = if size_m > 0.0 { size_m } else { 1.0 };
    let mut matrix = SMatrix::<f64, MAX_WHEELS, 3>::zeros();
    for (at, wheel) in wheels.iter().enumerate() {
        let b = row(wheel);
        matrix.set_row(at, &nalgebra::RowVector3::new(b[0], b[1], b[2] / scale));
    }
    let eigen = (matrix.transpose() * matrix).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    // Rounding may leave a small negative eigenvalue.
    let strength = |at: usize| eigen.eigenvalues[order[at]].max(0.0).sqrt();
    let weakest = eigen.eigenvectors.column(order[0]);
    let twist = [weakest[0], weakest[1], weakest[2] / scale];
    let rank = (0..3).filter(|at| strength(*at) > RANK_TOLERANCE * strength(2)).count();
    let condition = strength(2) / strength(0);
    if rank < 3 {
        Some(LayoutError::Rank { rank, undriven: twist })
    } else if condition > MAX_CONDITION {
        Some(LayoutError::Condition { condition, weakest: twist })
    } else {
        None
    }
}
