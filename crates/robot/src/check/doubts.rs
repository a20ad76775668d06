//! What a file may say, and probably doesn't mean: a slip of the decimal point is worth a word before a robot moves by it.

use std::ops::RangeInclusive;

use omnibase_platform::Twist2;

use crate::config::{RobotPlan, rim_per_count_m};
use crate::grip::probe::Extent;

/// What wheeled platforms that people stand beside have; far more or less is a mistake, or wants a second look.
const WHEEL_RADIUS_M: RangeInclusive<f64> = 0.01..=0.5;
const WHEEL_PLACE_M: RangeInclusive<f64> = 0.02..=5.0;
const SPEED_M_S: RangeInclusive<f64> = 0.01..=10.0;
const ACCELERATION_M_S2: RangeInclusive<f64> = 0.01..=10.0;
const TURN_SPEED_RAD_S: RangeInclusive<f64> = 0.01..=10.0;
const TURN_ACCELERATION_RAD_S2: RangeInclusive<f64> = 0.01..=50.0;
/// Cycles that drives take: whole multiples of this, to that, ns.
const CYCLE_STEP_NS: u64 = 125_000;
const LONGEST_CYCLE_NS: u64 = 10_000_000;
const DIRECTIONS: u32 = 16;

impl RobotPlan {
    /// What is allowed and probably not meant: the setting, its value, and why.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        let mut usual = |setting: &str, value: f64, range: RangeInclusive<f64>, unit: &str| {
            if !range.contains(&value) {
                let [least, most] = [range.start(), range.end()];
                doubts.push(format!(
                    "{setting} = {value} {unit}: usual are {least} to {most} {unit}; is it meant so?"
                ));
            }
        };
        let limits = &self.limits;
        usual("limits.speed_m_s", limits.speed_m_s, SPEED_M_S, "m/s");
        usual("limits.acceleration_m_s2", limits.acceleration_m_s2, ACCELERATION_M_S2, "m/s²");
        usual("limits.turn_speed_rad_s", limits.turn_speed_rad_s, TURN_SPEED_RAD_S, "rad/s");
        usual(
            "limits.turn_acceleration_rad_s2",
            limits.turn_acceleration_rad_s2,
            TURN_ACCELERATION_RAD_S2,
            "rad/s²",
        );
        let wheels = self.kinematics.wheels();
        if let Some(wheel) = wheels.first() {
            usual("platform.wheel_radius_m", wheel.radius_m, WHEEL_RADIUS_M, "m");
        }
        let far = wheels.iter().map(|wheel| wheel.position_m[0].hypot(wheel.position_m[1]));
        usual(
            "platform: the outermost wheel's distance from the centre",
            far.fold(0.0, f64::max),
            WHEEL_PLACE_M,
            "m",
        );
        let cycle_ns = self.bus.cycle_ns;
        if !cycle_ns.is_multiple_of(CYCLE_STEP_NS) || cycle_ns > LONGEST_CYCLE_NS {
            doubts.push(format!(
                "bus.cycle_us = {}: few drives take it; usual are whole multiples of {} us up to {} us",
                cycle_ns as f64 / 1e3,
                CYCLE_STEP_NS / 1000,
                LONGEST_CYCLE_NS / 1000
            ));
        }
        if let (Some(least_kg), Some(begins_kg)) = (self.mass_kg, self.controller.mass_kg)
            && begins_kg < least_kg
        {
            doubts.push(format!(
                "controller.mass_kg = {begins_kg} kg: less than the robot without a load, platform.mass_kg = {least_kg} kg; which was weighed?"
            ));
        }
        if Extent::is_drowned_by_counts(self) {
            doubts.push(format!(
                "counts_per_revolution: a count is {:.1} um of a rim, too coarse to hear by speed whether wheels slip in gentle motions; is it meant so?",
                1e6 * rim_per_count_m(self)
            ));
        }
        let most_m_s = self.reached_m_s();
        if most_m_s < limits.speed_m_s {
            doubts.push(format!(
                "limits.speed_m_s = {} m/s: wheels of limits.wheel_speed_rad_s = {} rad/s reach {most_m_s:.3} m/s in some direction",
                limits.speed_m_s, limits.wheel_speed_rad_s
            ));
        }
        doubts
    }

    /// The speed that the wheels' limit leaves in the direction in which it leaves least, m/s.
    fn reached_m_s(&self) -> f64 {
        let fastest = |direction: u32| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(direction) / f64::from(DIRECTIONS)).sin_cos();
            let speeds = self.kinematics.wheel_speeds_rad_s(Twist2::new(cos, sin, 0.0));
            speeds.iter().fold(0.0, |most: f64, speed| most.max(speed.abs()))
        };
        self.limits.wheel_speed_rad_s / (0..DIRECTIONS).map(fastest).fold(0.0, f64::max)
    }
}
