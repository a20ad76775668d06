//! A run as one page of HTML with still pictures: for the screen, for the phone, for paper.
//!
//! The page holds everything it needs, takes nothing from the network and runs no script.
//!
//! Curves are reduced to the least and the greatest value in each column of a chart, so its size hardly depends
//! on the length of the run, and neither does the room that it takes to make it ([`Digest`]). The same run
//! gives the same page.
//!
//! # Signals
//! Names are compared without regard to `/`, `.`, case and a unit at the end, so `/state` with `pose_x_m` is the same
//! as `state` with `pose.x`. A section whose signals are missing says so in a word.
//!
//! | shown | signals |
//! |---|---|
//! | path, errors | `wished.pose.{x,y,heading}` (else `setpoint.pose.…`), `state.pose.…`, `truth.pose.…` |
//! | speeds | `wished.twist.{x,y,heading}` (else `setpoint.twist.…`) in odom, `state.twist_in_body.…`, `truth.twist.…` in the body's frame |
//! | wheels | each topic with `speed` and `torque` |
//! | phases | `cycle.phase`, `allowed.action`, `command.saturation`, `allowed.saturation`, `exchange.result` |
//! | timing | `timing.round_trip`, `timing.wake_up`, `timing.compute`, `cycle.period`, `bus.dc_phase`, with their unit (`_ns`) |
//! | estimates | `state.slip_residual`, `estimate.mass`, `estimate.inertia` |
//! | sensors | `sensor.….verdict`, `sensor.….nis`, `map.pose.…`, `map.covariance_{xx,yy,hh}` |
//! | inputs, outputs and axes | all of each topic that has an `age`: it stands beside the drives |
//!
//! # Description
//! `robot`, `reference`, `mode`, `version`, `date` make the title. `footprint_m` (`x y; x y; …`, corners in the
//! body's frame), `wheels_m` (`x y rolling_angle_rad radius_m; …`) and `wheel_names` (separated by spaces) draw
//! the platform.
//!
//! `fence_m` (as the footprint, in odom), `walls_m` (several such: `x y; … | x y; …`) and `obstacles_m`
//! (`x y radius; …`) draw the room.
//!
//! `limit.wheel_speed_rad_s`, `limit.wheel_torque_nm`, `wheel_peak_torque_nm`, `wheel_rated_torque_nm` are what
//! wheels may. `sensor_gates` (`name chi²-per-number; …`) says beyond what readings were left out.
//! `simulation.mass_kg` and `simulation.inertia_kg_m2` are drawn beside what was measured.
//!
//! `lost_frames`, `overruns`, `records_dropped` and `realtime_factor` stand in the summary, and [`MEASURED`]
//! beside it. All of them may be missing.

mod bands;
mod beside;
mod chart;
mod configuration;
mod curve;
mod curves;
mod digest;
mod histogram;
mod overhead;
mod room;
mod scale;
mod sections;
mod sensors;
mod signals;
mod summary;
mod text;
mod totals;
mod tracking;
mod wheels;

pub use curves::{CurveChart, CurvesPage, Quantity};
pub use digest::Digest;
pub use tracking::{BelievedAndTrue, TrackingFigures};

use crate::run::{Keep, RecordedRun};
use sections::Page;
use signals::Signals;
use text::escape;
use totals::Totals;
use tracking::Tracking;

/// Colours, sizes and what differs on paper.
const STYLE: &str = include_str!("report/style.css");

/// The signals that a page shows.
const SHOWN: Keep<'static> = Keep::Signals(signals::is_shown);

/// In the description: `x y heading` in m, m and rad, where a person found the platform on the floor after the run, in odom.
pub const MEASURED: &str = "measured";

/// The page of a run that is there as a whole, as a whole HTML file; [`Digest`] for recordings of any length.
pub fn html(run: &RecordedRun) -> String {
    let signals = Signals::new(run);
    let tracking = Tracking::new(&signals);
    page(&signals, &tracking, &Totals::of(&signals, &tracking), None)
}

/// The page of the rows that are seen, with the figures of all rows.
fn page(signals: &Signals<'_>, tracking: &Tracking, totals: &Totals, planned: Option<&str>) -> String {
    let page = Page::new(signals, tracking, totals);
    let title = summary::title(signals);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta name=\"generator\" content=\"omnibase\">\n<title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n\
         <body>\n<main>\n",
        escape(&title)
    );
    html.push_str(&summary::html(signals, tracking, totals, &title));
    if signals.times_s.is_empty() {
        let empty = "<p class=\"absent\">The recording holds no cycle: there is nothing to draw.</p>\n";
        html.push_str(&sections::section("path", "Path", empty));
    } else {
        html.push_str(&page.path());
        html.extend(
            planned.map(|svg| sections::section("planned", "Planned motion, and what binds it", svg)),
        );
        for section in [Page::errors, Page::speeds, Page::wheels] {
            html.push_str(&section(&page));
        }
        for section in [Page::phases, Page::sensors, Page::beside, Page::timing, Page::estimates] {
            html.push_str(&section(&page));
        }
    }
    html.push_str(&page.events());
    html.push_str(&configuration::html(signals));
    html.push_str("</main>\n</body>\n</html>\n");
    html
}
