//! Recording what passes over the bus, and reading it back.
//!
//! - [`PcapngWriter`]: frames with nanosecond times and directions, as Wireshark reads them.
//! - [`RecordingLink`]: a link that records what passes through it, into any [`FrameSink`].
//! - [`BackgroundRecorder`]: a sink for the cyclic thread: a lock-free ring, and a thread that writes the file.
//! - [`LastFrames`]: the last seconds of frames, written when something goes wrong.
//! - [`Capture`]: the frames of a pcapng or pcap file, of any bytes, as far as they can be read.
//! - [`create`]: the file of a recording; nothing but a regular one.
//! - [`export`]: a run as a table for other programs.
//! - [`report`]: a page of HTML that shows a run.
//! - [`viewer`]: a run as viewers draw it.
//! - [`run`]: every signal of every cycle of a robot's run, as MCAP and as columns of text.
#![forbid(unsafe_code)]

mod background;
mod capture;
pub mod export;
mod last_frames;
mod output;
mod pcapng;
mod recording_link;
pub mod report;
mod ring;
pub mod run;
pub mod viewer;

pub use background::{BackgroundRecorder, Recorded, WhenFull};
pub use capture::{Capture, CaptureError, CapturedFrame, Warning};
pub use last_frames::{KeepFrames, Kept, LastFrames};
pub use output::create;
pub use pcapng::PcapngWriter;
pub use recording_link::{FrameSink, RecordingLink};

/// Which way a frame went, seen from the recording host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// It came in.
    Inbound,
    /// It was sent.
    Outbound,
}
