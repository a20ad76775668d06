//! Recording from the cyclic thread: a ring without locks, and a thread that writes.

use crate::ring::take;
use crate::{Direction, FrameSink, PcapngWriter};
use rtrb::{Consumer, Producer, RingBuffer};
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Bytes of the ring: some 20 000 frames of a small segment, many seconds of a slow disk.
const RING: usize = 4 * 1024 * 1024;
/// Bytes ahead of each frame in the ring: time 8, direction 1, length 2.
const ENTRY_HEADER: usize = 11;
/// How long the writer rests when the ring is empty.
const REST: Duration = Duration::from_millis(5);

/// What happens to a frame that finds the ring full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// It is dropped and counted: the cycle never waits. For real time.
    Drop,
    /// The sender waits for the disk: nothing is lost. For virtual time.
    Wait,
}

/// Takes frames through a ring, so that a thread of its own writes them to the output.
pub struct BackgroundRecorder {
    writer: JoinHandle<io::Result<u64>>,
    dropped: Arc<AtomicU64>,
}

/// The sink's end of the ring.
struct RingSink {
    ring: Producer<u8>,
    dropped: Arc<AtomicU64>,
    when_full: WhenFull,
}

/// What became of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recorded {
    /// Frames in the file.
    pub frames: u64,
    /// Frames that found the ring full.
    pub dropped: u64,
}

impl BackgroundRecorder {
    /// Starts the thread that writes to `writer`; the second value is the sink for the cyclic thread.
    pub fn start<W: Write + Send + 'static>(
        writer: PcapngWriter<W>,
        when_full: WhenFull,
    ) -> io::Result<(BackgroundRecorder, Box<dyn FrameSink + Send>)> {
        let (producer, consumer) = RingBuffer::new(RING);
        let dropped = Arc::new(AtomicU64::new(0));
        let thread =
            std::thread::Builder::new().name("recorder".to_owned()).spawn(move || drain(consumer, writer))?;
        let sink = Box::new(RingSink { ring: producer, dropped: dropped.clone(), when_full });
        Ok((BackgroundRecorder { writer: thread, dropped }, sink))
    }

    /// Waits until everything is written; call it after the sink is dropped, for it waits for that too.
    pub fn finish(self) -> io::Result<Recorded> {
        match self.writer.join() {
            Ok(frames) => Ok(Recorded { frames: frames?, dropped: self.dropped.load(Ordering::Relaxed) }),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

impl FrameSink for RingSink {
    fn record(&mut self, unix_ns: u64, direction: Direction, frame: &[u8]) -> io::Result<()> {
        if self.ring.is_abandoned() {
            return Err(io::Error::other("the writing thread has ended"));
        }
        let Ok(length) = u16::try_from(frame.len()) else {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "frame too long"));
        };
        let needed = ENTRY_HEADER + frame.len();
        while self.when_full == WhenFull::Wait && self.ring.slots() < needed && !self.ring.is_abandoned() {
            std::thread::sleep(REST);
        }
        let Ok(chunk) = self.ring.write_chunk_uninit(needed) else {
            self.dropped.fetch_add(1, Ordering::Relaxed);
            return Ok(());
        };
        let mut header = [0; ENTRY_HEADER];
        header[..8].copy_from_slice(&unix_ns.to_le_bytes());
        header[8] = u8::from(direction == Direction::Outbound);
        header[9..].copy_from_slice(&length.to_le_bytes());
        chunk.fill_from_iter(header.iter().chain(frame).copied());
        Ok(())
    }
}

/// A frame as it was recorded.
pub(crate) struct Entry {
    /// Nanoseconds since 1970-01-01 UTC.
    pub(crate) unix_ns: u64,
    pub(crate) direction: Direction,
    pub(crate) frame: Vec<u8>,
}

/// A sink, and the ring behind it.
pub(crate) fn ring_sink(
    dropped: Arc<AtomicU64>,
    when_full: WhenFull,
) -> (Box<dyn FrameSink + Send>, Consumer<u8>) {
    let (producer, consumer) = RingBuffer::new(RING);
    (Box::new(RingSink { ring: producer, dropped, when_full }), consumer)
}

/// Gives entries to `take` until the sink is gone and the ring is empty.
pub(crate) fn drained(
    mut ring: Consumer<u8>,
    each: &mut dyn FnMut(Entry) -> io::Result<()>,
) -> io::Result<()> {
    let mut header = Vec::with_capacity(ENTRY_HEADER);
    loop {
        // Asked first: what was pushed before the sink went is seen below.
        let ended = ring.is_abandoned();
        while take(&mut ring, ENTRY_HEADER, &mut header) {
            let mut time = [0; 8];
            time.copy_from_slice(&header[..8]);
            let direction = if header[8] == 1 { Direction::Outbound } else { Direction::Inbound };
            let length = usize::from(u16::from_le_bytes([header[9], header[10]]));
            let mut frame = Vec::with_capacity(length);
            // Header and frame were committed together.
            take(&mut ring, length, &mut frame);
            each(Entry { unix_ns: u64::from_le_bytes(time), direction, frame })?;
        }
        if ended {
            return Ok(());
        }
        std::thread::sleep(REST);
    }
}

/// Writes entries until the sink is gone and the ring is empty; the number of frames written.
fn drain<W: Write>(ring: Consumer<u8>, mut writer: PcapngWriter<W>) -> io::Result<u64> {
    let mut frames = 0;
    drained(ring, &mut |Entry { unix_ns, direction, frame }| {
        frames += 1;
        writer.write(unix_ns, direction, &frame)
    })?;
    writer.finish()?;
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Capture;
    use std::sync::Mutex;
    use std::sync::mpsc::{Receiver, channel};

    #[derive(Clone, Default)]
    struct Memory(Arc<Mutex<Vec<u8>>>);
    impl Write for Memory {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Lets some writes pass, then blocks at each until the channel's other end goes.
    struct Gate {
        open_for: usize,
        stuck: Receiver<()>,
    }
    impl Write for Gate {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.open_for.checked_sub(1) {
                Some(left) => self.open_for = left,
                None => assert!(self.stuck.recv().is_err(), "nothing is ever sent"),
            }
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_went_in_stands_in_the_file_in_order() {
        let memory = Memory::default();
        let writer = PcapngWriter::new(memory.clone(), "sim").unwrap();
        let (recorder, mut sink) = BackgroundRecorder::start(writer, WhenFull::Wait).unwrap();
        for number in 0..5000u64 {
            let direction = if number % 2 == 0 { Direction::Outbound } else { Direction::Inbound };
            sink.record(number, direction, &vec![number as u8; (number % 300) as usize]).unwrap();
        }
        drop(sink);
        assert_eq!(recorder.finish().unwrap(), Recorded { frames: 5000, dropped: 0 });
        let bytes = memory.0.lock().unwrap();
        let capture = Capture::read(&bytes).unwrap();
        assert_eq!(capture.frames.len(), 5000);
        assert!(capture.warnings.is_empty());
        for (number, frame) in capture.frames.iter().enumerate() {
            assert_eq!((frame.unix_ns, frame.data.len()), (number as u64, number % 300));
            assert!(frame.data.iter().all(|byte| *byte == number as u8));
            assert_eq!(frame.direction == Some(Direction::Outbound), number % 2 == 0);
        }
    }

    #[test]
    fn a_sender_that_waits_loses_nothing() {
        let memory = Memory::default();
        let writer = PcapngWriter::new(memory.clone(), "sim").unwrap();
        let (recorder, mut sink) = BackgroundRecorder::start(writer, WhenFull::Wait).unwrap();
        let frame = vec![7; 60_000];
        let frames = 3 * RING / frame.len();
        for _ in 0..frames {
            sink.record(1, Direction::Outbound, &frame).unwrap();
        }
        drop(sink);
        assert_eq!(recorder.finish().unwrap(), Recorded { frames: frames as u64, dropped: 0 });
    }

    #[test]
    fn a_full_ring_drops_and_counts_and_never_waits() {
        let (release, stuck) = channel();
        // Section header and interface description are four writes each and are made before the thread starts.
        let gate = Gate { open_for: 8, stuck };
        let writer = PcapngWriter::new(gate, "sim").unwrap();
        let (recorder, mut sink) = BackgroundRecorder::start(writer, WhenFull::Drop).unwrap();
        let frame = vec![7; 1500];
        let wanted = RING / 1500 + 100;
        for _ in 0..wanted {
            sink.record(1, Direction::Outbound, &frame).unwrap();
        }
        drop(sink);
        drop(release);
        let recorded = recorder.finish().unwrap();
        assert_eq!(recorded.frames + recorded.dropped, wanted as u64);
        assert!(recorded.dropped >= 90, "{recorded:?}");
    }
}
