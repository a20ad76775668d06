//! Units of the profile's objects (IEC 61800-7-201): fixed ones, and those that the drive names by its SI unit objects.

use core::fmt;

/// SI unit position; velocity, acceleration and jerk follow it.
pub const SI_UNIT_POSITION: u16 = 0x60A8;

/// What the number of an object is a number of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectUnit {
    /// The profile says it.
    Fixed(&'static str),
    /// The drive says it in this object (0x60A8 to 0x60AB), subindex 0.
    Told(u16),
}

/// The unit of an object of the profile; `None` where it has none, or nobody says it.
pub fn unit_of(index: u16, subindex: u8) -> Option<ObjectUnit> {
    use ObjectUnit::{Fixed, Told};
    Some(match (index, subindex) {
        (0x6071 | 0x6072 | 0x6074 | 0x6077 | 0x60B2 | 0x60E0 | 0x60E1, 0) => {
            Fixed("per mille of rated torque")
        }
        (0x6073 | 0x6078, 0) => Fixed("per mille of rated current"),
        (0x6087, 0) => Fixed("per mille of rated torque per s"),
        (0x6075, 0) => Fixed("mA"),
        (0x6076, 0) => Fixed("mN·m"),
        (0x6079, 0) => Fixed("mV"),
        (0x6066 | 0x6068 | 0x606E | 0x6070, 0) => Fixed("ms"),
        (0x6063, 0) | (0x608F, 1) => Fixed("increments"),
        (0x608F, 2) | (0x6091, 1) => Fixed("revolutions of the motor"),
        (0x6091 | 0x6092, 2) => Fixed("revolutions of the shaft"),
        (0x6062 | 0x6064 | 0x6065 | 0x6067 | 0x607A | 0x607C | 0x60B0 | 0x60BA..=0x60BD | 0x60F4, 0) => {
            Told(SI_UNIT_POSITION)
        }
        (0x607B | 0x607D, 1 | 2) | (0x6092, 1) => Told(SI_UNIT_POSITION),
        (0x606B..=0x606D | 0x606F | 0x607F | 0x6081 | 0x6082 | 0x60B1 | 0x60F8 | 0x60FF, 0) => {
            Told(SI_UNIT_POSITION + 1)
        }
        (0x6099, 1 | 2) => Told(SI_UNIT_POSITION + 1),
        (0x6083..=0x6085 | 0x609A | 0x60C5 | 0x60C6, 0) => Told(SI_UNIT_POSITION + 2),
        (0x60A4, 1..=6) => Told(SI_UNIT_POSITION + 3),
        _ => return None,
    })
}

/// A unit as the SI unit objects code it: power of ten (signed), numerator, denominator, 0, from the highest byte on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SiUnit {
    power: i8,
    numerator: &'static str,
    denominator: Option<&'static str>,
}

impl SiUnit {
    /// The unit of a code; `None` where there is none, or it isn't known here.
    pub fn from_code(code: u32) -> Option<Self> {
        let [rest, denominator, numerator, power] = code.to_le_bytes();
        let denominator = match denominator {
            0 => None,
            code => Some(name(code)?),
        };
        (rest == 0).then_some(())?;
        Some(SiUnit { power: power as i8, numerator: name(numerator)?, denominator })
    }
}

fn name(code: u8) -> Option<&'static str> {
    Some(match code {
        0x01 => "m",
        0x03 => "s",
        0x04 => "A",
        0x10 => "rad",
        0x41 => "°",
        0x47 => "min",
        0x57 => "s²",
        0xA0 => "s³",
        0xB4 => "rev",
        0xB5 => "increments",
        0xC0 => "rev/min",
        _ => return None,
    })
}

impl fmt::Display for SiUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.power != 0 {
            write!(f, "10^{} ", self.power)?;
        }
        f.write_str(self.numerator)?;
        self.denominator.map_or(Ok(()), |denominator| write!(f, "/{denominator}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_the_profiles_or_the_drives_and_else_nothing() {
        assert_eq!(unit_of(0x6076, 0), Some(ObjectUnit::Fixed("mN·m")));
        assert_eq!(unit_of(0x6064, 0), Some(ObjectUnit::Told(0x60A8)));
        assert_eq!(unit_of(0x60FF, 0), Some(ObjectUnit::Told(0x60A9)));
        assert_eq!(unit_of(0x607D, 2), Some(ObjectUnit::Told(0x60A8)));
        assert_eq!(unit_of(0x607D, 0), None, "how many entries it has is no position");
        assert_eq!((unit_of(0x6041, 0), unit_of(0x2002, 1)), (None, None));
        let words = |code| SiUnit::from_code(code).map(|unit| unit.to_string());
        assert_eq!(words(0x00B4_4700).as_deref(), Some("rev/min"));
        assert_eq!(words(0xFDB4_4700).as_deref(), Some("10^-3 rev/min"));
        assert_eq!(words(0x00B5_0000).as_deref(), Some("increments"));
        assert_eq!(words(0x0041_5700).as_deref(), Some("°/s²"));
        // Nothing told, and what isn't known.
        assert_eq!(
            (words(0), words(0x00EE_0000), words(0x00B4_EE00), words(0x00B4_4701)),
            (None, None, None, None)
        );
    }
}
