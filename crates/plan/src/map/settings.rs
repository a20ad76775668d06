//! The YAML file of a map: flat keys, as ROS's map_server writes them.

use super::Cell;
use super::image::Pixel;

/// What grey means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Occupied, free, or unknown between.
    #[default]
    Trinary,
    /// Between the thresholds the occupancy grows with the grey; what is transparent is unknown.
    Scale,
    /// The pixel itself is the occupancy in percent; above 100 it is unknown.
    Raw,
}

/// A map's settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The image's file.
    pub image: String,
    /// The side of a pixel, m.
    pub resolution_m: f64,
    /// The pose of the lower left corner: x m, y m, yaw rad.
    pub origin: [f64; 3],
    /// From this share of black on a cell is occupied.
    pub occupied_thresh: f64,
    /// Below this share it is free.
    pub free_thresh: f64,
    /// Whether white is occupied.
    pub negate: Negate,
    /// What grey means.
    pub mode: Mode,
}

/// Which end of the grey is occupied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Negate {
    /// Black.
    #[default]
    BlackIsOccupied,
    /// White.
    WhiteIsOccupied,
}

/// Why a map's settings were refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A key without a value that can be used.
    #[error("line {line}: {key}: expected {expected}, found `{found}`")]
    Value {
        /// The line, from 1.
        line: usize,
        /// The key.
        key: String,
        /// What it may be.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A line without a key.
    #[error("line {line}: expected `key: value`, found `{found}`")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What stands there.
        found: String,
    },
    /// A key that no map has.
    #[error("line {line}: no key of a map is called `{key}`: there are {known}")]
    Unknown {
        /// The line, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Those that there are.
        known: String,
    },
    /// A key twice.
    #[error("line {line}: {key} stands there twice")]
    Twice {
        /// The line, from 1.
        line: usize,
        /// The key.
        key: String,
    },
    /// A key that must be there.
    #[error("{key} is missing: expected `{key}: {example}`")]
    Missing {
        /// The key.
        key: &'static str,
        /// As it may be.
        example: &'static str,
    },
    /// Thresholds the wrong way round.
    #[error("free_thresh {free} is above occupied_thresh {occupied}")]
    Thresholds {
        /// The one.
        free: f64,
        /// The other.
        occupied: f64,
    },
}

const KEYS: [&str; 7] = ["image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate", "mode"];
/// As map_server assumes them.
const OCCUPIED_THRESH: f64 = 0.65;
const FREE_THRESH: f64 = 0.25;

/// A line's key and value.
struct Line<'a> {
    number: usize,
    key: &'a str,
    value: String,
}

impl Line<'_> {
    fn refused(&self, expected: &'static str) -> SettingsError {
        let (line, key, found) = (self.number, self.key.to_owned(), self.value.clone());
        SettingsError::Value { line, key, expected, found }
    }

    fn number(&self, text: &str, expected: &'static str) -> Result<f64, SettingsError> {
        let number: Option<f64> = text.trim().parse().ok();
        number.filter(|number| number.is_finite()).ok_or_else(|| self.refused(expected))
    }

    fn share(&self) -> Result<f64, SettingsError> {
        let expected = "a number from 0 to 1";
        let number = self.number(&self.value, expected)?;
        if (0.0..=1.0).contains(&number) { Ok(number) } else { Err(self.refused(expected)) }
    }

    fn origin(&self) -> Result<[f64; 3], SettingsError> {
        let expected = "[x, y, yaw] in m and rad";
        let inner = self.value.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let inner = inner.ok_or_else(|| self.refused(expected))?;
        let numbers: Vec<f64> =
            inner.split(',').map(|part| self.number(part, expected)).collect::<Result<_, _>>()?;
        numbers.try_into().map_err(|_| self.refused(expected))
    }

    fn negate(&self) -> Result<Negate, SettingsError> {
        match self.value.to_ascii_lowercase().as_str() {
            "0" | "false" => Ok(Negate::BlackIsOccupied),
            "1" | "true" => Ok(Negate::WhiteIsOccupied),
            _ => Err(self.refused("0, 1, true or false")),
        }
    }

    fn mode(&self) -> Result<Mode, SettingsError> {
        match self.value.as_str() {
            "trinary" => Ok(Mode::Trinary),
            "scale" => Ok(Mode::Scale),
            "raw" => Ok(Mode::Raw),
            _ => Err(self.refused("trinary, scale or raw")),
        }
    }
}

/// A value without its comment and quotes.
fn bare(text: &str) -> String {
    let text = text.trim();
    for quote in ['"', '\''] {
        if let Some((inside, _)) = text.strip_prefix(quote).and_then(|rest| rest.split_once(quote)) {
            return inside.to_owned();
        }
    }
    let end = [" #", "\t#"].iter().filter_map(|comment| text.find(comment)).min().unwrap_or(text.len());
    text[..end].trim().to_owned()
}

/// Lines as they count: a list may be written below its key, one `- value` a line.
fn lines(text: &str) -> Result<Vec<Line<'_>>, SettingsError> {
    let mut found: Vec<Line<'_>> = Vec::new();
    // What editors put before a text, to say how it is encoded.
    for (at, written) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let (number, line) = (at + 1, written.trim_end());
        if line.trim_start().is_empty() || line.trim_start().starts_with('#') || line == "---" {
            continue;
        }
        if let (Some(item), Some(last)) = (line.trim_start().strip_prefix("- "), found.last_mut()) {
            let before = last.value.trim_end_matches(']').to_owned();
            last.value = if before.is_empty() {
                format!("[{}]", bare(item))
            } else {
                format!("{before},{}]", bare(item))
            };
            continue;
        }
        let Some((key, value)) = line.split_once(':') else {
            return Err(SettingsError::Line { line: number, found: line.trim().chars().take(60).collect() });
        };
        let key = key.trim();
        if !KEYS.contains(&key) {
            return Err(SettingsError::Unknown { line: number, key: key.into(), known: KEYS.join(", ") });
        }
        if found.iter().any(|line| line.key == key) {
            return Err(SettingsError::Twice { line: number, key: key.into() });
        }
        found.push(Line { number, key, value: bare(value) });
    }
    Ok(found)
}

impl Settings {
    /// From a YAML file's text.
    pub fn parse(text: &str) -> Result<Settings, SettingsError> {
        let lines = lines(text)?;
        let line = |key: &str| lines.iter().find(|line| line.key == key);
        let missing = |key, example| SettingsError::Missing { key, example };
        let image = line("image").ok_or_else(|| missing("image", "map.pgm"))?;
        if image.value.is_empty() {
            return Err(image.refused("the name of a PGM or PNG file"));
        }
        let resolution = line("resolution").ok_or_else(|| missing("resolution", "0.05"))?;
        let resolution_m = resolution.number(&resolution.value, "the side of a pixel in m, as 0.05")?;
        let origin = line("origin").ok_or_else(|| missing("origin", "[0.0, 0.0, 0.0]"))?.origin()?;
        let share = |key, default| line(key).map_or(Ok(default), Line::share);
        let occupied_thresh = share("occupied_thresh", OCCUPIED_THRESH)?;
        let free_thresh = share("free_thresh", FREE_THRESH)?;
        if free_thresh > occupied_thresh {
            return Err(SettingsError::Thresholds { free: free_thresh, occupied: occupied_thresh });
        }
        let negate = line("negate").map_or(Ok(Negate::default()), Line::negate)?;
        let mode = line("mode").map_or(Ok(Mode::default()), Line::mode)?;
        let image = image.value.clone();
        Ok(Settings { image, resolution_m, origin, occupied_thresh, free_thresh, negate, mode })
    }

    /// What a pixel says, as map_server reads it.
    pub fn cell(&self, pixel: Pixel) -> Cell {
        let shade = f64::from(pixel.grey) / 255.0;
        let occupied = match self.negate {
            Negate::BlackIsOccupied => 1.0 - shade,
            Negate::WhiteIsOccupied => shade,
        };
        let thresholds = |between: Cell| {
            if occupied > self.occupied_thresh {
                Cell::Occupancy(100)
            } else if occupied < self.free_thresh {
                Cell::Occupancy(0)
            } else {
                between
            }
        };
        match self.mode {
            Mode::Trinary => thresholds(Cell::Unknown),
            Mode::Scale if pixel.is_transparent() => Cell::Unknown,
            Mode::Scale => {
                let range = (self.occupied_thresh - self.free_thresh).max(f64::MIN_POSITIVE);
                thresholds(Cell::Occupancy(((occupied - self.free_thresh) / range * 100.0).round() as u8))
            }
            Mode::Raw if pixel.grey <= 100 => Cell::Occupancy(pixel.grey),
            Mode::Raw => Cell::Unknown,
        }
    }
}
