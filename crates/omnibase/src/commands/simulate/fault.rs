//! Faults of the command line, `<fault>@<position>:<seconds>[:<argument>]`, and of lines that are typed meanwhile.

use crate::value;
use omnibase_ethercat_sim::Fault;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// Reads a fault from its name and its argument.
type Read = fn(&Argument<'_>) -> Result<Fault, String>;

/// All faults by their names.
const FAULTS: [(&str, Read); 17] = [
    ("power-off", |argument| argument.none(Fault::PowerOff)),
    ("power-on", |argument| argument.none(Fault::PowerOn)),
    ("power-cycle", |Argument { text, .. }| {
        Ok(Fault::PowerCycle { off_for: text.map_or(Ok(Duration::from_secs(1)), duration)? })
    }),
    ("cable-cut", |argument| Ok(Fault::CableCut { port: argument.number(1, 3)? as u8 })),
    ("link-alone", |argument| Ok(Fault::LinkAlone { port: argument.number(1, 3)? as u8 })),
    ("cable-restored", |argument| Ok(Fault::CableRestored { port: argument.number(1, 3)? as u8 })),
    ("crc-errors", |argument| Ok(Fault::CrcErrors { port: 0, frames: argument.number(1, 1_000_000)? })),
    ("al-error", |argument| Ok(ApplicationFault::AlError(argument.code()?).into())),
    ("drive-fault", |argument| Ok(ApplicationFault::DriveFault(argument.code()?).into())),
    ("mailbox-silence", |argument| argument.none(ApplicationFault::MailboxSilence(true))),
    ("mailbox-back", |argument| argument.none(ApplicationFault::MailboxSilence(false))),
    ("freeze", |argument| argument.none(ApplicationFault::Frozen(true))),
    ("unfreeze", |argument| argument.none(ApplicationFault::Frozen(false))),
    ("sto", |argument| argument.none(ApplicationFault::SafeTorqueOff(true))),
    ("sto-over", |argument| argument.none(ApplicationFault::SafeTorqueOff(false))),
    ("brake", |argument| Ok(ApplicationFault::Brake(argument.number(1500, 0xFFFF)? as u16).into())),
    ("push", |argument| Ok(ApplicationFault::Push(argument.signed()?).into())),
];
/// The latest time of a fault, s: a day.
const LATEST_S: f64 = 86_400.0;

/// A fault and when it comes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimedFault {
    /// Which SubDevice.
    pub position: usize,
    /// After the start of the simulation.
    pub after: Duration,
    /// What.
    pub fault: Fault,
    /// As the user wrote it.
    text: String,
}

impl fmt::Display for TimedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// What `--fault` is given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FaultSource {
    /// A fault at its time.
    Timed(TimedFault),
    /// `-`: lines of standard input, whenever they come.
    Lines,
}

impl FromStr for FaultSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "-" => Ok(FaultSource::Lines),
            _ => text.parse().map(FaultSource::Timed),
        }
    }
}

impl FromStr for TimedFault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        TimedFault::read(text, None)
    }
}

impl TimedFault {
    /// Reads one; without a time it comes `at_once`, where that is allowed.
    fn read(text: &str, at_once: Option<Duration>) -> Result<Self, String> {
        let (name, place) = text.split_once('@').ok_or(match at_once {
            None => "expected <fault>@<position>:<seconds>, for example power-cycle@1:5",
            Some(_) => "expected <fault>@<position>, for example power-cycle@1",
        })?;
        let mut parts = place.split(':');
        let position = parts.next().and_then(|part| part.parse().ok()).ok_or("the position is no number")?;
        let after = match (parts.next(), at_once) {
            (Some(seconds), _) => duration(seconds)?,
            (None, Some(at_once)) => at_once,
            (None, None) => return Err("the time is missing: <fault>@<position>:<seconds>".to_owned()),
        };
        let argument = parts.next();
        if parts.next().is_some() {
            return Err("there is more behind the argument".to_owned());
        }
        Ok(TimedFault { position, after, fault: fault(name, argument)?, text: text.to_owned() })
    }

    /// A line that was typed so long after the start, of one of `count` SubDevices: `sto@1` comes at once, `sto@1:5` in 5 s.
    ///
    /// # Errors
    /// What is wrong with it, in a sentence.
    pub fn typed(line: &str, count: usize, since_start: Duration) -> Result<Self, String> {
        let mut fault = TimedFault::read(line.trim(), Some(Duration::ZERO))?;
        fault.expect_within(count)?;
        fault.after += since_start;
        Ok(fault)
    }

    /// # Errors
    /// The segment has fewer SubDevices, `count`.
    pub fn expect_within(&self, count: usize) -> Result<(), String> {
        match self.position < count {
            true => Ok(()),
            false => Err(format!("there is no SubDevice {}, the segment has {count}", self.position)),
        }
    }
}

/// What stands behind the time, and the fault's name for messages.
struct Argument<'a> {
    name: &'a str,
    text: Option<&'a str>,
}

impl Argument<'_> {
    fn none(&self, fault: impl Into<Fault>) -> Result<Fault, String> {
        match self.text {
            None => Ok(fault.into()),
            Some(text) => Err(format!("{} takes no argument, found `{text}`", self.name)),
        }
    }

    fn number(&self, default: u32, limit: u32) -> Result<u32, String> {
        let Some(text) = self.text else { return Ok(default) };
        let number = value::number(text).filter(|number| *number <= limit);
        number.ok_or_else(|| format!("argument `{text}`: expected a number up to {limit}"))
    }

    fn code(&self) -> Result<u16, String> {
        let name = self.name;
        match self.text {
            None => Err(format!("{name} needs a code behind the time, for example {name}@0:5:0x1b")),
            Some(_) => self.number(0, 0xFFFF).map(|code| code as u16),
        }
    }

    /// A torque, per mille of the rated one.
    fn signed(&self) -> Result<i16, String> {
        let text = self.text.unwrap_or("0");
        text.parse().map_err(|_| format!("argument `{text}`: expected a number from -32768 to 32767"))
    }
}

fn fault(name: &str, text: Option<&str>) -> Result<Fault, String> {
    let found = FAULTS.iter().find(|(known, _)| *known == name);
    let (_, read) = found.ok_or_else(|| {
        let names: Vec<&str> = FAULTS.iter().map(|(known, _)| *known).collect();
        format!("`{name}` is no fault; there are {}", names.join(", "))
    })?;
    read(&Argument { name, text })
}

fn duration(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=LATEST_S).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err(format!("`{text}` is no time: expected seconds from 0 to {LATEST_S}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> (usize, u64, Fault) {
        let fault: TimedFault = text.parse().unwrap();
        (fault.position, fault.after.as_millis() as u64, fault.fault)
    }

    #[test]
    fn faults_have_a_place_a_time_and_an_argument() {
        let off_for = Duration::from_millis(500);
        assert_eq!(parsed("power-cycle@1:5:0.5"), (1, 5000, Fault::PowerCycle { off_for }));
        assert_eq!(parsed("cable-cut@0:0.25"), (0, 250, Fault::CableCut { port: 1 }));
        assert_eq!(parsed("link-alone@2:1:0"), (2, 1000, Fault::LinkAlone { port: 0 }));
        assert_eq!(parsed("push@0:2:-300"), (0, 2000, ApplicationFault::Push(-300).into()));
        assert_eq!(parsed("brake@0:0:50"), (0, 0, ApplicationFault::Brake(50).into()));
        let error = ApplicationFault::AlError(0x1B);
        assert_eq!(parsed("al-error@2:1:0x1b"), (2, 1000, Fault::Application(error)));
    }

    #[test]
    fn a_line_that_is_typed_needs_no_time() {
        let typed = |line: &str| TimedFault::typed(line, 2, Duration::from_secs(7));
        let at_once = typed(" sto@1\r").unwrap();
        assert_eq!((at_once.position, at_once.after), (1, Duration::from_secs(7)));
        assert_eq!(typed("push@0:2:300").unwrap().after, Duration::from_secs(9));
        assert_eq!(typed("sto").unwrap_err(), "expected <fault>@<position>, for example power-cycle@1");
        assert_eq!(typed("sto@2").unwrap_err(), "there is no SubDevice 2, the segment has 2");
        assert_eq!("-".parse(), Ok(FaultSource::Lines));
        assert_eq!("sto@1:12".parse::<TimedFault>().unwrap().after, typed("sto@1:5").unwrap().after);
        assert!("sto@1".parse::<FaultSource>().unwrap_err().contains("the time is missing"));
    }

    #[test]
    fn what_is_no_fault_is_refused_in_words() {
        let cases = [
            ("power-cycle", "expected <fault>@<position>:<seconds>"),
            ("power-cycle@x:1", "the position is no number"),
            ("power-cycle@1", "the time is missing"),
            ("power-cycle@1:-1", "`-1` is no time"),
            ("power-cycle@1:NaN", "is no time"),
            ("fire@1:1", "`fire` is no fault; there are power-off"),
            ("al-error@1:1", "al-error needs a code"),
            ("freeze@1:1:7", "freeze takes no argument"),
            ("cable-cut@1:1:4", "expected a number up to 3"),
            ("cable-cut@1:1:2:3", "more behind the argument"),
        ];
        for (text, expected) in cases {
            let error = text.parse::<TimedFault>().unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
