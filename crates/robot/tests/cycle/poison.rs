//! One wrong number, for one cycle, anywhere: always a defined stop, nothing of it goes out, and all is well afterwards.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_platform::Twist2;
use omnibase_robot::controllers::{AdaptiveTorque, ClosedLoopSpeed, DisturbanceObserver};
use omnibase_robot::devices::Cia402Device;
use omnibase_robot::estimators::WheelOdometry;
use omnibase_robot::references::Hold;
use omnibase_robot::signals::{
    Commands, CycleTime, DriveMeasurement, DriveProgress, Dynamics, Frame, GripReport, Measurements,
    PlatformState, Quantity, RequestAnswer, SafetyReason, Setpoint,
};
use omnibase_robot::stages::{Controller, Device, DriveCommand, Estimator, Gain, Observation, Reference};
use omnibase_robot::{CycleRecord, Phase, Registry, RequestKind};

use crate::support::{BMM, Bench, Random, kind, plan_with};

/// What is learnt of platform and floor, whatever came.
fn is_finite(record: &CycleRecord) -> bool {
    let GripReport {
        dynamics,
        mass_sigma_kg,
        slope_m_s2,
        slip_m_s,
        slipped_m,
        felt,
        friction,
        friction_sigma,
    } = &record.grip;
    let Dynamics { mass_kg, inertia_kg_m2, friction_n, mass_moment_kg_m } = dynamics;
    let numbers = [record.force_n, *felt, *mass_kg, *mass_sigma_kg, *inertia_kg_m2];
    let of_wheels = slip_m_s.iter().chain(slipped_m).chain(friction_n).chain(friction).chain(friction_sigma);
    numbers.iter().chain(mass_moment_kg_m).chain(slope_m_s2).chain(of_wheels).all(|number| number.is_finite())
}

const WRONG: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
/// Fields of the four stages together: 3 of a device, 14 of a state, 9 of a setpoint, 4 of commands.
const FIELDS: u64 = 30;

/// What is wrong now: 0 for nothing, else the field's number times 3 plus which number.
type Poison = Arc<AtomicU64>;

/// Puts the wrong number into one of a stage's fields, if it is this stage's turn.
fn poison(poison: &Poison, first: u64, fields: &mut [&mut f64]) {
    let code = poison.load(Ordering::Relaxed);
    if code == 0 {
        return;
    }
    let (field, wrong) = ((code - 1) / 3, (code - 1) % 3);
    if let Some(slot) = field.checked_sub(first).and_then(|at| fields.get_mut(at as usize)) {
        **slot = WRONG[wrong as usize];
    }
}

struct Poisoned<Stage>(Stage, Poison);

impl Device for Poisoned<Cia402Device> {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        let mut read = self.0.read(time, inputs);
        poison(&self.1, 0, &mut [&mut read.increment_rad, &mut read.speed_rad_s, &mut read.torque_nm]);
        read
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

impl Estimator for Poisoned<WheelOdometry> {
    fn reset(&mut self, from: &PlatformState) {
        self.0.reset(from);
    }
    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let mut state = self.0.update(observation);
        let PlatformState {
            odom_from_body: pose,
            twist_in_body: twist,
            covariance: [a, b, c, d, e, f],
            twist_age_s: age,
            slip_residual_m_s: slip,
            ..
        } = &mut state;
        let fields: &mut [&mut f64] = &mut [
            &mut pose.x_m,
            &mut pose.y_m,
            &mut pose.heading_rad,
            &mut twist.vx_m_s,
            &mut twist.vy_m_s,
            &mut twist.w_rad_s,
            age,
            slip,
            a,
            b,
            c,
            d,
            e,
            f,
        ];
        poison(&self.1, 3, fields);
        state
    }
}

impl Reference for Poisoned<Hold> {
    fn start(&mut self, from: &Setpoint) {
        self.0.start(from);
    }
    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        let mut sample = self.0.sample(since_start_s);
        let Setpoint {
            odom_from_body: pose, twist_in_odom: twist, acceleration_in_odom: acceleration, ..
        } = &mut sample;
        let fields: &mut [&mut f64] = &mut [
            &mut pose.x_m,
            &mut pose.y_m,
            &mut pose.heading_rad,
            &mut twist.vx_m_s,
            &mut twist.vy_m_s,
            &mut twist.w_rad_s,
            &mut acceleration.vx_m_s,
            &mut acceleration.vy_m_s,
            &mut acceleration.w_rad_s,
        ];
        poison(&self.1, 17, fields);
        sample
    }
}

impl Controller for Poisoned<Box<dyn Controller>> {
    fn quantity(&self) -> Quantity {
        self.0.quantity()
    }
    fn reset(&mut self) {
        self.0.reset();
    }
    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        let mut commands = self.0.update(time, state, setpoint);
        let [a, b, c, ..] = &mut commands.values;
        poison(&self.1, 26, &mut [a, b, c, &mut commands.saturation]);
        commands
    }
    fn gain(&self, index: usize) -> Option<Gain> {
        self.0.gain(index)
    }
    fn set_gain(&mut self, index: usize, value: f64) {
        self.0.set_gain(index, value);
    }
    fn force_n(&self) -> f64 {
        self.0.force_n()
    }
    fn knows(&mut self, dynamics: &Dynamics) {
        self.0.knows(dynamics);
    }
    fn feels(&mut self, measurements: &Measurements) {
        self.0.feels(measurements);
    }
}

fn poisoned_bench(law: &str) -> (Bench, Poison) {
    let poison = Poison::default();
    let mut registry = Registry::with_built_in();
    let defaults = registry.devices.defaults("sgdv").cloned().unwrap();
    let mine = poison.clone();
    let device = move |plan: &_| Ok(Poisoned(Cia402Device::new(plan)?, mine.clone()));
    registry.devices.add(kind("poisoned"), defaults, device);
    let mine = poison.clone();
    registry
        .estimators
        .add(kind("poisoned"), move |plan| Ok(Poisoned(WheelOdometry::new(plan)?, mine.clone())));
    let mine = poison.clone();
    registry.references.add(kind("poisoned"), move |_, _| Ok(Poisoned(Hold::default(), mine.clone())));
    let mine = poison.clone();
    registry.controllers.add(kind("poisoned_speed"), move |plan| {
        let inner: Box<dyn Controller> = Box::new(ClosedLoopSpeed::new(plan)?);
        Ok(Poisoned(inner, mine.clone()))
    });
    let mine = poison.clone();
    registry.controllers.add(kind("poisoned_torque"), move |plan| {
        let inner: Box<dyn Controller> = Box::new(AdaptiveTorque::new(plan)?);
        Ok(Poisoned(inner, mine.clone()))
    });
    let mine = poison.clone();
    registry.controllers.add(kind("poisoned_observer"), move |plan| {
        let inner: Box<dyn Controller> = Box::new(DisturbanceObserver::new(plan)?);
        Ok(Poisoned(inner, mine.clone()))
    });
    let text = BMM.replace("\"sgdv\"", "\"poisoned\"").replace("\"closed_loop_speed\"", law)
        + "\n[estimator]\nkind = \"poisoned\"\n[reference]\nkind = \"poisoned\"\n";
    (Bench::with_registry(plan_with(&text, &registry), &registry), poison)
}

#[test]
fn one_wrong_number_anywhere_stops_and_leaves_nothing_behind() {
    let mut random = Random(0x5EED_0003);
    for law in ["\"poisoned_speed\"", "\"poisoned_torque\"", "\"poisoned_observer\""] {
        let (mut bench, poison) = poisoned_bench(law);
        for code in 1..=3 * FIELDS {
            bench.enable();
            bench.step(Some(RequestKind::Track));
            // At any cycle: 1 to 60 later.
            bench.run(30 + random.within(29.0) as u64);
            assert_eq!(bench.robot.phase(), Phase::Tracking, "{law} {code}");
            poison.store(code, Ordering::Relaxed);
            let record = bench.step(None);
            poison.store(0, Ordering::Relaxed);
            assert_eq!(record.allowed.reason, SafetyReason::NotFinite, "{law} {code}");
            assert!(record.allowed.commands.is_finite(), "{law} {code}");
            assert!(is_finite(&record), "{law} {code}");
            assert!((0..3).all(|wheel| bench.control_word(wheel) == 0x02), "{law} {code}: quick stop");
            for _ in 0..6000 {
                let record = bench.step(None);
                assert!(
                    record.allowed.commands.is_finite() && record.estimates().iter().all(|e| e.is_finite())
                );
                if record.phase == Phase::Fault {
                    break;
                }
            }
            assert_eq!(bench.robot.phase(), Phase::Fault, "{law} {code}");
            bench.step(Some(RequestKind::Acknowledge));
            assert_eq!(bench.robot.phase(), Phase::Disabled, "{law} {code}");
            bench.run(5);
            let state = bench.robot.record().state;
            assert!(state.is_finite(), "{law} {code}");
            // What a wheel turned meanwhile is unknown where its count was no number.
            assert_eq!(!state.pose_known, code <= 3, "{law} {code}");
            let odom_from_body = state.odom_from_body;
            bench.step(Some(RequestKind::SetPose { odom_from_body, sigma_m: 0.0, sigma_rad: 0.0 }));
        }
    }
}

#[test]
fn requests_that_are_no_numbers_are_refused_and_change_nothing() {
    for law in ["\"poisoned_speed\"", "\"poisoned_torque\"", "\"poisoned_observer\""] {
        let (mut bench, _) = poisoned_bench(law);
        bench.enable();
        for wrong in WRONG {
            for twist in
                [Twist2::new(wrong, 0.0, 0.0), Twist2::new(0.0, wrong, 0.0), Twist2::new(0.0, 0.0, wrong)]
            {
                for frame in [Frame::Body, Frame::Odom] {
                    let record = bench.step(Some(RequestKind::Velocity { twist, frame }));
                    assert_eq!((record.answer, record.phase), (RequestAnswer::Refused, Phase::Holding));
                }
            }
            for index in 0..15 {
                let before: Vec<f64> = bench.robot.settings().map(|(_, gain)| gain.value).collect();
                let record = bench.step(Some(RequestKind::Set {
                    index,
                    value: wrong,
                    batch: omnibase_robot::signals::Batch::ALONE,
                }));
                assert_eq!(record.answer, RequestAnswer::Refused);
                assert!(bench.robot.settings().map(|(_, gain)| gain.value).eq(before));
            }
        }
    }
}

#[test]
fn any_bytes_from_the_drives_end_in_numbers() {
    // Process data as noise: 20 lives of 2000 cycles; a stop may come or not, a panic or a NaN may not.
    let mut random = Random(0x5EED_0004);
    for law in ["\"poisoned_speed\"", "\"poisoned_torque\"", "\"poisoned_observer\""] {
        for _ in 0..10 {
            let (mut bench, _) = poisoned_bench(law);
            bench.enable();
            bench.step(Some(RequestKind::Track));
            for _ in 0..2000 {
                bench.noise = (random.within(1.0) > 0.9).then(|| random.next());
                let record = bench.step(None);
                assert!(record.state.is_finite() && record.allowed.commands.is_finite());
                assert!(is_finite(&record));
            }
        }
    }
}
