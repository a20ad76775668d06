//! The exact words that replay a row: each is the bits of a value, or a count, and stands in the row's message as what it is.
//!
//! Recordings of before have counts as the nearest double, and beside them what that doesn't tell, word by word: its number in
//! two bytes, and its eight bytes, little-endian.

/// What a word of a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// The bits of the value at this place of the row.
    Bits(usize),
    /// A count, of which the value at this place of the row is the nearest double.
    Count(usize),
}

const NUMBER_BYTES: usize = 2;
const ENTRY_BYTES: usize = NUMBER_BYTES + 8;

/// A word of a row as a number: a count as the nearest one, else what its bits are of.
pub(super) fn number(word: u64, is_count: bool) -> f64 {
    if is_count { word as f64 } else { f64::from_bits(word) }
}

/// All bytes of the words, by the row's values, its counts, and what those don't tell.
pub(super) fn whole(raw: &mut Vec<u8>, words: &[Word], values: &[f64], counts: &[u64], rest: &[u8]) {
    raw.clear();
    for word in words {
        // 0 where there is no such place.
        let word = match *word {
            Word::Bits(place) => values.get(place).map_or(0, |value| value.to_bits()),
            Word::Count(place) => counts.get(place).copied().unwrap_or(0),
        };
        raw.extend_from_slice(&word.to_le_bytes());
    }
    for entry in rest.chunks_exact(ENTRY_BYTES) {
        let (number, word) = entry.split_at(NUMBER_BYTES);
        let at = 8 * usize::from(u16::from_le_bytes([number[0], number[1]]));
        if let Some(place) = raw.get_mut(at..at + 8) {
            place.copy_from_slice(word);
        }
    }
}

/// The words in a line of text.
pub(super) fn line(words: &[Word]) -> String {
    let one = |word: &Word| match word {
        Word::Bits(place) => format!("b{place}"),
        Word::Count(place) => format!("c{place}"),
    };
    words.iter().map(one).collect::<Vec<_>>().join(" ")
}

/// The words of a line; `None` where it isn't one.
pub(super) fn of_line(line: &str) -> Option<Vec<Word>> {
    let one = |word: &str| {
        let (kind, place) = word.split_at_checked(1)?;
        let place = place.parse().ok()?;
        match kind {
            "b" => Some(Word::Bits(place)),
            "c" => Some(Word::Count(place)),
            _ => None,
        }
    };
    line.split_whitespace().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_words_is_read_back_and_what_is_none_is_refused() {
        let words = [Word::Bits(1), Word::Count(0), Word::Count(2), Word::Bits(3), Word::Count(4)];
        assert_eq!(of_line(&line(&words)).as_deref(), Some(&words[..]));
        assert_eq!((of_line("b1 x2"), of_line("b"), of_line("ü1")), (None, None, None));
    }
}
