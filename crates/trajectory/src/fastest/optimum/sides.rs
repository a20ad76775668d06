//! Which of many limits bind at a moment.

/// An acceleration of at most 1 along x and y: its rows over x and u.
pub(super) struct Disk(pub(super) [[f64; 2]; 2]);

impl Disk {
    /// What of u the disk leaves: by how much u is off a part of x at most, and that part.
    fn slab(&self) -> [f64; 2] {
        let [[ax, au], [bx, bu]] = self.0;
        let size = au.hypot(bu);
        [1.0 / size, -(ax * au + bx * bu) / (size * size)]
    }

    /// The greatest size of u while x times the speed is at most 1; infinite, or none, at rest.
    pub(super) fn most(&self, speed: f64) -> f64 {
        let [off, part] = self.slab();
        off + part.abs() / speed
    }

    /// Whether all that it leaves while x times the speed is at most 1 is within a side.
    pub(super) fn implies(&self, [a, b]: [f64; 2], speed: f64) -> bool {
        let [off, part] = self.slab();
        b.abs() * off + (a + b * part).max(0.0) / speed <= 1.0
    }

    /// Whether all that binding sides leave is within it.
    pub(super) fn is_implied(&self, sides: &[[f64; 2]]) -> bool {
        let is_within =
            |[x, u]: [f64; 2]| self.0.iter().map(|row| (row[0] * x + row[1] * u).powi(2)).sum::<f64>() <= 1.0;
        let (Some(first), Some(last)) = (sides.first(), sides.last()) else { return false };
        // Where two sides meet, and at rest.
        let corner = |pair: &[[f64; 2]]| {
            let ([a, b], [c, d]) = (pair[0], pair[1]);
            let det = a * d - c * b;
            [(d - b) / det, (a - c) / det]
        };
        let is_bounded = first[1] < 0.0 && last[1] > 0.0;
        is_bounded
            && [first, last].into_iter().all(|side| is_within([0.0, 1.0 / side[1]]))
            && sides.windows(2).all(|pair| is_within(corner(pair)))
    }
}

/// Whether the jerk of the turn keeps its limit wherever that along x and y does, for x and u up to their most; rows over x, u and u'.
pub(super) fn is_gentle(turn: &[f64; 3], along: &[[f64; 3]; 2], [x, u]: [f64; 2]) -> bool {
    let size = along[0][2].hypot(along[1][2]);
    // What of the turn's is a part of the other's, and the rest.
    let share = along.map(|row| row[2] / size * (turn[2] / size));
    let rest = [0, 1].map(|at| (turn[at] - share[0] * along[0][at] - share[1] * along[1][at]).abs());
    turn[2].abs() / size + x.sqrt() * (rest[0] * x + rest[1] * u) <= 1.0
}

/// Drops what other limits imply, of those that a·x + b·u is at most 1, for x from 0 on.
///
/// The others are the corners of the hull of all (a, b), seen from where a is great, by rising b: a smaller a asks for less, as x isn't
/// negative.
pub(super) fn keep_binding(sides: &mut Vec<[f64; 2]>) {
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
            mut sides in prop::collection::vec([-2.0..2.0, -2.0..2.0_f64], 0..16),
            speed in 0.1..2.0_f64,
        ) {
            sides.push([speed, 0.0]);
            let mut kept = sides.clone();
            keep_binding(&mut kept);
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
            let beyond = [1.0, -1.0].map(|sign| most(&kept, 1.001 / speed, sign));
            prop_assert!(kept.contains(&[speed, 0.0]) || beyond[0] + beyond[1] < 0.0, "{sides:?}");
        }

        #[test]
        fn a_disk_implies_and_is_implied_as_it_says(
            rows in [[-1.0..1.0, -2.0..2.0_f64], [-1.0..1.0, -2.0..2.0_f64]],
            mut sides in prop::collection::vec([-2.0..2.0, -3.0..3.0_f64], 4..16),
            speed in 0.3..2.0_f64,
        ) {
            let disk = Disk(rows);
            let size = |x: f64, u: f64| rows.map(|row| row[0] * x + row[1] * u).map(|part| part * part).iter().sum::<f64>();
            let implied: Vec<[f64; 2]> =
                sides.iter().copied().filter(|side| disk.implies(*side, speed)).collect();
            sides.push([speed, 0.0]);
            keep_binding(&mut sides);
            let is_implied = disk.is_implied(&sides);
            for part in 0..=200 {
                let x = f64::from(part) / 200.0 / speed;
                for at in -200..=200 {
                    let u = 0.05 * f64::from(at);
                    if size(x, u) <= 1.0 {
                        prop_assert!(implied.iter().all(|[a, b]| a * x + b * u <= 1.0 + 1e-9), "{x}, {u}");
                        prop_assert!(u.abs() <= disk.most(speed) + 1e-9, "{x}, {u}");
                    }
                    if is_implied && sides.iter().all(|[a, b]| a * x + b * u <= 1.0) {
                        prop_assert!(size(x, u) <= 1.0 + 1e-9, "{x}, {u}: {sides:?}");
                    }
                }
            }
        }

        #[test]
        fn a_gentle_turn_keeps_its_jerk(
            along in [[-2.0..2.0, -2.0..2.0, -2.0..2.0_f64], [-2.0..2.0, -2.0..2.0, -2.0..2.0_f64]],
            turn in [-0.3..0.3, -0.3..0.3, -1.0..1.0_f64],
            most in [0.1..2.0, 0.1..2.0_f64],
        ) {
            prop_assume!(is_gentle(&turn, &along, most));
            for [x, u] in [[1.0, 1.0], [1.0, -1.0], [0.5, 1.0], [0.5, -1.0], [0.1, 0.3]] {
                let (x, u) = (x * most[0], u * most[1]);
                for at in -500..=500 {
                    let w = 0.05 * f64::from(at);
                    let jerk = |row: &[f64; 3]| row[0] * x + row[1] * u + row[2] * w;
                    if along.iter().map(|row| jerk(row).powi(2)).sum::<f64>() <= 1.0 / x {
                        prop_assert!(jerk(&turn).powi(2) <= (1.0 + 1e-9) / x, "{x}, {u}, {w}");
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
            .chain([[0.1, 0.0]])
            .collect();
        keep_binding(&mut sides);
        assert_eq!(sides.len(), 7, "{sides:?}");
        // All of these within a disk around them, and none of a smaller one.
        for (size, is_implied) in [(0.8, true), (1.1, false)] {
            assert_eq!(Disk([[size, 0.0], [0.0, size]]).is_implied(&sides), is_implied, "{size}");
        }
        assert!(Disk([[1.0, 0.0], [0.0, 1.0]]).implies([0.0, 0.9], 1.0));
    }
}
