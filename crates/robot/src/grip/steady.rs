//! Wheels that slide while the motion stays: together they push less than the least that the platform can weigh asks for.
//!
//! Over the floor F = m·a. Where rims show an acceleration for which the lightest that the platform can be
//! would take more force than its wheels give it, they turn without taking it along. It shows in a steady
//! circle, too, where no force changes its size.
//!
//! The least is that of the file, and of what was learnt: a slide makes it look lighter, never heavier.
//!
//! A slope that helps looks the same, so a slide is told where more is missing than slopes explain; then all
//! that was missing before was a slide as well, and it slides until the floor has made up for the speed that it
//! lacks, or gives it less than it did.

use super::sliding::{FAST_1_S, HELD_M_S, LASTING_S, Slide};
use super::{FORGOTTEN_S, GRAVITY_M_S2, LEAST_N};
use crate::decay::Decay;

/// By which part of what its drives tell a platform's motors may give more.
const MORE_SHARE: f64 = 0.05;
/// A slope that may help beside the one that is known, over gravity; and with what a mass that was learnt on it is off.
const SLOPE: f64 = 0.03;
const LEARNT_SLOPE: f64 = 0.05;
/// Of a gentler motion what friction is off hides more than the masses' tolerances give, m/s².
const GENTLE_M_S2: f64 = 1.5;
/// What gets less than this part of what it got while it slid grips.
const STILL_GIVEN: f64 = 0.5;

/// A low-passed vector in body axes.
type Vector = [f64; 2];

/// What a cycle showed, in body axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    /// The acceleration that setpoint and rims have in common, m/s², behind the low-pass.
    pub(super) acceleration: Vector,
    /// What the rims push the floor with, N, and what friction takes of it or adds.
    pub(super) push_n: Vector,
    pub(super) friction_n: Vector,
    /// What a slope pushes it with, N.
    pub(super) slope_n: Vector,
    /// How fast the rims say that the platform is, m/s and rad/s.
    pub(super) speed_m_s: f64,
    pub(super) turn_rad_s: f64,
    /// The least that was learnt of its mass, kg.
    pub(super) learnt_kg: f64,
}

/// The watch.
#[derive(Clone, Debug)]
pub(super) struct Steady {
    /// By what the file tells the least mass that its motors' torques may show, kg; 0 where it tells none.
    told_kg: f64,
    fast: Decay,
    forgotten: Decay,
    push_n: Vector,
    friction_n: Vector,
    /// For how long so little pushes that no slope explains it, s.
    since_s: f64,
    /// By how much the rims are faster than the floor if nothing but a slide explains what is missing, m/s, and how far that led, m.
    ahead_m_s: Vector,
    way_m: f64,
    /// What the floor gave while something was missing, N.
    given_n: f64,
}

/// A platform that slides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slides {
    /// Where its rims run ahead of it: a direction in body axes.
    direction: Vector,
    slide: Slide,
}

impl Slides {
    /// Of a wheel whose rim goes by a twist as its row says, and whose motor pushes the floor so, N; `None` where it pushes little
    /// of what the greatest one does.
    pub(super) fn of_wheel(&self, row: &[f64; 3], force_n: f64, greatest_n: f64) -> Option<Slide> {
        let along = self.along(row);
        let pushes = along * force_n > 0.0 && force_n.abs() > 0.5 * greatest_n;
        pushes.then(|| Slide {
            ahead_m_s: (self.slide.ahead_m_s * along.abs()).copysign(force_n),
            step_m: self.step_m(row),
        })
    }

    /// How far such a wheel slid by it, m.
    pub(super) fn step_m(&self, row: &[f64; 3]) -> f64 {
        self.slide.step_m * self.along(row).abs()
    }

    fn along(&self, row: &[f64; 3]) -> f64 {
        dot([row[0], row[1]], self.direction)
    }
}

impl Steady {
    /// Of a platform that weighs so much at least, kg; 0 where nobody tells.
    pub(super) fn new(least_kg: f64) -> Self {
        Steady {
            told_kg: (1.0 - MORE_SHARE) * least_kg,
            fast: Decay::new(FAST_1_S),
            forgotten: Decay::new(1.0 / FORGOTTEN_S),
            push_n: Vector::default(),
            friction_n: Vector::default(),
            since_s: 0.0,
            ahead_m_s: Vector::default(),
            way_m: 0.0,
            given_n: 0.0,
        }
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        let Steady { told_kg, fast, forgotten, .. } = *self;
        *self = Steady { told_kg, fast, forgotten, ..Steady::new(0.0) };
    }

    /// Whether the platform slides.
    pub(super) fn look(&mut self, shown: &Shown, span_s: f64) -> Option<Slides> {
        let Shown { acceleration, push_n, friction_n, slope_n, speed_m_s, .. } = shown;
        let learnt_kg = shown.learnt_kg.max(0.0);
        let told = [*push_n, *friction_n];
        if !told.as_flattened().iter().chain(slope_n).sum::<f64>().is_finite() {
            self.forget();
            return None;
        }
        let keep = self.fast.kept(span_s);
        let olds = [&mut self.push_n, &mut self.friction_n];
        for (old, new) in olds.into_iter().zip(told) {
            *old = std::array::from_fn(|axis| keep * old[axis] + (1.0 - keep) * new[axis]);
        }
        let mass_kg = self.told_kg.max(learnt_kg);
        if *speed_m_s < HELD_M_S || mass_kg <= 0.0 {
            self.grips();
            return None;
        }
        // On a slope wheels push as on a level floor for so much more.
        let asked: Vector = std::array::from_fn(|axis| acceleration[axis] - slope_n[axis] / mass_kg);
        let size = omnibase_platform::length(asked);
        let direction = if size > 0.0 { asked.map(|axis| axis / size) } else { Vector::default() };
        let push_n = dot(self.push_n, direction);
        // Friction that brakes where the wheels brake.
        let helps_n = (-dot(self.friction_n, direction)).max(0.0);
        let given_n = push_n + helps_n;
        // Who is slowed by wheels while speeding up goes downhill.
        let is_missing = |least_n: f64| push_n >= LEAST_N && given_n < least_n;
        if is_missing(mass_kg * size) {
            self.given_n = given_n;
        }
        let (sin, cos) = (span_s * shown.turn_rad_s).sin_cos();
        let [x, y] = self.ahead_m_s;
        let carried = [cos * x + sin * y, cos * y - sin * x];
        let ahead_m_s: Vector = std::array::from_fn(|axis| {
            let force_n = self.push_n[axis] + helps_n * direction[axis];
            carried[axis] + span_s * (asked[axis] - force_n / mass_kg)
        });
        // What slides is pushed where its rims run ahead, and by as much as before.
        let along_n = dot(self.push_n, ahead_m_s) / omnibase_platform::length(ahead_m_s);
        self.ahead_m_s = if along_n > STILL_GIVEN * self.given_n { ahead_m_s } else { Vector::default() };
        let ahead_m_s = omnibase_platform::length(self.ahead_m_s);
        self.way_m = if ahead_m_s > 0.0 {
            self.way_m + span_s * ahead_m_s
        } else {
            self.way_m * self.forgotten.kept(span_s)
        };
        let least_n = |mass_kg: f64, slope: f64| {
            if size > GENTLE_M_S2 { mass_kg * (size - slope * GRAVITY_M_S2) } else { 0.0 }
        };
        if is_missing(least_n(self.told_kg, SLOPE).max(least_n(learnt_kg, LEARNT_SLOPE))) {
            self.since_s += span_s;
        } else if self.since_s < LASTING_S || ahead_m_s == 0.0 {
            self.since_s = 0.0;
        }
        if self.since_s < LASTING_S {
            return None;
        }
        let slides = self.if_it_slides();
        self.count();
        slides
    }

    /// What is missing counts as slid.
    pub(super) fn count(&mut self) {
        self.way_m = 0.0;
    }

    /// The slide that explains what is missing and wasn't counted; `None` while a slope would explain it as well.
    pub(super) fn if_it_slides(&self) -> Option<Slides> {
        let ahead_m_s = omnibase_platform::length(self.ahead_m_s);
        (ahead_m_s > 0.0 && self.since_s > 0.0).then(|| Slides {
            direction: self.ahead_m_s.map(|axis| axis / ahead_m_s),
            slide: Slide { ahead_m_s, step_m: self.way_m },
        })
    }

    fn grips(&mut self) {
        (self.since_s, self.ahead_m_s) = (0.0, Vector::default());
    }
}

fn dot(one: Vector, other: Vector) -> f64 {
    one[0] * other[0] + one[1] * other[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    /// What a platform of 70 kg, 66.5 at least by its file, was said to slide by, and when, whose rims accelerate and whose wheels push
    /// over half a second as a world says.
    fn slides(world: impl Fn(f64) -> (Vector, Vector), learnt_kg: f64) -> Vec<(f64, Slide)> {
        let mut steady = Steady::new(66.5);
        let mut acceleration = Vector::default();
        let keep = Decay::new(FAST_1_S).kept(PERIOD_S);
        let looked = (0..500).filter_map(|cycle| {
            let t = f64::from(cycle) * PERIOD_S;
            let (driven, push_n) = world(t);
            for (old, new) in acceleration.iter_mut().zip(driven) {
                *old = keep * *old + (1.0 - keep) * new;
            }
            let (sin, cos) = (4.0 * t).sin_cos();
            let shown = Shown {
                acceleration,
                push_n,
                friction_n: [-4.0 * sin, 4.0 * cos],
                slope_n: [0.0; 2],
                speed_m_s: 0.7,
                turn_rad_s: 0.0,
                learnt_kg,
            };
            steady.look(&shown, PERIOD_S).map(|slides| (t, slides.slide))
        });
        looked.collect()
    }

    /// Going round in a circle with 3 m/s²: the wheels push as `pushes` makes of what that takes. When it was first told, s, and how far
    /// its rims were said to have run ahead by 0.5 s, m.
    fn told(pushes: impl Fn(f64, Vector) -> Vector, learnt_kg: f64) -> Option<(f64, f64)> {
        let world = |t: f64| {
            let (sin, cos) = (4.0 * t).sin_cos();
            ([3.0 * cos, 3.0 * sin], pushes(t, [210.0 * cos, 210.0 * sin]))
        };
        let slides = slides(world, learnt_kg);
        let way_m = slides.iter().map(|(_, slide)| slide.step_m).sum();
        slides.first().map(|(first, _)| (*first, way_m))
    }

    #[test]
    fn what_was_missing_before_a_slide_was_told_was_one_too() {
        // 0.25 m/s² of what the least that it weighs takes: a slope could give that. Then 0.6.
        let world = |t: f64| {
            let missing = if t < 0.3 { 0.25 } else { 0.6 };
            ([3.0, 0.0], [0.95 * 66.5 * (3.0 - missing), 0.0])
        };
        let (first_s, slide) = slides(world, 0.0)[0];
        assert!((0.35..0.4).contains(&first_s), "{first_s}");
        // 0.25 m/s² · (0.32 s)²/2 behind the low-passes, and more.
        assert!((0.012..0.03).contains(&slide.step_m), "{slide:?}");
    }

    #[test]
    fn what_slides_does_so_until_the_floor_has_made_up_for_it_or_gives_less() {
        let after = |push_n: f64| {
            let world =
                move |t: f64| if t < 0.3 { ([3.0, 0.0], [140.0, 0.0]) } else { ([0.0; 2], [push_n, 0.0]) };
            let slides = slides(world, 0.0);
            let way_m: f64 = slides.iter().map(|(_, slide)| slide.step_m).sum();
            (slides.last().expect("it slides").0, way_m)
        };
        // 0.3 s of 3 - 2.2 m/s², and what the low-passes are late by, are made up for by 2.2 m/s² in 0.13 s.
        let (last_s, way_m) = after(140.0);
        assert!((0.4..0.45).contains(&last_s), "{last_s}");
        assert!((0.03..0.06).contains(&way_m), "{way_m}");
        // Rims that nothing pushes any more run with the platform, as soon as the low-passes show it.
        assert!(after(0.0).0 < 0.38, "{}", after(0.0).0);
    }

    #[test]
    fn a_circle_on_which_the_floor_gives_too_little_is_a_slide() {
        // Two thirds: 1 m/s² is missing; of the least that it weighs 3 − 140/63.2 = 0.78.
        let (first_s, way_m) = told(|_, [x, y]| [x / 1.5, y / 1.5], 0.0).expect("it slides");
        assert!((0.05..0.1).contains(&first_s), "{first_s}");
        assert!((0.08..0.5 * 1.0 * 0.5 * 0.5).contains(&way_m), "{way_m}");
        // A quarter is missing, by what was learnt alone.
        assert_eq!(told(|_, [x, y]| [0.82 * x, 0.82 * y], 0.0), None);
        assert!(told(|_, [x, y]| [0.75 * x, 0.75 * y], 80.0).is_some());
    }

    #[test]
    fn wheels_that_grip_slide_nowhere() {
        assert_eq!(told(|_, push_n| push_n, 70.0), None);
        // On a slope of 3 %, whichever way; on a steeper one where it is slowed down.
        for by_n in [20.6, -20.6] {
            assert_eq!(told(|_, [x, y]| [x + by_n, y], 70.0), None, "{by_n}");
        }
        assert_eq!(told(|_, [x, y]| [-0.1 * x, -0.1 * y], 70.0), None);
        // Nobody knows what it weighs.
        for along in [3.0, 0.3] {
            let mut steady = Steady::new(0.0);
            let shown = Shown {
                acceleration: [along, 0.0],
                push_n: [2.0, 0.0],
                friction_n: [0.0; 2],
                slope_n: [0.0; 2],
                speed_m_s: 0.7,
                turn_rad_s: 0.0,
                learnt_kg: -20.0,
            };
            assert!((0..500).all(|_| steady.look(&shown, PERIOD_S).is_none()), "{along}");
        }
    }

    /// Whether a platform of 70 kg slides that drives along x at 0.7 m/s with an acceleration along x, on a slope that pulls it with a part
    /// of its weight, and whose wheels push so much less than that takes, m/s².
    fn slides_along(x_m_s2: f64, slope: f64, missing_m_s2: f64) -> bool {
        let mut steady = Steady::new(66.5);
        let slope_n = [slope * 66.5 * GRAVITY_M_S2, 0.0];
        let asked_n = 66.5 * x_m_s2 - slope_n[0];
        let keep = Decay::new(FAST_1_S).kept(PERIOD_S);
        (1..300).any(|cycle| {
            let shown = Shown {
                acceleration: [x_m_s2 * (1.0 - keep.powi(cycle)), 0.0],
                push_n: [0.95 * (asked_n - asked_n.signum() * 66.5 * missing_m_s2), 0.0],
                friction_n: [0.0; 2],
                slope_n,
                speed_m_s: 0.7,
                turn_rad_s: 0.0,
                learnt_kg: 0.0,
            };
            steady.look(&shown, PERIOD_S).is_some()
        })
    }

    #[test]
    fn what_a_slope_that_is_known_asks_of_the_wheels_is_asked_as_well() {
        // Up a slope of 5 % wheels push for 1.1 m/s² as for 1.6 on a level floor, and braking as for 0.6.
        assert!(slides_along(1.1, -0.05, 0.5) && !slides_along(1.1, -0.05, 0.1));
        assert!(slides_along(-1.1, 0.05, 0.5) && !slides_along(-1.1, -0.05, 0.5));
    }

    #[test]
    fn what_is_no_number_is_forgotten() {
        let spoiled = |t: f64, [x, y]: Vector| if t == 0.2 { [f64::NAN, y] } else { [x / 1.5, y / 1.5] };
        let (_, way_m) = told(spoiled, 0.0).expect("it slides");
        assert!(way_m.is_finite());
    }
}
