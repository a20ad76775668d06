//! The elastic tread between wheel and floor.

use crate::contact::{Friction, Regime};

/// A tread that gives way along the floor before it slides: a spring with a damper, alike in all directions.
///
/// Its deflection is one bristle's: spring and damper in parallel, in series with the creep of
/// [`Contact`](crate::Contact) and with Coulomb's friction. What the bristle asks for above the friction limit slides.
///
/// # Where the figures come from
/// Nobody is known to have measured an omni wheel's, so a control law has to bear the whole range:
///
/// | figure | default | range | source |
/// |---|---|---|---|
/// | `stiffness_n_m` | 2e5 | 1e5 to 4e6 | R. D. Mindlin's tangential contact, `8·a·G/(2 − ν)` (K. L. Johnson, *Contact Mechanics*, 1985, section 7.2), with contact radius a = 5 mm, G = 8 MPa (80 Shore A) and ν = 0.5; 17 MPa (92 Shore A) gives 4.4e5. Above: what the default creep implies, creep stiffness over half-width of the contact, 350 N/0.025/5.2 mm = 2.7e6. Below: rollers on small pins, soft rubber |
/// | `damping_ratio` | 0.1 | 0.1 to 1 | half the loss factor near resonance; 0.2 is in the middle of what elastomers have at room temperature, filled rubbers and soft polyurethanes reach 1 and more |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tread {
    /// Force over deflection of one contact, along the floor.
    pub stiffness_n_m: f64,
    /// Damping over that which is critical for the wheel's (and rotor's) spin inertia alone on that spring.
    pub damping_ratio: f64,
}

impl Default for Tread {
    fn default() -> Self {
        Self { stiffness_n_m: 2e5, damping_ratio: 0.1 }
    }
}

/// A tread's spring and damper at one wheel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bristle {
    pub(crate) stiffness_n_m: f64,
    pub(crate) damping_n_s_m: f64,
}

/// A bristle at the start of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bent {
    pub(crate) deflection_m: f64,
    /// Slip speed.
    pub(crate) slip_m_s: f64,
    /// Slip speed by creep, per force.
    pub(crate) creep_m_s_n: f64,
}

impl Bristle {
    pub(crate) fn new(tread: &Tread, inertia_kg_m2: f64, lever_m: f64) -> Self {
        let critical_n_s_m = 2.0 * (tread.stiffness_n_m * inertia_kg_m2).sqrt() / lever_m.abs();
        Self {
            stiffness_n_m: tread.stiffness_n_m,
            // A wheel that transmits no force along its way doesn't swing on its tread.
            damping_n_s_m: if lever_m == 0.0 { 0.0 } else { tread.damping_ratio * critical_n_s_m },
        }
    }

    /// Resistance per speed of deflection, spring and damper at the middle of a step: the trapezoidal rule, which
    /// takes no energy out of the spring.
    fn middle_n_s_m(&self, step_s: f64) -> f64 {
        self.damping_n_s_m + 0.5 * self.stiffness_n_m * step_s
    }

    /// What the contact does in a step, as a line in the slip speed at its end.
    pub(crate) fn set(&self, friction: &mut Friction, bent: &Bent, step_s: f64) {
        if friction.is_idle() {
            return;
        }
        let middle = self.middle_n_s_m(step_s);
        let share = 1.0 / (1.0 + middle * bent.creep_m_s_n);
        let slope = 0.5 * middle * share;
        let constant = share * self.stiffness_n_m * bent.deflection_m + slope * bent.slip_m_s;
        friction.set_line(constant, slope);
    }

    /// Deflection after a step that ended with this slip speed.
    pub(crate) fn deflection_after_m(
        &self,
        friction: &Friction,
        bent: &Bent,
        end_m_s: f64,
        step_s: f64,
    ) -> f64 {
        let unbalanced_n = friction.resistance(end_m_s) - self.stiffness_n_m * bent.deflection_m;
        // While it slides the spring settles where friction holds it; by the trapezoidal rule it could swing about that.
        let settling_m_s = unbalanced_n / (self.damping_n_s_m + self.stiffness_n_m * step_s);
        let mean_m_s = 0.5 * (bent.slip_m_s + end_m_s);
        let rate_m_s = match friction.regime {
            _ if friction.is_idle() => settling_m_s,
            Regime::Stick => unbalanced_n / self.middle_n_s_m(step_s),
            // Friction never pulls the foot of the bristle along with it.
            Regime::Forward => settling_m_s.min(mean_m_s),
            Regime::Backward => settling_m_s.max(mean_m_s),
        };
        bent.deflection_m + step_s * rate_m_s
    }
}
