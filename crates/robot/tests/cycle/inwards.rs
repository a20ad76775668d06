//! Plans of a robot that leaves less room to the fence than it must, for little is known of its pose: inwards, no further out.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_platform::{Pose2, PoseGrowth};
use omnibase_robot::estimators::WheelOdometry;
use omnibase_robot::references::Hold;
use omnibase_robot::registry::{Kind, optional};
use omnibase_robot::safety::SafetyChain;
use omnibase_robot::signals::{
    Allowed, CycleRecord, PlatformState, ReferenceStatus, RequestAnswer, SafetyReason, Setpoint,
};
use omnibase_robot::stages::{Estimator, Observation, Reference, Safety, SafetyView};
use omnibase_robot::{Phase, Registry, RequestKind, Robot};

use super::support::{BMM, Bench, kind, plan_with};

/// The footprint leaves 0.22 m to the fence behind it, and must leave 0.35 m by 0.1 m of doubt.
const BEFORE_THE_FENCE: &str = "[fence]\nrectangle_m = [-0.7, -3.0, 5.0, 3.0]\n";
const DOUBT: &str = "[estimator]\nstart_sigma_m = 0.1\n";

/// Odometry that becomes less sure when a test says so: m, as bits.
#[derive(Clone, Default)]
struct Doubt(Arc<AtomicU64>);

impl Doubt {
    fn set(&self, sigma_m: f64) {
        self.0.store(sigma_m.to_bits(), Ordering::Relaxed);
    }
}

struct Doubting(WheelOdometry, Doubt);

impl Estimator for Doubting {
    fn reset(&mut self, from: &PlatformState) {
        self.0.reset(from);
    }
    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let mut state = self.0.update(observation);
        let sigma_m = f64::from_bits(self.1.0.load(Ordering::Relaxed));
        state.covariance[0] += sigma_m * sigma_m;
        state.covariance[3] += sigma_m * sigma_m;
        state
    }
    fn growth(&self) -> PoseGrowth {
        self.0.growth()
    }
}

/// Goes off from where it begins, at this speed in m/s, and nobody can know it beforehand.
struct Blind(Setpoint, f64);

impl Reference for Blind {
    fn start(&mut self, from: &Setpoint) {
        self.0 = *from;
    }
    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        let mut place = Setpoint { status: ReferenceStatus::Moving, ..self.0 };
        // Softly: its speed has risen after half a second.
        let rising_s = since_start_s.min(0.5);
        place.odom_from_body.x_m += self.1 * (rising_s * rising_s + (since_start_s - rising_s));
        place.twist_in_odom.vx_m_s = 2.0 * self.1 * rising_s;
        place
    }
}

fn doubted_bench(more: &str) -> (Bench, Doubt) {
    let (doubt, mut registry) = (Doubt::default(), Registry::with_built_in());
    let mine = doubt.clone();
    let doubting = move |plan: &_| Ok(Doubting(WheelOdometry::new(plan)?, mine.clone()));
    let reads_sigma = Kind { keys: vec![optional("start_sigma_m")], ..kind("doubting") };
    registry.estimators.add(reads_sigma, doubting);
    for (name, speed_m_s) in [("blind_in", 0.2), ("blind_out", -0.05)] {
        registry.references.add(kind(name), move |_, _| Ok(Blind(Setpoint::default(), speed_m_s)));
    }
    registry.references.add(kind("stays"), |_, _| Ok(Hold::default()));
    let text = format!("{BMM}\n{BEFORE_THE_FENCE}{more}\n");
    let mut bench = Bench::with_registry(plan_with(&text, &registry), &registry);
    bench.enable();
    (bench, doubt)
}

fn bench(more: &str) -> Bench {
    let mut bench = doubted_bench(&format!("{DOUBT}{more}")).0;
    let guard = bench.step(None).guard;
    let [room_m, kept_m] = [guard.fence_margin_m, guard.fence_kept_m].map(Option::unwrap);
    assert!(0.05 < room_m && room_m < kept_m, "{room_m} of {kept_m}");
    bench
}

fn path(points: &str) -> String {
    format!("[reference]\nkind = \"path\"\npoints = {points}\n")
}

fn reference(kind: &str) -> String {
    format!("[reference]\nkind = \"{kind}\"\n")
}

fn go(x_m: f64) -> RequestKind {
    RequestKind::GoTo { odom_from_body: Pose2::new(x_m, 0.0, 0.0) }
}

/// How a plan ended.
struct End {
    /// The phase after its last cycle.
    into: Phase,
    /// The record one second later.
    record: CycleRecord,
    /// The least room to the fence until then, m.
    least_m: f64,
}

fn follow(bench: &mut Bench, kind: RequestKind) -> End {
    assert_eq!(bench.step(Some(kind)).answer, RequestAnswer::Taken);
    let mut least_m = f64::INFINITY;
    let mut step = |bench: &mut Bench| {
        let record = bench.step(None);
        least_m = least_m.min(record.guard.fence_margin_m.unwrap());
        record
    };
    for _ in 0..30_000 {
        step(bench);
        let into = bench.robot.phase();
        if into != Phase::Tracking {
            let record = (0..1000).map(|_| step(bench)).last().expect("cycles");
            return End { into, record, least_m };
        }
    }
    panic!("still under way");
}

#[test]
fn a_plan_leads_a_robot_inwards_that_leaves_less_room_than_it_must_and_no_further_out() {
    let inwards = path("[[0, 0, 0, 0], [4, 1.0, 0, 0]]");
    for (kind, more) in [(go(1.0), ""), (RequestKind::Track, inwards.as_str())] {
        let End { record, .. } = follow(&mut bench(more), kind);
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None), "{kind:?}");
        assert!((record.setpoint.odom_from_body.x_m - 1.0).abs() < 1e-3, "{kind:?}: {record:?}");
    }
    for outwards in [
        path("[[0, 0, 0, 0], [4, -0.1, 0, 0]]"),
        path("[[0, 0, 0, 0], [4, 0, 0, 0.7]]"),
        reference("blind_out"),
        // It leads in, from further out than where the platform stands.
        path("[[0, -0.02, 0, 0], [4, 1.0, 0, 0]]") + "frame = \"odom\"\n",
    ] {
        let mut bench = bench(&outwards);
        let room_m = bench.step(None).guard.fence_margin_m.unwrap();
        let End { record, least_m, .. } = follow(&mut bench, RequestKind::Track);
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::Fence), "{outwards}");
        assert!(least_m > room_m - 2e-4, "{outwards}: {least_m} of {room_m}");
    }
}

#[test]
fn what_a_plan_gained_it_gives_back_to_no_fence() {
    let there_and_back = path("[[0, 0, 0, 0], [2, 0.1, 0, 0], [4, 0, 0, 0]]");
    let End { into, record, .. } = follow(&mut bench(&there_and_back), RequestKind::Track);
    assert_eq!((into, record.stop_reason), (Phase::Holding, SafetyReason::Fence), "it halts on its path");
    assert!(record.setpoint.odom_from_body.x_m > 0.05, "{record:?}");
    // From where there is enough it may go anywhere but to where there isn't.
    let far_and_back = path("[[0, 0, 0, 0], [4, 1, 0, 0], [7, 0.3, 0, 0]]");
    let End { record, .. } = follow(&mut bench(&far_and_back), RequestKind::Track);
    assert_eq!(record.stop_reason, SafetyReason::None, "{record:?}");
    let too_far_back = path("[[0, 0, 0, 0], [4, 1, 0, 0], [8, 0, 0, 0]]");
    let End { into, record, .. } = follow(&mut bench(&too_far_back), RequestKind::Track);
    assert_eq!((into, record.stop_reason), (Phase::Holding, SafetyReason::Fence));
    assert!(record.setpoint.odom_from_body.x_m > 0.13, "{record:?}");
}

#[test]
fn along_the_fence_a_plan_is_followed_that_loses_no_room() {
    for points in ["[[0, 0, 0, 0], [5, 0, 1.5, 0]]", "[[0, 0, 0, 0], [5, 0.05, 1.5, 0]]"] {
        let mut bench = bench(&path(points));
        let End { record, .. } = follow(&mut bench, RequestKind::Track);
        assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::None), "{points}");
        assert!((record.setpoint.odom_from_body.y_m - 1.5).abs() < 1e-3, "{points}: {record:?}");
    }
}

#[test]
fn who_drives_inwards_becomes_less_sure_and_goes_on() {
    let inwards = path("[[0, 0, 0, 0], [6, 1.5, 0, 0]]");
    for (kind, more) in
        [(go(1.5), ""), (RequestKind::Track, inwards.as_str()), (RequestKind::Track, &reference("blind_in"))]
    {
        // By leaps, as a loss of devices or an estimator of one's own makes them: before it has enough room, when it just
        // has, and later; and by a millimetre in each cycle.
        for [from_cycle, per_cycle_m, most_m] in
            [[300.0, 0.1, 0.1], [1200.0, 0.1, 0.1], [1800.0, 0.2, 0.2], [0.0, 1e-4, 0.3], [0.0, 0.0, 0.0]]
        {
            let (mut bench, doubt) = doubted_bench(&format!("{DOUBT}kind = \"doubting\"\n{more}"));
            assert_eq!(bench.step(Some(kind)).answer, RequestAnswer::Taken);
            let case = format!("{kind:?} {more} from {from_cycle} {per_cycle_m} up to {most_m} m");
            let mut x_m = 0.0;
            for cycle in 0..8000 {
                doubt.set((f64::from(cycle) - from_cycle).mul_add(per_cycle_m, 0.0).clamp(0.0, most_m));
                let record = bench.step(None);
                assert_eq!(record.allowed.reason, SafetyReason::None, "{case}, {cycle}");
                let here_m = record.setpoint.odom_from_body.x_m;
                assert!(here_m >= x_m - 1e-6, "{case}, {cycle}: no way back");
                x_m = here_m;
                if bench.robot.phase() == Phase::Holding {
                    break;
                }
            }
            let record = bench.run(10);
            assert!(x_m > 1.499, "{case}: {record:?}");
            assert_eq!(record.stop_reason, SafetyReason::None, "{case}");
        }
    }
}

#[test]
fn doubt_that_comes_over_a_plan_stops_it_only_where_it_leads_out() {
    for (more, reason) in
        [("blind_in", SafetyReason::None), ("blind_out", SafetyReason::Fence), ("stays", SafetyReason::None)]
    {
        // Sure where it stands, with 0.17 m to spare, until half a second later.
        let (mut bench, doubt) =
            doubted_bench(&format!("[estimator]\nkind = \"doubting\"\n{}", reference(more)));
        assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Taken);
        let before = bench.run(500);
        assert_eq!((before.phase, before.allowed.reason), (Phase::Tracking, SafetyReason::None));
        doubt.set(0.1);
        let record = bench.run(500);
        assert_eq!(record.stop_reason, reason, "{more}");
        let moved_m = record.guard.fence_margin_m.unwrap() - before.guard.fence_margin_m.unwrap();
        assert!(moved_m > -0.05, "{more}: {moved_m}");
    }
}

#[test]
fn along_the_fence_doubt_that_grows_halts_a_plan_before_there_is_too_little_room() {
    let (mut bench, doubt) = doubted_bench(&format!(
        "[estimator]\nkind = \"doubting\"\n{}",
        path("[[0, 0, 0, 0], [9, 0, 2.2, 0]]")
    ));
    assert_eq!(bench.step(Some(RequestKind::Track)).answer, RequestAnswer::Taken);
    for cycle in 0..12_000 {
        doubt.set((8e-6 * f64::from(cycle)).min(0.1));
        let record = bench.step(None);
        if bench.robot.phase() == Phase::Holding {
            assert_eq!(record.phase, Phase::Tracking, "it came to a halt on its path");
            break;
        }
    }
    let record = bench.step(None);
    assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::Fence));
    let [room_m, kept_m] = [record.guard.fence_margin_m, record.guard.fence_kept_m].map(Option::unwrap);
    assert!(room_m > kept_m, "{room_m} of {kept_m}");
}

#[test]
fn a_room_that_is_no_number_stops() {
    struct Unknown(SafetyChain);
    impl Safety for Unknown {
        fn reset(&mut self) {
            self.0.reset();
        }
        fn apply(&mut self, view: &SafetyView<'_>) -> Allowed {
            self.0.apply(&SafetyView { wished_fence_room_m: f64::NAN, ..*view })
        }
    }
    let mut bench = bench(&path("[[0, 0, 0, 0], [4, 1.0, 0, 0]]"));
    let safety = Box::new(Unknown(SafetyChain::new(&bench.plan)));
    bench.robot = Robot::build_with_safety(&bench.plan, &Registry::with_built_in(), safety).expect("a robot");
    bench.enable();
    bench.step(Some(RequestKind::Track));
    assert_eq!(bench.run(1000).stop_reason, SafetyReason::Fence);
}

#[test]
fn a_doubt_that_is_no_number_stops() {
    let inwards = path("[[0, 0, 0, 0], [4, 1.0, 0, 0]]");
    let (mut bench, doubt) = doubted_bench(&format!("{DOUBT}kind = \"doubting\"\n{inwards}"));
    bench.step(Some(RequestKind::Track));
    bench.run(500);
    doubt.set(f64::NAN);
    let record = bench.step(None);
    assert_eq!(record.allowed.reason, SafetyReason::NotFinite);
    assert_eq!(bench.robot.phase(), Phase::QuickStopping);
}
