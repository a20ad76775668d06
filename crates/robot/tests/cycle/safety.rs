//! A number that isn't finite, anywhere: always a defined stop.

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::signals::{
    Commands, CycleTime, DriveMeasurement, DriveProgress, PlatformState, Quantity, ReferenceStatus,
    SafetyReason, Setpoint, Stage,
};
use omnibase_robot::stages::{Controller, Device, DriveCommand, Estimator, Observation, Reference};
use omnibase_robot::{Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, kind, plan_with};

/// Cycles after which the stages below give something that isn't finite.
const GOOD_CYCLES: u32 = 400;

/// Counts the calls of a stage and says when it is to break.
#[derive(Default)]
struct Fuse(u32);

impl Fuse {
    fn blown(&mut self) -> bool {
        self.0 += 1;
        self.0 > GOOD_CYCLES
    }
}

struct BrokenDevice(Box<dyn Device>, Fuse);

impl Device for BrokenDevice {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        let measured = self.0.read(time, inputs);
        if self.1.blown() { DriveMeasurement { torque_nm: f64::NAN, ..measured } } else { measured }
    }

    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress {
        self.0.write(time, command, outputs)
    }

    fn acknowledge(&mut self) {
        self.0.acknowledge();
    }

    fn problem(&self) -> Option<String> {
        self.0.problem()
    }
}

struct BrokenEstimator(Box<dyn Estimator>, Fuse, f64);

impl Estimator for BrokenEstimator {
    fn reset(&mut self, from: &PlatformState) {
        self.0.reset(from);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let mut state = self.0.update(observation);
        if self.1.blown() {
            state.odom_from_body.heading_rad = self.2;
        }
        state
    }
}

struct BrokenReference(Fuse, f64);

impl Reference for BrokenReference {
    fn sample(&mut self, _: f64) -> Setpoint {
        let mut setpoint = Setpoint::at_rest(Pose2::default());
        if self.0.blown() {
            setpoint.acceleration_in_odom = Twist2::new(0.0, self.1, 0.0);
        }
        setpoint
    }
}

struct BrokenController(Fuse, f64, Quantity);

impl Controller for BrokenController {
    fn quantity(&self) -> Quantity {
        self.2
    }

    fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
        let mut commands = Commands { quantity: self.2, ..Commands::default() };
        if self.0.blown() {
            commands.values[1] = self.1;
        }
        commands
    }
}

/// Runs until the stage breaks; then the drives brake by themselves, lose torque, and wait for a person.
fn stops(text: &str, registry: &Registry, stage: Stage) {
    let mut bench = Bench::with_registry(plan_with(text, registry), registry);
    bench.enable();
    bench.step(Some(RequestKind::Track));
    for _ in 0..2 * GOOD_CYCLES {
        let record = bench.step(None);
        if record.allowed.reason == SafetyReason::NotFinite {
            assert_eq!(record.allowed.where_index, stage.code(), "{stage:?}");
            assert_eq!(
                bench.control_word(0),
                0x02,
                "{stage:?}: the drives' own quick stop, in the same cycle"
            );
            break;
        }
        assert_eq!(bench.control_word(0), 0x0F, "{stage:?}");
    }
    assert_eq!(bench.robot.phase(), Phase::QuickStopping, "{stage:?}");
    let record = bench.run(6000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::NotFinite), "{stage:?}");
    for wheel in 0..3 {
        assert_eq!(bench.control_word(wheel), 0, "{stage:?}: without torque");
        assert_ne!(bench.status(wheel) & 0x6F, 0x27, "{stage:?}");
    }
}

#[test]
fn what_is_not_finite_stops_wherever_it_comes_from() {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut registry = Registry::with_built_in();
        let defaults = registry.devices.defaults("sgdv").cloned().unwrap();
        registry.devices.add(kind("broken"), defaults, |plan| {
            let inner = Box::new(omnibase_robot::devices::Cia402Device::new(plan)?);
            Ok(BrokenDevice(inner, Fuse::default()))
        });
        registry.estimators.add(kind("broken"), move |plan| {
            let inner = Box::new(omnibase_robot::estimators::WheelOdometry::new(plan)?);
            Ok(BrokenEstimator(inner, Fuse::default(), wrong))
        });
        registry.references.add(kind("broken"), move |_, _| Ok(BrokenReference(Fuse::default(), wrong)));
        for (name, quantity) in [("broken_speed", Quantity::Speed), ("broken_torque", Quantity::Torque)] {
            registry
                .controllers
                .add(kind(name), move |_| Ok(BrokenController(Fuse::default(), wrong, quantity)));
        }
        stops(&BMM.replace("\"sgdv\"", "\"broken\""), &registry, Stage::Device);
        stops(&format!("{BMM}\n[estimator]\nkind = \"broken\"\n"), &registry, Stage::Estimator);
        stops(&format!("{BMM}\n[reference]\nkind = \"broken\"\n"), &registry, Stage::Reference);
        stops(&BMM.replace("\"closed_loop_speed\"", "\"broken_speed\""), &registry, Stage::Controller);
        stops(&BMM.replace("\"closed_loop_speed\"", "\"broken_torque\""), &registry, Stage::Controller);
    }
}

#[test]
fn an_obstacle_far_away_hides_no_plan_that_jumps() {
    struct Jump(Fuse);
    impl Reference for Jump {
        fn sample(&mut self, _: f64) -> Setpoint {
            let y_m = if self.0.blown() { 1.0 } else { 0.0 };
            let place = Setpoint::at_rest(Pose2 { y_m, ..Pose2::default() });
            Setpoint { status: ReferenceStatus::Moving, ..place }
        }
    }
    let mut registry = Registry::with_built_in();
    registry.references.add(kind("jump"), |_, _| Ok(Jump(Fuse::default())));
    let far = "\n[reference]\nkind = \"jump\"\n[[obstacle]]\ncentre_m = [90.0, 0.0]\nradius_m = 0.2\n";
    let mut bench = Bench::with_registry(plan_with(&format!("{BMM}{far}"), &registry), &registry);
    bench.enable();
    bench.step(Some(RequestKind::Track));
    let record = bench.run(2 * u64::from(GOOD_CYCLES));
    assert_eq!(record.stop_reason, SafetyReason::TrackingError);
}

#[test]
fn a_users_controller_is_held_to_the_wheels_limits_too() {
    struct Greedy;
    impl Controller for Greedy {
        fn quantity(&self) -> Quantity {
            Quantity::Speed
        }
        fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
            let mut commands = Commands { quantity: Quantity::Speed, ..Commands::default() };
            commands.values[..3].copy_from_slice(&[30.0, -60.0, 15.0]);
            commands
        }
    }
    let mut registry = Registry::with_built_in();
    registry.controllers.add(kind("greedy"), |_| Ok(Greedy));
    let text = BMM.replace("\"closed_loop_speed\"", "\"greedy\"");
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.enable();
    let allowed = bench.step(None).allowed;
    assert_eq!(allowed.commands.values[..3], [7.5, -15.0, 3.75], "direction kept, greatest at its limit");
    assert_eq!(allowed.commands.saturation, 0.25);
}

#[test]
fn commands_of_another_quantity_than_the_law_names_stop() {
    /// Names speeds, for which the maps were checked, and commands torques.
    struct Mistaken;
    impl Controller for Mistaken {
        fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
            Commands { quantity: Quantity::Torque, ..Commands::default() }
        }
    }
    let mut registry = Registry::with_built_in();
    registry.controllers.add(kind("mistaken"), |_| Ok(Mistaken));
    let text = BMM.replace("\"closed_loop_speed\"", "\"mistaken\"");
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.enable();
    assert_eq!(bench.run(3).stop_reason, SafetyReason::NotFinite);
}
