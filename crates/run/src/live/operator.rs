//! Who commands the robot: emergency stop, then a person's stick, then the autonomous reference.
//!
//! The operator turns what many clients ask into the one request that a cycle takes. It is a plain struct without
//! clock, queue or allocation: the same commands at the same cycles give the same requests.

mod authors;
mod looked_after;
mod sticks;
mod stops;

use omnibase_robot::signals::{
    AxisAsk, Batch, CycleRecord, Phase, RequestAnswer, SafetyReason, StopCategory,
};
use omnibase_robot::stages::Reference;
use omnibase_robot::{Request, RequestKind};

use omnibase_cia402::ErrorCode;
use omnibase_robot::config::ComebackPlan;

use crate::conductor::{Conductor, Wish};

use self::authors::Authors;
use self::sticks::{STICKS, Stick, client_of, stick_of};
use super::command::{
    Answer, Ask, Client, Command, Commander, JoystickState, MAX_SESSIONS, Refusal, StickWish, begins,
    begins_motion, is_of_a_leader, leads, redirects,
};
use super::stamp::{BEGINNING_AGE_NS, Stamp, begins_or_allows};

/// Requests that can wait for their cycle.
const MOST_WAITING: usize = 64;
/// While a stick drives, other requests get every so many-th cycle.
const SHARE_OF_OTHERS: u64 = 4;

/// How long clients may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ages {
    /// A stick that drives, ns.
    pub stick_ns: u64,
    /// A page whose motion is under way, ns.
    pub session_ns: u64,
}

/// What happened, for people to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Note {
    /// In words.
    pub text: &'static str,
    /// Whom it is about; `None` for nobody alone.
    pub client: Option<Client>,
}

/// What the operator wants of a cycle.
#[derive(Default)]
pub struct Turn {
    /// The cycle's request.
    pub request: Option<Request>,
    /// A reference to offer to the robot before the cycle.
    pub offer: Option<(u32, Box<dyn Reference>)>,
}

/// One request that waits for its cycle.
struct Waiting {
    client: Client,
    ticket: u64,
    kind: RequestKind,
    /// In which cycle it comes too late.
    valid_until_ns: u64,
    reference: Option<(u32, Box<dyn Reference>)>,
    is_on_behalf: bool,
}

/// Answers that wait to be read.
const MOST_ANSWERS: usize = 4 * MOST_WAITING;
/// Notes that wait to be read.
const MOST_NOTES: usize = 16;

/// Arbitrates between clients.
pub struct Operator {
    ages: Ages,
    emergency_category: StopCategory,
    /// The run follows its plan: people may stop it, and change settings and obstacles.
    is_beside_plan: bool,
    sticks: [Stick; STICKS],
    /// When each page was heard last; `None` where there is no such session.
    sessions: [Option<u64>; MAX_SESSIONS],
    commander: Commander,
    /// What it leads is a way to a pose: nothing that could be gone on with after a loss.
    is_on_way: bool,
    is_emergency: bool,
    /// Something else than letting go and a program's silence stopped the robot, and nobody enabled programs since.
    programs_wait: bool,
    /// Why the robot stopped, as it said last.
    stop_reason: SafetyReason,
    stop: Option<(StopCategory, Client, u64)>,
    waiting: std::collections::VecDeque<Waiting>,
    /// The next of the values that were heard last and belong together.
    next_of_batch: Option<Batch>,
    asked: Option<(Client, u64, RequestKind)>,
    /// What comes by itself after a loss; `None`: a person goes on.
    comeback_plan: Option<ComebackPlan>,
    /// Whose motion a loss may end, or ended, and how far the way back from it is.
    comeback: Option<(Client, Conductor)>,
    authors: Authors,
    /// References that were loaded on somebody's behalf, of those that are followed or begun next, and the last one; 0: none.
    looked_after: [u32; 3],
    answers: Vec<(u64, Answer)>,
    notes: Vec<Note>,
    /// References that won't be offered; dropping them is not the cycle's work.
    discarded: Vec<Box<dyn Reference>>,
    cycle: u64,
}

impl Operator {
    /// An operator whom nobody commands yet.
    pub fn new(ages: Ages, emergency_category: StopCategory) -> Self {
        Operator {
            ages,
            emergency_category,
            is_beside_plan: false,
            sticks: [Stick::default(); STICKS],
            sessions: [None; MAX_SESSIONS],
            commander: Commander::Nobody,
            is_on_way: false,
            is_emergency: false,
            programs_wait: false,
            stop_reason: SafetyReason::None,
            stop: None,
            waiting: std::collections::VecDeque::with_capacity(MOST_WAITING),
            next_of_batch: None,
            asked: None,
            comeback_plan: None,
            comeback: None,
            authors: Authors::default(),
            looked_after: [0; 3],
            answers: Vec::with_capacity(MOST_ANSWERS),
            notes: Vec::with_capacity(MOST_NOTES),
            discarded: Vec::with_capacity(MOST_WAITING),
            cycle: 0,
        }
    }

    /// From now on the run follows its plan, and nobody leads it.
    pub fn stand_beside_plan(&mut self) {
        self.is_beside_plan = true;
    }

    /// Whether the run follows its plan.
    pub fn is_beside_plan(&self) -> bool {
        self.is_beside_plan
    }

    /// Sees a cycle in which the plan asks for something itself.
    pub fn look_on(&mut self, last: &CycleRecord, phase: Phase) {
        self.settle(last, phase);
    }

    /// What comes by itself from now on after a loss that ended a motion.
    pub fn comes_back(&mut self, plan: Option<ComebackPlan>) {
        self.comeback_plan = plan;
    }

    /// A drive said by an emergency what is wrong with it.
    pub fn drive_said(&mut self, wheel: usize, error: ErrorCode) {
        self.comeback.iter_mut().for_each(|(_, conductor)| conductor.drive_said(wheel, error));
    }

    /// In how many s the robot moves again without a person; `None` where it doesn't.
    pub fn moves_again_in_s(&self, now_ns: u64) -> Option<f64> {
        self.comeback.as_ref()?.1.moves_again_in_s(now_ns)
    }

    /// Who commands.
    pub fn commander(&self) -> Commander {
        self.commander
    }

    /// Whether the emergency stop is set.
    pub fn is_emergency(&self) -> bool {
        self.is_emergency
    }

    /// Whether a client's stick is blocked until a person enables it.
    pub fn is_blocked(&self, client: Client) -> bool {
        stick_of(client).is_some_and(|stick| self.waits_to_be_enabled(&self.sticks[stick]))
    }

    /// Sticks that are blocked, as bits: bit 0 the joystick's, then the pages'.
    pub fn blocked_bits(&self) -> u64 {
        let blocked = self.sticks.iter().map(|stick| u64::from(self.waits_to_be_enabled(stick)));
        blocked.enumerate().fold(0, |bits, (n, blocked)| bits | blocked << n)
    }

    /// What has become of the joystick at the robot's computer.
    pub fn joystick(&self) -> JoystickState {
        let stick = &self.sticks[0];
        match stick.wish {
            None if stick.is_blocked => JoystickState::Lost,
            None => JoystickState::Absent,
            Some(StickWish::Blocked) => JoystickState::Blocked,
            Some(_) if stick.is_blocked => JoystickState::Blocked,
            Some(_) => JoystickState::Present,
        }
    }

    /// The oldest of what happened since that was asked.
    pub fn take_note(&mut self) -> Option<Note> {
        (!self.notes.is_empty()).then(|| self.notes.remove(0))
    }

    /// What happened since it was last asked; emptied by reading.
    pub fn notes(&mut self) -> impl Iterator<Item = Note> + '_ {
        self.notes.drain(..)
    }

    /// References that are to be dropped elsewhere; emptied by reading.
    pub fn discarded(&mut self) -> impl Iterator<Item = Box<dyn Reference>> + '_ {
        self.discarded.drain(..)
    }

    /// Answers that are ready, with their tickets; emptied by reading.
    pub fn answers(&mut self) -> impl Iterator<Item = (u64, Answer)> + '_ {
        self.answers.drain(..)
    }

    /// Takes in a command, at the time of the coming cycle.
    pub fn hear(&mut self, now_ns: u64, command: Command) {
        let Command { client, ticket, ask, stamp } = command;
        let is_on_behalf = stamp == Stamp::OnBehalf;
        if !matches!(ask, Ask::Begun | Ask::Gone) {
            self.hear_page(now_ns, client, stamp);
        }
        let asked_ns = match stamp.judge(now_ns, &ask, self.ages.stick_ns) {
            Ok(asked_ns) => asked_ns,
            Err(refusal) => {
                if matches!(ask, Ask::Stick(_)) {
                    self.stick_refused(client, refusal);
                }
                return self.answer(ticket, Answer::Refused(refusal));
            }
        };
        if is_on_behalf && matches!(ask, Ask::Robot(_)) && begins_or_allows(&ask) && !self.is_there(client) {
            return self.answer(ticket, Answer::Refused(Refusal::Stopped));
        }
        if self.is_beside_plan && is_of_a_leader(&ask) {
            if let Ask::Load { reference, .. } = ask {
                self.discard(reference);
            }
            return self.answer(ticket, Answer::Refused(Refusal::Planned));
        }
        match ask {
            Ask::Alive => {}
            Ask::Begun => self.begun(now_ns, client),
            Ask::Gone => {
                self.gone(client);
                self.forget_stick(client);
            }
            Ask::PagesLost => self.pages_lost(),
            Ask::Stick(wish) => {
                self.take_wish(now_ns, client, wish, stamp);
                // Wishes come many times a second: the last one alone is answered.
                if wish == StickWish::Released {
                    self.answer(ticket, Answer::Done);
                }
            }
            Ask::EnableStick(of) => self.enable(client, ticket, of),
            Ask::RecoverStick => self.recover_stick(client),
            Ask::EndMotion => self.end_motion(client, ticket),
            Ask::EmergencyStop => {
                if !self.is_emergency {
                    self.say("emergency stop", client);
                }
                self.is_emergency = true;
                self.stop_asked(self.emergency_category, client, ticket);
            }
            Ask::ReleaseEmergencyStop => {
                if self.is_emergency {
                    self.say("the emergency stop is released", client);
                }
                self.is_emergency = false;
                self.answer(ticket, Answer::Done);
            }
            Ask::Robot(RequestKind::Stop(category)) => self.stop_asked(category, client, ticket),
            Ask::Robot(RequestKind::Axis { device, ask: AxisAsk::Stop }) => {
                self.stop_axis(device, client, ticket);
            }
            Ask::Robot(RequestKind::Velocity { .. }) => {
                self.answer(ticket, Answer::Refused(Refusal::NotAStick));
            }
            Ask::Robot(kind) => {
                let valid_until_ns =
                    if begins(&kind) { asked_ns.saturating_add(BEGINNING_AGE_NS) } else { u64::MAX };
                self.ask(Waiting { client, ticket, kind, valid_until_ns, reference: None, is_on_behalf });
            }
            Ask::Load { number, reference } => {
                let kind = RequestKind::UseReference { number };
                let reference = Some((number, reference));
                let valid_until_ns = u64::MAX;
                self.ask(Waiting { client, ticket, kind, valid_until_ns, reference, is_on_behalf });
            }
        }
    }

    /// What to ask in the coming cycle, from the last one and the phase after it.
    pub fn turn(&mut self, now_ns: u64, last: &CycleRecord, phase: Phase) -> Turn {
        self.cycle += 1;
        self.settle(last, phase);
        self.look_for_losses(now_ns, phase);
        self.keep_emergency(phase);
        if let Some((category, client, ticket)) = self.stop.take() {
            self.comeback = None;
            // What was asked before a stop must not begin after it.
            self.drop_waiting(|waiting| begins(&waiting.kind));
            return self.send(client, ticket, RequestKind::Stop(category), u64::MAX);
        }
        if let Some((client, ticket, kind)) = self.authors.next_end() {
            // A way back is looked after meanwhile.
            self.comeback.iter_mut().for_each(|(_, conductor)| conductor.watch(last, phase));
            return self.send(client, ticket, kind, u64::MAX);
        }
        if let Some(client) = self.driver(phase) {
            let others_turn = self.cycle.is_multiple_of(SHARE_OF_OTHERS) && !self.waiting.is_empty();
            if !others_turn && let Some(turn) = self.drive(client) {
                self.comeback = None;
                return turn;
            }
        }
        let turn = self.next_waiting(last);
        match turn.request {
            Some(request) if leads(&request.kind) => self.comeback = None,
            Some(_) => self.comeback.iter_mut().for_each(|(_, conductor)| conductor.watch(last, phase)),
            None => return self.come_back(last, phase).unwrap_or_default(),
        }
        turn
    }

    /// Where a lost SubDevice ended a motion and nothing else happened since: what leads back to it.
    fn come_back(&mut self, last: &CycleRecord, phase: Phase) -> Option<Turn> {
        let plan = self.comeback_plan?;
        if let (Commander::Reference(client @ Client::Page(_)), Phase::Tracking) = (self.commander, phase)
            && !self.is_on_way
            && !self.is_looked_after(last)[0]
        {
            // A page is somebody living; what a command began nobody may stand beside.
            let (_, conductor) = self.comeback.get_or_insert_with(|| (client, Conductor::following(plan)));
            conductor.next(last, phase, Wish::GoOn);
            return None;
        }
        let (client, mut conductor) = self.comeback.take()?;
        // Whoever takes a stick in hand leads from there; and one that was lost was somebody's who watched.
        if self.is_emergency || self.sticks.iter().any(Stick::is_held) || self.has_lost_stick() {
            return None;
        }
        let kind = conductor.next(last, phase, Wish::GoOn);
        if let Some(note) = conductor.take_note() {
            self.say(note, client);
        }
        self.comeback = conductor.is_coming_back().then_some((client, conductor));
        Some(self.send(client, 0, kind?, u64::MAX))
    }

    /// Whether a page is there; who has no session always is.
    fn is_there(&self, client: Client) -> bool {
        let Client::Page(number) = client else { return true };
        self.sessions.get(usize::from(number)).is_some_and(Option::is_some)
    }

    /// Whether the joystick is lost or blocked, or that of a page that is there.
    fn has_lost_stick(&self) -> bool {
        let living = self.sticks[1..].iter().zip(&self.sessions).filter(|(_, session)| session.is_some());
        self.sticks[0].is_blocked || living.into_iter().any(|(stick, _)| stick.is_blocked)
    }

    /// The answer to what was asked in the cycle before, and the end of what it commanded.
    fn settle(&mut self, last: &CycleRecord, phase: Phase) {
        self.see_stop(last);
        if let Some((client, ticket, kind)) = self.asked.take() {
            self.answer(ticket, Answer::Robot(last.answer));
            if last.answer == RequestAnswer::Taken {
                self.authors.note(&kind, client);
            }
            if begins_motion(&kind) && last.answer == RequestAnswer::Taken {
                self.commander = Commander::Reference(client);
                self.is_on_way = matches!(kind, RequestKind::GoTo { .. });
            }
        }
        if !matches!(phase, Phase::Tracking | Phase::Stopping) {
            self.commander = Commander::Nobody;
        }
    }

    /// As long as the emergency stop is set nothing moves, whatever was under way to the robot when it was set.
    fn keep_emergency(&mut self, phase: Phase) {
        let holds = self.emergency_category == StopCategory::RampAndHold;
        let moves = match phase {
            Phase::Enabling | Phase::Tracking => true,
            Phase::Holding => !holds,
            Phase::Disabled | Phase::Stopping | Phase::QuickStopping | Phase::Fault => false,
        };
        if self.is_emergency && moves && self.stop.is_none() {
            self.stop_with(self.emergency_category, Client::Command, 0);
        }
    }

    /// The stick that drives, or shall: the joystick before pages; among pages who drives already.
    fn driver(&self, phase: Phase) -> Option<Client> {
        if self.is_emergency || !matches!(phase, Phase::Holding | Phase::Tracking) {
            return None;
        }
        let drives = |client: &Client| {
            let stick = self.sticks[stick_of(*client)?];
            let may = !stick.must_release && !self.waits_to_be_enabled(&stick);
            (stick.is_held() && may).then_some(*client)
        };
        let present = match self.commander {
            Commander::Stick(client) => drives(&client),
            Commander::Nobody | Commander::Reference(_) => None,
        };
        drives(&Client::Joystick).or(present).or_else(|| (1..STICKS).map(client_of).find_map(|c| drives(&c)))
    }

    /// The wish of a stick as the cycle's request.
    fn drive(&mut self, client: Client) -> Option<Turn> {
        let stick = self.sticks[stick_of(client)?];
        let Some(StickWish::Held { twist, frame }) = stick.wish else { return None };
        if self.commander != Commander::Stick(client) {
            self.say("drives by hand", client);
            self.commander = Commander::Stick(client);
        }
        let valid_until_ns = stick.heard_ns.saturating_add(self.ages.stick_ns);
        Some(self.send(client, 0, RequestKind::Velocity { twist, frame }, valid_until_ns))
    }

    fn next_waiting(&mut self, last: &CycleRecord) -> Turn {
        while let Some(waiting) = self.waiting.pop_front() {
            let kind = waiting.kind;
            let refusal = match self.commander {
                _ if begins(&kind) && self.is_emergency => Refusal::EmergencyStop,
                Commander::Stick(_) if begins_motion(&kind) => Refusal::Commanded,
                Commander::Reference(leader) if leader != waiting.client && redirects(&kind) => Refusal::Led,
                _ if self.is_anothers_to_begin(&waiting, last) => Refusal::LookedAfter,
                _ => {
                    self.look_after(&waiting, last);
                    let turn = self.send(waiting.client, waiting.ticket, kind, waiting.valid_until_ns);
                    return Turn { offer: waiting.reference, ..turn };
                }
            };
            self.refuse(waiting, refusal);
        }
        Turn::default()
    }

    fn send(&mut self, client: Client, ticket: u64, kind: RequestKind, valid_until_ns: u64) -> Turn {
        self.asked = Some((client, ticket, kind));
        Turn { request: Some(Request { kind, valid_until_ns }), offer: None }
    }

    fn ask(&mut self, waiting: Waiting) {
        let has_room = match waiting.kind {
            RequestKind::Set { batch, .. } => self.has_room_for(batch),
            _ => self.waiting.len() < MOST_WAITING,
        };
        if has_room {
            self.waiting.push_back(waiting);
        } else {
            self.refuse(waiting, Refusal::Busy);
        }
    }

    /// Values that belong together wait together, or none of them does.
    fn has_room_for(&mut self, batch: Batch) -> bool {
        let wanted = if batch.place() == 0 { usize::from(batch.size()) } else { 1 };
        let follows = batch.place() == 0 || self.next_of_batch == Some(batch);
        let has_room = follows && self.waiting.len() + wanted <= MOST_WAITING;
        self.next_of_batch = batch.next().filter(|_| has_room);
        has_room
    }

    fn refuse(&mut self, waiting: Waiting, refusal: Refusal) {
        self.answer(waiting.ticket, Answer::Refused(refusal));
        if let Some((_, reference)) = waiting.reference {
            self.discard(reference);
        }
    }

    fn discard(&mut self, reference: Box<dyn Reference>) {
        if self.discarded.len() < MOST_WAITING {
            self.discarded.push(reference);
        }
    }

    fn answer(&mut self, ticket: u64, answer: Answer) {
        if ticket != 0 && self.answers.len() < MOST_ANSWERS {
            self.answers.push((ticket, answer));
        }
    }

    fn say(&mut self, text: &'static str, client: impl Into<Option<Client>>) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push(Note { text, client: client.into() });
        }
    }
}
