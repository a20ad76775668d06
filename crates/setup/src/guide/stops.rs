//! The emergency stop, pressed while each drive is enabled.

use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::{Clock, register};
use omnibase_ethercat::{Bus, BusOptions};

use super::jogging::Motion;
use super::{Guide, Leave, SetupError};
use crate::jog::JogEnd;

/// How long a drive is enabled while somebody goes to press it, s.
const PRESSED_WITHIN_S: f64 = 30.0;

/// What came of one try.
enum Tried {
    /// It took the torque, by this.
    Stopped(String),
    /// It isn't known to: what was seen.
    Failed(String),
    /// Nobody held the key.
    Untried(String),
    /// The set-up is left.
    Left,
}

impl<C: Clock> Guide<'_, C> {
    /// The emergency stop while each drive is enabled; `false` where it is left.
    pub(super) fn stop_all(&mut self) -> Result<bool, SetupError> {
        for number in 0..self.record.drives.len() {
            let Some(wheel) = self.record.drives[number].wheel.clone() else { continue };
            loop {
                let tried = self.stop(number, &wheel)?;
                match &tried {
                    Tried::Left => return Ok(false),
                    Tried::Stopped(words) => {
                        self.record.note(format!("{wheel}: the emergency stop took its torque: {words}"));
                        self.record.drives[number].is_stopped = Some(true);
                        break;
                    }
                    Tried::Failed(words) => self.tell_found(format!("{wheel}: {words}")),
                    Tried::Untried(_) => {}
                }
                let text = format!(
                    "{wheel} wasn't seen to be stopped by the emergency stop: again, or go on without? Don't drive such a robot."
                );
                let choices = ["again", "go on"].map(str::to_owned);
                match self.choose(format!("stop {number}"), text, &choices) {
                    Ok(choice) if choice == "go on" => {
                        self.record.drives[number].is_stopped = Some(false);
                        if let Tried::Untried(words) = tried {
                            self.record.found(format!("{wheel}: the emergency stop wasn't tried: {words}"));
                        }
                        break;
                    }
                    Ok(_) => {}
                    Err(Leave) => return Ok(false),
                }
            }
        }
        Ok(true)
    }

    /// One wheel's drive enabled, the stop pressed and released.
    fn stop(&mut self, number: usize, wheel: &str) -> Result<Tried, SetupError> {
        let what = format!("hold the key and press the emergency stop: {wheel} must go free by itself");
        let jog = self.jog(number, Motion::Stands(PRESSED_WITHIN_S), &what)?;
        let question = match &jog.end {
            JogEnd::Gone => return Ok(Tried::Left),
            JogEnd::Lost if jog.enabled_cycles > 0 => {
                Some(format!("frames were lost: did you press the emergency stop, and is {wheel} free?"))
            }
            // A drive that stops by a fault of its own looks the same from here.
            JogEnd::Drive(words) if jog.enabled_cycles > 0 => {
                Some(format!("{wheel} lost its torque ({words}): did you press the emergency stop?"))
            }
            _ => None,
        };
        let mut is_pressed = None;
        if let Some(text) = question {
            let choices = ["yes", "no"].map(str::to_owned);
            match self.choose(format!("stopped {number}"), text, &choices) {
                Ok(choice) => is_pressed = Some(choice == "yes"),
                Err(Leave) => return Ok(Tried::Left),
            }
        }
        let text = "release the emergency stop, reset what your safety circuit asks for, and wait until the drives are up"
            .to_owned();
        if self.choose(format!("release {number}"), text, &["done".to_owned()]).is_err() {
            return Ok(Tried::Left);
        }
        let end = jog.end.to_string();
        let position = self.record.drives[number].position;
        Ok(match (jog.end, is_pressed) {
            (JogEnd::Lost, Some(true)) if self.has_lost_supply(position)? => {
                Tried::Stopped("its drive lost its supply".to_owned())
            }
            (JogEnd::Lost, Some(true)) => Tried::Failed(format!(
                "the emergency stop isn't tested: {end}, but its drive isn't known to have lost its supply: look at the cables, and at whose \
                 supply the stop takes"
            )),
            (_, Some(true)) => Tried::Stopped(end),
            (_, Some(false)) => {
                Tried::Failed(format!("it lost its torque without the emergency stop: {end}"))
            }
            (JogEnd::Longest, None) => {
                Tried::Failed("the emergency stop didn't take its torque while it was enabled".to_owned())
            }
            (untried, None) if untried.is_untried() => Tried::Untried(end),
            (_, None) => Tried::Failed(format!("the emergency stop wasn't tried: {end}")),
        })
    }

    /// Whether a drive's chip forgot the address that the last scan gave it: its supply was gone. Who was merely cut off has it still,
    /// and lost its torque by the end of the jog or by its watchdog.
    fn has_lost_supply(&mut self, position: u16) -> Result<bool, SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut bus = Bus::new(link, clock, BusOptions::default());
        let address = Access::read_at("the station address", position, register::STATION_ADDRESS, 2);
        Ok(bus.transactor().perform_one(address).is_ok_and(|read| read.data == [0, 0]))
    }
}
