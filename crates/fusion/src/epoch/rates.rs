//! Speeds of an epoch: the mean of what each sensor told, against what the wheels make of it.

use nalgebra::SMatrix;
use omnibase_platform::BodyStep;

use super::lags::sees;
use super::lean::{OF_SPEEDS_S, share_of};
use super::{Epoch, Fading, GATES, Knowledge, Mounted, REPEATS_SIGMAS, SHARED_S, Sum, rates};
use crate::belief::{Belief, Change, Innovation, OWN, Row, Rows, SLIP, WHEELS, chi2};
use crate::sensor::{MAX_RATES, Sensor, SensorKind};
use crate::standing::Verdict;

/// So much of its noise at most is made up for by means that change less than what they are of.
const LEFT_OF_NOISE: f64 = 0.5;

/// A gyro's bias is learnt once it is known to this share of what was said of it; before, it may be so many times as great.
const LEARNT: f64 = 0.5;
const BIAS_SIGMAS: f64 = 8.0;

/// What an epoch's speeds are compared with.
#[derive(Clone, Copy)]
pub(super) struct Rates<'a> {
    pub(super) epoch: &'a Epoch,
    pub(super) sensors: &'a [Mounted],
    pub(super) fading: &'a Fading,
    /// As the wheels tell.
    pub(super) step: BodyStep,
    /// By how much the body's twist grows in a second, as the wheels tell.
    pub(super) gain: [f64; 3],
    /// The same without what comes and goes from one epoch to the next.
    pub(super) change: [f64; 3],
    /// The body's twist lately, of the wheels alone too.
    pub(super) slow: [f64; 3],
    /// Variances by which slip changes from an epoch to the next, (m/s)² and (rad/s)².
    pub(super) slip_drive: [f64; 3],
}

/// Speeds that one sensor told in an epoch.
#[derive(Clone, Copy)]
pub(super) struct Heard<'a> {
    /// The sensor's place among those that tell speeds.
    pub(super) rate: usize,
    /// Among all.
    pub(super) sensor: usize,
    sum: &'a Sum,
}

impl Rates<'_> {
    /// Speeds. What a single sensor contradicts is its own fault; what several do, and agree in, is the wheels': they
    /// slip.
    pub(super) fn take(&self, known: &mut Knowledge) {
        for one in self.heard() {
            if self.sensors[one.sensor].model.kind.is_gyro() {
                self.begin_bias(one, known);
            }
        }
        // By how much each that is believed contradicts the wheels, in body axes.
        let mut off = [None; MAX_RATES];
        let mut numbers = 0;
        let mut is_widened = false;
        for one in self.heard() {
            let Heard { rate, sensor, sum } = one;
            // A mouse that tells no motion at all is lifted off, or everything stands.
            let is_still = self.sensors[sensor].model.kind == SensorKind::Flow && sum.values == [0.0; 3];
            if known.standings[sensor].is_believed() && !is_still {
                let (contradicts, own) = self.contradicts(one, &known.belief);
                self.watch_lag(rate, sensor, own, known);
                off[rate] = contradicts.then(|| in_body(&self.sensors[sensor].model, own));
                numbers += numbers_of(self.sensors[sensor].model.kind);
            }
        }
        let contradicting = off.iter().flatten().count();
        // A gyro alone is believed while the floor may be giving way: it can't be lifted off it. Who would see the turn as well
        // has to agree with it in this epoch, or not to agree with the wheels where that wasn't heard in it.
        let is_gyro_alone = contradicting == 1
            && self.heard().any(|one| {
                let is_off = self.sensors[one.sensor].model.kind.is_gyro() && off[one.rate].is_some();
                is_off && (known.shared_s > 0.0 || !self.is_turn_seen(known))
            });
        let may_slip = contradicting >= 2 && numbers > 3 || is_gyro_alone && known.strained_s > 0.0;
        if contradicting > 0 && may_slip {
            let mut slipping = *known;
            for (axis, by) in off.iter().flatten().flat_map(|by| by.iter().enumerate()) {
                slipping.belief.widen(SLIP + axis, by * by);
            }
            if self.all_agree(&slipping) {
                known.belief = slipping.belief;
                is_widened = true;
                if self.heard().count() > 1 {
                    known.shared_s = SHARED_S;
                }
            }
        }
        for one in self.heard() {
            match self.sensors[one.sensor].model.kind {
                SensorKind::Turn | SensorKind::Inertial => self.take_one::<1>(one, is_widened, known),
                SensorKind::Flow => self.take_one::<2>(one, is_widened, known),
                _ => self.take_one::<3>(one, is_widened, known),
            }
        }
        self.judge_lags(known);
    }

    /// One bias in a thousand is further off than the gate of a reading lets pass, and would be gated for ever: where nothing was
    /// learnt of it yet, and a second reading is off likewise, it is as uncertain as that.
    fn begin_bias(&self, one: Heard<'_>, known: &mut Knowledge) {
        let Heard { rate, sensor: place, sum } = one;
        let sensor = &self.sensors[place].model;
        let learnt = LEARNT * LEARNT * sensor.bias_sigma * sensor.bias_sigma;
        if known.belief.variance(OWN + 2 * rate) < learnt {
            return;
        }
        let (contradicts, [off, ..]) = self.contradicts(one, &known.belief);
        let before = known.standings[place].off.take();
        if !contradicts || off.abs() > BIAS_SIGMAS * sensor.bias_sigma {
            return;
        }
        let noise = sensor.sigma[0] / f64::from(sum.count).sqrt();
        if before.is_some_and(|before| (off - before[0]).abs() <= REPEATS_SIGMAS * noise) {
            known.belief.widen_to(OWN + 2 * rate, off * off);
        } else {
            known.standings[place].off = Some([off, 0.0, 0.0]);
        }
    }

    /// Whether a sensor that isn't heard in this epoch tells of turns now, and agrees.
    fn is_turn_seen(&self, known: &Knowledge) -> bool {
        let all = self.sensors.iter().zip(&known.standings).enumerate();
        all.filter(|(place, _)| self.heard().all(|one| one.sensor != *place)).any(
            |(_, (sensor, standing))| {
                (sensor.is_pose() || sees(&sensor.model)[1]) && standing.agrees_now(self.epoch.end_ns)
            },
        )
    }

    /// What was heard.
    pub(super) fn heard(&self) -> impl Iterator<Item = Heard<'_>> {
        let all = rates(self.sensors).map(|(rate, (sensor, _))| Heard {
            rate,
            sensor,
            sum: &self.epoch.rates[rate],
        });
        all.filter(|one| one.sum.count > 0)
    }

    /// Whether all that are believed can be taken in one after the other.
    fn all_agree(&self, known: &Knowledge) -> bool {
        let mut known = *known;
        let believed = known.standings.map(|standing| standing.is_believed());
        self.heard().filter(|one| believed[one.sensor]).all(|one| match self.sensors[one.sensor].model.kind {
            SensorKind::Turn | SensorKind::Inertial => self.agrees::<1>(one, &mut known),
            SensorKind::Flow => self.agrees::<2>(one, &mut known),
            _ => self.agrees::<3>(one, &mut known),
        })
    }

    /// Takes a reading in where it agrees; whether it does.
    fn agrees<const M: usize>(&self, one: Heard<'_>, known: &mut Knowledge) -> bool {
        let agreeing = self
            .compare::<M>(one, &known.belief)
            .innovation(&known.belief, &[])
            .filter(|innovation| innovation.nis <= GATES[M - 1]);
        agreeing.map(|innovation| known.belief.correct(&innovation)).is_some()
    }

    /// Whether a mean of readings is beyond its gate, and by how much it is off in the sensor's own axes.
    fn contradicts(&self, one: Heard<'_>, belief: &Belief) -> (bool, [f64; 3]) {
        match self.sensors[one.sensor].model.kind {
            SensorKind::Turn | SensorKind::Inertial => self.is_beyond::<1>(one, belief),
            SensorKind::Flow => self.is_beyond::<2>(one, belief),
            _ => self.is_beyond::<3>(one, belief),
        }
    }

    fn is_beyond<const M: usize>(&self, one: Heard<'_>, belief: &Belief) -> (bool, [f64; 3]) {
        let compared = self.compare::<M>(one, belief);
        // What is within its gate by its noise alone is all the more with what isn't known beside.
        let is_beyond = || compared.innovation(belief, &[]).is_some_and(|one| one.nis > GATES[M - 1]);
        (chi2(&compared.difference, &compared.noise) > GATES[M - 1] && is_beyond(), compared.off(one.sum))
    }

    fn take_one<const M: usize>(&self, one: Heard<'_>, is_widened: bool, known: &mut Knowledge) {
        let Heard { sensor: place, sum, .. } = one;
        let mounted = &self.sensors[place];
        let sensor = &mounted.model;
        let changes = self.changes(mounted);
        let compared = self.compare::<M>(one, &known.belief);
        let Some(innovation) = compared.innovation(&known.belief, &changes) else {
            known.standings[place].judge(self.epoch.end_ns, 1.0, Verdict::Contradicts);
            return;
        };
        let driven_m = known.driven_m();
        let standing = &mut known.standings[place];
        let bound = sensor.sigma.map(|sigma| REPEATS_SIGMAS * sigma);
        let repeats = standing.repeats(mean(sum), self.by_wheels(mounted), bound, driven_m);
        standing.nis = innovation.nis / M as f64;
        let since_s = standing.since_s(self.epoch.end_ns);
        let agrees = innovation.nis <= GATES[M - 1] && !repeats;
        // Good ones are in the upper half of the gate once in fifty times: who is there again and again is off. A gyro isn't, where
        // wheels slip.
        let beyond = 2.0 * innovation.nis / GATES[M - 1] - 1.0;
        let contradicts = match agrees {
            true if sensor.kind.is_gyro() => 0.0,
            true => beyond.clamp(0.0, 0.999),
            false => 1.0,
        };
        let fault = if repeats { Verdict::Frozen } else { Verdict::Contradicts };
        let is_taken = standing.judge(self.epoch.end_ns, contradicts, fault);
        if is_taken {
            self.lean(place, since_s, &innovation, known);
            known.take_in(&innovation, &changes, !is_widened);
        } else {
            known.leave_out(&[mounted.clock, mounted.share], &innovation);
        }
        if !is_taken && !agrees && known.standings[place].is_doubtful() {
            // Until others tell, it may be the wheels that are wrong.
            let off = size(&compared.off(sum), sensor.kind);
            known.doubt[0] += off[0] * self.epoch.time_s;
            known.doubt[1] += off[1] * self.epoch.time_s;
        }
    }

    /// By how much what a sensor tells changes with one of each flaw.
    fn changes<const M: usize>(&self, sensor: &Mounted) -> [Change<M>; 4] {
        let of = |twist| {
            let change = sensor.tells(twist);
            std::array::from_fn(|m| change[m])
        };
        let [x, y, turn] = self.change;
        [
            (WHEELS[0], of([-x, -y, 0.0])),
            (WHEELS[1], of([0.0, 0.0, -turn])),
            (sensor.clock, of(self.change)),
            (sensor.share, of(self.slow.map(|speed| -speed))),
        ]
    }

    /// Takes in what a sensor is off that is believed: where it leans, it may be the wheels that are wrong, or what it says.
    fn lean<const M: usize>(
        &self,
        place: usize,
        since_s: f64,
        innovation: &Innovation<M>,
        known: &mut Knowledge,
    ) {
        let sensor = &self.sensors[place];
        let slip = sensor.tells([0, 1, 2].map(|axis| known.belief.error(SLIP + axis)));
        let off: [f64; M] = innovation.difference();
        let off_wheels: [f64; M] = std::array::from_fn(|n| off[n] - slip[n]);
        let lean = &mut known.leans[place];
        lean.take(share_of(since_s, OF_SPEEDS_S), &off, &innovation.expected(), &off_wheels);
        if let Some(by) = lean.by() {
            let [way, turn] = size(&by, sensor.model.kind);
            known.doubt[0] += way * self.epoch.time_s;
            known.doubt[1] += turn * self.epoch.time_s;
        }
    }

    /// What a sensor would tell if wheels were as they are said to be.
    fn by_wheels(&self, sensor: &Mounted) -> [f64; 3] {
        let per_s = 1.0 / self.epoch.time_s;
        let BodyStep { x_m, y_m, angle_rad } = self.step;
        sensor.tells([x_m * per_s, y_m * per_s, angle_rad * per_s])
    }

    /// A mean of readings, and what is expected of it.
    fn compare<const M: usize>(
        &self,
        Heard { rate, sensor: place, sum }: Heard<'_>,
        belief: &Belief,
    ) -> Compared<M> {
        let mounted = &self.sensors[place];
        let sensor = &mounted.model;
        let truly = belief.corrected(self.step, self.epoch.time_s);
        let per_s = 1.0 / self.epoch.time_s;
        let count = f64::from(sum.count);
        // The step's mean is that of its middle.
        let later_s = self.epoch.later_than_middle_s(sum);
        let body: [f64; 3] = std::array::from_fn(|n| {
            [truly.x_m, truly.y_m, truly.angle_rad][n] * per_s + self.gain[n] * later_s
        });
        let u = [self.step.x_m, self.step.y_m, self.step.angle_rad].map(|way| way * per_s);
        // Derivatives are taken where the wheels alone say, never where the last readings do: what can't be told apart (the
        // scales of wheels and of a gyro) would seem to be, reading by reading (Huang, Mourikis, Roumeliotis, *Int. J. Robotics
        // Research* 29, 2010).
        let own = OWN + 2 * rate;
        let (expected, rows): ([f64; 3], [Row; 3]) = match sensor.kind {
            SensorKind::Turn | SensorKind::Inertial => {
                let scale = 1.0 + belief.error(own + 1);
                let row = Row { twist: [0.0, 0.0, 1.0], own: [1.0, u[2]], ..Row::default() };
                ([scale * body[2] + belief.error(own), 0.0, 0.0], [row, Row::default(), Row::default()])
            }
            _ => {
                let mount = sensor.body_from_sensor;
                let scale = 1.0 + belief.error(own);
                let (sin, cos) = (mount.heading_rad + belief.error(own + 1)).sin_cos();
                let at = [body[0] - body[2] * mount.y_m, body[1] + body[2] * mount.x_m];
                let x = cos * at[0] + sin * at[1];
                let y = -sin * at[0] + cos * at[1];
                let [sin, cos] = mounted.turned;
                let [vx_m_s, vy_m_s, _] = mounted.sees(u);
                let row = |twist, own| Row { twist, own, ..Row::default() };
                let rows = [
                    row([cos, sin, -cos * mount.y_m + sin * mount.x_m], [vx_m_s, vy_m_s]),
                    row([-sin, cos, sin * mount.y_m + cos * mount.x_m], [vy_m_s, -vx_m_s]),
                    row([0.0, 0.0, 1.0], [0.0; 2]),
                ];
                ([scale * x, scale * y, body[2]], rows)
            }
        };
        let rows = Rows { rows: std::array::from_fn::<_, M, _>(|m| rows[m]), by_wheels: u, own };
        let own = SMatrix::<f64, M, M>::from_fn(|r, c| {
            if r == c { sensor.sigma[r] * sensor.sigma[r] / count } else { 0.0 }
        });
        let noise = own + self.of_means(&rows.rows, later_s, &own);
        let said = mean(sum);
        let difference = std::array::from_fn(|n| said[n] - expected[n]);
        Compared { difference, rows, noise, expected }
    }
}

/// A mean of readings beside what is expected of it.
struct Compared<const M: usize> {
    difference: [f64; M],
    rows: Rows<M>,
    noise: SMatrix<f64, M, M>,
    expected: [f64; 3],
}

impl<const M: usize> Compared<M> {
    /// Against a belief.
    fn innovation(&self, belief: &Belief, changes: &[Change<M>]) -> Option<Innovation<M>> {
        belief.innovation::<M>(self.difference, &self.rows, &self.noise, changes)
    }

    /// By how much all that a sensor says is off, in its own axes.
    fn off(&self, sum: &Sum) -> [f64; 3] {
        let said = mean(sum);
        std::array::from_fn(|n| said[n] - self.expected[n])
    }
}

impl Rates<'_> {
    /// What a mean over the epoch is off otherwise than slip at one instant, as part of the noise. Means of a process that drifts
    /// by a variance q from epoch to epoch change by 2/3·q, and hang together with a sixth of it; what is read c epochs after
    /// the middle has c times the last change in it. That is as if its noise were greater by q·(c² + c − 1/3)/2.
    fn of_means<const M: usize>(
        &self,
        rows: &[Row; M],
        later_s: f64,
        own: &SMatrix<f64, M, M>,
    ) -> SMatrix<f64, M, M> {
        let c = later_s / self.epoch.time_s;
        let share = 0.5 * (c * c + c - 1.0 / 3.0);
        let of_drive = SMatrix::<f64, M, M>::from_fn(|r, c| {
            let along = |axis: usize| rows[r].twist[axis] * rows[c].twist[axis];
            (0..3).map(|axis| share * along(axis) * self.slip_drive[axis]).sum()
        });
        // Noise stays noise, however fast wheels slip.
        let least =
            |r: usize| (-LEFT_OF_NOISE * own[(r, r)] / of_drive[(r, r)].min(-f64::MIN_POSITIVE)).min(1.0);
        of_drive * (0..M).map(least).fold(1.0, f64::min)
    }
}

/// What a sensor is off in its own axes as one in body axes, m/s and rad/s.
fn in_body(sensor: &Sensor, [x, y, turn]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = sensor.body_from_sensor.heading_rad.sin_cos();
    let along = [cos * x - sin * y, sin * x + cos * y];
    match sensor.kind {
        SensorKind::Turn | SensorKind::Inertial => [0.0, 0.0, x],
        // It may be the turn at its lever arm.
        SensorKind::Flow => [along[0], along[1], x.hypot(y) / arm_m(sensor)],
        _ => [along[0], along[1], turn],
    }
}

fn mean(sum: &Sum) -> [f64; 3] {
    sum.values.map(|value| value / f64::from(sum.count))
}

pub(super) fn numbers_of(kind: SensorKind) -> usize {
    match kind {
        SensorKind::Turn | SensorKind::Inertial => 1,
        SensorKind::Flow => 2,
        SensorKind::Twist | SensorKind::Pose => 3,
    }
}

/// How far from the middle of the platform a sensor is, m; one in the middle sees no turn.
fn arm_m(sensor: &Sensor) -> f64 {
    sensor.body_from_sensor.x_m.hypot(sensor.body_from_sensor.y_m).max(0.05)
}

/// By how much a reading is off, m/s and rad/s.
fn size(off: &[f64; 3], kind: SensorKind) -> [f64; 2] {
    match kind {
        SensorKind::Turn | SensorKind::Inertial => [0.0, off[0].abs()],
        _ => [off[0].hypot(off[1]), off[2].abs()],
    }
}

#[cfg(test)]
mod tests {
    use omnibase_platform::Pose2;

    use super::*;
    use crate::belief::STATES;

    /// What a sensor is expected to say, and the standard deviation of each number, where one error alone is off and uncertain
    /// by so much, in a motion that goes each way at once.
    fn expected<const M: usize>(sensor: Sensor, place: usize, off: f64) -> [[f64; 2]; M] {
        let sensors = Mounted::all(&[Sensor { sigma: [1e-9; 3], ..sensor }]);
        let mut belief = Belief::new(Pose2::default(), &SMatrix::zeros(), 1);
        let mut change = [0.0; STATES];
        change[place] = off;
        belief.shift(&change);
        belief.widen(place, off * off);
        let epoch = Epoch { time_s: 5e-3, ..Epoch::default() };
        let step = BodyStep::new(2e-3, -1e-3, 3e-3);
        let rates = Rates {
            epoch: &epoch,
            sensors: &sensors,
            fading: &Fading::default(),
            step,
            gain: [0.0; 3],
            change: [0.0; 3],
            slow: [0.0; 3],
            slip_drive: [0.0; 3],
        };
        let sum = Sum { count: 1, ..Sum::default() };
        let compared = rates.compare::<M>(Heard { rate: 0, sensor: 0, sum: &sum }, &belief);
        let variances = compared.innovation(&belief, &[]).expect("a covariance").expected();
        std::array::from_fn(|m| [compared.expected[m], variances[m].sqrt()])
    }

    /// A mouse beside the middle sees each way, the turn, and nine errors of the wheels in them.
    #[test]
    fn each_error_counts_in_each_number_as_it_changes_it() {
        fn check<const M: usize>(kind: SensorKind) {
            let mount = Pose2::new(0.2, -0.1, 0.4);
            let sensor = Sensor { body_from_sensor: mount, ..Sensor::of(kind) };
            let off = 1e-4;
            let right = expected::<M>(sensor, OWN, 0.0);
            for place in 3..OWN + 2 {
                for (m, [told, sigma]) in expected::<M>(sensor, place, off).into_iter().enumerate() {
                    let changes = (told - right[m][0]).abs();
                    assert!(
                        (changes - sigma).abs() < 1e-3 * off,
                        "{kind:?}, {place}, {m}: {changes:e} {sigma:e}"
                    );
                }
            }
        }
        check::<1>(SensorKind::Turn);
        check::<2>(SensorKind::Flow);
        check::<3>(SensorKind::Twist);
    }
}
