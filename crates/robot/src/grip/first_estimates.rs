//! What is known of a platform before it moves: by its file, or by what such platforms are like.

use crate::config::{ControllerTable, ESTIMATE_BOUNDS};

/// Mass and inertia where the file says nothing of them, kg and kg·m², and how uncertain they are then and else, over
/// themselves.
const UNKNOWN: (f64, f64) = (100.0, 10.0);
const UNKNOWN_SHARE: f64 = 1.0;
const KNOWN_SHARE: f64 = 0.5;
/// Bounds where the file gives none, over the first estimate.
const UNKNOWN_BOUNDS: [f64; 2] = [0.01, 100.0];
/// Friction of all wheels where the file gives no bound, N.
const FRICTION_MAX_N: f64 = 100.0;

/// What is known of a platform before it moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstEstimates {
    /// Mass and moment of inertia, each with its bounds, kg and kg·m².
    pub(crate) mass: (f64, [f64; 2]),
    pub(crate) inertia: (f64, [f64; 2]),
    /// How uncertain the two are, over themselves.
    pub(crate) share: f64,
    /// The most that one wheel rubs, N.
    pub(crate) friction_max_n: f64,
}

impl FirstEstimates {
    pub(crate) fn of(table: &ControllerTable) -> Self {
        let (unknown_kg, unknown_kg_m2) = UNKNOWN;
        let is_known = table.mass_kg.is_some() && table.inertia_kg_m2.is_some();
        let (share, factors) =
            if is_known { (KNOWN_SHARE, ESTIMATE_BOUNDS) } else { (UNKNOWN_SHARE, UNKNOWN_BOUNDS) };
        let first = |given: Option<f64>, unknown: f64, bounds: Option<[f64; 2]>| {
            let first = given.unwrap_or(unknown);
            // A law that takes no notice of them lets wrong ones pass.
            let bounds = bounds.filter(|[low, high]| 0.0 < *low && (*low..=*high).contains(&first));
            (first, bounds.unwrap_or(factors.map(|factor| factor * first)))
        };
        FirstEstimates {
            mass: first(table.mass_kg, unknown_kg, table.mass_bounds_kg),
            inertia: first(table.inertia_kg_m2, unknown_kg_m2, table.inertia_bounds_kg_m2),
            share,
            friction_max_n: table.friction_max_n.unwrap_or(FRICTION_MAX_N).max(0.0),
        }
    }

    /// The same of a platform that weighs so much at least, kg.
    pub(super) fn at_least(mut self, least_kg: f64) -> Self {
        let (first, [low, high]) = &mut self.mass;
        *low = low.max(least_kg);
        *high = high.max(*low);
        *first = first.clamp(*low, *high);
        self
    }
}
