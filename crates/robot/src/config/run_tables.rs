//! The deployment: by what the robot is reached, who leads it, and what is recorded of its runs.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

/// How `omnibase run` brings the robot up; options of the command line replace single keys. Relative paths begin at the
/// folder of the robot's file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RunTable {
    /// Network interface with the drives: with it `run` drives the real robot, unless `--simulated` is given; default:
    /// simulated.
    pub interface: Option<String>,
    /// Second network interface, at the other end of a ring.
    pub redundant: Option<String>,
    /// Real-time scheduling, locked memory and shallow idle for the cycle at the interface; default: `false`.
    pub realtime: Option<bool>,
    /// The CPU on which the cycle at the interface runs; default: any.
    #[schemars(range(min = 0, max = 4095))]
    pub cpu: Option<u32>,
    /// Serve the robot's page: `true` at 127.0.0.1:8400, or at an address; default: `false`.
    pub dashboard: Option<Switch>,
    /// A file of mode 0600 with the secret of those who may command; default: a new one for each run.
    pub token_file: Option<String>,
    /// Folder where taught paths are kept; default: `paths` in the folder where the command is run.
    pub paths: Option<String>,
    /// Drive by the joystick at the robot's computer: `true` the first one that fits, or a device, as `"/dev/input/event5"`;
    /// default: `false`.
    pub joystick: Option<Switch>,
}

/// A program that `omnibase run` starts beside the robot, and again where it ends: `[bridge.ros2]`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BridgeTable {
    /// The program: one that stands beside `omnibase` or in PATH, or a path with a `/`, from the folder of the robot's file;
    /// default: `omnibase-bridge-` with the bridge's name.
    pub program: Option<String>,
    /// What it is given, as `["--namespace", "/robot_1"]`; default: nothing.
    pub arguments: Vec<String>,
    /// Whether it is started; default: `true`.
    pub enabled: Option<bool>,
}

/// Off, on, or on with something of one's own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Switch {
    /// On or off.
    Plain(bool),
    /// On, with this address or device.
    With(String),
}

impl Switch {
    /// `None` where it is off; else what it is on with, where it is something of one's own.
    pub fn is_on(&self) -> Option<Option<&str>> {
        match self {
            Switch::Plain(false) => None,
            Switch::Plain(true) => Some(None),
            Switch::With(own) => Some(Some(own)),
        }
    }
}

impl JsonSchema for Switch {
    fn schema_name() -> Cow<'static, str> {
        "Switch".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "description": "Off, on, or on with something of one's own.", "type": ["boolean", "string"] })
    }
}

/// What is recorded of each run; options of the command line replace single keys.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RecordingTable {
    /// The file, relative to the folder of the robot's file; `{time}` in its name stands for when the run began, as
    /// `2026-11-22T20-15-03Z`. Without it a run writes over the one before.
    pub file: Option<String>,
    /// Signals by their names, as `state.pose_x_m`, where `*` stands for any characters; default: all.
    pub signals: Option<Vec<String>>,
    /// Time from one recorded cycle to the next, ms, a whole multiple of the cycle; default: every cycle is recorded.
    #[schemars(range(min = 0.05, max = 3_600_000.0))]
    pub every_ms: Option<f64>,
    /// The same in cycles; not both.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub every_cycles: Option<u32>,
    /// Its format; default: `mcap`.
    pub format: Option<RecordingFormat>,
    /// The most that a file takes, MB (of 10⁶ bytes); the run goes on in the next one: `run-00001.mcap`, `run-00002.mcap`.
    /// Default: one file without a limit.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub limit_mb: Option<u32>,
    /// How many such files of a run are kept, the one being written among them; default: all.
    #[schemars(range(min = 2, max = 99_999))]
    pub files: Option<u32>,
}

/// Format of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingFormat {
    /// MCAP, as Foxglove, PlotJuggler and `omnibase report` read it.
    #[default]
    Mcap,
    /// Text in columns with a header line, as Kst and numpy read it.
    Columns,
}

/// What is recorded of a run, resolved.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingPlan {
    /// The file, with `{time}` as it was written.
    pub file: String,
    /// Patterns of signals; empty: all.
    pub signals: Vec<String>,
    /// Time from one recorded cycle to the next, ns; `None`: every cycle.
    pub every_ns: Option<u64>,
    /// Its format.
    pub format: RecordingFormat,
    /// Bytes of a file, at most.
    pub limit_bytes: Option<u64>,
    /// Files that are kept; `None`: all.
    pub files: Option<u32>,
}

/// What stands in a recording's name for when its run began.
pub const TIME_IN_NAME: &str = "{time}";
