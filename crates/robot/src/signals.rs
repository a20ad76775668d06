//! What flows through the cycle: plain structs, all recorded in one [`CycleRecord`].

mod axis;
mod columns;
mod commands;
mod exchange;
mod fusion;
mod grip;
mod guard;
mod inputs;
mod measurements;
mod motion;
mod phase;
mod record;
#[cfg(test)]
mod record_tests;
mod request;
mod sources;
mod traction;

pub use axis::{AxisAsk, AxisState};
pub use columns::column_name;
pub use commands::{
    Allowed, Commands, Quantity, SafetyAction, SafetyReason, Stage, StopCategory, WheelCommand,
};
pub use exchange::{CycleTime, Exchange};
pub use fusion::{FusionReport, SensorReport};
pub(crate) use fusion::{verdict_code, verdict_from_code};
pub use grip::{Dynamics, GripReport};
pub use guard::{GuardReport, LimitedBy};
pub(crate) use inputs::Told;
pub use inputs::{
    Inputs, MAX_DEVICE_BYTES, MAX_DEVICES, MAX_SIGNALS, Outputs, SignalLayout, SignalName, SignalShape,
    Signals,
};
pub use measurements::{DriveMeasurement, DriveProgress, Measurements};
pub use motion::{Course, PlatformState, ReferenceStatus, Setpoint};
pub use omnibase_platform::MAX_WHEELS;
pub use phase::Phase;
pub use record::{
    Channel, CycleRecord, NotARecord, ProcessBytes, RecordLayout, TOPICS_BESIDE, Value, ValueKind,
};
pub use request::{Batch, Frame, Request, RequestAnswer, RequestKind, RequestSort};
pub use sources::{
    Between, Carries, Heard, MAX_SOURCE_VALUES, MAX_SOURCES, PoseMeasurement, SourceName, VelocityMeasurement,
};
pub use traction::TractionReport;

/// Bytes of process data that one drive can send or receive in a cycle.
pub const MAX_PROCESS_BYTES: usize = 64;

/// Numbers for the choices of an enum, as recordings hold them.
macro_rules! coded {
    ($name:ident { $($variant:ident = $code:literal),+ $(,)? }) => {
        impl $name {
            /// The number by which recordings hold this choice.
            pub const fn code(self) -> u64 {
                match self { $($name::$variant => $code),+ }
            }

            /// The choice of a number; `None` where no choice has it.
            pub const fn from_code(code: u64) -> Option<Self> {
                match code { $($code => Some($name::$variant),)+ _ => None }
            }
        }
    };
}
pub(crate) use coded;
