use super::*;

fn wheel(name: &str, position_m: [f64; 2], rolling: [f64; 2]) -> Wheel {
    Wheel {
        name: name.into(),
        position_m,
        rolling,
        radius_m: 0.1,
        inertia_kg_m2: 0.02,
        rotor_inertia_kg_m2: 0.01,
    }
}

fn robot() -> Description {
    Description {
        name: "a \"b\" & <c>".into(),
        body: Body { mass_kg: 50.0, inertia_kg_m2: 3.0, centre_m: [0.05, -0.02, 0.3] },
        footprint_m: vec![[0.4, 0.3], [-0.4, 0.3], [0.0, -0.3]],
        wheels: vec![wheel("ahead", [0.3, -0.2], [2.0, 0.0]), wheel("left", [-0.3, 0.1], [0.0, 1.0])],
        wheel_speed_rad_s: 15.0,
        wheel_torque_nm: 20.0,
    }
}

#[test]
fn a_wheel_rolls_to_where_its_axis_says() {
    let text = urdf(&robot(), Names { prefix: "r1/", base: "r1/base_link" });
    assert!(text.contains("<robot name=\"a &quot;b&quot; &amp; &lt;c&gt;\">"), "{text}");
    // What rolls ahead turns about y, to the left: y × z = x.
    assert!(text.contains("<axis xyz=\"0 1 0\"/>"), "{text}");
    assert!(text.contains("<axis xyz=\"-1 0 0\"/>"), "{text}");
    assert!(text.contains("<origin xyz=\"0.3 -0.2 0.1\" rpy=\"0 0 0\"/>"), "{text}");
    assert!(text.contains("r1/ahead_joint") && text.contains("<child link=\"r1/left_link\"/>"), "{text}");
}

#[test]
fn the_parts_together_are_the_robot() {
    let mut robot = robot();
    // The second one is as heavy as the wheels may count at most.
    for heavier in [1.0, 100.0] {
        robot.wheels[1].inertia_kg_m2 *= heavier;
        let (base, wheels) = parts::parts(&robot);
        let at = robot.wheels.iter().map(|wheel| [wheel.position_m[0], wheel.position_m[1], wheel.radius_m]);
        let all: Vec<_> = wheels.iter().zip(at).chain([(&base, base.centre_m)]).collect();
        let mass_kg: f64 = all.iter().map(|(part, _)| part.mass_kg).sum();
        assert!((mass_kg - 50.0).abs() < 1e-12 && base.mass_kg > 35.0, "{base:?}");
        for (axis, centre) in robot.body.centre_m.iter().enumerate() {
            let moment: f64 = all.iter().map(|(part, at)| part.mass_kg * at[axis]).sum();
            assert!((moment / mass_kg - centre).abs() < 1e-12, "{axis}: {moment}");
        }
        let [x, y, _] = robot.body.centre_m;
        let about_centre = |part: &parts::Part, at: &[f64; 3]| {
            part.inertia_kg_m2[2] + part.mass_kg * ((at[0] - x).powi(2) + (at[1] - y).powi(2))
        };
        let inertia: f64 = all.iter().map(|(part, at)| about_centre(part, at)).sum();
        assert!((inertia - 3.0).abs() < 1e-12, "{inertia}");
        // No body has a moment above the sum of the other two.
        assert!(wheels.iter().all(|part| part.mass_kg > 0.0 && part.inertia_kg_m2[2] > 0.0), "{wheels:?}");
    }
}

#[test]
fn a_wheel_of_mjcf_lies_along_its_axis() {
    let text = mjcf(&robot());
    // What rolls ahead lies along y, half as wide as its radius.
    assert!(text.contains("fromto=\"-0 -0.025 0 0 0.025 0\""), "{text}");
    assert!(text.contains("<mujoco model=\"a &quot;b&quot; &amp; &lt;c&gt;\">"), "{text}");
    assert_eq!(text.matches("ctrlrange=\"-20 20\"").count(), 2);
    // Two corners of height for each of the footprint.
    let corners = text.split("vertex=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap();
    assert_eq!(corners.split_whitespace().count(), 2 * 3 * 3);
}
