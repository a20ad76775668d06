//! Which SubDevice hangs on which port of which other, from their DL status.

use alloc::vec::Vec;
use core::fmt;

use crate::subdevice::{Parent, Port, PortKind};

/// The order in which a frame passes the ports of a controller (ETG.1000.4, "Frame processing order").
pub const PORT_ORDER: [u8; 4] = [0, 3, 1, 2];

/// A frame is never longer than this in one branch: a thousand SubDevices at about a microsecond both ways.
pub(crate) const BRANCH_LIMIT_NS: u32 = 10_000_000;

/// Reads the ports from the port descriptor (0x0007) and DL status (0x0110).
pub fn read_ports(descriptor: u8, dl_status: u16) -> [Port; 4] {
    core::array::from_fn(|port| Port {
        kind: match descriptor >> (2 * port) & 3 {
            1 => PortKind::Unconfigured,
            2 => PortKind::Ebus,
            3 => PortKind::Mii,
            _ => PortKind::None,
        },
        link: dl_status >> (4 + port) & 1 != 0,
        communicates: dl_status >> (9 + 2 * port) & 1 != 0 && dl_status >> (8 + 2 * port) & 1 == 0,
    })
}

/// The port through which frames arrive: the first that communicates, in the order of ports 0, 3, 1, 2.
pub fn entry_port(ports: &[Port; 4]) -> u8 {
    PORT_ORDER.into_iter().find(|&port| ports[usize::from(port)].communicates).unwrap_or(0)
}

/// The ports behind which other SubDevices hang, in the order in which frames leave them.
pub fn exit_ports(ports: &[Port; 4]) -> impl Iterator<Item = u8> + '_ {
    let entry = entry_port(ports);
    let first = PORT_ORDER.iter().position(|&port| port == entry).unwrap_or(0);
    (1..4)
        .map(move |step| PORT_ORDER[(first + step) % 4])
        .filter(|&port| ports[usize::from(port)].communicates)
}

/// The port that frames reach before port 0, by the local times at which one and the same frame passed the ports (registers
/// 0x0900 to 0x090F), where others hang on port 0.
pub fn swapped_port(ports: &[Port; 4], times_ns: [u32; 4]) -> Option<u8> {
    let communicates = |port: &u8| ports[usize::from(*port)].communicates;
    let ahead = |port: &u8| times_ns[0].wrapping_sub(times_ns[usize::from(*port)]);
    let others = PORT_ORDER.into_iter().skip(1).filter(communicates);
    others.filter(|port| communicates(&0) && (1..=BRANCH_LIMIT_NS).contains(&ahead(port))).max_by_key(ahead)
}

/// Why the ports don't make a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopologyError {
    /// More open ports than a tree has: a cable leads back into the segment.
    Ring {
        /// The SubDevice behind whose port nobody was found.
        position: u16,
        /// That port.
        port: u8,
    },
    /// No open port is left for a SubDevice to hang on.
    NoParent {
        /// The SubDevice.
        position: u16,
    },
    /// Frames come to another port than 0, and leave by port 0 to others.
    Swapped {
        /// The SubDevice.
        position: u16,
        /// The port to which they come.
        port: u8,
        /// Its alias, where it has one.
        alias: Option<u16>,
    },
}

impl fmt::Display for TopologyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TopologyError::Ring { position, port } => write!(
                f,
                "SubDevice {position}: port {port} communicates, but no SubDevice of the segment hangs there: \
                 expected a tree, found a ring or a link to another network"
            ),
            TopologyError::NoParent { position } => write!(
                f,
                "SubDevice {position} answers, but no SubDevice before it has an open port left for it \
                 (a link came or went during the scan? are IN and OUT swapped of one that has no clock?)"
            ),
            TopologyError::Swapped { position, port, alias } => {
                write!(f, "SubDevice {position}")?;
                if let Some(alias) = alias {
                    write!(f, " (alias {alias})")?;
                }
                write!(
                    f,
                    ": frames reach its port {port} before its port 0: its cables are swapped (IN and OUT). They pass it behind \
                     all that hang on it, so that positions aren't the order of the cables; plug the cable from the \
                     MainDevice into IN"
                )
            }
        }
    }
}

impl core::error::Error for TopologyError {}

/// Finds each SubDevice's parent, from all SubDevices' ports in the order of positions.
///
/// Frames pass a tree depth first, so the parent is the latest SubDevice that still has an open port which
/// nobody took.
pub fn find_parents(ports: &[[Port; 4]]) -> Result<Vec<Option<Parent>>, TopologyError> {
    let mut parents = Vec::with_capacity(ports.len());
    // Open ends: (position, port), the next to be taken last.
    let mut open = Vec::new();
    for (position, ports) in (0u16..).zip(ports) {
        let parent = if position == 0 {
            None
        } else {
            let (parent, port) = open.pop().ok_or(TopologyError::NoParent { position })?;
            Some(Parent { position: parent, port })
        };
        parents.push(parent);
        let mut exits = exit_ports(ports).collect::<Vec<_>>();
        exits.reverse();
        open.extend(exits.into_iter().map(|port| (position, port)));
    }
    match open.pop() {
        Some((position, port)) => Err(TopologyError::Ring { position, port }),
        None => Ok(parents),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ports(open: &[usize]) -> [Port; 4] {
        core::array::from_fn(|port| {
            let there = open.contains(&port);
            Port { kind: PortKind::Mii, link: there, communicates: there }
        })
    }

    fn parents(segment: &[&[usize]]) -> Result<Vec<Option<(u16, u8)>>, TopologyError> {
        let ports: Vec<_> = segment.iter().map(|open| ports(open)).collect();
        Ok(find_parents(&ports)?.into_iter().map(|p| p.map(|p| (p.position, p.port))).collect())
    }

    #[test]
    fn ports_are_read_as_the_standard_lays_them_out() {
        // EK1100 with a terminal: links at 0 and 1, both open; ports 2 and 3 closed.
        let read = read_ports(0b00_10_11_11, 0x5A31 & !0x0001 | 0x0001);
        assert_eq!(read.map(|port| port.communicates), [true, true, false, false]);
        assert_eq!(read.map(|port| port.link), [true, true, false, false]);
        assert_eq!(read[2].kind, PortKind::Ebus);
    }

    #[test]
    fn a_line() {
        assert_eq!(parents(&[&[0, 1], &[0, 1], &[0]]), Ok(vec![None, Some((0, 1)), Some((1, 1))]));
    }

    #[test]
    fn a_tree_is_walked_by_ports_3_1_2() {
        let tree: &[&[usize]] = &[&[0, 1, 2, 3], &[0], &[0, 1], &[0], &[0]];
        assert_eq!(parents(tree), Ok(vec![None, Some((0, 3)), Some((0, 1)), Some((2, 1)), Some((0, 2))]));
    }

    #[test]
    fn who_is_reached_at_another_port_first_is_swapped() {
        let both = ports(&[0, 1]);
        assert_eq!(swapped_port(&both, [5000, 9000, 0, 0]), None, "port 1 is where the frame comes back");
        assert_eq!(swapped_port(&both, [9000, 5000, 0, 0]), Some(1));
        // Times of 32 bits turn over; a closed port says nothing, nor does what isn't of the same frame.
        assert_eq!(swapped_port(&both, [1000, 0xFFFF_FF00, 0, 0]), Some(1));
        assert_eq!(swapped_port(&both, [9000, 9000, 5000, 5000]), None);
        assert_eq!(swapped_port(&both, [20_000_000, 5000, 0, 0]), None);
        assert_eq!(swapped_port(&ports(&[1]), [9000, 5000, 0, 0]), None, "the last one makes no other tree");
    }

    #[test]
    fn rings_and_gaps_are_refused_with_the_place() {
        assert_eq!(parents(&[&[0, 1], &[0, 1]]), Err(TopologyError::Ring { position: 1, port: 1 }));
        assert_eq!(parents(&[&[0], &[0]]), Err(TopologyError::NoParent { position: 1 }));
    }
}
