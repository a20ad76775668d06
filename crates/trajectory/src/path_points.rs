//! Path points: where the platform shall be at given times.
//!
//! A file has one point per line, `(t, x, y, θ)` or `t x y θ`, in s, m and rad, t rising. Empty lines and what
//! follows a `#` don't count. Angles are taken as they are: 6.283 is a whole turn.

use std::f64::consts::TAU;

use omnibase_platform::Pose2;

use crate::trajectory::LONGEST_S;

/// A pose at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathPoint {
    /// The time, in s.
    pub time_s: f64,
    /// The pose; its heading is not wrapped.
    pub odom_from_base: Pose2,
}

/// At least two points, all finite, with rising times.
#[derive(Clone, Debug, PartialEq)]
pub struct PathPoints {
    points: Vec<PathPoint>,
    /// The line of each point, 0 if they don't come from a file.
    lines: Vec<usize>,
}

/// Why a file or list of points was refused; lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathPointsError {
    /// A word that is no number.
    #[error("line {line}, column {column}: expected a number ({what}), found \"{found}\"")]
    NoNumber {
        /// The line.
        line: usize,
        /// The column, in characters.
        column: usize,
        /// Which of the four numbers.
        what: &'static str,
        /// The word.
        found: String,
    },
    /// NaN or infinity.
    #[error("line {line}, column {column}: {what} is {found}, expected a finite number")]
    NotFinite {
        /// The line.
        line: usize,
        /// The column, in characters.
        column: usize,
        /// Which of the four numbers.
        what: &'static str,
        /// The number.
        found: f64,
    },
    /// Not four numbers.
    #[error("line {line}, column {column}: expected 4 numbers (t, x, y, θ), found {found}")]
    NumberCount {
        /// The line.
        line: usize,
        /// The column of the first word too many, or behind the last one.
        column: usize,
        /// How many there are.
        found: usize,
    },
    /// A parenthesis without its partner, or a comma too many.
    #[error(
        "line {line}, column {column}: unexpected \"{found}\"; a point is written (t, x, y, θ) or t x y θ"
    )]
    Punctuation {
        /// The line.
        line: usize,
        /// The column, in characters.
        column: usize,
        /// What stands there.
        found: String,
    },
    /// Time stands still or runs backwards.
    #[error("line {line}, column {column}: times must rise, found {found_s} s after {before_s} s")]
    TimeOrder {
        /// The line, 0 if the points come from no file.
        line: usize,
        /// The column, in characters.
        column: usize,
        /// The time before.
        before_s: f64,
        /// The time found.
        found_s: f64,
    },
    /// A time beyond any use.
    #[error(
        "line {line}, column {column}: expected a time from −{LONGEST_S} s to {LONGEST_S} s, found {found_s} s"
    )]
    TooFar {
        /// The line, 0 if the points come from no file.
        line: usize,
        /// The column, in characters.
        column: usize,
        /// The time found.
        found_s: f64,
    },
    /// Too few points for a motion.
    #[error("{found} points: expected at least 2")]
    TooFew {
        /// How many there are.
        found: usize,
    },
}

const NAMES: [&str; 4] = ["t", "x", "y", "θ"];

impl PathPoints {
    /// The points of a file's text; the first error.
    pub fn parse(text: &str) -> Result<PathPoints, PathPointsError> {
        let mut points: Vec<PathPoint> = Vec::new();
        let mut lines = Vec::new();
        for (at, text) in text.lines().enumerate() {
            let Some((point, column)) = parse_line(text, at + 1)? else { continue };
            check_time(points.last(), &point, at + 1, column)?;
            points.push(point);
            lines.push(at + 1);
        }
        PathPoints::counted(points, lines)
    }

    /// Checks a list of points that comes from no file; errors carry line 0.
    pub fn new(points: Vec<PathPoint>) -> Result<PathPoints, PathPointsError> {
        for (at, point) in points.iter().enumerate() {
            let Pose2 { x_m, y_m, heading_rad } = point.odom_from_base;
            for (what, found) in NAMES.into_iter().zip([point.time_s, x_m, y_m, heading_rad]) {
                if !found.is_finite() {
                    return Err(PathPointsError::NotFinite { line: 0, column: 0, what, found });
                }
            }
            check_time(at.checked_sub(1).map(|before| &points[before]), point, 0, 0)?;
        }
        let lines = vec![0; points.len()];
        PathPoints::counted(points, lines)
    }

    fn counted(points: Vec<PathPoint>, lines: Vec<usize>) -> Result<PathPoints, PathPointsError> {
        match points.len() {
            found @ 0..=1 => Err(PathPointsError::TooFew { found }),
            _ => Ok(PathPoints { points, lines }),
        }
    }

    /// The points.
    pub fn as_slice(&self) -> &[PathPoint] {
        &self.points
    }

    /// The line of a point in its file, if it comes from one.
    pub fn line(&self, point: usize) -> Option<usize> {
        self.lines.get(point).copied().filter(|line| *line > 0)
    }

    /// The times between points, in s.
    pub fn durations_s(&self) -> Vec<f64> {
        self.points.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect()
    }

    /// The same places and times with the first point's heading.
    #[must_use]
    pub fn with_first_heading(mut self) -> PathPoints {
        let heading_rad = self.points[0].odom_from_base.heading_rad;
        self.points.iter_mut().for_each(|point| point.odom_from_base.heading_rad = heading_rad);
        self
    }

    /// The same poses with each time between two points multiplied by its factor.
    ///
    /// Missing factors, and factors that are no positive number, count as 1.
    pub(crate) fn stretched(&self, factors: &[f64]) -> PathPoints {
        let mut points = self.points.clone();
        for at in 1..points.len() {
            let factor = factors.get(at - 1).copied().filter(|factor| *factor > 0.0 && factor.is_finite());
            let duration_s = self.points[at].time_s - self.points[at - 1].time_s;
            points[at].time_s = points[at - 1].time_s + duration_s * factor.unwrap_or(1.0);
        }
        PathPoints { points, lines: self.lines.clone() }
    }
}

/// The angle that differs from `angle_rad` by whole turns and lies nearest to `towards_rad`.
pub fn nearest_turn_rad(angle_rad: f64, towards_rad: f64) -> f64 {
    angle_rad + TAU * ((towards_rad - angle_rad) / TAU).round()
}

fn check_time(
    before: Option<&PathPoint>,
    point: &PathPoint,
    line: usize,
    column: usize,
) -> Result<(), PathPointsError> {
    match before {
        _ if point.time_s.abs() > LONGEST_S => {
            Err(PathPointsError::TooFar { line, column, found_s: point.time_s })
        }
        Some(before) if point.time_s <= before.time_s => {
            Err(PathPointsError::TimeOrder { line, column, before_s: before.time_s, found_s: point.time_s })
        }
        _ => Ok(()),
    }
}

/// One word of a line: a number, or one of the characters `(`, `)` and `,`.
struct Word<'a> {
    column: usize,
    text: &'a str,
}

fn words(text: &str) -> Vec<Word<'_>> {
    let mut words: Vec<Word<'_>> = Vec::new();
    let mut open = false;
    let mut start = 0;
    for (column, (at, character)) in text.char_indices().enumerate() {
        let end = at + character.len_utf8();
        if character.is_whitespace() {
            open = false;
        } else if matches!(character, '(' | ')' | ',') {
            words.push(Word { column: column + 1, text: &text[at..end] });
            open = false;
        } else if open {
            if let Some(word) = words.last_mut() {
                word.text = &text[start..end];
            }
        } else {
            start = at;
            words.push(Word { column: column + 1, text: &text[at..end] });
            open = true;
        }
    }
    words
}

/// The point of a line and the column of its time; `None` for an empty line.
fn parse_line(text: &str, line: usize) -> Result<Option<(PathPoint, usize)>, PathPointsError> {
    let text = text.split('#').next().unwrap_or_default();
    let mut words = words(text);
    if words.is_empty() {
        return Ok(None);
    }
    let punctuation = |word: &Word<'_>| PathPointsError::Punctuation {
        line,
        column: word.column,
        found: word.text.to_string(),
    };
    if words[0].text == "(" {
        let open = words.remove(0);
        match words.pop() {
            Some(close) if close.text == ")" => {}
            _ => return Err(punctuation(&open)),
        }
    }
    let mut numbers = [0.0; 4];
    let mut count = 0;
    let mut time_column = usize::MAX;
    let mut comma_allowed = false;
    for word in &words {
        if word.text == "," && comma_allowed {
            comma_allowed = false;
            continue;
        }
        if matches!(word.text, "(" | ")" | ",") {
            return Err(punctuation(word));
        }
        time_column = time_column.min(word.column);
        // The first word too many is where the error points.
        let Some(number) = numbers.get_mut(count) else {
            let found = words.iter().filter(|word| !matches!(word.text, "," | "(" | ")")).count();
            return Err(PathPointsError::NumberCount { line, column: word.column, found });
        };
        let (what, column) = (NAMES[count], word.column);
        let value: f64 = word.text.parse().map_err(|_| {
            let found = word.text.to_string();
            PathPointsError::NoNumber { line, column, what, found }
        })?;
        if !value.is_finite() {
            return Err(PathPointsError::NotFinite { line, column, what, found: value });
        }
        *number = value;
        count += 1;
        comma_allowed = true;
    }
    if let (false, Some(last)) = (comma_allowed, words.last()) {
        return Err(punctuation(last));
    }
    if count < 4 {
        let column = text.trim_end().chars().count() + 1;
        return Err(PathPointsError::NumberCount { line, column, found: count });
    }
    let [time_s, x_m, y_m, heading_rad] = numbers;
    Ok(Some((PathPoint { time_s, odom_from_base: Pose2::new(x_m, y_m, heading_rad) }, time_column)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "(0,0,0,0)\n(5,2,0,0)\n(10,2,2,0)\n(15,0,2,0)\n(20,0,0,0)\n";

    #[test]
    fn both_ways_of_writing_are_read() {
        let square = PathPoints::parse(SQUARE).unwrap();
        assert_eq!(square.as_slice().len(), 5);
        assert_eq!(square.as_slice()[2].odom_from_base, Pose2::new(2.0, 2.0, 0.0));
        let plain =
            "# the square\n0 0 0 0\n\n5 2 0 0  # first corner\r\n10\t2 2 0\n15, 0, 2, 0\n 20 0 -0.0e3 0";
        let plain = PathPoints::parse(plain).unwrap();
        assert_eq!(plain.as_slice(), square.as_slice());
        assert_eq!(plain.line(1), Some(4));
    }

    #[test]
    fn errors_say_line_and_column() {
        for (text, expected) in [
            ("0 0 0 0\n(5, 2, x1, 0)", "line 2, column 8: expected a number (y), found \"x1\""),
            ("0 0 0 0\n5 2 0", "line 2, column 6: expected 4 numbers (t, x, y, θ), found 3"),
            ("0 0 0 0\n5 2 0 0 7 8", "line 2, column 9: expected 4 numbers (t, x, y, θ), found 6"),
            ("0 0 0 0\n 0 1 0 0", "line 2, column 2: times must rise, found 0 s after 0 s"),
            ("0 0 0 0\n5 NaN 0 0", "line 2, column 3: x is NaN, expected a finite number"),
            ("0 0 0 0\n5 0 0 1e999", "line 2, column 7: θ is inf, expected a finite number"),
            ("(0 0 0 0", "line 1, column 1: unexpected \"(\"; a point is written (t, x, y, θ) or t x y θ"),
            ("0 0 0 0)", "line 1, column 8: unexpected \")\"; a point is written (t, x, y, θ) or t x y θ"),
            ("0,,0 0 0", "line 1, column 3: unexpected \",\"; a point is written (t, x, y, θ) or t x y θ"),
            ("0,0,0,0,", "line 1, column 8: unexpected \",\"; a point is written (t, x, y, θ) or t x y θ"),
            ("()", "line 1, column 3: expected 4 numbers (t, x, y, θ), found 0"),
            ("# θ only\n0 0 0 0", "1 points: expected at least 2"),
            ("", "0 points: expected at least 2"),
        ] {
            assert_eq!(PathPoints::parse(text).unwrap_err().to_string(), expected, "{text:?}");
        }
    }

    #[test]
    fn a_list_is_checked_like_a_file() {
        let point = |time_s| PathPoint { time_s, odom_from_base: Pose2::default() };
        assert!(PathPoints::new(vec![point(0.0), point(1.0)]).is_ok());
        assert!(matches!(
            PathPoints::new(vec![point(1.0), point(1.0)]),
            Err(PathPointsError::TimeOrder { found_s: 1.0, .. })
        ));
        assert!(PathPoints::new(vec![point(0.0), point(f64::NAN)]).is_err());
    }
}
