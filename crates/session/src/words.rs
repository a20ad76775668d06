//! The words of an event, without allocation.

use std::fmt::{self, Write};
use std::ops::Deref;

/// Bytes that the words of one event may take.
const MOST_BYTES: usize = 230;

/// The words of an event in a room of their own, so that telling allocates nothing; what is longer is cut.
#[derive(Clone, Copy)]
pub struct Words {
    bytes: [u8; MOST_BYTES],
    length: u8,
}

impl Words {
    /// What `arguments` say.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut words = Words::default();
        // Cut, not failed: an event that is too long still says who it is about.
        let _ = words.write_fmt(arguments);
        words
    }
}

impl Default for Words {
    /// None.
    fn default() -> Self {
        Words { bytes: [0; MOST_BYTES], length: 0 }
    }
}

impl Write for Words {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let start = usize::from(self.length);
        let end = text.floor_char_boundary(MOST_BYTES - start);
        self.bytes[start..start + end].copy_from_slice(&text.as_bytes()[..end]);
        self.length = (start + end) as u8;
        if end == text.len() { Ok(()) } else { Err(fmt::Error) }
    }
}

impl From<&str> for Words {
    fn from(text: &str) -> Self {
        Words::new(format_args!("{text}"))
    }
}

impl Deref for Words {
    type Target = str;

    fn deref(&self) -> &str {
        std::str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self)
    }
}

impl fmt::Debug for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl PartialEq for Words {
    fn eq(&self, other: &Words) -> bool {
        **self == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_are_too_long_are_cut_between_letters() {
        let words = Words::new(format_args!("{}{}", "x".repeat(MOST_BYTES - 1), "ä and more"));
        assert_eq!(words.len(), MOST_BYTES - 1);
        assert_eq!(&*Words::from("short"), "short");
    }
}
