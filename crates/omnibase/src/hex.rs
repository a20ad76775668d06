//! Bytes as hexadecimal digits.

/// All bytes, two digits each, without spaces.
pub fn compact(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Bytes with spaces between them; of more than `limit` only the first ones, and how many there are.
pub fn spaced(bytes: &[u8], limit: usize) -> String {
    let shown = &bytes[..bytes.len().min(limit)];
    let digits = shown.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
    if shown.len() < bytes.len() { format!("{digits} ... ({} bytes)", bytes.len()) } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_data_are_shortened_and_say_so() {
        assert_eq!(compact(&[0, 0xAB]), "00ab");
        assert_eq!(spaced(&[1, 2], 2), "01 02");
        assert_eq!(spaced(&[1, 2, 3], 2), "01 02 ... (3 bytes)");
        assert_eq!(spaced(&[], 2), "");
    }
}
