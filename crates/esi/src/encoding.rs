//! Bytes to text: UTF-8, UTF-16 with its mark, and the western single-byte codes that makers write.

use std::borrow::Cow;

use crate::EsiError;

/// How far a declaration is looked for, bytes.
const DECLARATION: usize = 256;
/// Names of UTF-8 and what it contains. A text that declares UTF-16 and whose declaration can be read as single bytes was
/// converted by somebody who left the name.
const UTF_8: [&str; 5] = ["utf-8", "utf8", "us-ascii", "ascii", "utf-16"];
/// Names of Windows-1252, and of Latin-1, whose texts are read as the former everywhere (WHATWG's table of encodings).
const WESTERN: [&str; 6] = ["iso-8859-1", "iso8859-1", "latin1", "latin-1", "windows-1252", "cp1252"];
/// Windows-1252 from 0x80 to 0x9F; what it leaves free stays a control character.
const FROM_80: [char; 32] = [
    '\u{20AC}', '\u{81}', '\u{201A}', '\u{192}', '\u{201E}', '\u{2026}', '\u{2020}', '\u{2021}', '\u{2C6}',
    '\u{2030}', '\u{160}', '\u{2039}', '\u{152}', '\u{8D}', '\u{17D}', '\u{8F}', '\u{90}', '\u{2018}',
    '\u{2019}', '\u{201C}', '\u{201D}', '\u{2022}', '\u{2013}', '\u{2014}', '\u{2DC}', '\u{2122}', '\u{161}',
    '\u{203A}', '\u{153}', '\u{9D}', '\u{17E}', '\u{178}',
];

/// The text of a document, without the mark at its beginning.
pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, EsiError> {
    match bytes {
        [0xFF, 0xFE, rest @ ..] => return utf_16(rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => return utf_16(rest, u16::from_be_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => return utf_8(rest, 3),
        _ => {}
    }
    let declared = declared(bytes).unwrap_or_else(|| UTF_8[0].to_owned());
    let is = |names: &[&str]| names.iter().any(|name| name.eq_ignore_ascii_case(&declared));
    if is(&UTF_8) {
        utf_8(bytes, 0)
    } else if is(&WESTERN) {
        let letter = |byte: &u8| match byte {
            0x80..=0x9F => FROM_80[usize::from(byte - 0x80)],
            _ => char::from(*byte),
        };
        Ok(bytes.iter().map(letter).collect::<String>().into())
    } else {
        Err(EsiError::Encoding { name: crate::xml::quoted(&declared) })
    }
}

/// The encoding that the document's declaration names.
fn declared(bytes: &[u8]) -> Option<String> {
    let head: String = bytes.iter().take(DECLARATION).map(|byte| char::from(*byte)).collect();
    let (head, _) = head.trim_start().strip_prefix("<?xml")?.split_once("?>")?;
    let (_, value) = head.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    value[1..].split_once(quote).map(|(name, _)| name.trim().to_owned())
}

fn utf_8(bytes: &[u8], mark: usize) -> Result<Cow<'_, str>, EsiError> {
    let text = std::str::from_utf8(bytes);
    Ok(text.map_err(|error| EsiError::NotText { code: "UTF-8", at: mark + error.valid_up_to() })?.into())
}

fn utf_16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<Cow<'static, str>, EsiError> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let wrong = |at| EsiError::NotText { code: "UTF-16", at };
    let mut text = String::with_capacity(bytes.len());
    let mut at = 2;
    for letter in char::decode_utf16(pairs.iter().map(|pair| unit(*pair))) {
        let letter = letter.map_err(|_| wrong(at))?;
        at += 2 * letter.len_utf16();
        text.push(letter);
    }
    if rest.is_empty() { Ok(text.into()) } else { Err(wrong(at)) }
}
