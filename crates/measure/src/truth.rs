//! Where the simulated robot really is, at the instant at which its encoders were read.

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot_sim::SharedMachine;

/// The truth beside what the robot believes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruePlatform {
    /// Pose, in odom: the pose of the first look is its origin.
    pub odom_from_body: Pose2,
    /// Speed, in base_link.
    pub twist_in_body: Twist2,
}

/// Looks at the machine behind the simulated drives.
#[derive(Clone, Debug)]
pub struct Witness {
    machine: SharedMachine,
    body_from_world: Option<Pose2>,
}

impl Witness {
    /// A witness who hasn't looked yet.
    pub fn new(machine: SharedMachine) -> Self {
        Witness { machine, body_from_world: None }
    }

    /// The truth at an instant close to the machine's own, ns.
    ///
    /// The drives' inner loops run on between an encoder's reading and the frame that fetches it (half a cycle), so
    /// the machine is ahead of the inputs: its present twist leads back to their instant, wrong by a·t²/2, 0.2 um
    /// for 0.5 ms at 1.5 m/s².
    pub fn look(&mut self, instant_ns: u64) -> TruePlatform {
        let truth = self.machine.truth();
        let twist = truth.twist_in_body;
        let twist_in_body = Twist2::new(twist.vx_m_s, twist.vy_m_s, twist.w_rad_s);
        let ahead_s = (truth.time_ns as f64 - instant_ns as f64) * 1e-9;
        let now = Pose2::new(truth.pose.x_m, truth.pose.y_m, truth.pose.heading_rad);
        let turned_rad = now.heading_rad - twist_in_body.w_rad_s * ahead_s;
        let world_from_body = Pose2 { heading_rad: turned_rad, ..now.moved_by(twist_in_body.over(-ahead_s)) };
        let origin = *self.body_from_world.get_or_insert(world_from_body.inverse());
        let here = origin.then(world_from_body);
        // Whole turns count, as they do in what the robot believes.
        let heading_rad = world_from_body.heading_rad + origin.heading_rad;
        TruePlatform { odom_from_body: Pose2 { heading_rad, ..here }, twist_in_body }
    }
}
