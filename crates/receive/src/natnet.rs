//! NatNet, by which OptiTrack's Motive streams what it sees: versions 3 and 4.
//!
//! The layout is that of public clients: `python_natnet` (M. Edwards, 2017, versions 3.0 and 3.1) and `natnet` of the Python
//! package index (T. Schneider, versions to 4.2). All numbers are little endian; a message is its sort, its length and so
//! many bytes.

mod description;
mod frame;

use std::collections::BTreeMap;
use std::net::Ipv4Addr;

use omnibase_robot::config::{BodyChoice, NatNetPlan, UpAxis};
use omnibase_robot::signals::Heard;

use crate::clock::{ClockMap, Mapped};
use crate::cursor::Cursor;
use crate::moving::Moving;
use crate::numbers::Numbers;

pub use description::body_names;
pub use frame::{Body, Frame};

/// Sorts of message.
mod sort {
    pub const CONNECT: u16 = 0;
    pub const SERVER_INFO: u16 = 1;
    pub const REQUEST_DESCRIPTIONS: u16 = 4;
    pub const DESCRIPTIONS: u16 = 5;
    pub const FRAME: u16 = 7;
    pub const UNRECOGNISED: u16 = 100;
    pub const KEEP_ALIVE: u16 = 10;
    pub const ECHO_REQUEST: u16 = 12;
    pub const ECHO_RESPONSE: u16 = 13;
}

/// Between two requests to a server that said nothing of itself, or of whom it sees, ns.
const ASK_NS: u64 = 1_000_000_000;
/// Between two questions who has which id: somebody may rename bodies.
const NAMES_NS: u64 = 5_000_000_000;
/// Between two signs of life, which a server wants that sends to one machine alone, and two questions for its clock, ns.
const ALIVE_NS: u64 = 250_000_000;
/// A server that says nothing for so long is asked anew who it is: it may have been started again with another version.
const GONE_NS: u64 = 3_000_000_000;
/// A quaternion's length may be off by so much.
const UNIT_WITHIN: f64 = 0.05;
/// A body whose up axis points less than this upwards (the cosine) doesn't stand: another axis is up than the file says.
const UPRIGHT: f64 = 0.5;
/// No room is larger, m.
const FARTHEST_M: f64 = 1e5;

/// Version of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// The first number.
    pub major: u8,
    /// The second one.
    pub minor: u8,
}

/// Why something of the server goes no further.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refused {
    /// Somebody else sent it.
    #[error("a datagram of {found}: only {expected} is heard (`server`)")]
    Stranger {
        /// Who.
        found: Ipv4Addr,
        /// Who may.
        expected: Ipv4Addr,
    },
    /// It ends before it should.
    #[error("{found} bytes of {what}: it is cut off, or of another version than the server's {version:?}")]
    Short {
        /// What.
        what: &'static str,
        /// Its bytes.
        found: usize,
        /// By what it was read.
        version: Option<Version>,
    },
    /// It says another length than it has.
    #[error("a message of {found} bytes that says it has {said}")]
    Length {
        /// Bytes that came behind its head.
        found: usize,
        /// As it says.
        said: u16,
    },
    /// A version that nobody here understands.
    #[error("NatNet {}.{}: expected 3.x or 4.x", .0.major, .0.minor)]
    Version(Version),
    /// Nobody knows yet how to read it.
    #[error(
        "a frame before the server said which version it speaks: does it hear commands at its `command_port`?"
    )]
    Unknown,
    /// The body isn't among those in the frame.
    #[error("the frame has no rigid body {wanted}; it has {found}")]
    NoBody {
        /// Which.
        wanted: String,
        /// Which there are.
        found: String,
    },
    /// The cameras don't see it.
    #[error("the rigid body isn't tracked")]
    Untracked,
    /// Its values can't be.
    #[error("{what} is {found:.3}: expected {expected}")]
    Value {
        /// What.
        what: &'static str,
        /// The number.
        found: f64,
        /// What can be.
        expected: &'static str,
    },
    /// A frame that was heard before.
    #[error("frame {0} was heard already")]
    Again(u32),
    /// The server's clock contradicts itself.
    #[error("the server's clock is not where it was: left out until it stays so")]
    Clock,
    /// The server doesn't know a request.
    #[error("the server doesn't know what it was asked")]
    Unrecognised,
}

/// What a message came to.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Nothing that moves anything.
    Nothing,
    /// Who the server is.
    Server(String, Version),
    /// A pose, and how well its instant is known.
    Pose(Box<Heard>, Mapped),
}

/// What is known of the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Server {
    version: Version,
    ticks_per_s: u64,
}

/// The talk with a server.
#[derive(Clone, Debug)]
pub struct NatNet {
    plan: NatNetPlan,
    server: Option<Server>,
    map: ClockMap,
    /// Ids by name.
    names: BTreeMap<String, u32>,
    frames: Numbers,
    moving: Moving,
    asked_ns: Option<u64>,
    names_asked_ns: Option<u64>,
    alive_ns: Option<u64>,
    heard_ns: u64,
}

impl NatNet {
    /// With whom a plan says.
    pub fn new(plan: &NatNetPlan) -> Self {
        NatNet {
            plan: plan.clone(),
            server: None,
            map: ClockMap::default(),
            names: BTreeMap::new(),
            frames: Numbers::default(),
            moving: Moving::default(),
            asked_ns: None,
            names_asked_ns: None,
            alive_ns: None,
            heard_ns: 0,
        }
    }

    /// What to send to the server's port for commands now.
    pub fn requests(&mut self, now_ns: u64) -> Vec<Vec<u8>> {
        let is_due = |last_ns: &mut Option<u64>, period_ns| {
            let is_due = last_ns.is_none_or(|last_ns| now_ns.saturating_sub(last_ns) >= period_ns);
            if is_due {
                *last_ns = Some(now_ns);
            }
            is_due
        };
        let mut requests = Vec::new();
        if now_ns.saturating_sub(self.heard_ns) > GONE_NS {
            self.server = None;
        }
        if self.server.is_none() {
            if is_due(&mut self.asked_ns, ASK_NS) {
                requests.push(message(sort::CONNECT, &hello()));
            }
            return requests;
        }
        if let BodyChoice::Name(name) = &self.plan.body {
            let period_ns = if self.names.contains_key(name) { NAMES_NS } else { ASK_NS };
            if is_due(&mut self.names_asked_ns, period_ns) {
                requests.push(message(sort::REQUEST_DESCRIPTIONS, &[]));
            }
        }
        if is_due(&mut self.alive_ns, ALIVE_NS) {
            requests.push(message(sort::KEEP_ALIVE, b"\0"));
            requests.push(message(sort::ECHO_REQUEST, &now_ns.to_le_bytes()));
        }
        requests
    }

    /// Takes a message that came from somewhere at an instant of our clock.
    ///
    /// # Errors
    /// Why it goes no further.
    pub fn take(&mut self, bytes: &[u8], from: Ipv4Addr, now_ns: u64) -> Result<Outcome, Refused> {
        if from != self.plan.server {
            return Err(Refused::Stranger { found: from, expected: self.plan.server });
        }
        let short = |what| Refused::Short { what, found: bytes.len(), version: None };
        let mut head = Cursor::new(bytes);
        let (sort, said) = head.u16().zip(head.u16()).ok_or(short("a message"))?;
        let body = bytes.get(4..).unwrap_or_default();
        if body.len() != usize::from(said) {
            return Err(Refused::Length { found: body.len(), said });
        }
        self.heard_ns = now_ns;
        match sort {
            sort::SERVER_INFO => self.server_info(body),
            sort::ECHO_RESPONSE => self.echo(body, now_ns).ok_or(short("an answer with a clock")),
            sort::DESCRIPTIONS => {
                let server = self.server.ok_or(Refused::Unknown)?;
                let short =
                    Refused::Short { what: "descriptions", found: body.len(), version: Some(server.version) };
                self.names = body_names(body, server.version).ok_or(short)?;
                Ok(Outcome::Nothing)
            }
            sort::FRAME => self.frame(body, now_ns),
            sort::UNRECOGNISED => Err(Refused::Unrecognised),
            _ => Ok(Outcome::Nothing),
        }
    }

    fn server_info(&mut self, body: &[u8]) -> Result<Outcome, Refused> {
        let short =
            Refused::Short { what: "what the server says of itself", found: body.len(), version: None };
        let mut at = Cursor::new(body);
        let name = at.take(256).ok_or(short.clone())?;
        let _application = at.take(4).ok_or(short.clone())?;
        let [major, minor, ..] = at.array::<4>().ok_or(short.clone())?;
        let version = Version { major, minor };
        if !(3..=4).contains(&major) {
            return Err(Refused::Version(version));
        }
        let ticks_per_s = at.u64().filter(|ticks| *ticks > 0).ok_or(short)?;
        let server = Server { version, ticks_per_s };
        if self.server != Some(server) {
            (self.map, self.frames) = (ClockMap::default(), Numbers::default());
        }
        self.server = Some(server);
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        Ok(Outcome::Server(String::from_utf8_lossy(name).into_owned(), version))
    }

    /// The server heard our question at an instant of its clock: between when it was sent and now.
    fn echo(&mut self, body: &[u8], now_ns: u64) -> Option<Outcome> {
        let mut at = Cursor::new(body);
        let (asked_ns, its_ticks) = (at.u64()?, at.u64()?);
        if let Some(its_ns) = self.ns(its_ticks)
            && asked_ns <= now_ns
        {
            self.map.after(its_ns, asked_ns);
            self.map.before(its_ns, now_ns);
        }
        Some(Outcome::Nothing)
    }

    /// Ticks of the server's clock in ns.
    fn ns(&self, ticks: u64) -> Option<u64> {
        let ticks_per_s = u128::from(self.server?.ticks_per_s);
        u64::try_from(u128::from(ticks) * 1_000_000_000 / ticks_per_s).ok()
    }

    fn frame(&mut self, body: &[u8], now_ns: u64) -> Result<Outcome, Refused> {
        let version = self.server.ok_or(Refused::Unknown)?.version;
        let short = Refused::Short { what: "a frame", found: body.len(), version: Some(version) };
        let frame = Frame::from_bytes(body, version).ok_or(short)?;
        if !self.frames.is_new(frame.number) {
            return Err(Refused::Again(frame.number));
        }
        // Frames without stamps are those of a recording that is played.
        let stamp = |ticks: u64| self.ns(ticks).filter(|_| ticks > 0);
        let sent_ns = stamp(frame.sent_ticks).ok_or(Refused::Clock)?;
        let instant_ns = stamp(frame.exposed_ticks).unwrap_or(sent_ns);
        if !self.map.before(sent_ns, now_ns) {
            return Err(Refused::Clock);
        }
        let mapped = self.map.map(instant_ns).ok_or(Refused::Clock)?;
        let mapped = Mapped { ours_ns: mapped.ours_ns.min(now_ns), ..mapped };
        let body = self.body(&frame)?;
        if !body.is_tracked {
            return Err(Refused::Untracked);
        }
        let pose = upright(body, &self.plan)?;
        // How far its markers are from where they should be stands for the place.
        let variance_m2 = (body.error * self.plan.unit_m).powi(2);
        let covariance = [variance_m2, 0.0, 0.0, variance_m2, 0.0, 0.0];
        Ok(Outcome::Pose(Box::new(self.moving.heard(mapped, pose, covariance)), mapped))
    }

    fn body<'f>(&self, frame: &'f Frame) -> Result<&'f Body, Refused> {
        let (id, wanted) = match &self.plan.body {
            BodyChoice::Id(id) => (Some(*id), id.to_string()),
            BodyChoice::Name(name) => (self.names.get(name).copied(), format!("\"{name}\"")),
        };
        let found = id.and_then(|id| frame.bodies.iter().find(|body| body.id == id));
        found.ok_or_else(|| {
            let name = |id: u32| {
                self.names.iter().find(|(_, of)| **of == id).map(|(name, _)| format!(" \"{name}\""))
            };
            let all =
                frame.bodies.iter().map(|body| format!("{}{}", body.id, name(body.id).unwrap_or_default()));
            let all: Vec<String> = all.collect();
            Refused::NoBody { wanted, found: if all.is_empty() { "none".into() } else { all.join(", ") } }
        })
    }
}

/// x, y and heading of a body on the floor: with z up, a turn by a quarter about x from y up.
fn upright(body: &Body, plan: &NatNetPlan) -> Result<[f64; 3], Refused> {
    let value = |what, found, expected| Refused::Value { what, found, expected };
    let all = body.position.iter().chain(&body.rotation).chain([&body.error]);
    if let Some(found) = all.copied().find(|number| !number.is_finite()) {
        return Err(value("a number of the body", found, "a finite one"));
    }
    let turned = |[x, y, z]: [f64; 3]| match plan.up_axis {
        UpAxis::Y => [x, -z, y],
        UpAxis::Z => [x, y, z],
    };
    let [x, y, z, w] = body.rotation;
    let length = body.rotation.iter().map(|part| part * part).sum::<f64>().sqrt();
    if (length - 1.0).abs() > UNIT_WITHIN {
        return Err(value("the length of the quaternion", length, "1"));
    }
    let [x, y, z] = turned([x, y, z].map(|part| part / length));
    let w = w / length;
    let up = 1.0 - 2.0 * (x * x + y * y);
    if up < UPRIGHT {
        let tilt_deg = up.clamp(-1.0, 1.0).acos().to_degrees();
        return Err(value("the body's tilt in degrees", tilt_deg, "less than 60: is `up_axis` right?"));
    }
    let heading_rad = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    let [x_m, y_m, _] = turned(body.position).map(|part| part * plan.unit_m);
    for (what, found) in [("x", x_m), ("y", y_m)] {
        if found.abs() > FARTHEST_M {
            return Err(value(what, found, "less than 1e5 m"));
        }
    }
    Ok([x_m, y_m, heading_rad])
}

/// What a client says first: Motive looks at the word, its own library and other servers at the whole of 264 bytes, at whose
/// end two versions stand that it may speak.
fn hello() -> Vec<u8> {
    let mut hello = b"Ping".to_vec();
    hello.resize(256, 0);
    hello.extend([3, 0, 0, 0].repeat(2));
    hello
}

/// A message: its sort, its length, its bytes.
fn message(sort: u16, body: &[u8]) -> Vec<u8> {
    [&sort.to_le_bytes()[..], &(body.len() as u16).to_le_bytes(), body].concat()
}
