//! The numbers of what was heard: nothing counts twice.

/// So many numbers before the greatest are remembered.
const REMEMBERED: u32 = 64;

/// The greatest number so far, and which of the 64 before it were heard.
#[derive(Clone, Debug, Default)]
pub(crate) struct Numbers(Option<(u32, u64)>);

impl Numbers {
    /// Whether a number is new. One far before the greatest is that of a sender that began anew.
    pub(crate) fn is_new(&mut self, number: u32) -> bool {
        let Some((greatest, seen)) = self.0 else {
            self.0 = Some((number, 1));
            return true;
        };
        let (ahead, behind) = (number.wrapping_sub(greatest), greatest.wrapping_sub(number));
        if behind < REMEMBERED {
            self.0 = Some((greatest, seen | 1 << behind));
            return seen >> behind & 1 == 0;
        }
        let is_ahead = ahead < u32::MAX / 2;
        let shifted = if is_ahead { seen.checked_shl(ahead).unwrap_or(0) } else { 0 };
        self.0 = Some((number, shifted | 1));
        true
    }
}
