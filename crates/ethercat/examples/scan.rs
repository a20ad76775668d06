//! Who is in the segment? Replace the simulated link and clock by `omnibase_host::{PacketSocket, MonotonicClock}`
//! and the same code scans a real one.

use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::{SegmentFile, in_process};
use std::path::Path;

/// Prints a line for each SubDevice of a simulated tree.
pub fn main() -> Result<(), SetUpError> {
    let text = include_str!("../../../segments/mixed-tree.toml");
    let segment = SegmentFile::parse(text).unwrap().build(Path::new("segments")).unwrap();
    let (link, clock) = in_process(segment);

    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan()?;
    for one in bus.subdevices() {
        let parent = one.parent.map_or("the MainDevice".to_owned(), |parent| format!("{}", parent.position));
        println!("{} {}, vendor 0x{:08x}, behind {parent}", one.position, one.name, one.identity.vendor_id);
    }
    assert_eq!(bus.subdevices().len(), 9);
    Ok(())
}
