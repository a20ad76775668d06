//! How recordings call a signal: its name with its unit.

/// A name with its unit, in letters, digits and underscores.
pub fn column_name(name: &str, unit: &str) -> String {
    let unit = match unit {
        "" | "rad/s or N·m" => return name.to_owned(),
        "m/s" => "m_s",
        "m/s²" => "m_s2",
        "rad/s" => "rad_s",
        "rad/s²" => "rad_s2",
        "N·m" => "nm",
        "N" => "n",
        "m²" => "m2",
        "rad²" => "rad2",
        "m·rad" => "m_rad",
        "kg·m²" => "kg_m2",
        "%" => "percent",
        other => return format!("{name}_{}", plain(other)),
    };
    format!("{name}_{unit}")
}

/// A unit in small letters, digits and underscores.
fn plain(unit: &str) -> String {
    let letters = unit.chars().map(|letter| match letter {
        '°' => "deg".to_owned(),
        'µ' | 'μ' => "u".to_owned(),
        'Ω' => "ohm".to_owned(),
        '²' => "2".to_owned(),
        '³' => "3".to_owned(),
        letter if letter.is_ascii_alphanumeric() => letter.to_ascii_lowercase().to_string(),
        _ => "_".to_owned(),
    });
    letters.collect()
}
