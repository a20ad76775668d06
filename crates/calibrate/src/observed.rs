//! What the runs couldn't show, in words.
//!
//! The information of the runs alone, measured in tolerances: where an eigenvalue is below 1, they say less of that combination
//! than the file did. Such combinations are told by names where they have one, by their greatest parts where they don't.

use nalgebra::{DMatrix, DVector};

use crate::build::Build;
use crate::errors::contradictions;
use crate::solve::{Solution, observed_frames};
use crate::unknown::{Unknown, along, moved_frame};

/// A combination of unknowns that no run showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Unseen {
    /// What it is.
    pub words: String,
    /// Which unknowns it is made of, each with its part in tolerances.
    pub parts: Vec<(Unknown, f64)>,
}

/// A combination is called by a name that lies in what wasn't seen by so much of its square.
const NAMED_FROM: f64 = 0.9;
/// Parts smaller than this share of a combination's square aren't told.
const TOLD_FROM: f64 = 0.06;

/// All that couldn't be seen; `expected` is what the solution began from.
pub fn unseen(solution: &Solution, expected: &Build) -> Vec<Unseen> {
    let unknowns: Vec<Unknown> = solution.found.iter().map(|found| found.unknown).collect();
    let names: Vec<String> = expected.wheels.iter().map(|wheel| wheel.name.clone()).collect();
    let sigmas =
        DVector::from_iterator(unknowns.len(), solution.found.iter().map(|found| found.sigma_before));
    let scale = DMatrix::from_diagonal(&sigmas);
    let eigen = (&scale * &solution.information * &scale).symmetric_eigen();
    let dark = (0..unknowns.len()).filter(|at| eigen.eigenvalues[*at] < 1.0);
    let mut rest: Vec<DVector<f64>> = dark.map(|at| eigen.eigenvectors.column(at).into_owned()).collect();
    let mut told: Vec<DVector<f64>> = Vec::new();
    let mut list = Vec::new();
    for (words, amounts) in named(expected, &unknowns, &sigmas, &names) {
        let mut one = amounts.component_div(&sigmas);
        for known in &told {
            one -= known * known.dot(&one);
        }
        let Some(unit) = one.try_normalize(1e-9) else { continue };
        let mut inside = DVector::zeros(unknowns.len());
        for dark in &rest {
            inside += dark * dark.dot(&unit);
        }
        if inside.norm_squared() < NAMED_FROM {
            continue;
        }
        let direction = inside.normalize();
        rest = without(&rest, &direction);
        list.push(Unseen { words, parts: parts(&unknowns, &direction) });
        told.push(unit);
    }
    for direction in rest {
        let parts = parts(&unknowns, &direction);
        let words = sum(&parts, &names);
        list.push(Unseen { words, parts });
    }
    list
}

/// Combinations that have a name, in the order in which they are looked for.
fn named(
    expected: &Build,
    unknowns: &[Unknown],
    sigmas: &DVector<f64>,
    names: &[String],
) -> Vec<(String, DVector<f64>)> {
    let single = |at: usize| DVector::from_fn(unknowns.len(), |row, _| if row == at { 1.0 } else { 0.0 });
    let mut list = Vec::new();
    for (at, unknown) in unknowns.iter().enumerate() {
        if matches!(unknown, Unknown::Along(_)) {
            list.push((format!("{}: no motion shows it", unknown.words(names)), single(at)));
        }
    }
    let has_sensor = unknowns.contains(&Unknown::SensorX);
    let together = if has_sensor { "wheels and sensor" } else { "all wheels" };
    let frames = [
        format!("where base is along x: {together} moved together"),
        format!("where base is along y: {together} moved together"),
        format!("which way base looks: {together} turned together"),
    ];
    for (words, frame) in frames.into_iter().zip(observed_frames()) {
        list.push((words, moved_frame(expected, unknowns, frame)));
    }
    for direction in contradictions(expected, unknowns, sigmas) {
        let words = sum(&parts(unknowns, &direction), names);
        let amounts = direction.component_mul(sigmas);
        list.push((format!("what wheels contradict each other by, and nothing moves: {words}"), amounts));
    }
    let length = |unknown: &Unknown| {
        let place = |wheel: usize| expected.wheels[wheel].position_m;
        match *unknown {
            Unknown::Radius(_) => 1.0,
            Unknown::Across(wheel) | Unknown::Along(wheel) => {
                let ([ax, ay], [x, y]) = (along(&expected.wheels[wheel]), place(wheel));
                if matches!(unknown, Unknown::Across(_)) { x * ay - y * ax } else { x * ax + y * ay }
            }
            Unknown::SensorX => expected.sensor.base_from_sensor.x_m,
            Unknown::SensorY => expected.sensor.base_from_sensor.y_m,
            _ => 0.0,
        }
    };
    let lengths = DVector::from_iterator(unknowns.len(), unknowns.iter().map(length));
    list.push(("how long a metre is: all radii and places in proportion".to_owned(), lengths));
    let singles = unknowns.iter().enumerate().filter(|(_, unknown)| !matches!(unknown, Unknown::Along(_)));
    list.extend(singles.map(|(at, unknown)| (unknown.words(names), single(at))));
    list
}

/// Parts with their signs.
fn sum(parts: &[(Unknown, f64)], names: &[String]) -> String {
    let word = |(unknown, part): &(Unknown, f64)| {
        format!("{} {}", if *part < 0.0 { "−" } else { "+" }, unknown.words(names))
    };
    parts.iter().map(word).collect::<Vec<_>>().join(" ").trim_start_matches("+ ").to_owned()
}

/// The same space without one of its directions: what the projection on the rest keeps whole.
fn without(space: &[DVector<f64>], direction: &DVector<f64>) -> Vec<DVector<f64>> {
    let mut projection = -direction * direction.transpose();
    for vector in space {
        projection += vector * vector.transpose();
    }
    let eigen = projection.symmetric_eigen();
    let kept = (0..eigen.eigenvalues.len()).filter(|at| eigen.eigenvalues[*at] > 0.5);
    kept.map(|at| eigen.eigenvectors.column(at).into_owned()).collect()
}

/// The greatest parts of a direction, the greatest first.
fn parts(unknowns: &[Unknown], direction: &DVector<f64>) -> Vec<(Unknown, f64)> {
    let mut parts: Vec<(Unknown, f64)> = unknowns.iter().copied().zip(direction.iter().copied()).collect();
    parts.retain(|(_, part)| part * part >= TOLD_FROM);
    parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    parts
}
