//! The rigid body on its wheels, advanced step by step.

mod check;
mod mounted;

use crate::contact::{self, Mass, Regime};
use crate::floor::{Floor, GRAVITY_M_S2, Surface};
use crate::load::{Carried, LoadShare};
use crate::mechanics::Motion;
use crate::pose::{Pose, Twist, Wrench};
use crate::wheel::{Grip, WheelParameters, WheelState};
use check::{check_body, check_floor, check_payload, check_slope, check_support, check_surface, check_wheel};
use mounted::{Mounted, prepare, row_of};

pub use check::BodyError;

/// Time constant with which the normal loads follow the acceleration: tread and frame are not rigid in pitch and roll.
/// An assumption (a natural frequency of some 30 Hz); much below it the loads are the static ones.
pub const LOAD_TRANSFER_S: f64 = 0.005;

/// The body without payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyParameters {
    /// Mass, wheels included.
    pub mass_kg: f64,
    /// Inertia about the vertical through the centre of mass, wheels included.
    pub yaw_inertia_kg_m2: f64,
    /// Centre of mass in `base_link`.
    pub center_of_mass_m: [f64; 2],
    /// Height of the centre of mass over the floor.
    pub center_of_mass_height_m: f64,
}

/// A load that stands on the body and moves with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    /// Mass.
    pub mass_kg: f64,
    /// Inertia about the vertical through its own centre of mass.
    pub yaw_inertia_kg_m2: f64,
    /// Its centre of mass in `base_link`.
    pub position_m: [f64; 2],
    /// Height of its centre of mass over the floor.
    pub height_m: f64,
}

/// Body and payload as one rigid body.
#[derive(Clone, Copy, Debug)]
struct Total {
    carried: Carried,
    yaw_inertia_kg_m2: f64,
}

/// The body on its wheels: torques in, motion out.
///
/// State and solution are the truth of the simulation. A step is semi-implicit Euler in the velocities (frictions at the
/// end of the step, see [`contact`]) with the mean velocity of the step along an exact arc for the pose: exact
/// for constant torques, first order in the step otherwise. Elastic treads follow the trapezoidal rule.
#[derive(Clone, Debug)]
pub struct Body {
    parameters: BodyParameters,
    payload: Payload,
    total: Total,
    positions: Vec<[f64; 2]>,
    mounted: Vec<Mounted>,
    share: LoadShare,
    /// Where another one is tried, without allocation.
    spare_share: LoadShare,
    rows: Vec<contact::Wheel>,
    wheels: Vec<WheelState>,
    /// Velocity of the centre of mass in the body's axes, and yaw rate.
    velocity: [f64; 3],
    acceleration: [f64; 2],
    pose: Pose,
    /// Sine and cosine of its heading.
    heading: (f64, f64),
    push: Wrench,
    /// The same, in the axes of the body.
    push_in_body: Wrench,
    floor: Floor,
    /// Friction of the whole floor in place of contacts' and patches'.
    everywhere: Option<Surface>,
    /// Acceleration of free fall along the floor, in the fixed frame, and the share of weight that presses on it.
    fall_m_s2: [f64; 2],
    upright: f64,
}

impl Body {
    /// A body at rest at the origin.
    pub fn new(parameters: BodyParameters, wheels: &[WheelParameters]) -> Result<Self, BodyError> {
        check_body(&parameters)?;
        for (i, wheel) in wheels.iter().enumerate() {
            check_wheel(i, wheel)?;
        }
        let payload = Payload::default();
        let total = Total::of(&parameters, &payload);
        let positions: Vec<[f64; 2]> = wheels.iter().map(|w| w.position_m).collect();
        let share =
            LoadShare::new(&positions, total.carried).ok_or(BodyError::NoSupport { wheels: wheels.len() })?;
        check_support(&share, &total)?;
        let rows: Vec<contact::Wheel> = wheels.iter().map(row_of).collect();
        let mut body = Self {
            parameters,
            payload,
            total,
            positions,
            mounted: wheels.iter().zip(&rows).map(|(wheel, row)| Mounted::of(wheel, row)).collect(),
            spare_share: share.clone(),
            share,
            rows,
            wheels: vec![WheelState::default(); wheels.len()],
            velocity: [0.0; 3],
            acceleration: [0.0; 2],
            pose: Pose::default(),
            heading: (0.0, 1.0),
            push: Wrench::default(),
            push_in_body: Wrench::default(),
            floor: Floor::default(),
            everywhere: None,
            fall_m_s2: [0.0; 2],
            upright: 1.0,
        };
        body.place_rows();
        for (i, wheel) in body.wheels.iter_mut().enumerate() {
            wheel.normal_load_n = body.share.static_n[i];
        }
        Ok(body)
    }

    /// Puts another payload in the place of the present one, gently: it already moves with the body.
    ///
    /// Refused, and nothing changed, where the machine would tip over.
    pub fn set_payload(&mut self, payload: Payload) -> Result<(), BodyError> {
        check_payload(&payload)?;
        let total = Total::of(&self.parameters, &payload);
        let share = &mut self.spare_share;
        if !share.update(&self.positions, total.carried) {
            return Err(BodyError::NoSupport { wheels: self.positions.len() });
        }
        check_support(share, &total)?;
        check_slope(share, &self.floor.slope)?;
        let twist = self.twist_in_body();
        self.payload = payload;
        self.total = total;
        std::mem::swap(&mut self.share, &mut self.spare_share);
        self.place_rows();
        self.set_twist(twist);
        Ok(())
    }

    /// Puts another floor under it. Refused, and nothing changed, where the machine would fall over.
    pub fn set_floor(&mut self, floor: Floor) -> Result<(), BodyError> {
        check_floor(&floor)?;
        check_slope(&self.share, &floor.slope)?;
        let (sin, cos) = floor.slope.angle_rad.sin_cos();
        let (y, x) = floor.slope.downhill_rad.sin_cos();
        self.fall_m_s2 = [GRAVITY_M_S2 * sin * x, GRAVITY_M_S2 * sin * y];
        self.upright = cos;
        self.floor = floor;
        self.settle();
        Ok(())
    }

    /// The floor under it.
    pub fn floor(&self) -> &Floor {
        &self.floor
    }

    /// Makes the whole floor alike, patches included, until the next call; `None` leaves it as it was built.
    pub fn set_surface(&mut self, surface: Option<Surface>) -> Result<(), BodyError> {
        if let Some(surface) = &surface {
            check_surface(&|| "floor".to_owned(), surface)?;
        }
        self.everywhere = surface;
        Ok(())
    }

    /// Pushes the body from outside until the next call; every value must be finite.
    pub fn set_push(&mut self, push: Wrench) {
        self.push = push;
    }

    /// As [`Body::set_push`], in the axes of the body: beside the other, and it turns with the body.
    pub fn set_push_in_body(&mut self, push: Wrench) {
        self.push_in_body = push;
    }

    /// Puts the body somewhere, without moving it there.
    pub fn set_pose(&mut self, pose: Pose) {
        self.pose = pose;
        self.heading = pose.heading_rad.sin_cos();
    }

    /// Gives the body a velocity at once; the wheels keep theirs.
    pub fn set_twist(&mut self, twist: Twist) {
        let [cx, cy] = self.total.carried.center_m;
        self.velocity = [twist.vx_m_s - twist.w_rad_s * cy, twist.vy_m_s + twist.w_rad_s * cx, twist.w_rad_s];
    }

    /// Gives a wheel a speed at once; an index without a wheel is ignored.
    pub fn set_wheel_speed(&mut self, index: usize, speed_rad_s: f64) {
        if let (Some(row), Some(wheel)) = (self.rows.get_mut(index), self.wheels.get_mut(index)) {
            row.speed = speed_rad_s;
            wheel.speed_rad_s = speed_rad_s;
        }
    }

    /// A brake holds a wheel by so much about its axle until the next call, N·m; 0 opens it. An index without a wheel is ignored.
    pub fn set_brake(&mut self, index: usize, torque_n_m: f64) {
        if let Some(mounted) = self.mounted.get_mut(index) {
            mounted.brake = torque_n_m;
        }
    }

    /// Where the body is.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Sine and cosine of its heading.
    pub(crate) fn heading(&self) -> (f64, f64) {
        self.heading
    }

    /// How it moves.
    pub fn twist_in_body(&self) -> Twist {
        let [vx, vy, w] = self.velocity;
        let [cx, cy] = self.total.carried.center_m;
        Twist { vx_m_s: vx + w * cy, vy_m_s: vy - w * cx, w_rad_s: w }
    }

    /// The wheels, in the order given.
    pub fn wheels(&self) -> &[WheelState] {
        &self.wheels
    }

    /// Force of the floor on wheel `index` along its force direction, and across it (90 deg counter-clockwise from there):
    /// roller friction. Zeros for an index without a wheel.
    pub fn forces_n(&self, index: usize) -> [f64; 2] {
        self.rows.get(index).map_or([0.0; 2], contact::Wheel::forces)
    }

    /// The payload that it carries.
    pub fn payload(&self) -> Payload {
        self.payload
    }

    /// Mass with payload.
    pub fn mass_kg(&self) -> f64 {
        self.total.carried.mass_kg
    }

    /// Inertia about the vertical through the common centre of mass, with payload.
    pub fn yaw_inertia_kg_m2(&self) -> f64 {
        self.total.yaw_inertia_kg_m2
    }

    /// Spin inertia of wheel `index`; zero for an index without a wheel.
    pub fn wheel_inertia_kg_m2(&self, index: usize) -> f64 {
        self.mounted.get(index).map_or(0.0, |m| m.inertia)
    }

    /// Lever of wheel `index` along its force direction: radius times the cosine of rolling and force direction. Zero
    /// for an index without a wheel.
    pub fn lever_m(&self, index: usize) -> f64 {
        self.rows.get(index).map_or(0.0, |row| row.arm_along)
    }

    /// Whether nothing moves at all, to the bit.
    pub fn at_rest(&self) -> bool {
        self.velocity == [0.0; 3] && self.wheels.iter().all(|w| w.speed_rad_s == 0.0)
    }

    /// Kinetic energy of body and wheels.
    pub fn kinetic_energy_j(&self) -> f64 {
        let [vx, vy, w] = self.velocity;
        let body = self.mass_kg() * (vx * vx + vy * vy) + self.yaw_inertia_kg_m2() * w * w;
        let wheels: f64 = self
            .mounted
            .iter()
            .zip(&self.wheels)
            .map(|(m, s)| m.inertia * s.speed_rad_s * s.speed_rad_s)
            .sum();
        0.5 * (body + wheels)
    }

    /// Energy in the springs of elastic treads.
    pub fn elastic_energy_j(&self) -> f64 {
        let wheels = self.mounted.iter().zip(&self.wheels);
        let energies = wheels.filter_map(|(mounted, wheel)| {
            let [along_m, across_m] = wheel.deflection_m;
            Some(0.5 * mounted.bristle?.stiffness_n_m * (along_m * along_m + across_m * across_m))
        });
        energies.sum()
    }

    /// Moves as something else says: pose, velocity, wheels and their slip along the force direction.
    pub(crate) fn follow(&mut self, motion: &Motion) {
        self.set_pose(motion.pose);
        self.set_twist(motion.twist_in_body);
        for ((row, wheel), [angle_rad, speed_rad_s]) in
            self.rows.iter_mut().zip(&mut self.wheels).zip(&motion.wheels)
        {
            (row.speed, wheel.angle_rad, wheel.speed_rad_s) = (*speed_rad_s, *angle_rad, *speed_rad_s);
            wheel.slip_m_s = row.slip_along(&self.velocity, *speed_rad_s);
            wheel.roller_m_s = row.slip_across(&self.velocity, *speed_rad_s);
        }
    }

    /// Lets the loads become those of rest.
    pub(crate) fn settle(&mut self) {
        self.acceleration = [0.0; 2];
    }

    /// Advances by `step_s` (50 to 250 us give good results) with one motor torque per wheel, in the wheels' order;
    /// a wheel without a torque turns freely.
    pub fn step(&mut self, torques_n_m: &[f64], step_s: f64) {
        let rate = 1.0 / step_s;
        let before = self.velocity;
        // In axes that turn with the body a free body's velocity turns back by the angle of the step.
        let (sin, cos) = sin_cos(before[2] * step_s);
        let start = [before[0] * cos + before[1] * sin, before[1] * cos - before[0] * sin, before[2]];
        let (heading_sin, heading_cos) = self.heading;
        let mass = self.mass(start, heading_sin, heading_cos, rate);
        let [fall_x, fall_y] = self.fall_m_s2;
        // On a slope a body that stands is held against free fall, which shifts loads as acceleration does.
        let fall = [fall_x * heading_cos + fall_y * heading_sin, fall_y * heading_cos - fall_x * heading_sin];
        let held = [self.acceleration[0] - fall[0], self.acceleration[1] - fall[1]];
        // A floor in the place of the contacts' own, where a wheel stands.
        let (everywhere, patches) = (self.everywhere.as_ref(), self.floor.patches.as_slice());
        let is_plain = everywhere.is_none() && patches.is_empty();
        let pose = self.pose;
        let surface_at = |[x, y]: [f64; 2]| {
            everywhere.or_else(|| {
                let x_m = pose.x_m + heading_cos * x - heading_sin * y;
                let y_m = pose.y_m + heading_sin * x + heading_cos * y;
                let under = patches.iter().find(|patch| patch.place.holds([x_m, y_m]));
                under.map(|patch| &patch.surface)
            })
        };
        let loads_n = self.share.loads_n(held, self.upright);
        let torques_n_m = torques_n_m.iter().copied().chain(std::iter::repeat(0.0));
        let rows = self.rows.iter_mut().zip(&mut self.mounted).zip(&mut self.wheels);
        for (((row, mounted), wheel), (load, torque_n_m)) in rows.zip(loads_n.zip(torques_n_m)) {
            let surface = if is_plain { None } else { surface_at(mounted.position_m) };
            let holds = surface.map_or(mounted.holds, |surface| surface.holds(mounted.roller));
            wheel.normal_load_n = load;
            let travel = prepare(row, mounted, &holds, load, &before);
            row.stiffness = mounted.inertia * rate + mounted.viscous;
            row.drive = mounted.inertia * rate * row.speed + torque_n_m;
            if let Some(bristle) = &mounted.bristle {
                let creep_m_s_n = if load > 0.0 { mounted.creep * travel / load } else { 0.0 };
                let slips_m_s = [row.slip_along(&start, row.speed), row.slip_across(&start, row.speed)];
                for (axis, bent) in mounted.bent.iter_mut().enumerate() {
                    bent.deflection_m = wheel.deflection_m[axis];
                    bent.slip_m_s = slips_m_s[axis];
                }
                mounted.bent[0].creep_m_s_n = creep_m_s_n;
                bristle.set(&mut row.grip, &mounted.bent[0], step_s);
                bristle.set(&mut row.roller, &mounted.bent[1], step_s);
            }
        }
        self.velocity = contact::solve(&mass, &mut self.rows, start);
        let follow = step_s / (LOAD_TRANSFER_S + step_s);
        for (filtered, (after, start)) in self.acceleration.iter_mut().zip(self.velocity.iter().zip(&start)) {
            *filtered += follow * ((after - start) * rate - *filtered);
        }
        self.move_wheels(step_s);
        self.move_body(before, heading_sin, heading_cos, step_s);
    }

    fn mass(&self, start: [f64; 3], sin: f64, cos: f64, rate: f64) -> Mass {
        let m = self.total.carried.mass_kg * rate;
        let j = self.total.yaw_inertia_kg_m2 * rate;
        let weight = self.total.carried.mass_kg;
        let push = Wrench {
            fx_n: self.push.fx_n + weight * self.fall_m_s2[0],
            fy_n: self.push.fy_n + weight * self.fall_m_s2[1],
            ..self.push
        };
        let beside = self.push_in_body;
        Mass {
            stiffness: [m, m, j],
            drive: [
                m * start[0] + push.fx_n * cos + push.fy_n * sin + beside.fx_n,
                m * start[1] + push.fy_n * cos - push.fx_n * sin + beside.fy_n,
                j * start[2] + push.moment_n_m + beside.moment_n_m,
            ],
        }
    }

    fn move_wheels(&mut self, step_s: f64) {
        let rests = self.velocity == [0.0; 3] && self.rows.iter().all(|row| row.speed == 0.0);
        for ((row, wheel), mounted) in self.rows.iter().zip(&mut self.wheels).zip(&self.mounted) {
            wheel.angle_rad += 0.5 * (wheel.speed_rad_s + row.speed) * step_s;
            wheel.speed_rad_s = row.speed;
            wheel.slip_m_s = row.trial.along;
            wheel.roller_m_s = row.trial.across;
            if let Some(bristle) = mounted.bristle.filter(|_| !rests) {
                let contacts = [(&row.grip, row.trial.along), (&row.roller, row.trial.across)];
                for (axis, (friction, end_m_s)) in contacts.into_iter().enumerate() {
                    wheel.deflection_m[axis] =
                        bristle.deflection_after_m(friction, &mounted.bent[axis], end_m_s, step_s);
                }
            }
            wheel.grip = if row.grip.regime == Regime::Stick { Grip::Sticking } else { Grip::Sliding };
        }
    }

    /// Moves the pose along the arc of the step's mean twist.
    fn move_body(&mut self, before: [f64; 3], sin: f64, cos: f64, step_s: f64) {
        let mean = [0, 1, 2].map(|i| 0.5 * (before[i] + self.velocity[i]));
        let [cx, cy] = self.total.carried.center_m;
        let (dx, dy, turn) =
            ((mean[0] + mean[2] * cy) * step_s, (mean[1] - mean[2] * cx) * step_s, mean[2] * step_s);
        // The chord of the arc, in the axes at its start: sin(a)/a and (1 − cos(a))/a as series; a step turns little.
        let square = turn * turn;
        let ahead = 1.0 - square / 6.0 * (1.0 - square / 20.0);
        let aside = 0.5 * turn * (1.0 - square / 12.0 * (1.0 - square / 30.0));
        let (x, y) = (ahead * dx - aside * dy, aside * dx + ahead * dy);
        self.pose.x_m += cos * x - sin * y;
        self.pose.y_m += sin * x + cos * y;
        self.pose.heading_rad += turn;
        self.heading = self.pose.heading_rad.sin_cos();
    }

    /// Levers of the contacts about the present centre of mass.
    fn place_rows(&mut self) {
        let [cx, cy] = self.total.carried.center_m;
        for (row, position) in self.rows.iter_mut().zip(&self.positions) {
            let (x, y) = (position[0] - cx, position[1] - cy);
            row.along[2] = x * row.along[1] - y * row.along[0];
            row.across[2] = x * row.across[1] - y * row.across[0];
        }
    }
}

/// Sine and cosine of the small angle of one step: series that are exact to rounding below 0.03 rad.
fn sin_cos(angle: f64) -> (f64, f64) {
    if angle.abs() > 0.03 {
        return angle.sin_cos();
    }
    let square = angle * angle;
    (
        angle * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))),
        1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0))),
    )
}

impl Total {
    fn of(body: &BodyParameters, payload: &Payload) -> Self {
        let (a, b) = (body.mass_kg, payload.mass_kg);
        let mass_kg = a + b;
        let mix = |x: f64, y: f64| (a * x + b * y) / mass_kg;
        let (p, q) = (body.center_of_mass_m, payload.position_m);
        let apart = (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]);
        Self {
            carried: Carried {
                mass_kg,
                center_m: [mix(p[0], q[0]), mix(p[1], q[1])],
                height_m: mix(body.center_of_mass_height_m, payload.height_m),
            },
            yaw_inertia_kg_m2: body.yaw_inertia_kg_m2 + payload.yaw_inertia_kg_m2 + a * b / mass_kg * apart,
        }
    }
}

#[cfg(test)]
mod tests;
