//! What was found as a page: the table, what wasn't observed, dead reckoning and residuals over time.

use super::{Known, table};
use omnibase_calibrate::observed::unseen;
use omnibase_calibrate::{Dataset, Drift, Solution};
use omnibase_record::report::{CurveChart, CurvesPage, Quantity};

/// The page of a robot by this name.
pub(super) fn of(
    robot: &str,
    dataset: &Dataset,
    known: &Known,
    solution: &Solution,
    drifts: &[[Drift; 2]],
) -> CurvesPage {
    let mut rows = table::rows(known, solution).into_iter().map(|row| row.to_vec());
    let head = rows.next().unwrap_or_default();
    let mut charts = Vec::new();
    for ((run, fit), [before, after]) in dataset.runs.iter().zip(&solution.runs).zip(drifts) {
        let both = |of: fn(&[f64; 3]) -> f64| {
            let curve = |name: &str, drift: &Drift| (name.to_owned(), drift.errors.iter().map(of).collect());
            vec![curve("by the file", before), curve("by what was found", after)]
        };
        let chart = |title: &str, quantity, curves| CurveChart {
            title: format!("{}: {title}", run.name),
            quantity,
            times_s: before.instants_s.clone(),
            curves,
        };
        let distance = both(|[x, y, _]| x.hypot(*y));
        charts.push(chart("dead reckoning from the truth", Quantity::Length, distance));
        charts.push(chart("its heading", Quantity::Angle, both(|[.., heading]| *heading)));
        if !run.poses.is_empty() {
            let axis = |name: &str, axis: usize| {
                (name.to_owned(), fit.residuals.iter().map(|residual| residual[axis]).collect())
            };
            let axes = vec![axis("x of the sensor", 0), axis("y", 1), axis("heading", 2)];
            charts.push(chart("poses from where the solution has them", Quantity::Sigmas, axes));
        }
    }
    CurvesPage {
        title: format!("{robot}: calibration"),
        facts: table::facts(dataset, solution),
        head,
        rows: rows.collect(),
        listed: (
            "Not observed: the file's tolerances decide".to_owned(),
            unseen(solution, &known.build).into_iter().map(|one| one.words).collect(),
        ),
        charts,
    }
}
