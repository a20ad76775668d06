//! What a gyro tells of the wheels' wires: the turn that their speeds make of the platform, as the file has them and in each other way.
//!
//! It needs no mass, friction or slope. A gyro that says nothing, or the opposite, looks like some wires, and a platform that doesn't turn
//! while its wheels do, on blocks or on ice, like a gyro that says nothing: where one of these explains the turn as well, no wires are
//! named. A likelihood has the tails of a Student's distribution, as those of forces (`supposition.rs`).

use super::supposition::{Platform, Rims, Supposition, Wiring};
use super::{MARGIN, REFUTED, SCORE};

/// By how much a gyro may differ from the wheels' turn: its bias, rad/s; the floor's creep and slip, over what the wheels' speeds make
/// together; and how much later either may be told, s.
const TURN_RAD_S: f64 = 0.03;
const TURN_SHARE: f64 = 0.05;
const LATE_S: f64 = 0.02;
/// For how long what differs so stays, s.
const NOISE_S: f64 = 0.05;
/// Squares of what it may differ by from which on they say little more; and the most that a single one counts.
const TAIL: f64 = 4.0;
const MOST: f64 = 16.0;
/// How long a misfit is remembered, s.
const MISFIT_S: f64 = 0.3;
/// So much the file's wiring leaves at least where others are named, in those squares; others leave at most that, also of the file's.
const MISFIT: f64 = 4.0;
const LEFT: f64 = 1.0;
const LEFT_SHARE: f64 = 0.1;
/// For so long, s, and for two rounds of looks.
const LASTING_S: f64 = 0.02;
/// From this likelihood on others are worth waiting for, as its logarithm.
const BEGINS: f64 = 2.0;

/// Why a gyro may tell another turn than the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    Wires(Wiring),
    GyroSilent,
    GyroReversed,
}

#[derive(Clone, Copy, Debug)]
struct Guess {
    cause: Cause,
    /// By how much the likelihood of what was heard exceeds the file's, as its logarithm.
    score: f64,
    /// Mean square of what it leaves unexplained, over what the gyro may differ by.
    misfit: f64,
}

impl Guess {
    fn is_swap(&self) -> bool {
        matches!(self.cause, Cause::Wires(Wiring::Swapped(..)))
    }
}

/// The watch: in each cycle it looks at one cause.
#[derive(Clone, Debug)]
pub(super) struct TurnWatch {
    /// Wires, and then what may be wrong with the gyro.
    guesses: Box<[Guess]>,
    next: usize,
    /// The platform's turn by its gyro, behind the rims' low-pass, rad/s.
    turn_rad_s: Option<f64>,
    /// The file's misfit.
    of_file: f64,
    /// For how long other wires explain the turn; time in which they don't counts back, s.
    explained_s: f64,
    named: Option<usize>,
}

impl TurnWatch {
    /// Of wires other than the file's.
    pub(super) fn new(ways: impl Iterator<Item = Wiring>) -> Self {
        let causes = ways.map(Cause::Wires).chain([Cause::GyroSilent, Cause::GyroReversed]);
        TurnWatch {
            guesses: causes.map(|cause| Guess { cause, score: 0.0, misfit: 0.0 }).collect(),
            next: 0,
            turn_rad_s: None,
            of_file: 0.0,
            explained_s: 0.0,
            named: None,
        }
    }

    /// Nothing was heard yet.
    pub(super) fn reset(&mut self) {
        (self.next, self.turn_rad_s, self.of_file) = (0, None, 0.0);
        (self.explained_s, self.named) = (0.0, None);
        for guess in &mut self.guesses {
            (guess.score, guess.misfit) = (0.0, 0.0);
        }
    }

    /// Takes in what the gyro tells, rad/s, of which the low-pass keeps such a part of before.
    pub(super) fn hear(&mut self, told_rad_s: Option<f64>, keep: f64) {
        let told_rad_s = told_rad_s.filter(|told_rad_s| told_rad_s.is_finite());
        self.turn_rad_s = told_rad_s
            .map(|told_rad_s| keep * self.turn_rad_s.unwrap_or(told_rad_s) + (1.0 - keep) * told_rad_s);
    }

    /// Looks at it beside the rims, once a cycle of a motion, and at what forces tell of the file's wires and then of the others.
    pub(super) fn look(
        &mut self,
        platform: &Platform,
        rims: &Rims,
        by_forces: &[Supposition],
        period_s: f64,
    ) {
        let Some(turn_rad_s) = self.turn_rad_s else { return };
        let misfit = |cause: Cause| {
            let (wiring, told_rad_s) = match cause {
                Cause::Wires(wiring) => (wiring, turn_rad_s),
                Cause::GyroSilent => (Wiring::AsTold, turn_rad_s),
                Cause::GyroReversed => (Wiring::AsTold, -turn_rad_s),
            };
            let (shown_rad_s, all_rad_s) = wiring.turn(platform, &rims.speed_m_s);
            let (gain_rad_s2, _) = wiring.turn(platform, &rims.gain_m_s2);
            let untold = TURN_RAD_S + TURN_SHARE * all_rad_s + LATE_S * gain_rad_s2.abs();
            let shown_rad_s = if cause == Cause::GyroSilent { 0.0 } else { shown_rad_s };
            ((told_rad_s - shown_rad_s) / untold).powi(2).min(MOST)
        };
        let lasting = |before: f64, now: f64, span_s: f64| {
            let keep = (-span_s / MISFIT_S).exp();
            keep * before + (1.0 - keep) * now
        };
        let count = self.guesses.len();
        let (of_file, round_s) = (misfit(Cause::Wires(Wiring::AsTold)), count as f64 * period_s);
        let guess = &mut self.guesses[self.next % count];
        self.next = (self.next + 1) % count;
        if of_file.is_finite() {
            self.of_file = lasting(self.of_file, of_file, period_s);
        }
        let own = misfit(guess.cause);
        if guess.score > REFUTED && own.is_finite() && of_file.is_finite() {
            let said = |far: f64| -0.5 * TAIL * (far / TAIL).ln_1p();
            guess.score += (said(own) - said(of_file)) * round_s / NOISE_S;
            guess.misfit = lasting(guess.misfit, own, round_s);
        }
        if self.named.is_none() {
            let judged = self.judge(by_forces);
            let passed_s = if judged.is_some() { period_s } else { -period_s };
            self.explained_s = (self.explained_s + passed_s).max(0.0);
            self.named = judged.filter(|_| self.explained_s > LASTING_S.max(2.0 * round_s));
        }
    }

    /// The wheel that is the first to be looked at, where other wires explain the turn. Which of them do forces tell, too.
    fn judge(&self, by_forces: &[Supposition]) -> Option<usize> {
        let (wires, own) = self.guesses.split_at(by_forces.len() - 1);
        let scored =
            || wires.iter().zip(&by_forces[1..]).map(|(guess, forces)| (guess, guess.score + forces.score));
        let (best, score) = scored().max_by(|(_, one), (_, other)| one.total_cmp(other))?;
        // Which two are swapped can't be told on some layouts; that two are can.
        let others =
            scored().filter(|(other, _)| other.cause != best.cause && !(best.is_swap() && other.is_swap()));
        let second = others.map(|(_, score)| score).fold(0.0, f64::max);
        // No force tells of the gyro.
        let of_gyro = own.iter().map(|guess| guess.score).fold(0.0, f64::max);
        let is_clear = score > SCORE && score - second > MARGIN && best.score - of_gyro > MARGIN;
        let explains = self.of_file > MISFIT && best.misfit < LEFT.min(LEFT_SHARE * self.of_file);
        match best.cause {
            Cause::Wires(Wiring::Turned(wheel) | Wiring::Swapped(wheel, _)) if is_clear && explains => {
                Some(wheel)
            }
            _ => None,
        }
    }

    /// Whether it begins to show that a wheel is wired backwards. Swapped wheels look like what slips and turns the platform.
    pub(super) fn begins_to_show(&self) -> bool {
        let is_turned = |guess: &Guess| matches!(guess.cause, Cause::Wires(Wiring::Turned(_)));
        let begins = |guess: &Guess| is_turned(guess) && guess.score > BEGINS && guess.misfit < LEFT;
        let is_heard = self.turn_rad_s.is_some() && self.named.is_none();
        is_heard && self.of_file > LEFT && self.guesses.iter().any(begins)
    }

    /// The wheel that seems to be wired wrongly.
    pub(super) fn named(&self) -> Option<usize> {
        self.named
    }
}
