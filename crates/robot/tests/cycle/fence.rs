//! A fence that is drawn while the robot runs.

use omnibase_platform::Twist2;
use omnibase_robot::signals::{Batch, Frame, LimitedBy, RequestAnswer};
use omnibase_robot::{Phase, RequestKind};

use super::support::{BMM, Bench, plan};

const ROOM: &str = "[fence]\nrectangle_m = [-3.0, -3.0, 3.0, 3.0]\n";

fn bench(more: &str) -> Bench {
    let mut bench = Bench::new(plan(&format!("{BMM}\n{more}\n")));
    bench.enable();
    bench
}

fn square(half_m: f64) -> Vec<[f64; 2]> {
    vec![[-half_m, -half_m], [half_m, -half_m], [half_m, half_m], [-half_m, half_m]]
}

/// Draws a fence, a corner a cycle; what the last one was answered.
fn draw(bench: &mut Bench, corners_m: &[[f64; 2]]) -> RequestAnswer {
    let mut batch = Batch::new(7, corners_m.len() as u8);
    let mut answer = RequestAnswer::None;
    for corner_m in corners_m {
        let of = batch.unwrap();
        answer = bench.step(Some(RequestKind::SetFence { corner_m: *corner_m, batch: of })).answer;
        batch = of.next();
    }
    answer
}

fn ahead() -> RequestKind {
    RequestKind::Velocity { twist: Twist2::new(0.5, 0.0, 0.0), frame: Frame::Body }
}

/// Drives ahead for some seconds; how far it came, and whether the fence held it.
fn drive(bench: &mut Bench) -> (f64, bool) {
    let kind = ahead();
    let mut is_held = false;
    for _ in 0..8_000 {
        is_held |= bench.step(Some(kind)).guard.limited_by == LimitedBy::Fence;
    }
    (bench.robot.record().setpoint.odom_from_body.x_m, is_held)
}

#[test]
fn a_fence_that_is_drawn_is_kept_with_a_file_that_has_one_and_with_one_that_has_none() {
    for file in [ROOM, ""] {
        let mut bench = bench(file);
        let corners_m = square(1.0);
        assert_eq!(draw(&mut bench, &corners_m), RequestAnswer::Taken, "{file:?}");
        assert_eq!(bench.robot.fence_m(), corners_m);
        let stood = bench.robot.record().setpoint;
        assert_eq!(stood.twist_in_odom, Twist2::default(), "nothing moves by it");
        let (x_m, is_held) = drive(&mut bench);
        let footprint = plan(BMM).guard.footprint_m;
        let ahead_m = footprint.iter().map(|corner| corner[0]).fold(0.0, f64::max);
        let room_m = 1.0 - ahead_m - x_m;
        assert!(is_held && (0.05 - 1e-6..0.08).contains(&room_m), "{file:?}: {room_m} m");
    }
}

#[test]
fn no_fence_is_taken_that_leaves_the_robot_outside_or_is_none_and_the_one_before_stays() {
    let mut bench = bench(ROOM);
    let before = bench.robot.fence_m().to_vec();
    let bow = [[-2.0, -2.0], [2.0, 2.0], [2.0, -2.0], [-2.0, 2.0]];
    let beside: Vec<_> = square(1.0).into_iter().map(|[x, y]| [x + 1.4, y]).collect();
    // The footprint stands inside of this one, nearer to it than the margin.
    let near: Vec<_> = square(2.0).into_iter().map(|[x, y]| [x + 1.5, y]).collect();
    for (corners_m, expected) in [
        (bow.to_vec(), RequestAnswer::Refused),
        (vec![[-2.0, -2.0], [2.0, f64::NAN], [2.0, 2.0]], RequestAnswer::Refused),
        (vec![[-2.0, -2.0], [2.0, 1e9], [2.0, 2.0]], RequestAnswer::Refused),
        (vec![[-2.0, -2.0], [2.0, 2.0]], RequestAnswer::Refused),
        (beside, RequestAnswer::OutsideFence),
        (near, RequestAnswer::OutsideFence),
    ] {
        assert_eq!(draw(&mut bench, &corners_m), expected, "{corners_m:?}");
        assert_eq!(bench.robot.fence_m(), before);
    }
    // A corner is missing, or belongs to another one.
    let first = Batch::new(1, 3).unwrap();
    let third = first.next().unwrap().next().unwrap();
    let put = |corner_m, batch| Some(RequestKind::SetFence { corner_m, batch });
    bench.step(put([-2.0, -2.0], first));
    assert_eq!(bench.step(put([2.0, 2.0], third)).answer, RequestAnswer::Refused);
    bench.step(put([-2.0, -2.0], first));
    let other = Batch::new(2, 3).unwrap().next().unwrap();
    assert_eq!(bench.step(put([2.0, -2.0], other)).answer, RequestAnswer::Refused);
    assert_eq!(bench.step(put([2.0, 2.0], third)).answer, RequestAnswer::Refused);
    assert_eq!(bench.robot.fence_m(), before);
}

#[test]
fn no_fence_is_drawn_while_it_moves() {
    let mut bench = bench(ROOM);
    let kind = ahead();
    for _ in 0..500 {
        bench.step(Some(kind));
    }
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    assert_eq!(draw(&mut bench, &square(2.9)), RequestAnswer::WrongPhase);
    assert_eq!(bench.robot.fence_m(), square(3.0));
}
