//! What slipping wheels told of the floor's friction.

/// Friction of wet ice: no floor has less.
const LEAST_FRICTION: f64 = 0.01;
/// One look at a slipping wheel tells the floor's friction so well, over itself; and for how long such an error stays, s.
const LOOK_SHARE: f64 = 0.2;
const LOOK_S: f64 = 0.05;
/// What such a look is worth less after a second of slipping on.
const WALK_1_S: f64 = 0.1;

/// The floor's friction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Floor {
    pub(super) coefficient: f64,
    pub(super) variance: f64,
}

impl Floor {
    /// After a slipping wheel was given such a part of its load.
    pub(super) fn seen(before: Option<Floor>, coefficient: f64, span_s: f64) -> Floor {
        let looked = |most: f64| (LOOK_SHARE * most.max(LEAST_FRICTION)).powi(2);
        let Some(Floor { coefficient: mean, variance }) = before else {
            return Floor { coefficient, variance: looked(coefficient) };
        };
        // A force that passes through nothing, as where a slide ends, tells no more than another one.
        let looked = looked(coefficient.max(mean));
        // What the last look told grows old: floors differ by place.
        let variance = variance + WALK_1_S * looked * span_s;
        let share = variance / (variance + looked * (LOOK_S / span_s).max(1.0));
        Floor { coefficient: mean + share * (coefficient - mean), variance: variance - share * variance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_passes_through_nothing_is_not_taken_for_ice_and_ice_is_found() {
        let look = |floor: Option<Floor>, coefficient: f64, cycles: u32| {
            (0..cycles).fold(floor, |floor, _| Some(Floor::seen(floor, coefficient, 1e-3)))
        };
        let found = |floor: Option<Floor>| floor.expect("it was seen").coefficient;
        let slid = look(None, 0.2, 30);
        assert!((found(slid) - 0.2).abs() < 1e-9);
        let passed = look(slid, 0.004, 10);
        assert!(found(passed) > 0.15, "{passed:?}");
        // On another floor, within half a second of slip.
        let iced = look(look(None, 0.5, 100), 0.08, 500);
        assert!(found(iced) < 0.15, "{iced:?}");
    }
}
