//! The platform's limits on speed, acceleration and jerk, held in every cycle whatever is wished.
//!
//! Translation and rotation each are a vector whose length is limited. A wish that keeps the limits passes as it is;
//! else the setpoint lags behind and catches up. The limits hold exactly, for each step keeps a way back: from every
//! state that is entered, taking the acceleration back at the greatest jerk stays within the speed limit (the speeds on
//! that way lie between two speeds within a disc, so they lie within it too).

use omnibase_platform::{Pose2, Twist2};

use crate::config::Limits;
use crate::signals::Setpoint;

/// How fast a lag behind the wished pose is caught up, 1/s.
const CATCH_UP_1_S: f64 = 5.0;
/// Halvings on the way from a step that would leave the limits to the one that never does.
const HALVINGS: u32 = 20;

type Vector = [f64; 2];

/// Speed and acceleration of translation or rotation, within their limits.
#[derive(Clone, Copy, Debug)]
struct Motion {
    speed: Vector,
    acceleration: Vector,
    greatest_speed: f64,
    greatest_acceleration: f64,
    greatest_jerk: f64,
}

/// What lets a wished motion through as far as the platform's limits allow.
#[derive(Clone, Copy, Debug)]
pub struct Limiter {
    translation: Motion,
    rotation: Motion,
    pose: Pose2,
}

impl Limiter {
    /// A limiter at rest at the origin.
    pub fn new(limits: &Limits) -> Self {
        let motion = |greatest_speed, greatest_acceleration, greatest_jerk| Motion {
            speed: [0.0; 2],
            acceleration: [0.0; 2],
            greatest_speed,
            greatest_acceleration,
            greatest_jerk,
        };
        Limiter {
            translation: motion(limits.speed_m_s, limits.acceleration_m_s2, limits.jerk_m_s3),
            rotation: motion(
                limits.turn_speed_rad_s,
                limits.turn_acceleration_rad_s2,
                limits.turn_jerk_rad_s3,
            ),
            pose: Pose2::default(),
        }
    }

    /// Begins anew, at rest at a pose.
    pub fn reset(&mut self, pose: Pose2) {
        for motion in [&mut self.translation, &mut self.rotation] {
            motion.speed = [0.0; 2];
            motion.acceleration = [0.0; 2];
        }
        self.pose = pose;
    }

    /// Whether speed and acceleration are zero.
    pub fn is_at_rest(&self) -> bool {
        [self.translation, self.rotation].iter().all(|motion| {
            let zero = [0.0; 2];
            motion.speed == zero && motion.acceleration == zero
        })
    }

    /// One period towards a wished motion: its pose, speed and acceleration.
    pub fn follow(&mut self, wished: &Setpoint, period_s: f64) -> Setpoint {
        // Where the wished pose will be found from here: the lag that remains is caught up.
        let lag = [
            wished.odom_from_body.x_m - self.pose.x_m,
            wished.odom_from_body.y_m - self.pose.y_m,
            wished.odom_from_body.heading_rad - self.pose.heading_rad,
        ];
        let moved = |speed: f64, wished_speed: f64| 0.5 * (speed + wished_speed) * period_s;
        let twist = &wished.twist_in_odom;
        let speed = &self.translation.speed;
        let catch_up = [
            CATCH_UP_1_S * (lag[0] - moved(speed[0], twist.vx_m_s)),
            CATCH_UP_1_S * (lag[1] - moved(speed[1], twist.vy_m_s)),
            CATCH_UP_1_S * (lag[2] - moved(self.rotation.speed[0], twist.w_rad_s)),
        ];
        let target =
            Twist2::new(twist.vx_m_s + catch_up[0], twist.vy_m_s + catch_up[1], twist.w_rad_s + catch_up[2]);
        self.step(target, wished.acceleration_in_odom, period_s)
    }

    /// One period towards a speed, in odom.
    pub fn toward(&mut self, twist_in_odom: Twist2, period_s: f64) -> Setpoint {
        self.step(twist_in_odom, Twist2::default(), period_s)
    }

    fn step(&mut self, target: Twist2, acceleration: Twist2, period_s: f64) -> Setpoint {
        let (translation, rotation) = (self.translation.speed, self.rotation.speed[0]);
        let along = [acceleration.vx_m_s, acceleration.vy_m_s];
        self.translation.step([target.vx_m_s, target.vy_m_s], along, period_s);
        self.rotation.step([target.w_rad_s, 0.0], [acceleration.w_rad_s, 0.0], period_s);
        let half_s = 0.5 * period_s;
        self.pose.x_m += half_s * (translation[0] + self.translation.speed[0]);
        self.pose.y_m += half_s * (translation[1] + self.translation.speed[1]);
        self.pose.heading_rad += half_s * (rotation + self.rotation.speed[0]);
        self.setpoint()
    }

    /// Where the limiter is.
    pub fn setpoint(&self) -> Setpoint {
        let twist =
            |translation: Vector, rotation: Vector| Twist2::new(translation[0], translation[1], rotation[0]);
        Setpoint {
            odom_from_body: self.pose,
            twist_in_odom: twist(self.translation.speed, self.rotation.speed),
            acceleration_in_odom: twist(self.translation.acceleration, self.rotation.acceleration),
            status: Default::default(),
        }
    }
}

impl Motion {
    /// One period towards a speed that itself changes by `accelerating`.
    fn step(&mut self, target: Vector, accelerating: Vector, period_s: f64) {
        let target = shortened(target, self.greatest_speed);
        let accelerating = shortened(accelerating, self.greatest_acceleration);
        let change = self.greatest_jerk * period_s;
        let missing = minus(target, self.speed);
        let at_once = scaled(missing, 1.0 / period_s);
        let reaches = length(at_once) <= self.greatest_acceleration
            && length(minus(at_once, self.acceleration)) <= change
            && length(minus(at_once, accelerating)) <= 2.0 * change;
        let wished = if reaches {
            at_once
        } else {
            // The acceleration from which, taken back at the greatest jerk, the missing speed is just reached.
            let half = 0.5 * change;
            let size = (2.0 * self.greatest_jerk * length(missing) + half * half).sqrt() - half;
            shortened(plus(accelerating, with_length(missing, size)), self.greatest_acceleration)
        };
        let wished = plus(self.acceleration, shortened(minus(wished, self.acceleration), change));
        let acceleration = if self.keeps_limits(wished, period_s) {
            wished
        } else {
            self.largest_safe(wished, change, period_s)
        };
        // A target reached at once is met to the bit: at rest means zero.
        self.speed = if reaches && acceleration == wished && length(minus(wished, at_once)) == 0.0 {
            target
        } else {
            plus(self.speed, scaled(acceleration, period_s))
        };
        self.acceleration = acceleration;
    }

    /// The last step towards `wished` that keeps the limits, found from the one that takes the acceleration back.
    fn largest_safe(&self, wished: Vector, change: f64, period_s: f64) -> Vector {
        let back = with_length(self.acceleration, (length(self.acceleration) - change).max(0.0));
        let (mut safe, mut unsafe_part) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let part = 0.5 * (safe + unsafe_part);
            if self.keeps_limits(plus(back, scaled(minus(wished, back), part)), period_s) {
                safe = part;
            } else {
                unsafe_part = part;
            }
        }
        plus(back, scaled(minus(wished, back), safe))
    }

    /// Whether the speed after this step, and the one after taking its acceleration back, are within the limit.
    fn keeps_limits(&self, acceleration: Vector, period_s: f64) -> bool {
        let next = plus(self.speed, scaled(acceleration, period_s));
        let size = length(acceleration);
        let change = self.greatest_jerk * period_s;
        let steps = (size / change).floor();
        let gained = period_s * (steps * size - 0.5 * change * steps * (steps + 1.0));
        let end = plus(next, with_length(acceleration, gained));
        length(next) <= self.greatest_speed && length(end) <= self.greatest_speed
    }
}

fn length(a: Vector) -> f64 {
    a[0].hypot(a[1])
}

fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

fn scaled(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor]
}

/// `a` with another length; zero stays zero.
fn with_length(a: Vector, wished: f64) -> Vector {
    let size = length(a);
    if size > 0.0 { scaled(a, wished / size) } else { [0.0; 2] }
}

/// `a`, no longer than `greatest`.
fn shortened(a: Vector, greatest: f64) -> Vector {
    if length(a) > greatest { with_length(a, greatest) } else { a }
}
