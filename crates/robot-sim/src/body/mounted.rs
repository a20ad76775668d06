//! A wheel on its body, in the form that a step needs.

use crate::contact::{self, Regime, STICTION_M_S, STICTION_RAD_S};
use crate::floor::{Holds, Surface};
use crate::tread::{Bent, Bristle};
use crate::wheel::WheelParameters;

/// A wheel's parameters in the form that a step needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mounted {
    pub(super) position_m: [f64; 2],
    pub(super) inertia: f64,
    pub(super) viscous: f64,
    pub(super) coulomb: f64,
    /// Of a closed brake.
    pub(super) brake: f64,
    pub(super) rolling: f64,
    /// Of the rollers on a floor that holds them.
    pub(super) roller: f64,
    /// On such a floor.
    pub(super) holds: Holds,
    pub(super) creep: f64,
    pub(super) bristle: Option<Bristle>,
    /// An elastic tread at the start of the step, along and across.
    pub(super) bent: [Bent; 2],
}

impl Mounted {
    pub(super) fn of(wheel: &WheelParameters, row: &contact::Wheel) -> Self {
        let contact = &wheel.contact;
        let roller = contact.roller_resistance;
        let surface =
            Surface { static_friction: contact.static_friction, sliding_friction: contact.sliding_friction };
        Self {
            position_m: wheel.position_m,
            inertia: wheel.inertia_kg_m2,
            viscous: wheel.bearing_viscous_n_m_s,
            coulomb: wheel.bearing_coulomb_n_m,
            brake: 0.0,
            rolling: contact.rolling_resistance * wheel.radius_m,
            roller,
            holds: surface.holds(roller),
            creep: contact.creep,
            bristle: contact.tread.map(|tread| Bristle::new(&tread, wheel.inertia_kg_m2, row.arm_along)),
            bent: Default::default(),
        }
    }
}

fn unit(direction: [f64; 2]) -> [f64; 2] {
    let length = direction[0].hypot(direction[1]);
    [direction[0] / length, direction[1] / length]
}

pub(super) fn row_of(wheel: &WheelParameters) -> contact::Wheel {
    let rolling = unit(wheel.rolling_direction);
    let along = unit(wheel.force_direction);
    let across = [-along[1], along[0]];
    contact::Wheel {
        along: [along[0], along[1], 0.0],
        arm_along: wheel.radius_m * (along[0] * rolling[0] + along[1] * rolling[1]),
        is_elastic: wheel.contact.tread.is_some(),
        across: [across[0], across[1], 0.0],
        arm_across: wheel.radius_m * (across[0] * rolling[0] + across[1] * rolling[1]),
        ..contact::Wheel::default()
    }
}

/// Speed at which a wheel's hub travels.
fn travel_m_s(row: &contact::Wheel, velocity: &[f64; 3]) -> f64 {
    let (hub_a, hub_t) = (contact::dot(&row.along, velocity), contact::dot(&row.across, velocity));
    (hub_a * hub_a + hub_t * hub_t).sqrt()
}

/// Friction limits of a wheel under its load, and how far its tread creeps at the speed at which it travels, which it returns, m/s.
pub(super) fn prepare(
    row: &mut contact::Wheel,
    mounted: &Mounted,
    holds: &Holds,
    load_n: f64,
    velocity: &[f64; 3],
) -> f64 {
    let along = holds.along[usize::from(row.grip.regime != Regime::Stick)];
    let travel = travel_m_s(row, velocity);
    row.grip.set(along * load_n, STICTION_M_S + mounted.creep * along * travel);
    row.roller.set(holds.roller * load_n, STICTION_M_S);
    row.axle.set(mounted.coulomb + mounted.brake + mounted.rolling * load_n, STICTION_RAD_S);
    travel
}
