//! What crosses between the cycle's thread and everybody else; nothing of it ever waits in the cycle.

mod cycle_end;

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

use omnibase_record::run::RunDescriber;
use omnibase_robot::RequestKind;
use omnibase_robot::config::{ReferenceTable, SourcePlan};
use omnibase_robot::signals::{Batch, Heard, StopCategory};
use omnibase_robot::stages::Reference;
use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::{Output, triple_buffer};

use super::acyclic::{AcyclicLine, acyclic};
use super::command::{Answer, Ask, Client, Command, MAX_SESSIONS, Refusal};
use super::cycles::{CycleLine, Following, cycles};
use super::operator::{Ages, Operator};
use super::points::PointList;
use super::snapshot::Snapshot;
use super::sources::{NotHeard, SourceCounts, SourceLines, source_lines};
use super::stamp::{BEGINNING_AGE_NS, Stamp, begins_or_allows};
use super::trace::{Trace, TraceGap, TracePoint};
use crate::channels::reference_key;
use omnibase_session::Words;

pub use cycle_end::LiveEnd;

/// Commands on their way.
const COMMANDS: usize = 256;
/// Of them, those that only stops and ends of sessions may take.
const KEPT_FOR_STOPS: usize = 32;
/// Answers, notes and points of the trace on their way.
const BACK: usize = 4096;
/// Events and answers that are kept.
const KEPT: usize = 500;

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

/// The ends of the live operation of one robot, to which these programs send inputs.
pub fn live(ages: Ages, emergency: StopCategory, sources: &[SourcePlan]) -> (Live, LiveEnd) {
    let (commands, inbox) = RingBuffer::new(COMMANDS);
    let (back, from_cycle) = RingBuffer::new(BACK);
    let (input, output) = triple_buffer(&Snapshot::default());
    let clock_ns = Arc::new(AtomicU64::new(0));
    let (acyclic_line, acyclic_end) = acyclic();
    let (source_lines, source_ends) = source_lines(sources);
    let (cycle_line, cycle_end) = cycles();
    let shared = Shared {
        commands: Mutex::new(Sending { commands, stops: 0, ended: [0; MAX_SESSIONS + 1] }),
        clock_ns: clock_ns.clone(),
        seen: Mutex::new(FromCycle {
            output,
            from_cycle,
            events: VecDeque::new(),
            answers: VecDeque::new(),
            trace: Trace::default(),
            dropped: Vec::new(),
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
        clock_ns,
        reference: 0,
        reference_start: None,
        goal: None,
        last_trace_ns: None,
        unsent: None,
        acyclic: acyclic_end,
        sources: source_ends,
        cycles: cycle_end,
    };
    (
        Live {
            shared: Arc::new(shared),
            acyclic: acyclic_line,
            sources: source_lines,
            cycles: cycle_line,
            points: PointList::default(),
        },
        end,
    )
}

/// Everybody else's end; clones talk to the same robot. Methods may wait for each other, never for the cycle.
#[derive(Clone)]
pub struct Live {
    shared: Arc<Shared>,
    acyclic: AcyclicLine,
    sources: SourceLines,
    cycles: CycleLine,
    pub(super) points: PointList,
}

/// Whom a command comes from, and when it was asked.
///
/// Whoever computes between hearing and sending takes it at hearing: what begins a motion is then refused where a stop
/// or a pause came between, or the end of the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asker {
    /// Who.
    pub client: Client,
    /// When.
    pub stamp: Stamp,
    /// Stops, pauses and ends of this session before it; `None`: it is sent as soon as it is asked.
    ends: Option<u64>,
}

impl From<Client> for Asker {
    fn from(client: Client) -> Self {
        Asker { client, stamp: Stamp::Here, ends: None }
    }
}

impl Asker {
    /// The same, who asked then.
    #[must_use]
    pub fn stamped(self, stamp: Stamp) -> Self {
        Asker { stamp, ..self }
    }
}

/// Where commands go, with what ended what was asked before.
struct Sending {
    commands: Producer<Command>,
    stops: u64,
    /// Of each session, and of the command line.
    ended: [u64; MAX_SESSIONS + 1],
}

impl Sending {
    /// Everything so far that ends what this client asked before it.
    fn ends(&self, client: Client) -> u64 {
        let ended = place(client).and_then(|place| self.ended.get(place));
        self.stops + ended.copied().unwrap_or(0)
    }
}

/// Where it is counted what a client ended.
fn place(client: Client) -> Option<usize> {
    match client {
        Client::Page(number) => Some(usize::from(number)),
        Client::Command => Some(MAX_SESSIONS),
        Client::Joystick => None,
    }
}

struct Shared {
    /// Held for a push only: stops go this way.
    commands: Mutex<Sending>,
    clock_ns: Arc<AtomicU64>,
    seen: Mutex<FromCycle>,
    references: Mutex<BTreeMap<u32, Loaded>>,
    describer: Mutex<Option<RunDescriber>>,
    next_reference: AtomicU32,
    next_ticket: AtomicU64,
    next_batch: AtomicU16,
    sessions: Mutex<[bool; MAX_SESSIONS]>,
}

/// What a reference was made of, and the ticket of the command that loads it.
struct Loaded {
    table: Arc<ReferenceTable>,
    ticket: u64,
}

struct FromCycle {
    output: Output<Snapshot>,
    from_cycle: Consumer<Back>,
    events: VecDeque<LiveEvent>,
    answers: VecDeque<(u64, Answer)>,
    trace: Trace,
    /// References to be dropped where nobody waits for it.
    dropped: Vec<Box<dyn Reference>>,
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

    /// The robot's own clock in its latest cycle, ns.
    pub fn clock_ns(&self) -> u64 {
        self.shared.clock_ns.load(Ordering::Relaxed)
    }

    /// A client that asks now for something that is sent later.
    pub fn asker(&self, client: Client, stamp: Stamp) -> Asker {
        Asker { client, stamp, ends: Some(lock(&self.shared.commands).ends(client)) }
    }

    /// Says something to everybody who looks at events, in words.
    pub fn tell(&self, text: &str, client: Option<Client>) {
        let time_s = self.snapshot().record.time.now_ns as f64 * 1e-9;
        self.seen(|seen| {
            let text = Words::new(format_args!("{text}"));
            let event = LiveEvent { number: seen.next_event, time_s, text, client };
            seen.next_event += 1;
            push_kept(&mut seen.events, KEPT, event);
        });
    }

    /// Sends a command; the ticket by which its answer will be found, or `None` where the cycle takes no more.
    pub fn send(&self, asker: impl Into<Asker>, ask: Ask) -> Option<u64> {
        let Asker { client, stamp, ends } = asker.into();
        let ticket = self.ticket();
        let mut sending = lock(&self.shared.commands);
        if ends.is_some_and(|ends| ends != sending.ends(client)) && begins_or_allows(&ask) {
            drop(sending);
            let refused = Answer::Refused(Refusal::Stopped);
            self.seen(|seen| push_kept(&mut seen.answers, KEPT, (ticket, refused)));
            return Some(ticket);
        }
        // However much is asked: a stop finds room, and however many stops of axes, one of the robot.
        let kept = if ask.stops_axis() { KEPT_FOR_STOPS / 2 } else { KEPT_FOR_STOPS };
        if sending.commands.slots() <= kept && !ask.stops() {
            return None;
        }
        match &ask {
            Ask::EmergencyStop | Ask::PagesLost | Ask::Robot(RequestKind::Stop(_)) => sending.stops += 1,
            // What looks after a way pauses it to plan another one.
            Ask::Robot(RequestKind::Pause) if stamp != Stamp::OnBehalf => sending.stops += 1,
            Ask::Gone | Ask::EndMotion => {
                if let Some(ended) = place(client).and_then(|place| sending.ended.get_mut(place)) {
                    *ended += 1;
                }
            }
            _ => {}
        }
        sending.commands.push(Command { client, ticket, ask, stamp }).ok()?;
        Some(ticket)
    }

    /// Sends settings, by their index, that are to act in one cycle, all of them or none; the ticket of their answer,
    /// or `None` where the cycle takes no more, or there are none or too many of them.
    pub fn set(&self, asker: impl Into<Asker>, values: &[(u32, f64)]) -> Option<u64> {
        let set = |batch, &(index, value): &(u32, f64)| RequestKind::Set { index, value, batch };
        self.send_batch(asker.into(), values, set)
    }

    /// Sends another fence's corners in odom, m, which is in force with the last one; as settings are sent.
    pub fn set_fence(&self, asker: impl Into<Asker>, corners_m: &[[f64; 2]]) -> Option<u64> {
        let set = |batch, corner_m: &[f64; 2]| RequestKind::SetFence { corner_m: *corner_m, batch };
        self.send_batch(asker.into(), corners_m, set)
    }

    fn send_batch<T>(
        &self,
        Asker { client, stamp, .. }: Asker,
        values: &[T],
        kind: impl Fn(Batch, &T) -> RequestKind,
    ) -> Option<u64> {
        let number = self.shared.next_batch.fetch_add(1, Ordering::Relaxed);
        // Nobody's command comes between them.
        let commands = &mut lock(&self.shared.commands).commands;
        if commands.slots() < values.len() + KEPT_FOR_STOPS {
            return None;
        }
        let mut batch = Some(Batch::new(number, values.len().try_into().ok()?)?);
        let mut ticket = 0;
        for value in values {
            let ask = Ask::Robot(kind(batch?, value));
            batch = batch?.next();
            // The last one's answer is that of all.
            ticket = if batch.is_none() { self.ticket() } else { 0 };
            commands.push(Command { client, ticket, ask, stamp }).ok()?;
        }
        Some(ticket)
    }

    fn ticket(&self) -> u64 {
        self.shared.next_ticket.fetch_add(1, Ordering::Relaxed)
    }

    /// Sends a reference with the table it was made of, which recordings keep; its number and ticket.
    pub fn load(
        &self,
        asker: impl Into<Asker>,
        table: ReferenceTable,
        reference: Box<dyn Reference>,
    ) -> Option<(u32, u64)> {
        // What became of the ones before: theirs may go.
        self.seen(|_| ());
        let describer = lock(&self.shared.describer).clone();
        let told = describer.and_then(|describer| Some((describer, toml::to_string(&table).ok()?)));
        // Held until it is sent: numbers reach the cycle in their order.
        let mut references = lock(&self.shared.references);
        let number = self.shared.next_reference.fetch_add(1, Ordering::Relaxed);
        if let Some((describer, text)) = told {
            describer.describe(reference_key(number), text);
        }
        let Some(ticket) = self.send(asker, Ask::Load { number, reference }) else {
            drop(references);
            self.forget_references([number]);
            return None;
        };
        references.insert(number, Loaded { table: Arc::new(table), ticket });
        Some((number, ticket))
    }

    /// From now on the recording is told of references, without which it can't be computed again.
    pub fn describe_to(&self, describer: RunDescriber) {
        *lock(&self.shared.describer) = Some(describer);
    }

    /// The tables of the loaded references that are in use or on their way, by their numbers.
    pub fn references(&self) -> BTreeMap<u32, Arc<ReferenceTable>> {
        self.seen(|_| ());
        let references = lock(&self.shared.references);
        references.iter().map(|(number, loaded)| (*number, loaded.table.clone())).collect()
    }

    /// The table of a reference that was loaded, by its number.
    pub fn reference(&self, number: u32) -> Option<Arc<ReferenceTable>> {
        lock(&self.shared.references).get(&number).map(|loaded| loaded.table.clone())
    }

    /// Drops the tables of references that nothing will use any more.
    fn loading_ended(&self, ticket: u64, answer: Answer) {
        let followed = self.seen(|seen| seen.output.read().reference);
        let mut references = lock(&self.shared.references);
        let Some(number) = references.iter().find(|(_, loaded)| loaded.ticket == ticket).map(|(n, _)| *n)
        else {
            return;
        };
        let over = if answer.is_done() {
            // It takes the place of all before it, but of one that is followed still.
            let mut over = std::mem::take(&mut *references);
            *references = over.split_off(&number);
            references.extend(over.remove_entry(&followed));
            over
        } else {
            BTreeMap::from_iter(references.remove_entry(&number))
        };
        // Freed where nobody waits for it.
        drop(references);
        self.forget_references(over.into_keys());
    }

    /// What is recorded from now on follows none of these.
    fn forget_references(&self, numbers: impl IntoIterator<Item = u32>) {
        let Some(describer) = lock(&self.shared.describer).clone() else { return };
        numbers.into_iter().for_each(|number| describer.forget(reference_key(number), self.clock_ns()));
    }

    /// Whether what was asked then is young enough to change the machine.
    pub fn check_age(&self, stamp: Stamp) -> Result<(), Refusal> {
        stamp.within(self.clock_ns(), BEGINNING_AGE_NS).map(drop)
    }

    /// Sends what another program says, by its place among the plan's sources: the latest counts in the next cycle.
    pub fn send_inputs(&self, source: usize, heard: &Heard) -> Result<(), NotHeard> {
        self.sources.send(source, heard, self.clock_ns())
    }

    /// What became of all that each program sent.
    pub fn source_counts(&self) -> Vec<SourceCounts> {
        self.sources.counts()
    }

    /// SDOs and registers of the robot's SubDevices.
    pub fn acyclic(&self) -> &AcyclicLine {
        &self.acyclic
    }

    /// Every cycle from now on; `None` where somebody follows already.
    pub fn follow(&self) -> Option<Following> {
        self.cycles.follow()
    }

    /// The latest of everything.
    pub fn snapshot(&self) -> Snapshot {
        self.seen(|seen| *seen.output.read())
    }

    /// The answer to a command, once it is there.
    pub fn answer(&self, ticket: u64) -> Option<Answer> {
        self.seen(|seen| seen.answers.iter().find(|(of, _)| *of == ticket).map(|(_, answer)| *answer))
    }

    /// Events with a number above `after`, oldest first; as many as are kept.
    pub fn events_after(&self, after: u64) -> Vec<LiveEvent> {
        self.seen(|seen| seen.events.iter().filter(|event| event.number > after).copied().collect())
    }

    /// The trace since a time of the run, s.
    pub fn trace_since(&self, time_s: f64) -> Vec<TracePoint> {
        // Copied where nobody waits for it.
        let trace = self.seen(|seen| seen.trace.shared());
        trace.since(time_s)
    }

    /// The trace since a time of the run, s, where none of it is missing.
    pub fn whole_trace_since(&self, time_s: f64) -> Result<Vec<TracePoint>, TraceGap> {
        let trace = self.trace_since(time_s);
        TraceGap::in_trace(&trace, time_s).map_or(Ok(trace), Err)
    }

    /// Looks at what came back from the cycle: for a moment, for stops' answers go this way too.
    fn seen<T>(&self, look: impl FnOnce(&mut FromCycle) -> T) -> T {
        let mut seen = lock(&self.shared.seen);
        let mut answered = Vec::new();
        while let Ok(back) = seen.from_cycle.pop() {
            match back {
                Back::Answer(ticket, answer) => {
                    answered.push((ticket, answer));
                    push_kept(&mut seen.answers, KEPT, (ticket, answer));
                }
                Back::Event { time_ns, text, client } => {
                    let event =
                        LiveEvent { number: seen.next_event, time_s: time_ns as f64 * 1e-9, text, client };
                    seen.next_event += 1;
                    push_kept(&mut seen.events, KEPT, event);
                }
                Back::Trace(point) => seen.trace.push(point),
                Back::Reference(reference) => seen.dropped.push(reference),
            }
        }
        let dropped = std::mem::take(&mut seen.dropped);
        let looked = look(&mut seen);
        drop(seen);
        drop(dropped);
        for (ticket, answer) in answered {
            self.loading_ended(ticket, answer);
        }
        looked
    }
}

fn push_kept<T>(list: &mut VecDeque<T>, most: usize, value: T) {
    if list.len() == most {
        list.pop_front();
    }
    list.push_back(value);
}
