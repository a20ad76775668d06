//! Wheels that slide: what the floor gives them no longer depends on what is asked of them.
//!
//! Where wheels grip, their forces follow the platform's acceleration by mass and inertia; a sliding wheel gets
//! μ·N (C.-A. de Coulomb). So an acceleration that setpoint and rims change by alike and a wheel's force
//! doesn't follow is a slide, whatever of the masses that the file allows is the platform's.
//!
//! Slopes don't change then, and a push would have to come with that change and be as large. A slide that began
//! with the first motion shows in nothing else: the platform looks light and well.

use omnibase_platform::{Kinematics, Wrench2};

use super::{FirstEstimates, GRAVITY_M_S2};
use crate::decay::Decay;
use crate::signals::MAX_WHEELS;

/// What changes is what a low-pass lets through, 1/s, and one that is slower, 1/s, holds back: slower than treads swing.
pub(super) const FAST_1_S: f64 = 40.0;
const SLOW_1_S: f64 = 7.0;
/// What slides grips again where its force changes by this part of itself.
const GRIPS: f64 = 0.5;
/// A force follows where it changes by this part of the least that it should.
const FOLLOWS: f64 = 0.25;
/// The least change of a force, and the least force, that say anything: over the least load of a wheel, as what rubs changes by a part of it.
const LEAST_SHARE: f64 = 0.1;
/// Slower than this a wheel may be held, m/s: dry friction has no direction there.
pub(super) const HELD_M_S: f64 = 0.03;
/// For how long a force must stay, s: a soft tread takes half of that until it pushes.
pub(super) const LASTING_S: f64 = 0.05;

/// A value behind both low-passes.
#[derive(Clone, Copy, Debug, Default)]
struct Band {
    fast: f64,
    slow: f64,
}

impl Band {
    /// What both have in common, each with its sign: a push shows in the rims alone, a drive at its limit in the setpoint alone.
    fn common(one: f64, other: f64) -> f64 {
        if one * other > 0.0 { one.abs().min(other.abs()).copysign(one) } else { 0.0 }
    }

    /// By how much it changed lately.
    fn take(&mut self, value: f64, [fast, slow]: [f64; 2]) -> f64 {
        self.fast = fast * self.fast + (1.0 - fast) * value;
        self.slow = slow * self.slow + (1.0 - slow) * self.fast;
        self.fast - self.slow
    }
}

/// A wheel's force that stays.
#[derive(Clone, Copy, Debug, Default)]
struct Stays {
    /// For how long, s; by how much its rim is faster than the floor since at least, m/s, and how far it slid by that, m.
    since_s: f64,
    speed_m_s: f64,
    way_m: f64,
    /// What it was when it was told, N.
    told_n: f64,
}

impl Stays {
    /// Whether a wheel that was said to slide slides on: what slides is given the same, whatever else changes.
    fn goes_on(&self, force_n: f64) -> bool {
        self.since_s >= LASTING_S && (force_n - self.told_n).abs() < GRIPS * self.told_n.abs()
    }

    /// The slide, once it has lasted.
    fn slide(&mut self, force_n: f64) -> Option<Slide> {
        (self.since_s >= LASTING_S).then(|| Slide {
            ahead_m_s: self.speed_m_s.copysign(force_n),
            step_m: std::mem::take(&mut self.way_m),
        })
    }
}

/// A wheel that slides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slide {
    /// By how much its rim is ahead of the floor at least, m/s, in the direction of its force.
    pub(super) ahead_m_s: f64,
    /// How far it slid at least since the last look, and before the first one, m.
    pub(super) step_m: f64,
}

/// The watch.
#[derive(Clone, Debug)]
pub(super) struct Sliding {
    /// The force at each rim that a wrench takes, the least ones, and what a twist is at it.
    shares: [[f64; 3]; MAX_WHEELS],
    rows: [[f64; 3]; MAX_WHEELS],
    /// The platform's mass and moment of inertia, the least and the most that the file allows.
    mass_kg: [f64; 2],
    inertia_kg_m2: [f64; 2],
    /// What a change says nothing below, N.
    least_n: f64,
    fast: Decay,
    slow: Decay,
    kept: [f64; 2],
    wished: [Band; 3],
    driven: [Band; 3],
    forces: [Band; MAX_WHEELS],
    stays: [Stays; MAX_WHEELS],
}

impl Sliding {
    pub(super) fn new(kinematics: &Kinematics, first: &FirstEstimates) -> Self {
        let (wheels, (mass, inertia)) = (kinematics.wheel_count(), (first.mass.1, first.inertia.1));
        let mut sliding = Sliding {
            shares: [[0.0; 3]; MAX_WHEELS],
            rows: [[0.0; 3]; MAX_WHEELS],
            mass_kg: mass,
            inertia_kg_m2: inertia,
            least_n: LEAST_SHARE * mass[0] * GRAVITY_M_S2 / wheels as f64,
            fast: Decay::new(FAST_1_S),
            slow: Decay::new(SLOW_1_S),
            kept: [1.0; 2],
            wished: Default::default(),
            driven: Default::default(),
            forces: Default::default(),
            stays: Default::default(),
        };
        for axis in 0..3 {
            let unit = |at: usize| if at == axis { 1.0 } else { 0.0 };
            let torques_nm = kinematics.wheel_torques_nm(Wrench2::new(unit(0), unit(1), unit(2)));
            let rims = kinematics.matrix().iter().zip(kinematics.wheels());
            for (at, (row, rim)) in rims.enumerate() {
                sliding.shares[at][axis] = torques_nm[at] / rim.radius_m;
                sliding.rows[at] = *row;
            }
        }
        sliding
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        (self.wished, self.driven) = Default::default();
        (self.forces, self.stays) = Default::default();
    }

    /// Takes in accelerations over the floor in body axes, the setpoint's and the rims': by what both changed lately.
    pub(super) fn change(&mut self, wished: [f64; 3], driven: [f64; 3], span_s: f64) -> [f64; 3] {
        let mut change = [0.0; 3];
        if !wished.iter().chain(&driven).sum::<f64>().is_finite() {
            self.forget();
            return change;
        }
        self.kept = [self.fast.kept(span_s), self.slow.kept(span_s)];
        let axes = self.wished.iter_mut().zip(&mut self.driven).zip(wished.into_iter().zip(driven));
        for (change, ((of_setpoint, of_rims), (wished, driven))) in change.iter_mut().zip(axes) {
            *change = Band::common(of_setpoint.take(wished, self.kept), of_rims.take(driven, self.kept));
        }
        change
    }

    /// The acceleration along the floor that setpoint and rims have in common, m/s².
    pub(super) fn acceleration(&self) -> [f64; 2] {
        std::array::from_fn(|axis| Band::common(self.wished[axis].fast, self.driven[axis].fast))
    }

    /// Whether a wheel slides, whose rim has such a speed, m/s, and whose motor pushes the floor so, N.
    pub(super) fn look(
        &mut self,
        wheel: usize,
        change: &[f64; 3],
        rim_m_s: f64,
        force_n: f64,
        span_s: f64,
    ) -> Option<Slide> {
        let change_n = self.forces[wheel].take(force_n, self.kept);
        let least_n = self.least_change_n(wheel, change);
        let fast_n = self.forces[wheel].fast;
        let turns = fast_n.abs() > self.least_n && rim_m_s.abs() > HELD_M_S;
        let stays = turns && least_n.abs() > self.least_n && change_n.abs() < FOLLOWS * least_n.abs();
        let told = &mut self.stays[wheel];
        if stays {
            let gain_m_s2: f64 = self.rows[wheel].iter().zip(change).map(|(row, change)| row * change).sum();
            if told.since_s == 0.0 {
                (told.speed_m_s, told.way_m) = (0.0, 0.0);
            }
            told.since_s += span_s;
            told.speed_m_s += span_s * gain_m_s2.abs();
            told.told_n = fast_n;
        } else if turns && told.goes_on(fast_n) {
            // As long again at most: nobody knows when the floor has made up for it.
            told.since_s -= span_s;
        } else {
            told.since_s = 0.0;
            return None;
        }
        told.way_m += span_s * told.speed_m_s;
        told.slide(force_n)
    }

    /// A limit of its drive's keeps a wheel's force: that it stays says nothing.
    pub(super) fn leave(&mut self, wheel: usize) {
        self.stays[wheel] = Stays::default();
    }

    /// A wheel's part of a wrench, N: that of least norm.
    pub(super) fn share_n(&self, wheel: usize, wrench: [f64; 3]) -> f64 {
        self.shares[wheel].iter().zip(wrench).map(|(share, part)| share * part).sum()
    }

    /// The least that a gripping wheel's force changes by, N, whatever of the masses that the file allows is the platform's.
    fn least_change_n(&self, wheel: usize, [x, y, turn]: &[f64; 3]) -> f64 {
        let [by_x, by_y, by_turn] = self.shares[wheel];
        let (along, about) = (by_x * x + by_y * y, by_turn * turn);
        let [[light, heavy], [slim, wide]] = [self.mass_kg, self.inertia_kg_m2];
        if along * about >= 0.0 {
            return light * along + slim * about;
        }
        // One works against the other.
        let along_n = light * along.abs() - wide * about.abs();
        let about_n = slim * about.abs() - heavy * along.abs();
        if along_n > 0.0 { along_n.copysign(along) } else { about_n.max(0.0).copysign(about) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_platform::layout;

    const PERIOD_S: f64 = 1e-3;
    const FIRST: FirstEstimates = FirstEstimates {
        mass: (90.0, [30.0, 270.0]),
        inertia: (9.0, [3.0, 27.0]),
        share: 0.5,
        friction_max_n: 100.0,
    };

    /// Accelerations of the setpoint and of the rims, and what the motors push with, as a platform of such a mass and inertia does.
    struct World<'a> {
        wished: &'a dyn Fn(f64) -> [f64; 3],
        driven: &'a dyn Fn(f64) -> [f64; 3],
        /// A wheel's force by the one that its grip takes, and took at first.
        pushes: &'a dyn Fn(f64, [f64; 2]) -> f64,
        body: [f64; 2],
    }

    /// When the first wheel was told, s, and how far both that push slid, m.
    fn told(world: &World<'_>) -> Option<(f64, f64)> {
        let kinematics = Kinematics::new(layout::omni(3, 0.4, 0.1, 0.0)).unwrap();
        let mut sliding = Sliding::new(&kinematics, &FIRST);
        let (mut first, mut way_m) = (None, 0.0);
        let [mass_kg, inertia_kg_m2] = world.body;
        for cycle in 0..2000 {
            let t = f64::from(cycle) * PERIOD_S;
            let driven = (world.driven)(t);
            let change = sliding.change((world.wished)(t), driven, PERIOD_S);
            for at in 0..3 {
                let [x, y, turn] = sliding.shares[at];
                let grips_n = [driven, (world.driven)(0.0)].map(|[along, across, gain]| {
                    mass_kg * (x * along + y * across) + inertia_kg_m2 * turn * gain
                });
                let force_n = (world.pushes)(t, grips_n);
                if let Some(slide) = sliding.look(at, &change, 0.5, force_n, PERIOD_S) {
                    first.get_or_insert(t);
                    way_m += slide.step_m;
                }
            }
        }
        first.map(|first| (first, way_m))
    }

    fn stepped(t: f64) -> [f64; 3] {
        if t < 1.0 { [1.8, 0.0, 0.0] } else { [0.0, 0.0, 0.0] }
    }

    #[test]
    fn a_force_that_stays_while_the_acceleration_ends_is_a_slide() {
        // The floor gives 60 N throughout.
        let slides = |_: f64, [_, first_n]: [f64; 2]| first_n.signum() * first_n.abs().min(60.0);
        let world = World { wished: &stepped, driven: &stepped, pushes: &slides, body: [90.0, 9.0] };
        let (first_s, way_m) = told(&world).expect("it slides");
        assert!((1.05..1.1).contains(&first_s), "{first_s}");
        // 1.6 m/s² · (0.16 s)²/2 = 20 mm each in the time in which that shows, less what the low-passes forget, and as long again at
        // the speed that was reached.
        assert!((0.04..0.1).contains(&way_m), "{way_m}");
    }

    #[test]
    fn wheels_that_grip_slide_with_no_mass_that_the_file_allows_and_on_no_tread() {
        let winding = |t: f64| [1.5 * (5.0 * t).sin(), 1.2 * (3.0 * t).cos(), 2.0 * (4.0 * t).sin()];
        for body in [[30.0, 3.0], [30.0, 27.0], [270.0, 3.0], [270.0, 27.0]] {
            for motion in [&stepped as &dyn Fn(f64) -> [f64; 3], &winding] {
                let world =
                    World { wished: motion, driven: motion, pushes: &|_, [grips_n, _]| grips_n, body };
                assert_eq!(told(&world), None, "{body:?}");
                // A soft tread follows 30 ms later.
                let late = |t: f64| motion(t - 0.03);
                let world = World { wished: motion, driven: &late, ..world };
                assert_eq!(told(&world), None, "late, {body:?}");
            }
        }
    }

    #[test]
    fn a_push_alone_is_no_slide_nor_is_a_slope_nor_a_wish_that_nothing_follows() {
        let still = |_: f64| [0.0; 3];
        let held = |_: f64, _: [f64; 2]| 60.0;
        let body = [90.0, 9.0];
        assert_eq!(told(&World { wished: &still, driven: &stepped, pushes: &held, body }), None);
        assert_eq!(told(&World { wished: &stepped, driven: &still, pushes: &held, body }), None);
        let slope = |_: f64, [grips_n, _]: [f64; 2]| grips_n + 25.0;
        assert_eq!(told(&World { wished: &stepped, driven: &stepped, pushes: &slope, body }), None);
    }

    #[test]
    fn what_is_no_number_is_forgotten() {
        let spoiled = |t: f64| if t == 0.5 { [f64::NAN, 0.0, 0.0] } else { stepped(t) };
        let pushes = |_: f64, [_, first_n]: [f64; 2]| first_n;
        let world = World { wished: &spoiled, driven: &stepped, pushes: &pushes, body: [90.0, 9.0] };
        assert!(told(&world).is_some());
    }

    #[test]
    fn what_a_limit_keeps_is_no_slide_then_nor_when_it_ends() {
        // An acceleration that begins at half a second, and a force that stays; a limit keeps it until 0.65 s.
        let told_after_limit = |is_left: bool| {
            let kinematics = Kinematics::new(layout::omni(3, 0.4, 0.1, 0.0)).unwrap();
            let mut sliding = Sliding::new(&kinematics, &FIRST);
            (0..1000).any(|cycle| {
                let t = f64::from(cycle) * PERIOD_S;
                let motion = [if t < 0.5 { 0.0 } else { 1.5 }, 0.0, 0.0];
                let change = sliding.change(motion, motion, PERIOD_S);
                let (at, is_at_limit) = (1, t < 0.65);
                let slide = sliding.look(at, &change, 0.5, 60.0, PERIOD_S);
                if is_left && is_at_limit {
                    sliding.leave(at);
                }
                !is_at_limit && slide.is_some()
            })
        };
        assert_eq!([true, false].map(told_after_limit), [false, true]);
    }
}
