//! A program that commands a running robot.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::Message;

use crate::Error;
use crate::clock::RobotClock;
use crate::connection::Connection;
use crate::robots::Found;

/// In which frame a twist is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// The platform's: x ahead, y to the left.
    #[default]
    Body,
    /// The fixed one.
    Odom,
}

/// What came of something that was asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The number that [`Seat::ask`] gave; 0 for what couldn't be read.
    pub number: u64,
    /// Whether it was done.
    pub done: bool,
    /// In words.
    pub text: String,
    /// For programs, where there is more than words.
    pub data: Value,
}

/// What the robot says.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// What came of something.
    Answer(Answer),
    /// What it does now: `StatusMessage` of its description, thirty times a second.
    Status(Value),
}

/// A seat at a robot: a session among those of its pages, with a stick of its own.
///
/// A twist counts from the instant at which it was meant, or the last news of the robot before it (30 times a second), for
/// `safety.command_age_ms`. Where none follows it, or the program says nothing at all for a second, the stick is lost: the
/// robot stops, and somebody has to enable it again ([`Seat::enable_stick`]), but after [`Seat::recover`].
///
/// A program that has nothing more to say for now lets go, and may drive again by itself.
/// Whatever else stops the robot while it follows the stick ends the seat's drive too, until the stick is
/// enabled.
pub struct Seat {
    connection: Connection,
    clock: RobotClock,
    /// The last stamp that came, ms.
    stamp_ms: u64,
    name: String,
    stick_bit: Option<u64>,
    is_blocked: bool,
    recovers: bool,
    hand: Hand,
    let_go: LetGo,
    /// Why the robot stopped while this program drove it.
    stopped: Option<String>,
    number: u64,
}

/// Whether the robot has heard of the last let-go. What it said before that tells nothing of who drives since.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LetGo {
    /// Its answer has this number, and is waited for.
    Asked(u64),
    /// It had, when its clock stood there, ms.
    Heard(u64),
}

/// What the stick does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hand {
    /// It is let go.
    Off,
    /// It is held, and the robot doesn't follow it yet.
    On,
    /// The robot follows it.
    Drives,
}

impl Seat {
    /// Takes a seat, with the stick let go.
    pub fn take(robot: &Found) -> Result<Seat, Error> {
        let (connection, first) = Connection::open(robot, "live")?;
        let clock = RobotClock::unknown(Instant::now());
        let mut seat = Seat {
            connection,
            clock,
            stamp_ms: 0,
            name: String::new(),
            stick_bit: None,
            is_blocked: false,
            recovers: false,
            hand: Hand::Off,
            let_go: LetGo::Heard(0),
            stopped: None,
            number: 0,
        };
        let welcome = read(&first)?;
        seat.told(&welcome);
        match (welcome["may"].as_str(), welcome["you"].as_str()) {
            (Some("command"), Some(name)) => name.clone_into(&mut seat.name),
            (Some("look"), _) => return Err(Error::Refused("without the token one may only look".into())),
            _ => return Err(Error::Refused("all its seats are taken".into())),
        }
        seat.stick_bit = welcome["stick_bit"].as_u64();
        seat.let_go()?;
        Ok(seat)
    }

    /// How the robot calls this program where it says who commands.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether this program's stick was lost, and has to be enabled.
    pub fn is_blocked(&self) -> bool {
        self.is_blocked
    }

    /// From now on this seat drives again by itself after a silence, once twists come again: for a program that hands on what
    /// others say. Whatever else stops the robot, whether this seat drives or not, ends its drive until its stick is enabled.
    pub fn recover(&mut self) -> Result<(), Error> {
        self.recovers = true;
        self.say(json!({ "do": "recover_stick" }), None)?;
        self.let_go()
    }

    /// Holds a twist: vx m/s, vy m/s, turn rad/s, as it was meant at an instant; [`Error::Stopped`] once something else than
    /// letting go stopped the robot under it.
    pub fn drive(&mut self, twist: [f64; 3], frame: Frame, meant: Instant) -> Result<(), Error> {
        if let Some(why) = &self.stopped {
            return Err(Error::Stopped(why.clone()));
        }
        if self.hand == Hand::Off {
            self.hand = Hand::On;
        }
        let frame = match frame {
            Frame::Body => "body",
            Frame::Odom => "odom",
        };
        self.say(json!({ "do": "drive", "twist": twist, "frame": frame }), Some(meant)).map(drop)
    }

    /// Whether the robot follows this program's stick, as it said last.
    pub fn drives(&self) -> bool {
        self.hand == Hand::Drives
    }

    /// Lets go: the robot comes to rest, and holds.
    pub fn let_go(&mut self) -> Result<(), Error> {
        self.hand = Hand::Off;
        let number = self.say(json!({ "do": "release_stick" }), Some(Instant::now()))?;
        self.let_go = LetGo::Asked(number);
        Ok(())
    }

    /// Says that the program lives; whoever drives says so by that.
    pub fn live(&mut self) -> Result<(), Error> {
        self.say(json!({ "do": "alive" }), None).map(drop)
    }

    /// The stick that was lost may drive again, once it was let go. A person decides that, after looking at the robot.
    pub fn enable_stick(&mut self) -> Result<u64, Error> {
        self.stopped = None;
        let number = self.say(json!({ "do": "enable_stick" }), Some(Instant::now()))?;
        self.let_go()?;
        Ok(number)
    }

    /// Asks for something, as it was meant at an instant: a `Call` of the robot's description, such as
    /// `{"do": "go_to", "pose": [1.0, 0.0, 0.0]}`; the number of its answer.
    pub fn ask(&mut self, call: Value, meant: Instant) -> Result<u64, Error> {
        self.say(call, Some(meant))
    }

    /// The next that the robot says, where that comes in that time.
    pub fn hear(&mut self, longest: Duration) -> Result<Option<Heard>, Error> {
        let Some(message) = self.connection.hear(longest)? else { return Ok(None) };
        let said = read(&message)?;
        if let Some(number) = said["answer"].as_u64() {
            if self.let_go == LetGo::Asked(number) {
                self.let_go = LetGo::Heard(said["stamp"].as_u64().unwrap_or(self.stamp_ms));
            }
            let (done, text) = (said["done"] == true, said["text"].as_str().unwrap_or_default().to_owned());
            return Ok(Some(Heard::Answer(Answer { number, done, text, data: said["data"].clone() })));
        }
        self.told(&said);
        Ok(Some(Heard::Status(said)))
    }

    /// What came of what was asked by this number, heard in that time; [`Error::Silent`] where it didn't come.
    pub fn answer(&mut self, number: u64, longest: Duration) -> Result<Answer, Error> {
        let until = Instant::now() + longest;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            match self.hear(left)? {
                Some(Heard::Answer(answer)) if answer.number == number => return Ok(answer),
                Some(_) => self.live()?,
                None if left.is_zero() => return Err(Error::Silent),
                None => {}
            }
        }
    }

    fn say(&mut self, mut call: Value, meant: Option<Instant>) -> Result<u64, Error> {
        self.number += 1;
        call["number"] = self.number.into();
        // Never younger than it is, nor than the last that the robot said: its clock stands between two cycles. What was meant
        // before that clock began has no stamp.
        let meant_ms = meant.map(|meant| self.clock.at_ms(meant)).filter(|ms| *ms >= 0.0);
        if let Some(meant_ms) = meant_ms {
            call["stamp"] = (meant_ms as u64).min(self.stamp_ms).into();
        }
        self.connection.say(call.to_string())?;
        Ok(self.number)
    }

    fn told(&mut self, said: &Value) {
        if let Some(stamp_ms) = said["stamp"].as_u64() {
            self.clock.told(stamp_ms as f64, Instant::now());
            self.stamp_ms = stamp_ms;
        }
        if let (Some(bit), Some(blocked)) = (self.stick_bit, said["blocked_sticks"].as_u64()) {
            self.is_blocked = blocked >> bit & 1 == 1;
        }
        let Some(commander) = said["commander"].as_str() else { return };
        let drives = said["by_stick"] == true && commander == self.name;
        let is_news = matches!(self.let_go, LetGo::Heard(at_ms) if self.stamp_ms > at_ms);
        let is_lost = match (self.hand, drives) {
            _ if !is_news => false,
            (Hand::On, true) => {
                self.hand = Hand::Drives;
                false
            }
            (before, _) => before == Hand::Drives && !drives,
        };
        if is_lost {
            self.hand = Hand::Off;
        }
        // The robot itself knows which stops a seat may not end that recovers.
        self.stopped = match (self.recovers, self.is_blocked, is_lost) {
            (true, true, _) | (false, _, true) => self.stopped.take().or_else(|| Some(why_stopped(said))),
            (true, false, _) => None,
            (false, _, false) => self.stopped.take(),
        };
    }
}

fn why_stopped(said: &Value) -> String {
    let words = |key: &str| said[key].as_str().filter(|text| !text.is_empty());
    words("stop_reason").unwrap_or("somebody stopped it").to_owned()
}

fn read(message: &Message) -> Result<Value, Error> {
    let text = message.to_text().map_err(|error| Error::Words(error.to_string()))?;
    serde_json::from_str(text).map_err(|error| Error::Words(error.to_string()))
}
