//! Wheels that slide while the motion stays: together they push less than the least that the platform can weigh asks for.
//!
//! Over the floor F = m·a. Where rims show an acceleration for which the lightest that the platform can be would take more force than
//! its wheels give it, they turn without taking it along. It shows in a steady circle, too, where no force changes its size. The
//! least is that of the file's bounds, and of what was learnt: a slide makes it look lighter, never heavier.

use super::sliding::{FAST_1_S, HELD_M_S, LASTING_S, Slide};
use super::{GRAVITY_M_S2, LEAST_N};
use crate::decay::Decay;

/// By which part of what its drives tell a platform's motors may give more.
const MORE_SHARE: f64 = 0.05;
/// A slope that may help, over gravity; and with what a mass that was learnt on it is off.
const SLOPE: f64 = 0.03;
const LEARNT_SLOPE: f64 = 0.05;

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
    /// How fast the rims say that the platform is, m/s.
    pub(super) speed_m_s: f64,
    /// The least that was learnt of its mass, kg.
    pub(super) learnt_kg: f64,
}

/// The watch.
#[derive(Clone, Debug)]
pub(super) struct Steady {
    /// By what the file tells the least mass that its motors' torques may show, kg; 0 where it tells none.
    told_kg: f64,
    fast: Decay,
    push_n: Vector,
    friction_n: Vector,
    /// For how long too little pushes, s, and what that comes to since: a speed over the floor, m/s.
    since_s: f64,
    slides_m_s: f64,
    way_m: f64,
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
        let along = row[0] * self.direction[0] + row[1] * self.direction[1];
        let pushes = along * force_n > 0.0 && force_n.abs() > 0.5 * greatest_n;
        let part = |value: f64| value * along.abs();
        pushes.then(|| Slide {
            ahead_m_s: part(self.slide.ahead_m_s).copysign(force_n),
            step_m: part(self.slide.step_m),
        })
    }
}

impl Steady {
    /// Of a platform that weighs so much at least, kg, as far as anybody tells.
    pub(super) fn new(least_kg: Option<f64>) -> Self {
        Steady {
            told_kg: (1.0 - MORE_SHARE) * least_kg.unwrap_or(0.0),
            fast: Decay::new(FAST_1_S),
            push_n: Vector::default(),
            friction_n: Vector::default(),
            since_s: 0.0,
            slides_m_s: 0.0,
            way_m: 0.0,
        }
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        *self = Steady { told_kg: self.told_kg, fast: self.fast, ..Steady::new(None) };
    }

    /// Whether the platform slides.
    pub(super) fn look(&mut self, shown: &Shown, span_s: f64) -> Option<Slides> {
        let Shown { acceleration, push_n, friction_n, speed_m_s, .. } = shown;
        let learnt_kg = shown.learnt_kg.max(0.0);
        let told = [*push_n, *friction_n];
        if !told.as_flattened().iter().sum::<f64>().is_finite() {
            self.forget();
            return None;
        }
        let keep = self.fast.kept(span_s);
        let olds = [&mut self.push_n, &mut self.friction_n];
        for (old, new) in olds.into_iter().zip(told) {
            *old = std::array::from_fn(|axis| keep * old[axis] + (1.0 - keep) * new[axis]);
        }
        let size = omnibase_platform::length(*acceleration);
        let least_n = |mass_kg: f64, slope: f64| mass_kg * (size - slope * GRAVITY_M_S2);
        let least_n = least_n(self.told_kg, SLOPE).max(least_n(learnt_kg, LEARNT_SLOPE));
        if least_n <= 0.0 || *speed_m_s < HELD_M_S {
            self.since_s = 0.0;
            return None;
        }
        let direction = acceleration.map(|axis| axis / size);
        let along = |force_n: Vector| force_n[0] * direction[0] + force_n[1] * direction[1];
        // Friction that brakes where the wheels brake.
        let helps_n = (-along(self.friction_n)).max(0.0);
        let (push_n, given_n) = (along(self.push_n), along(self.push_n) + helps_n);
        // Who is slowed by wheels while speeding up goes downhill.
        if push_n < LEAST_N || given_n >= least_n {
            self.since_s = 0.0;
            return None;
        }
        let given_m_s2 = given_n / self.told_kg.max(learnt_kg);
        if self.since_s == 0.0 {
            (self.slides_m_s, self.way_m) = (0.0, 0.0);
        }
        self.since_s += span_s;
        self.slides_m_s += span_s * (size - given_m_s2);
        self.way_m += span_s * self.slides_m_s;
        (self.since_s >= LASTING_S).then(|| Slides {
            direction,
            slide: Slide { ahead_m_s: self.slides_m_s, step_m: std::mem::take(&mut self.way_m) },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    /// A platform of 70 kg whose file says 66.5 at least, going round in a circle with 3 m/s²: the wheels push as `pushes` makes of what
    /// that takes. When it was first told, s, and how far its rims were said to have run ahead by 0.5 s, m.
    fn told(pushes: impl Fn(f64, Vector) -> Vector, learnt_kg: f64) -> Option<(f64, f64)> {
        let mut steady = Steady::new(Some(66.5));
        let (mut first, mut way_m, mut acceleration) = (None, 0.0, Vector::default());
        let keep = Decay::new(FAST_1_S).kept(PERIOD_S);
        for cycle in 0..500 {
            let t = f64::from(cycle) * PERIOD_S;
            let (sin, cos) = (4.0 * t).sin_cos();
            for (old, new) in acceleration.iter_mut().zip([3.0 * cos, 3.0 * sin]) {
                *old = keep * *old + (1.0 - keep) * new;
            }
            let shown = Shown {
                acceleration,
                push_n: pushes(t, [210.0 * cos, 210.0 * sin]),
                friction_n: [-4.0 * sin, 4.0 * cos],
                speed_m_s: 0.7,
                learnt_kg,
            };
            if let Some(slides) = steady.look(&shown, PERIOD_S) {
                first.get_or_insert(t);
                way_m += slides.slide.step_m;
            }
        }
        first.map(|first| (first, way_m))
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
            let mut steady = Steady::new(None);
            let shown = Shown {
                acceleration: [along, 0.0],
                push_n: [2.0, 0.0],
                friction_n: [0.0; 2],
                speed_m_s: 0.7,
                learnt_kg: -20.0,
            };
            assert!((0..500).all(|_| steady.look(&shown, PERIOD_S).is_none()), "{along}");
        }
    }

    #[test]
    fn what_is_no_number_is_forgotten() {
        let spoiled = |t: f64, [x, y]: Vector| if t == 0.2 { [f64::NAN, y] } else { [x / 1.5, y / 1.5] };
        let (_, way_m) = told(spoiled, 0.0).expect("it slides");
        assert!(way_m.is_finite());
    }
}
