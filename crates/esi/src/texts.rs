//! Texts of a file, no longer than anybody reads.

use crate::names::Names;
use crate::notes::Notes;
use crate::xml::Element;

/// Longest name that is kept, characters.
const NAME_LIMIT: usize = 255;

/// The beginning of a text that is kept.
pub(crate) fn short(text: String) -> String {
    if text.len() <= NAME_LIMIT { text } else { text.chars().take(NAME_LIMIT).collect() }
}

/// Adds a name in its language.
pub(crate) fn name(element: Element, names: &mut Names, notes: &mut Notes) {
    let language = element.attribute_number("LcId", 0..=0xFFFF, notes);
    names.push(language.map(|number| number as u32), short(element.text()));
}
