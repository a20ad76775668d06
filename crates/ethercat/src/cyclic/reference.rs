//! Which clock is the reference while SubDevices go and come.
//!
//! Frames carry the reference's time to everybody behind it, in the order of positions; who stands before it
//! would be told nonsense.
//!
//! So the first operational SubDevice with a clock is the reference: another is elected when it is lost, and
//! one that comes back before the present reference is set by that one's time first and takes over then.
//!
//! Its time goes on where the other's was: nothing is stepped, and what differs by the way of the frame (delays
//! measured from the first reference, some hundred ns) the clocks' own control loops slew.

use super::diagnosis::Health;
use super::{CyclicBus, Goal, TransitionStatus};
use crate::image::{ClockUse, Member};
use crate::wire::{Address, Command, Link, register};

impl<L: Link> CyclicBus<L> {
    /// Elects another reference where the present one is lost, and gives it back to the first in the line.
    pub(super) fn keep_reference(&mut self) {
        let Some(reference) =
            self.plan.clock.reference().filter(|_| self.phase == TransitionStatus::Reached(Goal::Op))
        else {
            return;
        };
        // One that answers keeps the time whatever its state. One that is on its way back serves from the moment at which it has its time.
        let is_lost = matches!(self.health_of(reference), Health::Silent | Health::NotAlone)
            && !(self.promoted_reference == Some(reference) && self.acyclic.is_recovering(reference));
        if is_lost || self.reference_is_unset {
            let led = |member: &&Member| {
                let position = member.position;
                let is_on_its_way = self.acyclic.is_recovering(position);
                let is_operational = self.health_of(position) == Health::Operational && !is_on_its_way;
                member.clock.is_some()
                    && (is_operational || (self.reference_is_unset && self.acyclic.has_time(position)))
            };
            match self.members.iter().find(led).map(|member| member.position) {
                Some(position) => {
                    self.promoted_reference =
                        Some(position).filter(|position| self.acyclic.is_recovering(*position));
                    self.pending_reference = None;
                    self.set_reference(position);
                    self.lead_on();
                }
                None if !self.reference_is_unset => {
                    self.reference_is_unset = true;
                    (self.promoted_reference, self.pending_reference) = (None, None);
                    self.command_clock(Command::Fprd);
                    self.steer_clock(None);
                }
                None => {}
            }
            return;
        }
        let setting = self.acyclic.setting_clock().filter(|position| *position < reference);
        match (self.pending_reference, setting) {
            (None, Some(position)) => {
                self.pending_reference = Some(position);
                // Until it has its time nobody is told any: clocks drift less than 1 us meanwhile.
                self.command_clock(Command::Fprd);
            }
            (Some(position), None) => {
                self.pending_reference = None;
                self.command_clock(Command::Frmw);
                if self.acyclic.is_recovering(position) {
                    self.set_reference(position);
                    self.promoted_reference = Some(position);
                }
            }
            (None, None) => self.give_back(reference),
            _ => {}
        }
    }

    /// One before the reference that was taken for lost and is operational without a way back leads again: the frames of the
    /// present reference don't reach it, and its clock has run on by itself for some cycles only.
    fn give_back(&mut self, reference: u16) {
        let before = self.members.iter().take_while(|member| member.position < reference);
        let mut operational = before.filter(|member| {
            let position = member.position;
            let is_operational = self.health_of(position) == Health::Operational;
            member.clock.is_some() && is_operational && !self.acyclic.is_recovering(position)
        });
        if let Some(position) = operational.next().map(|member| member.position) {
            self.promoted_reference = None;
            self.set_reference(position);
        }
    }

    /// The reference is read and distributed, whatever was before.
    pub(super) fn lead_on(&mut self) {
        (self.reference_is_unset, self.pending_reference) = (false, None);
        self.command_clock(Command::Frmw);
    }

    fn health_of(&self, position: u16) -> Health {
        self.diagnosis.health().get(usize::from(position)).copied().unwrap_or(Health::Silent)
    }

    fn command_clock(&mut self, command: Command) {
        if let (Some(slot), Some(frame)) = (self.clock_slot, self.exchanger.frames.first_mut()) {
            frame.set_command(slot, command);
        }
    }

    fn set_reference(&mut self, position: u16) {
        let Some(member) = self.members.get(usize::from(position)) else { return };
        let address = Address::station(member.station, register::DC_SYSTEM_TIME);
        match &mut self.plan.clock {
            ClockUse::None => return,
            ClockUse::Distribute { reference } | ClockUse::Steer { reference } => *reference = position,
        }
        let Some(frame) = self.exchanger.frames.first_mut() else { return };
        for slot in [self.clock_slot, self.steer_slot].into_iter().flatten() {
            frame.set_address(slot, address);
        }
    }
}
