//! What a file holds that isn't read, and what is wrong in it.

use std::collections::BTreeMap;

use crate::xml::Element;

/// Distinct paths that are kept of elements without meaning; more are counted.
const PATH_LIMIT: usize = 1000;
/// Problems that are kept; more are counted.
const PROBLEM_LIMIT: usize = 1000;

/// Why something isn't read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Why {
    /// The standard knows it, nothing here needs it: pictures, addresses of pages, texts for other tools.
    Unused,
    /// Nobody here knows what it means.
    Unknown,
}

/// Elements or attributes of one path that aren't read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unread {
    /// Names from the document's root on, as `EtherCATInfo/Vendor/Name`; attributes as `.../@Version`, text between elements
    /// as `.../text()`.
    pub path: String,
    /// Line of the first one, from 1.
    pub line: u32,
    /// How often it stands there.
    pub count: u32,
    /// Why it isn't read.
    pub why: Why,
}

/// Something wrong in a file that could be read all the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileNote {
    /// Names from the document's root on.
    pub path: String,
    /// Line, from 1.
    pub line: u32,
    /// What was expected and what was found.
    pub text: String,
}

impl std::fmt::Display for FileNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}: {}: {}", self.line, self.path, self.text)
    }
}

/// Everything of a file that didn't become part of a device.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    unread: BTreeMap<(Why, String), (u32, u32)>,
    /// What is wrong, in the order of reading.
    pub problems: Vec<FileNote>,
    /// Paths and problems beyond those that are kept.
    pub beyond: u32,
    /// Problems, kept or not.
    told: u32,
}

impl Notes {
    /// What isn't read: what the standard knows first, then the unknown, each by path.
    pub fn unread(&self) -> impl Iterator<Item = Unread> + '_ {
        self.unread.iter().map(|((why, path), (line, count))| Unread {
            path: path.clone(),
            line: *line,
            count: *count,
            why: *why,
        })
    }

    /// Notes something that isn't read; the line is asked for where the path is new.
    pub(crate) fn skip(&mut self, why: Why, path: String, line: impl FnOnce() -> u32) {
        let full = self.unread.len() >= PATH_LIMIT;
        match self.unread.get_mut(&(why, path.clone())) {
            Some((_, count)) => *count += 1,
            None if full => self.beyond += 1,
            None => {
                self.unread.insert((why, path), (line(), 1));
            }
        }
    }

    /// Problems in `element` that were told since [`Notes::told`] gave `before`; those of which no note was kept are counted.
    pub(crate) fn since(&self, before: u32, element: Element) -> Vec<FileNote> {
        let mut problems: Vec<FileNote> = self.problems.iter().skip(before as usize).cloned().collect();
        let beyond = (self.told - before) as usize - problems.len();
        if beyond > 0 {
            let text = format!("{beyond} problems of which there was no room to keep a note");
            problems.push(FileNote { path: element.path(), line: element.line(), text });
        }
        problems
    }

    /// How many problems were told until now: more than before where something that was read meanwhile is wrong.
    pub(crate) fn told(&self) -> u32 {
        self.told
    }

    pub(crate) fn problem(&mut self, make: impl FnOnce() -> FileNote) {
        self.told = self.told.saturating_add(1);
        if self.problems.len() < PROBLEM_LIMIT {
            self.problems.push(make());
        } else {
            self.beyond += 1;
        }
    }
}
