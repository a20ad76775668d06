//! One wheel, and values of all wheels.

use std::ops::{Deref, DerefMut};

/// The largest number of wheels of a platform.
pub const MAX_WHEELS: usize = 8;

/// A driven wheel in base.
#[derive(Clone, Debug, PartialEq)]
pub struct Wheel {
    /// The name by which configuration and reports call it.
    pub name: String,
    /// Where it touches the ground, x and y in m.
    pub position_m: [f64; 2],
    /// The direction in which it rolls when its motor turns positive; any length but zero.
    pub rolling_direction: [f64; 2],
    /// The direction along which it transmits force (the roller's axis); the rolling direction for an omni wheel.
    pub force_direction: [f64; 2],
    /// Its radius, in m.
    pub radius_m: f64,
}

impl Wheel {
    /// The part of its force on the floor that its rim feels, and so its motor: the cosine between rolling and force direction. 1
    /// for an omni wheel, √½ for a mecanum wheel with rollers at 45°.
    pub fn rim_share(&self) -> f64 {
        let ([ux, uy], [ax, ay]) = (self.rolling_direction, self.force_direction);
        ((ux * ax + uy * ay) / (ux.hypot(uy) * ax.hypot(ay))).abs()
    }
}

/// One value per wheel, on the stack, in the order of the layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerWheel<T = f64> {
    values: [T; MAX_WHEELS],
    count: usize,
}

impl<T: Copy + Default> PerWheel<T> {
    /// The values of a slice; `None` if it is longer than [`MAX_WHEELS`].
    pub fn from_slice(values: &[T]) -> Option<PerWheel<T>> {
        (values.len() <= MAX_WHEELS).then(|| PerWheel::from_fn(values.len(), |at| values[at]))
    }

    /// A value for each of `count` wheels (at most [`MAX_WHEELS`] count), from its place.
    pub fn from_fn(count: usize, mut value: impl FnMut(usize) -> T) -> PerWheel<T> {
        let count = count.min(MAX_WHEELS);
        let mut values = [T::default(); MAX_WHEELS];
        for (at, slot) in values.iter_mut().take(count).enumerate() {
            *slot = value(at);
        }
        PerWheel { values, count }
    }

    /// The same function of each value.
    pub fn map<U: Copy + Default>(&self, mut function: impl FnMut(T) -> U) -> PerWheel<U> {
        PerWheel::from_fn(self.count, |at| function(self.values[at]))
    }
}

impl PerWheel<f64> {
    /// All values times one factor, so that none exceeds its limit: the direction of motion is kept.
    ///
    /// Returns the values and the factor, 1 if none was too large. Limits are positive, one per wheel.
    #[must_use]
    pub fn saturated(&self, limits: &PerWheel<f64>) -> (PerWheel<f64>, f64) {
        let factor = self.iter().zip(limits.iter()).fold(1.0_f64, |factor, (value, limit)| {
            let size = value.abs();
            if size > *limit { factor.min(limit / size) } else { factor }
        });
        (self.map(|value| value * factor), factor)
    }
}

impl<T> Deref for PerWheel<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[..self.count]
    }
}

impl<T> DerefMut for PerWheel<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.count]
    }
}

impl<const N: usize> From<[f64; N]> for PerWheel<f64> {
    fn from(values: [f64; N]) -> Self {
        const { assert!(N <= MAX_WHEELS) };
        PerWheel::from_fn(N, |at| values[at])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rim_feels_of_a_rollers_force_what_lies_along_it() {
        let wheel = |force_direction| Wheel {
            name: String::new(),
            position_m: [0.0; 2],
            rolling_direction: [2.0, 0.0],
            force_direction,
            radius_m: 0.1,
        };
        for (force_direction, share) in
            [([3.0, 0.0], 1.0), ([1.0, 1.0], 0.5_f64.sqrt()), ([-1.0, 3.0_f64.sqrt()], 0.5)]
        {
            assert!((wheel(force_direction).rim_share() - share).abs() < 1e-15, "{force_direction:?}");
        }
    }

    #[test]
    fn saturation_scales_the_whole_vector() {
        let (values, factor) = PerWheel::from([1.0, -4.0, 2.0]).saturated(&PerWheel::from([2.0, 2.0, 2.0]));
        assert_eq!(factor, 0.5);
        assert_eq!(values[..], [0.5, -2.0, 1.0]);
        assert_eq!(PerWheel::from([1.0]).saturated(&PerWheel::from([2.0])).1, 1.0);
        assert!(PerWheel::from_slice(&[0.0; MAX_WHEELS + 1]).is_none());
    }
}
