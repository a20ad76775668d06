//! What a search looks at next.

use crate::until::Until;

/// Keys of the queue in a cell.
const FINE: f32 = 4.0;

/// A queue by keys that all but rise, in buckets.
#[derive(Default)]
pub(crate) struct Queue<'a> {
    buckets: Vec<Vec<u32>>,
    at: usize,
    taken: u32,
    until: Until<'a>,
}

impl<'a> Queue<'a> {
    pub(crate) fn new(until: Until<'a>) -> Self {
        Queue { until, ..Queue::default() }
    }

    pub(crate) fn add(&mut self, key: f32, cell: usize) {
        let bucket = (key * FINE).max(0.0) as usize;
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
        }
        self.at = self.at.min(bucket);
        self.buckets[bucket].push(cell as u32);
    }

    /// Takes all out.
    pub(crate) fn clear(&mut self) {
        self.buckets.iter_mut().for_each(Vec::clear);
        self.at = 0;
    }

    /// Whether whoever waits ends it.
    pub(crate) fn is_over(&self) -> bool {
        self.until.is_over()
    }

    /// The next one; `None` where there is none, or whoever waits ends it.
    pub(crate) fn next(&mut self) -> Option<usize> {
        if self.until.is_over_at(self.taken) {
            return None;
        }
        self.taken = self.taken.wrapping_add(1);
        while let Some(bucket) = self.buckets.get_mut(self.at) {
            if let Some(cell) = bucket.pop() {
                return Some(cell as usize);
            }
            self.at += 1;
        }
        None
    }
}
