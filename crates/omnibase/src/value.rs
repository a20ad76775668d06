//! Values of objects: CoE data types as text, as JSON, and back to bytes.

use crate::hex;
use serde_json::{Value, json};
use std::fmt;

/// A type of data (ETG.1020, "Data types"), as far as text can be made of it; everything else is bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// Truth value, one byte.
    Bool,
    /// Signed integer of so many bytes.
    Signed(u8),
    /// Unsigned integer of so many bytes.
    Unsigned(u8),
    /// Floating point, 4 bytes.
    Real32,
    /// Floating point, 8 bytes.
    Real64,
    /// Text.
    Text,
    /// Any bytes, in hexadecimal.
    Bytes,
}

/// Text that is no value of a type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueError {
    /// The text.
    pub text: String,
    /// The type that was wanted.
    pub data_type: DataType,
}

impl fmt::Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no value of type {}", self.text, self.data_type)?;
        match self.data_type {
            DataType::Bool => f.write_str(" (true, false, 1 or 0)"),
            DataType::Signed(bytes) => {
                let limit = 1i128 << (8 * u32::from(bytes) - 1);
                write!(f, " ({} to {}, or 0x...)", -limit, limit - 1)
            }
            DataType::Unsigned(bytes) => {
                write!(f, " (0 to {}, or 0x...)", (1u128 << (8 * u32::from(bytes))) - 1)
            }
            DataType::Bytes => f.write_str(" (pairs of hexadecimal digits)"),
            _ => Ok(()),
        }
    }
}

impl std::error::Error for ValueError {}

impl fmt::Display for DataType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DataType::Bool => f.write_str("bool"),
            DataType::Signed(bytes) => write!(f, "i{}", u32::from(*bytes) * 8),
            DataType::Unsigned(bytes) => write!(f, "u{}", u32::from(*bytes) * 8),
            DataType::Real32 => f.write_str("f32"),
            DataType::Real64 => f.write_str("f64"),
            DataType::Text => f.write_str("string"),
            DataType::Bytes => f.write_str("hex"),
        }
    }
}

impl std::str::FromStr for DataType {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = [DataType::Bool, DataType::Real32, DataType::Real64, DataType::Text, DataType::Bytes];
        let sizes = || (1..=8u8).flat_map(|bytes| [DataType::Signed(bytes), DataType::Unsigned(bytes)]);
        names
            .into_iter()
            .chain(sizes())
            .find(|data_type| data_type.to_string() == text)
            .ok_or_else(|| "expected bool, u8 to u64, i8 to i64, f32, f64, string or hex".to_owned())
    }
}

impl DataType {
    /// The type with this CoE number.
    pub fn from_coe(number: u16) -> Self {
        match number {
            0x0001 => DataType::Bool,
            0x0002 => DataType::Signed(1),
            0x0003 => DataType::Signed(2),
            0x0004 => DataType::Signed(4),
            0x0005 | 0x001E | 0x002D | 0x0030..=0x0037 => DataType::Unsigned(1),
            0x0006 | 0x001F | 0x002E => DataType::Unsigned(2),
            0x0007 | 0x0020 | 0x002F => DataType::Unsigned(4),
            0x0008 => DataType::Real32,
            0x0009 => DataType::Text,
            0x0010 => DataType::Signed(3),
            0x0011 => DataType::Real64,
            0x0012 => DataType::Signed(5),
            0x0013 => DataType::Signed(6),
            0x0014 => DataType::Signed(7),
            0x0015 => DataType::Signed(8),
            0x0016 => DataType::Unsigned(3),
            0x0018 => DataType::Unsigned(5),
            0x0019 => DataType::Unsigned(6),
            0x001A => DataType::Unsigned(7),
            0x001B => DataType::Unsigned(8),
            _ => DataType::Bytes,
        }
    }

    /// The value that the bytes are; bytes that don't fit the type are shown as they are.
    pub fn to_json(self, bytes: &[u8]) -> Value {
        let number = |bytes: &[u8]| {
            let mut wide = [0; 8];
            wide[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(wide)
        };
        match self {
            DataType::Bool if bytes.len() == 1 => json!(bytes[0] != 0),
            DataType::Signed(length) if bytes.len() == usize::from(length) => {
                let unused = 64 - 8 * u32::from(length);
                json!((number(bytes) << unused) as i64 >> unused)
            }
            DataType::Unsigned(length) if bytes.len() == usize::from(length) => json!(number(bytes)),
            // Through its digits: 0.1 is no 0.10000000149011612.
            DataType::Real32 if bytes.len() == 4 => real(f32::from_bits(number(bytes) as u32).to_string()),
            DataType::Real64 if bytes.len() == 8 => real(f64::from_bits(number(bytes)).to_string()),
            DataType::Text => match std::str::from_utf8(bytes) {
                Ok(text) => json!(text.trim_end_matches('\0')),
                Err(_) => json!(hex::compact(bytes)),
            },
            _ => json!(hex::compact(bytes)),
        }
    }

    /// The value in words: number and hexadecimal, text, or bytes.
    pub fn to_words(self, bytes: &[u8]) -> String {
        match (self, self.to_json(bytes)) {
            (DataType::Unsigned(length), Value::Number(number)) => {
                let digits = 2 * usize::from(length);
                format!("{number} (0x{:0digits$x})", number.as_u64().unwrap_or_default())
            }
            (DataType::Text, Value::String(text)) if std::str::from_utf8(bytes).is_ok() => {
                format!("{text:?}")
            }
            (DataType::Real32, Value::String(text)) if bytes.len() == 4 => text,
            (DataType::Real64, Value::String(text)) if bytes.len() == 8 => text,
            (_, Value::String(_)) => hex::spaced(bytes, usize::MAX),
            (_, value) => value.to_string(),
        }
    }

    /// The bytes of a value that a user wrote.
    pub fn parse(self, text: &str) -> Result<Vec<u8>, ValueError> {
        self.parse_inner(text).ok_or_else(|| ValueError { text: text.to_owned(), data_type: self })
    }

    fn parse_inner(self, text: &str) -> Option<Vec<u8>> {
        match self {
            DataType::Bool => match text {
                "true" | "1" => Some(vec![1]),
                "false" | "0" => Some(vec![0]),
                _ => None,
            },
            DataType::Signed(length) => {
                let limit = 1i128 << (8 * u32::from(length) - 1);
                // Hexadecimal digits are bits: 0xFFFF is the i16 -1.
                let number = match hexadecimal(text) {
                    Some(bits) if bits >= limit && bits < 2 * limit => bits - 2 * limit,
                    Some(bits) => bits,
                    None => text.parse().ok()?,
                };
                (-limit..limit)
                    .contains(&number)
                    .then(|| number.to_le_bytes()[..usize::from(length)].to_vec())
            }
            DataType::Unsigned(length) => {
                let number = hexadecimal(text).or_else(|| text.parse().ok())?;
                let limit = 1i128 << (8 * u32::from(length));
                (0..limit).contains(&number).then(|| number.to_le_bytes()[..usize::from(length)].to_vec())
            }
            DataType::Real32 => Some(text.parse::<f32>().ok()?.to_le_bytes().to_vec()),
            DataType::Real64 => Some(text.parse::<f64>().ok()?.to_le_bytes().to_vec()),
            DataType::Text => Some(text.as_bytes().to_vec()),
            DataType::Bytes => {
                let digits: Vec<char> =
                    text.strip_prefix("0x").unwrap_or(text).chars().filter(|c| !c.is_whitespace()).collect();
                if digits.is_empty() || !digits.len().is_multiple_of(2) {
                    return None;
                }
                digits
                    .chunks(2)
                    .map(|pair| Some((pair[0].to_digit(16)? << 4 | pair[1].to_digit(16)?) as u8))
                    .collect()
            }
        }
    }
}

/// A number by its digits; `NaN`, `inf` and `-inf`, which JSON has no numbers for, as text.
fn real(digits: String) -> Value {
    match digits.parse::<f64>() {
        Ok(number) if number.is_finite() => json!(number),
        _ => json!(digits),
    }
}

/// A number of 32 bits, decimal or hexadecimal behind `0x`.
pub fn number(text: &str) -> Option<u32> {
    hexadecimal(text).map_or_else(|| text.parse().ok(), |number| u32::try_from(number).ok())
}

fn hexadecimal(text: &str) -> Option<i128> {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"))?;
    // i128 would take a sign here.
    i128::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with(['+', '-']))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_shown_again() {
        let cases = [
            ("u8", "255", vec![0xFF], json!(255)),
            ("u16", "0x1234", vec![0x34, 0x12], json!(0x1234)),
            ("u24", "1", vec![1, 0, 0], json!(1)),
            ("i24", "-2", vec![0xFE, 0xFF, 0xFF], json!(-2)),
            ("i16", "0xFFFF", vec![0xFF, 0xFF], json!(-1)),
            ("i64", "-9223372036854775808", vec![0, 0, 0, 0, 0, 0, 0, 0x80], json!(i64::MIN)),
            ("u64", "18446744073709551615", vec![0xFF; 8], json!(u64::MAX)),
            ("f32", "1.5", vec![0, 0, 0xC0, 0x3F], json!(1.5)),
            ("bool", "true", vec![1], json!(true)),
            ("string", "AB", vec![0x41, 0x42], json!("AB")),
            ("hex", "0a 0B", vec![0x0A, 0x0B], json!("0a0b")),
        ];
        for (name, text, bytes, shown) in cases {
            let data_type: DataType = name.parse().unwrap();
            assert_eq!(data_type.parse(text), Ok(bytes.clone()), "{name}");
            assert_eq!(data_type.to_json(&bytes), shown, "{name}");
        }
    }

    #[test]
    fn values_outside_of_their_type_are_refused_with_its_bounds() {
        let refused = [
            ("u8", "256"),
            ("u8", "-1"),
            ("i8", "128"),
            ("i8", "0x100"),
            ("u16", "0x-1"),
            ("hex", "abc"),
            ("hex", ""),
            ("bool", "2"),
            ("f32", "x"),
        ];
        for (name, text) in refused {
            assert!(name.parse::<DataType>().unwrap().parse(text).is_err(), "{name} {text}");
        }
        let error = DataType::Signed(1).parse("128").unwrap_err();
        assert_eq!(error.to_string(), "`128` is no value of type i8 (-128 to 127, or 0x...)");
        assert!("u65".parse::<DataType>().is_err());
    }

    /// No number isn't told as none that can be read, and a short one isn't made longer.
    #[test]
    fn real_numbers_are_what_they_are() {
        let shown = |bytes: &[u8]| (DataType::Real32.to_json(bytes), DataType::Real32.to_words(bytes));
        assert_eq!(shown(&0.1f32.to_le_bytes()), (json!(0.1), "0.1".to_owned()));
        for (number, words) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (f32::NEG_INFINITY, "-inf")] {
            assert_eq!(shown(&number.to_le_bytes()), (json!(words), words.to_owned()));
        }
        assert_eq!(DataType::Real64.to_json(&f64::MAX.to_le_bytes()), json!(f64::MAX));
        assert_eq!(DataType::Real64.to_words(&f64::NAN.to_le_bytes()), "NaN");
    }

    #[test]
    fn bytes_that_do_not_fit_their_type_are_shown_as_bytes() {
        assert_eq!(DataType::Unsigned(2).to_json(&[1]), json!("01"));
        assert_eq!(DataType::Unsigned(2).to_words(&[1]), "01");
        assert_eq!(DataType::Unsigned(2).to_words(&[1, 0]), "1 (0x0001)");
        assert_eq!(DataType::Text.to_words(b"AB\0\0"), "\"AB\"");
        assert_eq!(DataType::Text.to_json(b"G\xf6"), json!("47f6"));
        assert_eq!(DataType::Text.to_words(b"G\xf6"), "47 f6");
        assert_eq!(DataType::Real32.to_words(&[0]), "00");
        assert_eq!(DataType::from_coe(0x0007), DataType::Unsigned(4));
        assert_eq!(DataType::from_coe(0x4711), DataType::Bytes);
    }
}
