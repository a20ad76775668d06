//! ESI files (EtherCAT Slave Information, ETG.2000): what a maker says of its devices.
//!
//! - [`EsiFile::read`] and [`EsiFile::parse`]: a file to [`Device`]s and [`Module`]s. Nothing is dropped in silence: what has
//!   no meaning here stands in [`Notes::unread`] with its path and line, what is wrong in [`Notes::problems`].
//! - [`model`]: what is read, in the standard's words.
//! - [`Assembly`]: a device with modules in its slots; which PDOs count, what is written at which transition.
//! - [`image`]: the SII (EEPROM) image that follows from a device.
//!
//! Files are bounded: [`SIZE_LIMIT`] bytes, [`NODE_LIMIT`] nodes, 256 attributes in one element, 64 elements deep, no document
//! type (so no entities of their own). They are UTF-8, UTF-16 with its mark, ISO 8859-1 or Windows-1252.
#![forbid(unsafe_code)]

mod assembly;
mod bounds;
mod dictionary;
mod doubt;
mod encoding;
mod file;
pub mod image;
mod mailbox;
pub mod model;
mod names;
mod notes;
mod pdo;
mod read;
mod slots;
mod texts;
mod xml;

pub use assembly::{Assembly, AssemblyError, Command, CommandSource};
pub use doubt::Doubt;
pub use file::{EsiError, EsiFile, NODE_LIMIT, SIZE_LIMIT};
pub use model::{Device, Module};
pub use names::Names;
pub use notes::{FileNote, Notes, Unread, Why};
