//! How treads that creep share out what wheels contradict each other by, and what they slip of themselves.
//!
//! Wheels that say different things are believed by how much their treads resist ([`Treads`]). The forces that treads pass on
//! accelerate the platform, a disc that reaches out to its wheels with its centre of mass over the origin of base, and they
//! overcome the resistance of rollers, a share of their loads. All of that is in proportion to the mass, so that no mass is needed.

use nalgebra::Vector3;
use omnibase_platform::tread::resistance;
use omnibase_platform::{Kinematics, PerWheel, Treads, Twist2, Wrench2};

use crate::dataset::Run;

const GRAVITY_M_S2: f64 = 9.806_65;
/// Speed over the floor at which a roller's resistance is 0.7 of its whole, m/s: the sign of a speed about zero is noise.
const ROLLERS_TURN_M_S: f64 = 1e-3;
/// Speeds are compared over so long for an acceleration, s.
const GAIN_OVER_S: f64 = 0.04;

/// A hub that is slower counts as this fast, m/s: one that stands would be believed without end.
const HUBS_STAND_M_S: f64 = 1e-6;

/// What treads make of a step of a run.
#[derive(Clone, Copy, Debug)]
pub struct Tread {
    /// How much each wheel is believed where they contradict each other.
    pub weights: PerWheel,
    /// What the platform's way lacks per unit of creep: x, y in m and the turn in rad, along base.
    pub lacking: Vector3<f64>,
}

/// For each step of a run what treads make of it.
pub fn treads(run: &Run, kinematics: &Kinematics, roller_resistance: f64) -> Vec<Tread> {
    let wheels = kinematics.wheels();
    let treads = Treads::new(wheels);
    let loads_m_s2 = treads.load_shares().map(|share| share * GRAVITY_M_S2);
    let squares = wheels.iter().map(|wheel| wheel.position_m[0].powi(2) + wheel.position_m[1].powi(2));
    let gyration_m2 = 0.5 * squares.sum::<f64>() / wheels.len() as f64;
    let mut before_s = run.begin_s;
    let moved: Vec<(f64, f64, Twist2)> = run
        .steps
        .iter()
        .map(|step| {
            let period_s = step.end_s - before_s;
            let middle_s = 0.5 * (step.end_s + before_s);
            before_s = step.end_s;
            let speeds = step.turned_rad.map(|angle| angle / period_s);
            (middle_s, period_s, kinematics.twist(&speeds).twist_in_base)
        })
        .collect();
    let (mut first, mut last) = (0, 0);
    let tread = |(number, &(middle_s, period_s, twist)): (usize, &(f64, f64, Twist2))| {
        while moved[first].0 < middle_s - 0.5 * GAIN_OVER_S && first < number {
            first += 1;
        }
        while last + 1 < moved.len() && (moved[last].0 < middle_s + 0.5 * GAIN_OVER_S || last < number) {
            last += 1;
        }
        let (from, to) = (&moved[first], &moved[last]);
        let per_s = if to.0 > from.0 { 1.0 / (to.0 - from.0) } else { 0.0 };
        let Twist2 { vx_m_s, vy_m_s, w_rad_s } = twist;
        // In axes that don't turn; the forces of unit mass over the step.
        let gained = [
            (to.2.vx_m_s - from.2.vx_m_s) * per_s - w_rad_s * vy_m_s,
            (to.2.vy_m_s - from.2.vy_m_s) * per_s + w_rad_s * vx_m_s,
            (to.2.w_rad_s - from.2.w_rad_s) * per_s,
        ];
        let mut wrench = Wrench2::new(gained[0], gained[1], gyration_m2 * gained[2]);
        for (at, (wheel, row)) in wheels.iter().zip(kinematics.matrix()).enumerate() {
            let [x_m, y_m] = wheel.position_m;
            let ([ux, uy], [ax, ay]) = (wheel.rolling_direction, wheel.force_direction);
            let (u_size, a_size) = (ux.hypot(uy), ax.hypot(ay));
            let across = [-ay / a_size, ax / a_size];
            let rolled_m_s = (row[0] * vx_m_s + row[1] * vy_m_s + row[2] * w_rad_s) / u_size;
            let over_m_s = across[0] * (vx_m_s - w_rad_s * y_m - ux * rolled_m_s)
                + across[1] * (vy_m_s + w_rad_s * x_m - uy * rolled_m_s);
            let resisted = roller_resistance * loads_m_s2[at] * over_m_s / over_m_s.hypot(ROLLERS_TURN_M_S);
            wrench.fx_n += resisted * across[0];
            wrench.fy_n += resisted * across[1];
            wrench.torque_nm += resisted * (x_m * across[1] - y_m * across[0]);
        }
        let weights = treads
            .resistances([vx_m_s, vy_m_s, w_rad_s], HUBS_STAND_M_S)
            .map(|resists| GRAVITY_M_S2 * resists);
        let wrench = Vector3::new(wrench.fx_n, wrench.fy_n, wrench.torque_nm);
        let resists = resistance(kinematics.matrix(), &weights);
        let lacking = resists.try_inverse().map_or_else(Vector3::zeros, |gives| gives * wrench * period_s);
        Tread { weights, lacking }
    };
    moved.iter().enumerate().map(tread).collect()
}
