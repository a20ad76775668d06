//! All that is asked of a motion between two rests, and the moves towards its least time.

use std::ops::Range;

use super::super::bounds::PlatformBounds;
use super::super::smooth::Progress;
use super::sides::{Disk, is_gentle, keep_binding};
use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::trajectory::Setpoint;

/// What all prices make of the time when it begins, and when it begins again.
const GAP: f64 = 1.0;
const GAP_AGAIN: f64 = 0.01;
/// What part of the gap is asked for first, and next: what the last move left, within these. A move that makes so much of itself is whole.
const FIRST_LESS: f64 = 0.2;
const LESS: [f64; 2] = [0.05, 0.9];
const WHOLE: f64 = 0.5;
/// Moves at most, and how far one is cut at most.
const MOVES: usize = 60;
const SHORTEST: f64 = 1e-6;
const SHORTER: f64 = 0.8;
/// A move leaves so much of what is left to each limit, and of its price.
const LEFT: f64 = 0.01;
/// A cost becomes so many times as much as the mean square is, to this power: half as much heat costs two to four times as much.
const DEARER: f64 = 1.5;
/// What the heat of a motor costs first: of motions that speed up evenly and brake again, as many seconds as they take for what they heat, that is
/// the least where the mean square of the torque is 1.
const FIRST_COST: f64 = 1.0 / 3.0;

/// x, u and u' at the beginning of a step, or at a look, where the step's length counts 1.
pub(super) type State = [f64; 3];
/// A symmetric matrix over these: its first row's three, the second one's two, and the last.
type Square = [f64; 6];

/// What limits ask at a moment of a step, each over itself, of x, u and u' there.
struct Look {
    /// What part of the step is behind it.
    part: f64,
    /// What part of the step's time is counted there.
    weight: f64,
    /// Speeds and planes: x·side[0] + u·side[1] is at most 1.
    sides: Range<usize>,
    /// The acceleration along x and y, where sides don't imply it: its square is at most 1.
    disks: Range<usize>,
    /// Jerks: their squares are at most 1/x.
    jerks: Range<usize>,
    /// Of all of these, in this order.
    bars: Range<usize>,
}

/// One limit at one look: what is left to it, how fast that falls over x, u and u' there, and its price.
#[derive(Clone, Copy, Default)]
pub(super) struct Bar {
    left: f64,
    /// What would be left after a move.
    then_left: f64,
    /// One over what is left.
    per_left: f64,
    falls: State,
    price: f64,
    /// By how much the price changes next.
    change: f64,
}

/// All that is asked of a motion between two rests.
#[derive(Default)]
pub(super) struct Scene {
    /// The looks of each step.
    steps: Vec<Range<usize>>,
    looks: Vec<Look>,
    sides: Vec<[f64; 2]>,
    disks: Vec<Square>,
    jerks: Vec<Square>,
    /// Those of one look.
    of_look: Vec<[f64; 2]>,
    bar_count: usize,
    pub(super) motors: usize,
    /// At each look the torque of each motor over what it bears for ever, by x and u.
    torques: Vec<[f64; 2]>,
    /// What the heat of each motor costs on each step: so many times as much as the time in which its torque is what it bears for ever.
    costs: Vec<f64>,
}

/// A quadratic form over a state: its slope and its curvature.
#[derive(Default)]
struct Form {
    slope: State,
    curve: Square,
}

impl Form {
    /// Adds what depends on x and u alone.
    fn add_side(&mut self, [x, u]: [f64; 2], slope: f64, curve: f64) {
        let [cx, cu] = [curve * x, curve * u];
        self.slope[0] += slope * x;
        self.slope[1] += slope * u;
        self.curve[0] += cx * x;
        self.curve[1] += cx * u;
        self.curve[3] += cu * u;
    }

    fn add(&mut self, row: &State, slope: f64, curve: f64) {
        let [x, u, w] = *row;
        let [cx, cu, cw] = row.map(|part| curve * part);
        self.slope.iter_mut().zip(row).for_each(|(sum, part)| *sum += slope * part);
        self.bend(&[cx * x, cx * u, cx * w, cu * u, cu * w, cw * w], 1.0);
    }

    fn bend(&mut self, square: &Square, by: f64) {
        self.curve.iter_mut().zip(square).for_each(|(sum, part)| *sum += by * part);
    }

    /// Adds a form over what a state becomes after a part of its step.
    fn add_after(&mut self, part: f64, other: &Form) {
        let [x, u, w] = other.slope;
        let [xx, xu, xw, uu, uw, ww] = other.curve;
        let (twice, square) = (2.0 * part, part * part);
        let slope = [x, twice * x + u, square * x + part * u + w];
        let (of_u, of_w) = (twice * xx + xu, square * xx + part * xu + xw);
        let middle = square * xu + part * uu + uw;
        let last = square * (of_w + xw) + part * (middle + uw) + ww;
        self.slope.iter_mut().zip(slope).for_each(|(sum, part)| *sum += part);
        self.bend(&[xx, of_u, of_w, twice * (of_u + xu) + uu, twice * of_w + middle, last], 1.0);
    }
}

fn dot(a: &State, b: &State) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(square: &Square, [x, u, w]: &State) -> State {
    let [xx, xu, xw, uu, uw, ww] = square;
    [xx * x + xu * u + xw * w, xu * x + uu * u + uw * w, xw * x + uw * u + ww * w]
}

/// The square of a vector, from its rows over the state.
fn square(rows: &[State]) -> Square {
    let sum = |a: usize, b: usize| rows.iter().map(|row| row[a] * row[b]).sum();
    [sum(0, 0), sum(0, 1), sum(0, 2), sum(1, 1), sum(1, 2), sum(2, 2)]
}

fn moved(states: &[State], moves: &[State], part: f64) -> Vec<State> {
    let pairs = states.iter().zip(moves);
    pairs.map(|(state, by)| std::array::from_fn(|at| state[at] + part * by[at])).collect()
}

impl Look {
    /// What a state at the beginning of the step becomes.
    fn at(&self, [x, u, w]: &State) -> State {
        let part = self.part;
        [x + part * (2.0 * u + part * w), u + part * w, *w]
    }

    /// The bars of its sides, disks and jerks.
    fn bars<'a>(&self, bars: &'a mut [Bar]) -> [&'a mut [Bar]; 3] {
        let (sides, others) = bars[self.bars.clone()].split_at_mut(self.sides.len());
        let (disks, jerks) = others.split_at_mut(self.disks.len());
        [sides, disks, jerks]
    }
}

impl Scene {
    pub(super) fn new(
        path: &impl GeometricPath,
        bounds: &PlatformBounds,
        spline: &Progress,
        joints: &[f64],
    ) -> Scene {
        let count = spline.piece_count();
        let step_s = spline.duration_s() / count as f64;
        let motors = bounds.heat.as_ref().map_or(0, |heat| heat.torques.len());
        let mut scene = Scene { motors, costs: vec![0.0; count * motors], ..Scene::default() };
        let (mut of_path, mut joint) = (0, 0);
        for step in 0..count {
            let first = scene.looks.len();
            let mut look = |part: f64, progress: [f64; 4], side: f64, is_for_jerk: bool| {
                let axes = path.sample_near(progress[0], side, &mut of_path);
                let at = Setpoint::from_axes(axes.map(|axis| over_time(axis, progress)));
                let rate = progress[1] / path.most_rate(progress[0]);
                scene.push(bounds, &at, rate, [part, step_s], is_for_jerk);
            };
            let [begin, middle, end] = [0.0, 0.5, 1.0].map(|part| spline.in_piece(step, part).1);
            look(0.0, begin, 1.0, false);
            look(0.5, middle, 1.0, false);
            // Where the way's third derivative jumps, the jerk does: both sides of it count.
            joint += joints[joint..].iter().take_while(|joint| **joint <= begin[0]).count();
            for sigma in joints[joint..].iter().take_while(|joint| **joint < end[0]) {
                let (time_s, [_, rates @ ..]) = spline.in_piece_at(step, *sigma);
                for (side, is_for_jerk) in [(-1.0, true), (1.0, false)] {
                    let part = time_s / step_s - step as f64;
                    look(part, [*sigma, rates[0], rates[1], rates[2]], side, is_for_jerk);
                }
            }
            look(1.0, end, -1.0, step + 1 < count);
            let looks = first..scene.looks.len();
            // The trapezoidal rule.
            scene.looks[looks.start].weight = 0.5;
            scene.looks[looks.end - 1].weight = 0.5;
            scene.steps.push(looks);
        }
        scene
    }

    /// A look at a part of a step, where the spline's own motion is `at`, and its rate takes a part of what the way allows. Where another
    /// look at the same moment asks for speed and acceleration, which jump nowhere, only the jerk counts.
    fn push(
        &mut self,
        bounds: &PlatformBounds,
        at: &Setpoint,
        rate: f64,
        [part, step_s]: [f64; 2],
        is_for_jerk: bool,
    ) {
        let limits = &bounds.limits;
        let [first, second, third] = bounds.derivatives_in_base(at);
        let speed = bounds.speed_share(&first).max(rate).powi(2);
        let side = |a: f64, b: f64, most: f64| [a / most, b / (step_s * most)];
        let acceleration = |axis: usize, most: f64| side(second[axis], first[axis], most);
        let disk = Disk([0, 1].map(|axis| acceleration(axis, limits.acceleration_m_s2)));
        let from = [self.sides.len(), self.disks.len(), self.jerks.len()];
        if !is_for_jerk {
            self.of_look.clear();
            let [x, u] = acceleration(2, limits.angular_acceleration_rad_s2);
            self.of_look.push([speed, 0.0]);
            self.of_look.extend([[x, u], [-x, -u]].into_iter().filter(|side| !disk.implies(*side, speed)));
            bounds.planes_at(&first, |_, plane, left| {
                let [a, b] = [second, first].map(|of| dot(&plane.normal, &of));
                self.of_look.push(side(a, b, left));
            });
            keep_binding(&mut self.of_look);
            self.sides.extend(&self.of_look);
            if !disk.is_implied(&self.of_look) {
                self.disks.push(square(&disk.0.map(|[x, u]| [x, u, 0.0])));
            }
        }
        let jerk = |axis: usize, most: f64| {
            let [x, u] = side(third[axis], 3.0 * second[axis], most);
            [x, u, first[axis] / (step_s * step_s * most)]
        };
        let along = [0, 1].map(|axis| jerk(axis, limits.jerk_m_s3));
        let turn = jerk(2, limits.angular_jerk_rad_s3);
        self.jerks.push(square(&along));
        if !is_gentle(&turn, &along, [1.0 / speed, disk.most(speed)]) {
            self.jerks.push(square(&[turn]));
        }
        for torque in bounds.heat.iter().flat_map(|heat| &heat.torques) {
            let [a, b] = [second, first].map(|of| dot(torque, &of));
            self.torques.push(side(a, b, 1.0));
        }
        let to = [self.sides.len(), self.disks.len(), self.jerks.len()];
        let [sides, disks, jerks] = [0, 1, 2].map(|at| from[at]..to[at]);
        let begin = self.bar_count;
        self.bar_count += sides.len() + disks.len() + jerks.len();
        self.looks.push(Look { part, weight: 0.0, sides, disks, jerks, bars: begin..self.bar_count });
    }

    /// The greatest even x within all limits.
    pub(super) fn even(&self) -> f64 {
        let sides = self.sides.iter().map(|side| side[0]);
        let disks = self.disks.iter().map(|square| square[0].sqrt());
        let jerks = self.jerks.iter().map(|square| square[0].cbrt());
        1.0 / sides.chain(disks).chain(jerks).fold(0.0, f64::max)
    }

    /// Tells bars of a look with what is left at a state there.
    fn left(&self, look: &Look, at: &State, bars: &mut [Bar], mut take: impl FnMut(&mut Bar, f64)) {
        let [of_sides, of_disks, of_jerks] = look.bars(bars);
        for (bar, [x, u]) in of_sides.iter_mut().zip(&self.sides[look.sides.clone()]) {
            take(bar, 1.0 - x * at[0] - u * at[1]);
        }
        for (bar, disk) in of_disks.iter_mut().zip(&self.disks[look.disks.clone()]) {
            take(bar, 1.0 - dot(&times(disk, at), at));
        }
        let per_x = 1.0 / at[0];
        for (bar, jerk) in of_jerks.iter_mut().zip(&self.jerks[look.jerks.clone()]) {
            take(bar, per_x - dot(&times(jerk, at), at));
        }
    }

    /// Finds what is left to all limits; whether that is more than a part of what was.
    fn is_left(&self, states: &[State], bars: &mut [Bar]) -> bool {
        self.steps.iter().zip(states).all(|(looks, state)| {
            let mut is_enough = true;
            for look in &self.looks[looks.clone()] {
                self.left(look, &look.at(state), bars, |bar, left| {
                    is_enough &= left > LEFT * bar.left;
                    bar.then_left = left;
                });
            }
            is_enough
        })
    }

    /// Newton's move towards where each price is a weight over what is left; how fast that falls goes into `bars`.
    fn newton(&self, states: &[State], bars: &mut [Bar], weight: f64) -> Vec<State> {
        // Backwards: u' as the best answer to x and u, and what is then left to pay from there on.
        let mut answers = vec![[0.0; 3]; states.len()];
        let mut behind = Form::default();
        for (step, (looks, state)) in self.steps.iter().zip(states).enumerate().rev() {
            let mut form = Form::default();
            for number in looks.clone() {
                let look = &self.looks[number];
                let at = look.at(state);
                let mut pull = |form: &mut Form| self.pull(form, [step, number], &at, bars, weight);
                // Those at the step's ends need no turning of their own.
                if look.part == 0.0 {
                    pull(&mut form);
                } else if look.part == 1.0 {
                    pull(&mut behind);
                } else {
                    let mut here = Form::default();
                    pull(&mut here);
                    form.add_after(look.part, &here);
                }
            }
            form.add_after(1.0, &behind);
            let ([x, u, w], [xx, xu, xw, uu, uw, ww]) = (form.slope, form.curve);
            let [of_x, of_u, own] = [xw, uw, w].map(|part| -part / ww);
            answers[step] = [of_x, of_u, own];
            behind = Form {
                slope: [x + own * xw, u + own * uw, 0.0],
                curve: [xx + of_x * xw, xu + of_x * uw, 0.0, uu + of_u * uw, 0.0, 0.0],
            };
        }
        let ([x, u, _], [xx, xu, _, uu, ..]) = (behind.slope, behind.curve);
        let det = xx * uu - xu * xu;
        let mut at = [(xu * u - uu * x) / det, (xu * x - xx * u) / det];
        let moves = answers.iter().map(|answer| {
            let state = [at[0], at[1], answer[0] * at[0] + answer[1] * at[1] + answer[2]];
            at = [state[0] + 2.0 * state[1] + state[2], state[1] + state[2]];
            state
        });
        moves.collect()
    }

    /// Adds what time, heat and limits make of a look of a step, over x, u and u' there.
    fn pull(&self, form: &mut Form, [step, number]: [usize; 2], at: &State, bars: &mut [Bar], weight: f64) {
        let look = &self.looks[number];
        let per_x = 1.0 / at[0];
        if look.weight > 0.0 {
            let rate = 0.5 * look.weight * per_x * per_x.sqrt();
            form.slope[0] -= rate;
            form.curve[0] += 1.5 * rate * per_x;
            self.add_heat(form, [step, number], at, rate);
        }
        let [of_sides, of_disks, of_jerks] = look.bars(bars);
        for (bar, side) in of_sides.iter_mut().zip(&self.sides[look.sides.clone()]) {
            (bar.falls, bar.per_left) = ([side[0], side[1], 0.0], 1.0 / bar.left);
            form.add_side(*side, weight * bar.per_left, bar.price * bar.per_left);
        }
        let squares = self.disks[look.disks.clone()].iter().map(|disk| (disk, 0.0));
        let squares = squares.chain(self.jerks[look.jerks.clone()].iter().map(|jerk| (jerk, per_x * per_x)));
        for (bar, (square, fall)) in of_disks.iter_mut().chain(of_jerks).zip(squares) {
            let [x, u, w] = times(square, at);
            (bar.falls, bar.per_left) = ([fall + 2.0 * x, 2.0 * u, 2.0 * w], 1.0 / bar.left);
            form.add(&bar.falls, weight * bar.per_left, bar.price * bar.per_left);
            form.bend(square, 2.0 * bar.price);
        }
    }

    /// Adds what heat costs at a look of a step: each motor's torque squared, over √x.
    fn add_heat(&self, form: &mut Form, [step, look]: [usize; 2], at: &State, rate: f64) {
        let costs = &self.costs[step * self.motors..(step + 1) * self.motors];
        for (cost, [x, u]) in
            costs.iter().zip(&self.torques[look * self.motors..]).filter(|(cost, _)| **cost > 0.0)
        {
            let load = x * at[0] + u * at[1];
            let (along, rate) = (0.5 * load / at[0], cost * rate);
            form.add_side([x - along, *u], 4.0 * rate * at[0] * load, 4.0 * rate * at[0]);
            form.add_side([1.0, 0.0], rate * load * load, rate * load * along);
        }
    }

    /// Begins at states within all limits: finds what is left to these, and what it costs at least.
    pub(super) fn begin(&self, states: &[State], bars: &mut Vec<Bar>) {
        let gap = if bars.is_empty() { GAP } else { GAP_AGAIN };
        bars.resize(self.bar_count, Bar::default());
        for (looks, state) in self.steps.iter().zip(states) {
            for look in &self.looks[looks.clone()] {
                self.left(look, &look.at(state), bars, |bar, left| bar.left = left);
            }
        }
        let least = gap * states.len() as f64 / bars.len() as f64;
        bars.iter_mut().for_each(|bar| bar.price = bar.price.max(least / bar.left));
    }

    /// Moves states to those of the least time but for a gap, or towards them.
    pub(super) fn solve(&self, states: &mut Vec<State>, bars: &mut [Bar], last_gap: f64) {
        let (count, length) = (bars.len() as f64, states.len() as f64);
        let mut less = FIRST_LESS;
        for _ in 0..MOVES {
            let gap = bars.iter().map(|bar| bar.left * bar.price).sum::<f64>();
            let weight = less * gap / count;
            let moves = self.newton(states, bars, weight);
            let (mut part, mut of_prices) = (1.0_f64, 1.0_f64);
            for (looks, by) in self.steps.iter().zip(&moves) {
                for look in &self.looks[looks.clone()] {
                    let by = look.at(by);
                    for bar in &mut bars[look.bars.clone()] {
                        let falls = dot(&bar.falls, &by);
                        bar.change = (weight + bar.price * falls) * bar.per_left - bar.price;
                        // Few bars are the first ones that are met: only these are worth a quotient.
                        if (1.0 - LEFT) * bar.left < part * falls {
                            part = (1.0 - LEFT) * bar.left / falls;
                        }
                        if (1.0 - LEFT) * bar.price < -of_prices * bar.change {
                            of_prices = (1.0 - LEFT) * bar.price / -bar.change;
                        }
                    }
                }
            }
            let parts = std::iter::successors(Some(part), |part| Some(SHORTER * part));
            let tried = parts.take_while(|part| *part > SHORTEST).find_map(|part| {
                let moved = moved(states, &moves, part);
                self.is_left(&moved, bars).then_some((part, moved))
            });
            let Some((part, moved)) = tried else { break };
            *states = moved;
            for bar in bars.iter_mut() {
                bar.left = bar.then_left;
                bar.price += of_prices * bar.change;
            }
            let made = part.min(of_prices);
            less = (1.0 - made).clamp(LESS[0], LESS[1]);
            let gap = bars.iter().map(|bar| bar.left * bar.price).sum::<f64>();
            if made > WHOLE && gap < last_gap * length {
                break;
            }
        }
    }

    /// Whether heat costs anything.
    pub(super) fn pays(&self) -> bool {
        self.costs.iter().any(|cost| *cost > 0.0)
    }

    /// Makes a motor's heat on a step dearer or cheaper, by the greatest mean square of its torque in any window that holds the step.
    pub(super) fn charge(&mut self, [step, motor]: [usize; 2], square: f64) {
        let cost = &mut self.costs[step * self.motors + motor];
        if *cost > 0.0 {
            *cost *= square.powf(DEARER);
        } else if square > 1.0 {
            *cost = FIRST_COST;
        }
    }

    /// Lowers the limits of a step so that it takes so many times as long.
    pub(super) fn lower(&mut self, step: usize, pace: f64) {
        let scale =
            |parts: &mut [f64], power: i32| parts.iter_mut().for_each(|part| *part *= pace.powi(power));
        for look in &self.looks[self.steps[step].clone()] {
            scale(self.sides[look.sides.clone()].as_flattened_mut(), 2);
            scale(self.disks[look.disks.clone()].as_flattened_mut(), 4);
            scale(self.jerks[look.jerks.clone()].as_flattened_mut(), 6);
        }
    }
}
