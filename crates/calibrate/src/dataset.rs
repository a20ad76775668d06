//! What was measured: runs of wheels, and beside them whatever tells where the platform really was.

use omnibase_platform::{MAX_WHEELS, PerWheel, Pose2};

/// Runs of one platform, in between which nothing about it changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// The runs.
    pub runs: Vec<Run>,
}

/// One run. All instants are seconds of the same clock.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// What it is called, for messages.
    pub name: String,
    /// When the first step begins, s.
    pub begin_s: f64,
    /// What the wheels turned, one behind the other without a gap.
    pub steps: Vec<Step>,
    /// What a gyro measured.
    pub turns: Vec<TurnSample>,
    /// What a sensor of poses measured, in a world of its own.
    pub poses: Vec<PoseSample>,
    /// Where somebody found the platform on the floor.
    pub places: Vec<PlaceSample>,
}

/// What the wheels turned since the step before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// When it ends, s.
    pub end_s: f64,
    /// By how much each wheel turned, rad.
    pub turned_rad: PerWheel,
}

/// A gyro's turn about the vertical, to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnSample {
    /// When, s.
    pub instant_s: f64,
    /// The speed, rad/s.
    pub rate_rad_s: f64,
}

/// Where a sensor on the platform was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSample {
    /// When, as the sensor says, s: later than the truth by its delay.
    pub instant_s: f64,
    /// Where, in the sensor's own world.
    pub world_from_sensor: Pose2,
    /// Standard deviation of each coordinate, m.
    pub sigma_m: f64,
    /// That of the heading, rad; infinite where it isn't measured.
    pub sigma_rad: f64,
}

/// Where the base frame was on the floor, measured by hand while the platform stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceSample {
    /// When, s.
    pub instant_s: f64,
    /// Where, in a frame on the floor.
    pub floor_from_base: Pose2,
    /// Standard deviation of each coordinate, m.
    pub sigma_m: f64,
    /// That of the heading, rad.
    pub sigma_rad: f64,
}

/// No step lasts longer, s.
const LONGEST_S: f64 = 60.0;
/// No number is greater, in any unit: the year is 2·10⁹ s.
const GREATEST: f64 = 1e12;

/// Why a dataset can't be worked with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DatasetError {
    /// There is nothing in it.
    #[error("no run: expected at least one")]
    NoRun,
    /// A run without wheels.
    #[error("{run}: no wheel turned in it: expected the increments of {wheels} wheels")]
    NoSteps {
        /// Which run.
        run: String,
        /// How many wheels the platform has.
        wheels: usize,
    },
    /// A run of another platform.
    #[error("{run}, step {step}: {found} wheels, expected {expected}")]
    WheelCount {
        /// Which run.
        run: String,
        /// Which step, from 0.
        step: usize,
        /// The platform's.
        expected: usize,
        /// What was found.
        found: usize,
    },
    /// Time that stands still or runs back.
    #[error(
        "{run}, {what} {number}: its instant {found_s} s isn't later than {before_s} s, that of the one before"
    )]
    Order {
        /// Which run.
        run: String,
        /// Of what: `step`, `turn`, `pose` or `place`.
        what: &'static str,
        /// Which one, from 0.
        number: usize,
        /// Its instant.
        found_s: f64,
        /// The one before.
        before_s: f64,
    },
    /// Wheels of which nothing was read for too long.
    #[error(
        "{run}, step {step}: it lasts {found_s} s, expected at most {LONGEST_S} s: instants are in s, and wheels are read all the time"
    )]
    Long {
        /// Which run.
        run: String,
        /// Which step, from 0.
        step: usize,
        /// How long it lasts.
        found_s: f64,
    },
    /// NaN, more than can be, or a standard deviation that is none.
    #[error("{run}, {what} {number}: {value} is {found:?}, expected a number of at most {GREATEST:e} in size{and}", and = if *.must_be_positive { " above 0" } else { "" })]
    Number {
        /// Which run.
        run: String,
        /// Of what.
        what: &'static str,
        /// Which one, from 0.
        number: usize,
        /// Which of its values.
        value: &'static str,
        /// What was found.
        found: f64,
        /// Whether it is a standard deviation.
        must_be_positive: bool,
    },
    /// Nothing tells where the platform was.
    #[error(
        "{run}: nothing tells where it really was: expected poses of a sensor, a gyro's turns, or two places on the floor"
    )]
    NoTruth {
        /// Which run.
        run: String,
    },
    /// Two worlds in one run.
    #[error("{run}: poses of a sensor and places on the floor are in two worlds: expected one of them")]
    TwoWorlds {
        /// Which run.
        run: String,
    },
    /// What was measured lies beyond what the wheels did.
    #[error(
        "{run}: {what} {number} is of {found_s} s, expected within {from_s} s to {to_s} s, when wheels were counted"
    )]
    Outside {
        /// Which run.
        run: String,
        /// Of what.
        what: &'static str,
        /// Which one, from 0.
        number: usize,
        /// Its instant.
        found_s: f64,
        /// When the wheels begin.
        from_s: f64,
        /// When they end.
        to_s: f64,
    },
}

impl Dataset {
    /// Refuses what can't be worked with.
    pub fn check(&self, wheels: usize) -> Result<(), DatasetError> {
        if self.runs.is_empty() {
            return Err(DatasetError::NoRun);
        }
        self.runs.iter().try_for_each(|run| run.check(wheels))
    }
}

impl Run {
    /// When the last step ends, s.
    pub fn end_s(&self) -> f64 {
        self.steps.last().map_or(self.begin_s, |step| step.end_s)
    }

    /// The same run in steps of at least this length, s, where it has shorter ones.
    #[must_use]
    pub fn in_steps_of(mut self, least_s: f64) -> Run {
        let mut joined: Vec<Step> = Vec::new();
        let mut from_s = self.begin_s;
        for step in &self.steps {
            match joined.last_mut() {
                Some(last) if last.end_s - from_s < least_s * (1.0 - 1e-9) => {
                    let turned_rad = PerWheel::from_fn(step.turned_rad.len(), |at| {
                        last.turned_rad[at] + step.turned_rad[at]
                    });
                    *last = Step { end_s: step.end_s, turned_rad };
                }
                last => {
                    from_s = last.map_or(from_s, |last| last.end_s);
                    joined.push(*step);
                }
            }
        }
        self.steps = joined;
        self
    }

    /// The same run without poses that say to the bit what the one before said: a tracker that lost sight of its markers repeats
    /// the last one, and nothing was measured.
    #[must_use]
    pub fn without_repeats(mut self) -> Run {
        let mut last = None;
        self.poses.retain(|pose| {
            let Pose2 { x_m, y_m, heading_rad } = pose.world_from_sensor;
            let said = [x_m, y_m, heading_rad].map(f64::to_bits);
            last.replace(said) != Some(said)
        });
        self
    }

    /// Refuses what can't be worked with.
    pub fn check(&self, wheels: usize) -> Result<(), DatasetError> {
        let run = || self.name.clone();
        if self.steps.is_empty() {
            return Err(DatasetError::NoSteps { run: run(), wheels });
        }
        for (step, Step { turned_rad, .. }) in self.steps.iter().enumerate() {
            let found = turned_rad.len();
            if found != wheels || wheels > MAX_WHEELS {
                return Err(DatasetError::WheelCount { run: run(), step, expected: wheels, found });
            }
            for value in turned_rad.iter() {
                self.number("step", step, "turned_rad", *value)?;
            }
        }
        self.in_order("step", self.begin_s, self.steps.iter().map(|step| step.end_s))?;
        let mut from_s = self.begin_s;
        for (step, Step { end_s, .. }) in self.steps.iter().enumerate() {
            let found_s = end_s - from_s;
            if found_s > LONGEST_S {
                return Err(DatasetError::Long { run: run(), step, found_s });
            }
            from_s = *end_s;
        }
        self.in_order("turn", f64::NEG_INFINITY, self.turns.iter().map(|turn| turn.instant_s))?;
        self.in_order("pose", f64::NEG_INFINITY, self.poses.iter().map(|pose| pose.instant_s))?;
        self.in_order("place", f64::NEG_INFINITY, self.places.iter().map(|place| place.instant_s))?;
        for (number, turn) in self.turns.iter().enumerate() {
            self.number("turn", number, "rate_rad_s", turn.rate_rad_s)?;
        }
        for (number, pose) in self.poses.iter().enumerate() {
            self.pose("pose", number, pose.world_from_sensor, pose.sigma_m)?;
            // Infinity says that no heading was measured.
            if pose.sigma_rad.is_nan() || pose.sigma_rad <= 0.0 {
                return Err(self.not_a_number("pose", number, "sigma_rad", pose.sigma_rad, true));
            }
        }
        for (number, place) in self.places.iter().enumerate() {
            self.pose("place", number, place.floor_from_base, place.sigma_m)?;
            self.sigma("place", number, "sigma_rad", place.sigma_rad)?;
            let (from_s, to_s, found_s) = (self.begin_s, self.end_s(), place.instant_s);
            if !(from_s..=to_s).contains(&found_s) {
                return Err(DatasetError::Outside {
                    run: run(),
                    what: "place",
                    number,
                    found_s,
                    from_s,
                    to_s,
                });
            }
        }
        if !self.poses.is_empty() && !self.places.is_empty() {
            return Err(DatasetError::TwoWorlds { run: run() });
        }
        if self.poses.len() < 2 && self.places.len() < 2 && self.turns.len() < 2 {
            return Err(DatasetError::NoTruth { run: run() });
        }
        Ok(())
    }

    fn in_order(
        &self,
        what: &'static str,
        begin_s: f64,
        instants_s: impl Iterator<Item = f64>,
    ) -> Result<(), DatasetError> {
        let mut before_s = begin_s;
        for (number, found_s) in instants_s.enumerate() {
            self.number(what, number, "its instant", found_s)?;
            if found_s <= before_s {
                return Err(DatasetError::Order { run: self.name.clone(), what, number, found_s, before_s });
            }
            before_s = found_s;
        }
        Ok(())
    }

    fn pose(&self, what: &'static str, number: usize, pose: Pose2, sigma_m: f64) -> Result<(), DatasetError> {
        for (value, found) in [("x_m", pose.x_m), ("y_m", pose.y_m), ("heading_rad", pose.heading_rad)] {
            self.number(what, number, value, found)?;
        }
        self.sigma(what, number, "sigma_m", sigma_m)
    }

    fn number(
        &self,
        what: &'static str,
        number: usize,
        value: &'static str,
        found: f64,
    ) -> Result<(), DatasetError> {
        if found.abs() <= GREATEST {
            Ok(())
        } else {
            Err(self.not_a_number(what, number, value, found, false))
        }
    }

    fn sigma(
        &self,
        what: &'static str,
        number: usize,
        value: &'static str,
        found: f64,
    ) -> Result<(), DatasetError> {
        let is_sigma = found > 0.0 && found <= GREATEST;
        if is_sigma { Ok(()) } else { Err(self.not_a_number(what, number, value, found, true)) }
    }

    fn not_a_number(
        &self,
        what: &'static str,
        number: usize,
        value: &'static str,
        found: f64,
        must_be_positive: bool,
    ) -> DatasetError {
        DatasetError::Number { run: self.name.clone(), what, number, value, found, must_be_positive }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_that_repeats_the_one_before_is_none() {
        let pose = |instant_s: f64, x_m: f64| PoseSample {
            instant_s,
            world_from_sensor: Pose2::new(x_m, 0.0, 0.0),
            sigma_m: 1e-3,
            sigma_rad: 3e-3,
        };
        let poses = vec![pose(0.0, 1.0), pose(0.1, 1.0), pose(0.2, 2.0), pose(0.3, 2.0), pose(0.4, 1.0)];
        let run = Run { poses, ..Run::default() }.without_repeats();
        let kept: Vec<f64> = run.poses.iter().map(|pose| pose.instant_s).collect();
        assert_eq!(kept, [0.0, 0.2, 0.4]);
    }
}
