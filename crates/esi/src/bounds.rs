//! What a document may hold at most, counted before it is parsed: a parser compares each attribute with all others of its element.

use crate::EsiError;

/// The deepest nesting. The standard's deepest element is some 15 deep.
const DEPTH_LIMIT: usize = 64;
/// The most attributes of an element. The standard's richest has some 20.
const ATTRIBUTE_LIMIT: usize = 256;
/// The most attributes of a file.
const ATTRIBUTES_LIMIT: usize = 4_000_000;

/// Refuses what is too deep or has too many attributes. Looks at each byte once; what isn't XML is left to the parser.
pub(crate) fn check(text: &str) -> Result<(), EsiError> {
    let (mut at, mut depth, mut attributes) = (0, 0usize, 0);
    while let Some(start) = text[at..].find('<').map(|found| at + found) {
        let rest = &text[start..];
        let passed = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
        if let Some((open, close)) = passed.iter().find(|(open, _)| rest.starts_with(open)) {
            let Some(length) = rest[open.len()..].find(close) else { return Ok(()) };
            at = start + open.len() + length + close.len();
            continue;
        }
        let Some(tag) = Tag::read(rest) else { return Ok(()) };
        attributes += tag.attributes;
        let refusal =
            |what: &'static str, limit| EsiError::TooMany { what, limit, line: line_of(text, start) };
        if tag.attributes > ATTRIBUTE_LIMIT {
            return Err(refusal("attributes in one element", ATTRIBUTE_LIMIT));
        }
        if attributes > ATTRIBUTES_LIMIT {
            return Err(refusal("attributes", ATTRIBUTES_LIMIT));
        }
        if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if depth == DEPTH_LIMIT {
            return Err(EsiError::TooDeep { limit: DEPTH_LIMIT, line: line_of(text, start) });
        } else if !rest[..tag.length].ends_with("/>") {
            depth += 1;
        }
        at = start + tag.length;
    }
    Ok(())
}

fn line_of(text: &str, at: usize) -> u32 {
    1 + text.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count() as u32
}

/// A tag: its bytes, and how many attributes it has.
struct Tag {
    length: usize,
    attributes: usize,
}

impl Tag {
    /// `None` where it has no end.
    fn read(text: &str) -> Option<Tag> {
        let (mut quote, mut attributes) = (None, 0);
        for (at, byte) in text.bytes().enumerate() {
            match (quote, byte) {
                (Some(open), _) if open == byte => quote = None,
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => attributes += 1,
                (None, b'>') => return Some(Tag { length: at + 1, attributes }),
                (None, _) => {}
            }
        }
        // Without an end there may be as many of them: they count.
        (attributes > ATTRIBUTE_LIMIT).then_some(Tag { length: text.len(), attributes })
    }
}
