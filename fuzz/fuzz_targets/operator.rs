//! Any text as what a client asks of the robot's page: refused, or a call that says the same when written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_dashboard::call::Call;

fuzz_target!(|bytes: &[u8]| {
    let Ok(call) = serde_json::from_slice::<Call>(bytes) else { return };
    let text = serde_json::to_string(&call).expect("a call is JSON");
    let again: Call = serde_json::from_str(&text).expect("our own words");
    assert_eq!(serde_json::to_string(&again).unwrap(), text);
});
