//! The tables of drives and their parameters, as written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::custom::Parameters;
use super::drive_mode::DriveMode;
use super::start_tables::{DcTable, TimeoutsTable};

/// One drive and its motor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DriveTable {
    /// The wheel's name; default: `wheel_1` and so on.
    pub name: Option<String>,
    /// Its position on the bus, from 0; this, `alias` or `identification`.
    #[schemars(range(min = 0, max = 65_535))]
    pub position: Option<u16>,
    /// Its station alias; this, `position` or `identification`.
    #[schemars(range(min = 1, max = 65_535))]
    pub alias: Option<u16>,
    /// What its switch for explicit device identification shows; this, `position` or `alias`.
    #[schemars(range(min = 0, max = 65_535))]
    pub identification: Option<u16>,
    /// Which device.
    pub device: Option<String>,
    /// Vendor that must be there, as `"0x539"`.
    pub vendor_id: Option<String>,
    /// Product that must be there, as `"0x2200001"`.
    pub product_code: Option<String>,
    /// Revision that must be there.
    pub revision: Option<String>,
    /// PDO maps from the cycle to the drive; default: the device's own.
    pub outputs: Option<Vec<PdoTable>>,
    /// PDO maps from the drive to the cycle; default: the device's own.
    pub inputs: Option<Vec<PdoTable>>,
    /// Encoder counts per revolution of the motor.
    #[schemars(range(min = 1))]
    pub counts_per_revolution: Option<u32>,
    /// Whether the encoder keeps its count of turns without supply; default: `incremental`.
    pub encoder: Option<EncoderName>,
    /// Revolutions of the motor per revolution of the wheel; default: 1.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub gear_ratio: Option<f64>,
    /// Whether positive counts turn the wheel backwards; default: `forward`.
    pub direction: Option<TurnDirection>,
    /// Unit of the drive's speed objects; default: `counts_s`.
    pub speed_unit: Option<SpeedUnit>,
    /// The motor's rated torque, N·m: 1000 in the drive's torque objects.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub rated_torque_nm: Option<f64>,
    /// The motor's peak torque, N·m; default: the rated torque.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub peak_torque_nm: Option<f64>,
    /// What the drive is commanded by; default: what the control law commands. Under a law that commands speeds the cycle
    /// closes the speed loop of a drive that takes torques.
    pub mode: Option<DriveMode>,
    /// Torque of that loop per error of the wheel's speed, N·m·s/rad.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_loop_gain_nm_s_rad: Option<f64>,
    /// Time in which that loop's integral gives as much again, s.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_loop_integral_s: Option<f64>,
    /// The objects that hold the drive to `limits.wheel_torque_nm`: in every cycle where they are mapped among
    /// `outputs`, else by SDO at start-up, read back; default: `max_torque`.
    pub torque_limit: Option<TorqueLimitName>,
    /// Events of its clock with `bus.synchronisation = "sync0"`; default: a SYNC0 in each cycle.
    pub dc: Option<DcTable>,
    /// The longest waits for it.
    pub timeouts: Option<TimeoutsTable>,
    /// SDOs written at start-up and read back.
    pub parameters: Option<Vec<ParameterTable>>,
    /// A file of `[[parameter]]` tables, sent before `parameters`.
    pub parameters_file: Option<String>,
    /// The device's own keys.
    pub custom: Parameters,
}

/// What an encoder knows after a loss of its drive's supply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EncoderName {
    /// Nothing: its count begins anew, or lacks whole turns.
    #[default]
    Incremental,
    /// Its angle and its whole turns: 0x6064 goes on where it was, with what turned meanwhile (a battery for its turns).
    Absolute,
}

/// Which way the wheel turns when the counts rise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TurnDirection {
    /// The wheel's positive way.
    Forward,
    /// Against it.
    Backward,
}

/// The objects that hold a drive to a torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TorqueLimitName {
    /// Max torque (0x6072).
    MaxTorque,
    /// Positive and negative torque limit value (0x60E0, 0x60E1).
    PositiveAndNegative,
}

/// Unit of 0x60FF and 0x606C.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SpeedUnit {
    /// Encoder counts per second.
    CountsS,
    /// Revolutions of the motor per minute.
    Rpm,
    /// Thousandths of a revolution of the motor per minute.
    MilliRpm,
}

/// One PDO and what it carries.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct PdoTable {
    /// The PDO, as `"0x1600"`.
    pub pdo: Option<String>,
    /// Its objects in order, each `index:bits` or `index.subindex:bits`, a gap `pad:bits`, as `"6040:16 60FF:32"`.
    pub map: Option<String>,
}

/// One SDO to write.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ParameterTable {
    /// Object as `"0x6085"` or `"0x60C2.1"`.
    pub object: Option<String>,
    /// Type of the value.
    #[serde(rename = "type")]
    pub kind: Option<ParameterType>,
    /// The value, in the drive's units.
    pub value: Option<i64>,
    /// In place of `type` and `value`: bytes as they are sent, in hexadecimal, as `"6D6164652075702E"`.
    pub bytes: Option<String>,
    /// Whether `bytes` are the whole object from this subindex (0 or 1), in one transfer; default: false.
    pub complete_access: Option<bool>,
    /// Whether it is read back and compared; default: `compare`.
    pub read_back: Option<ReadBackChoice>,
    /// The state in which it is written on the way to OP; default: `pre_op`.
    pub state: Option<ParameterState>,
}

/// The state in which a parameter is written on the way to OP.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterState {
    /// PRE-OP, before the PDO map: transitions IP and PS of a maker's file.
    #[default]
    PreOp,
    /// SAFE-OP, with SYNC armed and process data flowing, before OP is asked: transition SO.
    SafeOp,
}

/// Type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterType {
    /// Signed, 8 bits.
    I8,
    /// Signed, 16 bits.
    I16,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 8 bits.
    U8,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 32 bits.
    U32,
}

/// Whether a parameter is read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReadBackChoice {
    /// Read and compared.
    Compare,
    /// Not read: write-only objects and commands.
    Skip,
}

/// A file of parameters of one drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ParametersFile {
    /// SDOs in the order in which they are sent.
    pub parameter: Vec<ParameterTable>,
}
