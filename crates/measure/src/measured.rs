//! What a person measured on the floor after a run, against what the robot wished and believed.

use std::fmt;
use std::str::FromStr;

use omnibase_platform::{Pose2, wrap_angle_rad};
use serde::Serialize;

/// Where the platform stood on the floor after a run, in odom: `x y heading`, in m, m and rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPose(pub Pose2);

/// A measured pose beside the ends of the run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// x m, y m, heading rad, in odom.
    pub pose: [f64; 3],
    /// From where it was wished to end; `None` where nothing was followed.
    pub from_wished: Option<Off>,
    /// From where it believed to stand.
    pub from_believed: Off,
}

/// From one pose to the measured one, in odom.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Off {
    /// Along x, m.
    pub x_m: f64,
    /// Along y, m.
    pub y_m: f64,
    /// How far, m.
    pub distance_m: f64,
    /// Counter-clockwise, within half a turn, rad.
    pub heading_rad: f64,
}

impl Measured {
    /// A pose that was measured after a run that should have ended at `wished` and believes in `believed`.
    pub fn after(pose: FloorPose, wished: Option<Pose2>, believed: Pose2) -> Measured {
        let FloorPose(there) = pose;
        let off = |from: Pose2| Off {
            x_m: there.x_m - from.x_m,
            y_m: there.y_m - from.y_m,
            distance_m: from.distance_m(there),
            heading_rad: wrap_angle_rad(there.heading_rad - from.heading_rad),
        };
        Measured {
            pose: [there.x_m, there.y_m, there.heading_rad],
            from_wished: wished.map(off),
            from_believed: off(believed),
        }
    }
}

impl FromStr for FloorPose {
    type Err = String;

    fn from_str(text: &str) -> Result<FloorPose, String> {
        let words: Vec<&str> = text.split([' ', ',', ';', '\t']).filter(|word| !word.is_empty()).collect();
        let expected = || format!("expected `x y heading` in m, m and rad (or 90deg), found `{text}`");
        let &[x, y, heading] = words.as_slice() else { return Err(expected()) };
        let number = |word: &str| word.parse().ok().filter(|value: &f64| value.is_finite());
        let heading = match heading.strip_suffix("deg").or_else(|| heading.strip_suffix('°')) {
            Some(degrees) => number(degrees).map(f64::to_radians),
            None => number(heading),
        };
        match (number(x), number(y), heading) {
            (Some(x_m), Some(y_m), Some(heading_rad)) => Ok(FloorPose(Pose2::new(x_m, y_m, heading_rad))),
            _ => Err(expected()),
        }
    }
}

impl fmt::Display for FloorPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FloorPose(Pose2 { x_m, y_m, heading_rad }) = self;
        write!(f, "{x_m} {y_m} {heading_rad}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_pose_is_read_as_a_person_writes_it_and_mistakes_are_told() {
        let read = |text: &str| text.parse::<FloorPose>().map(|FloorPose(pose)| pose);
        assert_eq!(read("0.012 -0.003 0.5"), Ok(Pose2::new(0.012, -0.003, 0.5)));
        assert_eq!(read("1, 2, 180deg"), Ok(Pose2::new(1.0, 2.0, PI)));
        assert_eq!(read("1;2;-90°"), Ok(Pose2::new(1.0, 2.0, -PI / 2.0)));
        for wrong in ["", "1 2", "1 2 3 4", "1 2 x", "1 nan 3", "inf 0 0", "1 2 deg"] {
            assert!(read(wrong).unwrap_err().contains(&format!("found `{wrong}`")), "{wrong}");
        }
        let pose = FloorPose(Pose2::new(0.1, -2.0, 3.25));
        assert_eq!(pose.to_string().parse(), Ok(pose));
    }

    #[test]
    fn it_is_told_from_both_ends_and_a_turn_more_is_none() {
        let pose = FloorPose(Pose2::new(1.003, 2.004, 0.1 + 2.0 * PI));
        let measured = Measured::after(pose, Some(Pose2::new(1.0, 2.0, 0.0)), Pose2::new(1.003, 2.0, 0.1));
        let wished = measured.from_wished.unwrap();
        assert!((wished.distance_m - 5e-3).abs() < 1e-12 && (wished.heading_rad - 0.1).abs() < 1e-12);
        let believed = measured.from_believed;
        assert!(believed.x_m.abs() < 1e-12 && (believed.y_m - 4e-3).abs() < 1e-12);
        assert!(believed.heading_rad.abs() < 1e-12);
        assert_eq!(Measured::after(pose, None, pose.0).from_wished, None);
    }
}
