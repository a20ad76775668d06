//! What was heard in a few milliseconds, and how a belief passes through it.
//!
//! Readings of speeds count as their mean over the epoch; poses at their own instants, on the arc of the epoch's step.

use nalgebra::{Matrix3, SMatrix};
use omnibase_platform::{BodyStep, Pose2, Twist2, wrap_angle_rad};

use crate::belief::{Belief, GEOMETRY, Innovation, OWN, Row, SLIP};
use crate::filter::FilterSettings;
use crate::sensor::{MAX_RATES, MAX_SENSORS, Reading, Sensor, SensorKind};
use crate::standing::{Standing, Verdict};

/// Poses of one epoch; those beyond are left out.
pub const MAX_POSES: usize = 8;
/// chi² that one reading in a thousand exceeds, with 1, 2 and 3 degrees of freedom.
const GATES: [f64; 3] = [10.83, 13.82, 16.27];
/// Wheels that slip leave a pose at most so fast, m/s and rad/s: a pose that is off by more jumped.
const SLIPS_AT_MOST: [f64; 2] = [0.5, 1.0];
/// What a sensor repeats to the bit counts where more than so many standard deviations were expected in between.
const REPEATS_SIGMAS: f64 = 4.0;
/// While nobody follows the pose, one that stays elsewhere for so long is where the platform is: it was carried, ns.
const CARRIED_NS: u64 = 1_000_000_000;

/// A sum of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    values: [f64; 3],
    count: u32,
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
    /// What it may be off beside its covariance, m and rad, because a sensor contradicts.
    pub doubt: [f64; 2],
    /// How far the wheels drove since the beginning, m and rad: the way's length and the turns'.
    pub driven: [f64; 2],
}

impl Epoch {
    /// Takes a reading of a sensor in, whose place among those that tell speeds is `rate`; whether there was room.
    pub(crate) fn hear(
        &mut self,
        (sensor, rate): (usize, usize),
        instant_ns: u64,
        reading: &Reading,
    ) -> bool {
        let values = match *reading {
            Reading::Turn(turn) => [turn, 0.0, 0.0],
            Reading::Flow([x, y]) => [x, y, 0.0],
            Reading::Twist(twist) => twist,
            Reading::Pose { map_from_sensor, covariance } => {
                return self.hear_pose(Heard { sensor, instant_ns, map_from_sensor, covariance });
            }
        };
        let Some(sum) = self.rates.get_mut(rate) else { return false };
        for (sum, value) in sum.values.iter_mut().zip(values) {
            *sum += value;
        }
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

    /// The step of the body in it, as the wheels tell.
    pub fn step(&self) -> BodyStep {
        self.body_from_end.log()
    }

    /// Carries what is known through it.
    pub(crate) fn pass(&self, settings: &FilterSettings, sensors: &[Sensor], known: &mut Knowledge) {
        if self.time_s <= 0.0 {
            return;
        }
        let step = self.step();
        let mut sigma = settings.slip_sigma(step, self.time_s);
        for sigma in &mut sigma {
            *sigma = sigma.hypot(self.slip_m_s);
        }
        let truly = known.belief.advance(step, self.time_s, sigma);
        known.driven[0] += step.distance_m();
        known.driven[1] += step.angle_rad.abs();
        let [way_m, turn_rad] = self.unread;
        known.belief.widen(0, way_m * way_m);
        known.belief.widen(1, way_m * way_m);
        known.belief.widen(2, turn_rad * turn_rad);
        for (rate, (sensor, _)) in rates(sensors) {
            let walk = sensors[sensor].bias_walk;
            known.belief.widen(OWN + 2 * rate, walk * walk * self.time_s);
        }
        if !self.has_gap {
            self.take_rates(sensors, known, step);
        }
        for heard in self.poses.iter().flatten() {
            self.take_pose(&sensors[heard.sensor], heard, known, truly);
        }
        known.belief.settle();
    }

    /// Speeds. What a single sensor contradicts is its own fault; what several do is the wheels': they slip.
    fn take_rates(&self, sensors: &[Sensor], known: &mut Knowledge, step: BodyStep) {
        // By how much each that is believed contradicts the wheels, in body axes.
        let mut off = [None; MAX_RATES];
        for (rate, (sensor, kind)) in rates(sensors) {
            let sum = &self.rates[rate];
            let standing = &known.standings[sensor];
            if sum.count > 0 && standing.is_believed() && !is_same(standing, &mean(sum)) {
                let (nis, by) = self.off(&sensors[sensor], (rate, sum), known, step);
                off[rate] = (nis > gate(kind)).then_some(by);
            }
        }
        if off.iter().flatten().count() >= 2 {
            for (axis, by) in off.iter().flatten().flat_map(|by| by.iter().enumerate()) {
                known.belief.widen(SLIP + axis, by * by);
            }
        }
        for (rate, (sensor, kind)) in rates(sensors) {
            let sum = &self.rates[rate];
            if sum.count == 0 {
                continue;
            }
            match kind {
                SensorKind::Turn => self.take_rate::<1>(&sensors[sensor], (sensor, rate, sum), known, step),
                SensorKind::Flow => self.take_rate::<2>(&sensors[sensor], (sensor, rate, sum), known, step),
                _ => self.take_rate::<3>(&sensors[sensor], (sensor, rate, sum), known, step),
            }
        }
    }

    /// chi² of a mean of readings, and by how much it is off in body axes, m/s and rad/s.
    fn off(
        &self,
        sensor: &Sensor,
        (rate, sum): (usize, &Sum),
        known: &Knowledge,
        step: BodyStep,
    ) -> (f64, [f64; 3]) {
        let nis = match sensor.kind {
            SensorKind::Turn => nis(self.compare::<1>(sensor, (rate, sum), known, step).0),
            SensorKind::Flow => nis(self.compare::<2>(sensor, (rate, sum), known, step).0),
            _ => nis(self.compare::<3>(sensor, (rate, sum), known, step).0),
        };
        let (_, expected) = self.compare::<3>(sensor, (rate, sum), known, step);
        let said = mean(sum);
        let off: [f64; 3] = std::array::from_fn(|n| said[n] - expected[n]);
        let (sin, cos) = sensor.body_from_sensor.heading_rad.sin_cos();
        match sensor.kind {
            SensorKind::Turn => (nis, [0.0, 0.0, off[0]]),
            SensorKind::Flow => (nis, [cos * off[0] - sin * off[1], sin * off[0] + cos * off[1], 0.0]),
            _ => (nis, [cos * off[0] - sin * off[1], sin * off[0] + cos * off[1], off[2]]),
        }
    }

    fn take_rate<const M: usize>(
        &self,
        sensor: &Sensor,
        (place, rate, sum): (usize, usize, &Sum),
        known: &mut Knowledge,
        step: BodyStep,
    ) {
        let (innovation, expected) = self.compare::<M>(sensor, (rate, sum), known, step);
        let Some(innovation) = innovation else { return };
        let standing = &mut known.standings[place];
        let bound = sensor.sigma.map(|sigma| REPEATS_SIGMAS * sigma);
        let repeats = standing.repeats(mean(sum), self.by_wheels(sensor, step), bound);
        standing.nis = innovation.nis / M as f64;
        let agrees = innovation.nis <= GATES[M - 1] && !repeats;
        let fault = if repeats { Verdict::Frozen } else { Verdict::Contradicts };
        if standing.judge(self.end_ns, agrees, fault) {
            known.belief.correct(&innovation);
        } else if !agrees {
            // Until others tell, it may be the wheels that are wrong.
            let off = innovation_size(&mean(sum), &expected, sensor.kind);
            known.doubt[0] += off[0] * self.time_s;
            known.doubt[1] += off[1] * self.time_s;
        }
    }

    /// What a sensor would tell if wheels were as they are said to be.
    fn by_wheels(&self, sensor: &Sensor, step: BodyStep) -> [f64; 3] {
        let per_s = 1.0 / self.time_s;
        let twist = Twist2::new(step.x_m * per_s, step.y_m * per_s, step.angle_rad * per_s);
        match sensor.kind {
            SensorKind::Turn => [twist.w_rad_s, 0.0, 0.0],
            _ => {
                let Twist2 { vx_m_s, vy_m_s, w_rad_s } = twist.at(sensor.body_from_sensor);
                [vx_m_s, vy_m_s, w_rad_s]
            }
        }
    }

    /// A mean of readings against what is believed, and what was expected.
    fn compare<const M: usize>(
        &self,
        sensor: &Sensor,
        (rate, sum): (usize, &Sum),
        known: &Knowledge,
        step: BodyStep,
    ) -> (Option<Innovation<M>>, [f64; 3]) {
        let belief = &known.belief;
        let truly = belief.corrected(step, self.time_s);
        let per_s = 1.0 / self.time_s;
        let body = [truly.x_m * per_s, truly.y_m * per_s, truly.angle_rad * per_s];
        let u = [step.x_m * per_s, step.y_m * per_s, step.angle_rad * per_s];
        // How each component of the body's twist depends on what is estimated.
        let twist_rows: [Row; 3] = std::array::from_fn(|i| {
            let at = GEOMETRY + 3 * i;
            Row::of(&[(at, u[0]), (at + 1, u[1]), (at + 2, u[2]), (SLIP + i, -1.0)])
        });
        let own = OWN + 2 * rate;
        let (expected, rows): ([f64; 3], [Row; 3]) = match sensor.kind {
            SensorKind::Turn => {
                let scale = 1.0 + belief.error(own + 1);
                let mut row = Row::of(&[(own, 1.0), (own + 1, body[2])]);
                row.add_scaled(&twist_rows[2], scale);
                ([scale * body[2] + belief.error(own), 0.0, 0.0], [row, Row::default(), Row::default()])
            }
            _ => {
                let mount = sensor.body_from_sensor;
                let scale = 1.0 + belief.error(own);
                let angle = mount.heading_rad + belief.error(own + 1);
                let (sin, cos) = angle.sin_cos();
                let at = [body[0] - body[2] * mount.y_m, body[1] + body[2] * mount.x_m];
                let x = cos * at[0] + sin * at[1];
                let y = -sin * at[0] + cos * at[1];
                let mut row_x = Row::of(&[(own, x), (own + 1, scale * y)]);
                row_x.add_scaled(&twist_rows[0], scale * cos);
                row_x.add_scaled(&twist_rows[1], scale * sin);
                let mut row_y = Row::of(&[(own, y), (own + 1, -scale * x)]);
                row_y.add_scaled(&twist_rows[0], -scale * sin);
                row_y.add_scaled(&twist_rows[1], scale * cos);
                // The lever arm's share of the turn.
                row_x.add_scaled(&twist_rows[2], scale * (-cos * mount.y_m + sin * mount.x_m));
                row_y.add_scaled(&twist_rows[2], scale * (sin * mount.y_m + cos * mount.x_m));
                ([scale * x, scale * y, body[2]], [row_x, row_y, twist_rows[2]])
            }
        };
        let said = mean(sum);
        let count = f64::from(sum.count);
        let noise = SMatrix::<f64, M, M>::from_fn(|r, c| {
            if r == c { sensor.sigma[r] * sensor.sigma[r] / count } else { 0.0 }
        });
        let difference = std::array::from_fn(|n| said[n] - expected[n]);
        let innovation = belief.innovation::<M>(difference, &std::array::from_fn(|n| rows[n]), &noise);
        (innovation, expected)
    }

    /// A pose at its own instant.
    fn take_pose(&self, sensor: &Sensor, heard: &Heard, known: &mut Knowledge, truly: BodyStep) {
        // From the epoch's end back to the instant, or on to it, along the arc.
        let late_s = (self.end_ns as f64 - heard.instant_ns as f64) * 1e-9;
        let share = late_s / self.time_s;
        let back = BodyStep::new(-share * truly.x_m, -share * truly.y_m, -share * truly.angle_rad).exp();
        let noise = noise_of(sensor, heard);
        if !known.is_placed {
            let then = heard.map_from_sensor.then(sensor.body_from_sensor.inverse());
            known.belief.place(then.then(back.inverse()), place_noise(&noise, sensor));
            known.is_placed = true;
            known.standings[heard.sensor].trust(heard.instant_ns);
            return;
        }
        let expected = known.belief.map_from_body.then(back).then(sensor.body_from_sensor);
        let compare = |belief: &Belief| {
            let body = belief.map_from_body;
            let said = heard.map_from_sensor;
            let difference = [
                said.x_m - expected.x_m,
                said.y_m - expected.y_m,
                wrap_angle_rad(said.heading_rad - expected.heading_rad),
            ];
            let rows = [
                Row::of(&[(0, 1.0), (2, body.y_m - expected.y_m)]),
                Row::of(&[(1, 1.0), (2, expected.x_m - body.x_m)]),
                Row::of(&[(2, 1.0)]),
            ];
            (belief.innovation::<3>(difference, &rows, &noise), difference)
        };
        let (innovation, off) = compare(&known.belief);
        let Some(mut innovation) = innovation else { return };
        let standing = &mut known.standings[heard.sensor];
        standing.nis = innovation.nis / 3.0;
        let said = [heard.map_from_sensor.x_m, heard.map_from_sensor.y_m, heard.map_from_sensor.heading_rad];
        let bound: [f64; 3] = std::array::from_fn(|n| REPEATS_SIGMAS * noise[(n, n)].sqrt());
        let [way_m, turn_rad] = known.driven;
        let repeats = standing.repeats(said, [way_m, 0.0, turn_rad], bound);
        let mut agrees = innovation.nis <= GATES[2] && !repeats;
        if !agrees && !repeats && standing.is_believed() {
            let since_s = standing.silent_s(heard.instant_ns);
            let size = [off[0].hypot(off[1]), off[2].abs()];
            let slips =
                |n: usize| size[n] <= SLIPS_AT_MOST[n] * since_s.min(1.0) + bound[if n == 0 { 0 } else { 2 }];
            if slips(0) && slips(1) {
                for (place, off) in off.iter().enumerate() {
                    known.belief.widen(place, off * off);
                    known.belief.widen(SLIP + place, (off / since_s.max(self.time_s)).powi(2));
                }
                if let (Some(again), _) = compare(&known.belief) {
                    (innovation, agrees) = (again, again.nis <= GATES[2]);
                }
            }
        }
        let standing = &mut known.standings[heard.sensor];
        let fault = if repeats { Verdict::Frozen } else { Verdict::Contradicts };
        if standing.judge(heard.instant_ns, agrees, fault) {
            known.belief.correct(&innovation);
            known.doubt = [0.0; 2];
            return;
        }
        if !agrees {
            let size = [off[0].hypot(off[1]), off[2].abs()];
            known.doubt = [known.doubt[0].max(size[0]), known.doubt[1].max(size[1])];
            self.look_elsewhere((sensor, heard), known, (off, bound), back);
        }
    }

    /// A platform that was carried while nobody followed its pose: it is where the sensor says all the time.
    fn look_elsewhere(
        &self,
        (sensor, heard): (&Sensor, &Heard),
        known: &mut Knowledge,
        (off, bound): ([f64; 3], [f64; 3]),
        back: Pose2,
    ) {
        let standing = &mut known.standings[heard.sensor];
        let stays = |from: &[f64; 3]| (0..3).all(|n| (off[n] - from[n]).abs() <= bound[n]);
        match standing.elsewhere {
            Some((from, since_ns)) if self.is_free && stays(&from) => {
                if heard.instant_ns.saturating_sub(since_ns) >= CARRIED_NS {
                    let then = heard.map_from_sensor.then(sensor.body_from_sensor.inverse());
                    let noise = noise_of(sensor, heard);
                    known.belief.place(then.then(back.inverse()), place_noise(&noise, sensor));
                    known.doubt = [0.0; 2];
                    known.standings[heard.sensor].trust(heard.instant_ns);
                }
            }
            _ => standing.elsewhere = self.is_free.then_some((off, heard.instant_ns)),
        }
    }
}

/// The sensors that tell speeds: the place of each among them, among all, and its kind.
pub(crate) fn rates(sensors: &[Sensor]) -> impl Iterator<Item = (usize, (usize, SensorKind))> + '_ {
    let kinds = sensors.iter().map(|sensor| sensor.kind).enumerate();
    kinds.filter(|(_, kind)| *kind != SensorKind::Pose).enumerate().take(MAX_RATES)
}

fn mean(sum: &Sum) -> [f64; 3] {
    sum.values.map(|value| value / f64::from(sum.count))
}

fn is_same(standing: &Standing, said: &[f64; 3]) -> bool {
    said.iter().zip(&standing.said).all(|(a, b)| a.to_bits() == b.to_bits())
}

fn gate(kind: SensorKind) -> f64 {
    match kind {
        SensorKind::Turn => GATES[0],
        SensorKind::Flow => GATES[1],
        SensorKind::Twist | SensorKind::Pose => GATES[2],
    }
}

fn nis<const M: usize>(innovation: Option<Innovation<M>>) -> f64 {
    innovation.map_or(0.0, |innovation| innovation.nis)
}

/// By how much a reading is off, m/s and rad/s.
fn innovation_size(said: &[f64; 3], expected: &[f64; 3], kind: SensorKind) -> [f64; 2] {
    let off: [f64; 3] = std::array::from_fn(|n| said[n] - expected[n]);
    match kind {
        SensorKind::Turn => [0.0, off[0].abs()],
        _ => [off[0].hypot(off[1]), off[2].abs()],
    }
}

fn noise_of(sensor: &Sensor, heard: &Heard) -> Matrix3<f64> {
    let [xx, xy, xh, yy, yh, hh] = heard.covariance;
    let own = Matrix3::from_diagonal(&sensor.sigma.map(|sigma| sigma * sigma).into());
    own + Matrix3::new(xx, xy, xh, xy, yy, yh, xh, yh, hh)
}

/// What the noise of a sensor makes of the place of the platform: its heading turns the lever arm.
fn place_noise(noise: &Matrix3<f64>, sensor: &Sensor) -> [f64; 6] {
    let arm_m2 = sensor.body_from_sensor.distance_m(Pose2::default()).powi(2);
    let swept = arm_m2 * noise[(2, 2)];
    [noise[(0, 0)] + swept, noise[(0, 1)], noise[(0, 2)], noise[(1, 1)] + swept, noise[(1, 2)], noise[(2, 2)]]
}
