//! Which devices there are, and the one that a map fits.

use std::io;
use std::path::{Path, PathBuf};

use omnibase_robot::config::JoystickTable;

use crate::description::Description;
use crate::device::{Device, EvdevDevice};
use crate::map::{JoystickMapError, Map};

/// Where the kernel shows its input devices.
pub const FOLDER: &str = "/dev/input";

/// Looks for a device, again and again as long as there is none.
pub trait Finder: Send {
    /// The device that shall drive, with its map; `None` where there is none now.
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)>;
}

/// One device that is there.
#[derive(Debug)]
pub struct Listed {
    /// Where.
    pub path: PathBuf,
    /// What it is, or why it can't be opened.
    pub description: io::Result<Description>,
}

/// All event devices of a folder, in the order of their numbers.
///
/// # Errors
/// The folder can't be read; one that isn't there is empty.
pub fn list(folder: &Path) -> io::Result<Vec<Listed>> {
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut paths: Vec<(u32, PathBuf)> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let number = path.file_name()?.to_str()?.strip_prefix("event")?.parse().ok()?;
            Some((number, path))
        })
        .collect();
    paths.sort();
    let describe = |path: PathBuf| {
        let description = EvdevDevice::open(&path).map(|device| device.description().clone());
        Listed { path, description }
    };
    Ok(paths.into_iter().map(|(_, path)| describe(path)).collect())
}

/// Finds the file's device, else the first one that the file's map fits.
#[derive(Clone, Debug)]
pub struct Installed {
    table: JoystickTable,
    folder: PathBuf,
}

/// Why a named device can't drive.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// It can't be opened.
    #[error("{path}: {source}{}", hint(.source))]
    Device {
        /// Which.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// No map fits it.
    #[error("{path}: {}", lines(.problems))]
    Map {
        /// Which.
        path: PathBuf,
        /// Why not.
        problems: Vec<JoystickMapError>,
    },
}

fn hint(error: &io::Error) -> &'static str {
    if error.kind() == io::ErrorKind::PermissionDenied {
        " (whoever reads input devices belongs to the group `input`)"
    } else {
        ""
    }
}

fn lines(problems: &[JoystickMapError]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n  ")
}

impl Installed {
    /// What the file names, among the devices of this machine.
    pub fn new(table: JoystickTable) -> Self {
        Installed { table, folder: FOLDER.into() }
    }

    /// Opens a device by its path.
    ///
    /// # Errors
    /// It can't be opened, or no map fits it.
    pub fn open(&self, path: &Path) -> Result<(EvdevDevice, Map), OpenError> {
        let device =
            EvdevDevice::open(path).map_err(|source| OpenError::Device { path: path.to_owned(), source })?;
        let map = Map::of(&self.table, device.description())
            .map_err(|problems| OpenError::Map { path: path.to_owned(), problems })?;
        Ok((device, map))
    }

    /// The path of the device that would be taken now.
    ///
    /// A gamepad shows itself as several devices with the same ids, its motion sensors and its touchpad among them: only
    /// the one that has all that the map names fits.
    pub fn path(&self) -> Option<PathBuf> {
        if let Some(path) = &self.table.device {
            return Some(path.into());
        }
        let listed = list(&self.folder).ok()?;
        let fits = |listed: &Listed| {
            listed.description.as_ref().is_ok_and(|device| Map::of(&self.table, device).is_ok())
        };
        listed.into_iter().find(fits).map(|listed| listed.path)
    }
}

impl Finder for Installed {
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)> {
        let (device, map) = self.open(&self.path()?).ok()?;
        Some((Box::new(device), map))
    }
}
