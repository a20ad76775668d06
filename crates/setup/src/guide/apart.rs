//! Who of the drives on the bus turns a wheel. Others, the lift of the robot's file for one, are never jogged.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::Clock;
use omnibase_robot::config::{BusPlace, DevicePlan, DrivePlan, Identity};
use omnibase_robot::peripherals::AXIS;

use super::{
    ATTEMPTS, AnyBus, Guide, Leave, SetupError, has_its_numbers, is_identity, is_product, seen, who,
};
use crate::record::{FoundDevice, FoundDrive, Step};

/// What of findings wheels have no drive.
pub(super) const UNDRIVEN: &str = "wheels without a drive";

impl<C: Clock> Guide<'_, C> {
    /// Takes from `drives` who turns no wheel: by the robot's file, and by what somebody says where that can't tell. `false` where he
    /// leaves; an error where the file's devices aren't where it has them. Nothing is written into who isn't among the drives.
    pub(super) fn set_apart(
        &mut self,
        on_bus: &[SubDevice],
        drives: &mut Vec<FoundDrive>,
    ) -> Result<bool, SetupError> {
        let places = places(&self.plan.devices, on_bus).map_err(SetupError::Devices)?;
        let places: Vec<(u16, String, String)> =
            places.into_iter().map(|(at, one)| (at, one.name.clone(), one.kind.clone())).collect();
        for drive in drives.clone() {
            let Some((_, name, kind)) = places.iter().find(|(at, ..)| *at == drive.position) else {
                continue;
            };
            let what = if kind == AXIS { "an axis".to_owned() } else { format!("kind `{kind}`") };
            self.leave_alone(drives, &drive, &format!("is `{name}` of the file, {what}"));
        }
        // Who isn't among the drives any more was set apart before.
        let by_word = self.record.others.iter().filter(|one| one.is_apart_by_word);
        let mut said: Vec<FoundDrive> = by_word.map(FoundDevice::as_drive).collect();
        said.retain(|one| drives.iter().all(|drive| drive.position != one.position));
        for drive in self.unclear(drives) {
            // Nobody else may be left over by now.
            if !self.unclear(drives).contains(&drive) {
                continue;
            }
            let text = format!(
                "SubDevice {} ({}, {}): on the bus are {} drives for {} wheels. Does this one turn a wheel? What is no wheel's (a lift, an \
                 arm) isn't turned here; who doesn't know leaves, and looks where its cables go",
                drive.position,
                drive.name,
                who(&drive),
                drives.len(),
                self.plan.drives.len()
            );
            let choices = ["wheel", "no wheel"].map(str::to_owned);
            match self.choose(format!("role {}", drive.position), text, &choices) {
                Err(Leave) => return Ok(false),
                Ok(said) if said == choices[0] => {}
                Ok(_) => {
                    self.leave_alone(drives, &drive, "turns no wheel, as was said");
                    said.push(drive);
                }
            }
        }
        let others = on_bus.iter().filter(|one| drives.iter().all(|drive| drive.position != one.position));
        let by_word: Vec<u16> = said.iter().map(|one| one.position).collect();
        let others = others.map(|one| FoundDevice {
            is_by_position: !self.is_found_anywhere(one, on_bus),
            is_apart_by_word: by_word.contains(&one.position),
            name: places.iter().find(|(at, ..)| *at == one.position).map(|(_, name, _)| name.clone()),
            position: one.position,
            vendor_id: one.identity.vendor_id,
            product_code: one.identity.product_code,
            serial: one.identity.serial,
            alias: one.alias,
        });
        self.record.others = others.collect();
        // Behind a group that is plugged in a position tells nobody; without an alias of its own it is known by its position alone.
        let is_group = |name: &String| {
            self.plan.devices.iter().any(|device| device.name == *name && device.group.is_some())
        };
        let grouped = self.record.others.iter().filter(|one| one.name.as_ref().is_some_and(is_group));
        let first = grouped.map(|one| one.position).min().unwrap_or(u16::MAX);
        let is_lost = |one: &&FoundDevice| one.name.is_none() && one.is_by_position && one.position > first;
        if let Some(one) = self.record.others.iter().find(is_lost) {
            return Err(SetupError::Devices(format!(
                "SubDevice {} is in no table of the file, and its position shifts with the hot-connect group in front of it: give it an alias \
                 that nobody else has, plug it in before the group, or name it in the file",
                one.position
            )));
        }
        Ok(true)
    }

    /// Whether its alias tells it from everybody, and from who isn't there.
    fn is_found_anywhere(&self, one: &SubDevice, on_bus: &[SubDevice]) -> bool {
        one.alias.is_some_and(|alias| {
            let mut places = self.plan.devices.iter().map(|device| device.place);
            on_bus.iter().filter(|other| other.claims_alias(alias)).count() == 1
                && places.all(|place| place != BusPlace::Alias(alias))
        })
    }

    /// Adds to `drives` who was set apart, where some wheel has no drive: that may have been a mistake of somebody's, or of the file.
    pub(super) fn take_back(&self, bus: &mut AnyBus<C>, drives: &mut Vec<FoundDrive>) {
        if drives.len() >= self.plan.drives.len() && !self.record.has_found(UNDRIVEN) {
            return;
        }
        drives.extend(self.drives_on(bus).into_iter().filter(|drive| self.was_apart(drive)));
        drives.sort_by_key(|one| one.position);
    }

    /// Whether it turned no wheel before.
    fn was_apart(&self, drive: &FoundDrive) -> bool {
        self.record.others.iter().any(|one| one.position == drive.position)
    }

    /// Whoever was there and is in no table of the file is there still, or gone for good: the file would do without him. `false` where
    /// it is left.
    pub(super) fn is_nobody_gone(&mut self) -> Result<bool, SetupError> {
        for _ in 0..ATTEMPTS {
            let mut there: Vec<FoundDrive> = self.scanned_as_found()?.subdevices().iter().map(seen).collect();
            there.retain(|one| self.record.drives.iter().all(|drive| drive.position != one.position));
            let is_gone = |one: &&FoundDevice| {
                let at = there.iter().position(|now| has_its_numbers(&one.as_drive(), now));
                at.map(|at| there.remove(at)).is_none()
            };
            let Some(one) = self.record.others.iter().filter(|one| one.name.is_none()).find(is_gone).cloned()
            else {
                return Ok(true);
            };
            let text = format!(
                "SubDevice {} ({}) was on the bus and isn't: is it gone for good, so that the file does without it, or there again?",
                one.position,
                who(&one.as_drive())
            );
            match self.choose(format!("gone {}", one.position), text, &["gone", "there"].map(str::to_owned)) {
                Err(Leave) => return Ok(false),
                Ok(said) if said == "gone" => {
                    self.record.others.retain(|other| *other != one);
                    self.record.note(format!("SubDevice {} is gone for good, as was said", one.position));
                }
                Ok(_) => {}
            }
        }
        Ok(false)
    }

    /// There is a drive for each wheel.
    pub(super) fn are_enough(&self, drives: usize) -> Result<(), SetupError> {
        let wheels = self.plan.drives.len();
        if drives < wheels { Err(SetupError::TooFewDrives { wheels, drives }) } else { Ok(()) }
    }

    /// Who is another product than the file's wheels have is asked about once: the file may be another robot's. `false` where it is left.
    pub(super) fn are_products_meant(&mut self, drives: &[FoundDrive]) -> Result<bool, SetupError> {
        let is_meant = |one: &&FoundDrive| self.plan.drives.iter().any(|plan| is_product(plan, one));
        let others: Vec<&FoundDrive> = drives.iter().filter(|one| !is_meant(one)).collect();
        let found =
            |one: &FoundDrive| format!("vendor 0x{:08x} product 0x{:08x}", one.vendor_id, one.product_code);
        let texts = others.iter().map(|one| {
            format!(
                "SubDevice {} is {}, and no wheel of the file has that: put `device` and its maps right before it is driven \
                 (`omnibase scan --toml` shows them)",
                one.position,
                found(one)
            )
        });
        let texts: Vec<String> = texts.collect();
        let is_new =
            |one: &&FoundDrive| !self.record.products_meant.contains(&(one.vendor_id, one.product_code));
        let new: Vec<FoundDrive> = others.into_iter().filter(is_new).cloned().collect();
        if new.is_empty() {
            self.tell_found_of("products", texts);
            return Ok(true);
        }
        self.record.found_of("products", texts);
        let wheels =
            self.plan.drives.iter().map(|plan| format!("`{}` ({})", plan.device, expected(&plan.identity)));
        let wheels: BTreeSet<String> = wheels.collect();
        let on_bus =
            new.iter().map(|one| format!("SubDevice {} ({}): {}", one.position, one.name, found(one)));
        let text = format!(
            "the file's wheels have {}, and on the bus are {}. Is it another robot's file? Jogs would use these drives as they are by themselves, \
             but the robot's file would have that device's maps and parameters. Leave, and put `device` right; or go on with these drives?",
            Vec::from_iter(wheels).join(", "),
            Vec::from_iter(on_bus).join(", ")
        );
        match self.choose("products".to_owned(), text, &["go on".to_owned()]) {
            Err(Leave) => Ok(false),
            Ok(_) => {
                self.record.note("gone on with drives that are other products than the file's wheels have");
                self.record.products_meant.extend(new.iter().map(|one| (one.vendor_id, one.product_code)));
                Ok(true)
            }
        }
    }

    /// A drive that isn't turned here: whatever was seen of it counts no more.
    fn leave_alone(&mut self, drives: &mut Vec<FoundDrive>, drive: &FoundDrive, why: &str) {
        let text = format!("SubDevice {} {why}: not turned here", drive.position);
        self.hand.tell(&text);
        self.record.note(text);
        drives.retain(|one| one.position != drive.position);
        if let Some(wheel) = &drive.wheel {
            self.tell_found(format!(
                "SubDevice {} was seen to turn {wheel}, and {why}: that counts no more",
                drive.position
            ));
            self.record.begin_again();
            self.record.done.push(Step::Find);
        }
    }

    /// Drives of which nobody knows whether they turn a wheel: one of too many, of another product than wheels have by the file where not
    /// all are alike, or one of whom the contrary was said.
    fn unclear(&self, drives: &[FoundDrive]) -> Vec<FoundDrive> {
        let is_seen = |plan: &DrivePlan| drives.iter().any(|one| one.wheel.as_ref() == Some(&plan.name));
        if self.plan.drives.iter().all(is_seen) {
            return Vec::new();
        }
        let product = |one: &FoundDrive| (one.vendor_id, one.product_code);
        let are_many = drives.len() > self.plan.drives.len();
        let are_mixed = drives.iter().any(|one| product(one) != product(&drives[0]));
        let is_of_wheel = |one: &FoundDrive| {
            let mut of_wheels = self.plan.drives.iter().filter(|plan| plan.identity.product_code.is_some());
            of_wheels.any(|plan| is_product(plan, one))
        };
        let is_unclear = |one: &&FoundDrive| {
            one.wheel.is_none() && (are_many || are_mixed && !is_of_wheel(one) || self.was_apart(one))
        };
        drives.iter().filter(is_unclear).cloned().collect()
    }
}

/// Where the file's devices are on the bus; in words who isn't there, or is another than the file has.
fn places<'p>(devices: &'p [DevicePlan], on_bus: &[SubDevice]) -> Result<Vec<(u16, &'p DevicePlan)>, String> {
    let mut places: Vec<(u16, &DevicePlan)> = Vec::new();
    let mut problems = Vec::new();
    let is_absent = |device: &DevicePlan| !on_bus.iter().any(|one| is_at(device, one));
    for device in devices {
        let there: Vec<&SubDevice> = on_bus.iter().filter(|one| is_at(device, one)).collect();
        let mut words = format!("`{}` is at {} in the file", device.name, device.place);
        match there[..] {
            [] => {
                // A hot-connect group is there as a whole, or not at all.
                let mut group = devices.iter().filter(|one| one.group == device.group);
                if device.group.is_some() && group.all(is_absent) {
                    continue;
                }
                match device.place {
                    BusPlace::Position(_) => {
                        let _ =
                            write!(words, ", the bus has SubDevices 0 to {}", on_bus.len().saturating_sub(1));
                    }
                    _ => words += ", and nobody has that",
                }
                let pending = on_bus
                    .iter()
                    .find(|one| matches!(device.place, BusPlace::Alias(alias) if one.claims_alias(alias)));
                if let Some(one) = pending {
                    let _ = write!(words, " before SubDevice {} was switched off and on", one.position);
                }
            }
            [one] if !is_its(device, one) => {
                let _ = write!(words, " ({}), and there is {}", expected(&device.identity), who(&seen(one)));
            }
            [one] => match places.iter().find(|(at, _)| *at == one.position) {
                None => {
                    places.push((one.position, device));
                    continue;
                }
                Some((_, other)) => {
                    let _ = write!(words, ", and that is `{}`", other.name);
                }
            },
            _ => {
                let positions: Vec<String> = there.iter().map(|one| one.position.to_string()).collect();
                let _ = write!(words, ", and SubDevices {} all have that", positions.join(", "));
            }
        }
        let is_known = device.identity.product_code.is_some();
        let elsewhere: Vec<String> = on_bus
            .iter()
            .filter(|one| is_known && !is_at(device, one) && is_its(device, one))
            .map(|one| one.position.to_string())
            .collect();
        if !elsewhere.is_empty() {
            let _ = write!(words, "; its product is that of SubDevice {}", elsewhere.join(", "));
        }
        problems.push(words);
    }
    if problems.is_empty() { Ok(places) } else { Err(problems.join("; ")) }
}

/// Whether a SubDevice is where the file has this device.
pub(super) fn is_at(device: &DevicePlan, one: &SubDevice) -> bool {
    match device.place {
        BusPlace::Position(position) => one.position == position,
        BusPlace::Alias(alias) => one.alias == Some(alias),
        BusPlace::Identification(number) => one.identification == Some(number),
    }
}

/// Whether it has the numbers that the file has for it.
pub(super) fn is_its(device: &DevicePlan, one: &SubDevice) -> bool {
    let found = &one.identity;
    is_identity(&device.identity, found.vendor_id, found.product_code)
        && device.identity.revision.is_none_or(|revision| revision == found.revision)
}

/// Who must be there.
fn expected(identity: &Identity) -> String {
    let numbers =
        [("vendor", identity.vendor_id), ("product", identity.product_code), ("revision", identity.revision)];
    let given = numbers.into_iter().filter_map(|(what, number)| Some(format!("{what} 0x{:08x}", number?)));
    given.collect::<Vec<_>>().join(" ")
}
