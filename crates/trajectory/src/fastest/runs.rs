//! Ways that are passed with a speed: what leads from rest onto their start, and from their end to rest.
//!
//! A run goes on as the way ends: its bend fades to nothing, then it is straight, and the heading turns on in proportion. It is passed
//! no faster than the end of the way beside it, and so for half a window of the mean within the way: so the mean has that speed at the end.

use super::smooth::Progress;
use super::{FastestError, FastestTrajectory, PlatformBounds};
use crate::geometry::GeometricPath;
use crate::reach::{self, Interval};

/// Speeds along x and y with which a motion passes the ends of its way, m/s; 0: it rests there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passing {
    /// At its start.
    pub start_m_s: f64,
    /// At its end.
    pub end_m_s: f64,
}

/// An end of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WayEnd {
    /// The first.
    Start,
    /// The last.
    End,
}

impl WayEnd {
    const BOTH: [WayEnd; 2] = [WayEnd::Start, WayEnd::End];

    /// The direction in which σ leaves the way.
    fn sign(self) -> f64 {
        match self {
            WayEnd::Start => -1.0,
            WayEnd::End => 1.0,
        }
    }
}

impl std::fmt::Display for WayEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            WayEnd::Start => "start",
            WayEnd::End => "end",
        })
    }
}

/// A speed is kept if it is met to this part of it.
const MET: f64 = 2e-3;
/// A fading bend takes so much of the jerk.
const FADING: f64 = 0.5;
/// A run is longer by this than it must be: the mean may lower limits a little.
const LONGER: f64 = 1.1;
/// Intervals on which a run's length is sought, how often it is doubled and then halved between.
const INTERVALS: usize = 16;
const DOUBLINGS: usize = 40;
const HALVINGS: usize = 12;
/// A joint nearer to a joint of the way than this, over the whole, is that joint.
const SAME: f64 = 1e-9;

/// What is beyond an end of a way.
#[derive(Clone, Debug)]
struct Run {
    /// The way at that end.
    axes: [[f64; 4]; 3],
    /// Over which σ its bend fades.
    fading: f64,
    length: f64,
    /// σ̇ at most, there and up to so far within the way.
    rate: f64,
    within: f64,
}

impl Run {
    fn new(
        path: &impl GeometricPath,
        end: WayEnd,
        speed_m_s: f64,
        bounds: &PlatformBounds,
    ) -> Result<Option<Run>, FastestError> {
        if speed_m_s == 0.0 {
            return Ok(None);
        }
        let axes = match end {
            WayEnd::Start => path.sample(0.0, 1.0),
            WayEnd::End => path.sample(path.length(), -1.0),
        };
        let along = axes[0][1].hypot(axes[1][1]);
        if along <= 0.0 {
            return Err(FastestError::OnTheSpot(end));
        }
        let rate = speed_m_s / along;
        let limits = &bounds.limits;
        let (least, turn) = (axes[0][2].hypot(axes[1][2]) / limits.jerk_m_s3, axes[2][2].abs());
        let fading = rate.powi(3) * least.max(turn / limits.angular_jerk_rad_s3) / FADING;
        // Half of the longest window: that of a change from speeding up to braking.
        let half_s = (limits.acceleration_m_s2 / limits.jerk_m_s3)
            .max(limits.angular_acceleration_rad_s2 / limits.angular_jerk_rad_s3);
        let within = (half_s * rate).min(path.length());
        let mut run = Run { axes, fading, length: f64::INFINITY, rate, within };
        let even = fading.max(half_s * rate);
        let rest = run.resting(end, even, bounds);
        run.length = even
            + LONGER * rest.ok_or(FastestError::NoSpeed { end, asked_m_s: speed_m_s, found_m_s: 0.0 })?;
        Ok(Some(run))
    }

    /// The way so far beyond the end.
    fn at(&self, end: WayEnd, beyond: f64) -> [[f64; 4]; 3] {
        let (sign, bent) = (end.sign(), beyond.min(self.fading));
        // How much of the bend is left, and what it came to in its rate and its place.
        let part = if self.fading > 0.0 { bent / self.fading } else { 1.0 };
        let turned = bent * (1.0 - part / 2.0);
        let moved = bent * bent * (0.5 - part / 6.0) + turned * (beyond - bent);
        let third = if beyond < self.fading { -sign / self.fading } else { 0.0 };
        self.axes.map(|[at, rate, bend, _]| {
            [
                at + sign * rate * beyond + bend * moved,
                rate + sign * bend * turned,
                bend * (1.0 - part),
                bend * third,
            ]
        })
    }

    /// How long it must be behind its even part to go from rest to its speed, or back; `None` where no length does.
    fn resting(&self, end: WayEnd, even: f64, bounds: &PlatformBounds) -> Option<f64> {
        let (x, acceleration) = (self.rate * self.rate, bounds.acceleration());
        let is_enough = |length: f64| {
            let bend = |at: usize| {
                let part = length * at as f64 / INTERVALS as f64;
                bounds.look(&self.at(end, even + if end == WayEnd::End { part } else { length - part })).0
            };
            let interval = |at: usize| Interval {
                length: length / INTERVALS as f64,
                ends: [bend(at), bend(at + 1)],
                share: 1.0,
            };
            let intervals: Vec<Interval> = (0..INTERVALS).map(interval).collect();
            let ends = if end == WayEnd::End { [x, 0.0] } else { [0.0, x] };
            let found = reach::fastest(&intervals, &[x; INTERVALS + 1], &acceleration, ends);
            found.is_ok_and(|found| found[INTERVALS] >= ends[1] * (1.0 - SAME))
        };
        let along = self.axes[0][1].hypot(self.axes[1][1]);
        let shortest = 0.5 * x * along / bounds.limits.acceleration_m_s2;
        let mut tried = std::iter::successors(Some(shortest), |length| Some(2.0 * length)).take(DOUBLINGS);
        let mut enough = tried.find(|length| is_enough(*length))?;
        let mut short = if enough == shortest { 0.0 } else { 0.5 * enough };
        for _ in 0..HALVINGS {
            let middle = 0.5 * (short + enough);
            if is_enough(middle) { enough = middle } else { short = middle }
        }
        Some(enough)
    }
}

/// A way with runs beyond its ends.
#[derive(Clone, Debug)]
pub struct WithRuns<P> {
    path: P,
    runs: [Option<Run>; 2],
}

impl<P: GeometricPath> WithRuns<P> {
    fn run(&self, end: WayEnd) -> Option<&Run> {
        self.runs[end as usize].as_ref()
    }

    /// When a progress passes each end with a run beyond it, s, and what part of its speed it has there.
    fn passed(&self, progress: &Progress) -> [Option<(f64, f64)>; 2] {
        let ends = self.ends();
        WayEnd::BOTH.map(|end| {
            let time_s = progress.time_s(ends[end as usize]);
            Some((time_s, progress.at(time_s)[1] / self.run(end)?.rate))
        })
    }

    /// σ at the ends of the way.
    fn ends(&self) -> [f64; 2] {
        let begin = self.run(WayEnd::Start).map_or(0.0, |run| run.length);
        [begin, begin + self.path.length()]
    }
}

impl<P: GeometricPath> GeometricPath for WithRuns<P> {
    fn length(&self) -> f64 {
        self.ends()[1] + self.run(WayEnd::End).map_or(0.0, |run| run.length)
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        self.sample_near(sigma, side, &mut 0)
    }

    fn sample_near(&self, sigma: f64, side: f64, piece: &mut usize) -> [[f64; 4]; 3] {
        let [begin, end] = self.ends();
        let is_before = sigma < begin || (sigma == begin && side < 0.0);
        let is_behind = sigma > end || (sigma == end && side >= 0.0);
        match (self.run(WayEnd::Start), self.run(WayEnd::End)) {
            (Some(run), _) if is_before => run.at(WayEnd::Start, begin - sigma),
            (_, Some(run)) if is_behind => run.at(WayEnd::End, sigma - end),
            _ => self.path.sample_near(sigma - begin, side, piece),
        }
    }

    fn breaks(&self) -> Vec<f64> {
        if self.runs.iter().all(Option::is_none) {
            return self.path.breaks();
        }
        let ends = self.ends();
        let mut breaks: Vec<f64> = self.path.breaks().iter().map(|at| ends[0] + at).collect();
        for end in WayEnd::BOTH {
            let Some(run) = self.run(end) else { continue };
            let (at, sign) = (ends[end as usize], end.sign());
            breaks.extend([run.length, run.fading, -run.within].map(|beyond| at + sign * beyond));
        }
        breaks.sort_by(f64::total_cmp);
        let near = SAME * self.length();
        breaks.dedup_by(|next, before| *next - *before < near);
        // The last ones are the ends themselves, to the bit.
        (breaks[0], *breaks.last_mut().expect("a way has ends")) = (0.0, self.length());
        breaks
    }

    fn most_rate(&self, sigma: f64) -> f64 {
        let near = SAME * self.length();
        let rates = WayEnd::BOTH.into_iter().zip(self.ends()).filter_map(|(end, at)| {
            let run = self.run(end)?;
            (end.sign() * (sigma - at) >= -run.within - near).then_some(run.rate)
        });
        rates.fold(f64::INFINITY, f64::min)
    }
}

impl<P: GeometricPath> FastestTrajectory<WithRuns<P>> {
    /// The fastest motion along a path that passes its ends with speeds: from rest to rest, with what leads onto it and away from it.
    pub fn passing(
        path: P,
        speeds: Passing,
        bounds: &PlatformBounds,
    ) -> Result<FastestTrajectory<WithRuns<P>>, FastestError> {
        let asked = [speeds.start_m_s, speeds.end_m_s];
        let run = |end: WayEnd| Run::new(&path, end, asked[end as usize], bounds);
        let runs = [run(WayEnd::Start)?, run(WayEnd::End)?];
        let mut found = FastestTrajectory::that(WithRuns { path, runs }, bounds, |way, progress| {
            way.passed(progress).into_iter().flatten().all(|(_, met)| (met - 1.0).abs() <= MET)
        })?;
        for (end, passed) in WayEnd::BOTH.into_iter().zip(found.path.passed(&found.progress)) {
            let Some((time_s, met)) = passed else { continue };
            let asked_m_s = asked[end as usize];
            if met < 1.0 - MET {
                return Err(FastestError::NoSpeed { end, asked_m_s, found_m_s: met * asked_m_s });
            }
            found.passes_s[end as usize] = Some(time_s);
        }
        Ok(found)
    }
}
