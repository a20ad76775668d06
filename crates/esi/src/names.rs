//! Names in several languages.

/// The language that is taken where nothing else is asked: English.
const ENGLISH: u32 = 1033;

/// A name, once for each language.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names(Vec<(u32, String)>);

impl Names {
    /// No name.
    pub(crate) const NONE: Names = Names(Vec::new());

    /// Adds a name; `language` is Windows' number of it (1033 English, 1031 German), English where none is given.
    pub(crate) fn push(&mut self, language: Option<u32>, name: String) {
        self.0.push((language.unwrap_or(ENGLISH), name));
    }

    /// The name in English, else the first one; empty where there is none.
    pub fn english(&self) -> &str {
        self.in_language(ENGLISH)
    }

    /// The name in this language (Windows' number of it), else the first one; empty where there is none.
    pub fn in_language(&self, language: u32) -> &str {
        let of_language = self.0.iter().find(|(known, _)| *known == language);
        of_language.or(self.0.first()).map_or("", |(_, name)| name)
    }

    /// Every language with its name.
    pub fn all(&self) -> &[(u32, String)] {
        &self.0
    }
}

impl std::fmt::Display for Names {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.english())
    }
}
