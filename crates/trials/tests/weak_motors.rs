//! Drives that can't give what they are asked for: motors too weak or too hot, or a body that is held fast.

use omnibase_robot::signals::SafetyReason;
use omnibase_robot::{Phase, RequestKind};
use omnibase_robot_sim::Wrench;
use omnibase_trials::{Trial, plan_of, robots};

#[test]
fn a_robot_too_weak_for_its_path_stops_and_says_so() {
    // Round the circle as fast as the limits allow, with a third of the torque that the payload would take.
    let fast = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 10\n";
    for law in ["closed_loop_speed", "adaptive_torque"] {
        let text = robots::loaded(robots::BMM, law, 1.0, fast)
            .replace("rated_torque_nm = 7.0", "rated_torque_nm = 3.0")
            .replace("payload_kg = 100.0", "payload_kg = 250.0\nmotor_torque_limit_nm = 5.0");
        let mut trial = Trial::new(plan_of(&text));
        trial.enable();
        trial.step(Some(RequestKind::Track));
        while trial.robot.phase() == Phase::Tracking {
            trial.step(None);
        }
        assert_eq!(trial.robot.record().stop_reason, SafetyReason::WeakMotor, "{law}");
        let record = trial.run(8000);
        assert_eq!(record.phase, Phase::Fault, "{law}");
        let estimates = record.estimates();
        assert!(estimates.iter().all(|estimate| *estimate < 600.0), "{law}: {estimates:?}");
    }
}

#[test]
fn a_robot_that_was_held_fast_comes_back_within_its_speed() {
    for law in ["closed_loop_speed", "adaptive_torque"] {
        // The wheels slide meanwhile, and a law by torque rings where they do: here that is no reason to stop.
        let safety = "\n[safety]\ntracking_error_m = 2.0\noscillation_share = 1.0\n";
        let text = robots::loaded(robots::BMM, law, 1.0, safety);
        let mut trial = Trial::new(plan_of(&text));
        trial.enable();
        let at_start = trial.robot.record().estimates();
        // More than the motors' 21 N·m on two wheels hold.
        trial.machine.lock().set_push(Wrench { fx_n: -480.0, fy_n: 0.0, moment_n_m: 0.0 });
        while trial.pose().x_m > -0.5 {
            trial.step(None);
        }
        trial.machine.lock().set_push(Wrench::default());
        let (mut back_m_s, mut truly_m_s, mut x_before_m) = (0.0_f64, 0.0_f64, trial.pose().x_m);
        for _ in 0..6000 {
            let record = trial.step(None);
            assert_eq!(
                (record.phase, record.stop_reason),
                (Phase::Holding, SafetyReason::None),
                "{law}: {:?} at {back_m_s} m/s",
                record.measurements.present()
            );
            back_m_s = back_m_s.max(record.state.twist_in_body.vx_m_s);
            let x_m = trial.pose().x_m;
            truly_m_s = truly_m_s.max((x_m - x_before_m) / 1e-3);
            x_before_m = x_m;
        }
        let estimates = trial.robot.record().estimates();
        println!("{law}: back at {back_m_s} m/s, truly {truly_m_s} m/s, {estimates:?} after {at_start:?}");
        // 2 % for the inner loops.
        assert!((0.3..1.02).contains(&truly_m_s), "{law}: truly {truly_m_s} m/s");
        // What is believed is the wheels' speed: they slide, and by torques they do so a little faster.
        let most_m_s = if law == "adaptive_torque" { 1.3 } else { 1.02 };
        assert!((0.5..most_m_s).contains(&back_m_s), "{law}: {back_m_s} m/s");
        let state = trial.robot.record().state.odom_from_body;
        // At rest the law of torque integrates nothing: what friction holds against K·Kp stays.
        let most_m = if law == "adaptive_torque" { 0.03 } else { 1e-3 };
        assert!(state.x_m.hypot(state.y_m) < most_m, "{law}: {state:?}");
        assert!((estimates[0] - at_start[0]).abs() <= 0.1 * at_start[0], "{law}: {estimates:?}");
    }
}
