//! Driven by hand, taught, repeated: in virtual time, frames and all.

use std::sync::{Arc, Mutex};

use crate::hands::{BMM, Hands, Played, played, played_by};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::{Frame, Phase};
use omnibase_run::RobotText;
use omnibase_run::live::{Ask, Client, NotRemembered, StickWish, TracePoint};
use omnibase_run::teach::{Sampling, joined, taught};

/// Somebody drives: ahead, in a bow with a turn, sideways.
fn driven() -> Played {
    played(10.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Joystick, Ask::Robot(RequestKind::Enable));
        let held = |vx, vy, w, frame| StickWish::Held { twist: Twist2::new(vx, vy, w), frame };
        hands.stick(1.0, 2.5, Client::Joystick, held(0.4, 0.0, 0.0, Frame::Body));
        hands.stick(2.5, 5.0, Client::Joystick, held(0.35, 0.1, 0.5, Frame::Body));
        hands.stick(5.0, 7.0, Client::Joystick, held(0.0, 0.3, -0.2, Frame::Odom));
        hands.send(7.0, Client::Joystick, Ask::Stick(StickWish::Released));
    })
}

/// The robot follows a path from its start to its end.
fn repeated(reference: &ReferenceTable) -> Played {
    let reference = Some(reference.clone().into());
    let robot = RobotText { text: BMM.into(), reference, ..RobotText::default() };
    played_by(robot, 14.0, |hands: &mut Hands| {
        hands.send(0.5, Client::Command, Ask::Robot(RequestKind::Enable));
        hands.send(1.0, Client::Command, Ask::Robot(RequestKind::Track));
        hands.at(13.9, |_, seen| assert_eq!(seen.phase, Phase::Holding));
    })
}

/// Root mean square of the distances of one trace's points from the other trace, m.
fn rms_m(trace: &[TracePoint], from: &[TracePoint]) -> f64 {
    let near_m = |point: &TracePoint| {
        let [x, y, _] = point.believed;
        let gap = |pair: &[TracePoint]| {
            let ([ax, ay, _], [bx, by, _]) = (pair[0].believed, pair[1].believed);
            let (dx, dy) = (bx - ax, by - ay);
            let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy).max(1e-18);
            let along = along.clamp(0.0, 1.0);
            (x - ax - along * dx).hypot(y - ay - along * dy)
        };
        from.windows(2).map(gap).fold(f64::INFINITY, f64::min)
    };
    (trace.iter().map(|point| near_m(point).powi(2)).sum::<f64>() / trace.len() as f64).sqrt()
}

#[test]
fn a_path_driven_by_hand_repeats_within_two_millimetres_and_its_repeats_are_the_same_bits() {
    let driven = driven();
    let trace = driven.live.trace_since(0.0);
    let limits = crate::hands::plan().limits;
    for sampling in
        [Sampling::Period { period_s: 0.05 }, Sampling::Change { distance_m: 0.02, angle_rad: 0.035 }]
    {
        let path = taught(&trace, sampling, 0.001, &limits).unwrap();
        let first = repeated(&path.reference);
        let repeat = first.live.trace_since(0.0);
        let off_m = rms_m(&repeat, &trace).max(rms_m(&trace, &repeat));
        println!(
            "{sampling:?}: {} points of {}, repeats within {:.3} mm RMS",
            path.reference.points.as_ref().unwrap().len(),
            path.remembered,
            1e3 * off_m,
        );
        assert!(off_m < 0.002, "{sampling:?}: {off_m} m");
        let (x, y) = (trace.last().unwrap().believed, repeat.last().unwrap().believed);
        assert!((x[0] - y[0]).hypot(x[1] - y[1]) < 0.002 && (x[2] - y[2]).abs() < 0.004, "{x:?} {y:?}");
        let second = repeated(&path.reference);
        let (first, second) = (first.recorded.raw, second.recorded.raw);
        assert!(first.len() > 10_000 && first == second, "{sampling:?}");
        // Taught from its own repeat, the path stays the path.
        let again = taught(&repeat, sampling, 0.001, &limits).unwrap();
        let third = repeated(&again.reference);
        assert!(rms_m(&third.live.trace_since(0.0), &trace) < 0.002, "{sampling:?}");
    }
}

#[test]
fn single_points_become_a_path_that_stands_at_each_of_them() {
    let taught = Arc::new(Mutex::new(Vec::new()));
    let kept = taught.clone();
    let driven = played(9.0, move |hands: &mut Hands| {
        hands.at(0.2, |live, _| assert_eq!(live.remember_point(), Err(NotRemembered::NotBegun)));
        hands.at(0.3, |live, _| live.begin_points());
        hands.send(0.5, Client::Joystick, Ask::Robot(RequestKind::Enable));
        let held = |vx, vy, w| StickWish::Held { twist: Twist2::new(vx, vy, w), frame: Frame::Body };
        hands.at(0.9, |live, _| assert_eq!(live.remember_point(), Ok(1)));
        hands.stick(1.0, 2.5, Client::Joystick, held(0.4, 0.0, 0.0));
        hands.stick(2.5, 3.5, Client::Joystick, StickWish::Released);
        hands.at(3.5, |live, _| assert_eq!(live.remember_point(), Ok(2)));
        hands.at(3.6, |live, _| assert_eq!(live.remember_point(), Err(NotRemembered::SamePlace)));
        hands.stick(3.7, 6.0, Client::Joystick, held(0.0, 0.3, 0.5));
        hands.stick(6.0, 8.0, Client::Joystick, StickWish::Released);
        hands.at(8.0, move |live, _| {
            assert_eq!(live.remember_point(), Ok(3));
            *kept.lock().unwrap() = live.points().unwrap();
            assert!(!live.end_points(2) && live.end_points(3));
            assert_eq!(live.points(), None);
        });
    });
    let poses = taught.lock().unwrap().clone();
    let limits = crate::hands::plan().limits;
    let path = joined(&poses, &limits).unwrap();
    let points = path.reference.points.clone().unwrap();
    assert_eq!((points.len(), path.remembered), (3, 3));
    // As fast as the limits allow, from rest to rest: a quintic's greatest speed is 15/8 of its mean.
    let way_m = (poses[1].x_m - poses[0].x_m).hypot(poses[1].y_m - poses[0].y_m);
    assert!(points[1][0] < 15.0 / 8.0 * way_m / (0.5 * limits.speed_m_s), "{points:?}");
    let repeat = repeated(&path.reference);
    let trace = repeat.live.trace_since(0.0);
    for pose in &poses {
        let away_m = |point: &TracePoint| {
            let [x_m, y_m, heading_rad] = point.believed;
            (x_m - pose.x_m).hypot(y_m - pose.y_m) + 0.5 * (heading_rad - pose.heading_rad).abs()
        };
        let stands = trace.windows(4).filter(|four| four.iter().all(|point| away_m(point) < 0.002)).count();
        assert!(stands > 0, "{pose:?}");
    }
    assert!(driven.replayed.difference.is_none());
    // One pose is no path.
    assert!(joined(&poses[..1], &limits).is_err());
}
