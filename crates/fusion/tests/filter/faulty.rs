//! A sensor that fails in one of the ways of which there are six, in a company of others.

use omnibase_fusion::{Filter, Reading, Sensor, SensorKind, Verdict};
use omnibase_platform::{Pose2, Twist2};

use crate::followed::{eight, is_lost, wheels};
use crate::world::{World, camera, error, gyro, imu, mouse, nees, settings, tracker};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    Dead,
    Frozen,
    /// By 1 m, m/s or rad/s.
    Jumping,
    Biased,
    Reversed,
    /// Its instants are told 50 ms too early.
    Early,
    /// And too late.
    Late,
}

pub const FAULTS: [Fault; 7] =
    [Fault::Dead, Fault::Frozen, Fault::Jumping, Fault::Biased, Fault::Reversed, Fault::Early, Fault::Late];

/// Companies of sensors; the first one fails.
pub fn companies() -> Vec<(&'static str, Vec<Sensor>)> {
    let [left, right] = [mouse(0.2, 0.1), mouse(-0.2, 0.1)];
    vec![
        ("gyro, beside two mice and poses", vec![gyro(), left, right, tracker()]),
        ("gyro, beside poses", vec![gyro(), tracker()]),
        ("imu, beside two mice and poses", vec![imu(), left, right, tracker()]),
        ("imu, beside twist and poses", vec![imu(), camera(), tracker()]),
        ("flow, beside a gyro, another and poses", vec![left, gyro(), right, tracker()]),
        ("flow, beside twist and an imu", vec![left, camera(), imu()]),
        ("twist, beside an imu and poses", vec![camera(), imu(), tracker()]),
        ("twist, beside a gyro and two mice", vec![camera(), gyro(), left, right]),
        ("pose, beside a gyro and two mice", vec![tracker(), gyro(), left, right]),
        ("pose, beside an imu and twist", vec![tracker(), imu(), camera()]),
        ("pose, alone", vec![tracker()]),
        ("gyro, alone", vec![gyro()]),
        ("imu, alone", vec![imu()]),
        ("flow, alone", vec![left]),
        ("twist, alone", vec![camera()]),
    ]
}

/// How many milliseconds lie between readings.
pub fn every(sensor: &Sensor) -> u64 {
    match sensor.kind {
        SensorKind::Turn | SensorKind::Inertial => 1,
        SensorKind::Flow => 8,
        SensorKind::Twist => 20,
        SensorKind::Pose => 10,
    }
}

/// What became of it.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// After how long it wasn't good any more, s, and what it was called.
    pub named: Option<(f64, Verdict)>,
    /// How far the truth was from what was believed at most, in standard deviations of x, y, heading.
    pub sigmas: f64,
    /// The share of the time from the fault on in which the truth was outside of the ellipsoid that holds it as often as three
    /// standard deviations hold one axis, and the mean NEES of that time over its three degrees of freedom.
    pub outside: f64,
    pub nees: f64,
    /// To how much half a second of the motion shows the first one's clock at best, standard deviation, s; of a pose nothing is told.
    pub shown_s: Option<f64>,
    /// Another that was named while the first failed, or any before.
    pub other: Option<usize>,
    /// How far the truth was from where it was to be at most, m; and that it stood because it didn't know where it is.
    pub led_m: f64,
    pub stood: bool,
}

/// Who says where the platform goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveProfile {
    /// Nobody who knows of the filter.
    Wanders,
    /// A control law, by what is believed.
    Followed,
}

/// chi² with three degrees of freedom that is exceeded as often as three standard deviations of one axis: by 0.27 %.
pub const THREE_SIGMA: f64 = 14.16;
pub const OUTSIDE: f64 = 0.0027;

/// What becomes of a reading.
fn broken(fault: Fault, reading: Reading, said: Reading) -> Reading {
    let by = match fault {
        Fault::Frozen => return said,
        Fault::Jumping => 1.0,
        // 50 mm of a place, 0.1 m/s or rad/s of a speed.
        Fault::Biased if matches!(reading, Reading::Pose { .. }) => 0.05,
        Fault::Biased => 0.1,
        _ => 0.0,
    };
    let sign = if fault == Fault::Reversed { -1.0 } else { 1.0 };
    match reading {
        Reading::Turn(turn) => Reading::Turn(sign * turn + by),
        Reading::Inertial { turn, acceleration } => {
            Reading::Inertial { turn: sign * turn + by, acceleration: acceleration.map(|one| sign * one) }
        }
        Reading::Flow([x, y]) => Reading::Flow([sign * x + by, sign * y]),
        Reading::Twist([x, y, turn]) => Reading::Twist([sign * x + by, sign * y, sign * turn]),
        Reading::Pose { map_from_sensor: Pose2 { x_m, y_m, heading_rad }, covariance } => Reading::Pose {
            map_from_sensor: Pose2::new(sign * x_m + by, sign * y_m, sign * heading_rad),
            covariance,
        },
    }
}

/// A world of 8 s; the first sensor fails after 5 s, or none.
pub fn drive(sensors: &[Sensor], fault: Option<Fault>, seed: u64) -> Outcome {
    drive_for((8.0, DriveProfile::Wanders), sensors, fault, seed)
}

/// The same in a world of so many seconds, on such a way.
pub fn drive_for(
    (time_s, way): (f64, DriveProfile),
    sensors: &[Sensor],
    fault: Option<Fault>,
    seed: u64,
) -> Outcome {
    let mut world = World::new(seed, sensors);
    let mut filter = Filter::new(settings(), sensors);
    let begin_ns = world.now_ns + 5_000_000_000;
    let mut said = [Reading::Turn(0.0); 8];
    let mut heard: Vec<std::collections::VecDeque<Reading>> = vec![Default::default(); sensors.len()];
    let mut outcome = Outcome {
        named: None,
        sigmas: 0.0,
        outside: 0.0,
        nees: 0.0,
        shown_s: None,
        other: None,
        led_m: 0.0,
        stood: false,
    };
    let mut looks = 0.0;
    let weight = |filter: &Filter| filter.clock_s(0).map(|[_, sigma_s]| sigma_s.powi(-2));
    let mut weight_before = None;
    for cycle in 0..(1000.0 * time_s) as u64 {
        let motion = match way {
            DriveProfile::Wanders => world.step(),
            DriveProfile::Followed => {
                let (to, speed) = eight(1e-3 * cycle as f64);
                outcome.stood |= is_lost(&filter) && fault.is_some() && world.now_ns >= begin_ns;
                if !outcome.stood {
                    outcome.led_m = outcome.led_m.max(to.distance_m(world.truth));
                }
                world.drive(if outcome.stood { Twist2::default() } else { wheels(&filter, to, speed) })
            }
        };
        filter.advance(world.now_ns, &motion);
        let fails = fault.filter(|_| world.now_ns >= begin_ns);
        for (place, sensor) in sensors.iter().enumerate() {
            if !cycle.is_multiple_of(every(sensor)) {
                continue;
            }
            let reading = world.read(place);
            let kept = &mut heard[place];
            kept.push_back(reading);
            // What was so 50 ms before.
            let before = kept[kept.len().saturating_sub(1 + (50 / every(sensor)) as usize)];
            let (reading, instant_ns) = match fails.filter(|_| place == 0) {
                Some(Fault::Dead) => continue,
                Some(Fault::Early) => (reading, world.now_ns - 50_000_000),
                Some(Fault::Late) => (before, world.now_ns),
                Some(fault) => (broken(fault, reading, said[place]), world.now_ns),
                None => {
                    said[place] = reading;
                    (reading, world.now_ns)
                }
            };
            filter.hear(place, instant_ns, &reading);
        }
        let since_s = (world.now_ns as f64 - begin_ns as f64) * 1e-9;
        for place in 0..sensors.len() {
            let verdict = filter.verdict(place).0;
            let is_named = !matches!(verdict, Verdict::Good | Verdict::Awaited);
            if is_named && place == 0 && fails.is_some() {
                outcome.named.get_or_insert((since_s, verdict));
            } else if is_named {
                outcome.other.get_or_insert(place);
            }
        }
        if world.now_ns == begin_ns {
            weight_before = weight(&filter);
        }
        if world.now_ns == begin_ns + 500_000_000 {
            // Of what was shown before so much is left.
            let left = f64::exp(-0.5);
            let half_s = weight(&filter).zip(weight_before).map(|(now, before)| now - left * before);
            outcome.shown_s = half_s.map(|weight| weight.max(1.0).powf(-0.5));
        }
        // From when it fails on: before, all is as ever.
        if since_s <= 0.0 {
            continue;
        }
        let covariance = filter.estimate().covariance;
        let off = error(&filter, world.truth);
        for (off, variance) in off.iter().zip([covariance[0], covariance[3], covariance[5]]) {
            outcome.sigmas = outcome.sigmas.max(off.abs() / variance.sqrt());
        }
        let nees = nees(&filter, world.truth);
        looks += 1.0;
        outcome.nees += nees;
        outcome.outside += f64::from(u8::from(3.0 * nees > THREE_SIGMA));
    }
    outcome.nees /= looks;
    outcome.outside /= looks;
    outcome
}
