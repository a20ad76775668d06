//! A robot's bus.
//!
//! - [`mod@session`]: from PRE-OP to OP and back, one exchange a cycle, at the pace of clocks.
//! - [`supervision`]: who is missing, who comes back, and what the bus counts, in the spare time of cycles.
//! - [`words`]: what happened, told without allocation.
#![forbid(unsafe_code)]

pub mod session;
pub mod supervision;
pub mod words;

pub use session::{Session, SessionError};
pub use words::Words;
