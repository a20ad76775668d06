//! Messages of `common_interfaces`, `tf2_msgs` and `rosgraph_msgs`.

use super::*;

message!("builtin_interfaces/msg/Time" Time { sec: i32, nanosec: u32 });
message!("builtin_interfaces/msg/Duration" Duration { sec: i32, nanosec: u32 });
message!("std_msgs/msg/Header" Header { stamp: Time, frame_id: String });
message!("std_msgs/msg/String" Text { data: String });
message!("std_msgs/msg/Empty" Empty { structure_needs_at_least_one_member: u8 });
message!("rosgraph_msgs/msg/Clock" Clock { clock: Time });

message!("geometry_msgs/msg/Vector3" Vector3 { x: f64, y: f64, z: f64 });
message!("geometry_msgs/msg/Point" Point { x: f64, y: f64, z: f64 });
message!("geometry_msgs/msg/Point32" Point32 { x: f32, y: f32, z: f32 });
message!("geometry_msgs/msg/Quaternion" Quaternion { x: f64, y: f64, z: f64, w: f64 });
message!("geometry_msgs/msg/Pose" Pose { position: Point, orientation: Quaternion });
message!("geometry_msgs/msg/PoseStamped" PoseStamped { header: Header, pose: Pose });
message!("geometry_msgs/msg/PoseWithCovariance" PoseWithCovariance { pose: Pose, covariance: Numbers<36> });
message!("geometry_msgs/msg/PoseWithCovarianceStamped" PoseWithCovarianceStamped {
    header: Header,
    pose: PoseWithCovariance,
});
message!("geometry_msgs/msg/Twist" Twist { linear: Vector3, angular: Vector3 });
message!("geometry_msgs/msg/TwistStamped" TwistStamped { header: Header, twist: Twist });
message!("geometry_msgs/msg/TwistWithCovariance" TwistWithCovariance { twist: Twist, covariance: Numbers<36> });
message!("geometry_msgs/msg/Transform" Transform { translation: Vector3, rotation: Quaternion });
message!("geometry_msgs/msg/TransformStamped" TransformStamped {
    header: Header,
    child_frame_id: String,
    transform: Transform,
});
message!("geometry_msgs/msg/Polygon" Polygon { points: Vec<Point32> });
message!("geometry_msgs/msg/PolygonStamped" PolygonStamped { header: Header, polygon: Polygon });
message!("tf2_msgs/msg/TFMessage" Transforms { transforms: Vec<TransformStamped> });

message!("nav_msgs/msg/Odometry" Odometry {
    header: Header,
    child_frame_id: String,
    pose: PoseWithCovariance,
    twist: TwistWithCovariance,
});
message!("nav_msgs/msg/Path" Path { header: Header, poses: Vec<PoseStamped> });
message!("sensor_msgs/msg/JointState" JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
});

message!("diagnostic_msgs/msg/KeyValue" KeyValue { key: String, value: String });
message!("diagnostic_msgs/msg/DiagnosticStatus" DiagnosticStatus {
    level: Byte,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
});
message!("diagnostic_msgs/msg/DiagnosticArray" DiagnosticArray {
    header: Header,
    status: Vec<DiagnosticStatus>,
});

message!("std_srvs/srv/Trigger_Request" TriggerRequest { structure_needs_at_least_one_member: u8 });
message!("std_srvs/srv/Trigger_Response" TriggerResponse { success: bool, message: String });
message!("std_srvs/srv/SetBool_Request" SetBoolRequest { data: bool });
message!("std_srvs/srv/SetBool_Response" SetBoolResponse { success: bool, message: String });

message!("robot_localization/srv/SetPose_Request" SetPoseRequest { pose: PoseWithCovarianceStamped });

/// A byte that is no number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Byte(pub u8);

impl Quaternion {
    /// About the vertical axis, rad.
    pub fn heading(heading_rad: f64) -> Self {
        let (z, w) = (heading_rad / 2.0).sin_cos();
        Quaternion { x: 0.0, y: 0.0, z, w }
    }

    /// The heading, rad, of what is upright within 0.1 rad and of length 1 within 1 %.
    pub fn upright_heading_rad(&self) -> Option<f64> {
        let Quaternion { x, y, z, w } = *self;
        let length = (x * x + y * y + z * z + w * w).sqrt();
        let is_upright = (length - 1.0).abs() < 0.01 && 2.0 * (x * x + y * y) < 0.005;
        is_upright.then(|| (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)))
    }
}

impl Time {
    /// Of ns since the clock's beginning.
    pub fn of_ns(ns: i64) -> Self {
        let nanosec = ns.rem_euclid(1_000_000_000) as u32;
        let sec = ns.div_euclid(1_000_000_000).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        Time { sec, nanosec }
    }

    /// Ns since the clock's beginning.
    pub fn ns(&self) -> i64 {
        i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)
    }
}
