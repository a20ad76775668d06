//! What a thread heard of a held key, for the cycle: counters, never a queue.

use omnibase_setup::Key;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A key that wasn't heard for so long was let go.
const SILENCE: Duration = Duration::from_millis(250);
/// Likewise behind its first beat: keyboards wait before they repeat.
const FIRST_SILENCE: Duration = Duration::from_secs(1);

/// What was heard of a key since it was taken.
#[derive(Debug, Default)]
pub struct Heard {
    beats: AtomicU32,
    taken: AtomicU32,
    let_go: AtomicBool,
    gone: AtomicBool,
    press: Mutex<Press>,
}

/// A key that is down; not the cycle's.
#[derive(Clone, Copy, Debug, Default)]
struct Press {
    /// The last beat of a key that wasn't told to be let go.
    last: Option<Instant>,
    /// Beats of this press.
    beats: u32,
    /// It was down before the motion began.
    is_held_over: bool,
}

impl Press {
    fn is_down(&self) -> bool {
        let bound = if self.beats < 2 { FIRST_SILENCE } else { SILENCE };
        self.last.is_some_and(|last| last.elapsed() < bound)
    }

    fn beat(&mut self) {
        if !self.is_down() {
            *self = Press::default();
        }
        self.beats = self.beats.saturating_add(1);
        self.last = Some(Instant::now());
    }
}

impl Heard {
    /// The same key for another motion.
    pub fn again(&self) -> Self {
        Heard { press: Mutex::new(*self.press()), ..Heard::default() }
    }

    fn press(&self) -> MutexGuard<'_, Press> {
        self.press.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The key is down.
    pub fn beat(&self) {
        let mut press = self.press();
        press.beat();
        if !press.is_held_over {
            self.beats.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// It was let go.
    pub fn let_go(&self) {
        *self.press() = Press::default();
        self.let_go.store(true, Ordering::Relaxed);
    }

    /// Whoever held it leaves, or is heard no more.
    pub fn gone(&self) {
        self.gone.store(true, Ordering::Relaxed);
    }

    /// Whether whoever held it is gone.
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// A motion begins: what was heard of the key before is none of its own, nor is a key that stays down; but whoever is gone stays
    /// gone.
    pub fn begin(&self) {
        let mut press = self.press();
        press.is_held_over = press.is_down();
        self.let_go.store(false, Ordering::Relaxed);
        self.taken.store(self.beats.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// What was heard since the last look.
    pub fn key(&self) -> Key {
        if self.is_gone() {
            return Key::Gone;
        }
        let let_go = self.let_go.swap(false, Ordering::Relaxed);
        let beats = self.beats.load(Ordering::Relaxed);
        let is_beaten = self.taken.swap(beats, Ordering::Relaxed) != beats;
        match (let_go, is_beaten) {
            (true, _) => Key::LetGo,
            (false, true) => Key::Beat,
            (false, false) => Key::Quiet,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A key that stays down from one motion to the next moves nothing in that.
    #[test]
    fn a_key_that_is_still_down_is_pressed_anew() {
        let heard = Heard::default();
        heard.begin();
        heard.beat();
        assert_eq!(heard.key(), Key::Beat);
        heard.begin();
        heard.beat();
        assert_eq!(heard.key(), Key::Quiet, "still down");
        heard.let_go();
        assert_eq!(heard.key(), Key::LetGo);
        heard.beat();
        assert_eq!(heard.key(), Key::Beat, "pressed anew");
        // Another terminal's listener goes on with it.
        let next = heard.again();
        next.begin();
        next.beat();
        assert_eq!(next.key(), Key::Quiet);
        let silent = |beats| Press { last: Instant::now().checked_sub(SILENCE), beats, is_held_over: true };
        *next.press() = silent(2);
        next.beat();
        assert_eq!(next.key(), Key::Beat, "it was silent");
        *next.press() = silent(1);
        next.beat();
        assert_eq!(next.key(), Key::Quiet, "its keyboard waited before it repeated");
    }
}
