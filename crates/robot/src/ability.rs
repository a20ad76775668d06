//! What a platform can do: what motions are planned with.
//!
//! Beside the limits of the robot's file the wheels': their speeds always; their torques and their motors' heat where mass and
//! inertia are told; and what the floor gives them where its friction is told or remembered, less a fifth that is the control law's.

use std::fmt;

use omnibase_platform::Kinematics;
use omnibase_trajectory::fastest::{Heat, Limit};
use omnibase_trajectory::reach::Plane;
use omnibase_trajectory::PlatformBounds;

use crate::config::{ControllerTable, DrivePlan, GripPlan, Limits, RobotPlan, motion_limits};
use crate::grip::FirstEstimates;
use crate::signals::Dynamics;
use crate::traction::{Footing, Traction};

/// Part of a wheel's greatest torque that motions are planned with; the rest is the control law's, and what rubs.
const PLANNED_TORQUE: f64 = 0.9;
/// A motor bears its rated torque for ever; a motion may ask for this much of it, as the root of the mean square over a window, s.
const HEAT_WINDOW_S: f64 = 30.0;

/// What a platform can do.
#[derive(Clone, Debug, PartialEq)]
pub struct Ability {
    /// The limits of its file.
    pub limits: Limits,
    /// All that bounds a planned motion.
    pub bounds: PlatformBounds,
    /// The friction that its grip is planned with; `None`: nothing is known of the floor.
    pub friction: Option<f64>,
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
        Ability { limits: *limits, bounds: PlatformBounds::new(motion_limits(limits)), friction: None }
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
            ability.bounds.wheel_speeds.push(row.map(|part| part / (wheel.radius_m * limits.wheel_speed_rad_s)));
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
            ability.add_torques(&footing, kinematics, (drives, &dynamics));
        }
        ability
    }

    /// Every wheel pushes at most what the floor gives it, with its load as the acceleration shifts it.
    fn add_grip(&mut self, footing: &Footing, friction: f64, dynamics: &Dynamics) {
        for wheel in 0..footing.wheel_count() {
            let push = footing.push(wheel, friction, dynamics);
            for sign in [1.0, -1.0] {
                let [x, y, turn] = push.force.map(|part| sign * part);
                let normal = [x + push.lighter[0], y + push.lighter[1], turn];
                self.bounds.planes.push((Limit::Grip, Plane { normal, most: push.given_n }));
            }
        }
    }

    /// Every wheel's motor pushes the platform and speeds its own wheel up.
    fn add_torques(
        &mut self,
        footing: &Footing,
        kinematics: &Kinematics,
        (drives, dynamics): (&[DrivePlan], &Dynamics),
    ) {
        let mut heat = Heat { window_s: HEAT_WINDOW_S, torques: Vec::new() };
        for (wheel, drive) in (0..footing.wheel_count()).zip(drives) {
            let radius_m = kinematics.wheels()[wheel].radius_m;
            let torque = footing.push(wheel, 0.0, dynamics).force.map(|force| force * radius_m);
            let most = PLANNED_TORQUE * self.limits.wheel_torque_nm;
            for sign in [1.0, -1.0] {
                let normal = torque.map(|part| sign * part);
                self.bounds.planes.push((Limit::WheelTorque, Plane { normal, most }));
            }
            let rated_nm = drive.scale.rated_torque_nm * drive.scale.gear_ratio;
            heat.torques.push(torque.map(|part| part / rated_nm));
        }
        self.bounds.heat = Some(heat);
    }
}
