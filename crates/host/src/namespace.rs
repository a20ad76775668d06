//! A network namespace of one's own, with a virtual cable in it, for tests and benches.

use crate::interface::{self, LinkState};
use crate::skipped;
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::process::Command;
use std::time::{Duration, Instant};

/// A private network namespace with a veth pair, `veth0` and `veth1`: what is sent into one end comes out of the
/// other. It and everything in it vanish with the value, even when the process is killed.
#[derive(Debug)]
pub struct Namespace {
    handle: File,
}

/// Why there is no namespace.
#[derive(Debug, thiserror::Error)]
pub enum NamespaceError {
    /// Making namespaces is not allowed here; a test that needs one should say that it was skipped.
    #[error("no right to make a network namespace (CAP_SYS_ADMIN): {0}")]
    MissingRights(io::Error),
    /// The `ip` program is missing or failed; without it there is no cable.
    #[error("`ip {arguments}` failed: {reason}")]
    Ip {
        /// What it was asked to do.
        arguments: String,
        /// What it said.
        reason: String,
    },
    /// The kernel refused another step.
    #[error("{operation} failed: {source}")]
    System {
        /// The step.
        operation: &'static str,
        /// The reason.
        source: io::Error,
    },
}

/// How long the kernel may take to tell of a carrier.
const CARRIER: Duration = Duration::from_secs(10);

impl Namespace {
    /// One end of the cable.
    pub const NEAR: &'static str = "veth0";
    /// The other end of the cable.
    pub const FAR: &'static str = "veth1";

    /// Makes a namespace with a cable whose ends are up.
    pub fn new() -> Result<Self, NamespaceError> {
        // The namespace is made in a thread that ends at once; the open handle keeps it alive.
        let made = std::thread::spawn(|| {
            // SAFETY: unshare has no memory arguments; only this thread moves.
            if unsafe { libc::unshare(libc::CLONE_NEWNET) } != 0 {
                return Err(NamespaceError::MissingRights(io::Error::last_os_error()));
            }
            let handle = File::open("/proc/thread-self/ns/net")
                .map_err(|source| NamespaceError::System { operation: "opening the namespace", source })?;
            ip("link set lo up")?;
            ip(&format!("link add {} type veth peer name {}", Self::NEAR, Self::FAR))?;
            for end in [Self::NEAR, Self::FAR] {
                // Without this the kernel sends IPv6 solicitations of its own into the cable.
                let _ = std::fs::write(format!("/proc/sys/net/ipv6/conf/{end}/disable_ipv6"), "1");
                ip(&format!("link set {end} up"))?;
            }
            // The kernel tells of a carrier some time after it is there, on a busy machine up to a second.
            let begin = Instant::now();
            let is_up = |end| interface::link_state(end) == LinkState::Up;
            while !(is_up(Self::NEAR) && is_up(Self::FAR)) && begin.elapsed() < CARRIER {
                std::thread::sleep(Duration::from_millis(1));
            }
            Ok(Namespace { handle })
        });
        match made.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }

    /// As [`Namespace::new`]; where the rights are missing, `test` is [`skipped`] and gets `None`.
    ///
    /// Panics on any other failure: a test that can't run for another reason must not pass.
    pub fn for_test(test: &str) -> Option<Self> {
        match Self::new() {
            Ok(namespace) => Some(namespace),
            Err(error @ NamespaceError::MissingRights(_)) => {
                skipped(format_args!("{test}: {error}"));
                None
            }
            Err(error) => panic!("{test}: {error}"),
        }
    }

    /// Runs `work` in a thread inside the namespace; sockets that it opens and programs that it starts belong there.
    ///
    /// A panic of `work` goes on in the caller.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        std::thread::scope(|scope| {
            let worker = scope.spawn(|| {
                // SAFETY: the descriptor is an open namespace; only this thread moves.
                let moved = unsafe { libc::setns(self.handle.as_raw_fd(), libc::CLONE_NEWNET) };
                assert_eq!(moved, 0, "entering the namespace: {}", io::Error::last_os_error());
                work()
            });
            match worker.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }

    /// Runs `ip` in the namespace, for example `link set veth1 down`.
    pub fn ip(&self, arguments: &str) -> Result<(), NamespaceError> {
        self.run(|| ip(arguments))
    }
}

/// Runs `ip` in the namespace of the calling thread.
fn ip(arguments: &str) -> Result<(), NamespaceError> {
    let failed = |reason: String| NamespaceError::Ip { arguments: arguments.to_owned(), reason };
    let output = Command::new("ip")
        .args(arguments.split_whitespace())
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if output.status.success() {
        return Ok(());
    }
    Err(failed(String::from_utf8_lossy(&output.stderr).trim().to_owned()))
}
