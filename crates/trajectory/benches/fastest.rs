//! Prints what planning costs, by points and limits: CPU time, and how much memory it takes at its most.
//!
//! `cargo bench -p omnibase-trajectory`; `-- 20 "wheels, grip, heat" 1` plans one row so many times, for `valgrind --tool=callgrind`.

use omnibase_platform::Pose2;
use omnibase_trajectory::fastest::{Heat, Limit};
use omnibase_trajectory::limits;
use omnibase_trajectory::reach::Plane;
use omnibase_trajectory::{
    FastestTrajectory, Interpolation, Joining, Limits, PathPoint, PathPoints, PiecewisePath, PlatformBounds,
    Trajectory,
};

const LIMITS: Limits = Limits {
    speed_m_s: 1.5,
    acceleration_m_s2: 6.0,
    jerk_m_s3: 200.0,
    rate_rad_s: 3.0,
    angular_acceleration_rad_s2: 20.0,
    angular_jerk_rad_s3: 800.0,
};

/// Round and round, never the same: a point every 0.2 m or so.
fn pose(at: usize) -> Pose2 {
    let phi = 0.1 * at as f64;
    Pose2::new(2.0 * phi.sin(), 1.5 * (1.3 * phi).cos(), 0.4 * (0.7 * phi).sin())
}

/// Three omni wheels on a floor of friction 0.4.
fn wheels() -> PlatformBounds {
    let mut bounds = PlatformBounds::new(LIMITS);
    let mut heat = Heat { window_s: 30.0, torques: Vec::new() };
    for wheel in 0..3 {
        let (sin, cos) = (2.1 * f64::from(wheel)).sin_cos();
        bounds.wheel_speeds.push([-sin, cos, 0.4].map(|part| part / 1.5));
        let force = [-sin * 47.0, cos * 47.0, 5.8];
        for sign in [1.0, -1.0] {
            let normal = [sign * force[0] + 18.0 * cos, sign * force[1] + 18.0 * sin, sign * force[2]];
            bounds.planes.push((Limit::Grip, Plane { normal, most: 91.0, ..Plane::default() }));
            bounds.planes.push((
                Limit::WheelTorque,
                Plane { normal: force.map(|f| sign * f), most: 190.0, ..Plane::default() },
            ));
        }
        heat.torques.push(force.map(|force| force / 70.0));
    }
    bounds.heat = Some(heat);
    bounds
}

/// CPU time of this thread, ms: what else the machine does doesn't count.
fn cpu_ms() -> f64 {
    let words = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    words.split(' ').next().unwrap().parse::<f64>().unwrap() / 1e6
}

/// What one of some runs takes, ms.
fn mean_ms(runs: usize, mut run: impl FnMut()) -> f64 {
    let begun_ms = cpu_ms();
    (0..runs).for_each(|_| run());
    (cpu_ms() - begun_ms) / runs as f64
}

/// The most memory that this process has had since `is_anew`, MB.
fn peak_mb(is_anew: bool) -> f64 {
    if is_anew {
        std::fs::write("/proc/self/clear_refs", "5").unwrap();
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
}

fn main() {
    // Cargo adds a flag of its own.
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let one = match &asked[..] {
        [count, limits, runs] => Some((count.parse().unwrap(), limits, runs.parse().unwrap())),
        _ => None,
    };
    println!("| what | points | limits | CPU ms | memory MB | motion s |\n|---|---|---|---|---|---|");
    let joining = Joining { radius_m: 0.5, corner_rad: 0.52, tolerance_m: 0.05 };
    let with_jerk = |jerk_m_s3| Limits { jerk_m_s3, angular_jerk_rad_s3: 4.0 * jerk_m_s3, ..LIMITS };
    let (quick, slow) = (with_jerk(40.0), with_jerk(10.0));
    let many: &[usize] = &[20, 80, 1000, 10_000, 100_000];
    for (name, bounds, counts) in [
        ("platform", PlatformBounds::new(LIMITS), many),
        ("wheels, grip, heat", wheels(), many),
        ("platform, jerk 40 m/s³", PlatformBounds::new(quick), &many[..2]),
        ("wheels, grip, heat, jerk 40 m/s³", PlatformBounds { limits: quick, ..wheels() }, &many[..2]),
        ("platform, jerk 10 m/s³", PlatformBounds::new(slow), &many[..2]),
        ("wheels, grip, heat, jerk 10 m/s³", PlatformBounds { limits: slow, ..wheels() }, &many[..2]),
    ] {
        for &count in counts {
            if one.is_some_and(|(points, limits, _): (usize, _, usize)| points != count || limits != name) {
                continue;
            }
            let poses: Vec<Pose2> = (0..count).map(pose).collect();
            let mut duration_s = 0.0;
            let runs = one.map_or((20_000 / count).max(1), |(.., runs)| runs);
            let before_mb = peak_mb(true);
            let ms = mean_ms(runs, || {
                let path = PiecewisePath::through(&poses, joining).unwrap();
                duration_s = FastestTrajectory::new(path, &bounds).unwrap().duration_s();
            });
            let mb = peak_mb(false) - before_mb;
            println!("| fastest | {count} | {name} | {ms:.2} | {mb:.1} | {duration_s:.3} |");
        }
    }
    if one.is_some() {
        return;
    }
    for count in [20, 1000, 64_000, 1_000_000] {
        let point = |at: usize| PathPoint { time_s: 1.0 * at as f64, odom_from_base: pose(at) };
        let points = PathPoints::new((0..count).map(point).collect()).unwrap();
        for (name, interpolation) in [("smooth", Interpolation::Smooth), ("quintic", Interpolation::Quintic)]
        {
            let runs = (20_000 / count).max(1);
            let before_mb = peak_mb(true);
            let ms = mean_ms(runs, || assert!(limits::plan(&points, interpolation, &LIMITS).is_ok()));
            let mb = peak_mb(false) - before_mb;
            println!("| as given, {name} | {count} | platform | {ms:.2} | {mb:.1} | {count} |");
        }
    }
}
