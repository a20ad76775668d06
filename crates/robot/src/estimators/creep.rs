//! What wheels turn without moving the platform: the creep of their treads while they accelerate it.

use omnibase_platform::{Kinematics, PerWheel, Twist2, Wrench2};

use crate::config::EstimatorTable;
use crate::signals::PlatformState;

/// Standard gravity, m/s² (ISO 80000-3).
const GRAVITY_M_S2: f64 = 9.806_65;

/// α of the filter through which the gained speed is seen, rad/s. It only shifts the slip by 30 ms; without it the noise
/// of a difference of differences would stand in the pose.
const GAIN_FILTER_RAD_S: f64 = 30.0;

/// Takes the creep of the treads out of what the encoders count, by the speed that the platform gained.
///
/// A contact with force `f` under load `N` slips at `c·|v|·f/N` against the direction of `f` (Carter's law for small
/// forces, K. L. Johnson, *Contact Mechanics*, 1985, chapter 8), `v` the velocity of the wheel's hub. Forces that
/// accelerate a mass `m` on `n` wheels are in proportion to it as the loads `m·g/n` are, so that no mass is needed.
/// Forces against drag are left out: they turn with the direction of travel, and over a closed path sum up to nothing.
#[derive(Clone, Debug)]
pub(super) struct Creep {
    kinematics: Kinematics,
    /// Slip over travelling speed and over a wheel's share of the gained speed, s/m: c·n/g.
    slip_s_m: f64,
    /// Speed by what the encoders counted. Not what odometry made of it: that would see its own correction again.
    counted_in_odom: Option<Twist2>,
}

impl Creep {
    /// What a robot's file says; `None` where it doesn't ask for it.
    pub(super) fn new(table: &EstimatorTable, kinematics: &Kinematics) -> Option<Creep> {
        let slip_s_m = table.creep? * kinematics.wheel_count() as f64 / GRAVITY_M_S2;
        Some(Creep { kinematics: kinematics.clone(), slip_s_m, counted_in_odom: None })
    }

    /// Nothing is known of the motion before the next increments.
    pub(super) fn reset(&mut self) {
        self.counted_in_odom = None;
    }

    /// The increments, rad, that treads without creep would have had; `state` is that of the cycle before.
    pub(super) fn corrected(
        &mut self,
        increments_rad: &PerWheel,
        state: &PlatformState,
        period_s: f64,
    ) -> PerWheel {
        let heading_rad = state.odom_from_body.heading_rad;
        let Twist2 { vx_m_s, vy_m_s, w_rad_s } = state.twist_in_body;
        let counted = self.kinematics.twist(&increments_rad.map(|angle| angle / period_s)).twist_in_base;
        let counted = counted.rotated(heading_rad);
        let before = self.counted_in_odom.unwrap_or(counted);
        let follow = 1.0 - (-GAIN_FILTER_RAD_S * period_s).exp();
        let gained = Twist2::new(
            follow * (counted.vx_m_s - before.vx_m_s),
            follow * (counted.vy_m_s - before.vy_m_s),
            0.0,
        );
        self.counted_in_odom =
            Some(Twist2::new(before.vx_m_s + gained.vx_m_s, before.vy_m_s + gained.vy_m_s, 0.0));
        let gained = gained.rotated(-heading_rad);
        // As forces on a platform of 1 kg for 1 s, from its wheels of 1 kg·m/s each.
        let torques = self.kinematics.wheel_torques_nm(Wrench2::new(gained.vx_m_s, gained.vy_m_s, 0.0));
        let wheels = self.kinematics.wheels();
        PerWheel::from_fn(increments_rad.len().min(wheels.len()), |at| {
            let wheel = &wheels[at];
            let ([ux, uy], [ax, ay]) = (wheel.rolling_direction, wheel.force_direction);
            // Torque over force, and advance along the force direction over angle.
            let lever_m = wheel.radius_m * (ux * ax + uy * ay) / (ux.hypot(uy) * ax.hypot(ay));
            let [x_m, y_m] = wheel.position_m;
            let travel_m_s = (vx_m_s - w_rad_s * y_m).hypot(vy_m_s + w_rad_s * x_m);
            let slip_m = self.slip_s_m * travel_m_s * torques[at] / lever_m;
            increments_rad[at] - slip_m / lever_m
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::Pose2;

    fn plan(text: &str) -> crate::RobotPlan {
        let file = format!("{}\n[estimator]\n{text}\n", include_str!("../../../../robots/mecanum.toml"));
        let no_files = |_: &str| Err(String::new());
        crate::RobotPlan::from_toml(&file, &crate::Registry::with_built_in(), &no_files)
            .unwrap_or_else(|problems| panic!("{problems:?}"))
    }

    #[test]
    fn a_platform_that_gains_speed_moves_less_than_its_wheels_turn() {
        let off = plan("");
        assert!(Creep::new(&off.estimator, &off.kinematics).is_none());
        let on = plan("creep = 0.02");
        let mut creep = Creep::new(&on.estimator, &on.kinematics).expect("asked for");
        let state = |vx_m_s: f64| PlatformState {
            odom_from_body: Pose2::new(1.0, 2.0, 0.7),
            twist_in_body: Twist2::new(vx_m_s, 0.2, 0.0).rotated(-0.7),
            ..Default::default()
        };
        let counted = |vx_m_s: f64| {
            let speeds = on.kinematics.wheel_speeds_rad_s(Twist2::new(vx_m_s, 0.2, 0.0).rotated(-0.7));
            speeds.map(|speed| speed * 1e-3)
        };
        // The first sample has none before it: nothing was gained that is known of.
        assert_eq!(creep.corrected(&counted(0.5), &state(0.5), 1e-3)[..], counted(0.5)[..]);
        let mut missing = PerWheel::from([0.0; 4]);
        for _ in 0..1000 {
            let corrected = creep.corrected(&counted(0.501), &state(0.501), 1e-3);
            missing.iter_mut().enumerate().for_each(|(at, sum)| *sum += counted(0.501)[at] - corrected[at]);
        }
        let (step, _) = on.kinematics.body_step(&missing);
        // 2·c/g·|v|·Δv along Δv, as docs/accuracy.md derives it; after a second the filter lacks exp(-30) of it.
        let speed_m_s = Twist2::new(0.501, 0.2, 0.0);
        let wanted_m = 2.0 * 0.02 / GRAVITY_M_S2 * speed_m_s.vx_m_s.hypot(speed_m_s.vy_m_s) * 0.001;
        let [along, across] = [
            step.x_m * 0.7_f64.cos() - step.y_m * 0.7_f64.sin(),
            step.x_m * 0.7_f64.sin() + step.y_m * 0.7_f64.cos(),
        ];
        assert!((along / wanted_m - 1.0).abs() < 1e-9 && across.abs() < 1e-15, "{step:?} for {wanted_m}");
        // After a reset nothing is known.
        creep.reset();
        assert_eq!(creep.corrected(&counted(0.9), &state(0.9), 1e-3)[..], counted(0.9)[..]);
    }
}
