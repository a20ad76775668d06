//! The whole cycle, from the drives' bytes to the drives' bytes, on a small body that obeys.

mod around;
mod axes;
mod blocked;
mod counts;
mod courses;
mod disturbance;
mod fence;
mod heedless;
mod inputs;
mod inwards;
mod large_modules;
mod lifecycle;
mod oscillation;
mod place;
mod planned;
mod poison;
mod promises;
mod reasons;
mod replans;
mod safety;
mod settings;
#[path = "../../../host/src/skipped.rs"]
mod skipped;
mod sources;
mod stops;
mod support;
mod torque;
mod tracking;
mod waiting;

use omnibase_host::CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
