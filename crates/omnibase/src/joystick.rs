//! Where commands take a joystick from: a device that may come and go, or a recording.

use anyhow::Context;
use omnibase_joystick::find::OpenError;
use omnibase_joystick::{Device, Finder, Installed, Joystick, Map, Port, Recorded};
use omnibase_robot::config::JoystickTable;
use std::path::{Path, PathBuf};

/// Age of a joystick's values where the file gives none, ms.
const AGE_MS: u32 = 200;

/// What a command is told about a joystick.
#[derive(Clone, Debug, Default)]
pub struct JoystickOptions {
    /// A device or a recording of one; `None`: the first device that fits.
    pub path: Option<PathBuf>,
    /// The robot file's table.
    pub table: JoystickTable,
}

/// A joystick, or where one is looked for.
pub enum Source {
    /// Devices of this machine.
    Installed(Box<Installed>),
    /// A recording, which is plugged in once.
    Recorded(Option<Box<(Recorded, Map)>>),
}

impl Source {
    /// Opens it: what is named must be there and fit now; otherwise the first device that fits is awaited.
    pub fn open(options: &JoystickOptions) -> anyhow::Result<Self> {
        let JoystickOptions { path, table } = options;
        match path {
            Some(path) if !is_device(path) => {
                let words = || format!("`{}`", path.display());
                let bytes = std::fs::read(path).with_context(words)?;
                let recorded = Recorded::from_bytes(&bytes).with_context(words)?;
                let map = Map::of(table, recorded.description())
                    .map_err(|problems| OpenError::Map { path: path.clone(), problems })?;
                Ok(Source::Recorded(Some(Box::new((recorded, map)))))
            }
            Some(path) => {
                let named = JoystickTable { device: Some(path.display().to_string()), ..table.clone() };
                let finder = Installed::new(named);
                finder.open(path)?;
                Ok(Source::Installed(Box::new(finder)))
            }
            None => {
                let finder = Installed::new(table.clone());
                // Named in the file and there, it must fit; where it isn't there yet it is awaited.
                if let Some(device) = table.device.as_deref().map(Path::new).filter(|path| path.exists()) {
                    finder.open(device)?;
                }
                Ok(Source::Installed(Box::new(finder)))
            }
        }
    }

    /// The port at which it is, or will be.
    pub fn port(self, table: &JoystickTable) -> Port<Source> {
        let age_ms = table.age_ms.unwrap_or(AGE_MS);
        Port::new(self, Joystick::new(u64::from(age_ms) * 1_000_000))
    }
}

impl Finder for Source {
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)> {
        match self {
            Source::Installed(finder) => finder.find(),
            Source::Recorded(recorded) => {
                let (device, map) = *recorded.take()?;
                Some((Box::new(device), map))
            }
        }
    }
}

/// Whether this is a device rather than a file.
fn is_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    let kind = std::fs::metadata(path).map(|data| data.file_type());
    // What isn't there is named as a device is: its own message says so.
    kind.map_or(path.starts_with("/dev"), |kind| kind.is_char_device())
}
