//! The robot as URDF: its platform and wheels, as true as a URDF can say them.

use crate::robot::{Facts, Wheel};

/// A URDF of the robot. `base_link` lies on the floor where the pose counts from; a wheel turns about its axis. Rollers don't exist in URDF.
pub fn urdf(facts: &Facts, prefix: &str, base_frame: &str) -> String {
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(&facts.name));
    let base = escaped(base_frame);
    let outline: Vec<String> = facts.footprint.iter().map(|[x, y]| format!("{x} {y}")).collect();
    text +=
        &format!("  <!-- footprint in {base}, m: {} -->\n  <link name=\"{base}\"/>\n", outline.join(", "));
    for wheel in &facts.wheels {
        text += &wheel_of(wheel, &escaped(prefix), &base, facts);
    }
    text + "</robot>\n"
}

fn wheel_of(wheel: &Wheel, prefix: &str, base: &str, facts: &Facts) -> String {
    let name = format!("{prefix}{}", escaped(&wheel.name));
    let ([x, y], [along_x, along_y], radius) = (wheel.position_m, wheel.rolling, wheel.radius_m);
    let length = along_x.hypot(along_y);
    // Turning about it, the wheel rolls to where axis × up points.
    let (axis_x, axis_y) = (-along_y / length, along_x / length);
    let heading = along_y.atan2(along_x);
    let visual = format!(
        "<visual>\n      <origin xyz=\"0 0 0\" rpy=\"{} 0 {heading}\"/>\n      <geometry><cylinder radius=\"{radius}\" length=\"{}\"/></geometry>\n    </visual>",
        std::f64::consts::FRAC_PI_2,
        radius / 2.0
    );
    format!(
        "  <link name=\"{name}_link\">\n    {visual}\n  </link>\n  <joint name=\"{name}_joint\" type=\"continuous\">\n    \
         <parent link=\"{base}\"/>\n    <child link=\"{name}_link\"/>\n    <origin xyz=\"{x} {y} {radius}\" rpy=\"0 0 0\"/>\n    \
         <axis xyz=\"{axis_x} {axis_y} 0\"/>\n    <limit velocity=\"{}\" effort=\"{}\"/>\n  </joint>\n",
        facts.limits.wheel_speed_rad_s, facts.limits.wheel_torque_nm
    )
}

/// A text as an attribute of XML may hold it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Limits;

    #[test]
    fn a_wheel_rolls_to_where_its_axis_says() {
        let wheel = |name: &str, rolling| Wheel {
            name: name.into(),
            position_m: [0.3, -0.2],
            rolling,
            radius_m: 0.1,
        };
        let facts = Facts {
            name: "a \"b\" & <c>".into(),
            simulated: true,
            wheels: vec![wheel("ahead", [2.0, 0.0]), wheel("left", [0.0, 1.0])],
            footprint: vec![[0.4, 0.3], [-0.4, 0.3]],
            columns: vec![],
            limits: Limits {
                speed_m_s: 1.0,
                turn_speed_rad_s: 1.0,
                wheel_speed_rad_s: 15.0,
                wheel_torque_nm: 20.0,
            },
        };
        let text = urdf(&facts, "r1/", "r1/base_link");
        assert!(text.contains("<robot name=\"a &quot;b&quot; &amp; &lt;c&gt;\">"), "{text}");
        // What rolls ahead turns about y, to the left: y × z = x.
        assert!(text.contains("<axis xyz=\"-0 1 0\"/>"), "{text}");
        assert!(text.contains("<axis xyz=\"-1 0 0\"/>"), "{text}");
        assert!(text.contains("<origin xyz=\"0.3 -0.2 0.1\" rpy=\"0 0 0\"/>"), "{text}");
        assert!(text.contains("r1/ahead_joint") && text.contains("<child link=\"r1/left_link\"/>"), "{text}");
    }
}
