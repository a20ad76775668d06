//! Runs in real time over a virtual cable: `omnibase simulate` in one process, `omnibase run` in another.
//!
//! Skipped loudly without the rights for a namespace of one's own. Nothing here asserts a time of the host's: what
//! is measured is measured by the simulator, in the segment's own time.

mod ends;
mod manners;
mod own_crate;
mod owner;
mod parts;
mod recovery;
mod redundancy;
mod refusals;
mod same_end;
mod support;
mod system_calls;
mod watchdog;
mod whole_file;
