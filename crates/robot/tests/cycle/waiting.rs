//! Paths that are never left for what stands in them: the platform waits on the path, and goes on along it.

use omnibase_platform::Pose2;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{CycleRecord, SafetyReason};
use omnibase_robot::{Phase, Registry, RequestKind, RobotPlan};

use super::support::{BMM, Bench, plan};

/// Round two corners, as fast as the limits allow; walls may stand beside it.
const PATH: &str = "[avoidance]\nkind = \"guarded\"\ngive_up_s = 2.0\n[reference]\nkind = \"path\"\ntiming = \"fastest\"\n\
    corner_m = 0.1\npoints = [[0, 0, 0, 0], [4, 2, 0, 0], [8, 2, 2, 1.5], [12, 0, 2, 1.5]]\nobstacles = \"wait\"\n";
/// Farther than this from its path nobody is on it, m.
const ON_PATH_M: f64 = 0.01;
/// Nearer than this, from where it is to the obstacle's middle, it brakes at once, m, and leaves its path by less than this, m.
const AT_ONCE_M: f64 = 1.5;
const BRAKED_M: f64 = 0.06;
const RADIUS_M: f64 = 0.2;

fn begun() -> Bench {
    let mut bench = Bench::new(plan(&format!("{BMM}\n{PATH}")));
    bench.enable();
    bench.step(Some(RequestKind::Track));
    bench
}

/// Where it is led along its path, cycle by cycle, with nothing in the way.
fn undisturbed() -> Vec<Pose2> {
    let mut bench = begun();
    let mut poses = Vec::new();
    while bench.robot.phase() == Phase::Tracking {
        poses.push(bench.step(None).setpoint.odom_from_body);
    }
    poses
}

/// How far from its path it is led, looked for around where it was nearest before.
struct OffPath {
    /// Every fourth cycle's pose.
    poses: Vec<Pose2>,
    nearest: usize,
}

impl OffPath {
    /// Poses that are looked at on either side.
    const REACH: usize = 50;

    fn new(path: &[Pose2]) -> Self {
        OffPath { poses: path.iter().step_by(4).copied().collect(), nearest: 0 }
    }

    fn off_m(&mut self, record: &CycleRecord) -> f64 {
        let here = record.setpoint.odom_from_body;
        let (first, end) = (self.nearest.saturating_sub(Self::REACH), self.nearest + Self::REACH);
        let around = (first..end.min(self.poses.len())).map(|at| {
            let pose = self.poses[at];
            (at, here.distance_m(pose) + 0.4 * (here.heading_rad - pose.heading_rad).abs())
        });
        let (at, off_m) = around.min_by(|one, other| one.1.total_cmp(&other.1)).expect("a path");
        self.nearest = at;
        off_m
    }
}

fn put(bench: &mut Bench, centre: &Pose2) {
    let obstacle =
        Obstacle { centre_m: [centre.x_m, centre.y_m], radius_m: RADIUS_M, velocity_m_s: [0.0; 2] };
    bench.step(Some(RequestKind::SetObstacle { index: 0, obstacle }));
}

#[test]
fn whatever_comes_onto_a_path_that_is_kept_the_platform_waits_on_it_and_goes_on() {
    let path = undisturbed();
    assert!(path.last().unwrap().distance_m(Pose2::new(0.0, 2.0, 1.5)) < 1e-3);
    let (mut stood, mut worst_m) = (0, [0.0_f64; 2]);
    for (share, ahead_m, aside_m) in (1..9).flat_map(|share| {
        [1.2, 1.35, 1.6]
            .into_iter()
            .flat_map(move |ahead_m| [-0.3, 0.0, 0.3].map(|aside_m| (share, ahead_m, aside_m)))
    }) {
        let mut bench = begun();
        let cycles = path.len() * share / 10;
        let mut off_path = OffPath::new(&path);
        let mut off_m = (0..cycles).map(|_| off_path.off_m(&bench.step(None))).fold(0.0, f64::max);
        // Somewhere on the way that is left, farther than a stop is long, or past it.
        let here = path[cycles];
        let mut ahead = path[cycles..].iter().skip_while(|pose| pose.distance_m(here) < ahead_m);
        let Some(place) = ahead.next() else { continue };
        let along = (place.y_m - here.y_m).atan2(place.x_m - here.x_m);
        let centre = Pose2::new(place.x_m - aside_m * along.sin(), place.y_m + aside_m * along.cos(), 0.0);
        put(&mut bench, &centre);
        let what = format!("{share}, {ahead_m} m, {aside_m} m");
        let mut stands = false;
        for cycle in 0..20_000 {
            let record = bench.step(None);
            off_m = off_m.max(off_path.off_m(&record));
            if bench.robot.phase() != Phase::Tracking {
                break;
            }
            stands |= cycle > 100 && record.setpoint.twist_in_odom.speed_m_s() < 1e-3;
            if stands && record.guard.obstacle_distance_m.is_some() {
                bench.step(Some(RequestKind::RemoveObstacle { index: 0 }));
            }
        }
        stood += u32::from(stands);
        let record = bench.step(None);
        assert_eq!(record.stop_reason, SafetyReason::None, "{what}");
        let lacks_m = record.setpoint.odom_from_body.distance_m(*path.last().unwrap());
        assert!(lacks_m < 2e-3, "{what}: {lacks_m} m from its end");
        // What appears so near that it brakes at once leads it straight on.
        let most_m = if ahead_m < AT_ONCE_M { BRAKED_M } else { ON_PATH_M };
        assert!(off_m < most_m, "{what}: {off_m} m off its path");
        let worst_m = &mut worst_m[usize::from(ahead_m < AT_ONCE_M)];
        *worst_m = worst_m.max(off_m);
    }
    println!(
        "off its path at most {worst_m:.4?} m, the second where it brakes at once; it stood {stood} times"
    );
    assert!(stood > 20, "{stood}");
}

#[test]
fn what_stays_in_a_path_that_is_kept_ends_it_on_the_path() {
    let path = undisturbed();
    let mut bench = begun();
    put(&mut bench, &Pose2::new(2.0, 1.2, 0.0));
    let mut off_path = OffPath::new(&path);
    let mut off_m = 0.0_f64;
    let mut nearest_m = f64::INFINITY;
    while bench.robot.phase() == Phase::Tracking {
        let record = bench.step(None);
        off_m = off_m.max(off_path.off_m(&record));
        nearest_m = nearest_m.min(record.guard.obstacle_distance_m.unwrap());
    }
    let record = bench.run(2000);
    assert_eq!((record.phase, record.stop_reason), (Phase::Holding, SafetyReason::WayBlocked));
    assert!(off_m < ON_PATH_M && off_path.off_m(&record) < ON_PATH_M, "{off_m} m off its path");
    // As near as is kept, and hardly farther.
    assert!((0.099..0.2).contains(&nearest_m), "{nearest_m} m");
}

#[test]
fn who_stands_too_near_to_an_obstacle_leaves_it_on_a_path_that_leads_straight_away() {
    let path = PATH.replace(
        "[[0, 0, 0, 0], [4, 2, 0, 0], [8, 2, 2, 1.5], [12, 0, 2, 1.5]]",
        "[[0, 0, 0, 0], [2, -0.3, 0, 0], [5, -0.3, 1, 0], [9, 2, 1, 0]]",
    );
    let mut bench = Bench::new(plan(&format!("{BMM}\n{path}")));
    bench.enable();
    put(&mut bench, &Pose2::new(0.8, 0.0, 0.0));
    let gap_m = bench.step(None).guard.obstacle_distance_m.unwrap();
    put(&mut bench, &Pose2::new(0.8 - gap_m + 0.04, 0.0, 0.0));
    let near_m = bench.step(None).guard.obstacle_distance_m.unwrap();
    assert!((0.039..0.041).contains(&near_m), "{near_m} m");
    bench.step(Some(RequestKind::Track));
    while bench.robot.phase() == Phase::Tracking {
        bench.step(None);
    }
    let record = bench.run(10);
    let lacks_m = record.setpoint.odom_from_body.distance_m(Pose2::new(2.0, 1.0, 0.0));
    assert!(record.stop_reason == SafetyReason::None && lacks_m < 2e-3, "{lacks_m} m from its end");
}

#[test]
fn a_fastest_motion_keeps_to_speeds_of_its_own_and_others_have_none() {
    let path = "[reference]\nkind = \"path\"\ncorner_m = 0.1\npoints = [[0, 0, 0, 0], [4, 2, 0, 0], [8, 2, 2, 1.5]]\n\
        speed_m_s = 0.3\nturn_speed_rad_s = 0.2\n";
    let mut bench = Bench::new(plan(&format!("{BMM}\n{path}timing = \"fastest\"\n")));
    bench.enable();
    bench.step(Some(RequestKind::Track));
    let mut most = [0.0_f64; 2];
    while bench.robot.phase() == Phase::Tracking {
        let twist = bench.step(None).setpoint.twist_in_odom;
        most = [most[0].max(twist.speed_m_s()), most[1].max(twist.w_rad_s.abs())];
    }
    assert!((0.28..0.3 + 1e-6).contains(&most[0]) && most[1] <= 0.2 + 1e-6, "{most:?}");
    let refused = |timing: &str| {
        let text = format!("{BMM}\n{path}timing = \"{timing}\"\n");
        let problems = RobotPlan::from_toml(&text, &Registry::with_built_in(), &|_| Err(String::new()));
        problems.unwrap_err()[0].to_string()
    };
    for timing in ["as_given", "stretched"] {
        let text = refused(timing);
        assert!(text.contains("reference.speed_m_s") && text.contains("\"fastest\""), "{text}");
    }
}
