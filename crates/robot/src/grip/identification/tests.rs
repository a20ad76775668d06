//! What is learnt of simulated motions: mass, inertia, friction, centre of mass, slope.

use super::*;

const PERIOD_S: f64 = 1e-3;

fn first(mass: (f64, [f64; 2]), inertia: (f64, [f64; 2])) -> FirstEstimates {
    FirstEstimates { mass, inertia, share: 0.5, friction_max_n: 100.0 }
}

/// A platform whose speeds follow the wrenches of a motion; what is learnt after so many seconds. `push_n` acts beside them.
fn learnt(seconds: f64, push_n: &dyn Fn(f64) -> f64, trusted: &dyn Fn(f64) -> bool) -> [f64; BODY] {
    driven(seconds, push_n, [0.0; 2], trusted).estimate.theta
}

/// The same on a slope, whose force in axes that don't turn is given, N; all that was learnt.
fn driven(
    seconds: f64,
    push_n: &dyn Fn(f64) -> f64,
    [downhill_n, across_n]: [f64; 2],
    trusted: &dyn Fn(f64) -> bool,
) -> Identification {
    let mut heading_rad = 0.0_f64;
    let (mass_kg, inertia_kg_m2, friction_n) = (173.0, 11.3, [4.0, 7.0]);
    let [cx, cy] = [0.08, -0.05];
    let mut one = Identification::new(&first((85.0, [28.0, 255.0]), (6.0, [2.0, 18.0])), 0.4);
    let wished = |t: f64| [0.4 * (0.9 * t).sin(), 0.3 * (0.5 * t).cos(), 0.5 * (0.7 * t).sin()];
    for cycle in 0..(seconds / PERIOD_S) as u32 {
        let t = f64::from(cycle) * PERIOD_S;
        let [vx, vy, turn] = wished(t);
        heading_rad += PERIOD_S * turn;
        let (sin, cos) = heading_rad.sin_cos();
        let (before, after) = (wished(t - 1e-6), wished(t + 1e-6));
        let [gx, gy, gain] = std::array::from_fn(|axis| (after[axis] - before[axis]) / 2e-6);
        let (ax, ay) = (gx - turn * vy, gy + turn * vx);
        // The spin resists along x and about the vertical, the rollers along y.
        let spin = [2.0 * vx.signum(), 0.0, 1.2 * turn.signum()];
        let roller = [0.0, 2.0 * vy.signum(), 0.0];
        // By Newton and Euler for the centre of mass itself, its inertia by Steiner.
        let (cax, cay) = (ax - gain * cy - turn * turn * cx, ay + gain * cx - turn * turn * cy);
        let own_kg_m2 = inertia_kg_m2 - mass_kg * (cx * cx + cy * cy);
        let rubs: [f64; 3] =
            std::array::from_fn(|axis| friction_n[0] * spin[axis] + friction_n[1] * roller[axis]);
        let wrench = [
            mass_kg * cax + rubs[0] + push_n(t) - cos * downhill_n - sin * across_n,
            mass_kg * cay + rubs[1] + sin * downhill_n - cos * across_n,
            own_kg_m2 * gain + mass_kg * (cx * cay - cy * cax) + rubs[2],
        ];
        one.learn(&Motion {
            acceleration: [ax, ay, gain],
            turn_rad_s: turn,
            wrench,
            friction_per_newton: [spin, roller],
            is_trusted: trusted(t),
            moves: true,
            period_s: PERIOD_S,
        });
    }
    one
}

fn off([mass_kg, inertia_kg_m2, spin_n, roller_n, x, y]: [f64; BODY]) -> [f64; BODY] {
    let centre = [x / (173.0 * 0.08) - 1.0, y / (173.0 * -0.05) - 1.0];
    let [x, y] = centre;
    [mass_kg / 173.0 - 1.0, inertia_kg_m2 / 11.3 - 1.0, spin_n / 4.0 - 1.0, roller_n / 7.0 - 1.0, x, y]
}

#[test]
fn mass_inertia_centre_and_friction_are_read_from_what_wrenches_did() {
    let found = off(learnt(60.0, &|_| 0.0, &|_| true));
    assert!(found.iter().all(|off| off.abs() < 0.03), "{found:?}");
    // Half of the mass is made up for within two seconds.
    let early = off(learnt(2.0, &|_| 0.0, &|_| true));
    assert!(early[0].abs() < 0.1, "{early:?}");
}

#[test]
fn a_slope_is_told_from_what_rubs_and_from_the_mass() {
    // 5 and 3 % of 173 kg.
    let slope_n = [85.0, -51.0];
    let one = driven(60.0, &|_| 0.0, slope_n, &|_| true);
    let found = off(std::array::from_fn(|index| one.watched.theta[index]));
    assert!(found.iter().all(|off| off.abs() < 0.05), "{found:?}");
    for (told_n, slope_n) in one.watched.theta[BODY..].iter().zip(slope_n) {
        assert!((told_n - slope_n).abs() < 4.0, "{told_n} of {slope_n} N");
    }
    // What is told is less by what the watches allow for, however the platform stands on it.
    let told_n = omnibase_platform::length(one.watched().slope_n);
    let less_n = LEAST_SLOPE * 173.0 * GRAVITY_M_S2;
    assert!((omnibase_platform::length(slope_n) - less_n - told_n).abs() < 4.0, "{told_n}");
    // A level floor has none.
    let level = driven(60.0, &|_| 0.0, [0.0; 2], &|_| true);
    assert_eq!(level.watched().slope_n, [0.0; 2]);
}

#[test]
fn what_a_slope_may_pull_is_told_in_body_axes_and_a_level_floor_pulls_nothing() {
    // 5 and 3 % of 173 kg, and as much more as isn't known.
    let slope_n = [85.0, -51.0];
    let one = driven(60.0, &|_| 0.0, slope_n, &|_| true);
    let pull = one.slope_m_s2();
    let (size, true_m_s2) = (omnibase_platform::length(pull), omnibase_platform::length(slope_n) / 173.0);
    assert!((true_m_s2..true_m_s2 + 0.15).contains(&size), "{size} of {true_m_s2} m/s²");
    let in_world = one.turned.out_of_body(pull);
    let along = (in_world[0] * slope_n[0] + in_world[1] * slope_n[1]) / (173.0 * true_m_s2 * size);
    assert!(along > 0.99, "{in_world:?}");
    // Nor does one that looks steep while wheels slide; from there on more is counted with bit by bit.
    let mut level = driven(60.0, &|_| 0.0, [0.0; 2], &|_| true);
    assert_eq!(level.slope_m_s2(), [0.0; 2]);
    let weight_n = level.watched.theta[0] * GRAVITY_M_S2;
    let mut pull = |steep: f64| {
        (level.watched.theta[BODY], level.watched.theta[BODY + 1]) = (steep * weight_n, 0.0);
        omnibase_platform::length(level.slope_m_s2()) / GRAVITY_M_S2
    };
    assert_eq!(pull(0.99 * LOOKS_STEEP), 0.0);
    assert!(pull(1.01 * LOOKS_STEEP) < 0.001, "{}", pull(1.01 * LOOKS_STEEP));
    let steps = (1..100).map(|step| 0.001 * f64::from(step));
    steps.for_each(|steep| assert!(pull(steep + 0.001) - pull(steep) <= 0.001 * STEEPER + 1e-9, "{steep}"));
}

#[test]
fn what_wheels_that_stand_hold_against_is_a_slope_of_what_a_floor_may_have() {
    let mut one = Identification::new(&first((70.0, [25.0, 200.0]), (7.0, [2.0, 20.0])), 0.4);
    let weight_n = 70.0 * GRAVITY_M_S2;
    let stand = |one: &mut Identification, pushes_n: [f64; 2]| {
        (0..500).for_each(|_| one.rest(pushes_n, [0.0; 2], PERIOD_S));
        one.watched().slope_n
    };
    // Uphill, along y; friction may hold a part of it, and the watches allow for another.
    let told_n = 0.05 * weight_n - (HELD_SLOPE + LEAST_SLOPE) * weight_n;
    let [x, y] = stand(&mut one, [0.0, 0.05 * weight_n]);
    assert!(x.abs() < 1e-9 && (y + told_n).abs() < 0.1, "{x}, {y}");
    one.turned = Turned::to(1.0);
    let turned_n = one.watched().slope_n;
    let size_n = omnibase_platform::length(turned_n);
    assert!((size_n - told_n).abs() < 0.1 && turned_n[0] < -0.8 * told_n, "{turned_n:?}");
    one.turned = Turned::to(0.0);
    // A person who leans on it is no floor of 30 %.
    let leant_n = omnibase_platform::length(stand(&mut one, [0.0, 0.3 * weight_n]));
    assert!(leant_n <= MOST_SLOPE * weight_n, "{leant_n}");
    let before = one.watched.theta;
    one.rest([f64::NAN, 0.0], [0.0; 2], PERIOD_S);
    assert_eq!(one.watched.theta, before);
}

#[test]
fn a_push_of_a_second_moves_the_mass_by_a_twentieth_at_most() {
    let push = |t: f64| if (5.0..6.0).contains(&t) { 400.0 } else { 0.0 };
    let (pushed, alone) = (learnt(6.0, &push, &|_| true), learnt(6.0, &|_| 0.0, &|_| true));
    assert!((pushed[0] - alone[0]).abs() < 0.05 * 173.0, "{pushed:?} {alone:?}");
    assert_ne!(pushed, alone);
}

#[test]
fn what_a_platform_was_held_by_at_rest_tells_nothing_of_its_mass() {
    let after_rest = |wrench_n: f64| {
        let mut one = Identification::new(&first((70.0, [25.0, 200.0]), (7.0, [2.0, 20.0])), 0.4);
        let seen = |moves: bool, wrench_n: f64, t: f64| Motion {
            acceleration: [if moves { 0.8 * (4.0 * t).sin() } else { 0.0 }, 0.0, 0.0],
            turn_rad_s: 0.0,
            wrench: [wrench_n, 0.0, 0.0],
            friction_per_newton: [[0.0; 3]; 2],
            is_trusted: true,
            moves,
            period_s: PERIOD_S,
        };
        (0..300).for_each(|_| one.learn(&seen(false, wrench_n, 0.0)));
        for cycle in 0..100 {
            let t = f64::from(cycle) * PERIOD_S;
            one.learn(&seen(true, 70.0 * 0.8 * (4.0 * t).sin(), t));
        }
        one.estimate.theta
    };
    assert_eq!(after_rest(300.0), after_rest(0.0));
    assert!((after_rest(300.0)[0] - 70.0).abs() < 0.1, "{:?}", after_rest(300.0));
}

#[test]
fn nothing_is_learnt_while_the_wheels_do_something_else_nor_from_what_is_no_number() {
    let unlearnt = [85.0, 6.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(learnt(5.0, &|_| 0.0, &|_| false), unlearnt);
    // A drive that holds back for a moment in every tenth of a second leaves nothing that could be trusted.
    assert_eq!(learnt(5.0, &|_| 0.0, &|t| (10.0 * t).fract() > 0.1), unlearnt);
    assert_eq!(learnt(5.0, &|_| f64::NAN, &|_| true)[0..1], unlearnt[0..1]);
}
