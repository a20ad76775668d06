//! Any bytes as an FoE message: read without a panic, and what was read survives being written.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat_wire::foe::Message;

fuzz_target!(|bytes: &[u8]| {
    let Ok(message) = Message::read(bytes) else { return };
    let mut again = vec![0; bytes.len() + 8];
    let length = message.write(&mut again);
    assert!(length <= bytes.len());
    assert_eq!(Message::read(&again[..length]), Ok(message));
});
