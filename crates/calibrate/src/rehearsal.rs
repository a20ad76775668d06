//! Sensors that are made up where the truth is known: in a simulation, for a rehearsal. Their noise is stated, never hidden.

use omnibase_platform::{GeometrySigmas, Pose2, Wheel};

use crate::build::SensorMount;
use crate::dataset::{PlaceSample, PoseSample, TurnSample};

/// Numbers that look random, the same for the same seed (SplitMix64: Steele, Lea and Flood, OOPSLA 2014).
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66)
    }

    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// With mean 0 and deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let [size, turn] = [self.unit().max(f64::MIN_POSITIVE), std::f64::consts::TAU * self.unit()];
        (-2.0 * size.ln()).sqrt() * turn.cos()
    }
}

/// Another wheel than the file says: drawn by the tolerances with which it is built.
pub fn drawn_wheel(wheel: &Wheel, sigmas: &GeometrySigmas, random: &mut Random) -> Wheel {
    let mut drawn = wheel.clone();
    drawn.radius_m *= 1.0 + sigmas.radius_share * random.normal();
    let (sin, cos) = (sigmas.direction_rad * random.normal()).sin_cos();
    let turned = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    drawn.rolling_direction = turned(drawn.rolling_direction);
    drawn.force_direction = turned(drawn.force_direction);
    for coordinate in &mut drawn.position_m {
        *coordinate += sigmas.position_m * random.normal();
    }
    drawn
}

/// A sensor of poses as motion capture is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSensor {
    /// From one pose to the next, s.
    pub every_s: f64,
    /// Standard deviation of each coordinate, m.
    pub sigma_m: f64,
    /// Of the heading, rad.
    pub sigma_rad: f64,
    /// Where it is, and how late.
    pub mount: SensorMount,
}

impl Default for PoseSensor {
    /// 100 Hz, 1 mm, 3 mrad (markers 0.3 m apart, 1 mm each), 20 ms late, in the origin of base.
    fn default() -> Self {
        let mount = SensorMount { base_from_sensor: Pose2::default(), delay_s: 0.02 };
        PoseSensor { every_s: 0.01, sigma_m: 1e-3, sigma_rad: 3e-3, mount }
    }
}

impl PoseSensor {
    /// What it sends of a platform that was here at these instants, s.
    pub fn poses(&self, truth: &[(f64, Pose2)], random: &mut Random) -> Vec<PoseSample> {
        let mut poses = self.true_poses(truth);
        for PoseSample { instant_s, world_from_sensor: seen, .. } in &mut poses {
            *instant_s += self.mount.delay_s;
            seen.x_m += self.sigma_m * random.normal();
            seen.y_m += self.sigma_m * random.normal();
            seen.heading_rad += self.sigma_rad * random.normal();
        }
        poses
    }

    /// Where it truly is at the instants of which it sends, s: without noise, and not late.
    pub fn true_poses(&self, truth: &[(f64, Pose2)]) -> Vec<PoseSample> {
        let mut due_s = f64::NEG_INFINITY;
        let mut poses = Vec::new();
        for (instant_s, world_from_base) in truth {
            if *instant_s < due_s {
                continue;
            }
            // A little early, for instants on a grid are off by rounding.
            due_s = instant_s + self.every_s - 1e-6;
            poses.push(PoseSample {
                instant_s: *instant_s,
                world_from_sensor: world_from_base.then(self.mount.base_from_sensor),
                sigma_m: self.sigma_m,
                sigma_rad: self.sigma_rad,
            });
        }
        poses
    }
}

/// A gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroSensor {
    /// From one sample to the next, s.
    pub every_s: f64,
    /// Noise, rad/s/√Hz.
    pub density: f64,
    /// What it shows at rest, rad/s.
    pub bias_rad_s: f64,
    /// What it shows too much, as a share.
    pub scale: f64,
}

impl Default for GyroSensor {
    /// 200 Hz, 0.01 °/s/√Hz, 0.2 °/s at rest, 0.5 % too much: a micromachined gyro of a telephone, calibrated once.
    fn default() -> Self {
        GyroSensor { every_s: 5e-3, density: 1.7e-4, bias_rad_s: 3.5e-3, scale: 5e-3 }
    }
}

impl GyroSensor {
    /// What it sends of a platform that was here at these instants, s, and turned as fast, rad/s.
    pub fn turns(&self, truth: &[(f64, f64)], random: &mut Random) -> Vec<TurnSample> {
        let mut due_s = f64::NEG_INFINITY;
        let sigma_rad_s = self.density / self.every_s.sqrt();
        let mut turns = Vec::new();
        for (instant_s, rate_rad_s) in truth {
            if *instant_s < due_s {
                continue;
            }
            due_s = instant_s + self.every_s - 1e-6;
            let seen = (1.0 + self.scale) * rate_rad_s + self.bias_rad_s + sigma_rad_s * random.normal();
            turns.push(TurnSample { instant_s: *instant_s, rate_rad_s: seen });
        }
        turns
    }
}

/// Somebody with a tape and a line on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tape {
    /// Standard deviation of each coordinate, m.
    pub sigma_m: f64,
    /// Of the heading, rad.
    pub sigma_rad: f64,
}

impl Default for Tape {
    /// 1 mm, and 2 mrad: 1 mm at both ends of half a metre, roughly.
    fn default() -> Self {
        Tape { sigma_m: 1e-3, sigma_rad: 2e-3 }
    }
}

impl Tape {
    /// Where that person finds a platform that truly stands here.
    pub fn place(&self, instant_s: f64, floor_from_base: Pose2, random: &mut Random) -> PlaceSample {
        let found = Pose2 {
            x_m: floor_from_base.x_m + self.sigma_m * random.normal(),
            y_m: floor_from_base.y_m + self.sigma_m * random.normal(),
            heading_rad: floor_from_base.heading_rad + self.sigma_rad * random.normal(),
        };
        PlaceSample { instant_s, floor_from_base: found, sigma_m: self.sigma_m, sigma_rad: self.sigma_rad }
    }
}
