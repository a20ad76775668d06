//! Writing an EEPROM so that half of it is never taken for a whole.
//!
//! The checksum (word 7) guards words 0 to 6, and every MainDevice and every chip looks at it. It is spoiled first and
//! set right last: whatever ends the writing in between, the EEPROM says itself that it isn't valid.

use alloc::vec::Vec;
use core::fmt;

use super::interface::Interface;
use super::{COMMAND_READ, EepromFailure};
use crate::found::Target;
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::wire::bytes::{put_u16, put_u32, u16_at, u32_at};
use crate::wire::{HostTime, register, sii};

/// The word with the checksum.
const CHECKSUM: u32 = 7;
/// Command: write a word, with the permission in the same datagram.
const COMMAND_WRITE: u16 = 1 << 9 | 1;
/// Attempts at a word whose reading back differs.
const ATTEMPTS: u32 = 4;

/// One word and what is written there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WordWrite {
    /// Address of the word.
    pub word: u32,
    /// Its value.
    pub value: u16,
}

/// The image with the checksum that its first words have.
pub fn with_checksum(mut image: Vec<u8>) -> Vec<u8> {
    if let Some(first) = image.first_chunk::<14>() {
        let checksum = sii::checksum(first);
        if let Some(place) = image.get_mut(14) {
            *place = checksum;
        }
    }
    image
}

/// The words to write to make `after` of `before`, in an order that leaves the checksum wrong until the last one.
///
/// `after` has whole words; what `before` doesn't reach counts as different.
pub fn plan(before: &[u8], after: &[u8]) -> Vec<WordWrite> {
    let word_of = |image: &[u8], word: u32| {
        let at = word as usize * 2;
        (at + 2 <= image.len()).then(|| u16_at(image, at))
    };
    let words = (after.len() / 2) as u32;
    let differs = |word: &u32| word_of(before, *word) != word_of(after, *word);
    let write = |word: u32| WordWrite { word, value: word_of(after, word).unwrap_or(0xFFFF) };
    let guarded = (0..CHECKSUM.min(words)).filter(differs).map(write);
    let others = (CHECKSUM + 1..words).filter(differs).map(write);
    let all: Vec<WordWrite> = others.chain(guarded).collect();
    if words <= CHECKSUM || (all.is_empty() && !differs(&CHECKSUM)) {
        return Vec::new();
    }
    let mut steps = Vec::with_capacity(all.len() + 2);
    if !all.is_empty() {
        let high = word_of(after, CHECKSUM).unwrap_or(0) & 0xFF00;
        steps.push(WordWrite { word: CHECKSUM, value: high | u16::from(spoiled(before, &all)) });
    }
    steps.extend(all);
    steps.push(write(CHECKSUM));
    steps
}

/// What makes the checksum of an image wrong.
pub(crate) fn spoiled_checksum(image: &[u8]) -> WordWrite {
    WordWrite { word: CHECKSUM, value: u16_at(image, CHECKSUM as usize * 2) ^ 0x00FF }
}

/// A checksum that is wrong before the first, between any two and behind the last of `writes`.
fn spoiled(before: &[u8], writes: &[WordWrite]) -> u8 {
    let mut guarded = [0xFF; 14];
    let there = before.len().min(guarded.len());
    guarded[..there].copy_from_slice(&before[..there]);
    let mut right = Vec::from([sii::checksum(&guarded)]);
    for WordWrite { word, value } in writes {
        if *word < CHECKSUM {
            put_u16(&mut guarded, *word as usize * 2, *value);
            right.push(sii::checksum(&guarded));
        }
    }
    // At most eight are right.
    (0..=u8::MAX).find(|value| !right.contains(value)).unwrap_or(0)
}

/// Why an EEPROM could not be written, and what it is like now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EepromWriteError {
    /// The SubDevice.
    pub position: u16,
    /// The word that was in hand.
    pub word: u32,
    /// Words that were written and read back before it.
    pub written: usize,
    /// Words to write in all.
    pub of: usize,
    /// What went wrong.
    pub cause: EepromFailure,
}

impl fmt::Display for EepromWriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EepromWriteError { position, word, written, of, cause } = self;
        write!(
            f,
            "SubDevice {position}: writing EEPROM word 0x{word:04x} ({written} of {of} words done): {cause}"
        )?;
        f.write_str(if *written == 0 {
            "; nothing but perhaps the checksum was changed: run the same command again"
        } else {
            "; the EEPROM is incomplete and says so by its checksum, which is wrong on purpose. Leave the power on and \
             run the same command again, or write the backup; a device that was switched off meanwhile stays in INIT, \
             but its EEPROM can still be written"
        })
    }
}

impl core::error::Error for EepromWriteError {}

/// What the next datagram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Look whether the interface is free.
    Free,
    /// Order the writing.
    Write,
    /// Wait for its end.
    Written,
    /// Order the reading back.
    Read,
    /// Fetch what stands there.
    Fetch,
}

/// Writes words of one SubDevice's EEPROM one by one, each read back before the next.
#[derive(Debug)]
pub struct SiiWriter {
    target: Target,
    steps: Vec<WordWrite>,
    next: usize,
    stage: Stage,
    interface: Interface,
    attempts: u32,
    outcome: Option<Result<(), EepromFailure>>,
}

impl SiiWriter {
    /// A writer of `steps`, see [`plan`], for `target`, whose EEPROM belongs to the MainDevice at present.
    pub fn new(target: Target, steps: Vec<WordWrite>) -> Self {
        SiiWriter {
            target,
            outcome: steps.is_empty().then_some(Ok(())),
            steps,
            next: 0,
            stage: Stage::Free,
            interface: Interface::default(),
            attempts: 0,
        }
    }

    fn step(&self) -> WordWrite {
        self.steps.get(self.next).copied().unwrap_or(WordWrite { word: CHECKSUM, value: 0 })
    }

    fn take_status(&mut self, data: &[u8], now: HostTime) -> Result<(), EepromFailure> {
        let status = u16_at(data, 0);
        if self.interface.is_busy(status, now)? {
            return Ok(());
        }
        if self.stage == Stage::Free {
            self.stage = Stage::Write;
            return Ok(());
        }
        let WordWrite { word, value } = self.step();
        let was_written = self.stage == Stage::Written;
        // An EEPROM that is still storing the last word acknowledges nothing.
        if !self.interface.is_acknowledged(status, u32_at(data, 2), word, now)? {
            self.stage = if was_written { Stage::Write } else { Stage::Read };
            return Ok(());
        }
        if was_written {
            self.stage = Stage::Read;
            return Ok(());
        }
        let found = u16_at(data, 6);
        self.stage = Stage::Write;
        if found == value {
            self.attempts = 0;
            self.next += 1;
            if self.next == self.steps.len() {
                self.outcome = Some(Ok(()));
            }
            return Ok(());
        }
        self.attempts += 1;
        self.interface.wait(now);
        if self.attempts < ATTEMPTS { Ok(()) } else { Err(EepromFailure::Differs { written: value, found }) }
    }
}

impl Procedure for SiiWriter {
    type Output = Result<(), EepromWriteError>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        if let Some(outcome) = self.outcome.take() {
            let (position, written, of) = (self.target.position, self.next, self.steps.len());
            let word = self.step().word;
            return Next::Done(outcome.map_err(|cause| EepromWriteError {
                position,
                word,
                written,
                of,
                cause,
            }));
        }
        if let Some(instant) = self.interface.pause(now) {
            return Next::WaitUntil(instant);
        }
        let station = self.target.station;
        Next::Send(match self.stage {
            Stage::Free => DatagramRequest::read(station, register::SII_CONTROL, 2),
            Stage::Write => DatagramRequest::write(station, register::SII_CONTROL, 8),
            Stage::Read => DatagramRequest::write(station, register::SII_CONTROL, 6),
            Stage::Written | Stage::Fetch => DatagramRequest::read(station, register::SII_CONTROL, 14),
        })
    }

    fn fill(&self, data: &mut [u8]) {
        let WordWrite { word, value } = self.step();
        match self.stage {
            Stage::Write => {
                put_u16(data, 0, COMMAND_WRITE);
                put_u32(data, 2, word);
                put_u16(data, 6, value);
            }
            Stage::Read => {
                put_u16(data, 0, COMMAND_READ);
                put_u32(data, 2, word);
            }
            Stage::Free | Stage::Written | Stage::Fetch => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        let taken = match answer.data(1) {
            Err(found) => {
                // Nobody knows whether an order was seen: the interface may be busy with it.
                if matches!(self.stage, Stage::Write | Stage::Read) {
                    self.stage = Stage::Free;
                }
                self.interface.lost(found, now)
            }
            Ok(data) => {
                // An interface that is free says nothing of whether orders reach it: their failures go on counting.
                if self.stage != Stage::Free {
                    self.interface.answered();
                }
                match self.stage {
                    Stage::Write => {
                        self.stage = Stage::Written;
                        Ok(())
                    }
                    Stage::Read => {
                        self.stage = Stage::Fetch;
                        Ok(())
                    }
                    Stage::Free | Stage::Written | Stage::Fetch => self.take_status(data, now),
                }
            }
        };
        if let Err(failure) = taken {
            self.outcome = Some(Err(failure));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(first: u8, rest: u8) -> Vec<u8> {
        let mut image = vec![first; 14];
        image.resize(64, rest);
        with_checksum(image)
    }

    #[test]
    fn the_checksum_is_wrong_from_the_first_to_the_last_but_one_write() {
        for first in 0..=255 {
            let (before, after) = (image(first, 1), image(first.wrapping_mul(7).wrapping_add(3), 2));
            let mut chip = before.clone();
            let steps = plan(&before, &after);
            for (number, WordWrite { word, value }) in steps.iter().enumerate() {
                put_u16(&mut chip, *word as usize * 2, *value);
                let is_right = chip[14] == sii::checksum(chip.first_chunk().unwrap());
                assert_eq!(is_right, number + 1 == steps.len(), "{first}: {number} of {steps:?}");
            }
            assert_eq!(chip, after);
        }
    }

    #[test]
    fn what_is_the_same_isnt_written() {
        let before = image(5, 1);
        assert_eq!(plan(&before, &before), []);
        let mut after = before.clone();
        after[8] = 77;
        let words: Vec<u32> = plan(&before, &with_checksum(after)).iter().map(|step| step.word).collect();
        assert_eq!(words, [7, 4, 7]);
    }
}
