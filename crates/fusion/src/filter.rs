//! Epochs in a ring; what comes late goes where it belongs, and what follows is computed again.
//!
//! While that goes on, a few epochs a cycle, the belief that is told goes on without what was late, and is replaced when
//! the other has caught up. What is known then is what it would be had everything come in its order.

use nalgebra::SMatrix;
use omnibase_platform::{BodyStep, CovarianceSettings, Kinematics, Pose2};

use crate::belief::{Belief, OWN, SLIP_TIME_S};
use crate::epoch::{Epoch, Fading, Flaw, Inertia, Kept, Knowledge, Lag, Lean, Mounted, Unshown, rates};
use crate::sensor::{MAX_RATES, MAX_SENSORS, Reading, Sensor, SensorKind};
use crate::standing::{Standing, Verdict};

/// Epochs that are kept.
const KEPT: u64 = 256;
/// What is late by so many of them finds its place: by 1.2 s, with 5 ms each.
const REACH: u64 = 240;
/// A reading may be ahead of the wheels by so much: theirs is read in the middle of a cycle, ns.
const AHEAD_NS: u64 = 10_000_000;
/// Wheels that say what is no number may have gone anywhere, m.
const UNKNOWN_M: f64 = 10.0;
/// Least duration of an epoch, ns.
const EPOCH_NS: u64 = 5_000_000;
/// Epochs that are passed in one cycle at most, beside the new one.
const PASSED_PER_CYCLE: u32 = 2;
/// The geometry of wheels is wrong by at most so many of its standard deviations.
const WRONG_SIGMAS: f64 = 3.5;
/// Wheels at rest creep at most so fast, m/s and rad/s.
const RESTING: [f64; 2] = [5e-5, 1e-4];

/// What a filter is told once.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterSettings {
    /// How wheels make the pose uncertain.
    pub wheels: CovarianceSettings,
    /// Covariance of what the wheels' geometry makes of a step, row by row of E.
    pub geometry: SMatrix<f64, 9, 9>,
    /// Period of the cycle, ns.
    pub period_ns: u64,
}

impl FilterSettings {
    /// Those of a platform.
    pub fn new(kinematics: &Kinematics, wheels: CovarianceSettings, period_ns: u64) -> FilterSettings {
        FilterSettings { wheels, geometry: kinematics.step_covariance(&wheels.geometry), period_ns }
    }

    /// What of a twist that wheels tell is none of their geometry's making, however wrong that is.
    pub(crate) fn surely(&self, twist: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let of = |r: usize, c: usize| twist[r] * self.geometry[(3 * axis + r, 3 * axis + c)] * twist[c];
            let variance: f64 = (0..9).map(|n| of(n / 3, n % 3)).sum();
            let least = WRONG_SIGMAS * variance.sqrt();
            twist[axis] - twist[axis].clamp(-least, least)
        })
    }

    /// Standard deviations of the speed by which wheels slip unseen during a step: over a way they add up to what the
    /// wheels' settings say of it.
    pub(crate) fn slip_sigma(&self, step: BodyStep, time_s: f64) -> [f64; 3] {
        let (way_m, turn_rad) = (step.distance_m(), step.angle_rad.abs());
        let wheels = &self.wheels;
        let position_m2 = wheels.position_per_m * way_m + wheels.position_per_rad * turn_rad;
        let heading_rad2 = wheels.heading_per_m * way_m + wheels.heading_per_rad * turn_rad;
        let sigma =
            |variance: f64, resting: f64| (variance / (2.0 * SLIP_TIME_S * time_s)).sqrt().hypot(resting);
        let position = sigma(position_m2, RESTING[0]);
        [position, position, sigma(heading_rad2, RESTING[1])]
    }
}

/// How the platform moved in a cycle, as its wheels tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// From the pose of the cycle before to this one's.
    pub body_from_next: Pose2,
    /// How fast wheels slip, as forces tell, m/s.
    pub slip_m_s: f64,
    /// By how much wheels may have rolled unread, m and rad.
    pub unread: [f64; 2],
    /// All wheels were heard.
    pub is_heard: bool,
    /// Nobody follows the pose: it may jump.
    pub is_free: bool,
}

/// What is known now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Where the platform is.
    pub map_from_body: Pose2,
    /// Covariance of that: xx, xy, xψ, yy, yψ, ψψ, with what a sensor that contradicts makes of it.
    pub covariance: [f64; 6],
    /// Some pose told where the platform is, or somebody did.
    pub is_placed: bool,
}

/// A filter.
#[derive(Clone, Debug)]
pub struct Filter {
    settings: FilterSettings,
    sensors: Vec<Mounted>,
    initial: Knowledge,
    fading: Fading,
    epochs: Box<[Epoch]>,
    /// What was known after each epoch, as it is told until it was computed again.
    known_after: Box<[Knowledge]>,
    /// Number of the open epoch.
    open: u64,
    /// The first epoch since the beginning.
    first: u64,
    /// The last epoch in what is told.
    told: u64,
    /// The last epoch that was computed again, before that.
    again: Option<u64>,
    /// The first epoch into which something came late.
    late_from: Option<u64>,
    now_ns: u64,
    /// When each was heard last, or the first cycle was: by arrival, for what is late isn't silent, ns.
    last_heard_ns: [u64; MAX_SENSORS],
    epoch_ns: u64,
    begun: bool,
    /// Readings that were older than all that is kept, or of too many.
    left_out: u64,
}

impl Filter {
    /// A filter that begins at the origin of map; sensors beyond [`MAX_SENSORS`] are left out.
    pub fn new(settings: FilterSettings, sensors: &[Sensor]) -> Filter {
        let sensors = Mounted::all(&sensors[..sensors.len().min(MAX_SENSORS)]);
        let mut belief = Belief::new(Pose2::default(), &settings.geometry, rates(&sensors).count());
        for (rate, (sensor, kind)) in rates(&sensors) {
            let Sensor { bias_sigma, scale_sigma, direction_sigma_rad, .. } = sensors[sensor].model;
            let own = match kind {
                SensorKind::Turn | SensorKind::Inertial => [bias_sigma, scale_sigma],
                _ => [scale_sigma, direction_sigma_rad],
            };
            for (n, sigma) in own.iter().enumerate() {
                belief.widen(OWN + 2 * rate + n, sigma * sigma);
            }
        }
        let (position_m2, heading_rad2) = (settings.wheels.initial_m2, settings.wheels.initial_rad2);
        belief.place(Pose2::default(), [position_m2, 0.0, 0.0, position_m2, 0.0, heading_rad2]);
        let has_poses = sensors.iter().any(Mounted::is_pose);
        let known = Knowledge {
            belief,
            standings: [Standing::default(); MAX_SENSORS],
            is_placed: !has_poses,
            doubt: [0.0; 2],
            strained_s: 0.0,
            shared_s: 0.0,
            twist: [0.0; 3],
            slow: [0.0; 3],
            change: [0.0; 3],
            driven: [0.0; 2],
            inertia: [Inertia::default(); MAX_RATES],
            flaws: Flaw::all(&sensors),
            kept: Kept::default(),
            unshown: Unshown::default(),
            lags: [Lag::default(); MAX_RATES],
            leans: [Lean::default(); MAX_SENSORS],
        };
        Filter {
            epoch_ns: EPOCH_NS.max(settings.period_ns),
            settings,
            sensors,
            initial: known,
            fading: Fading::default(),
            epochs: vec![Epoch::default(); KEPT as usize].into(),
            known_after: vec![known; KEPT as usize].into(),
            open: 0,
            first: 0,
            told: 0,
            again: None,
            late_from: None,
            now_ns: 0,
            last_heard_ns: [0; MAX_SENSORS],
            begun: false,
            left_out: 0,
        }
    }

    /// Somebody says where the platform is: what was learnt of wheels and sensors stays. Where that is no place, the next
    /// pose that is heard is.
    pub fn place(&mut self, map_from_body: Pose2, covariance: [f64; 6], is_placed: bool) {
        // What isn't finite any more was no knowledge.
        let mut known = if self.known().belief.is_finite() { *self.known() } else { self.initial };
        known.belief.place(map_from_body, covariance);
        (known.is_placed, known.doubt) = (is_placed, [0.0; 2]);
        (known.kept, known.unshown) = (Kept::default(), Unshown::default());
        for standing in &mut known.standings {
            *standing = Standing::default();
        }
        // What came before it says nothing of what comes after.
        self.known_after[(self.told % KEPT) as usize] = known;
        self.begun = false;
    }

    /// Takes in a cycle. Its step belongs to the time up to now.
    pub fn advance(&mut self, now_ns: u64, motion: &Motion) {
        let number = self.number(now_ns);
        // A clock that was set, or stood for long: what is kept has no place any more.
        if self.begun && !(self.open..self.open + KEPT / 2).contains(&number) {
            self.catch_up();
            self.begun = false;
        }
        if !self.begun {
            self.begin(number);
        }
        while self.open < number {
            self.open += 1;
            *self.at_mut(self.open) = Epoch::default();
        }
        let time_s =
            now_ns.saturating_sub(self.now_ns.max(now_ns.saturating_sub(10_000_000_000))) as f64 * 1e-9;
        let is_first = self.now_ns == 0;
        if is_first {
            self.last_heard_ns = [now_ns; MAX_SENSORS];
        }
        let period_s = self.settings.period_ns as f64 * 1e-9;
        self.now_ns = now_ns;
        let epoch = &mut self.epochs[(self.open % KEPT) as usize];
        epoch.end_ns = now_ns;
        epoch.time_s += if is_first { period_s } else { time_s };
        if motion.body_from_next.is_finite() {
            epoch.body_from_end = epoch.body_from_end.then(motion.body_from_next);
        } else {
            epoch.has_gap = true;
            epoch.unread = [UNKNOWN_M, std::f64::consts::PI];
        }
        epoch.slip_m_s = epoch.slip_m_s.max(motion.slip_m_s);
        epoch.unread = [0, 1].map(|n| epoch.unread[n] + motion.unread[n]);
        epoch.has_gap |= !motion.is_heard;
        epoch.is_free &= motion.is_free;
        self.work();
    }

    /// Takes in a reading of a sensor at its own instant; `false` where it says nothing, or comes too late.
    pub fn hear(&mut self, sensor: usize, instant_ns: u64, reading: &Reading) -> bool {
        let is_sound = self.sensors.get(sensor).is_some_and(|known| reading.is_of(known.model.kind));
        // What is measured a little after the wheels are read belongs to the epoch that is open.
        let number = self.number(instant_ns).min(self.open);
        let is_kept = self.begun && number >= self.first && number + REACH > self.open;
        if !(is_sound && is_kept && instant_ns <= self.now_ns + AHEAD_NS) {
            self.left_out += u64::from(is_sound);
            return false;
        }
        self.last_heard_ns[sensor] = self.now_ns;
        let rate = self.sensors[sensor].rate;
        if !self.at_mut(number).hear(sensor, rate, instant_ns, reading) {
            self.left_out += 1;
            return false;
        }
        let passed = self.again.unwrap_or(self.told);
        if number <= passed {
            self.late_from = Some(self.late_from.map_or(number, |from| from.min(number)));
        }
        true
    }

    /// What is known now: the belief, carried on through what it hasn't passed yet.
    pub fn estimate(&self) -> Estimate {
        let known = self.known();
        let belief = &known.belief;
        let (mut ahead, mut told, mut time_s) = (Pose2::default(), Pose2::default(), 0.0);
        for number in self.told + 1..=self.open {
            let epoch = &self.epochs[(number % KEPT) as usize];
            if epoch.time_s > 0.0 {
                ahead = ahead.moved_by(belief.corrected(epoch.step(), epoch.time_s));
                told = told.then(epoch.body_from_end);
                time_s += epoch.time_s;
            }
        }
        let map_from_body = belief.map_from_body.then(ahead);
        let mut covariance = belief.pose_covariance_at(map_from_body, told.log(), time_s);
        let unshown = known.unshown.covariance(&self.settings);
        for ((covariance, by_flaws), unshown) in covariance.iter_mut().zip(known.made_by_flaws()).zip(unshown)
        {
            *covariance += by_flaws + unshown;
        }
        let [doubt_m, doubt_rad] = known.doubts();
        covariance[0] += doubt_m * doubt_m;
        covariance[3] += doubt_m * doubt_m;
        covariance[5] += doubt_rad * doubt_rad;
        Estimate { map_from_body, covariance, is_placed: known.is_placed }
    }

    /// What a step as the wheels tell it truly is, as far as is known now.
    pub fn corrected(&self, step: BodyStep, time_s: f64) -> BodyStep {
        self.known().belief.corrected(step, time_s)
    }

    /// What is thought of a sensor now, and chi² of its last reading over its degrees of freedom.
    pub fn verdict(&self, sensor: usize) -> (Verdict, f64) {
        let (Some(known), Some(standing)) = (self.sensors.get(sensor), self.known().standings.get(sensor))
        else {
            return (Verdict::Awaited, 0.0);
        };
        let silent = self.now_ns.saturating_sub(self.last_heard_ns[sensor]) > known.model.silent_ns;
        (if silent { Verdict::Silent } else { standing.verdict }, standing.nis)
    }

    /// How much too early the instants of a sensor that tells speeds seem to be, and the standard deviation of that, s: as far as
    /// the motion of the last second shows it.
    pub fn clock_s(&self, sensor: usize) -> Option<[f64; 2]> {
        let mounted = self.sensors.get(sensor).filter(|mounted| mounted.rate.is_some());
        mounted.map(|mounted| self.known().clock_s(mounted))
    }

    /// Readings that were older than all that is kept, or more in an epoch than it holds.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Whether everything that was heard is in what is told.
    pub fn is_settled(&self) -> bool {
        self.again.is_none() && self.late_from.is_none() && self.told + 1 >= self.open
    }

    /// The belief that is told, and the instant to which it belongs, ns.
    pub fn belief(&self) -> (&Belief, u64) {
        (&self.known().belief, self.epochs[(self.told % KEPT) as usize].end_ns)
    }

    /// The epoch of an instant; never the first of all, so that there is one before it.
    fn number(&self, instant_ns: u64) -> u64 {
        instant_ns.saturating_sub(1) / self.epoch_ns + 1
    }

    fn begin(&mut self, number: u64) {
        self.epochs.fill(Epoch::default());
        (self.open, self.first) = (number, number);
        let known = *self.known();
        self.told = number - 1;
        self.known_after[(self.told % KEPT) as usize] = known;
        (self.again, self.late_from) = (None, None);
        self.begun = true;
    }

    fn at_mut(&mut self, number: u64) -> &mut Epoch {
        &mut self.epochs[(number % KEPT) as usize]
    }

    fn known(&self) -> &Knowledge {
        &self.known_after[(self.told % KEPT) as usize]
    }

    /// A share of what there is to compute.
    fn work(&mut self) {
        // The new one first: what is told keeps up.
        if self.told + 1 < self.open {
            self.told += 1;
            self.pass(self.told);
        }
        for _ in 0..PASSED_PER_CYCLE {
            self.pass_again();
        }
    }

    fn pass_again(&mut self) {
        if self.again.is_none()
            && let Some(from) = self.late_from.take()
        {
            self.again = Some(from.max(self.first) - 1);
        }
        let Some(passed) = self.again else { return };
        self.pass(passed + 1);
        self.again = Some(passed + 1).filter(|passed| *passed < self.told);
    }

    /// From what was known after the epoch before.
    fn pass(&mut self, number: u64) {
        let [before, at] = [number - 1, number].map(|number| (number % KEPT) as usize);
        let Ok([before, known]) = self.known_after.get_disjoint_mut([before, at]) else { return };
        let epoch = &self.epochs[at];
        epoch.pass(&self.settings, &self.sensors, &self.fading.of(epoch.time_s), before, known);
    }

    /// All of it at once.
    fn catch_up(&mut self) {
        while self.told + 1 < self.open || self.again.is_some() || self.late_from.is_some() {
            self.work();
        }
    }
}
