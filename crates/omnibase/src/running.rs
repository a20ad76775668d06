//! Robots that run on this machine: where their dashboards listen, and the token that lets their user command them.
//!
//! Each holds a lock on the file in which it says so. The kernel lets go of it however the robot ends: a token whose
//! lock is free is shown to nobody, for its port may be somebody else's by now.

use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The longest wait for a robot of this machine to take a connection.
const CONNECT: Duration = Duration::from_millis(500);

/// What is known of a running robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Found {
    /// The robot's name.
    pub robot: String,
    /// Where its dashboard listens.
    pub address: SocketAddr,
    /// The secret of those who may command it.
    pub token: String,
}

/// Says that a robot runs, as long as it lives; only the same user can read it.
pub struct RunningRobot {
    path: PathBuf,
    /// Locked.
    _file: fs::File,
}

impl RunningRobot {
    /// Says it.
    pub fn announce(robot: &str, address: SocketAddr, token: &str) -> anyhow::Result<Self> {
        let folder = folder();
        fs::DirBuilder::new().recursive(true).mode(0o700).create(&folder)?;
        let owner = fs::metadata(&folder)?;
        let own = owner.uid() == rustix::process::getuid().as_raw() && owner.mode() & 0o077 == 0;
        anyhow::ensure!(own, "{}: expected a folder of this user alone", folder.display());
        let path = folder.join(format!("{}.json", address.port()));
        // Nobody sees it before it is locked.
        let unseen = folder.join(format!("{}.new", std::process::id()));
        let _ = fs::remove_file(&unseen);
        let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(&unseen)?;
        file.lock()?;
        let found = Found { robot: robot.to_owned(), address, token: token.to_owned() };
        file.write_all(serde_json::to_string(&found)?.as_bytes())?;
        fs::rename(&unseen, &path)?;
        Ok(RunningRobot { path, _file: file })
    }
}

impl Drop for RunningRobot {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// The robots that said so and live, the latest first.
pub fn robots() -> Vec<Found> {
    let Ok(entries) = fs::read_dir(folder()) else { return Vec::new() };
    let read = |entry: fs::DirEntry| {
        let path = entry.path();
        let changed = entry.metadata().ok()?.modified().ok()?;
        let found: Found = serde_json::from_str(&fs::read_to_string(&path).ok()?).ok()?;
        lives(&path).then_some((changed, found))
    };
    let mut found: Vec<_> = entries.flatten().filter_map(read).collect();
    found.sort_by_key(|(changed, _)| std::cmp::Reverse(*changed));
    found.into_iter().map(|(_, found)| found).collect()
}

/// Whether the robot that wrote this file lives; what is left of a dead one is removed.
fn lives(path: &Path) -> bool {
    let Ok(file) = fs::File::open(path) else { return false };
    if file.try_lock_shared().is_err() {
        return true;
    }
    let is_same = |there: fs::Metadata| file.metadata().is_ok_and(|here| here.ino() == there.ino());
    if fs::metadata(path).is_ok_and(is_same) {
        let _ = fs::remove_file(path);
    }
    false
}

/// Where running robots are announced: of this user alone.
fn folder() -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(folder) if !folder.is_empty() => PathBuf::from(folder).join("omnibase"),
        _ => std::env::temp_dir().join(format!("omnibase-{}", rustix::process::getuid().as_raw())),
    }
}

/// The robot that is meant: at `address`, or the latest on this machine.
pub fn robot(address: Option<SocketAddr>, token: Option<&str>) -> anyhow::Result<Found> {
    let known = robots();
    let found = match address {
        Some(address) => known
            .into_iter()
            .find(|found| found.address.port() == address.port() && address.ip().is_loopback())
            .map(|found| Found { address, ..found })
            .unwrap_or(Found { robot: String::new(), address, token: String::new() }),
        None => {
            anyhow::ensure!(
                !known.is_empty(),
                "no robot runs on this machine under this user: start one by `omnibase run <robot.toml> \
                 --dashboard`, or say where by --at ADDRESS and --token TOKEN"
            );
            let places: Vec<_> = known.iter().map(|found| found.address.to_string()).collect();
            let answers = |found: &Found| TcpStream::connect_timeout(&found.address, CONNECT).is_ok();
            let found = known.into_iter().find(answers);
            found.with_context(|| format!("no robot answers at {}", places.join(", nor at ")))?
        }
    };
    Ok(Found { token: token.map_or(found.token, str::to_owned), ..found })
}
