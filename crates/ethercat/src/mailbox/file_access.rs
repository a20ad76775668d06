//! A file as a request names it.

use alloc::string::String;
use core::fmt;

/// A few bytes of text that can be copied: a file's name, or the beginning of what a SubDevice said.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ShortText {
    bytes: [u8; ShortText::LONGEST],
    length: u8,
}

impl ShortText {
    /// The most bytes.
    pub const LONGEST: usize = 23;

    /// The whole of `text`; `None` where it is too long.
    pub fn new(text: &str) -> Option<Self> {
        (text.len() <= Self::LONGEST).then(|| Self::beginning(text.as_bytes()))
    }

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

/// Which file, and by what right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAccess {
    /// The file's name as the SubDevice knows it.
    pub name: ShortText,
    /// Its password; 0 where it has none.
    pub password: u32,
}
