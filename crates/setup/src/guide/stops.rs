//! The emergency stop, pressed while each drive is enabled.

use std::collections::BTreeSet;

use omnibase_ethercat::wire::Clock;

use super::jogging::Motion;
use super::{ATTEMPTS, Guide, Leave, SetupError};
use crate::jog::JogEnd;
use crate::record::Step;

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
            if !self.record.is_due(Step::SafeTorqueOff, &wheel) {
                continue;
            }
            loop {
                let tried = self.stop(number, &wheel)?;
                match &tried {
                    Tried::Left => return Ok(false),
                    Tried::Stopped(words) => {
                        self.record.note(format!("{wheel}: the emergency stop took its torque: {words}"));
                        self.record.drives[number].is_stopped = Some(true);
                        self.record.make_good(Step::SafeTorqueOff, Some(&wheel));
                        break;
                    }
                    Tried::Failed(words) => {
                        self.tell_failed(Step::SafeTorqueOff, &wheel, format!("{wheel}: {words}"));
                    }
                    Tried::Untried(_) => {}
                }
                let text = format!(
                    "{wheel} wasn't seen to be stopped by the emergency stop: again, or go on without? Don't drive such a robot."
                );
                let choices = ["again", "go on"].map(str::to_owned);
                match self.choose(format!("stop {number}"), text, &choices) {
                    Ok(choice) if choice == "go on" => {
                        self.record.drives[number].is_stopped = Some(false);
                        let why = match tried {
                            Tried::Untried(words) => format!("the emergency stop wasn't tried: {words}"),
                            _ => "gone on without an emergency stop that was seen to take its torque"
                                .to_owned(),
                        };
                        self.record.pass_over(Step::SafeTorqueOff, Some(&wheel), format!("{wheel}: {why}"));
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
            JogEnd::Lost(words) if jog.enabled_cycles > 0 => {
                Some(format!("{words}. Did you press the emergency stop, and is {wheel} free?"))
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
        let text = match jog.end.is_untried() {
            true => {
                "the key was let go first: if the emergency stop is pressed, release it, and wait until the drives are up"
            }
            false => {
                "release the emergency stop, reset what your safety circuit asks for, and wait until the drives are up"
            }
        };
        let Some(lost) = self.are_up(format!("release {number}"), text.to_owned())? else {
            return Ok(Tried::Left);
        };
        let end = jog.end.to_string();
        let position = self.record.drives[number].position;
        Ok(match (jog.end, is_pressed) {
            (JogEnd::Lost(_), Some(true)) if lost.contains(&position) => {
                Tried::Stopped("its drive lost its supply".to_owned())
            }
            (JogEnd::Lost(_), Some(true)) => Tried::Failed(format!(
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

    /// Somebody says that the drives are up: which of them lost their supply meanwhile. Asked again until as many SubDevices answer as
    /// drives need, and those can be asked; `None` where it is left.
    pub(super) fn are_up(&mut self, id: String, text: String) -> Result<Option<Vec<u16>>, SetupError> {
        let needed = self.record.drives.iter().map(|drive| drive.position + 1).max().unwrap_or(0);
        // By this look alone: what was lost before is no emergency stop of now.
        let mut lost = BTreeSet::new();
        for _ in 0..ATTEMPTS {
            if self.choose(id.clone(), text.clone(), &["done".to_owned()]).is_err() {
                return Ok(None);
            }
            let (there, now) = self.who_lost_supply()?;
            let problem = if there < needed {
                format!("{there} SubDevices answer, and at least {needed} are needed")
            } else {
                lost.extend(now);
                match self.bus() {
                    Ok(mut bus) => {
                        self.lose_sight();
                        self.forget_lost(&bus, &lost);
                        self.put_back(&mut bus);
                        return Ok(Some(lost.into_iter().collect()));
                    }
                    Err(error) => error.to_string(),
                }
            };
            self.hand.tell(&format!("{problem}: wait until all drives are up, and say it again"));
        }
        Ok(None)
    }
}
