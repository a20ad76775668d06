use super::design::{FILTERS_1_S, GAIN_STEP, GREATEST_1_S, OBSERVERS_1_S, rates};
use super::*;

/// `robots/bmm.toml`, along x and y and about the vertical: three wheels at 120°, Σb² = 1.5 and p1² + 2p².
fn bmm() -> [TorqueLoop; 2] {
    let along = TorqueLoop {
        period_s: 1e-3,
        lag_s: 0.5e-3,
        speed_filter_1_s: 400.0,
        shares: [1.5; 2],
        wheel_kg: 2.0,
        body: [70.0 / 3.0, 210.0],
        stiffness_n_m: [1e5, 4e6],
        damping_ratio: 0.1,
        integral_1_s: 0.5,
        observed_body: 0.0,
    };
    [
        along.clone(),
        TorqueLoop { shares: [0.38 * 0.38 + 2.0 * 0.4 * 0.4; 2], body: [7.0 / 3.0, 21.0], ..along },
    ]
}

/// `robots/mecanum.toml` with the mass of its simulation: four wheels, Σb² = 4 and 4·(0.24 + 0.21)².
fn mecanum() -> [TorqueLoop; 2] {
    let [along, _] = bmm();
    let turn = TorqueLoop { shares: [4.0 * 0.45 * 0.45; 2], body: [4.0 / 3.0, 12.0], ..along.clone() };
    [TorqueLoop { shares: [4.0; 2], body: [20.0, 180.0], ..along }, turn]
}

/// The same axes under a law with a disturbance observer that counts with the mean of lightest and heaviest.
fn observed() -> [TorqueLoop; 4] {
    let [[along, turn], [wide, spin]] = [bmm(), mecanum()];
    [along, turn, wide, spin].map(|axis| {
        let observed_body = (axis.body[0] * axis.body[1]).sqrt();
        TorqueLoop { integral_1_s: 0.0, observed_body, ..axis }
    })
}

/// How much faster the wheels move after 20 s than in the first second, by time: the equations in steps of a hundredth of a
/// period, the law cycle by cycle.
fn growth(axis: &TorqueLoop, gains: &LoopGains, plant: &Plant) -> f64 {
    const STEPS: usize = 100;
    let (period_s, step_s) = (axis.period_s, axis.period_s / STEPS as f64);
    let (wheel, spring) = (plant.shares * axis.wheel_kg, plant.shares * plant.stiffness_n_m);
    let damper = plant.damping_ratio * 2.0 * (spring * wheel).sqrt();
    let part = |filter_1_s: f64| 1.0 - (-filter_1_s * period_s).exp();
    let (speed_part, low_pass_part) = (part(axis.speed_filter_1_s), part(gains.filter_1_s));
    let (mut torque, mut observed) = (0.0, 0.0);
    // A wheel that stands a millimetre off, with its body.
    let (mut way, mut way_speed, mut body, mut body_speed) = (1e-3, 0.0_f64, 1e-3, 0.0);
    let (mut way_before, mut measured, mut low_passed, mut learnt, mut force) = (way, 0.0, 0.0, 0.0, 0.0);
    let mut commands = [0.0; 2];
    let (mut first, mut last) = (0.0_f64, 0.0_f64);
    for cycle in 0..20_000 {
        let measured_before = measured;
        measured += speed_part * ((way - way_before) / period_s - measured);
        way_before = way;
        torque += speed_part * (force - torque);
        low_passed += low_pass_part * (measured + gains.kp_1_s * way - low_passed);
        learnt += axis.integral_1_s * period_s * low_passed;
        let acts = commands[0];
        commands = [commands[1], -gains.damping * (low_passed + learnt) - observed];
        if axis.observed_body > 0.0 {
            let gained = axis.observed_body * (measured - measured_before) / period_s;
            observed += part(gains.observer_1_s) * (gained - torque - observed);
        }
        for _ in 0..STEPS {
            force += step_s / axis.lag_s * (acts - force);
            let tread = spring * (way - body) + damper * (way_speed - body_speed);
            way_speed += step_s / wheel * (force - tread);
            body_speed += step_s / plant.body * tread;
            way += step_s * way_speed;
            body += step_s * body_speed;
        }
        match cycle {
            0..1000 => first = first.max(way_speed.abs()),
            19_000.. => last = last.max(way_speed.abs()),
            _ if way_speed.abs() > 1e3 => return f64::INFINITY,
            _ => {}
        }
    }
    last / first
}

#[test]
fn margins_by_frequency_are_those_by_time() {
    for axis in bmm().into_iter().chain(mecanum()).chain(observed()) {
        let gains = axis.design().expect("gains");
        let plants = axis.plants();
        let gain_db = |plant: &&Plant| axis.margins(&gains, plant).gain_db;
        let worst =
            plants.iter().min_by(|one, other| gain_db(one).total_cmp(&gain_db(other))).expect("plants");
        // The softest and the stiffest tread too, on the lightest platform and the heaviest.
        let corners = [worst, &plants[0], &plants[9], &plants[20], &plants[29]];
        for plant in corners {
            let limit = 10_f64.powf(gain_db(&plant) / 20.0);
            for (factor, is_stable) in [(1.0, true), (0.93 * limit, true), (1.07 * limit, false)] {
                // The whole gain of an observer's law is K and the mass that it counts with.
                let gains = LoopGains { damping: factor * gains.damping, ..gains };
                let axis = TorqueLoop { observed_body: factor * axis.observed_body, ..axis.clone() };
                let grown = growth(&axis, &gains, plant);
                let told = axis.margins(&gains, plant);
                assert_eq!(told.is_stable, is_stable, "{factor} times K on {plant:?} of {axis:?}");
                assert_eq!(grown < 1.0, is_stable, "{factor} times K on {plant:?} of {axis:?}: {grown}");
            }
        }
    }
}

#[test]
fn designed_gains_leave_6_db_and_30_degrees_on_every_tread() {
    for axis in bmm().into_iter().chain(mecanum()).chain(observed()) {
        let mut stiffest = 0.0;
        for (soft, damping_ratio) in [(1e5, 0.1), (3e5, 0.3), (2e6, 0.3)] {
            let axis = TorqueLoop { stiffness_n_m: [soft, 4e6], damping_ratio, ..axis.clone() };
            let gains = axis.design().expect("gains");
            let worst = axis.worst(&gains);
            assert!(worst.is_stable && worst.sensitivity <= MOST_SENSITIVE, "{worst:?} of {gains:?}");
            assert!(worst.gain_db >= 6.0 && worst.phase_deg >= 30.0, "{worst:?} of {gains:?}");
            assert!(axis.observed_body > 0.0 || gains.damping >= axis.body[1] * gains.kp_1_s, "{gains:?}");
            // More that is known is never less stiffness.
            assert!(gains.stiffness() >= stiffest, "{gains:?} of {axis:?}");
            stiffest = gains.stiffness();
        }
    }
}

#[test]
fn the_gain_at_which_6_db_are_left_is_the_known_one() {
    let [along, _] = bmm();
    let axis = TorqueLoop { integral_1_s: 0.0, ..along };
    // Measured speed alone; known from the same transfer functions at 400 000 frequencies.
    for (stiffness_n_m, damping_ratio, known) in [(1e6, 0.3, 1446.0), (1e5, 0.1, 434.0)] {
        let gains = LoopGains { damping: 300.0, kp_1_s: 0.0, filter_1_s: 1e6, observer_1_s: 0.0 };
        let plant = Plant { shares: 1.5, body: 170.0, stiffness_n_m, damping_ratio };
        let left_db = axis.margins(&gains, &plant).gain_db;
        let damping = gains.damping * 10_f64.powf((left_db - 20.0 * 2_f64.log10()) / 20.0);
        // The product looks at 260 frequencies, and draws straight lines between them.
        assert!((damping / known - 1.0).abs() < 0.04, "{damping} N·s/m for {plant:?}, not {known}");
    }
}

#[test]
fn wheels_that_share_unlike_by_direction_get_margins_in_every_direction() {
    let [along, _] = bmm();
    let alike = TorqueLoop { shares: [2.5; 2], ..along.clone() };
    let unlike = TorqueLoop { shares: [0.5, 2.5], ..along };
    let (gains, safer) = (alike.design().expect("a design"), unlike.design().expect("a design"));
    assert!(!unlike.worst(&gains).suffice(), "what holds in one direction doesn't in the other: {gains:?}");
    assert!(unlike.worst(&safer).suffice() && safer.damping * safer.kp_1_s < gains.damping * gains.kp_1_s);
}

#[test]
fn between_the_stiffnesses_that_were_looked_at_nothing_hides() {
    for axis in bmm().into_iter().chain(observed()) {
        let axis = TorqueLoop { damping_ratio: 0.05, ..axis };
        let gains = axis.design().expect("a design");
        // A hundred swings of the lightest damping that a file may say, none at a place of the design's.
        for step in 0..100 {
            let stiffness_n_m = 1e5 * 40.0_f64.powf((f64::from(step) + 0.37) / 100.0);
            let between = TorqueLoop { stiffness_n_m: [stiffness_n_m; 2], ..axis.clone() };
            let worst = between.worst(&gains);
            assert!(
                worst.is_stable && worst.sensitivity < 1.05 * MOST_SENSITIVE,
                "{stiffness_n_m}: {worst:?}"
            );
        }
    }
}

/// The same search by trial: every gain on every plant, its turns summed up from frequency to frequency.
fn by_trial(axis: &TorqueLoop) -> Option<LoopGains> {
    let frequencies = axis.frequencies();
    let mut plants: Vec<_> = axis.plants().iter().map(|plant| axis.response(plant, &frequencies)).collect();
    let observers_1_s: &[f64] = if axis.observed_body > 0.0 { &OBSERVERS_1_S } else { &[0.0] };
    let mut best: Option<LoopGains> = None;
    for filter_1_s in FILTERS_1_S {
        let low_pass = axis.low_pass(filter_1_s, &frequencies);
        for (kp_1_s, observer_1_s) in rates(observers_1_s) {
            let mut damping = GREATEST_1_S * axis.body[1];
            let gains = LoopGains { damping, kp_1_s, filter_1_s, observer_1_s };
            let law = axis.law(&gains, &low_pass, &frequencies);
            let least = best.map_or(0.0, |best| best.stiffness() / (kp_1_s + observer_1_s));
            while damping > least.max(axis.least(kp_1_s)) {
                let bears = |plant: &Vec<Complex<f64>>| {
                    let of = |(at, plant): (usize, &Complex<f64>)| 1.0 + plant * law.whole(at, damping);
                    let closed: Vec<_> = plant.iter().enumerate().map(of).collect();
                    let turned_rad: f64 =
                        closed.windows(2).map(|pair| (pair[1] * pair[0].conj()).arg()).sum();
                    let least = closed.iter().map(|at| at.norm_sqr()).fold(f64::INFINITY, f64::min);
                    is_stable(turned_rad, axis.quarter_turns()) && least * MOST_SENSITIVE.powi(2) >= 1.0
                };
                match plants.iter().position(|plant| !bears(plant)) {
                    Some(fails) => plants.swap(0, fails),
                    None => {
                        best = Some(LoopGains { damping, ..gains });
                        break;
                    }
                }
                damping *= GAIN_STEP;
            }
        }
    }
    best
}

#[test]
fn what_the_search_finds_is_what_trying_every_gain_finds() {
    let [along, turn] = bmm();
    let [wide, spin] = mecanum();
    let told =
        TorqueLoop { stiffness_n_m: [4e5, 9e5], damping_ratio: 0.4, period_s: 0.5e-3, ..along.clone() };
    let stiff = TorqueLoop { stiffness_n_m: [2e6, 4e6], damping_ratio: 0.8, lag_s: 0.0, ..wide.clone() };
    let unlike = TorqueLoop { shares: [0.5, 2.5], body: [90.0, 120.0], integral_1_s: 0.0, ..along.clone() };
    let hopeless = TorqueLoop { period_s: 0.1, ..turn.clone() };
    let watched = TorqueLoop { integral_1_s: 0.0, observed_body: 70.0, ..told.clone() };
    for axis in [along, turn, wide, spin, told, stiff, unlike, hopeless, watched] {
        assert_eq!(axis.design(), by_trial(&axis), "{axis:?}");
    }
}
