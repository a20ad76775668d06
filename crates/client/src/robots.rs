//! Robots that run on this machine: where their dashboards listen, and the token that lets their user command them.
//!
//! Each holds a lock on the file in which it says so. The kernel lets go of it however the robot ends: a token whose
//! lock is free is shown to nobody, for its port may be somebody else's by now.

use crate::Error;
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// The longest wait for a robot of this machine to take a connection.
const CONNECT: Duration = Duration::from_millis(500);
/// Between two attempts at a socket at which too many wait already.
const AGAIN: Duration = Duration::from_millis(10);

/// What is known of a running robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Found {
    /// The robot's name.
    pub robot: String,
    /// Where it listens.
    #[serde(flatten)]
    pub place: Endpoint,
    /// The secret of those who may command it; nothing where its socket is the proof.
    pub token: String,
}

/// Where a robot listens.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Endpoint {
    /// The address of its page.
    Address(SocketAddr),
    /// A socket in the folder of this user alone.
    Socket(PathBuf),
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Endpoint::Address(address) => address.fmt(f),
            Endpoint::Socket(path) => path.display().fmt(f),
        }
    }
}

impl Endpoint {
    /// Whether somebody takes connections there.
    fn answers(&self) -> bool {
        match self {
            Endpoint::Address(address) => TcpStream::connect_timeout(address, CONNECT).is_ok(),
            Endpoint::Socket(path) => connect(path, CONNECT).is_ok(),
        }
    }
}

/// A connection to a robot's socket. A robot that hangs takes none once enough of them wait: that isn't waited for longer
/// than this.
pub fn connect(socket: &Path, longest: Duration) -> io::Result<UnixStream> {
    let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
    let stream = rustix::net::socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    let address = SocketAddrUnix::new(socket)?;
    let until = Instant::now() + longest;
    loop {
        match rustix::net::connect(&stream, &address) {
            Err(Errno::AGAIN) if Instant::now() < until => std::thread::sleep(AGAIN),
            connected => break connected?,
        }
    }
    let stream = UnixStream::from(stream);
    stream.set_nonblocking(false)?;
    Ok(stream)
}

/// Where a robot's socket belongs, in a folder that nobody else can enter.
pub fn socket() -> Result<PathBuf, Error> {
    Ok(made()?.join(format!("{}.socket", unique())))
}

/// A name that no other process gives: the number of one that died comes again, and is another's in another container.
fn unique() -> String {
    // A clock before 1970 gives no name twice at the same time either.
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    format!("{}-{:x}", std::process::id(), now.as_nanos())
}

/// The folder where robots are announced, made where it isn't there.
fn made() -> Result<PathBuf, Error> {
    let place = place();
    fs::DirBuilder::new().recursive(true).mode(0o700).create(&place).map_err(about(&place))?;
    own(place.clone())?.ok_or_else(|| about(&place)(ErrorKind::NotFound.into()))
}

/// An error about a file or folder.
fn about(path: &Path) -> impl Fn(io::Error) -> Error {
    |error| Error::File { path: path.to_owned(), error }
}

/// Says that a robot runs, as long as it lives; only the same user can read it.
pub struct RunningRobot {
    path: PathBuf,
    place: Endpoint,
    /// Locked.
    file: fs::File,
}

impl RunningRobot {
    /// Says it; of a socket before it is made, so that none is left of which nobody knows.
    pub fn announce(robot: &str, place: Endpoint, token: &str) -> Result<Self, Error> {
        let folder = made()?;
        let path = folder.join(match &place {
            Endpoint::Address(address) => PathBuf::from(format!("{}.json", address.port())),
            Endpoint::Socket(socket) => socket.with_extension("json"),
        });
        // Nobody sees it before it is locked.
        let unseen = folder.join(format!("{}.new", unique()));
        let found = Found { robot: robot.to_owned(), place: place.clone(), token: token.to_owned() };
        let file = written(&unseen, &path, &found).map_err(about(&unseen))?;
        Ok(RunningRobot { path, place, file })
    }
}

/// Writes what is found there, and locks it before anybody sees it.
fn written(unseen: &Path, path: &Path, found: &Found) -> io::Result<fs::File> {
    let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(unseen)?;
    file.lock()?;
    file.write_all(serde_json::to_string(found)?.as_bytes())?;
    fs::rename(unseen, path)?;
    Ok(file)
}

impl Drop for RunningRobot {
    fn drop(&mut self) {
        if let Endpoint::Socket(socket) = &self.place {
            let _ = fs::remove_file(socket);
        }
        remove(&self.path, &self.file);
    }
}

/// The robots that said so and live, the latest first; an error where somebody else could have said it.
pub fn robots() -> Result<Vec<Found>, Error> {
    let Some(folder) = own(place())? else { return Ok(Vec::new()) };
    let entries = fs::read_dir(&folder).map_err(about(&folder))?;
    let read = |entry: fs::DirEntry| {
        let path = entry.path();
        let changed = entry.metadata().ok()?.modified().ok()?;
        let found: Found = serde_json::from_str(&fs::read_to_string(&path).ok()?).ok()?;
        lives(&path).then_some((changed, found))
    };
    let mut found: Vec<_> = entries.flatten().filter_map(read).collect();
    found.sort_by_key(|(changed, _)| std::cmp::Reverse(*changed));
    Ok(found.into_iter().map(|(_, found)| found).collect())
}

/// Whether the robot that wrote this file lives; what is left of a dead one is removed.
fn lives(path: &Path) -> bool {
    let Ok(file) = fs::File::open(path) else { return false };
    if file.try_lock_shared().is_err() {
        return true;
    }
    // Of its socket nobody else has the name.
    let _ = fs::remove_file(path.with_extension("socket"));
    remove(path, &file);
    false
}

/// Removes what a robot said, unless another one says something there by now.
fn remove(path: &Path, file: &fs::File) {
    let is_same = |there: fs::Metadata| file.metadata().is_ok_and(|here| here.ino() == there.ino());
    if fs::metadata(path).is_ok_and(is_same) {
        let _ = fs::remove_file(path);
    }
}

/// The folder where nobody but this user can announce a robot; `None` where there is none yet.
fn own(folder: PathBuf) -> Result<Option<PathBuf>, Error> {
    // Not what a link leads to: it may lead elsewhere a moment later.
    let there = match fs::symlink_metadata(&folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        there => there.map_err(about(&folder))?,
    };
    let found = Owned { is_folder: there.is_dir(), user: there.uid(), mode: there.mode() & 0o7777 };
    match found.foreign_to(rustix::process::getuid().as_raw()) {
        None => Ok(Some(folder)),
        Some(found) => Err(Error::Foreign { path: folder, found }),
    }
}

/// What is known of the place where robots are announced.
struct Owned {
    is_folder: bool,
    user: u32,
    mode: u32,
}

impl Owned {
    /// In words, what keeps it from being this user's own.
    fn foreign_to(&self, user: u32) -> Option<String> {
        match self {
            Owned { is_folder: false, .. } => Some("a link or file".to_owned()),
            Owned { user: owner, .. } if *owner != user => Some(format!("one of user {owner}")),
            Owned { mode, .. } if mode & 0o077 != 0 => Some(format!("mode {mode:04o}")),
            _ => None,
        }
    }
}

/// Where running robots are announced.
fn place() -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(folder) if !folder.is_empty() => PathBuf::from(folder).join("omnibase"),
        _ => std::env::temp_dir().join(format!("omnibase-{}", rustix::process::getuid().as_raw())),
    }
}

/// The robot that said so last and answers.
pub fn latest() -> Result<Found, Error> {
    let known = robots()?;
    if known.is_empty() {
        return Err(Error::NoRobot);
    }
    let places: Vec<_> = known.iter().map(|found| found.place.to_string()).collect();
    let found = known.into_iter().find(|found| found.place.answers());
    found.ok_or_else(|| Error::NoAnswer(places.join(", nor at ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_folder_of_this_user_alone_is_trusted() {
        let found = |is_folder, user, mode| Owned { is_folder, user, mode }.foreign_to(1000);
        assert_eq!(found(true, 1000, 0o700), None);
        assert_eq!(found(true, 1000, 0o500), None);
        assert_eq!(found(true, 1001, 0o700).as_deref(), Some("one of user 1001"));
        assert_eq!(found(true, 0, 0o700).as_deref(), Some("one of user 0"));
        assert_eq!(found(true, 1000, 0o770).as_deref(), Some("mode 0770"));
        assert_eq!(found(true, 1000, 0o1777).as_deref(), Some("mode 1777"));
        assert_eq!(found(false, 1000, 0o777).as_deref(), Some("a link or file"));
    }
}
