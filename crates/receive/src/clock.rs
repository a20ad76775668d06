//! Instants of another clock on ours.
//!
//! What is sent before it is heard bounds how far the two clocks are apart from one side, an answer to something of ours
//! from the other. Between the two bounds lies the truth; where only one side is known, or the other is far away, that bound stands for it.

/// Of each second in which something was heard, the strictest bounds are kept.
const BUCKET_NS: u64 = 1_000_000_000;
/// Of so many of them: what a silence hides is judged by what was heard before it.
const BUCKETS: usize = 4;
/// Two clocks drift apart by so much in a second at most: 100 ppm, as quartz in a computer has it.
const DRIFT_NS: i128 = BUCKET_NS as i128 / 10_000;
/// What contradicts all before it by more than this, ns, is put aside until so many in a row say the same: a clock that was set.
const JUMP_NS: i128 = 10_000_000;
const IN_A_ROW: u32 = 10;

/// Bounds that are farther apart than this, ns, don't have the truth in their middle: who answers so late is held up on one way.
const FAR_APART_NS: i128 = 20_000_000;

/// An instant on our clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// When, ns of our clock.
    pub ours_ns: u64,
    /// It may be off by so much, ns; `None` where only one side is bounded.
    pub bound_ns: Option<u64>,
}

/// What of two instants is put before the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Least,
    Most,
}

/// The offset of our clock to another one, from both sides.
#[derive(Clone, Debug, Default)]
pub struct ClockMap {
    least_ns: Bound,
    most_ns: Bound,
    /// The second in which something was heard last.
    now: u64,
    /// How many in a row contradicted, of either side: what fits one of them says nothing of the other.
    aside: [u32; 2],
}

/// The strictest bound of each of the last seconds in which something was heard, the newest first.
#[derive(Clone, Debug, Default)]
struct Bound([Option<(u64, i128)>; BUCKETS]);

impl Bound {
    fn put(&mut self, bucket: u64, offset_ns: i128, side: Side) {
        if let Some((of, kept)) = &mut self.0[0]
            && *of == bucket
        {
            *kept = match side {
                Side::Least => offset_ns.max(*kept),
                Side::Most => offset_ns.min(*kept),
            };
            return;
        }
        self.0.rotate_right(1);
        self.0[0] = Some((bucket, offset_ns));
    }

    /// What they all say of the second `now`: an old one says less, for clocks drift.
    fn strictest(&self, side: Side, now: u64) -> Option<i128> {
        let drift_ns = |of: u64| i128::from(now.saturating_sub(of)) * DRIFT_NS;
        let all = self.0.iter().flatten();
        match side {
            Side::Least => all.map(|(of, offset_ns)| offset_ns - drift_ns(*of)).max(),
            Side::Most => all.map(|(of, offset_ns)| offset_ns + drift_ns(*of)).min(),
        }
    }
}

impl ClockMap {
    /// What was so at an instant of the other clock was heard at one of ours, or before. False where that contradicts
    /// all that was heard so far, and is left out.
    pub fn before(&mut self, foreign_ns: u64, ours_ns: u64) -> bool {
        self.take(Side::Most, i128::from(ours_ns) - i128::from(foreign_ns), ours_ns)
    }

    /// What was so at an instant of the other clock followed something of ours. False as in [`ClockMap::before`].
    pub fn after(&mut self, foreign_ns: u64, ours_ns: u64) -> bool {
        self.take(Side::Least, i128::from(ours_ns) - i128::from(foreign_ns), ours_ns)
    }

    fn take(&mut self, side: Side, offset_ns: i128, ours_ns: u64) -> bool {
        let bucket = ours_ns / BUCKET_NS;
        self.now = bucket;
        let contradicts = match side {
            // Nothing is heard before it was sent.
            Side::Most => self.offset().is_some_and(|(now_ns, _)| offset_ns < now_ns - JUMP_NS),
            Side::Least => self.offset().is_some_and(|(now_ns, _)| offset_ns > now_ns + JUMP_NS),
        };
        if contradicts {
            self.aside[side as usize] += 1;
            if self.aside[side as usize] < IN_A_ROW {
                return false;
            }
            self.begin_anew();
        }
        self.aside[side as usize] = 0;
        self.put(offset_ns, side);
        // Both can't be true: a clock was set by less than a jump, and what came last is true.
        if self.offset().is_some_and(|(_, bound_ns)| bound_ns.is_some_and(|bound_ns| bound_ns < 0)) {
            self.begin_anew();
            self.put(offset_ns, side);
        }
        true
    }

    fn begin_anew(&mut self) {
        *self = ClockMap { now: self.now, ..ClockMap::default() };
    }

    fn put(&mut self, offset_ns: i128, side: Side) {
        match side {
            Side::Least => self.least_ns.put(self.now, offset_ns, side),
            Side::Most => self.most_ns.put(self.now, offset_ns, side),
        }
    }

    /// How far ours is ahead, and how well that is known: less than nothing where both bounds contradict each other.
    fn offset(&self) -> Option<(i128, Option<i128>)> {
        let (least, most) =
            (self.least_ns.strictest(Side::Least, self.now), self.most_ns.strictest(Side::Most, self.now));
        match (least, most) {
            (None, None) => None,
            (Some(one), None) | (None, Some(one)) => Some((one, None)),
            (Some(least), Some(most)) if most - least > FAR_APART_NS => {
                Some((most, Some(most - least + DRIFT_NS)))
            }
            (Some(least), Some(most)) => Some(((least + most) / 2, Some((most - least) / 2 + DRIFT_NS))),
        }
    }

    /// An instant of the other clock; `None` before anything was heard, and where it lies before ours began.
    pub fn map(&self, foreign_ns: u64) -> Option<Mapped> {
        let (offset_ns, bound_ns) = self.offset()?;
        let ours_ns = u64::try_from(i128::from(foreign_ns) + offset_ns).ok()?;
        Some(Mapped { ours_ns, bound_ns: bound_ns.and_then(|bound_ns| u64::try_from(bound_ns).ok()) })
    }
}
