//! Every cycle for whoever follows a running robot: none is left out without being counted.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use omnibase_robot::CycleRecord;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::channels::CycleExtras;

/// Cycles on their way: half a second of them at 1 kHz.
const ON_THEIR_WAY: usize = 512;

/// A cycle as it is followed.
#[derive(Clone, Copy, Debug)]
pub struct CycleSeen {
    /// Rises by one with each cycle since the run began: where it rises by more, cycles between are missing.
    pub number: u64,
    /// The cycle.
    pub record: CycleRecord,
    /// What stands beside it.
    pub extras: CycleExtras,
}

/// Where one at a time may follow.
#[derive(Clone)]
pub(super) struct CycleLine {
    is_followed: Arc<AtomicBool>,
    cycles: Arc<Mutex<Option<Consumer<CycleSeen>>>>,
}

/// The cycle's end.
pub(super) struct CycleEnd {
    is_followed: Arc<AtomicBool>,
    cycles: Producer<CycleSeen>,
    number: u64,
}

/// Follows until it is dropped.
pub struct Following {
    line: CycleLine,
    /// There but while it is dropped.
    cycles: Option<Consumer<CycleSeen>>,
}

pub(super) fn cycles() -> (CycleLine, CycleEnd) {
    let (producer, consumer) = RingBuffer::new(ON_THEIR_WAY);
    let is_followed = Arc::new(AtomicBool::new(false));
    let line = CycleLine { is_followed: is_followed.clone(), cycles: Arc::new(Mutex::new(Some(consumer))) };
    (line, CycleEnd { is_followed, cycles: producer, number: 0 })
}

impl CycleLine {
    pub(super) fn follow(&self) -> Option<Following> {
        let mut cycles = self.cycles.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        // Of whoever followed before.
        while cycles.pop().is_ok() {}
        self.is_followed.store(true, Ordering::Relaxed);
        Some(Following { line: self.clone(), cycles: Some(cycles) })
    }
}

impl CycleEnd {
    /// Counts a cycle, and shows it where somebody follows; where they don't keep up it is missing.
    pub(super) fn show(&mut self, record: &CycleRecord, extras: &CycleExtras) {
        self.number += 1;
        if self.is_followed.load(Ordering::Relaxed) {
            let _ = self.cycles.push(CycleSeen { number: self.number, record: *record, extras: *extras });
        }
    }
}

impl Following {
    /// The next cycle, where it has come.
    pub fn next_cycle(&mut self) -> Option<CycleSeen> {
        self.cycles.as_mut()?.pop().ok()
    }
}

impl Drop for Following {
    fn drop(&mut self) {
        self.line.is_followed.store(false, Ordering::Relaxed);
        *self.line.cycles.lock().unwrap_or_else(PoisonError::into_inner) = self.cycles.take();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(following: &mut Following) -> Vec<u64> {
        std::iter::from_fn(|| following.next_cycle()).map(|cycle| cycle.number).collect()
    }

    #[test]
    fn who_follows_sees_every_cycle_and_finds_the_missing_ones_by_their_numbers() {
        let (line, mut end) = cycles();
        let mut show = |count: usize| {
            (0..count).for_each(|_| end.show(&CycleRecord::default(), &CycleExtras::default()));
        };
        // Nobody follows: counted all the same.
        show(10);
        let mut following = line.follow().unwrap();
        show(3);
        assert_eq!(numbers(&mut following), [11, 12, 13]);
        show(ON_THEIR_WAY + 5);
        let found = numbers(&mut following);
        assert_eq!((found[0], found.len()), (14, ON_THEIR_WAY));
        show(1);
        assert_eq!(numbers(&mut following), [14 + ON_THEIR_WAY as u64 + 5]);
        // One at a time, and the next one begins afresh.
        assert!(line.follow().is_none());
        show(4);
        drop(following);
        show(1);
        assert_eq!(numbers(&mut line.follow().unwrap()), Vec::<u64>::new());
    }
}
