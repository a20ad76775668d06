//! Text of devices and files as a terminal may have it.

use alloc::string::String;
use core::fmt::Write;

/// Whether a character would do something to a terminal instead of being shown: controls, and what turns the
/// direction of writing.
pub fn is_control(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}' | '\u{2066}'..='\u{2069}')
}

/// Bytes that somebody else wrote, as one line of text: bad bytes replaced, controls as `\x1b` or `\u009b`.
pub fn printable(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len());
    for character in String::from_utf8_lossy(bytes).chars() {
        push(&mut text, character);
    }
    text
}

/// Appends a character, or what stands for it.
pub fn push(text: &mut String, character: char) {
    // Writing into a string doesn't fail.
    let _ = match u32::from(character) {
        code if !is_control(character) => {
            let _ = code;
            text.write_char(character)
        }
        code @ 0..0x20 => write!(text, "\\x{code:02x}"),
        code => write!(text, "\\u{code:04x}"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_acts_on_a_terminal_is_left() {
        assert_eq!(printable(b"SGDV-OCA01A \xC2\xB5m"), "SGDV-OCA01A \u{b5}m");
        assert_eq!(printable(b"\x1b]0;owned\x07\x1b[2J\n"), "\\x1b]0;owned\\x07\\x1b[2J\\x0a");
        assert_eq!(printable("\u{9b}31m\u{7f}\u{202e}".as_bytes()), "\\u009b31m\\u007f\\u202e");
        assert_eq!(printable(&[0xFF, 0x9B]), "\u{fffd}\u{fffd}");
        for character in printable(&Vec::from_iter(0..=255u8)).chars() {
            assert!(!is_control(character), "{character:?}");
        }
    }
}
