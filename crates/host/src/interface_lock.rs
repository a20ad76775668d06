//! One program of ours at an interface at a time.
//!
//! The lock is a listening socket with an abstract name: such names belong to the network namespace, as interfaces
//! do, leave no file behind, and are free again however their holder ends. Nothing is ever accepted at it: who
//! connects learns the holder's process from the kernel.
//!
//! A name lives as long as any copy of the socket. A child of the holder has one from its fork to the program that it
//! becomes; so the holder also ends the listening, and a name at which nobody listens is waited for.

use crate::interface;
use crate::raw::OpenError;
use std::io;
use std::mem::size_of;
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::time::{Duration, Instant};

/// How long the copies of an ended holder's socket may live on.
const COPIES: Duration = Duration::from_secs(5);

/// The sole use of an interface, as long as the value lives.
#[derive(Debug)]
pub struct InterfaceLock {
    listener: UnixListener,
}

impl Drop for InterfaceLock {
    fn drop(&mut self) {
        // It can't fail for a socket that listens; if it did, closing would still end it.
        let _ = rustix::net::shutdown(&self.listener, rustix::net::Shutdown::Both);
    }
}

/// Who has an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Its process.
    pub pid: u32,
    /// Its program and what it was asked to do, without options; empty where the system doesn't tell.
    pub command: String,
}

/// Why an interface could not be had.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another program of ours has it.
    #[error("`{interface}` is in use by {}", in_words(.holder.as_ref()))]
    Held {
        /// The interface.
        interface: String,
        /// Who has it; `None` where the system doesn't tell.
        holder: Option<Holder>,
    },
    /// There is no such interface.
    #[error(transparent)]
    Interface(#[from] OpenError),
    /// The operating system refused.
    #[error("taking the lock of `{interface}`: {cause}")]
    System {
        /// The interface.
        interface: String,
        /// Why.
        cause: io::Error,
    },
}

fn in_words(holder: Option<&Holder>) -> String {
    match holder {
        None => "another program of omnibase".to_owned(),
        Some(Holder { pid, command }) if command.is_empty() => format!("process {pid}"),
        Some(Holder { pid, command }) => format!("process {pid} (`{command}`)"),
    }
}

impl InterfaceLock {
    /// Takes the interface `name` of this network namespace, whatever it is called beside that.
    pub fn take(name: &str) -> Result<Self, LockError> {
        let index = interface::index_of(name).ok_or_else(|| OpenError::NoSuchInterface {
            interface: name.to_owned(),
            existing: interface::names(),
        })?;
        let failed = |cause| LockError::System { interface: name.to_owned(), cause };
        let address =
            SocketAddr::from_abstract_name(format!("omnibase-interface-{index}")).map_err(failed)?;
        let begin = Instant::now();
        loop {
            let error = match UnixListener::bind_addr(&address) {
                Ok(listener) => return Ok(InterfaceLock { listener }),
                Err(error) => error,
            };
            if error.kind() != io::ErrorKind::AddrInUse {
                return Err(failed(error));
            }
            match listening(&address) {
                Listening::Nobody if begin.elapsed() < COPIES => std::thread::sleep(Duration::from_millis(1)),
                Listening::Nobody | Listening::Unknown => {
                    return Err(LockError::Held { interface: name.to_owned(), holder: None });
                }
                Listening::Holder(holder) => {
                    return Err(LockError::Held { interface: name.to_owned(), holder: Some(holder) });
                }
            }
        }
    }
}

/// What connecting to a name tells.
enum Listening {
    /// Nobody listens, though the name may still be taken.
    Nobody,
    /// Somebody does, and the system doesn't tell who.
    Unknown,
    Holder(Holder),
}

/// Who listens at `address`.
fn listening(address: &SocketAddr) -> Listening {
    match peer(address) {
        Ok(pid) => {
            pid.map_or(Listening::Unknown, |pid| Listening::Holder(Holder { pid, command: command_of(pid) }))
        }
        Err(rustix::io::Errno::CONNREFUSED) => Listening::Nobody,
        Err(_) => Listening::Unknown,
    }
}

/// The process that listens at `address`; `None` where the system doesn't tell.
fn peer(address: &SocketAddr) -> rustix::io::Result<Option<u32>> {
    // A datagram could wait for ever at a full queue; this one asks and goes.
    let socket = rustix::net::socket_with(
        rustix::net::AddressFamily::UNIX,
        rustix::net::SocketType::STREAM,
        rustix::net::SocketFlags::CLOEXEC | rustix::net::SocketFlags::NONBLOCK,
        None,
    )?;
    let name = address.as_abstract_name().ok_or(rustix::io::Errno::INVAL)?;
    rustix::net::connect(&socket, &rustix::net::SocketAddrUnix::new_abstract_name(name)?)?;
    // SAFETY: ucred is plain data for which zero bytes are valid; pointer and length are those of one live value.
    let peer = unsafe {
        let mut peer: libc::ucred = std::mem::zeroed();
        let mut length = size_of::<libc::ucred>() as libc::socklen_t;
        let asked = libc::getsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_PEERCRED,
            (&raw mut peer).cast(),
            &mut length,
        );
        (asked == 0).then_some(peer)
    };
    Ok(peer.and_then(|peer| u32::try_from(peer.pid).ok()).filter(|pid| *pid != 0))
}

/// A process's program and its arguments up to the first option: options may hold secrets.
fn command_of(pid: u32) -> String {
    let Ok(bytes) = std::fs::read(format!("/proc/{pid}/cmdline")) else { return String::new() };
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let mut words = text.split('\0').filter(|word| !word.is_empty());
    let program = words.next().map(|path| path.rsplit('/').next().unwrap_or(path)).unwrap_or_default();
    let arguments = words.take_while(|word| !word.starts_with('-'));
    let said: Vec<&str> = std::iter::once(program).chain(arguments).collect();
    said.join(" ").escape_debug().take(200).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A child of the holder keeps a copy of the socket until it has become its program.
    #[test]
    fn copies_of_an_ended_holders_socket_are_waited_for() {
        let held = InterfaceLock::take("lo").unwrap();
        let copy = held.listener.try_clone().unwrap();
        drop(held);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(50));
                drop(copy);
            });
            InterfaceLock::take("lo").unwrap();
        });
    }
}
