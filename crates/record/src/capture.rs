//! Reading captures: pcapng (either byte order) and pcap, of any bytes.

mod pcap;
mod pcapng;

use crate::Direction;
use std::fmt;

/// The link type of Ethernet.
const LINKTYPE_ETHERNET: i32 = 1;

/// A frame of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CapturedFrame<'a> {
    /// Its number, counted from 1 over all packets of the file as Wireshark does.
    pub number: u64,
    /// Nanoseconds since 1970-01-01 UTC; 0 where the file gives none (simple packet blocks).
    pub unix_ns: u64,
    /// Which way it went; `None` where the file doesn't say.
    pub direction: Option<Direction>,
    /// The bytes that were captured.
    pub data: &'a [u8],
    /// The length that it had on the wire; more than `data` where the capture cut it off.
    pub original_length: usize,
}

/// The Ethernet frames of a file, as far as it could be read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Capture<'a> {
    /// The frames in the order of the file.
    pub frames: Vec<CapturedFrame<'a>>,
    /// What couldn't be read.
    pub warnings: Vec<Warning>,
}

/// Something in a capture that couldn't be read, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Byte offset in the file.
    pub offset: usize,
    /// What is wrong and what was done about it.
    pub text: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}: {}", self.offset, self.text)
    }
}

/// Why bytes aren't a capture at all.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CaptureError {
    /// Neither pcapng nor pcap starts like this.
    #[error(
        "not a capture: the file starts with {found}, expected pcapng (0a 0d 0d 0a) or pcap (d4 c3 b2 a1)"
    )]
    NotACapture {
        /// The first bytes, in hexadecimal.
        found: String,
    },
    /// The file's header is cut off or wrong.
    #[error("the header of the {format} file can't be read: {found} bytes, expected at least {expected}")]
    Header {
        /// Format by its first bytes.
        format: &'static str,
        /// Bytes needed.
        expected: usize,
        /// Bytes there.
        found: usize,
    },
}

impl<'a> Capture<'a> {
    /// Reads a whole file; frames are borrowed from it.
    ///
    /// A file that was cut off is read to its last complete record, damaged records are skipped where the next
    /// one can be found; either gives a warning.
    pub fn read(file: &'a [u8]) -> Result<Self, CaptureError> {
        let Some(magic) = file.first_chunk::<4>() else {
            return Err(CaptureError::NotACapture { found: hex(file) });
        };
        match u32::from_le_bytes(*magic) {
            pcapng::MAGIC => pcapng::read(file),
            magic if pcap::MAGICS.contains(&magic) => pcap::read(file),
            _ => Err(CaptureError::NotACapture { found: hex(magic) }),
        }
    }

    fn warn(&mut self, offset: usize, text: String) {
        self.warnings.push(Warning { offset, text });
    }
}

fn hex(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "nothing".to_owned();
    }
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}
