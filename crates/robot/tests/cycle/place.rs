//! Where nobody knows the platform's place: nothing that stands in odom is followed, however it came to be unknown.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::devices::Cia402Device;
use omnibase_robot::estimators::WheelOdometry;
use omnibase_robot::signals::{
    CycleTime, DriveMeasurement, DriveProgress, Frame, PlatformState, RequestAnswer, SafetyReason,
};
use omnibase_robot::stages::{Device, DriveCommand, Estimator, Observation};
use omnibase_robot::{Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, kind, plan_with};

const KNOWS: u64 = 0;
/// It says by itself that it doesn't know the pose.
const SAYS_UNKNOWN: u64 = 1;
/// It says what is no number, until it is told where the platform stands.
const SAYS_NO_NUMBER: u64 = 2;
/// A drive's count is no number.
const NO_COUNT: u64 = 3;

type Trouble = Arc<AtomicU64>;

/// Odometry with a source of its own beside the wheels.
struct Sees(WheelOdometry, Trouble);

impl Estimator for Sees {
    fn reset(&mut self, from: &PlatformState) {
        self.1.store(KNOWS, Ordering::Relaxed);
        self.0.reset(from);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let state = self.0.update(observation);
        PlatformState { pose_known: self.1.load(Ordering::Relaxed) != SAYS_UNKNOWN, ..state }
    }

    fn sees_beyond_wheels(&self) -> bool {
        true
    }
}

/// Odometry that says what is no number where it doesn't know.
struct Doubts(WheelOdometry, Trouble);

impl Estimator for Doubts {
    fn reset(&mut self, from: &PlatformState) {
        self.1.store(KNOWS, Ordering::Relaxed);
        self.0.reset(from);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let mut state = self.0.update(observation);
        if self.1.load(Ordering::Relaxed) == SAYS_NO_NUMBER {
            state.odom_from_body.x_m = f64::NAN;
        }
        state
    }
}

/// A drive whose count may be no number.
struct Miscounts(Cia402Device, Trouble);

impl Device for Miscounts {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        let mut drive = self.0.read(time, inputs);
        if self.1.load(Ordering::Relaxed) == NO_COUNT {
            drive.increment_rad = f64::NAN;
        }
        drive
    }

    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress {
        self.0.write(time, command, outputs)
    }

    fn acknowledge(&mut self) {
        self.0.acknowledge();
    }

    fn problem(&self) -> Option<String> {
        self.0.problem()
    }
}

/// A robot that holds, with a fence around it.
fn bench(estimator: &str) -> (Bench, Trouble) {
    let trouble = Trouble::default();
    let mut registry = Registry::with_built_in();
    let mine = trouble.clone();
    registry.estimators.add(kind("sees"), move |plan| Ok(Sees(WheelOdometry::new(plan)?, mine.clone())));
    let mine = trouble.clone();
    registry.estimators.add(kind("doubts"), move |plan| Ok(Doubts(WheelOdometry::new(plan)?, mine.clone())));
    let defaults = registry.devices.defaults("sgdv").cloned().unwrap();
    let mine = trouble.clone();
    registry.devices.add(kind("miscounts"), defaults, move |plan: &_| {
        Ok(Miscounts(Cia402Device::new(plan)?, mine.clone()))
    });
    let text = BMM.replace("\"sgdv\"", "\"miscounts\"")
        + "\n[fence]\nrectangle_m = [-2.0, -2.0, 2.0, 2.0]\n[estimator]\nkind = \""
        + estimator
        + "\"\n";
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.enable();
    (bench, trouble)
}

fn go(x_m: f64) -> Option<RequestKind> {
    Some(RequestKind::GoTo { odom_from_body: Pose2::new(x_m, 0.0, 0.0) })
}

fn stick(frame: Frame) -> Option<RequestKind> {
    Some(RequestKind::Velocity { twist: Twist2::new(0.5, 0.0, 0.0), frame })
}

fn set_pose(x_m: f64) -> Option<RequestKind> {
    let odom_from_body = Pose2::new(x_m, 0.0, 0.0);
    Some(RequestKind::SetPose { odom_from_body, sigma_m: 0.02, sigma_rad: 0.02 })
}

#[test]
fn what_stands_in_odom_stops_where_the_pose_becomes_unknown_on_the_way_and_a_stick_leads_on_slowly() {
    // A way to a goal, and a stick whose wishes stand in odom.
    for repeated in [None, stick(Frame::Odom)] {
        let (mut bench, trouble) = bench("sees");
        assert_eq!(bench.step(repeated.or(go(1.5))).answer, RequestAnswer::Taken);
        for _ in 0..700 {
            bench.step(repeated);
        }
        let from = bench.pose;
        assert!(bench.twist_in_body.speed_m_s() > 0.2, "{:?}", bench.twist_in_body);
        trouble.store(SAYS_UNKNOWN, Ordering::Relaxed);
        let record = bench.step(repeated);
        let stop = (record.allowed.reason, bench.robot.phase());
        assert_eq!(stop, (SafetyReason::PoseUnknown, Phase::Stopping), "{repeated:?}");
        let record = bench.run(3000);
        // At 1.5 m/s² and some jerk: a stop, not the rest of the way.
        assert!(bench.pose.distance_m(from) < 0.4, "{from:?}: {:?}", bench.pose);
        assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::PoseUnknown));
    }
    let (mut bench, trouble) = bench("sees");
    for _ in 0..700 {
        bench.step(stick(Frame::Body));
    }
    trouble.store(SAYS_UNKNOWN, Ordering::Relaxed);
    for _ in 0..1000 {
        bench.step(stick(Frame::Body));
    }
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    assert!((bench.twist_in_body.speed_m_s() - 0.25).abs() < 1e-3, "{:?}", bench.twist_in_body);
}

#[test]
fn whoever_doesnt_know_the_pose_isnt_taken_to_stand_at_the_origin() {
    for (estimator, what) in [("doubts", SAYS_NO_NUMBER), ("wheel_odometry", NO_COUNT)] {
        let (mut bench, trouble) = bench(estimator);
        bench.step(go(1.5));
        bench.run(700);
        trouble.store(what, Ordering::Relaxed);
        assert_eq!(bench.step(None).allowed.reason, SafetyReason::NotFinite, "{estimator}");
        bench.run(3000);
        if what == NO_COUNT {
            trouble.store(KNOWS, Ordering::Relaxed);
            bench.run(3);
        }
        assert_eq!(bench.robot.phase(), Phase::Fault, "{estimator}");
        bench.step(Some(RequestKind::Acknowledge));
        bench.enable();
        let state = bench.robot.record().state;
        assert!(state.is_finite() && !state.pose_known, "{estimator}: {state:?}");
        // The covariance says at least how far it rolled meanwhile.
        let off_m = bench.pose.distance_m(state.odom_from_body);
        assert!(3.0 * state.covariance[0].sqrt() > off_m, "{estimator}: {off_m} m, {:?}", state.covariance);
        assert_eq!(bench.step(go(0.0)).answer, RequestAnswer::PoseUnknown, "{estimator}");
        // Somebody who sees it says where it stands.
        let is = bench.pose;
        assert_eq!(bench.step(set_pose(is.x_m)).answer, RequestAnswer::Taken, "{estimator}");
        assert_eq!(bench.step(go(is.x_m - 0.2)).answer, RequestAnswer::Taken, "{estimator}");
        bench.run(4000);
        assert!((bench.pose.x_m - is.x_m + 0.2).abs() < 2e-3, "{estimator}: {:?}", bench.pose);
    }
}
