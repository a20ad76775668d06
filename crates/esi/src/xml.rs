//! Elements of a document, read one by one: whatever nobody asks for is noted.

use roxmltree::Node;

use crate::notes::{Notes, Problem, Why};

/// Elements and attributes that the standard knows and nothing here needs, wherever they stand.
const UNUSED: [&str; 56] = [
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
    "DownloadModuleAddressList",
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

/// An element of a document.
#[derive(Clone, Copy)]
pub(crate) struct Element<'a, 'input> {
    /// The element.
    pub node: Node<'a, 'input>,
    /// The document's lines.
    pub lines: &'a Lines,
}

impl<'a, 'input> Element<'a, 'input> {
    /// Its name.
    pub fn name(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Its line, from 1.
    pub fn line(self) -> u32 {
        self.lines.at(self.node.range().start)
    }

    pub fn path(self) -> String {
        let mut names: Vec<&str> =
            self.node.ancestors().filter(Node::is_element).map(|one| one.tag_name().name()).collect();
        names.reverse();
        names.join("/").chars().take(PATH_LIMIT).collect()
    }

    /// The elements in it.
    pub fn children(self) -> impl Iterator<Item = Element<'a, 'input>> {
        let lines = self.lines;
        self.node.children().filter(Node::is_element).map(move |node| Element { node, lines })
    }

    /// The first element in it of this name.
    pub fn child(self, name: &str) -> Option<Element<'a, 'input>> {
        self.children().find(|child| child.name() == name)
    }

    /// Its text without white space at the ends.
    pub fn text(self) -> String {
        let parts: Vec<&str> =
            self.node.children().filter(Node::is_text).filter_map(|text| text.text()).collect();
        parts.concat().trim().to_owned()
    }

    /// An attribute of it as text.
    pub fn attribute(self, name: &str) -> Option<&'a str> {
        self.node.attributes().find(|attribute| attribute.name() == name).map(|attribute| attribute.value())
    }

    /// Notes that nobody here reads it.
    pub fn skip(self, notes: &mut Notes) {
        let why = if UNUSED.contains(&self.name()) { Why::Unused } else { Why::Unknown };
        notes.skip(why, self.path(), || self.line());
    }

    /// Notes that the standard knows it and nothing here needs it.
    pub fn set_aside(self, notes: &mut Notes) {
        notes.skip(Why::Unused, self.path(), || self.line());
    }

    /// Notes the same of every element in it.
    pub fn set_aside_children(self, notes: &mut Notes) {
        self.children().for_each(|child| child.set_aside(notes));
    }

    /// Notes every attribute but those that are read.
    pub fn attributes(self, read: &[&str], notes: &mut Notes) {
        for attribute in self.node.attributes().filter(|attribute| !read.contains(&attribute.name())) {
            let why = if UNUSED.contains(&attribute.name()) { Why::Unused } else { Why::Unknown };
            notes.skip(why, format!("{}/@{}", self.path(), attribute.name()), || self.line());
        }
    }

    /// Notes something wrong with it.
    pub fn problem(self, text: impl Into<String>, notes: &mut Notes) {
        notes.problem(|| Problem { path: self.path(), line: self.line(), text: text.into() });
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

    /// Notes children of these names that stand there more than once: one of them is wrong.
    pub fn at_most_once(self, names: &[&str], notes: &mut Notes) {
        let mut seen = Vec::new();
        for child in self.children() {
            let name = child.name();
            if seen.contains(&name) {
                child.problem("it stands there more than once: nobody knows which is meant", notes);
            } else if names.contains(&name) {
                seen.push(name);
            }
        }
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
        match self.attribute(attribute).map(str::trim) {
            None | Some("0" | "false") => false,
            Some("1" | "true") => true,
            Some(other) => {
                let text =
                    format!("attribute {attribute}: expected 0, 1, true or false, found {}", quoted(other));
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
