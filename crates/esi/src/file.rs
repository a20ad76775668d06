//! A whole file.

use std::io::Read;
use std::path::Path;

use roxmltree::{Document, ParsingOptions};

use crate::model::{Device, Module, Vendor};
use crate::notes::Notes;
use crate::xml::Element;
use crate::{read, slots, texts};

/// The largest file that is read, bytes. Makers' largest have some 20 MB.
pub const SIZE_LIMIT: u64 = 64 << 20;
/// The most elements, texts and comments of a file: a node takes some 50 bytes of memory.
pub const NODE_LIMIT: u32 = 4_000_000;
/// The deepest nesting. The standard's deepest element is some 15 deep.
const DEPTH_LIMIT: usize = 64;

/// Why a file can't be read at all.
#[derive(Debug, thiserror::Error)]
pub enum EsiError {
    /// It can't be opened or read.
    #[error("reading it: {0}")]
    Io(#[from] std::io::Error),
    /// It is too large.
    #[error("it has more than {limit} bytes, which is as large as an ESI file may be here")]
    TooLarge {
        /// The most.
        limit: u64,
    },
    /// It isn't text in UTF-8.
    #[error("it is no text in UTF-8: byte {at} can't be read; save it as UTF-8")]
    NotUtf8 {
        /// Where the first wrong byte is, from 0.
        at: usize,
    },
    /// It isn't XML, or has more of something than is read.
    #[error("it is no XML that can be read: {text}")]
    Xml {
        /// What is wrong and where.
        text: String,
    },
    /// Elements stand too deep in one another.
    #[error("line {line}: elements stand more than {DEPTH_LIMIT} deep in one another")]
    TooDeep {
        /// Line, from 1.
        line: u32,
    },
    /// It is XML of another kind.
    #[error("it is no ESI file: expected the element EtherCATInfo or EtherCATModule, found {found}")]
    OtherDocument {
        /// The outermost element.
        found: String,
    },
}

/// What an ESI file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EsiFile {
    /// Who made the devices.
    pub vendor: Vendor,
    /// Other files that the file refers to, as it names them.
    pub references: Vec<String>,
    /// Groups of devices: name in the file, and the English one.
    pub groups: Vec<(String, String)>,
    /// Devices, in the order of the file.
    pub devices: Vec<Device>,
    /// Modules, in the order of the file.
    pub modules: Vec<Module>,
    /// What isn't read, and what is wrong.
    pub notes: Notes,
}

impl EsiFile {
    /// Reads a file of at most [`SIZE_LIMIT`] bytes.
    pub fn read(path: &Path) -> Result<Self, EsiError> {
        let mut bytes = Vec::new();
        std::fs::File::open(path)?.take(SIZE_LIMIT + 1).read_to_end(&mut bytes)?;
        EsiFile::parse(&bytes)
    }

    /// Reads the bytes of a file.
    pub fn parse(bytes: &[u8]) -> Result<Self, EsiError> {
        if bytes.len() as u64 > SIZE_LIMIT {
            return Err(EsiError::TooLarge { limit: SIZE_LIMIT });
        }
        let text =
            std::str::from_utf8(bytes).map_err(|error| EsiError::NotUtf8 { at: error.valid_up_to() })?;
        let options =
            ParsingOptions { allow_dtd: false, nodes_limit: NODE_LIMIT, ..ParsingOptions::default() };
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let document = Document::parse_with_options(text, options).map_err(|error| {
            let error = error.to_string();
            EsiError::Xml { text: error.chars().take(300).collect() }
        })?;
        let root = Element(document.root_element());
        check_depth(root)?;
        if !matches!(root.name(), "EtherCATInfo" | "EtherCATModule") {
            let found = crate::xml::quoted(root.name());
            return Err(EsiError::OtherDocument { found });
        }
        let mut file = EsiFile::default();
        file.read_root(root);
        Ok(file)
    }

    fn read_root(&mut self, root: Element) {
        let mut notes = Notes::default();
        root.attributes(&[], &mut notes);
        for child in root.children() {
            match child.name() {
                "InfoReference" => self.references.push(child.text()),
                "Vendor" => self.read_vendor(child, &mut notes),
                "Descriptions" => self.read_descriptions(child, &mut notes),
                // A file of modules has them outside of Descriptions.
                "Modules" => self.modules.extend(slots::modules(child, &mut notes)),
                _ => child.skip(&mut notes),
            }
        }
        self.notes = notes;
    }

    fn read_vendor(&mut self, vendor: Element, notes: &mut Notes) {
        vendor.attributes(&[], notes);
        for child in vendor.children() {
            match child.name() {
                "Id" => self.vendor.id = child.u32(notes),
                "Name" => texts::name(child, &mut self.vendor.name, notes),
                _ => child.skip(notes),
            }
        }
    }

    fn read_descriptions(&mut self, descriptions: Element, notes: &mut Notes) {
        for child in descriptions.children() {
            match child.name() {
                "Groups" => {
                    for group in child.children() {
                        match group.name() {
                            "Group" => self.groups.push(read::group(group, notes)),
                            _ => group.skip(notes),
                        }
                    }
                }
                "Devices" => {
                    for device in child.children() {
                        match device.name() {
                            "Device" => self.devices.push(read::device(device, notes)),
                            _ => device.skip(notes),
                        }
                    }
                }
                "Modules" => self.modules.extend(slots::modules(child, notes)),
                _ => child.skip(notes),
            }
        }
    }
}

/// Refuses what stands too deep: reading goes down by calls.
fn check_depth(root: Element) -> Result<(), EsiError> {
    let (mut node, mut depth) = (root.0, 1);
    loop {
        if depth > DEPTH_LIMIT {
            return Err(EsiError::TooDeep { line: Element(node).line() });
        }
        if let Some(child) = node.first_child() {
            (node, depth) = (child, depth + 1);
            continue;
        }
        while node.next_sibling().is_none() || node == root.0 {
            if node == root.0 {
                return Ok(());
            }
            let Some(parent) = node.parent() else { return Ok(()) };
            (node, depth) = (parent, depth - 1);
        }
        let Some(next) = node.next_sibling() else { return Ok(()) };
        node = next;
    }
}

impl EsiFile {
    /// The device of this type or name, or of `product:revision` (numbers as in the file, `0x` or decimal).
    ///
    /// Where several revisions have the name, the newest one is meant that no other one asked for by number.
    pub fn device(&self, wanted: &str) -> Result<&Device, String> {
        let numbers = wanted.split_once(':').and_then(|(product, revision)| {
            Some((crate::xml::parse_number(product)?, crate::xml::parse_number(revision)?))
        });
        let is_meant = |device: &&Device| match numbers {
            Some((product, revision)) => {
                device.product_code.map(i64::from) == Some(product) && i64::from(device.revision) == revision
            }
            None => device.type_name == wanted || device.names.all().iter().any(|(_, name)| name == wanted),
        };
        let found = self.devices.iter().filter(is_meant).max_by_key(|device| device.revision);
        found.ok_or_else(|| {
            let mut known: Vec<&str> = self.devices.iter().map(|device| device.type_name.as_str()).collect();
            known.dedup();
            format!("no device of the file is called \"{wanted}\"; it has {}", known.join(", "))
        })
    }

    /// The module of this type for a device: of the device's own list first.
    pub fn module<'a>(&'a self, device: &'a Device, wanted: &str) -> Option<&'a Module> {
        let own = device.slots.iter().flat_map(|slots| &slots.modules);
        own.chain(&self.modules).find(|module| module.type_name == wanted)
    }
}
