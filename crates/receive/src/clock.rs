//! Instants of another clock on ours.
//!
//! What is sent before it is heard bounds how far the two clocks are apart from one side, an answer to something of ours
//! from the other. Between the two bounds lies the truth; where only one side is known, that bound stands for it.

/// Bounds count for so long: clocks drift away from each other.
const BUCKET_NS: u64 = 1_000_000_000;
const BUCKETS: usize = 4;
/// Two clocks drift apart by so much at most: 100 ppm, as quartz in a computer has it.
const DRIFT_NS: i128 = (BUCKET_NS as i128 * BUCKETS as i128) / 10_000;
/// What contradicts all before it by more than this, ns, is put aside until so many in a row say the same: a clock that was set.
const JUMP_NS: i128 = 10_000_000;
const IN_A_ROW: u32 = 10;

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
    /// How many in a row contradicted, of either side: what fits one of them says nothing of the other.
    aside: [u32; 2],
}

/// The strictest bound of each of the last seconds.
#[derive(Clone, Debug, Default)]
struct Bound([Option<(u64, i128)>; BUCKETS]);

impl Bound {
    fn put(&mut self, bucket: u64, offset_ns: i128, side: Side) {
        let place = &mut self.0[(bucket % BUCKETS as u64) as usize];
        match place {
            Some((of, kept)) if *of == bucket => {
                *kept = match side {
                    Side::Least => offset_ns.max(*kept),
                    Side::Most => offset_ns.min(*kept),
                }
            }
            _ => *place = Some((bucket, offset_ns)),
        }
    }

    /// What is older than the last seconds counts no more.
    fn forget(&mut self, bucket: u64) {
        for place in &mut self.0 {
            *place = place.filter(|(of, _)| bucket.abs_diff(*of) < BUCKETS as u64);
        }
    }

    fn strictest(&self, side: Side) -> Option<i128> {
        let all = self.0.iter().flatten().map(|(_, offset_ns)| *offset_ns);
        match side {
            Side::Least => all.max(),
            Side::Most => all.min(),
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
        self.least_ns.forget(bucket);
        self.most_ns.forget(bucket);
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
            *self = ClockMap::default();
        }
        self.aside[side as usize] = 0;
        match side {
            Side::Least => self.least_ns.put(bucket, offset_ns, side),
            Side::Most => self.most_ns.put(bucket, offset_ns, side),
        }
        true
    }

    /// How far ours is ahead, and how well that is known.
    fn offset(&self) -> Option<(i128, Option<i128>)> {
        match (self.least_ns.strictest(Side::Least), self.most_ns.strictest(Side::Most)) {
            (None, None) => None,
            (Some(one), None) | (None, Some(one)) => Some((one, None)),
            (Some(least), Some(most)) => {
                Some(((least + most) / 2, Some((most - least).abs() / 2 + DRIFT_NS)))
            }
        }
    }

    /// An instant of the other clock; `None` before anything was heard, and where it lies before ours began.
    pub fn map(&self, foreign_ns: u64) -> Option<Mapped> {
        let (offset_ns, bound_ns) = self.offset()?;
        let ours_ns = u64::try_from(i128::from(foreign_ns) + offset_ns).ok()?;
        Some(Mapped { ours_ns, bound_ns: bound_ns.and_then(|bound_ns| u64::try_from(bound_ns).ok()) })
    }
}
