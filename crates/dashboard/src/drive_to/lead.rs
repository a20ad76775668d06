//! Where a robot that moves goes while another way is planned for it.

use omnibase_platform::Pose2;
use omnibase_robot::Ability;
use omnibase_robot::signals::{Course, Phase, Setpoint};
use omnibase_robot::stages::Reference;
use omnibase_run::live::{Live, Snapshot};

use crate::robot_info::RobotInfo;

/// Slower than this it stands, m/s and rad/s.
const STANDS: f64 = 0.01;
/// A robot that moves goes on for so long until another way is planned, s; and places that are kept of where it goes.
const PLANNING_S: f64 = 0.2;
const LEADS: u32 = 8;

/// Where a robot that moves goes before it turns to another way: on its path as long as it takes to come to rest there, otherwise where a
/// stop would lead it. None where it stands.
pub(super) fn lead(live: &Live, about: &RobotInfo, snapshot: &Snapshot) -> Vec<Pose2> {
    let (record, limits) = (&snapshot.record, &about.robot.plan.limits);
    let Setpoint { odom_from_body: here, twist_in_odom: twist, .. } = record.setpoint;
    let ramp_s = |speed: f64, gain: f64, jerk: f64| speed / gain + gain / jerk;
    let (speed, turn) = (twist.speed_m_s(), twist.w_rad_s.abs());
    if snapshot.phase != Phase::Tracking || (speed < STANDS && turn < STANDS) {
        return Vec::new();
    }
    let stop_s = PLANNING_S
        + ramp_s(speed, limits.acceleration_m_s2, limits.jerk_m_s3).max(ramp_s(
            turn,
            limits.turn_acceleration_rad_s2,
            limits.turn_jerk_rad_s3,
        ));
    let path = (record.course == Course::Reference).then(|| followed(live, about, snapshot)).flatten();
    let along = |share: f64| match &path {
        Some(path) => path.preview(record.reference_time_s + share * stop_s).map(|at| at.odom_from_body),
        None => {
            let s = PLANNING_S * share + 0.5 * (stop_s - PLANNING_S) * share * (2.0 - share);
            Some(Pose2::new(
                here.x_m + s * twist.vx_m_s,
                here.y_m + s * twist.vy_m_s,
                here.heading_rad + s * twist.w_rad_s,
            ))
        }
    };
    let ahead = (1..=LEADS).map_while(|part| along(f64::from(part) / f64::from(LEADS)));
    std::iter::once(here).chain(ahead.filter(|pose| pose.is_finite())).collect()
}

/// The path that is followed, laid where it is.
fn followed(live: &Live, about: &RobotInfo, snapshot: &Snapshot) -> Option<Box<dyn Reference>> {
    let loaded = live.reference(snapshot.reference);
    let table = loaded.as_deref().unwrap_or(&about.robot.plan.reference);
    let ability = Ability::of(&about.robot.plan);
    let mut path = about.registry.make_reference(table, &ability).ok()?;
    path.start(&snapshot.reference_start?);
    Some(path)
}
