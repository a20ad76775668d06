//! The robot's bus as a ring of two interfaces, and a break in it.

use std::cell::RefCell;
use std::rc::Rc;

use omnibase_ethercat::redundant::RedundantLink;
use omnibase_ethercat::wire::{HostTime, Link, LinkError, RingState};
use omnibase_ethercat_sim::{Fault, SimPort, VirtualClock, ring_in_process};
use omnibase_run::simulated;

use super::case::{Case, STATES};
use super::{CIRCLE, Expected, GOES_ON};
use crate::bench::{Bench, plan};

/// Both interfaces, so that a test and its session can have them.
#[derive(Clone)]
struct Ring(Rc<RefCell<RedundantLink<SimPort, SimPort, VirtualClock>>>);

impl Link for Ring {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.0.borrow_mut().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.0.borrow_mut().receive(buffer, deadline)
    }

    fn ring(&self) -> Option<RingState> {
        self.0.borrow().ring()
    }
}

/// The ring breaks behind the first drive: every exchange stays complete, and the break is named.
pub fn row() -> String {
    let cells = STATES.map(|state| {
        let plan = plan(CIRCLE);
        let (mut segment, machine) = simulated::segment(&plan).unwrap();
        segment.close_ring(2, 1).unwrap();
        let (primary, redundant, clock) = ring_in_process(segment);
        let port = primary.clone();
        let link = Ring(Rc::new(RefCell::new(RedundantLink::new(primary, redundant, clock.clone()))));
        let mut case = Case::new(Bench::behind(&plan, link, clock.clone()), machine, clock, state);
        let before = case.bench.session.figures();
        port.with_segment(|segment| segment.inject(1, Fault::CableCut { port: 0 })).unwrap();
        for _ in 0..GOES_ON {
            case.cycle();
            case.watch();
        }
        let after = case.bench.session.figures();
        let what = format!("a ring breaks, {state:?}");
        assert_eq!((before.ring_breaks, after.ring_breaks), (0, 1), "{what}: {:?}", case.bench.events);
        assert_eq!(before.frames_lost, after.frames_lost, "{what}");
        assert_eq!(before.working_counter_errors, after.working_counter_errors, "{what}");
        assert_eq!(case.bench.told("the ring is broken between").len(), 1, "{what}");
        case.judge(Expected::GoesOn, true, &what)
    });
    format!("| a ring breaks once | as a line | {} |\n", cells.join(" | "))
}
