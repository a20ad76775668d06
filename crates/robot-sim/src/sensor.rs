//! Sensors beside the wheels, with all their vices: bias, walk, scale, steps, latency with jitter, readings that never
//! come or are anywhere, a mouse that is lifted off, a clock that drifts.
//!
//! What they tell follows from the true motion alone. Their chance comes from a seed.

use crate::pose::{Pose, Twist};

/// What a sensor tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tells {
    /// How fast it turns, rad/s.
    Turn,
    /// That, and how it is accelerated along its own axes, m/s².
    Inertia,
    /// How far it went since it was switched on, along its own axes, m.
    Flow,
    /// Its speed along its own axes, m/s, and how fast it turns, rad/s.
    Twist,
    /// Its own pose in the fixed frame.
    Pose,
}

/// A sensor as it really is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorParameters {
    /// What it tells.
    pub tells: Tells,
    /// Where it is really mounted, in base_link.
    pub mount: Pose,
    /// Time between two readings, ns.
    pub period_ns: u64,
    /// Noise of x and y of a reading, standard deviation.
    pub noise: f64,
    /// Noise of its turn or heading.
    pub turn_noise: f64,
    /// Bias of a gyro, rad/s.
    pub bias_rad_s: f64,
    /// How far that wanders within a second, rad/s.
    pub bias_walk_rad_s: f64,
    /// Bias of accelerations, m/s².
    pub bias_m_s2: [f64; 2],
    /// It tells so much too much, as a share.
    pub scale_error: f64,
    /// Steps of what it tells; 0 for none.
    pub quantum: f64,
    /// A reading is on its way for so long, ns.
    pub latency_ns: u64,
    /// And at most so much longer, evenly spread, ns.
    pub jitter_ns: u64,
    /// Share of readings that never come.
    pub drop_share: f64,
    /// Share of readings that are anywhere within 1 of the truth.
    pub outlier_share: f64,
    /// Share of the way on which it is lifted off.
    pub lift_off_share: f64,
    /// Its clock runs fast by so much, ppm.
    pub clock_drift_ppm: f64,
    /// Of its chance.
    pub seed: u64,
}

/// What it said: when it arrives, the instant that it gives, and its values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorMessage {
    /// When it arrives, ns.
    pub arrives_ns: u64,
    /// Its instant by the sensor's clock, ns.
    pub instant_ns: u64,
    /// x, y and turn or heading; of a gyro the turn first, then accelerations.
    pub values: [f64; 3],
}

/// A simulated sensor.
#[derive(Clone, Debug)]
pub struct SimulatedSensor {
    parameters: SensorParameters,
    chance: Chance,
    bias_rad_s: f64,
    way_m: [f64; 2],
    last: Option<(u64, Pose)>,
    /// Its speed in the fixed frame at the last look, m/s, and how that changed until then, m/s².
    speed_m_s: Option<[f64; 2]>,
    acceleration_m_s2: [f64; 2],
    due_ns: u64,
    /// Of the way: up to where the mouse stays as it is, m, and whether it is lifted off.
    gone_m: f64,
    next_lift_m: f64,
    is_lifted: bool,
}

/// A mouse is lifted off, or not, for so much of its way, m.
const LIFTED_M: f64 = 0.1;

impl SimulatedSensor {
    /// Switched on before the first look.
    pub fn new(parameters: SensorParameters) -> Self {
        SimulatedSensor {
            chance: Chance(parameters.seed),
            bias_rad_s: parameters.bias_rad_s,
            way_m: [0.0; 2],
            last: None,
            speed_m_s: None,
            acceleration_m_s2: [0.0; 2],
            due_ns: 0,
            gone_m: 0.0,
            next_lift_m: 0.0,
            is_lifted: false,
            parameters,
        }
    }

    /// Where it is in the fixed frame.
    fn place(&self, body: Pose) -> Pose {
        let mount = self.parameters.mount;
        let (sin, cos) = body.heading_rad.sin_cos();
        Pose {
            x_m: body.x_m + cos * mount.x_m - sin * mount.y_m,
            y_m: body.y_m + sin * mount.x_m + cos * mount.y_m,
            heading_rad: body.heading_rad + mount.heading_rad,
        }
    }

    /// Looks at the true motion at an instant, later than the last; what it says of it, where a reading is due and comes.
    pub fn look(&mut self, now_ns: u64, body: Pose, twist: Twist) -> Option<SensorMessage> {
        let here = self.place(body);
        if let Some((before_ns, before)) = self.last {
            let time_s = now_ns.saturating_sub(before_ns) as f64 * 1e-9;
            self.go(time_s, before, here);
            self.speed_up(time_s, body, twist);
        }
        self.last = Some((now_ns, here));
        if now_ns < self.due_ns {
            return None;
        }
        self.due_ns =
            self.due_ns.max(now_ns.saturating_sub(self.parameters.period_ns)) + self.parameters.period_ns;
        let p = self.parameters;
        let scale = 1.0 + p.scale_error;
        let own = [twist.vx_m_s - twist.w_rad_s * p.mount.y_m, twist.vy_m_s + twist.w_rad_s * p.mount.x_m];
        let (sin, cos) = p.mount.heading_rad.sin_cos();
        let own = [cos * own[0] + sin * own[1], -sin * own[0] + cos * own[1]];
        let noise = [self.chance.normal(), self.chance.normal(), self.chance.normal()];
        let mut values = match p.tells {
            Tells::Turn => [scale * twist.w_rad_s + self.bias_rad_s + p.turn_noise * noise[0], 0.0, 0.0],
            Tells::Inertia => {
                let (sin, cos) = here.heading_rad.sin_cos();
                let [x, y] = self.acceleration_m_s2;
                let own = [cos * x + sin * y, -sin * x + cos * y];
                let told = |n: usize| scale * own[n] + p.bias_m_s2[n] + p.noise * noise[1 + n];
                [scale * twist.w_rad_s + self.bias_rad_s + p.turn_noise * noise[0], told(0), told(1)]
            }
            // Its noise is that of each step: the way wanders off by it.
            Tells::Flow => {
                let noise_m = if self.is_lifted { 0.0 } else { p.noise * p.period_ns as f64 * 1e-9 };
                for (way_m, noise) in self.way_m.iter_mut().zip(noise) {
                    *way_m += noise_m * noise;
                }
                [self.way_m[0], self.way_m[1], 0.0]
            }
            Tells::Twist => [
                scale * own[0] + p.noise * noise[0],
                scale * own[1] + p.noise * noise[1],
                twist.w_rad_s + p.turn_noise * noise[2],
            ],
            Tells::Pose => [
                here.x_m + p.noise * noise[0],
                here.y_m + p.noise * noise[1],
                here.heading_rad + p.turn_noise * noise[2],
            ],
        };
        if self.chance.unit() < p.outlier_share {
            values = values.map(|value| value + 2.0 * self.chance.unit() - 1.0);
        }
        if p.quantum > 0.0 {
            values = values.map(|value| (value / p.quantum).round() * p.quantum);
        }
        let late_ns = p.latency_ns + (self.chance.unit() * p.jitter_ns as f64) as u64;
        let drift_ns = now_ns as f64 * p.clock_drift_ppm * 1e-6;
        let comes = self.chance.unit() >= p.drop_share;
        comes.then_some(SensorMessage {
            arrives_ns: now_ns + late_ns,
            instant_ns: (now_ns as f64 + drift_ns).max(0.0) as u64,
            values,
        })
    }

    /// How its speed in the fixed frame changed since the last look.
    fn speed_up(&mut self, time_s: f64, body: Pose, twist: Twist) {
        let mount = self.parameters.mount;
        let own = [twist.vx_m_s - twist.w_rad_s * mount.y_m, twist.vy_m_s + twist.w_rad_s * mount.x_m];
        let (sin, cos) = body.heading_rad.sin_cos();
        let now = [cos * own[0] - sin * own[1], sin * own[0] + cos * own[1]];
        if let Some(before) = self.speed_m_s.replace(now)
            && time_s > 0.0
        {
            self.acceleration_m_s2 = [0, 1].map(|n| (now[n] - before[n]) / time_s);
        }
    }

    /// What becomes of bias and way while it goes from one place to the next.
    fn go(&mut self, time_s: f64, before: Pose, here: Pose) {
        self.bias_rad_s += self.parameters.bias_walk_rad_s * time_s.sqrt() * self.chance.normal();
        let (dx, dy) = (here.x_m - before.x_m, here.y_m - before.y_m);
        self.gone_m += dx.hypot(dy);
        while self.gone_m >= self.next_lift_m {
            self.next_lift_m += LIFTED_M;
            self.is_lifted = self.chance.unit() < self.parameters.lift_off_share;
        }
        if !self.is_lifted {
            let (sin, cos) = (0.5 * (before.heading_rad + here.heading_rad)).sin_cos();
            let scale = 1.0 + self.parameters.scale_error;
            self.way_m[0] += scale * (cos * dx + sin * dy);
            self.way_m[1] += scale * (-sin * dx + cos * dy);
        }
    }
}

/// Numbers that look random, the same for the same seed (SplitMix64: Steele, Lea and Flood, OOPSLA 2014).
#[derive(Clone, Copy, Debug)]
struct Chance(u64);

impl Chance {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// With mean 0 and variance 1 (Box and Muller).
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: SensorParameters = SensorParameters {
        tells: Tells::Flow,
        mount: Pose { x_m: 0.2, y_m: -0.1, heading_rad: 0.7 },
        period_ns: 1_000_000,
        noise: 0.0,
        turn_noise: 0.0,
        bias_rad_s: 0.0,
        bias_walk_rad_s: 0.0,
        bias_m_s2: [0.0; 2],
        scale_error: 0.0,
        quantum: 0.0,
        latency_ns: 0,
        jitter_ns: 0,
        drop_share: 0.0,
        outlier_share: 0.0,
        lift_off_share: 0.0,
        clock_drift_ppm: 0.0,
        seed: 1,
    };

    /// Half a turn about a point 1 m to the left of base_link within a second, as it is looked at.
    fn drive(parameters: SensorParameters) -> Vec<SensorMessage> {
        let mut sensor = SimulatedSensor::new(parameters);
        let turn = std::f64::consts::PI;
        let twist = Twist { vx_m_s: turn, vy_m_s: 0.0, w_rad_s: turn };
        let look = |n: u64| {
            let angle = turn * n as f64 * 1e-4;
            let pose = Pose { x_m: angle.sin(), y_m: 1.0 - angle.cos(), heading_rad: angle };
            sensor.look(n * 100_000, pose, twist)
        };
        (0..=10_000).filter_map(look).collect()
    }

    #[test]
    fn a_perfect_sensor_tells_the_closed_form() {
        let last = |parameters| drive(parameters).last().copied().expect("a reading");
        let turn = std::f64::consts::PI;
        assert_eq!(last(SensorParameters { tells: Tells::Turn, ..PERFECT }).values[0], turn);
        // The place of the sensor moves at turn × its distance from the pole, across the line to it.
        let speed = [turn - turn * -0.1, turn * 0.2];
        let (sin, cos) = 0.7_f64.sin_cos();
        let own = [cos * speed[0] + sin * speed[1], -sin * speed[0] + cos * speed[1]];
        let twist = last(SensorParameters { tells: Tells::Twist, ..PERFECT }).values;
        assert!((twist[0] - own[0]).abs() < 1e-12 && (twist[1] - own[1]).abs() < 1e-12, "{twist:?}");
        // About the pole it is only drawn inwards, by the turn's square times its distance.
        let inertia =
            last(SensorParameters { tells: Tells::Inertia, bias_m_s2: [0.5, -0.25], ..PERFECT }).values;
        let inwards = [-turn * turn * 0.2, turn * turn * 1.1];
        let felt = [cos * inwards[0] + sin * inwards[1] + 0.5, -sin * inwards[0] + cos * inwards[1] - 0.25];
        assert!(
            inertia[0] == turn && (0..2).all(|n| (inertia[n + 1] - felt[n]).abs() < 1e-2),
            "{inertia:?} {felt:?}"
        );
        let way = last(PERFECT).values;
        assert!(
            (way[0] - own[0]).abs() < 1e-6 && (way[1] - own[1]).abs() < 1e-6,
            "{way:?}: one second of it"
        );
        let pose = last(SensorParameters { tells: Tells::Pose, ..PERFECT }).values;
        assert!((pose[0] + 0.2).abs() < 1e-12 && (pose[1] - 2.1).abs() < 1e-12, "{pose:?}");
    }

    #[test]
    fn each_vice_is_as_great_as_it_was_asked_for() {
        let count = drive(PERFECT).len();
        assert_eq!(count, 1001);
        let dropped = count - drive(SensorParameters { drop_share: 0.3, ..PERFECT }).len();
        assert!((250..350).contains(&dropped), "{dropped}");
        let gyro = SensorParameters { tells: Tells::Turn, ..PERFECT };
        let turn = std::f64::consts::PI;
        let spread = |parameters: SensorParameters| {
            let all = drive(parameters);
            let off: Vec<f64> = all.iter().map(|message| message.values[0] - turn).collect();
            let mean = off.iter().sum::<f64>() / off.len() as f64;
            (mean, (off.iter().map(|off| (off - mean).powi(2)).sum::<f64>() / off.len() as f64).sqrt())
        };
        let (mean, sigma) = spread(SensorParameters { turn_noise: 0.01, bias_rad_s: 0.05, ..gyro });
        assert!((mean - 0.05).abs() < 1e-3 && (sigma - 0.01).abs() < 1e-3, "{mean} {sigma}");
        assert!((spread(SensorParameters { scale_error: 0.01, ..gyro }).0 - 0.01 * turn).abs() < 1e-9);
        assert!(spread(SensorParameters { outlier_share: 0.1, ..gyro }).1 > 0.1);
        // Over a second its steps' squares add up to the square of what a root of a second makes of it.
        let walks = drive(SensorParameters { bias_walk_rad_s: 0.02, ..gyro });
        let steps = walks.windows(2).map(|pair| (pair[1].values[0] - pair[0].values[0]).powi(2));
        let walked = steps.sum::<f64>().sqrt();
        assert!((0.018..0.022).contains(&walked), "{walked}");
        let way = |parameters| drive(parameters).last().expect("a reading").values;
        let whole = way(PERFECT)[0];
        let lifted = way(SensorParameters { lift_off_share: 0.5, ..PERFECT })[0];
        assert!((0.2..0.8).contains(&(lifted / whole)), "{lifted} of {whole}");
        let steps = way(SensorParameters { quantum: 0.5, ..PERFECT })[0];
        assert_eq!(steps % 0.5, 0.0);
        let late =
            drive(SensorParameters { latency_ns: 7_000, jitter_ns: 1000, clock_drift_ppm: 100.0, ..PERFECT });
        assert!(late.iter().all(|one| {
            let true_ns = one.instant_ns as f64 / (1.0 + 1e-4);
            let way_ns = one.arrives_ns as f64 - true_ns;
            (6_999.0..8_002.0).contains(&way_ns)
        }));
    }
}
