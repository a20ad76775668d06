//! A held key, counted in cycles.

use crate::hand::Key;

/// A key that must be held for anything to move.
///
/// Terminals tell of a held key by repeating it. So a single press moves nothing: motion begins with its second beat, and ends
/// when the last beat is older than the bound, when the key is let go, or when whoever held it is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeadMan {
    bound_cycles: u32,
    first_bound_cycles: u32,
    age_cycles: u32,
    beats: u32,
    is_gone: bool,
}

impl DeadMan {
    /// Nobody holds it yet. A beat counts for `bound_cycles`; between the first two may lie `first_bound_cycles`, for
    /// keyboards wait before they repeat.
    pub fn new(bound_cycles: u32, first_bound_cycles: u32) -> Self {
        DeadMan { bound_cycles, first_bound_cycles, age_cycles: 0, beats: 0, is_gone: false }
    }

    /// One exchange, with what was heard of the key since the last one; whether it is held. `periods` passed since then, more than
    /// one where the program was late: a key grows old by time.
    pub fn cycle(&mut self, key: Key, periods: u64) -> bool {
        self.age_cycles = self.age_cycles.saturating_add(u32::try_from(periods).unwrap_or(u32::MAX));
        match key {
            Key::Beat => {
                let bound = if self.beats < 2 { self.first_bound_cycles } else { self.bound_cycles };
                self.beats =
                    if self.beats > 0 && self.age_cycles > bound { 1 } else { self.beats.saturating_add(1) };
                self.age_cycles = 0;
            }
            Key::Quiet => {}
            Key::LetGo => self.beats = 0,
            Key::Gone => self.is_gone = true,
        }
        self.is_held()
    }

    /// Whether the key is held now.
    pub fn is_held(&self) -> bool {
        !self.is_gone && self.beats >= 2 && self.age_cycles <= self.bound_cycles
    }

    /// Whether whoever held it will never be heard again.
    pub fn is_gone(&self) -> bool {
        self.is_gone
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_press_moves_nothing_and_an_old_beat_counts_no_more() {
        let mut key = DeadMan::new(3, 10);
        assert!(!key.cycle(Key::Beat, 1));
        for _ in 0..9 {
            assert!(!key.cycle(Key::Quiet, 1));
        }
        assert!(key.cycle(Key::Beat, 1), "the second beat came in time");
        assert!(key.cycle(Key::Quiet, 1) && key.cycle(Key::Quiet, 1) && key.cycle(Key::Quiet, 1));
        assert!(!key.cycle(Key::Quiet, 1), "a beat counts for three cycles");
        assert!(!key.cycle(Key::Beat, 1), "a key that was let go begins anew");
        assert!(key.cycle(Key::Beat, 1));
        assert!(!key.cycle(Key::LetGo, 1) && !key.cycle(Key::Beat, 1));
        assert!(key.cycle(Key::Beat, 1));
        assert!(
            !key.cycle(Key::Gone, 1) && !key.cycle(Key::Beat, 1) && !key.cycle(Key::Beat, 1),
            "gone is gone"
        );
    }

    #[test]
    fn two_presses_far_apart_are_no_held_key() {
        let mut key = DeadMan::new(3, 10);
        key.cycle(Key::Beat, 1);
        for _ in 0..10 {
            key.cycle(Key::Quiet, 1);
        }
        assert!(!key.cycle(Key::Beat, 1));
    }

    #[test]
    fn a_key_grows_old_while_the_program_is_paused() {
        let mut key = DeadMan::new(250, 1000);
        key.cycle(Key::Beat, 1);
        assert!(key.cycle(Key::Beat, 1) && key.cycle(Key::Quiet, 200));
        assert!(!key.cycle(Key::Quiet, 51));
    }
}
