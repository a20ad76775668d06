//! PDO maps as text: `6040:16 60FF:32 pad:8 60C1.1:32`.

use std::fmt;
use std::ops::Range;

/// One entry of a PDO: an object, or a gap where the index is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapEntry {
    /// Object index; 0 is a gap.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Length, bits.
    pub bits: u8,
}

/// One PDO and its entries in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoPlan {
    /// 0x16xx (outputs) or 0x1Axx (inputs).
    pub index: u16,
    /// Its entries.
    pub entries: Vec<MapEntry>,
}

/// Why a map's text was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PdoMapError {
    /// Not `index:bits`, `index.subindex:bits` or `pad:bits`.
    #[error("expected `index:bits`, `index.subindex:bits` or `pad:bits`, found `{0}`")]
    Form(String),
    /// Not a hexadecimal object.
    #[error("expected an object in hexadecimal such as `6040` or `60C1.1`, found `{0}`")]
    Object(String),
    /// Not a length.
    #[error("expected a length of 1 to 255 bits (a gap may have 0), found `{0}`")]
    Bits(String),
}

/// Reads an object: `6040`, `0x6040`, `60C1.1`, or with a hexadecimal subindex `60C1:01`.
pub fn parse_object(text: &str) -> Result<(u16, u8), PdoMapError> {
    let wrong = || PdoMapError::Object(text.into());
    let (index, subindex) = text.trim().split_once('.').unwrap_or((text.trim(), "0"));
    let index = index.strip_prefix("0x").or(index.strip_prefix("0X")).unwrap_or(index);
    if let Some((index, subindex)) = index.split_once(':') {
        let index = u16::from_str_radix(index, 16).map_err(|_| wrong())?;
        return Ok((index, u8::from_str_radix(subindex, 16).map_err(|_| wrong())?));
    }
    let index = u16::from_str_radix(index, 16).map_err(|_| wrong())?;
    Ok((index, subindex.parse().map_err(|_| wrong())?))
}

/// Reads a map: entries between white space, in order.
pub fn parse_map(text: &str) -> Result<Vec<MapEntry>, PdoMapError> {
    text.split_whitespace()
        .map(|entry| {
            let (object, bits) = entry.split_once(':').ok_or_else(|| PdoMapError::Form(entry.into()))?;
            let least = u8::from(object != "pad");
            let bits = bits.parse().ok().filter(|bits| *bits >= least);
            let bits = bits.ok_or_else(|| PdoMapError::Bits(entry.into()))?;
            let (index, subindex) = if object == "pad" { (0, 0) } else { parse_object(object)? };
            Ok(MapEntry { index, subindex, bits })
        })
        .collect()
}

impl fmt::Display for MapEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.index, self.subindex) {
            (0, _) => write!(f, "pad:{}", self.bits),
            (index, 0) => write!(f, "{index:04X}:{}", self.bits),
            (index, subindex) => write!(f, "{index:04X}.{subindex}:{}", self.bits),
        }
    }
}

impl PdoPlan {
    /// Sum of the entries' lengths, bits.
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }
}

/// Where an object lies in the process data of a direction, as byte offset and bits; `None` where it isn't mapped.
pub(crate) fn find(pdos: &[PdoPlan], index: u16, subindex: u8) -> Option<(u32, u8)> {
    let mut bit = 0;
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        if (entry.index, entry.subindex) == (index, subindex) {
            return Some((bit, entry.bits));
        }
        bit += u32::from(entry.bits);
    }
    None
}

/// How many bits an object has together with the padding behind it in its PDO; 0 where it isn't mapped.
pub(crate) fn length_with_padding(pdos: &[PdoPlan], index: u16, subindex: u8) -> u32 {
    let is_it = |entry: &MapEntry| (entry.index, entry.subindex) == (index, subindex);
    let with_rest = |pdo: &PdoPlan| {
        let at = pdo.entries.iter().position(is_it)?;
        let padding = pdo.entries[at + 1..].iter().take_while(|entry| entry.index == 0);
        Some(pdo.entries[at..=at].iter().chain(padding).map(|entry| u32::from(entry.bits)).sum())
    };
    pdos.iter().find_map(with_rest).unwrap_or(0)
}

/// Whether padding lies between two bits of the process data, the second excluded.
pub(crate) fn has_padding(pdos: &[PdoPlan], bits: Range<u32>) -> bool {
    let mut at = 0;
    pdos.iter().flat_map(|pdo| &pdo.entries).any(|entry| {
        let begin = at;
        at += u32::from(entry.bits);
        entry.index == 0 && begin < bits.end && bits.start < at
    })
}

/// Whether an object lies whole and at a byte in the process data.
pub(crate) fn is_mapped(pdos: &[PdoPlan], object: u16, bits: u8) -> bool {
    find(pdos, object, 0).is_some_and(|(bit, length)| length == bits && bit % 8 == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_reads_as_it_is_shown() {
        let text = "6040:16 607A:32 pad:8 60C1.1:32";
        let entries = parse_map(text).unwrap();
        assert_eq!(entries[3], MapEntry { index: 0x60C1, subindex: 1, bits: 32 });
        let shown: Vec<String> = entries.iter().map(MapEntry::to_string).collect();
        assert_eq!(shown.join(" "), text);
        let pdos = [PdoPlan { index: 0x1600, entries }];
        assert_eq!(find(&pdos, 0x60C1, 1), Some((56, 32)));
        assert_eq!(find(&pdos, 0x6071, 0), None);
    }

    #[test]
    fn wrong_maps_say_what_was_expected() {
        assert_eq!(parse_map("6040"), Err(PdoMapError::Form("6040".into())));
        assert_eq!(parse_map("zz40:16"), Err(PdoMapError::Object("zz40".into())));
        assert_eq!(parse_map("6040:0"), Err(PdoMapError::Bits("6040:0".into())));
        assert_eq!(parse_map("6040:999"), Err(PdoMapError::Bits("6040:999".into())));
    }
}
