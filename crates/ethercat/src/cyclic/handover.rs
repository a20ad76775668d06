//! From set-up to cycle.

use alloc::vec::Vec;

use super::{CyclicBus, CyclicParts};
use crate::bus::Bus;
use crate::clock_setup::reference_clock;
use crate::image::{ClockUse, ImagePlan, Member, PlanError};
use crate::subdevice::SubDevice;
use crate::transaction::Access;
use crate::wire::{Clock, Link, register};

/// Who follows whom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockDirection {
    /// The cycle follows the reference clock, see [`super::DcFollower`].
    #[default]
    CycleFollowsDc,
    /// The reference clock follows the host, see [`super::HostToDc`].
    DcFollowsHost,
    /// Nobody: no clock is distributed.
    NoClock,
}

/// A segment that left set-up.
#[derive(Debug)]
pub struct Handover<L, C> {
    /// The cycle; every SubDevice is in PRE-OP and configured.
    pub bus: CyclicBus<L>,
    /// The clock that set-up used.
    pub clock: C,
    /// What was found and configured, by position.
    pub subdevices: Vec<SubDevice>,
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// Ends set-up, behind [`Bus::configure`]: from here on frames go round at the cycle.
    ///
    /// The first SubDevice with a distributed clock is the reference; without any no clock is distributed.
    pub fn into_cyclic(self, direction: ClockDirection) -> Result<Handover<L, C>, PlanError> {
        let Bus { mut transactor, subdevices, mailboxes, .. } = self;
        if let (Some(_), Some(last)) = (transactor.link.ring(), subdevices.last()) {
            let ports = Access::write("closing the ring", last.target(), register::DL_CONTROL_PORTS, &[0]);
            // Where that fails the ring stays as good as a line, and its state says so.
            let _ = transactor.perform_one(ports);
        }
        let members: Vec<Member> = subdevices.iter().map(Member::from).collect();
        let clock = match (reference_clock(&subdevices), direction) {
            (Some(one), _) if one.dc.is_none() => ClockUse::None,
            (Some(one), ClockDirection::CycleFollowsDc) => ClockUse::Distribute { reference: one.position },
            (Some(one), ClockDirection::DcFollowsHost) => ClockUse::Steer { reference: one.position },
            (Some(_), ClockDirection::NoClock) | (None, _) => ClockUse::None,
        };
        let plan = ImagePlan::new(&members, clock)?;
        let mut bus = CyclicBus::new(transactor.link, CyclicParts { members, plan, mailboxes });
        subdevices.iter().for_each(|one| bus.prepare(one));
        Ok(Handover { bus, clock: transactor.clock, subdevices })
    }
}
