//! What each wheel did, against what it may.

use super::chart::{LOOKS, Limit, Line, Marked, TimeChart};
use super::signals::{Signals, WheelSignals};
use super::text::{self, Unit, absent, escape};
use super::totals::Totals;
use std::fmt::Write;

/// What wheels may, where the recording tells it.
struct Limits {
    /// The platform's limit of a wheel's speed, rad/s.
    speed_rad_s: Option<f64>,
    /// The platform's limit of a wheel's torque, N·m.
    torque_nm: Option<f64>,
    /// What the drive gives for a short time, N·m at the wheel.
    peak_nm: Option<f64>,
    /// What the motor bears for ever, N·m at the wheel.
    rated_nm: Option<f64>,
}

impl Limits {
    fn of(signals: &Signals<'_>) -> Self {
        let positive = |key: &str| signals.number(key).filter(|value| *value > 0.0);
        Limits {
            speed_rad_s: positive("limit.wheel_speed_rad_s"),
            torque_nm: positive("limit.wheel_torque_nm"),
            peak_nm: positive("wheel_peak_torque_nm"),
            rated_nm: positive("wheel_rated_torque_nm"),
        }
    }
}

/// Charts of speeds and torques, and how much of each limit was used.
pub(super) fn html(signals: &Signals<'_>, totals: &Totals, marked: &[Marked]) -> String {
    let wheels = signals.wheels();
    if wheels.is_empty() {
        return absent("Wheels", "the run has no signals of wheels");
    }
    let limits = Limits::of(signals);
    let limit = |name: &str, class: &'static str, value: Option<f64>| {
        Some(Limit { name: name.to_owned(), class, value: value? })
    };
    let speed_limits = [limit("limit", "limit", limits.speed_rad_s)];
    let torque_limits = [
        limit("limit", "limit", limits.torque_nm),
        limit("peak", "limit peak", limits.peak_nm),
        limit("rated", "limit rated", limits.rated_nm),
    ];
    let chart = |title, unit, values: fn(&WheelSignals) -> &Option<Vec<f64>>, limits: Vec<Limit>| {
        let known = wheels.iter().zip(LOOKS.iter().cycle()).filter_map(|(wheel, look)| {
            let values = values(wheel).as_deref()?;
            Some(Line { name: wheel.name.clone(), class: (*look).to_owned(), values })
        });
        let lines: Vec<Line<'_>> = known.collect();
        if lines.is_empty() {
            return absent(title, "not recorded for any wheel");
        }
        TimeChart { title, unit: Unit::plain(unit), times: &signals.times_s, lines, limits, marked }.html()
    };
    let speeds =
        chart("Wheel speed", "rad/s", |wheel| &wheel.speed, speed_limits.into_iter().flatten().collect());
    let torques =
        chart("Wheel torque", "N·m", |wheel| &wheel.torque, torque_limits.into_iter().flatten().collect());
    format!("{}{speeds}{torques}", table(&wheels, totals, &limits))
}

/// The greatest speed and torque of each wheel, and the torque that heats its motor.
fn table(wheels: &[WheelSignals], totals: &Totals, limits: &Limits) -> String {
    let mut rows = String::new();
    for (number, wheel) in wheels.iter().enumerate() {
        let torques = totals.torques.get(number).copied().flatten();
        let greatest = |values: &Option<Vec<f64>>| {
            let sizes = values.as_ref()?.iter().map(|value| value.abs()).filter(|value| value.is_finite());
            sizes.reduce(f64::max)
        };
        let cell = |value: Option<f64>, limit: Option<f64>| {
            let shown = value.map_or("\u{2013}".to_owned(), text::significant);
            let share = value.zip(limit).map(|(value, limit)| {
                format!(" <small>({} %)</small>", text::fixed(100.0 * value / limit, 0))
            });
            format!("<td class=\"number\">{shown}{}</td>", share.unwrap_or_default())
        };
        let _ = writeln!(
            rows,
            "<tr><th>{}</th>{}{}{}</tr>",
            escape(&wheel.name),
            cell(greatest(&wheel.speed), limits.speed_rad_s),
            cell(greatest(&wheel.torque), limits.torque_nm),
            cell(torques.and_then(|torques| torques.root_mean_square()), limits.rated_nm)
        );
    }
    format!(
        "<table class=\"figures wheels\"><thead><tr><th>Wheel</th><th class=\"number\">greatest speed in rad/s (of \
         limit)</th><th class=\"number\">greatest torque in N·m (of limit)</th><th class=\"number\">RMS torque in N·m \
         (of rated)</th></tr></thead><tbody>\n{rows}</tbody></table>\n"
    )
}
