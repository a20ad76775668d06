//! An allocator that counts, for tests that promise "no allocation".

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static RETURNS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting each thread's allocations (and reallocations), and what it gives back.
///
/// ```
/// use omnibase_host::CountingAllocator;
/// #[global_allocator]
/// static ALLOCATOR: CountingAllocator = CountingAllocator;
///
/// let before = CountingAllocator::allocations_of_this_thread();
/// let boxed = Box::new(7);
/// assert_eq!(CountingAllocator::allocations_of_this_thread() - before, 1);
///
/// let before = CountingAllocator::returns_of_this_thread();
/// drop(boxed);
/// assert_eq!(CountingAllocator::returns_of_this_thread() - before, 1);
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct CountingAllocator;

impl CountingAllocator {
    /// How often the calling thread has asked for memory since it began.
    ///
    /// Zero for ever where this allocator isn't the global one.
    pub fn allocations_of_this_thread() -> u64 {
        ALLOCATIONS.try_with(Cell::get).unwrap_or(0)
    }

    /// How often the calling thread has given memory back since it began: that may lock, too.
    pub fn returns_of_this_thread() -> u64 {
        RETURNS.try_with(Cell::get).unwrap_or(0)
    }
}

fn count() {
    // A thread that is ending has no counter any more; nobody can ask it either.
    let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes on to the system's allocator with the same arguments; the counter is a thread-local cell
// without a destructor and doesn't allocate.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // As in `count`.
        let _ = RETURNS.try_with(|count| count.set(count.get() + 1));
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}
