//! What tracking a reference came to.

use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_robot::{CycleRecord, Phase, RequestKind};

use crate::trial::Trial;

/// Errors of a run: between the wished pose and the believed or true pose of the instant of the measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Run {
    /// Root of the mean square while tracking, as believed, m.
    pub believed_rms_m: f64,
    /// Greatest while tracking, as believed, m.
    pub believed_greatest_m: f64,
    /// A second after the end, as believed, m.
    pub believed_final_m: f64,
    /// Root of the mean square while tracking, in truth, m.
    pub true_rms_m: f64,
    /// A second after the end, in truth, m.
    pub true_final_m: f64,
    /// Heading a second after the end, in truth, rad.
    pub true_final_heading_rad: f64,
    /// Cycles of the tracking.
    pub cycles: u64,
    /// Whether it came to its end by itself.
    pub finished: bool,
}

impl Run {
    /// Tracks an enabled robot's whole reference and a second more; `each` sees every record of the tracking.
    pub fn track(trial: &mut Trial, each: &mut dyn FnMut(&CycleRecord)) -> Run {
        let origin = Origin { odom: trial.robot.record().setpoint.odom_from_body, true_pose: trial.pose() };
        trial.step(Some(RequestKind::Track));
        let mut run = Run::default();
        let (mut believed, mut truly) = (0.0, 0.0);
        while trial.robot.phase() == Phase::Tracking {
            let record = *trial.step(None);
            let wished = record.wished.odom_from_body;
            let error_m = wished.distance_m(record.state.odom_from_body);
            believed += error_m * error_m;
            run.believed_greatest_m = run.believed_greatest_m.max(error_m);
            truly += wished.distance_m(origin.in_odom(trial.measured_pose())).powi(2);
            run.cycles += 1;
            each(&record);
        }
        let stopped = trial.robot.record().stop_reason;
        run.finished = trial.robot.phase() == Phase::Holding && stopped == Default::default();
        let record = *trial.run(1000);
        let wished = record.wished.odom_from_body;
        let true_pose = origin.in_odom(trial.pose());
        let count = run.cycles.max(1) as f64;
        run.believed_rms_m = (believed / count).sqrt();
        run.true_rms_m = (truly / count).sqrt();
        run.believed_final_m = wished.distance_m(record.state.odom_from_body);
        run.true_final_m = wished.distance_m(true_pose);
        run.true_final_heading_rad = wrap_angle_rad(wished.heading_rad - true_pose.heading_rad).abs();
        run
    }
}

/// Where the robot stood when it began, in odom and in the world: what odometry can't know isn't counted.
struct Origin {
    odom: Pose2,
    true_pose: Pose2,
}

impl Origin {
    fn in_odom(&self, pose: Pose2) -> Pose2 {
        let turn = self.odom.heading_rad - self.true_pose.heading_rad;
        let (sin, cos) = turn.sin_cos();
        let (dx, dy) = (pose.x_m - self.true_pose.x_m, pose.y_m - self.true_pose.y_m);
        Pose2 {
            x_m: self.odom.x_m + cos * dx - sin * dy,
            y_m: self.odom.y_m + sin * dx + cos * dy,
            heading_rad: pose.heading_rad + turn,
        }
    }
}
