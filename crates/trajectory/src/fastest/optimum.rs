//! The shortest motion near another one, over the whole of its grid at once.
//!
//! The other motion, as a spline over even steps of its time s, takes the place of the way: with x = ṡ² and u =
//! s̈ a limit on the speed is linear in x, one on the acceleration a ball or a plane in (x, u), and one on the
//! jerk a ball in (x, u, u') whose radius is 1/√x.
//!
//! So nothing is singular where the motion rests, and x is about 1 everywhere. On each step u' is constant.
//!
//! The least time is found by a primal-dual interior-point method (S. Boyd and L. Vandenberghe, *Convex
//! Optimization*, 2004, 11.7), with the jerk's radius, which alone isn't convex, taken without its curvature;
//! each of its linear systems is solved along the grid, as that of a linear regulator.
//!
//! Where the motion exceeds limits between the looks, they are lowered on that step. What is found is the best
//! near by, not surely the best.

mod scene;
mod sides;

use super::bounds::PlatformBounds;
use super::smooth::{PARTS, Progress};
use crate::geometry::GeometricPath;
use scene::{Bar, Scene, State};

/// Steps at a joint of the way, but within a window of the mean at least and at most so many, the fewest where the jerk costs less than this
/// part of the time; and between two rests at least. With more than so many nothing is sought.
const AT_A_JOINT: f64 = 3.0;
const IN_A_WINDOW: [f64; 3] = [2.5, 5.0, 20.0];
const COSTLY: f64 = 0.03;
const LEAST_STEPS: usize = 32;
const MOST_STEPS: f64 = 2000.0;
/// The first x is so far within all limits, and the first of a further round within lowered ones, as a factor on the time.
const WITHIN: f64 = 1.05;
const WITHIN_AGAIN: f64 = 1.01;
/// How often the best motion near by is sought; and again, as long as its rate is off that of the one before by so much in the mean.
const SEARCHES: usize = 4;
const UNEVEN: f64 = 0.02;
/// Rounds of lowering limits, until none is exceeded by more; a last stretch takes that away.
const ROUNDS: usize = 4;
const NEAR: f64 = 5e-4;
/// Rounds where motors become too hot: what their heat costs is found, too.
const HOT_ROUNDS: usize = 16;
/// And until the greatest mean square is so near to what they bear, or above it by no more.
const HEAT_LEFT: f64 = 0.01;
const TOO_HOT: f64 = 1e-3;
/// Gauss and Legendre's rule of three points.
const GAUSS: [[f64; 2]; 3] =
    [[0.112_701_665_379_258_3, 5.0 / 18.0], [0.5, 8.0 / 18.0], [0.887_298_334_620_741_7, 5.0 / 18.0]];
/// What all prices make of the time before it is told whether a motion is sought again, and at the end.
const FIRST_GAP: f64 = 1e-2;
const LAST_GAP: f64 = 1e-3;

/// What limits and motors say to a motion.
pub(super) struct Assessment {
    /// By how many times longer each of its pieces must take to keep the limits.
    pub(super) paces: Vec<f64>,
    /// Of each motor the greatest mean square of its torque, over what it bears for ever, in any window that a step lies in.
    pub(super) squares: Vec<Vec<f64>>,
}

/// A motion between two rests.
struct Span {
    spline: Progress,
    scene: Scene,
    states: Vec<State>,
    bars: Vec<Bar>,
}

impl Span {
    /// All of a motion, which begin where it goes evenly; `None` where it goes back, or is too long, or has no time.
    fn all<P: GeometricPath>(
        path: &P,
        bounds: &PlatformBounds,
        near: &Progress,
        [window_s, costs]: [f64; 2],
        joints: &[f64],
    ) -> Option<Vec<Span>> {
        // As many as the window asks for, and more where the way itself does.
        let windows = near.duration_s() / window_s;
        if !windows.is_finite() {
            return None;
        }
        let [few, enough, most] = IN_A_WINDOW;
        let least = (enough * costs / COSTLY).clamp(few, enough);
        let [least, most] = [least, most].map(|steps| steps * windows);
        let asked = (AT_A_JOINT * joints.len() as f64).clamp(least, most);
        if asked > MOST_STEPS {
            return None;
        }
        let span = |rests_s: &[f64]| {
            let part = (rests_s[1] - rests_s[0]) / near.duration_s();
            let steps = ((part * asked) as usize).max(LEAST_STEPS);
            let spline = near.spline([rests_s[0], rests_s[1]], steps)?;
            let scene = Scene::new(path, bounds, &spline, joints);
            let states = vec![[scene.even(), 0.0, 0.0]; steps];
            Some(Span { spline, scene, states, bars: Vec::new() })
        };
        near.rests_s().windows(2).map(span).collect()
    }

    /// Begins slower as a whole, so that it is within limits that it exceeds by so much.
    fn begin(&mut self, most: f64) {
        let within = if self.bars.is_empty() { WITHIN } else { WITHIN_AGAIN };
        let factor = (most * within).powi(-2);
        self.states.as_flattened_mut().iter_mut().for_each(|part| *part *= factor);
        self.scene.begin(&self.states, &mut self.bars);
    }

    /// Moves to the least time but for a gap.
    fn solve(&mut self, last_gap: f64) {
        self.scene.solve(&mut self.states, &mut self.bars, last_gap);
    }

    /// Adds its motion to one before it, from a time on; when it ends, s.
    fn push_knots(&self, from_s: f64, knots: &mut Vec<(f64, [f64; 3])>) -> f64 {
        let step_s = self.spline.duration_s() / self.states.len() as f64;
        let mut time_s = from_s;
        for (step, [x, u, w]) in self.states.iter().copied().enumerate() {
            let [sigma, rate, second, _] = self.spline.in_piece(step, 0.0).1;
            knots.push((time_s, [sigma, rate * x.sqrt(), second * x + rate * u / step_s]));
            let takes = GAUSS.map(|[part, weight]| weight / (x + part * (2.0 * u + part * w)).sqrt());
            time_s += step_s * takes.iter().sum::<f64>();
        }
        time_s
    }
}

/// The motion of all spans, one after the other.
fn together(spans: &[Span], length: f64) -> Progress {
    let (mut knots, mut time_s) = (Vec::new(), 0.0);
    for span in spans {
        time_s = span.push_knots(time_s, &mut knots);
    }
    knots.push((time_s, [length, 0.0, 0.0]));
    Progress::through(&knots)
}

/// How far the rates of motions are off those that they are sought near to, in the mean.
fn unevenness(spans: &[Span]) -> f64 {
    let states = || spans.iter().flat_map(|span| &span.states);
    let off = states().map(|[x, ..]| (x.sqrt() - 1.0).abs()).sum::<f64>();
    off / states().count() as f64
}

/// The shortest motion near one whose accelerations change within a window of time; `None` where none is found.
///
/// `near` may exceed limits itself. `look` tells what limits and motors say to a motion.
pub(super) fn shortest<P: GeometricPath>(
    path: &P,
    bounds: &PlatformBounds,
    near: &Progress,
    [window_s, costs]: [f64; 2],
    look: impl Fn(&Progress) -> Assessment,
) -> Option<Progress> {
    let joints = path.breaks();
    let sought = |near: &Progress| {
        let mut spans = Span::all(path, bounds, near, [window_s, costs], &joints)?;
        for span in &mut spans {
            span.begin(1.0);
            span.solve(FIRST_GAP);
        }
        Some(spans)
    };
    let mut spans = sought(near)?;
    for _ in 1..SEARCHES {
        // What goes so much faster or slower is sought near to again: its steps are then even in its own time.
        if unevenness(&spans) <= UNEVEN {
            break;
        }
        let Some(again) = sought(&together(&spans, path.length())) else { break };
        spans = again;
    }
    let mut best: Option<Progress> = None;
    let (mut round, mut rounds) = (1, ROUNDS);
    loop {
        spans.iter_mut().for_each(|span| span.solve(LAST_GAP));
        let mut found = together(&spans, path.length());
        let seen = look(&found);
        let hottest = seen.squares.iter().flatten().copied().fold(0.0, f64::max);
        let most = seen.paces.iter().copied().fold(1.0, f64::max);
        found.stretch(most);
        let is_cool = hottest <= 1.0 + TOO_HOT;
        // What rests between its looks has no time.
        if is_cool && found.duration_s() < best.as_ref().map_or(f64::INFINITY, Progress::duration_s) {
            best = Some(found);
        }
        // Where heat costs anything, it is as hot as it may be.
        let is_hot = !is_cool || spans.iter().any(|span| span.scene.pays());
        if is_hot {
            rounds = HOT_ROUNDS;
        }
        let is_done = most <= 1.0 + NEAR && is_cool && (!is_hot || hottest > 1.0 - HEAT_LEFT);
        if is_done || round == rounds {
            return best;
        }
        round += 1;
        let mut first = 0;
        for Span { scene, states, .. } in &mut spans {
            for step in 0..states.len() {
                let pieces = PARTS * (first + step)..PARTS * (first + step + 1);
                let pace = seen.paces[pieces].iter().copied().fold(1.0, f64::max);
                scene.lower(step, pace);
                for motor in 0..scene.motors {
                    scene.charge([step, motor], seen.squares[motor][first + step]);
                }
            }
            first += states.len();
        }
        spans.iter_mut().for_each(|span| span.begin(most));
    }
}
