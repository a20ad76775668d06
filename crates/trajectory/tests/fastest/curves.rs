//! Ways along curves with control points.

use super::*;
use omnibase_trajectory::{CurveHeading, Nurbs, curve};

const CORNER_RAD: f64 = 0.5;

fn poses(controls: &[[f64; 3]], degree: usize, heading: CurveHeading) -> Vec<Pose2> {
    curve::poses(&[Nurbs::new(controls, degree, None, None).unwrap()], heading, CORNER_RAD)
}

#[test]
fn a_curve_that_turns_on_the_spot_keeps_its_headings() {
    let to_and_fro = [[1.0, 2.0, 0.0], [1.0, 2.0, 2.0], [1.0, 2.0, 0.5]];
    let found = poses(&to_and_fro, 2, CurveHeading::Given);
    assert_eq!((found[0], found[found.len() - 1]), (Pose2::new(1.0, 2.0, 0.0), Pose2::new(1.0, 2.0, 0.5)));
    // It turns back at 4/7 of its parameter, at 8/7 rad.
    let most_rad = found.iter().map(|pose| pose.heading_rad).fold(0.0, f64::max);
    assert!((most_rad - 8.0 / 7.0).abs() < 1e-6, "{most_rad} rad");
    assert!(found.len() < 40, "{} poses", found.len());
    let way = PiecewisePath::through(&found, JOINING).unwrap();
    let bounds = PlatformBounds::new(LIMITS);
    let motion = FastestTrajectory::new(way, &bounds).unwrap();
    assert!(loads(&motion, &bounds) < 1.003, "{}", loads(&motion, &bounds));
    let end = motion.sample(motion.duration_s()).odom_from_base;
    assert!((end.heading_rad - 0.5).abs() < 1e-9, "{end:?}");
    // By less than a corner does, before it drives.
    let found = poses(&[[0.0; 3], [0.0, 0.0, 0.4], [1.0, 0.0, 0.4]], 1, CurveHeading::Given);
    let is_turned = |pose: &Pose2| (pose.heading_rad - 0.4).abs() < 1e-9;
    let begun = found.iter().position(|pose| pose.x_m > 0.0).unwrap();
    assert!(found[0] == Pose2::default() && found[begun - 1..].iter().all(is_turned), "{found:?}");
    // A tangent stays where there is none.
    assert_eq!(poses(&to_and_fro, 2, CurveHeading::Tangent).len(), 1);
}
