//! Layouts: where the wheels stand.

use omnibase_platform::{Wheel, layout};

use crate::config::{PlatformTable, WheelTable};
use crate::registry::{Kind, Made, Registry, all, given, needed, optional};

/// Registers the built-in layouts; each reads `wheel_radius_m`.
pub fn register(registry: &mut Registry) {
    let layouts = &mut registry.layouts;
    layouts.add(
        Kind {
            name: "bmm",
            meaning: "The Barcelona Mobile Manipulator: wheel 1 behind, wheels 2 and 3 right and left in front",
            keys: ["p1_m", "p_m"].map(needed).to_vec(),
        },
        |table| {
            Ok(layout::bmm(given(table.p1_m, "p1_m")?, given(table.p_m, "p_m")?, radius_m(table)?))
        },
    );
    let omni = [("omni3", "Three omni wheels 120° apart", 3), ("omni4", "Four omni wheels 90° apart", 4)];
    for (name, meaning, count) in omni {
        layouts.add(
            Kind {
                name,
                meaning,
                keys: vec![needed("centre_distance_m"), optional("first_wheel_angle_rad")],
            },
            move |table| {
                let distance_m = given(table.centre_distance_m, "centre_distance_m")?;
                let first_rad = table.first_wheel_angle_rad.unwrap_or(0.0);
                Ok(layout::omni(count, distance_m, radius_m(table)?, first_rad))
            },
        );
    }
    layouts.add(
        Kind {
            name: "mecanum",
            meaning: "Four mecanum wheels: front left, front right, rear left, rear right",
            keys: ["half_length_m", "half_width_m"].map(needed).to_vec(),
        },
        |table| {
            let half_length_m = given(table.half_length_m, "half_length_m")?;
            let half_width_m = given(table.half_width_m, "half_width_m")?;
            Ok(layout::mecanum4(half_length_m, half_width_m, radius_m(table)?))
        },
    );
    layouts.add(
        Kind {
            name: "wheels",
            meaning: "Wheels one by one, in the order of the drives",
            keys: vec![needed("wheel")],
        },
        |table| {
            let radius_m = radius_m(table)?;
            all(table.wheel.iter().enumerate().map(|(index, one)| wheel(one, index, radius_m)))
        },
    );
}

fn radius_m(table: &PlatformTable) -> Made<f64> {
    given(table.wheel_radius_m, "wheel_radius_m")
}

fn wheel(table: &WheelTable, index: usize, radius_m: f64) -> Made<Wheel> {
    let position_m = given(table.position_m, &format!("wheel[{index}].position_m"))?;
    let rolling_rad = given(table.rolling_angle_rad, &format!("wheel[{index}].rolling_angle_rad"))?;
    let force_rad = table.force_angle_rad.unwrap_or(rolling_rad);
    Ok(Wheel {
        name: format!("wheel_{}", index + 1),
        position_m,
        rolling_direction: [rolling_rad.cos(), rolling_rad.sin()],
        force_direction: [force_rad.cos(), force_rad.sin()],
        radius_m: table.radius_m.unwrap_or(radius_m),
    })
}
