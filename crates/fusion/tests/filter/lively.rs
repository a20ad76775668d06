//! A platform that starts, stops and turns as its limits let it, whose wheels slip when they are told to.

use omnibase_fusion::{Motion, Reading, Sensor, SensorKind};
use omnibase_platform::{BodyStep, Pose2, Twist2};

use crate::world::{Chance, PERIOD_NS};

const PERIOD_S: f64 = 1e-3;
/// Acceleration, m/s² and rad/s², and how long each ramp and each rest between lasts, s.
const GAIN: [f64; 3] = [1.5, 0.9, 2.0];
const RAMP_S: f64 = 0.4;
const REST_S: f64 = 0.5;

/// Its true motion, and that of its wheels.
pub struct Lively {
    pub truth: Pose2,
    /// The last of them is now's.
    pub twists: Vec<Twist2>,
    pub now_ns: u64,
    /// By which share the floor carries less acceleration than the wheels are told, from one second of the motion to another:
    /// the platform lags, and catches up by what is carried.
    slip: Option<(f64, [f64; 2])>,
    carried: [f64; 3],
    chance: Chance,
}

impl Lively {
    pub fn new(seed: u64, slip: Option<(f64, [f64; 2])>) -> Self {
        Lively {
            truth: Pose2::default(),
            twists: vec![Twist2::default()],
            now_ns: 1_000_000_000,
            slip,
            carried: [0.0; 3],
            chance: Chance::new(seed),
        }
    }

    pub fn time_s(&self) -> f64 {
        (self.now_ns - 1_000_000_000) as f64 * 1e-9
    }

    /// The speed to which it ramps: there, back, and at rest for the first second.
    fn wanted(time_s: f64) -> [f64; 3] {
        let phase = (time_s - 1.0).max(0.0) / (RAMP_S + REST_S);
        let (number, share) = (phase.floor(), (phase.fract() * (RAMP_S + REST_S) / RAMP_S).min(1.0));
        let level = |number: f64| [0.0, 1.0, 0.0, -1.0][(number.max(0.0) as usize) % 4];
        let from_to = level(number) + (level(number + 1.0) - level(number)) * share;
        GAIN.map(|gain| if time_s < 1.0 { 0.0 } else { from_to * gain * RAMP_S })
    }

    /// A cycle.
    pub fn step(&mut self) -> Motion {
        self.now_ns += PERIOD_NS;
        let time_s = self.time_s();
        let [x, y, turn] = Self::wanted(time_s);
        let wheels = Twist2::new(x, y, turn);
        // What the floor carries: elsewhere all that is asked.
        let share = match self.slip {
            Some((share, [from_s, to_s])) if (from_s..to_s).contains(&time_s) => 1.0 - share,
            _ => 10.0,
        };
        for (carried, (asked, gain)) in self.carried.iter_mut().zip([x, y, turn].into_iter().zip(GAIN)) {
            let most = share * gain * PERIOD_S;
            *carried += (asked - *carried).clamp(-most, most);
        }
        let [x, y, turn] = self.carried;
        let truly = Twist2::new(x, y, turn);
        self.twists.push(truly);
        self.truth = self.truth.moved_by(truly.over(PERIOD_S));
        let told = wheels.over(PERIOD_S);
        let mut noise = || 1e-6 * self.chance.normal();
        let told = BodyStep::new(told.x_m + noise(), told.y_m + noise(), told.angle_rad + noise());
        Motion { body_from_next: told.exp(), is_heard: true, ..Motion::default() }
    }

    /// What a sensor says of the twist so many cycles ago.
    pub fn read(&mut self, sensor: &Sensor, ago: usize) -> Reading {
        let at = |ago: usize| self.twists[self.twists.len().saturating_sub(1 + ago)];
        let (twist, before) = (at(ago), at(ago + 1));
        let noise = sensor.sigma.map(|sigma| sigma * self.chance.normal());
        match sensor.kind {
            SensorKind::Turn => Reading::Turn(twist.w_rad_s + 0.01 + noise[0]),
            SensorKind::Flow => {
                let at = twist.at(sensor.body_from_sensor);
                Reading::Flow([1.01 * at.vx_m_s + noise[0], 1.01 * at.vy_m_s + noise[1]])
            }
            SensorKind::Inertial => {
                let felt = [
                    (twist.vx_m_s - before.vx_m_s) / PERIOD_S - twist.w_rad_s * twist.vy_m_s,
                    (twist.vy_m_s - before.vy_m_s) / PERIOD_S + twist.w_rad_s * twist.vx_m_s,
                ];
                let acceleration = [felt[0] + 0.2 + noise[1], felt[1] - 0.1 + noise[2]];
                Reading::Inertial { turn: twist.w_rad_s + 0.01 + noise[0], acceleration }
            }
            SensorKind::Twist => {
                let at = twist.at(sensor.body_from_sensor);
                let [x, y] = [at.vx_m_s, at.vy_m_s].map(|speed| 1.01 * speed);
                Reading::Twist([x + noise[0], y + noise[1], at.w_rad_s + noise[2]])
            }
            SensorKind::Pose => {
                assert_eq!(ago, 0, "of now");
                let Pose2 { x_m, y_m, heading_rad } = self.truth.then(sensor.body_from_sensor);
                let map_from_sensor = Pose2::new(x_m + noise[0], y_m + noise[1], heading_rad + noise[2]);
                Reading::Pose { map_from_sensor, covariance: [0.0; 6] }
            }
        }
    }
}
