//! Brakes: they open while a drive is enabled, and hold while nothing is.

use omnibase_ethercat::wire::Clock;

use super::jogging::{ENABLED_S, Motion};
use super::{Guide, Leave, SetupError};
use crate::jog::JogEnd;
use crate::record::Step;

/// How long somebody pushes a wheel whose brake shall hold, s.
const PUSHED_S: f64 = 8.0;
/// A brake gives by so much of a wheel's turn, its play.
const PLAY_TURNS: f64 = 0.01;

impl<C: Clock> Guide<'_, C> {
    /// Each wheel's brake, where it has one; `false` where it is left.
    pub(super) fn brakes(&mut self) -> Result<bool, SetupError> {
        for number in 0..self.record.drives.len() {
            let Some(wheel) = self.record.drives[number].wheel.clone() else { continue };
            if !self.record.is_due(Step::Brake, &wheel) {
                continue;
            }
            let choices = ["no", "yes"].map(str::to_owned);
            let text = format!("has the motor of {wheel} a brake?");
            match self.choose(format!("brake {number}"), text, &choices) {
                Err(Leave) => return Ok(false),
                Ok(choice) if choice == "no" => {
                    self.record.note(format!("{wheel}: no brake"));
                    self.record.make_good(Step::Brake, Some(&wheel));
                    continue;
                }
                Ok(_) => {}
            }
            loop {
                match self.brake(number, &wheel)? {
                    Err(Leave) => return Ok(false),
                    Ok(true) => {
                        self.record.make_good(Step::Brake, Some(&wheel));
                        break;
                    }
                    Ok(false) => {}
                }
                let text =
                    format!("{wheel}: its brake isn't known to hold: test it again, or go on without?");
                let choices = ["again", "go on"].map(str::to_owned);
                match self.choose(format!("braked {number}"), text, &choices) {
                    Err(Leave) => return Ok(false),
                    Ok(choice) if choice == "go on" => {
                        let why = format!("{wheel}: gone on without a brake that is known to hold");
                        self.record.pass_over(Step::Brake, Some(&wheel), why);
                        break;
                    }
                    Ok(_) => {}
                }
            }
        }
        Ok(true)
    }

    /// Opened by enabling it with a held key, then pushed while nothing is enabled: whether it did both.
    fn brake(&mut self, number: usize, wheel: &str) -> Result<Result<bool, Leave>, SetupError> {
        let what = format!(
            "hold the key: the brake of {wheel} opens; listen to it. The wheel gets stiff and mustn't move"
        );
        let jog = self.jog(number, Motion::Stands(ENABLED_S), &what)?;
        if jog.end == JogEnd::Gone {
            return Ok(Err(Leave));
        }
        if jog.end != JogEnd::Longest {
            let why = format!("{wheel}: its brake wasn't opened for {ENABLED_S} s: {}", jog.end);
            self.record.failed(Step::Brake, Some(wheel), why);
            return Ok(Ok(false));
        }
        let choices = ["yes", "no"].map(str::to_owned);
        let text = format!("did the brake of {wheel} open and close again?");
        match self.choose(format!("opened {number}"), text, &choices) {
            Ok(choice) if choice == "yes" => {}
            Ok(_) => {
                let why = format!("{wheel}: its brake wasn't heard to open and close");
                self.record.failed(Step::Brake, Some(wheel), why);
                return Ok(Ok(false));
            }
            Err(Leave) => return Ok(Err(Leave)),
        }
        let text = format!("{wheel}: push and turn it by hand, both ways, for {PUSHED_S} s from Enter on");
        if self.choose(format!("push {number}"), text, &["done".to_owned()]).is_err() {
            return Ok(Err(Leave));
        }
        let span = match self.watch(number, PUSHED_S)? {
            Ok(span) => span,
            Err(away) => {
                let why = format!("{wheel}: nobody saw whether its brake holds while it was pushed: {away}");
                self.tell_failed(Step::Brake, wheel, why);
                return Ok(Ok(false));
            }
        };
        let turns = span as f64 / self.record.drives[number].seen_counts.unwrap_or(1.0);
        let text = format!("{wheel}: pushed by hand with its brake closed it gave by {turns:.4} turns");
        if turns > PLAY_TURNS {
            self.hand.tell(&text);
            self.record.failed(Step::Brake, Some(wheel), text);
            return Ok(Ok(false));
        }
        // A wheel that nobody touched gives by nothing, too.
        let question = format!("{text}: did you push and turn it both ways, and did it hold?");
        match self.choose(format!("pushed {number}"), question, &["yes", "no"].map(str::to_owned)) {
            Err(Leave) => return Ok(Err(Leave)),
            Ok(choice) if choice == "no" => {
                let why = format!("{wheel}: nobody pushed it, or it didn't hold");
                self.record.failed(Step::Brake, Some(wheel), why);
                return Ok(Ok(false));
            }
            Ok(_) => self.record.note(text),
        }
        Ok(Ok(true))
    }
}
