//! The way to a position within speed, acceleration and jerk, one step a cycle.

use crate::config::AxisLimits;

/// Where an axis shall be: a trapezoid of speeds, averaged over the last cycles so that its jerk is limited.
#[derive(Clone, Debug)]
pub(super) struct Profile {
    limits: AxisLimits,
    period_s: f64,
    /// Of the trapezoid.
    position: f64,
    speed: f64,
    /// `None`: it comes to rest.
    target: Option<f64>,
    /// The trapezoid's last positions; its mean is the set point.
    window: Box<[f64]>,
    oldest: usize,
}

impl Profile {
    /// At rest at 0.
    pub(super) fn new(limits: AxisLimits, period_s: f64) -> Self {
        let rise_s = limits.jerk.map_or(0.0, |jerk| limits.acceleration.max(limits.stop_deceleration) / jerk);
        let cycles = (rise_s / period_s).ceil().max(1.0) as usize;
        let window = vec![0.0; cycles].into();
        Profile { limits, period_s, position: 0.0, speed: 0.0, target: None, window, oldest: 0 }
    }

    /// At rest at a position.
    pub(super) fn reset(&mut self, position: f64) {
        (self.position, self.speed, self.target) = (position, 0.0, None);
        self.window.fill(position);
    }

    /// From now on it leads to a position.
    pub(super) fn lead_to(&mut self, target: f64) {
        self.target = Some(target);
    }

    /// From now on it comes to rest.
    pub(super) fn stop(&mut self) {
        self.target = None;
    }

    /// Where the axis shall be now.
    pub(super) fn set_point(&self) -> f64 {
        let count = self.window.len() as f64;
        // Of what rests exactly where it is.
        self.position + self.window.iter().map(|past| past - self.position).sum::<f64>() / count
    }

    /// Whether the set point rests: at the target, where it leads to one.
    pub(super) fn rests(&self) -> bool {
        self.speed == 0.0
            && self.target.is_none_or(|target| target == self.position)
            && self.window.iter().all(|past| *past == self.position)
    }

    /// One cycle on, however long the last one took: a set point never leaps.
    pub(super) fn step(&mut self) {
        match self.target {
            Some(target) => self.approach(target),
            None => {
                let most = self.limits.stop_deceleration * self.period_s;
                self.speed -= self.speed.clamp(-most, most);
                self.position += self.speed * self.period_s;
            }
        }
        self.window[self.oldest] = self.position;
        self.oldest = (self.oldest + 1) % self.window.len();
    }

    fn approach(&mut self, target: f64) {
        let change = self.limits.acceleration * self.period_s;
        let left = target - self.position;
        let way = left.abs();
        // Towards the target.
        let speed = self.speed * left.signum();
        let next = stopping_speed(way / (change * self.period_s)) * change;
        let next = next.min(self.limits.speed).clamp(speed - change, speed + change);
        // What is left would take less than a step: it is there.
        let is_there = speed.abs() <= change && (way - next * self.period_s).abs() <= 1e-9 * way + 1e-12;
        if is_there {
            self.speed = next * left.signum();
            self.position = target;
            if way <= 1e-12 {
                self.speed = 0.0;
            }
            return;
        }
        self.speed = next * left.signum();
        self.position += self.speed * self.period_s;
    }
}

/// The greatest speed, in steps of the speed, from which so long a way brings it to rest: each cycle goes as far as its speed,
/// and the speed falls by 1.
fn stopping_speed(way: f64) -> f64 {
    let cycles = (((1.0 + 8.0 * way).sqrt() - 1.0) / 2.0).ceil();
    if cycles < 1.0 { 0.0 } else { (way + cycles * (cycles - 1.0) / 2.0) / cycles }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn limits(jerk: Option<f64>) -> AxisLimits {
        AxisLimits {
            position: [-10.0, 10.0],
            speed: 0.5,
            acceleration: 2.0,
            jerk,
            stop_deceleration: 4.0,
            following_error: 0.1,
            torque_nm: 1.0,
        }
    }

    /// Set points of so many cycles, with what is done in some of them.
    fn run(jerk: Option<f64>, cycles: usize, deeds: &[(usize, Option<f64>)]) -> (Profile, Vec<f64>) {
        let mut profile = Profile::new(limits(jerk), PERIOD_S);
        let mut points = vec![profile.set_point(); 3];
        for cycle in 0..cycles {
            match deeds.iter().find(|(at, _)| *at == cycle) {
                Some((_, Some(target))) => profile.lead_to(*target),
                Some((_, None)) => profile.stop(),
                None => {}
            }
            profile.step();
            points.push(profile.set_point());
        }
        (profile, points)
    }

    /// The greatest of the n-th difference quotient.
    fn peak(points: &[f64], order: u32) -> f64 {
        let mut values = points.to_vec();
        for _ in 0..order {
            values = values.windows(2).map(|pair| (pair[1] - pair[0]) / PERIOD_S).collect();
        }
        values.iter().fold(0.0, |peak: f64, value| peak.max(value.abs()))
    }

    #[test]
    fn it_gets_there_as_fast_as_its_limits_allow_and_no_faster() {
        for target in [0.5, -0.5, 1e-6, 0.01, 0.123_456_789] {
            let (profile, points) = run(None, 3000, &[(0, Some(target))]);
            assert!(profile.rests() && profile.set_point() == target, "{target}: {profile:?}");
            assert!(peak(&points, 1) <= 0.5 * (1.0 + 1e-9), "{target}");
            assert!(peak(&points, 2) <= 2.0 * (1.0 + 1e-6), "{target}: {}", peak(&points, 2));
            let beyond = points.iter().fold(0.0, |most: f64, point| most.max(point / target));
            assert!(beyond <= 1.0 + 1e-12, "{target}: {beyond}");
        }
        // 0.5 m at 0.5 m/s and 2 m/s²: 1 s and the time to speed, 0.25 s.
        let (_, points) = run(None, 3000, &[(0, Some(0.5))]);
        let arrived = points.iter().position(|point| *point == 0.5).unwrap();
        assert!((1250..1260).contains(&arrived), "{arrived}");
    }

    #[test]
    fn its_jerk_is_limited_where_the_file_says_so() {
        let (profile, points) = run(Some(20.0), 3000, &[(0, Some(0.4)), (500, None), (1500, Some(-0.2))]);
        assert!(profile.rests() && profile.set_point() == -0.2);
        assert!(peak(&points, 3) <= 20.0 * (1.0 + 1e-3), "{}", peak(&points, 3));
        assert!(peak(&points, 2) <= 4.0 * (1.0 + 1e-6));
    }

    #[test]
    fn a_stop_slows_down_by_its_own_limit_and_never_goes_on() {
        let (profile, points) = run(None, 1000, &[(0, Some(1.0)), (500, None)]);
        assert!(profile.rests());
        // From 0.5 m/s at 4 m/s².
        let stopped = profile.set_point() - points[502];
        assert!((stopped - 0.5 * 0.5 / 8.0).abs() < 1e-3, "{stopped}");
    }

    #[test]
    fn a_new_target_behind_it_is_reached_without_a_leap() {
        let (profile, points) = run(None, 4000, &[(0, Some(1.0)), (600, Some(0.1))]);
        assert!(profile.rests() && profile.set_point() == 0.1);
        assert!(peak(&points, 2) <= 2.0 * (1.0 + 1e-6), "{}", peak(&points, 2));
        let furthest = points.iter().fold(0.0, |most: f64, point| most.max(*point));
        assert!(furthest < 1.0);
    }
}
