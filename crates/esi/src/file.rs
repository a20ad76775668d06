//! A whole file.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use roxmltree::{Document, ParsingOptions};

use crate::model::{Device, Module, Vendor, number};
use crate::notes::Notes;
use crate::xml::{Element, Reading};
use crate::{bounds, encoding, read, slots, texts};

/// The largest file that is read, bytes. Makers' largest have some 20 MB.
pub const SIZE_LIMIT: u64 = 64 << 20;
/// The most elements, texts and comments of a file: a node takes some 50 bytes of memory.
pub const NODE_LIMIT: u32 = 4_000_000;

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
    /// It isn't text in the code that it is said to be in.
    #[error("it is no text in {code}: byte {at} can't be read; save it as UTF-8")]
    NotText {
        /// The code.
        code: &'static str,
        /// Where the first wrong byte is, from 0.
        at: usize,
    },
    /// It declares a code that isn't read.
    #[error("its encoding {name} isn't read here; save it as UTF-8")]
    Encoding {
        /// The code's name, quoted.
        name: String,
    },
    /// It isn't XML, or has more of something than is read.
    #[error("it is no XML that can be read: {text}")]
    Xml {
        /// What is wrong and where.
        text: String,
    },
    /// Elements stand too deep in one another.
    #[error("line {line}: elements stand more than {limit} deep in one another")]
    TooDeep {
        /// How deep they may stand.
        limit: usize,
        /// Line, from 1.
        line: u32,
    },
    /// It has more of something than is read.
    #[error("line {line}: there are more than {limit} {what}, which is as many as an ESI file may have here")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// The most.
        limit: usize,
        /// Line, from 1.
        line: u32,
    },
    /// It has more elements, texts and comments than are read.
    #[error(
        "it has more than {NODE_LIMIT} elements, texts and comments, which is as many as an ESI file may have here"
    )]
    TooManyNodes,
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
        let text = encoding::decode(bytes)?;
        bounds::check(&text)?;
        let options =
            ParsingOptions { allow_dtd: false, nodes_limit: NODE_LIMIT, ..ParsingOptions::default() };
        let document = Document::parse_with_options(&text, options).map_err(|error| match error {
            roxmltree::Error::NodesLimitReached => EsiError::TooManyNodes,
            error => EsiError::Xml { text: error.to_string().chars().take(300).collect() },
        })?;
        let reading = Reading::of(&document, &text);
        let root = Element { node: document.root_element(), reading: &reading };
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
        for child in root.children(&mut notes) {
            match child.name() {
                "InfoReference" => self.references.push(child.text()),
                "Vendor" => self.read_vendor(child, &mut notes),
                "Descriptions" => self.read_descriptions(child, &mut notes),
                // A file of modules has them outside of Descriptions.
                "Modules" => self.modules.extend(slots::modules(child, &mut notes)),
                _ => child.skip(&mut notes),
            }
        }
        if self.vendor.id.is_none() && !self.devices.is_empty() {
            root.problem(
                "the vendor has no Id that can be read: nobody can tell its devices on the bus",
                &mut notes,
            );
        }
        if self.devices.is_empty() && self.modules.is_empty() && self.references.is_empty() {
            root.problem("it has no device, no module and no reference to another file", &mut notes);
        }
        root.reading.note_unread(root, &mut notes);
        self.notes = notes;
    }

    fn read_vendor(&mut self, vendor: Element, notes: &mut Notes) {
        for child in vendor.children(notes) {
            match child.name() {
                "Id" => self.vendor.id = child.u32(notes),
                "Name" => texts::name(child, &mut self.vendor.name, notes),
                _ => child.skip(notes),
            }
        }
    }

    fn read_descriptions(&mut self, descriptions: Element, notes: &mut Notes) {
        let mut lines = BTreeMap::new();
        for child in descriptions.children(notes) {
            match child.name() {
                "Groups" => {
                    for group in child.children(notes) {
                        match group.name() {
                            "Group" => self.groups.push(read::group(group, notes)),
                            _ => group.skip(notes),
                        }
                    }
                }
                "Devices" => {
                    for device in child.children(notes) {
                        match device.name() {
                            "Device" => {
                                let read = read::device(device, notes);
                                let numbers = (read.product_code, read.revision);
                                match lines.get(&numbers).filter(|_| read.product_code.is_some()) {
                                    Some(line) => {
                                        let text = format!(
                                            "product code and revision are those of the device of line {line}, which is meant by them"
                                        );
                                        device.problem(text, notes);
                                    }
                                    None => {
                                        lines.insert(numbers, read.line);
                                    }
                                }
                                self.devices.push(read);
                            }
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

impl EsiFile {
    /// The device of this type or name, or of `product:revision` (numbers as in the file, `0x` or decimal).
    ///
    /// Where several revisions of a product have the name, the newest one is meant; several products are told apart by number
    /// alone. Of two with the same numbers the first one is meant.
    pub fn device(&self, wanted: &str) -> Result<&Device, String> {
        let numbers = wanted.split_once(':').and_then(|(product, revision)| {
            Some((crate::xml::parse_number(product)?, crate::xml::parse_number(revision)?))
        });
        let is_meant = |device: &&Device| match numbers {
            Some((product, revision)) => {
                device.product_code.map(i64::from) == Some(product)
                    && device.revision.map(i64::from) == Some(revision)
            }
            None => device.type_name == wanted || device.names.all().iter().any(|(_, name)| name == wanted),
        };
        let found: Vec<&Device> = self.devices.iter().filter(is_meant).collect();
        if let Some(other) = found.iter().find(|device| device.product_code != found[0].product_code) {
            let (one, other) = (found[0].numbers(), other.numbers());
            return Err(format!("several products are called \"{wanted}\": say {one} or {other}"));
        }
        // Of equal ones the last of the iterator is taken.
        found.into_iter().rev().max_by_key(|device| device.revision).ok_or_else(|| {
            let mut known: Vec<&str> = self.devices.iter().map(|device| device.type_name.as_str()).collect();
            known.dedup();
            match known[..] {
                [] => {
                    "the file has no devices; modules go into a device of another file with --slot".to_owned()
                }
                _ => format!("no device of the file is called \"{wanted}\"; it has {}", known.join(", ")),
            }
        })
    }
}

impl Device {
    /// The module for one of its slots, by type or ident (as in the file, `0x` or decimal): of its own list, or of these files.
    /// No name is a slot that stays empty; several modules of a name are told apart by ident alone.
    pub fn module<'a>(
        &'a self,
        files: impl Iterator<Item = &'a EsiFile>,
        wanted: &str,
    ) -> Result<&'a Module, String> {
        if wanted.is_empty() {
            return Ok(Module::none());
        }
        let own = self.slots.iter().flat_map(|slots| &slots.modules);
        let all: Vec<&Module> = own.chain(files.flat_map(|file| &file.modules)).collect();
        let called: Vec<&Module> = all.iter().copied().filter(|module| module.type_name == wanted).collect();
        if let Some(other) = called.iter().find(|module| module.ident != called[0].ident) {
            let (one, other) = (number(called[0].ident), number(other.ident));
            return Err(format!("several modules are called \"{wanted}\": say {one} or {other}"));
        }
        let ident = crate::xml::parse_number(wanted);
        let of_ident =
            || all.iter().copied().find(|module| ident.is_some() && module.ident.map(i64::from) == ident);
        let found = called.first().copied().or_else(of_ident);
        found.ok_or_else(|| {
            format!("no module is called \"{wanted}\" in the files: `omnibase esi FILE --modules` lists them")
        })
    }
}
