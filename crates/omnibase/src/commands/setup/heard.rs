//! What a thread heard of a held key, for the cycle: counters, never a queue.

use omnibase_setup::Key;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// What was heard of a key since it was taken.
#[derive(Debug, Default)]
pub struct Heard {
    beats: AtomicU32,
    taken: AtomicU32,
    let_go: AtomicBool,
    gone: AtomicBool,
}

impl Heard {
    /// The key is down.
    pub fn beat(&self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
    }

    /// It was let go.
    pub fn let_go(&self) {
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

    /// A motion begins: what was heard of the key before is none of its own, but whoever is gone stays gone.
    pub fn begin(&self) {
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
