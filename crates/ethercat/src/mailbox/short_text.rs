//! The beginning of what a SubDevice said, in an error that can be copied.

use alloc::string::String;
use core::fmt;

/// A few bytes of text that can be copied.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ShortText {
    bytes: [u8; ShortText::LONGEST],
    length: u8,
}

impl ShortText {
    /// The most bytes.
    pub const LONGEST: usize = 23;

    /// As much of `text` as there is room for.
    pub fn beginning(text: &[u8]) -> Self {
        let length = text.len().min(Self::LONGEST);
        let mut bytes = [0; Self::LONGEST];
        bytes[..length].copy_from_slice(&text[..length]);
        ShortText { bytes, length: length as u8 }
    }

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length).min(Self::LONGEST)]
    }
}

impl fmt::Display for ShortText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(self.bytes()))
    }
}

impl fmt::Debug for ShortText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&String::from_utf8_lossy(self.bytes()), f)
    }
}
