//! Units at the end of a key's name.

/// Units that a key may end in, longest first where one ends in another.
const UNITS: [&str; 44] = [
    "n_m_s_rad",
    "kg_s2_m2",
    "kg_m2_s2",
    "rad_s3",
    "rad_s2",
    "deg_s2",
    "kg_m2",
    "kg_cm2",
    "mm_s2",
    "n_s_m",
    "m_s3",
    "m_s2",
    "mm_s",
    "cm_s",
    "km_h",
    "rad_s",
    "deg_s",
    "m_s",
    "rpm",
    "n_m",
    "1_s",
    "rad",
    "deg",
    "mnm",
    "ncm",
    "min",
    "hz",
    "khz",
    "us",
    "ms",
    "ns",
    "mm",
    "cm",
    "km",
    "um",
    "kg",
    "lb",
    "nm",
    "in",
    "s",
    "m",
    "g",
    "n",
    "h",
];

/// A key without its unit, and the unit.
pub(crate) fn split(key: &str) -> (&str, Option<&'static str>) {
    UNITS
        .iter()
        .filter_map(|unit| Some((key.strip_suffix(unit)?.strip_suffix('_')?, Some(*unit))))
        .min_by_key(|(stem, _)| stem.len())
        .unwrap_or((key, None))
}

#[cfg(test)]
mod tests {
    use super::split;

    #[test]
    fn the_longest_unit_counts() {
        assert_eq!(split("wheel_radius_m"), ("wheel_radius", Some("m")));
        assert_eq!(split("jerk_m_s3"), ("jerk", Some("m_s3")));
        assert_eq!(split("damping_n_s_m"), ("damping", Some("n_s_m")));
        assert_eq!(split("cycle"), ("cycle", None));
        assert_eq!(split("m"), ("m", None));
    }
}
