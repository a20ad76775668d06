//! The speed nearest to a wished one that keeps to the greatest speeds along several normals.

use super::shape::{Point, dot, plus};

/// Most constraints that shape a wish; the check behind it forgets none.
pub(super) const MOST: usize = 32;
/// By how much a speed that keeps a plane may exceed it, m/s: rounding.
const KEPT_M_S: f64 = 1e-12;
/// Two planes whose normals are no further apart count as parallel, rad.
const PARALLEL_RAD: f64 = 1e-6;
/// By how much parallel planes may contradict each other, m/s.
const CONTRADICTION_M_S: f64 = 1e-9;

/// The greatest speed along a normal, m/s; the normal's length is 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Plane {
    pub(super) normal: Point,
    pub(super) most_m_s: f64,
}

impl Plane {
    fn excess_m_s(&self, speed: Point) -> f64 {
        dot(self.normal, speed) - self.most_m_s
    }
}

/// Half-planes of speeds.
pub(super) struct Planes {
    list: [Plane; MOST],
    count: usize,
}

impl Planes {
    /// The first [`MOST`] of them.
    pub(super) fn of(planes: impl Iterator<Item = Plane>) -> Self {
        let mut of = Planes { list: [Plane::default(); MOST], count: 0 };
        for (slot, plane) in of.list.iter_mut().zip(planes) {
            *slot = plane;
            of.count += 1;
        }
        of
    }

    /// The speed within all of them that is nearest to a wished one, m/s; `None` where there is no such speed.
    /// One after the other (Seidel, "Small-dimensional linear programming and convex hulls made easy", 1991): where the speed
    /// that is nearest so far breaks the next one, the nearest of all is on that one's edge.
    pub(super) fn nearest(&self, wish: Point) -> Option<Point> {
        let planes = &self.list[..self.count];
        let mut speed = wish;
        for (number, plane) in planes.iter().enumerate() {
            if plane.excess_m_s(speed) > KEPT_M_S {
                speed = nearest_on_edge(plane, &planes[..number], wish)?;
            }
        }
        Some(speed)
    }
}

/// Of an edge, what is nearest to a wish within others.
fn nearest_on_edge(edge: &Plane, others: &[Plane], wish: Point) -> Option<Point> {
    let foot = plus(wish, edge.normal, -edge.excess_m_s(wish));
    let along = [-edge.normal[1], edge.normal[0]];
    let (mut least, mut most) = (f64::NEG_INFINITY, f64::INFINITY);
    for other in others {
        let (rate, left) = (dot(other.normal, along), -other.excess_m_s(foot));
        if rate > PARALLEL_RAD {
            most = most.min(left / rate);
        } else if rate < -PARALLEL_RAD {
            least = least.max(left / rate);
        } else if left < -CONTRADICTION_M_S {
            return None;
        }
    }
    if least > most + CONTRADICTION_M_S {
        return None;
    }
    Some(plus(foot, along, 0.0_f64.max(least).min(most)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::guard::shape::{cross, length};

    /// Seeded numbers from -1 to 1.
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    /// The wish, its feet on all edges and all corners: one of them is nearest, if any is within all.
    fn nearest_by_trying_all(planes: &[Plane], wish: Point) -> Option<Point> {
        let feet = planes.iter().map(|plane| plus(wish, plane.normal, -plane.excess_m_s(wish)));
        let corners = planes.iter().flat_map(|a| planes.iter().map(move |b| (a, b))).filter_map(|(a, b)| {
            let apart = cross(a.normal, b.normal);
            (apart.abs() > PARALLEL_RAD).then(|| {
                let x = a.most_m_s * b.normal[1] - b.most_m_s * a.normal[1];
                let y = b.most_m_s * a.normal[0] - a.most_m_s * b.normal[0];
                [x / apart, y / apart]
            })
        });
        let is_within = |speed: &Point| planes.iter().all(|plane| plane.excess_m_s(*speed) <= 1e-9);
        let away_m_s = |speed: Point| length(plus(speed, wish, -1.0));
        std::iter::once(wish)
            .chain(feet)
            .chain(corners)
            .filter(is_within)
            .min_by(|a, b| away_m_s(*a).total_cmp(&away_m_s(*b)))
    }

    #[test]
    fn the_nearest_of_all_speeds_is_found_or_there_is_none() {
        let (mut found, mut none) = (0, 0);
        for seed in 1..=20_000 {
            let mut number = numbers(seed);
            let count = 1 + (seed % 17) as usize;
            let planes: Vec<Plane> = (0..count)
                .map(|_| {
                    let (sin, cos) = (std::f64::consts::PI * number()).sin_cos();
                    Plane { normal: [cos, sin], most_m_s: 0.6 * number() + 0.4 }
                })
                .collect();
            let wish = [number(), number()];
            let nearest = Planes::of(planes.iter().copied()).nearest(wish);
            match (nearest, nearest_by_trying_all(&planes, wish)) {
                (Some(speed), Some(expected)) => {
                    let apart_m_s = length(plus(speed, expected, -1.0));
                    assert!(apart_m_s < 1e-8, "{seed}: {speed:?} instead of {expected:?}");
                    found += 1;
                }
                (None, None) => none += 1,
                (speed, expected) => panic!("{seed}: {speed:?} instead of {expected:?}"),
            }
        }
        assert!(found > 5000 && none > 1000, "{found} found, {none} without any");
    }

    #[test]
    fn opposite_planes_leave_what_is_between_them() {
        let between = |most_m_s: f64| {
            let planes = [
                Plane { normal: [0.0, 1.0], most_m_s },
                Plane { normal: [0.0, -1.0], most_m_s: 0.125 },
                Plane { normal: [0.0, 1.0], most_m_s },
            ];
            Planes::of(planes.into_iter()).nearest([0.5, 0.75])
        };
        assert_eq!(between(0.25), Some([0.5, 0.25]));
        assert_eq!(between(-0.125), Some([0.5, -0.125]));
        assert_eq!(between(-0.25), None);
    }
}
