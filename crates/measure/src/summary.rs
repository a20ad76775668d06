//! The figures of a run.

use serde::Serialize;

use crate::events::Event;
use crate::measured::Measured;
use crate::pauses::Pauses;
use crate::timing::TimingFigures;
use crate::tracking::BelievedAndTrue;
use omnibase_session::supervision::{BusFigures, DatagramFigures, SubDeviceFigures};

/// How a run went: `omnibase run --json` prints this, key by key.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Distance from the wished pose after the end was held, m.
    pub final_error_m: BelievedAndTrue,
    /// Root of the mean square of that distance while tracking, m.
    pub rms_error_m: BelievedAndTrue,
    /// Greatest distance while tracking, m.
    pub max_error_m: BelievedAndTrue,
    /// Heading at the end: wished less true (believed on hardware), rad.
    pub final_heading_error_rad: Option<f64>,
    /// What a person measured on the floor after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured: Option<Measured>,
    /// Cycles in OP.
    pub cycles: u64,
    /// Frames that weren't back at their deadline.
    pub lost_frames: u64,
    /// Cycles left out because the one before took too long or the host overslept.
    pub overruns: u64,
    /// Cycles in the recording.
    pub records_written: u64,
    /// Cycles that found no room in the recorder's ring.
    pub records_dropped: u64,
    /// Time of the robot over time of the host.
    pub realtime_factor: f64,
    /// What was counted of the bus.
    pub bus: BusFigures,
    /// What was counted of each SubDevice.
    pub subdevices: Vec<SubDeviceFigures>,
    /// Working counters, by datagram.
    pub datagrams: Vec<DatagramFigures>,
    /// How long cycles took, and what happened in the worst ones.
    pub timing: TimingFigures,
    /// Whose pauses cost cycles.
    pub pauses: Pauses,
    /// CPU time of the cycle's thread over the run's; `None` on virtual time.
    pub cpu_share: Option<f64>,
    /// What happened.
    pub events: Vec<Event>,
}
