//! The cycle's end of what crosses between its thread and everybody else.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_cia402::ErrorCode;
use omnibase_robot::config::ComebackPlan;
use omnibase_robot::signals::Phase;
use omnibase_robot::stages::Reference;
use omnibase_robot::{RequestKind, Robot};
use omnibase_session::Words;
use rtrb::{Consumer, Producer};
use triple_buffer::Input;

use super::super::acyclic::AcyclicEnd;
use super::super::command::{Client, Command};
use super::super::cycles::CycleEnd;
use super::super::operator::{Note, Operator, Turn};
use super::super::snapshot::Snapshot;
use super::super::sources::SourceEnds;
use super::super::trace::TracePoint;
use super::{BACK, Back};
use crate::channels::Authority;

/// Between two points of the trace, ns.
const TRACE_NS: u64 = 10_000_000;

/// The cycle's end: takes commands in, gives one request a cycle, shows the latest. Neither waits nor allocates.
pub struct LiveEnd {
    pub(super) operator: Operator,
    pub(super) inbox: Consumer<Command>,
    pub(super) back: Producer<Back>,
    pub(super) snapshot: Input<Snapshot>,
    pub(super) clock_ns: Arc<AtomicU64>,
    pub(super) reference: u32,
    pub(super) reference_start: Option<omnibase_robot::signals::Setpoint>,
    pub(super) goal: Option<omnibase_platform::Pose2>,
    pub(super) last_trace_ns: Option<u64>,
    /// A reference for which there was no room on the way back; kept, for dropping it would free memory.
    pub(super) unsent: Option<Box<dyn Reference>>,
    pub(super) acyclic: AcyclicEnd,
    pub(super) sources: SourceEnds,
    pub(super) cycles: CycleEnd,
}

impl LiveEnd {
    /// What is asked of SubDevices beside the cycle.
    pub(crate) fn acyclic(&mut self) -> &mut AcyclicEnd {
        &mut self.acyclic
    }

    /// Gives the robot what other programs sent since the last cycle.
    pub(crate) fn hear(&mut self, robot: &mut Robot) {
        self.sources.hear(robot);
    }

    /// What to ask in the coming cycle, at its time, from the last snapshot's record and phase.
    pub fn turn(&mut self, now_ns: u64, last: &omnibase_robot::CycleRecord, phase: Phase) -> Turn {
        // As many as were there at the beginning: a flood doesn't hold the cycle up.
        for _ in 0..self.inbox.slots() {
            let Ok(command) = self.inbox.pop() else { break };
            self.operator.hear(now_ns, command);
        }
        let turn = self.operator.turn(now_ns, last, phase);
        self.send_answers();
        turn
    }

    /// In place of [`LiveEnd::turn`] in a cycle in which the plan asks for something itself: commands wait for the next one.
    pub fn look_on(&mut self, last: &omnibase_robot::CycleRecord, phase: Phase) {
        self.operator.look_on(last, phase);
        self.send_answers();
    }

    fn send_answers(&mut self) {
        for (ticket, answer) in self.operator.answers() {
            let _ = self.back.push(Back::Answer(ticket, answer));
        }
        for reference in self.operator.discarded() {
            give_back(&mut self.back, &mut self.unsent, reference);
        }
    }

    /// From now on the run follows its plan, and nobody leads it: people may stop it, and change settings and obstacles.
    pub fn stand_beside_plan(&mut self) {
        self.operator.stand_beside_plan();
    }

    /// Whether the run follows its plan.
    pub fn is_beside_plan(&self) -> bool {
        self.operator.is_beside_plan()
    }

    /// What comes by itself from now on after a loss that ended a motion.
    pub fn comes_back(&mut self, plan: Option<ComebackPlan>) {
        self.operator.comes_back(plan);
    }

    /// A drive said by an emergency what is wrong with it.
    pub fn drive_said(&mut self, wheel: usize, error: ErrorCode) {
        self.operator.drive_said(wheel, error);
    }

    /// In how many s the robot moves again without a person; `None` where it doesn't.
    pub fn moves_again_in_s(&self, now_ns: u64) -> Option<f64> {
        self.operator.moves_again_in_s(now_ns)
    }

    /// Who has the say.
    pub fn authority(&self) -> Authority {
        Authority {
            commander: self.operator.commander(),
            is_emergency: self.operator.is_emergency(),
            blocked_sticks: self.operator.blocked_bits(),
            joystick: self.operator.joystick(),
        }
    }

    /// Sends a reference that is no longer used to where it may be dropped.
    pub fn give_back(&mut self, reference: Box<dyn Reference>) {
        give_back(&mut self.back, &mut self.unsent, reference);
    }

    /// The oldest of what clients did and what became of them, to be [told](LiveEnd::tell).
    pub fn take_note(&mut self) -> Option<Note> {
        self.operator.take_note()
    }

    /// Tells everybody what happened, and whom it is about.
    pub fn tell(&mut self, time_ns: u64, text: Words, client: Option<Client>) {
        let _ = self.back.push(Back::Event { time_ns, text, client });
    }

    /// Shows the latest.
    pub fn show(&mut self, snapshot: &Snapshot) {
        use omnibase_robot::signals::RequestAnswer;
        let record = &snapshot.record;
        let taken = record.request.filter(|_| record.answer == RequestAnswer::Taken);
        match taken.map(|request| request.kind) {
            Some(RequestKind::Track) => self.reference_start = Some(record.wished),
            Some(RequestKind::GoTo { odom_from_body }) => self.goal = Some(odom_from_body),
            _ => {}
        }
        // One that was loaded may take its place in another cycle than that which asked for it.
        let is_begun = matches!(taken.map(|request| request.kind), Some(RequestKind::Track));
        let reference = record.reference as u32;
        if std::mem::replace(&mut self.reference, reference) != reference && !is_begun {
            self.reference_start = None;
        }
        *self.snapshot.input_buffer_mut() = Snapshot {
            reference: self.reference,
            is_looked_after: self.operator.is_looked_after(record),
            reference_start: self.reference_start,
            goal: self.goal,
            ..*snapshot
        };
        self.snapshot.publish();
        self.cycles.show(record, &snapshot.extras);
        let now_ns = record.time.now_ns;
        self.clock_ns.store(now_ns, Ordering::Relaxed);
        if self.last_trace_ns.is_none_or(|last_ns| now_ns >= last_ns + TRACE_NS) {
            self.last_trace_ns = Some(now_ns);
            let numbers = |pose: omnibase_platform::Pose2| [pose.x_m, pose.y_m, pose.heading_rad];
            let point = TracePoint {
                time_s: now_ns as f64 * 1e-9,
                believed: numbers(record.state.odom_from_body),
                wished: numbers(record.setpoint.odom_from_body),
                truth: snapshot.extras.truth.map(|truth| numbers(truth.odom_from_body)),
            };
            // Where nobody looks the trace ends here; answers keep their room.
            if self.back.slots() > BACK / 2 {
                let _ = self.back.push(Back::Trace(point));
            }
        }
    }
}

/// Where there is no room, one is kept and the rest stays with it for the run: nothing is freed in a cycle.
fn give_back(
    back: &mut Producer<Back>,
    unsent: &mut Option<Box<dyn Reference>>,
    reference: Box<dyn Reference>,
) {
    if let Err(rtrb::PushError::Full(Back::Reference(reference))) = back.push(Back::Reference(reference))
        && let Some(older) = unsent.replace(reference)
    {
        std::mem::forget(older);
    }
}
