//! The last seconds of frames, kept in memory and written when something goes wrong.
//!
//! A thread beside the cycle keeps what passes, forgets what is older, and is itself the judge: a frame without an answer,
//! a working counter that isn't what it was before, an AL status that shows an error. Somebody else may tell it, too
//! ([`LastFrames::told`]). A second after that the file is written, with what came before and behind.

use std::collections::{HashMap, VecDeque};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use omnibase_ethercat_wire::bytes::u16_at;
use omnibase_ethercat_wire::frame::Datagrams;
use omnibase_ethercat_wire::{AlState, register};

use crate::background::{Entry, drained, ring_sink};
use crate::{Direction, FrameSink, PcapngWriter, WhenFull};

/// What is written behind the moment in which something went wrong, ns.
const BEHIND_NS: u64 = 1_000_000_000;
/// The most files before the run's end: what goes wrong all the time says nothing new.
const MOST_FILES: usize = 10;
/// An unanswered frame is one that is older than this when others come back, ns.
const UNANSWERED_NS: u64 = 100_000_000;
/// Frames that are sent at once, on both ends of a ring, are no later ones of each other, ns.
const AT_ONCE_NS: u64 = 50_000;
/// Datagrams whose counters are remembered; more aren't judged.
const MOST_KNOWN: usize = 4096;
/// Why frames are written in which nothing is wrong.
const BY_THE_RUN: &str = "no frame shows it; what went wrong is in the run's own messages";
/// AL status register's bit that says that something is wrong.
const AL_ERROR: u16 = AlState::ERROR;

/// How frames are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeepFrames {
    /// Where they are written; a second file is called `x-2.pcapng`, and so on. A file that is there already is left alone.
    pub path: PathBuf,
    /// What the interface is called there.
    pub interface: String,
    /// How much of the past is kept.
    pub seconds: Duration,
    /// What happens to frames that find no room on their way: on virtual time the sender waits.
    pub when_full: WhenFull,
}

/// Keeps the last frames.
pub struct LastFrames {
    keeper: JoinHandle<io::Result<Keeper>>,
    told: Arc<AtomicBool>,
    dropped: Arc<AtomicU64>,
}

/// What became of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Files that were written, and what went wrong first in each.
    pub files: Vec<(PathBuf, String)>,
    /// How often more went wrong than there are files for.
    pub untold: u32,
    /// Frames that found the ring between the threads full.
    pub dropped: u64,
}

impl LastFrames {
    /// Starts the thread; the second value is the sink for the cyclic thread. Where no file can be made that is told now, not when
    /// it is needed.
    pub fn start(keep: KeepFrames) -> io::Result<(LastFrames, Box<dyn FrameSink + Send>)> {
        if keep.path.is_dir() || keep.path.file_name().is_none() {
            let told = format!("`{}` is a folder, expected the name of a file", keep.path.display());
            return Err(io::Error::new(io::ErrorKind::IsADirectory, told));
        }
        let (_, path) = next_file(&keep.path, 1)?;
        std::fs::remove_file(path)?;
        let dropped = Arc::new(AtomicU64::new(0));
        let (sink, ring) = ring_sink(dropped.clone(), keep.when_full);
        let told = Arc::new(AtomicBool::new(false));
        let mut keeper = Keeper::new(keep, told.clone());
        let thread = std::thread::Builder::new().name("last frames".to_owned()).spawn(move || {
            drained(ring, &mut |entry| keeper.take(entry))?;
            Ok(keeper)
        })?;
        Ok((LastFrames { keeper: thread, told, dropped }, sink))
    }

    /// Becomes true where something goes wrong that frames don't tell: what is kept is written a second later.
    pub fn told(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.told)
    }

    /// Waits until everything is written, the end with it where that is wrong. Call it after the sink is dropped, for it waits
    /// for that too.
    pub fn finish(self, is_wrong: bool) -> io::Result<Kept> {
        match self.keeper.join() {
            Ok(keeper) => {
                Ok(Kept { dropped: self.dropped.load(Ordering::Relaxed), ..keeper?.end(is_wrong)? })
            }
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

/// A datagram as it comes again every cycle: place in the frame, command, address, length.
type DatagramKey = (usize, u8, u32, usize);

/// A frame that was sent, by its first datagram.
struct Sent {
    unix_ns: u64,
    index: u8,
    place: DatagramKey,
}

struct Keeper {
    keep: KeepFrames,
    told: Arc<AtomicBool>,
    frames: VecDeque<Entry>,
    counters: HashMap<DatagramKey, u16>,
    /// Frames that were sent and not answered.
    awaited: VecDeque<Sent>,
    /// The MainDevice acknowledges errors with the state that it asks for: who has none may repeat that in its AL status.
    acknowledges: bool,
    /// What went wrong, and when what follows is enough.
    incident: Option<(String, u64)>,
    /// The number of the next file.
    number: u32,
    kept: Kept,
}

impl Keeper {
    fn new(keep: KeepFrames, told: Arc<AtomicBool>) -> Self {
        Keeper {
            keep,
            told,
            frames: VecDeque::new(),
            counters: HashMap::new(),
            awaited: VecDeque::new(),
            acknowledges: false,
            incident: None,
            number: 1,
            kept: Kept::default(),
        }
    }

    fn take(&mut self, entry: Entry) -> io::Result<()> {
        let now = entry.unix_ns;
        let found = match entry.direction {
            Direction::Outbound => self.sent(&entry),
            Direction::Inbound => self.back(&entry),
        };
        let told = self.told.swap(false, Ordering::Relaxed).then(|| BY_THE_RUN.to_owned());
        if let (Some(words), None) = (found.or(told), &self.incident) {
            self.incident = Some((words, now + BEHIND_NS));
        }
        // What follows a moment doesn't push out what came before it.
        let moment =
            self.incident.as_ref().map_or(now, |(_, until)| until.saturating_sub(BEHIND_NS).min(now));
        let oldest = moment.saturating_sub(self.keep.seconds.as_nanos() as u64);
        // A wall clock that was set back would let what came before stay for so long.
        let newest = now.saturating_add(BEHIND_NS);
        let is_over = |first: &Entry| first.unix_ns < oldest || first.unix_ns > newest;
        while self.frames.front().is_some_and(is_over) {
            self.frames.pop_front();
        }
        self.frames.push_back(entry);
        let is_enough = |until: u64| now >= until || until - now > 2 * BEHIND_NS;
        if let Some((words, _)) = self.incident.take_if(|(_, until)| is_enough(*until)) {
            match self.kept.files.len() < MOST_FILES {
                true => self.write(words)?,
                false => self.kept.untold += 1,
            }
        }
        Ok(())
    }

    fn sent(&mut self, entry: &Entry) -> Option<String> {
        for datagram in Datagrams::new(&entry.frame).ok()?.flatten() {
            let is_asked = datagram.header.address >> 16 == u32::from(register::AL_CONTROL);
            if is_asked && datagram.data.len() >= 2 {
                self.acknowledges = u16_at(datagram.data, 0) & AL_ERROR != 0;
            }
        }
        let header = Datagrams::new(&entry.frame).ok()?.next()?.ok()?.header;
        let place = (0, header.command, header.address, header.length);
        let age_ns = |sent: &Sent| entry.unix_ns.saturating_sub(sent.unix_ns);
        let oldest_ns = self.awaited.front().map_or(0, age_ns);
        // The next of its kind is sent: a cycle is over, and its answer comes too late if it comes.
        let before = self.awaited.len();
        self.awaited.retain(|sent| sent.place != place || age_ns(sent) <= AT_ONCE_NS);
        let is_late = self.awaited.len() < before;
        self.awaited.push_back(Sent { unix_ns: entry.unix_ns, index: header.index, place });
        if oldest_ns > UNANSWERED_NS {
            self.awaited.clear();
        }
        (is_late || oldest_ns > UNANSWERED_NS).then(|| "a frame got no answer in its time".to_owned())
    }

    fn back(&mut self, entry: &Entry) -> Option<String> {
        let mut words = None;
        for (number, datagram) in Datagrams::new(&entry.frame).ok()?.enumerate() {
            let Ok(datagram) = datagram else { return Some("a frame came back damaged".to_owned()) };
            let header = &datagram.header;
            if number == 0 {
                let is_own = |sent: &Sent| (sent.index, sent.place.1) == (header.index, header.command);
                // Those before it were lost, or come later: both are told.
                if let Some(at) = self.awaited.iter().position(is_own) {
                    if at > 0 {
                        words = Some("a frame got no answer, but later ones did".to_owned());
                    }
                    self.awaited.drain(..=at);
                }
            }
            // What a SubDevice is asked by its register beside the cycle differs by nature.
            let is_cyclic = matches!(header.command, 10..=12);
            let place = (number, header.command, header.address, header.length);
            let counter = datagram.working_counter;
            if is_cyclic && self.counters.len() < MOST_KNOWN {
                let before = self.counters.insert(place, counter);
                if before.is_some_and(|before| before > counter) {
                    words = Some(format!(
                        "datagram {number}: working counter {counter} behind {}",
                        before.unwrap_or_default()
                    ));
                }
            }
            let is_status =
                header.address >> 16 == u32::from(register::AL_STATUS) && datagram.data.len() >= 2;
            let is_error = is_status && counter > 0 && u16_at(datagram.data, 0) & AL_ERROR != 0;
            // With its code, where that is read, too: a repeated acknowledgement has none.
            let has_code = datagram.data.len() >= 6 && u16_at(datagram.data, 4) != 0;
            if is_error && (has_code || !self.acknowledges) {
                words = Some("a SubDevice shows an error in its AL status".to_owned());
            }
        }
        words
    }

    fn write(&mut self, words: String) -> io::Result<()> {
        let (file, path) = next_file(&self.keep.path, self.number)?;
        self.number += 1;
        let mut writer = PcapngWriter::new(BufWriter::new(file), &self.keep.interface)?;
        for entry in &self.frames {
            writer.write(entry.unix_ns, entry.direction, &entry.frame)?;
        }
        writer.finish()?.into_inner().map_err(|error| error.into_error())?.sync_all()?;
        self.kept.files.push((path, words));
        Ok(())
    }

    /// No more frames come: what went wrong is written with what there is.
    fn end(mut self, is_wrong: bool) -> io::Result<Kept> {
        let is_wrong = is_wrong || self.told.load(Ordering::Relaxed);
        let told = is_wrong.then(|| BY_THE_RUN.to_owned());
        if let Some(words) = self.incident.take().map(|(words, _)| words).or(told) {
            self.write(words)?;
        }
        Ok(self.kept)
    }
}

/// The first file from this number on that isn't there yet, and its path.
fn next_file(path: &Path, first: u32) -> io::Result<(File, PathBuf)> {
    for number in first.. {
        let path = numbered(path, number);
        match File::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => {
                let words =
                    |error: io::Error| io::Error::new(error.kind(), format!("`{}`: {error}", path.display()));
                return Ok((made.map_err(words)?, path));
            }
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// `x.pcapng`, `x-2.pcapng` and so on.
fn numbered(path: &Path, number: u32) -> PathBuf {
    if number == 1 {
        return path.to_path_buf();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|extension| format!(".{}", extension.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number}{}", extension.unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Capture;
    use omnibase_ethercat_wire::frame::FrameBuilder;
    use omnibase_ethercat_wire::{Address, Command};

    fn frame(index: u8, counter: u16) -> Vec<u8> {
        let mut frame = FrameBuilder::new();
        frame.push(Command::Lrd, index, Address::Logical(0), &[0; 4]).unwrap();
        let mut bytes = frame.bytes().to_vec();
        let at = bytes.len().min(16 + 10 + 4);
        bytes[at..at + 2].copy_from_slice(&counter.to_le_bytes());
        bytes
    }

    /// Ten seconds of cycles of 10 ms, of which cycle 600 has this working counter, and is answered or not.
    fn kept(name: &str, counter: u16, is_answered: bool) -> (Kept, PathBuf) {
        let path = std::env::temp_dir().join(format!("omnibase-{}-{name}.pcapng", std::process::id()));
        let keep = KeepFrames {
            path: path.clone(),
            interface: "eth1".into(),
            seconds: Duration::from_secs(2),
            when_full: WhenFull::Wait,
        };
        let (frames, mut sink) = LastFrames::start(keep).unwrap();
        for cycle in 0..1000u64 {
            let (time, index) = (cycle * 10_000_000, cycle as u8);
            sink.record(time, Direction::Outbound, &frame(index, 0)).unwrap();
            let counter = if cycle == 600 { counter } else { 3 };
            if is_answered || cycle != 600 {
                sink.record(time + 50_000, Direction::Inbound, &frame(index, counter)).unwrap();
            }
        }
        drop(sink);
        (frames.finish(false).unwrap(), path)
    }

    #[test]
    fn a_wall_clock_that_is_set_back_lets_nothing_pile_up() {
        let keep = KeepFrames {
            path: PathBuf::from("unwritten.pcapng"),
            interface: "eth1".into(),
            seconds: Duration::from_secs(2),
            when_full: WhenFull::Wait,
        };
        let mut keeper = Keeper::new(keep, Arc::default());
        for number in (10_000..10_100_u64).chain(0..1000) {
            let unix_ns = number * 10_000_000;
            keeper.take(Entry { unix_ns, direction: Direction::Inbound, frame: frame(0, 3) }).unwrap();
        }
        assert_eq!(keeper.frames.len(), 201);
    }

    #[test]
    fn nothing_is_written_where_nothing_goes_wrong() {
        let (kept, path) = kept("well", 3, true);
        assert_eq!((kept.files, kept.dropped), (vec![], 0));
        assert!(!path.exists());
    }

    #[test]
    fn what_came_before_and_behind_is_written_when_a_counter_falls_or_an_answer_is_missing() {
        for (name, counter, is_answered, words) in [
            ("short", 2, true, "datagram 0: working counter 2 behind 3"),
            ("lost", 3, false, "a frame got no answer in its time"),
        ] {
            let (kept, path) = kept(name, counter, is_answered);
            assert_eq!(kept.files, [(path.clone(), words.to_owned())]);
            let file = std::fs::read(&path).unwrap();
            let capture = Capture::read(&file).unwrap();
            let times: Vec<u64> = capture.frames.iter().map(|frame| frame.unix_ns).collect();
            let (first, last) = (times[0], times[times.len() - 1]);
            assert!((3_900_000_000..4_100_000_000).contains(&first), "{name}: {first}");
            assert!((7_000_000_000..7_050_000_000).contains(&last), "{name}: {last}");
            std::fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn what_cannot_be_written_is_refused_at_once_and_what_is_there_is_left_alone() {
        let folder = std::env::temp_dir().join(format!("omnibase-{}-incidents", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let keep = |path: PathBuf| KeepFrames {
            path,
            interface: "eth1".into(),
            seconds: Duration::from_secs(2),
            when_full: WhenFull::Wait,
        };
        let nowhere = folder.join("none/x.pcapng");
        let refused = LastFrames::start(keep(nowhere.clone())).err().expect("no such folder").to_string();
        assert!(refused.contains(nowhere.to_str().unwrap()), "{refused}");
        let path = folder.join("x.pcapng");
        std::fs::write(&path, "of an earlier run").unwrap();
        let (frames, mut sink) = LastFrames::start(keep(path.clone())).unwrap();
        // Each second something else goes wrong, more often than there are files for, and at the end once more.
        for cycle in 0..300u64 {
            let counter = if cycle % 15 == 14 { 2 } else { 3 };
            sink.record(cycle * 100_000_000, Direction::Inbound, &frame(0, counter)).unwrap();
        }
        drop(sink);
        let kept = frames.finish(true).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "of an earlier run");
        assert_eq!(kept.files.len(), MOST_FILES + 1, "{:?}", kept.files);
        assert_eq!(kept.files[0].0, folder.join("x-2.pcapng"));
        assert!(kept.untold > 5, "{}", kept.untold);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// However late the end's verdict comes, and whatever the run told in between.
    #[test]
    fn what_the_run_tells_is_written_with_what_came_before_it() {
        let path = std::env::temp_dir().join(format!("omnibase-{}-told.pcapng", std::process::id()));
        let keep = KeepFrames {
            path: path.clone(),
            interface: "eth1".into(),
            seconds: Duration::from_secs(2),
            when_full: WhenFull::Wait,
        };
        let told = Arc::<AtomicBool>::default();
        let mut keeper = Keeper::new(keep, Arc::clone(&told));
        for cycle in 0..1000u64 {
            told.fetch_or(cycle == 300, Ordering::Relaxed);
            let unix_ns = cycle * 10_000_000;
            keeper.take(Entry { unix_ns, direction: Direction::Inbound, frame: frame(0, 3) }).unwrap();
        }
        let kept = keeper.end(true).unwrap();
        let files: Vec<PathBuf> = kept.files.into_iter().map(|(path, _)| path).collect();
        assert_eq!(files, [path.clone(), numbered(&path, 2)]);
        for (file, expected) in
            files.iter().zip([1_000_000_000..4_010_000_000, 7_900_000_000..10_000_000_000_u64])
        {
            let bytes = std::fs::read(file).unwrap();
            let times = Capture::read(&bytes).unwrap().frames;
            assert!(times.iter().all(|frame| expected.contains(&frame.unix_ns)), "{file:?}");
            assert!(times.len() > 190, "{}", times.len());
            std::fs::remove_file(file).unwrap();
        }
    }

    /// What became of frames at these times in us, with these bytes.
    fn kept_of(name: &str, frames: &[(u64, Direction, Vec<u8>)]) -> Vec<String> {
        let path = std::env::temp_dir().join(format!("omnibase-{}-{name}.pcapng", std::process::id()));
        let (interface, seconds) = ("eth1".to_owned(), Duration::from_secs(2));
        let keep = KeepFrames { path, interface, seconds, when_full: WhenFull::Wait };
        let mut keeper = Keeper::new(keep, Arc::default());
        for (time_us, direction, frame) in frames {
            let (unix_ns, direction, frame) = (1000 * time_us, *direction, frame.clone());
            keeper.take(Entry { unix_ns, direction, frame }).unwrap();
        }
        let files = keeper.end(false).unwrap().files.into_iter();
        files.map(|(path, words)| std::fs::remove_file(path).map(|()| words).unwrap()).collect()
    }

    /// An answer that comes behind the next cycle's frame is none for its cycle; both ends of a ring send at once.
    #[test]
    fn an_answer_behind_the_next_cycle_is_late() {
        let (out, back) = (Direction::Outbound, Direction::Inbound);
        let sound =
            [(0, out, 1), (10, out, 1), (90, back, 1), (100, back, 1), (1000, out, 2), (1090, back, 2)];
        let late =
            [(0, out, 1), (1000, out, 2), (1010, back, 1), (1090, back, 2), (2000, out, 3), (2090, back, 3)];
        let frames = |all: &[(u64, Direction, u8)]| -> Vec<_> {
            all.iter().map(|(time_us, way, index)| (*time_us, *way, frame(*index, 3))).collect()
        };
        assert_eq!(kept_of("in-time", &frames(&sound)), Vec::<String>::new());
        assert_eq!(kept_of("late", &frames(&late)), ["a frame got no answer in its time"]);
    }

    /// On the way down errors are acknowledged by the way, and a chip alone repeats that; its own error has a code.
    #[test]
    fn a_repeated_acknowledgement_is_no_error() {
        let status = |direction, register, data: &[u8]| {
            let mut frame = FrameBuilder::new();
            let command = if direction == Direction::Outbound { Command::Fpwr } else { Command::Fprd };
            frame.push(command, 7, Address::Station { station: 0x1001, register }, data).unwrap();
            let mut bytes = frame.bytes().to_vec();
            let at = 16 + 10 + data.len();
            bytes[at..at + 2].copy_from_slice(&1u16.to_le_bytes());
            (0, direction, bytes)
        };
        let shown = |data: &[u8]| status(Direction::Inbound, register::AL_STATUS, data);
        let acknowledged = status(Direction::Outbound, register::AL_CONTROL, &[0x12, 0]);
        let error = ["a SubDevice shows an error in its AL status"];
        assert_eq!(kept_of("error", &[shown(&[0x12, 0])]), error);
        assert_eq!(kept_of("repeated", &[acknowledged.clone(), shown(&[0x12, 0])]), Vec::<String>::new());
        assert_eq!(kept_of("code", &[acknowledged, shown(&[0x12, 0, 0, 0, 0x1B, 0])]), error);
    }

    #[test]
    fn later_files_have_numbers() {
        assert_eq!(numbered(Path::new("a/x.pcapng"), 1), Path::new("a/x.pcapng"));
        assert_eq!(numbered(Path::new("a/x.pcapng"), 2), Path::new("a/x-2.pcapng"));
    }

    #[test]
    fn a_folder_is_no_file_for_frames() {
        for path in [".", "/"] {
            let keep = KeepFrames {
                path: path.into(),
                interface: "simulated".to_owned(),
                seconds: Duration::from_secs(1),
                when_full: WhenFull::Drop,
            };
            let refused = LastFrames::start(keep).map(drop).unwrap_err().to_string();
            assert!(refused.contains("is a folder"), "{refused}");
        }
    }
}
