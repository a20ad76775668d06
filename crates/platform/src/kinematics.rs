//! Between the platform and its wheels: speeds and forces, both ways.

use nalgebra::{Matrix3, SMatrix};

use crate::layout::{self, LayoutError};
use crate::se2::{BodyStep, Twist2, Wrench2};
use crate::wheel::{MAX_WHEELS, PerWheel, Wheel};

/// What wheel speeds say about the platform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredTwist {
    /// The twist that fits the wheels best (least squares of surface speeds).
    pub twist_in_base: Twist2,
    /// The length of the vector of surface speeds that no twist explains, in m/s: some wheel slips.
    ///
    /// Always 0 with three wheels: they contradict nothing.
    pub residual_m_s: f64,
}

/// The kinematics of a wheel layout: R·ω = B·ξ.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinematics {
    wheels: Vec<Wheel>,
    radii_m: PerWheel,
    /// Rows of B.
    rows: [[f64; 3]; MAX_WHEELS],
    /// Columns of the pseudo-inverse of B: the twist per surface speed of each wheel.
    twist_per_speed: [[f64; 3]; MAX_WHEELS],
    /// Rows of the least-norm solution of (1/R·B)ᵀ·τ = F: a wheel's torque per wrench.
    torque_per_wrench: [[f64; 3]; MAX_WHEELS],
}

impl Kinematics {
    /// The kinematics of a layout, or the first reason why it cannot be driven (see [`layout::problems`]).
    pub fn new(wheels: Vec<Wheel>) -> Result<Kinematics, LayoutError> {
        if let Some(problem) = layout::problems(&wheels).into_iter().next() {
            return Err(problem);
        }
        let radii_m = PerWheel::from_fn(wheels.len(), |at| wheels[at].radius_m);
        let mut rows = [[0.0; 3]; MAX_WHEELS];
        for (row, wheel) in rows.iter_mut().zip(&wheels) {
            *row = layout::row(wheel);
        }
        let b = SMatrix::<f64, MAX_WHEELS, 3>::from_fn(|at, axis| rows[at][axis]);
        let speed_per_twist = SMatrix::<f64, MAX_WHEELS, 3>::from_fn(|at, axis| match radii_m.get(at) {
            Some(radius_m) => rows[at][axis] / radius_m,
            None => 0.0,
        });
        let fit = b * inverse(b.transpose() * b);
        let share = speed_per_twist * inverse(speed_per_twist.transpose() * speed_per_twist);
        let array = |matrix: &SMatrix<f64, MAX_WHEELS, 3>| {
            std::array::from_fn(|at| std::array::from_fn(|axis| matrix[(at, axis)]))
        };
        Ok(Kinematics {
            radii_m,
            rows,
            twist_per_speed: array(&fit),
            torque_per_wrench: array(&share),
            wheels,
        })
    }

    /// The wheels, in order.
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels
    }

    /// How many wheels there are.
    pub fn wheel_count(&self) -> usize {
        self.wheels.len()
    }

    /// The matrix B, one row per wheel: surface speed per vx, vy (no unit) and w (m).
    pub fn matrix(&self) -> &[[f64; 3]] {
        &self.rows[..self.wheels.len()]
    }

    /// The wheel speeds, in rad/s, of a twist of the platform.
    pub fn wheel_speeds_rad_s(&self, twist_in_base: Twist2) -> PerWheel {
        let Twist2 { vx_m_s, vy_m_s, w_rad_s } = twist_in_base;
        PerWheel::from_fn(self.wheels.len(), |at| {
            let b = &self.rows[at];
            (b[0] * vx_m_s + b[1] * vy_m_s + b[2] * w_rad_s) / self.radii_m[at]
        })
    }

    /// The twist of the platform that wheel speeds, in rad/s, show.
    pub fn twist(&self, wheel_speeds_rad_s: &PerWheel) -> MeasuredTwist {
        let (fit, residual_m_s) = self.fit(wheel_speeds_rad_s);
        MeasuredTwist { twist_in_base: Twist2::new(fit[0], fit[1], fit[2]), residual_m_s }
    }

    /// The way of the platform when its wheels turn by these angles, in rad, and what no way explains, in m.
    pub fn body_step(&self, wheel_angles_rad: &PerWheel) -> (BodyStep, f64) {
        let (fit, residual_m) = self.fit(wheel_angles_rad);
        (BodyStep::new(fit[0], fit[1], fit[2]), residual_m)
    }

    /// The wrench on the body of wheel torques, in N·m.
    pub fn wrench(&self, wheel_torques_nm: &PerWheel) -> Wrench2 {
        let mut sum = [0.0; 3];
        let wheels = wheel_torques_nm.iter().zip(self.radii_m.iter());
        for ((torque_nm, radius_m), row) in wheels.zip(&self.rows) {
            for (total, part) in sum.iter_mut().zip(row) {
                *total += part * torque_nm / radius_m;
            }
        }
        Wrench2::new(sum[0], sum[1], sum[2])
    }

    /// The wheel torques, in N·m, that together make a wrench; the smallest ones (least squares) if there is a choice.
    pub fn wheel_torques_nm(&self, wrench_in_base: Wrench2) -> PerWheel {
        let Wrench2 { fx_n, fy_n, torque_nm } = wrench_in_base;
        PerWheel::from_fn(self.wheels.len(), |at| {
            let share = &self.torque_per_wrench[at];
            share[0] * fx_n + share[1] * fy_n + share[2] * torque_nm
        })
    }

    /// Least squares over R·`wheels`, and the length of what remains.
    fn fit(&self, wheels: &PerWheel) -> ([f64; 3], f64) {
        let mut fit = [0.0; 3];
        for ((radius_m, wheel), column) in self.radii_m.iter().zip(wheels.iter()).zip(&self.twist_per_speed) {
            let surface = radius_m * wheel;
            for (value, part) in fit.iter_mut().zip(column) {
                *value += part * surface;
            }
        }
        if self.wheels.len() == 3 {
            return (fit, 0.0);
        }
        let surfaces = self.radii_m.iter().zip(wheels.iter()).map(|(radius_m, wheel)| radius_m * wheel);
        let square: f64 = surfaces
            .zip(&self.rows)
            .map(|(surface, b)| {
                let left = surface - (b[0] * fit[0] + b[1] * fit[1] + b[2] * fit[2]);
                left * left
            })
            .sum();
        (fit, square.sqrt())
    }
}

/// The inverse of a matrix that the layout's condition number has shown to have one.
fn inverse(matrix: Matrix3<f64>) -> Matrix3<f64> {
    matrix.try_inverse().unwrap_or_else(Matrix3::zeros)
}
