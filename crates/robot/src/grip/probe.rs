//! The floor is asked: laws of speed swing what they ask of the wheels by a part of it, and a wheel whose push doesn't follow slides.
//!
//! A drive that holds a speed gives whatever that takes, so what a floor lacks looks like a lighter platform or a
//! slope's help for as long as the motion stays. Asked for an acceleration a(t) the law adds p·a·cos(ω·t): a gripping
//! wheel's push swings with its rim by the platform's mass, a sliding one's not at all (C.-A. de Coulomb).
//!
//! What swings is what a whole swing has in common with sine and cosine beside a straight line (W. C. Michels
//! and N. L. Curtis, *Rev. Sci. Instrum.* 12, 1941), so neither a force nor its steady change tells.

use std::f64::consts::{PI, TAU};

use omnibase_platform::{Twist2, axes};

use super::GRAVITY_M_S2;
use super::friction::{DRY_M_S, WheelFriction};
use crate::config::{RobotPlan, rim_per_count_m};
use crate::signals::{CycleTime, MAX_WHEELS, Setpoint};

/// The part of an acceleration that swings: a gripping wheel's push does on the softest treads by five times as much, within the margin
/// that motions are planned with.
const PART: f64 = 0.04;
/// Gentler motions swing by this part of what the floor bears beyond them, up to so much, m/s², more where encoders count coarsely, and so
/// great a part: what changes in them otherwise makes a wheel of its motor's force look like a tenth of the platform.
const LEFT: f64 = 0.2;
const MOST_M_S2: f64 = 0.1;
const MOST_PART: f64 = 0.4;
/// What is asked for with so many times what tells nothing tells something along most rims.
const HEARD: f64 = 1.25;
/// By so much at least, m/s².
const GENTLEST_M_S2: f64 = HEARD * LEAST_M_S2;
/// What three wheels on a floor whose friction is told bear of it in their worst direction, within that margin, over gravity.
const BORNE: f64 = 0.33;
/// What asks for less than this of a rim is gentle, m/s².
const GENTLE_M_S2: f64 = 1.0;
/// How long a swing takes at least, ns: slower than what counts as ringing, 20 Hz.
const SWING_NS: u64 = 56_000_000;
/// So many looks begin within a swing, one after the other.
const LOOKS: usize = 4;
/// A rim that is asked to swing by less tells nothing, m/s².
const LEAST_M_S2: f64 = 0.02;
/// Nor by less than so many times what counts alone look like: a position that is rounded to them swings by a πth of one at most
/// (B. Widrow, I. Kollár, *Quantization Noise*, 2008).
const COUNTED: f64 = 4.0;
/// Nor one that is asked for less than this part of what the most is, for what all of them move moves it too; nor one that follows by less
/// than this part.
const OF_MOST: f64 = 0.5;
const FOLLOWS: f64 = 0.5;
/// Wheels slide only where their platform is pushed by less than this part of what is believed that it takes.
const PUSHED: f64 = 0.5;

/// Sine beside a straight line: what they have in common over a swing, u from −1/2 to 1/2, is taken out, and what is left is scaled so that it
/// finds a sine's amplitude as the cosine does.
const LINE: f64 = 6.0 / PI;
const SCALE: f64 = 1.0 / (1.0 - 6.0 / (PI * PI));

/// A rim that is asked to swing by less tells nothing, m/s², where it goes so far by a count of its encoder, m.
fn least_m_s2(count_m: f64) -> f64 {
    let rad_s = TAU * 1e9 / SWING_NS as f64;
    LEAST_M_S2.max(COUNTED * rad_s * rad_s * count_m / PI)
}

/// Cycles of a swing: a multiple of the looks.
fn cycles(period_ns: u64) -> u64 {
    let looks = LOOKS as u64;
    looks * SWING_NS.div_ceil(looks * period_ns.max(1))
}

/// Where in its swing the cycle with an index is, over the whole.
fn place(index: u64, cycles: u64) -> f64 {
    ((index % cycles) as f64 + 0.5) / cycles as f64
}

/// How much of an acceleration swings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// What the floor bears, m/s²; and how fast the platform may turn faster, rad/s².
    borne_m_s2: f64,
    turn_rad_s2: f64,
    /// The most that a gentle motion swings by, m/s².
    most_m_s2: f64,
    /// By what a turn becomes a rim's speed, m.
    lever_m: f64,
}

impl Extent {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let floors = [plan.grip.friction, plan.grip.remembered.map(|floor| floor.friction)];
        let borne = floors.into_iter().flatten().map(|friction| BORNE * friction * GRAVITY_M_S2);
        let smooth_m_s2 = plan.limits.jerk_m_s3 * 1e-9 * SWING_NS as f64 / TAU;
        let told_m_s2 = least_m_s2(rim_per_count_m(plan));
        Extent {
            borne_m_s2: borne.fold(plan.limits.acceleration_m_s2, f64::min),
            turn_rad_s2: plan.limits.turn_acceleration_rad_s2,
            // A swing changes by its size times its ω in a second.
            most_m_s2: MOST_M_S2.max(HEARD * told_m_s2).min(smooth_m_s2),
            lever_m: WheelFriction::new(&plan.kinematics).lever_m(),
        }
    }

    /// Whether its encoders count so coarsely that no gentle motion swings by what tells something.
    pub(crate) fn is_drowned_by_counts(plan: &RobotPlan) -> bool {
        let (extent, told_m_s2) = (Extent::new(plan), least_m_s2(rim_per_count_m(plan)));
        // Where both parts are alike the swing is the greatest.
        let greatest_m_s2 = extent.borne_m_s2 * LEFT * MOST_PART / (LEFT + MOST_PART);
        told_m_s2 > LEAST_M_S2 && greatest_m_s2.min(extent.most_m_s2) < told_m_s2
    }

    /// Whether a motion asks for little.
    pub(super) fn is_gentle(&self, acceleration: [f64; 3]) -> bool {
        self.rim_m_s2(acceleration) < GENTLE_M_S2
    }

    /// What a rim gains of an acceleration over the floor at the most, m/s².
    fn rim_m_s2(&self, [x, y, turn]: [f64; 3]) -> f64 {
        omnibase_platform::length([x, y]) + self.lever_m * turn.abs()
    }

    /// The part of one over the floor, m/s² and rad/s², whichever way its axes point.
    pub(super) fn part(&self, acceleration: [f64; 3]) -> f64 {
        let (rim_m_s2, [.., turn]) = (self.rim_m_s2(acceleration), acceleration);
        let gentle_m_s2 = (LEFT * (self.borne_m_s2 - rim_m_s2)).max(GENTLEST_M_S2).min(self.most_m_s2);
        let part = |swings: f64, of: f64| swings / of.max(f64::MIN_POSITIVE);
        let of_turn = part(LEFT * (self.turn_rad_s2 - turn.abs()), turn.abs());
        part(gentle_m_s2, rim_m_s2).min(of_turn).clamp(PART, MOST_PART)
    }
}

/// What a law of speed asks for beside its speeds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swing {
    is_heard: bool,
    extent: Extent,
    /// For how many cycles the setpoint has moved: a motion is driven alike whenever it begins.
    moved: u64,
}

impl Swing {
    /// Nothing where a drive doesn't tell its torque.
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        Swing { is_heard: plan.tells_torques(), extent: Extent::new(plan), moved: 0 }
    }

    /// Whether it swings anything.
    pub(crate) fn asks(&self) -> bool {
        self.is_heard
    }

    /// The setpoint's acceleration for so long, s; in each cycle once.
    pub(crate) fn lead_s(&mut self, time: &CycleTime, setpoint: &Setpoint) -> f64 {
        let Setpoint { twist_in_odom, acceleration_in_odom, .. } = setpoint;
        let rests = [twist_in_odom, acceleration_in_odom].into_iter().all(|one| *one == Twist2::default());
        self.moved = if rests { 0 } else { self.moved.wrapping_add(1) };
        if !self.is_heard {
            return 0.0;
        }
        self.extent.part(axes(acceleration_in_odom)) * swing_s(self.moved, time)
    }
}

/// By what an acceleration that swings makes a speed, s.
fn swing_s(index: u64, time: &CycleTime) -> f64 {
    let cycles = cycles(time.period_ns);
    cycles as f64 * time.period_s() / TAU * (TAU * place(index, cycles)).sin()
}

/// What a wheel showed in a cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rim {
    /// By how much it is asked to swing, and what it gains, m/s².
    pub(super) asked_m_s2: f64,
    pub(super) gains_m_s2: f64,
    /// How fast it is, m/s, what its motor pushes it with, N, and by how much that swings at least by what is believed of the platform.
    pub(super) rim_m_s: f64,
    pub(super) motor_n: f64,
    pub(super) needed_n: f64,
}

/// What a look found of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moved {
    /// What its motor moves with its rim, kg; of it what goes along with the rim, less than none where a soft tread pushes back; and what it
    /// would move at least if it gripped.
    pub(super) kg: f64,
    pub(super) along_kg: f64,
    pub(super) needed_kg: f64,
    /// Whether the platform is pushed as is believed that it takes: then one motor may push less because another one, or a friction,
    /// does its part.
    pub(super) is_pushed: bool,
}

/// What the platform showed in a cycle along the acceleration that it is asked for, N: what all motors push it with, and what its acceleration
/// needs by what is believed of it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Along {
    pub(super) pushed_n: f64,
    pub(super) needed_n: f64,
}

/// What a rim adds to every look.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    forwards: i64,
    /// What was asked for, gains, motor's force, and what was needed.
    values: [f64; 4],
}

/// A rim's swings over a look.
#[derive(Clone, Copy, Debug, Default)]
struct Swings {
    /// In how many cycles it turned forwards less those in which it turned backwards: dry friction changes where it turns back.
    forwards: i64,
    /// What its values have in common with cosine, and with sine.
    cosines: [f64; 4],
    sines: [f64; 4],
}

#[derive(Clone, Copy, Debug, Default)]
struct Look {
    taken: u64,
    pushed: [f64; 2],
    needed: [f64; 2],
    wheels: [Swings; MAX_WHEELS],
}

/// The watch.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    looks: [Look; LOOKS],
    /// A rim that is asked to swing by less tells nothing, m/s².
    least_m_s2: f64,
}

impl Probe {
    /// Of rims that go so far by a count of their encoders, m.
    pub(super) fn new(count_m: f64) -> Self {
        Probe { looks: Default::default(), least_m_s2: least_m_s2(count_m) }
    }

    /// Nothing is known of what was before.
    pub(super) fn forget(&mut self) {
        self.looks = Default::default();
    }

    /// Takes in a cycle; what is found of each wheel that a look has ended on.
    pub(super) fn look(
        &mut self,
        time: &CycleTime,
        rims: &[Rim],
        along: &Along,
    ) -> [Option<Moved>; MAX_WHEELS] {
        let mut moved = [None; MAX_WHEELS];
        // Of what swings only the size is looked at: this one's place needn't be the law's.
        let cycles = cycles(time.period_ns);
        let place = place(time.index, cycles);
        let (mut sin, mut cos) = (TAU * place).sin_cos();
        let swing = cos;
        let mut shown = [Shown::default(); MAX_WHEELS];
        for (shown, rim) in shown.iter_mut().zip(rims) {
            *shown = Shown {
                forwards: i64::from(rim.rim_m_s > DRY_M_S) - i64::from(rim.rim_m_s < -DRY_M_S),
                values: [swing * rim.asked_m_s2, rim.gains_m_s2, rim.motor_n, swing * rim.needed_n],
            };
        }
        for (at, look) in self.looks.iter_mut().enumerate() {
            let index = (time.index + at as u64 * (cycles / LOOKS as u64)) % cycles;
            if index == 0 {
                *look = Look::default();
            }
            look.taken += 1;
            // A look's middle is half a swing after its begin; the next look is a quarter further.
            let u = (index as f64 + 0.5) / cycles as f64 - 0.5;
            let with = [-cos, SCALE * (-sin - LINE * u)];
            (sin, cos) = (cos, -sin);
            add(&mut look.pushed, with, along.pushed_n);
            add(&mut look.needed, with, along.needed_n);
            for (swings, shown) in look.wheels.iter_mut().zip(&shown[..rims.len()]) {
                swings.forwards += shown.forwards;
                add(&mut swings.cosines, shown.values, with[0]);
                add(&mut swings.sines, shown.values, with[1]);
            }
            if index + 1 == cycles && look.taken == cycles {
                moved = look.moved(cycles, self.least_m_s2);
            }
        }
        moved
    }
}

/// Adds products.
fn add<const N: usize>(sums: &mut [f64; N], values: [f64; N], with: f64) {
    *sums = std::array::from_fn(|at| sums[at] + values[at] * with);
}

impl Look {
    /// What is found of each wheel; `None` where that says nothing.
    fn moved(&self, cycles: u64, least_m_s2: f64) -> [Option<Moved>; MAX_WHEELS] {
        let size = |sums: [f64; 2]| 2.0 / cycles as f64 * omnibase_platform::length(sums);
        let is_pushed = size(self.pushed) > PUSHED * size(self.needed);
        let asked = |swings: &Swings| size([swings.cosines[0], swings.sines[0]]);
        let most = self.wheels.iter().map(asked).fold(0.0, f64::max);
        self.wheels.map(|Swings { forwards, cosines, sines }| {
            let [asked, gains, motor, needed] = std::array::from_fn(|at| [cosines[at], sines[at]]);
            let along =
                (motor[0] * gains[0] + motor[1] * gains[1]) / (gains[0] * gains[0] + gains[1] * gains[1]);
            let [asked, gains, motor, needed] = [asked, gains, motor, needed].map(size);
            let turns_on = forwards.unsigned_abs() == cycles;
            let tells = turns_on && asked > least_m_s2.max(OF_MOST * most) && gains > FOLLOWS * asked;
            let moved = Moved { kg: motor / gains, along_kg: along, needed_kg: needed / asked, is_pushed };
            tells.then_some(moved).filter(|moved| (moved.kg + moved.needed_kg).is_finite())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Registry;

    const PERIOD_NS: u64 = 1_000_000;
    const EXTENT: Extent = Extent { borne_m_s2: 1.5, turn_rad_s2: 3.0, most_m_s2: MOST_M_S2, lever_m: 0.4 };

    /// What two rims were said to move over a second, kg: a motor's force as a world makes it of time and of what the first rim gains, that
    /// begins to be asked for an acceleration at 0.1 s; the second is asked for a part of it.
    fn told(asked_m_s2: f64, part: f64, world: impl Fn(f64, f64) -> f64) -> [Vec<f64>; 2] {
        let mut probe = Probe::new(0.0);
        let mut told = [vec![], vec![]];
        let mut before_s = 0.0;
        for index in 0..1000 {
            let time = CycleTime::on_grid(index, PERIOD_NS);
            let t = 1e-3 * index as f64;
            let wished_m_s2 = if t < 0.1 { 0.0 } else { asked_m_s2 };
            // The speed that is asked for beside the motion's, and so what it gains.
            let gains_m_s2 = wished_m_s2 * (1.0 + 1e3 * PART * (swing_s(index, &time) - before_s));
            before_s = swing_s(index, &time);
            let asked_m_s2 = PART * wished_m_s2;
            let mut rims = [Rim::default(); MAX_WHEELS];
            rims[0] =
                Rim { asked_m_s2, gains_m_s2, rim_m_s: 0.5, motor_n: world(t, gains_m_s2), needed_n: 0.0 };
            let [asked_m_s2, gains_m_s2] = [part * asked_m_s2, part * gains_m_s2];
            rims[1] =
                Rim { asked_m_s2, gains_m_s2, rim_m_s: 0.5, motor_n: world(t, gains_m_s2), needed_n: 0.0 };
            let moved = probe.look(&time, &rims, &Along::default());
            told.iter_mut()
                .zip(moved)
                .for_each(|(told, kg)| told.extend(kg.map(|moved| moved.kg).filter(|_| t > 0.2)));
        }
        told
    }

    #[test]
    fn a_motor_is_found_to_move_what_its_rim_takes_with_it() {
        let [grips, _] = told(1.5, 0.0, |_, gains| 37.0 * gains + 12.0);
        assert!(grips.len() > 50 && grips.iter().all(|kg| (kg - 37.0).abs() < 1e-6), "{grips:?}");
        // A floor that gives 60 N, its load shifting by 100 N in a second.
        let [slides, _] = told(1.5, 0.0, |t, gains| 60.0 + 100.0 * t + 2.0 * gains);
        assert!(slides.len() > 50 && slides.iter().all(|kg| (kg - 2.0).abs() < 0.1), "{slides:?}");
    }

    #[test]
    fn who_is_asked_for_little_says_nothing() {
        assert!(told(0.4, 0.0, |_, gains| 2.0 * gains)[0].is_empty());
        let seconds = [0.4, 0.6].map(|part| told(1.5, part, |_, gains| 2.0 * gains)[1].len());
        assert!(seconds[0] == 0 && seconds[1] > 50, "{seconds:?}");
        // A rim that doesn't follow, as where its motor is at its limit.
        let mut probe = Probe::new(0.0);
        for index in 0..1000 {
            let time = CycleTime::on_grid(index, PERIOD_NS);
            let rim =
                Rim { asked_m_s2: PART * 1.5, gains_m_s2: 1.5, rim_m_s: 0.5, motor_n: 60.0, needed_n: 0.0 };
            assert_eq!(probe.look(&time, &[rim; MAX_WHEELS], &Along::default()), [None; MAX_WHEELS]);
        }
    }

    #[test]
    fn a_wheel_that_turns_back_says_nothing_for_dry_friction_turns_with_it() {
        let mut probe = Probe::new(0.0);
        let mut told_s = vec![];
        for index in 0..1000 {
            let time = CycleTime::on_grid(index, PERIOD_NS);
            let t = 1e-3 * index as f64;
            let gains_m_s2 = -1.5 + 1.5 * PART * (TAU * place(index, cycles(PERIOD_NS))).cos();
            let rim = Rim {
                asked_m_s2: PART * -1.5,
                gains_m_s2,
                rim_m_s: 0.75 - 1.5 * t,
                motor_n: gains_m_s2,
                needed_n: 0.0,
            };
            if probe.look(&time, &[rim; MAX_WHEELS], &Along::default())[0].is_some() {
                told_s.push(t);
            }
        }
        assert!(told_s.iter().all(|t| !(0.498..0.555).contains(t)) && told_s.len() > 55, "{told_s:?}");
    }

    #[test]
    fn what_is_no_number_says_nothing_and_is_forgotten_after_a_swing() {
        let spoils = |t: f64, gains: f64| if t == 0.5 { f64::NAN } else { 37.0 * gains };
        let [told_kg, _] = told(1.5, 0.0, spoils);
        assert!(told_kg.len() > 40 && told_kg.iter().all(|kg| (kg - 37.0).abs() < 1e-6), "{told_kg:?}");
    }

    #[test]
    fn a_motion_swings_alike_whenever_it_begins() {
        let swings = |begins: u64| {
            let mut swing = Swing { is_heard: true, extent: EXTENT, moved: 0 };
            let of_cycle = |index: u64| {
                let twist_in_odom = Twist2::new(if index < begins { 0.0 } else { 0.3 }, 0.0, 0.0);
                let setpoint = Setpoint { twist_in_odom, ..Setpoint::default() };
                swing.lead_s(&CycleTime::on_grid(index, PERIOD_NS), &setpoint)
            };
            (0..begins + 200).map(of_cycle).skip(begins as usize).collect::<Vec<_>>()
        };
        assert_eq!(swings(3), swings(41));
        assert!(swings(3).iter().any(|lead_s| *lead_s > 3e-4));
    }

    #[test]
    fn a_gentle_motion_swings_by_what_the_floor_bears_beyond_it_and_no_harder() {
        let m_s2 = |extent: &Extent, [x, turn]: [f64; 2]| {
            extent.part([0.6 * x, -0.8 * x, turn]) * (x + 0.4 * turn.abs())
        };
        // As hard as may be, half of what is left of 1.5 over five, and all but rest.
        for (asked, swings) in
            [([2.0, 0.0], 0.08), ([1.3, 0.0], 0.052), ([0.5, 0.0], 0.1), ([0.1, 0.0], 0.04)]
        {
            assert!((m_s2(&EXTENT, asked) - swings).abs() < 1e-12, "{asked:?}");
        }
        assert!((m_s2(&EXTENT, [0.25, -0.5]) - 0.1).abs() < 1e-12);
        assert_eq!(
            [[0.0, 2.4], [0.99, 0.0], [0.6, 1.1]].map(|[x, turn]| EXTENT.is_gentle([x, 0.0, turn])),
            [true, true, false]
        );
        assert_eq!(EXTENT.part([0.0; 3]) * 0.0, 0.0);
        // On a floor that bears 0.26, as one of 0.08 that was told, not beyond it.
        let icy = Extent { borne_m_s2: 0.26, ..EXTENT };
        assert!([0.2, 0.25].iter().all(|asked| (m_s2(&icy, [*asked, 0.0]) - GENTLEST_M_S2).abs() < 1e-12));
        // A platform that may turn faster by 0.5 rad/s² only, and one that may change by 2 m/s³.
        let slow = Extent { turn_rad_s2: 0.5, ..EXTENT };
        assert!((slow.part([0.0, 0.0, 0.4]) - 0.05).abs() < 1e-12 && slow.part([0.0, 0.0, 0.5]) == PART);
        let smooth = Extent { most_m_s2: 0.02, ..EXTENT };
        assert!((m_s2(&smooth, [0.2, 0.0]) - 0.02).abs() < 1e-12);
    }

    #[test]
    fn the_floor_bears_what_the_file_says_of_acceleration_or_friction_whichever_is_less() {
        let of = |told: &str| {
            let text = include_str!("../../../../robots/bmm.toml");
            let no_files = |_: &str| Err(String::new());
            let plan = RobotPlan::from_toml(&format!("{text}{told}"), &Registry::with_built_in(), &no_files);
            Extent::new(&plan.unwrap_or_else(|problems| panic!("{problems:?}")))
        };
        assert_eq!([of("").borne_m_s2, of("").turn_rad_s2, of("").most_m_s2], [1.5, 3.0, MOST_M_S2]);
        assert_eq!(of("\n[grip]\nfriction = 0.6\n").borne_m_s2, 1.5);
        let icy_m_s2 = of("\n[grip]\nfriction = 0.08\n").borne_m_s2;
        assert!((icy_m_s2 - BORNE * 0.08 * GRAVITY_M_S2).abs() < 1e-12);
    }

    #[test]
    fn what_counts_alone_look_like_tells_nothing_and_coarse_ones_are_asked_harder() {
        // A position that is rounded, swinging by as much as it can at the swing's place: a πth of a count.
        let count_m = TAU * 0.1 / 60_000.0;
        let counted_m_s2 = (TAU / 0.056).powi(2) * count_m / PI;
        assert!((least_m_s2(count_m) - 4.0 * counted_m_s2).abs() < 1e-12);
        assert_eq!([0.0, 0.6e-6].map(least_m_s2), [LEAST_M_S2; 2]);
        let of = |counts: u32| {
            let text = include_str!("../../../../robots/bmm.toml");
            let told = format!("device = \"sgdv\"\ncounts_per_revolution = {counts}");
            let text = text.replace("device = \"sgdv\"", &told);
            RobotPlan::from_toml(&text, &Registry::with_built_in(), &|_: &str| Err(String::new())).unwrap()
        };
        let [fine, coarse, coarsest] = [1_048_576, 60_000, 40_000].map(of);
        assert_eq!(Extent::new(&fine).most_m_s2, MOST_M_S2);
        assert!((Extent::new(&coarse).most_m_s2 - 5.0 * counted_m_s2).abs() < 1e-12);
        assert_eq!([&fine, &coarse, &coarsest].map(Extent::is_drowned_by_counts), [false, false, true]);
    }

    #[test]
    fn a_swing_is_slower_than_ringing_and_swings_by_a_part() {
        for period_ns in [125_000, 250_000, 500_000, 1_000_000, 2_000_000, 3_000_000, 4_000_000] {
            let half_ns = cycles(period_ns) * period_ns / 2;
            assert!((26_000_000..34_000_000).contains(&half_ns), "{period_ns}: {half_ns}");
        }
        let swings = (0..56).map(|index| swing_s(index, &CycleTime::on_grid(index, PERIOD_NS)));
        let most_s = swings.fold(0.0, f64::max);
        // 56 ms/2π.
        assert!((most_s - 0.056 / TAU).abs() < 2e-5, "{most_s}");
    }
}
