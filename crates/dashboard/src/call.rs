//! What a client may ask, in words of JSON: `{"do": "go_to", "pose": [1.0, 0.0, 0.0]}`.

mod words;

use std::collections::BTreeMap;

use omnibase_robot::config::{AxisMode, BestWay, DriveMode, StopName};
use omnibase_robot::signals::Frame;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a client asks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Call {
    /// Bring the drives to operation and hold.
    Enable,
    /// Somebody saw the fault and wants to go on.
    Acknowledge,
    /// Follow the reference from its start. While the robot moves it is joined further on, without a stop.
    Track,
    /// Let the reference come to a halt on its path.
    Pause,
    /// Go on with a reference that was left, or that is being paused.
    Resume,
    /// Go to a pose in odom in the shortest time: x m, y m, heading rad. From rest the way is straight; whoever asked for the motion that is
    /// under way may ask while the robot moves, and it goes over into the new one.
    GoTo {
        /// The pose.
        pose: [f64; 3],
    },
    /// Plan a way through the room to a pose in odom, x m, y m, heading rad, and drive it: around walls of the `[map]`, fence and
    /// obstacles. Where the way is blocked meanwhile it is planned again, then given up with the reason.
    DriveTo {
        /// The pose.
        pose: [f64; 3],
        /// Which way is the best one; default: that of the robot's file.
        best: Option<BestWay>,
    },
    /// Draw walls that planned ways go around, in place of those drawn before; the guard, which keeps fence and obstacles, doesn't
    /// see them.
    SetWalls {
        /// Closed polygons, each a list of corners x and y in odom, m.
        polygons_m: Vec<Vec<[f64; 2]>>,
    },
    /// Take another fence, which the guard keeps from now on; only while the platform stands, and never one in which it hasn't the room that
    /// must be kept. The robot's file stays as it is.
    SetFence {
        /// Its corners in order, x and y in odom, m; 3 to 32, and its sides don't cross.
        corners_m: Vec<[f64; 2]>,
    },
    /// Say where the platform stands, in odom: x m, y m, heading rad; only while it stands.
    SetPose {
        /// The pose.
        pose: [f64; 3],
        /// Standard deviation of x and of y, m; default: 0.02.
        sigma_m: Option<f64>,
        /// Standard deviation of the heading, rad; default: 0.02.
        sigma_rad: Option<f64>,
    },
    /// Go the straight way to where the reference begins.
    GoToStart,
    /// End the motion that this session began, and nobody else's; the robot comes to rest and holds.
    EndMotion,
    /// Stop: `category_0`, `category_1` or `category_2` of IEC 60204-1.
    Stop {
        /// How.
        category: StopName,
    },
    /// Stop, and let nothing begin until that is released.
    EmergencyStop,
    /// Motion may be asked for again.
    Release,
    /// Go on with another controller of the robot's file.
    Controller {
        /// Its name.
        name: String,
    },
    /// Command one wheel's drive by speeds or by torques from now on, while moving too.
    DriveMode {
        /// The wheel, by its name in the robot's file.
        name: String,
        /// How; without it by what the control law commands.
        mode: Option<DriveMode>,
    },
    /// Change settings: all of them, or none.
    Set {
        /// New values by name.
        values: BTreeMap<String, f64>,
    },
    /// A stick's wish, in shares of the limits, each from -1 to 1; it counts from where the session said once that its
    /// stick was let go.
    Stick {
        /// Forward, or along x.
        x: f64,
        /// To the left, or along y.
        y: f64,
        /// Counter-clockwise.
        turn: f64,
        /// In which frame.
        #[serde(default)]
        frame: WishFrame,
    },
    /// A twist's wish, held as a stick's is, by a program that plans: vx m/s, vy m/s, turn rad/s. Fence, obstacles and limits
    /// keep the last word.
    Drive {
        /// The twist.
        twist: [f64; 3],
        /// In which frame.
        #[serde(default)]
        frame: WishFrame,
    },
    /// The stick was let go.
    ReleaseStick,
    /// The stick is gone while it was held, as a gamepad whose cable was pulled.
    LoseStick,
    /// The page's own stick, which was lost, may command again.
    EnableStick,
    /// From now on the session's stick drives again by itself after a silence, as a program's does that hands on what others
    /// say; whatever else stops the robot blocks it until it is enabled.
    RecoverStick,
    /// The joystick at the robot's computer, which was lost or stopped, may command again once it was let go.
    EnableJoystick,
    /// Put an obstacle on the floor, or move the one that is there.
    SetObstacle {
        /// Its place, from 0.
        index: u32,
        /// Centre in odom, x and y, m.
        centre_m: [f64; 2],
        /// Radius, m.
        radius_m: f64,
        /// Speed in odom, x and y, m/s; default: it stands.
        #[serde(default)]
        velocity_m_s: [f64; 2],
    },
    /// Take an obstacle away.
    RemoveObstacle {
        /// Its place, from 0.
        index: u32,
    },
    /// Set an output of a SubDevice without a wheel; it stays so until the robot stops, or the page that set it is gone.
    SetOutput {
        /// Its full name, as `lamps.green`.
        name: String,
        /// Its value, in its unit.
        value: f64,
    },
    /// Say what a program outside knows, as a `[[source]]` of the robot's file: all its values at one instant.
    SendInputs {
        /// The source's name.
        source: String,
        /// Its values by name, in their units; null, or left out, for what isn't known now.
        values: BTreeMap<String, Option<f64>>,
        /// When that was so, ms of the robot's clock: the last stamp, plus the time since then by the program's own clock;
        /// default: the stamp. What is older than the source's `max_age_ms`, or than what was heard before, is refused.
        instant_ms: Option<f64>,
    },
    /// Have an axis find its home.
    HomeAxis {
        /// Its name in the robot's file.
        name: String,
    },
    /// Move an axis; it stops where the robot does, or the page that moved it is gone.
    MoveAxis {
        /// Its name in the robot's file.
        name: String,
        /// The position, in its unit.
        position: f64,
        /// Who plans the way; default: `csp`, the cycle.
        mode: Option<AxisMode>,
    },
    /// Have an axis run at a speed, until it is told something else or comes to its limits.
    RunAxis {
        /// Its name in the robot's file.
        name: String,
        /// The speed, in its unit per second.
        speed: f64,
    },
    /// Have an axis come to rest.
    StopAxis {
        /// Its name in the robot's file.
        name: String,
    },
    /// Take another reference; not while one is followed.
    Load {
        /// The reference, with the keys of its table in a robot's file.
        reference: serde_json::Map<String, serde_json::Value>,
    },
    /// Take path points, as lines of a file, for reference.
    LoadPoints {
        /// The lines.
        text: String,
    },
    /// Take a path that was saved here.
    LoadSaved {
        /// Its name.
        name: String,
    },
    /// Remember from now on where the robot is driven, or single poses.
    Teach {
        /// A point every so often, or where `teach_point` says.
        #[serde(default)]
        by: TeachBy,
    },
    /// Remember the pose where the robot stands now, after `teach by="points"`.
    TeachPoint,
    /// Make a path of where it was driven, keep it under a name, and take it for reference.
    TeachEnd {
        /// The name: letters, digits, `-` and `_`.
        name: String,
        /// How far the path may be from where the robot was, m; default: 0.001.
        tolerance_m: Option<f64>,
    },
    /// What hangs at the robot's bus, and in which state.
    Scan,
    /// Read an object of a SubDevice by SDO.
    SdoRead {
        /// Its position, from 0.
        subdevice: u16,
        /// Index and subindex in hexadecimal: `6041:00`.
        object: String,
    },
    /// List the indices of a SubDevice's objects, by SDO Information.
    SdoList {
        /// Its position, from 0.
        subdevice: u16,
    },
    /// Ask for an object's name, kind and highest subindex, by SDO Information.
    SdoObject {
        /// Its position, from 0.
        subdevice: u16,
        /// Index in hexadecimal.
        object: String,
    },
    /// Ask for an entry's name, type, length and access, by SDO Information.
    SdoType {
        /// Its position, from 0.
        subdevice: u16,
        /// Index and subindex in hexadecimal.
        object: String,
    },
    /// Write an object of a SubDevice by SDO: while no drive is enabled, or where the robot's file allows it.
    SdoWrite {
        /// Its position, from 0.
        subdevice: u16,
        /// Index and subindex in hexadecimal.
        object: String,
        /// A whole number, as long as the SubDevice says.
        value: Option<serde_json::Value>,
        /// Bytes in hexadecimal, in place of a value.
        data: Option<String>,
    },
    /// The client is there.
    Alive,
}

pub(crate) use words::unknown;

/// A call as it comes in, with what stands beside it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    /// The number by which a page knows the answer.
    pub(crate) number: u64,
    /// The last stamp that the client had from the robot, ms of the robot's own clock.
    pub(crate) stamp_ms: Option<u64>,
    /// What is asked.
    pub(crate) call: Call,
}

impl Message {
    /// From JSON; what is wrong with it, in words.
    pub(crate) fn read(text: &[u8]) -> Result<Self, String> {
        let mut written: serde_json::Value =
            serde_json::from_slice(text).map_err(|error| format!("expected JSON: {error}"))?;
        let mut count = |key: &str| match written.as_object_mut().and_then(|written| written.remove(key)) {
            None | Some(serde_json::Value::Null) => Ok(None),
            Some(found) => found
                .as_u64()
                .map(Some)
                .ok_or_else(|| format!("{key}: expected a whole number, found `{found}`")),
        };
        let (number, stamp_ms) = (count("number")?.unwrap_or(0), count("stamp")?);
        Ok(Message { number, stamp_ms, call: words::read(&written)? })
    }
}

impl Call {
    /// Whether it ends a motion, and begins none.
    pub(crate) fn stops(&self) -> bool {
        matches!(self, Call::Stop { .. } | Call::EndMotion | Call::EmergencyStop | Call::StopAxis { .. })
    }

    /// Whether carrying it out takes more than a moment: it computes, or reads files.
    pub(crate) fn computes(&self) -> bool {
        match self {
            Call::GoToStart
            | Call::DriveTo { .. }
            | Call::Load { .. }
            | Call::LoadPoints { .. }
            | Call::LoadSaved { .. }
            | Call::TeachEnd { .. } => true,
            Call::Enable
            | Call::Acknowledge
            | Call::Track
            | Call::Pause
            | Call::Resume
            | Call::GoTo { .. }
            | Call::Stop { .. }
            | Call::EmergencyStop
            | Call::Release
            | Call::Controller { .. }
            | Call::DriveMode { .. }
            | Call::Set { .. }
            | Call::Stick { .. }
            | Call::Drive { .. }
            | Call::ReleaseStick
            | Call::LoseStick
            | Call::RecoverStick
            | Call::EndMotion
            | Call::EnableStick
            | Call::EnableJoystick
            | Call::SetObstacle { .. }
            | Call::RemoveObstacle { .. }
            | Call::SetOutput { .. }
            | Call::SendInputs { .. }
            | Call::HomeAxis { .. }
            | Call::MoveAxis { .. }
            | Call::RunAxis { .. }
            | Call::StopAxis { .. }
            | Call::Scan
            | Call::SdoRead { .. }
            | Call::SdoList { .. }
            | Call::SdoObject { .. }
            | Call::SdoType { .. }
            | Call::SdoWrite { .. }
            | Call::Teach { .. }
            | Call::TeachPoint
            | Call::SetWalls { .. }
            | Call::SetFence { .. }
            | Call::SetPose { .. }
            | Call::Alive => false,
        }
    }

    /// Whether it waits for nothing that was asked before it.
    pub(crate) fn goes_first(&self) -> bool {
        matches!(
            self,
            Call::Stop { .. }
                | Call::EndMotion
                | Call::EmergencyStop
                | Call::StopAxis { .. }
                | Call::Release
                | Call::Pause
                | Call::Stick { .. }
                | Call::Drive { .. }
                | Call::ReleaseStick
                | Call::LoseStick
                | Call::RecoverStick
                | Call::SendInputs { .. }
                | Call::Alive
        )
    }
}

/// In which frame a stick's wish is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WishFrame {
    /// The platform's.
    #[default]
    Body,
    /// The fixed one.
    Odom,
}

/// When a point is remembered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TeachBy {
    /// Where `teach_point`, the page's button or the joystick's says; the path goes straight from pose to pose.
    Points,
    /// Every so many seconds.
    PeriodS(f64),
    /// After every change of the pose by so many m, or rad.
    Change {
        /// Metres.
        distance_m: f64,
        /// Radians.
        angle_rad: f64,
    },
}

impl Default for TeachBy {
    fn default() -> Self {
        TeachBy::PeriodS(0.05)
    }
}

impl From<WishFrame> for Frame {
    fn from(frame: WishFrame) -> Self {
        match frame {
            WishFrame::Body => Frame::Body,
            WishFrame::Odom => Frame::Odom,
        }
    }
}

/// What came of a call.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CallResult {
    /// Whether it was done.
    pub done: bool,
    /// In words.
    pub text: String,
    /// For programs, where there is more than words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data: Option<serde_json::Value>,
}

impl CallResult {
    pub(crate) fn done(text: impl Into<String>) -> Self {
        CallResult { done: true, text: text.into(), data: None }
    }

    /// `why` may begin with "refused: " itself, as the robot's own answers do.
    pub(crate) fn refused(why: impl std::fmt::Display) -> Self {
        let why = why.to_string();
        CallResult::not_done(format!("refused: {}", why.strip_prefix("refused: ").unwrap_or(&why)))
    }

    pub(crate) fn not_done(text: impl Into<String>) -> Self {
        CallResult { done: false, text: text.into(), data: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_plain_json_and_unknown_words_are_errors() {
        let read = |text| serde_json::from_str::<Call>(text);
        assert_eq!(read(r#"{"do": "enable"}"#).unwrap(), Call::Enable);
        assert_eq!(read(r#"{"do":"go_to","pose":[1,2,3]}"#).unwrap(), Call::GoTo { pose: [1.0, 2.0, 3.0] });
        let wish = read(r#"{"do":"stick","x":0.5,"y":0,"turn":0}"#).unwrap();
        assert_eq!(wish, Call::Stick { x: 0.5, y: 0.0, turn: 0.0, frame: WishFrame::Body });
        let set = read(r#"{"do":"set_pose","pose":[1,2,3],"sigma_m":0.05}"#).unwrap();
        assert_eq!(set, Call::SetPose { pose: [1.0, 2.0, 3.0], sigma_m: Some(0.05), sigma_rad: None });
        let stop = read(r#"{"do":"stop","category":"category_1"}"#).unwrap();
        assert_eq!(stop, Call::Stop { category: StopName::Category1 });
        for wrong in [
            r#"{"do":"fly"}"#,
            r#"{"do":"stick","x":0.5,"y":0,"turn":0,"z":1}"#,
            r#"{"do":"go_to","pose":[1,2]}"#,
            r#"{"do":"go_to","pose":[1,2,NaN]}"#,
            "[]",
            "",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
