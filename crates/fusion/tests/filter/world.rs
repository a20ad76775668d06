//! A platform that moves, its wheels and its sensors, with errors as the settings say. Seeded.

use omnibase_fusion::{Filter, FilterSettings, MAX_SENSORS, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::layout::omni;
use omnibase_platform::{BodyStep, CovarianceSettings, Kinematics, Pose2, Twist2, wrap_angle_rad};

/// Numbers that look random, the same for the same seed (SplitMix64: Steele, Lea and Flood, OOPSLA 2014).
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        Chance(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5851_F42D_4C95_7F2D)
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of variance 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

pub const PERIOD_NS: u64 = 1_000_000;
const PERIOD_S: f64 = 1e-3;

pub fn kinematics() -> Kinematics {
    Kinematics::new(omni(3, 0.3, 0.06, 0.0)).expect("a platform")
}

pub fn settings() -> FilterSettings {
    FilterSettings::new(&kinematics(), CovarianceSettings::default(), PERIOD_NS)
}

pub fn gyro() -> Sensor {
    Sensor {
        kind: SensorKind::Turn,
        body_from_sensor: Pose2::default(),
        sigma: [3e-3, 0.0, 0.0],
        bias_sigma: 0.01,
        bias_walk: 1e-4,
        scale_sigma: 2e-3,
        direction_sigma_rad: 0.0,
        silent_ns: 300_000_000,
    }
}

pub fn mouse(x_m: f64, y_m: f64) -> Sensor {
    Sensor {
        kind: SensorKind::Flow,
        body_from_sensor: Pose2::new(x_m, y_m, 0.4),
        sigma: [0.01, 0.01, 0.0],
        bias_sigma: 0.0,
        bias_walk: 0.0,
        scale_sigma: 0.01,
        direction_sigma_rad: 0.017,
        silent_ns: 300_000_000,
    }
}

pub fn tracker() -> Sensor {
    Sensor {
        kind: SensorKind::Pose,
        body_from_sensor: Pose2::new(0.1, -0.05, 0.3),
        sigma: [1e-3, 1e-3, 2e-3],
        bias_sigma: 0.0,
        bias_walk: 0.0,
        scale_sigma: 0.0,
        direction_sigma_rad: 0.0,
        silent_ns: 300_000_000,
    }
}

pub fn imu() -> Sensor {
    Sensor { kind: SensorKind::Inertial, sigma: [3e-3, 0.05, 0.05], ..gyro() }
}

pub fn camera() -> Sensor {
    Sensor { kind: SensorKind::Twist, sigma: [0.02, 0.02, 5e-3], ..mouse(0.1, 0.2) }
}

/// A platform whose wheels and sensors err as their settings say.
pub struct World {
    pub chance: Chance,
    sensors: Vec<Sensor>,
    own: [[f64; 2]; MAX_SENSORS],
    geometry: [[f64; 3]; 3],
    slip: [f64; 3],
    settings: FilterSettings,
    pub truth: Pose2,
    pub twist: Twist2,
    twist_before: Twist2,
    pub now_ns: u64,
    cycle: u64,
}

impl World {
    pub fn new(seed: u64, sensors: &[Sensor]) -> World {
        let mut chance = Chance::new(seed);
        let settings = settings();
        let root = settings.geometry.symmetric_eigen();
        let draws = nalgebra::SVector::<f64, 9>::from_fn(|n, _| {
            root.eigenvalues[n].max(0.0).sqrt() * chance.normal()
        });
        let drawn = root.eigenvectors * draws;
        let mut own = [[0.0; 2]; MAX_SENSORS];
        for (sensor, own) in sensors.iter().zip(&mut own) {
            *own = match sensor.kind {
                SensorKind::Turn | SensorKind::Inertial => [sensor.bias_sigma, sensor.scale_sigma],
                _ => [sensor.scale_sigma, sensor.direction_sigma_rad],
            }
            .map(|sigma| sigma * chance.normal());
        }
        let start = (settings.wheels.initial_m2.sqrt(), settings.wheels.initial_rad2.sqrt());
        let truth =
            Pose2::new(start.0 * chance.normal(), start.0 * chance.normal(), start.1 * chance.normal());
        World {
            geometry: std::array::from_fn(|r| std::array::from_fn(|c| drawn[3 * r + c])),
            chance,
            sensors: sensors.to_vec(),
            own,
            slip: [0.0; 3],
            settings,
            truth,
            twist: Twist2::default(),
            twist_before: Twist2::default(),
            now_ns: 1_000_000_000,
            cycle: 0,
        }
    }

    /// A wandering motion at about 0.5 m/s.
    fn wanders(time_s: f64) -> Twist2 {
        let ramp = (time_s / 2.0).min(1.0);
        Twist2::new(
            ramp * 0.5 * (0.7 * time_s).cos(),
            ramp * 0.4 * (0.45 * time_s).sin(),
            ramp * 0.6 * (0.3 * time_s).sin(),
        )
    }

    fn begin(&mut self) {
        self.now_ns += PERIOD_NS;
        self.cycle += 1;
        for (sensor, own) in self.sensors.iter().zip(&mut self.own) {
            if sensor.kind.is_gyro() {
                own[0] += sensor.bias_walk * PERIOD_S.sqrt() * self.chance.normal();
            }
        }
    }

    /// A cycle of it: what the wheels tell.
    pub fn step(&mut self) -> Motion {
        self.begin();
        let time_s = self.cycle as f64 * PERIOD_S;
        let truly = Self::wanders(time_s - 0.5 * PERIOD_S);
        self.moves(Self::wanders(time_s), truly)
    }

    /// A cycle in which the wheels turn as they are told, whatever comes of it.
    pub fn drive(&mut self, wheels: Twist2) -> Motion {
        self.begin();
        let told = [wheels.vx_m_s, wheels.vy_m_s, wheels.w_rad_s];
        let [x, y, turn] = std::array::from_fn(|r| {
            let wrong: f64 = (0..3).map(|c| self.geometry[r][c] * told[c]).sum();
            told[r] + wrong - self.slip[r]
        });
        let truly = Twist2::new(x, y, turn);
        self.moves(truly, truly)
    }

    /// Sensors tell the twist at the end of a cycle, and it moves as in its middle.
    fn moves(&mut self, twist: Twist2, in_middle: Twist2) -> Motion {
        self.twist_before = self.twist;
        self.twist = twist;
        let truly = in_middle.over(PERIOD_S);
        self.truth = self.truth.moved_by(truly);
        // u + E·u − s·T is truly: u is, to first order, truly − E·truly + s·T.
        let way = [truly.x_m, truly.y_m, truly.angle_rad];
        let told: [f64; 3] = std::array::from_fn(|r| {
            let wrong: f64 = (0..3).map(|c| self.geometry[r][c] * way[c]).sum();
            way[r] - wrong + self.slip[r] * PERIOD_S
        });
        let keep = f64::exp(-PERIOD_S / 0.15);
        let (way_m, turn_rad) = (truly.distance_m(), truly.angle_rad.abs());
        let wheels = &self.settings.wheels;
        let position = wheels.position_per_m * way_m + wheels.position_per_rad * turn_rad;
        let heading = wheels.heading_per_m * way_m + wheels.heading_per_rad * turn_rad;
        for (n, variance) in [position, position, heading].iter().enumerate() {
            let sigma = (variance / (2.0 * 0.15 * PERIOD_S)).sqrt();
            let drive = sigma * (1.0 - keep * keep).sqrt();
            self.slip[n] = keep * self.slip[n] + drive * self.chance.normal();
        }
        Motion {
            body_from_next: BodyStep::new(told[0], told[1], told[2]).exp(),
            is_heard: true,
            ..Motion::default()
        }
    }

    /// How an inertial sensor is accelerated along its own axes, with noise and a bias, m/s².
    fn felt(&self, mount: Pose2, noise: [f64; 2]) -> [f64; 2] {
        let (now, before) = (self.twist, self.twist_before);
        let gain = [now.vx_m_s - before.vx_m_s, now.vy_m_s - before.vy_m_s].map(|gain| gain / PERIOD_S);
        let body = [gain[0] - now.w_rad_s * now.vy_m_s, gain[1] + now.w_rad_s * now.vx_m_s];
        let (sin, cos) = mount.heading_rad.sin_cos();
        [cos * body[0] + sin * body[1] + 0.2 + noise[0], -sin * body[0] + cos * body[1] - 0.1 + noise[1]]
    }

    /// What a sensor says now.
    pub fn read(&mut self, sensor: usize) -> Reading {
        let known = self.sensors[sensor];
        let [one, other] = self.own[sensor];
        let noise = known.sigma.map(|sigma| sigma * self.chance.normal());
        match known.kind {
            SensorKind::Turn => Reading::Turn((1.0 + other) * self.twist.w_rad_s + one + noise[0]),
            SensorKind::Inertial => Reading::Inertial {
                turn: (1.0 + other) * self.twist.w_rad_s + one + noise[0],
                acceleration: self.felt(known.body_from_sensor, [noise[1], noise[2]]),
            },
            SensorKind::Flow => {
                let mut mount = known.body_from_sensor;
                mount.heading_rad += other;
                let at = self.twist.at(mount);
                Reading::Flow([(1.0 + one) * at.vx_m_s + noise[0], (1.0 + one) * at.vy_m_s + noise[1]])
            }
            SensorKind::Twist => {
                let mut mount = known.body_from_sensor;
                mount.heading_rad += other;
                let at = self.twist.at(mount);
                let along = [at.vx_m_s, at.vy_m_s].map(|speed| (1.0 + one) * speed);
                Reading::Twist([along[0] + noise[0], along[1] + noise[1], at.w_rad_s + noise[2]])
            }
            SensorKind::Pose => {
                let at = self.truth.then(known.body_from_sensor);
                let map_from_sensor =
                    Pose2::new(at.x_m + noise[0], at.y_m + noise[1], at.heading_rad + noise[2]);
                Reading::Pose { map_from_sensor, covariance: [0.0; 6] }
            }
        }
    }
}

/// True minus believed: x, y, heading.
pub fn error(filter: &Filter, truth: Pose2) -> [f64; 3] {
    let believed = filter.estimate().map_from_body;
    [
        truth.x_m - believed.x_m,
        truth.y_m - believed.y_m,
        wrap_angle_rad(truth.heading_rad - believed.heading_rad),
    ]
}

/// The error in the measure of its covariance, over its three degrees of freedom.
pub fn nees(filter: &Filter, truth: Pose2) -> f64 {
    let [xx, xy, xh, yy, yh, hh] = filter.estimate().covariance;
    let covariance = nalgebra::Matrix3::new(xx, xy, xh, xy, yy, yh, xh, yh, hh);
    let error = nalgebra::Vector3::from(error(filter, truth));
    let inverse = covariance.try_inverse().expect("a covariance");
    error.dot(&(inverse * error)) / 3.0
}
