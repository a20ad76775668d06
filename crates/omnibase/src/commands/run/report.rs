//! The summary of a run for a person.

use omnibase_measure::Summary;
use omnibase_measure::measured::Measured;
use omnibase_measure::tracking::BelievedAndTrue;
use std::io::{self, Write};

/// Prints it.
pub fn print(summary: &Summary, output: &mut dyn Write) -> io::Result<()> {
    // A run that ended before it followed anything has no errors.
    if summary.final_error_m.believed.is_some() {
        print_errors(summary, output)?;
    }
    if let Some(measured) = &summary.measured {
        print_measured(measured, output)?;
    }
    writeln!(output, "{:<22} {:>12}", "cycles", summary.cycles)?;
    writeln!(output, "{:<22} {:>12}", "lost frames", summary.lost_frames)?;
    if summary.bus.frames_late > 0 {
        let late = summary.bus.frames_late;
        // A double of a frame that was in time comes behind its cycle, too.
        writeln!(output, "{:<22} {late:>12} came behind their deadline, or a second time", "late frames")?;
    }
    writeln!(output, "{:<22} {:>12}", "overruns", summary.overruns)?;
    writeln!(
        output,
        "{:<22} {:>12} written, {} dropped",
        "records", summary.records_written, summary.records_dropped
    )?;
    writeln!(output, "{:<22} {:>12.1}", "times real time", summary.realtime_factor)?;
    if let Some(share) = summary.cpu_share {
        writeln!(output, "{:<22} {:>12.2} %", "CPU of the cycle", 1e2 * share)?;
    }
    summary.timing.print(output)?;
    // On virtual time nobody is paused.
    if summary.cpu_share.is_some() {
        summary.pauses.print(output)?;
    }
    writeln!(output, "events")?;
    for event in &summary.events {
        writeln!(output, "  {:>10.3} s  {}", event.time_s, event.text)?;
    }
    Ok(())
}

fn print_errors(summary: &Summary, output: &mut dyn Write) -> io::Result<()> {
    writeln!(output, "{:<22} {:>12} {:>12}", "tracking error", "believed", "true")?;
    for (name, figure) in [
        ("  final", summary.final_error_m),
        ("  RMS", summary.rms_error_m),
        ("  greatest", summary.max_error_m),
    ] {
        let BelievedAndTrue { believed, truth } = figure;
        writeln!(output, "{name:<22} {:>12} {:>12}", millimetres(believed), millimetres(truth))?;
    }
    let heading = summary.final_heading_error_rad.map(|rad| format!("{:.3} mrad", 1e3 * rad));
    writeln!(output, "{:<22} {:>12}", "final heading error", heading.unwrap_or_else(|| "-".to_owned()))
}

fn print_measured(measured: &Measured, output: &mut dyn Write) -> io::Result<()> {
    let [x_m, y_m, heading_rad] = measured.pose;
    writeln!(output, "{:<22} {x_m:>10.4} m {y_m:>10.4} m {heading_rad:>12.4} rad", "measured on the floor")?;
    for (name, off) in [
        ("  from the wished end", measured.from_wished),
        ("  from the believed", Some(measured.from_believed)),
    ] {
        let Some(off) = off else { continue };
        writeln!(
            output,
            "{name:<22} {:>9.2} mm {:>9.2} mm {:>12.3} mrad, {:.2} mm off",
            1e3 * off.x_m,
            1e3 * off.y_m,
            1e3 * off.heading_rad,
            1e3 * off.distance_m
        )?;
    }
    Ok(())
}

fn millimetres(metres: Option<f64>) -> String {
    metres.map_or_else(|| "-".to_owned(), |metres| format!("{:.4} mm", 1e3 * metres))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_frames_are_told_beside_the_lost_ones_and_not_as_some_of_them() {
        let mut summary = Summary::default();
        let printed = |summary: &Summary| {
            let mut text = Vec::new();
            print(summary, &mut text).unwrap();
            String::from_utf8(text).unwrap()
        };
        assert!(!printed(&summary).contains("late"));
        summary.bus.frames_late = 2;
        let text = printed(&summary);
        assert!(text.contains("2 came behind their deadline, or a second time"), "{text}");
        assert!(!text.contains("of them"), "{text}");
    }
}
