//! What the floor carries, as far as that is known.

/// What was counted on in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TractionReport {
    /// The friction that is counted on; `None` where nothing is known of the floor: then nothing is held back.
    pub friction: Option<f64>,
    /// The part of the limits' accelerations, straight and turning, that the setpoint and every stop keep to.
    pub share: f64,
    /// By what the wheels' torques were scaled so that all of them grip; 1 as the control law wished.
    pub factor: f64,
}

impl Default for TractionReport {
    fn default() -> Self {
        TractionReport { friction: None, share: 1.0, factor: 1.0 }
    }
}

impl TractionReport {
    /// Whether a wheel would have spun.
    pub fn is_capped(&self) -> bool {
        self.factor < 1.0
    }
}
