//! Why a jog ended, and what its encoder showed, in words.

use std::fmt;

use omnibase_ethercat::cyclic::{CyclicBus, Exchange, Health};
use omnibase_ethercat::wire::Link;
use omnibase_session::supervision::HealthWords;

/// Why a jog ended.
#[derive(Clone, Debug, PartialEq)]
pub enum JogEnd {
    /// The key was let go.
    LetGo,
    /// The key was held as long as a motion may last.
    Longest,
    /// Whoever held the key is gone.
    Gone,
    /// The key was never held.
    NeverHeld,
    /// It turns otherwise than it is told: the other way, as where the encoder counts against the motor and the drive drives it ever
    /// faster; or much faster.
    Runaway {
        /// Counts per cycle that were told.
        told: f64,
        /// Counts per cycle that were seen.
        seen: f64,
    },
    /// The drive didn't do as it was told, in its own words.
    Drive(String),
    /// Frames were lost, or somebody didn't answer any more: who that is, as far as it is known, and what to do.
    Lost(String),
}

impl JogEnd {
    /// Nobody held the key for long enough to try anything.
    pub(crate) fn is_untried(&self) -> bool {
        matches!(self, JogEnd::LetGo | JogEnd::NeverHeld)
    }
}

impl fmt::Display for JogEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            JogEnd::LetGo => f.write_str("the key was let go"),
            JogEnd::Longest => f.write_str("it took as long as a motion may"),
            JogEnd::Gone => f.write_str("whoever held the key was gone"),
            JogEnd::NeverHeld => f.write_str("the key was never held"),
            JogEnd::Runaway { told, seen } => {
                write!(
                    f,
                    "told {told:.1} counts a cycle, its encoder counted {seen:.1}: {}",
                    astray(*told, *seen)
                )
            }
            JogEnd::Drive(words) => f.write_str(words),
            JogEnd::Lost(words) => f.write_str(words),
        }
    }
}

/// A position that stayed the same to the count, though it was told to change, until the jog's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Still {
    /// For so long, s.
    pub seconds: f64,
    /// The position, counts.
    pub position: i32,
    /// Something else of what the drive says changed meanwhile.
    pub others_changed: bool,
}

impl fmt::Display for Still {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Still { seconds, position, others_changed } = self;
        write!(
            f,
            "its position (0x6064) stayed at {position} to the count for {seconds:.1} s though it was told to turn, "
        )?;
        f.write_str(match others_changed {
            true => {
                "and other values of it changed: the wheel doesn't turn (brake closed, held, jammed, too little torque), or the position \
                 is frozen: look at its brake, and at its encoder's plug"
            }
            false => {
                "as did all else that it says: the wheel doesn't turn (brake closed, held, jammed), or its firmware hangs: look at its brake, \
                 and switch it off and on"
            }
        })
    }
}

/// What kept frames from coming back whole, in words.
pub(super) fn away<L: Link>(bus: &CyclicBus<L>, last: Exchange) -> String {
    let all = (0u16..).zip(bus.health().iter().copied());
    let certain: Vec<(u16, Health)> = all.filter(|(position, _)| bus.is_certain(*position)).collect();
    // Who is dark cuts off those behind it, and whoever waits for frames leaves OP.
    let silent = certain.iter().find(|(_, health)| *health == Health::Silent);
    let Some((first, health)) = silent.or(certain.first()).copied() else {
        return match last {
            Exchange::Lost { .. } => {
                "no frame comes back: look at the supply of SubDevice 0 and at the cable to it"
            }
            _ => "frames were lost, and all answer by now: look at the cables",
        }
        .to_owned();
    };
    let others: Vec<String> =
        certain.iter().map(|(one, _)| one.to_string()).filter(|one| *one != first.to_string()).collect();
    let others = match &others[..] {
        [] => String::new(),
        others => format!("; SubDevice {} likewise, or cut off by that", others.join(", ")),
    };
    let what = HealthWords(health);
    let look = match health {
        Health::Silent => "look at its supply and at the cable to it, and go on once it is up",
        _ => "look at what it shows, and at the cables: without frames each leaves OP",
    };
    format!("SubDevice {first} was lost: {what}{others}: {look}")
}

/// What counts that weren't told mean, in words.
pub(crate) fn astray(told: f64, seen: f64) -> &'static str {
    match told * seen {
        along if along > 0.0 => {
            "it has more counts per turn, or another unit of speeds, than the file says, or more is told to it, or somebody pushed it on, or it still rolled"
        }
        against if against < 0.0 => "it counts the wrong way, or somebody pushed it back",
        _ => "it moves though it shall stand, or somebody pushed it",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_that_turns_too_fast_is_not_said_to_count_the_wrong_way() {
        let words = |told, seen| JogEnd::Runaway { told, seen }.to_string();
        assert!(words(5.3, 19.1).contains("more counts per turn, or another unit of speeds"));
        assert!(words(5.3, -6.7).ends_with("it counts the wrong way, or somebody pushed it back"));
        assert!(words(0.0, 31.0).ends_with("it moves though it shall stand, or somebody pushed it"));
    }
}
