//! What every cycle promises: no allocation, the same bits again, and numbers that aren't finite stop.

use omnibase_fusion::Verdict;
use omnibase_host::CountingAllocator;
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Heard, MAX_SOURCE_VALUES, RecordLayout, Value};
use omnibase_robot::{CycleRecord, ImageBuffer, Phase, Registry, RequestKind, Robot};

use crate::support::{BMM, Bench, MECANUM, plan};

/// A gyro and poses.
const FUSED: &str = "
[estimator]
kind = \"fused\"

[[source]]
name = \"imu\"
input = [{ name = \"turn\", unit = \"rad/s\" }]

[[source]]
name = \"tracker\"
carries = \"pose\"
max_age_ms = 1000

[[sensor]]
name = \"gyro\"
kind = \"gyro\"
from = \"imu.turn\"

[[sensor]]
name = \"mocap\"
kind = \"pose\"
from = \"tracker\"
";

/// The other kinds: an imu, visual odometry, a mouse.
const OTHERS: &str = "
[estimator]
kind = \"fused\"

[[source]]
name = \"imu\"
input = [{ name = \"turn\" }, { name = \"acceleration_x\" }, { name = \"acceleration_y\" }]

[[source]]
name = \"camera\"
input = [{ name = \"x\" }, { name = \"y\" }, { name = \"heading\" }]
max_age_ms = 1000

[[source]]
name = \"mouse\"
input = [{ name = \"x\" }, { name = \"y\" }]

[[sensor]]
name = \"imu\"
kind = \"imu\"
from = \"imu\"

[[sensor]]
name = \"camera\"
kind = \"twist\"
from = \"camera\"

[[sensor]]
name = \"mouse\"
kind = \"flow\"
from = \"mouse\"
";

/// A life: enabled, moved about, tracked, stopped.
fn life(bench: &mut Bench) -> Vec<CycleRecord> {
    let mut records = vec![bench.step(None), bench.step(Some(RequestKind::Enable))];
    for cycle in 0..3000_u32 {
        let request = match cycle {
            100..=1500 => {
                let swing = f64::from(cycle) * 0.01;
                let twist = Twist2::new(0.4 * swing.sin(), 0.3 * swing.cos(), 0.5 * (0.3 * swing).sin());
                Some(RequestKind::Velocity { twist, frame: Frame::Body })
            }
            1600 => {
                Some(RequestKind::Set { index: 3, value: 5.0, batch: omnibase_robot::signals::Batch::ALONE })
            }
            2500 => Some(RequestKind::Stop(omnibase_robot::signals::StopCategory::RampThenRemove)),
            _ => None,
        };
        records.push(bench.step(request));
    }
    assert!(records.iter().any(|record| record.phase == Phase::Tracking));
    assert_eq!(bench.robot.phase(), Phase::Disabled);
    records
}

fn bits(record: &CycleRecord) -> Vec<u64> {
    let mut values = Vec::new();
    record.values(&mut values);
    let bits = |value: &Value| match value {
        Value::F64(value) => value.to_bits(),
        Value::U64(value) => *value,
    };
    values.iter().map(bits).collect()
}

#[test]
fn a_cycle_never_allocates() {
    let adaptive = adaptive(BMM);
    let [fused, others] = [FUSED, OTHERS].map(|sensors| format!("{BMM}{sensors}"));
    for robot in [BMM, MECANUM, &adaptive, &fused, &others] {
        let mut bench = Bench::new(plan(robot));
        bench.enable();
        let before = CountingAllocator::allocations_of_this_thread();
        for cycle in 0..2000_u32 {
            let twist = Twist2::new(0.3, 0.2, 0.1);
            let kind = (cycle < 1000).then_some(RequestKind::Velocity { twist, frame: Frame::Body });
            let instant_ns = bench.index * bench.plan.bus.cycle_ns;
            bench.robot.hear(0, &Heard { instant_ns, values: [1e-4; MAX_SOURCE_VALUES] });
            if cycle % 10 == 0 {
                // Each is late, and what followed is computed again.
                let instant_ns = instant_ns.saturating_sub(30_000_000);
                bench.robot.hear(1, &Heard { instant_ns, values: [0.0; MAX_SOURCE_VALUES] });
            }
            bench.robot.hear(2, &Heard { instant_ns, values: [1e-5 * f64::from(cycle); MAX_SOURCE_VALUES] });
            bench.step(kind);
            if cycle == 1500 {
                bench.fail_drive(0);
            }
        }
        assert_eq!(CountingAllocator::allocations_of_this_thread() - before, 0);
        let heard = bench.robot.record().fusion.sensors.map(|sensor| sensor.verdict);
        let expected = robot.matches("[[sensor]]").count();
        let is_heard = |verdict: &&Verdict| !matches!(verdict, Verdict::Awaited | Verdict::Silent);
        assert_eq!(heard.iter().filter(is_heard).count(), expected);
    }
}

#[test]
fn the_allocator_does_count() {
    let before = CountingAllocator::allocations_of_this_thread();
    let list = std::hint::black_box(vec![1_u8]);
    assert_eq!(CountingAllocator::allocations_of_this_thread() - before, list.len() as u64);
}

/// The robot with the adaptive controller, and a square of its own to follow.
pub fn adaptive(text: &str) -> String {
    text.replace("kind = \"closed_loop_speed\"", "kind = \"adaptive_torque\"")
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    for robot in [BMM.to_string(), adaptive(BMM)] {
        let first = life(&mut Bench::new(plan(&robot)));
        let second = life(&mut Bench::new(plan(&robot)));
        assert!(first.iter().zip(&second).all(|(a, b)| bits(a) == bits(b)));
    }
}

#[test]
fn a_recording_replays_to_the_same_bits() {
    for robot in [BMM.to_string(), adaptive(BMM), MECANUM.to_string()] {
        let plan = plan(&robot);
        let wheels = plan.drives.len();
        let recorded = life(&mut Bench::new(plan.clone()));
        let mut robot = Robot::build(&plan, &Registry::with_built_in()).unwrap();
        let mut buffer = ImageBuffer::new(&plan);
        for record in &recorded {
            // Through channels, as a file holds them.
            let mut values = Vec::new();
            record.values(&mut values);
            let read = CycleRecord::from_values(&RecordLayout::of_wheels(wheels), &values).unwrap();
            let replayed = robot.replay(&read, &mut buffer);
            assert_eq!(bits(replayed), bits(record), "cycle {}", record.time.index);
        }
    }
}
