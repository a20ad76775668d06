//! What a robot's file says of its body and its wheels, for other programs.

use omnibase_description::{Body, Description, Wheel};
use omnibase_robot::RobotPlan;

use crate::simulated;

/// The robot as it is simulated: with its payload, and with the documented default for what its file doesn't say.
pub fn description(plan: &RobotPlan) -> Description {
    let machine = simulated::description(plan).machine;
    let drives = machine.wheels.iter().zip(&plan.drives);
    let wheels = drives.map(|(simulated, drive)| Wheel {
        name: drive.name.clone(),
        position_m: simulated.wheel.position_m,
        rolling: simulated.wheel.rolling_direction,
        radius_m: simulated.wheel.radius_m,
        inertia_kg_m2: simulated.wheel.inertia_kg_m2,
        rotor_inertia_kg_m2: simulated.motor.rotor_inertia_kg_m2 * simulated.motor.gear_ratio.powi(2),
    });
    let (body, payload) = (machine.body, machine.payload);
    let mass_kg = body.mass_kg + payload.mass_kg;
    let at = |[x, y]: [f64; 2], z| [x, y, z];
    let places =
        [at(body.center_of_mass_m, body.center_of_mass_height_m), at(payload.position_m, payload.height_m)];
    let centre = |axis: usize| (body.mass_kg * places[0][axis] + payload.mass_kg * places[1][axis]) / mass_kg;
    // Two masses apart turn about the centre of both as their reduced mass does about either.
    let apart_m2 = (places[0][0] - places[1][0]).powi(2) + (places[0][1] - places[1][1]).powi(2);
    let apart_kg_m2 = body.mass_kg * payload.mass_kg / mass_kg * apart_m2;
    Description {
        name: plan.name.clone(),
        body: Body {
            mass_kg,
            inertia_kg_m2: body.yaw_inertia_kg_m2 + payload.yaw_inertia_kg_m2 + apart_kg_m2,
            centre_m: [centre(0), centre(1), centre(2)],
        },
        footprint_m: plan.guard.footprint_m.clone(),
        wheels: wheels.collect(),
        wheel_speed_rad_s: plan.limits.wheel_speed_rad_s,
        wheel_torque_nm: plan.limits.wheel_torque_nm,
    }
}
