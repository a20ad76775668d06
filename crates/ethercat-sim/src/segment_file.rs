//! A segment described in TOML.
//!
//! ```toml
//! [[subdevice]]
//! kind = "sgdv"              # sgdv, servo, coupler, digital-io, sii, esi
//! name = "left"              # default: the kind and the position
//! alias = 1                  # station alias, default 0 (none)
//! serial = 1001              # default 0 (none)
//! identification = 7         # what its switch for explicit device identification shows, default none
//! dc_offset_ns = 5_000_000   # its clock at power-on
//! dc_drift_ppm = 50.0        # its quartz, against virtual time
//! cable_delay_ns = 100       # of the cable to its parent
//! parent = "hub"             # default: the one before
//! port = 2                   # of the parent, default: its first free one
//! entry_port = 1             # its own one by which frames come in, default 0; another one is IN and OUT swapped, and
//!                            # frames pass it behind all that hang on it: so positions count
//! count = 20                 # so many of them in a line; names, aliases and serials count up
//! dc_offset_step_ns = 1000   # with count: each has so much more than the one before
//! dc_drift_spread_ppm = 50.0 # with count: drifts spread evenly within ± this
//! ```
//!
//! A SubDevice with `firmware = "socket"` has its chip and SII as its kind says, and its application in a program that
//! connects to the Unix socket `socket` (default: `<name>.pdi` in the current folder), see `docs/pdi-socket.md`.
//!
//! `kind = "sii"` wants `sii = "file.bin"`, an image beside the segment file; `kind = "digital-io"` wants
//! `inputs` and `outputs`, numbers of bits.
//!
//! `kind = "esi"` wants `esi = "maker.xml"` and `device`, a type or `product:revision` in it, and may have
//! `modules`, types in the slots from 1 on, and `module_files`, where they stand.
//!
//! `kind = "servo"` and `"sgdv"` may have a table `[subdevice.servo]` (see `segments/three-sgdv.toml`), and so
//! may an `"esi"` that is a drive (profile 402) of one axis: its motor and its load, its PDOs are those of its
//! file.

mod build;
mod drive;
mod reader;
#[cfg(test)]
mod tests;

pub use build::{ImagesError, line_of_images};

use crate::device::Piece;
use crate::device::axis::Load;
use crate::device::drive::{Drive, DriveKind};
use crate::device::servo::ServoConfig;
use crate::device::simple::{DIGITAL_IO_LIMIT, DigitalIo};
use reader::{Document, TableReader};
use std::ops::Range;
use std::path::PathBuf;

/// The longest line that one entry may stand for.
const COUNT_LIMIT: i64 = 1000;
/// Cables of 20 m, where nothing is said.
const CABLE_DELAY_NS: u32 = 100;

/// Something wrong in a segment file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
    /// What is wrong, with what was expected.
    pub text: String,
}

impl core::fmt::Display for Mistake {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.text)
    }
}

/// Everything that is wrong in a segment file, in the order of lines.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", lines(.problems))]
pub struct SegmentFileError {
    /// The problems, at least one.
    pub problems: Vec<Mistake>,
}

fn lines(problems: &[Mistake]) -> String {
    let lines: Vec<String> = problems.iter().map(Mistake::to_string).collect();
    lines.join("\n")
}

/// What a SubDevice is.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A servo drive and its motor's load.
    Drive(Box<Drive>, Load),
    /// A device from an SII image in a file.
    Sii(PathBuf),
    /// A device from its maker's file.
    Esi(Box<EsiDevice>),
    /// A coupler.
    Coupler,
    /// Digital inputs and outputs.
    DigitalIo(DigitalIo),
}

/// A device of an ESI file.
#[derive(Clone, Debug, PartialEq)]
pub struct EsiDevice {
    /// The file.
    pub file: PathBuf,
    /// Type, or `product:revision`.
    pub device: String,
    /// Modules in its slots by type or ident, from slot 1 on.
    pub modules: Vec<String>,
    /// Files with modules, besides the device's own.
    pub module_files: Vec<PathBuf>,
    /// A drive's servo and its motor's load, where they are given.
    pub servo: Option<(ServoConfig, Load)>,
}

/// Where a SubDevice is plugged in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plug {
    /// Index of the SubDevice nearer to the MainDevice; `None` for the first.
    pub parent: Option<usize>,
    /// Its port; `None` takes the first free one.
    pub port: Option<u8>,
    /// Its own port by which frames come in.
    pub entry_port: u8,
    /// Delay of the cable, ns.
    pub cable_delay_ns: u32,
}

/// One SubDevice of a segment file, repetitions written out.
#[derive(Clone, Debug, PartialEq)]
pub struct SubDeviceEntry {
    /// Name, unique in the file.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// What distinguishes it from others of its kind.
    pub piece: Piece,
    /// Where it is plugged in.
    pub plug: Plug,
    /// The socket to which its firmware connects; `None` for the built-in firmware.
    pub socket: Option<PathBuf>,
    /// Line and column of its entry, from 1.
    pub place: (usize, usize),
}

/// A segment file that was read and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentFile {
    /// Every SubDevice in the order of positions.
    pub sub_devices: Vec<SubDeviceEntry>,
}

impl SegmentFile {
    /// Reads a segment file; all that is wrong comes at once.
    pub fn parse(text: &str) -> Result<Self, SegmentFileError> {
        let (mut document, table) = Document::parse(text);
        let mut sub_devices = Vec::new();
        if document.is_broken() {
            return document.into_result(SegmentFile { sub_devices });
        }
        let mut top = TableReader::new(&table);
        for entry in top.tables("subdevice", &mut document) {
            read_entry(entry, &mut document, &mut sub_devices);
        }
        top.finish(&mut document);
        document.into_result(SegmentFile { sub_devices })
    }
}

/// Reads one `[[subdevice]]` and appends the SubDevices that it stands for.
fn read_entry(mut entry: TableReader, document: &mut Document, sub_devices: &mut Vec<SubDeviceEntry>) {
    let kind = read_kind(&mut entry, document);
    let count = entry.integer("count", 1..=COUNT_LIMIT, document).unwrap_or(1) as usize;
    let name = entry.text("name", document);
    let alias = entry.integer("alias", 0..=0xFFFF, document).unwrap_or(0);
    let serial = entry.integer("serial", 0..=0xFFFF_FFFF, document).unwrap_or(0);
    let identification = entry.integer("identification", 0..=0xFFFF, document);
    let offset = entry.integer("dc_offset_ns", 0..=i64::MAX, document).unwrap_or(0);
    let offset_step = entry.integer("dc_offset_step_ns", 0..=1_000_000_000_000, document).unwrap_or(0);
    let drift = entry.number("dc_drift_ppm", -1000.0..=1000.0, document).unwrap_or(0.0);
    let spread = entry.number("dc_drift_spread_ppm", 0.0..=1000.0, document).unwrap_or(0.0);
    let delay = entry.integer("cable_delay_ns", 0..=1_000_000, document);
    let port = entry.integer("port", 0..=3, document).map(|port| port as u8);
    let entry_port = entry.integer("entry_port", 0..=3, document).unwrap_or(0) as u8;
    let parent = entry.text("parent", document);
    let socket = read_socket(&mut entry, count, document);
    let place = document.place(entry.span());
    let parent = match parent {
        None => sub_devices.len().checked_sub(1),
        Some((name, span)) => {
            let found = sub_devices.iter().position(|sub_device: &SubDeviceEntry| sub_device.name == name);
            if found.is_none() {
                let known: Vec<&str> = sub_devices.iter().map(|known| known.name.as_str()).collect();
                document.problem(
                    span,
                    format!(
                        "no subdevice before this one is named \"{name}\"{}",
                        nearest_hint(&name, &known)
                    ),
                );
            }
            found
        }
    };
    let name_span = name.as_ref().map_or(entry.span(), |(_, span)| span.clone());
    let name = name.map(|(name, _)| name);
    entry.finish(document);
    let Some((kind_name, kind)) = kind else { return };
    let first = sub_devices.len();
    for number in 0..count {
        let name = match &name {
            Some(name) if count == 1 => name.clone(),
            Some(name) => format!("{name}-{}", number + 1),
            None => format!("{kind_name}-{}", first + number),
        };
        if sub_devices.iter().any(|sub_device| sub_device.name == name) {
            document.problem(name_span.clone(), format!("the name \"{name}\" is taken"));
        }
        let counted = |base: i64| if base == 0 { 0 } else { base + number as i64 };
        let plug = Plug {
            parent: if number == 0 { parent } else { Some(first + number - 1) },
            port: port.filter(|_| number == 0),
            entry_port: if number == 0 { entry_port } else { 0 },
            cable_delay_ns: delay.map_or(CABLE_DELAY_NS, |delay| delay as u32),
        };
        let piece = Piece {
            alias: counted(alias) as u16,
            serial: counted(serial) as u32,
            identification: identification.map(|identification| (identification + number as i64) as u16),
            dc_offset_ns: offset as u64 + offset_step as u64 * number as u64,
            dc_drift_ppm: drift + spread * spread_of(number, count),
        };
        let socket = socket.clone().map(|path| match path {
            Some(path) => path,
            None => PathBuf::from(format!("{name}.pdi")),
        });
        sub_devices.push(SubDeviceEntry { name, kind: kind.clone(), piece, plug, socket, place });
    }
}

/// Whether its firmware is elsewhere, and where its socket is told.
fn read_socket(entry: &mut TableReader, count: usize, document: &mut Document) -> Option<Option<PathBuf>> {
    let path = entry.text("socket", document);
    let (firmware, span) = match (entry.text("firmware", document), &path) {
        (None, None) => return None,
        (None, Some((_, span))) => {
            document.problem(span.clone(), "\"socket\" is for firmware = \"socket\"".into());
            return None;
        }
        (Some(firmware), _) => firmware,
    };
    if firmware != "socket" {
        document.problem(span, format!("\"firmware\" must be \"socket\" or left out, found \"{firmware}\""));
        return None;
    }
    if let (Some((_, span)), 2..) = (&path, count) {
        document.problem(span.clone(), "several SubDevices can't share one socket: leave it out".into());
    }
    Some(path.map(|(path, _)| path.into()))
}

/// Evenly spread values from -1 to 1 in an order in which neighbours differ much.
fn spread_of(number: usize, count: usize) -> f64 {
    if count < 2 {
        return 0.0;
    }
    // 37 has no factor in common with any count below 37 and few above; equal values do no harm.
    let place = number * 37 % count;
    2.0 * place as f64 / (count - 1) as f64 - 1.0
}

/// Reads a kind from the table of its SubDevice and the place of its name.
type ReadKind = fn(Range<usize>, &mut TableReader, &mut Document) -> Option<Kind>;

/// All kinds by their names.
const KINDS: [(&str, ReadKind); 6] = [
    ("sgdv", |_, entry, document| Some(drive::read(DriveKind::Sgdv, entry, document))),
    ("servo", |_, entry, document| Some(drive::read(DriveKind::Generic, entry, document))),
    ("coupler", |_, _, _| Some(Kind::Coupler)),
    ("digital-io", read_digital_io),
    ("sii", |place, entry, document| {
        Some(Kind::Sii(need("sii", "the file with the image", place, entry, document)?.into()))
    }),
    ("esi", read_esi),
];

fn read_kind(entry: &mut TableReader, document: &mut Document) -> Option<(String, Kind)> {
    let names = KINDS.map(|(name, _)| name);
    let Some((name, place)) = entry.text("kind", document) else {
        if !entry.has("kind") {
            document
                .problem(entry.span(), format!("the key \"kind\" is missing: one of {}", names.join(", ")));
        }
        entry.ignore_rest();
        return None;
    };
    let Some((_, read)) = KINDS.iter().find(|(known, _)| *known == name) else {
        let text = format!("\"{name}\" is no kind of subdevice{}", nearest_hint(&name, &names));
        document.problem(place, format!("{text}; there are {}", names.join(", ")));
        entry.ignore_rest();
        return None;
    };
    Some((name, read(place, entry, document)?))
}

fn read_digital_io(place: Range<usize>, entry: &mut TableReader, document: &mut Document) -> Option<Kind> {
    let limit = i64::from(DIGITAL_IO_LIMIT);
    let inputs = entry.integer("inputs", 0..=limit, document).unwrap_or(0) as u8;
    let outputs = entry.integer("outputs", 0..=limit, document).unwrap_or(0) as u8;
    if inputs == 0 && outputs == 0 {
        document.problem(place, "digital I/O needs \"inputs\" or \"outputs\"".into());
    }
    Some(Kind::DigitalIo(DigitalIo { inputs, outputs }))
}

fn read_esi(place: Range<usize>, entry: &mut TableReader, document: &mut Document) -> Option<Kind> {
    let file = need("esi", "the maker's file", place.clone(), entry, document);
    let device = need("device", "which device of the file", place, entry, document);
    let mut texts = |key| -> Vec<String> {
        let texts = entry.texts(key, document).unwrap_or_default();
        texts.into_iter().map(|(text, _)| text).collect()
    };
    let (modules, files) = (texts("modules"), texts("module_files"));
    let module_files = files.into_iter().map(PathBuf::from).collect();
    let servo = drive::read_servo(entry, document);
    Some(Kind::Esi(Box::new(EsiDevice { file: file?.into(), device: device?, modules, module_files, servo })))
}

/// A text that must be there; what is missing is noted.
fn need(
    key: &'static str,
    what: &str,
    place: Range<usize>,
    entry: &mut TableReader,
    document: &mut Document,
) -> Option<String> {
    let text = entry.text(key, document);
    if text.is_none() && !entry.has(key) {
        document.problem(place, format!("the key \"{key}\" is missing: {what}"));
    }
    text.map(|(text, _)| text)
}

/// ": did you mean ...?" where something near is known.
fn nearest_hint(name: &str, known: &[&str]) -> String {
    match reader::nearest(name, known) {
        Some(near) => format!("; did you mean \"{near}\"?"),
        None => String::new(),
    }
}
