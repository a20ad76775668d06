//! Sticks and pages, as the operator knows them: held, let go, silent, gone, blocked.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Phase, StopCategory};

use super::super::command::{Answer, Client, Commander, MAX_SESSIONS, Refusal, StickWish};
use super::super::stamp::{BEGINNING_AGE_NS, Stamp};
use super::Operator;

/// Sticks: the joystick's and one for each page.
pub(super) const STICKS: usize = 1 + MAX_SESSIONS;

/// One stick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Stick {
    pub(super) wish: Option<StickWish>,
    pub(super) heard_ns: u64,
    pub(super) is_blocked: bool,
    /// A program's that drives again by itself after a silence, and waits for a person after whatever else stopped the robot.
    recovers: bool,
    /// It must be let go before it can take command: whoever is enabled with a stick in hand starts nothing.
    pub(super) must_release: bool,
    /// It was told that its wishes aren't taken: once, until it is let go.
    is_told: bool,
}

impl Stick {
    pub(super) fn is_held(&self) -> bool {
        matches!(self.wish, Some(StickWish::Held { .. }))
    }
}

impl Operator {
    /// Sticks and pages that fell silent while they commanded.
    pub(super) fn look_for_losses(&mut self, now_ns: u64, phase: Phase) {
        let old = |heard_ns: u64, age_ns: u64| now_ns.saturating_sub(heard_ns) > age_ns;
        for number in 0..STICKS {
            let client = client_of(number);
            let stick = &mut self.sticks[number];
            // The joystick repeats that it is there; a page says nothing while nobody holds its stick.
            let must_speak = match client {
                Client::Joystick => stick.wish.is_some(),
                Client::Page(_) | Client::Command => stick.is_held(),
            };
            if must_speak && old(stick.heard_ns, self.ages.stick_ns) {
                self.stick_silent(client, "the stick fell silent: it is blocked until it is enabled");
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
    pub(super) fn ask_to_let_go(&mut self) {
        for stick in self.sticks.iter_mut().filter(|stick| stick.is_held()) {
            stick.must_release = true;
        }
    }

    /// A page is heard: it counts as there from when it spoke, not from when that arrived.
    pub(super) fn hear_page(&mut self, now_ns: u64, client: Client, stamp: Stamp) {
        let spoke_ns = match stamp {
            Stamp::Here | Stamp::Missing => Some(now_ns),
            Stamp::OnBehalf => None,
            Stamp::Told(_) => stamp.within(now_ns, self.ages.session_ns).ok(),
        };
        if let (Client::Page(number), Some(spoke_ns)) = (client, spoke_ns)
            && let Some(session) = self.sessions.get_mut(usize::from(number))
        {
            *session = Some(spoke_ns.max(session.unwrap_or(0)));
        }
    }

    /// A wish that is too old is none: the stick is as silent as it was before. Told once, not with every wish.
    pub(super) fn stick_refused(&mut self, client: Client, refusal: Refusal) {
        let Some(stick) = stick_of(client).map(|number| &mut self.sticks[number]) else { return };
        if !std::mem::replace(&mut stick.is_told, true) {
            let text = match refusal {
                Refusal::Unstamped => "the stick's wishes have no stamp: they aren't taken",
                Refusal::OfAnotherRun => "the stick's wishes are of another run: they aren't taken",
                _ => "the stick's wishes come too late, the line is slow: they aren't taken",
            };
            self.say(text, client);
        }
    }

    /// What a stick says, which counts from when it was said.
    pub(super) fn take_wish(&mut self, now_ns: u64, client: Client, wish: StickWish, stamp: Stamp) {
        let Some(number) = stick_of(client) else { return };
        let drives = self.commander == Commander::Stick(client);
        let stick = &mut self.sticks[number];
        let said_ns = stamp.within(now_ns, self.ages.stick_ns).unwrap_or(now_ns);
        stick.heard_ns = said_ns.max(stick.heard_ns);
        match wish {
            // What isn't a number is no wish.
            StickWish::Held { twist, .. } if !twist.is_finite() => {
                self.stick_lost(client, "the stick sent what is no number: stopped, and blocked");
            }
            StickWish::Held { .. } => stick.wish = Some(wish),
            StickWish::Released => {
                // The joystick repeats it while the robot comes to rest: told once.
                let was_held = stick.is_held();
                (stick.wish, stick.is_told) = (Some(wish), false);
                // One of long ago doesn't tell that it is let go now.
                stick.must_release &= stamp.within(now_ns, BEGINNING_AGE_NS).is_err();
                if drives {
                    if was_held {
                        self.say("let go of the stick", client);
                    }
                    self.stop_with(StopCategory::RampAndHold, client, 0);
                }
            }
            StickWish::Lost => self
                .stick_lost(client, "the stick is gone: when it is back, it is blocked until it is enabled"),
            StickWish::Withdrawn => {
                // Blocked in any case: whoever presses a stop button is to be believed.
                stick.wish = Some(StickWish::Held { twist: Twist2::default(), frame: Frame::Body });
                self.stick_lost(client, "stopped at the stick, which is blocked until it is enabled");
                self.stop_asked(StopCategory::RampAndHold, client, 0);
            }
            StickWish::Blocked => {
                // One that drove a moment ago: what blocked it must have been missed.
                if stick.is_held() {
                    self.stick_lost(client, "the stick was blocked while it was held: it must be enabled");
                }
                self.sticks[number].wish = Some(wish);
            }
        }
    }

    /// A person allows a stick that was lost to drive again; it has to be let go first.
    pub(super) fn enable(&mut self, client: Client, ticket: u64, of: Client) {
        let Some(stick) = stick_of(of).map(|number| &mut self.sticks[number]) else {
            return self.answer(ticket, Answer::Refused(Refusal::NoStick));
        };
        // What isn't there isn't enabled either: it would come back free, and nobody would see it happen.
        if of == Client::Joystick && stick.is_blocked && stick.wish.is_none() {
            return self.answer(ticket, Answer::Refused(Refusal::NoStick));
        }
        let waits = stick.recovers && std::mem::take(&mut self.programs_wait);
        if stick.is_blocked || waits {
            (stick.is_blocked, stick.must_release) = (false, true);
            self.say(
                if of == client { "enabled its stick again" } else { "enabled the joystick again" },
                client,
            );
        }
        self.answer(ticket, Answer::Done);
    }

    /// From now on it drives again by itself after a silence.
    pub(super) fn recover_stick(&mut self, client: Client) {
        if let Some(number) = stick_of(client) {
            self.sticks[number].recovers = true;
        }
    }

    /// Whether a stick drives nothing until a person enables it.
    pub(super) fn waits_to_be_enabled(&self, stick: &Stick) -> bool {
        stick.is_blocked || (stick.recovers && self.programs_wait)
    }

    /// Nothing was heard of a stick for too long.
    fn stick_silent(&mut self, client: Client, text: &'static str) {
        let Some(number) = stick_of(client) else { return };
        let stick = &mut self.sticks[number];
        if !stick.recovers {
            return self.stick_lost(client, text);
        }
        stick.wish = None;
        if self.commander == Commander::Stick(client) {
            self.comeback = None;
            self.say("the program that drove fell silent: stopped until it is heard", client);
            self.stop_with(StopCategory::RampAndHold, client, 0);
        }
    }

    pub(super) fn stick_lost(&mut self, client: Client, text: &'static str) {
        let Some(number) = stick_of(client) else { return };
        let drives = self.commander == Commander::Stick(client);
        let stick = &mut self.sticks[number];
        // The joystick's loss always counts: a person saw to it that it was there. It is told once.
        let is_known = stick.is_blocked && stick.wish.is_none();
        let counts = stick.is_held() || drives || (client == Client::Joystick && !is_known);
        stick.wish = None;
        if counts {
            (self.comeback, self.programs_wait) = (None, true);
            let stick = &mut self.sticks[number];
            (stick.is_blocked, stick.must_release) = (true, true);
            self.say(text, client);
        }
        if self.commander == Commander::Stick(client) {
            self.stop_with(StopCategory::RampAndHold, client, 0);
        }
    }

    /// A session begins: whatever had its number before is gone, and what is in hand now must be let go first.
    pub(super) fn begun(&mut self, now_ns: u64, client: Client) {
        self.gone(client);
        self.forget_stick(client);
        if let Client::Page(number) = client
            && let Some(session) = self.sessions.get_mut(usize::from(number))
        {
            *session = Some(now_ns);
        }
    }

    /// Nobody speaks for the pages any more.
    pub(super) fn pages_lost(&mut self) {
        self.say("the server of the pages died: what they commanded stops", None);
        for client in (0..MAX_SESSIONS as u8).map(Client::Page) {
            self.gone(client);
            self.forget_stick(client);
        }
    }

    /// Whoever has this number next is another one.
    pub(super) fn forget_stick(&mut self, client: Client) {
        if let Some(number) = stick_of(client) {
            self.sticks[number] = Stick { must_release: true, ..Stick::default() };
        }
    }

    /// A page is silent or has ended: its stick is lost, and the motion that it asked for ends. Its stick stays
    /// blocked: after a stalled line the same page comes back, perhaps with the finger still down.
    pub(super) fn gone(&mut self, client: Client) {
        let Client::Page(number) = client else { return };
        let Some(session) = self.sessions.get_mut(usize::from(number)) else { return };
        if session.take().is_none() {
            // Its end was seen already; who comes under its number is another.
            return;
        }
        self.comeback = self.comeback.take().filter(|(of, _)| *of != client);
        self.stick_silent(client, "the page that drove is gone: stopped");
        // Nor may a finger that went down while the line was dead start anything when it is back.
        let stick = &mut self.sticks[1 + usize::from(number)];
        stick.must_release |= !stick.recovers;
        let was_a_person = !stick.recovers;
        self.drop_waiting(|waiting| waiting.client == client);
        if let Some((by, _, kind)) = self.asked
            && by == client
        {
            self.authors.note(&kind, client);
        }
        self.authors.gone(client);
        if self.has_begun_motion(client) {
            self.programs_wait |= was_a_person;
            self.say("the page that asked for this motion is gone: stopped", client);
            self.stop_with(StopCategory::RampAndHold, client, 0);
        }
    }
}

pub(super) fn stick_of(client: Client) -> Option<usize> {
    match client {
        Client::Joystick => Some(0),
        Client::Page(number) if usize::from(number) < MAX_SESSIONS => Some(1 + usize::from(number)),
        Client::Page(_) | Client::Command => None,
    }
}

pub(super) fn client_of(stick: usize) -> Client {
    if stick == 0 { Client::Joystick } else { Client::Page((stick - 1) as u8) }
}
