//! What wheels turn without moving the platform: the creep of their treads while they accelerate it.

use omnibase_platform::{Kinematics, PerWheel, Twist2, Wrench2, length};

use crate::config::EstimatorTable;
use crate::grip::GRAVITY_M_S2;
use crate::grip::loads::Loads;
use crate::signals::PlatformState;

/// α of the filter through which the gained speed is seen, rad/s. It only shifts the slip by 30 ms; without it the noise
/// of a difference of differences would stand in the pose.
const GAIN_FILTER_RAD_S: f64 = 30.0;

/// A roller's resistance over its load where the file gives none: between 0.009 straight and 0.048 askew (Duda et al.,
/// *Sensors* 2025, 25(16), 5026, omni wheel on industrial concrete).
const ROLLER_RESISTANCE: f64 = 0.03;

/// Speed over the floor at which a roller's resistance is 0.7 of its whole, m/s: it turns over softly, for the sign of a speed
/// about zero is noise.
const ROLLERS_TURN_M_S: f64 = 1e-3;

/// Takes the creep of the treads out of what the encoders count, by the force that each wheel needs for what the platform does.
///
/// A contact with force `f` under load `N` slips at `c·|v|·f/N` against the direction of `f` (Carter's law for
/// small forces, K. L. Johnson, *Contact Mechanics*, 1985, chapter 8), `v` the velocity of the wheel's hub.
///
/// The wheels' forces accelerate the platform by what the wheels gained of speed (about its centre as a disc
/// that reaches out to the wheels), and they push against the rollers, which resist with a share of their loads
/// wherever they turn.
///
/// All of that is in proportion to the mass as the loads are, so that no mass is needed; its centre is taken to
/// stand over the platform's, and where the file tells its height (`grip.centre_of_mass_height_m`) an
/// acceleration shifts the loads.
#[derive(Clone, Debug)]
pub(super) struct Creep {
    kinematics: Kinematics,
    creep: f64,
    /// Each wheel's load over the mass, m/s².
    loads_m_s2: PerWheel,
    /// By how much that falls with the acceleration along x and y.
    lighter: Vec<[f64; 2]>,
    /// Moment of inertia over mass, m².
    gyration_m2: f64,
    roller_resistance: f64,
    /// Speed by what the encoders counted. Not what odometry made of it: that would see its own correction again.
    counted_in_odom: Option<Twist2>,
}

impl Creep {
    /// What a robot's file says; `None` where it doesn't ask for it.
    pub(super) fn new(table: &EstimatorTable, kinematics: &Kinematics, height_m: f64) -> Option<Creep> {
        let places = kinematics.wheels().iter().map(|wheel| wheel.position_m);
        let squares = places.map(|[x_m, y_m]| x_m * x_m + y_m * y_m);
        Some(Creep {
            creep: table.creep?,
            loads_m_s2: loads_m_s2(kinematics),
            lighter: lighter(kinematics, height_m),
            gyration_m2: 0.5 * squares.sum::<f64>() / kinematics.wheel_count() as f64,
            roller_resistance: table.roller_resistance.unwrap_or(ROLLER_RESISTANCE),
            kinematics: kinematics.clone(),
            counted_in_odom: None,
        })
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
            follow * (counted.w_rad_s - before.w_rad_s),
        );
        self.counted_in_odom = Some(Twist2::new(
            before.vx_m_s + gained.vx_m_s,
            before.vy_m_s + gained.vy_m_s,
            before.w_rad_s + gained.w_rad_s,
        ));
        let gained = gained.rotated(-heading_rad);
        // As forces on a platform of 1 kg for 1 s, from its wheels of 1 kg·m/s each.
        let mut wrench = Wrench2::new(gained.vx_m_s, gained.vy_m_s, self.gyration_m2 * gained.w_rad_s);
        for (at, (wheel, row)) in self.kinematics.wheels().iter().zip(self.kinematics.matrix()).enumerate() {
            let [x_m, y_m] = wheel.position_m;
            let ([ux, uy], [ax, ay]) = (wheel.rolling_direction, wheel.force_direction);
            let (u_size, a_size) = (length([ux, uy]), length([ax, ay]));
            let across = [-ay / a_size, ax / a_size];
            // The rollers turn by what the hub moves across and the wheel's own rolling doesn't.
            let rolled_m_s = (row[0] * vx_m_s + row[1] * vy_m_s + row[2] * w_rad_s) / u_size;
            let over_m_s = across[0] * (vx_m_s - w_rad_s * y_m - ux * rolled_m_s)
                + across[1] * (vy_m_s + w_rad_s * x_m - uy * rolled_m_s);
            let resisted_m_s = self.roller_resistance * self.loads_m_s2[at] * period_s * over_m_s
                / length([over_m_s, ROLLERS_TURN_M_S]);
            wrench.fx_n += resisted_m_s * across[0];
            wrench.fy_n += resisted_m_s * across[1];
            wrench.torque_nm += resisted_m_s * (x_m * across[1] - y_m * across[0]);
        }
        let torques = self.kinematics.wheel_torques_nm(wrench);
        let (ax_m_s2, ay_m_s2) = (gained.vx_m_s / period_s, gained.vy_m_s / period_s);
        let wheels = self.kinematics.wheels();
        PerWheel::from_fn(increments_rad.len().min(wheels.len()), |at| {
            let wheel = &wheels[at];
            let ([ux, uy], [ax, ay]) = (wheel.rolling_direction, wheel.force_direction);
            // Torque over force, and advance along the force direction over angle.
            let lever_m = wheel.radius_m * (ux * ax + uy * ay) / (length([ux, uy]) * length([ax, ay]));
            let [x_m, y_m] = wheel.position_m;
            let travel_m_s = length([vx_m_s - w_rad_s * y_m, vy_m_s + w_rad_s * x_m]);
            let [by_x, by_y] = self.lighter[at];
            let load_m_s2 = self.loads_m_s2[at];
            let load_m_s2 = (load_m_s2 - by_x * ax_m_s2 - by_y * ay_m_s2).max(LEAST_LOAD * load_m_s2);
            let slip_m = self.creep * travel_m_s * torques[at] / (lever_m * load_m_s2);
            increments_rad[at] - slip_m / lever_m
        })
    }
}

/// A wheel bears this part of its load at rest at least, however hard the platform leans away from it.
const LEAST_LOAD: f64 = 0.2;

/// By how much a wheel under a mass of 1 kg, whose centre stands at a height, becomes lighter with the acceleration along x and y, N
/// for 1 m/s².
fn lighter(kinematics: &Kinematics, height_m: f64) -> Vec<[f64; 2]> {
    let loads = Loads::new(kinematics);
    let count = kinematics.wheel_count();
    (0..count).map(|at| loads.shift(at).map(|shift| shift * height_m / count as f64)).collect()
}

/// The loads of wheels under a mass of 1 kg over the platform's centre, N.
fn loads_m_s2(kinematics: &Kinematics) -> PerWheel {
    let loads = Loads::new(kinematics);
    let count = kinematics.wheel_count();
    PerWheel::from_fn(count, |at| GRAVITY_M_S2 / count as f64 * loads.of(at, [0.0; 2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::Pose2;

    const MECANUM: &str = include_str!("../../../../robots/mecanum.toml");
    const BMM: &str = include_str!("../../../../robots/bmm.toml");

    fn plan(robot: &str, text: &str) -> crate::RobotPlan {
        let file = format!("{robot}\n[estimator]\n{text}\n");
        let no_files = |_: &str| Err(String::new());
        crate::RobotPlan::from_toml(&file, &crate::Registry::with_built_in(), &no_files)
            .unwrap_or_else(|problems| panic!("{problems:?}"))
    }

    /// The platform's step that is taken away while its wheels turn as for `told`, 1000 times 1 ms; before that `before`.
    fn taken(plan: &crate::RobotPlan, before: Twist2, told: Twist2) -> Twist2 {
        let mut creep = Creep::new(&plan.estimator, &plan.kinematics, 0.0).expect("asked for");
        let state = |twist_in_body: Twist2| PlatformState {
            odom_from_body: Pose2::new(1.0, 2.0, 0.7),
            twist_in_body,
            ..Default::default()
        };
        let counted = |twist: Twist2| plan.kinematics.wheel_speeds_rad_s(twist).map(|speed| speed * 1e-3);
        creep.corrected(&counted(before), &state(before), 1e-3);
        let mut missing = counted(before).map(|_| 0.0);
        for _ in 0..1000 {
            let corrected = creep.corrected(&counted(told), &state(told), 1e-3);
            missing.iter_mut().enumerate().for_each(|(at, sum)| *sum += counted(told)[at] - corrected[at]);
        }
        // After a reset nothing is known.
        creep.reset();
        let again = creep.corrected(&counted(told), &state(told), 1e-3);
        let steady = creep.corrected(&counted(told), &state(told), 1e-3);
        assert_eq!(again[..], steady[..], "nothing was gained");
        plan.kinematics.twist(&missing).twist_in_base
    }

    #[test]
    fn a_platform_that_gains_speed_moves_less_than_its_wheels_turn() {
        let off = plan(MECANUM, "");
        assert!(Creep::new(&off.estimator, &off.kinematics, 0.4).is_none());
        // On the BMM with p1 = 0.38 m and p = 0.40 m the front wheels, which alone push ahead, bear p1/(p + 2·p1) of the mass
        // each and not a third.
        for (robot, factor) in [(MECANUM, 1.0), (BMM, (0.40 + 2.0 * 0.38) / (3.0 * 0.38))] {
            let on = plan(robot, "creep = 0.02\nroller_resistance = 0.0");
            let missing = taken(&on, Twist2::new(0.5, 0.2, 0.0), Twist2::new(0.501, 0.2, 0.0));
            // 2·c/g·|v|·Δv along Δv, as docs/accuracy.md derives it; after a second the filter lacks exp(-30) of it.
            let wanted_m = factor * 2.0 * 0.02 / GRAVITY_M_S2 * 0.501_f64.hypot(0.2) * 0.001;
            assert!((missing.vx_m_s / wanted_m - 1.0).abs() < 1e-9, "{missing:?} for {wanted_m}");
            assert!(missing.vy_m_s.abs() < 1e-15 && missing.w_rad_s.abs() < 1e-15, "{missing:?}");
        }
    }

    #[test]
    fn a_platform_that_begins_to_turn_turns_less_than_its_wheels() {
        // On the spot, wheels at the distance r of the centre: forces of I·Δw/(n·l) each, I = m·r²/2, with the lever arm l
        // of the force, loads of m·g/n and a hub that travels at w·r: Δψ = c·w·r³·Δw/(2·g·l²).
        let on = plan(MECANUM, "creep = 0.02\nroller_resistance = 0.0");
        let missing = taken(&on, Twist2::new(0.0, 0.0, 0.5), Twist2::new(0.0, 0.0, 0.501));
        let (radius_m, lever_m) = (0.24_f64.hypot(0.21), (0.24 + 0.21) * 0.5_f64.sqrt());
        let wanted_rad = 0.02 * 0.501 * radius_m.powi(3) * 0.001 / (2.0 * GRAVITY_M_S2 * lever_m.powi(2));
        assert!((missing.w_rad_s / wanted_rad - 1.0).abs() < 1e-9, "{missing:?} for {wanted_rad}");
    }

    #[test]
    fn rollers_that_resist_take_a_share_of_the_way() {
        let on = plan(MECANUM, "creep = 0.02\nroller_resistance = 0.04");
        // Sideways each wheel pushes with 0.04 of its load against the others' rollers, and creeps by 0.02·0.04 along its
        // force; the four at 45° make the root of two of it. Forward no roller turns.
        let aside = Twist2::new(0.0, 0.4, 0.0);
        let missing = taken(&on, aside, aside);
        let wanted_m = 2.0_f64.sqrt() * 0.02 * 0.04 * 0.4;
        // Rollers that turn at 0.57 m/s are beyond the soft turn-over by 2e-6.
        assert!((missing.vy_m_s / wanted_m - 1.0).abs() < 1e-5, "{missing:?} for {wanted_m}");
        let ahead = Twist2::new(0.4, 0.0, 0.0);
        assert!(taken(&on, ahead, ahead).vx_m_s.abs() < 1e-12);
        let by_default = taken(&plan(MECANUM, "creep = 0.02"), aside, aside);
        assert!((by_default.vy_m_s / missing.vy_m_s - 0.75).abs() < 1e-9, "0.03 where the file says nothing");
    }

    #[test]
    fn loads_hold_the_mass_over_the_centre() {
        for robot in [BMM, MECANUM] {
            let kinematics = plan(robot, "").kinematics;
            let loads = loads_m_s2(&kinematics);
            let moment = |axis: usize| -> f64 {
                kinematics
                    .wheels()
                    .iter()
                    .zip(loads.iter())
                    .map(|(wheel, load)| load * wheel.position_m[axis])
                    .sum()
            };
            assert!((loads.iter().sum::<f64>() - GRAVITY_M_S2).abs() < 1e-12, "{loads:?}");
            assert!(moment(0).abs() < 1e-12 && moment(1).abs() < 1e-12, "{loads:?}");
        }
    }
}
