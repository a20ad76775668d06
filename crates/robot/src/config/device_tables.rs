//! The tables of SubDevices that drive no wheel, as written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis_tables::AxisTable;
use super::custom::Parameters;
use super::drive_tables::{ParameterTable, PdoTable};
use super::start_tables::{DcTable, TimeoutsTable};

/// One SubDevice that drives no wheel: a coupler, a terminal, a sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DeviceTable {
    /// Its name: small letters, digits and underscores, at most 24; its signals are called `name.signal`.
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
    /// The hot-connect group that it is of: all of a group are plugged in at the start, or none of it is.
    pub group: Option<String>,
    /// Its process data go in each n-th cycle of the bus only; default: 1, in every one. Not a drive's.
    #[schemars(range(min = 1, max = 1000))]
    pub every: Option<u16>,
    /// Events that its clock gives it behind each frame with its data; default: none, an axis' those of the drives.
    pub dc: Option<DcTable>,
    /// The longest waits for it.
    pub timeouts: Option<TimeoutsTable>,
    /// What it is; it says which of the keys below are read.
    pub kind: Option<String>,
    /// Vendor that must be there, as `"0x2"`.
    pub vendor_id: Option<String>,
    /// Product that must be there, as `"0x3F03052"`.
    pub product_code: Option<String>,
    /// Revision that must be there.
    pub revision: Option<String>,
    /// PDO maps from the cycle to it; default: the kind's own.
    pub outputs: Option<Vec<PdoTable>>,
    /// PDO maps from it to the cycle; default: the kind's own.
    pub inputs: Option<Vec<PdoTable>>,
    /// Signals that come from it.
    pub input: Vec<InputTable>,
    /// Signals that it is told.
    pub output: Vec<OutputTable>,
    /// The axis that its drive moves.
    pub axis: Option<AxisTable>,
    /// SDOs written at start-up and read back.
    pub parameters: Option<Vec<ParameterTable>>,
    /// The kind's own keys.
    pub custom: Parameters,
}

/// A signal that comes from a SubDevice: `value = number · scale + offset`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct InputTable {
    /// Its name: small letters, digits and underscores, at most 24.
    pub name: Option<String>,
    /// Its object among `inputs`, as `"6000.1"`.
    pub object: Option<String>,
    /// The byte in that object at which it begins, from 0, where the object holds several numbers: it has as many bytes as
    /// its `type`. Padding behind the object belongs to it.
    pub byte: Option<u8>,
    /// Its bit in that object, or in that `byte` of it, from 0, where the object holds several; default: the whole object.
    pub bit: Option<u8>,
    /// Type of the number; default: `bool` where it is one bit.
    #[serde(rename = "type")]
    pub kind: Option<SignalType>,
    /// Unit of the value; default: none.
    pub unit: Option<String>,
    /// Factor of the number; default: 1.
    pub scale: Option<f64>,
    /// What is added to it; default: 0.
    pub offset: Option<f64>,
    /// Its value in the simulated robot; default: what the number 0 is.
    pub simulated: Option<f64>,
}

/// A signal that a SubDevice is told: `number = (value - offset) / scale`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct OutputTable {
    /// Its name: small letters, digits and underscores, at most 24.
    pub name: Option<String>,
    /// Its object among `outputs`, as `"7000.1"`.
    pub object: Option<String>,
    /// The byte in that object at which it begins, from 0, where the object holds several numbers: it has as many bytes as
    /// its `type`. Padding behind the object belongs to it.
    pub byte: Option<u8>,
    /// Its bit in that object, or in that `byte` of it, from 0, where the object holds several; default: the whole object.
    pub bit: Option<u8>,
    /// Type of the number; default: `bool` where it is one bit.
    #[serde(rename = "type")]
    pub kind: Option<SignalType>,
    /// Unit of the value; default: none.
    pub unit: Option<String>,
    /// Factor of the number; default: 1.
    pub scale: Option<f64>,
    /// What is added to it; default: 0.
    pub offset: Option<f64>,
    /// Its value until somebody sets it, and again when the robot stops or whoever set it is gone; default: 0.
    pub on_stop: Option<f64>,
}

/// Type of a signal's number in the process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SignalType {
    /// One bit.
    Bool,
    /// Signed, up to 8 bits.
    I8,
    /// Signed, up to 16 bits.
    I16,
    /// Signed, up to 32 bits.
    I32,
    /// Unsigned, up to 8 bits.
    U8,
    /// Unsigned, up to 16 bits.
    U16,
    /// Unsigned, up to 32 bits.
    U32,
    /// IEEE 754, 32 bits.
    F32,
}

impl SignalType {
    /// The most bits that it can have.
    pub fn bits(self) -> u8 {
        match self {
            SignalType::Bool => 1,
            SignalType::I8 | SignalType::U8 => 8,
            SignalType::I16 | SignalType::U16 => 16,
            SignalType::I32 | SignalType::U32 | SignalType::F32 => 32,
        }
    }
}
