//! Every reason for which the robot stops: what leads to it, what it does at first, and where it ends.

use omnibase_platform::{PerWheel, Pose2, Twist2, Wrench2};
use omnibase_robot::config::{PdoPlan, parse_map};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::registry::PeripheralDefaults;
use omnibase_robot::signals::{
    Commands, CycleTime, Frame, PlatformState, Quantity, ReferenceStatus, SafetyAction, SafetyReason,
    Setpoint, StopCategory,
};
use omnibase_robot::stages::{Controller, Estimator, Observation, Peripheral, Readiness, Reference};
use omnibase_robot::{Exchange, Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, MECANUM, kind, plan_with};

/// Cycles in which a stage of these tests does as it should.
const GOOD_CYCLES: u32 = 300;

/// The same command for all wheels, from some cycle on.
struct Constant(Quantity, f64, u32);

impl Controller for Constant {
    fn quantity(&self) -> Quantity {
        self.0
    }

    fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
        self.2 = self.2.saturating_sub(1);
        let mut commands = Commands { quantity: self.0, ..Commands::default() };
        if self.2 == 0 {
            commands.values[..3].fill(self.1);
        }
        commands
    }
}

/// Sideways at a constant speed, and once to another place; nobody can look ahead on it.
struct Sideways {
    speed_m_s: f64,
    jump_m: f64,
}

impl Reference for Sideways {
    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        let jump_m = if since_start_s > 0.3 { self.jump_m } else { 0.0 };
        let pose = Pose2 { y_m: self.speed_m_s * since_start_s + jump_m, ..Pose2::default() };
        Setpoint {
            twist_in_odom: Twist2::new(0.0, self.speed_m_s, 0.0),
            status: ReferenceStatus::Moving,
            ..Setpoint::at_rest(pose)
        }
    }
}

/// Sees where the platform stands, and from some cycle on doesn't.
struct Blinded(u32);

impl Estimator for Blinded {
    fn reset(&mut self, _: &PlatformState) {}

    fn update(&mut self, _: &Observation<'_>) -> PlatformState {
        self.0 = self.0.saturating_sub(1);
        PlatformState { pose_known: self.0 > 0, ..PlatformState::default() }
    }

    fn sees_beyond_wheels(&self) -> bool {
        true
    }
}

/// An axis of a test's own: it failed where its process data say so.
#[derive(Default)]
struct Fails(bool);

impl Peripheral for Fails {
    fn read(&mut self, _: &CycleTime, bytes: &[u8], _: &mut [f64]) {
        self.0 = bytes[0] != 0;
    }

    fn readiness(&self) -> Readiness {
        Readiness { failed: self.0, ..Readiness::NOTHING_MOVES }
    }
}

fn registry() -> Registry {
    let mut registry = Registry::with_built_in();
    let inputs = vec![PdoPlan { index: 0x1A00, entries: parse_map("6000.1:8").unwrap() }];
    let defaults = PeripheralDefaults { inputs, ..Default::default() };
    registry.peripherals.add(kind("fails"), defaults, |_| Ok(Fails::default()));
    let laws = [("too_much", Quantity::Torque, 60.0), ("no_number", Quantity::Speed, f64::NAN)];
    for (name, quantity, value) in laws {
        registry.controllers.add(kind(name), move |_| Ok(Constant(quantity, value, GOOD_CYCLES)));
    }
    registry.estimators.add(kind("blinded"), |_| Ok(Blinded(GOOD_CYCLES)));
    for (name, speed_m_s, jump_m) in [("jump", 0.0, 0.6), ("away", 0.2, 0.0)] {
        registry.references.add(kind(name), move |_, _| Ok(Sideways { speed_m_s, jump_m }));
    }
    registry
}

fn bench(robot: &str, more: &str) -> Bench {
    let registry = registry();
    Bench::with_registry(plan_with(&format!("{robot}\n{more}\n"), &registry), &registry)
}

/// A robot that holds.
fn enabled(robot: &str, more: &str) -> Bench {
    let mut bench = bench(robot, more);
    bench.enable();
    bench
}

fn forward(bench: &mut Bench, speed_m_s: f64, cycles: u32) {
    for _ in 0..cycles {
        let twist = Twist2::new(speed_m_s, 0.0, 0.0);
        bench.step(Some(RequestKind::Velocity { twist, frame: Frame::Body }));
    }
}

/// The BMM driven forward.
fn driven(more: &str) -> Bench {
    let mut bench = enabled(BMM, more);
    forward(&mut bench, 0.3, 500);
    bench
}

/// Four mecanum wheels to and fro along x, their torques those of a platform of which one truly turns the other way.
fn wired_backwards(wheel: usize) -> Bench {
    let known = "[controller]\nmass_kg = 60.0\ninertia_kg_m2 = 4.0";
    let mut bench = enabled(&MECANUM.replace("[controller]", known), "");
    let kinematics = bench.kinematics.clone();
    let turned =
        |values: PerWheel| PerWheel::from_fn(4, |at| if at == wheel { -values[at] } else { values[at] });
    for cycle in 0..4000 {
        let vx_m_s = if cycle / 400 % 2 == 0 { 0.5 } else { -0.5 };
        let twist = Twist2::new(vx_m_s, 0.0, 0.0);
        let record = bench.step(Some(RequestKind::Velocity { twist, frame: Frame::Body }));
        if record.stop_reason == SafetyReason::Wiring {
            break;
        }
        let believed = kinematics.wheel_speeds_rad_s(record.setpoint.acceleration_in_odom);
        let truly = kinematics.twist(&turned(believed)).twist_in_base;
        let (mass_kg, inertia_kg_m2) = (bench.mass_kg, bench.inertia_kg_m2);
        let wrench =
            Wrench2::new(mass_kg * truly.vx_m_s, mass_kg * truly.vy_m_s, inertia_kg_m2 * truly.w_rad_s);
        // What moves nothing: the front wheels against those behind.
        let fights = PerWheel::from_fn(4, |at| if at < 2 { 3.0 } else { -3.0 } * vx_m_s.signum());
        let (moves, fights) = (turned(kinematics.wheel_torques_nm(wrench)), turned(fights));
        (0..4).for_each(|at| bench.lie_about_torque(at, moves[at] + fights[at]));
    }
    assert_eq!(bench.robot.record().stop_where, wheel as u64);
    bench
}

/// The BMM on a reference.
fn tracking(robot: &str, more: &str) -> Bench {
    let mut bench = enabled(robot, more);
    bench.step(Some(RequestKind::Track));
    bench
}

/// Runs until the robot stops for a reason: its phase then, and where it ends.
fn stops(mut bench: Bench, reason: SafetyReason) -> (Phase, Phase) {
    for _ in 0..9000 {
        bench.step(None);
        if bench.robot.record().stop_reason == reason {
            let first = bench.robot.phase();
            bench.run(3000);
            assert_eq!(bench.robot.record().stop_reason, reason, "it stays the cause");
            return (first, bench.robot.phase());
        }
    }
    panic!("never {reason:?}, but {:?} in {:?}", bench.robot.record().stop_reason, bench.robot.phase());
}

/// A robot that drove while somebody pressed a button of a terminal.
fn pressed(safety: &str) -> Bench {
    let mut bench = driven(&format!(
        "[safety]\n{safety}\n[[device]]\nname = \"button\"\nposition = 3\nkind = \"io\"\n\
         inputs = [{{ pdo = \"0x1A00\", map = \"6000.1:1\" }}]\n\
         input = [{{ name = \"stop\", object = \"6000.1\" }}, \
         {{ name = \"released\", object = \"6000.1\", scale = -1, offset = 1 }}]"
    ));
    bench.image.device_inputs[0][0] = 1;
    bench
}

/// What leads to a reason, and what it leads to; `None` for those that are no stop.
fn case(reason: SafetyReason) -> Option<(Phase, Phase)> {
    let robot = |from: &str, to: &str| BMM.replace(from, to);
    let fence = "[fence]\nrectangle_m = [-1.0, -1.0, 1.0, 1.0]\n[reference]\nkind = \"away\"";
    let bench = match reason {
        SafetyReason::None | SafetyReason::Torque => return None,
        SafetyReason::Requested => {
            let mut bench = driven("");
            bench.step(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
            bench
        }
        SafetyReason::WheelSpeed => {
            let mut bench = enabled(&robot("\"closed_loop_speed\"", "\"adaptive_torque\""), "");
            forward(&mut bench, 0.3, 500);
            // Somebody pushes.
            bench.twist_in_body = Twist2::new(0.0, 0.0, 6.0);
            bench.step(None);
            bench.step(None);
            bench.twist_in_body = Twist2::default();
            bench
        }
        SafetyReason::ReferenceSpeed => {
            let mut bench = driven("");
            forward(&mut bench, 1.2, 1);
            bench
        }
        SafetyReason::NotFinite => enabled(&robot("\"closed_loop_speed\"", "\"no_number\""), ""),
        // Nobody repeats the command.
        SafetyReason::CommandAge => driven(""),
        SafetyReason::ExchangeLost => {
            let mut bench = driven("");
            bench.exchange = Exchange::Lost;
            bench
        }
        SafetyReason::TrackingError => tracking(BMM, "[reference]\nkind = \"jump\""),
        SafetyReason::Drive => {
            let mut bench = driven("");
            bench.fail_drive(2);
            bench
        }
        SafetyReason::EnablingTimeout => {
            // Each step to operation takes a cycle of 1 ms, and there are more than two.
            let mut bench = bench(BMM, "[safety]\nenabling_timeout_ms = 2");
            bench.step(None);
            bench.step(Some(RequestKind::Enable));
            bench
        }
        SafetyReason::StopTimeout => {
            // From 0.3 m/s a ramp takes a quarter of a second.
            let mut bench = driven("[safety]\nstop_timeout_ms = 50");
            bench.step(Some(RequestKind::Stop(StopCategory::RampAndHold)));
            bench
        }
        SafetyReason::DeviceLost => {
            let mut bench = driven("");
            bench.exchange = Exchange::Without { wheels: 0b100, devices: 0 };
            bench
        }
        SafetyReason::Fence => tracking(BMM, fence),
        SafetyReason::WheelTorque => {
            let mut bench = driven("");
            bench.lie_about_torque(1, 25.0);
            bench
        }
        SafetyReason::Oscillation => {
            let mut bench = enabled(BMM, "");
            bench.ring(1, 10.0);
            bench
        }
        SafetyReason::WheelSlip => {
            let mut bench = enabled(BMM, "");
            // Hardly any force, and yet the wheels speed up as if they moved all of it.
            for (wheel, torque_nm) in [0.0, -0.3, 0.3].into_iter().enumerate() {
                bench.lie_about_torque(wheel, torque_nm);
            }
            bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(1.0, 0.0, 0.0) }));
            bench
        }
        SafetyReason::Wiring => wired_backwards(1),
        SafetyReason::EncoderDirection => {
            // It speeds up faster than any push would, and its third motor pushes back.
            let quick = BMM.replace("\nacceleration_m_s2 = 1.5", "\nacceleration_m_s2 = 15.0");
            let mut bench = enabled(&quick.replace("jerk_m_s3 = 40.0", "jerk_m_s3 = 4000.0"), "");
            bench.lie_about_torque(2, -7.0);
            forward(&mut bench, 0.9, 100);
            bench
        }
        SafetyReason::WeakMotor => {
            let mut bench = enabled(&BMM.replace("\"closed_loop_speed\"", "\"adaptive_torque\""), "");
            bench.friction_nm = 5.0;
            bench.lie_about_torque(1, 0.0);
            bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(1.0, 0.0, 0.0) }));
            bench
        }
        SafetyReason::WayBlocked => {
            let mut bench = enabled(BMM, "[avoidance]\ngive_up_s = 1.0");
            bench.step(Some(RequestKind::GoTo { odom_from_body: Pose2::new(1.0, 0.0, 0.0) }));
            bench.run(200);
            let obstacle = Obstacle { centre_m: [1.0, 0.0], radius_m: 0.2, velocity_m_s: [0.0; 2] };
            bench.step(Some(RequestKind::SetObstacle { index: 0, obstacle }));
            bench
        }
        SafetyReason::StopInput => pressed("stop_input = \"button.stop\""),
        SafetyReason::EnableInput => pressed("enable_input = \"button.released\""),
        SafetyReason::Axis => {
            let mut bench = driven("[[device]]\nname = \"lift\"\nposition = 3\nkind = \"fails\"");
            bench.image.device_inputs[0][0] = 1;
            bench
        }
        SafetyReason::PoseUnknown => {
            tracking(BMM, "[reference]\nkind = \"away\"\n[estimator]\nkind = \"blinded\"")
        }
    };
    Some(stops(bench, reason))
}

#[test]
fn every_reason_stops_the_robot_as_it_should() {
    // A reason without its line here fails to compile above, or fails below.
    let expected = |reason| match reason {
        SafetyReason::None | SafetyReason::Torque => None,
        SafetyReason::Requested => Some((Phase::Stopping, Phase::Disabled)),
        SafetyReason::WheelSpeed
        | SafetyReason::WheelTorque
        | SafetyReason::ReferenceSpeed
        | SafetyReason::TrackingError
        | SafetyReason::StopInput
        | SafetyReason::EnableInput
        | SafetyReason::Axis
        | SafetyReason::WheelSlip
        | SafetyReason::WeakMotor
        | SafetyReason::PoseUnknown => Some((Phase::Stopping, Phase::Fault)),
        SafetyReason::CommandAge | SafetyReason::Fence | SafetyReason::WayBlocked => {
            Some((Phase::Stopping, Phase::Holding))
        }
        SafetyReason::NotFinite
        | SafetyReason::Drive
        | SafetyReason::Oscillation
        | SafetyReason::Wiring
        | SafetyReason::StopTimeout
        | SafetyReason::DeviceLost => Some((Phase::QuickStopping, Phase::Fault)),
        // Nobody is heard: for so long as a stop may take.
        SafetyReason::ExchangeLost => Some((Phase::QuickStopping, Phase::QuickStopping)),
        SafetyReason::EnablingTimeout | SafetyReason::EncoderDirection => Some((Phase::Fault, Phase::Fault)),
    };
    let mut seen = 0;
    for reason in (0..64).filter_map(SafetyReason::from_code) {
        assert_eq!(case(reason), expected(reason), "{reason:?}");
        seen += 1;
    }
    assert_eq!(seen, 25, "every reason has had its turn");
}

#[test]
fn a_torque_above_its_limit_is_scaled_as_a_whole_and_told() {
    let mut bench = enabled(&BMM.replace("\"closed_loop_speed\"", "\"too_much\""), "");
    for _ in 0..2 * GOOD_CYCLES {
        let record = bench.step(None);
        if record.commands.values[0] == 60.0 {
            assert_eq!(record.allowed.commands.values[..3], [21.0; 3], "the limit of the robot's file");
            assert_eq!(
                (record.allowed.action, record.allowed.reason),
                (SafetyAction::Pass, SafetyReason::Torque)
            );
            return;
        }
        assert_eq!(record.allowed.reason, SafetyReason::None);
    }
    panic!("it never asked for too much");
}
