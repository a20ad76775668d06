//! A capture as datagrams in words.
//!
//! - [`records`]: frames of a capture as records: who sent them, and their datagrams.
//! - [`words`]: what a datagram's data mean; [`registers`]: names and values of ESC registers; [`mailbox`]: mailbox
//!   messages.
//! - [`summary`]: what a whole capture shows: round trips, cycle, losses, working counters.

pub mod mailbox;
pub mod records;
pub mod registers;
pub mod summary;
pub mod words;
