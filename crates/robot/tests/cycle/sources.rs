//! What other programs send: named, aged, believed while it is young, sound and newer than what was there.

use std::sync::{Arc, Mutex};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::signals::{
    Between, Frame, Heard, PlatformState, PoseMeasurement, RequestAnswer, SafetyReason, VelocityMeasurement,
};
use omnibase_robot::stages::{Estimator, Observation};
use omnibase_robot::{CycleRecord, ImageBuffer, Phase, Registry, RequestKind, Robot};

use crate::support::{BMM, Bench, kind, plan, plan_with};

const SOURCES: &str = "
[[source]]
name = \"gate\"
max_age_ms = 20

[[source.input]]
name = \"open\"

[[source.input]]
name = \"force\"
unit = \"N\"
least = -100.0
greatest = 100.0

[[source]]
name = \"mocap\"
carries = \"pose\"
max_age_ms = 50

[[source]]
name = \"flow\"
carries = \"velocity_in_body\"
";
const GATE: usize = 0;
const MOCAP: usize = 1;
const FLOW: usize = 2;
const MS: u64 = 1_000_000;

fn text() -> String {
    format!("{BMM}{SOURCES}")
}

/// What is sent, so long before the cycle that comes next.
fn sent(bench: &Bench, age_ns: u64, values: &[f64]) -> Heard {
    let now_ns = bench.index * bench.plan.bus.cycle_ns;
    let mut heard = Heard { instant_ns: now_ns - age_ns, ..Heard::NOTHING };
    heard.values[..values.len()].copy_from_slice(values);
    heard
}

fn hear(bench: &mut Bench, source: usize, age_ns: u64, values: &[f64]) {
    let heard = sent(bench, age_ns, values);
    bench.robot.hear(source, &heard);
}

fn value(record: &CycleRecord, place: usize) -> Option<f64> {
    record.signals.believed(place)
}

#[test]
fn a_value_is_believed_from_its_instant_on_for_so_long_and_no_longer() {
    let mut bench = Bench::new(plan(&text()));
    bench.run(100);
    assert!(bench.robot.record().signals.ages_s[..3].iter().all(|age_s| age_s.is_infinite()));
    // It took 15 ms on its way, and counts from where it was measured.
    hear(&mut bench, GATE, 15 * MS, &[1.0, 5.0]);
    for cycle in 0..=5 {
        let record = bench.step(None);
        assert_eq!((value(&record, 0), value(&record, 1)), (Some(1.0), Some(5.0)), "after {cycle}");
        assert!((record.signals.ages_s[GATE] - f64::from(15 + cycle) * 1e-3).abs() < 1e-12);
    }
    let record = bench.step(None);
    assert_eq!((value(&record, 0), value(&record, 1)), (None, None), "21 ms old");
    assert_eq!(record.signals.inputs[..2], [1.0, 5.0], "the last that was heard");
}

#[test]
fn what_was_overtaken_or_is_of_the_future_changes_nothing() {
    let mut bench = Bench::new(plan(&text()));
    bench.run(100);
    hear(&mut bench, GATE, 2 * MS, &[1.0, 5.0]);
    bench.step(None);
    for (age_ns, is_heard) in [(10 * MS, 0), (4 * MS + 1, 0), (2 * MS, 1)] {
        hear(&mut bench, GATE, age_ns, &[0.0, 7.0]);
        let record = bench.step(None);
        assert_eq!(record.signals.heard, is_heard, "{age_ns} ns old");
        assert_eq!(value(&record, 0), Some(f64::from(is_heard == 0)));
    }
    let ahead = Heard { instant_ns: (bench.index + 5) * MS, ..sent(&bench, 0, &[1.0, 1.0]) };
    bench.robot.hear(GATE, &ahead);
    let record = bench.step(None);
    assert_eq!((record.signals.heard, value(&record, 0)), (0, Some(0.0)));
    // A source that the robot hasn't.
    bench.robot.hear(7, &ahead);
    bench.step(None);
}

#[test]
fn no_number_and_what_lies_beyond_its_bounds_isnt_believed_and_hides_nothing_else() {
    let mut bench = Bench::new(plan(&text()));
    bench.run(100);
    for lie in [f64::NAN, f64::INFINITY, 1e308, 100.1, -101.0] {
        hear(&mut bench, GATE, 0, &[1.0, lie]);
        let record = bench.step(None);
        assert_eq!((value(&record, 0), value(&record, 1)), (Some(1.0), None), "{lie}");
    }
    hear(&mut bench, GATE, 0, &[1.0, -100.0]);
    assert_eq!(value(&bench.step(None), 1), Some(-100.0));
}

/// What an estimator saw of poses and velocities.
type Readings = (Option<PoseMeasurement>, Option<VelocityMeasurement>, Option<f64>);

#[derive(Default)]
struct Onlooker(Arc<Mutex<Vec<Readings>>>);

impl Estimator for Onlooker {
    fn reset(&mut self, _: &PlatformState) {}

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let inputs = &observation.inputs;
        let seen = (inputs.pose("mocap"), inputs.velocity("flow"), inputs.age_s("gate"));
        assert_eq!(inputs.pose("flow"), None, "it sends no pose");
        assert_eq!(inputs.velocity("elsewhere"), None);
        self.0.lock().unwrap().push(seen);
        PlatformState::default()
    }
}

#[test]
fn stages_see_poses_and_velocities_whole_or_not_at_all() {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let mut registry = Registry::with_built_in();
    let shared = seen.clone();
    registry.estimators.add(kind("onlooker"), move |_| Ok(Onlooker(shared.clone())));
    let text = text() + "\n[estimator]\nkind = \"onlooker\"\n";
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.run(10);
    let pose = [1.0, 2.0, 0.3, 4e-4, 0.0, 0.0, 4e-4, 0.0, 1e-4];
    let last = |bench: &mut Bench, pose: &[f64], velocity: &[f64]| {
        hear(bench, MOCAP, 3 * MS, pose);
        hear(bench, FLOW, MS, velocity);
        bench.step(None);
        *seen.lock().unwrap().last().unwrap()
    };
    let (told_pose, told_velocity, gate_age_s) = last(&mut bench, &pose, &[0.1, -0.2, 0.3]);
    assert_eq!(
        told_pose,
        Some(PoseMeasurement {
            odom_from_body: Pose2 { x_m: 1.0, y_m: 2.0, heading_rad: 0.3 },
            covariance: [4e-4, 0.0, 0.0, 4e-4, 0.0, 1e-4],
            age_s: 0.003,
        })
    );
    assert_eq!(
        told_velocity,
        Some(VelocityMeasurement { twist: Twist2::new(0.1, -0.2, 0.3), frame: Frame::Body, age_s: 0.001 })
    );
    assert_eq!(gate_age_s, Some(f64::INFINITY));
    let mut negative = pose;
    negative[3] = -4e-4;
    let (told_pose, told_velocity, _) = last(&mut bench, &negative, &[0.1, f64::NAN, 0.3]);
    assert_eq!((told_pose, told_velocity), (None, None));
    bench.run(51);
    assert_eq!(seen.lock().unwrap().last().unwrap().0, None, "too old");
}

#[test]
fn a_program_that_falls_silent_stops_the_robot_and_its_return_moves_nothing() {
    let text = text() + "\n[safety]\nenable_input = \"gate.open\"\n";
    let mut bench = Bench::new(plan(&text));
    bench.run(100);
    assert_eq!(bench.step(Some(RequestKind::Enable)).answer, RequestAnswer::EnableInput);
    let open = |bench: &mut Bench, request| {
        hear(bench, GATE, 0, &[1.0, 0.0]);
        bench.step(request)
    };
    assert_eq!(open(&mut bench, Some(RequestKind::Enable)).answer, RequestAnswer::Taken);
    for _ in 0..300 {
        open(&mut bench, None);
    }
    assert_eq!(open(&mut bench, Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    for _ in 0..200 {
        open(&mut bench, None);
    }
    assert_eq!(bench.robot.phase(), Phase::Tracking);
    for _ in 0..20 {
        bench.step(None);
        assert_eq!(bench.robot.phase(), Phase::Tracking);
    }
    let record = bench.step(None);
    // It stands, so that the ramp is over at once.
    assert_eq!((record.allowed.reason, bench.robot.phase()), (SafetyReason::EnableInput, Phase::Fault));
    for _ in 0..2000 {
        open(&mut bench, None);
    }
    assert_eq!(bench.robot.phase(), Phase::Fault, "it is there again, and nobody acknowledged");
}

#[test]
fn a_demand_that_was_over_before_the_cycle_saw_it_stops_all_the_same() {
    for (safety, between, reason) in [
        ("enable_input = \"gate.open\"", Between { zero: 1, nonzero: 1 }, SafetyReason::EnableInput),
        ("stop_input = \"gate.force\"", Between { zero: 2, nonzero: 3 }, SafetyReason::StopInput),
    ] {
        let text = text() + &format!("\n[safety]\n{safety}\n");
        let mut bench = Bench::new(plan(&text));
        let open = |bench: &mut Bench, request| {
            hear(bench, GATE, 0, &[1.0, 0.0]);
            bench.step(request)
        };
        bench.run(10);
        assert_eq!(open(&mut bench, Some(RequestKind::Enable)).answer, RequestAnswer::Taken);
        for _ in 0..300 {
            open(&mut bench, None);
        }
        assert_eq!(bench.robot.phase(), Phase::Holding);
        bench.robot.hear_between(GATE, between);
        assert_eq!(open(&mut bench, None).allowed.reason, reason);
    }
}

#[test]
fn a_recorded_cycle_is_computed_again_with_what_was_heard_in_it() {
    let mut bench = Bench::new(plan(&text()));
    let mut records = Vec::new();
    for cycle in 0..400_u64 {
        match cycle % 7 {
            0 => hear(&mut bench, GATE, (cycle % 5) * MS.min(cycle), &[1.0, cycle as f64]),
            1 => bench.robot.hear_between(GATE, Between { zero: 1, nonzero: 2 }),
            3 => hear(&mut bench, MOCAP, 0, &[f64::NAN; 9]),
            5 => hear(&mut bench, FLOW, cycle, &[0.1, 0.2, cycle as f64]),
            _ => {}
        }
        let request = match cycle {
            50 => Some(RequestKind::Enable),
            350 => Some(RequestKind::Track),
            _ => None,
        };
        records.push(bench.step(request));
    }
    assert!(records.iter().any(|record| record.signals.heard == 1));
    let mut again = Robot::build(&bench.plan, &Registry::with_built_in()).unwrap();
    let mut image = ImageBuffer::new(&bench.plan);
    let layout = bench.plan.record_layout();
    let (mut values, mut computed) = (Vec::new(), Vec::new());
    let bits = |values: &[omnibase_robot::signals::Value]| -> Vec<u64> {
        values.iter().map(|value| value.as_f64().to_bits()).collect()
    };
    for record in &records {
        record.values(&mut values);
        let read = CycleRecord::from_values(&layout, &values).unwrap();
        again.replay(&read, &mut image).values(&mut computed);
        assert_eq!(bits(&values), bits(&computed), "cycle {}", record.time.index);
    }
}

#[test]
fn a_file_says_what_is_wrong_with_its_sources() {
    let refused = |sources: &str| {
        let no_files = |name: &str| Err(format!("no file {name}"));
        let text = format!("{BMM}{sources}");
        let problems = omnibase_robot::RobotPlan::from_toml(&text, &Registry::with_built_in(), &no_files);
        problems.unwrap_err().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    for (sources, words) in [
        ("[[source]]\nname = \"a\"", "1 to 32"),
        ("[[source]]\nname = \"a\"\ncarries = \"pose\"\n[[source.input]]\nname = \"x\"", "its own values"),
        ("[[source]]\nname = \"A b\"\ncarries = \"pose\"", "small letters"),
        ("[[source]]\nname = \"wheel_1\"\ncarries = \"pose\"", "recordings call something else so"),
        (
            "[[source]]\nname = \"a\"\ncarries = \"pose\"\n[[source]]\nname = \"a\"\ncarries = \"pose\"",
            "source[0] has the same name",
        ),
        (
            "[[source]]\nname = \"a\"\n[[source.input]]\nname = \"b\"\nleast = 2.0\ngreatest = 1.0",
            "above least = 2",
        ),
        ("[[source]]\nname = \"a\"\n[[source.input]]\nname = \"age\"", "is called so"),
        ("[[source]]\nname = \"a\"\ncarries = \"poses\"", "poses"),
        ("[[source]]\nname = \"a\"\ncarries = \"pose\"\nmax_age_ms = 0", "max_age_ms"),
    ] {
        let found = refused(sources);
        assert!(found.contains(words), "{sources}: expected `{words}`, found: {found}");
    }
}
