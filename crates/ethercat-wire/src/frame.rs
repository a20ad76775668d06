//! Ethernet frames that carry EtherCAT datagrams: building them in place, and reading them.
//!
//! ```text
//! 0        6        12      14              16                 26              26+n   28+n
//! | dst 6  | src 6  | 88A4  | len:11 r:1 t:4 | datagram header  | data, n bytes | WKC 2 | next datagram ...
//! ```

use crate::bytes::{put_u16, put_u32, u16_at, u32_at};
use crate::{Address, Command};

/// The EtherType of EtherCAT.
pub const ETHERTYPE: u16 = 0x88A4;
/// Bytes of the Ethernet header.
pub const ETHERNET_HEADER: usize = 14;
/// Bytes of the EtherCAT header behind the Ethernet header.
pub const ETHERCAT_HEADER: usize = 2;
/// Where the first datagram starts.
pub const FIRST_DATAGRAM: usize = ETHERNET_HEADER + ETHERCAT_HEADER;
/// Bytes of a datagram's header.
pub const DATAGRAM_HEADER: usize = 10;
/// Bytes of a datagram beside its data: header and working counter.
pub const DATAGRAM_OVERHEAD: usize = DATAGRAM_HEADER + 2;
/// The largest frame, without the checksum: 1500 bytes of payload behind the Ethernet header.
pub const MAX_FRAME: usize = ETHERNET_HEADER + 1500;
/// The smallest Ethernet frame without checksum; shorter ones are padded by a real network card.
pub const MIN_FRAME: usize = 60;
/// The most data that one datagram of a frame can carry.
pub const MAX_DATA: usize = MAX_FRAME - FIRST_DATAGRAM - DATAGRAM_OVERHEAD;
/// Source address of the frames that this MainDevice sends; [`PROCESSED_BIT`] is clear in it.
pub const MAIN_DEVICE_MAC: [u8; 6] = [0x10, 0x6f, 0x6d, 0x6e, 0x69, 0x01];
/// The bit that every SubDevice sets in the first byte of a frame's source address (the "locally administered"
/// bit), so that a frame which came back from a segment can be told from one that was merely reflected.
pub const PROCESSED_BIT: u8 = 0x02;

/// Why bytes aren't an EtherCAT frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// Fewer bytes than the headers need.
    #[error("frame of {found} bytes is shorter than its headers, {expected} bytes")]
    TooShort {
        /// Bytes needed.
        expected: usize,
        /// Bytes there.
        found: usize,
    },
    /// Another protocol.
    #[error("EtherType 0x{found:04x} is not EtherCAT (0x88a4)")]
    NotEtherCat {
        /// The EtherType of the frame.
        found: u16,
    },
    /// An EtherCAT frame, but not of datagrams (type 1).
    #[error("EtherCAT frame type {found} does not carry datagrams (type 1)")]
    NotDatagrams {
        /// The type nibble.
        found: u8,
    },
    /// The EtherCAT header announces more bytes than the frame holds.
    #[error("EtherCAT header announces {announced} bytes, the frame holds {found}")]
    LengthBeyondFrame {
        /// Length field of the EtherCAT header.
        announced: usize,
        /// Bytes behind it.
        found: usize,
    },
    /// A datagram reaches past the announced length.
    #[error("datagram at byte {offset} needs {needed} bytes, {found} are left")]
    DatagramBeyondLength {
        /// Offset of the datagram in the frame.
        offset: usize,
        /// Bytes that it needs with header and working counter.
        needed: usize,
        /// Bytes that are left.
        found: usize,
    },
}

/// A datagram's header as values; `command` stays a raw code so that nothing is lost in reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramHeader {
    /// Command code; [`Command::from_code`] gives it its name.
    pub command: u8,
    /// Index by which the sender recognises the answer.
    pub index: u8,
    /// The four address bytes.
    pub address: u32,
    /// Bytes of data.
    pub length: usize,
    /// The frame has passed this datagram once already on a ring.
    pub circulating: bool,
    /// Another datagram follows.
    pub more: bool,
    /// External event request, ORed together by the SubDevices.
    pub event: u16,
}

impl DatagramHeader {
    fn read(bytes: &[u8]) -> Self {
        let flags = u16_at(bytes, 6);
        DatagramHeader {
            command: bytes[0],
            index: bytes[1],
            address: u32_at(bytes, 2),
            length: usize::from(flags & 0x07FF),
            circulating: flags & 0x4000 != 0,
            more: flags & 0x8000 != 0,
            event: u16_at(bytes, 8),
        }
    }

    /// The address as the command means it; `None` where the command is unknown.
    pub fn target(&self) -> Option<Address> {
        Command::from_code(self.command).map(|command| command.address(self.address))
    }
}

/// One datagram in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// Its header.
    pub header: DatagramHeader,
    /// Offset of the header in the Ethernet frame.
    pub offset: usize,
    /// Its data.
    pub data: &'a [u8],
    /// Its working counter.
    pub working_counter: u16,
}

/// Checks the Ethernet and EtherCAT headers and gives the range of bytes in which datagrams stand.
///
/// Padding and slack behind the announced length are tolerated, as are frames under 60 bytes.
pub fn datagram_area(frame: &[u8]) -> Result<core::ops::Range<usize>, FrameError> {
    if frame.len() < FIRST_DATAGRAM {
        return Err(FrameError::TooShort { expected: FIRST_DATAGRAM, found: frame.len() });
    }
    let ethertype = u16::from_be_bytes([frame[12], frame[13]]);
    if ethertype != ETHERTYPE {
        return Err(FrameError::NotEtherCat { found: ethertype });
    }
    let header = u16_at(frame, ETHERNET_HEADER);
    let (length, kind) = (usize::from(header & 0x07FF), (header >> 12) as u8);
    if kind != 1 {
        return Err(FrameError::NotDatagrams { found: kind });
    }
    let found = frame.len() - FIRST_DATAGRAM;
    if length > found {
        return Err(FrameError::LengthBeyondFrame { announced: length, found });
    }
    Ok(FIRST_DATAGRAM..FIRST_DATAGRAM + length)
}

/// The datagrams of a frame, one after another; ends at the datagram without "more" or at the first error.
#[derive(Clone, Debug)]
pub struct Datagrams<'a> {
    frame: &'a [u8],
    next: Option<usize>,
    end: usize,
}

impl<'a> Datagrams<'a> {
    /// Reads `frame`, which starts at its Ethernet header.
    pub fn new(frame: &'a [u8]) -> Result<Self, FrameError> {
        let area = datagram_area(frame)?;
        Ok(Datagrams { frame, next: (!area.is_empty()).then_some(area.start), end: area.end })
    }
}

impl<'a> Iterator for Datagrams<'a> {
    type Item = Result<Datagram<'a>, FrameError>;

    fn next(&mut self) -> Option<Self::Item> {
        let offset = self.next.take()?;
        let found = self.end - offset;
        if found < DATAGRAM_OVERHEAD {
            return Some(Err(FrameError::DatagramBeyondLength { offset, needed: DATAGRAM_OVERHEAD, found }));
        }
        let header = DatagramHeader::read(&self.frame[offset..]);
        let needed = header.length + DATAGRAM_OVERHEAD;
        if found < needed {
            return Some(Err(FrameError::DatagramBeyondLength { offset, needed, found }));
        }
        let data_at = offset + DATAGRAM_HEADER;
        let counter_at = data_at + header.length;
        if header.more {
            self.next = Some(counter_at + 2);
        }
        Some(Ok(Datagram {
            header,
            offset,
            data: &self.frame[data_at..counter_at],
            working_counter: u16_at(self.frame, counter_at),
        }))
    }
}

/// There was no room for a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a datagram of {needed} bytes does not fit into the {free} bytes left in the frame")]
pub struct FrameFull {
    /// Bytes needed, with header and working counter.
    pub needed: usize,
    /// Bytes free.
    pub free: usize,
}

/// Builds one frame in a fixed buffer.
#[derive(Clone)]
pub struct FrameBuilder {
    buffer: [u8; MAX_FRAME],
    length: usize,
    last: Option<usize>,
}

impl Default for FrameBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameBuilder {
    /// A broadcast frame from [`MAIN_DEVICE_MAC`] without datagrams.
    pub fn new() -> Self {
        let mut buffer = [0; MAX_FRAME];
        buffer[..6].fill(0xFF);
        buffer[6..12].copy_from_slice(&MAIN_DEVICE_MAC);
        buffer[12..14].copy_from_slice(&ETHERTYPE.to_be_bytes());
        put_u16(&mut buffer, ETHERNET_HEADER, 0x1000);
        FrameBuilder { buffer, length: FIRST_DATAGRAM, last: None }
    }

    /// Drops all datagrams.
    pub fn clear(&mut self) {
        self.length = FIRST_DATAGRAM;
        self.last = None;
        put_u16(&mut self.buffer, ETHERNET_HEADER, 0x1000);
    }

    /// Data bytes that one more datagram may carry.
    pub fn room(&self) -> usize {
        (MAX_FRAME - self.length).saturating_sub(DATAGRAM_OVERHEAD)
    }

    /// Appends a datagram of `length` zero bytes; returns the offset of its header in the frame.
    pub fn push_zeros(
        &mut self,
        command: Command,
        index: u8,
        address: Address,
        length: usize,
    ) -> Result<usize, FrameFull> {
        if length > self.room() || self.length + DATAGRAM_OVERHEAD > MAX_FRAME {
            return Err(FrameFull { needed: length + DATAGRAM_OVERHEAD, free: MAX_FRAME - self.length });
        }
        let offset = self.length;
        if let Some(last) = self.last {
            self.buffer[last + 7] |= 0x80;
        }
        let end = offset + DATAGRAM_OVERHEAD + length;
        self.buffer[offset..end].fill(0);
        self.buffer[offset] = command.code();
        self.buffer[offset + 1] = index;
        put_u32(&mut self.buffer, offset + 2, address.raw());
        put_u16(&mut self.buffer, offset + 6, length as u16);
        self.last = Some(offset);
        self.length = end;
        put_u16(&mut self.buffer, ETHERNET_HEADER, 0x1000 | (end - FIRST_DATAGRAM) as u16);
        Ok(offset)
    }

    /// Appends a datagram that carries `data`; returns the offset of its header in the frame.
    pub fn push(
        &mut self,
        command: Command,
        index: u8,
        address: Address,
        data: &[u8],
    ) -> Result<usize, FrameFull> {
        let offset = self.push_zeros(command, index, address, data.len())?;
        let at = offset + DATAGRAM_HEADER;
        self.buffer[at..at + data.len()].copy_from_slice(data);
        Ok(offset)
    }

    /// The frame without padding.
    pub fn bytes(&self) -> &[u8] {
        &self.buffer[..self.length]
    }

    /// The frame for changes in place (index, data, working counters).
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.buffer[..self.length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// BRD of register 0 as any capture of a start-up shows it.
    const BRD: [u8; 29] = [
        0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x10, 0x6f, 0x6d, 0x6e, 0x69, 0x01, 0x88, 0xa4, 0x0d, 0x10, 0x07,
        0x2a, 0x00, 0x00, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    ];

    #[test]
    fn a_broadcast_read_has_the_bytes_of_the_standard() {
        let mut frame = FrameBuilder::new();
        frame.push_zeros(Command::Brd, 0x2a, Address::broadcast(0), 1).unwrap();
        assert_eq!(frame.bytes(), BRD);
    }

    #[test]
    fn what_was_pushed_is_read_back() {
        let mut frame = FrameBuilder::new();
        frame.push(Command::Fpwr, 1, Address::station(0x1001, 0x0120), &[4, 0]).unwrap();
        frame.push_zeros(Command::Lrd, 2, Address::Logical(0x0001_0000), 24).unwrap();
        let read: Vec<_> = Datagrams::new(frame.bytes()).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), 2);
        assert_eq!(read[0].header.target(), Some(Address::station(0x1001, 0x0120)));
        assert_eq!(read[0].data, [4, 0]);
        assert!(read[0].header.more && !read[1].header.more);
        assert_eq!((read[1].header.command, read[1].header.length), (Command::Lrd.code(), 24));
    }

    #[test]
    fn slack_behind_the_last_datagram_is_tolerated_and_lies_are_refused() {
        let mut padded = BRD.to_vec();
        padded.resize(60, 0xEE);
        assert_eq!(Datagrams::new(&padded).unwrap().count(), 1);
        let mut lying = BRD;
        lying[14] = 0xFF;
        assert!(matches!(Datagrams::new(&lying), Err(FrameError::LengthBeyondFrame { .. })));
        let mut long = BRD;
        long[22] = 9;
        assert!(matches!(
            Datagrams::new(&long).unwrap().next(),
            Some(Err(FrameError::DatagramBeyondLength { .. }))
        ));
    }

    #[test]
    fn a_full_frame_refuses_and_keeps_what_it_has() {
        let mut frame = FrameBuilder::new();
        frame.push_zeros(Command::Lrd, 0, Address::Logical(0), MAX_DATA).unwrap();
        assert_eq!(frame.bytes().len(), MAX_FRAME);
        assert!(frame.push_zeros(Command::Nop, 1, Address::broadcast(0), 0).is_err());
        assert_eq!(Datagrams::new(frame.bytes()).unwrap().count(), 1);
    }

    fn datagrams() -> impl Strategy<Value = Vec<(Command, u8, u32, Vec<u8>)>> {
        let command = (0..Command::ALL.len()).prop_map(|code| Command::ALL[code]);
        let data = prop::collection::vec(any::<u8>(), 0..200);
        prop::collection::vec((command, any::<u8>(), any::<u32>(), data), 0..12)
    }

    proptest! {
        #[test]
        fn what_is_built_is_read_back(datagrams in datagrams()) {
            let mut frame = FrameBuilder::new();
            let mut built = Vec::new();
            for (command, index, address, data) in &datagrams {
                if frame.push(*command, *index, command.address(*address), data).is_ok() {
                    built.push((command.code(), *index, *address, data.clone()));
                }
            }
            prop_assert!(frame.bytes().len() <= MAX_FRAME);
            let read: Vec<_> = Datagrams::new(frame.bytes()).unwrap().map(Result::unwrap).collect();
            for (number, datagram) in read.iter().enumerate() {
                prop_assert_eq!(datagram.header.more, number + 1 < read.len());
            }
            let read: Vec<_> = read
                .iter()
                .map(|one| (one.header.command, one.header.index, one.header.address, one.data.to_vec()))
                .collect();
            prop_assert_eq!(read, built);
        }

        #[test]
        fn any_bytes_are_read_inside_their_frame(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut frame = FrameBuilder::new().bytes()[..ETHERNET_HEADER].to_vec();
            frame.extend_from_slice(&(0x1000 | bytes.len() as u16).to_le_bytes());
            frame.extend_from_slice(&bytes);
            for datagram in Datagrams::new(&frame).unwrap().flatten() {
                prop_assert!(datagram.offset + DATAGRAM_OVERHEAD + datagram.data.len() <= frame.len());
            }
        }
    }
}
