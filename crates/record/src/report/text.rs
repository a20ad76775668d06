//! Words and numbers as the page shows them.

/// `text` so that HTML and SVG show it as it is, in content and in quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Others of these are no characters in HTML.
            control if control.is_control() && !matches!(control, '\n' | '\t') => escaped.push('\u{FFFD}'),
            other => escaped.push(other),
        }
    }
    escaped
}

/// A number with `decimals` and a real minus sign; a dash where it isn't finite.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        // Nothing but zeros is not negative.
        Some(rest) if rest.bytes().all(|byte| matches!(byte, b'0' | b'.')) => rest.to_owned(),
        Some(rest) => format!("\u{2212}{rest}"),
        None => text,
    }
}

/// A number with about three significant digits.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    if size >= 1e6 || (size > 0.0 && size < 1e-4) {
        return format!("{value:.2e}").replace('-', "\u{2212}");
    }
    let decimals = match size {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        size if size >= 0.1 || size == 0.0 => 3,
        size if size >= 0.01 => 4,
        _ => 6,
    };
    fixed(value, decimals)
}

/// A whole number in groups of three.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (position, digit) in digits.char_indices() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            grouped.push('\u{202F}');
        }
        grouped.push(digit);
    }
    grouped
}

/// Whole microseconds, milliseconds or seconds of a time in s.
pub(super) fn duration(seconds: f64) -> String {
    match seconds.abs() {
        size if size < 1e-3 => format!("{} us", significant(seconds * 1e6)),
        size if size < 1.0 => format!("{} ms", significant(seconds * 1e3)),
        _ => format!("{} s", fixed(seconds, 3)),
    }
}

/// A unit in which numbers of some size are easily read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    /// Its name.
    pub(super) name: &'static str,
    /// Numbers are multiplied by this.
    pub(super) factor: f64,
}

impl Unit {
    /// Numbers as they are.
    pub(super) const fn plain(name: &'static str) -> Self {
        Unit { name, factor: 1.0 }
    }

    /// For lengths in m up to `greatest`.
    pub(super) fn length(greatest: f64) -> Self {
        match greatest {
            size if size < 1e-3 => Unit { name: "um", factor: 1e6 },
            size if size < 1.0 => Unit { name: "mm", factor: 1e3 },
            _ => Unit::plain("m"),
        }
    }

    /// For angles in rad up to `greatest`.
    pub(super) fn angle(greatest: f64) -> Self {
        if greatest < 0.1 { Unit { name: "mrad", factor: 1e3 } } else { Unit::plain("rad") }
    }

    /// For times in s up to `greatest`.
    pub(super) fn time(greatest: f64) -> Self {
        match greatest {
            // Most times of a cycle are some us, even where one of them is some ms.
            size if size < 20e-3 => Unit { name: "us", factor: 1e6 },
            size if size < 2.0 => Unit { name: "ms", factor: 1e3 },
            _ => Unit::plain("s"),
        }
    }
}

/// A word in the place of what can't be shown.
pub(super) fn absent(what: &str, why: &str) -> String {
    format!("<p class=\"absent\">{}: {}.</p>\n", escape(what), escape(why))
}
