//! What a machine must be to be simulated.

use super::{BodyParameters, Payload, Total};
use crate::floor::{Floor, GRAVITY_M_S2, Slope, Surface};
use crate::load::LoadShare;
use crate::wheel::WheelParameters;

/// A machine that can't be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A figure outside of what has a meaning.
    #[error("{part}: {parameter} is {value}; it must be {must}")]
    Parameter {
        /// What it belongs to: the body, the payload, or a wheel by number, counted from 1.
        part: String,
        /// The field.
        parameter: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        must: &'static str,
    },
    /// The wheels stand on one line (or there are fewer than three).
    #[error("the {wheels} wheels stand on one line: the body would fall over")]
    NoSupport {
        /// How many wheels there are.
        wheels: usize,
    },
    /// The weight lies outside of the wheels.
    #[error(
        "wheel {wheel} would carry {load_n:.1} N: the centre of mass ({x_m:.3}, {y_m:.3}) m is outside of the wheels"
    )]
    TipsOver {
        /// The wheel that would lift, counted from 1.
        wheel: usize,
        /// Its load.
        load_n: f64,
        /// Centre of mass in `base_link`.
        x_m: f64,
        /// Centre of mass in `base_link`.
        y_m: f64,
    },
    /// The slope is so steep that the robot falls over.
    #[error("wheel {wheel} would lift on a slope of {angle_rad} rad: the centre of mass is too high")]
    FallsOver {
        /// The wheel that would lift, counted from 1.
        wheel: usize,
        /// The slope.
        angle_rad: f64,
    },
}

/// What a figure must be, in words and as a test.
#[derive(Clone, Copy)]
enum Must {
    BePositive,
    NotBeNegative,
    BeFinite,
}

fn check(part: &dyn Fn() -> String, must: Must, figures: &[(&'static str, f64)]) -> Result<(), BodyError> {
    for &(parameter, value) in figures {
        let (holds, must) = match must {
            Must::BePositive => (value > 0.0, "positive"),
            Must::NotBeNegative => (value >= 0.0, "zero or positive"),
            Must::BeFinite => (true, "a finite number"),
        };
        if !holds || !value.is_finite() {
            return Err(BodyError::Parameter { part: part(), parameter, value, must });
        }
    }
    Ok(())
}

pub(super) fn check_body(body: &BodyParameters) -> Result<(), BodyError> {
    let part = || "body".to_owned();
    check(
        &part,
        Must::BePositive,
        &[("mass_kg", body.mass_kg), ("yaw_inertia_kg_m2", body.yaw_inertia_kg_m2)],
    )?;
    check(&part, Must::NotBeNegative, &[("center_of_mass_height_m", body.center_of_mass_height_m)])?;
    let [x, y] = body.center_of_mass_m;
    check(&part, Must::BeFinite, &[("center_of_mass_m x", x), ("center_of_mass_m y", y)])
}

pub(super) fn check_payload(payload: &Payload) -> Result<(), BodyError> {
    let part = || "payload".to_owned();
    let figures = [
        ("mass_kg", payload.mass_kg),
        ("yaw_inertia_kg_m2", payload.yaw_inertia_kg_m2),
        ("height_m", payload.height_m),
    ];
    check(&part, Must::NotBeNegative, &figures)?;
    let [x, y] = payload.position_m;
    check(&part, Must::BeFinite, &[("position_m x", x), ("position_m y", y)])
}

pub(super) fn check_wheel(index: usize, wheel: &WheelParameters) -> Result<(), BodyError> {
    let part = || format!("wheel {}", index + 1);
    let contact = &wheel.contact;
    let length = |d: [f64; 2]| d[0].hypot(d[1]);
    let positive = [
        ("radius_m", wheel.radius_m),
        ("inertia_kg_m2", wheel.inertia_kg_m2),
        ("length of rolling_direction", length(wheel.rolling_direction)),
        ("length of force_direction", length(wheel.force_direction)),
    ];
    check(&part, Must::BePositive, &positive)?;
    let not_negative = [
        ("bearing_coulomb_n_m", wheel.bearing_coulomb_n_m),
        ("bearing_viscous_n_m_s", wheel.bearing_viscous_n_m_s),
        ("contact static_friction", contact.static_friction),
        ("contact sliding_friction", contact.sliding_friction),
        ("contact rolling_resistance", contact.rolling_resistance),
        ("contact roller_resistance", contact.roller_resistance),
        ("contact creep", contact.creep),
    ];
    check(&part, Must::NotBeNegative, &not_negative)?;
    if let Some(tread) = &contact.tread {
        check(&part, Must::BePositive, &[("tread stiffness_n_m", tread.stiffness_n_m)])?;
        check(&part, Must::NotBeNegative, &[("tread damping_ratio", tread.damping_ratio)])?;
    }
    let [x, y] = wheel.position_m;
    check(&part, Must::BeFinite, &[("position_m x", x), ("position_m y", y)])?;
    let ordered = |parameter, value, limit: f64, must| {
        if value <= limit {
            Ok(())
        } else {
            Err(BodyError::Parameter { part: part(), parameter, value, must })
        }
    };
    ordered(
        "contact sliding_friction",
        contact.sliding_friction,
        contact.static_friction,
        "at most static_friction",
    )?;
    ordered(
        "contact roller_resistance",
        contact.roller_resistance,
        contact.sliding_friction,
        "at most sliding_friction",
    )
}

pub(super) fn check_floor(floor: &Floor) -> Result<(), BodyError> {
    let Slope { angle_rad, downhill_rad } = floor.slope;
    let part = || "floor".to_owned();
    check(&part, Must::BeFinite, &[("slope downhill_rad", downhill_rad)])?;
    if !(0.0..1.5).contains(&angle_rad) {
        let must = "zero or positive, and below 1.5";
        return Err(BodyError::Parameter {
            part: part(),
            parameter: "slope angle_rad",
            value: angle_rad,
            must,
        });
    }
    for (i, patch) in floor.patches.iter().enumerate() {
        check_surface(&|| format!("patch {}", i + 1), &patch.surface)?;
    }
    Ok(())
}

pub(super) fn check_surface(part: &dyn Fn() -> String, surface: &Surface) -> Result<(), BodyError> {
    let Surface { static_friction, sliding_friction } = *surface;
    let figures = [("static_friction", static_friction), ("sliding_friction", sliding_friction)];
    check(part, Must::NotBeNegative, &figures)?;
    if sliding_friction <= static_friction {
        return Ok(());
    }
    let (parameter, must) = ("sliding_friction", "at most static_friction");
    Err(BodyError::Parameter { part: part(), parameter, value: sliding_friction, must })
}

/// Whether all wheels stay on a slope, whichever way the body stands on it.
pub(super) fn check_slope(share: &LoadShare, slope: &Slope) -> Result<(), BodyError> {
    let (sin, cos) = slope.angle_rad.sin_cos();
    for (i, load_n) in share.static_n.iter().enumerate() {
        let shift_n = GRAVITY_M_S2 * sin * share.per_ax_n[i].hypot(share.per_ay_n[i]);
        if load_n * cos <= shift_n {
            return Err(BodyError::FallsOver { wheel: i + 1, angle_rad: slope.angle_rad });
        }
    }
    Ok(())
}

pub(super) fn check_support(share: &LoadShare, total: &Total) -> Result<(), BodyError> {
    for (i, &load_n) in share.static_n.iter().enumerate() {
        if load_n.is_nan() || load_n <= 0.0 {
            let [x_m, y_m] = total.carried.center_m;
            return Err(BodyError::TipsOver { wheel: i + 1, load_n, x_m, y_m });
        }
    }
    Ok(())
}
