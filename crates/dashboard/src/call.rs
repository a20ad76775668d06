//! What a client may ask, in words of JSON: `{"do": "go_to", "pose": [1.0, 0.0, 0.0]}`.

use std::collections::BTreeMap;

use omnibase_robot::config::{ReferenceTable, StopName};
use omnibase_robot::signals::{Frame, StopCategory};
use serde::{Deserialize, Serialize};

/// What a client asks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Call {
    /// Bring the drives to operation and hold.
    Enable,
    /// Somebody saw the fault and wants to go on.
    Acknowledge,
    /// Follow the reference from its start.
    Track,
    /// Let the reference come to a halt on its path.
    Pause,
    /// Go on with a reference that was left.
    Resume,
    /// Go the straight way to a pose in odom: x m, y m, heading rad.
    GoTo {
        /// The pose.
        pose: [f64; 3],
    },
    /// Go the straight way to where the reference begins.
    GoToStart,
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
    /// Change settings: all of them, or none.
    Set {
        /// New values by name.
        values: BTreeMap<String, f64>,
    },
    /// A stick's wish, in shares of the limits, each from -1 to 1; it counts from where the session said once that its
    /// stick was let go.
    Pad {
        /// Forward, or along x.
        x: f64,
        /// To the left, or along y.
        y: f64,
        /// Counter-clockwise.
        turn: f64,
        /// In which frame.
        #[serde(default)]
        frame: PadFrame,
    },
    /// The stick was let go.
    ReleasePad,
    /// The stick is gone while it was held, as a gamepad whose cable was pulled.
    LosePad,
    /// The page's own stick, which was lost, may command again.
    EnablePad,
    /// The stick at the robot's computer, which was lost or stopped, may command again once it was let go.
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
    /// Take another reference.
    Load {
        /// The reference, as its table in a robot's file.
        reference: Box<ReferenceTable>,
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
    /// Remember from now on where the robot is driven.
    Teach {
        /// A point every so often.
        #[serde(default)]
        by: TeachBy,
    },
    /// Make a path of where it was driven, keep it under a name, and take it for reference.
    TeachEnd {
        /// The name: letters, digits, `-` and `_`.
        name: String,
        /// How far the path may be from where the robot was, m; default: 0.001.
        tolerance_m: Option<f64>,
    },
    /// The client is there.
    Alive,
}

impl Call {
    /// Whether it ends a motion, and begins none.
    pub(crate) fn stops(&self) -> bool {
        matches!(self, Call::Stop { .. } | Call::EmergencyStop)
    }
}

/// In which frame a stick's wish is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PadFrame {
    /// The platform's.
    #[default]
    Body,
    /// The fixed one.
    Odom,
}

/// When a point is remembered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TeachBy {
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

impl From<PadFrame> for Frame {
    fn from(frame: PadFrame) -> Self {
        match frame {
            PadFrame::Body => Frame::Body,
            PadFrame::Odom => Frame::Odom,
        }
    }
}

/// What came of a call.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    /// Whether it was done.
    pub done: bool,
    /// In words.
    pub text: String,
}

impl Said {
    pub(crate) fn done(text: impl Into<String>) -> Self {
        Said { done: true, text: text.into() }
    }

    pub(crate) fn refused(why: impl std::fmt::Display) -> Self {
        Said { done: false, text: format!("refused: {why}") }
    }
}

/// The category of a name.
pub(crate) fn category(name: StopName) -> StopCategory {
    match name {
        StopName::Category0 => StopCategory::RemoveTorque,
        StopName::Category1 => StopCategory::RampThenRemove,
        StopName::Category2 => StopCategory::RampAndHold,
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
        let pad = read(r#"{"do":"pad","x":0.5,"y":0,"turn":0}"#).unwrap();
        assert_eq!(pad, Call::Pad { x: 0.5, y: 0.0, turn: 0.0, frame: PadFrame::Body });
        let stop = read(r#"{"do":"stop","category":"category_1"}"#).unwrap();
        assert_eq!(stop, Call::Stop { category: StopName::Category1 });
        for wrong in [
            r#"{"do":"fly"}"#,
            r#"{"do":"pad","x":0.5,"y":0,"turn":0,"z":1}"#,
            r#"{"do":"go_to","pose":[1,2]}"#,
            r#"{"do":"go_to","pose":[1,2,NaN]}"#,
            "[]",
            "",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
