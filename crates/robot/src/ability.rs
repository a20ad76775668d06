//! What a platform can do: what motions are planned with.
//!
//! Beside the limits of the robot's file the wheels': their speeds always; their torques and their motors' heat where mass and
//! inertia are told; and what the floor gives them where its friction is told or remembered, less a fifth that is the control law's.

use std::fmt;

use omnibase_platform::Kinematics;
use omnibase_trajectory::PlatformBounds;
use omnibase_trajectory::fastest::{Heat, Limit};
use omnibase_trajectory::reach::Plane;

use crate::config::{ControllerTable, DrivePlan, GripPlan, Limits, RobotPlan, motion_limits};
use crate::grip::FirstEstimates;
use crate::signals::{Dynamics, Setpoint};
use crate::stages::PlannedFor;
use crate::traction::{Footing, HEAT_WINDOW_S, Traction};

/// A motion without times of its own keeps this far from the limits, in time, so that catching up has room: without it a setpoint
/// that lags while all brake overshoots.
pub(crate) const ROOM: f64 = 1.02;
/// Part of a wheel's greatest torque that motions are planned with; the rest is the control law's, and what rubs.
const PLANNED_TORQUE: f64 = 0.9;

/// What a platform can do.
#[derive(Clone, Debug, PartialEq)]
pub struct Ability {
    /// The limits of its file.
    pub limits: Limits,
    /// All that bounds a planned motion: a little less than the limits, so that it can be caught up with.
    pub bounds: PlatformBounds,
    /// The friction that its grip is planned with; `None`: nothing is known of the floor.
    pub friction: Option<f64>,
    /// Floor and mass where both are told: else nobody knows what a wheel pushes for a turn.
    pub(crate) sure: Option<PlannedFor>,
    /// The wheels on their floor, and what they move; `None` where nothing is known of them.
    stance: Option<(Footing, Dynamics)>,
}

/// The parts of a robot's file that say what its wheels can do.
#[derive(Clone, Copy)]
pub(crate) struct WheelFacts<'a> {
    pub(crate) kinematics: &'a Kinematics,
    pub(crate) drives: &'a [DrivePlan],
    pub(crate) controller: &'a ControllerTable,
    pub(crate) grip: &'a GripPlan,
}

impl fmt::Debug for WheelFacts<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WheelFacts").field("wheels", &self.kinematics.wheel_count()).finish_non_exhaustive()
    }
}

impl From<&Limits> for Ability {
    /// Of the platform's limits alone.
    fn from(limits: &Limits) -> Ability {
        let most = motion_limits(limits);
        let bounds = PlatformBounds::new(omnibase_trajectory::Limits {
            speed_m_s: most.speed_m_s / ROOM,
            acceleration_m_s2: most.acceleration_m_s2 / ROOM.powi(2),
            jerk_m_s3: most.jerk_m_s3 / ROOM.powi(3),
            rate_rad_s: most.rate_rad_s / ROOM,
            angular_acceleration_rad_s2: most.angular_acceleration_rad_s2 / ROOM.powi(2),
            angular_jerk_rad_s3: most.angular_jerk_rad_s3 / ROOM.powi(3),
        });
        Ability { limits: *limits, bounds, friction: None, sure: None, stance: None }
    }
}

impl Ability {
    /// That of a robot.
    pub fn of(plan: &RobotPlan) -> Ability {
        let RobotPlan { kinematics, drives, controller, grip, .. } = plan;
        Ability::new(&plan.limits, WheelFacts { kinematics, drives, controller, grip })
    }

    pub(crate) fn new(limits: &Limits, facts: WheelFacts<'_>) -> Ability {
        let mut ability = Ability::from(limits);
        let WheelFacts { kinematics, drives, controller, grip } = facts;
        for (wheel, row) in kinematics.wheels().iter().zip(kinematics.matrix()) {
            ability
                .bounds
                .wheel_speeds
                .push(row.map(|part| ROOM * part / (wheel.radius_m * limits.wheel_speed_rad_s)));
        }
        let first = FirstEstimates::of(controller);
        let dynamics =
            Dynamics { mass_kg: first.mass.0, inertia_kg_m2: first.inertia.0, ..Dynamics::default() };
        let footing = Footing::new(kinematics, grip.height_m);
        ability.friction = Traction::planned_friction(grip);
        if let Some(friction) = ability.friction {
            ability.add_grip(&footing, friction, &dynamics);
        }
        if controller.mass_kg.is_some() && controller.inertia_kg_m2.is_some() {
            let mass_kg = dynamics.mass_kg;
            ability.sure = ability.friction.map(|friction| PlannedFor { friction, mass_kg, heat: 0.0 });
            ability.add_torques(&footing, kinematics, drives, &dynamics);
        }
        ability.stance = Some((footing, dynamics));
        ability
    }

    /// The friction of a floor on which every wheel grips in a moment of a motion; 0 where nothing is known of the wheels.
    pub fn friction_needed(&self, setpoint: &Setpoint) -> f64 {
        self.stance
            .as_ref()
            .map_or(0.0, |(footing, dynamics)| footing.needs(setpoint, dynamics, [0.0; 2]).friction)
    }

    /// Every wheel pushes at most what the floor gives it, with its load as the acceleration shifts it.
    fn add_grip(&mut self, footing: &Footing, friction: f64, dynamics: &Dynamics) {
        self.bounds.resistance = footing.roller_wrenches(dynamics);
        for wheel in 0..footing.wheel_count() {
            let push = footing.push(wheel, friction, dynamics);
            for sign in [1.0, -1.0] {
                let [x, y, turn] = push.force.map(|part| sign * part);
                let normal = [x + push.lighter[0], y + push.lighter[1], turn];
                self.bounds.planes.push((
                    Limit::Grip,
                    Plane { normal, most: push.given_n, resisted: push.resisted.map(|part| sign * part) },
                ));
            }
        }
    }

    /// Every wheel's motor pushes the platform and speeds its own wheel up.
    fn add_torques(
        &mut self,
        footing: &Footing,
        kinematics: &Kinematics,
        drives: &[DrivePlan],
        dynamics: &Dynamics,
    ) {
        let mut heat = Heat { window_s: HEAT_WINDOW_S, torques: Vec::new() };
        for (wheel, drive) in (0..footing.wheel_count()).zip(drives) {
            let radius_m = kinematics.wheels()[wheel].radius_m;
            let torque = footing.push(wheel, 0.0, dynamics).force.map(|force| force * radius_m);
            let most = PLANNED_TORQUE * self.limits.wheel_torque_nm;
            for sign in [1.0, -1.0] {
                let normal = torque.map(|part| sign * part);
                self.bounds.planes.push((Limit::WheelTorque, Plane { normal, most, ..Plane::default() }));
            }
            let rated_nm = drive.scale.rated_torque_nm * drive.scale.gear_ratio;
            heat.torques.push(torque.map(|part| part / rated_nm));
        }
        self.bounds.heat = Some(heat);
    }
}
