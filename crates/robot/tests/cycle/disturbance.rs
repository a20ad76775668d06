//! A force that no model tells, while a path is driven: what each law of torque makes of it.

use omnibase_platform::{Pose2, Twist2, Wrench2};
use omnibase_robot::controllers::DisturbanceObserver;
use omnibase_robot::signals::{Measurements, PlatformState, ReferenceStatus, SafetyReason, Setpoint};
use omnibase_robot::stages::Controller;
use omnibase_robot::{CycleTime, Exchange, Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, Random, laws_of_torque, plan};

/// The one whose integral takes a push, and the other one.
const LAWS: [&str; 2] = ["adaptive_torque", OBSERVER];
const OBSERVER: &str = "disturbance_observer";
/// A push along x, N, and how long it lasts, cycles of 1 ms.
const PUSH_N: f64 = 60.0;
const CYCLES: u64 = 5000;

/// A push on the way round a circle.
#[derive(Clone, Copy, Debug)]
struct Push {
    law: &'static str,
    heading: &'static str,
    /// Of so many exchanges one is lost.
    lost_every: u64,
    wheel_torque_nm: f64,
}

const CIRCLE: &str = "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 10.0\n";

/// What it came to.
#[derive(Clone, Copy, Debug)]
struct Pushed {
    /// The greatest error while pushed, m, and the root of its mean square.
    most_m: f64,
    rms_m: f64,
    /// The force that the law found by the end of the push, N, and the most on the way.
    found_n: f64,
    most_n: f64,
    /// In how many cycles torques were scaled down.
    saturated: u32,
    /// The error two seconds after it, m.
    after_m: f64,
}

const PLAIN: Push = Push { law: OBSERVER, heading: "fixed", lost_every: u64::MAX, wheel_torque_nm: 21.0 };

fn robot(law: &str, more: &str) -> String {
    BMM.replace("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\"")) + more
}

impl Push {
    /// Pushes the BMM.
    fn ride(self) -> Pushed {
        let Push { law, heading, lost_every, wheel_torque_nm } = self;
        let circle = format!(
            "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 30.0\nheading = \"{heading}\"\n\
             [safety]\ntracking_error_m = 10.0\n"
        );
        let limit = format!("wheel_torque_nm = {wheel_torque_nm:?}");
        let mut bench = Bench::new(plan(&robot(law, &circle).replace("wheel_torque_nm = 21.0", &limit)));
        bench.enable();
        bench.step(Some(RequestKind::Track));
        bench.run(10_000);
        bench.push = Wrench2::new(-PUSH_N, 0.0, 0.0);
        let (mut most_m, mut square_m2, mut most_n, mut saturated) = (0.0_f64, 0.0, 0.0_f64, 0);
        for cycle in 0..CYCLES {
            bench.exchange = if cycle % lost_every == 0 { Exchange::Lost } else { Exchange::Complete };
            let before = bench.pose;
            let record = bench.step(None);
            assert_eq!(record.phase, Phase::Tracking, "{self:?}: {:?}", record.stop_reason);
            let off_m = record.wished.odom_from_body.distance_m(before);
            most_m = most_m.max(off_m);
            square_m2 += off_m * off_m;
            most_n = most_n.max(record.force_n);
            saturated += u32::from(record.commands.saturation < 1.0);
        }
        bench.exchange = Exchange::Complete;
        let found_n = bench.robot.record().force_n;
        bench.push = Wrench2::default();
        let record = bench.run(2000);
        let after_m = record.wished.odom_from_body.distance_m(bench.pose);
        let rms_m = (square_m2 / CYCLES as f64).sqrt();
        let pushed = Pushed { most_m, rms_m, found_n, most_n, saturated, after_m };
        println!("{self:?}: {pushed:?}");
        pushed
    }
}

#[test]
fn an_observer_takes_a_push_that_an_added_up_error_takes_slowly() {
    let [adaptive, observer] = LAWS.map(|law| Push { law, ..PLAIN }.ride());
    assert!((observer.found_n - PUSH_N).abs() < 0.15 * PUSH_N, "{observer:?}");
    assert!(observer.most_m < 0.92 * adaptive.most_m, "{observer:?} {adaptive:?}");
    assert!(observer.rms_m < 0.8 * adaptive.rms_m, "{observer:?} {adaptive:?}");
    assert!(observer.after_m < 0.6 * adaptive.after_m, "{observer:?} {adaptive:?}");
}

#[test]
fn a_push_is_taken_wherever_the_platform_heads() {
    for law in laws_of_torque() {
        let [fixed, turning] =
            ["fixed", "follows_tangent"].map(|heading| Push { law, heading, ..PLAIN }.ride());
        assert!((turning.found_n - fixed.found_n).abs() < 0.1 * PUSH_N, "{turning:?} {fixed:?}");
        assert!(turning.rms_m < 1.1 * fixed.rms_m, "{turning:?} {fixed:?}");
        assert!(turning.after_m < 1.2 * fixed.after_m, "{turning:?} {fixed:?}");
    }
}

#[test]
fn an_observer_bears_lost_exchanges() {
    let whole = PLAIN.ride();
    for lost_every in [7, 2] {
        let lossy = Push { lost_every, ..PLAIN }.ride();
        assert!((lossy.found_n - PUSH_N).abs() < 0.2 * PUSH_N, "{lossy:?}");
        assert!(lossy.rms_m < 1.5 * whole.rms_m, "{lossy:?} {whole:?}");
    }
}

#[test]
fn torques_that_are_scaled_down_wind_no_observer_up() {
    let weak = Push { wheel_torque_nm: 2.5, ..PLAIN }.ride();
    assert!(weak.saturated > 1000, "{weak:?}");
    assert!(weak.most_n < 1.2 * PUSH_N, "{weak:?}");
}

#[test]
fn at_rest_no_force_is_looked_for() {
    for law in laws_of_torque() {
        let mut bench = Bench::new(plan(&robot(law, "")));
        bench.enable();
        bench.push = Wrench2::new(PUSH_N, 0.0, 0.0);
        let record = bench.run(2000);
        assert_eq!((record.phase, record.force_n), (Phase::Holding, 0.0), "{law}");
    }
}

#[test]
fn what_was_found_ends_with_the_stop_of_a_drive_that_fails_and_comes_back() {
    for law in laws_of_torque() {
        let mut bench = Bench::new(plan(&robot(law, CIRCLE)));
        bench.enable();
        bench.step(Some(RequestKind::Track));
        bench.run(1000);
        bench.push = Wrench2::new(-PUSH_N, 0.0, 0.0);
        bench.run(3000);
        assert!(bench.robot.record().force_n > 0.3 * PUSH_N, "{law}: {:?}", bench.robot.record().force_n);
        bench.push = Wrench2::default();
        bench.fail_drive(1);
        let record = bench.run(3000);
        assert_eq!((record.phase, record.stop_reason), (Phase::Fault, SafetyReason::Drive), "{law}");
        bench.repair_drive(1);
        bench.step(Some(RequestKind::Acknowledge));
        bench.enable();
        assert_eq!(bench.robot.record().force_n, 0.0, "{law}");
        let before = bench.pose;
        let record = bench.run(500);
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None), "{law}");
        assert!(bench.pose.distance_m(before) < 1e-4, "{law}: nothing moves without a person");
    }
}

#[test]
fn a_drive_that_shows_a_torque_which_it_does_not_give_leads_no_observer_astray() {
    for shown_nm in [0.0, 3.0, -3.0] {
        let mut bench = Bench::new(plan(&robot(OBSERVER, CIRCLE)));
        bench.enable();
        bench.step(Some(RequestKind::Track));
        bench.run(1000);
        bench.lie_about_torque(1, shown_nm);
        let mut most_m = 0.0_f64;
        for _ in 0..8000 {
            let before = bench.pose;
            let record = bench.step(None);
            if record.phase != Phase::Tracking {
                break;
            }
            most_m = most_m.max(record.wished.odom_from_body.distance_m(before));
        }
        let record = bench.robot.record();
        println!("{shown_nm} N·m shown: {:?}, {most_m} m, {} N", record.stop_reason, record.force_n);
        assert_eq!(record.stop_reason, SafetyReason::WeakMotor, "{shown_nm}");
        assert!(most_m < 0.015, "{shown_nm}: {most_m}");
    }
}

/// An observer alone, beside a platform whose speeds and torques a test makes.
struct Alone {
    law: DisturbanceObserver,
    cycle: u64,
    measurements: Measurements,
}

impl Alone {
    fn new() -> Alone {
        let plan = plan(&robot(OBSERVER, "\n[estimator]\nspeed_filter_1_s = 100.0\n"));
        let measurements = Measurements { wheels: plan.drives.len(), ..Measurements::default() };
        Alone { law: DisturbanceObserver::new(&plan).expect("a law"), cycle: 0, measurements }
    }

    /// A cycle at a wished acceleration along x, m/s², the platform faster than the setpoint by so much, m/s; what it was asked for, N·m.
    fn cycle(&mut self, acceleration_m_s2: f64, faster_m_s: f64, torques_nm: Option<[f64; 3]>) -> [f64; 3] {
        if let Some(torques_nm) = torques_nm {
            for (drive, torque_nm) in self.measurements.drives.iter_mut().zip(torques_nm) {
                drive.torque_nm = torque_nm;
            }
            self.law.feels(&self.measurements);
        }
        let setpoint = Setpoint {
            odom_from_body: Pose2::default(),
            twist_in_odom: Twist2::new(0.5, 0.0, 0.0),
            acceleration_in_odom: Twist2::new(acceleration_m_s2, 0.0, 0.0),
            status: ReferenceStatus::Moving,
        };
        let state = PlatformState {
            twist_in_body: Twist2::new(0.5 + faster_m_s, 0.0, 0.0),
            ..PlatformState::default()
        };
        let time = CycleTime::on_grid(self.cycle, 1_000_000);
        self.cycle += 1;
        let commands = self.law.update(&time, &state, &setpoint);
        std::array::from_fn(|wheel| commands.values[wheel])
    }
}

#[test]
fn torques_as_they_were_asked_for_are_no_force_however_the_way_bends() {
    let (mut alone, mut random) = (Alone::new(), Random(0x5EED_0013));
    // Asked for in this cycle, it is measured in the third behind it.
    let mut asked = [[0.0; 3]; 3];
    for cycle in 0..500 {
        let measured = asked[cycle % 3];
        asked[cycle % 3] = alone.cycle(random.within(1.5), 0.0, Some(measured));
        assert!(alone.law.force_n() < 1e-9, "cycle {cycle}: {} N", alone.law.force_n());
    }
}

#[test]
fn what_accelerates_the_platform_is_no_force_also_behind_lost_exchanges() {
    // 105 N along x accelerate the 70 kg of the file, as the filter of the measured speed shows it.
    let plan = plan(&robot(OBSERVER, ""));
    let (force_n, filter_1_s) = (105.0, 100.0);
    let mass_kg = plan.controller.mass_kg.expect("the file gives it");
    // At an even wished speed nothing is fed forward: all of it is beside the model.
    let told = plan.kinematics.wheel_torques_nm(Wrench2::new(force_n, 0.0, 0.0));
    let torques_nm = std::array::from_fn(|wheel| told[wheel]);
    for (lost_every, most_n) in [(u64::MAX, 0.03), (3, 0.06)] {
        let mut alone = Alone::new();
        let (mut faster_m_s, mut gained_m_s, mut worst_n) = (0.0, 0.0, 0.0_f64);
        for cycle in 0..400_u64 {
            let is_heard = cycle % lost_every != 1;
            gained_m_s += 1e-3 * force_n / mass_kg;
            faster_m_s += (1.0 - (-1e-3_f64 * filter_1_s).exp()) * (gained_m_s - faster_m_s);
            alone.cycle(0.0, faster_m_s, is_heard.then_some(torques_nm));
            worst_n = worst_n.max(alone.law.force_n());
        }
        println!("of {lost_every} exchanges one lost: {worst_n} N");
        assert!(worst_n < most_n, "of {lost_every} exchanges one lost: {worst_n} N");
    }
}

#[test]
fn an_observer_has_gains_for_heavy_platforms_as_the_other_law_has() {
    for mass_kg in [30.0, 70.0, 170.0, 255.0, 400.0] {
        let heavy = |law| {
            let told = format!("mass_kg = {mass_kg:?}            #");
            let inertia = format!("inertia_kg_m2 = {:?}\n\n", 0.1 * mass_kg);
            plan(
                &robot(law, "")
                    .replace("mass_kg = 70.0            #", &told)
                    .replace("inertia_kg_m2 = 7.0\n\n", &inertia),
            )
        };
        let [adaptive, observer] = LAWS.map(|law| {
            let mut made = Registry::with_built_in().make_controllers(&heavy(law)).expect(law);
            made.remove(0).design().expect("a design").gains
        });
        let gains = observer[0];
        println!("{mass_kg} kg: {gains:?}, of the other law {:?}", adaptive[0]);
        let part = gains.stiffness() / adaptive[0].stiffness();
        assert!(gains.observer_1_s > 0.0 && part > 0.8, "{mass_kg} kg: {gains:?}, {part}");
    }
}
