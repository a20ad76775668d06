//! Writing pcapng (draft-ietf-opsawg-pcapng).
//!
//! ```text
//! section header | interface description (Ethernet, nanoseconds) | enhanced packet | enhanced packet | ...
//! block: | type 4 | length 4 | body, padded to 4 | length 4 |
//! ```

use crate::{Direction, FrameSink};
use std::io::{self, Write};

const SECTION_HEADER: u32 = 0x0A0D_0D0A;
const INTERFACE_DESCRIPTION: u32 = 1;
const ENHANCED_PACKET: u32 = 6;
const BYTE_ORDER_MAGIC: u32 = 0x1A2B_3C4D;
const LINKTYPE_ETHERNET: u16 = 1;
const OPTION_END: u16 = 0;
const OPTION_INTERFACE_NAME: u16 = 2;
const OPTION_TIME_RESOLUTION: u16 = 9;
const OPTION_PACKET_FLAGS: u16 = 2;
const OPTION_USER_APPLICATION: u16 = 4;

/// Writes frames of one interface as pcapng.
///
/// Nothing is buffered or allocated per frame beyond what `W` does: wrap files in a `BufWriter`.
#[derive(Debug)]
pub struct PcapngWriter<W: Write> {
    output: W,
}

impl<W: Write> PcapngWriter<W> {
    /// Starts a recording of the interface called `interface`.
    pub fn new(mut output: W, interface: &str) -> io::Result<Self> {
        let mut options = Vec::new();
        push_option(&mut options, OPTION_USER_APPLICATION, b"omnibase");
        push_option(&mut options, OPTION_END, &[]);
        let mut body = Vec::new();
        body.extend(BYTE_ORDER_MAGIC.to_le_bytes());
        body.extend(1u16.to_le_bytes());
        body.extend(0u16.to_le_bytes());
        // Length of the section: not known ahead.
        body.extend((-1i64).to_le_bytes());
        body.extend(options);
        write_block(&mut output, SECTION_HEADER, &body)?;

        let mut body = Vec::new();
        body.extend(LINKTYPE_ETHERNET.to_le_bytes());
        body.extend(0u16.to_le_bytes());
        // Snapshot length: no limit.
        body.extend(0u32.to_le_bytes());
        // An option's length has 16 bits; interface names have 15 bytes, paths of segments some more.
        let name = &interface.as_bytes()[..interface.len().min(1024)];
        push_option(&mut body, OPTION_INTERFACE_NAME, name);
        push_option(&mut body, OPTION_TIME_RESOLUTION, &[9]);
        push_option(&mut body, OPTION_END, &[]);
        write_block(&mut output, INTERFACE_DESCRIPTION, &body)?;
        Ok(PcapngWriter { output })
    }

    /// Writes one frame with the time in nanoseconds since 1970-01-01 UTC.
    pub fn write(&mut self, unix_ns: u64, direction: Direction, frame: &[u8]) -> io::Result<()> {
        const OPTIONS: usize = 12;
        let padding = frame.len().wrapping_neg() % 4;
        let length = u32::try_from(32 + frame.len() + padding + OPTIONS)
            .map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "frame too long for a pcapng block"))?;
        let frame_length = frame.len() as u32;
        let header = [
            ENHANCED_PACKET,
            length,
            0, // interface
            (unix_ns >> 32) as u32,
            unix_ns as u32,
            frame_length,
            frame_length,
        ];
        for word in header {
            self.output.write_all(&word.to_le_bytes())?;
        }
        self.output.write_all(frame)?;
        self.output.write_all(&[0; 3][..padding])?;
        let flags = match direction {
            Direction::Inbound => 1u32,
            Direction::Outbound => 2,
        };
        let trailer = [u32::from(OPTION_PACKET_FLAGS) | 4 << 16, flags, u32::from(OPTION_END), length];
        for word in trailer {
            self.output.write_all(&word.to_le_bytes())?;
        }
        Ok(())
    }

    /// Flushes and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.output.flush()?;
        Ok(self.output)
    }
}

impl<W: Write> FrameSink for PcapngWriter<W> {
    fn record(&mut self, unix_ns: u64, direction: Direction, frame: &[u8]) -> io::Result<()> {
        self.write(unix_ns, direction, frame)
    }
}

fn push_option(to: &mut Vec<u8>, code: u16, value: &[u8]) {
    to.extend(code.to_le_bytes());
    to.extend((value.len() as u16).to_le_bytes());
    to.extend(value);
    to.resize(to.len() + value.len().wrapping_neg() % 4, 0);
}

fn write_block(output: &mut impl Write, kind: u32, body: &[u8]) -> io::Result<()> {
    let length = body.len() as u32 + 12;
    output.write_all(&kind.to_le_bytes())?;
    output.write_all(&length.to_le_bytes())?;
    output.write_all(body)?;
    output.write_all(&length.to_le_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_has_the_bytes_of_the_draft() {
        let mut writer = PcapngWriter::new(Vec::new(), "eth0").unwrap();
        writer.write(0x0123_4567_89AB_CDEF, Direction::Outbound, &[0xAA; 5]).unwrap();
        let bytes = writer.finish().unwrap();
        #[rustfmt::skip]
        let expected = [
            // section header: magic, version 1.0, length unknown, application
            0x0a, 0x0d, 0x0d, 0x0a, 44, 0, 0, 0, 0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0,
            0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff,
            4, 0, 8, 0, b'o', b'm', b'n', b'i', b'b', b'a', b's', b'e', 0, 0, 0, 0, 44, 0, 0, 0,
            // interface: Ethernet, no limit, name, resolution 10^-9
            1, 0, 0, 0, 40, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0,
            2, 0, 4, 0, b'e', b't', b'h', b'0', 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0, 40, 0, 0, 0,
            // packet: interface 0, time high and low, lengths, data and padding, flags: outbound
            6, 0, 0, 0, 52, 0, 0, 0, 0, 0, 0, 0, 0x67, 0x45, 0x23, 0x01, 0xef, 0xcd, 0xab, 0x89,
            5, 0, 0, 0, 5, 0, 0, 0, 0xaa, 0xaa, 0xaa, 0xaa, 0xaa, 0, 0, 0,
            2, 0, 4, 0, 2, 0, 0, 0, 0, 0, 0, 0, 52, 0, 0, 0,
        ];
        assert_eq!(bytes, expected);
    }
}
