//! Writing an image.

use super::*;

impl Image {
    /// The image's bytes, padded with 0xFF to the size that its header announces.
    pub fn emit(&self) -> Vec<u8> {
        unimplemented!()
    }
}
