//! Elements of a document, read one by one: whatever nobody asks for is noted in the end.

use std::cell::RefCell;

use roxmltree::{Attribute, Document, Node};

use crate::notes::{FileNote, Notes, Why};

/// Elements and attributes that the standard knows and nothing here needs, wherever they stand.
const UNUSED: [&str; 55] = [
    "URL",
    "Image16x14",
    "ImageFile16x14",
    "ImageData16x14",
    "ImageFile",
    "Comment",
    "VendorSpecific",
    "noNamespaceSchemaLocation",
    "Version",
    "FileVersion",
    "UniqueName",
    "DiagMessages",
    "SortOrder",
    "ParentGroup",
    "VendorUrl",
    "SafetyMapping",
    "SafetyParaMapping",
    "MinSize",
    "MaxSize",
    "Su",
    "IP",
    "MAC",
    "TimeStamp",
    "ChannelCount",
    "DriveFollowsBit3Support",
    "EdsFile",
    "MaxSlotCount",
    "MaxSlotGroupCount",
    "SlotGroupIndexIncrement",
    "SlotGroupPdoIncrement",
    "IdentifyModuleBy",
    "ProductRevision",
    "OverwrittenByModule",
    "AdaptAutomatically",
    "UnknownFRMW",
    "Unknown64Bit",
    "ExternalRefClock",
    "PotentialReferenceClock",
    "BitOffs",
    "Category",
    "SdoAccess",
    "Backup",
    "Setting",
    "ReadRestrictions",
    "Invisible",
    "Default",
    "OutputDelayTime",
    "Input",
    "CheckProductCode",
    "CheckRevisionNo",
    "CheckVendorId",
    "CheckSerialNo",
    "SerialNo",
    "TcSmClass",
    "TcCfgModeSafeOp",
];
/// Elements that an element has once at most, but in a list of them (`DataType` in `DataTypes`).
const SINGLE: [&str; 53] = [
    "Vendor",
    "Id",
    "Descriptions",
    "Groups",
    "Devices",
    "Type",
    "Info",
    "Mailbox",
    "Dc",
    "Slots",
    "ESC",
    "Eeprom",
    "Index",
    "SubIndex",
    "SubIdx",
    "BitLen",
    "BitSize",
    "DataType",
    "BaseType",
    "Data",
    "CoE",
    "EoE",
    "FoE",
    "SoE",
    "AoE",
    "VoE",
    "Electrical",
    "EBusCurrent",
    "StateMachine",
    "Behavior",
    "Timeout",
    "IdentificationAdo",
    "IdentificationReg134",
    "PreopTimeout",
    "SafeopOpTimeout",
    "BackToInitTimeout",
    "BackToSafeopTimeout",
    "RequestTimeout",
    "ResponseTimeout",
    "AssignActivate",
    "CycleTimeSync0",
    "CycleTimeSync1",
    "ShiftTimeSync0",
    "ShiftTimeSync1",
    "ByteSize",
    "ConfigData",
    "BootStrap",
    "Dictionary",
    "DataTypes",
    "Objects",
    "Flags",
    "Access",
    "DefaultData",
];
/// Longest path that is written out, characters.
const PATH_LIMIT: usize = 400;
/// Longest text that is quoted, characters.
const QUOTED: usize = 60;

/// Where the lines of a text begin: looked through once, not for each element whose line is told.
pub(crate) struct Lines(Vec<usize>);

impl Lines {
    /// The lines of a text.
    pub fn of(text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        Lines(std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect())
    }

    /// The line, from 1, in which a byte of the text stands.
    fn at(&self, byte: usize) -> u32 {
        self.0.partition_point(|start| *start <= byte) as u32
    }
}

/// How far a document was read.
pub(crate) struct Reading {
    lines: Lines,
    nodes: RefCell<Vec<ReadMarks>>,
}

/// What was read of one node.
#[derive(Clone, Copy, Default)]
struct ReadMarks {
    /// Its text, its elements or one of its attributes was asked for, or that it is there.
    is_read: bool,
    /// Its text was asked for.
    is_text_read: bool,
    /// It is noted with all in it.
    is_noted: bool,
    /// Attributes that were asked for: bit n for the n-th, of the first 32.
    attributes: u32,
}

impl Reading {
    /// Nothing was read yet of a document and its text.
    pub fn of(document: &Document<'_>, text: &str) -> Self {
        let nodes = document.descendants().count();
        Reading { lines: Lines::of(text), nodes: RefCell::new(vec![ReadMarks::default(); nodes]) }
    }

    fn mark(&self, node: Node, mark: impl FnOnce(&mut ReadMarks)) {
        if let Some(seen) = self.nodes.borrow_mut().get_mut(node.id().get_usize()) {
            mark(seen);
        }
    }

    fn seen(&self, node: Node) -> ReadMarks {
        self.nodes.borrow().get(node.id().get_usize()).copied().unwrap_or_default()
    }

    /// Notes every element, attribute and text below `root` that nobody asked for.
    pub fn note_unread(&self, root: Element, notes: &mut Notes) {
        let mut noted_until = 0;
        for node in root.node.descendants().filter(Node::is_element) {
            if node.range().start < noted_until {
                continue;
            }
            let (seen, element) = (self.seen(node), Element { node, reading: self });
            if seen.is_noted || !seen.is_read {
                if !seen.is_noted {
                    element.skip(notes);
                }
                noted_until = node.range().end;
                continue;
            }
            let unread = node.attributes().enumerate().filter(|(at, _)| seen.attributes & bit(*at) == 0);
            for (_, attribute) in unread {
                let path = format!("{}/@{}", element.path(), attribute.name());
                notes.skip(why(attribute.name()), path, || element.line());
            }
            if !seen.is_text_read && element.texts().any(|text| !text.trim().is_empty()) {
                notes.skip(Why::Unknown, format!("{}/text()", element.path()), || element.line());
            }
        }
    }
}

/// The bit of the n-th attribute.
fn bit(at: usize) -> u32 {
    1u32.checked_shl(at as u32).unwrap_or(0)
}

/// Why an element or attribute of this name isn't read.
fn why(name: &str) -> Why {
    if UNUSED.contains(&name) { Why::Unused } else { Why::Unknown }
}

/// An element of a document.
#[derive(Clone, Copy)]
pub(crate) struct Element<'a, 'input> {
    /// The element.
    pub node: Node<'a, 'input>,
    /// How far its document was read.
    pub reading: &'a Reading,
}

impl<'a, 'input> Element<'a, 'input> {
    /// Its name.
    pub fn name(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Its line, from 1.
    pub fn line(self) -> u32 {
        self.reading.lines.at(self.node.range().start)
    }

    pub fn path(self) -> String {
        let mut names: Vec<&str> =
            self.node.ancestors().filter(Node::is_element).map(|one| one.tag_name().name()).collect();
        names.reverse();
        names.join("/").chars().take(PATH_LIMIT).collect()
    }

    /// Notes that it says all that it has to say by being there.
    pub fn is_there(self) -> bool {
        self.reading.mark(self.node, |seen| seen.is_read = true);
        true
    }

    /// The elements in it, but for those of other namespaces than the document's, which nobody reads.
    fn elements(self) -> impl Iterator<Item = Element<'a, 'input>> {
        let reading = self.reading;
        let namespace = self.node.document().root_element().tag_name().namespace();
        let own = self.node.children().filter(move |node| node.tag_name().namespace() == namespace);
        own.filter(Node::is_element).map(move |node| Element { node, reading })
    }

    /// The elements in it; what stands there more than once and mustn't is noted.
    pub fn children(self, notes: &mut Notes) -> impl Iterator<Item = Element<'a, 'input>> + use<'a, 'input> {
        self.is_there();
        let mut seen = Vec::new();
        let is_single = |name: &str| SINGLE.contains(&name) && self.name().strip_suffix('s') != Some(name);
        for child in self.elements().filter(|child| is_single(child.name())) {
            if seen.contains(&child.name()) {
                child.problem("it stands there more than once: nobody knows which is meant", notes);
            } else {
                seen.push(child.name());
            }
        }
        self.elements()
    }

    /// The first element in it of this name.
    pub fn child(self, name: &str) -> Option<Element<'a, 'input>> {
        self.is_there();
        self.elements().find(|child| child.name() == name)
    }

    /// Its text without white space at the ends.
    pub fn text(self) -> String {
        self.reading.mark(self.node, |seen| (seen.is_read, seen.is_text_read) = (true, true));
        self.texts().collect::<String>().trim().to_owned()
    }

    /// The pieces of text between its elements.
    fn texts(self) -> impl Iterator<Item = &'a str> {
        self.node.children().filter(Node::is_text).filter_map(|text| text.text())
    }

    /// An attribute of it as text.
    pub fn attribute(self, name: &str) -> Option<&'a str> {
        let is_it = |attribute: &Attribute| attribute.namespace().is_none() && attribute.name() == name;
        let found = self.node.attributes().enumerate().find(|(_, attribute)| is_it(attribute));
        self.reading.mark(self.node, |seen| {
            seen.is_read = true;
            seen.attributes |= found.map_or(0, |(at, _)| bit(at));
        });
        found.map(|(_, attribute)| attribute.value())
    }

    /// Notes that nobody here reads it.
    pub fn skip(self, notes: &mut Notes) {
        self.note(why(self.name()), notes);
    }

    fn note(self, why: Why, notes: &mut Notes) {
        self.reading.mark(self.node, |seen| seen.is_noted = true);
        notes.skip(why, self.path(), || self.line());
    }

    /// Notes that the standard knows it and nothing here needs it.
    pub fn set_aside(self, notes: &mut Notes) {
        self.note(Why::Unused, notes);
    }

    /// Notes the same of every element in it.
    pub fn set_aside_children(self, notes: &mut Notes) {
        self.is_there();
        self.elements().for_each(|child| child.set_aside(notes));
    }

    /// Notes something wrong with it.
    pub fn problem(self, text: impl Into<String>, notes: &mut Notes) {
        notes.problem(|| FileNote { path: self.path(), line: self.line(), text: text.into() });
    }

    /// Its text as a number within `limits`; what is none is noted.
    pub fn number(self, limits: std::ops::RangeInclusive<i64>, notes: &mut Notes) -> Option<i64> {
        self.number_of(&self.text(), "", limits, notes)
    }

    /// An attribute as a number within `limits`; what is none is noted.
    pub fn attribute_number(
        self,
        name: &str,
        limits: std::ops::RangeInclusive<i64>,
        notes: &mut Notes,
    ) -> Option<i64> {
        self.attribute(name).and_then(|text| self.number_of(text, name, limits, notes))
    }

    /// The same, `absent` where the attribute isn't there: `None` is one that can't be read.
    pub fn attribute_number_or(
        self,
        name: &str,
        absent: i64,
        limits: std::ops::RangeInclusive<i64>,
        notes: &mut Notes,
    ) -> Option<i64> {
        self.attribute(name).map_or(Some(absent), |text| self.number_of(text, name, limits, notes))
    }

    fn number_of(
        self,
        text: &str,
        attribute: &str,
        limits: std::ops::RangeInclusive<i64>,
        notes: &mut Notes,
    ) -> Option<i64> {
        let number = parse_number(text).filter(|number| limits.contains(number));
        if number.is_none() {
            let of = if attribute.is_empty() { String::new() } else { format!("attribute {attribute}: ") };
            let (least, greatest) = (limits.start(), limits.end());
            let quoted = quoted(text);
            self.problem(format!("{of}expected a number from {least} to {greatest}, found {quoted}"), notes);
        }
        number
    }

    /// Its text as 16 bits.
    pub fn u16(self, notes: &mut Notes) -> Option<u16> {
        self.number(0..=0xFFFF, notes).map(|number| number as u16)
    }

    /// Its text as 8 bits.
    pub fn u8(self, notes: &mut Notes) -> Option<u8> {
        self.number(0..=0xFF, notes).map(|number| number as u8)
    }

    /// Its text as 32 bits.
    pub fn u32(self, notes: &mut Notes) -> Option<u32> {
        self.number(0..=0xFFFF_FFFF, notes).map(|number| number as u32)
    }

    /// An attribute as yes or no; no where it isn't there.
    pub fn is(self, attribute: &str, notes: &mut Notes) -> bool {
        let text = self.attribute(attribute);
        text.is_some_and(|text| self.yes_or_no(text, &format!("attribute {attribute}: "), notes))
    }

    /// Its text as yes or no.
    pub fn yes(self, notes: &mut Notes) -> bool {
        self.yes_or_no(&self.text(), "", notes)
    }

    fn yes_or_no(self, text: &str, of: &str, notes: &mut Notes) -> bool {
        match text.trim() {
            "0" | "false" => false,
            "1" | "true" => true,
            other => {
                let text = format!("{of}expected 0, 1, true or false, found {}", quoted(other));
                self.problem(text, notes);
                false
            }
        }
    }

    /// Its text as bytes in hexadecimal; what is none is noted.
    pub fn bytes(self, most: usize, notes: &mut Notes) -> Option<Vec<u8>> {
        let digits: String = self.text().chars().filter(|letter| !letter.is_whitespace()).collect();
        let bytes =
            parse_bytes(digits.strip_prefix("#x").unwrap_or(&digits)).filter(|bytes| bytes.len() <= most);
        if bytes.is_none() {
            let text = format!("expected at most {most} bytes in hexadecimal, found {}", quoted(&digits));
            self.problem(text, notes);
        }
        bytes
    }
}

/// Text as it stands in a message: its beginning, without control characters.
pub(crate) fn quoted(text: &str) -> String {
    let shown: String =
        text.chars().take(QUOTED).map(|one| if one.is_control() { ' ' } else { one }).collect();
    let more = if text.chars().count() > QUOTED { "..." } else { "" };
    format!("\"{shown}{more}\"")
}

/// A number as ESI files write it: decimal, or hexadecimal behind `#x` (some makers write `0x`).
pub(crate) fn parse_number(text: &str) -> Option<i64> {
    let text = text.trim();
    let (negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let hexadecimal = ["#x", "#X", "0x", "0X"].iter().find_map(|prefix| digits.strip_prefix(prefix));
    let (digits, radix) = hexadecimal.map_or((digits, 10), |digits| (digits, 16));
    let is_plain = !digits.is_empty() && digits.chars().all(|digit| digit.is_digit(radix));
    let number = is_plain.then(|| i64::from_str_radix(digits, radix).ok()).flatten()?;
    Some(if negative { -number } else { number })
}

fn parse_bytes(digits: &str) -> Option<Vec<u8>> {
    if !digits.is_ascii() || !digits.len().is_multiple_of(2) {
        return None;
    }
    let pairs =
        (0..digits.len()).step_by(2).map(|first| u8::from_str_radix(digits.get(first..first + 2)?, 16).ok());
    pairs.collect()
}
