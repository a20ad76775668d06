//! What is asked of the bridge.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// ROS 2's side of a running omnibase robot: it drives by `cmd_vel`, and tells `odom`, `tf`, `joint_states`, `diagnostics`.
///
/// Exit codes: 0 asked to end, 1 lost (start it again), 2 wrong usage.
#[derive(Clone, Debug, clap::Parser)]
#[command(name = "omnibase-bridge-ros2", version, max_term_width = 110)]
pub struct Arguments {
    /// The robot's address; otherwise the robot that started this bridge, or the latest on this machine.
    #[arg(long, value_name = "ADDRESS")]
    pub at: Option<SocketAddr>,
    /// A file with the secret of those who may command; otherwise OMNIBASE_TOKEN says it.
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// The namespace, as /robot_1.
    #[arg(long, default_value = "/")]
    pub namespace: String,
    /// The node's name.
    #[arg(long, default_value = "omnibase")]
    pub name: String,
    /// The DDS domain; otherwise ROS_DOMAIN_ID says it, or it is 0.
    #[arg(long, value_parser = clap::value_parser!(u16).range(0..=232))]
    pub domain: Option<u16>,
    /// The type of `cmd_vel`; the other one is refused.
    #[arg(long, value_enum, default_value_t = CommandType::TwistStamped)]
    pub cmd_vel: CommandType,
    /// For how long a command counts, from its stamp, ms.
    #[arg(long, value_name = "MS", default_value = "200", value_parser = milliseconds)]
    pub hold_ms: Duration,
    /// Rate of `odom`, Hz; 0: every cycle.
    #[arg(long, value_name = "HZ", default_value_t = 50.0)]
    pub odom_hz: f64,
    /// Rate of `joint_states`, Hz; 0: none.
    #[arg(long, value_name = "HZ", default_value_t = 50.0)]
    pub joint_hz: f64,
    /// Rate of the transform, Hz; 0: none.
    #[arg(long, value_name = "HZ", default_value_t = 50.0)]
    pub tf_hz: f64,
    /// Where transforms go; with `tf` into the namespace.
    #[arg(long, value_name = "TOPIC", default_value = "/tf")]
    pub tf_topic: String,
    /// What begins the names of all frames, as robot_1/.
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub frame_prefix: String,
    /// The fixed frame.
    #[arg(long, value_name = "FRAME", default_value = "odom")]
    pub odom_frame: String,
    /// The frame in which sensors tell where the platform is: tells its transform to the fixed frame, too, as a localiser does
    /// (REP-105); default: none, for a localiser of ROS 2's own.
    #[arg(long, value_name = "FRAME")]
    pub map_frame: Option<String>,
    /// The platform's frame.
    #[arg(long, value_name = "FRAME", default_value = "base_link")]
    pub base_frame: String,
    /// Stamps of the simulated robot's own clock, which is told on /clock.
    #[arg(long)]
    pub sim_time: bool,
    /// A URDF file for `robot_description`, in place of one made of the robot's wheels.
    #[arg(long, value_name = "FILE")]
    pub urdf: Option<PathBuf>,
    /// The `[[source]]` of the robot's file to which poses of the topic `pose` go.
    #[arg(long, value_name = "NAME")]
    pub pose_source: Option<String>,
}

/// The type of `cmd_vel`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CommandType {
    /// `geometry_msgs/msg/TwistStamped`.
    #[value(name = "stamped")]
    TwistStamped,
    /// `geometry_msgs/msg/Twist`, which counts from when it comes.
    #[value(name = "twist")]
    Twist,
}

fn milliseconds(text: &str) -> Result<Duration, String> {
    let ms = text.parse().ok().filter(|ms| (20..=10_000).contains(ms));
    ms.map(Duration::from_millis).ok_or_else(|| format!("expected 20 to 10000, found `{text}`"))
}

impl Arguments {
    /// The DDS domain.
    pub fn domain(&self) -> anyhow::Result<u16> {
        match (self.domain, std::env::var("ROS_DOMAIN_ID")) {
            (Some(domain), _) => Ok(domain),
            (None, Ok(text)) if !text.is_empty() => {
                let domain = text.parse().ok().filter(|domain| *domain <= 232);
                domain.ok_or_else(|| anyhow::anyhow!("ROS_DOMAIN_ID: expected 0 to 232, found `{text}`"))
            }
            (None, _) => Ok(0),
        }
    }

    /// The fixed frame's whole name.
    pub fn odom_frame(&self) -> String {
        format!("{}{}", self.frame_prefix, self.odom_frame)
    }

    /// The whole name of the frame of sensors.
    pub fn map_frame(&self) -> Option<String> {
        Some(format!("{}{}", self.frame_prefix, self.map_frame.as_ref()?))
    }

    /// The platform's whole name.
    pub fn base_frame(&self) -> String {
        format!("{}{}", self.frame_prefix, self.base_frame)
    }
}
