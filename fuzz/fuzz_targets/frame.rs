//! Any bytes as an Ethernet frame: every datagram lies inside it, and what was read builds the same bytes again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat_wire::Command;
use omnibase_ethercat_wire::frame::{DATAGRAM_HEADER, Datagrams, ETHERNET_HEADER, FrameBuilder};

fuzz_target!(|bytes: &[u8]| {
    read(bytes);
    // Once more behind headers that are right, so that the datagrams get the fuzzer's attention.
    let mut frame = FrameBuilder::new().bytes()[..ETHERNET_HEADER].to_vec();
    frame.extend_from_slice(&(0x1000 | bytes.len().min(0x7FF) as u16).to_le_bytes());
    frame.extend_from_slice(bytes);
    read(&frame);
});

fn read(bytes: &[u8]) {
    let Ok(datagrams) = Datagrams::new(bytes) else { return };
    let mut rebuilt = FrameBuilder::new();
    for datagram in datagrams {
        let Ok(datagram) = datagram else { return };
        let at = datagram.offset + DATAGRAM_HEADER;
        assert_eq!(datagram.data, &bytes[at..at + datagram.header.length]);
        let Some(command) = Command::from_code(datagram.header.command) else { continue };
        let address = command.address(datagram.header.address);
        assert_eq!(address.raw(), datagram.header.address);
        if let Ok(offset) = rebuilt.push(command, datagram.header.index, address, datagram.data) {
            let again = Datagrams::new(rebuilt.bytes()).unwrap().last().unwrap().unwrap();
            assert_eq!(again.offset, offset);
            assert_eq!(again.data, datagram.data);
        }
    }
}
