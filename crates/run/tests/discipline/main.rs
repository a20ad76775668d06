//! The discipline of the cycle: what is late is left out, nothing is allocated, and the kernel is asked for nothing but
//! the frame and the time; in good cycles and in bad ones.

mod allocations;
mod overruns;
mod system_calls;
mod watched;

use omnibase_host::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
