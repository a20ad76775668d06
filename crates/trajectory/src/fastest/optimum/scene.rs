//! All that is asked of a motion between two rests, and the moves towards its least time.

use std::ops::Range;

use super::super::bounds::PlatformBounds;
use super::super::smooth::Progress;
use super::sides::keep_binding;
use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::trajectory::Setpoint;

/// What all prices make of the time when it begins, and when it begins again.
const GAP: f64 = 1.0;
const GAP_AGAIN: f64 = 0.01;
/// What part of the gap is asked for next: what the last move left, within these. A move that makes so much of itself is whole.
const LESS: [f64; 2] = [0.05, 0.9];
const WHOLE: f64 = 0.5;
/// Moves at most, and how far one is cut at most.
const MOVES: usize = 60;
const SHORTEST: f64 = 1e-6;
const SHORTER: f64 = 0.8;
/// A move leaves so much of what is left to each limit, and of its price.
const LEFT: f64 = 0.1;
/// A cost becomes so many times as much as the mean square is, to this power: half as much heat costs two to four times as much.
const DEARER: f64 = 1.5;
/// What the heat of a motor costs first: of motions that speed up evenly and brake again, as many seconds as they take for what they heat, that is
/// the least where the mean square of the torque is 1.
const FIRST_COST: f64 = 1.0 / 3.0;
/// Axes whose limit is one on their length: x and y, and the turn.
const BALLS: [Range<usize>; 2] = [0..2, 2..3];

/// x, u and u' at the beginning of a step, where its length counts 1.
pub(super) type State = [f64; 3];
/// Coefficients of these.
pub(super) type Row = [f64; 3];

/// What limits ask at a moment of a step, each over itself.
struct Look {
    /// x there.
    x: Row,
    /// What part of the step's time is counted there.
    weight: f64,
    /// What speed takes of x.
    speed: f64,
    /// The acceleration along x, y and the turn; and the jerk, over √x.
    acceleration: [Row; 3],
    jerk: [Row; 3],
    planes: Range<usize>,
    /// Another look at the same moment asks for speed and acceleration, which jump nowhere: here only the jerk counts.
    is_for_jerk: bool,
}

/// One limit at one look: what is left to it, how fast that falls over the state, and its price.
#[derive(Clone, Copy)]
pub(super) struct Bar {
    left: f64,
    /// What would be left after a move.
    then_left: f64,
    /// One over it.
    per_left: f64,
    falls: Row,
    price: f64,
    /// By how much the price changes next.
    change: f64,
}

/// Looks and limits of a step.
pub(super) struct Step {
    looks: Range<usize>,
    bars: Range<usize>,
}

/// All that is asked of a motion between two rests.
#[derive(Default)]
pub(super) struct Scene {
    steps: Vec<Step>,
    looks: Vec<Look>,
    planes: Vec<Row>,
    /// Those of one look, by x and u there.
    sides: Vec<[f64; 2]>,
    pub(super) motors: usize,
    /// At each look the torque of each motor over what it bears for ever.
    torques: Vec<Row>,
    /// What the heat of each motor costs on each step: so many times as much as the time in which its torque is what it bears for ever.
    costs: Vec<f64>,
}

/// A quadratic form over a step's state: its slope, and its curvature, from the first row's three to the last one's one.
#[derive(Default)]
struct Form {
    slope: [f64; 3],
    curve: [f64; 6],
}

impl Form {
    fn add(&mut self, row: &Row, slope: f64, curve: f64) {
        self.slope.iter_mut().zip(row).for_each(|(sum, part)| *sum += slope * part);
        self.bend(row, curve);
    }

    fn bend(&mut self, row: &Row, curve: f64) {
        let [x, u, w] = *row;
        let [cx, cu, cw] = scaled(row, curve);
        let products = [cx * x, cx * u, cx * w, cu * u, cu * w, cw * w];
        self.curve.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
}

fn dot(a: &Row, b: &State) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn scaled([x, u, w]: &Row, by: f64) -> Row {
    [by * x, by * u, by * w]
}

fn moved(states: &[State], moves: &[State], part: f64) -> Vec<State> {
    let pairs = states.iter().zip(moves);
    pairs.map(|(state, by)| std::array::from_fn(|at| state[at] + part * by[at])).collect()
}

impl Look {
    /// Tells what is left to each limit, how fast that falls, and the rows whose squares make it fall.
    fn limits(&self, planes: &[Row], state: &State, mut take: impl FnMut(f64, Row, &[Row])) {
        let x = dot(&self.x, state);
        // The squares of the radii: 1/x for the jerk, 1 for the acceleration.
        let per_x = 1.0 / x;
        for (rows, square, fall) in [(&self.jerk, per_x, per_x * per_x), (&self.acceleration, 1.0, 0.0)] {
            for ball in BALLS {
                let rows = &rows[ball];
                let (mut left, mut falls) = (square, scaled(&self.x, fall));
                for row in rows {
                    let y = dot(row, state);
                    left -= y * y;
                    let [a, b, c] = scaled(row, 2.0 * y);
                    falls = [falls[0] + a, falls[1] + b, falls[2] + c];
                }
                take(left, falls, rows);
            }
            if self.is_for_jerk {
                return;
            }
        }
        take(1.0 - self.speed * x, scaled(&self.x, self.speed), &[]);
        for row in &planes[self.planes.clone()] {
            take(1.0 - dot(row, state), *row, &[]);
        }
    }

    fn limit_count(&self) -> usize {
        if self.is_for_jerk { BALLS.len() } else { 1 + 2 * BALLS.len() + self.planes.len() }
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
        let (mut of_path, mut joint, mut bars) = (0, 0, 0);
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
            let begin = bars;
            bars += scene.looks[looks.clone()].iter().map(Look::limit_count).sum::<usize>();
            scene.steps.push(Step { looks, bars: begin..bars });
        }
        scene
    }

    /// A look at a part of a step, where the spline's own motion is `at`, and its rate takes a part of what the way allows.
    fn push(
        &mut self,
        bounds: &PlatformBounds,
        at: &Setpoint,
        rate: f64,
        [part, step_s]: [f64; 2],
        is_for_jerk: bool,
    ) {
        let limits = &bounds.limits;
        // From what x, u and u' make there to what those at the beginning do.
        let row = |x: f64, u: f64, w: f64| {
            let (u, w) = (u / step_s, w / (step_s * step_s));
            [x, 2.0 * part * x + u, part * (part * x + u) + w]
        };
        let [first, second, third] = bounds.derivatives_in_base(at);
        let [along, turn] = [limits.acceleration_m_s2, limits.angular_acceleration_rad_s2];
        let accelerations = [along, along, turn];
        let jerks = [limits.jerk_m_s3, limits.jerk_m_s3, limits.angular_jerk_rad_s3];
        let speed = bounds.speed_share(&first).max(rate).powi(2);
        let from = self.planes.len();
        if !is_for_jerk {
            self.sides.clear();
            bounds.planes_at(&first, |_, plane, left| {
                self.sides.push([second, first].map(|of| dot(&plane.normal, &of) / left));
            });
            keep_binding(&mut self.sides, speed);
            self.planes.extend(self.sides.iter().map(|[x, u]| row(*x, *u, 0.0)));
        }
        for torque in bounds.heat.iter().flat_map(|heat| &heat.torques) {
            let [x, u] = [second, first].map(|of| dot(torque, &of));
            self.torques.push(row(x, u, 0.0));
        }
        self.looks.push(Look {
            x: row(1.0, 0.0, 0.0),
            weight: 0.0,
            speed,
            acceleration: std::array::from_fn(|axis| {
                let [x, u] = [second[axis], first[axis]].map(|of| of / accelerations[axis]);
                row(x, u, 0.0)
            }),
            jerk: std::array::from_fn(|axis| {
                let [x, u, w] = [third[axis], 3.0 * second[axis], first[axis]].map(|of| of / jerks[axis]);
                row(x, u, w)
            }),
            planes: from..self.planes.len(),
            is_for_jerk,
        });
    }

    /// The greatest even x within all limits.
    pub(super) fn even(&self) -> f64 {
        let size = |rows: &[Row]| rows.iter().map(|row| row[0].powi(2)).sum::<f64>().sqrt();
        let most = self.looks.iter().map(|look| {
            let planes = self.planes[look.planes.clone()].iter().map(|row| row[0]);
            let balls = BALLS.map(|ball| {
                size(&look.acceleration[ball.clone()]).max(size(&look.jerk[ball]).powf(2.0 / 3.0))
            });
            planes.chain(balls).fold(look.speed, f64::max)
        });
        1.0 / most.fold(0.0, f64::max)
    }

    /// Tells all limits of a step as [`Look::limits`] does.
    fn limits(&self, step: &Step, state: &State, mut take: impl FnMut(f64, Row, &[Row])) {
        let looks = &self.looks[step.looks.clone()];
        looks.iter().for_each(|look| look.limits(&self.planes, state, &mut take));
    }

    /// Finds what is left to all limits; whether that is more than a part of what was.
    fn is_left(&self, states: &[State], bars: &mut [Bar]) -> bool {
        self.steps.iter().zip(states).all(|(step, state)| {
            let (mut is_enough, mut of_step) = (true, bars[step.bars.clone()].iter_mut());
            self.limits(step, state, |left, _, _| {
                let bar = of_step.next().expect("each limit has one");
                is_enough &= left > LEFT * bar.left;
                bar.then_left = left;
            });
            is_enough
        })
    }

    /// Newton's move towards where each price is a weight over what is left; how fast that falls goes into `bars`.
    fn newton(&self, states: &[State], bars: &mut [Bar], weight: f64) -> Vec<State> {
        // Backwards: u' as the best answer to x and u, and what is then left to pay from there on.
        let mut answers = vec![[0.0; 3]; states.len()];
        let (mut slope, mut curve) = ([0.0; 2], [0.0; 3]);
        for (number, ((step, state), answer)) in
            self.steps.iter().zip(states).zip(&mut answers).enumerate().rev()
        {
            let mut form = Form::default();
            let mut of_step = bars[step.bars.clone()].iter_mut();
            for at in step.looks.clone() {
                let look = &self.looks[at];
                if look.weight > 0.0 {
                    let x = dot(&look.x, state);
                    let rate = 0.5 * look.weight / (x * x.sqrt());
                    form.add(&look.x, -rate, 1.5 * rate / x);
                    self.add_heat(&mut form, [number, at], state, [x, rate]);
                }
                look.limits(&self.planes, state, |left, falls, rows| {
                    let bar = of_step.next().expect("each limit has one");
                    (bar.falls, bar.per_left) = (falls, 1.0 / left);
                    form.add(&falls, weight * bar.per_left, bar.price * bar.per_left);
                    rows.iter().for_each(|row| form.bend(row, 2.0 * bar.price));
                });
            }
            // What is behind the step: x' = x + 2u + w and u' = u + w.
            let (by_x, by_u) = (slope[0], slope[1]);
            let behind = [by_x, 2.0 * by_x + by_u, by_x + by_u];
            form.slope.iter_mut().zip(behind).for_each(|(sum, part)| *sum += part);
            let [xx, xu, uu] = curve;
            let behind = [
                xx,
                2.0 * xx + xu,
                xx + xu,
                4.0 * (xx + xu) + uu,
                2.0 * xx + 3.0 * xu + uu,
                xx + 2.0 * xu + uu,
            ];
            form.curve.iter_mut().zip(behind).for_each(|(sum, part)| *sum += part);
            let ([x, u, w], [xx, xu, xw, uu, uw, ww]) = (form.slope, form.curve);
            let [of_x, of_u, own] = [xw, uw, w].map(|part| -part / ww);
            *answer = [of_x, of_u, own];
            slope = [x + own * xw, u + own * uw];
            curve = [xx + of_x * xw, xu + of_x * uw, uu + of_u * uw];
        }
        let [xx, xu, uu] = curve;
        let det = xx * uu - xu * xu;
        let mut at = [(xu * slope[1] - uu * slope[0]) / det, (xu * slope[0] - xx * slope[1]) / det];
        let moves = answers.iter().map(|answer| {
            let state = [at[0], at[1], answer[0] * at[0] + answer[1] * at[1] + answer[2]];
            at = [state[0] + 2.0 * state[1] + state[2], state[1] + state[2]];
            state
        });
        moves.collect()
    }

    /// Adds what heat costs at a look of a step: each motor's torque squared, over √x.
    fn add_heat(&self, form: &mut Form, [step, look]: [usize; 2], state: &State, [x, rate]: [f64; 2]) {
        let costs = &self.costs[step * self.motors..(step + 1) * self.motors];
        for (cost, torque) in
            costs.iter().zip(&self.torques[look * self.motors..]).filter(|(cost, _)| **cost > 0.0)
        {
            let [load, of_x] = [dot(torque, state), 0.5 / x];
            let [along, rate] = [load * of_x, cost * rate];
            let slanted = std::array::from_fn(|at| torque[at] - along * self.looks[look].x[at]);
            form.add(&slanted, 4.0 * rate * x * load, 4.0 * rate * x);
            form.add(&self.looks[look].x, rate * load * load, rate * load * along);
        }
    }

    /// Moves states within all limits to those of the least time but for a gap, or towards them.
    pub(super) fn solve(&self, states: &mut Vec<State>, bars: &mut Vec<Bar>, last_gap: f64) {
        let is_new = bars.is_empty();
        let mut at = 0;
        for (step, state) in self.steps.iter().zip(states.iter()) {
            self.limits(step, state, |left, falls, _| {
                if is_new {
                    bars.push(Bar { left, then_left: left, per_left: 0.0, falls, price: 0.0, change: 0.0 });
                } else {
                    bars[at].left = left;
                    at += 1;
                }
            });
        }
        let (count, length) = (bars.len() as f64, states.len() as f64);
        let even = |gap: f64, bar: &Bar| gap * length / count / bar.left;
        if is_new {
            bars.iter_mut().for_each(|bar| bar.price = even(GAP, bar));
        } else {
            bars.iter_mut().for_each(|bar| bar.price = bar.price.max(even(GAP_AGAIN, bar)));
        }
        let mut less = 0.5;
        for _ in 0..MOVES {
            let gap = bars.iter().map(|bar| bar.left * bar.price).sum::<f64>();
            let weight = less * gap / count;
            let moves = self.newton(states, bars, weight);
            let (mut part, mut of_prices) = (1.0_f64, 1.0_f64);
            for (step, by) in self.steps.iter().zip(&moves) {
                for bar in &mut bars[step.bars.clone()] {
                    let falls = dot(&bar.falls, by);
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
        let (second, third) = (pace.powi(2), pace.powi(3));
        for look in &mut self.looks[self.steps[step].looks.clone()] {
            look.speed *= second;
            look.acceleration.as_flattened_mut().iter_mut().for_each(|part| *part *= second);
            look.jerk.as_flattened_mut().iter_mut().for_each(|part| *part *= third);
            self.planes[look.planes.clone()].as_flattened_mut().iter_mut().for_each(|part| *part *= second);
        }
    }
}
