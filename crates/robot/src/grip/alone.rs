//! Wheels that turn alone: their rims answer their motors as a wheel does that carries no platform.
//!
//! A motor's force that swings moves a gripping rim as little as the platform is heavy, and what it changes by
//! reaches the floor; a sliding wheel gets μ·N (C.-A. de Coulomb), so all of the swing turns the wheel. Between
//! the two lies the platform's mass over the wheels': no mass, friction or slope need be known.
//!
//! A law of torque swings by itself where it answers to wheels that slide, and where a motion begins; a drive
//! that holds a speed gives whatever that takes, and tells nothing so.

use omnibase_platform::PerWheel;

use super::probe::Moved;
use super::sliding::Slide;
use crate::decay::Decay;
use crate::signals::MAX_WHEELS;

/// What swings is what passes a low-pass, a slower one taken off, 1/s: faster than motions change, slower than the softest tread lets a
/// gripping wheel turn alone (the root of 3·1e5 N/m over 2 kg).
const FAST_1_S: f64 = 150.0;
const SLOW_1_S: f64 = 60.0;
/// How fast the mean of squares follows, 1/s: no slower than what a step leaves behind is forgotten.
const AVERAGED_1_S: f64 = 120.0;
/// A wheel turns alone where less than this part of a swing reaches the floor: nearly all does where it grips, next to nothing where not.
const REACHES: f64 = 0.6;
/// Only of a swing that is at least this part of the greatest of all wheels': all of them together accelerate a gripping rim so little that
/// what that takes of a greater one is far less than the rest.
const PART: f64 = 0.3;
/// A swing of fewer steps of the torque that drives tell is small: where none was told to turn alone for so long, s, a wheel doesn't whose
/// rim the platform carries along, by what its other wheels' pushes and friction that turns give it.
const STEPS: f64 = 4.0;
const ANEW_S: f64 = 2.0;
/// What gets less than this part of what it got a moment before grips, or is let go.
const STILL_GIVEN: f64 = 0.5;
/// Slower than this no slide is taken to be, m/s: how heavy the platform is may not be known.
const LEAST_M_S: f64 = 0.02;
/// For how long, s, where it swings by itself: a wheel that rings on a soft tread after a jerk looks so for 8 ms, single ones of seeded
/// robots that grip for 17; and where it was asked.
const SEEN_S: f64 = 0.018;
const HEARD_S: f64 = 0.015;
/// So many looks in a row say it of a wheel that was asked: a platform that swings on soft treads, or friction, may hide
/// its push from two, and one that rings on them all but hides it from more.
const LOOKS: u32 = 3;
const LOOKS_GIVEN: u32 = 8;
/// A wheel of four whose tread pushes back by more than this part of what its motor moves, of a gentle motion, carries a platform above the
/// tread's resonance.
const BACK: f64 = 0.5;
/// One that no other wheel stands in for slides where its motor moves less than this part of what it moved if it gripped: what slides is
/// given a little more where it slides faster. A tread of k N/m and so little damping that it looks as light, k/(m·ω² − k) of m, pushes
/// back as its rim goes on, by more than this part: the softest by 0.044 under 270 kg, less what the wheel's own mass takes.
const GIVEN: f64 = 0.25;
const AGAINST: f64 = 0.02;
/// A swing that tells something, over the least load of a wheel.
const LEAST_SHARE: f64 = 1.5e-3;
/// What forces leave unexplained of a rim's gain is forgotten by this rate while it grips, 1/s: the watch takes that long to tell.
const FORGOTTEN_1_S: f64 = 10.0;

/// What swings, and the mean of its square.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    fast: f64,
    slow: f64,
    square: f64,
}

impl Swings {
    fn take(&mut self, value: f64, [fast, slow, averaged]: [f64; 3]) {
        self.fast = fast * self.fast + (1.0 - fast) * value;
        self.slow = slow * self.slow + (1.0 - slow) * self.fast;
        let swing = self.fast - self.slow;
        self.square = averaged * self.square + (1.0 - averaged) * swing * swing;
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    motor: Swings,
    floor: Swings,
    carried: Swings,
    /// Whether it turns alone, for how long, s, and whether it was told to the cycle before.
    is_alone: bool,
    since_s: f64,
    was_told: bool,
    /// How many looks in a row said so, and that it is given little.
    looks: u32,
    looks_given: u32,
}

/// The watch.
#[derive(Clone, Debug)]
pub(super) struct Alone {
    fast: Decay,
    slow: Decay,
    averaged: Decay,
    forgotten: Decay,
    /// The squares of a swing that says nothing, and of a small one, N²; and for how long none was told, s.
    least: f64,
    small: f64,
    untold_s: f64,
    wheels: PerWheel<Wheel>,
    /// For how long a wheel must turn alone to be told, s.
    lasting_s: f64,
    /// By how much the rims gained more than forces explain, in body axes, m/s.
    ahead_m_s: [f64; 2],
}

impl Alone {
    /// Of so many wheels that each bear so much at least, and whose drives tell their torques in such steps, N.
    pub(super) fn new(wheels: usize, load_n: f64, step_n: f64) -> Self {
        Alone {
            fast: Decay::new(FAST_1_S),
            slow: Decay::new(SLOW_1_S),
            averaged: Decay::new(AVERAGED_1_S),
            forgotten: Decay::new(FORGOTTEN_1_S),
            least: (LEAST_SHARE * load_n).powi(2),
            small: (STEPS * step_n).powi(2),
            untold_s: f64::INFINITY,
            wheels: PerWheel::from_fn(wheels, |_| Wheel::default()),
            lasting_s: HEARD_S,
            ahead_m_s: [0.0; 2],
        }
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        self.wheels.fill(Wheel::default());
        self.ahead_m_s = [0.0; 2];
    }

    /// Takes in what a wheel's motor pushes its rim with, the rim the floor, and what it would if the platform carried it along, N.
    pub(super) fn take(&mut self, wheel: usize, [motor_n, floor_n, carried_n]: [f64; 3], span_s: f64) {
        let kept = [self.fast.kept(span_s), self.slow.kept(span_s), self.averaged.kept(span_s)];
        let Wheel { motor, floor, carried, .. } = &mut self.wheels[wheel];
        motor.take(motor_n, kept);
        floor.take(floor_n, kept);
        carried.take(carried_n, kept);
    }

    /// Sees which wheels turn alone by what swings by itself.
    pub(super) fn see(&mut self) {
        self.lasting_s = SEEN_S;
        let greatest = self.wheels.iter().fold(0.0, |most: f64, wheel| most.max(wheel.motor.square));
        let least = self.least.max(PART * PART * greatest);
        let small = if self.untold_s > ANEW_S { self.small } else { 0.0 };
        for wheel in self.wheels.iter_mut() {
            let Wheel { motor, floor, carried, .. } = *wheel;
            let reaches = if motor.square < small { floor.square.max(carried.square) } else { floor.square };
            wheel.is_alone = motor.square > least && reaches < REACHES * REACHES * motor.square;
        }
    }

    /// Hears which do of those that were asked, by a gentle motion or a harder one: by what each motor moves, of wheels of such a mass at
    /// their rims, kg.
    pub(super) fn hear(&mut self, moved: &[Option<Moved>; MAX_WHEELS], wheel_kg: f64, is_gentle: bool) {
        self.lasting_s = HEARD_S;
        let are_spare = self.wheels.len() > 3;
        for (wheel, moved) in self.wheels.iter_mut().zip(moved) {
            if let Some(Moved { kg, along_kg, needed_kg, is_pushed }) = *moved {
                let pushes_back = are_spare && is_gentle && along_kg < -BACK * kg;
                let turns_alone = !is_pushed && (1.0 - REACHES) * kg < wheel_kg && !pushes_back;
                let others_push = are_spare && is_pushed;
                let is_given_little =
                    !others_push && kg < GIVEN * needed_kg && along_kg > -AGAINST * needed_kg;
                let in_a_row = |looks: u32, says_so: bool| if says_so { looks.saturating_add(1) } else { 0 };
                wheel.looks = in_a_row(wheel.looks, turns_alone);
                wheel.looks_given = in_a_row(wheel.looks_given, is_given_little);
                wheel.is_alone = wheel.looks >= LOOKS || wheel.looks_given >= LOOKS_GIVEN;
            }
        }
    }

    /// Which wheels turn alone for long enough, and how far their rims are ahead: they gain so much more than forces give the platform, in
    /// body axes that turn so fast, m/s² and rad/s.
    pub(super) fn look(&mut self, more_m_s2: [f64; 2], turn_rad_s: f64, span_s: f64) {
        for wheel in self.wheels.iter_mut() {
            let Wheel { floor, since_s, is_alone, .. } = *wheel;
            let is_given = floor.fast * floor.slow > STILL_GIVEN * floor.slow * floor.slow;
            wheel.was_told = since_s >= self.lasting_s;
            wheel.is_alone = is_alone && is_given;
            wheel.since_s = if wheel.is_alone { since_s + span_s } else { 0.0 };
        }
        let any_slides = self.wheels.iter().any(|wheel| wheel.since_s >= self.lasting_s);
        self.untold_s = if any_slides { 0.0 } else { self.untold_s + span_s };
        let keep = if any_slides { 1.0 } else { self.forgotten.kept(span_s) };
        let [x, y] = self.ahead_m_s;
        let turned = span_s * turn_rad_s;
        let carried = [x + turned * y, y - turned * x];
        self.ahead_m_s = std::array::from_fn(|axis| keep * carried[axis] + span_s * more_m_s2[axis]);
        if !self.ahead_m_s.iter().sum::<f64>().is_finite() {
            self.forget();
        }
    }

    /// The slide of a wheel that turns alone, whose rim goes by a twist as its row says.
    pub(super) fn slide(&self, wheel: usize, row: &[f64; 3], motor_n: f64, span_s: f64) -> Option<Slide> {
        let Wheel { since_s, was_told, .. } = self.wheels[wheel];
        let [x, y] = self.ahead_m_s;
        let ahead_m_s = (motor_n.signum() * (row[0] * x + row[1] * y)).max(LEAST_M_S);
        // Until it was told it came to that speed from none.
        let lasted_s = if was_told { span_s } else { 0.5 / FORGOTTEN_1_S };
        let slide = Slide { ahead_m_s: ahead_m_s.copysign(motor_n), step_m: lasted_s * ahead_m_s };
        (since_s >= self.lasting_s).then_some(slide)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;
    const WHEEL_KG: f64 = 2.0;
    /// A rim that goes along with x, and one with y.
    const ROWS: [[f64; 3]; 2] = [[1.0, 0.0, 0.3], [0.0, 1.0, 0.3]];

    /// When the first wheel was told, s, and how far it slid, m: a motor that pushes with 40 N and swings by some at 12 Hz, on a platform of
    /// such a mass that slides from half a second on, if at all, with the rims unexplainedly ahead by 0.4 m/s² more each second.
    fn told(swings_n: f64, kg: f64, slides: bool) -> Option<(f64, f64)> {
        let mut alone = Alone::new(2, 200.0, 0.0);
        let (mut first, mut way_m) = (None, 0.0);
        for cycle in 0..1000 {
            let t = f64::from(cycle) * PERIOD_S;
            let swing_n = swings_n * (75.0 * t).sin();
            let is_sliding = slides && t > 0.5;
            let given_n = if is_sliding { 40.0 } else { 40.0 + swing_n * (1.0 - WHEEL_KG / (kg + WHEEL_KG)) };
            alone.take(0, [40.0 + swing_n, given_n, 0.0], PERIOD_S);
            alone.take(1, [0.0; 3], PERIOD_S);
            alone.see();
            alone.look(if is_sliding { [0.4, 0.0] } else { [0.0; 2] }, 0.0, PERIOD_S);
            assert!(alone.slide(1, &ROWS[1], 0.0, PERIOD_S).is_none(), "{t}");
            if let Some(slide) = alone.slide(0, &ROWS[0], 40.0, PERIOD_S) {
                first.get_or_insert(t);
                way_m += slide.step_m;
            }
        }
        first.map(|first| (first, way_m))
    }

    #[test]
    fn a_wheel_of_whose_swings_nothing_reaches_the_floor_slides_whatever_the_platform_weighs() {
        for kg in [10.0, 30.0, 300.0] {
            assert_eq!(told(3.0, kg, false), None, "{kg} kg");
            let (first_s, way_m) = told(3.0, kg, true).expect("it slides");
            assert!((0.515..0.56).contains(&first_s), "{kg} kg: {first_s}");
            // 0.4 m/s² for half a second are 50 mm.
            assert!((0.03..0.055).contains(&way_m), "{kg} kg: {way_m}");
        }
    }

    #[test]
    fn what_does_not_swing_tells_nothing() {
        assert_eq!(told(0.0, 30.0, true), None);
        assert_eq!(told(0.1, 30.0, true), None);
    }

    #[test]
    fn a_small_swing_of_a_rim_that_the_platform_carries_along_tells_nothing_until_one_was_told() {
        // Steps of 0.5 N. When it was told after a second in which it may swing otherwise, s.
        let is_told = |swings_n: f64, carried: f64, before_n: f64| {
            let mut alone = Alone::new(2, 200.0, 0.5);
            (0..2000).any(|cycle| {
                let size_n = if cycle < 1000 { before_n } else { swings_n };
                let swing_n = size_n * (0.075 * f64::from(cycle)).sin();
                let carried = if cycle < 1000 { 0.0 } else { carried };
                alone.take(0, [40.0 + swing_n, 40.0 + 0.4 * swing_n, 40.0 + carried * swing_n], PERIOD_S);
                alone.see();
                alone.look([0.0; 2], 0.0, PERIOD_S);
                cycle > 1200 && alone.slide(0, &ROWS[0], 40.0, PERIOD_S).is_some()
            })
        };
        // Behind the low-passes it is 0.3 to 0.63 of that.
        assert!(!is_told(3.0, 1.0, 0.0) && is_told(3.0, 0.4, 0.0) && is_told(12.0, 1.0, 0.0));
        assert!(is_told(3.0, 1.0, 12.0));
    }

    #[test]
    fn a_wheel_that_hardly_pushes_while_others_do_is_not_judged_nor_one_that_is_let_go() {
        // Its own inertia takes all of its small part: the others accelerate it.
        let is_told = |part: f64, given_n: &dyn Fn(f64) -> f64| {
            let mut alone = Alone::new(2, 200.0, 0.0);
            for cycle in 0..1000 {
                let swing_n = 10.0 * (0.075 * f64::from(cycle)).sin();
                alone.take(0, [40.0 + swing_n, 40.0 + 0.95 * swing_n, 0.0], PERIOD_S);
                alone.take(1, [40.0 + part * swing_n, given_n(f64::from(cycle) * PERIOD_S), 0.0], PERIOD_S);
                alone.see();
                alone.look([0.0; 2], 0.0, PERIOD_S);
            }
            alone.slide(1, &ROWS[1], 40.0, PERIOD_S).is_some()
        };
        assert!(!is_told(0.2, &|_| 40.0) && is_told(0.5, &|_| 40.0));
        // The floor gave something, and by now nothing.
        assert!(!is_told(0.5, &|t| if t < 0.9 { 40.0 } else { 0.0 }));
    }

    /// After how many looks, each 14 ms after the other, one of three wheels is told to turn alone, if at all.
    fn looks(moved: impl Fn(u32) -> Moved) -> Option<u32> {
        looks_of(3, false, moved)
    }

    /// The same, of so many wheels, by a gentle motion or a harder one.
    fn looks_of(wheels: usize, is_gentle: bool, moved: impl Fn(u32) -> Moved) -> Option<u32> {
        let mut alone = Alone::new(wheels, 200.0, 0.0);
        let mut heard = [None; MAX_WHEELS];
        (0..20).find(|look| {
            heard[0] = Some(moved(*look));
            alone.take(0, [40.0; 3], 14.0 * PERIOD_S);
            alone.hear(&heard, WHEEL_KG, is_gentle);
            alone.wheels[0].is_alone
        })
    }

    #[test]
    fn who_moves_nothing_is_told_soon_and_who_moves_little_later() {
        let moved = |kg: f64, along_kg: f64| Moved { kg, along_kg, needed_kg: 60.0, is_pushed: false };
        assert_eq!(looks(|_| moved(3.0, 1.0)), Some(2));
        assert_eq!(looks(|_| moved(10.0, 2.0)), Some(7));
        // One look in between says that it grips.
        assert_eq!(looks(|look| moved(if look % 7 == 6 { 50.0 } else { 10.0 }, 2.0)), None);
        assert_eq!(looks(|_| moved(20.0, 2.0)), None);
        // A soft tread pushes back: the softest under 270 kg so little.
        assert_eq!(looks(|_| moved(10.0, -9.0)), None);
        assert_eq!(looks(|_| moved(6.0, -2.0)), None);
        // The others push the platform: of four one may do another's part, of three none can.
        let pushed = |needed_kg: f64| move |_: u32| Moved { needed_kg, is_pushed: true, ..moved(3.0, 1.0) };
        assert_eq!(looks(pushed(0.0)), None);
        assert_eq!(looks(pushed(60.0)), Some(7));
    }

    #[test]
    fn one_of_four_slides_where_the_others_do_not_push_for_it_nor_its_tread_back() {
        let moved =
            |kg: f64, along_kg: f64, is_pushed: bool| Moved { kg, along_kg, needed_kg: 40.0, is_pushed };
        for is_gentle in [false, true] {
            assert_eq!(looks_of(4, is_gentle, |_| moved(6.0, 2.0, false)), Some(7));
            assert_eq!(looks_of(4, is_gentle, |_| moved(6.0, 2.0, true)), None);
            assert_eq!(looks_of(4, is_gentle, |_| moved(4.0, 1.0, false)), Some(2));
        }
        assert_eq!(
            [true, false].map(|is_gentle| looks_of(4, is_gentle, |_| moved(4.0, -3.0, false))),
            [None, Some(2)]
        );
    }

    #[test]
    fn what_is_no_number_is_forgotten() {
        let mut alone = Alone::new(2, 200.0, 0.0);
        alone.take(0, [f64::NAN, 1.0, 1.0], PERIOD_S);
        alone.look([f64::NAN, 0.0], 0.0, PERIOD_S);
        for cycle in 0..200 {
            alone.take(0, [40.0 + 3.0 * (0.075 * f64::from(cycle)).sin(), 40.0, 0.0], PERIOD_S);
            alone.see();
            alone.look([0.4, 0.0], 0.0, PERIOD_S);
        }
        let slide = alone.slide(0, &ROWS[0], 40.0, PERIOD_S).expect("it slides");
        assert!(slide.ahead_m_s.is_finite() && slide.step_m.is_finite(), "{slide:?}");
    }
}
