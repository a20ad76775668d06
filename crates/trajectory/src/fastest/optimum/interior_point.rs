//! The least time within all limits, by a primal-dual interior-point method whose linear systems are solved along the grid.

use super::State;
use super::look::{Form, Row, dot};
use super::scene::Scene;

/// What all prices make of the time when it begins, when it begins again, and in the end.
const GAP: f64 = 1.0;
const GAP_AGAIN: f64 = 0.01;
const LAST_GAP: f64 = 1e-3;
/// What part of the gap is asked for next: what the last move left, within these. A move that makes so much of itself is whole.
const LESS: [f64; 2] = [0.05, 0.9];
const WHOLE: f64 = 0.5;
/// Moves at most, and how far one is cut at most.
const MOVES: usize = 60;
const SHORTEST: f64 = 1e-6;
const SHORTER: f64 = 0.8;
/// A move leaves so much of what is left to each limit, and of its price.
const LEFT: f64 = 0.1;

/// One limit at one look: what is left to it, how fast that falls over the state there, and its price.
#[derive(Clone, Copy, Default)]
pub(super) struct Bar {
    left: f64,
    /// One over it.
    per_left: f64,
    falls: Row,
    price: f64,
    /// By how much the price changes next.
    change: f64,
}

fn moved(states: &[State], moves: &[State], part: f64) -> Vec<State> {
    let pairs = states.iter().zip(moves);
    pairs.map(|(state, by)| std::array::from_fn(|at| state[at] + part * by[at])).collect()
}

impl Scene {
    /// Moves states within all limits to those of the least time, or towards them.
    pub(super) fn solve(&self, states: &mut Vec<State>, bars: &mut Vec<Bar>) {
        let mut lefts = Vec::new();
        self.are_within(states, &mut lefts, |_| f64::NEG_INFINITY);
        let even = |gap: f64, left: f64| gap * states.len() as f64 / lefts.len() as f64 / left;
        let is_new = bars.is_empty();
        bars.resize(lefts.len(), Bar::default());
        for (bar, left) in bars.iter_mut().zip(&lefts) {
            bar.left = *left;
            bar.price = if is_new { even(GAP, *left) } else { bar.price.max(even(GAP_AGAIN, *left)) };
        }
        let (count, length) = (bars.len() as f64, states.len() as f64);
        let mut less = 0.5;
        for _ in 0..MOVES {
            let gap = bars.iter().map(|bar| bar.left * bar.price).sum::<f64>();
            let weight = less * gap / count;
            let moves = self.newton(states, bars, weight);
            let (mut part, mut of_prices) = (1.0_f64, 1.0_f64);
            for (step, by) in self.steps.iter().zip(&moves) {
                for look in &self.looks[step.clone()] {
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
                self.are_within(&moved, &mut lefts, |bar| LEFT * bars[bar].left).then_some((part, moved))
            });
            let Some((part, moved)) = tried else { break };
            *states = moved;
            for (bar, left) in bars.iter_mut().zip(&lefts) {
                bar.left = *left;
                bar.price += of_prices * bar.change;
            }
            let made = part.min(of_prices);
            less = (1.0 - made).clamp(LESS[0], LESS[1]);
            let gap = bars.iter().map(|bar| bar.left * bar.price).sum::<f64>();
            if made > WHOLE && gap < LAST_GAP * length {
                break;
            }
        }
    }

    /// Whether more than a least is left to each limit; what is, goes into `lefts`, until it isn't enough.
    fn are_within(&self, states: &[State], lefts: &mut Vec<f64>, least: impl Fn(usize) -> f64) -> bool {
        lefts.clear();
        for (step, state) in self.steps.iter().zip(states) {
            for look in &self.looks[step.clone()] {
                let at = look.at(state);
                let mut is_enough = true;
                let mut take = |left: f64| {
                    is_enough &= left > least(lefts.len());
                    lefts.push(left);
                };
                look.balls(&at, |left, _, _| take(left));
                look.lines(&self.planes, &at, |left, _| take(left));
                if !is_enough {
                    return false;
                }
            }
        }
        true
    }

    /// Newton's move towards where each price is a weight over what is left; how fast that falls goes into `bars`.
    fn newton(&self, states: &[State], bars: &mut [Bar], weight: f64) -> Vec<State> {
        // Backwards: u' as the best answer to x and u, and what is then left to pay from there on.
        let mut answers = vec![[0.0; 3]; states.len()];
        let (mut slope, mut curve) = ([0.0; 2], [0.0; 3]);
        for (number, (state, answer)) in states.iter().zip(&mut answers).enumerate().rev() {
            let mut form = Form::default();
            for at in self.steps[number].clone() {
                form.add_form(&self.pays_at([number, at], state, bars, weight));
            }
            // What is behind the step: x' = x + 2u + w and u' = u + w.
            let [xx, xu, uu] = curve;
            let behind = Form { slope: [slope[0], slope[1], 0.0], curve: [xx, xu, 0.0, uu, 0.0, 0.0] };
            form.add_form(&behind.before(1.0));
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

    /// What is paid at a look of a step, over the state at its beginning: the time there, limits by their prices, and heat.
    fn pays_at(&self, [step, look]: [usize; 2], state: &State, bars: &mut [Bar], weight: f64) -> Form {
        let (number, look) = (look, &self.looks[look]);
        let at = look.at(state);
        let mut form = Form::default();
        if look.weight > 0.0 {
            let rate = 0.5 * look.weight / (at[0] * at[0].sqrt());
            form.slope[0] -= rate;
            form.curve[0] += 1.5 * rate / at[0];
            self.add_heat(&mut form, [step, number], &at, rate);
        }
        let mut bars = bars[look.bars.clone()].iter_mut();
        let mut price = |left: f64, falls: Row| {
            let bar = bars.next().expect("each limit has one");
            (bar.falls, bar.per_left) = (falls, 1.0 / left);
            (bar.per_left, bar.price)
        };
        look.balls(&at, |left, falls, rows| {
            let (per_left, price) = price(left, falls);
            form.add(&falls, weight * per_left, price * per_left);
            rows.iter().for_each(|row| form.add_square(row, 2.0 * price));
        });
        look.lines(&self.planes, &at, |left, line| {
            let (per_left, price) = price(left, [line[0], line[1], 0.0]);
            form.add_line(line, weight * per_left, price * per_left);
        });
        form.before(look.part)
    }

    /// Adds what heat costs at a look of a step: each motor's torque squared, over √x.
    fn add_heat(&self, form: &mut Form, [step, look]: [usize; 2], at: &State, rate: f64) {
        let costs = &self.costs[step * self.motors..(step + 1) * self.motors];
        for (cost, [by_x, by_u]) in
            costs.iter().zip(&self.torques[look * self.motors..]).filter(|(cost, _)| **cost > 0.0)
        {
            let [x, u, _] = at;
            let (load, of_x) = (by_x * x + by_u * u, 0.5 / x);
            let [along, rate] = [load * of_x, cost * rate];
            form.add_line(&[by_x - along, *by_u], 4.0 * rate * x * load, 4.0 * rate * x);
            form.add_line(&[1.0, 0.0], rate * load * load, rate * load * along);
        }
    }
}
