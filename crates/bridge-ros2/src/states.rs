//! What the robot does, told to ROS 2: `odom`, the transform, `joint_states`, `/clock`.

use anyhow::Context as _;
use omnibase_client::{Found, Row, States, Wanted};
use ros2_client::Publisher;
use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::arguments::Arguments;
use crate::clock::Clock;
use crate::messages::*;
use crate::node::{Ros, telling, telling_at};

/// The longest silence between two looks.
const LOOK: Duration = Duration::from_millis(100);
/// `/clock` is told so often, ns.
const CLOCK_NS: u64 = 10_000_000;
/// Variance of what isn't known at all: nobody weighs it.
const UNKNOWN: f64 = 1e6;
/// The least variance of what is known: m², rad².
const LEAST: f64 = 1e-9;
/// Standard deviation of the platform's speed by its wheels while none slips, m/s and rad/s.
const SPEED_SIGMA: f64 = 0.01;

/// What was told, and what not.
#[derive(Default)]
pub struct Counts {
    /// Messages of `odom`.
    pub odom: AtomicU64,
    /// Messages that DDS didn't take.
    pub unsent: AtomicU64,
    /// Cycles that never came here.
    pub missing: AtomicU64,
}

/// When something is told next.
struct Due {
    every_ns: u64,
    next_ns: u64,
}

impl Due {
    fn new(every_ns: u64) -> Self {
        Due { every_ns, next_ns: 0 }
    }

    /// Whether it is time: the first instant at or behind each multiple.
    fn take(&mut self, instant_ns: u64) -> bool {
        let is_due = instant_ns >= self.next_ns;
        if is_due {
            self.next_ns = (instant_ns / self.every_ns.max(1) + 1) * self.every_ns.max(1);
        }
        is_due
    }
}

/// A rate as the time from one to the next; every cycle, or never, is 0 Hz.
fn every_ns(hz: f64) -> anyhow::Result<u64> {
    anyhow::ensure!((0.0..=10_000.0).contains(&hz), "expected a rate of 0 to 10000 Hz, found {hz}");
    Ok(if hz == 0.0 { 0 } else { (1e9 / hz).round() as u64 })
}

/// Where the values of a row stand.
struct Places {
    pose: [usize; 3],
    twist: [usize; 3],
    /// xx, xy, xh, yy, yh, hh.
    covariance: [usize; 6],
    slip: usize,
    pose_known: usize,
    /// Where sensors told that the platform is, and whether they did; for robots with sensors.
    map: Option<([usize; 3], usize)>,
    /// Of each wheel: increment, speed, torque.
    wheels: Vec<[usize; 3]>,
}

impl Places {
    fn find(names: &[String], wheels: &[String], with_map: bool) -> anyhow::Result<Places> {
        let place = |name: &str| {
            names.iter().position(|known| known == name).with_context(|| format!("the robot has no `{name}`"))
        };
        let places = |prefix: &str, names: &[&str]| -> anyhow::Result<Vec<usize>> {
            names.iter().map(|name| place(&format!("{prefix}{name}"))).collect()
        };
        let three = |prefix: &str, names: [&str; 3]| -> anyhow::Result<[usize; 3]> {
            places(prefix, &names)?.try_into().ok().context("three places")
        };
        let of_wheel =
            |name: &String| three(&format!("{name}."), ["increment_rad", "speed_rad_s", "torque_nm"]);
        let covariance = ["xx_m2", "xy_m2", "xh_m_rad", "yy_m2", "yh_m_rad", "hh_rad2"];
        let map = || anyhow::Ok((three("map.pose_", ["x_m", "y_m", "heading_rad"])?, place("map.placed")?));
        let words = "--map-frame: expected a robot with a [[sensor]] and the estimator `fused`";
        Ok(Places {
            map: with_map.then(|| map().context(words)).transpose()?,
            pose: three("state.pose_", ["x_m", "y_m", "heading_rad"])?,
            twist: three("state.twist_in_body_", ["x_m_s", "y_m_s", "heading_rad_s"])?,
            covariance: places("state.covariance_", &covariance)?.try_into().ok().context("six places")?,
            slip: place("state.slip_residual_m_s")?,
            pose_known: place("state.pose_known")?,
            wheels: wheels.iter().map(of_wheel).collect::<anyhow::Result<_>>()?,
        })
    }
}

/// Follows the robot cycle by cycle.
pub struct Teller {
    states: States,
    places: Places,
    clock: Clock,
    counts: Arc<Counts>,
    odom_frame: String,
    map_frame: Option<String>,
    base_frame: String,
    odom: (Due, Publisher<Odometry>),
    transform: Option<(Due, Publisher<Transforms>)>,
    joints: Option<(Due, Publisher<JointState>)>,
    clocks: Option<(Due, Publisher<crate::messages::Clock>)>,
    wheels: Vec<String>,
    angles_rad: Vec<f64>,
}

impl Teller {
    /// Begins to follow a robot whose wheels have these names.
    pub fn new(
        ros: &mut Ros,
        robot: &Found,
        wheels: Vec<String>,
        arguments: &Arguments,
        clock: Clock,
    ) -> anyhow::Result<Teller> {
        let signals = ["increment_rad", "speed_rad_s", "torque_nm"];
        let of_wheels = wheels.iter().flat_map(|wheel| signals.map(|signal| format!("{wheel}.{signal}")));
        let map_frame = arguments.map_frame();
        let of_map = map_frame.iter().map(|_| "map.*".to_owned());
        let signals = std::iter::once("state.*".to_owned()).chain(of_map).chain(of_wheels).collect();
        let states = States::follow(robot, &Wanted { signals, every_ms: None })?;
        let places = Places::find(states.names(), &wheels, map_frame.is_some())?;
        let every_cycle = 1000.0 / states.cycle_ms();
        let odom_hz = if arguments.odom_hz == 0.0 { every_cycle } else { arguments.odom_hz };
        let odom = ros.publisher("odom", telling_at(odom_hz))?;
        let (tf_ns, joint_ns) = (every_ns(arguments.tf_hz)?, every_ns(arguments.joint_hz)?);
        let transform = (tf_ns > 0).then(|| ros.publisher(&arguments.tf_topic, telling())).transpose()?;
        let joints = (joint_ns > 0).then(|| ros.publisher("joint_states", telling())).transpose()?;
        let clocks = arguments.sim_time.then(|| ros.publisher("/clock", telling())).transpose()?;
        Ok(Teller {
            states,
            places,
            clock,
            counts: Arc::default(),
            odom_frame: arguments.odom_frame(),
            map_frame,
            base_frame: arguments.base_frame(),
            odom: (Due::new(every_ns(arguments.odom_hz)?), odom),
            transform: transform.map(|publisher| (Due::new(tf_ns), publisher)),
            joints: joints.map(|publisher| (Due::new(joint_ns), publisher)),
            clocks: clocks.map(|publisher| (Due::new(CLOCK_NS), publisher)),
            angles_rad: vec![0.0; wheels.len()],
            wheels: wheels.iter().map(|name| format!("{}{name}_joint", arguments.frame_prefix)).collect(),
        })
    }

    /// What is counted, for others.
    pub fn counts(&self) -> Arc<Counts> {
        Arc::clone(&self.counts)
    }

    /// Tells all that comes, until the robot is gone.
    pub fn tell(mut self) -> anyhow::Error {
        loop {
            match self.states.rows(LOOK) {
                Ok(rows) => rows.iter().for_each(|row| self.take(row)),
                Err(error) => return error.into(),
            }
            self.counts.missing.store(self.states.missing(), Ordering::Relaxed);
        }
    }

    fn take(&mut self, row: &Row) {
        for (angle_rad, [increment, ..]) in self.angles_rad.iter_mut().zip(&self.places.wheels) {
            // A cycle without news of a wheel has no number.
            let increment_rad = row.values[*increment];
            *angle_rad += if increment_rad.is_finite() { increment_rad } else { 0.0 };
        }
        let Some(stamp_ns) = self.clock.stamp_ns(row.instant_ns) else { return };
        let stamp = Time::of_ns(stamp_ns);
        let header = |frame: &str| Header { stamp: stamp.clone(), frame_id: frame.to_owned() };
        let mut unsent = 0;
        if let Some((due, publisher)) = &mut self.clocks
            && due.take(row.instant_ns)
        {
            unsent += u64::from(publisher.publish(crate::messages::Clock { clock: stamp.clone() }).is_err());
        }
        let pose = Pose {
            position: Point {
                x: row.values[self.places.pose[0]],
                y: row.values[self.places.pose[1]],
                z: 0.0,
            },
            orientation: Quaternion::heading(row.values[self.places.pose[2]]),
        };
        let is_told =
            [pose.position.x, pose.position.y, pose.orientation.z].iter().all(|number| number.is_finite());
        if is_told && self.odom.0.take(row.instant_ns) {
            let odometry = Odometry {
                header: header(&self.odom_frame),
                child_frame_id: self.base_frame.clone(),
                pose: PoseWithCovariance { pose: pose.clone(), covariance: self.places.pose_covariance(row) },
                twist: self.places.twist(row),
            };
            self.counts.odom.fetch_add(1, Ordering::Relaxed);
            unsent += u64::from(self.odom.1.publish(odometry).is_err());
        }
        if let Some((due, publisher)) = &mut self.transform
            && is_told
            && due.take(row.instant_ns)
        {
            let transform = |parent: &str, child: &str, [x, y, turn]: [f64; 3]| TransformStamped {
                header: header(parent),
                child_frame_id: child.to_owned(),
                transform: Transform {
                    translation: Vector3 { x, y, z: 0.0 },
                    rotation: Quaternion::heading(turn),
                },
            };
            let odom_from_base = self.places.pose.map(|place| row.values[place]);
            let mut transforms = vec![transform(&self.odom_frame, &self.base_frame, odom_from_base)];
            if let (Some(frame), Some(map_from_base)) = (&self.map_frame, self.places.in_map(row)) {
                let map_from_odom = from_odom(map_from_base, odom_from_base);
                transforms.push(transform(frame, &self.odom_frame, map_from_odom));
            }
            unsent += u64::from(publisher.publish(Transforms { transforms }).is_err());
        }
        if let Some((due, publisher)) = &mut self.joints
            && due.take(row.instant_ns)
        {
            let column = |n: usize| self.places.wheels.iter().map(|wheel| row.values[wheel[n]]).collect();
            let joints = JointState {
                header: header(""),
                name: self.wheels.clone(),
                position: self.angles_rad.clone(),
                velocity: column(1),
                effort: column(2),
            };
            unsent += u64::from(publisher.publish(joints).is_err());
        }
        self.counts.unsent.fetch_add(unsent, Ordering::Relaxed);
    }
}

/// Where odom is in a frame in which the platform's pose is known, too: x, y in m, turn in rad.
fn from_odom([x, y, turn]: [f64; 3], [odom_x, odom_y, odom_turn]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = (turn - odom_turn).sin_cos();
    [x - cos * odom_x + sin * odom_y, y - sin * odom_x - cos * odom_y, turn - odom_turn]
}

impl Places {
    /// Where sensors told that the platform is; `None` before they did.
    fn in_map(&self, row: &Row) -> Option<[f64; 3]> {
        let (pose, placed) = self.map?;
        let pose = pose.map(|place| row.values[place]);
        (row.values[placed] == 1.0 && pose.iter().all(|number| number.is_finite())).then_some(pose)
    }

    /// Of x, y, z, and the turns about them, in the fixed frame.
    fn pose_covariance(&self, row: &Row) -> Numbers<36> {
        let [xx, xy, xh, yy, yh, hh] = self.covariance.map(|place| row.values[place]);
        let is_known = row.values[self.pose_known] == 1.0;
        let all = [xx, xy, xh, yy, yh, hh];
        if !is_known || all.iter().any(|number| !number.is_finite()) {
            return diagonal([UNKNOWN; 6]);
        }
        let of = |variance: f64| variance.max(LEAST);
        let mut covariance = diagonal([of(xx), of(yy), UNKNOWN, UNKNOWN, UNKNOWN, of(hh).min(PI * PI)]);
        for (row, column, value) in [(0, 1, xy), (0, 5, xh), (1, 5, yh)] {
            covariance.0[6 * row + column] = value;
            covariance.0[6 * column + row] = value;
        }
        covariance
    }

    fn twist(&self, row: &Row) -> TwistWithCovariance {
        let [x, y, turn] = self.twist.map(|place| row.values[place]);
        let slip = row.values[self.slip];
        let variance = SPEED_SIGMA * SPEED_SIGMA + if slip.is_finite() { slip * slip } else { UNKNOWN };
        TwistWithCovariance {
            twist: Twist { linear: Vector3 { x, y, z: 0.0 }, angular: Vector3 { x: 0.0, y: 0.0, z: turn } },
            covariance: diagonal([variance, variance, UNKNOWN, UNKNOWN, UNKNOWN, variance]),
        }
    }
}

fn diagonal(variances: [f64; 6]) -> Numbers<36> {
    let mut covariance = Numbers::default();
    for (at, variance) in variances.into_iter().enumerate() {
        covariance.0[7 * at] = variance;
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odom_in_map_leads_from_the_pose_in_odom_to_that_in_map() {
        let (map, odom) = ([1.0, 2.0, 1.3], [0.4, -0.2, 0.3]);
        let [x, y, turn] = from_odom(map, odom);
        let (sin, cos) = turn.sin_cos();
        let back = [x + cos * odom[0] - sin * odom[1], y + sin * odom[0] + cos * odom[1], turn + odom[2]];
        for (back, map) in back.iter().zip(map) {
            assert!((back - map).abs() < 1e-12, "{back} {map}");
        }
        assert_eq!(from_odom(odom, odom), [0.0; 3]);
    }
}
