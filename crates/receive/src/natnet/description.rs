//! Who is in the frames: ids by the names that people gave.

use std::collections::BTreeMap;

use super::Version;
use crate::cursor::Cursor;

/// From these versions on descriptions say how many bytes they have; markers have names; bodies have a turn of their own.
const SIZED: Version = Version { major: 4, minor: 1 };
const NAMED_MARKERS: Version = Version { major: 4, minor: 0 };
const TURNED: Version = Version { major: 4, minor: 2 };
/// More than so many of anything is a description that is read wrongly.
const MOST: u32 = 4096;

/// The streaming ids of the rigid bodies by their names; `None` where the bytes end too early. Before 4.1 what stands behind
/// something else than sets of markers and rigid bodies isn't read: Motive sends those first.
pub fn body_names(bytes: &[u8], version: Version) -> Option<BTreeMap<String, u32>> {
    let mut at = Cursor::new(bytes);
    let mut names = BTreeMap::new();
    for _ in 0..at.u32().filter(|count| *count <= MOST)? {
        let sort = at.u32()?;
        let mut own = at;
        if version >= SIZED {
            let size = at.u32()? as usize;
            own = Cursor::new(at.take(size)?);
        }
        match sort {
            0 => marker_set(&mut own)?,
            1 => {
                let (name, id) = rigid_body(&mut own, version)?;
                names.insert(name, id);
            }
            _ if version >= SIZED => {}
            _ => break,
        }
        if version < SIZED {
            at = own;
        }
    }
    Some(names)
}

fn marker_set(at: &mut Cursor<'_>) -> Option<()> {
    at.text()?;
    let count = at.u32().filter(|count| *count <= MOST)?;
    (0..count).try_for_each(|_| at.text().map(drop))
}

fn rigid_body(at: &mut Cursor<'_>, version: Version) -> Option<(String, u32)> {
    let name = String::from_utf8_lossy(at.text()?).into_owned();
    let id = at.u32()?;
    // Its parent, its place there, its turn, then its markers.
    at.take(16)?;
    if version >= TURNED {
        at.take(16)?;
    }
    let markers = at.u32().filter(|count| *count <= MOST)?;
    at.take(markers as usize * 16)?;
    if version >= NAMED_MARKERS {
        (0..markers).try_for_each(|_| at.text().map(drop))?;
    }
    Some((name, id))
}
