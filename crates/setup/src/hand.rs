//! Whoever is asked and holds the key.

use serde::{Deserialize, Serialize};

use crate::record::Step;

/// What was heard of the key in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// It is down: pressed, repeated, or told so.
    Beat,
    /// Nothing.
    Quiet,
    /// It was let go.
    LetGo,
    /// The terminal, or whatever it came from, is gone.
    Gone,
}

/// A question.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Question {
    /// What it is about, for programs: a plain word and, where it is about a drive, its position, as `wheel 2`.
    pub id: String,
    /// In words.
    pub text: String,
    /// What may be answered; empty for numbers and text.
    pub choices: Vec<String>,
    /// What an empty answer means.
    pub default: Option<String>,
}

/// An answer, as it was given.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub enum Answer {
    /// Words, a number, or one of the choices.
    Text(String),
    /// Enough for now: the state is kept.
    Leave,
}

/// Whoever is asked and holds the key.
pub trait Hand {
    /// Answers a question; waits as long as it takes. Nothing moves meanwhile.
    fn ask(&mut self, question: &Question) -> Answer;

    /// Is told something.
    fn tell(&mut self, text: &str);

    /// Is told something while a key may be held: it stays in the hand.
    fn remark(&mut self, text: &str) {
        self.tell(text);
    }

    /// A step begins, or, where it was done before, is passed over.
    fn step(&mut self, step: Step, was_done: bool) {
        let word = if was_done { "done before" } else { "step" };
        self.tell(&format!("{word}: {}", step.words()));
    }

    /// The step that is over was passed over, as a whole or in part.
    fn passed_over(&mut self, _step: Step) {}

    /// A time begins in which a held key moves a drive; `what` says what it does.
    fn take_key(&mut self, what: &str);

    /// What was heard of the key since the last cycle. Called in every cycle of a motion: doesn't wait.
    fn key(&mut self) -> Key;

    /// What a drive or the robot does meanwhile: whether it is enabled, and how far it went in counts, m or rad. Called in every cycle
    /// of a motion: doesn't wait.
    fn moves(&mut self, _is_enabled: bool, _travel: f64) {}
}
