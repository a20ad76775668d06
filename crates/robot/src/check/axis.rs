//! The axis of a SubDevice: between its unit and its drive's, limits, homing.

use std::f64::consts::TAU;

use super::Check;
use crate::config::*;

/// A count below it wraps nowhere on its way: half of what 32 bits hold to either side.
const MOST_COUNTS: f64 = (1_u64 << 30) as f64;
/// How long homing may take, s, where the file says nothing.
const HOMING_TIMEOUT_S: f64 = 60.0;
/// Cycles over which a set point is averaged at most, to limit its jerk.
const MOST_JERK_CYCLES: f64 = 1000.0;

/// An axis as its table says; `table` is its name, as `device[0].axis`.
pub(super) fn resolve(check: &mut Check, table: &str, own: &AxisTable, period_s: f64) -> Option<AxisPlan> {
    let problems = check.problems.len();
    let axis = Axis { check, table, own };
    let plan = axis.resolve(period_s)?;
    (check.problems.len() == problems).then_some(plan)
}

struct Axis<'a> {
    check: &'a mut Check,
    table: &'a str,
    own: &'a AxisTable,
}

impl Axis<'_> {
    fn need<T>(&mut self, value: Option<T>, key: &str, why: &str) -> Option<T> {
        self.check.need(value, &format!("{}.{key}", self.table), why)
    }

    fn refuse(&mut self, key: &str, reason: &str, value: impl ToString, limit: impl Into<String>) {
        let setting = format!("{}.{key}", self.table);
        let problem = self.check.report(ProblemKind::OutOfRange, &setting, reason);
        problem.value = Some(value.to_string());
        problem.limit = Some(limit.into());
    }

    fn resolve(mut self, period_s: f64) -> Option<AxisPlan> {
        let unit = self.need(self.own.unit, "unit", "positions, speeds and limits are in it");
        let scale = self.scale(unit);
        let limits = self.limits();
        let homing = self.homing(limits.as_ref());
        let encoder = self.own.encoder.unwrap_or_default();
        if encoder == EncoderName::Incremental && self.own.homing.is_none() {
            let why = "an incremental encoder knows no position until the axis was homed";
            self.need(None::<()>, "homing", why);
        }
        let modes = self.own.modes.clone().unwrap_or_else(|| vec![AxisMode::Csp]);
        let (scale, limits) = (scale?, limits?);
        self.fits(&scale, &limits, period_s);
        let [least, greatest] = limits.position;
        Some(AxisPlan {
            unit: unit?,
            scale,
            encoder,
            modes,
            limits,
            homing,
            simulated_position: self.own.simulated_position.unwrap_or(f64::midpoint(least, greatest)),
            period_s,
        })
    }

    fn scale(&mut self, unit: Option<AxisUnit>) -> Option<AxisScale> {
        let counts = self.own.counts_per_revolution;
        let counts = self.need(counts, "counts_per_revolution", "positions and speeds are scaled by it");
        let rated = self.need(self.own.rated_torque_nm, "rated_torque_nm", "torques are scaled by it");
        let per_revolution = match (unit?, self.own.feed_m) {
            (AxisUnit::Rad, None) => Some(TAU),
            (AxisUnit::Rad, Some(feed_m)) => {
                self.refuse("feed_m", "an axis in rad has no feed", feed_m, "`unit = \"m\"`, or no feed");
                None
            }
            (AxisUnit::M, feed_m) => self.need(feed_m, "feed_m", "an axis in m moves so far a revolution"),
        };
        let (counts_per_revolution, per_revolution) = (counts?, per_revolution?);
        let sign = match self.own.direction.unwrap_or(TurnDirection::Forward) {
            TurnDirection::Forward => 1.0,
            TurnDirection::Backward => -1.0,
        };
        let revolutions_per_unit = sign * self.own.gear_ratio.unwrap_or(1.0) / per_revolution;
        let counts_per_unit = revolutions_per_unit * f64::from(counts_per_revolution);
        Some(AxisScale {
            counts_per_revolution,
            counts_per_unit,
            speed_units_per_unit_s: match self.own.speed_unit.unwrap_or(SpeedUnit::CountsS) {
                SpeedUnit::CountsS => counts_per_unit,
                SpeedUnit::Rpm => revolutions_per_unit * 60.0,
                SpeedUnit::MilliRpm => revolutions_per_unit * 60_000.0,
            },
            rated_torque_nm: rated?,
            zero_position: self.own.zero_position.unwrap_or(0.0),
        })
    }

    fn limits(&mut self) -> Option<AxisLimits> {
        const WHY: &str = "without its limits no axis is enabled";
        let own = self.own;
        let position = self.need(own.position_limits, "position_limits", WHY);
        let speed = self.need(own.speed_limit, "speed_limit", WHY);
        let acceleration = self.need(own.acceleration_limit, "acceleration_limit", WHY);
        let following_error = self.need(own.following_error, "following_error", WHY);
        let (position, acceleration) = (position?, acceleration?);
        if !(position[0].is_finite() && position[1].is_finite() && position[0] < position[1]) {
            let found = format!("[{}, {}]", position[0], position[1]);
            self.refuse(
                "position_limits",
                "nothing lies between them",
                found,
                "the least, then the greatest",
            );
        }
        let stop_deceleration = own.stop_deceleration.unwrap_or(acceleration);
        if stop_deceleration < acceleration {
            let reason = "a stop must not take it further than the motion would have gone";
            let limit = format!("at least acceleration_limit = {acceleration}");
            self.refuse("stop_deceleration", reason, stop_deceleration, limit);
        }
        let rated = own.rated_torque_nm?;
        let torque_nm = own.torque_limit_nm.unwrap_or(rated);
        // Torque objects hold 16 bits of 0.1 %.
        if torque_nm > 32.767 * rated {
            let limit = format!("at most {}", 32.767 * rated);
            self.refuse("torque_limit_nm", "its object holds 16 bits of 0.1 %", torque_nm, limit);
        }
        Some(AxisLimits {
            position,
            speed: speed?,
            acceleration,
            jerk: own.jerk_limit,
            stop_deceleration,
            following_error: following_error?,
            torque_nm,
        })
    }

    fn homing(&mut self, limits: Option<&AxisLimits>) -> Option<HomingPlan> {
        let table = self.own.homing.as_ref()?;
        const WHY: &str = "the drive finds its home by it";
        let method = self.need(table.method, "homing.method", WHY);
        let switch_speed = self.need(table.switch_speed, "homing.switch_speed", WHY);
        let zero_speed = self.need(table.zero_speed, "homing.zero_speed", WHY);
        let acceleration = self.need(table.acceleration, "homing.acceleration", WHY);
        if method == Some(0) {
            self.refuse("homing.method", "0 is no method", 0, "a method of the profile or the manufacturer");
        }
        let most = limits.map_or(f64::INFINITY, |limits| limits.speed);
        for (key, speed) in [("homing.switch_speed", switch_speed), ("homing.zero_speed", zero_speed)] {
            if let Some(speed) = speed.filter(|speed| *speed > most) {
                self.refuse(
                    key,
                    "faster than the axis may be",
                    speed,
                    format!("at most speed_limit = {most}"),
                );
            }
        }
        Some(HomingPlan {
            method: method?,
            switch_speed: switch_speed?,
            zero_speed: zero_speed?,
            acceleration: acceleration?,
            timeout_ns: (table.timeout_s.unwrap_or(HOMING_TIMEOUT_S) * 1e9) as u64,
        })
    }

    /// The drive's objects can hold what the limits come to.
    fn fits(&mut self, scale: &AxisScale, limits: &AxisLimits, period_s: f64) {
        for position in limits.position {
            if ((position - scale.zero_position) * scale.counts_per_unit).abs() >= MOST_COUNTS {
                let limit = format!(
                    "less than {} from zero_position = {}",
                    MOST_COUNTS / scale.counts_per_unit.abs(),
                    scale.zero_position
                );
                self.refuse("position_limits", "the drive's count would wrap", position, limit);
            }
        }
        let units = limits.speed * scale.speed_units_per_unit_s.abs();
        if units >= f64::from(i32::MAX) || units < 1.0 {
            let limit = format!(
                "{} to {}",
                1.0 / scale.speed_units_per_unit_s.abs(),
                f64::from(i32::MAX) / scale.speed_units_per_unit_s.abs()
            );
            self.refuse("speed_limit", "the drive's speed objects can't hold it", limits.speed, limit);
        }
        if let Some(jerk) = limits.jerk
            && limits.stop_deceleration / jerk > MOST_JERK_CYCLES * period_s
        {
            let limit = format!("at least {}", limits.stop_deceleration / (MOST_JERK_CYCLES * period_s));
            let reason = "the deceleration would take more than 1000 cycles to come";
            self.refuse("jerk_limit", reason, jerk, limit);
        }
    }
}
