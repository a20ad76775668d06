//! What a command talks to: a network interface, or a simulated segment in the process.

use crate::progress::{note, warn};
use anyhow::Context;
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::{Pace, VirtualClock, in_process};
use omnibase_ethercat_wire::{Clock, HostTime, Link, LinkError, RingState};
use omnibase_host::{
    Holder, InterfaceLock, LISTENING, LockError, MonotonicClock, PacketRing, PacketSocket, Waiting, listen,
};
use omnibase_record::{BackgroundRecorder, PcapngWriter, RecordingLink, WhenFull};
use omnibase_run::pace::PacedClock;
use std::fmt;
use std::io::BufWriter;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Where the segment is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// Behind this network interface, in real time.
    Interface(String),
    /// Driven by a robot that runs on this machine: the one that was started last, or the one at this address.
    Running(Option<SocketAddr>),
    /// Simulated in the process as this file describes it, in virtual time.
    Simulated(PathBuf),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(robot) = text.strip_prefix('@') {
            return match robot {
                "robot" => Ok(Target::Running(None)),
                address => address.parse().map(|address| Target::Running(Some(address))).map_err(|_| {
                    format!("expected @robot or @<address>:<port> of its dashboard, found `{text}`")
                }),
            };
        }
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
            Target::Running(None) => f.write_str("@robot"),
            Target::Running(Some(address)) => write!(f, "@{address}"),
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

/// Whether other programs on this machine see frames leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Taps {
    /// They see answers alone.
    Bypassed,
    /// They see both.
    See,
}

/// How a segment is taken that somebody else may drive.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Manners {
    /// Take the segment even where frames of another MainDevice pass at the interface.
    #[arg(long)]
    pub force: bool,
    /// Let tcpdump on this machine see the frames that leave, too: without it only answers are seen there. Costs a little time.
    #[arg(long)]
    pub visible: bool,
}

impl Manners {
    /// Opens the way to a segment as its MainDevice: refused where a program of ours has the interface, and where
    /// another MainDevice's frames pass there.
    pub fn enter(self, target: &Target, port: Port) -> anyhow::Result<Cable> {
        let taps = if self.visible { Taps::See } else { Taps::Bypassed };
        let Target::Interface(name) = target else { return target.open(port) };
        let lock =
            InterfaceLock::take(name).map_err(|error| in_use(&error).unwrap_or_else(|| error.into()))?;
        if let Some(heard) = listen(name, LISTENING)? {
            anyhow::ensure!(
                self.force,
                "`{name}`: another MainDevice drives this segment, and its drives would stop: {heard}; end it, or \
                 take the segment from it by --force"
            );
            warn(format_args!("`{name}`: the segment is taken from another MainDevice: {heard}"));
        }
        let cable = target.open_for(port, taps)?;
        Ok(Cable { link: Box::new(Held { link: cable.link, _lock: lock }), ..cable })
    }
}

/// Who has the interface, and what to do about it.
fn in_use(error: &LockError) -> Option<anyhow::Error> {
    let LockError::Held { holder, .. } = error else { return None };
    let remedy = match holder {
        Some(Holder { command, .. }) if command.contains(" run ") => {
            "a robot that runs with --dashboard answers by itself: `omnibase scan @robot`, \
             `omnibase sdo read @robot 0 6041:00`"
        }
        _ => "wait until it has ended, or end it",
    };
    Some(anyhow::anyhow!("{error}: {remedy}"))
}

/// A link whose interface nobody else of ours takes as long as it lives.
struct Held {
    link: Box<dyn Link>,
    _lock: InterfaceLock,
}

impl Link for Held {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }

    fn arrival(&self) -> Option<HostTime> {
        self.link.arrival()
    }

    fn ring(&self) -> Option<RingState> {
        self.link.ring()
    }

    fn is_connected(&self) -> Option<bool> {
        self.link.is_connected()
    }
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

impl Clock for AnyClock {
    fn now(&self) -> HostTime {
        match self {
            AnyClock::Host(clock) => clock.now(),
            AnyClock::Virtual(clock) => clock.now(),
            AnyClock::Paced(clock) => clock.now(),
        }
    }

    fn since_2000_ns(&self) -> Option<u64> {
        match self {
            AnyClock::Host(clock) => clock.since_2000_ns(),
            AnyClock::Virtual(_) | AnyClock::Paced(_) => None,
        }
    }

    fn chance(&self) -> Option<u64> {
        match self {
            AnyClock::Host(clock) => clock.chance(),
            AnyClock::Virtual(_) | AnyClock::Paced(_) => None,
        }
    }

    fn sleep_until(&mut self, instant: HostTime) {
        match self {
            AnyClock::Host(clock) => clock.sleep_until(instant),
            AnyClock::Virtual(clock) => clock.sleep_until(instant),
            AnyClock::Paced(clock) => clock.sleep_until(instant),
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
    /// Opens the way to the segment, whoever is there; a MainDevice [enters](Manners::enter).
    pub fn open(&self, port: Port) -> anyhow::Result<Cable> {
        self.open_for(port, Taps::Bypassed)
    }

    fn open_for(&self, port: Port, taps: Taps) -> anyhow::Result<Cable> {
        match self {
            Target::Interface(name) => {
                let link: Box<dyn Link> = match port {
                    Port::Socket => {
                        let socket = PacketSocket::open(name)?;
                        if taps == Taps::See {
                            socket.let_taps_see();
                        }
                        Box::new(socket)
                    }
                    Port::Ring(waiting) => {
                        let ring = PacketRing::open(name, waiting)?;
                        if taps == Taps::See {
                            ring.let_taps_see();
                        }
                        Box::new(ring)
                    }
                };
                Ok(Cable { link, clock: AnyClock::Host(MonotonicClock), label: name.clone() })
            }
            Target::Running(_) => {
                anyhow::bail!(
                    "`{self}` drives its segment itself: expected an interface or sim:<segment.toml>"
                )
            }
            Target::Simulated(path) => {
                let (link, clock) = in_process(crate::segment::load(path, Pace::Lockstep)?);
                Ok(Cable { link: Box::new(link), clock: AnyClock::Virtual(clock), label: self.to_string() })
            }
        }
    }
}

impl Cable {
    /// A bus on this cable; nothing is sent yet.
    pub fn into_bus(self) -> AnyBus {
        Bus::new(self.link, self.clock, BusOptions::default())
    }

    /// Records from now on what passes through the link into `path`. The recording ends when the cable is gone.
    pub fn record(self, path: &Path) -> anyhow::Result<(Self, BackgroundRecorder)> {
        let file = omnibase_record::create(path).with_context(|| format!("creating `{}`", path.display()))?;
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
        assert_eq!("@robot".parse(), Ok(Target::Running(None)));
        assert_eq!("@127.0.0.1:8400".parse(), Ok(Target::Running("127.0.0.1:8400".parse().ok())));
        assert!("@".parse::<Target>().is_err() && "@eth0".parse::<Target>().is_err());
        assert!("sim:".parse::<Target>().is_err() && "".parse::<Target>().is_err());
    }
}
