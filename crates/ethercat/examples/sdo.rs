//! Objects of a servo: read one, write one, and see what a refusal says.

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::{Bus, BusOptions, SetUpError};
use omnibase_ethercat_sim::{SegmentFile, in_process};
use std::path::Path;

const PROFILE_VELOCITY: ObjectAddress = ObjectAddress::new(0x6081, 0);
const STATUS_WORD: ObjectAddress = ObjectAddress::new(0x6041, 0);

/// Talks to the first of three simulated servos.
pub fn main() -> Result<(), SetUpError> {
    let text = include_str!("../../../segments/three-servos.toml");
    let segment = SegmentFile::parse(text).unwrap().build(Path::new("segments")).unwrap();
    let (link, clock) = in_process(segment);
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan()?;
    // PRE-OP: from here on there are mailboxes. No configuration: each SubDevice as it describes itself.
    bus.configure(&[])?;

    bus.sdo_write(0, PROFILE_VELOCITY, &50_000u32.to_le_bytes())?;
    let read = bus.sdo_read(0, PROFILE_VELOCITY, SdoAccess::Entry)?;
    println!("{PROFILE_VELOCITY} is {read:?}");
    assert_eq!(read, 50_000u32.to_le_bytes());

    let refused = bus.sdo_write(0, STATUS_WORD, &[0, 0]).unwrap_err();
    println!("as it should be: {refused}");
    assert!(refused.to_string().contains("read-only"));
    Ok(())
}
