//! A person at the page: questions answered there, a button held.

use super::heard::Heard;
use omnibase_dashboard::setup_page::{
    HearsSetup, HoldShown, PlatformShown, QuestionShown, SetupPage, SetupShown, StepShown, WheelShown,
};
use omnibase_dashboard::{Access, DashboardError};
use omnibase_robot::RobotPlan;
use omnibase_setup::{Answer, Hand, Key, Question, Record, Step};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Lines that pages show.
const LINES: usize = 200;
/// Answers that may wait to be read.
const WAITING: usize = 16;
/// How often is looked whether somebody leaves.
const LOOK: Duration = Duration::from_millis(50);

/// What the server's thread heard.
struct Ear {
    heard: Heard,
    /// The motion for which a button may be held.
    hold: AtomicU64,
    answers: SyncSender<(u64, String)>,
}

impl HearsSetup for Ear {
    fn answer(&self, question: u64, said: String) {
        // Who answers ever again is heard once he is asked again.
        let _ = self.answers.try_send((question, said));
    }

    fn beat(&self, hold: u64) {
        // A beat of the motion before is none of this one's.
        if hold == self.hold.load(Ordering::Relaxed) {
            self.heard.beat();
        }
    }

    fn let_go(&self) {
        self.heard.let_go();
    }

    fn leave(&self) {
        self.heard.gone();
    }
}

/// A person at the page.
pub struct Page {
    server: SetupPage,
    ear: Arc<Ear>,
    answers: Receiver<(u64, String)>,
    shown: SetupShown,
    /// Of the last question or motion.
    number: u64,
    stop: &'static AtomicBool,
}

impl Page {
    /// Serves the page of this robot's set-up, taken up from `record`; `stop` ends it as leaving does.
    pub fn start(
        access: Access,
        plan: &RobotPlan,
        record: &Record,
        stop: &'static AtomicBool,
    ) -> Result<Self, DashboardError> {
        let (sender, answers) = sync_channel(WAITING);
        let ear = Arc::new(Ear { heard: Heard::default(), hold: AtomicU64::new(0), answers: sender });
        let server = SetupPage::start(access, ear.clone())?;
        let wheels = plan.kinematics.wheels().iter().zip(&plan.drives);
        let wheels = wheels.map(|(wheel, drive)| WheelShown {
            name: drive.name.clone(),
            position_m: wheel.position_m,
            rolls: wheel.rolling_direction,
            radius_m: wheel.radius_m,
        });
        let steps = Step::ALL.map(|step| StepShown {
            words: step.words().to_owned(),
            is_done: record.done.contains(&step),
            is_passed_over: record.passed_over_of(step).is_some(),
            is_now: false,
        });
        let shown = SetupShown {
            robot: plan.name.clone(),
            steps: steps.to_vec(),
            platform: PlatformShown { footprint_m: plan.guard.footprint_m.clone(), wheels: wheels.collect() },
            ..SetupShown::default()
        };
        let page = Page { server, ear, answers, shown, number: 0, stop };
        page.show();
        Ok(page)
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.server.address
    }

    /// Says how it ended, and waits until that may be seen.
    pub fn end(mut self, words: String) {
        self.quiet();
        self.shown.over = Some(words);
        self.show();
        self.server.linger();
    }

    fn show(&self) {
        self.server.show(&self.shown);
    }

    fn say(&mut self, text: String) {
        let said = &mut self.shown.said;
        if said.len() >= LINES {
            said.remove(0);
        }
        said.push(text);
    }

    /// Nothing is asked, and no button moves anything.
    fn quiet(&mut self) {
        self.ear.hold.store(0, Ordering::Relaxed);
        (self.shown.question, self.shown.hold) = (None, None);
    }

    fn next(&mut self) -> u64 {
        self.number += 1;
        self.number
    }

    fn is_gone(&self) -> bool {
        self.ear.heard.is_gone() || self.stop.load(Ordering::Relaxed)
    }
}

impl Hand for Page {
    fn ask(&mut self, question: &Question) -> Answer {
        self.quiet();
        let number = self.next();
        let Question { id, text, choices, default } = question.clone();
        self.shown.question = Some(QuestionShown { number, id, text: text.clone(), choices, default });
        self.show();
        let said = loop {
            if self.is_gone() {
                break None;
            }
            match self.answers.recv_timeout(LOOK) {
                // A second press of a button that is gone meanwhile answers nothing.
                Ok((of, said)) if of == number => break Some(said),
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break None,
            }
        };
        self.quiet();
        if let Some(said) = &said {
            self.say(format!("{text} {said}"));
        }
        self.show();
        said.map_or(Answer::Leave, Answer::Text)
    }

    fn tell(&mut self, text: &str) {
        self.quiet();
        self.say(text.to_owned());
        self.show();
    }

    /// The button stays.
    fn remark(&mut self, text: &str) {
        self.say(text.replace("holds the key", "holds the button").replace("held key", "held button"));
        self.show();
    }

    fn step(&mut self, step: Step, was_done: bool) {
        self.quiet();
        for (shown, one) in self.shown.steps.iter_mut().zip(Step::ALL) {
            // Behind drives that are found or jogged again nothing is done.
            let counts = one <= step || was_done || step > Step::Jog;
            shown.is_done = counts && (shown.is_done || one < step || one == step && was_done);
            shown.is_now = one == step && !was_done;
            // What of it is passed over again is said once it is over.
            shown.is_passed_over &= one != step;
        }
        self.show();
    }

    fn passed_over(&mut self, step: Step) {
        for (shown, one) in self.shown.steps.iter_mut().zip(Step::ALL) {
            shown.is_passed_over |= one == step;
        }
        self.show();
    }

    fn take_key(&mut self, what: &str) {
        self.quiet();
        let number = self.next();
        self.server.moves.set(false, 0.0);
        self.ear.heard.begin();
        self.ear.hold.store(number, Ordering::Relaxed);
        self.shown.hold = Some(HoldShown { number, text: what.replace("hold the key", "hold the button") });
        self.say(what.to_owned());
        self.show();
    }

    fn key(&mut self) -> Key {
        if self.stop.load(Ordering::Relaxed) {
            return Key::Gone;
        }
        self.ear.heard.key()
    }

    fn moves(&mut self, is_enabled: bool, travel: f64) {
        self.server.moves.set(is_enabled, travel);
    }
}
