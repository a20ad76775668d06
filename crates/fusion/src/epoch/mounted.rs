//! Sensors as they are mounted: what of them doesn't change from epoch to epoch.

use omnibase_platform::Pose2;

use crate::belief::{FLAWS, WHEELS};
use crate::sensor::{MAX_RATES, Sensor, SensorKind};

/// A sensor in its company.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mounted {
    /// How well it knows.
    pub(crate) model: Sensor,
    /// Its place among those that tell speeds.
    pub(crate) rate: Option<usize>,
    /// The flaw that is its clock's.
    pub(crate) clock: usize,
    /// The flaw that it tells too little; of poses its clock again.
    pub(crate) share: usize,
    /// Sine and cosine of the direction in which it is mounted.
    pub(super) turned: [f64; 2],
}

impl Mounted {
    /// All of a company, in their order.
    pub(crate) fn all(sensors: &[Sensor]) -> Vec<Mounted> {
        let (mut rates, mut poses) = (0, 0);
        let mounted = |model: &Sensor| {
            let (sin, cos) = model.body_from_sensor.heading_rad.sin_cos();
            let none = Mounted { model: *model, rate: None, clock: 0, share: 0, turned: [sin, cos] };
            match model.kind {
                SensorKind::Pose => {
                    poses += 1;
                    Mounted { clock: FLAWS - poses, share: FLAWS - poses, ..none }
                }
                _ if rates < MAX_RATES => {
                    rates += 1;
                    let clock = WHEELS.len() + 2 * (rates - 1);
                    Mounted { rate: Some(rates - 1), clock, share: clock + 1, ..none }
                }
                _ => none,
            }
        };
        sensors.iter().map(mounted).collect()
    }

    /// Whether it tells poses.
    pub(crate) fn is_pose(&self) -> bool {
        self.model.kind == SensorKind::Pose
    }

    /// A body's twist at its place and along its axes.
    pub(super) fn sees(&self, [x, y, turn]: [f64; 3]) -> [f64; 3] {
        let Pose2 { x_m, y_m, .. } = self.model.body_from_sensor;
        let [sin, cos] = self.turned;
        let (x, y) = (x - turn * y_m, y + turn * x_m);
        [cos * x + sin * y, cos * y - sin * x, turn]
    }

    /// What one that tells speeds tells of such a twist, or of what a twist changes by.
    pub(super) fn tells(&self, twist: [f64; 3]) -> [f64; 3] {
        match self.model.kind {
            SensorKind::Turn | SensorKind::Inertial => [twist[2], 0.0, 0.0],
            _ => self.sees(twist),
        }
    }
}
