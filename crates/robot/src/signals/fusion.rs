//! What is known of the platform's place by all that tells of it.

use omnibase_fusion::{MAX_SENSORS, Verdict};
use omnibase_platform::Pose2;

/// What sensors tell, in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FusionReport {
    /// Pose of base_link in map; it may jump.
    pub map_from_body: Pose2,
    /// Covariance of that: xx, xy, xψ, yy, yψ, ψψ in m², m·rad and rad².
    pub covariance: [f64; 6],
    /// A sensor told where the platform is in map, or somebody did.
    pub is_placed: bool,
    /// The sensors, in the order of the file.
    pub sensors: [SensorReport; MAX_SENSORS],
}

/// What is thought of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorReport {
    /// Whether it is believed, and why not.
    pub verdict: Verdict,
    /// chi² of its last reading over its degrees of freedom: 1 in the mean where all is as the file says.
    pub nis: f64,
}

/// The number by which recordings hold a verdict.
pub(crate) fn verdict_code(verdict: Verdict) -> u64 {
    match verdict {
        Verdict::Awaited => 0,
        Verdict::Good => 1,
        Verdict::Silent => 2,
        Verdict::Frozen => 3,
        Verdict::Contradicts => 4,
    }
}

/// The verdict of a number; `None` where no verdict has it.
pub(crate) fn verdict_from_code(code: u64) -> Option<Verdict> {
    [Verdict::Awaited, Verdict::Good, Verdict::Silent, Verdict::Frozen, Verdict::Contradicts]
        .into_iter()
        .find(|verdict| verdict_code(*verdict) == code)
}
