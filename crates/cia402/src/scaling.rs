//! Between a drive's units and SI: encoder counts and radians, tenths of a percent and N·m.

use core::f64::consts::TAU;

/// A position as the drive reports it: 32 bits that wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PositionCounts(pub i32);

impl PositionCounts {
    /// How far the encoder turned since `earlier`, in counts, across the wrap.
    ///
    /// Exact as long as less than half the range (2^31 counts) lies between the two.
    pub const fn since(self, earlier: PositionCounts) -> i32 {
        self.0.wrapping_sub(earlier.0)
    }

    /// This position moved by `counts`, across the wrap.
    #[must_use]
    pub const fn moved_by(self, counts: i32) -> PositionCounts {
        PositionCounts(self.0.wrapping_add(counts))
    }
}

/// Why a scale was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ScaleError {
    /// A resolution of zero.
    #[error("encoder resolution: expected at least 1 count per revolution, found 0")]
    NoCounts,
    /// A rated torque that is no positive number.
    #[error("rated torque: expected a positive number of N·m, found {0}")]
    RatedTorque(f64),
}

/// How many counts an encoder has per revolution of its shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderScale {
    rad_per_count: f64,
    counts_per_rad: f64,
}

impl EncoderScale {
    /// 20 bits, the encoder of the SGDV's motors.
    pub const COUNTS_PER_REVOLUTION_20_BIT: u32 = 1_048_576;

    /// The scale of an encoder with so many counts per revolution.
    pub fn new(counts_per_revolution: u32) -> Result<EncoderScale, ScaleError> {
        if counts_per_revolution == 0 {
            return Err(ScaleError::NoCounts);
        }
        let counts = f64::from(counts_per_revolution);
        Ok(EncoderScale { rad_per_count: TAU / counts, counts_per_rad: counts / TAU })
    }

    /// Counts (or counts per second) as radians (or radians per second).
    pub fn rad(&self, counts: f64) -> f64 {
        counts * self.rad_per_count
    }

    /// Radians (or radians per second) as counts (or counts per second), unrounded.
    pub fn counts(&self, rad: f64) -> f64 {
        rad * self.counts_per_rad
    }
}

/// A torque in tenths of a percent of the motor's rated torque, as 0x6071 and 0x6077 carry it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TorquePerMille(pub i16);

/// The rated torque by which per mille become N·m (object 0x6076 holds it in mN·m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueScale {
    rated_torque_nm: f64,
}

impl TorqueScale {
    /// The scale of a motor with this rated torque, in N·m.
    pub fn new(rated_torque_nm: f64) -> Result<TorqueScale, ScaleError> {
        if rated_torque_nm.is_finite() && rated_torque_nm > 0.0 {
            Ok(TorqueScale { rated_torque_nm })
        } else {
            Err(ScaleError::RatedTorque(rated_torque_nm))
        }
    }

    /// The motor's rated torque in N·m.
    pub fn rated_torque_nm(&self) -> f64 {
        self.rated_torque_nm
    }

    /// A torque in N·m.
    pub fn torque_nm(&self, torque: TorquePerMille) -> f64 {
        f64::from(torque.0) * self.rated_torque_nm / 1000.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_turn_is_two_pi() {
        let scale = EncoderScale::new(EncoderScale::COUNTS_PER_REVOLUTION_20_BIT).unwrap();
        assert_eq!(scale.rad(1_048_576.0), TAU);
        assert_eq!(scale.counts(TAU), 1_048_576.0);
        assert_eq!(EncoderScale::new(0), Err(ScaleError::NoCounts));
    }

    #[test]
    fn increments_cross_the_wrap_both_ways() {
        let (top, bottom) = (PositionCounts(i32::MAX), PositionCounts(i32::MIN));
        assert_eq!(bottom.since(top), 1);
        assert_eq!(top.since(bottom), -1);
        assert_eq!(top.moved_by(3).since(top), 3);
    }

    #[test]
    fn torque_is_a_tenth_of_a_percent_of_rated() {
        let scale = TorqueScale::new(7.0).unwrap();
        assert_eq!(scale.torque_nm(TorquePerMille(3000)), 21.0);
        for wrong in [0.0, -7.0, f64::NAN, f64::INFINITY] {
            assert!(TorqueScale::new(wrong).is_err(), "{wrong}");
        }
    }
}
