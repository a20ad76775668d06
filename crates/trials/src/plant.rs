//! The machine that a robot's plan describes, with the simulator's documented defaults for all that it doesn't say.

use omnibase_platform::Wheel;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::DrivePlan;
use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    BodyParameters, Contact, MachineParameters, MotorParameters, Payload, WheelDrive, WheelParameters,
};

/// Mass of a body that the plan says nothing about, kg.
const MASS_KG: f64 = 70.0;
/// Its moment of inertia, kg·m².
const INERTIA_KG_M2: f64 = 7.0;
/// Height of the centre of mass over the floor, of a body and of a payload, m.
const HEIGHT_M: f64 = 0.3;

/// Body, wheels and motors of a plan.
pub fn machine(plan: &RobotPlan) -> MachineParameters {
    let table = &plan.simulation;
    let wheels = plan.kinematics.wheels().iter().zip(&plan.drives);
    MachineParameters {
        body: BodyParameters {
            mass_kg: table.mass_kg.unwrap_or(MASS_KG),
            yaw_inertia_kg_m2: table.inertia_kg_m2.unwrap_or(INERTIA_KG_M2),
            center_of_mass_m: table.centre_of_mass_m.unwrap_or_default(),
            center_of_mass_height_m: table.centre_of_mass_height_m.unwrap_or(HEIGHT_M),
        },
        payload: Payload {
            mass_kg: table.payload_kg.unwrap_or(0.0),
            yaw_inertia_kg_m2: table.payload_inertia_kg_m2.unwrap_or(0.0),
            position_m: table.payload_position_m.unwrap_or_default(),
            height_m: table.payload_height_m.unwrap_or(HEIGHT_M),
        },
        wheels: wheels.map(|(wheel, drive)| wheel_drive(plan, wheel, drive)).collect(),
        step_ns: table.step_us.map_or(DEFAULT_STEP_NS, |step_us| step_us * 1000),
    }
}

fn wheel_drive(plan: &RobotPlan, wheel: &Wheel, drive: &DrivePlan) -> WheelDrive {
    let table = &plan.simulation;
    let floor = Contact::default();
    let contact = Contact {
        static_friction: table.static_friction.unwrap_or(floor.static_friction),
        sliding_friction: table.sliding_friction.unwrap_or(floor.sliding_friction),
        rolling_resistance: table.rolling_resistance.unwrap_or(floor.rolling_resistance),
        roller_resistance: table.roller_resistance.unwrap_or(floor.roller_resistance),
        creep: table.creep.unwrap_or(floor.creep),
    };
    let usual = WheelParameters::mecanum(
        wheel.position_m,
        wheel.rolling_direction,
        wheel.force_direction,
        wheel.radius_m,
    );
    let motor = MotorParameters::default();
    WheelDrive {
        wheel: WheelParameters {
            inertia_kg_m2: table.wheel_inertia_kg_m2.unwrap_or(usual.inertia_kg_m2),
            contact,
            ..usual
        },
        motor: MotorParameters {
            rated_torque_n_m: drive.scale.rated_torque_nm,
            peak_torque_n_m: table.motor_torque_limit_nm.unwrap_or(drive.scale.peak_torque_nm),
            rotor_inertia_kg_m2: table.rotor_inertia_kg_m2.unwrap_or(motor.rotor_inertia_kg_m2),
            rated_speed_rad_s: table.motor_rated_speed_rad_s.unwrap_or(motor.rated_speed_rad_s),
            maximum_speed_rad_s: table.motor_greatest_speed_rad_s.unwrap_or(motor.maximum_speed_rad_s),
            heating_time_constant_s: table.heating_time_constant_s.unwrap_or(motor.heating_time_constant_s),
            gear_ratio: drive.scale.gear_ratio,
            ..motor
        },
    }
}
