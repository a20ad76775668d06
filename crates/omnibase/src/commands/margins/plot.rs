//! Margins over the treads' stiffness as a picture.

use super::{Axis, worst_of_bodies};
use omnibase_robot::torque_loop::Margins;
use std::fmt::Write;

const WIDTH: f64 = 1040.0;
/// Of one panel, with its numbers.
const PANEL: [f64; 2] = [500.0, 270.0];
/// Of its curves.
const AREA: [f64; 2] = [410.0, 190.0];
/// From the panel's corner to that of its curves.
const INSET: [f64; 2] = [60.0, 36.0];
const TOP: f64 = 70.0;
const POINTS: usize = 60;
const COLOURS: [&str; 4] = ["#0b5fa5", "#c4501b", "#2d8a4e", "#7b4ab0"];

/// What is drawn over the stiffness.
struct Panel {
    name: &'static str,
    of: fn(&Margins) -> f64,
    /// What must be left.
    least: f64,
    step: f64,
    most: f64,
}

const PANELS: [Panel; 2] = [
    Panel { name: "gain margin, dB", of: |found| found.gain_db, least: 6.0, step: 6.0, most: 30.0 },
    Panel { name: "phase margin, °", of: |found| found.phase_deg, least: 30.0, step: 15.0, most: 90.0 },
];

/// The picture: an axis a row, gain and phase side by side.
pub(super) fn svg(robot: &str, axes: &[Axis<'_>]) -> String {
    let height = TOP + PANEL[1] * axes.len() as f64 + 10.0;
    let robot = robot.replace('&', "&amp;").replace('<', "&lt;");
    let mut picture = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"20\" y=\"28\" font-size=\"18\">{robot}: margins of the torque law over the stiffness of a tread</text>\n"
    );
    let ratios = axes.first().map_or(&[][..], |axis| &axis.damping_ratios);
    for ((number, ratio), colour) in ratios.iter().enumerate().zip(COLOURS) {
        let x = 20.0 + 130.0 * number as f64;
        let _ = writeln!(
            picture,
            "<path d=\"M{x} 48h26\" stroke=\"{colour}\" stroke-width=\"2.5\"/><text x=\"{}\" y=\"52\">damping {ratio}</text>",
            x + 32.0
        );
    }
    let x = 20.0 + 130.0 * ratios.len() as f64;
    let _ = writeln!(
        picture,
        "<path d=\"M{x} 48h26\" stroke=\"#c00\" stroke-dasharray=\"6 4\"/><text x=\"{}\" y=\"52\">least: 6 dB, 30°</text>",
        x + 32.0
    );
    for (row, axis) in axes.iter().enumerate() {
        let curves = curves(axis);
        for (column, panel) in PANELS.iter().enumerate() {
            let corner = [10.0 + PANEL[0] * column as f64 + INSET[0], TOP + PANEL[1] * row as f64 + INSET[1]];
            draw(&mut picture, panel, axis.name, corner, &curves);
        }
    }
    picture + "</svg>\n"
}

/// By damping, then by stiffness.
fn curves(axis: &Axis<'_>) -> Vec<Vec<(f64, Margins)>> {
    let [soft, stiff] = axis.one.stiffness_n_m;
    let at = |point: usize| soft * (stiff / soft).powf(point as f64 / (POINTS - 1) as f64);
    let of = |stiffness, ratio: &f64| (stiffness, worst_of_bodies(axis.one, &axis.gains, stiffness, *ratio));
    let curve = |ratio: &f64| (0..POINTS).map(|point| of(at(point), ratio)).collect();
    axis.damping_ratios.iter().map(curve).collect()
}

fn draw(picture: &mut String, panel: &Panel, name: &str, corner: [f64; 2], curves: &[Vec<(f64, Margins)>]) {
    let [left, top] = corner;
    let [width, height] = AREA;
    let (right, bottom) = (left + width, top + height);
    let all = || curves.iter().flatten();
    let greatest = all().map(|(_, found)| (panel.of)(found)).fold(2.0 * panel.least, f64::max);
    let high = ((greatest / panel.step).ceil() * panel.step).min(panel.most);
    let soft = all().map(|(stiffness, _)| stiffness.log10()).fold(f64::INFINITY, f64::min);
    let stiff = all().map(|(stiffness, _)| stiffness.log10()).fold(soft + 0.01, f64::max);
    let x = |stiffness: f64| left + width * (stiffness.log10() - soft) / (stiff - soft);
    let y = |value: f64| bottom - height * (value / high).clamp(0.0, 1.0);
    let _ = writeln!(
        picture,
        "<text x=\"{left}\" y=\"{}\" font-weight=\"bold\">{name}: {}</text>\
         <rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"#f7f8fa\" stroke=\"#888\"/>\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">stiffness of a tread, N/m</text>",
        top - 9.0,
        panel.name,
        bottom + 34.0
    );
    for number in 0..=(high / panel.step).round() as usize {
        let (value, at) = (number as f64 * panel.step, y(number as f64 * panel.step));
        let _ = writeln!(
            picture,
            "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#ddd\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{value}</text>",
            left - 7.0,
            at + 4.5
        );
    }
    for power in soft.floor() as i32..=stiff.ceil() as i32 {
        for digit in 1..10 {
            let value = f64::from(digit) * 10_f64.powi(power);
            let at = x(value);
            if !(left - 0.1..=right + 0.1).contains(&at) {
                continue;
            }
            let colour = if digit == 1 { "#bbb" } else { "#e4e4e4" };
            let _ = write!(picture, "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"{colour}\"/>");
            if [1, 2, 4].contains(&digit) {
                let below = bottom + 17.0;
                let _ = write!(
                    picture,
                    "<text x=\"{at:.1}\" y=\"{below}\" text-anchor=\"middle\">{digit}e{power}</text>"
                );
            }
        }
    }
    let least = y(panel.least);
    let _ = writeln!(
        picture,
        "\n<path d=\"M{left} {least:.1}H{right}\" stroke=\"#c00\" stroke-dasharray=\"6 4\"/>"
    );
    for (curve, colour) in curves.iter().zip(COLOURS) {
        let point = |(stiffness, found): &(f64, Margins)| {
            // What doesn't hold has no margin.
            let value = if found.is_stable { (panel.of)(found) } else { 0.0 };
            format!("{:.1},{:.1}", x(*stiffness), y(value))
        };
        let points: Vec<String> = curve.iter().map(point).collect();
        let _ = writeln!(
            picture,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            points.join(" ")
        );
    }
}
