//! What a [`CyclicBus`] tells, and what is handed in and taken out beside the cycle.

use super::diagnosis::is_process_data;
use super::{
    AcyclicCompletion, AcyclicRequest, Comeback, CommandSet, CycleCounters, CyclicBus, CyclicParts,
    DatagramCount, Exchange, Flight, Freshness, Health, RecoveryError, SegmentStatus, TransitionStatus,
};
use crate::image::{ClockUse, ImagePlan, Member, Role};
use crate::mailbox::{Mailbox, ReceivedEmergency};
use crate::subdevice::SubDevice;
use crate::wire::{Command, DcTime};

impl<L> CyclicBus<L> {
    /// Where the segment is on its way between states.
    pub fn transition(&self) -> &TransitionStatus {
        &self.phase
    }

    /// The farthest clock of the last look while clocks are being locked: position and ns.
    pub fn worst_clock(&self) -> Option<(u16, i32)> {
        self.transition.as_ref()?.worst_clock()
    }

    /// Time of the reference clock when the last frame passed it.
    pub fn clock(&self) -> Option<DcTime> {
        self.clock.last()
    }

    /// How the reference clock is used.
    pub fn clock_use(&self) -> ClockUse {
        self.plan.clock
    }

    /// AL status of all SubDevices in the last exchange; `None` where its frame was lost.
    pub fn status(&self) -> Option<SegmentStatus> {
        self.status
    }

    /// What became of the last exchange.
    pub fn last_exchange(&self) -> Exchange {
        self.last
    }

    /// How each SubDevice is, by position.
    pub fn health(&self) -> &[Health] {
        self.diagnosis.health()
    }

    /// Whether the SubDevice at `position` isn't operational beyond doubt: it said so itself, or left several rounds of
    /// questions unanswered. Before, the frames that it missed may have suffered on their way.
    pub fn is_certain(&self, position: u16) -> bool {
        self.diagnosis.is_certain(position)
    }

    /// Exchanges in a row of which no frame came back at all.
    pub fn nothing_back(&self) -> u64 {
        self.nothing_back
    }

    /// Whether the link said that it is down, and no frame of ours has come back since.
    pub fn is_link_down(&self) -> bool {
        self.exchanger.is_down
    }

    /// How old the inputs of the SubDevice at `position` are after the last exchange.
    pub fn freshness(&self, position: u16) -> Freshness {
        if self
            .diagnosis
            .health()
            .get(usize::from(position))
            .is_some_and(|health| *health != Health::Operational)
        {
            return Freshness::NotOperational;
        }
        for (frame, plan) in self.exchanger.frames.iter().zip(&self.plan.frames) {
            for (slot, datagram) in frame.slots().iter().zip(&plan.datagrams) {
                let carries = matches!(datagram.role, Role::Inputs { .. } | Role::Both { .. })
                    && datagram.touches.iter().any(|touch| touch.position == position);
                if carries && frame.flight == Flight::Idle {
                    return Freshness::Resting { cycles: self.cycle - frame.taken_in };
                }
                if carries && frame.flight != Flight::Back {
                    return Freshness::FrameLost;
                }
                let most = slot.accepted + slot.leeway;
                if carries
                    && !(slot.accepted..=most).contains(&slot.received)
                    && slot.received != slot.expected
                {
                    return Freshness::ShortCount;
                }
            }
        }
        match self.last {
            Exchange::Complete | Exchange::Without { .. } => Freshness::Fresh,
            Exchange::ShortCount { .. } | Exchange::Lost { .. } => Freshness::HeldBack,
        }
    }

    /// Whether the process data of the SubDevice at `position` went in the last exchange, or rest until their next turn.
    pub fn rests(&self, position: u16) -> bool {
        self.plan.turns.get(usize::from(position)).is_some_and(|turn| !turn.is_due(self.cycle))
    }

    /// Figures of all cycles so far.
    pub fn counters(&self) -> CycleCounters {
        self.exchanger.counters
    }

    /// The datagrams of process data, each with its own count of wrong working counters.
    pub fn datagram_counts(&self) -> impl Iterator<Item = DatagramCount> + '_ {
        let frames = self.exchanger.frames.iter().zip(&self.plan.frames).enumerate();
        frames.flat_map(|(number, (frame, plan))| {
            let slots = frame.slots().iter().zip(&plan.datagrams).enumerate();
            slots.filter(|(_, (slot, _))| is_process_data(slot.purpose)).map(
                move |(datagram, (slot, plan))| DatagramCount {
                    frame: number as u16,
                    datagram: datagram as u16,
                    command: plan.command,
                    expected: slot.expected,
                    short_counts: slot.short_counts,
                },
            )
        })
    }

    /// Frames with process data, those included that don't go in every cycle.
    pub fn frames_per_cycle(&self) -> usize {
        self.planned
    }

    /// Every command that this bus has put into a frame.
    pub fn commands_used(&self) -> CommandSet {
        self.exchanger.frames.iter().fold(CommandSet::default(), |set, frame| set.union(frame.commands))
    }

    /// The layout of image and frames.
    pub fn plan(&self) -> &ImagePlan {
        &self.plan
    }

    /// The SubDevices as the cycle knows them.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// So many cycles didn't take place: whose turn it would have been waits for its next one, so that it stays at its
    /// place against SYNC0.
    pub fn leave_out(&mut self, cycles: u64) {
        self.cycle += cycles;
    }

    /// The DC time that this cycle's frame shall write to the reference clock; without one it isn't written.
    /// Only with [`crate::image::ClockUse::Steer`].
    pub fn steer_clock(&mut self, time: Option<DcTime>) {
        let (Some(number), Some(frame)) = (self.steer_slot, self.exchanger.frames.first_mut()) else {
            return;
        };
        let time = time.filter(|_| !self.reference_is_unset);
        frame.set_command(number, if time.is_some() { Command::Fpwr } else { Command::Nop });
        let range = frame.slots()[number].data();
        let bytes = time.unwrap_or_default().0.to_le_bytes();
        let data = frame.data_mut(range);
        let length = data.len().min(bytes.len());
        data[..length].copy_from_slice(&bytes[..length]);
    }

    /// Queues work beside the cycle; gives it back where [`super::CAPACITY`] is reached.
    pub fn submit(&mut self, request: AcyclicRequest) -> Result<(), AcyclicRequest> {
        self.acyclic.submit(request)
    }

    /// Takes work that has ended.
    pub fn poll_completion(&mut self) -> Option<AcyclicCompletion> {
        self.acyclic.poll()
    }

    /// Makes ready what is done for one SubDevice alone, as set-up left it, in place of what was ready before: its SDOs in
    /// SAFE-OP, and what [`CyclicBus::recover`] needs.
    ///
    /// [`crate::Bus::into_cyclic`] has done it for all of them. Not for the cycle: it allocates.
    pub fn prepare(&mut self, subdevice: &SubDevice) {
        let turn = self.plan.turns.get(usize::from(subdevice.position)).copied().unwrap_or_default();
        self.acyclic.prepare(subdevice, turn);
    }

    /// Begins to bring one SubDevice back to OP beside the cycle, as its start-up list says; all others go on.
    ///
    /// Its outputs must be safe until the application enables it again. `false` where it is on its way already,
    /// where no way was prepared, and where the ends of as many ways as there are SubDevices wait to be taken. For the cycle: neither this nor the way itself asks for memory.
    pub fn recover(&mut self, position: u16) -> bool {
        let begun = self.acyclic.recover(position);
        self.set_leeway();
        begun
    }

    /// Ends a way back on which nothing was changed yet: the SubDevice is operational again by itself. `false` where there is
    /// none, or where it has to go on to its end.
    pub fn call_off(&mut self, position: u16) -> bool {
        let is_called_off = self.acyclic.call_off(position);
        self.set_leeway();
        is_called_off
    }

    /// Takes the end of a way back: the SubDevice's position, and how it was found or why it isn't in OP again.
    pub fn poll_recovered(&mut self) -> Option<(u16, Result<Comeback, RecoveryError>)> {
        let recovered = self.acyclic.poll_recovered();
        if recovered.is_some() {
            self.set_leeway();
        }
        recovered
    }

    /// What those on their way back may add to each working counter.
    fn set_leeway(&mut self) {
        for (frame, plan) in self.exchanger.frames.iter_mut().zip(&self.plan.frames) {
            for (slot, datagram) in frame.slots_mut().iter_mut().zip(&plan.datagrams) {
                let coming =
                    datagram.touches.iter().filter(|touch| self.acyclic.is_recovering(touch.position));
                slot.leeway = coming.map(|touch| touch.count).sum();
            }
        }
    }

    /// Takes an emergency and the position of the SubDevice that sent it.
    pub fn take_emergency(&mut self) -> Option<(u16, ReceivedEmergency)> {
        self.acyclic.take_emergency()
    }

    /// A SubDevice's mailbox, for its counters.
    pub fn mailbox(&self, position: u16) -> Option<&Mailbox> {
        self.acyclic.mailbox(position)
    }

    /// The link, for its own figures.
    pub fn link(&self) -> &L {
        &self.exchanger.link
    }

    /// The link, to change it between two exchanges.
    pub fn link_mut(&mut self) -> &mut L {
        &mut self.exchanger.link
    }

    /// Ends cyclic exchange; gives back the link and the mailboxes.
    pub fn into_parts(self) -> (L, CyclicParts) {
        let mailboxes = self.acyclic.into_mailboxes().collect();
        (self.exchanger.link, CyclicParts { members: self.members, plan: self.plan, mailboxes })
    }
}
