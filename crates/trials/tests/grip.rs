//! Where each control law holds on treads that give way, and where it rings and is stopped for it: what a better law
//! changes is [`CASES`].

use omnibase_robot::signals::SafetyReason;
use omnibase_robot_sim::Tread;
use omnibase_trials::grip::{Case, Ridden, SIDE_S};

/// What a torque does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Torque {
    RingsAndStops,
    Holds,
}
use Torque::{Holds, RingsAndStops};

/// Law, stiffness of the tread in N/m, damping ratio, and what comes of it on a floor of 0.5 with 100 kg on top.
const CASES: [(&str, f64, f64, Torque); 12] = [
    ("adaptive_torque", 1e5, 0.1, RingsAndStops),
    ("adaptive_torque", 1e5, 1.0, RingsAndStops),
    ("adaptive_torque", 3e5, 0.1, RingsAndStops),
    ("adaptive_torque", 3e5, 0.6, RingsAndStops),
    ("adaptive_torque", 1e6, 0.3, RingsAndStops),
    ("adaptive_torque", 1e6, 1.0, Holds),
    ("adaptive_torque", 3e6, 0.3, Holds),
    ("adaptive_torque", 4e6, 0.1, Holds),
    ("closed_loop_speed", 1e5, 0.1, Holds),
    ("closed_loop_speed", 3e5, 0.3, Holds),
    ("closed_loop_speed", 1e6, 0.1, Holds),
    ("closed_loop_speed", 4e6, 0.3, Holds),
];

fn assert_does(case: &Case, torque: Torque) -> Ridden {
    let ridden = case.ride();
    println!("{}", case.row(&ridden));
    match torque {
        RingsAndStops => {
            assert!(ridden.ringing > 0.0 && ridden.ringing_hz > 40.0, "{case:?}: {ridden:?}");
            assert_eq!(ridden.stopped, SafetyReason::Oscillation, "{case:?}");
            assert!(ridden.run.true_final_m < 0.015, "{case:?}: {ridden:?}");
        }
        Holds => {
            assert!(ridden.ringing < 0.001, "{case:?}: {ridden:?}");
            assert!(ridden.greatest_torque_n_m < 18.0, "{case:?}: {ridden:?}");
            assert!(
                ridden.stopped == SafetyReason::None && ridden.run.finished && ridden.run.true_final_m < 1e-3,
                "{case:?}: {ridden:?}"
            );
        }
    }
    ridden
}

#[test]
fn each_law_rings_where_it_is_known_to_and_nowhere_else() {
    for (law, stiffness_n_m, damping_ratio, torque) in CASES {
        let tread = Some(Tread { stiffness_n_m, damping_ratio });
        let case = Case { law, tread, friction: 0.5, payload_kg: 100.0, estimate: 0.5, side_s: SIDE_S };
        assert_does(&case, torque);
    }
}

#[test]
fn a_wheel_that_spins_rings_as_a_soft_tread_does() {
    let case =
        |law| Case { law, tread: None, friction: 0.15, payload_kg: 0.0, estimate: 1.0, side_s: SIDE_S };
    let ridden = assert_does(&case("adaptive_torque"), RingsAndStops);
    assert!(ridden.run.true_rms_m < 0.002, "{ridden:?}");
    // At usual grip it takes twice the thesis's speed.
    let fast = |law| Case { friction: 0.5, side_s: 0.5 * SIDE_S, ..case(law) };
    let ridden = assert_does(&fast("adaptive_torque"), RingsAndStops);
    assert!(ridden.run.true_rms_m < 0.005, "{ridden:?}");
    // The speed law slips there too, but doesn't ring.
    let ridden = fast("closed_loop_speed").ride();
    assert!(ridden.ringing < 0.001 && ridden.run.true_final_m < 0.05, "{ridden:?}");
    let ridden = case("closed_loop_speed").ride();
    assert!(ridden.ringing < 0.001 && ridden.run.true_final_m < 0.004, "{ridden:?}");
}
