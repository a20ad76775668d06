//! What the watches of a slide are told of each cycle, and what they say together.

use omnibase_platform::PerWheel;

use super::identification::{Motion, Watched};
use super::probe::{Along, Rim};
use super::steady::Shown;
use super::{Grip, SIGMAS, WIRES_SHOWN_M, Wheel, Wished};
use crate::signals::{Dynamics, MAX_WHEELS};

impl Grip {
    /// Which wheels' forces stay where they should follow the setpoint's acceleration, or are less than the least that it can weigh
    /// asks for.
    pub(super) fn slide(&mut self, wished: Option<Wished>, motion: &Motion, watched: &Watched, span_s: f64) {
        let Some(wished) = wished else {
            self.sliding.forget();
            self.steady.forget();
            self.alone.forget();
            self.probe.forget();
            self.wheels.iter_mut().for_each(|wheel| wheel.slide = None);
            return;
        };
        let count = self.kinematics.wheel_count();
        let mut pushes_n = [0.0; MAX_WHEELS];
        for (push_n, wheel) in pushes_n.iter_mut().zip(self.wheels.iter()) {
            *push_n = wheel.force_n - self.wheel_kg * wheel.gains_m_s2;
        }
        let change = self.sliding.change(wished.acceleration, motion.acceleration, span_s);
        for (at, wheel) in self.wheels.iter_mut().enumerate() {
            let slide = self.sliding.look(at, &change, wheel.rim_m_s, pushes_n[at], span_s);
            wheel.slide = slide.filter(|_| !wheel.is_held_back && wheel.drives(pushes_n[at]));
            if wheel.is_held_back {
                self.sliding.leave(at);
            }
        }
        let (shown, moment_nm) = self.pushed(motion, watched, &pushes_n[..count]);
        // By speed nothing swings by itself.
        if wished.by_torque || wished.asks_floor {
            self.ask(&wished, motion, watched, (&shown, moment_nm), &pushes_n);
        } else {
            self.alone.forget();
        }
        let told = self.steady.look(&shown, span_s);
        let is_told = told.is_some();
        let any_slides = self.wheels.iter().any(|wheel| wheel.slide.is_some());
        let missing = if any_slides { self.steady.if_it_slides() } else { None };
        let Some(slides) = told.or(missing) else { return };
        self.steady.count();
        let greatest_n = pushes_n.iter().fold(0.0, |most: f64, push_n| most.max(push_n.abs()));
        for ((wheel, row), push_n) in self.wheels.iter_mut().zip(self.kinematics.matrix()).zip(pushes_n) {
            match &mut wheel.slide {
                // Both tell the same way, and the wheel's own watch knows only what came after its force stayed.
                Some(slide) => slide.step_m = slide.step_m.max(slides.step_m(row)),
                None if is_told => wheel.slide = slides.of_wheel(row, push_n, greatest_n),
                None => {}
            }
        }
    }

    /// Which wheels turn alone: by what a law of torque swings by itself, or one of speed on purpose.
    fn ask(
        &mut self,
        wished: &Wished,
        motion: &Motion,
        watched: &Watched,
        (shown, moment_nm): (&Shown, f64),
        pushes_n: &[f64; MAX_WHEELS],
    ) {
        let (more_m_s2, span_s) = (self.unexplained(motion, shown), motion.period_s);
        let gains = if wished.by_torque { self.given(motion, watched, shown, moment_nm) } else { [0.0; 3] };
        let wheels = self.wheels.iter().zip(self.kinematics.matrix()).zip(pushes_n);
        for (at, ((wheel, row), push_n)) in wheels.enumerate() {
            let along_m_s2: f64 = row.iter().zip(gains).map(|(row, gain)| row * gain).sum();
            let carried_n = push_n + self.wheel_kg * along_m_s2;
            self.alone.take(at, [wheel.force_n, *push_n, carried_n], span_s);
        }
        if wished.by_torque {
            self.alone.see();
        } else {
            self.hear(wished, motion, shown.learnt_kg);
        }
        self.alone.look(more_m_s2, motion.turn_rad_s, span_s);
        for (at, (wheel, row)) in self.wheels.iter_mut().zip(self.kinematics.matrix()).enumerate() {
            let slide = self.alone.slide(at, row, wheel.force_n, span_s);
            // By torque a motor's own swing tells it, and the floor may push a wheel that turns alone either way.
            let is_driven = wished.by_torque || wheel.drives(pushes_n[at]);
            wheel.slide = wheel.slide.or(slide.filter(|_| is_driven));
        }
    }

    /// What a law of speed swings on purpose, and what each wheel's motor moves by it, of a platform that weighs so much at least, kg.
    fn hear(&mut self, wished: &Wished, motion: &Motion, least_kg: f64) {
        let count = self.kinematics.wheel_count();
        let are_wires_shown = count <= 3 || self.agreed_m >= WIRES_SHOWN_M;
        let is_gentle = self.extent.is_gentle(wished.acceleration);
        if is_gentle && !are_wires_shown {
            return;
        }
        let part = self.extent.part(wished.acceleration);
        let asked = wished.acceleration.map(|axis| part * axis);
        let needed = self.needed(asked, least_kg);
        let mut rims = [Rim::default(); MAX_WHEELS];
        let wheels = self.wheels.iter().zip(self.kinematics.matrix());
        for (at, (rim, (wheel, row))) in rims.iter_mut().zip(wheels).enumerate() {
            let asked_m_s2 = row.iter().zip(asked).map(|(row, axis)| row * axis).sum();
            let Wheel { rim_m_s, gains_m_s2, force_n: motor_n, is_held_back, .. } = *wheel;
            let needed_n = self.sliding.share_n(at, needed);
            // At its drive's limit it follows nothing: it tells as little as one that stands.
            let rim_m_s = if is_held_back { 0.0 } else { rim_m_s };
            *rim = Rim { asked_m_s2, gains_m_s2, rim_m_s, motor_n, needed_n };
        }
        let along = self.along(&wished.acceleration, motion);
        let rims = &rims[..count];
        let moved = self.probe.look(&wished.time, rims, &along);
        self.alone.hear(&moved, self.wheel_kg, is_gentle);
    }

    /// The wrench that an acceleration takes by what was learnt, of a platform that weighs so much at least, kg.
    fn needed(&self, asked: [f64; 3], least_kg: f64) -> [f64; 3] {
        let dynamics = self.identification.dynamics();
        let sure = (least_kg / dynamics.mass_kg).clamp(0.0, 1.0);
        dynamics.wrench(asked, 0.0).map(|part| sure * part)
    }

    /// What pushes the platform along an acceleration that it is asked for, and what its rims' acceleration needs by what was learnt.
    fn along(&self, asked: &[f64; 3], motion: &Motion) -> Along {
        let Dynamics { mass_kg, inertia_kg_m2, .. } = self.identification.dynamics();
        let size = asked.iter().map(|axis| axis * axis).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let [x, y, turn] = motion.acceleration;
        let needed = [mass_kg * x, mass_kg * y, inertia_kg_m2 * turn];
        let along = |wrench: [f64; 3]| asked.iter().zip(wrench).map(|(axis, part)| axis / size * part).sum();
        Along { pushed_n: along(motion.wrench), needed_n: along(needed) }
    }

    /// By how much more the rims gain along the floor than what the wheels push gives the platform, m/s²: of one that weighs what its file
    /// tells, for what slid since its first motion looks light.
    fn unexplained(&self, motion: &Motion, shown: &Shown) -> [f64; 2] {
        let mass_kg = self.identification.dynamics().mass_kg.max(self.told_kg);
        let given_n = |axis: usize| shown.push_n[axis] + shown.slope_n[axis] - shown.friction_n[axis];
        std::array::from_fn(|axis| motion.acceleration[axis] - given_n(axis) / mass_kg)
    }

    /// What the platform's twist gains in body axes by what the wheels push, of one that weighs what its file tells at least.
    fn given(&self, motion: &Motion, watched: &Watched, shown: &Shown, moment_nm: f64) -> [f64; 3] {
        let mut dynamics = watched.dynamics;
        dynamics.mass_kg = dynamics.mass_kg.max(self.told_kg);
        let [x_n, y_n] = [0, 1].map(|axis| shown.push_n[axis] + shown.slope_n[axis] - shown.friction_n[axis]);
        let [along, across, gain] = dynamics.acceleration([x_n, y_n, moment_nm], motion.turn_rad_s);
        let [vx, vy, turn] = self.shown;
        [along + turn * vy, across - turn * vx, gain]
    }

    /// What the wheels push the platform with, beside how it moves by them; and the moment that turns it, N·m.
    fn pushed(&self, motion: &Motion, watched: &Watched, pushes_n: &[f64]) -> (Shown, f64) {
        let rims = self.kinematics.wheels();
        let torques_nm = PerWheel::from_fn(pushes_n.len(), |at| pushes_n[at] * rims[at].radius_m);
        let wrench = self.kinematics.wrench(&torques_nm);
        let Watched { dynamics, mass_sigma_kg, slope_n } = *watched;
        let Dynamics { mass_kg, friction_n: [spin_n, roller_n], .. } = dynamics;
        let [by_spin, by_roller] = motion.friction_per_newton;
        let [along_n, across_n, about_nm] =
            std::array::from_fn(|axis| spin_n * by_spin[axis] + roller_n * by_roller[axis]);
        let shown = Shown {
            acceleration: self.sliding.acceleration(),
            push_n: [wrench.fx_n, wrench.fy_n],
            slope_n,
            friction_n: [along_n, across_n],
            speed_m_s: omnibase_platform::length([self.shown[0], self.shown[1]]),
            turn_rad_s: motion.turn_rad_s,
            learnt_kg: mass_kg - SIGMAS * mass_sigma_kg,
        };
        (shown, wrench.torque_nm - about_nm)
    }
}
