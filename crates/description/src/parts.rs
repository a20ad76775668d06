//! Base and wheels, each with its mass and inertia; together they have what is known of the whole robot.
//!
//! Of a wheel the moment of inertia about its axis is known, not its mass: it counts as a disc, as long as the wheels together
//! are no more than a quarter of mass and inertia. What no file tells, the base's moments about its horizontal axes, counts
//! like the one about the vertical axis: driving on a floor never asks for it.

use crate::Description;

/// One link's mass and inertia.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Its centre of mass in its link's frame, m.
    pub centre_m: [f64; 3],
    /// Moments about the axes of its frame through its centre of mass: xx, yy, zz, xy, kg·m²; the others are 0.
    pub inertia_kg_m2: [f64; 4],
}

/// The base, and each wheel in the frame of its link: base_link's directions, at the wheel's centre.
pub fn parts(robot: &Description) -> (Part, Vec<Part>) {
    let body = &robot.body;
    let share = 0.25 / robot.wheels.len().max(1) as f64;
    let [x, y, z] = body.centre_m;
    let from_centre = |[at_x, at_y]: [f64; 2]| (at_x - x).powi(2) + (at_y - y).powi(2);
    let (mut mass_kg, mut moment) = (body.mass_kg, [x, y, z].map(|centre| body.mass_kg * centre));
    let mut inertia_kg_m2 = body.inertia_kg_m2;
    let mut wheels = Vec::with_capacity(robot.wheels.len());
    for wheel in &robot.wheels {
        let distance_m2 = from_centre(wheel.position_m).max(f64::MIN_POSITIVE);
        let disc_kg = 2.0 * wheel.inertia_kg_m2 / wheel.radius_m.powi(2);
        let wheel_kg = disc_kg.min(share * body.mass_kg).min(share * body.inertia_kg_m2 / distance_m2);
        // Of a disc half as wide as its radius, about its diameter: m r²/4 + m (r/2)²/12, where m r²/2 is known.
        let across = wheel.inertia_kg_m2 * 13.0 / 24.0;
        let ([axis_x, axis_y], more) = (wheel.axis(), wheel.inertia_kg_m2 - across);
        let moments = [across + more * axis_x * axis_x, across + more * axis_y * axis_y, across];
        wheels.push(Part {
            mass_kg: wheel_kg,
            centre_m: [0.0; 3],
            inertia_kg_m2: [moments[0], moments[1], moments[2], more * axis_x * axis_y],
        });
        mass_kg -= wheel_kg;
        inertia_kg_m2 -= wheel_kg * distance_m2 + across;
        let at = [wheel.position_m[0], wheel.position_m[1], wheel.radius_m];
        for (moment, at) in moment.iter_mut().zip(at) {
            *moment -= wheel_kg * at;
        }
    }
    let centre_m = moment.map(|moment| moment / mass_kg);
    inertia_kg_m2 -= mass_kg * from_centre([centre_m[0], centre_m[1]]);
    let base = Part { mass_kg, centre_m, inertia_kg_m2: [inertia_kg_m2, inertia_kg_m2, inertia_kg_m2, 0.0] };
    (base, wheels)
}
