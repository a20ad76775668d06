//! One program of ours at an interface at a time.
//!
//! The lock is a listening socket with an abstract name: such names belong to the network namespace, as interfaces
//! do, leave no file behind, and are free again however their holder ends. Nothing is ever accepted at it: who
//! connects learns the holder's process from the kernel.

use crate::interface;
use crate::raw::OpenError;
use std::io;
use std::mem::size_of;
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};

/// The sole use of an interface, as long as the value lives.
#[derive(Debug)]
pub struct InterfaceLock {
    _listener: UnixListener,
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
        match UnixListener::bind_addr(&address) {
            Ok(listener) => Ok(InterfaceLock { _listener: listener }),
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                Err(LockError::Held { interface: name.to_owned(), holder: holder(&address) })
            }
            Err(error) => Err(failed(error)),
        }
    }
}

/// Who listens at `address`.
fn holder(address: &SocketAddr) -> Option<Holder> {
    // A datagram could wait for ever at a full queue; this one asks and goes.
    let socket = rustix::net::socket_with(
        rustix::net::AddressFamily::UNIX,
        rustix::net::SocketType::STREAM,
        rustix::net::SocketFlags::CLOEXEC | rustix::net::SocketFlags::NONBLOCK,
        None,
    )
    .ok()?;
    let name = rustix::net::SocketAddrUnix::new_abstract_name(address.as_abstract_name()?).ok()?;
    rustix::net::connect(&socket, &name).ok()?;
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
    }?;
    let pid = u32::try_from(peer.pid).ok().filter(|pid| *pid != 0)?;
    Some(Holder { pid, command: command_of(pid) })
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
