//! What a datagram's data mean.

use super::records::FrameDirection;
use super::{mailbox, registers};
use omnibase_ethercat_wire::frame::Datagram;
use omnibase_ethercat_wire::{Address, Command, register};

/// The name of what a datagram addresses: a register, or memory; `None` for logical addresses.
pub fn place(address: Address) -> Option<String> {
    let at = register_of(address)?;
    if at >= register::PROCESS_DATA { Some("memory".to_owned()) } else { registers::name(at) }
}

/// The register or memory address; `None` for logical addresses.
fn register_of(address: Address) -> Option<u16> {
    match address {
        Address::Position { register, .. }
        | Address::Station { register, .. }
        | Address::Broadcast { register, .. } => Some(register),
        Address::Logical(_) => None,
    }
}

/// The data in words; empty where they have no meaning (yet): a read on its way out, an answer that nobody gave.
pub fn content(datagram: &Datagram<'_>, way: FrameDirection) -> Vec<String> {
    let Some(command) = Command::from_code(datagram.header.command) else { return Vec::new() };
    let writes =
        !matches!(command, Command::Nop | Command::Aprd | Command::Fprd | Command::Brd | Command::Lrd);
    let answered = way == FrameDirection::Reply && datagram.working_counter > 0;
    if command == Command::Nop || !(answered || (writes && way == FrameDirection::Request)) {
        return Vec::new();
    }
    let Some(at) = register_of(command.address(datagram.header.address)) else { return Vec::new() };
    if at >= register::PROCESS_DATA {
        return mailbox::words(datagram.data).into_iter().collect();
    }
    registers::values(at, datagram.data, command == Command::Brd && datagram.working_counter > 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder};

    fn said(command: Command, working_counter: u16, way: FrameDirection) -> Vec<String> {
        let mut frame = FrameBuilder::new();
        frame.push(command, 1, Address::station(0x1001, 0x0130), &[8, 0]).unwrap();
        let end = frame.bytes().len();
        frame.bytes_mut()[end - 2..].copy_from_slice(&working_counter.to_le_bytes());
        let datagram = Datagrams::new(frame.bytes()).unwrap().next().unwrap().unwrap();
        content(&datagram, way)
    }

    #[test]
    fn only_data_that_somebody_gave_have_a_meaning() {
        assert_eq!(said(Command::Fprd, 1, FrameDirection::Reply), ["in OP"]);
        assert_eq!(said(Command::Fpwr, 0, FrameDirection::Request), ["in OP"]);
        assert!(said(Command::Fprd, 0, FrameDirection::Request).is_empty());
        assert!(said(Command::Fprd, 0, FrameDirection::Reply).is_empty());
    }

    #[test]
    fn places_have_names() {
        assert_eq!(place(Address::broadcast(0x0120)).as_deref(), Some("AL control"));
        assert_eq!(place(Address::station(1, 0x1000)).as_deref(), Some("memory"));
        assert_eq!(place(Address::Logical(0x0120)), None);
    }
}
