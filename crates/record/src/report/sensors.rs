//! Sensors beside the wheels: who was believed when, what their gates left out, and how well the place was known.

use super::bands::{self, Band};
use super::chart::{LOOKS, Limit, Line, TimeChart};
use super::signals::{Poses, Signals};
use super::text::{self, Unit, absent, escape};
use super::totals::Totals;
use super::tracking::Tracking;

/// Verdicts by the codes that the recording holds.
const VERDICTS: [bands::Choice; 5] = [
    (0, "awaited", "band-off"),
    (1, "good", "band-go"),
    (2, "silent", "band-wait"),
    (3, "frozen", "band-stop"),
    (4, "contradicts", "band-fault"),
];
/// The code of a sensor that is believed.
const GOOD: f64 = 1.0;
/// What of a distribution in two directions lies within its greater standard deviation's threefold is more than 98.9 %.
const SIGMAS: f64 = 3.0;

/// Innovations are drawn up to so many times the gate.
const GATES_SEEN: f64 = 2.0;

/// A sensor as it was recorded.
struct Sensor {
    name: String,
    verdict: Vec<f64>,
    /// chi² of the last reading over its degrees of freedom.
    nis: Vec<f64>,
    /// Beyond which a reading is left out.
    gate: Option<f64>,
}

/// What was heard and left out of a sensor, in rows whose readings differ from those of the row before.
#[derive(Clone, Debug, Default)]
pub(super) struct Counted {
    rows: u64,
    believed: u64,
    heard: u64,
    left_out: u64,
    /// Of those that weren't left out.
    sum_nis: f64,
    before: Option<f64>,
}

/// Takes the next rows of each sensor: those of this piece from `first` on.
pub(super) fn count(totals: &mut Vec<Counted>, signals: &Signals<'_>, first: usize) {
    let sensors = sensors(signals);
    totals.resize(sensors.len(), Counted::default());
    for (counted, sensor) in totals.iter_mut().zip(&sensors) {
        for (verdict, nis) in sensor.verdict.iter().zip(&sensor.nis).skip(first) {
            counted.rows += 1;
            counted.believed += u64::from(*verdict == GOOD);
            if nis.is_finite() && *nis > 0.0 && counted.before != Some(*nis) {
                counted.heard += 1;
                let is_out = sensor.gate.is_some_and(|gate| *nis > gate);
                counted.left_out += u64::from(is_out);
                counted.sum_nis += if is_out { 0.0 } else { *nis };
            }
            counted.before = Some(*nis);
        }
    }
}

/// Gates by the sensors' names: `gyro 10.83; mocap 5.42`.
fn gate(signals: &Signals<'_>, name: &str) -> Option<f64> {
    let all = signals.text("sensor_gates")?.split(';');
    let mut found = all.filter_map(|one| one.trim().split_once(' ')).filter(|(of, _)| *of == name);
    found.next()?.1.trim().parse().ok().filter(|gate: &f64| gate.is_finite() && *gate > 0.0)
}

fn sensors(signals: &Signals<'_>) -> Vec<Sensor> {
    let found = signals.named("sensor_", "_verdict").into_iter();
    let sensor = |(name, verdict): (String, Vec<f64>)| {
        let nis = signals.column(&[&format!("sensor_{name}_nis")])?;
        Some(Sensor { gate: gate(signals, &name), name, verdict, nis })
    };
    found.filter_map(sensor).collect()
}

/// The section's content; nothing for a robot without sensors.
pub(super) fn html(signals: &Signals<'_>, tracking: &Tracking, totals: &Totals) -> String {
    let sensors = sensors(signals);
    if sensors.is_empty() {
        return String::new();
    }
    let times = &signals.times_s;
    let band = |sensor: &Sensor| Band {
        name: sensor.name.clone().into(),
        choices: &VERDICTS,
        codes: sensor.verdict.clone(),
    };
    let all: Vec<Band> = sensors.iter().map(band).collect();
    let mut html = bands::html("Which sensor was believed", times, &all);
    html.push_str(&table(&sensors, &totals.sensors));
    html.push_str(&innovations(times, &sensors));
    html.push_str(&place(signals, tracking, totals));
    html
}

fn table(sensors: &[Sensor], totals: &[Counted]) -> String {
    let row = |(sensor, counted): (&Sensor, &Counted)| {
        let percent = |share: f64, decimals| format!("{} %", text::fixed(100.0 * share, decimals));
        let left_out = match sensor.gate {
            None => "gate unknown".to_owned(),
            Some(_) => percent(counted.left_out as f64 / counted.heard.max(1) as f64, 2),
        };
        format!(
            "<tr><th>{}</th><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{left_out}</td>\
             <td class=\"number\">{}</td></tr>\n",
            escape(&sensor.name),
            percent(counted.believed as f64 / counted.rows.max(1) as f64, 1),
            text::count(counted.heard),
            text::significant(counted.sum_nis / (counted.heard - counted.left_out).max(1) as f64)
        )
    };
    format!(
        "<div class=\"tables\"><table class=\"figures\"><thead><tr><th>Sensor</th><th class=\"number\">believed</th>\
         <th class=\"number\">cycles with a reading</th><th class=\"number\">left out by the gate</th>\
         <th class=\"number\">mean chi² of the others (1 expected)</th></tr></thead><tbody>\n{}</tbody></table></div>\n",
        sensors.iter().zip(totals).map(row).collect::<String>()
    )
}

/// By how many of its standard deviations each reading was off.
fn innovations(times: &[f64], sensors: &[Sensor]) -> String {
    let chart = |sensor: &Sensor| {
        // One outlier of a metre would flatten all else.
        let most = sensor.gate.map_or(f64::INFINITY, |gate| GATES_SEEN * gate.sqrt());
        let sigmas: Vec<f64> = sensor.nis.iter().map(|nis| nis.sqrt().min(most)).collect();
        let look = LOOKS[0].to_owned();
        let line = Line {
            name: "innovation over its sigma, up to twice the gate".into(),
            class: look,
            values: &sigmas,
        };
        let limits =
            sensor.gate.map(|gate| Limit { name: "gate".into(), class: "limit", value: gate.sqrt() });
        TimeChart {
            title: &format!("{}: innovation over its standard deviation", sensor.name),
            unit: Unit::plain("σ"),
            times,
            lines: vec![line],
            limits: limits.into_iter().collect(),
            marked: &[],
        }
        .html()
    };
    sensors.iter().map(chart).collect()
}

/// How far poses are from others, row by row.
pub(super) struct Off {
    pub(super) distance_m: Vec<f64>,
    pub(super) turned_rad: Vec<f64>,
}

/// The place in map, row by row.
pub(super) struct MapSeries {
    /// Three standard deviations, m, in the worse direction.
    pub(super) known_m: Vec<f64>,
    /// Three standard deviations of the heading, rad.
    pub(super) known_rad: Vec<f64>,
    /// From the truth.
    pub(super) truth: Option<Off>,
    /// From odom.
    pub(super) odom: Option<Off>,
}

impl MapSeries {
    /// `None` where it wasn't recorded.
    pub(super) fn of(signals: &Signals<'_>, tracking: &Tracking) -> Option<Self> {
        let variance = |axes: &str| signals.column(&[&format!("map_covariance_{axes}")]);
        let map = signals.poses(&["map_pose"])?;
        let (xx, yy, hh) = (variance("xx")?, variance("yy")?, variance("hh")?);
        let sigmas = |variance: f64| SIGMAS * variance.max(0.0).sqrt();
        let off = |other: &Poses| {
            let distance = |row: usize| (map.x[row] - other.x[row]).hypot(map.y[row] - other.y[row]);
            let turned = |row: usize| wrapped(map.heading[row] - other.heading[row]).abs();
            let rows = 0..map.x.len().min(other.x.len());
            Off { distance_m: rows.clone().map(distance).collect(), turned_rad: rows.map(turned).collect() }
        };
        Some(MapSeries {
            known_m: xx.iter().zip(&yy).map(|(xx, yy)| sigmas(xx.max(*yy))).collect(),
            known_rad: hh.iter().map(|hh| sigmas(*hh)).collect(),
            truth: tracking.truth.as_ref().map(off),
            odom: tracking.believed.as_ref().map(off),
        })
    }
}

/// How well the place in map was known, how wrong it was where the truth is known, and how far odom was off map.
fn place(signals: &Signals<'_>, tracking: &Tracking, totals: &Totals) -> String {
    let times = &signals.times_s;
    let Some(place) = MapSeries::of(signals, tracking) else {
        return absent("Place in map", "not recorded");
    };
    let mut html = String::new();
    let lines = |known: &'_ [f64], pick: fn(&Off) -> &Vec<f64>| {
        let mut all = vec![("3 σ", "limit", known.to_vec())];
        all.extend(place.odom.as_ref().map(|odom| ("odom from map", "planned", pick(odom).clone())));
        all.extend(place.truth.as_ref().map(|truth| ("map from truth", "true", pick(truth).clone())));
        all
    };
    let [known_m, known_rad] = &totals.known;
    for (title, is_length, known, all) in [
        ("Place in map: how well it was known", true, known_m, lines(&place.known_m, |off| &off.distance_m)),
        (
            "Heading in map: how well it was known",
            false,
            known_rad,
            lines(&place.known_rad, |off| &off.turned_rad),
        ),
    ] {
        // Before the first pose nothing is known: what follows is what the unit is for.
        let usual = known.at(0.5).unwrap_or(0.0);
        let unit = if is_length { Unit::length(usual) } else { Unit::angle(usual) };
        let most = MOST_SEEN
            * usual.max(
                all.iter()
                    .skip(1)
                    .flat_map(|(.., values)| values)
                    .fold(0.0, |most: f64, value| most.max(*value)),
            );
        let drawn: Vec<(&str, &str, Vec<f64>)> = all
            .into_iter()
            .map(|(name, class, values)| {
                let values = values.into_iter().map(|value| if value > most { f64::NAN } else { value });
                (name, class, values.collect())
            })
            .collect();
        let lines = drawn.iter().map(|(name, class, values)| Line {
            name: (*name).to_owned(),
            class: (*class).to_owned(),
            values,
        });
        let lines = lines.collect();
        html.push_str(&TimeChart { title, unit, times, lines, limits: Vec::new(), marked: &[] }.html());
    }
    html
}

/// What is known no better than so many times the usual isn't drawn: it would flatten all else.
const MOST_SEEN: f64 = 20.0;

fn wrapped(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * (angle / turn).round()
}
