//! The same run gives the same bits, and a record computes to the same bits again.

use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{LimitedBy, RequestAnswer, Value};
use omnibase_robot::{CycleRecord, ImageBuffer, Phase, Registry, RequestKind, Robot};
use omnibase_trials::sensed::Case;
use omnibase_trials::{Trial, plan_of, robots};

fn bits(record: &CycleRecord) -> Vec<u64> {
    let mut values = Vec::new();
    record.values(&mut values);
    let bits = |value: &Value| match value {
        Value::F64(value) => value.to_bits(),
        Value::U64(value) => *value,
    };
    values.iter().map(bits).collect()
}

/// Every cycle of enabling and a circle, and where the body ended.
fn life(text: &str) -> (Vec<CycleRecord>, [u64; 3]) {
    let asked = |index| match index {
        20 => Some(RequestKind::Enable),
        500 => Some(RequestKind::Track),
        _ => None,
    };
    let (records, pose) = life_of(text, 12_000, &asked);
    assert_eq!(records.last().map(|record| record.phase), Some(Phase::Holding));
    (records, pose)
}

/// Every cycle of so many, and where the body ended.
fn life_of(
    text: &str,
    cycles: u64,
    asked: &dyn Fn(u64) -> Option<RequestKind>,
) -> (Vec<CycleRecord>, [u64; 3]) {
    let mut trial = Trial::new(plan_of(text));
    let records: Vec<CycleRecord> = (0..cycles).map(|index| *trial.step(asked(index))).collect();
    assert!(records.iter().any(|record| record.phase == Phase::Tracking));
    let pose = trial.pose();
    (records, [pose.x_m.to_bits(), pose.y_m.to_bits(), pose.heading_rad.to_bits()])
}

#[test]
fn same_run_same_bits_and_a_record_computes_again() {
    for (robot, law) in [
        (robots::BMM, "open_loop"),
        (robots::BMM, "closed_loop_speed"),
        (robots::BMM, "adaptive_torque"),
        (robots::MECANUM, "adaptive_torque"),
    ] {
        let text = robots::loaded(robot, law, 0.5, robots::CIRCLE);
        let ((first, pose), (second, pose_again)) = (life(&text), life(&text));
        assert!(first.iter().zip(&second).all(|(a, b)| bits(a) == bits(b)), "{law}");
        assert_eq!(pose, pose_again, "{law}");
        // It did something: the last record isn't the first one.
        assert_ne!(first[600].setpoint, first[11_000].setpoint);
        let plan = plan_of(&text);
        let mut robot = match Robot::build(&plan, &Registry::with_built_in()) {
            Ok(robot) => robot,
            Err(error) => panic!("{error}"),
        };
        let mut buffer = ImageBuffer::new(&plan);
        for record in &first {
            assert_eq!(bits(robot.replay(record, &mut buffer)), bits(record), "{law} {}", record.time.index);
        }
    }
}

/// Poses that are late, and come in any order of the sensors, are in the record with their instants.
#[test]
fn a_record_with_sensors_computes_again() {
    computes_again(&Case { set: 3, floor: 2, path: 1 }.text());
    // An imu, and visual odometry that is late.
    let imu = Case { set: 4, floor: 2, path: 1 }.text();
    computes_again(&format!("{imu}{CAMERA}"));
}

const CAMERA: &str = "
[[source]]
name = \"camera\"
input = [{ name = \"x\", unit = \"m/s\" }, { name = \"y\", unit = \"m/s\" }, { name = \"heading\", unit = \"rad/s\" }]
max_age_ms = 1000

[[sensor]]
name = \"camera\"
kind = \"twist\"
from = \"camera\"

[[simulation.sensor]]
name = \"camera\"
latency_ms = 40.0
jitter_ms = 30.0
drop_share = 0.05
seed = 4
";

fn computes_again(text: &str) {
    let asked = |index: u64| match index {
        100 => Some(RequestKind::Enable),
        500 => Some(RequestKind::Track),
        _ => None,
    };
    let ((first, pose), (second, pose_again)) = (life_of(text, 6000, &asked), life_of(text, 6000, &asked));
    assert!(first.iter().zip(&second).all(|(a, b)| bits(a) == bits(b)));
    assert_eq!(pose, pose_again);
    let last = &first[5999];
    assert_ne!(last.fusion.map_from_body, last.state.odom_from_body, "they were heard");
    let plan = plan_of(text);
    let mut robot = Robot::build(&plan, &Registry::with_built_in()).unwrap_or_else(|error| panic!("{error}"));
    let mut buffer = ImageBuffer::new(&plan);
    for record in &first {
        assert_eq!(bits(robot.replay(record, &mut buffer)), bits(record), "{}", record.time.index);
    }
}

/// Obstacles are put, dragged, refused and taken away while a circle is followed inside a fence; then the record alone
/// computes to the same bits.
#[test]
fn a_record_with_obstacles_that_were_moved_computes_again() {
    let fence = "\n[fence]\nrectangle_m = [-2.5, -2.5, 2.5, 2.5]\n\
                 [[obstacle]]\ncentre_m = [2.0, -1.5]\nradius_m = 0.1\nvelocity_m_s = [-0.02, 0.01]\n";
    let circle = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 10.0\n";
    let put = |index, x: f64, y: f64, radius_m| RequestKind::SetObstacle {
        index,
        obstacle: Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [0.01, -0.02] },
    };
    let asked = |index: u64| match index {
        20 => Some(RequestKind::Enable),
        500 => Some(RequestKind::Track),
        // On its way, dragged thirty times a second.
        2000..5000 if index.is_multiple_of(33) => Some(put(3, 0.6, 1.2 - 1e-4 * (index - 2000) as f64, 0.2)),
        5000 => Some(put(15, -1.0, 0.3, 0.15)),
        5500 => Some(put(16, 0.0, 0.0, 0.1)),
        5600 => Some(put(4, f64::NAN, 0.0, 0.1)),
        6000 => Some(RequestKind::RemoveObstacle { index: 3 }),
        _ => None,
    };
    let text = format!("{}{circle}{fence}", robots::BMM);
    let ((first, pose), (second, pose_again)) = (life_of(&text, 9000, &asked), life_of(&text, 9000, &asked));
    assert!(first.iter().zip(&second).all(|(a, b)| bits(a) == bits(b)));
    assert_eq!(pose, pose_again);
    // They were heeded, and what can't be was refused.
    assert!(first.iter().any(|record| record.guard.limited_by == LimitedBy::Obstacle));
    assert!(
        [1, 4, 16].iter().all(|number| first.iter().any(|record| record.guard.nearest_obstacle == *number))
    );
    assert_eq!(first[5500].answer, RequestAnswer::Refused);
    assert_eq!(first[5600].answer, RequestAnswer::Refused);
    let plan = plan_of(&text);
    let mut robot = Robot::build(&plan, &Registry::with_built_in()).unwrap_or_else(|error| panic!("{error}"));
    let mut buffer = ImageBuffer::new(&plan);
    for record in &first {
        assert_eq!(bits(robot.replay(record, &mut buffer)), bits(record), "{}", record.time.index);
    }
    assert_eq!(robot.obstacles()[3], None);
    assert!(robot.obstacles()[15].is_some());
}

/// What a robot does in a motion depends on the motion's own time alone.
#[test]
fn a_motion_is_driven_alike_whenever_it_begins() {
    let driven = |text: &str, begins: u64| {
        let asked = |index| match index {
            20 => Some(RequestKind::Enable),
            _ if index == begins => Some(RequestKind::Track),
            _ => None,
        };
        let (mut records, _) = life_of(text, begins + 11_000, &asked);
        records.drain(..begins as usize);
        let shown = |record: CycleRecord| (record.setpoint, record.allowed, record.state, record.grip);
        records.into_iter().map(shown).collect::<Vec<_>>()
    };
    for (robot, law) in [
        (robots::BMM, "open_loop"),
        (robots::BMM, "closed_loop_speed"),
        (robots::BMM, "adaptive_torque"),
        (robots::MECANUM, "closed_loop_speed"),
    ] {
        let text = robots::loaded(robot, law, 0.5, robots::CIRCLE);
        let (first, second) = (driven(&text, 500), driven(&text, 523));
        let differs = first.iter().zip(&second).position(|(first, second)| first != second);
        assert_eq!(differs, None, "{law}");
    }
}
