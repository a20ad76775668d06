//! Iterative learning: what repeats of a motion teach of where the platform gets to, as a correction of where it is told to go.
//!
//! Of each repeat the distance of map from the motion that is wished is averaged at each control of a B-spline, by the
//! spline's own bell: symmetric in time, so nothing is shifted, and without a negative share at any frequency, so that each
//! repeat leaves less of what repeats (D. A. Bristow et al., "A survey of iterative learning control", 2006: Q-filter).

pub mod rehearsal;

use omnibase_fusion::{SensorKind, Verdict};
use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::TaskFrame;
use omnibase_robot::signals::{Course, CycleRecord, LimitedBy, Phase, SafetyReason};
use omnibase_trajectory::corrected::{MOST_CORRECTED, control_centre_s};

/// Between two controls, s, and the most of them.
const CONTROL_S: f64 = 0.1;
const MOST_CONTROLS: usize = 2000;
/// The least of them: a short motion's.
const FEWEST_CONTROLS: usize = 8;
/// The share of what is wrong that the next repeat makes up for, and the least one: below it nothing more is learnt.
const GAIN: f64 = 0.7;
const LEAST_GAIN: f64 = 0.05;
/// A heading's error counts as the way of a point so far from the centre, m.
const ARM_M: f64 = 0.3;
/// A sensor may be out of favour for this share of the cycles.
const DOUBTED_SHARE: f64 = 0.05;
/// What is learnt must be better than nothing by this share.
const WORTH: f64 = 0.05;

/// Why nothing can be learnt on a robot, or of a repeat.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotLearnt {
    /// Nothing tells where it is.
    #[error(
        "expected a `[[sensor]]` of kind \"pose\" and the estimator `fused`: nothing tells this robot where it truly is"
    )]
    NoPoses,
    /// A motion without an end.
    #[error("expected a motion with an end")]
    Endless,
    /// What it was driven with isn't of this motion, or not of here.
    #[error(
        "its correction has {found} lines: expected {expected}, as `omnibase learn` writes them for this motion"
    )]
    Correction {
        /// Lines that it should have.
        expected: usize,
        /// Lines that it has.
        found: usize,
    },
    /// It is of another motion.
    #[error("it is a motion of {found_s} s: expected one of {expected_s} s, as those before it")]
    Another {
        /// Those before it, s.
        expected_s: f64,
        /// This one, s.
        found_s: f64,
    },
    /// It wasn't driven to its end.
    #[error("it wasn't driven to its end: {why}")]
    NotDriven {
        /// Why.
        why: &'static str,
    },
    /// It was held back.
    #[error("at {time_s:.2} s of the motion {what}: what followed isn't what is to be learnt")]
    HeldBack {
        /// The motion's time, s.
        time_s: f64,
        /// By what.
        what: &'static str,
    },
    /// Its poses weren't believed.
    #[error("the sensor `{name}` wasn't believed for {percent:.0} % of the way")]
    Doubted {
        /// The sensor.
        name: String,
        /// For how much of the way.
        percent: f64,
    },
}

/// One repeat, as it is driven.
#[derive(Clone, Debug)]
pub struct Repeat {
    duration_s: f64,
    /// What it is driven with.
    controls: Vec<[f64; 3]>,
    poses: Vec<(usize, String)>,
    in_map: bool,
    map_from_odom: Option<Pose2>,
    /// Weighted sums about the controls: of where the platform was in the axes of where it should have been.
    sums: Vec<[f64; 4]>,
    cycles: usize,
    doubted: Vec<usize>,
    refused: Option<NotLearnt>,
    begun: bool,
    ended: bool,
}

impl Repeat {
    /// A repeat of a plan's own motion of this duration, driven with its own correction.
    pub fn new(plan: &RobotPlan, duration_s: f64) -> Result<Repeat, NotLearnt> {
        let sensors = plan.sensors.iter().enumerate();
        let poses: Vec<(usize, String)> = sensors
            .filter(|(_, sensor)| sensor.sensor.kind == SensorKind::Pose)
            .map(|(place, sensor)| (place, sensor.name.clone()))
            .collect();
        if poses.is_empty() {
            return Err(NotLearnt::NoPoses);
        }
        if !duration_s.is_finite() {
            return Err(NotLearnt::Endless);
        }
        let expected = controls_of(duration_s);
        let lines = plan.reference.correction.as_deref().unwrap_or_default();
        if !lines.is_empty() && lines.len() != expected {
            return Err(NotLearnt::Correction { expected, found: lines.len() });
        }
        let mut controls: Vec<_> = lines.iter().map(|[_, x, y, turn]| [*x, *y, *turn]).collect();
        controls.resize(expected, [0.0; 3]);
        Ok(Repeat {
            duration_s,
            controls,
            doubted: vec![0; poses.len()],
            poses,
            in_map: plan.estimator.task_frame.unwrap_or_default() == TaskFrame::Map,
            map_from_odom: None,
            sums: vec![[0.0; 4]; expected],
            cycles: 0,
            refused: None,
            begun: false,
            ended: false,
        })
    }

    /// Time of the whole motion, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Takes a cycle of it in; those before and after it, too.
    pub fn take(&mut self, record: &CycleRecord) {
        let time_s = match record.phase {
            Phase::Tracking if record.course == Course::Reference => {
                record.reference_time_s.min(self.duration_s)
            }
            // It rests where it ends.
            Phase::Holding if self.ended => self.duration_s,
            _ => return,
        };
        if !self.begun {
            self.begun = true;
            let odom_from_body = record.state.odom_from_body;
            let map_from_odom = record.fusion.map_from_body.then(odom_from_body.inverse());
            self.map_from_odom = Some(if self.in_map { Pose2::default() } else { map_from_odom });
        }
        self.ended |= record.reference_time_s >= self.duration_s;
        if record.phase == Phase::Tracking {
            self.look(record, time_s);
        }
        let Some(map_from_odom) = self.map_from_odom else { return };
        let asked = map_from_odom.then(record.wished.odom_from_body.then(record.correction.inverse()));
        let off = asked.inverse().then(record.fusion.map_from_body);
        let off = [off.x_m, off.y_m, wrap_angle_rad(off.heading_rad)];
        let (last, span_s) = (self.sums.len() - 1, self.duration_s / (self.sums.len() + 1) as f64);
        for (control, sum) in self.sums.iter_mut().enumerate() {
            let centre_s = control_centre_s(self.duration_s, last, control);
            let weight = bell((time_s - centre_s) / span_s);
            if weight > 0.0 {
                sum.iter_mut().zip([1.0, off[0], off[1], off[2]]).for_each(|(sum, one)| *sum += weight * one);
            }
        }
    }

    /// Sees what must not be learnt from.
    fn look(&mut self, record: &CycleRecord, time_s: f64) {
        self.cycles += 1;
        for (doubted, (place, _)) in self.doubted.iter_mut().zip(&self.poses) {
            *doubted += usize::from(record.fusion.sensors[*place].verdict != Verdict::Good);
        }
        let what = if record.stop_reason != SafetyReason::None {
            record.stop_reason.text()
        } else if record.guard.limited_by != LimitedBy::Nothing {
            "fence or obstacles held it back"
        } else if !self.ended && record.reference_rate < 0.999 {
            "it was slowed"
        } else {
            return;
        };
        self.refused.get_or_insert(NotLearnt::HeldBack { time_s, what });
    }

    /// What it comes to: where the platform was in the axes of where it should have been, m and rad, at each control.
    fn offs(&self) -> Result<Vec<[f64; 3]>, NotLearnt> {
        if let Some(refused) = &self.refused {
            return Err(refused.clone());
        }
        if !self.ended {
            let why = if self.begun { "it was stopped on its way" } else { "it didn't begin" };
            return Err(NotLearnt::NotDriven { why });
        }
        for (doubted, (_, name)) in self.doubted.iter().zip(&self.poses) {
            let share = *doubted as f64 / self.cycles.max(1) as f64;
            if share > DOUBTED_SHARE {
                return Err(NotLearnt::Doubted { name: name.clone(), percent: 100.0 * share });
            }
        }
        let mean = |sum: &[f64; 4]| [1, 2, 3].map(|n| if sum[0] > 0.0 { sum[n] / sum[0] } else { 0.0 });
        Ok(self.sums.iter().map(mean).collect())
    }
}

/// What a repeat came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learnt {
    /// RMS distance of map from the wished motion, without what doesn't last longer than a control, m; a heading's error
    /// counts with an arm of 0.3 m.
    pub rms_m: f64,
    /// It is the best one so far.
    pub is_best: bool,
}

/// The best repeat so far.
#[derive(Clone, Debug)]
struct Best {
    rms_m: f64,
    /// What it was driven with.
    controls: Vec<[f64; 3]>,
    /// Where the platform was in the axes of where it should have been.
    offs: Vec<[f64; 3]>,
}

/// What repeats taught so far.
#[derive(Clone, Debug)]
pub struct Learner {
    duration_s: f64,
    gain: f64,
    /// What the next repeat is driven with.
    next: Vec<[f64; 3]>,
    best: Option<Best>,
    /// The RMS of the first one.
    first_m: f64,
}

impl Learner {
    /// Nothing is known yet.
    pub fn new(duration_s: f64) -> Learner {
        let next = vec![[0.0; 3]; controls_of(duration_s)];
        Learner { duration_s, gain: GAIN, next, best: None, first_m: f64::NAN }
    }

    /// What the next repeat is driven with: controls `[t, x, y, θ]`.
    pub fn next(&self) -> Vec<[f64; 4]> {
        self.lines(&self.next)
    }

    /// The best one that was driven; nothing where none was better than the first by what is worth it.
    pub fn best(&self) -> Option<Vec<[f64; 4]>> {
        let best = self.best.as_ref()?;
        (best.rms_m < (1.0 - WORTH) * self.first_m).then(|| self.lines(&best.controls))
    }

    /// Whether more repeats teach nothing.
    pub fn is_settled(&self) -> bool {
        self.gain < LEAST_GAIN
    }

    /// Learns from a repeat.
    pub fn learn(&mut self, repeat: &Repeat) -> Result<Learnt, NotLearnt> {
        if repeat.duration_s != self.duration_s {
            return Err(NotLearnt::Another { expected_s: self.duration_s, found_s: repeat.duration_s });
        }
        let offs = repeat.offs()?;
        let square_m2 = |[x, y, turn]: &[f64; 3]| x * x + y * y + (ARM_M * turn).powi(2);
        let rms_m = (offs.iter().map(square_m2).sum::<f64>() / offs.len() as f64).sqrt();
        let is_best = self.best.as_ref().is_none_or(|best| rms_m < best.rms_m);
        if is_best {
            if self.best.is_none() {
                self.first_m = rms_m;
            }
            self.best = Some(Best { rms_m, controls: repeat.controls.clone(), offs });
        } else {
            // Back to the best one, and on from there in smaller steps.
            self.gain *= 0.5;
        }
        if let Some(Best { controls, offs, .. }) = &self.best {
            let corrected = controls.iter().zip(offs).map(|(control, off)| {
                let sum = [0, 1, 2].map(|n| control[n] - self.gain * off[n]);
                within(sum)
            });
            self.next = corrected.collect();
            // It begins where the platform stands.
            self.next[0] = [0.0; 3];
        }
        Ok(Learnt { rms_m, is_best })
    }

    fn lines(&self, controls: &[[f64; 3]]) -> Vec<[f64; 4]> {
        let last = (controls.len() - 1) as f64;
        let at = |control: usize| self.duration_s * control as f64 / last;
        controls.iter().enumerate().map(|(n, [x, y, turn])| [at(n), *x, *y, *turn]).collect()
    }
}

fn within([x_m, y_m, turn_rad]: [f64; 3]) -> [f64; 3] {
    let [most_m, most_rad] = MOST_CORRECTED;
    // A rounding away from the bound.
    let share = (0.999 * most_m / x_m.hypot(y_m)).min(1.0);
    [share * x_m, share * y_m, turn_rad.clamp(-most_rad, most_rad)]
}

fn controls_of(duration_s: f64) -> usize {
    ((duration_s / CONTROL_S).ceil().min(MOST_CONTROLS as f64) as usize).max(FEWEST_CONTROLS)
}

/// The uniform cubic B-spline about 0, with knots 1 apart.
fn bell(at: f64) -> f64 {
    let at = at.abs();
    if at < 1.0 {
        2.0 / 3.0 - at * at * (1.0 - 0.5 * at)
    } else if at < 2.0 {
        (2.0 - at).powi(3) / 6.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::{Kinematics, Wheel};
    use omnibase_robot::Registry;
    use omnibase_trajectory::{Correction, PathPoint, PathPoints};

    const TRACKED: &str = include_str!("../../../robots/bmm_tracked.toml");

    fn plan(reference: &str) -> RobotPlan {
        let text = format!("{TRACKED}\n{reference}");
        RobotPlan::from_toml(&text, &Registry::with_built_in(), &|_| Err(String::new())).unwrap()
    }

    /// Wheels as a workshop leaves them: 0.4 % off.
    fn built(plan: &RobotPlan) -> RobotPlan {
        let wheels =
            plan.kinematics.wheels().iter().enumerate().map(|(n, wheel)| Wheel {
                radius_m: wheel.radius_m * [1.004, 0.997, 1.002][n],
                ..wheel.clone()
            });
        RobotPlan { kinematics: Kinematics::new(wheels.collect()).unwrap(), ..plan.clone() }
    }

    fn rehearse(plan: &RobotPlan, repeats: u64) -> (Learner, Vec<(Learnt, rehearsal::Rehearsed)>) {
        let (registry, built) = (Registry::with_built_in(), built(plan));
        let mut learner = Learner::new(plan.reference.duration_s.unwrap());
        let one = |seed| {
            let driven = rehearsal::drive(&built, plan, Some(learner.next()), &registry, seed).unwrap();
            (learner.learn(&driven.repeat).unwrap(), driven)
        };
        let rehearsed = (0..repeats).map(one).collect();
        (learner, rehearsed)
    }

    const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.4\nduration_s = 7.0\n";

    #[test]
    fn what_wheels_do_wrong_the_same_way_each_time_is_learnt() {
        let mut plan = plan(CIRCLE);
        plan.estimator.task_frame = Some(TaskFrame::Odom);
        let (learner, rehearsed) = rehearse(&plan, 5);
        let (_, first) = &rehearsed[0];
        let (_, best) = rehearsed.iter().rfind(|(learnt, _)| learnt.is_best).unwrap();
        assert!(first.true_rms_m > 0.003, "{}", first.true_rms_m);
        assert!(best.true_rms_m < 0.1 * first.true_rms_m, "{}", best.true_rms_m);
        assert!(best.true_end_m < 0.001, "{}", best.true_end_m);
        assert!(learner.best().is_some());
    }

    /// A repeat that was `off` the motion, driven with these controls.
    fn seen(off_m: f64, controls: &[[f64; 4]]) -> Repeat {
        let mut plan = plan(CIRCLE);
        plan.reference.correction = Some(controls.to_vec());
        let mut repeat = Repeat::new(&plan, 7.0).unwrap();
        let point = |&[time_s, x_m, y_m, heading_rad]: &[f64; 4]| PathPoint {
            time_s,
            odom_from_base: Pose2 { x_m, y_m, heading_rad },
        };
        let points = PathPoints::new(controls.iter().map(point).collect());
        let correction = points.ok().map(|points| Correction::new(7.0, &points).unwrap());
        for cycle in 0..=7000 {
            let mut record = CycleRecord { phase: Phase::Tracking, ..CycleRecord::default() };
            record.reference_time_s = 1e-3 * f64::from(cycle);
            record.reference_rate = 1.0;
            record.fusion.sensors.iter_mut().for_each(|sensor| sensor.verdict = Verdict::Good);
            record.correction =
                correction.as_ref().map_or_else(Pose2::default, |all| all.at(record.reference_time_s));
            record.wished.odom_from_body = record.correction;
            record.fusion.map_from_body.x_m = off_m;
            repeat.take(&record);
        }
        repeat
    }

    #[test]
    fn a_worse_repeat_leads_back_to_the_best_one_in_smaller_steps() {
        let mut learner = Learner::new(7.0);
        assert!(learner.learn(&seen(0.003, &[])).unwrap().is_best);
        let first = learner.next();
        assert!((first[30][1] + GAIN * 0.003).abs() < 1e-9, "{:?}", first[30]);
        assert!(learner.best().is_none(), "nothing was driven truer than without");
        let worse = learner.learn(&seen(0.004, &first)).unwrap();
        assert!(!worse.is_best);
        let next = learner.next();
        assert!((next[30][1] + 0.5 * GAIN * 0.003).abs() < 1e-9, "{:?}", next[30]);
        for _ in 0..4 {
            learner.learn(&seen(0.004, &learner.next())).unwrap();
        }
        assert!(learner.is_settled() && learner.best().is_none());
    }

    #[test]
    fn what_is_learnt_stays_small() {
        let mut learner = Learner::new(7.0);
        for _ in 0..3 {
            learner.learn(&seen(0.2, &[])).unwrap();
        }
        let greatest = learner.next().iter().map(|control| control[1].abs()).fold(0.0, f64::max);
        assert!(greatest <= MOST_CORRECTED[0], "{greatest}");
    }

    #[test]
    fn nothing_is_learnt_from_what_was_held_back_or_not_believed() {
        let record = |time_s| CycleRecord {
            phase: Phase::Tracking,
            reference_time_s: time_s,
            reference_rate: 1.0,
            ..CycleRecord::default()
        };
        let learn = |change: &dyn Fn(&mut CycleRecord), until_s: f64| {
            let mut repeat = Repeat::new(&plan(CIRCLE), 7.0).unwrap();
            for cycle in 0..=(1000.0 * until_s) as u32 {
                let mut record = record(1e-3 * f64::from(cycle));
                record.fusion.sensors.iter_mut().for_each(|sensor| sensor.verdict = Verdict::Good);
                change(&mut record);
                repeat.take(&record);
            }
            Learner::new(7.0).learn(&repeat)
        };
        assert!(learn(&|_| {}, 7.0).is_ok());
        // On the way to its start nothing is learnt.
        let by_way = learn(&|record| record.course = Course::Way, 7.0);
        assert!(matches!(by_way, Err(NotLearnt::NotDriven { .. })), "{by_way:?}");
        assert!(matches!(learn(&|_| {}, 6.0), Err(NotLearnt::NotDriven { .. })));
        let held = |change: &dyn Fn(&mut CycleRecord)| {
            let refused = learn(change, 7.0).unwrap_err();
            assert!(matches!(refused, NotLearnt::HeldBack { .. }), "{refused}");
        };
        held(&|record| record.guard.limited_by = LimitedBy::Obstacle);
        held(&|record| record.reference_rate = 0.5);
        held(&|record| record.stop_reason = SafetyReason::WheelSlip);
        let doubted = learn(&|record| record.fusion.sensors[1].verdict = Verdict::Contradicts, 7.0);
        let words = doubted.unwrap_err().to_string();
        assert!(words.contains("`mocap`") && words.contains("100 %"), "{words}");
    }

    #[test]
    fn a_robot_without_poses_or_with_anothers_correction_learns_nothing() {
        let bmm = include_str!("../../../robots/bmm.toml");
        let bare = RobotPlan::from_toml(bmm, &Registry::with_built_in(), &|_| Err(String::new())).unwrap();
        assert_eq!(Repeat::new(&bare, 7.0).unwrap_err(), NotLearnt::NoPoses);
        assert_eq!(Repeat::new(&plan(CIRCLE), f64::INFINITY).unwrap_err(), NotLearnt::Endless);
        let mut other = plan(CIRCLE);
        let another = Learner::new(8.0).learn(&seen(0.0, &[])).unwrap_err();
        assert_eq!(another, NotLearnt::Another { expected_s: 8.0, found_s: 7.0 });
        other.reference.correction = Some(vec![[0.0; 4], [7.0, 0.0, 0.0, 0.0]]);
        assert_eq!(Repeat::new(&other, 7.0).unwrap_err(), NotLearnt::Correction { expected: 70, found: 2 });
    }
}
