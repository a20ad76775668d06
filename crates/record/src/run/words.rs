//! The exact words that replay a row, as what they are more than the row's values.
//!
//! Most words are a value's bits, or a count that a value holds exactly: they needn't be written a second time. What is left is
//! written word by word: its number in two bytes, and its eight bytes, little-endian.

/// What a word of a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Word {
    /// The bits of the value at this place of the row.
    Bits(usize),
    /// A count, of which the value at this place of the row is the nearest number.
    Count(usize),
}

const NUMBER_BYTES: usize = 2;
const ENTRY_BYTES: usize = NUMBER_BYTES + 8;

impl Word {
    /// What it is by the row's values alone; 0 where there is no such value.
    fn told_by(self, values: &[f64]) -> u64 {
        match self {
            Word::Bits(place) => values.get(place).map_or(0, |value| value.to_bits()),
            Word::Count(place) => values.get(place).map_or(0, |value| *value as u64),
        }
    }
}

/// Appends what the values don't tell of the words; `None` where the bytes aren't those words.
pub(super) fn push_rest(rest: &mut Vec<u8>, words: &[Word], values: &[f64], raw: &[u8]) -> Option<()> {
    if words.is_empty() || raw.len() != 8 * words.len() || words.len() > usize::from(u16::MAX) {
        return None;
    }
    for (number, (word, bytes)) in (0_u16..).zip(words.iter().zip(raw.as_chunks::<8>().0)) {
        if word.told_by(values).to_le_bytes() != *bytes {
            rest.extend_from_slice(&number.to_le_bytes());
            rest.extend_from_slice(bytes);
        }
    }
    Some(())
}

/// All bytes of the words, by the row's values and what those don't tell.
pub(super) fn whole(raw: &mut Vec<u8>, words: &[Word], values: &[f64], rest: &[u8]) {
    raw.clear();
    words.iter().for_each(|word| raw.extend_from_slice(&word.told_by(values).to_le_bytes()));
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
    fn words_come_back_whatever_they_are_and_only_what_values_lack_is_written() {
        let words = [Word::Bits(1), Word::Count(0), Word::Count(2), Word::Bits(3), Word::Count(4)];
        assert_eq!(of_line(&line(&words)).as_deref(), Some(&words[..]));
        assert_eq!((of_line("b1 x2"), of_line("b"), of_line("ü1")), (None, None, None));
        let payload = f64::from_bits(0x7FF8_0000_0000_1234);
        for counts in [[0, 7, 1 << 52], [u64::MAX, (1 << 53) + 1, 0x1234_5678_9ABC_DEF1]] {
            let exact = [payload.to_bits(), counts[0], counts[1], (-0.0_f64).to_bits(), counts[2]];
            let values = [counts[0] as f64, payload, counts[1] as f64, -0.0, counts[2] as f64];
            let raw: Vec<u8> = exact.iter().flat_map(|word| word.to_le_bytes()).collect();
            let (mut rest, mut back) = (Vec::new(), Vec::new());
            push_rest(&mut rest, &words, &values, &raw).expect("its words");
            whole(&mut back, &words, &values, &rest);
            assert_eq!(back, raw);
            // The greatest number of 64 bits is what the nearest double becomes.
            assert_eq!(rest.len(), if counts[1] == 7 { 0 } else { 2 * ENTRY_BYTES });
        }
        assert_eq!(push_rest(&mut Vec::new(), &words, &[], &[0; 7]), None);
        assert_eq!(push_rest(&mut Vec::new(), &[], &[], &[]), None);
    }
}
