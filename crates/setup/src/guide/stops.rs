//! The emergency stop, pressed while each drive is enabled.

use std::collections::BTreeSet;

use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::{Clock, register};
use omnibase_ethercat::{Bus, BusOptions};

use super::at_start::MAX_TORQUE;
use super::jogging::Motion;
use super::reading::held;
use super::{ATTEMPTS, Guide, Leave, SetupError, has_its_numbers, seen};
use crate::jog::JogEnd;
use crate::record::{FoundDrive, Record, Step};

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
        let Some(lost) = self.are_up(format!("release {number}"), text)? else { return Ok(Tried::Left) };
        let end = jog.end.to_string();
        let position = self.record.drives[number].position;
        Ok(match (jog.end, is_pressed) {
            (JogEnd::Lost, Some(true)) if lost.contains(&position) => {
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

    /// Somebody says that the drives are up: which of them lost their supply meanwhile; these hold what is stored in them. Asked again
    /// until as many SubDevices answer as drives need, and those can be asked; `None` where it is left.
    pub(super) fn are_up(&mut self, id: String, text: String) -> Result<Option<Vec<u16>>, SetupError> {
        let needed = self.record.drives.iter().map(|drive| drive.position + 1).max().unwrap_or(0);
        // By this look alone: what was lost before is no emergency stop of now.
        let mut lost = BTreeSet::new();
        for _ in 0..ATTEMPTS {
            if self.choose(id.clone(), text.clone(), &["done".to_owned()]).is_err() {
                return Ok(None);
            }
            let problem = match self.note_who_lost_supply(needed)? {
                Ok(now) => {
                    lost.extend(now);
                    match self.see_as_stored() {
                        Ok(()) => return Ok(Some(lost.into_iter().collect())),
                        Err(error) => error.to_string(),
                    }
                }
                Err(there) => format!("{there} SubDevices answer, and at least {needed} are needed"),
            };
            self.hand.tell(&format!("{problem}: wait until all drives are up, and say it again"));
        }
        Ok(None)
    }

    /// Drives whose chip forgot the address that the last scan gave it: their supply was gone. Who was merely cut off has it still,
    /// and lost its torque by the end of the jog or by its watchdog. An error is how many SubDevices answer, where that are too few.
    pub(super) fn note_who_lost_supply(&mut self, needed: u16) -> Result<Result<Vec<u16>, u16>, SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut bus = Bus::new(link, clock, BusOptions::default());
        let there = bus.count().unwrap_or(0);
        if there < needed {
            return Ok(Err(there));
        }
        let has_lost = |position: &u16| {
            let address = Access::read_at("the station address", *position, register::STATION_ADDRESS, 2);
            bus.transactor().perform_one(address).is_ok_and(|read| read.data == [0, 0])
        };
        let Record { drives, jogged, lost_supply, .. } = &mut self.record;
        let positions: BTreeSet<u16> = drives.iter().chain(&*jogged).map(|drive| drive.position).collect();
        // Whoever is scanned has an address again: it is known until those were looked at.
        let now: Vec<u16> = positions.into_iter().filter(has_lost).collect();
        lost_supply.extend(&now);
        lost_supply.sort_unstable();
        lost_supply.dedup();
        if !now.is_empty() {
            self.kept();
        }
        Ok(Ok(now))
    }

    /// Drives that lost their supply hold what is stored in them: nothing of what they held before a jog.
    pub(super) fn see_as_stored(&mut self) -> Result<(), SetupError> {
        let Record { jogged, lost_supply, .. } = &self.record;
        let is_lost = |one: &&FoundDrive| lost_supply.contains(&one.position);
        let jogged: Vec<FoundDrive> = jogged.iter().filter(is_lost).cloned().collect();
        if jogged.is_empty() {
            self.record.lost_supply.clear();
            return Ok(());
        }
        let mut bus = self.bus()?;
        let limit = self.wished.torque_per_mille.to_le_bytes();
        for one in jogged {
            let now = bus.subdevices().get(usize::from(one.position)).map(seen);
            if !now.is_some_and(|now| has_its_numbers(&one, &now)) {
                continue;
            }
            let stored = held(&mut bus, &self.plan, &one);
            // One that stores by itself may hold the jog's limit: what is known of it stays.
            let is_no_jogs =
                |(index, _, bytes): &(u16, u8, Vec<u8>)| *index == MAX_TORQUE && bytes[..] != limit;
            if stored.iter().any(is_no_jogs) {
                let is_it =
                    |other: &FoundDrive| other.position == one.position && has_its_numbers(other, &one);
                let Record { drives, jogged, .. } = &mut self.record;
                drives.iter_mut().filter(|drive| is_it(drive)).for_each(|drive| drive.was = stored.clone());
                jogged.retain(|other| !is_it(other));
            }
        }
        self.record.lost_supply.clear();
        self.is_nothing_left();
        self.kept();
        Ok(())
    }
}
