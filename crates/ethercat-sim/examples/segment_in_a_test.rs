//! A simulated segment in your own test, for any MainDevice: frames go in, answers come back.

use omnibase_ethercat_sim::{SegmentFile, in_process};
use omnibase_ethercat_wire::frame::{Datagrams, FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::{Address, Clock, Command, Link};
use std::path::Path;
use std::time::Duration;

/// Counts the SubDevices of a segment with a frame written by hand.
pub fn main() {
    let text = "[[subdevice]]\nkind = \"coupler\"\n[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
    let segment = SegmentFile::parse(text).unwrap().build(Path::new(".")).unwrap();
    // Or serve it behind a network interface: `omnibase_ethercat_sim::serve`.
    let (mut link, clock) = in_process(segment);

    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Brd, 1, Address::broadcast(0x0000), 1).unwrap();
    link.send(frame.bytes()).unwrap();

    let mut answer = [0; MAX_FRAME];
    let deadline = clock.now() + Duration::from_millis(1);
    let length = link.receive(&mut answer, deadline).unwrap().expect("the frame comes back");
    let datagram = Datagrams::new(&answer[..length]).unwrap().next().unwrap().unwrap();
    println!("{} SubDevices answered after {:?}", datagram.working_counter, clock.now());
    assert_eq!(datagram.working_counter, 3);
}
