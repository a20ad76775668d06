//! How cost grows with what there is: a table and a picture each.
//!
//! `cargo run --release -p omnibase-trials --example growth -- FOLDER [HOURS [NAME]]`: wheels 3 to 8, obstacles 0 to 16, SubDevices 1 to
//! 1000, points of a path 10 to 10^6, and recordings of a minute to so many hours (1 where nothing is said; each is 1.8 GB, which
//! stand in the folder until they are read); or the one of them that is named as its picture. Pictures go into the folder.

mod computing;
mod picture;
mod recordings;
mod segments;

use std::path::{Path, PathBuf};
use std::time::Instant;

use omnibase_platform::Pose2;
use omnibase_trajectory::{FastestTrajectory, Joining, Limits, PiecewisePath, PlatformBounds, Trajectory};
use omnibase_trials::core_s;

/// What was measured over what there is more and more of.
struct Growth {
    title: &'static str,
    /// What there is more and more of.
    across: &'static str,
    /// What is measured.
    curves: Vec<&'static str>,
    /// How many there are, and what was measured of each curve.
    rows: Vec<(f64, Vec<f64>)>,
}

impl Growth {
    fn tell(&self, picture: &Path) {
        println!("\n{}\n\n| {} | {} |", self.title, self.across, self.curves.join(" | "));
        println!("|{}", "---|".repeat(1 + self.curves.len()));
        for (count, values) in &self.rows {
            let values: Vec<String> = values.iter().map(|value| short(*value)).collect();
            println!("| {} | {} |", short(*count), values.join(" | "));
        }
        std::fs::write(picture, picture::svg(self))
            .unwrap_or_else(|error| panic!("{}: {error}", picture.display()));
    }
}

/// Three digits of it, at least.
fn short(value: f64) -> String {
    if value >= 100.0 || value == value.round() { format!("{value:.0}") } else { format!("{value:.2}") }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(folder) = arguments.next().map(PathBuf::from) else { panic!("expected: FOLDER [HOURS [NAME]]") };
    let hours: f64 = arguments.next().map_or(1.0, |text| text.parse().expect("hours, a number"));
    std::fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let name = arguments.next();
    let recordings = || recordings::growth(&folder, hours);
    // Recordings first: their memory is that of the process.
    let all: [(&str, &dyn Fn() -> Growth); 5] = [
        ("recordings", &recordings),
        ("wheels", &computing::wheels),
        ("obstacles", &computing::obstacles),
        ("subdevices", &segments::growth),
        ("points", &points),
    ];
    let chosen = all.iter().filter(|(known, _)| name.as_ref().is_none_or(|name| name == known));
    for (file, measured) in chosen {
        measured().tell(&folder.join(file).with_extension("svg"));
    }
}

/// What a call takes in the middle of so many, us: what else the machine does lengthens some of them.
fn median_us(calls: usize, mut call: impl FnMut()) -> f64 {
    let once = |_| {
        let began = Instant::now();
        call();
        began.elapsed().as_nanos()
    };
    let mut took: Vec<u128> = (0..calls).map(once).collect();
    took.sort_unstable();
    took[calls / 2] as f64 * 1e-3
}

/// Planning the fastest motion through points some 0.2 m apart, by the platform's limits.
fn points() -> Growth {
    let limits = Limits {
        speed_m_s: 1.5,
        acceleration_m_s2: 6.0,
        jerk_m_s3: 200.0,
        rate_rad_s: 3.0,
        angular_acceleration_rad_s2: 20.0,
        angular_jerk_rad_s3: 800.0,
    };
    let joining = Joining { radius_m: 0.5, corner_rad: 0.52, tolerance_m: 0.05 };
    let bounds = PlatformBounds::new(limits);
    let pose = |at: usize| {
        let phi = 0.1 * at as f64;
        Pose2::new(2.0 * phi.sin(), 1.5 * (1.3 * phi).cos(), 0.4 * (0.7 * phi).sin())
    };
    let rows = [10, 100, 1000, 10_000, 100_000, 1_000_000].map(|count| {
        let poses: Vec<Pose2> = (0..count).map(pose).collect();
        let runs = (10_000 / count).max(1);
        let began_s = core_s();
        for _ in 0..runs {
            let path = PiecewisePath::through(&poses, joining).expect("a smooth path");
            let motion = FastestTrajectory::new(path, &bounds).expect("a motion");
            assert!(motion.duration_s() > 0.0);
        }
        (count as f64, vec![1e3 * (core_s() - began_s) / runs as f64])
    });
    Growth {
        title: "Planning the fastest motion through points",
        across: "points",
        curves: vec!["ms of a core"],
        rows: rows.into(),
    }
}
