//! Work that must not stop in the middle.

use crate::progress::warn;
use omnibase_host::stop_on_signals;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Between two looks whether somebody asked for an end.
const LOOK: Duration = Duration::from_millis(20);

/// Does `work`, which leaves a SubDevice with `half` if it's cut off: who asks for an end (Ctrl-C) is told so at once, and it
/// goes on; a second time ends the process.
pub fn to_the_end<T>(half: &str, work: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    let asked = stop_on_signals()?;
    thread::scope(|scope| {
        // Gone when the work is, however it ends.
        let (_working, is_working) = channel::<()>();
        scope.spawn(move || {
            while !asked.load(Ordering::Relaxed) {
                if is_working.recv_timeout(LOOK) != Err(RecvTimeoutError::Timeout) {
                    return;
                }
            }
            warn(format_args!(
                "not ended: the device would be left with {half}; Ctrl-C again ends it all the same"
            ));
        });
        work()
    })
}
