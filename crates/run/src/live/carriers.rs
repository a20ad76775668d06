//! What crosses between the cycle's thread and everybody else; nothing of it ever waits in the cycle.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use omnibase_record::run::RunDescriber;
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::{Batch, Phase};
use omnibase_robot::stages::Reference;
use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::{Input, Output, triple_buffer};

use super::command::{Answer, Ask, Client, Command, MAX_SESSIONS};
use super::operator::{Ages, Note, Operator, Turn};
use super::snapshot::Snapshot;
use crate::channels::Say;
use crate::describe::reference_key;
use crate::events::Words;

/// Commands on their way.
const COMMANDS: usize = 256;
/// Of them, those that only stops and ends of sessions may take.
const KEPT_FOR_STOPS: usize = 32;
/// Answers, notes and points of the trace on their way.
const BACK: usize = 4096;
/// Between two points of the trace, ns.
const TRACE_NS: u64 = 10_000_000;
/// Points of the trace that are kept: those of [`TRACE_KEPT_S`].
const TRACE_KEPT: usize = 60_000;
/// As long as that the trace is kept, s.
pub const TRACE_KEPT_S: f64 = 600.0;
/// The longest time between two points that follow each other, s: some cycles may be left out, and no more.
const TRACE_STEP_S: f64 = 0.1;
/// Events and answers that are kept.
const KEPT: usize = 500;

/// One point of where the robot went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TracePoint {
    /// Time of the run, s.
    pub time_s: f64,
    /// Believed pose in odom: x, y in m, heading in rad.
    pub believed: [f64; 3],
    /// Setpoint, likewise.
    pub wished: [f64; 3],
    /// True pose, likewise; `None` on hardware.
    pub truth: Option<[f64; 3]>,
}

/// A part of the trace that isn't there.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "where the robot was from {from_s:.2} s to {until_s:.2} s is not known any more: {TRACE_KEPT_S} s are kept"
)]
pub struct TraceGap {
    /// Its begin, in time of the run, s.
    pub from_s: f64,
    /// Its end, s.
    pub until_s: f64,
}

/// Something that happened, with the client whom it is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveEvent {
    /// Its number, rising by one.
    pub number: u64,
    /// Time of the run, s.
    pub time_s: f64,
    /// In words.
    pub text: Words,
    /// Whom it is about; `None` for the robot itself.
    pub client: Option<Client>,
}

/// What the cycle's thread sends back.
enum Back {
    Answer(u64, Answer),
    Event {
        time_ns: u64,
        text: Words,
        client: Option<Client>,
    },
    Trace(TracePoint),
    /// To be dropped where dropping may take its time.
    Reference(Box<dyn Reference>),
}

/// The ends of one robot's live operation.
pub fn live(ages: Ages, emergency: omnibase_robot::signals::StopCategory) -> (Live, LiveEnd) {
    let (commands, inbox) = RingBuffer::new(COMMANDS);
    let (back, from_cycle) = RingBuffer::new(BACK);
    let (input, output) = triple_buffer(&Snapshot::default());
    let shared = Shared {
        commands: Mutex::new(commands),
        seen: Mutex::new(Seen {
            output,
            from_cycle,
            events: VecDeque::new(),
            answers: VecDeque::new(),
            trace: VecDeque::new(),
            next_event: 1,
        }),
        references: Mutex::new(BTreeMap::new()),
        describer: Mutex::new(None),
        next_reference: AtomicU32::new(1),
        next_ticket: AtomicU64::new(1),
        next_batch: AtomicU16::new(0),
        sessions: Mutex::new([false; MAX_SESSIONS]),
    };
    let end = LiveEnd {
        operator: Operator::new(ages, emergency),
        inbox,
        back,
        snapshot: input,
        reference: 0,
        reference_start: None,
        goal: None,
        last_trace_ns: None,
        unsent: None,
    };
    (Live { shared: Arc::new(shared) }, end)
}

/// Everybody else's end; clones talk to the same robot. Methods may wait for each other, never for the cycle.
#[derive(Clone)]
pub struct Live {
    shared: Arc<Shared>,
}

struct Shared {
    commands: Mutex<Producer<Command>>,
    seen: Mutex<Seen>,
    references: Mutex<BTreeMap<u32, ReferenceTable>>,
    describer: Mutex<Option<RunDescriber>>,
    next_reference: AtomicU32,
    next_ticket: AtomicU64,
    next_batch: AtomicU16,
    sessions: Mutex<[bool; MAX_SESSIONS]>,
}

struct Seen {
    output: Output<Snapshot>,
    from_cycle: Consumer<Back>,
    events: VecDeque<LiveEvent>,
    answers: VecDeque<(u64, Answer)>,
    trace: VecDeque<TracePoint>,
    next_event: u64,
}

/// A guard whose holder panicked still guards whole values.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

impl Live {
    /// A session for a page; `None` where all are taken. It ends with [`Live::end_session`], or by silence.
    pub fn begin_session(&self) -> Option<Client> {
        let mut sessions = lock(&self.shared.sessions);
        let number = sessions.iter().position(|taken| !taken)?;
        let client = Client::Page(number as u8);
        self.send(client, Ask::Begun)?;
        sessions[number] = true;
        Some(client)
    }

    /// Ends a session: the motion that it commands stops.
    pub fn end_session(&self, client: Client) {
        if let Client::Page(number) = client {
            self.send(client, Ask::Gone);
            if let Some(taken) = lock(&self.shared.sessions).get_mut(usize::from(number)) {
                *taken = false;
            }
        }
    }

    /// The server of all pages is no more: their sessions end, and what they command stops.
    pub fn lose_pages(&self) {
        self.send(Client::Command, Ask::PagesLost);
        *lock(&self.shared.sessions) = [false; MAX_SESSIONS];
    }

    /// Sends a command; the ticket by which its answer will be found, or `None` where the cycle takes no more.
    pub fn send(&self, client: Client, ask: Ask) -> Option<u64> {
        let ticket = self.ticket();
        let mut commands = lock(&self.shared.commands);
        // However much is asked: a stop finds room.
        if commands.slots() <= KEPT_FOR_STOPS && !ask.stops() {
            return None;
        }
        commands.push(Command { client, ticket, ask }).ok()?;
        Some(ticket)
    }

    /// Sends settings, by their index, that are to act in one cycle, all of them or none; the ticket of their answer,
    /// or `None` where the cycle takes no more, or there are none or too many of them.
    pub fn set(&self, client: Client, values: &[(u32, f64)]) -> Option<u64> {
        let number = self.shared.next_batch.fetch_add(1, Ordering::Relaxed);
        // Nobody's command comes between them.
        let mut commands = lock(&self.shared.commands);
        if commands.slots() < values.len() + KEPT_FOR_STOPS {
            return None;
        }
        let mut batch = Some(Batch::new(number, values.len().try_into().ok()?)?);
        let mut ticket = 0;
        for &(index, value) in values {
            let ask = Ask::Robot(RequestKind::Set { index, value, batch: batch? });
            batch = batch?.next();
            // The last one's answer is that of all.
            ticket = if batch.is_none() { self.ticket() } else { 0 };
            commands.push(Command { client, ticket, ask }).ok()?;
        }
        Some(ticket)
    }

    fn ticket(&self) -> u64 {
        self.shared.next_ticket.fetch_add(1, Ordering::Relaxed)
    }

    /// Sends a reference with the table it was made of, which recordings keep; its number and ticket.
    pub fn load(
        &self,
        client: Client,
        table: ReferenceTable,
        reference: Box<dyn Reference>,
    ) -> Option<(u32, u64)> {
        let number = self.shared.next_reference.fetch_add(1, Ordering::Relaxed);
        if let Some(describer) = &*lock(&self.shared.describer)
            && let Ok(text) = toml::to_string(&table)
        {
            describer.describe(reference_key(number), text);
        }
        lock(&self.shared.references).insert(number, table);
        Some((number, self.send(client, Ask::Load { number, reference })?))
    }

    /// From now on the recording is told of references, without which it can't be computed again.
    pub fn describe_to(&self, describer: RunDescriber) {
        *lock(&self.shared.describer) = Some(describer);
    }

    /// The tables of all references that were loaded, by their numbers.
    pub fn references(&self) -> BTreeMap<u32, ReferenceTable> {
        lock(&self.shared.references).clone()
    }

    /// The latest of everything.
    pub fn snapshot(&self) -> Snapshot {
        *self.seen().output.read()
    }

    /// The answer to a command, once it is there.
    pub fn answer(&self, ticket: u64) -> Option<Answer> {
        self.seen().answers.iter().find(|(of, _)| *of == ticket).map(|(_, answer)| *answer)
    }

    /// Events with a number above `after`, oldest first; as many as are kept.
    pub fn events_after(&self, after: u64) -> Vec<LiveEvent> {
        self.seen().events.iter().filter(|event| event.number > after).copied().collect()
    }

    /// The trace since a time of the run, s.
    pub fn trace_since(&self, time_s: f64) -> Vec<TracePoint> {
        let seen = self.seen();
        let first = seen.trace.partition_point(|point| point.time_s <= time_s);
        seen.trace.range(first..).copied().collect()
    }

    /// The trace since a time of the run, s, where none of it is missing.
    pub fn whole_trace_since(&self, time_s: f64) -> Result<Vec<TracePoint>, TraceGap> {
        let trace = self.trace_since(time_s);
        let mut last_s = time_s;
        for point in &trace {
            if point.time_s > last_s + TRACE_STEP_S {
                return Err(TraceGap { from_s: last_s, until_s: point.time_s });
            }
            last_s = point.time_s;
        }
        Ok(trace)
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        let mut seen = lock(&self.shared.seen);
        while let Ok(back) = seen.from_cycle.pop() {
            match back {
                Back::Answer(ticket, answer) => push_kept(&mut seen.answers, KEPT, (ticket, answer)),
                Back::Event { time_ns, text, client } => {
                    let event =
                        LiveEvent { number: seen.next_event, time_s: time_ns as f64 * 1e-9, text, client };
                    seen.next_event += 1;
                    push_kept(&mut seen.events, KEPT, event);
                }
                Back::Trace(point) => push_kept(&mut seen.trace, TRACE_KEPT, point),
                Back::Reference(reference) => drop(reference),
            }
        }
        seen
    }
}

fn push_kept<T>(list: &mut VecDeque<T>, most: usize, value: T) {
    if list.len() == most {
        list.pop_front();
    }
    list.push_back(value);
}

/// The cycle's end: takes commands in, gives one request a cycle, shows the latest. Neither waits nor allocates.
pub struct LiveEnd {
    operator: Operator,
    inbox: Consumer<Command>,
    back: Producer<Back>,
    snapshot: Input<Snapshot>,
    reference: u32,
    reference_start: Option<omnibase_robot::signals::Setpoint>,
    goal: Option<omnibase_platform::Pose2>,
    last_trace_ns: Option<u64>,
    /// A reference for which there was no room on the way back; kept, for dropping it would free memory.
    unsent: Option<Box<dyn Reference>>,
}

impl LiveEnd {
    /// What to ask in the coming cycle, at its time, from the last snapshot's record and phase.
    pub fn turn(&mut self, now_ns: u64, last: &omnibase_robot::CycleRecord, phase: Phase) -> Turn {
        // As many as were there at the beginning: a flood doesn't hold the cycle up.
        for _ in 0..self.inbox.slots() {
            let Ok(command) = self.inbox.pop() else { break };
            self.operator.hear(now_ns, command);
        }
        let turn = self.operator.turn(now_ns, last, phase);
        for (ticket, answer) in self.operator.answers() {
            let _ = self.back.push(Back::Answer(ticket, answer));
        }
        for reference in self.operator.discarded() {
            give_back(&mut self.back, &mut self.unsent, reference);
        }
        turn
    }

    /// From now on a motion that a lost SubDevice ended goes on when that is back within so many ns.
    pub fn resume_within(&mut self, within_ns: Option<u64>) {
        self.operator.resume_within(within_ns);
    }

    /// Who has the say.
    pub fn say(&self) -> Say {
        Say {
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
            Some(RequestKind::UseReference { number }) => {
                (self.reference, self.reference_start) = (number, None);
            }
            Some(RequestKind::GoTo { odom_from_body }) => self.goal = Some(odom_from_body),
            _ => {}
        }
        *self.snapshot.input_buffer_mut() = Snapshot {
            reference: self.reference,
            reference_start: self.reference_start,
            goal: self.goal,
            ..*snapshot
        };
        self.snapshot.publish();
        let now_ns = record.time.now_ns;
        if self.last_trace_ns.is_none_or(|last_ns| now_ns >= last_ns + TRACE_NS) {
            self.last_trace_ns = Some(now_ns);
            let numbers = |pose: omnibase_platform::Pose2| [pose.x_m, pose.y_m, pose.heading_rad];
            let point = TracePoint {
                time_s: now_ns as f64 * 1e-9,
                believed: numbers(record.state.odom_from_body),
                wished: numbers(record.setpoint.odom_from_body),
                truth: snapshot.beside.truth.map(|truth| numbers(truth.odom_from_body)),
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

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::signals::StopCategory;

    /// A robot was looked at in every one of these cycles of 10 ms.
    fn traced(cycles: impl Iterator<Item = u64>) -> Live {
        let (live, mut end) = live(Ages { pad_ns: 1, session_ns: 1 }, StopCategory::RampAndHold);
        let mut snapshot = Snapshot::default();
        for cycle in cycles {
            snapshot.record.time.now_ns = cycle * TRACE_NS;
            end.show(&snapshot);
            live.snapshot();
        }
        live
    }

    #[test]
    fn a_trace_whose_beginning_or_middle_is_missing_is_refused_in_words() {
        let kept = TRACE_KEPT as u64;
        let live = traced(0..kept + 500);
        assert_eq!(live.whole_trace_since(10.0).unwrap().len(), TRACE_KEPT - 501);
        let gap = live.whole_trace_since(2.0).unwrap_err();
        assert!((gap.from_s, gap.until_s) == (2.0, 5.0), "{gap}");
        assert!(
            gap.to_string().contains("from 2.00 s to 5.00 s") && gap.to_string().contains("600 s"),
            "{gap}"
        );
        // A few cycles that were left out are no gap.
        let live = traced((0..100).chain(105..200));
        assert_eq!(live.whole_trace_since(0.5).unwrap().len(), 144);
        let live = traced((0..100).chain(150..200));
        assert!((live.whole_trace_since(0.5).unwrap_err().from_s - 0.99).abs() < 1e-9);
    }
}
