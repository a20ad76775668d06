//! What is done in OP: jog, first enable.

use omnibase_ethercat::wire::Clock;

use super::apart::UNDRIVEN;
use super::{ATTEMPTS, Guide, Leave, SetupError, in_words};
use crate::jog::{Jog, JogEnd, JogPlan, astray};
use crate::record::{FoundDrive, Step, Turned};
use crate::turns::{contradicts, is_seen_as, likely_resolution};

/// How long a drive is enabled without moving, s.
pub(super) const ENABLED_S: f64 = 2.0;
/// How often drives are jogged again of which several were seen to turn the same wheel.
const ROUNDS: u32 = 3;
/// Over what time a jog comes to its speed, s: it begins at a 64th of it, for nobody knows the encoder yet.
const RAMP_S: f64 = 5.0;
/// What an eye counts, gears and encoders have: least and most.
const TURNS: [f64; 2] = [0.01, 1000.0];
const GEARS: [f64; 2] = [1e-3, 1e5];
const COUNTS: [f64; 2] = [1.0, 4_294_967_295.0];
/// A drive that is enabled without being told a speed may creep by so much of a wheel's turn.
const CREEP_TURNS: f64 = 0.005;

/// What a drive does while the key is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// It turns.
    Turns,
    /// It is enabled and stands, at most so long, s.
    Stands(f64),
}

impl<C: Clock> Guide<'_, C> {
    /// Turns one drive while its key is held; all have back what they held then.
    pub(super) fn jog(&mut self, number: usize, motion: Motion, what: &str) -> Result<Jog, SetupError> {
        let ended = self.jog_limited(number, motion, what);
        self.after_motion(ended.as_ref().is_ok_and(|(_, is_lost)| *is_lost));
        ended.map(|(jog, _)| jog)
    }

    /// With the limits of a jog in all drives; whether frames were lost in it or behind it.
    pub(super) fn jog_limited(
        &mut self,
        number: usize,
        motion: Motion,
        what: &str,
    ) -> Result<(Jog, bool), SetupError> {
        let mut operational = self.operational()?;
        let drive = self.record.drives[number].clone();
        if let Err(words) = operational.shows_its_mode(number, drive.position)? {
            operational.end().map_err(|error| in_words(&error))?;
            return Err(SetupError::Bus(words));
        }
        let cycle_s = self.wished.cycle.as_secs_f64();
        let counts_s = self.expected_counts(&drive) * self.wished.wheel_speed_rad_s / core::f64::consts::TAU;
        let cycles = |seconds: f64| (seconds / cycle_s).ceil() as u32;
        let plan = JogPlan {
            speed_units: self.speed_units(counts_s, &drive),
            counts_per_cycle: counts_s * cycle_s,
            torque_per_mille: self.wished.torque_per_mille,
            ramp_cycles: cycles(RAMP_S),
            most_cycles: cycles(match motion {
                Motion::Turns => self.wished.longest_s,
                Motion::Stands(longest_s) => longest_s,
            }),
            key_cycles: self.wished.key_s.map(cycles),
        };
        self.hand.take_key(what);
        let mut jogger = operational.jogger(number);
        let mut jog = match motion {
            Motion::Turns => jogger.run(&plan, self.hand)?,
            Motion::Stands(_) => jogger.hold(&plan, self.hand)?,
        };
        if let JogEnd::Drive(words) = &mut jog.end
            && operational.maps[number].error.is_none()
            && let Some(error) = operational.error_code(drive.position)?
        {
            *words += &format!("; asked by SDO, it says error {error}");
        }
        let ended = operational.end();
        self.record.note(format!(
            "SubDevice {}: {what}: {}, {} counts, enabled for {} cycles, {} without a held key",
            drive.position, jog.end, jog.travel_counts, jog.enabled_cycles, jog.unheld_cycles
        ));
        self.kept();
        let is_lost = matches!(jog.end, JogEnd::Lost(_)) || ended.is_err();
        // Who is lost goes nowhere, and that is told already; where one said a fault, it or another may have lost its supply by then.
        if !matches!(jog.end, JogEnd::Lost(_) | JogEnd::Drive(_)) {
            ended.map_err(|error| match &jog.still {
                Some(still) => SetupError::Bus(format!("SubDevice {}: {still}; {error}", drive.position)),
                None => in_words(&error),
            })?;
        }
        Ok((jog, is_lost))
    }

    /// Nothing is enabled for so long: between the least and the greatest position of one drive, counts; in words who didn't answer where
    /// frames were lost.
    pub(super) fn watch(&mut self, number: usize, seconds: f64) -> Result<Result<i64, String>, SetupError> {
        let span = self.watch_limited(number, seconds);
        self.after_motion(matches!(span, Ok(Err(_))));
        span
    }

    fn watch_limited(&mut self, number: usize, seconds: f64) -> Result<Result<i64, String>, SetupError> {
        let mut operational = self.operational()?;
        let cycles = (seconds / self.wished.cycle.as_secs_f64()).ceil() as u32;
        let span = operational.jogger(number).watch(cycles)?;
        match operational.end() {
            // Who is lost goes nowhere, and that is told.
            Err(_) if span.is_err() => {}
            ended => ended.map_err(|error| in_words(&error))?,
        }
        Ok(span)
    }

    /// Every drive until each wheel has one; `false` where it is left.
    pub(super) fn jog_all(&mut self) -> Result<bool, SetupError> {
        for _ in 0..ROUNDS {
            for number in 0..self.record.drives.len() {
                // Who is left over turns no wheel.
                while self.record.drives[number].wheel.is_none() && !self.has_every_wheel_one() {
                    match self.jog_one(number)? {
                        Ok(true) => {}
                        Ok(false) => break,
                        Err(Leave) => return Ok(false),
                    }
                }
            }
            if !self.forget_doubled() {
                return Ok(self.has_every_wheel_a_drive());
            }
        }
        self.hand.tell(&format!(
            "{ROUNDS} times more than one drive was seen to turn the same wheel: mark wheels and drives, then take it up again"
        ));
        Ok(false)
    }

    /// Whether several drives were seen to turn the same wheel; they have none any more.
    fn forget_doubled(&mut self) -> bool {
        let mut any = false;
        for name in self.wheels() {
            let drives = &mut self.record.drives;
            let having: Vec<&mut FoundDrive> =
                drives.iter_mut().filter(|drive| drive.wheel.as_ref() == Some(&name)).collect();
            if having.len() > 1 {
                let positions: Vec<String> = having.iter().map(|drive| drive.position.to_string()).collect();
                having.into_iter().for_each(|drive| drive.wheel = None);
                let text = format!(
                    "SubDevices {} were all seen to turn {name}: they are jogged again",
                    positions.join(", ")
                );
                self.hand.tell(&text);
                self.record.found(text);
                any = true;
            }
        }
        any
    }

    /// Whether each wheel was seen to be turned by some drive.
    pub(super) fn has_every_wheel_one(&self) -> bool {
        self.without_drive().is_none()
    }

    /// Whether it turns no wheel, for each has another.
    pub(super) fn is_left_over(&self, drive: &FoundDrive) -> bool {
        drive.wheel.is_none() && self.has_every_wheel_one()
    }

    fn without_drive(&self) -> Option<String> {
        let drives = &self.record.drives;
        let has = |name: &String| drives.iter().any(|drive| drive.wheel.as_ref() == Some(name));
        self.wheels().into_iter().find(|name| !has(name))
    }

    pub(super) fn has_every_wheel_a_drive(&mut self) -> bool {
        let name = self.without_drive();
        let text = name.iter().map(|name| format!("no drive was seen to turn {name}")).collect();
        self.record.found_of(UNDRIVEN, text);
        if let Some(name) = &name {
            let is_by_word = self.record.others.iter().any(|one| one.is_apart_by_word);
            let or = if is_by_word {
                "; or it is one that was said to turn none: that is asked again then"
            } else {
                ""
            };
            self.hand.tell(&format!(
                "no drive was seen to turn {name}: look at its cables and its drive, then go on{or}"
            ));
        }
        name.is_none()
    }

    fn wheels(&self) -> Vec<String> {
        self.plan.drives.iter().map(|plan| plan.name.clone()).collect()
    }

    /// One drive, and what was seen; `Ok(false)` where it is left out.
    fn jog_one(&mut self, number: usize) -> Result<Result<bool, Leave>, SetupError> {
        let position = self.record.drives[number].position;
        let what =
            format!("hold the key: SubDevice {position} turns; let go after a whole turn of the wheel");
        let jog = match self.jog(number, Motion::Turns, &what) {
            // Whoever isn't there now may be there again.
            Err(SetupError::Bus(words)) => return Ok(self.again_after(position, words)),
            Err(error @ SetupError::Changed { .. }) => {
                self.hand.tell(&error.to_string());
                return Ok(self.again(position));
            }
            jog => jog?,
        };
        let trouble = match &jog.end {
            JogEnd::LetGo | JogEnd::Longest => None,
            JogEnd::Runaway { told, seen } if told * seen >= 0.0 => {
                Some(format!("{seen:.1} counts a cycle where {told:.1} were told: {}", astray(*told, *seen)))
            }
            JogEnd::Runaway { told, seen } => Some(format!(
                "its encoder counted against its motor ({seen:.1} counts a cycle where {told:.1} were told): where nobody pushed the wheel or \
                 the platform, change its motor's phases or its encoder by the maker's tool; `direction` can't mend that"
            )),
            JogEnd::Drive(words) => Some(words.clone()),
            JogEnd::Lost(words) => Some(format!("while it was turned: {words}")),
            JogEnd::Gone => return Ok(Err(Leave)),
            JogEnd::NeverHeld => Some("the key wasn't held".to_owned()),
        };
        let still = jog.still.map(|still| format!("SubDevice {position}: {still}"));
        self.tell_found_of(&format!("still {position}"), Vec::from_iter(still));
        match trouble {
            Some(trouble) if jog.end == JogEnd::NeverHeld => {
                self.hand.tell(&format!("SubDevice {position}: {trouble}"));
                Ok(self.again(position))
            }
            Some(trouble) => Ok(self.again_after(position, format!("SubDevice {position}: {trouble}"))),
            None => Ok(self.seen(number, &jog)),
        }
    }

    /// Whether a drive is jogged again after what went wrong, which is found.
    fn again_after(&mut self, position: u16, trouble: String) -> Result<bool, Leave> {
        self.tell_found(trouble);
        self.again(position)
    }

    fn again(&mut self, position: u16) -> Result<bool, Leave> {
        let choices = ["again", "leave it out"].map(str::to_owned);
        let text = format!("SubDevice {position}: jog it again, or leave it out for now?");
        Ok(self.choose(format!("again {position}"), text, &choices)? == "again")
    }

    /// Asks what was seen of a jog.
    fn seen(&mut self, number: usize, jog: &Jog) -> Result<bool, Leave> {
        let position = self.record.drives[number].position;
        let mut wheels = self.wheels();
        wheels.extend(["none", "again"].map(str::to_owned));
        let wheel = self.choose(format!("wheel {position}"), "which wheel turned?".to_owned(), &wheels)?;
        match wheel.as_str() {
            "again" => return Ok(true),
            "none" => {
                self.record.found(format!("SubDevice {position}: no wheel was seen to turn"));
                let choices = ["again", "leave it out"].map(str::to_owned);
                let text = "jog it again, or leave it out (it drives no wheel)?".to_owned();
                return Ok(self.choose(format!("again {position}"), text, &choices)? == "again");
            }
            _ => {}
        }
        if jog.travel_counts == 0 {
            let text = format!(
                "SubDevice {position}: {wheel} was seen to turn, but its position (0x6064) didn't change"
            );
            self.tell_found(text);
            let choices = ["again", "leave it out"].map(str::to_owned);
            let text = "look at its encoder; jog it again, or leave it out for now?".to_owned();
            return Ok(self.choose(format!("again {position}"), text, &choices)? == "again");
        }
        let text = format!(
            "which way did {wheel} turn? Forward: its lowest point moved against the way that `omnibase check` shows as `rolls deg`"
        );
        let way =
            self.choose(format!("way {position}"), text, &["forward", "backward"].map(str::to_owned))?;
        let turns = self.number(
            format!("turns {position}"),
            format!("how many turns did {wheel} make?"),
            1.0,
            TURNS,
        )?;
        let counts = jog.travel_counts as f64;
        let forward = (way == "forward") == (counts > 0.0);
        let seen_counts = counts.abs() / turns;
        let Some((counts_per_revolution, gear_ratio)) = self.resolution(number, &wheel, seen_counts)? else {
            return Ok(true);
        };
        let drive = &mut self.record.drives[number];
        drive.turned = Some(if forward { Turned::Forward } else { Turned::Backward });
        drive.seen_counts = Some(seen_counts);
        drive.counts_per_revolution = Some(counts_per_revolution);
        drive.gear_ratio = Some(gear_ratio);
        drive.wheel = Some(wheel.clone());
        self.compare_with_file(number, &wheel);
        self.kept();
        Ok(true)
    }

    /// Counts of the motor and gear: as known where what was seen fits, else as the gear's plate and the eye say; `None` where it is jogged
    /// again.
    fn resolution(
        &mut self,
        number: usize,
        wheel: &str,
        seen_counts: f64,
    ) -> Result<Option<(u32, f64)>, Leave> {
        let drive = self.record.drives[number].clone();
        let scale = self.scale_of(&FoundDrive { wheel: Some(wheel.to_owned()), ..drive.clone() });
        let told = (
            drive.told_counts.unwrap_or(f64::from(scale.counts_per_revolution)),
            drive.told_gear.unwrap_or(scale.gear_ratio),
        );
        let counts_of = format!("counts of {wheel}");
        self.record.found_of(&counts_of, Vec::new());
        if is_seen_as(told.0 * told.1, seen_counts) {
            return Ok(Some((told.0.round() as u32, told.1)));
        }
        let position = drive.position;
        let text = format!(
            "{wheel}: {seen_counts:.0} counts per turn were seen, {:.0} were expected ({} of the motor, gear {})",
            told.0 * told.1,
            told.0,
            told.1
        );
        self.record.found_of(&counts_of, vec![text.clone()]);
        let text = format!(
            "{text}: has it another gear or encoder, or did somebody push the wheel or the platform, or miscount the turns?"
        );
        let choices = ["another gear or encoder", "jog it again"].map(str::to_owned);
        if self.choose(format!("differs {position}"), text, &choices)? == choices[1] {
            return Ok(None);
        }
        for _ in 0..ATTEMPTS {
            let text = format!(
                "{wheel} has {seen_counts:.0} counts per turn where {:.0} were expected. How many turns of the motor make one of the wheel (the gear's plate)?",
                told.0 * told.1
            );
            let gear = self.number(format!("gear {position}"), text, told.1, GEARS)?;
            let of_motor = seen_counts / gear;
            let likely = likely_resolution(of_motor).map_or(of_motor.round(), f64::from);
            let text = format!(
                "with it the motor has {of_motor:.0} counts per turn: how many exactly (the encoder's data sheet)?"
            );
            let counts = self.number(format!("counts {position}"), text, likely, COUNTS)?.round();
            if !contradicts(counts * gear, seen_counts) {
                return Ok(Some((counts.clamp(1.0, f64::from(u32::MAX)) as u32, gear)));
            }
            let text = format!(
                "{counts} counts and a gear of {gear} make {:.0} counts per turn of {wheel}, {seen_counts:.0} were seen: one of them is wrong, or \
                 the wheel didn't make the turns that were said; say these numbers again, or jog it again?",
                counts * gear
            );
            let choices = ["say them again", "jog it again"].map(str::to_owned);
            if self.choose(format!("numbers {position}"), text, &choices)? == choices[1] {
                return Ok(None);
            }
        }
        Err(Leave)
    }

    /// Notes what isn't as the file had it.
    fn compare_with_file(&mut self, number: usize, wheel: &str) {
        use omnibase_robot::config::{BusPlace, TurnDirection};
        let drive = self.record.drives[number].clone();
        let Some(plan) = self.plan.drives.iter().find(|plan| plan.name == wheel) else { return };
        let mut differs = Vec::new();
        if let BusPlace::Position(position) = plan.place
            && position != drive.position
        {
            differs.push(format!(
                "{wheel}: its drive is at position {}, the file says {position}",
                drive.position
            ));
        }
        let of_file =
            if plan.scale.direction == TurnDirection::Forward { Turned::Forward } else { Turned::Backward };
        if drive.turned != Some(of_file) {
            differs.push(format!("{wheel}: it turns the other way than the file says"));
        }
        self.tell_found_of(&format!("wiring of {wheel}"), differs);
    }

    /// Each wheel's drive enabled without moving; `false` where it is left.
    pub(super) fn enable_all(&mut self) -> Result<bool, SetupError> {
        for number in 0..self.record.drives.len() {
            let Some(wheel) = self.record.drives[number].wheel.clone() else { continue };
            if !self.record.is_due(Step::Enable, &wheel) {
                continue;
            }
            loop {
                let jog = self.jog(
                    number,
                    Motion::Stands(ENABLED_S),
                    &format!("hold the key: {wheel} gets stiff and mustn't move"),
                )?;
                let turn = self.record.drives[number].seen_counts.unwrap_or(1.0);
                let turns = jog.travel_counts.abs() as f64 / turn;
                match &jog.end {
                    JogEnd::Longest if turns <= CREEP_TURNS => {
                        self.record.make_good(Step::Enable, Some(&wheel));
                        break;
                    }
                    JogEnd::Gone => return Ok(false),
                    JogEnd::Longest => {
                        let why = format!("{wheel}: enabled without a speed it moved {turns:.3} turns");
                        self.record.failed(Step::Enable, Some(&wheel), why);
                    }
                    end if end.is_untried() => {}
                    end => {
                        let why = format!("{wheel}: enabling it: {end}");
                        self.record.failed(Step::Enable, Some(&wheel), why);
                    }
                }
                let text =
                    format!("{wheel} wasn't enabled for {ENABLED_S} s at rest: again, or go on without?");
                let choices = ["again", "go on"].map(str::to_owned);
                match self.choose(format!("enable {number}"), text, &choices) {
                    Ok(choice) if choice == "go on" => {
                        let why =
                            format!("{wheel}: gone on without {ENABLED_S} s enabled at rest: {}", jog.end);
                        self.record.pass_over(Step::Enable, Some(&wheel), why);
                        break;
                    }
                    Ok(_) => {}
                    Err(Leave) => return Ok(false),
                }
            }
        }
        Ok(true)
    }
}
