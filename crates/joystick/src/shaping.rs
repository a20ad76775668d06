//! From a raw axis to a part of the greatest speed.

use omnibase_robot::AxisShape;

use crate::description::AxisRange;

/// How one axis is shaped.
///
/// With n = (raw − centre) / half range, held to −1..1 and turned round if the axis is reversed:
/// 1. offset o: x = (n − o) / (1 + o) below o, (n − o) / (1 − o) above, so that both ends stay reachable;
/// 2. dead zone d: y = 0 for |x| ≤ d, else sgn(x)·(|x| − d) / (1 − d): continuous at its edge, 1 at the end;
/// 3. expo e: z = (1 − e)·y + e·y³: odd, rising, with slope 1 − e at rest;
/// 4. gain g: g·z.
///
/// Each step never falls as its argument rises, so neither does the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaping {
    /// 1, or −1 where the axis counts against the wished direction.
    pub sign: f64,
    /// Offset −0.5..0.5, dead zone 0..0.9, gain 0..1, expo 0..1.
    pub shape: AxisShape,
}

impl Shaping {
    /// A raw value as −gain..gain; 0 where the axis has no range.
    pub fn shape(&self, raw: i32, range: AxisRange) -> f64 {
        self.curve(normalise(raw, range))
    }

    /// A normalised value, −1..1, as −gain..gain.
    pub fn curve(&self, normalised: f64) -> f64 {
        let AxisShape { offset, dead_zone, gain, expo } = self.shape;
        let from_rest = self.sign * normalised - offset;
        let centred =
            (from_rest / if from_rest < 0.0 { 1.0 + offset } else { 1.0 - offset }).clamp(-1.0, 1.0);
        let beyond = (centred.abs() - dead_zone).max(0.0) / (1.0 - dead_zone);
        let straight = beyond.copysign(centred);
        let curved = (1.0 - expo) * straight + expo * straight.powi(3);
        // Rest is +0, on either side.
        if curved == 0.0 { 0.0 } else { (gain * curved).clamp(-1.0, 1.0) }
    }
}

/// A raw value as −1..1 about the middle of its range; 0 where the axis has no range.
pub fn normalise(raw: i32, range: AxisRange) -> f64 {
    let (low, high) = (f64::from(range.minimum), f64::from(range.maximum));
    let half = (high - low) / 2.0;
    if half <= 0.0 {
        return 0.0;
    }
    ((f64::from(raw) - (low + high) / 2.0) / half).clamp(-1.0, 1.0)
}
