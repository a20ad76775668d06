//! What reaches a terminal: controls that devices, files and captures hold are shown and don't act.

use omnibase_ethercat_wire::printable::push;
use std::io::{self, Write};

/// Text in which nothing acts on a terminal but ends of lines and tabs.
pub fn shown(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '\n' | '\t' => shown.push(character),
            other => push(&mut shown, other),
        }
    }
    shown
}

/// With so many decimals, and no sign before nothing.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_nothing = text.starts_with('-') && text.chars().all(|one| matches!(one, '-' | '0' | '.'));
    if is_nothing { text[1..].to_owned() } else { text }
}

/// A writer of text for people and programs, in which nothing acts on a terminal but ends of lines and tabs. What is
/// written for these holds in JSON, too.
pub struct Shown<W> {
    inner: W,
    /// The beginning of a character whose end isn't there yet.
    begun: Vec<u8>,
}

impl<W: Write> Shown<W> {
    pub fn new(inner: W) -> Self {
        Shown { inner, begun: Vec::new() }
    }
}

impl<W: Write> Write for Shown<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.begun.extend_from_slice(bytes);
        let whole = match std::str::from_utf8(&self.begun) {
            Ok(text) => text.len(),
            // Cut within a character: the rest of it is to come.
            Err(error) if error.error_len().is_none() => error.valid_up_to(),
            Err(_) => self.begun.len(),
        };
        let text = String::from_utf8_lossy(&self.begun[..whole]);
        self.inner.write_all(shown(&text).as_bytes())?;
        self.begun.drain(..whole);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_shown_and_characters_survive_being_cut() {
        let mut shown = Shown::new(Vec::new());
        let text = "a\x1b[31m\u{9b}2J \u{b5}m \u{1f916}\tb\n";
        for byte in text.as_bytes() {
            shown.write_all(&[*byte]).unwrap();
        }
        assert_eq!(String::from_utf8(shown.inner).unwrap(), "a\\x1b[31m\\u009b2J \u{b5}m \u{1f916}\tb\n");
    }
}
