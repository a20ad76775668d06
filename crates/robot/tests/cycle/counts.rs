//! What a cycle costs in instructions, counted by callgrind: counts repeat, whatever else the machine does.
//!
//! The test starts itself under valgrind. Tests are less optimised than a release, so their counts are higher; what they are in a
//! release stands in docs/measurements.md.

use std::process::Command;

use omnibase_robot::config::FencePlan;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::{
    CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};

/// Set where the test runs under valgrind.
const COUNTED: &str = "OMNIBASE_COUNTED";
const BMM: &str = include_str!("../../../../robots/bmm.toml");
const CIRCLE: &str =
    "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = 100000\nduration_s = 1000000\n";
const CYCLES: u64 = 200;
/// Obstacles in a fence of 4 m by 4 m, `None`: without a fence; and the most instructions of a cycle.
const CASES: [(Option<u32>, u64); 3] = [(None, MOST_ALONE), (Some(1), MOST_FENCED), (Some(16), MOST_AMONG)];
const MOST_ALONE: u64 = 25_000;
const MOST_FENCED: u64 = 38_700;
const MOST_AMONG: u64 = 57_800;

fn running(obstacles: Option<u32>) -> impl FnMut(Option<RequestKind>) -> Phase {
    let registry = Registry::with_built_in();
    let no_files = |_: &str| Err(String::new());
    let mut plan = RobotPlan::from_toml(&format!("{BMM}{CIRCLE}"), &registry, &no_files).expect("a robot");
    if obstacles.is_some() {
        let corners_m = vec![[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
        plan.guard.fence = Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 });
    }
    let mut robot = Robot::build(&plan, &registry).unwrap_or_else(|error| panic!("{error}"));
    let (mut image, period_ns, mut index) = (ImageBuffer::new(&plan), plan.bus.cycle_ns, 0);
    move |kind| {
        for (inputs, outputs) in image.inputs.iter_mut().zip(&image.outputs) {
            // The status word that follows the control word, and the mode that was asked for.
            let status = match outputs[0] & 0x0F {
                0x0F => 0x0237_u16,
                0x07 => 0x0233,
                0x06 => 0x0231,
                _ => 0x0250,
            };
            inputs[..2].copy_from_slice(&status.to_le_bytes());
            inputs[12] = outputs[14];
        }
        let time = CycleTime::on_grid(index, period_ns);
        index += 1;
        robot.compute(time, Exchange::Complete, kind.map(Request::lasting), &mut image);
        robot.phase()
    }
}

/// Where callgrind ends a count and begins the next one.
#[inline(never)]
fn count_ends_here(case: usize) {
    std::hint::black_box(case);
}

fn run_cases() {
    for (number, (obstacles, _)) in CASES.into_iter().enumerate() {
        let mut cycle = running(obstacles);
        let mut phase = Phase::Disabled;
        for _ in 0..100 {
            phase = cycle(match phase {
                Phase::Disabled => Some(RequestKind::Enable),
                Phase::Holding => Some(RequestKind::Track),
                _ => None,
            });
        }
        assert_eq!(phase, Phase::Tracking);
        for index in 0..obstacles.unwrap_or(0) {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / 16.0).sin_cos();
            let obstacle =
                Obstacle { centre_m: [1.2 * cos, 1.2 * sin], radius_m: 0.02, velocity_m_s: [0.0; 2] };
            cycle(Some(RequestKind::SetObstacle { index, obstacle }));
        }
        count_ends_here(number);
        for _ in 0..CYCLES {
            phase = cycle(None);
        }
        count_ends_here(number);
        assert_eq!(phase, Phase::Tracking);
    }
}

#[test]
fn a_cycle_costs_no_more_instructions_than_it_may() {
    if std::env::var_os(COUNTED).is_some() {
        return run_cases();
    }
    let folder = std::env::temp_dir().join(format!("omnibase-counts-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for counts");
    let started = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=omnibase_robot::cycle::Robot::compute"])
        .args(["--dump-before=*count_ends_here*", "--combine-dumps=no"])
        .arg(format!("--callgrind-out-file={}", folder.join("counts").display()))
        .arg(std::env::current_exe().expect("this test"))
        .args(["--exact", "counts::a_cycle_costs_no_more_instructions_than_it_may", "--test-threads=1"])
        .env(COUNTED, "1")
        .output();
    let output = match started {
        Ok(output) => output,
        Err(why) => return eprintln!("SKIPPED: instructions aren't counted without valgrind: {why}"),
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Each case has two ends: the second one closes its count.
    for (number, (obstacles, most)) in CASES.into_iter().enumerate() {
        let name = folder.join(format!("counts.{}", 2 * number + 2));
        let text = std::fs::read_to_string(&name).unwrap_or_else(|why| panic!("{}: {why}", name.display()));
        let total = text.lines().find_map(|line| line.strip_prefix("summary: ")).expect("a summary");
        let each = total.trim().parse::<u64>().expect("a count") / CYCLES;
        println!("{obstacles:?} obstacles: {each} instructions a cycle");
        assert!(each > 1000, "{obstacles:?}: {each} instructions a cycle are too few to be true");
        assert!(each <= most, "{obstacles:?} obstacles: {each} instructions a cycle, at most {most}");
    }
    std::fs::remove_dir_all(folder).expect("the folder for counts");
}
