//! Where nobody knows where the platform stands: what is refused, what a person can do, and who says it again.

use std::time::Duration;

use omnibase_ethercat_sim::{Fault, in_process};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Frame, Phase, RequestAnswer, StopCategory};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::simulated;

use crate::bench::{Bench, plan};

/// A circle within a fence that it keeps off; the robot stands at the origin.
const FENCED: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 8.0\n\
    [fence]\npolygon_m = [[-1.5, -1.5], [1.5, -1.5], [1.5, 1.5], [-1.5, 1.5]]\n";

/// A robot that lost its third drive on its way and holds again, enabled by a person.
fn bereft() -> (Bench, SharedMachine) {
    let (segment, machine) = simulated::segment(&plan(FENCED)).unwrap();
    let (link, clock) = in_process(segment);
    let mut bench = Bench::with(&plan(FENCED), link, clock);
    bench.enable();
    bench.cycle(Some(RequestKind::Track));
    bench.run(3000);
    bench.inject(2, Fault::PowerCycle { off_for: Duration::from_millis(300) });
    bench.run(3000);
    assert_eq!(bench.robot.phase(), Phase::Fault);
    bench.cycle(Some(RequestKind::Acknowledge));
    bench.enable();
    (bench, machine)
}

fn answer(bench: &mut Bench, kind: RequestKind) -> RequestAnswer {
    bench.cycle_for(kind, 200_000_000);
    bench.robot.record().answer
}

fn truth(machine: &SharedMachine) -> Pose2 {
    let pose = machine.truth().pose;
    Pose2 { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad }
}

fn set(odom_from_body: Pose2) -> RequestKind {
    RequestKind::SetPose { odom_from_body, sigma_m: 0.01, sigma_rad: 0.01 }
}

#[test]
fn paths_are_refused_until_somebody_sets_the_pose_and_a_stick_leads_slowly() {
    let (mut bench, machine) = bereft();
    assert!(!bench.robot.record().state.pose_known);
    let goal = RequestKind::GoTo { odom_from_body: Pose2::new(0.2, 0.0, 0.0) };
    let in_odom = RequestKind::Velocity { twist: Twist2::new(0.1, 0.0, 0.0), frame: Frame::Odom };
    for kind in [RequestKind::Track, RequestKind::Resume, goal, in_odom] {
        assert_eq!(answer(&mut bench, kind), RequestAnswer::PoseUnknown, "{kind:?}");
        assert_eq!(bench.robot.phase(), Phase::Holding, "{kind:?}");
    }
    // By hand, and slowly, also past a fence that stands nobody knows where.
    let fast = RequestKind::Velocity { twist: Twist2::new(0.9, 0.0, 1.2), frame: Frame::Body };
    let (mut fastest_m_s, mut fastest_rad_s) = (0.0_f64, 0.0_f64);
    for _ in 0..3000 {
        assert_eq!(answer(&mut bench, fast), RequestAnswer::Taken);
        assert_eq!(answer(&mut bench, set(Pose2::default())), RequestAnswer::WrongPhase, "it moves");
        let twist = machine.truth().twist_in_body;
        fastest_m_s = fastest_m_s.max(twist.vx_m_s.hypot(twist.vy_m_s));
        fastest_rad_s = fastest_rad_s.max(twist.w_rad_s.abs());
    }
    assert!(
        (0.1..0.26).contains(&fastest_m_s) && (0.1..0.26).contains(&fastest_rad_s),
        "{fastest_m_s} m/s, {fastest_rad_s} rad/s"
    );
    bench.cycle(Some(RequestKind::Stop(StopCategory::RampAndHold)));
    bench.run(1500);
    assert_eq!(answer(&mut bench, set(Pose2::new(f64::NAN, 0.0, 0.0))), RequestAnswer::Refused);
    assert!(!bench.robot.record().state.pose_known);
    // Where it stands truly; in any turn.
    let is = truth(&machine);
    assert!(is.x_m.abs().max(is.y_m.abs()) > 1.15, "the fence would have held it at 1.15 m: {is:?}");
    let told = Pose2 { heading_rad: is.heading_rad + std::f64::consts::TAU, ..is };
    assert_eq!(answer(&mut bench, set(told)), RequestAnswer::Taken);
    bench.run(100);
    let state = bench.robot.record().state;
    assert!(state.pose_known && state.odom_from_body.distance_m(is) < 1e-3, "{state:?}, {is:?}");
    assert!((state.covariance[0].sqrt() - 0.01).abs() < 1e-3, "{state:?}");
    assert_eq!(bench.robot.phase(), Phase::Holding, "nothing jumps");
    assert!(truth(&machine).distance_m(is) < 1e-3);
    assert_eq!(answer(&mut bench, goal), RequestAnswer::Taken);
}

#[test]
fn a_person_who_sets_the_pose_can_resume_the_path_that_was_left() {
    let (mut bench, machine) = bereft();
    assert_eq!(answer(&mut bench, set(truth(&machine))), RequestAnswer::Taken);
    assert_eq!(answer(&mut bench, RequestKind::Resume), RequestAnswer::Taken);
    bench.run(15_000);
    assert_eq!(bench.robot.phase(), Phase::Holding, "{:?}", bench.events);
    // The circle ends where it began.
    let is = truth(&machine);
    assert!(is.distance_m(Pose2::default()) < 5e-3 && is.heading_rad.abs() < 5e-3, "{is:?}");
}
