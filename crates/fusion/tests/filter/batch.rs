//! What wheels and sensors tell in a world, to the filter epoch by epoch, and all at once to a batch smoother of other people: GTSAM.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use omnibase_fusion::{Filter, Reading, Sensor};
use omnibase_platform::{BodyStep, Pose2, wrap_angle_rad};

use crate::world::{World, gyro, mouse, settings, tracker};

/// Cycles in an epoch of the filter.
const CYCLES: u64 = 5;
const EPOCH_S: f64 = 5e-3;
/// Milliseconds from one reading to the next of gyro, mice and poses.
const EVERY: [u64; 4] = [1, 8, 8, 10];

/// When, s, and what.
type Heard = (f64, [f64; 3]);

/// The end of a world as both tell it: x, y and heading, m and rad.
pub struct Ends {
    /// Standard deviations of the batch, and of the filter.
    pub batch_sigma: [f64; 3],
    pub filter_sigma: [f64; 3],
    /// Filter less batch, and true less batch.
    pub filter_off: [f64; 3],
    #[allow(dead_code, reason = "the example prints it")]
    pub truth_off: [f64; 3],
}

impl Ends {
    /// Of a world of so many epochs, by a Python that has GTSAM.
    pub fn of(seed: u64, epochs: u64, python: &Path) -> Ends {
        let (table, filter, truth) = drive(seed, epochs);
        let file = std::env::temp_dir().join(format!("omnibase-smoother-{}-{seed}.csv", std::process::id()));
        std::fs::write(&file, table).expect("the table is written");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/smoother/batch.py");
        let output = Command::new(python).arg(script).arg(&file).output().expect("python runs");
        std::fs::remove_file(&file).expect("the table is there");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let told = String::from_utf8_lossy(&output.stdout);
        let numbers: Vec<f64> = told.split_whitespace().map(|word| word.parse().expect("numbers")).collect();
        let [x, y, heading, sx, sy, sh] = numbers[..] else { panic!("expected six numbers, found `{told}`") };
        let off = |pose: Pose2| [pose.x_m - x, pose.y_m - y, wrap_angle_rad(pose.heading_rad - heading)];
        let belief = filter.belief().0;
        let [xx, _, _, yy, _, hh] = belief.pose_covariance();
        Ends {
            batch_sigma: [sx, sy, sh],
            filter_sigma: [xx, yy, hh].map(f64::sqrt),
            filter_off: off(belief.map_from_body),
            truth_off: off(truth),
        }
    }

    /// In standard deviations of the batch.
    pub fn over_batch(&self, all: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|n| all[n] / self.batch_sigma[n])
    }
}

/// What is told epoch by epoch, the filter at the end, and the truth there.
fn drive(seed: u64, epochs: u64) -> (String, Filter, Pose2) {
    let sensors: [Sensor; 4] = [gyro(), mouse(0.2, 0.1), mouse(-0.2, 0.1), tracker()];
    let mut world = World::new(seed, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let mut table = head(&sensors);
    // One epoch more, so that the last one is passed.
    for epoch in 0..=epochs {
        let mut moved = Pose2::default();
        let mut heard: [Vec<Heard>; 4] = Default::default();
        for cycle in 1..=CYCLES {
            let (truth, end_ns) = (world.truth, world.now_ns);
            let motion = world.step();
            moved = moved.then(motion.body_from_next);
            filter.advance(world.now_ns, &motion);
            if epoch == epochs {
                assert_eq!(filter.belief().1, end_ns, "all of it is passed, and nothing else");
                return (table, filter, truth);
            }
            for (sensor, every) in EVERY.iter().enumerate() {
                if (epoch * CYCLES + cycle).is_multiple_of(*every) {
                    let reading = world.read(sensor);
                    assert!(filter.hear(sensor, world.now_ns, &reading));
                    let values = match reading {
                        Reading::Turn(turn) => [turn, 0.0, 0.0],
                        Reading::Inertial { .. } => unreachable!("no sensor of this world is one"),
                        Reading::Flow([x, y]) => [x, y, 0.0],
                        Reading::Twist(twist) => twist,
                        Reading::Pose { map_from_sensor: Pose2 { x_m, y_m, heading_rad }, .. } => {
                            [x_m, y_m, heading_rad]
                        }
                    };
                    heard[sensor].push((1e-3 * (cycle as f64 - 2.5), values));
                }
            }
        }
        let BodyStep { x_m, y_m, angle_rad } = moved.log();
        let _ = write!(table, "{x_m:e},{y_m:e},{angle_rad:e}");
        for readings in heard {
            let count = readings.len() as f64;
            let mean = |of: &dyn Fn(&Heard) -> f64| readings.iter().map(of).sum::<f64>() / count.max(1.0);
            let values: [f64; 3] = std::array::from_fn(|n| mean(&|one| one.1[n]));
            let _ = write!(
                table,
                ",{count},{:e},{:e},{:e},{:e}",
                mean(&|one| one.0),
                values[0],
                values[1],
                values[2]
            );
        }
        table.push('\n');
    }
    unreachable!("the last epoch ends it")
}

/// What a smoother must know: settings, one line each.
fn head(sensors: &[Sensor; 4]) -> String {
    let settings = settings();
    let wheels = &settings.wheels;
    let mut text = format!("{EPOCH_S}\n{:e},{:e}\n", wheels.initial_m2, wheels.initial_rad2);
    let _ = writeln!(
        text,
        "{:e},{:e},{:e},{:e}",
        wheels.position_per_m, wheels.position_per_rad, wheels.heading_per_m, wheels.heading_per_rad
    );
    let row = |row: usize| {
        (0..9).map(|column| format!("{:e}", settings.geometry[(row, column)])).collect::<Vec<_>>()
    };
    let _ = writeln!(text, "{}", (0..9).flat_map(row).collect::<Vec<_>>().join(","));
    for Sensor {
        body_from_sensor: at, sigma, bias_sigma, bias_walk, scale_sigma, direction_sigma_rad, ..
    } in sensors
    {
        let [sx, sy, sh] = sigma;
        let _ = writeln!(
            text,
            "{},{},{},{sx:e},{sy:e},{sh:e},{bias_sigma:e},{bias_walk:e},{scale_sigma:e},{direction_sigma_rad:e}",
            at.x_m, at.y_m, at.heading_rad
        );
    }
    text
}
