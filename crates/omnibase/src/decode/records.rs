//! Frames of a capture as records: which way they went, and their datagrams.

use omnibase_ethercat_wire::frame::{Datagram, Datagrams, ETHERTYPE, PROCESSED_BIT};
use omnibase_record::{CapturedFrame, Direction};
use serde::Serialize;
use std::borrow::Cow;

/// Which way a frame went, seen from the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FrameDirection {
    /// To the segment.
    Request,
    /// Back from it.
    Reply,
}

/// How the way of a frame is told where the capture doesn't say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DirectionRule {
    /// The "locally administered" bit of the source address, which every SubDevice sets.
    ProcessedBit,
    /// Every frame of the capture carries that bit, so it tells nothing: a frame like one that is still
    /// unanswered is its reply.
    Pairing,
    /// It was taken where the segment begins, as `simulate --record` does: what came in there are the requests.
    SegmentSide,
}

/// An EtherCAT frame without a VLAN tag.
#[derive(Clone, Debug)]
pub struct Record<'a> {
    /// The frame as captured.
    pub frame: CapturedFrame<'a>,
    /// Its bytes from the Ethernet header on, a VLAN tag taken out.
    pub bytes: Cow<'a, [u8]>,
}

impl<'a> Record<'a> {
    /// The frame as a record; `None` for another protocol.
    pub fn new(frame: CapturedFrame<'a>) -> Option<Self> {
        const VLAN: [u8; 2] = [0x81, 0x00];
        let ethercat = ETHERTYPE.to_be_bytes();
        let bytes = match (frame.data.get(12..14)?, frame.data.get(16..18)) {
            (kind, _) if kind == ethercat => Cow::Borrowed(frame.data),
            (kind, Some(inner)) if kind == VLAN && inner == ethercat => {
                Cow::Owned([&frame.data[..12], &frame.data[16..]].concat())
            }
            _ => return None,
        };
        Some(Record { frame, bytes })
    }

    /// The source address has the bit that SubDevices set.
    pub fn is_marked(&self) -> bool {
        self.bytes[6] & PROCESSED_BIT != 0
    }

    /// A SubDevice counted in it, as in no request.
    fn is_counted(&self) -> bool {
        self.datagrams().0.iter().any(|datagram| datagram.working_counter > 0)
    }

    /// The way, as far as this frame alone tells it.
    pub fn way(&self, rule: DirectionRule) -> Option<FrameDirection> {
        match (self.frame.direction, rule) {
            (Some(Direction::Outbound), DirectionRule::SegmentSide) => Some(FrameDirection::Reply),
            (Some(Direction::Inbound), DirectionRule::SegmentSide) => Some(FrameDirection::Request),
            (Some(Direction::Outbound), _) => Some(FrameDirection::Request),
            (Some(Direction::Inbound), _) => Some(FrameDirection::Reply),
            (None, DirectionRule::Pairing) => None,
            (None, _) if self.is_marked() => Some(FrameDirection::Reply),
            (None, _) => Some(FrameDirection::Request),
        }
    }

    /// The datagrams, and what is wrong with the frame from where on nothing more can be read.
    pub fn datagrams(&self) -> (Vec<Datagram<'_>>, Option<String>) {
        let mut datagrams = Vec::new();
        let reader = match Datagrams::new(&self.bytes) {
            Ok(reader) => reader,
            Err(error) => return (datagrams, Some(error.to_string())),
        };
        for datagram in reader {
            match datagram {
                Ok(datagram) => datagrams.push(datagram),
                Err(error) => return (datagrams, Some(error.to_string())),
            }
        }
        (datagrams, None)
    }

    /// What stays the same between a request and its reply, for matching them: commands, indices, addresses
    /// without the part that SubDevices count up, and lengths.
    pub fn key(datagrams: &[Datagram<'_>]) -> Vec<u64> {
        datagrams
            .iter()
            .map(|datagram| {
                let header = &datagram.header;
                let address = match header.command {
                    // Auto-increment and broadcast: the low half is counted up on the way.
                    0..=3 | 7..=9 | 13 => header.address & 0xFFFF_0000,
                    _ => header.address,
                };
                u64::from(header.command)
                    | u64::from(header.index) << 8
                    | (header.length as u64) << 16
                    | u64::from(address) << 32
            })
            .collect()
    }
}

/// The rule for a whole capture.
pub fn way_rule<'a>(records: impl Iterator<Item = &'a Record<'a>> + Clone) -> DirectionRule {
    let is_counted = |way: Direction| {
        records.clone().filter(|record| record.frame.direction == Some(way)).any(Record::is_counted)
    };
    if !is_counted(Direction::Inbound) && is_counted(Direction::Outbound) {
        return DirectionRule::SegmentSide;
    }
    let mut undecided = records.filter(|record| record.frame.direction.is_none()).peekable();
    if undecided.peek().is_some() && undecided.all(Record::is_marked) {
        DirectionRule::Pairing
    } else {
        DirectionRule::ProcessedBit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_ethercat_wire::frame::FrameBuilder;
    use omnibase_ethercat_wire::{Address, Command};

    fn captured(data: &[u8]) -> CapturedFrame<'_> {
        CapturedFrame { number: 1, unix_ns: 0, direction: None, data, original_length: data.len() }
    }

    fn request() -> Vec<u8> {
        let mut frame = FrameBuilder::new();
        frame.push(Command::Aprd, 7, Address::position(1, 0x130), &[0, 0]).unwrap();
        frame.bytes().to_vec()
    }

    #[test]
    fn other_protocols_are_no_records_and_a_vlan_tag_is_taken_out() {
        let plain = request();
        let mut tagged = plain.clone();
        tagged.splice(12..12, [0x81, 0x00, 0x00, 0x05]);
        assert_eq!(Record::new(captured(&tagged)).unwrap().bytes, plain);
        let mut arp = plain.clone();
        arp[12..14].copy_from_slice(&[0x08, 0x06]);
        assert!(Record::new(captured(&arp)).is_none());
        assert!(Record::new(captured(&plain[..13])).is_none());
    }

    #[test]
    fn a_reply_has_the_key_of_its_request_and_its_own_way() {
        let sent = request();
        let mut came = sent.clone();
        came[6] |= PROCESSED_BIT;
        came[18] = came[18].wrapping_add(2);
        came[28] = 1;
        let (request, reply) = (Record::new(captured(&sent)).unwrap(), Record::new(captured(&came)).unwrap());
        assert_eq!(Record::key(&request.datagrams().0), Record::key(&reply.datagrams().0));
        assert_eq!(request.way(DirectionRule::ProcessedBit), Some(FrameDirection::Request));
        assert_eq!(reply.way(DirectionRule::ProcessedBit), Some(FrameDirection::Reply));
    }

    #[test]
    fn a_capture_whose_frames_are_all_marked_needs_pairing() {
        let mut marked = request();
        marked[6] |= PROCESSED_BIT;
        let plain = request();
        let both = [Record::new(captured(&marked)).unwrap(), Record::new(captured(&plain)).unwrap()];
        assert_eq!(way_rule(both.iter()), DirectionRule::ProcessedBit);
        assert_eq!(way_rule(both[..1].iter()), DirectionRule::Pairing);
        assert_eq!(way_rule([].iter()), DirectionRule::ProcessedBit);
    }

    /// Whose interface it was tells which way is out.
    #[test]
    fn a_capture_of_the_segments_side_has_its_requests_coming_in() {
        let (sent, mut came) = (request(), request());
        let counter = came.len() - 2;
        came[counter] = 1;
        let record = |data, direction| {
            Record::new(CapturedFrame { direction: Some(direction), ..captured(data) }).unwrap()
        };
        let ways = |records: [Record<'_>; 2]| {
            let rule = way_rule(records.iter());
            records.map(|record| record.way(rule).unwrap())
        };
        use Direction::{Inbound, Outbound};
        let both = [FrameDirection::Request, FrameDirection::Reply];
        assert_eq!(ways([record(&sent, Outbound), record(&came, Inbound)]), both);
        assert_eq!(ways([record(&sent, Inbound), record(&came, Outbound)]), both);
        // Nobody answered: the interface's word holds.
        assert_eq!(ways([record(&sent, Outbound), record(&sent, Outbound)]), [FrameDirection::Request; 2]);
    }
}
