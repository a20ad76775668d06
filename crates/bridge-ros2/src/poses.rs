//! Poses that come in: a measurement as a `[[source]]` of the robot's file, and a person's word where it stands.

use std::time::{Duration, Instant};

use omnibase_client::{Found, Inputs, Seat};
use ros2_client::Subscription;
use serde_json::{Map, Value};

use crate::arguments::Arguments;
use crate::clock::Clock;
use crate::command::Whole;
use crate::messages::PoseWithCovarianceStamped;
use crate::node::{Ros, newest, reliable};
use crate::services::set_pose;

type Poses = Subscription<Whole<PoseWithCovarianceStamped>>;

/// The topics.
pub struct PosesIn {
    measured: Option<(String, Poses, Inputs)>,
    /// As RViz and robot_localization call them.
    set: [Poses; 2],
    odom_frame: String,
}

impl PosesIn {
    /// Hears them.
    pub fn new(ros: &mut Ros, found: &Found, arguments: &Arguments) -> anyhow::Result<PosesIn> {
        let measured = match &arguments.pose_source {
            Some(name) => {
                let poses = ros.subscription::<PoseWithCovarianceStamped, _>("pose", newest())?;
                Some((name.clone(), poses, Inputs::open(found)?))
            }
            None => None,
        };
        let set = [
            ros.subscription::<PoseWithCovarianceStamped, _>("initialpose", reliable())?,
            ros.subscription::<PoseWithCovarianceStamped, _>("set_pose", reliable())?,
        ];
        Ok(PosesIn { measured, set, odom_frame: arguments.odom_frame() })
    }

    /// Hands on what came; words about what can't be.
    pub fn take(
        &mut self,
        seat: &mut Seat,
        clock: &Clock,
        now: Instant,
    ) -> Result<Vec<String>, omnibase_client::Error> {
        let mut refused = Vec::new();
        for topic in &self.set {
            while let Some(read) = topic.take().transpose() {
                match read
                    .map_err(|error| format!("a pose: {error:?}"))
                    .and_then(|(Whole(message), _)| set_pose(&message, &self.odom_frame))
                {
                    Ok(call) => drop(seat.ask(call, now)?),
                    Err(words) => refused.push(words),
                }
            }
        }
        if let Some((name, poses, inputs)) = &mut self.measured {
            while let Some(read) = poses.take().transpose() {
                let values = read.map_err(|error| format!("a measured pose: {error:?}"));
                match values
                    .and_then(|(Whole(message), _)| measured(&message, &self.odom_frame, clock.now_ns()))
                {
                    Ok((values, age)) => inputs.send(name, &values, now.checked_sub(age).unwrap_or(now))?,
                    Err(words) => refused.push(words),
                }
            }
            let (_, before, _) = inputs.told();
            inputs.look(Duration::ZERO)?;
            let (_, after, why) = inputs.told();
            if after > before {
                refused.push(format!("a measured pose: the robot refuses it: {why}"));
            }
        }
        Ok(refused)
    }
}

/// A pose as the robot's source has it, and how old it is.
fn measured(
    message: &PoseWithCovarianceStamped,
    odom_frame: &str,
    clock_ns: Option<i64>,
) -> Result<(Map<String, Value>, Duration), String> {
    let PoseWithCovarianceStamped { header, pose } = message;
    if header.frame_id != odom_frame {
        return Err(format!("a measured pose: expected one in `{odom_frame}`, found `{}`", header.frame_id));
    }
    let heading_rad = pose.pose.orientation.upright_heading_rad();
    let heading_rad =
        heading_rad.ok_or("a measured pose: its orientation is no turn about the vertical axis")?;
    let clock_ns = clock_ns.ok_or("a measured pose: the robot's clock isn't known yet")?;
    let age_ns = u64::try_from((clock_ns - header.stamp.ns()).max(0)).unwrap_or(u64::MAX);
    let covariance = |row: usize, column: usize| pose.covariance.0[6 * row + column];
    let values = [
        ("x", pose.pose.position.x),
        ("y", pose.pose.position.y),
        ("heading", heading_rad),
        ("covariance_xx", covariance(0, 0)),
        ("covariance_xy", covariance(0, 1)),
        ("covariance_xh", covariance(0, 5)),
        ("covariance_yy", covariance(1, 1)),
        ("covariance_yh", covariance(1, 5)),
        ("covariance_hh", covariance(5, 5)),
    ];
    if values.iter().any(|(_, value)| !value.is_finite()) {
        return Err("a measured pose: a number of it is not finite".to_owned());
    }
    Ok((
        values.map(|(name, value)| (name.to_owned(), value.into())).into_iter().collect(),
        Duration::from_nanos(age_ns),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Quaternion, Time};

    #[test]
    fn a_measured_pose_has_its_age_and_its_covariance() {
        let mut message = PoseWithCovarianceStamped::default();
        message.header.frame_id = "odom".into();
        message.header.stamp = Time::of_ns(1_000_000_000);
        message.pose.pose.orientation = Quaternion::heading(-0.25);
        message.pose.pose.position.x = 1.5;
        (message.pose.covariance.0[0], message.pose.covariance.0[11]) = (1e-4, 2e-5);
        let (values, age) = measured(&message, "odom", Some(1_030_000_000)).unwrap();
        assert_eq!(age, Duration::from_millis(30));
        assert_eq!((values["x"].as_f64(), values["covariance_xx"].as_f64()), (Some(1.5), Some(1e-4)));
        assert_eq!(values["covariance_yh"].as_f64(), Some(2e-5));
        assert!((values["heading"].as_f64().unwrap() + 0.25).abs() < 1e-12);
        assert!(measured(&message, "map", Some(0)).is_err());
        message.pose.covariance.0[35] = f64::NAN;
        assert!(measured(&message, "odom", Some(0)).is_err());
    }
}
