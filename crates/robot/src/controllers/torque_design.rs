//! The gains of a law of torque for a robot: designed by what its file says of treads, wheels and delay, or given and checked.

use crate::config::{ControllerTable, ESTIMATE_BOUNDS, Problem, RobotPlan, wheel_kg};
use crate::estimators::SPEED_FILTER_RAD_S;
use crate::registry::{Made, StageError, given};
use crate::torque_loop::{LoopGains, MOST_SENSITIVE, Margins, TREAD_STIFFNESS_N_M, TorqueDesign, TorqueLoop};

/// And its least damping.
const TREAD_DAMPING_RATIO: f64 = 0.1;
/// Time constant of a drive's torque where the file doesn't say, s.
const TORQUE_LAG_S: f64 = 0.5e-3;
/// How fast the law's slow force follows what its error asks for, 1/s.
pub(super) const INTEGRAL_1_S: f64 = 0.5;

/// By what a law of torque finds the force that no model tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlowForce {
    /// It adds up what its error asks for: `adaptive_torque`.
    Integral,
    /// It compares torques with what they did: `disturbance_observer`.
    Observer,
}

impl TorqueDesign {
    /// The design for a robot and a law.
    ///
    /// # Errors
    /// Where its keys contradict each other, gains that are given leave no margins, or no gains would.
    pub fn new(plan: &RobotPlan, slow: SlowForce) -> Made<Self> {
        let table = &plan.controller;
        let mass_kg = bounds("mass_kg", table.mass_kg, table.mass_bounds_kg)?;
        let inertia_kg_m2 = bounds("inertia_kg_m2", table.inertia_kg_m2, table.inertia_bounds_kg_m2)?;
        let stiffness_n_m = table.tread_stiffness_n_m.unwrap_or(TREAD_STIFFNESS_N_M);
        if stiffness_n_m[0] > stiffness_n_m[1] {
            let [low, high] = stiffness_n_m;
            let problem =
                Problem::refused("tread_stiffness_n_m", "least and greatest stiffness, in this order");
            let limit = Some("the first at most the second".into());
            return Err(Problem { value: Some(format!("[{low}, {high}]")), limit, ..problem }.into());
        }
        let wheel_kg = wheel_kg(plan, given(table.mass_kg, "mass_kg")?);
        let product = |one: usize, other: usize| -> f64 {
            plan.kinematics.matrix().iter().map(|row| row[one] * row[other]).sum()
        };
        // Of the matrix [[Σbx², Σbx·by], [Σbx·by, Σby²]] the eigenvalues: no direction has less or more.
        let mean = 0.5 * (product(0, 0) + product(1, 1));
        let apart = (0.5 * (product(0, 0) - product(1, 1))).hypot(product(0, 1));
        let axis = |shares: [f64; 2], body: [f64; 2], first: f64| TorqueLoop {
            period_s: plan.bus.cycle_ns as f64 * 1e-9,
            lag_s: table.torque_lag_us.map_or(TORQUE_LAG_S, |lag_us| lag_us * 1e-6),
            speed_filter_1_s: plan.estimator.speed_filter_1_s.unwrap_or(SPEED_FILTER_RAD_S),
            shares,
            wheel_kg,
            body,
            stiffness_n_m,
            damping_ratio: table.tread_damping_ratio.unwrap_or(TREAD_DAMPING_RATIO),
            integral_1_s: if slow == SlowForce::Integral { INTEGRAL_1_S } else { 0.0 },
            observed_body: if slow == SlowForce::Observer { first } else { 0.0 },
        };
        let along = axis([mean - apart, mean + apart], mass_kg, given(table.mass_kg, "mass_kg")?);
        let first = given(table.inertia_kg_m2, "inertia_kg_m2")?;
        let turn = axis([product(2, 2); 2], inertia_kg_m2, first);
        let (along_gains, turn_gains) = (along.design(), turn.design());
        let is_told = table.tread_stiffness_n_m.is_some() || table.tread_damping_ratio.is_some();
        let softer = is_told.then(|| softer(&along).zip(softer(&turn))).flatten();
        let softer = softer.map(|(along, turn)| [along, along, turn]);
        let loops = [along.clone(), along, turn];
        let designed = [along_gains, along_gains, turn_gains];
        let mut gains = [LoopGains { damping: 0.0, kp_1_s: 0.0, filter_1_s: 0.0, observer_1_s: 0.0 }; 3];
        let mut problems = Vec::new();
        // x and y differ in nothing but a Kp that the file gives.
        let is_one = table.torque_kp_1_s.is_none_or(|[x, y, _]| x == y);
        let names = if is_one { ["x and y", "", "the heading"] } else { ["x", "y", "the heading"] };
        for (axis, (one, designed)) in loops.iter().zip(designed).enumerate() {
            if axis == 1 && is_one {
                gains[1] = gains[0];
                continue;
            }
            match chosen(table, axis, names[axis], one, designed) {
                Ok(found) => gains[axis] = found,
                Err(StageError(found)) => problems.extend(found),
            }
        }
        if problems.is_empty() {
            Ok(TorqueDesign { loops, gains, softer })
        } else {
            Err(StageError(problems))
        }
    }
}

/// Gains for the same axis on all treads.
fn softer(told: &TorqueLoop) -> Option<LoopGains> {
    let ([soft, stiff], [softest, stiffest]) = (told.stiffness_n_m, TREAD_STIFFNESS_N_M);
    let all = TorqueLoop {
        stiffness_n_m: [soft.min(softest), stiff.max(stiffest)],
        damping_ratio: told.damping_ratio.min(TREAD_DAMPING_RATIO),
        ..told.clone()
    };
    all.design()
}

/// Between what a first estimate and its like may lie.
fn bounds(key: &str, first: Option<f64>, bounds: Option<[f64; 2]>) -> Made<[f64; 2]> {
    let first = given(first, key)?;
    let [low, high] = bounds.unwrap_or(ESTIMATE_BOUNDS.map(|factor| factor * first));
    if (low..=high).contains(&first) {
        return Ok([low, high]);
    }
    let reason = "the first estimate must lie within its bounds, which must be positive and ascending";
    let limit = Some(format!("{low} to {high}"));
    Err(Problem { value: Some(first.to_string()), limit, ..Problem::refused(key, reason) }.into())
}

/// An axis's gains: as designed, but for what the file gives.
fn chosen(
    table: &ControllerTable,
    axis: usize,
    name: &str,
    one: &TorqueLoop,
    designed: Option<LoopGains>,
) -> Made<LoopGains> {
    let damping_key = if axis == 2 { "turn_damping_n_m_s_rad" } else { "damping_n_s_m" };
    let damping = if axis == 2 { table.turn_damping_n_m_s_rad } else { table.damping_n_s_m };
    let kp_1_s = table.torque_kp_1_s.map(|kp_1_s| kp_1_s[axis]);
    let filter_1_s = table.torque_filter_1_s;
    let observer_1_s = table.observer_1_s.filter(|_| one.observed_body > 0.0);
    let given = [
        damping.map(|_| damping_key),
        kp_1_s.map(|_| "torque_kp_1_s"),
        filter_1_s.map(|_| "torque_filter_1_s"),
        observer_1_s.map(|_| "observer_1_s"),
    ];
    let Some(key) = given.into_iter().flatten().next() else {
        return designed.ok_or_else(|| {
            let [soft, stiff] = one.stiffness_n_m;
            let reason = format!(
                "no gains leave 6 dB and 30° along {name} from {soft:.1e} to {stiff:.1e} N/m with a damping of at least \
                 {}, a cycle of {} us and a lag of {} us: say more of the tread, or make it faster",
                one.damping_ratio,
                1e6 * one.period_s,
                1e6 * one.lag_s
            );
            Problem::refused("tread_stiffness_n_m", reason).into()
        });
    };
    let part = |given: Option<f64>, designed: Option<f64>| -> Made<f64> {
        given
            .or(designed)
            .ok_or_else(|| Problem::missing(key, format!("nothing can be designed along {name}")).into())
    };
    let gains = LoopGains {
        damping: part(damping, designed.map(|gains| gains.damping))?,
        kp_1_s: part(kp_1_s, designed.map(|gains| gains.kp_1_s))?,
        filter_1_s: part(filter_1_s, designed.map(|gains| gains.filter_1_s))?,
        observer_1_s: part(observer_1_s, designed.map(|gains| gains.observer_1_s))?,
    };
    let worst = one.worst(&gains);
    let LoopGains { damping, kp_1_s, filter_1_s, observer_1_s } = gains;
    let observed = |rate_1_s: f64| match one.observed_body > 0.0 {
        true => format!(", an observer of {rate_1_s} 1/s"),
        false => String::new(),
    };
    let found = format!(
        "K = {damping:.1}, Kp = {kp_1_s} 1/s{} and a low-pass of {filter_1_s} 1/s along {name}",
        observed(observer_1_s)
    );
    if damping < one.least(kp_1_s) {
        let reason = format!(
            "{found}: K must be at least the {} mass (or moment of inertia) times Kp, {:.1}",
            if one.observed_body > 0.0 { "least" } else { "greatest" },
            one.least(kp_1_s)
        );
        return Err(Problem::refused(key, reason).into());
    }
    if !worst.suffice() {
        let leaves = if worst.is_stable {
            let Margins { sensitivity, gain_db, phase_deg, .. } = worst;
            format!("leave {gain_db:.1} dB and {phase_deg:.0}° with a sensitivity of {sensitivity:.2}")
        } else {
            "don't hold".to_owned()
        };
        let [soft, stiff] = one.stiffness_n_m;
        let designed = designed.map_or(String::new(), |gains| {
            // No more than was looked at.
            let damping = (10.0 * gains.damping).floor() / 10.0;
            let LoopGains { kp_1_s, filter_1_s, observer_1_s, .. } = gains;
            format!("; K = {damping}, Kp = {kp_1_s} 1/s{} and {filter_1_s} 1/s do", observed(observer_1_s))
        });
        let reason = format!(
            "{found} {leaves} on treads from {soft:.1e} to {stiff:.1e} N/m with a damping of at least {}; a \
             sensitivity of at most {MOST_SENSITIVE} is asked for, which is 6 dB and 30°{designed}",
            one.damping_ratio
        );
        return Err(Problem::refused(key, reason).into());
    }
    Ok(gains)
}
