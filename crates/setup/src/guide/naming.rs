//! What each drive is found by wherever it is plugged in: an alias in its EEPROM, or its identification switch.

use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::Clock;
use omnibase_robot::Registry;
use omnibase_robot::config::BusPlace;
use omnibase_session::session::finds_all;

use super::{ATTEMPTS, AnyBus, Guide, Leave, SetupError};
use crate::robot_file::{self, RobotFileError};

/// What of findings is of how a wheel's drive is found.
pub(super) fn name_of(wheel: &str) -> String {
    format!("name of {wheel}")
}

impl<C: Clock> Guide<'_, C> {
    /// The same, and each drive is where it was found.
    pub(super) fn scanned_as_found(&mut self) -> Result<AnyBus<C>, SetupError> {
        let bus = self.scanned()?;
        self.are_those_found(&bus)?;
        Ok(bus)
    }

    /// A name for each wheel's drive by which a start of the robot finds it; `false` where it is left.
    pub(super) fn name_all(&mut self) -> Result<bool, SetupError> {
        for _ in 0..ATTEMPTS {
            if !self.name_each()? {
                return Ok(false);
            }
            if self.finds_all()? {
                return Ok(true);
            }
            // Who has a name of his own isn't asked again.
            if !self.record.drives.iter().any(|drive| drive.wheel.is_some() && drive.is_by_position) {
                break;
            }
        }
        Ok(false)
    }

    /// Whether the robot's file as it will be finds everybody where he is.
    pub(super) fn finds_all(&mut self) -> Result<bool, SetupError> {
        let bus = self.scanned_as_found()?;
        let plan = self.text().and_then(|text| Ok(robot_file::plan(&text, &Registry::with_built_in())?));
        let found = match plan {
            Ok(plan) => finds_all(&bus, &plan).map_err(|error| error.to_string()),
            Err(SetupError::File(RobotFileError::Problems(problems))) => Err(problems.join("; ")),
            Err(error) => return Err(error),
        };
        if let Err(words) = &found {
            self.hand.tell(&format!("a robot's file by that wouldn't start: {words}"));
        }
        Ok(found.is_ok())
    }

    /// What is written counts once the drives were switched off and on.
    fn name_each(&mut self) -> Result<bool, SetupError> {
        let mut bus = self.scanned_as_found()?;
        let mut written: Vec<(usize, u16)> = Vec::new();
        for number in 0..self.record.drives.len() {
            let drive = self.record.drives[number].clone();
            let Some(wheel) = drive.wheel.clone() else { continue };
            self.record.found_of(&name_of(&wheel), Vec::new());
            let has = bus.subdevices().get(usize::from(drive.position));
            let (alias, shown) = has.map_or((None, None), |one| (one.alias, one.identification));
            let others = |is_its: &dyn Fn(&SubDevice) -> bool| {
                let others = bus.subdevices().iter().filter(|one| one.position != drive.position);
                others.filter(|one| is_its(one)).map(|one| one.position).next()
            };
            if let Some(alias) = alias {
                let Some(other) = others(&|one| one.claims_alias(alias)) else {
                    self.hand.tell(&format!("{wheel}: its drive has alias {alias}"));
                    let named = &mut self.record.drives[number];
                    (named.alias, named.is_by_position) = (Some(alias), false);
                    continue;
                };
                let text = format!("{wheel}: its drive has alias {alias}, as SubDevice {other} has");
                self.tell_found_of(&name_of(&wheel), vec![text]);
            }
            // Until something else is chosen; what was chosen in a set-up that was left is asked again.
            let named = &mut self.record.drives[number];
            (named.identification, named.is_by_position) = (None, true);
            // What a set-up that was left has written counts from the next power-on.
            let waiting = drive.written_alias.filter(|alias| has.is_some_and(|one| one.claims_alias(*alias)));
            let mut choices = vec!["alias".to_owned()];
            let mut text = format!("{wheel}: write an alias into its drive's EEPROM");
            if let Some(waiting) = waiting {
                choices.insert(0, "keep".to_owned());
                text = format!(
                    "{wheel}: its drive's EEPROM has alias {waiting}, which counts once it was switched off and on: keep it, write another one"
                );
            }
            if let Some(shown) = shown {
                choices.push("switch".to_owned());
                text += &format!(", find it by its switch (it shows {shown})");
            }
            choices.push("position".to_owned());
            text += ", or find it by its position?";
            match self.choose(format!("name {}", drive.position), text, &choices) {
                Err(Leave) => return Ok(false),
                Ok(choice) if choice == "alias" => {}
                Ok(choice) if choice == "keep" => {
                    self.record.drives[number].is_by_position = false;
                    written.extend(waiting.map(|alias| (number, alias)));
                    continue;
                }
                Ok(choice) if choice == "switch" => {
                    if let Some(other) = others(&|one| one.identification == shown) {
                        let text = format!(
                            "{wheel}: the switch of SubDevice {other} shows the same number: found by its position"
                        );
                        self.tell_found_of(&name_of(&wheel), vec![text]);
                        continue;
                    }
                    self.record.drives[number].identification = shown;
                    continue;
                }
                Ok(_) => continue,
            }
            let Ok(alias) = self.free_alias(&bus, number, &written) else { return Ok(false) };
            if self.write_alias(&mut bus, number, alias)? {
                self.record.drives[number].is_by_position = false;
                written.push((number, alias));
            }
        }
        drop(bus);
        if written.is_empty() {
            return Ok(true);
        }
        let positions: Vec<u16> =
            written.iter().map(|(number, _)| self.record.drives[*number].position).collect();
        if !self.are_switched_off_and_on(&positions)? {
            return Ok(false);
        }
        let bus = self.scanned_as_found()?;
        for (number, alias) in written {
            let drive = &mut self.record.drives[number];
            let shown = bus.subdevices()[usize::from(drive.position)].alias;
            let mut others = bus.subdevices().iter().filter(|one| one.position != drive.position);
            let other = others.find(|one| one.claims_alias(alias)).map(|one| one.position);
            let wheel = drive.wheel.clone().unwrap_or_default();
            if let Some(other) = other {
                let text = format!(
                    "{wheel}: SubDevice {other} has the alias {alias}, too: it is found by its position; give that another alias"
                );
                self.tell_found_of(&name_of(&wheel), vec![text]);
            } else if shown == Some(alias) {
                (drive.alias, drive.written_alias) = (Some(alias), None);
                self.record.note(format!("{wheel}: its drive shows alias {alias}"));
            } else {
                let shown = shown.map_or("none".to_owned(), |alias| alias.to_string());
                let text = format!(
                    "{wheel}: alias {alias} was written, its drive shows {shown}: it is found by its position until it was switched off and on"
                );
                self.tell_found_of(&name_of(&wheel), vec![text]);
            }
        }
        Ok(true)
    }

    /// Somebody does it, as what stands in EEPROMs counts from then on; who of these wasn't dark is told. `false` where it is left.
    pub(super) fn are_switched_off_and_on(&mut self, positions: &[u16]) -> Result<bool, SetupError> {
        let mut text = "switch the supply of all drives off, wait until they are dark, switch it on again, and wait until they are up";
        let mut kept = positions.to_vec();
        for _ in 0..ATTEMPTS {
            let Some(lost) = self.are_up("power".to_owned(), text.to_owned())? else { return Ok(false) };
            kept.retain(|position| !lost.contains(position));
            if kept.is_empty() {
                return Ok(true);
            }
            let positions: Vec<String> = kept.iter().map(u16::to_string).collect();
            let question = format!(
                "SubDevice {} never lost its supply since that was asked: switch it off and on, or go on with what counts until then?",
                positions.join(", ")
            );
            let choices = ["again", "go on"].map(str::to_owned);
            match self.choose("dark".to_owned(), question, &choices) {
                Err(Leave) => return Ok(false),
                Ok(said) if said == "go on" => return Ok(true),
                Ok(_) => text = "say it once they were dark and are up again",
            }
        }
        Ok(false)
    }

    /// An alias that nobody has, asked for.
    fn free_alias(&mut self, bus: &AnyBus<C>, number: usize, written: &[(usize, u16)]) -> Result<u16, Leave> {
        let position = self.record.drives[number].position;
        // One of a hot-connect group isn't there.
        let places: Vec<BusPlace> = self.plan.devices.iter().map(|one| one.place).collect();
        let is_free = |alias: u16| {
            let mut others = bus.subdevices().iter().filter(|one| one.position != position);
            alias > 0
                && !places.contains(&BusPlace::Alias(alias))
                && !others.any(|one| one.claims_alias(alias))
                && written.iter().all(|(_, other)| *other != alias)
        };
        let likely = (number as u16 + 1..=u16::MAX).find(|alias| is_free(*alias)).unwrap_or(u16::MAX);
        for _ in 0..ATTEMPTS {
            let text = "which alias (1 to 65535)?".to_owned();
            let said =
                self.number(format!("alias {position}"), text, likely.into(), [1.0, f64::from(u16::MAX)])?;
            let alias = said as u16;
            if f64::from(alias) == said && is_free(alias) {
                return Ok(alias);
            }
            self.hand.tell(&format!("expected a whole number up to 65535 that nobody has, found {said}"));
        }
        Err(Leave)
    }
}
