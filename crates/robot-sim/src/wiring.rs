//! Cables that a person may have connected wrongly: which motor a drive turns, and which way round.

/// What hangs on a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The wheel whose motor and encoder it is.
    pub wheel: usize,
    /// Its motor turns against what it is told.
    pub turns_motor: bool,
    /// Its encoder counts against the motor's turning.
    pub turns_encoder: bool,
}

impl Wire {
    /// The right one for a wheel.
    pub fn straight(wheel: usize) -> Self {
        Wire { wheel, turns_motor: false, turns_encoder: false }
    }

    pub(crate) fn motor_sign(self) -> f64 {
        if self.turns_motor { -1.0 } else { 1.0 }
    }

    pub(crate) fn encoder_sign(self) -> f64 {
        if self.turns_encoder { -1.0 } else { 1.0 }
    }
}

/// One wire for each wheel; `None` where they don't belong together one to one.
pub(crate) fn complete(wires: &[Wire], wheels: usize) -> Option<Vec<Wire>> {
    if wires.is_empty() {
        return Some((0..wheels).map(Wire::straight).collect());
    }
    let is_reached = |wheel: usize| wires.iter().any(|wire| wire.wheel == wheel);
    (wires.len() == wheels && (0..wheels).all(is_reached)).then(|| wires.to_vec())
}
