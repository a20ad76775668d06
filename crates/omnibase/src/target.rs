//! What a command talks to: a network interface, or a simulated segment in the process.

use crate::progress::note;
use anyhow::Context;
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::{VirtualClock, in_process};
use omnibase_ethercat_wire::{Clock, HostTime, Link};
use omnibase_host::{MonotonicClock, PacketRing, PacketSocket, Waiting};
use omnibase_record::{BackgroundRecorder, PcapngWriter, RecordingLink, WhenFull};
use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

/// Where the segment is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// Behind this network interface, in real time.
    Interface(String),
    /// Simulated in the process as this file describes it, in virtual time.
    Simulated(PathBuf),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("sim:") {
            Some("") => Err("the path of a segment file is missing behind `sim:`".to_owned()),
            Some(path) => Ok(Target::Simulated(path.into())),
            None if text.is_empty() => Err("expected an interface or sim:<segment.toml>".to_owned()),
            None => Ok(Target::Interface(text.to_owned())),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Target::Interface(name) => f.write_str(name),
            Target::Simulated(path) => write!(f, "sim:{}", path.display()),
        }
    }
}

/// How frames reach an interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Port {
    /// `send` and `recv`.
    #[default]
    Socket,
    /// Mapped rings.
    Ring(Waiting),
}

/// A clock of either kind; clones show the same time.
#[derive(Clone, Debug)]
pub enum AnyClock {
    /// The host's.
    Host(MonotonicClock),
    /// Virtual time.
    Virtual(VirtualClock),
    /// Virtual time at the pace of the host's.
    Paced(PacedClock),
}

/// Virtual time that doesn't run ahead of the host's: a simulated robot at which people look and which they drive.
#[derive(Clone, Debug)]
pub struct PacedClock {
    clock: VirtualClock,
    /// The same moment on both clocks; from the first sleep on.
    anchor: Option<(HostTime, Instant)>,
}

/// So far behind the host it starts afresh in place of running after it.
const MOST_BEHIND: Duration = Duration::from_millis(100);

impl PacedClock {
    /// Virtual time, paced from now on.
    pub fn new(clock: VirtualClock) -> Self {
        PacedClock { clock, anchor: None }
    }

    fn sleep_until(&mut self, instant: HostTime) {
        let (virtual_then, host_then) =
            *self.anchor.get_or_insert_with(|| (self.clock.now(), Instant::now()));
        let due = host_then + (instant - virtual_then);
        let now = Instant::now();
        if now < due {
            std::thread::sleep(due - now);
        } else if now - due > MOST_BEHIND {
            self.anchor = Some((instant, now));
        }
        self.clock.sleep_until(instant);
    }
}

impl Clock for AnyClock {
    fn now(&self) -> HostTime {
        match self {
            AnyClock::Host(clock) => clock.now(),
            AnyClock::Virtual(clock) => clock.now(),
            AnyClock::Paced(paced) => paced.clock.now(),
        }
    }

    fn sleep_until(&mut self, instant: HostTime) {
        match self {
            AnyClock::Host(clock) => clock.sleep_until(instant),
            AnyClock::Virtual(clock) => clock.sleep_until(instant),
            AnyClock::Paced(paced) => paced.sleep_until(instant),
        }
    }
}

/// The way to a segment.
pub struct Cable {
    /// The link.
    pub link: Box<dyn Link>,
    /// The clock that belongs to it.
    pub clock: AnyClock,
    /// What the link is called in recordings.
    label: String,
}

/// A bus over any link.
pub type AnyBus = Bus<Box<dyn Link>, AnyClock>;

impl Target {
    /// Opens the way to the segment.
    pub fn open(&self, port: Port) -> anyhow::Result<Cable> {
        match self {
            Target::Interface(name) => {
                let link: Box<dyn Link> = match port {
                    Port::Socket => Box::new(PacketSocket::open(name)?),
                    Port::Ring(waiting) => Box::new(PacketRing::open(name, waiting)?),
                };
                Ok(Cable { link, clock: AnyClock::Host(MonotonicClock), label: name.clone() })
            }
            Target::Simulated(path) => {
                let (link, clock) = in_process(crate::segment::load(path)?);
                Ok(Cable { link: Box::new(link), clock: AnyClock::Virtual(clock), label: self.to_string() })
            }
        }
    }

    /// Opens the way to the segment and sets a bus up on it; nothing is sent yet.
    pub fn bus(&self) -> anyhow::Result<AnyBus> {
        Ok(self.open(Port::Socket)?.into_bus())
    }
}

impl Cable {
    /// A bus on this cable; nothing is sent yet.
    pub fn into_bus(self) -> AnyBus {
        Bus::new(self.link, self.clock, BusOptions::default())
    }

    /// Records from now on what passes through the link into `path`. The recording ends when the cable is gone.
    pub fn record(self, path: &Path) -> anyhow::Result<(Self, BackgroundRecorder)> {
        let file = File::create(path).with_context(|| format!("creating `{}`", path.display()))?;
        let writer = PcapngWriter::new(BufWriter::new(file), &self.label)
            .with_context(|| format!("writing `{}`", path.display()))?;
        let (unix_offset_ns, when_full) = match &self.clock {
            AnyClock::Host(clock) => (clock.unix_offset_ns(), WhenFull::Drop),
            AnyClock::Virtual(_) | AnyClock::Paced(_) => (0, WhenFull::Wait),
        };
        let (recorder, sink) = BackgroundRecorder::start(writer, when_full)?;
        let clock = Box::new(self.clock.clone());
        let link = Box::new(RecordingLink::new(self.link, clock, unix_offset_ns, sink));
        Ok((Cable { link, ..self }, recorder))
    }
}

/// Waits until a recording is written, and says what became of it.
pub fn finish_recording(recorder: BackgroundRecorder, path: &Path) -> anyhow::Result<()> {
    let recorded = recorder.finish().with_context(|| format!("writing `{}`", path.display()))?;
    note(format_args!("recorded {} frames in {}", recorded.frames, path.display()));
    anyhow::ensure!(
        recorded.dropped == 0,
        "{} frames found no room in the recorder's ring",
        recorded.dropped
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_an_interface_or_a_segment_file() {
        assert_eq!("eth0".parse(), Ok(Target::Interface("eth0".to_owned())));
        assert_eq!("sim:a.toml".parse(), Ok(Target::Simulated("a.toml".into())));
        assert!("sim:".parse::<Target>().is_err() && "".parse::<Target>().is_err());
    }
}
