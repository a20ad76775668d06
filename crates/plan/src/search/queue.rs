//! What a search looks at next.

use crate::until::Until;

/// Keys of the queue in a cell.
const FINE: f32 = 4.0;

/// A queue by keys that all but rise, in buckets: of cells, or of whatever else is small.
pub(crate) struct Queue<'a, T = usize> {
    buckets: Vec<Vec<T>>,
    at: usize,
    taken: u32,
    until: Until<'a>,
}

impl<'a, T: Copy> Queue<'a, T> {
    pub(crate) fn new(until: Until<'a>) -> Self {
        Queue { buckets: Vec::new(), at: 0, taken: 0, until }
    }

    /// Nothing where the key is infinite: as far as is known, nothing leads from there on.
    pub(crate) fn add(&mut self, key: f32, what: T) {
        if !key.is_finite() {
            return;
        }
        let bucket = (key * FINE).max(0.0) as usize;
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
        }
        self.at = self.at.min(bucket);
        self.buckets[bucket].push(what);
    }

    /// Takes all out.
    pub(crate) fn clear(&mut self) {
        self.buckets.iter_mut().for_each(Vec::clear);
        self.at = 0;
    }

    /// The next one; `None` where there is none, or whoever waits ends it.
    pub(crate) fn next(&mut self) -> Option<T> {
        if self.until.is_over_at(self.taken) {
            return None;
        }
        self.taken = self.taken.wrapping_add(1);
        while let Some(bucket) = self.buckets.get_mut(self.at) {
            if let Some(next) = bucket.pop() {
                return Some(next);
            }
            self.at += 1;
        }
        None
    }
}
