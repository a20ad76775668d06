//! The robot as URDF (wiki.ros.org/urdf/XML).

use crate::parts::{Part, parts};
use crate::{Description, Wheel, escaped};

/// What links and joints are called.
#[derive(Clone, Copy, Debug)]
pub struct Names<'a> {
    /// Stands before the name of each wheel's link and joint.
    pub prefix: &'a str,
    /// The base's link.
    pub base: &'a str,
}

impl Default for Names<'_> {
    fn default() -> Self {
        Names { prefix: "", base: "base_link" }
    }
}

/// A URDF of the robot: a joint turns each wheel about its axis. Rollers don't exist in URDF.
pub fn urdf(robot: &Description, names: Names<'_>) -> String {
    let (base, wheels) = parts(robot);
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(&robot.name));
    let (prefix, base_link) = (escaped(names.prefix), escaped(names.base));
    let outline: Vec<String> = robot.footprint_m.iter().map(|[x, y]| format!("{x} {y}")).collect();
    text += &format!("  <!-- footprint in base_link, m: {} -->\n", outline.join(", "));
    text += &format!("  <link name=\"{base_link}\">\n{}{}  </link>\n", inertial(&base), slab(robot));
    for (wheel, part) in robot.wheels.iter().zip(&wheels) {
        text += &joint(robot, wheel, part, Names { prefix: &prefix, base: &base_link });
    }
    text + "</robot>\n"
}

fn inertial(part: &Part) -> String {
    let ([x, y, z], [xx, yy, zz, xy]) = (part.centre_m, part.inertia_kg_m2);
    format!(
        "    <inertial>\n      <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>\n      <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"0\" iyy=\"{yy}\" iyz=\"0\" izz=\"{zz}\"/>\n    </inertial>\n",
        part.mass_kg
    )
}

/// The rectangle around the footprint, as thick as a wheel's radius, at the wheels' centres; nothing without a footprint.
fn slab(robot: &Description) -> String {
    let along = |axis: usize| {
        let values = robot.footprint_m.iter().map(move |corner| corner[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let ((x_min, x_max), (y_min, y_max)) = (along(0), along(1));
    let height_m = robot.wheels.iter().map(|wheel| wheel.radius_m).fold(0.0, f64::max);
    if x_max <= x_min || y_max <= y_min || height_m <= 0.0 {
        return String::new();
    }
    format!(
        "    <visual>\n      <origin xyz=\"{} {} {height_m}\" rpy=\"0 0 0\"/>\n      <geometry><box size=\"{} {} {height_m}\"/></geometry>\n    </visual>\n",
        (x_min + x_max) / 2.0,
        (y_min + y_max) / 2.0,
        x_max - x_min,
        y_max - y_min
    )
}

fn joint(robot: &Description, wheel: &Wheel, part: &Part, escaped_names: Names<'_>) -> String {
    let Names { prefix, base } = escaped_names;
    let name = format!("{prefix}{}", escaped(&wheel.name));
    let ([x, y], [axis_x, axis_y], radius) = (wheel.position_m, wheel.axis(), wheel.radius_m);
    // A cylinder lies along z: rolled about x it lies along y, turned about z along the axis.
    let heading = (-axis_x).atan2(axis_y);
    let visual = format!(
        "    <visual>\n      <origin xyz=\"0 0 0\" rpy=\"{} 0 {heading}\"/>\n      \
         <geometry><cylinder radius=\"{radius}\" length=\"{}\"/></geometry>\n    </visual>\n",
        std::f64::consts::FRAC_PI_2,
        radius / 2.0
    );
    format!(
        "  <link name=\"{name}_link\">\n{}{visual}  </link>\n  <joint name=\"{name}_joint\" type=\"continuous\">\n    \
         <parent link=\"{base}\"/>\n    <child link=\"{name}_link\"/>\n    <origin xyz=\"{x} {y} {radius}\" rpy=\"0 0 0\"/>\n    \
         <axis xyz=\"{axis_x} {axis_y} 0\"/>\n    <limit velocity=\"{}\" effort=\"{}\"/>\n  </joint>\n",
        inertial(part),
        robot.wheel_speed_rad_s,
        robot.wheel_torque_nm
    )
}
