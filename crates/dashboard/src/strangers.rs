//! How much each network may ask, and how long it waits after wrong tokens. Time is an argument: since the server began.

use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::connections::Network;

/// Requests a second that a network may make, and how many at once.
const RATE_1_S: f64 = 200.0;
const BURST: f64 = 400.0;
/// By so much more those say who measure, some thousand times a second.
const INPUTS_FACTOR: f64 = 25.0;
/// Requests of a network that may be under way at the same time.
const MOST_ASKING: usize = 32;
/// Wrong tokens, each another one, after which a network waits; from there on it waits twice as long each time.
const FREE_WRONG: u32 = 5;
const FIRST_WAIT: Duration = Duration::from_secs(1);
const LONGEST_WAIT: Duration = Duration::from_secs(64);
/// After so long without a wrong one they are forgotten.
const FORGOTTEN: Duration = Duration::from_secs(600);
/// Networks that are remembered.
const MOST_KNOWN: usize = 1024;

/// How much may still come: so many at once, and so many a second.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowance {
    factor: f64,
    left: f64,
    since: Duration,
}

impl Allowance {
    /// All of it.
    pub(crate) fn new(now: Duration) -> Self {
        Allowance { factor: 1.0, left: BURST, since: now }
    }

    /// All of it, for a program that sends inputs.
    pub(crate) fn of_inputs(now: Duration) -> Self {
        Allowance { factor: INPUTS_FACTOR, left: INPUTS_FACTOR * BURST, since: now }
    }

    /// Whether one more may come.
    pub(crate) fn takes(&mut self, now: Duration) -> bool {
        self.refill(now);
        let takes = self.left >= 1.0;
        if takes {
            self.left -= 1.0;
        }
        takes
    }

    fn refill(&mut self, now: Duration) {
        let passed_s = now.saturating_sub(self.since).as_secs_f64();
        self.left = (self.left + self.factor * RATE_1_S * passed_s).min(self.factor * BURST);
        self.since = self.since.max(now);
    }
}

/// The wrong tokens of a network.
#[derive(Clone, Copy, Debug, Default)]
struct Wrong {
    count: u32,
    last: Option<u64>,
    last_at: Duration,
    until: Duration,
}

struct Known {
    requests: Allowance,
    asking: usize,
    wrong: Wrong,
}

impl Known {
    /// Whether forgetting it changes nothing.
    fn is_as_new(&mut self, now: Duration) -> bool {
        self.requests.refill(now);
        let is_forgotten = now.saturating_sub(self.wrong.last_at) > FORGOTTEN;
        self.requests.left >= BURST && self.asking == 0 && (self.wrong.count == 0 || is_forgotten)
    }
}

/// What is remembered of those who ask.
#[derive(Default)]
pub(crate) struct Strangers {
    known: Mutex<HashMap<Network, Known>>,
    hasher: RandomState,
}

/// Why a request has to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TooMuch {
    /// Too many a second.
    Rate,
    /// Too many at the same time.
    Asking,
}

impl Strangers {
    fn known(&self) -> MutexGuard<'_, HashMap<Network, Known>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A request of that network begins, to be [ended](Strangers::end).
    pub(crate) fn begin(&self, now: Duration, from: Network) -> Result<(), TooMuch> {
        let mut all = self.known();
        let known = entry(&mut all, now, from).ok_or(TooMuch::Rate)?;
        if known.asking >= MOST_ASKING {
            return Err(TooMuch::Asking);
        }
        if !known.requests.takes(now) {
            return Err(TooMuch::Rate);
        }
        known.asking += 1;
        Ok(())
    }

    /// It has its answer.
    pub(crate) fn end(&self, from: Network) {
        if let Some(known) = self.known().get_mut(&from) {
            known.asking = known.asking.saturating_sub(1);
        }
    }

    /// How long that network's tokens aren't looked at yet.
    pub(crate) fn wait(&self, now: Duration, from: Network) -> Option<Duration> {
        let wait = self.known().get(&from)?.wrong.until.checked_sub(now)?;
        (!wait.is_zero()).then_some(wait)
    }

    /// A wrong token came from there. The same one again teaches nobody anything: a page's cookie of the run before.
    pub(crate) fn wrong(&self, now: Duration, from: Network, shown: &str) {
        let shown = self.hasher.hash_one(shown);
        let mut all = self.known();
        let Some(Known { wrong, .. }) = entry(&mut all, now, from) else { return };
        if now.saturating_sub(wrong.last_at) > FORGOTTEN {
            *wrong = Wrong::default();
        }
        if wrong.last == Some(shown) {
            return;
        }
        (wrong.last, wrong.last_at) = (Some(shown), now);
        wrong.count = wrong.count.saturating_add(1);
        if let Some(over) = wrong.count.checked_sub(FREE_WRONG) {
            let wait = FIRST_WAIT.saturating_mul(1u32.checked_shl(over).unwrap_or(u32::MAX));
            wrong.until = now + wait.min(LONGEST_WAIT);
        }
    }
}

/// What is known of a network; nothing where there are too many of them.
fn entry(all: &mut HashMap<Network, Known>, now: Duration, from: Network) -> Option<&mut Known> {
    if all.len() >= MOST_KNOWN && !all.contains_key(&from) {
        all.retain(|_, known| !known.is_as_new(now));
        // Who shows ever new networks waits until they are forgotten.
        if all.len() >= MOST_KNOWN {
            return None;
        }
    }
    let new = || Known { requests: Allowance::new(now), asking: 0, wrong: Wrong::default() };
    Some(all.entry(from).or_insert_with(new))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::IpAddr;

    fn network(n: u8) -> Network {
        Network::of(IpAddr::from([10, 0, 0, n]))
    }

    fn at(time_s: f64) -> Duration {
        Duration::from_secs_f64(time_s)
    }

    #[test]
    fn a_network_asks_so_much_and_no_more_and_nobody_else_pays_for_it() {
        let strangers = Strangers::default();
        let begun = |time_s, n| {
            let said = strangers.begin(at(time_s), network(n));
            strangers.end(network(n));
            said
        };
        let taken = (0..1000).filter(|_| begun(0.0, 1).is_ok()).count();
        assert_eq!(taken, BURST as usize);
        assert_eq!(begun(0.0, 2), Ok(()));
        let taken = (0..1000).filter(|_| begun(1.0, 1).is_ok()).count();
        assert_eq!(taken, RATE_1_S as usize);
        // Those that aren't answered count at once.
        let open = (0..100).take_while(|_| strangers.begin(at(9.0), network(3)).is_ok()).count();
        assert_eq!((open, strangers.begin(at(9.0), network(3))), (MOST_ASKING, Err(TooMuch::Asking)));
        strangers.end(network(3));
        assert_eq!(strangers.begin(at(9.0), network(3)), Ok(()));
    }

    #[test]
    fn wrong_tokens_make_their_network_wait_longer_and_longer() {
        let strangers = Strangers::default();
        let mut now_s = 0.0;
        let mut waits = Vec::new();
        for n in 0..14 {
            strangers.wrong(at(now_s), network(1), &format!("guess-{n}"));
            let wait = strangers.wait(at(now_s), network(1)).unwrap_or_default();
            waits.push(wait.as_secs_f64());
            now_s += wait.as_secs_f64();
            assert_eq!(strangers.wait(at(now_s), network(1)), None, "it is over");
            assert_eq!(strangers.wait(at(now_s), network(2)), None, "another one");
        }
        let expected = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 64.0, 64.0, 64.0];
        assert_eq!(waits, expected);
        // Long after it begins anew.
        strangers.wrong(at(now_s + 601.0), network(1), "guess");
        assert_eq!(strangers.wait(at(now_s + 601.0), network(1)), None);
    }

    #[test]
    fn a_page_that_shows_the_token_of_the_run_before_again_and_again_is_no_guesser() {
        let strangers = Strangers::default();
        (0..1000).for_each(|_| strangers.wrong(at(1.0), network(1), "of-yesterday"));
        assert_eq!(strangers.wait(at(1.0), network(1)), None);
    }

    #[test]
    fn what_is_remembered_is_bounded() {
        let strangers = Strangers::default();
        for n in 0..100_000u32 {
            let from = Network::of(IpAddr::from(n.to_be_bytes()));
            strangers.wrong(at(0.0), from, "guess");
        }
        assert_eq!(strangers.known().len(), MOST_KNOWN);
    }
}
