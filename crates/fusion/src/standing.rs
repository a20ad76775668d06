//! Which sensor is believed, and why not.

/// What is thought of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing was heard of it yet.
    #[default]
    Awaited,
    /// It agrees with the others.
    Good,
    /// It fell silent, or never spoke.
    Silent,
    /// It says the same again and again while the platform moves.
    Frozen,
    /// What it says can't be, as far as the others know.
    Contradicts,
}

/// Readings that contradict are remembered for so long, s.
const DOUBT_TIME_S: f64 = 0.3;
/// The share of readings that contradict, lately, beyond which it isn't.
const DOUBTED: f64 = 0.5;
/// The share from which what it contradicts may be wrong.
const DOUBTFUL: f64 = 0.2;
/// For so long it must agree before it is believed again, s.
const RETURN_S: f64 = 1.0;
/// Readings further apart than this tell no more of it than this, s.
const LONGEST_S: f64 = 0.05;

/// What says the same more often than so many times as often as it ever did, and these beside, is frozen, if wheels drove by
/// more than this meanwhile, m; known once it said something new so often.
const LONGER: u32 = 4;
const SAME: u32 = 10;
const DROVE_M: f64 = 5e-3;
const KNOWN_NEW: u32 = 100;
/// Numbers that differ by this share are one.
const ROUNDING: f64 = 1e-14;

/// What a filter remembers of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Why it isn't believed; what it fell to last.
    pub verdict: Verdict,
    /// chi² of its last reading over its degrees of freedom: 1 in the mean where all is as said.
    pub nis: f64,
    /// The share of readings that contradict, lately.
    doubt: f64,
    agrees_s: f64,
    /// The last instant of a reading, ns.
    heard_ns: Option<u64>,
    /// What it said last, and what was expected when it first said so.
    pub(crate) said: [f64; 3],
    pub(crate) expected: [f64; 3],
    /// It says something else than before.
    is_new: bool,
    /// How often it has said the same now, since wheels had driven so far, m; how often it ever did; how often something new.
    same: (u32, f64),
    longest: u32,
    said_new: u32,
    /// The instant of the last one that was taken in, ns.
    agreed_ns: Option<u64>,
    /// What it sees of a pose that is off, m and rad: more than so much.
    pub(crate) sees: [f64; 3],
    /// By how much the pose may be off because of what it says, m and rad.
    pub(crate) doubted: [f64; 2],
    /// By how much its last reading was off, where that contradicted.
    pub(crate) off: Option<[f64; 3]>,
    /// By how much it was off when it began to contradict, while nobody followed the pose.
    pub(crate) elsewhere: Option<([f64; 3], u64)>,
    /// How far wheels had driven at its last reading, and how far they did while it wasn't heard, since it agreed last, m.
    driven_m: f64,
    pub(crate) unheard_m: f64,
}

impl Default for Standing {
    fn default() -> Self {
        Standing {
            verdict: Verdict::Awaited,
            nis: 0.0,
            doubt: 0.0,
            agrees_s: 0.0,
            heard_ns: None,
            said: [f64::NAN; 3],
            expected: [0.0; 3],
            is_new: true,
            same: (0, 0.0),
            longest: 0,
            said_new: 0,
            agreed_ns: None,
            sees: [0.0; 3],
            doubted: [0.0; 2],
            off: None,
            elsewhere: None,
            driven_m: 0.0,
            unheard_m: 0.0,
        }
    }
}

impl Standing {
    /// Whether what it says is taken in where it agrees.
    pub fn is_believed(&self) -> bool {
        !matches!(self.verdict, Verdict::Frozen | Verdict::Contradicts)
    }

    /// Whether it contradicts more often than outliers do.
    pub(crate) fn is_doubtful(&self) -> bool {
        self.doubt > DOUBTFUL
    }

    /// Whether it says something else than before: what froze has no clock any more.
    pub(crate) fn is_new(&self) -> bool {
        self.is_new
    }

    /// Whether it was heard lately, and agreed.
    pub(crate) fn agrees_now(&self, instant_ns: u64) -> bool {
        self.is_believed() && !self.is_doubtful() && self.silent_s(instant_ns) <= LONGEST_S
    }

    /// Whether it was taken in after another was heard last, is believed yet, and would see what that one is off.
    pub(crate) fn refutes(&self, other: &Standing, off: &[f64; 3]) -> bool {
        let sees = off.iter().zip(self.sees).any(|(off, sees)| off.abs() > sees);
        self.is_believed() && self.agreed_ns > other.heard_ns && sees
    }

    /// How long it was silent before an instant, s; infinite where nothing was heard.
    pub(crate) fn silent_s(&self, instant_ns: u64) -> f64 {
        self.heard_ns.map_or(f64::INFINITY, |heard_ns| instant_ns.saturating_sub(heard_ns) as f64 * 1e-9)
    }

    /// For how long a reading of an instant tells of it, s.
    pub(crate) fn since_s(&self, instant_ns: u64) -> f64 {
        self.silent_s(instant_ns).min(LONGEST_S)
    }

    /// A reading comes, when wheels have driven so far. What they drove before it began to contradict, or while it was silent,
    /// nobody saw.
    pub(crate) fn comes(&mut self, instant_ns: u64, silent_ns: u64, driven_m: f64) {
        if self.off.is_none() || self.silent_s(instant_ns) > silent_ns as f64 * 1e-9 {
            self.unheard_m += driven_m - self.driven_m;
        }
        self.driven_m = driven_m;
    }

    /// Whether it says to the bit what it said before, though what is expected went on by more than a bound, or far longer than
    /// it ever did, while wheels drive. Remembers what it says.
    pub(crate) fn repeats(
        &mut self,
        said: [f64; 3],
        expected: [f64; 3],
        bound: [f64; 3],
        driven_m: f64,
    ) -> bool {
        // Means of more or fewer readings differ by rounding.
        let is_same = said.iter().zip(&self.said).all(|(a, b)| (a - b).abs() <= ROUNDING * a.abs());
        self.is_new = !is_same;
        if !is_same {
            (self.said, self.expected) = (said, expected);
            if self.verdict != Verdict::Frozen {
                self.longest = self.longest.max(self.same.0);
            }
            self.same = (0, driven_m);
            self.said_new = self.said_new.saturating_add(1);
            return false;
        }
        let (count, from_m) = &mut self.same;
        *count = count.saturating_add(1);
        let is_unheard_of =
            self.said_new >= KNOWN_NEW && *count > self.longest.saturating_mul(LONGER).saturating_add(SAME);
        is_unheard_of && driven_m - *from_m > DROVE_M
            || (0..3).any(|n| (expected[n] - self.expected[n]).abs() > bound[n])
    }

    /// A reading of an instant contradicts the others (1) or doesn't, as a share; whether it is to be taken in.
    pub(crate) fn judge(&mut self, instant_ns: u64, contradicts: f64, fault: Verdict) -> bool {
        let agrees = contradicts < 1.0;
        let since_s = self.since_s(instant_ns);
        self.heard_ns = Some(instant_ns);
        let weight = 1.0 - (-since_s / DOUBT_TIME_S).exp();
        self.doubt += (contradicts - self.doubt) * weight;
        if agrees {
            self.agrees_s += since_s;
        } else {
            self.agrees_s = 0.0;
        }
        if self.is_believed() {
            self.verdict = if self.doubt > DOUBTED { fault } else { Verdict::Good };
        } else if self.agrees_s >= RETURN_S || self.verdict == Verdict::Frozen && agrees && self.is_new {
            // What froze and says something new that agrees is alive: trackers that lose their markers now and then would
            // never agree for long.
            (self.verdict, self.doubt) = (Verdict::Good, 0.0);
        }
        let takes = agrees && self.is_believed();
        if takes {
            (self.elsewhere, self.off, self.unheard_m) = (None, None, 0.0);
            self.agreed_ns = Some(instant_ns);
        }
        takes
    }

    /// It isn't believed from now on, whatever it says, until it agreed for long enough.
    pub(crate) fn name(&mut self, instant_ns: u64, fault: Verdict) {
        (self.verdict, self.agrees_s, self.heard_ns) = (fault, 0.0, Some(instant_ns));
    }

    /// It is believed from now on, whatever was before.
    pub(crate) fn trust(&mut self, instant_ns: u64) {
        *self = Standing {
            verdict: Verdict::Good,
            heard_ns: Some(instant_ns),
            agreed_ns: Some(instant_ns),
            said: self.said,
            expected: self.expected,
            driven_m: self.driven_m,
            longest: self.longest,
            said_new: self.said_new,
            ..Standing::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_froze_is_believed_again_when_it_says_something_new_that_agrees() {
        let mut standing = Standing::default();
        let mut now_ns = 0;
        let mut say = |standing: &mut Standing, said: f64, expected: f64| {
            now_ns += 10_000_000;
            let repeats = standing.repeats([said, 0.0, 0.0], [expected, 0.0, 0.0], [1e-3; 3], 0.0);
            let agrees = !repeats && (said - expected).abs() < 1e-3;
            standing.judge(
                now_ns,
                f64::from(u8::from(!agrees)),
                if repeats { Verdict::Frozen } else { Verdict::Contradicts },
            );
            standing.verdict
        };
        assert_eq!(say(&mut standing, 0.0, 0.0), Verdict::Good);
        let last = (1..=40).map(|n| say(&mut standing, 0.0, 2e-3 * f64::from(n))).last();
        assert_eq!(last, Some(Verdict::Frozen));
        assert_eq!(
            say(&mut standing, 0.0, 0.0),
            Verdict::Frozen,
            "the same again, where it is right by chance"
        );
        assert_eq!(say(&mut standing, 0.5, 0.1), Verdict::Frozen, "new, but wrong");
        assert_eq!(say(&mut standing, 0.1, 0.1), Verdict::Good);
    }

    #[test]
    fn what_never_said_the_same_is_frozen_when_it_does_and_wheels_drive() {
        let frozen = |steps: u32, drives: bool| {
            let mut standing = Standing::default();
            let mut driven_m = 0.0;
            let mut say = |standing: &mut Standing, said: f64| {
                driven_m += if drives { 1e-3 } else { 0.0 };
                standing.repeats([said, 0.0, 0.0], [0.0; 3], [1.0; 3], driven_m)
            };
            for n in 0..200 {
                say(&mut standing, 0.1 * f64::from(n / steps));
            }
            (1..=100).find(|_| say(&mut standing, 0.5))
        };
        assert_eq!(frozen(1, true), Some(12), "the first one is new");
        assert_eq!(frozen(1, false), None, "at rest");
        assert_eq!(frozen(3, true), None, "it said too little that is new yet");
        assert_eq!(frozen(2, true), Some(16), "it says the same twice each time");
    }

    #[test]
    fn what_contradicts_is_named_within_a_third_of_a_second_and_returns_after_a_second() {
        for period_ns in [1_000_000, 10_000_000, 50_000_000] {
            let mut standing = Standing::default();
            let mut now_ns = 0;
            let mut say = |standing: &mut Standing, agrees: bool, for_ns: u64| {
                for _ in 0..for_ns / period_ns {
                    now_ns += period_ns;
                    standing.judge(now_ns, f64::from(u8::from(!agrees)), Verdict::Contradicts);
                }
                standing.verdict
            };
            assert_eq!(say(&mut standing, true, 500_000_000), Verdict::Good);
            assert_eq!(say(&mut standing, false, 150_000_000), Verdict::Good, "outliers pass");
            assert_eq!(say(&mut standing, false, 150_000_000), Verdict::Contradicts, "{period_ns}");
            assert_eq!(say(&mut standing, true, 900_000_000), Verdict::Contradicts);
            assert_eq!(say(&mut standing, true, 150_000_000), Verdict::Good);
        }
    }
}
