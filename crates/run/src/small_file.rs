//! Files of a known kind, whose size is known to have an end: one without an end, as a device's, is refused.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// The longest text that a person or a program writes of a robot, a segment or a path, bytes: some millions of points.
pub const TEXT: u64 = 256 << 20;

/// What a text file holds; one of more than [`TEXT`] bytes, or of other bytes than UTF-8, is refused.
pub fn text(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path, TEXT)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(ErrorKind::InvalidData, format!("byte {at}: expected text (UTF-8)"))
    })
}

/// What a file holds; one of more than `most` bytes is refused before it is all in memory.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    let is_too_long = bytes.len() as u64 > most;
    let words = || format!("expected at most {most} bytes, found more");
    if is_too_long { Err(io::Error::new(ErrorKind::FileTooLarge, words())) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_and_one_that_is_no_text_are_refused() {
        assert_eq!(
            read(Path::new("/dev/zero"), 7).unwrap_err().to_string(),
            "expected at most 7 bytes, found more"
        );
        assert_eq!(read(Path::new("/dev/null"), 0).unwrap(), b"");
        let path = std::env::temp_dir().join(format!("omnibase-no-text-{}", std::process::id()));
        std::fs::write(&path, b"ab\xff").unwrap();
        assert_eq!(text(&path).unwrap_err().to_string(), "byte 2: expected text (UTF-8)");
        assert_eq!(read(&path, 3).unwrap(), b"ab\xff");
        std::fs::remove_file(path).unwrap();
    }
}
