//! Images of maps: PGM, plain (P2) and raw (P5), and PNG.

use super::MOST_CELLS;

/// A pixel: the mean of its colours, and how opaque it is, 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pixel {
    /// 0 is black.
    pub grey: u8,
    /// 0 can't be seen.
    pub alpha: u8,
}

impl Pixel {
    /// Whether something shines through.
    pub(super) fn is_transparent(self) -> bool {
        self.alpha < u8::MAX
    }
}

/// A picture, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// All of them.
    pub pixels: Vec<Pixel>,
}

/// Why an image was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImageError {
    /// Another kind of file.
    #[error("expected a PGM file (P2 or P5) or a PNG file, found a file that begins with {found}")]
    Kind {
        /// How it begins.
        found: String,
    },
    /// A number of a PGM file.
    #[error("byte {at}: {what}: expected {expected}, found {found}")]
    Number {
        /// Where in the file, from 0.
        at: usize,
        /// Which number.
        what: &'static str,
        /// What it may be.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// Too few pixels.
    #[error("expected {expected} pixels of {width} by {height}, found {found}")]
    Short {
        /// How many there should be.
        expected: usize,
        /// In a row.
        width: usize,
        /// Rows.
        height: usize,
        /// How many there are.
        found: usize,
    },
    /// Too many pixels.
    #[error("expected 1 to {MOST_CELLS} pixels, found {width} by {height}")]
    Size {
        /// In a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A PNG file that can't be read.
    #[error("PNG: {0}")]
    Png(String),
}

impl Image {
    /// From a file's bytes.
    pub fn read(bytes: &[u8]) -> Result<Image, ImageError> {
        match bytes {
            [b'P', b'2' | b'5', ..] => Pgm { bytes, at: 2 }.read(),
            [0x89, b'P', b'N', b'G', ..] => png_image(bytes),
            _ => {
                let begin = &bytes[..bytes.len().min(4)];
                let found =
                    if begin.is_empty() { "nothing".into() } else { format!("\"{}\"", begin.escape_ascii()) };
                Err(ImageError::Kind { found })
            }
        }
    }
}

/// The count of pixels, where it is one that a map may have.
fn count(width: usize, height: usize) -> Result<usize, ImageError> {
    let count = width.checked_mul(height).filter(|count| (1..=MOST_CELLS).contains(count));
    count.ok_or(ImageError::Size { width, height })
}

struct Pgm<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Pgm<'_> {
    fn read(mut self) -> Result<Image, ImageError> {
        let is_plain = self.bytes[1] == b'2';
        let width = self.number("width", 1..=MOST_CELLS)?;
        let height = self.number("height", 1..=MOST_CELLS)?;
        let count = count(width, height)?;
        let greatest = self.number("greatest grey", 1..=65_535)?;
        let grey = |value: usize| Pixel { grey: (value * 255 / greatest) as u8, alpha: u8::MAX };
        let short = |found| ImageError::Short { expected: count, width, height, found };
        let mut pixels = Vec::new();
        if is_plain {
            for found in 0..count {
                self.skip_space();
                if self.at == self.bytes.len() {
                    return Err(short(found));
                }
                pixels.push(grey(self.number("grey", 0..=greatest)?));
            }
        } else {
            let size = if greatest > 255 { 2 } else { 1 };
            // One white space ends the header.
            let raw = self.bytes.get(self.at + 1..).unwrap_or_default();
            if raw.len() / size < count {
                return Err(short(raw.len() / size));
            }
            for (number, pixel) in raw.chunks_exact(size).take(count).enumerate() {
                let value = pixel.iter().fold(0, |value, byte| value * 256 + usize::from(*byte));
                if value > greatest {
                    let at = self.at + 1 + number * size;
                    let (expected, found) = (format!("0 to {greatest}"), value.to_string());
                    return Err(ImageError::Number { at, what: "grey", expected, found });
                }
                pixels.push(grey(value));
            }
        }
        Ok(Image { width, height, pixels })
    }

    fn skip_space(&mut self) {
        while let Some(byte) = self.bytes.get(self.at) {
            if *byte == b'#' {
                self.at += self.bytes[self.at..].iter().take_while(|byte| **byte != b'\n').count();
            } else if byte.is_ascii_whitespace() {
                self.at += 1;
            } else {
                break;
            }
        }
    }

    fn number(
        &mut self,
        what: &'static str,
        range: std::ops::RangeInclusive<usize>,
    ) -> Result<usize, ImageError> {
        self.skip_space();
        let at = self.at;
        let word: Vec<u8> = self.bytes[at..]
            .iter()
            .copied()
            .take_while(|byte| !byte.is_ascii_whitespace())
            .take(20)
            .collect();
        self.at += word.len();
        let text = String::from_utf8_lossy(&word).into_owned();
        let number: Option<usize> = text.parse().ok().filter(|number| range.contains(number));
        number.ok_or_else(|| {
            let found = if text.is_empty() { "the end of the file".into() } else { format!("{text:?}") };
            let expected = format!("{} to {}", range.start(), range.end());
            ImageError::Number { at, what, expected, found }
        })
    }
}

fn png_image(bytes: &[u8]) -> Result<Image, ImageError> {
    let wrong = |error: png::DecodingError| ImageError::Png(error.to_string());
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(wrong)?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    let count = count(width, height)?;
    let size = reader.output_buffer_size().ok_or(ImageError::Size { width, height })?;
    let mut buffer = vec![0; size];
    let frame = reader.next_frame(&mut buffer).map_err(wrong)?;
    let samples = frame.color_type.samples();
    let has_alpha = matches!(frame.color_type, png::ColorType::GrayscaleAlpha | png::ColorType::Rgba);
    let pixels: Vec<Pixel> = buffer
        .chunks_exact(samples)
        .take(count)
        .map(|pixel| {
            let (colours, alpha) = match pixel.split_last() {
                Some((alpha, colours)) if has_alpha => (colours, *alpha),
                _ => (pixel, u8::MAX),
            };
            let sum: u32 = colours.iter().map(|colour| u32::from(*colour)).sum();
            Pixel { grey: (sum / colours.len().max(1) as u32) as u8, alpha }
        })
        .collect();
    if pixels.len() < count {
        return Err(ImageError::Short { expected: count, width, height, found: pixels.len() });
    }
    Ok(Image { width, height, pixels })
}
