//! Any bytes as a recording: read to its last complete cycle, and computed again without harm.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_record::run::RecordedRun;
use omnibase_robot::Registry;

fuzz_target!(|bytes: &[u8]| {
    let Ok(run) = RecordedRun::read(bytes) else { return };
    assert_eq!(run.values.len() % run.schema.width().max(1), 0);
    let _ = omnibase_run::replay(&run, &Registry::with_built_in());
});
