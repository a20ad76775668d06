//! The reading end of a ring without locks.

use rtrb::Consumer;

/// Moves the next `length` elements to `to`, which is emptied first; `false`, with nothing moved, where there are
/// fewer.
pub(crate) fn take<T: Copy>(ring: &mut Consumer<T>, length: usize, to: &mut Vec<T>) -> bool {
    let Ok(chunk) = ring.read_chunk(length) else { return false };
    let (first, second) = chunk.as_slices();
    to.clear();
    to.extend_from_slice(first);
    to.extend_from_slice(second);
    chunk.commit_all();
    true
}
