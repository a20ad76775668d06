//! A record as channels and back.

use omnibase_cia402::StatusWord;
use omnibase_platform::{Pose2, Regime, Twist2};

use super::*;
use crate::config::AxisMode;
use crate::obstacle::Obstacle;

fn full(wheels: usize) -> CycleRecord {
    let mut record = CycleRecord {
        time: CycleTime { index: 7, now_ns: 7_000_000, period_ns: 1_000_000 },
        exchange: Exchange::ShortCount { expected: 9, received: 6 },
        request: Some(Request {
            kind: RequestKind::Velocity { twist: Twist2::new(0.1, -0.2, 0.3), frame: Frame::Odom },
            valid_until_ns: 99,
        }),
        answer: RequestAnswer::WrongPhase,
        controller: 1,
        phase: Phase::QuickStopping,
        stop_reason: SafetyReason::Drive,
        stop_where: 2,
        grip: GripReport {
            dynamics: Dynamics {
                mass_kg: 70.0,
                inertia_kg_m2: 7.0,
                friction_n: [3.0, 4.0],
                mass_moment_kg_m: [1.0, 2.0],
            },
            friction: Some(0.3),
            ..GripReport::default()
        },
        force_n: 20.0,
        ..Default::default()
    };
    record.state.odom_from_body = Pose2::new(1.0, 2.0, 3.0);
    record.state.covariance = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    record.state.twist_age_s = 0.003;
    record.state.slip_residual_m_s = 0.01;
    record.state.twist_in_body = Twist2::new(0.4, 0.5, 0.6);
    record.state.regime = Regime::Tangent;
    record.setpoint.status = ReferenceStatus::Finished;
    record.wished.acceleration_in_odom = Twist2::new(0.5, 0.6, 0.7);
    record.commands.quantity = Quantity::Torque;
    record.allowed.action = SafetyAction::Stop(StopCategory::RampAndHold);
    record.measurements.wheels = wheels;
    for wheel in 0..wheels {
        let drive = &mut record.measurements.drives[wheel];
        drive.position_counts = i32::MIN + wheel as i32;
        drive.status = StatusWord(0x1237);
        drive.mode_code = -3;
        drive.progress = DriveProgress::Running;
        drive.torque_nm = -1.5;
        record.commands.values[wheel] = 0.1 * wheel as f64;
        record.inputs[wheel].0 = std::array::from_fn(|at| (at * 3 + wheel) as u8);
    }
    record
}

#[test]
fn a_record_comes_back_to_the_bit() {
    for wheels in [3, 4, MAX_WHEELS] {
        let record = full(wheels);
        let mut values = Vec::new();
        record.values(&mut values);
        assert_eq!(values.len(), CycleRecord::channels(&RecordLayout::of_wheels(wheels)).len());
        assert_eq!(CycleRecord::from_values(&RecordLayout::of_wheels(wheels), &values), Ok(record));
        assert_eq!(
            CycleRecord::from_values(&RecordLayout::of_wheels(wheels), &values[1..]),
            Err(NotARecord::Channels)
        );
    }
}

#[test]
fn channels_have_one_name_each_and_a_fixed_order() {
    let channels = CycleRecord::channels(&RecordLayout::of_wheels(3));
    let mut names: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(names[..2], ["cycle.index", "cycle.time"]);
    for name in
        ["state.pose.heading", "state.covariance_hh", "setpoint.twist.x", "wheel_3.speed", "wheel_1.input_7"]
    {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    assert!(!names.contains(&"wheel_4.speed"));
    let speed = channels.iter().find(|channel| channel.name == "wheel_2.speed").unwrap();
    assert_eq!((speed.unit.as_str(), speed.kind), ("rad/s", ValueKind::F64));
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), channels.len());
}

#[test]
fn every_request_comes_back() {
    let kinds = [
        RequestKind::Enable,
        RequestKind::Track,
        RequestKind::Stop(StopCategory::RampThenRemove),
        RequestKind::Acknowledge,
        RequestKind::Set { index: 4, value: 2.5, batch: Batch::new(9, 3).and_then(Batch::next).unwrap() },
        RequestKind::Set { index: 5, value: -2.5, batch: Batch::ALONE },
        RequestKind::Pause,
        RequestKind::Resume,
        RequestKind::GoTo { odom_from_body: Pose2 { x_m: 1.0, y_m: -2.0, heading_rad: 7.0 } },
        RequestKind::UseReference { number: 3 },
        RequestKind::SwitchController { index: 1 },
        RequestKind::Axis { device: 2, ask: AxisAsk::Home },
        RequestKind::Axis { device: 2, ask: AxisAsk::Move { position: -0.5, mode: AxisMode::Pp } },
        RequestKind::Axis { device: 0, ask: AxisAsk::Stop },
        RequestKind::Axis { device: 1, ask: AxisAsk::Run { speed: 0.25 } },
        RequestKind::SetObstacle { index: 15, obstacle: OBSTACLE },
        RequestKind::RemoveObstacle { index: 3 },
        RequestKind::SetFence { corner_m: [1.5, -2.0], batch: Batch::new(7, 4).unwrap() },
    ];
    for kind in kinds {
        let request = Some(Request::lasting(kind));
        let (codes, values) = Request::codes(request);
        assert_eq!(Request::from_codes(codes, values), Some(request));
    }
    for [number, place, size] in
        [[0.0, 0.0, 0.0], [1.0, 2.0, 2.0], [1.5, 0.0, 1.0], [65536.0, 0.0, 1.0], [f64::NAN, 0.0, 1.0]]
    {
        assert_eq!(Request::from_codes([6, 0, 1], [0.5, number, place, size, 0.0, 0.0]), None);
    }
    assert_eq!(Request::from_codes([0; 3], [0.0; 6]), Some(None));
    assert_eq!(Request::from_codes([99, 0, 0], [0.0; 6]), None);
}

const OBSTACLE: Obstacle = Obstacle { centre_m: [1.5, -2.5], radius_m: 0.25, velocity_m_s: [-0.125, 0.5] };

#[test]
fn requests_about_obstacles_are_12_and_13_and_come_back_through_a_record() {
    let set = Request { kind: RequestKind::SetObstacle { index: 15, obstacle: OBSTACLE }, valid_until_ns: 7 };
    assert_eq!(Request::codes(Some(set)), ([12, 15, 7], [1.5, -2.5, 0.25, -0.125, 0.5, 0.0]));
    let remove = Request::lasting(RequestKind::RemoveObstacle { index: 3 });
    assert_eq!(Request::codes(Some(remove)), ([13, 3, u64::MAX], [0.0; 6]));
    for request in [set, remove] {
        let mut record = CycleRecord { request: Some(request), ..full(3) };
        record.guard = GuardReport {
            fence_margin_m: Some(-0.25),
            fence_kept_m: Some(0.07),
            obstacle_distance_m: Some(0.5),
            nearest_obstacle: 16,
            limited_by: LimitedBy::Obstacle,
        };
        let mut values = Vec::new();
        record.values(&mut values);
        assert_eq!(CycleRecord::from_values(&RecordLayout::of_wheels(3), &values), Ok(record));
    }
    // A place that no number of 32 bits holds is no request.
    for sort in [12, 13] {
        assert_eq!(Request::from_codes([sort, 1 << 32, 0], [0.0; 6]), None);
    }
}

#[test]
fn a_pose_that_is_set_is_14_and_comes_back_through_a_record() {
    let odom_from_body = Pose2 { x_m: 1.5, y_m: -2.5, heading_rad: 0.5 };
    let kind = RequestKind::SetPose { odom_from_body, sigma_m: 0.02, sigma_rad: 0.03 };
    let request = Request { kind, valid_until_ns: 9 };
    assert_eq!(Request::codes(Some(request)), ([14, 0, 9], [1.5, -2.5, 0.5, 0.02, 0.03, 0.0]));
    for pose_known in [true, false] {
        let mut record =
            CycleRecord { request: Some(request), answer: RequestAnswer::PoseUnknown, ..full(3) };
        record.state.pose_known = pose_known;
        let mut values = Vec::new();
        record.values(&mut values);
        assert_eq!(CycleRecord::from_values(&RecordLayout::of_wheels(3), &values), Ok(record));
    }
    assert_eq!(RequestAnswer::PoseUnknown.code(), 6);
}

#[test]
fn a_code_that_no_choice_has_is_no_record() {
    let mut values = Vec::new();
    full(3).values(&mut values);
    for name in
        ["exchange.result", "request.kind", "phase", "stop_reason", "allowed.action", "wheel_1.progress"]
    {
        let channel = CycleRecord::channels(&RecordLayout::of_wheels(3))
            .iter()
            .position(|channel| channel.name == name)
            .unwrap();
        let mut changed = values.clone();
        changed[channel] = Value::U64(200);
        let refused = NotARecord::Code { channel, value: Value::U64(200) };
        assert_eq!(CycleRecord::from_values(&RecordLayout::of_wheels(3), &changed), Err(refused), "{name}");
    }
}
