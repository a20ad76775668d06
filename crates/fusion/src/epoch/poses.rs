//! Poses of an epoch, each at its own instant.

use nalgebra::Matrix3;
use omnibase_platform::{BodyStep, Pose2, wrap_angle_rad};

use super::kept::symmetric;
use super::lean::{OF_POSES_S, share_of};
use super::{ARM_M, Epoch, GATES, Heard, Kept, Knowledge, Mounted, REPEATS_SIGMAS, Unshown};
use crate::belief::{Belief, OWN, Row, Rows, SLIP};
use crate::sensor::Sensor;
use crate::standing::Verdict;

/// Wheels that slip leave a pose at most so fast, m/s and rad/s: a pose that is off by more jumped.
const SLIPS_AT_MOST: [f64; 2] = [0.5, 1.0];
/// Of the way that they drove unseen, wheels slip at most this share.
const SLIPS_OF_WAY: f64 = 0.2;
/// While nobody follows the pose, one that stays elsewhere for so long is where the platform is: it was carried, ns.
const CARRIED_NS: u64 = 1_000_000_000;

impl Knowledge {
    /// Whether another sensor of poses agreed since one was heard that would see it: what that is off is no slip, nor was the platform carried.
    fn is_refuted(&self, sensors: &[Mounted], one: usize, off: &[f64; 3]) -> bool {
        let poses = sensors.iter().zip(&self.standings).enumerate();
        let mut others = poses.filter(|(place, (sensor, _))| *place != one && sensor.is_pose());
        others.any(|(_, (_, other))| other.refutes(&self.standings[one], off))
    }
}

impl Epoch {
    /// A pose at its own instant.
    pub(super) fn take_pose(
        &self,
        sensors: &[Mounted],
        heard: &Heard,
        known: &mut Knowledge,
        truly: BodyStep,
    ) {
        let mounted = &sensors[heard.sensor];
        let sensor = &mounted.model;
        // From the epoch's end back to the instant, or on to it, along the arc.
        let late_s = (self.end_ns as f64 - heard.instant_ns as f64) * 1e-9;
        let share = late_s / self.time_s;
        let back = BodyStep::new(-share * truly.x_m, -share * truly.y_m, -share * truly.angle_rad).exp();
        let noise = noise_of(sensor, heard);
        if !known.is_placed {
            let then = heard.map_from_sensor.then(sensor.body_from_sensor.inverse());
            known.belief.place(then.then(back.inverse()), place_noise(&noise, sensor));
            (known.is_placed, known.kept) = (true, Kept::default());
            known.standings[heard.sensor].trust(heard.instant_ns);
            return;
        }
        let expected = known.belief.map_from_body.then(back).then(sensor.body_from_sensor);
        let changes = [(mounted.clock, speed_of(sensor, known))];
        let body = known.belief.map_from_body;
        let by_pose =
            [[1.0, 0.0, body.y_m - expected.y_m], [0.0, 1.0, expected.x_m - body.x_m], [0.0, 0.0, 1.0]];
        let compare = |belief: &Belief| {
            let said = heard.map_from_sensor;
            let difference = [
                said.x_m - expected.x_m,
                said.y_m - expected.y_m,
                wrap_angle_rad(said.heading_rad - expected.heading_rad),
            ];
            let rows = by_pose.map(|pose| Row { pose, ..Row::default() });
            let rows = Rows { rows, by_wheels: [0.0; 3], own: OWN };
            (belief.innovation::<3>(difference, &rows, &noise, &changes), difference)
        };
        let (innovation, off) = compare(&known.belief);
        let Some(mut innovation) = innovation else {
            // Its covariance is none.
            known.standings[heard.sensor].judge(heard.instant_ns, 1.0, Verdict::Contradicts);
            return;
        };
        let driven_m = known.driven_m();
        let is_refuted = known.is_refuted(sensors, heard.sensor, &off);
        let standing = &mut known.standings[heard.sensor];
        standing.nis = innovation.nis / 3.0;
        let said = [heard.map_from_sensor.x_m, heard.map_from_sensor.y_m, heard.map_from_sensor.heading_rad];
        let bound: [f64; 3] = std::array::from_fn(|n| REPEATS_SIGMAS * noise[(n, n)].sqrt());
        let [way_m, turn_rad] = known.driven;
        standing.sees = bound;
        standing.comes(heard.instant_ns, sensor.silent_ns, driven_m);
        let repeats = standing.repeats(said, [way_m, 0.0, turn_rad], bound, driven_m);
        let mut agrees = innovation.nis <= GATES[2] && !repeats;
        if !agrees
            && !repeats
            && !is_refuted
            && standing.is_believed()
            && self.widen_for_slip(heard, &off, &bound, known)
            && let (Some(again), _) = compare(&known.belief)
        {
            (innovation, agrees) = (again, again.nis <= GATES[2]);
        }
        let since_s = known.standings[heard.sensor].since_s(heard.instant_ns);
        let standing = &mut known.standings[heard.sensor];
        let fault = if repeats { Verdict::Frozen } else { Verdict::Contradicts };
        if standing.judge(heard.instant_ns, f64::from(u8::from(!agrees)), fault) {
            let lean = &mut known.leans[heard.sensor];
            lean.take(
                share_of(since_s, OF_POSES_S),
                &innovation.difference(),
                &innovation.expected(),
                &innovation.difference(),
            );
            let leans = lean.by().map_or([0.0; 2], |[x, y, turn]| [x.hypot(y), turn.abs()]);
            known.standings[heard.sensor].doubted = leans;
            known.doubt = [0.0; 2];
            known.unshown = Unshown::default();
            known.kept.becomes(&innovation.left_of_pose(&by_pose));
            known.take_in(&innovation, &changes, true);
            known.kept.is_counted(&symmetric(known.belief.pose_covariance()));
            return;
        }
        known.leave_out(&[mounted.clock], &innovation);
        if !agrees {
            known.standings[heard.sensor].off = Some(off);
            let size = [off[0].hypot(off[1]), off[2].abs()];
            let standing = &mut known.standings[heard.sensor];
            if standing.is_doubtful() {
                standing.doubted = [standing.doubted[0].max(size[0]), standing.doubted[1].max(size[1])];
            }
            // What says the same whatever the platform does stays anywhere, and tells of no place.
            if is_refuted || repeats {
                standing.elsewhere = None;
            } else {
                self.look_elsewhere(sensor, heard, known, off, bound, back);
            }
        }
    }

    /// A pose that is off alone is an outlier; a second one that is off likewise tells of slip: since the one before, or before
    /// that began to contradict, while nobody saw it. Whether it does; then wheels are known that much less.
    fn widen_for_slip(&self, heard: &Heard, off: &[f64; 3], bound: &[f64; 3], known: &mut Knowledge) -> bool {
        let standing = &known.standings[heard.sensor];
        let since_s = standing.silent_s(heard.instant_ns).min(1.0);
        let may_slip = |off: &[f64; 3], time_s: f64, unheard_m: f64| {
            let slip_m = SLIPS_OF_WAY * unheard_m;
            off[0].hypot(off[1]) <= SLIPS_AT_MOST[0] * time_s + slip_m + bound[0]
                && off[2].abs() <= SLIPS_AT_MOST[1] * time_s + slip_m / ARM_M + bound[2]
        };
        let goes_on = standing
            .off
            .is_some_and(|before| may_slip(&std::array::from_fn(|n| off[n] - before[n]), since_s, 0.0));
        if !goes_on || !may_slip(off, 2.0 * since_s, standing.unheard_m) {
            return false;
        }
        for (place, off) in off.iter().enumerate() {
            known.belief.widen(place, off * off);
        }
        // In body axes, which lie anywhere in map's.
        let way_m = off[0].hypot(off[1]);
        for (axis, way) in [way_m, way_m, off[2].abs()].into_iter().enumerate() {
            let slips = (way / since_s.max(self.time_s)).min(SLIPS_AT_MOST[axis / 2]);
            known.belief.widen(SLIP + axis, slips * slips);
        }
        true
    }

    /// A platform that was carried while nobody followed its pose: it is where the sensor says all the time.
    fn look_elsewhere(
        &self,
        sensor: &Sensor,
        heard: &Heard,
        known: &mut Knowledge,
        off: [f64; 3],
        bound: [f64; 3],
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
                    (known.doubt, known.kept, known.unshown) = Default::default();
                    known.standings.iter_mut().for_each(|standing| standing.doubted = [0.0; 2]);
                    known.standings[heard.sensor].trust(heard.instant_ns);
                }
            }
            _ => standing.elsewhere = self.is_free.then_some((off, heard.instant_ns)),
        }
    }
}

/// How fast a sensor moves in map, as wheels tell.
fn speed_of(sensor: &Sensor, known: &Knowledge) -> [f64; 3] {
    let ([x, y, turn], mount) = (known.twist, sensor.body_from_sensor);
    let (x, y) = (x - turn * mount.y_m, y + turn * mount.x_m);
    let (sin, cos) = known.belief.map_from_body.heading_rad.sin_cos();
    [cos * x - sin * y, sin * x + cos * y, turn]
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
