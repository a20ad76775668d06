//! Reading an image.

use super::*;

impl Image {
    /// Reads an image of at least 128 bytes: what could be read, and what couldn't.
    pub fn parse(_bytes: &[u8]) -> Result<(Self, Vec<Problem>), ImageTooShort> {
        unimplemented!()
    }
}
