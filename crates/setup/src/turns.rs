//! Counts of an encoder, from turns that somebody saw.

/// Counts per turn that encoders have: powers of two from 2^10 to 2^24, and lines four times.
pub const COMMON_RESOLUTIONS: [u32; 29] = [
    1 << 10,
    1 << 11,
    1 << 12,
    1 << 13,
    1 << 14,
    1 << 15,
    1 << 16,
    1 << 17,
    1 << 18,
    1 << 19,
    1 << 20,
    1 << 21,
    1 << 22,
    1 << 23,
    1 << 24,
    1000,
    1440,
    2000,
    2500,
    3600,
    4000,
    5000,
    7200,
    8000,
    10_000,
    14_400,
    20_000,
    36_000,
    40_000,
];

/// How far a count by eye may be off.
const SEEN_SHARE: f64 = 0.03;

/// How far it is off where somebody looked badly.
const WORST_SHARE: f64 = 0.3;

/// The common resolution nearest to what was seen, where one is within 3 %.
pub fn likely_resolution(seen_counts: f64) -> Option<u32> {
    let share = |one: u32| (seen_counts / f64::from(one) - 1.0).abs();
    let nearest =
        COMMON_RESOLUTIONS.into_iter().min_by(|one, other| share(*one).total_cmp(&share(*other)))?;
    (share(nearest) <= SEEN_SHARE).then_some(nearest)
}

/// Whether two counts are the same to the eye.
pub(crate) fn is_seen_as(expected_counts: f64, seen_counts: f64) -> bool {
    (seen_counts / expected_counts - 1.0).abs() <= SEEN_SHARE
}

/// Whether counts can't be those of turns that somebody saw, however badly: a digit too many, another gear.
pub(crate) fn contradicts(told_counts: f64, seen_counts: f64) -> bool {
    !(1.0 - WORST_SHARE..=1.0 / (1.0 - WORST_SHARE)).contains(&(seen_counts / told_counts))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_look_contradicts_nothing_and_a_digit_too_many_does() {
        assert!(!contradicts(50_000.0, 62_000.0) && !contradicts(50_000.0, 40_000.0));
        assert!(contradicts(500_000.0, 50_000.0) && contradicts(25_000.0, 50_000.0));
        assert!(contradicts(f64::NAN, 1.0) && contradicts(0.0, 1.0));
    }

    #[test]
    fn what_was_seen_is_a_common_resolution_or_none() {
        assert_eq!(likely_resolution(1_040_000.0), Some(1 << 20));
        assert_eq!(likely_resolution(10_100.0), Some(10_000));
        assert_eq!(likely_resolution(4060.0), Some(1 << 12), "4096 is nearer than 4000");
        assert_eq!(likely_resolution(6100.0), None);
        assert_eq!(likely_resolution(f64::NAN), None);
        assert!(COMMON_RESOLUTIONS.iter().all(|one| likely_resolution(f64::from(*one)) == Some(*one)));
    }
}
