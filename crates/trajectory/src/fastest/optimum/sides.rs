//! Which of many limits bind at a moment.

/// Drops what other limits imply, of those that a·x + b·u is at most 1, for x from 0 to that at which `speed`·x is 1.
///
/// The others are the corners of the hull of all (a, b), seen from where a is great: a smaller a asks for less, as x isn't negative.
pub(super) fn keep_binding(sides: &mut Vec<[f64; 2]>, speed: f64) {
    sides.push([speed, 0.0]);
    sides.sort_unstable_by(|one, other| one[1].total_cmp(&other[1]));
    let mut kept = 0;
    for at in 0..sides.len() {
        let next = sides[at];
        while kept > 0 {
            let last = sides[kept - 1];
            let is_behind = match kept.checked_sub(2).map(|at| sides[at]) {
                // Not beyond the line from the one before it to the next.
                Some(before) => {
                    (last[0] - before[0]) * (next[1] - before[1])
                        <= (next[0] - before[0]) * (last[1] - before[1])
                }
                None => last[1] == next[1] && last[0] <= next[0],
            };
            if !is_behind {
                break;
            }
            kept -= 1;
        }
        sides[kept] = next;
        kept += 1;
    }
    sides.truncate(kept);
    // That on speed is told by itself.
    sides.retain(|side| *side != [speed, 0.0]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// How far u may go up, or down, at x.
    fn most(sides: &[[f64; 2]], x: f64, sign: f64) -> f64 {
        let facing = sides.iter().filter(|[_, b]| sign * b > 0.0);
        facing.map(|[a, b]| (1.0 - a * x) / (sign * b)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn what_is_dropped_is_implied_by_what_is_kept(
            sides in prop::collection::vec([-2.0..2.0, -2.0..2.0_f64], 0..16),
            speed in 0.1..2.0_f64,
        ) {
            let mut kept = sides.clone();
            keep_binding(&mut kept, speed);
            prop_assert!(kept.iter().all(|side| sides.contains(side)));
            for part in 0..=1000 {
                let x = f64::from(part) / 1000.0 / speed;
                let [up, down] = [1.0, -1.0].map(|sign| most(&kept, x, sign));
                // Where nothing is within the kept ones, the others don't count.
                if up + down >= 0.0 {
                    for (sign, by_kept) in [(1.0, up), (-1.0, down)] {
                        prop_assert!(most(&sides, x, sign) >= by_kept - 1e-9, "{x}: {sides:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn few_of_many_are_kept() {
        // Of twelve planes round a circle all that face forwards bind; none that is behind one of these, or asks less than the speed.
        let mut sides: Vec<[f64; 2]> = (0..12)
            .flat_map(|at| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(at) / 12.0).sin_cos();
                [[cos, sin], [0.5 * cos, 0.5 * sin]]
            })
            .collect();
        keep_binding(&mut sides, 0.1);
        assert_eq!(sides.len(), 7, "{sides:?}");
    }
}
