//! A pose in a plain datagram: the form is described in docs/guides/motion-capture.md.

use std::net::IpAddr;

use omnibase_platform::covariance_fault;
use omnibase_robot::config::DatagramPlan;
use omnibase_robot::signals::Heard;

use crate::clock::{ClockMap, Mapped};
use crate::cursor::Cursor;
use crate::moving::Moving;
use crate::numbers::Numbers;

/// What each datagram begins with.
pub const MAGIC: [u8; 4] = *b"OBPS";
/// What each answer begins with.
pub const ANSWER_MAGIC: [u8; 4] = *b"OBCK";
/// The version that is understood.
pub const VERSION: u8 = 1;
/// Flag: a covariance follows the pose.
pub const HAS_COVARIANCE: u8 = 1;
/// Flag: at the end stands which of our answers was heard last.
pub const HAS_ECHO: u8 = 2;
/// Flag: an answer with our clock is wished.
pub const WANTS_ANSWER: u8 = 4;
/// Bytes of an answer.
pub const ANSWER_BYTES: usize = 20;
/// Bytes of the shortest and the longest datagram.
pub const BYTES: [usize; 2] = [56, 56 + 48 + 16];
/// The longest time between an instant and the sending of what was measured then, ns.
const HELD_AT_MOST_NS: u64 = 60_000_000_000;
/// No room is larger, m.
const FARTHEST_M: f64 = 1e5;
/// So many of the last answers are remembered.
const ANSWERS: usize = 256;

/// A pose as it is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseDatagram {
    /// Counts up by one with each.
    pub sequence: u32,
    /// When the pose was so, ns of the sender's clock.
    pub instant_ns: u64,
    /// When the datagram was sent, ns of the same clock.
    pub sent_ns: u64,
    /// x and y in m, heading in rad.
    pub pose: [f64; 3],
    /// xx, xy, xh, yy, yh, hh in m² and rad.
    pub covariance: Option<[f64; 6]>,
    /// Which of our answers was heard last.
    pub echo: Option<Echo>,
    /// Whether an answer is wished.
    pub answer: Answer,
}

/// Whether our clock is to be told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Answer {
    /// It isn't.
    #[default]
    Unwanted,
    /// It is.
    Wanted,
}

/// What a sender heard of our clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Echo {
    /// What an answer said, ns of our clock.
    pub told_ns: u64,
    /// How long ago it was heard when this was sent, ns of the sender's clock.
    pub held_ns: u64,
}

/// Why a datagram goes no further.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// Somebody else sent it.
    #[error("a datagram of {found}: only {expected} is heard (`peer`)")]
    Stranger {
        /// Who.
        found: IpAddr,
        /// Who may.
        expected: IpAddr,
    },
    /// It doesn't begin as one does.
    #[error("{found} bytes that don't begin with OBPS: no pose datagram")]
    Magic {
        /// Its length.
        found: usize,
    },
    /// Another version.
    #[error("version {found}: expected {VERSION}")]
    Version {
        /// Which.
        found: u8,
    },
    /// Flags that mean nothing.
    #[error("flags {found:#04x}: expected none but 0x07")]
    Flags {
        /// All flags.
        found: u8,
    },
    /// Another length than it says, or than its flags need.
    #[error("{found} bytes: expected {expected} by its flags, and {said} as it says itself")]
    Length {
        /// Bytes that came.
        found: usize,
        /// Bytes that its flags need.
        expected: usize,
        /// Bytes that it says.
        said: u16,
    },
    /// No number, or beyond what can be.
    #[error("{what} is {found}: expected a finite number within its bounds")]
    Number {
        /// What.
        what: &'static str,
        /// The number.
        found: f64,
    },
    /// Its instants contradict each other.
    #[error("its instant is {instant_ns} ns and it was sent at {sent_ns} ns: expected at most 60 s before")]
    Instant {
        /// When it was measured.
        instant_ns: u64,
        /// When it was sent.
        sent_ns: u64,
    },
    /// It was heard before.
    #[error("number {sequence} was heard already")]
    Again {
        /// Which.
        sequence: u32,
    },
    /// The sender's clock contradicts itself.
    #[error("the sender's clock is not where it was: left out until it stays so")]
    Clock,
}

impl PoseDatagram {
    /// Reads one.
    ///
    /// # Errors
    /// The bytes aren't one, or its values can't be.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refused> {
        let mut at = Cursor::new(bytes);
        let magic = Refused::Magic { found: bytes.len() };
        if at.array() != Some(MAGIC) {
            return Err(magic);
        }
        let (version, flags) = (at.u8().ok_or(magic)?, at.u8().ok_or(magic)?);
        if version != VERSION {
            return Err(Refused::Version { found: version });
        }
        if flags & !(HAS_COVARIANCE | HAS_ECHO | WANTS_ANSWER) != 0 {
            return Err(Refused::Flags { found: flags });
        }
        let has = |flag: u8| flags & flag != 0;
        let expected = BYTES[0] + 48 * usize::from(has(HAS_COVARIANCE)) + 16 * usize::from(has(HAS_ECHO));
        let said = at.u16().ok_or(magic)?;
        let length = Refused::Length { found: bytes.len(), expected, said };
        if bytes.len() != expected || usize::from(said) != expected {
            return Err(length);
        }
        let sequence = at.u32().ok_or(length)?;
        let _reserved = at.u32().ok_or(length)?;
        let (instant_ns, sent_ns) = (at.u64().ok_or(length)?, at.u64().ok_or(length)?);
        let mut numbers = |count: usize| (0..count).map(|_| at.f64()).collect::<Option<Vec<f64>>>();
        let pose = numbers(3).ok_or(length)?;
        let covariance = if has(HAS_COVARIANCE) { Some(numbers(6).ok_or(length)?) } else { None };
        let echo = if has(HAS_ECHO) {
            Some(Echo { told_ns: at.u64().ok_or(length)?, held_ns: at.u64().ok_or(length)? })
        } else {
            None
        };
        if sent_ns.checked_sub(instant_ns).is_none_or(|held_ns| held_ns > HELD_AT_MOST_NS) {
            return Err(Refused::Instant { instant_ns, sent_ns });
        }
        let pose = [pose[0], pose[1], pose[2]];
        for (what, found) in ["x", "y", "heading"].into_iter().zip(pose) {
            if !found.is_finite() || found.abs() > FARTHEST_M {
                return Err(Refused::Number { what, found });
            }
        }
        let covariance = match covariance.as_deref() {
            Some(&[xx, xy, xh, yy, yh, hh]) => Some([xx, xy, xh, yy, yh, hh]),
            _ => None,
        };
        if let Some((what, found)) = covariance.as_ref().and_then(covariance_fault) {
            return Err(Refused::Number { what, found });
        }
        let variances = covariance.iter().flat_map(|[xx, _, _, yy, _, hh]| [*xx, *yy, *hh]);
        if let Some(found) = variances.into_iter().find(|found| *found > FARTHEST_M * FARTHEST_M) {
            return Err(Refused::Number { what: "a variance", found });
        }
        let answer = if has(WANTS_ANSWER) { Answer::Wanted } else { Answer::Unwanted };
        Ok(PoseDatagram { sequence, instant_ns, sent_ns, pose, covariance, echo, answer })
    }

    /// Its bytes, as [`PoseDatagram::from_bytes`] reads them.
    pub fn to_bytes(&self) -> Vec<u8> {
        let flags = (u8::from(self.covariance.is_some()) * HAS_COVARIANCE)
            | (u8::from(self.echo.is_some()) * HAS_ECHO)
            | (u8::from(self.answer == Answer::Wanted) * WANTS_ANSWER);
        let mut bytes = MAGIC.to_vec();
        bytes.extend([VERSION, flags, 0, 0]);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend(self.instant_ns.to_le_bytes());
        bytes.extend(self.sent_ns.to_le_bytes());
        let numbers = self.pose.iter().chain(self.covariance.iter().flatten());
        bytes.extend(numbers.flat_map(|number| number.to_le_bytes()));
        bytes.extend(
            self.echo.iter().flat_map(|echo| [echo.told_ns, echo.held_ns]).flat_map(u64::to_le_bytes),
        );
        let length = (bytes.len() as u16).to_le_bytes();
        bytes[6..8].copy_from_slice(&length);
        bytes
    }
}

/// What became of a datagram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// The pose, on our clock.
    pub heard: Heard,
    /// How well its instant is known.
    pub mapped: Mapped,
    /// What to answer.
    pub answer: Option<[u8; ANSWER_BYTES]>,
}

/// Hears one sender.
#[derive(Clone, Debug)]
pub struct DatagramHearing {
    peer: IpAddr,
    map: ClockMap,
    numbers: Numbers,
    moving: Moving,
    /// What the last answers said of our clock, ns; 0 where there was none.
    told_ns: [u64; ANSWERS],
    answered: usize,
}

impl DatagramHearing {
    /// Of whom a plan says.
    pub fn new(plan: &DatagramPlan) -> Self {
        DatagramHearing {
            peer: plan.peer,
            map: ClockMap::default(),
            numbers: Numbers::default(),
            moving: Moving::default(),
            told_ns: [0; ANSWERS],
            answered: 0,
        }
    }

    /// Takes a datagram that came from somewhere at an instant of our clock.
    ///
    /// # Errors
    /// Why it goes no further.
    pub fn take(&mut self, bytes: &[u8], from: IpAddr, now_ns: u64) -> Result<Taken, Refused> {
        if from != self.peer {
            return Err(Refused::Stranger { found: from, expected: self.peer });
        }
        let sent = PoseDatagram::from_bytes(bytes)?;
        if !self.numbers.is_new(sent.sequence) {
            return Err(Refused::Again { sequence: sent.sequence });
        }
        // What somebody says of our clock counts where it was said, and is of before now.
        if let Some(echo) = sent.echo
            && echo.told_ns > 0
            && self.told_ns.contains(&echo.told_ns)
            && let Some(after_ns) =
                echo.told_ns.checked_add(echo.held_ns).filter(|after_ns| *after_ns <= now_ns)
        {
            self.map.after(sent.sent_ns, after_ns);
        }
        if !self.map.before(sent.sent_ns, now_ns) {
            return Err(Refused::Clock);
        }
        let mapped = self.map.map(sent.instant_ns).ok_or(Refused::Clock)?;
        let mapped = Mapped { ours_ns: mapped.ours_ns.min(now_ns), ..mapped };
        let answer = (sent.answer == Answer::Wanted).then(|| {
            self.told_ns[self.answered % ANSWERS] = now_ns;
            self.answered += 1;
            answer(sent.sequence, now_ns)
        });
        let heard = self.moving.heard(mapped, sent.pose, sent.covariance.unwrap_or_default());
        Ok(Taken { heard, mapped, answer })
    }
}

/// An answer: OBCK, version, three zeros, the number, our clock in ns.
fn answer(sequence: u32, now_ns: u64) -> [u8; ANSWER_BYTES] {
    let mut bytes = [0; ANSWER_BYTES];
    bytes[..4].copy_from_slice(&ANSWER_MAGIC);
    bytes[4] = VERSION;
    bytes[8..12].copy_from_slice(&sequence.to_le_bytes());
    bytes[12..].copy_from_slice(&now_ns.to_le_bytes());
    bytes
}
