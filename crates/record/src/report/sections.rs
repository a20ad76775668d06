//! The sections of the page, each from the signals that it needs.

use super::bands::{self, Band};
use super::beside;
use super::chart::{Line, Marked, TimeChart};
use super::histogram;
use super::overhead::{self, Shape};
use super::room::Room;
use super::scale::Span;
use super::sensors;
use super::signals::{Poses, Signals};
use super::text::{self, Unit, absent, escape};
use super::totals::{TIMINGS, Totals};
use super::tracking::{Error, Tracking};
use super::wheels;

/// Events listed at most.
const MOST_EVENTS: usize = 500;
/// What rounding leaves of a speed that is 0, m/s.
const ROUNDING_M_S: f64 = 1e-9;

/// Everything that sections are made from.
pub(super) struct Page<'a> {
    pub(super) signals: &'a Signals<'a>,
    pub(super) tracking: &'a Tracking,
    pub(super) totals: &'a Totals,
    /// Saturation, stops and lost frames, to be marked behind curves.
    pub(super) marked: Vec<Marked>,
    pub(super) bands: Vec<Band>,
}

impl<'a> Page<'a> {
    pub(super) fn new(signals: &'a Signals<'a>, tracking: &'a Tracking, totals: &'a Totals) -> Self {
        let bands = bands(signals, tracking);
        // Which of the codes are marked behind the curves of the wheels.
        let interesting = [
            ("Commands", 1, "commands scaled down"),
            ("Frames", 1, "frames lost"),
            ("Frames", 2, "working counter short"),
        ];
        let marked = interesting.iter().filter_map(|(band, code, name)| {
            bands.iter().find(|known| known.name == *band)?.marked(&signals.times_s, *code, name)
        });
        Page { signals, tracking, totals, marked: marked.collect(), bands }
    }

    fn times(&self) -> &[f64] {
        &self.signals.times_s
    }

    fn chart(&self, title: &str, unit: Unit, lines: Vec<Line<'_>>) -> String {
        let limits = Vec::new();
        TimeChart { title, unit, times: self.times(), lines, limits, marked: &[] }.html()
    }

    /// The path from above.
    pub(super) fn path(&self) -> String {
        let shape = Shape::of(self.signals);
        let html = overhead::html(self.tracking, self.times(), &shape, &Room::of(self.signals));
        let html = html.unwrap_or_else(|| absent("Path", "the run has no poses"));
        section("path", "Path", &html)
    }

    /// Errors over time.
    pub(super) fn errors(&self) -> String {
        let named = [
            ("believed", "believed", &self.tracking.believed_error),
            ("true", "true", &self.tracking.true_error),
        ];
        let known: Vec<(&str, &str, &Error)> = named
            .into_iter()
            .filter_map(|(name, class, error)| Some((name, class, error.as_ref()?)))
            .collect();
        let Some((whose, _, last)) = known.last() else {
            let why = "the run lacks the planned pose, or the believed and the true one";
            return section("errors", "Tracking error", &absent("Errors", why));
        };
        let lines = |values: fn(&Error) -> &[f64]| -> Vec<Line<'_>> {
            let each = known.iter().map(|(name, class, error)| Line {
                name: (*name).to_owned(),
                class: (*class).to_owned(),
                values: values(error),
            });
            // What is true lies below: where both agree, both are seen, for the believed curve is thinner.
            each.rev().collect()
        };
        let greatest = |values: fn(&Error) -> &[f64]| {
            let all = known.iter().flat_map(|(_, _, error)| values(error).iter().map(|value| value.abs()));
            Span::of(all).map_or(0.0, |span| span.high)
        };
        fn distance(error: &Error) -> &[f64] {
            &error.distance
        }
        let length = Unit::length(greatest(distance));
        let mut html = self.chart("Position error: distance from the plan", length, lines(distance));
        let sides = vec![
            Line { name: "along (ahead is positive)".into(), class: "w3".into(), values: &last.along },
            Line { name: "across (left is positive)".into(), class: "w4".into(), values: &last.across },
        ];
        if last.along.iter().any(|value| value.is_finite()) {
            let title = format!("Position error along and across the planned motion ({whose})");
            html.push_str(&self.chart(&title, length, sides));
        }
        fn heading(error: &Error) -> &[f64] {
            &error.heading
        }
        let angle = Unit::angle(greatest(heading));
        html.push_str(&self.chart("Heading error: planned less actual", angle, lines(heading)));
        section("errors", "Tracking error", &html)
    }

    /// Speeds of the platform, in odom.
    pub(super) fn speeds(&self) -> String {
        let Speeds { planned, believed, truth } = Speeds::of(self.signals, self.tracking);
        let all = [("planned", &planned), ("true", &truth), ("believed", &believed)];
        if all.iter().all(|(_, twist)| twist.is_none()) {
            let why = "the run has neither planned nor believed speeds";
            return section("speeds", "Speeds of the platform", &absent("Speeds", why));
        }
        let mut html = String::new();
        let axes =
            [("Speed along x of odom", "m/s"), ("Speed along y of odom", "m/s"), ("Turning speed", "rad/s")];
        for (axis, (title, unit)) in axes.into_iter().enumerate() {
            let lines = all.iter().filter_map(|(name, twist)| {
                let values = &twist.as_ref()?[axis];
                Some(Line { name: (*name).to_owned(), class: (*name).to_owned(), values })
            });
            html.push_str(&self.chart(title, Unit::plain(unit), lines.collect()));
        }
        section("speeds", "Speeds of the platform", &html)
    }

    /// Speeds and torques of the wheels against their limits.
    pub(super) fn wheels(&self) -> String {
        section("wheels", "Wheels", &wheels::html(self.signals, self.totals, &self.marked))
    }

    /// Phases, safety, saturation, frames.
    pub(super) fn phases(&self) -> String {
        if self.bands.is_empty() {
            let why = "the run has neither phases nor actions of safety";
            return section("phases", "Phases and safety", &absent("Phases", why));
        }
        section("phases", "Phases and safety", &bands::html("What the robot did", self.times(), &self.bands))
    }

    /// How punctual the cycle was.
    pub(super) fn timing(&self) -> String {
        let period_s = self.signals.column(&["cycle_period"]).and_then(|periods| periods.last().copied());
        let mut html = String::new();
        for ((title, _), times) in TIMINGS.into_iter().zip(&self.totals.timings) {
            if let Some(times) = times {
                html.push_str(&histogram::html(title, times, period_s));
            }
        }
        let phase = self.signals.column(&["bus_dc_phase"]);
        // Without distributed clocks there is none.
        if let Some(phase) = phase.filter(|phase| phase.iter().any(|value| *value != 0.0)) {
            let greatest = Span::of(phase.iter().map(|value| value.abs())).map_or(0.0, |span| span.high);
            let line = Line { name: "phase error".into(), class: "w1".into(), values: &phase };
            let title = "Phase error of the frames by the distributed clock";
            html.push_str(&self.chart(title, Unit::time(greatest), vec![line]));
        }
        if html.is_empty() {
            html = absent("Cycle timing", "not recorded: on virtual time a cycle takes none");
        }
        section("timing", "Cycle timing", &html)
    }

    /// Slip, mass, inertia.
    pub(super) fn estimates(&self) -> String {
        let mut html = self.slip();
        let estimates = [
            ("Estimated mass", "kg", "estimate_mass", "simulation.mass_kg"),
            ("Estimated inertia", "kg·m²", "estimate_inertia", "simulation.inertia_kg_m2"),
        ];
        let mut without = Vec::new();
        for (title, unit, name, truth) in estimates {
            // Controllers that don't estimate leave these at 0.
            let column = self.signals.column(&[name]);
            let Some(values) = column.filter(|values| values.iter().any(|v| v.is_finite() && *v != 0.0))
            else {
                without.push(title);
                continue;
            };
            let simulated = self.signals.number(truth).filter(|_| self.tracking.truth.is_some());
            let constant = simulated.map(|truth| vec![truth; values.len()]);
            let mut lines = vec![Line { name: "estimate".into(), class: "believed".into(), values: &values }];
            if let Some(constant) = &constant {
                let line = Line { name: "simulated body".into(), class: "true".into(), values: constant };
                lines.insert(0, line);
            }
            html.push_str(&self.chart(title, Unit::plain(unit), lines));
        }
        if !without.is_empty() {
            html.push_str(&absent(
                &without.join(" and ").replace(" and Estimated", " and"),
                "this controller has none",
            ));
        }
        section("estimates", "Estimates", &html)
    }

    fn slip(&self) -> String {
        let title = "Slip residual: wheel speed that no motion of a rigid body explains";
        let Some(slip) = self.signals.column(&["state_slip_residual"]) else {
            return absent("Slip residual", "not recorded");
        };
        let greatest = Span::of(slip.iter().map(|value| value.abs())).map_or(0.0, |span| span.high);
        if greatest < ROUNDING_M_S {
            return absent(
                "Slip residual",
                "0 in every cycle, as with wheels that suffice just so for the motion",
            );
        }
        let unit = if greatest < 1.0 { Unit { name: "mm/s", factor: 1e3 } } else { Unit::plain("m/s") };
        let line = Line { name: "slip residual".into(), class: "w1".into(), values: &slip };
        self.chart(title, unit, vec![line])
    }

    /// Sensors beside the wheels, where the robot has any.
    pub(super) fn sensors(&self) -> String {
        let html = sensors::html(self.signals, self.tracking, self.totals);
        if html.is_empty() { html } else { section("sensors", "Sensors and the place in map", &html) }
    }

    /// Inputs, outputs and axes, where the robot has any.
    pub(super) fn beside(&self) -> String {
        let html = beside::html(self.signals);
        if html.is_empty() { html } else { section("beside", "Inputs, outputs and axes", &html) }
    }

    /// What happened, in words.
    pub(super) fn events(&self) -> String {
        let run = self.signals.run();
        if run.events.is_empty() {
            return section("events", "Events", &absent("Events", "none were recorded"));
        }
        let first = run.times_ns.first().copied().unwrap_or(0);
        let mut rows = String::new();
        for event in run.events.iter().take(MOST_EVENTS) {
            // Events before the first cycle have negative times.
            let time_s = (i128::from(event.time_ns) - i128::from(first)) as f64 * 1e-9;
            let time = text::fixed(time_s, 3);
            rows.push_str(&format!(
                "<tr><td class=\"number\">{time}</td><td>{}</td></tr>\n",
                escape(&event.text)
            ));
        }
        let mut html = format!(
            "<table class=\"events\"><thead><tr><th class=\"number\">time in s</th><th>event</th></tr></thead>\
             <tbody>{rows}</tbody></table>"
        );
        if let Some(more @ 1..) = run.events.len().checked_sub(MOST_EVENTS) {
            html.push_str(&format!(
                "<p class=\"absent\">and {} more in the recording.</p>",
                text::count(more as u64)
            ));
        }
        section("events", "Events", &html)
    }
}

/// The bands that the run's signals allow.
fn bands(signals: &Signals<'_>, tracking: &Tracking) -> Vec<Band> {
    let mut bands = Vec::new();
    if let Some(codes) = tracking.phase.clone() {
        bands.push(Band { name: "Phase".into(), choices: &bands::PHASES, codes });
    }
    if let Some(codes) = signals.column(&["allowed_action", "safety_action"]) {
        bands.push(Band { name: "Safety".into(), choices: &bands::ACTIONS, codes });
    }
    let factors = [signals.column(&["command_saturation"]), signals.column(&["allowed_saturation"])];
    if factors.iter().any(Option::is_some) {
        let is_scaled = |row: usize| factors.iter().flatten().any(|factor| factor[row] < 1.0);
        let codes = (0..signals.times_s.len()).map(|row| f64::from(u8::from(is_scaled(row)))).collect();
        bands.push(Band { name: "Commands".into(), choices: &bands::SATURATION, codes });
    }
    if let Some(codes) = signals.column(&["exchange_result"]) {
        bands.push(Band { name: "Frames".into(), choices: &bands::EXCHANGES, codes });
    }
    bands
}

/// Twists in odom, row by row: along x and y, m/s, and rad/s.
pub(super) struct Speeds {
    pub(super) planned: Option<[Vec<f64>; 3]>,
    pub(super) believed: Option<[Vec<f64>; 3]>,
    pub(super) truth: Option<[Vec<f64>; 3]>,
}

impl Speeds {
    pub(super) fn of(signals: &Signals<'_>, tracking: &Tracking) -> Self {
        let turned =
            |of: &str, poses: &Option<Poses>| in_odom(signals.twists(&[of])?, &poses.as_ref()?.heading);
        Speeds {
            planned: signals.twists(&["wished_twist", "setpoint_twist"]),
            believed: turned("state_twist_in_body", &tracking.believed),
            truth: turned("truth_twist", &tracking.truth),
        }
    }
}

/// A twist in the body's frame as one in odom.
fn in_odom([vx, vy, w]: [Vec<f64>; 3], heading: &[f64]) -> Option<[Vec<f64>; 3]> {
    let turned = |row: usize| {
        let (sin, cos) = heading[row].sin_cos();
        (cos * vx[row] - sin * vy[row], sin * vx[row] + cos * vy[row])
    };
    let (x, y) = (0..vx.len().min(heading.len())).map(turned).unzip();
    Some([x, y, w])
}

/// A section of the page.
pub(super) fn section(id: &str, title: &str, html: &str) -> String {
    format!("<section id=\"{id}\"><h2>{}</h2>\n{html}</section>\n", escape(title))
}
