//! The same run gives the same bits, and a record computes to the same bits again.

use omnibase_robot::signals::Value;
use omnibase_robot::{CycleRecord, ImageBuffer, Phase, Registry, RequestKind, Robot};
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
    let mut trial = Trial::new(plan_of(text));
    let mut records = Vec::new();
    for index in 0..12_000 {
        let kind = match (index, trial.robot.phase()) {
            (20, _) => Some(RequestKind::Enable),
            (500, _) => Some(RequestKind::Track),
            _ => None,
        };
        records.push(*trial.step(kind));
    }
    assert!(records.iter().any(|record| record.phase == Phase::Tracking));
    assert_eq!(trial.robot.phase(), Phase::Holding);
    let pose = trial.pose();
    (records, [pose.x_m.to_bits(), pose.y_m.to_bits(), pose.heading_rad.to_bits()])
}

#[test]
fn same_run_same_bits_and_a_record_computes_again() {
    for (robot, law) in [
        (robots::BMM, "open_loop"),
        (robots::BMM, "closed_loop_speed"),
        (robots::BMM, "adaptive_torque"),
        (robots::BMM, "adaptive_model_free"),
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
