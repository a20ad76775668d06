//! What was heard in a few milliseconds, and how a belief passes through it.
//!
//! Readings of speeds count as their mean over the epoch; poses at their own instants, on the arc of the epoch's step.

mod fading;
mod flaws;
mod inertial;
mod kept;
mod lags;
mod lean;
mod mounted;
mod poses;
mod rates;
mod unshown;

use omnibase_platform::{BodyStep, Pose2, length};

use crate::belief::{Belief, FLAWS, Meanwhile, OWN};
use crate::filter::FilterSettings;
use crate::sensor::{MAX_RATES, MAX_SENSORS, Reading, SensorKind};
use crate::standing::Standing;
pub(crate) use fading::Fading;
pub use flaws::Flaw;
pub use inertial::Inertia;
pub use kept::Kept;
pub use lags::Lag;
pub use lean::Lean;
pub(crate) use mounted::Mounted;
use rates::Rates;
pub use unshown::Unshown;

/// Poses of one epoch; those beyond are left out.
pub const MAX_POSES: usize = 8;
/// chi² that one reading in a thousand exceeds, with 1, 2 and 3 degrees of freedom.
const GATES: [f64; 3] = [10.83, 13.82, 16.27];

/// chi² of a reading over its degrees of freedom, beyond which it is left out.
pub fn gate(kind: SensorKind) -> f64 {
    let numbers = rates::numbers_of(kind);
    GATES[numbers - 1] / numbers as f64
}

/// Any dry floor carries an acceleration of the wheels up to this, m/s²; beyond it, wheels are the first suspects for so
/// long, s. Turns count at a usual distance of the wheels, m.
const STRAINING_M_S2: f64 = 0.8;
const STRAINED_S: f64 = 0.3;
/// How the twist changes is seen over so long, s.
const SMOOTHED_S: f64 = 0.2;
/// What several agreed in counts for so long, s.
const SHARED_S: f64 = 0.05;
const ARM_M: f64 = 0.35;
/// What a sensor repeats to the bit counts where more than so many standard deviations were expected in between.
const REPEATS_SIGMAS: f64 = 4.0;

/// A sum of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    values: [f64; 3],
    count: u32,
    /// Of their instants since the first of these, ns.
    instants_ns: [u64; 2],
}

/// A pose that was heard.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Heard {
    sensor: usize,
    instant_ns: u64,
    map_from_sensor: Pose2,
    covariance: [f64; 6],
}

/// What was heard in an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Epoch {
    /// The instant of its last cycle, ns.
    pub end_ns: u64,
    /// How long its cycles were together, s.
    pub time_s: f64,
    /// How the platform moved in it, as its wheels tell.
    pub body_from_end: Pose2,
    /// How fast wheels slip in it, as forces tell, m/s: 0 where they grip.
    pub slip_m_s: f64,
    /// By how much wheels may have rolled unread, m and rad.
    pub unread: [f64; 2],
    /// The wheels weren't heard in each of its cycles: what they tell belongs to no single moment.
    pub has_gap: bool,
    /// Nobody followed the pose in it: it may jump.
    pub is_free: bool,
    rates: [Sum; MAX_RATES],
    poses: [Option<Heard>; MAX_POSES],
}

impl Default for Epoch {
    fn default() -> Self {
        Epoch {
            end_ns: 0,
            time_s: 0.0,
            body_from_end: Pose2::default(),
            slip_m_s: 0.0,
            unread: [0.0; 2],
            has_gap: false,
            is_free: true,
            rates: [Sum::default(); MAX_RATES],
            poses: [None; MAX_POSES],
        }
    }
}

/// A belief, and what is thought of each sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knowledge {
    /// The belief.
    pub belief: Belief,
    /// The sensors.
    pub standings: [Standing; MAX_SENSORS],
    /// A pose told where the platform is, or somebody did.
    pub is_placed: bool,
    /// What it may be off beside its covariance, m and rad, because a sensor that tells speeds contradicts.
    pub doubt: [f64; 2],
    /// For so long yet a floor may be giving way, s: wheels were strongly accelerated, or slip as forces tell.
    pub strained_s: f64,
    /// For so long yet several agree in that wheels slip, s.
    pub shared_s: f64,
    /// The body's twist in the epoch before, as wheels tell.
    pub twist: [f64; 3],
    /// That over lately.
    pub slow: [f64; 3],
    /// And how it changes.
    pub change: [f64; 3],
    /// How far the wheels drove since the beginning, m and rad: the way's length and the turns'.
    pub driven: [f64; 2],
    /// What is known of accelerometers, by their places among those that tell speeds.
    pub inertia: [Inertia; MAX_RATES],
    /// What is known of the flaws of those that tell speeds, and of the clocks of wheels and poses.
    pub flaws: [Flaw; FLAWS],
    /// What they may have made of the pose since one was taken in.
    pub kept: Kept,
    /// What gyros that weren't shown right may have made of the pose.
    pub unshown: Unshown,
    /// How those that tell speeds are off as what they tell changes.
    pub lags: [Lag; MAX_RATES],
    /// What each sensor was off lately.
    pub leans: [Lean; MAX_SENSORS],
}

impl Knowledge {
    /// All but the belief is as before.
    fn follow(&mut self, before: &Knowledge) {
        let Knowledge {
            belief: _,
            standings,
            is_placed,
            doubt,
            strained_s,
            shared_s,
            twist,
            slow,
            change,
            driven,
            inertia,
            flaws,
            kept,
            unshown,
            lags,
            leans,
        } = before;
        (self.standings, self.is_placed, self.doubt) = (*standings, *is_placed, *doubt);
        (self.strained_s, self.shared_s) = (*strained_s, *shared_s);
        (self.twist, self.slow, self.change, self.driven) = (*twist, *slow, *change, *driven);
        (self.inertia, self.flaws, self.kept, self.unshown) = (*inertia, *flaws, *kept, *unshown);
        (self.lags, self.leans) = (*lags, *leans);
    }

    /// What it may be off beside its covariance, m and rad, because a sensor contradicts, by the one that says most.
    pub(crate) fn doubts(&self) -> [f64; 2] {
        let all = self.standings.iter().map(|standing| standing.doubted);
        all.fold(self.doubt, |most, one| [most[0].max(one[0]), most[1].max(one[1])])
    }

    /// How far a wheel drove, whichever way, m.
    fn driven_m(&self) -> f64 {
        self.driven[0] + ARM_M * self.driven[1]
    }

    /// By how much the twist grew in a second lately, and what it was. This epoch's has no part in it: what wheels slip in it would
    /// seem to have to do with what sensors are off.
    fn next_change(&mut self, fading: &Fading) -> [[f64; 3]; 2] {
        let share = 1.0 - fading.smoothed;
        let before = [self.change, self.slow];
        for (slow, now) in self.slow.iter_mut().zip(self.twist) {
            *slow += share * (now - *slow);
        }
        self.change = std::array::from_fn(|n| (self.twist[n] - self.slow[n]) / SMOOTHED_S);
        before
    }

    /// Notices when wheels are accelerated as floors may not carry; by how much the twist grows in a second.
    fn strain(&mut self, step: BodyStep, time_s: f64, slip_m_s: f64) -> [f64; 3] {
        let twist = [step.x_m, step.y_m, step.angle_rad].map(|way| way / time_s);
        let gain: [f64; 3] = std::array::from_fn(|n| (twist[n] - self.twist[n]) / time_s);
        // What turns the way with the body is carried by the floor, too.
        let along = [gain[0] - twist[2] * twist[1], gain[1] + twist[2] * twist[0]];
        let at_wheels_m_s2 = along[0].hypot(along[1]) + ARM_M * gain[2].abs();
        self.twist = twist;
        self.strained_s = (self.strained_s - time_s).max(0.0);
        self.shared_s = (self.shared_s - time_s).max(0.0);
        if at_wheels_m_s2 > STRAINING_M_S2 || slip_m_s > 0.0 {
            self.strained_s = STRAINED_S;
        }
        gain
    }
}

impl Epoch {
    /// Takes a reading of a sensor in, whose place among those that tell speeds is `rate`; whether there was room.
    pub(crate) fn hear(
        &mut self,
        sensor: usize,
        rate: Option<usize>,
        instant_ns: u64,
        reading: &Reading,
    ) -> bool {
        let values = match *reading {
            Reading::Turn(turn) => [turn, 0.0, 0.0],
            Reading::Inertial { turn, acceleration: [x, y] } => [turn, x, y],
            Reading::Flow([x, y]) => [x, y, 0.0],
            Reading::Twist(twist) => twist,
            Reading::Pose { map_from_sensor, covariance } => {
                return self.hear_pose(Heard { sensor, instant_ns, map_from_sensor, covariance });
            }
        };
        let Some(sum) = rate.and_then(|rate| self.rates.get_mut(rate)) else { return false };
        for (sum, value) in sum.values.iter_mut().zip(values) {
            *sum += value;
        }
        if sum.count == 0 {
            sum.instants_ns[0] = instant_ns;
        }
        sum.instants_ns[1] = sum.instants_ns[1].wrapping_add(instant_ns.wrapping_sub(sum.instants_ns[0]));
        sum.count += 1;
        true
    }

    /// In the order of their instants, however they came.
    fn hear_pose(&mut self, heard: Heard) -> bool {
        if self.poses[MAX_POSES - 1].is_some() {
            return false;
        }
        let key = |one: &Option<Heard>| one.map_or((u64::MAX, 0), |one| (one.instant_ns, one.sensor));
        let at = self.poses.partition_point(|one| key(one) <= (heard.instant_ns, heard.sensor));
        self.poses[at..].rotate_right(1);
        self.poses[at] = Some(heard);
        true
    }

    /// How long after its middle readings were on average, s.
    fn later_than_middle_s(&self, sum: &Sum) -> f64 {
        let [first_ns, since_ns] = sum.instants_ns;
        let first_s = first_ns.wrapping_sub(self.end_ns) as i64 as f64 * 1e-9;
        first_s + since_ns as i64 as f64 * 1e-9 / f64::from(sum.count) + 0.5 * self.time_s
    }

    /// The step of the body in it, as the wheels tell.
    pub fn step(&self) -> BodyStep {
        self.body_from_end.log()
    }

    /// Makes what was known before it what is known after it.
    pub(crate) fn pass(
        &self,
        settings: &FilterSettings,
        sensors: &[Mounted],
        fading: &Fading,
        before: &Knowledge,
        known: &mut Knowledge,
    ) {
        if self.time_s <= 0.0 {
            *known = *before;
            return;
        }
        known.follow(before);
        let step = self.step();
        let wheels_slip = settings.slip_sigma(step, self.time_s);
        let [change, slow] = known.next_change(fading);
        let slow = settings.surely(slow);
        let gain = known.strain(step, self.time_s, self.slip_m_s);
        let [x, y, turn] = change.map(|change| change * self.time_s);
        let meanwhile = Meanwhile {
            time_s: self.time_s,
            slip_kept: fading.slip,
            slip_sigma: wheels_slip.map(|sigma| length([sigma, self.slip_m_s])),
            slip_least: self.feel(sensors, step, gain, known),
            flaws_kept: known.forget_flaws(fading),
            longer: [[x, y, 0.0], [0.0, 0.0, turn]],
        };
        let truly = known.belief.advance(&before.belief, step, &meanwhile);
        let from = before.belief.map_from_body;
        known.kept.goes_on(from, known.belief.map_from_body);
        self.count_unshown(settings, sensors, from, truly, known);
        known.driven[0] += step.distance_m();
        known.driven[1] += step.angle_rad.abs();
        let [way_m, turn_rad] = self.unread;
        known.belief.widen(0, way_m * way_m);
        known.belief.widen(1, way_m * way_m);
        known.belief.widen(2, turn_rad * turn_rad);
        for (rate, (sensor, _)) in rates(sensors) {
            let walk = sensors[sensor].model.bias_walk;
            known.belief.widen(OWN + 2 * rate, walk * walk * self.time_s);
        }
        if !self.has_gap {
            let slip_drive = meanwhile.slip_drive();
            Rates { epoch: self, sensors, step, gain, change, slow, slip_drive, fading }.take(known);
        }
        for heard in self.poses.iter().flatten() {
            self.take_pose(sensors, heard, known, truly);
        }
        known.judge_flaws(sensors, self.end_ns);
        if sensors.iter().any(Mounted::is_pose) {
            known.keep_by_flaws();
        }
    }
}

/// The sensors that tell speeds: the place of each among them, among all, and its kind.
pub(crate) fn rates(sensors: &[Mounted]) -> impl Iterator<Item = (usize, (usize, SensorKind))> + '_ {
    let all = sensors.iter().enumerate();
    all.filter_map(|(place, sensor)| Some((sensor.rate?, (place, sensor.model.kind))))
}
