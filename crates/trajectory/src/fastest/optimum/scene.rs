//! All that is asked of a motion between two rests.

use std::ops::Range;

use super::look::{Line, Look, dot};
use crate::fastest::PlatformBounds;
use crate::fastest::smooth::Progress;
use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::trajectory::Setpoint;

/// A cost becomes so many times as much as the mean square is, to this power: half as much heat costs two to four times as much.
const DEARER: f64 = 1.5;
/// What the heat of a motor costs first: of motions that speed up evenly and brake again, as many seconds as they take for what they heat, that is
/// the least where the mean square of the torque is 1.
const FIRST_COST: f64 = 1.0 / 3.0;

/// Limits and motors, look by look.
#[derive(Default)]
pub(super) struct Scene {
    /// The looks of each step.
    pub(super) steps: Vec<Range<usize>>,
    pub(super) looks: Vec<Look>,
    pub(super) planes: Vec<Line>,
    pub(super) motors: usize,
    /// At each look the torque of each motor over what it bears for ever.
    pub(super) torques: Vec<Line>,
    /// What the heat of each motor costs on each step: so many times as much as the time in which its torque is what it bears for ever.
    pub(super) costs: Vec<f64>,
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
        let [first, second, third] = bounds.derivatives_in_base(at);
        let [along, turn] = [limits.acceleration_m_s2, limits.angular_acceleration_rad_s2];
        let accelerations = [along, along, turn];
        let jerks = [limits.jerk_m_s3, limits.jerk_m_s3, limits.angular_jerk_rad_s3];
        let from = self.planes.len();
        if !is_for_jerk {
            bounds.planes_at(&first, |_, plane, left| {
                let [x, u] = [second, first].map(|of| dot(&plane.normal, &of) / left);
                self.planes.push([x, u / step_s]);
            });
        }
        for torque in bounds.heat.iter().flat_map(|heat| &heat.torques) {
            let [x, u] = [second, first].map(|of| dot(torque, &of));
            self.torques.push([x, u / step_s]);
        }
        let bars = self.looks.last().map_or(0, |look| look.bars.end);
        let mut look = Look {
            part,
            weight: 0.0,
            speed: bounds.speed_share(&first).max(rate).powi(2),
            acceleration: std::array::from_fn(|axis| {
                let [x, u] = [second[axis], first[axis]].map(|of| of / accelerations[axis]);
                [x, u / step_s, 0.0]
            }),
            jerk: std::array::from_fn(|axis| {
                let [x, u, w] = [third[axis], 3.0 * second[axis], first[axis]].map(|of| of / jerks[axis]);
                [x, u / step_s, w / (step_s * step_s)]
            }),
            planes: from..self.planes.len(),
            is_for_jerk,
            bars: bars..bars,
        };
        look.bars.end += look.limit_count();
        self.looks.push(look);
    }

    /// The greatest even x within all limits.
    pub(super) fn even(&self) -> f64 {
        1.0 / self.looks.iter().map(|look| look.even(&self.planes)).fold(0.0, f64::max)
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
        for look in &mut self.looks[self.steps[step].clone()] {
            look.speed *= second;
            look.acceleration.as_flattened_mut().iter_mut().for_each(|part| *part *= second);
            look.jerk.as_flattened_mut().iter_mut().for_each(|part| *part *= third);
            self.planes[look.planes.clone()].as_flattened_mut().iter_mut().for_each(|part| *part *= second);
        }
    }
}
