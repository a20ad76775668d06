//! The robot as MJCF (mujoco.readthedocs.io, "XML reference").

use crate::parts::{Part, parts};
use crate::{Description, Wheel, escaped};

/// An MJCF of the robot: it slides and turns on the floor by three joints, each wheel turns by its own, with a motor.
///
/// Nothing touches the floor: what a wheel's rollers do isn't in the model.
pub fn mjcf(robot: &Description) -> String {
    let (base, wheels) = parts(robot);
    let height_m = robot.wheels.iter().map(|wheel| wheel.radius_m).fold(0.0, f64::max);
    let is_drawn = robot.footprint_m.len() >= 3 && height_m > 0.0;
    let corners = [0.5, 1.5]
        .iter()
        .flat_map(|part| robot.footprint_m.iter().map(move |[x, y]| format!("{x} {y} {}", part * height_m)));
    let corners: Vec<String> = corners.collect();
    let mut text = format!(
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n",
        escaped(&robot.name)
    );
    if is_drawn {
        text += &format!(
            "  <asset>\n    <mesh name=\"footprint\" vertex=\"{}\"/>\n  </asset>\n",
            corners.join("  ")
        );
    }
    text += "  <worldbody>\n    <light pos=\"0 0 5\"/>\n    \
             <geom name=\"floor\" type=\"plane\" size=\"5 5 0.1\" contype=\"0\" conaffinity=\"0\"/>\n    \
             <body name=\"base_link\">\n      \
             <joint name=\"odom_x\" type=\"slide\" axis=\"1 0 0\"/>\n      \
             <joint name=\"odom_y\" type=\"slide\" axis=\"0 1 0\"/>\n      \
             <joint name=\"odom_heading\" type=\"hinge\" axis=\"0 0 1\"/>\n";
    text += &format!("      {}\n", inertial(&base));
    if is_drawn {
        text += "      <geom type=\"mesh\" mesh=\"footprint\" contype=\"0\" conaffinity=\"0\" rgba=\"0.3 0.5 0.8 0.5\"/>\n";
    }
    for (wheel, part) in robot.wheels.iter().zip(&wheels) {
        text += &wheel_body(wheel, part);
    }
    text += "    </body>\n  </worldbody>\n  <actuator>\n";
    for wheel in &robot.wheels {
        let (name, most) = (escaped(&wheel.name), robot.wheel_torque_nm);
        text += &format!(
            "    <motor name=\"{name}_motor\" joint=\"{name}_joint\" ctrlrange=\"-{most} {most}\"/>\n"
        );
    }
    text + "  </actuator>\n</mujoco>\n"
}

fn inertial(part: &Part) -> String {
    let ([x, y, z], [xx, yy, zz, xy]) = (part.centre_m, part.inertia_kg_m2);
    format!(
        "<inertial pos=\"{x} {y} {z}\" mass=\"{}\" fullinertia=\"{xx} {yy} {zz} {xy} 0 0\"/>",
        part.mass_kg
    )
}

fn wheel_body(wheel: &Wheel, part: &Part) -> String {
    let (name, [x, y], radius) = (escaped(&wheel.name), wheel.position_m, wheel.radius_m);
    let ([axis_x, axis_y], half) = (wheel.axis(), radius / 4.0);
    let (end_x, end_y) = (axis_x * half, axis_y * half);
    format!(
        "      <body name=\"{name}_link\" pos=\"{x} {y} {radius}\">\n        \
         <joint name=\"{name}_joint\" type=\"hinge\" axis=\"{axis_x} {axis_y} 0\" armature=\"{}\"/>\n        {}\n        \
         <geom type=\"cylinder\" size=\"{radius}\" fromto=\"{} {} 0 {end_x} {end_y} 0\" contype=\"0\" conaffinity=\"0\"/>\n      \
         </body>\n",
        wheel.rotor_inertia_kg_m2,
        inertial(part),
        -end_x,
        -end_y
    )
}
