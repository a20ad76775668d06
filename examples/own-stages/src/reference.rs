//! To the left and back, several times, smoothly: y = left · sin⁴(π·t/period).

use omnibase::prelude::*;
use std::f64::consts::PI;

/// Its name, and the keys of `[reference] custom` that it reads.
pub fn kind() -> Kind {
    Kind {
        name: "sway",
        meaning: "To the left and back, several times",
        keys: vec![
            needed("left_m").number("How far to the left, m", -100.0..=100.0),
            needed("period_s").number("Time there and back, s", 0.1..=1000.0),
            needed("times").number("How often", 1.0..=10_000.0),
        ],
    }
}

/// Sways to the left of where it starts; the heading stays.
#[derive(Clone, Debug)]
pub struct Sway {
    left_m: f64,
    period_s: f64,
    times: f64,
    from: Pose2,
}

impl Sway {
    /// The motion of a table; refused where the platform's limits don't allow it.
    pub fn new(table: &ReferenceTable, ability: &Ability) -> Made<Self> {
        let limits = &ability.limits;
        let [left_m, period_s, times] = table.custom.numbers(["left_m", "period_s", "times"])?;
        // Peaks of the derivatives of sin⁴: 3√3/4 of the first, 4 of the second, 10.95 of the third.
        let w = PI / period_s;
        let peaks = [
            ("speed", 0.75 * 3_f64.sqrt() * left_m.abs() * w, limits.speed_m_s, "m/s"),
            ("acceleration", 4.0 * left_m.abs() * w.powi(2), limits.acceleration_m_s2, "m/s²"),
            ("jerk", 10.95 * left_m.abs() * w.powi(3), limits.jerk_m_s3, "m/s³"),
        ];
        // A derivative of order n falls with the n-th power of the time: so long it must be for all of them.
        let needed_s = (1..)
            .zip(peaks)
            .map(|(order, (_, peak, limit, _))| period_s * (peak / limit).powf(1.0 / f64::from(order)));
        let needed_s = needed_s.fold(0.0, f64::max);
        if let Some((what, peak, limit, unit)) = peaks.into_iter().find(|(_, peak, limit, _)| peak > limit) {
            let reason = format!(
                "{period_s} s need a {what} of {peak:.2} {unit}, allowed is {limit} {unit}; the limits allow \
                 {needed_s:.2} s and more"
            );
            return Err(Problem::refused("custom.period_s", reason).into());
        }
        Ok(Sway { left_m, period_s, times: times.round(), from: Pose2::default() })
    }
}

impl Reference for Sway {
    fn start(&mut self, from: &Setpoint) {
        self.from = from.odom_from_body;
    }

    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        let duration_s = self.times * self.period_s;
        if since_start_s >= duration_s {
            return Setpoint { status: ReferenceStatus::Finished, ..Setpoint::at_rest(self.from) };
        }
        let w = PI / self.period_s;
        let (sin, cos) = (w * since_start_s).sin_cos();
        let left_m = self.left_m * sin.powi(4);
        let speed_m_s = self.left_m * w * 4.0 * sin.powi(3) * cos;
        let acceleration_m_s2 = self.left_m * w * w * (12.0 * sin.powi(2) * cos.powi(2) - 4.0 * sin.powi(4));
        // "Left" is meant as seen at the start.
        let to_odom = |left: f64| Twist2::new(0.0, left, 0.0).rotated(self.from.heading_rad);
        let moved = to_odom(left_m);
        Setpoint {
            odom_from_body: Pose2 {
                x_m: self.from.x_m + moved.vx_m_s,
                y_m: self.from.y_m + moved.vy_m_s,
                heading_rad: self.from.heading_rad,
            },
            twist_in_odom: to_odom(speed_m_s),
            acceleration_in_odom: to_odom(acceleration_m_s2),
            status: ReferenceStatus::Moving,
        }
    }

    fn duration_s(&self) -> Option<f64> {
        Some(self.times * self.period_s)
    }
}
