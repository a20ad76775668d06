//! What an axis means once its table is resolved.

use omnibase_cia402::Mode;

use super::axis_tables::{AxisMode, AxisUnit};
use super::bus_plan::ParameterPlan;
use super::device_plan::InputPlan;
use super::drive_tables::EncoderName;

/// An axis. Positions in its unit, from its own zero.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisPlan {
    /// Unit of its position.
    pub unit: AxisUnit,
    /// Between its unit and the drive's.
    pub scale: AxisScale,
    /// What its encoder knows after a loss of supply.
    pub encoder: EncoderName,
    /// Modes in which it may be moved.
    pub modes: Vec<AxisMode>,
    /// What it never exceeds.
    pub limits: AxisLimits,
    /// How it finds its home.
    pub homing: Option<HomingPlan>,
    /// Where it stands at first in the simulated robot.
    pub simulated_position: f64,
    /// Period of the cycle, s.
    pub period_s: f64,
}

/// Between an axis' unit and its drive's; factors are negative where positive counts move it backwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisScale {
    /// Encoder counts per revolution of the motor.
    pub counts_per_revolution: u32,
    /// Counts per unit.
    pub counts_per_unit: f64,
    /// The drive's speed units per unit/s.
    pub speed_units_per_unit_s: f64,
    /// The motor's rated torque, N·m.
    pub rated_torque_nm: f64,
    /// Position where the drive counts 0.
    pub zero_position: f64,
}

impl AxisScale {
    /// The drive's whole counts at a position, 32 bits; 0 for NaN.
    pub fn counts(&self, position: f64) -> i32 {
        ((position - self.zero_position) * self.counts_per_unit).round() as i32
    }

    /// The position at the drive's counts.
    pub fn position(&self, counts: i32) -> f64 {
        self.zero_position + f64::from(counts) / self.counts_per_unit
    }

    /// The motor's torque, N·m, positive where it pushes the axis forward.
    pub fn torque_nm(&self, per_mille: i16) -> f64 {
        f64::from(per_mille) * self.rated_torque_nm / 1000.0 * self.counts_per_unit.signum()
    }
}

/// What an axis never exceeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// The least and the greatest position.
    pub position: [f64; 2],
    /// Speed.
    pub speed: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Jerk; `None` where it isn't limited.
    pub jerk: Option<f64>,
    /// How fast a stop slows down, at least the acceleration.
    pub stop_deceleration: f64,
    /// Distance from the set point.
    pub following_error: f64,
    /// The motor's torque, N·m.
    pub torque_nm: f64,
}

/// How an axis finds its home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingPlan {
    /// Method (0x6098).
    pub method: i8,
    /// Speed on the way to the switch.
    pub switch_speed: f64,
    /// Speed on the way to zero.
    pub zero_speed: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// After so long it has failed, ns.
    pub timeout_ns: u64,
}

impl AxisUnit {
    /// As people write it.
    pub fn name(self) -> &'static str {
        match self {
            AxisUnit::M => "m",
            AxisUnit::Rad => "rad",
        }
    }
}

impl AxisMode {
    /// The profile's mode.
    pub fn mode(self) -> Mode {
        match self {
            AxisMode::Csp => Mode::CyclicSynchronousPosition,
            AxisMode::Pp => Mode::ProfilePosition,
            AxisMode::Pv => Mode::ProfileVelocity,
        }
    }
}

impl AxisPlan {
    /// Modes of its drive that it needs: csp holds it whatever moves it.
    pub fn needed_modes(&self) -> Vec<Mode> {
        let of_moves = self.modes.iter().map(|mode| mode.mode());
        let others = of_moves.filter(|mode| *mode != Mode::CyclicSynchronousPosition);
        let homing = self.homing.map(|_| Mode::Homing);
        [Mode::CyclicSynchronousPosition].into_iter().chain(others).chain(homing).collect()
    }

    /// Its signals, in the order in which the axis says them.
    pub(crate) fn signals(&self) -> Vec<InputPlan> {
        let unit = self.unit.name();
        let signal = |(name, unit): (&str, String)| InputPlan {
            name: name.to_owned(),
            unit,
            coding: None,
            simulated: None,
        };
        let all = [
            ("position", unit.to_owned()),
            ("speed", format!("{unit}/s")),
            ("torque", "N·m".to_owned()),
            ("set_point", unit.to_owned()),
            ("state", String::new()),
            ("homed", String::new()),
            ("mode", String::new()),
        ];
        all.map(signal).into()
    }

    /// What its drive is told at start-up, so that what it plans itself keeps the limits too. `is_mapped` tells which
    /// objects the cycle writes.
    pub(crate) fn objects(&self, is_mapped: impl Fn(u16) -> bool) -> Vec<AxisObject> {
        let AxisLimits { speed, acceleration, stop_deceleration, following_error, torque_nm, .. } =
            self.limits;
        let units = |object, key, value| AxisObject {
            object,
            data: whole(key, value, self.scale.speed_units_per_unit_s.abs(), u32::MAX),
        };
        let fixed = |object, data: &[u8]| AxisObject { object, data: Ok(data.to_vec()) };
        let mut all = vec![
            // The bus is lost: the drive's quick stop, which then holds.
            fixed((0x6007, 0), &3_i16.to_le_bytes()),
            fixed((0x605A, 0), &6_i16.to_le_bytes()),
            units((0x6085, 0), "stop_deceleration", stop_deceleration),
            AxisObject {
                object: (0x6065, 0),
                // The greatest number takes the drive's supervision away.
                data: whole(
                    "following_error",
                    following_error,
                    self.scale.counts_per_unit.abs(),
                    u32::MAX - 1,
                ),
            },
        ];
        if !is_mapped(0x6072) {
            let per_mille = (torque_nm / self.scale.rated_torque_nm * 1000.0).floor() as u16;
            all.push(fixed((0x6072, 0), &per_mille.to_le_bytes()));
        }
        let has = |mode| self.modes.contains(&mode);
        if has(AxisMode::Pp) {
            all.push(units((0x6081, 0), "speed_limit", speed));
        }
        if has(AxisMode::Pp) || has(AxisMode::Pv) {
            all.push(units((0x6083, 0), "acceleration_limit", acceleration));
            all.push(units((0x6084, 0), "acceleration_limit", acceleration));
        }
        if has(AxisMode::Pp) || has(AxisMode::Pv) || self.homing.is_some() {
            // A halt: by the quick stop's ramp.
            all.push(fixed((0x605D, 0), &2_i16.to_le_bytes()));
        }
        if let Some(homing) = self.homing {
            all.extend([
                // Drives differ in the sign of the home offset: their home is their 0.
                fixed((0x607C, 0), &0_i32.to_le_bytes()),
                fixed((0x6098, 0), &homing.method.to_le_bytes()),
                units((0x6099, 1), "homing.switch_speed", homing.switch_speed),
                units((0x6099, 2), "homing.zero_speed", homing.zero_speed),
                units((0x609A, 0), "homing.acceleration", homing.acceleration),
            ]);
        }
        all
    }
}

/// An object of the drive that an axis' table decides.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AxisObject {
    /// Index and subindex.
    pub object: (u16, u8),
    data: Result<Vec<u8>, Misfit>,
}

impl AxisObject {
    /// How it is written at start-up.
    pub(crate) fn parameter(self) -> Result<ParameterPlan, Misfit> {
        Ok(ParameterPlan::entry(self.object, self.data?, "axis".to_owned()))
    }
}

/// A value that its object can't hold.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Misfit {
    /// In the axis' table.
    pub key: &'static str,
    /// What stands there.
    pub value: f64,
    /// The least and the greatest that the object can hold, in the axis' unit.
    pub limits: [f64; 2],
}

/// A value in the drive's units, 32 bits of at least 1: never more than it says.
fn whole(key: &'static str, value: f64, per_unit: f64, most: u32) -> Result<Vec<u8>, Misfit> {
    let units = (value * per_unit).floor();
    if (1.0..=f64::from(most)).contains(&units) {
        return Ok((units as u32).to_le_bytes().to_vec());
    }
    Err(Misfit { key, value, limits: [1.0 / per_unit, f64::from(most) / per_unit] })
}
