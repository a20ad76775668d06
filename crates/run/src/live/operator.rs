//! Who commands the robot: emergency stop, then a person's stick, then the autonomous reference.
//!
//! The operator turns what many clients ask into the one request that a cycle takes. It is a plain struct without
//! clock, queue or allocation: the same commands at the same cycles give the same requests.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Batch, CycleRecord, Frame, Phase, RequestAnswer, StopCategory};
use omnibase_robot::stages::Reference;
use omnibase_robot::{Request, RequestKind};

use super::command::{
    Answer, Ask, Client, Command, Commander, MAX_SESSIONS, Pad, Refusal, StickState, begins_motion,
};

/// Requests that can wait for their cycle.
const MOST_WAITING: usize = 64;
/// Sticks: the joystick's and one for each page.
const PADS: usize = 1 + MAX_SESSIONS;
/// While a stick drives, other requests get every so many-th cycle.
const SHARE_OF_OTHERS: u64 = 4;

/// How long clients may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ages {
    /// A stick that drives, ns.
    pub pad_ns: u64,
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

/// One stick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Stick {
    wish: Option<Pad>,
    heard_ns: u64,
    is_blocked: bool,
    /// It must be let go before it can take command: whoever is enabled with a stick in hand starts nothing.
    must_release: bool,
}

impl Stick {
    fn is_held(&self) -> bool {
        matches!(self.wish, Some(Pad::Held { .. }))
    }
}

/// One request that waits for its cycle.
struct Waiting {
    client: Client,
    ticket: u64,
    kind: RequestKind,
    reference: Option<(u32, Box<dyn Reference>)>,
}

/// Answers that wait to be read.
const MOST_ANSWERS: usize = 4 * MOST_WAITING;
/// Notes that wait to be read.
const MOST_NOTES: usize = 16;

/// Arbitrates between clients.
pub struct Operator {
    ages: Ages,
    emergency_category: StopCategory,
    sticks: [Stick; PADS],
    /// When each page was heard last; `None` where there is no such session.
    sessions: [Option<u64>; MAX_SESSIONS],
    commander: Commander,
    is_emergency: bool,
    stop: Option<(StopCategory, Client, u64)>,
    waiting: std::collections::VecDeque<Waiting>,
    /// The next of the values that were heard last and belong together.
    next_of_batch: Option<Batch>,
    asked: Option<(Client, u64, RequestKind)>,
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
            sticks: [Stick::default(); PADS],
            sessions: [None; MAX_SESSIONS],
            commander: Commander::Nobody,
            is_emergency: false,
            stop: None,
            waiting: std::collections::VecDeque::with_capacity(MOST_WAITING),
            next_of_batch: None,
            asked: None,
            answers: Vec::with_capacity(MOST_ANSWERS),
            notes: Vec::with_capacity(MOST_NOTES),
            discarded: Vec::with_capacity(MOST_WAITING),
            cycle: 0,
        }
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
        stick_of(client).is_some_and(|stick| self.sticks[stick].is_blocked)
    }

    /// Sticks that are blocked, as bits: bit 0 the joystick's, then the pages'.
    pub fn blocked_bits(&self) -> u64 {
        self.sticks.iter().enumerate().fold(0, |bits, (n, stick)| bits | u64::from(stick.is_blocked) << n)
    }

    /// What has become of the stick at the robot's computer.
    pub fn joystick(&self) -> StickState {
        let stick = &self.sticks[0];
        match stick.wish {
            None if stick.is_blocked => StickState::Lost,
            None => StickState::Absent,
            Some(Pad::Blocked) => StickState::Blocked,
            Some(_) if stick.is_blocked => StickState::Blocked,
            Some(_) => StickState::Present,
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
        let Command { client, ticket, ask } = command;
        if let Client::Page(number) = client
            && let Some(session) = self.sessions.get_mut(usize::from(number))
        {
            *session = Some(now_ns);
        }
        match ask {
            Ask::Alive => {}
            Ask::Begun => self.begun(now_ns, client),
            Ask::Gone => {
                self.gone(client);
                self.forget_stick(client);
            }
            Ask::PagesLost => self.pages_lost(),
            Ask::Pad(pad) => self.pad(now_ns, client, pad),
            Ask::EnablePad(of) => self.enable(client, ticket, of),
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
            Ask::Robot(RequestKind::Velocity { .. }) => {
                self.answer(ticket, Answer::Refused(Refusal::NotAPad));
            }
            Ask::Robot(kind) => self.ask(Waiting { client, ticket, kind, reference: None }),
            Ask::Load { number, reference } => {
                let kind = RequestKind::UseReference { number };
                self.ask(Waiting { client, ticket, kind, reference: Some((number, reference)) });
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
            // What was asked before a stop must not begin after it.
            self.drop_waiting(|waiting| begins(&waiting.kind));
            return self.send(client, ticket, RequestKind::Stop(category), u64::MAX);
        }
        if let Some(client) = self.driver(phase) {
            let others_turn = self.cycle.is_multiple_of(SHARE_OF_OTHERS) && !self.waiting.is_empty();
            if !others_turn && let Some(turn) = self.drive(client) {
                return turn;
            }
        }
        self.next_waiting()
    }

    /// The answer to what was asked in the cycle before, and the end of what it commanded.
    fn settle(&mut self, last: &CycleRecord, phase: Phase) {
        if let Some((client, ticket, kind)) = self.asked.take() {
            self.answer(ticket, Answer::Robot(last.answer));
            if begins_motion(&kind) && last.answer == RequestAnswer::Taken {
                self.commander = Commander::Reference(client);
            }
        }
        if !matches!(phase, Phase::Tracking | Phase::Stopping) {
            self.commander = Commander::Nobody;
        }
    }

    /// Sticks and pages that fell silent while they commanded.
    fn look_for_losses(&mut self, now_ns: u64, phase: Phase) {
        let old = |heard_ns: u64, age_ns: u64| now_ns.saturating_sub(heard_ns) > age_ns;
        for number in 0..PADS {
            let client = client_of(number);
            let stick = &mut self.sticks[number];
            // The joystick repeats that it is there; a page says nothing while nobody holds its stick.
            let must_speak = match client {
                Client::Joystick => stick.wish.is_some(),
                Client::Page(_) | Client::Command => stick.is_held(),
            };
            if must_speak && old(stick.heard_ns, self.ages.pad_ns) {
                self.pad_lost(client, "the stick fell silent: it is blocked until it is enabled");
            }
        }
        for number in 0..MAX_SESSIONS {
            let client = Client::Page(number as u8);
            if self.sessions[number].is_some_and(|heard_ns| old(heard_ns, self.ages.session_ns)) {
                self.gone(client);
            }
        }
        // Drives that are taken from under a stick: it must be let go before it drives again.
        if self.is_emergency || !matches!(phase, Phase::Holding | Phase::Tracking | Phase::Stopping) {
            self.ask_to_let_go();
        }
    }

    /// Sticks that are held must be let go before they drive again.
    fn ask_to_let_go(&mut self) {
        for stick in self.sticks.iter_mut().filter(|stick| stick.is_held()) {
            stick.must_release = true;
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
            (stick.is_held() && !stick.is_blocked && !stick.must_release).then_some(*client)
        };
        let present = match self.commander {
            Commander::Pad(client) => drives(&client),
            Commander::Nobody | Commander::Reference(_) => None,
        };
        drives(&Client::Joystick).or(present).or_else(|| (1..PADS).map(client_of).find_map(|c| drives(&c)))
    }

    /// The wish of a stick as the cycle's request.
    fn drive(&mut self, client: Client) -> Option<Turn> {
        let stick = self.sticks[stick_of(client)?];
        let Some(Pad::Held { twist, frame }) = stick.wish else { return None };
        if self.commander != Commander::Pad(client) {
            self.say("drives by hand", client);
            self.commander = Commander::Pad(client);
        }
        let valid_until_ns = stick.heard_ns.saturating_add(self.ages.pad_ns);
        Some(self.send(client, 0, RequestKind::Velocity { twist, frame }, valid_until_ns))
    }

    fn next_waiting(&mut self) -> Turn {
        while let Some(waiting) = self.waiting.pop_front() {
            let kind = waiting.kind;
            let refusal = match self.commander {
                _ if begins(&kind) && self.is_emergency => Refusal::EmergencyStop,
                Commander::Pad(_) if begins_motion(&kind) => Refusal::Commanded,
                _ => {
                    let turn = self.send(waiting.client, waiting.ticket, kind, u64::MAX);
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

    fn pad(&mut self, now_ns: u64, client: Client, pad: Pad) {
        let Some(number) = stick_of(client) else { return };
        let drives = self.commander == Commander::Pad(client);
        let stick = &mut self.sticks[number];
        stick.heard_ns = now_ns;
        match pad {
            // What isn't a number is no wish.
            Pad::Held { twist, .. } if !twist.is_finite() => {
                self.pad_lost(client, "the stick sent what is no number: stopped, and blocked");
            }
            Pad::Held { .. } => stick.wish = Some(pad),
            Pad::Released => {
                (stick.wish, stick.must_release) = (Some(pad), false);
                if drives {
                    self.say("let go of the stick", client);
                    self.stop_with(StopCategory::RampAndHold, client, 0);
                }
            }
            Pad::Lost => {
                self.pad_lost(client, "the stick is gone: when it is back, it is blocked until it is enabled")
            }
            Pad::Withdrawn => {
                // Blocked in any case: whoever presses a stop button is to be believed.
                stick.wish = Some(Pad::Held { twist: Twist2::default(), frame: Frame::Body });
                self.pad_lost(client, "stopped at the stick, which is blocked until it is enabled");
                self.stop_asked(StopCategory::RampAndHold, client, 0);
            }
            Pad::Blocked => {
                // One that drove a moment ago: what blocked it must have been missed.
                if stick.is_held() {
                    self.pad_lost(client, "the stick was blocked while it was held: it must be enabled");
                }
                self.sticks[number].wish = Some(pad);
            }
        }
    }

    /// A person allows a stick that was lost to drive again; it has to be let go first.
    fn enable(&mut self, client: Client, ticket: u64, of: Client) {
        let Some(stick) = stick_of(of).map(|number| &mut self.sticks[number]) else {
            return self.answer(ticket, Answer::Refused(Refusal::NoStick));
        };
        // What isn't there isn't enabled either: it would come back free, and nobody would see it happen.
        if of == Client::Joystick && stick.is_blocked && stick.wish.is_none() {
            return self.answer(ticket, Answer::Refused(Refusal::NoStick));
        }
        if stick.is_blocked {
            (stick.is_blocked, stick.must_release) = (false, true);
            self.say(
                if of == client { "enabled its stick again" } else { "enabled the joystick again" },
                client,
            );
        }
        self.answer(ticket, Answer::Done);
    }

    fn pad_lost(&mut self, client: Client, text: &'static str) {
        let Some(number) = stick_of(client) else { return };
        let drives = self.commander == Commander::Pad(client);
        let stick = &mut self.sticks[number];
        // The joystick's loss always counts: a person saw to it that it was there. It is told once.
        let is_known = stick.is_blocked && stick.wish.is_none();
        let counts = stick.is_held() || drives || (client == Client::Joystick && !is_known);
        stick.wish = None;
        if counts {
            (stick.is_blocked, stick.must_release) = (true, true);
            self.say(text, client);
        }
        if self.commander == Commander::Pad(client) {
            self.stop_with(StopCategory::RampAndHold, client, 0);
        }
    }

    /// A session begins: whatever had its number before is gone, and what is in hand now must be let go first.
    fn begun(&mut self, now_ns: u64, client: Client) {
        self.gone(client);
        self.forget_stick(client);
        if let Client::Page(number) = client
            && let Some(session) = self.sessions.get_mut(usize::from(number))
        {
            *session = Some(now_ns);
        }
    }

    /// Nobody speaks for the pages any more.
    fn pages_lost(&mut self) {
        self.say("the server of the pages died: what they commanded stops", None);
        for client in (0..MAX_SESSIONS as u8).map(Client::Page) {
            self.gone(client);
            self.forget_stick(client);
        }
    }

    /// Whoever has this number next is another one.
    fn forget_stick(&mut self, client: Client) {
        if let Some(number) = stick_of(client) {
            self.sticks[number] = Stick { must_release: true, ..Stick::default() };
        }
    }

    /// A page is silent or has ended: its stick is lost, and the motion that it asked for ends. Its stick stays
    /// blocked: after a stalled line the same page comes back, perhaps with the finger still down.
    fn gone(&mut self, client: Client) {
        let Client::Page(number) = client else { return };
        let Some(session) = self.sessions.get_mut(usize::from(number)) else { return };
        *session = None;
        self.pad_lost(client, "the page that drove is gone: stopped");
        // Nor may a finger that went down while the line was dead start anything when it is back.
        self.sticks[1 + usize::from(number)].must_release = true;
        self.drop_waiting(|waiting| waiting.client == client);
        let asked_now = self.asked.is_some_and(|(by, _, kind)| by == client && begins_motion(&kind));
        if self.commander == Commander::Reference(client) || asked_now {
            self.say("the page that asked for this motion is gone: stopped", client);
            self.stop_with(StopCategory::RampAndHold, client, 0);
        }
    }

    /// Somebody stops the robot: it stays so, whoever holds a stick.
    fn stop_asked(&mut self, category: StopCategory, client: Client, ticket: u64) {
        self.ask_to_let_go();
        self.stop_with(category, client, ticket);
    }

    /// The most severe stop counts.
    fn stop_with(&mut self, category: StopCategory, client: Client, ticket: u64) {
        let asked = (category, client, ticket);
        let (kept, other) = match self.stop {
            Some(present) if present.0.severity() >= category.severity() => (present, Some(asked)),
            other => (asked, other),
        };
        self.stop = Some(kept);
        // Whoever asked for the gentler one gets the stronger.
        if let Some((_, _, ticket)) = other {
            self.answer(ticket, Answer::Done);
        }
    }

    fn drop_waiting(&mut self, is_dropped: impl Fn(&Waiting) -> bool) {
        for _ in 0..self.waiting.len() {
            let Some(waiting) = self.waiting.pop_front() else { return };
            if is_dropped(&waiting) {
                self.refuse(waiting, Refusal::Stopped);
            } else {
                self.waiting.push_back(waiting);
            }
        }
    }

    fn refuse(&mut self, waiting: Waiting, refusal: Refusal) {
        self.answer(waiting.ticket, Answer::Refused(refusal));
        if let Some((_, reference)) = waiting.reference
            && self.discarded.len() < MOST_WAITING
        {
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

/// What must not begin while the robot shall stand.
fn begins(kind: &RequestKind) -> bool {
    begins_motion(kind) || *kind == RequestKind::Enable
}

fn stick_of(client: Client) -> Option<usize> {
    match client {
        Client::Joystick => Some(0),
        Client::Page(number) if usize::from(number) < MAX_SESSIONS => Some(1 + usize::from(number)),
        Client::Page(_) | Client::Command => None,
    }
}

fn client_of(stick: usize) -> Client {
    if stick == 0 { Client::Joystick } else { Client::Page((stick - 1) as u8) }
}
