//! Whether the platform follows the ramp of its stop, whatever law leads it: one that heeds nothing isn't stopped by a ramp.
//!
//! By how far the wheels carry the platform away from the set point, beyond what the set point itself moves, is
//! added up from the stop's begin; what brings it back is taken off. So a law may come back from an error of
//! before at any speed, and one that brakes harder than the ramp goes nowhere.
//!
//! What the motors resist counts little: then it is a push, a slope, or a correction that ran too far.

use omnibase_platform::{Kinematics, PerWheel, Twist2, Wrench2, axes, pose_error};

use crate::config::{Limits, RobotPlan};
use crate::grip::friction::WheelFriction;
use crate::signals::{Exchange, Phase, Quantity};
use crate::stages::SafetyView;

/// So far away from the ramp the wheels may carry the platform, beside delay and slip, m: ours keep to it within a third of that on
/// floors that grip, and soft treads, wrong masses and wheels that slip a little take the rest.
const ASTRAY_M: f64 = 0.05;
/// From the set point to what the wheels show of it, in periods: two of delay, one for the drives.
const DELAY_PERIODS: f64 = 3.0;
/// What motors resist counts by this part.
const RESISTED: f64 = 0.1;
/// Motors resist with at least this part of the braking that the ramp asks for, and with this part of the limit's acceleration
/// beside it; or with this part of the most that they may give.
const BRAKING_SHARE: f64 = 0.75;
const BESIDE_SHARE: f64 = 0.1;
const FULL_SHARE: f64 = 0.8;
/// Nearer to its set point than this a platform has no side on which it is, m.
const NO_SIDE_M: f64 = 1e-6;

/// How far the platform went astray in a stop. Ways have three parts, m: along x and y, and the turn at the wheels' lever.
#[derive(Clone, Debug)]
pub(super) struct AstrayWatch {
    kinematics: Kinematics,
    lever_m: f64,
    limits: Limits,
    /// The set point's way since the last complete exchange, in odom and in its own axes.
    shall_in_odom: [f64; 3],
    shall_in_body: [f64; 3],
    astray_m: f64,
    most_m: f64,
}

impl AstrayWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        AstrayWatch {
            lever_m: WheelFriction::new(&plan.kinematics).lever_m(),
            kinematics: plan.kinematics.clone(),
            limits: plan.limits,
            shall_in_odom: [0.0; 3],
            shall_in_body: [0.0; 3],
            astray_m: 0.0,
            most_m: ASTRAY_M,
        }
    }

    /// No stop is under way.
    pub(super) fn reset(&mut self) {
        (self.shall_in_odom, self.shall_in_body, self.astray_m) = ([0.0; 3], [0.0; 3], 0.0);
    }

    /// Takes in a cycle of a stop.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        // Nothing that is measured leads the wheels in a ramp without inputs, and no law does.
        if view.phase != Phase::Stopping || view.is_ramp_blind {
            return self.reset();
        }
        let period_s = view.time.period_s();
        let heading_rad = view.setpoint.odom_from_body.heading_rad;
        let shall = view.setpoint.twist_in_odom.scaled(period_s);
        self.shall_in_odom = sum(self.shall_in_odom, self.way(shall), 1.0);
        self.shall_in_body = sum(self.shall_in_body, self.way(shall.rotated(-heading_rad)), 1.0);
        if view.exchange != Exchange::Complete {
            return;
        }
        let drives = view.measurements.present();
        let turned_rad = PerWheel::from_fn(self.kinematics.wheel_count(), |wheel| {
            drives.get(wheel).map_or(0.0, |drive| drive.increment_rad)
        });
        let went = self.kinematics.twist(&turned_rad).twist_in_base;
        let went_in_odom = self.way(went.rotated(view.state.odom_from_body.heading_rad));
        let departs = sum(went_in_odom, self.shall_in_odom, -1.0);
        let departs_in_body = sum(self.way(went), self.shall_in_body, -1.0);
        (self.shall_in_odom, self.shall_in_body) = ([0.0; 3], [0.0; 3]);
        let [x, y, turn_rad] = pose_error(&view.state.odom_from_body, &view.setpoint.odom_from_body);
        let off = [x, y, self.lever_m * turn_rad];
        let away = if length(off) > NO_SIDE_M { off } else { departs };
        let outward = away.map(|part| part / length(away).max(f64::MIN_POSITIVE));
        let mut gains_m = dot(outward, departs);
        if gains_m > 0.0 {
            // A platform that stands while its set point leaves goes nowhere, and wheels that turn as the ramp says obey, wherever they lead.
            gains_m = gains_m.min(dot(outward, went_in_odom).max(0.0)).min(length(departs_in_body));
            if self.is_resisted(view, outward) {
                gains_m *= RESISTED;
            }
        }
        self.astray_m = (self.astray_m + gains_m).max(0.0);
        // What slips shows a way that the platform doesn't go; but a law that makes wheels spin isn't let go on for that.
        let slipped_m = view.grip.slipped_m.iter().fold(0.0, |most: f64, way_m| most.max(*way_m));
        let late_m = DELAY_PERIODS * period_s * self.limits.speed_m_s;
        self.most_m = ASTRAY_M + late_m + slipped_m.min(ASTRAY_M);
    }

    /// Whether the motors push against a direction, in odom, harder than following the ramp takes.
    fn is_resisted(&self, view: &SafetyView<'_>, outward: [f64; 3]) -> bool {
        let heading_rad = view.state.odom_from_body.heading_rad;
        let drives = view.measurements.present();
        let wheels = self.kinematics.wheel_count();
        let torques_nm =
            PerWheel::from_fn(wheels, |wheel| drives.get(wheel).map_or(0.0, |drive| drive.torque_nm));
        let Wrench2 { fx_n, fy_n, torque_nm } = self.kinematics.wrench(&torques_nm).rotated(heading_rad);
        let inward_n = -dot(outward, [fx_n, fy_n, torque_nm / self.lever_m]);
        let dynamics = &view.grip.dynamics;
        let [ax, ay, gain] = axes(&view.setpoint.acceleration_in_odom);
        let mass_kg = dynamics.mass_kg;
        let ramp_n = [mass_kg * ax, mass_kg * ay, dynamics.inertia_kg_m2 * gain / self.lever_m];
        let braking_n = -dot(outward, ramp_n);
        // All that the floor or the wheels' limits let a law of torques do.
        let is_all = view.commands.quantity == Quantity::Torque && view.commands.saturation < 1.0;
        if is_all && inward_n > 0.0 {
            return true;
        }
        let needed_n =
            BRAKING_SHARE * braking_n.max(0.0) + BESIDE_SHARE * mass_kg * self.limits.acceleration_m_s2;
        let unit = Wrench2::new(outward[0], outward[1], self.lever_m * outward[2]).rotated(-heading_rad);
        let per_newton = self.kinematics.wheel_torques_nm(unit);
        let greatest = per_newton.iter().fold(0.0, |most: f64, torque_nm| most.max(torque_nm.abs()));
        inward_n > needed_n.min(FULL_SHARE * view.wheel_limits.torque_nm / greatest)
    }

    fn way(&self, step: Twist2) -> [f64; 3] {
        let [x, y, turn] = axes(&step);
        [x, y, self.lever_m * turn]
    }

    /// Whether the ramp isn't followed.
    pub(super) fn is_astray(&self) -> bool {
        self.astray_m > self.most_m
    }
}

fn sum(one: [f64; 3], other: [f64; 3], factor: f64) -> [f64; 3] {
    std::array::from_fn(|axis| one[axis] + factor * other[axis])
}

fn dot(one: [f64; 3], other: [f64; 3]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

fn length(way: [f64; 3]) -> f64 {
    dot(way, way).sqrt()
}
