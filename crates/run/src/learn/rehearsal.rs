//! Repeats of a simulated robot, each with other noise on its sensors.

use omnibase_ethercat::wire::LinkError;
use omnibase_robot::signals::{Phase, Setpoint};
use omnibase_robot::{Ability, Registry, RobotPlan};

use super::{NotLearnt, Repeat};
use crate::stepped::{Leader, NotBegun, Stepped};

/// Why repeats weren't rehearsed.
#[derive(Debug, thiserror::Error)]
pub enum NotRehearsed {
    /// The simulated robot can't be made.
    #[error(transparent)]
    Robot(#[from] NotBegun),
    /// Its bus.
    #[error("the simulated bus: {0}")]
    Bus(#[from] LinkError),
    /// Nothing can be learnt on it.
    #[error(transparent)]
    Nothing(#[from] NotLearnt),
}

/// A repeat that was rehearsed.
#[derive(Clone, Debug)]
pub struct Rehearsed {
    /// What it is to learn from.
    pub repeat: Repeat,
    /// RMS of the true distance from the motion without its correction, while it drove, m.
    pub true_rms_m: f64,
    /// The same at its end, m.
    pub true_end_m: f64,
}

/// Drives a plan's own motion with a correction, or none, on the machine of another plan; `seed` draws the noise of its sensors.
pub fn drive(
    built: &RobotPlan,
    plan: &RobotPlan,
    correction: Option<Vec<[f64; 4]>>,
    registry: &Registry,
    seed: u64,
) -> Result<Rehearsed, NotRehearsed> {
    let mut plan = plan.clone();
    for sensor in &mut plan.simulation.sensor {
        sensor.seed = Some(sensor.seed.unwrap_or(1).wrapping_add(seed.wrapping_mul(1000)));
    }
    plan.reference.correction = None;
    let mut asked = registry.make_reference(&plan.reference, &Ability::of(&plan)).map_err(NotBegun::from)?;
    plan.reference.correction = correction;
    let mut repeat = Repeat::new(&plan, asked.duration_s().unwrap_or(f64::INFINITY))?;
    let mut robot = Stepped::begin_on(built, plan, registry, Leader::Plan, &mut |_| {})?;
    let (mut from, mut squares_m2, mut cycles, mut true_end_m) = (Setpoint::default(), 0.0, 0.0, 0.0);
    while !robot.is_over() {
        let record = *robot.step(None)?;
        repeat.take(&record);
        if record.phase == Phase::Tracking {
            if cycles == 0.0 {
                asked.start(&from);
            }
            let wished = asked.sample(record.reference_time_s).odom_from_body;
            true_end_m = wished.distance_m(robot.truth().odom_from_body);
            squares_m2 += true_end_m * true_end_m;
            cycles += 1.0;
        }
        from = record.wished;
    }
    let true_rms_m = (squares_m2 / f64::max(cycles, 1.0)).sqrt();
    Ok(Rehearsed { repeat, true_rms_m, true_end_m })
}
