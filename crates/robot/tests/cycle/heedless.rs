//! Laws that heed nothing of what is wished: they are stopped by the drives, and by name.

use omnibase_platform::{Kinematics, Twist2, Wrench2};
use omnibase_robot::controllers::saturated;
use omnibase_robot::signals::{
    Commands, CycleTime, Frame, PlatformState, Quantity, SafetyReason, Setpoint, StopCategory,
};
use omnibase_robot::stages::Controller;
use omnibase_robot::{CycleRecord, Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, kind, plan, plan_with};

/// What a law does, whatever is wished.
#[derive(Clone, Copy, Debug)]
enum Heedless {
    /// Pushes so, N and N·m in base_link, until the platform is so fast, m/s, and then against what brakes it.
    Pushes(Wrench2, f64),
    /// Brings it to so many m/s along x, and lets it roll.
    Rolls(f64),
    /// Turns the wheels forward, faster by 1 m/s² until they are so fast, m/s.
    Turns(f64),
    /// Pulls it to the set point's speed by so many N per m/s, and to its place not at all.
    Brakes(f64),
}

struct Law {
    does: Heedless,
    kinematics: Kinematics,
    cycles: u32,
    lets_roll: bool,
}

impl Controller for Law {
    fn quantity(&self) -> Quantity {
        if matches!(self.does, Heedless::Turns(_)) { Quantity::Speed } else { Quantity::Torque }
    }

    fn update(&mut self, _: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let speed_m_s = state.twist_in_body.speed_m_s();
        self.cycles += 1;
        let wrench = match self.does {
            Heedless::Turns(most_m_s) => {
                let twist = Twist2::new(most_m_s.min(1e-3 * f64::from(self.cycles)), 0.0, 0.0);
                return saturated(Quantity::Speed, &self.kinematics.wheel_speeds_rad_s(twist), 15.0);
            }
            Heedless::Pushes(wrench, until_m_s) => {
                let part = if speed_m_s > until_m_s { 0.25 } else { 1.0 };
                Wrench2::new(part * wrench.fx_n, part * wrench.fy_n, part * wrench.torque_nm)
            }
            Heedless::Rolls(until_m_s) => {
                self.lets_roll |= speed_m_s > until_m_s;
                Wrench2::new(if self.lets_roll { 0.0 } else { 100.0 }, 0.0, 0.0)
            }
            Heedless::Brakes(damping_n_s_m) => {
                let wished_m_s = setpoint.twist_in_odom.vx_m_s;
                Wrench2::new(damping_n_s_m * (wished_m_s - state.twist_in_body.vx_m_s), 0.0, 0.0)
            }
        };
        saturated(Quantity::Torque, &self.kinematics.wheel_torques_nm(wrench), 1e6)
    }
}

fn bench(law: Heedless, more: &str) -> Bench {
    let mut registry = Registry::with_built_in();
    registry.controllers.add(kind("heedless"), move |plan| {
        Ok(Law { does: law, kinematics: plan.kinematics.clone(), cycles: 0, lets_roll: false })
    });
    let text = BMM.replace("\"closed_loop_speed\"", "\"heedless\"");
    // Slip has a stop of its own; the torque's direction may be any.
    let text = format!("{text}\n[safety]\nslip_m = 1e6\n{more}\n");
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.enable();
    bench
}

/// Drives forward for so many cycles.
fn drive(bench: &mut Bench, speed_m_s: f64, cycles: u32) -> CycleRecord {
    let twist = Twist2::new(speed_m_s, 0.0, 0.0);
    let mut record = *bench.robot.record();
    for _ in 0..cycles {
        record = bench.step(Some(RequestKind::Velocity { twist, frame: Frame::Body }));
    }
    record
}

fn astray_m(record: &CycleRecord) -> f64 {
    record.state.odom_from_body.distance_m(record.setpoint.odom_from_body)
}

#[test]
fn a_law_that_does_not_follow_the_ramp_is_stopped_by_the_drives_within_a_hand() {
    let laws =
        [Heedless::Pushes(Wrench2::new(100.0, 0.0, 0.0), 0.6), Heedless::Rolls(0.6), Heedless::Turns(0.6)];
    for law in laws {
        for category in [StopCategory::RampThenRemove, StopCategory::RampAndHold] {
            let mut bench = bench(law, "tracking_error_m = 10");
            while bench.twist_in_body.vx_m_s < 0.59 {
                drive(&mut bench, 0.6, 1);
            }
            assert_eq!(bench.robot.phase(), Phase::Tracking, "{law:?}");
            let before_m = astray_m(&bench.step(Some(RequestKind::Stop(category))));
            let mut cycles = 0;
            let mut nearest_m = before_m;
            while bench.robot.phase() == Phase::Stopping {
                let away_m = astray_m(&bench.step(None));
                nearest_m = nearest_m.min(away_m);
                assert!(away_m - nearest_m < 0.06, "{law:?} {category:?}: {away_m} m, {nearest_m} before");
                cycles += 1;
            }
            let record = *bench.robot.record();
            let found = (bench.robot.phase(), record.stop_reason);
            assert_eq!(
                found,
                (Phase::QuickStopping, SafetyReason::TrackingError),
                "{law:?} {category:?} after {cycles} ms"
            );
            assert_eq!(bench.control_word(0), 0x02, "{law:?}: the drives' own quick stop, in the same cycle");
            bench.run(6000);
            assert_eq!(bench.robot.phase(), Phase::Fault, "{law:?}");
            // 0.4 s of ramp, and not the 5 s of the time that a ramp may take.
            assert!((100..400).contains(&cycles), "{law:?} {category:?}: {cycles} ms");
        }
    }
}

#[test]
fn a_law_that_brakes_harder_than_the_ramp_or_as_hard_is_left_alone() {
    for damping_n_s_m in [400.0, 4000.0] {
        let mut bench = bench(Heedless::Brakes(damping_n_s_m), "");
        drive(&mut bench, 0.8, 1500);
        bench.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
        bench.run(3000);
        let record = *bench.robot.record();
        let found = (bench.robot.phase(), record.stop_reason);
        assert_eq!(found, (Phase::Disabled, SafetyReason::Requested), "{damping_n_s_m} N·s/m");
    }
}

#[test]
fn a_robot_that_stands_before_its_ramp_ends_went_nowhere() {
    let mut bench = bench(Heedless::Brakes(4000.0), "");
    drive(&mut bench, 0.8, 1500);
    bench.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
    bench.run(50);
    // Somebody holds it.
    bench.friction_nm = 1000.0;
    bench.twist_in_body = Twist2::default();
    for _ in 0..200 {
        bench.twist_in_body = Twist2::default();
        bench.step(None);
    }
    assert!(astray_m(bench.robot.record()) > 0.1);
    assert_eq!(bench.robot.record().stop_reason, SafetyReason::Requested);
}

#[test]
fn a_law_that_drives_a_wheel_beyond_its_limit_is_stopped_by_name_whatever_it_was_told() {
    for phase in [Phase::Holding, Phase::Tracking] {
        let turns = Heedless::Pushes(Wrench2::new(0.0, 0.0, 24.0), 1e6);
        let mut bench = bench(turns, "tracking_error_m = 10");
        let limit_rad_s = bench.plan.limits.wheel_speed_rad_s;
        let mut fastest_rad_s: f64 = 0.0;
        let mut cycles = 0;
        while matches!(bench.robot.phase(), Phase::Holding | Phase::Tracking | Phase::Stopping) {
            match phase {
                Phase::Tracking => drive(&mut bench, 0.1, 1),
                _ => bench.step(None),
            };
            let drives = bench.robot.record().measurements;
            let speeds = drives.present().iter().map(|drive| drive.speed_rad_s.abs());
            fastest_rad_s = speeds.fold(fastest_rad_s, f64::max);
            cycles += 1;
            assert!(cycles < 20_000, "{phase:?}: {fastest_rad_s} rad/s");
        }
        let found = (bench.robot.phase(), bench.robot.record().stop_reason);
        assert_eq!(found, (Phase::QuickStopping, SafetyReason::WheelSpeed), "{phase:?}");
        // A tenth is the margin; the rest what the law itself gains in 20 ms.
        assert!(fastest_rad_s < 1.12 * limit_rad_s, "{phase:?}: {fastest_rad_s} of {limit_rad_s} rad/s");
    }
}

#[test]
fn a_wheel_that_is_pushed_beyond_its_limit_ramps_down_as_the_file_says() {
    let mut bench = Bench::new(plan(&format!(
        "{}\n[safety]\nslip_m = 1e6\n",
        BMM.replace("\"closed_loop_speed\"", "\"adaptive_torque\"")
    )));
    bench.enable();
    let mut push_rad_s = 0.0;
    let mut after = 0;
    while after < 60 {
        // Somebody turns it, ever faster, against all that its law does.
        push_rad_s += 3e-3;
        bench.twist_in_body = Twist2::new(0.0, 0.0, push_rad_s);
        let record = bench.step(None);
        assert!(push_rad_s < 6.0, "never stopped");
        if record.stop_reason != SafetyReason::None {
            after += 1;
            assert_eq!(
                (bench.robot.phase(), record.stop_reason),
                (Phase::Stopping, SafetyReason::WheelSpeed)
            );
        }
    }
}
