//! A frame: what the cameras saw at one instant.

use super::Version;
use crate::cursor::Cursor;

/// From this version on each section says how many bytes it has.
const SIZED: Version = Version { major: 4, minor: 1 };
/// Sections of a frame end somewhere: more than so many of anything is a frame that is read wrongly.
const MOST: u32 = 4096;

/// A rigid body in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Its streaming id.
    pub id: u32,
    /// Where it is, in the server's unit and axes.
    pub position: [f64; 3],
    /// How it is turned: x, y, z and w of a quaternion.
    pub rotation: [f64; 4],
    /// Mean error of its markers, in the server's unit.
    pub error: f64,
    /// Whether the cameras see it now.
    pub is_tracked: bool,
}

/// What of a frame counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// All rigid bodies.
    pub bodies: Vec<Body>,
    /// When the cameras' shutters were half open, ticks of the server's clock; 0 where it doesn't say.
    pub exposed_ticks: u64,
    /// When it was sent.
    pub sent_ticks: u64,
}

impl Frame {
    /// Reads what stands behind a frame's head; `None` where it ends too early, or where a section isn't as long as it says.
    pub fn from_bytes(bytes: &[u8], version: Version) -> Option<Frame> {
        let mut at = Sections { at: Cursor::new(bytes), version };
        let number = at.at.u32()?;
        // Sets of markers, and markers of nobody.
        at.section(|at| {
            at.text()?;
            let count = few(at.u32()?)?;
            at.take(count * 12).map(drop)
        })?;
        at.section(|at| at.take(12).map(drop))?;
        let mut bodies = Vec::new();
        at.section(|at| {
            bodies.push(body(at)?);
            Some(())
        })?;
        // Skeletons, and from 4.1 on assets.
        at.section(|at| {
            at.u32()?;
            let count = few(at.u32()?)?;
            (0..count).try_for_each(|_| body(at).map(drop))
        })?;
        if version >= SIZED {
            at.section(|at| {
                at.u32()?;
                let bodies = few(at.u32()?)?;
                (0..bodies).try_for_each(|_| body(at).map(drop))?;
                let markers = few(at.u32()?)?;
                at.take(markers * 26).map(drop)
            })?;
        }
        // Markers with a label: id, place, size, flags, residual.
        at.section(|at| at.take(26).map(drop))?;
        // Force plates, and devices.
        for _ in 0..2 {
            at.section(|at| {
                at.u32()?;
                let channels = few(at.u32()?)?;
                (0..channels).try_for_each(|_| {
                    let samples = few(at.u32()?)?;
                    at.take(samples * 4).map(drop)
                })
            })?;
        }
        // Time code, its part, and a time as a number.
        let _ = at.at.take(16)?;
        let (exposed_ticks, _received, sent_ticks) = (at.at.u64()?, at.at.u64()?, at.at.u64()?);
        Some(Frame { number, bodies, exposed_ticks, sent_ticks })
    }
}

/// A count that can be.
fn few(count: u32) -> Option<usize> {
    (count <= MOST).then_some(count as usize)
}

fn body(at: &mut Cursor<'_>) -> Option<Body> {
    Some(Body {
        id: at.u32()?,
        position: at.f32s()?,
        rotation: at.f32s()?,
        error: at.f32s::<1>()?[0],
        is_tracked: at.u16()? & 1 == 1,
    })
}

/// The sections of a frame, one after the other.
struct Sections<'a> {
    at: Cursor<'a>,
    version: Version,
}

impl Sections<'_> {
    /// Reads one of each that a section has; from 4.1 on exactly as many bytes as it says.
    fn section(&mut self, mut each: impl FnMut(&mut Cursor<'_>) -> Option<()>) -> Option<()> {
        let count = few(self.at.u32()?)?;
        if self.version < SIZED {
            return (0..count).try_for_each(|_| each(&mut self.at));
        }
        let size = self.at.u32()? as usize;
        let mut own = Cursor::new(self.at.take(size)?);
        (0..count).try_for_each(|_| each(&mut own))?;
        own.is_empty().then_some(())
    }
}
