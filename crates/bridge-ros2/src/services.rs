//! What a person or a program asks for by a service, answered in the robot's own words.

use std::collections::BTreeMap;
use std::time::Instant;

use omnibase_client::{Answer, Seat};
use ros2_client::{RmwRequestId, Server};
use serde_json::{Value, json};

use crate::messages::{
    Empty, PoseWithCovarianceStamped, SetBoolRequest, SetBoolResponse, SetPoseRequest, TriggerRequest,
    TriggerResponse,
};
use crate::node::Ros;

/// Services without a question, and what they ask of the robot. The names are relative to the namespace.
fn plain() -> [(&'static str, Value); 9] {
    [
        ("enable", json!({ "do": "enable" })),
        ("enable_stick", Value::Null),
        ("acknowledge", json!({ "do": "acknowledge" })),
        ("stop", json!({ "do": "stop", "category": "category_2" })),
        ("emergency_stop", json!({ "do": "emergency_stop" })),
        ("release", json!({ "do": "release" })),
        ("track", json!({ "do": "track" })),
        ("resume", json!({ "do": "resume" })),
        ("load", Value::Null),
    ]
}

/// Who waits for an answer.
enum Waiting {
    Plain(usize, RmwRequestId),
    Teach(RmwRequestId),
    SetPose(RmwRequestId),
}

/// All services.
pub struct Services {
    plain: Vec<(&'static str, Value, Server<TriggerRequest, TriggerResponse>)>,
    teach: Server<SetBoolRequest, SetBoolResponse>,
    set_pose: Server<SetPoseRequest, Empty>,
    waiting: BTreeMap<u64, Waiting>,
    odom_frame: String,
}

/// What the robot is asked for a pose, where that is one in the fixed frame.
pub fn set_pose(message: &PoseWithCovarianceStamped, odom_frame: &str) -> Result<Value, String> {
    let PoseWithCovarianceStamped { header, pose } = message;
    if header.frame_id != odom_frame {
        return Err(format!("a pose: expected one in `{odom_frame}`, found `{}`", header.frame_id));
    }
    let heading_rad = pose.pose.orientation.upright_heading_rad();
    let heading_rad = heading_rad.ok_or("a pose: its orientation is no turn about the vertical axis")?;
    let (x_m, y_m) = (pose.pose.position.x, pose.pose.position.y);
    if ![x_m, y_m].iter().all(|number| number.is_finite()) {
        return Err("a pose: a number of it is not finite".to_owned());
    }
    let mut call = json!({ "do": "set_pose", "pose": [x_m, y_m, heading_rad] });
    let covariance = &pose.covariance.0;
    let sigma = |variance: f64| (variance.is_finite() && variance > 0.0).then(|| variance.sqrt());
    // One number for both: the greater.
    if let Some(sigma_m) = sigma(covariance[0].max(covariance[7])) {
        call["sigma_m"] = sigma_m.into();
    }
    if let Some(sigma_rad) = sigma(covariance[35]) {
        call["sigma_rad"] = sigma_rad.into();
    }
    Ok(call)
}

impl Services {
    /// Serves them all.
    pub fn new(ros: &mut Ros, odom_frame: String) -> anyhow::Result<Services> {
        let served = |(name, call): (&'static str, Value)| -> anyhow::Result<_> {
            Ok((name, call, ros.server(name, "std_srvs/srv/Trigger")?))
        };
        Ok(Services {
            plain: plain().into_iter().map(served).collect::<anyhow::Result<_>>()?,
            teach: ros.server("teach", "std_srvs/srv/SetBool")?,
            set_pose: ros.server("set_pose", "robot_localization/srv/SetPose")?,
            waiting: BTreeMap::new(),
            odom_frame,
        })
    }

    /// Takes what is asked now. `path_name` is the path that is loaded, or taught.
    pub fn take(
        &mut self,
        seat: &mut Seat,
        phase: &str,
        path_name: &str,
    ) -> Result<(), omnibase_client::Error> {
        for (at, (name, call, server)) in self.plain.iter().enumerate() {
            while let Ok(Some((id, _))) = server.receive_request() {
                let number = match *name {
                    // Whoever enables looked at the robot: that holds for this bridge's stick too.
                    "enable" if phase == "disabled" => {
                        seat.enable_stick()?;
                        seat.ask(call.clone(), Instant::now())?
                    }
                    "enable" | "enable_stick" => seat.enable_stick()?,
                    "load" => seat.ask(json!({ "do": "load_saved", "name": path_name }), Instant::now())?,
                    _ => seat.ask(call.clone(), Instant::now())?,
                };
                self.waiting.insert(number, Waiting::Plain(at, id));
            }
        }
        while let Ok(Some((id, SetBoolRequest { data }))) = self.teach.receive_request() {
            let call =
                if data { json!({ "do": "teach" }) } else { json!({ "do": "teach_end", "name": path_name }) };
            self.waiting.insert(seat.ask(call, Instant::now())?, Waiting::Teach(id));
        }
        while let Ok(Some((id, SetPoseRequest { pose }))) = self.set_pose.receive_request() {
            match set_pose(&pose, &self.odom_frame) {
                Ok(call) => drop(self.waiting.insert(seat.ask(call, Instant::now())?, Waiting::SetPose(id))),
                // Its answer has no words.
                Err(words) => {
                    eprintln!("warning: the service set_pose: {words}");
                    let _ = self.set_pose.send_response(id, Empty::default());
                }
            }
        }
        Ok(())
    }

    /// Hands an answer to who waits for it; whether somebody did.
    pub fn answer(&mut self, answer: &Answer) -> bool {
        let Some(waiting) = self.waiting.remove(&answer.number) else { return false };
        let (success, message) = (answer.done, answer.text.clone());
        // Whoever asked may be gone.
        match waiting {
            Waiting::Plain(at, id) => {
                drop(self.plain[at].2.send_response(id, TriggerResponse { success, message }))
            }
            Waiting::Teach(id) => drop(self.teach.send_response(id, SetBoolResponse { success, message })),
            Waiting::SetPose(id) => {
                if !success {
                    eprintln!("warning: the service set_pose: {message}");
                }
                drop(self.set_pose.send_response(id, Empty::default()));
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, Numbers, Point, Pose, PoseWithCovariance, Quaternion};

    #[test]
    fn a_pose_is_set_in_odom_alone_and_upright() {
        let message = |frame: &str, orientation: Quaternion, x: f64| PoseWithCovarianceStamped {
            header: Header { frame_id: frame.to_owned(), ..Header::default() },
            pose: PoseWithCovariance {
                pose: Pose { position: Point { x, y: -2.0, z: 0.0 }, orientation },
                covariance: {
                    let mut numbers = [0.0; 36];
                    (numbers[0], numbers[7], numbers[35]) = (0.01, 0.04, 0.09);
                    Numbers(numbers)
                },
            },
        };
        let upright = Quaternion::heading(0.5);
        let call = set_pose(&message("odom", upright.clone(), 1.0), "odom").unwrap();
        assert_eq!((call["do"].as_str(), call["pose"][1].as_f64()), (Some("set_pose"), Some(-2.0)));
        assert!((call["pose"][2].as_f64().unwrap() - 0.5).abs() < 1e-12, "{call}");
        assert!((call["sigma_m"].as_f64().unwrap() - 0.2).abs() < 1e-12, "{call}");
        assert!((call["sigma_rad"].as_f64().unwrap() - 0.3).abs() < 1e-12, "{call}");
        assert!(set_pose(&message("map", upright.clone(), 1.0), "odom").is_err());
        assert!(set_pose(&message("odom", upright, f64::NAN), "odom").is_err());
        assert!(set_pose(&message("odom", Quaternion::default(), 1.0), "odom").is_err());
        let (lying, nowhere) = (Quaternion { x: 0.6, w: 0.8, ..Quaternion::default() }, f64::NAN);
        assert!(set_pose(&message("odom", lying, 1.0), "odom").is_err());
        assert!(
            set_pose(&message("odom", Quaternion { w: nowhere, ..Quaternion::default() }, 1.0), "odom")
                .is_err()
        );
    }
}
