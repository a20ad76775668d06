//! Ending on Ctrl-C.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

extern "C" fn on_signal(signal: libc::c_int) {
    if STOP.swap(true, Ordering::Relaxed) {
        // SAFETY: allowed in a signal handler; nothing of the process runs after it.
        unsafe { libc::_exit(128 + signal) };
    }
}

/// A flag that becomes true at the first SIGINT (Ctrl-C), SIGQUIT (Ctrl-\), SIGTERM or SIGHUP (the terminal is gone); a
/// second signal of them ends the process at once, with the exit code of a process that a signal ended.
///
/// A SIGHUP that was ignored from the start (`nohup`) stays ignored. System calls that wait are cut short, so that
/// the flag is seen soon. A file that reaches its size limit (SIGXFSZ) is no reason to end: the write fails.
pub fn stop_on_signals() -> io::Result<&'static AtomicBool> {
    // SAFETY: no handler of ours; a write beyond the limit then fails with an error number, like one on a full disk.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    for signal in [libc::SIGINT, libc::SIGQUIT, libc::SIGTERM, libc::SIGHUP] {
        // SAFETY: sigaction is plain data for which zero bytes are valid (no flags, empty mask); the handler does
        // nothing but swap an atomic and _exit, which are allowed in a signal handler.
        let result = unsafe {
            let mut before: libc::sigaction = std::mem::zeroed();
            if libc::sigaction(signal, std::ptr::null(), &mut before) == 0
                && signal == libc::SIGHUP
                && before.sa_sigaction == libc::SIG_IGN
            {
                continue;
            }
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = on_signal as extern "C" fn(libc::c_int) as libc::sighandler_t;
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
