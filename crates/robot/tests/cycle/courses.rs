//! Taking over, giving back, pausing, going to a pose, another reference: without a jump, within the limits.

use super::support::{BMM, Bench, plan};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{PathFrame, ReferenceTable, Timing};
use omnibase_robot::signals::{Batch, Course, CycleRecord, Frame, RequestAnswer, StopCategory};
use omnibase_robot::{Ability, Phase, Registry, RequestKind};

const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 10.0\n\n[safety]\n";
const PERIOD_S: f64 = 0.001;

/// Steps of the setpoint from cycle to cycle stay within the platform's limits.
struct Smooth {
    before: Option<CycleRecord>,
}

impl Smooth {
    fn new() -> Self {
        Smooth { before: None }
    }

    fn look(&mut self, bench: &Bench, record: &CycleRecord) {
        let limits = &bench.plan.limits;
        if let Some(before) = self.before {
            let (a, b) = (before.setpoint, record.setpoint);
            let step_m = a.odom_from_body.distance_m(b.odom_from_body);
            assert!(step_m <= limits.speed_m_s * PERIOD_S * (1.0 + 1e-6), "a step of {step_m} m");
            let (from, to) = (a.twist_in_odom, b.twist_in_odom);
            let change = Twist2::new(to.vx_m_s - from.vx_m_s, to.vy_m_s - from.vy_m_s, 0.0).speed_m_s();
            let most = limits.acceleration_m_s2 * PERIOD_S * (1.0 + 1e-6);
            assert!(change <= most, "a change of speed of {change} m/s");
        }
        self.before = Some(*record);
    }

    fn step(&mut self, bench: &mut Bench, kind: Option<RequestKind>) -> CycleRecord {
        let record = bench.step(kind);
        self.look(bench, &record);
        record
    }

    fn until(&mut self, bench: &mut Bench, phase: Phase, most_cycles: u32) {
        for _ in 0..most_cycles {
            if bench.robot.phase() == phase {
                return;
            }
            self.step(bench, None);
        }
        panic!("not {phase:?} after {most_cycles} cycles, but {:?}", bench.robot.phase());
    }
}

fn circling() -> (Bench, Smooth) {
    let mut bench = Bench::new(plan(&(BMM.to_owned() + CIRCLE)));
    bench.enable();
    let mut smooth = Smooth::new();
    assert_eq!(smooth.step(&mut bench, Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    for _ in 0..3000 {
        smooth.step(&mut bench, None);
    }
    (bench, smooth)
}

fn velocity(vx_m_s: f64) -> Option<RequestKind> {
    Some(RequestKind::Velocity { twist: Twist2::new(vx_m_s, 0.0, 0.0), frame: Frame::Odom })
}

/// Distance from the circle of the reference, which begins at the origin and is centred left of it.
fn off_circle_m(record: &CycleRecord, centre: [f64; 2]) -> f64 {
    let pose = record.setpoint.odom_from_body;
    ((pose.x_m - centre[0]).hypot(pose.y_m - centre[1]) - 0.5).abs()
}

#[test]
fn a_person_takes_over_and_gives_back_without_a_jump() {
    let (mut bench, mut smooth) = circling();
    let left_at_s = bench.robot.record().reference_time_s;
    for _ in 0..1500 {
        let record = smooth.step(&mut bench, velocity(0.3));
        assert_eq!((record.answer, record.course), (RequestAnswer::Taken, Course::Velocity));
    }
    assert_eq!(bench.robot.record().reference_time_s, left_at_s, "the reference waits");
    smooth.step(&mut bench, Some(RequestKind::Stop(StopCategory::RampAndHold)));
    smooth.until(&mut bench, Phase::Holding, 3000);
    assert_eq!(bench.robot.record().reference_begun, 1);
    let record = smooth.step(&mut bench, Some(RequestKind::Resume));
    assert_eq!((record.answer, record.course), (RequestAnswer::Taken, Course::Way));
    smooth.until(&mut bench, Phase::Holding, 20_000);
    let record = *bench.robot.record();
    assert_eq!((record.reference_begun, record.reference_time_s > 9.99), (0, true));
    assert!(record.setpoint.odom_from_body.distance_m(Pose2::default()) < 1e-5, "the circle is closed");
}

#[test]
fn a_pause_stands_on_the_path_and_goes_on_from_there() {
    let (mut bench, mut smooth) = circling();
    let centre = {
        let pose = bench.robot.record().setpoint.odom_from_body;
        // The centre is half a metre to one side of the start.
        let candidates = [[0.0, 0.5], [0.0, -0.5], [0.5, 0.0], [-0.5, 0.0]];
        let off = |centre: &[f64; 2]| ((pose.x_m - centre[0]).hypot(pose.y_m - centre[1]) - 0.5).abs();
        candidates.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
    };
    assert_eq!(smooth.step(&mut bench, Some(RequestKind::Pause)).answer, RequestAnswer::Taken);
    let mut furthest_m = 0.0_f64;
    while bench.robot.phase() == Phase::Tracking {
        furthest_m = furthest_m.max(off_circle_m(&smooth.step(&mut bench, None), centre));
        assert!(bench.index < 20_000);
    }
    assert_eq!(bench.robot.phase(), Phase::Holding);
    assert_eq!(bench.robot.record().reference_rate, 0.0);
    assert_eq!(smooth.step(&mut bench, Some(RequestKind::Resume)).answer, RequestAnswer::Taken);
    while bench.robot.phase() == Phase::Tracking {
        furthest_m = furthest_m.max(off_circle_m(&smooth.step(&mut bench, None), centre));
        assert!(bench.index < 40_000);
    }
    assert!(furthest_m < 1e-4, "{furthest_m} m off the circle");
    assert_eq!(bench.robot.record().reference_begun, 0);
}

#[test]
fn a_slower_robot_keeps_to_its_path() {
    let (mut bench, mut smooth) = circling();
    let record =
        smooth.step(&mut bench, Some(RequestKind::Set { index: 0, value: 0.25, batch: Batch::ALONE }));
    assert_eq!(record.answer, RequestAnswer::Taken);
    for _ in 0..2000 {
        smooth.step(&mut bench, None);
    }
    assert!((bench.robot.record().reference_rate - 0.25).abs() < 1e-9);
    smooth.until(&mut bench, Phase::Holding, 40_000);
    assert!(bench.robot.record().reference_time_s > 9.99);
}

#[test]
fn a_robot_goes_the_straight_way_to_a_pose() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let mut smooth = Smooth::new();
    let there = Pose2 { x_m: 0.7, y_m: -0.4, heading_rad: 2.0 };
    smooth.step(&mut bench, Some(RequestKind::GoTo { odom_from_body: there }));
    let mut off_line_m = 0.0_f64;
    while bench.robot.phase() == Phase::Tracking {
        let pose = smooth.step(&mut bench, None).setpoint.odom_from_body;
        off_line_m = off_line_m.max((pose.x_m * -0.4 - pose.y_m * 0.7).abs() / 0.7_f64.hypot(0.4));
        assert!(bench.index < 10_000);
    }
    let pose = bench.robot.record().setpoint.odom_from_body;
    assert!(pose.distance_m(there) < 1e-6 && (pose.heading_rad - 2.0).abs() < 1e-6, "{pose:?}");
    assert!(off_line_m < 1e-6, "{off_line_m} m off the line");
    for wrong in [f64::NAN, f64::INFINITY] {
        let nowhere = RequestKind::GoTo { odom_from_body: Pose2 { x_m: wrong, ..there } };
        assert_eq!(bench.step(Some(nowhere)).answer, RequestAnswer::Refused);
    }
    // To where it stands: at once.
    smooth.step(&mut bench, Some(RequestKind::GoTo { odom_from_body: pose }));
    smooth.until(&mut bench, Phase::Holding, 10);
}

#[test]
fn a_motion_begins_where_another_one_came_to_rest_whatever_speed_is_set() {
    for factor in [1.0, 0.25, 0.05] {
        let mut bench = Bench::new(plan(&(BMM.to_owned() + CIRCLE)));
        bench.enable();
        let mut smooth = Smooth::new();
        let there = Pose2 { x_m: 0.7, y_m: -0.4, heading_rad: 2.0 };
        smooth.step(&mut bench, Some(RequestKind::GoTo { odom_from_body: there }));
        smooth.until(&mut bench, Phase::Holding, 10_000);
        let set = RequestKind::Set { index: 0, value: factor, batch: Batch::ALONE };
        assert_eq!(smooth.step(&mut bench, Some(set)).answer, RequestAnswer::Taken);
        for _ in 0..300 {
            smooth.step(&mut bench, None);
        }
        let record = smooth.step(&mut bench, Some(RequestKind::Track));
        assert_eq!((record.answer, record.course), (RequestAnswer::Taken, Course::Reference), "{factor}");
        for _ in 0..200 {
            smooth.step(&mut bench, None);
        }
    }
}

#[test]
fn another_motion_is_joined_however_slowly_the_robot_is_set_to_go() {
    for factor in [1.0, 0.3, 0.05] {
        let mut bench = Bench::new(plan(&(BMM.to_owned() + CIRCLE)));
        bench.enable();
        let mut smooth = Smooth::new();
        let set = RequestKind::Set { index: 0, value: factor, batch: Batch::ALONE };
        assert_eq!(smooth.step(&mut bench, Some(set)).answer, RequestAnswer::Taken);
        assert_eq!(smooth.step(&mut bench, Some(RequestKind::Track)).answer, RequestAnswer::Taken);
        for _ in 0..2000 {
            smooth.step(&mut bench, None);
        }
        let table = bench.plan.reference.clone();
        let reference = Registry::with_built_in().make_reference(&table, &Ability::of(&bench.plan)).unwrap();
        bench.robot.offer_reference(7, reference);
        for kind in [RequestKind::UseReference { number: 7 }, RequestKind::Track] {
            assert_eq!(
                smooth.step(&mut bench, Some(kind)).answer,
                RequestAnswer::Taken,
                "{factor}: {kind:?}"
            );
        }
        smooth.until(&mut bench, Phase::Holding, (20_000.0 / factor) as u32);
    }
}

#[test]
fn the_way_to_a_pose_keeps_to_what_is_set() {
    for (settings, most_m_s) in [([1.0, 0.1], 0.1), ([0.2, 0.3], 0.2)] {
        let mut bench = Bench::new(plan(BMM));
        bench.enable();
        let mut smooth = Smooth::new();
        for (index, value) in settings.into_iter().enumerate() {
            let kind = RequestKind::Set { index: index as u32, value, batch: Batch::ALONE };
            assert_eq!(smooth.step(&mut bench, Some(kind)).answer, RequestAnswer::Taken);
        }
        let there = Pose2 { x_m: 1.0, y_m: 0.0, heading_rad: 0.0 };
        smooth.step(&mut bench, Some(RequestKind::GoTo { odom_from_body: there }));
        let mut fastest_m_s = 0.0_f64;
        while bench.robot.phase() == Phase::Tracking {
            let record = smooth.step(&mut bench, None);
            fastest_m_s = fastest_m_s.max(record.setpoint.twist_in_odom.speed_m_s());
            assert!(bench.index < 40_000);
            // Faster on the way: the rate rises within the limits, and no further.
            if settings[0] < 1.0 && bench.index == 3000 {
                let faster = RequestKind::Set { index: 0, value: 0.25, batch: Batch::ALONE };
                smooth.step(&mut bench, Some(faster));
            }
        }
        let most_m_s = if settings[0] < 1.0 { 0.25 } else { most_m_s };
        assert!((0.8 * most_m_s..=most_m_s * 1.001).contains(&fastest_m_s), "{fastest_m_s} of {most_m_s}");
        assert!(bench.robot.record().setpoint.odom_from_body.distance_m(there) < 1e-6);
    }
}

#[test]
fn what_cannot_begin_is_refused() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    for kind in [RequestKind::Resume, RequestKind::UseReference { number: 1 }] {
        assert_eq!(bench.step(Some(kind)).answer, RequestAnswer::Refused, "{kind:?}");
    }
    assert_eq!(bench.step(Some(RequestKind::Pause)).answer, RequestAnswer::WrongPhase);
    assert_eq!(bench.robot.phase(), Phase::Holding);
    bench.step(velocity(0.2));
    assert_eq!(bench.step(Some(RequestKind::Resume)).answer, RequestAnswer::Refused);
    bench.step(Some(RequestKind::Stop(StopCategory::RampAndHold)));
    for kind in
        [RequestKind::Resume, RequestKind::GoTo { odom_from_body: Pose2::default() }, RequestKind::Track]
    {
        assert_eq!(bench.step(Some(kind)).answer, RequestAnswer::WrongPhase, "{kind:?}");
    }
}

#[test]
fn another_reference_is_taken_at_rest_and_begins_only_near_its_start() {
    let mut bench = Bench::new(plan(BMM));
    let table = ReferenceTable {
        kind: Some("path".into()),
        points: Some(vec![[0.0, 1.0, 0.0, 6.5], [4.0, 1.5, 0.0, 6.5]]),
        frame: Some(PathFrame::Odom),
        ..Default::default()
    };
    let reference = Registry::with_built_in().make_reference(&table, &Ability::of(&bench.plan)).unwrap();
    assert!(bench.robot.offer_reference(7, reference).is_none());
    bench.enable();
    let mut smooth = Smooth::new();
    let mut ask = |bench: &mut Bench, kind| smooth.step(bench, Some(kind)).answer;
    assert_eq!(ask(&mut bench, RequestKind::UseReference { number: 8 }), RequestAnswer::Refused);
    assert_eq!(ask(&mut bench, RequestKind::UseReference { number: 7 }), RequestAnswer::Taken);
    assert_eq!(
        ask(&mut bench, RequestKind::UseReference { number: 7 }),
        RequestAnswer::Refused,
        "it is taken"
    );
    assert_eq!(ask(&mut bench, RequestKind::Track), RequestAnswer::TooFar);
    // A turn more or less is the same heading.
    let start = Pose2 { x_m: 1.03, y_m: 0.0, heading_rad: 6.5 - std::f64::consts::TAU };
    ask(&mut bench, RequestKind::GoTo { odom_from_body: start });
    smooth.until(&mut bench, Phase::Holding, 10_000);
    assert_eq!(smooth.step(&mut bench, Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    smooth.until(&mut bench, Phase::Holding, 10_000);
    let pose = bench.robot.record().setpoint.odom_from_body;
    assert!((pose.x_m - 1.5).abs() < 1e-6 && (pose.heading_rad - 0.2168).abs() < 1e-4, "{pose:?}");
    let table = ReferenceTable::default();
    let reference = Registry::with_built_in().make_reference(&table, &Ability::of(&bench.plan)).unwrap();
    assert_eq!(bench.robot.offer_reference(9, reference).map(|(number, _)| number), Some(u32::MAX));
}

#[test]
fn an_obstacle_moves_on_through_cycles_that_are_left_out() {
    let obstacle = "\n[[obstacle]]\ncentre_m = [5.0, 0.0]\nradius_m = 0.2\nvelocity_m_s = [-0.5, 0.0]\n";
    let mut bench = Bench::new(plan(&format!("{BMM}{obstacle}")));
    let first = bench.index;
    for left_out in [0, 7, 300, 0] {
        bench.index += left_out;
        bench.step(None);
    }
    let expected_m = 5.0 - 0.5e-3 * (bench.index - 1 - first) as f64;
    let [x_m, _] = bench.robot.obstacles()[0].unwrap().centre_m;
    assert!((x_m - expected_m).abs() < 1e-12, "{x_m}, not {expected_m}");
}

#[test]
fn a_robot_that_nobody_leads_stays_where_an_obstacle_comes_near_it() {
    let obstacle = "\n[[obstacle]]\ncentre_m = [2.0, 0.0]\nradius_m = 0.2\nvelocity_m_s = [-0.5, 0.0]\n";
    let mut bench = Bench::new(plan(&format!("{BMM}{obstacle}")));
    bench.enable();
    let begin = bench.pose;
    for _ in 0..6000 {
        let record = bench.step(None);
        assert_eq!((record.phase, bench.pose), (Phase::Holding, begin));
    }
    assert!(bench.robot.record().guard.obstacle_distance_m.unwrap() < 1.0, "it came by");
}

#[test]
fn timing_says_how_fast_points_are_gone_along() {
    let limits = plan(BMM).limits;
    // An eight in 80 points, too fast for the default's rule and its limits.
    let point = |at: u32| {
        let phi = f64::from(at) / 80.0 * std::f64::consts::TAU;
        [f64::from(at) * 0.1, 0.8 * phi.sin(), 0.4 * (2.0 * phi).sin(), 0.0]
    };
    let table = |timing| ReferenceTable {
        kind: Some("path".into()),
        points: Some((0..=80).map(point).collect()),
        timing,
        ..Default::default()
    };
    let make =
        |table: &ReferenceTable| Registry::with_built_in().make_reference(table, &Ability::from(&limits));
    let duration_s = |timing| make(&table(Some(timing))).unwrap().duration_s().unwrap();
    assert!(make(&table(None)).is_err() && make(&table(Some(Timing::AsGiven))).is_err());
    assert!(duration_s(Timing::Stretched) > 8.0);
    assert!(duration_s(Timing::Fastest) < 8.0);
    let refusal = |table: ReferenceTable| make(&table).err().unwrap().to_string();
    let fastest = Some(Timing::Fastest);
    assert!(refusal(ReferenceTable { frame: Some(PathFrame::Platform), ..table(fastest) }).contains("frame"));
    let circle = ReferenceTable {
        kind: Some("circle".into()),
        radius_m: Some(0.5),
        duration_s: Some(9.0),
        timing: fastest,
        ..Default::default()
    };
    assert!(refusal(circle).contains("duration_s"));
}

#[test]
fn a_way_to_a_pose_is_as_fast_as_the_limits_and_planned_in_the_cycle_without_allocating() {
    let mut bench = Bench::new(plan(BMM));
    bench.enable();
    let before = omnibase_host::CountingAllocator::allocations_of_this_thread();
    bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(3.0, 4.0, 0.5) }));
    let mut cycles = 0;
    while bench.robot.phase() == Phase::Tracking {
        bench.step(None);
        cycles += 1;
    }
    assert_eq!(omnibase_host::CountingAllocator::allocations_of_this_thread() - before, 0);
    // v/a + a/j and 5 m at full speed, a twentieth slower; a quintic took 9.8 s.
    let best_s = 1.05 * (1.0 / 1.5 + 1.5 / 40.0 + 5.0);
    assert!((1e-3 * f64::from(cycles) - best_s).abs() < 0.05, "{cycles} cycles, {best_s} s");
}
