//! Ending on Ctrl-C.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

extern "C" fn on_signal(_: libc::c_int) {
    STOP.store(true, Ordering::Relaxed);
}

/// A flag that becomes true at the first SIGINT (Ctrl-C) or SIGTERM; a second one ends the process at once.
///
/// System calls that wait are cut short, so that the flag is seen soon.
pub fn stop_on_signals() -> io::Result<&'static AtomicBool> {
    for signal in [libc::SIGINT, libc::SIGTERM] {
        // SAFETY: sigaction is plain data for which zero bytes are valid (no flags, empty mask); the handler does
        // nothing but store to an atomic, which is allowed in a signal handler.
        let result = unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_signal as extern "C" fn(libc::c_int) as libc::sighandler_t;
            // The default comes back after the first signal.
            action.sa_flags = libc::SA_RESETHAND;
            libc::sigaction(signal, &action, std::ptr::null_mut())
        };
        if result != 0 {
            return Err(io::Error::last_os_error());
        }
    }
    Ok(&STOP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_signal_sets_the_flag() {
        let stop = stop_on_signals().unwrap();
        assert!(!stop.load(Ordering::Relaxed));
        // SAFETY: raise has no memory arguments; the handler was just set.
        unsafe { libc::raise(libc::SIGTERM) };
        assert!(stop.load(Ordering::Relaxed));
    }
}
