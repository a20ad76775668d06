//! What is asked of an axis, and what it does.

use super::coded;
use crate::config::AxisMode;

/// What is asked of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisAsk {
    /// Find its home.
    Home,
    /// Go to a position.
    Move {
        /// The position, in the axis' unit.
        position: f64,
        /// Who plans the way: csp or pp.
        mode: AxisMode,
    },
    /// Run at a speed, by pv, until it is told something else or comes to its limits; 0 stops it.
    Run {
        /// The speed, in the axis' unit per second.
        speed: f64,
    },
    /// Come to rest.
    Stop,
}

/// What an axis does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisState {
    /// Its drive isn't in operation.
    #[default]
    Off,
    /// It holds where it is.
    Holding,
    /// It moves to a position.
    Moving,
    /// It looks for its home.
    Homing,
    /// It comes to rest.
    Stopping,
    /// It holds; its home wasn't found.
    HomingFailed,
    /// It failed, and stopped the robot.
    Failed,
}

coded!(AxisState {
    Off = 0,
    Holding = 1,
    Moving = 2,
    Homing = 3,
    Stopping = 4,
    HomingFailed = 5,
    Failed = 6,
});

impl AxisState {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            AxisState::Off => "off",
            AxisState::Holding => "holding",
            AxisState::Moving => "moving",
            AxisState::Homing => "homing",
            AxisState::Stopping => "stopping",
            AxisState::HomingFailed => "holding, its home wasn't found",
            AxisState::Failed => "failed",
        }
    }
}
