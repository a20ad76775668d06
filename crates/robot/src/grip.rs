//! What the wheels' torques do on the floor: how heavy the platform is, how much it rubs, how steep it stands, and which wheel slips.
//!
//! The twist that forces alone explain, v̂' = M⁻¹·(Bᵀ·f − friction) in body axes, is drawn slowly to what the
//! wheels that grip show. A wheel whose rim runs ahead of v̂ in the direction of its own force slips: what a
//! floor gives to a slipping wheel brakes its slip (K. L. Johnson, *Contact Mechanics*, 1985, section 8.1).
//!
//! A push does the opposite, for then the wheel's force is against it; a slope's force is learnt, and is among
//! those of v̂.
//!
//! How far ahead counts depends on how well mass and friction are known by then, and on how fast treads give way.
//! A gyro's turn is v̂'s. Of more than three wheels those that run ahead of what all of them show together slip as well.

mod alone;
pub(crate) mod equation;
mod first_estimates;
mod floor;
pub(crate) mod friction;
mod identification;
pub(crate) mod loads;
pub(crate) mod probe;
mod sliding;
mod steady;
mod treads;
mod watches;

use omnibase_platform::{Kinematics, PerWheel, Wrench2, axes};

use crate::config::{RobotPlan, rated_nm, rim_per_count_m, wheel_kg};
use crate::decay::Decay;
use crate::signals::{CycleTime, Dynamics, Exchange, GripReport, MAX_WHEELS, Measurements};
use alone::Alone;
pub(crate) use first_estimates::FirstEstimates;
use floor::Floor;
use friction::{DRY_M_S, WheelFriction};
use identification::{Identification, Motion, Watched};
use loads::Loads;
use probe::{Extent, Probe};
use sliding::{Slide, Sliding};
use steady::Steady;
use treads::Treads;

/// Standard gravity, m/s² (ISO 80000-3).
pub(crate) const GRAVITY_M_S2: f64 = 9.806_65;
/// Low-pass on the rims' speeds and torques, 1/s: counts are coarse, treads swing.
const FILTER_1_S: f64 = 400.0;
/// How fast v̂ is drawn to what the wheels show, 1/s: forces that nothing tells (slopes, pushes) shift it by 1/5 s of
/// their acceleration.
const DRAWN_1_S: f64 = 5.0;
/// A rim that is less ahead than this may be creep, tread, or a slope of 3 %, m/s.
const LEAST_SLIP_M_S: f64 = 0.05;
/// So many standard deviations of v̂ come on top.
const SIGMAS: f64 = 3.0;
/// All of it counts so many times before it begins to count where more than three rims agree within this part of it, as they did before,
/// and no gyro tells the turn: then a force is unknown, more often than all slip alike.
const ALIKE: f64 = 1.3;
const ALIKE_SHARE: f64 = 0.25;
/// For how long it must be ahead, ns; and what slips grips again after as long below half of it.
const LASTING_NS: u64 = 10_000_000;
/// A wheel that grips makes up for what it slipped, s: many short slips are a long one.
const FORGOTTEN_S: f64 = 2.0;
/// What slid may slide on for so long though no watch says so any more, s: as a stop goes on.
const SLIDES_ON_S: f64 = 0.5;
/// Longer than this v̂ is no witness without the wheel, ns.
const LONGEST_NS: u64 = 2_000_000_000;
/// After so many periods without a complete exchange v̂ begins anew.
const LONGEST_GAP: u32 = 10;
/// Less than this is no force, N.
const LEAST_N: f64 = 1.0;
/// Rims agree where what no motion of a platform explains is less than this part of them; so far they do before one contradicts the
/// others, m.
const AGREEING: f64 = 0.2;
const AGREED_M: f64 = 0.01;
/// A wheel of four that is wired wrongly makes others slip, and is named by its own watch by then, m: gentle motions are heard later.
const WIRES_SHOWN_M: f64 = 0.15;
/// No wheel turns faster than its limit times this.
const IMPOSSIBLE: f64 = 3.0;
/// By which part of what its file says an empty platform may weigh less.
const WEIGHED_SHARE: f64 = 0.05;

/// A drive tells its torque in such parts of the rated one (0x6077).
const TOLD_SHARE: f64 = 1e-3;

/// The watch.
#[derive(Clone, Debug)]
pub(crate) struct Grip {
    kinematics: Kinematics,
    friction: WheelFriction,
    loads: Loads,
    identification: Identification,
    sliding: Sliding,
    steady: Steady,
    alone: Alone,
    probe: Probe,
    treads: Treads,
    extent: Extent,
    filter: Decay,
    drawn: Decay,
    forgotten: Decay,
    /// Whether every drive tells its torque: without that nothing is known.
    is_told: bool,
    /// A wheel with its rotor as a mass at its rim, kg.
    wheel_kg: f64,
    /// The part of its force on the floor that each wheel's rim feels.
    rim_share: [f64; MAX_WHEELS],
    /// The platform's mass by its file, kg.
    told_kg: f64,
    /// A rim that is faster, or further ahead, is no measurement, m/s.
    most_m_s: f64,
    /// Periods since the last complete exchange: its increments span them all.
    periods: u32,
    wheels: PerWheel<Wheel>,
    /// v̂ in body axes; `None` before the first measurement.
    body: Option<[f64; 3]>,
    /// The acceleration over the floor that forces explain.
    acceleration: [f64; 3],
    /// What the wheels showed last.
    shown: [f64; 3],
    /// Standard deviations of v̂.
    sigma: [f64; 3],
    /// The most that a wheel pushes the floor with, over its load.
    felt: f64,
    /// `None` before any wheel slipped, in this run or one that is remembered.
    floor: Option<Floor>,
    /// How far the rims went as those of a platform do, m.
    agreed_m: f64,
    /// Whether a gyro tells the platform's turn.
    is_turn_told: bool,
}

/// How the platform is meant to move.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wished {
    /// The setpoint's acceleration over the floor, in body axes.
    pub(crate) acceleration: [f64; 3],
    /// Whether torques are commanded.
    pub(crate) by_torque: bool,
    /// Whether the law swings what it asks for.
    pub(crate) asks_floor: bool,
    /// The cycle in which.
    pub(crate) time: CycleTime,
}

/// What is known of one wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    /// Its rim, behind the low-pass, m/s; what it gains in a second; and its motor's force there, N.
    rim_m_s: f64,
    gains_m_s2: f64,
    force_n: f64,
    /// Whether its drive is at a limit of its own: its force stays, and its rim doesn't follow, for that alone.
    is_held_back: bool,
    /// How far its rim is ahead of v̂, m/s.
    ahead_m_s: f64,
    slips: bool,
    /// Its force stays where it should change.
    slide: Option<Slide>,
    /// For how long it says the opposite of `slips`, and for how long it slips, ns.
    doubted_ns: u64,
    since_ns: u64,
    /// By how much it slipped lately, m; by how much it may have, and what of that was told before, and now.
    way_m: f64,
    may_m: f64,
    told_m: f64,
    unread_m: f64,
    /// Its rim's speed when it began to be loose, m/s, and for how long it isn't by now, s.
    loose_from: Option<(f64, f64)>,
}

impl Wheel {
    /// Whether it says nothing of the platform's motion.
    fn is_loose(&self) -> bool {
        self.slips || self.slide.is_some()
    }

    /// Adds to the way that it may have slipped. What the rim of a wheel gained since it was loose the platform may have gained not at all,
    /// nor lost, for as long as it may slide on.
    fn doubt(&mut self, span_s: f64, forgotten: &mut Decay) {
        let (from_m_s, gripped_s) = self.loose_from.unwrap_or((self.rim_m_s, f64::INFINITY));
        let gripped_s = if self.is_loose() { 0.0 } else { gripped_s + span_s };
        self.loose_from = (gripped_s < SLIDES_ON_S).then_some((from_m_s, gripped_s));
        self.unread_m = 0.0;
        if self.loose_from.is_some() {
            self.may_m = self.way_m.max(self.may_m + span_s * (self.rim_m_s - from_m_s).abs());
            self.unread_m = (self.may_m * self.may_m - self.told_m * self.told_m).max(0.0).sqrt();
            self.told_m = self.may_m;
        } else {
            self.may_m = self.way_m.max(forgotten.kept(span_s) * self.may_m);
            self.told_m = self.told_m.min(self.may_m);
        }
    }

    /// Whether its motor is what makes it push the floor so, N: what the floor turns by itself is no slide, and a motor that pushes the other
    /// way, or not at all, makes none.
    fn drives(&self, push_n: f64) -> bool {
        self.force_n * push_n.signum() > LEAST_N
    }
}

impl Grip {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let friction = WheelFriction::new(&plan.kinematics);
        let weighed_kg = (1.0 - WEIGHED_SHARE) * plan.mass_kg.unwrap_or(0.0);
        let first = FirstEstimates::of(&plan.controller).at_least(weighed_kg);
        let bounded_kg = plan.controller.mass_bounds_kg.map_or(0.0, |[least, _]| least);
        let mut rim_share = [1.0; MAX_WHEELS];
        rim_share
            .iter_mut()
            .zip(plan.kinematics.wheels())
            .for_each(|(share, wheel)| *share = wheel.rim_share());
        let greatest_m = plan.kinematics.wheels().iter().map(|wheel| wheel.radius_m).fold(0.0, f64::max);
        Grip {
            identification: Identification::new(&first, friction.lever_m()),
            sliding: Sliding::new(&plan.kinematics, &first),
            steady: Steady::new(weighed_kg.max(bounded_kg)),
            alone: Alone::new(
                plan.kinematics.wheel_count(),
                first.mass.1[0] * GRAVITY_M_S2 / plan.kinematics.wheel_count() as f64,
                TOLD_SHARE * rated_nm(plan).into_iter().fold(0.0, f64::max) / greatest_m,
            ),
            probe: Probe::new(rim_per_count_m(plan)),
            treads: Treads::new(plan),
            extent: Extent::new(plan),
            friction,
            loads: Loads::new(&plan.kinematics),
            filter: Decay::new(FILTER_1_S),
            drawn: Decay::new(DRAWN_1_S),
            forgotten: Decay::new(1.0 / FORGOTTEN_S),
            is_told: plan.tells_torques(),
            wheel_kg: wheel_kg(plan, first.mass.0),
            rim_share,
            told_kg: plan.controller.mass_kg.or(plan.mass_kg).unwrap_or(first.mass.0),
            most_m_s: IMPOSSIBLE * plan.limits.wheel_speed_rad_s * greatest_m,
            kinematics: plan.kinematics.clone(),
            periods: 0,
            wheels: PerWheel::from_fn(plan.kinematics.wheel_count(), |_| Wheel::default()),
            body: None,
            acceleration: [0.0; 3],
            shown: [0.0; 3],
            sigma: [0.0; 3],
            felt: 0.0,
            agreed_m: 0.0,
            is_turn_told: false,
            floor: plan
                .grip
                .remembered
                .map(|floor| Floor { coefficient: floor.friction, variance: floor.friction_sigma.powi(2) }),
        }
    }

    /// Takes in a cycle; `turn_rad_s` by a gyro where there is one, and what is wished where the platform is meant to move.
    pub(crate) fn look(
        &mut self,
        time: &CycleTime,
        exchange: Exchange,
        measurements: &Measurements,
        turn_rad_s: Option<f64>,
        wished: Option<Wished>,
    ) -> GripReport {
        self.periods = self.periods.saturating_add(1);
        self.wheels.iter_mut().for_each(|wheel| wheel.unread_m = 0.0);
        self.predict(time.period_s());
        self.is_turn_told = turn_rad_s.is_some();
        if let (Some(body), Some(turn_rad_s)) = (&mut self.body, turn_rad_s) {
            (body[2], self.sigma[2]) = (turn_rad_s, 0.0);
        }
        if self.is_told && exchange == Exchange::Complete {
            let periods = std::mem::take(&mut self.periods);
            if periods > LONGEST_GAP {
                self.forget();
            }
            let span_s = f64::from(periods) * time.period_s();
            let is_whole = periods == 1;
            if measurements.present().iter().all(|drive| drive.is_finite()) {
                self.compare(measurements, span_s, is_whole, wished);
                self.judge(span_s);
            } else {
                self.forget();
            }
        }
        self.report()
    }

    /// How far the wheels may have rolled in this cycle, rad, without moving the platform: the ways of a slip add up.
    pub(crate) fn unread_rad(&self, wheel: usize) -> f64 {
        self.wheels.get(wheel).map_or(0.0, |told| told.unread_m / self.kinematics.wheels()[wheel].radius_m)
    }

    /// Nothing is known of the motion before the next measurement.
    fn forget(&mut self) {
        (self.body, self.acceleration, self.sigma) = (None, [0.0; 3], [0.0; 3]);
        self.sliding.forget();
        self.steady.forget();
        self.alone.forget();
        self.probe.forget();
        self.treads.forget();
        self.wheels.fill(Wheel::default());
    }

    /// v̂ goes on by what forces give it.
    fn predict(&mut self, period_s: f64) {
        let [ax, ay, gain] = self.acceleration;
        if let Some([vx, vy, turn]) = self.body {
            // Its axes turn with it.
            let gains = [ax + turn * vy, ay - turn * vx, gain];
            self.body =
                Some([vx + period_s * gains[0], vy + period_s * gains[1], turn + period_s * gains[2]]);
        }
    }

    /// Compares v̂ with what the wheels show, and learns by the way.
    fn compare(&mut self, measurements: &Measurements, span_s: f64, is_whole: bool, wished: Option<Wished>) {
        let present = measurements.present();
        let count = present.len().min(self.kinematics.wheel_count());
        let keep = if self.body.is_some() { self.filter.kept(span_s) } else { 0.0 };
        let (mut speeds_rad_s, mut torques_nm) =
            (PerWheel::from_fn(count, |_| 0.0), PerWheel::from_fn(count, |_| 0.0));
        // A drive that holds a speed holds its rim against its tread.
        let is_by_torque = wished.is_some_and(|wished| wished.by_torque);
        if !is_by_torque {
            self.treads.forget();
        }
        let rims = self.wheels.iter_mut().zip(self.kinematics.wheels());
        for (at, ((wheel, rim), drive)) in rims.zip(present).enumerate() {
            let before_m_s = wheel.rim_m_s;
            wheel.rim_m_s = keep * before_m_s + (1.0 - keep) * rim.radius_m * drive.increment_rad / span_s;
            wheel.gains_m_s2 = if self.body.is_some() { (wheel.rim_m_s - before_m_s) / span_s } else { 0.0 };
            wheel.force_n = keep * wheel.force_n + (1.0 - keep) * drive.torque_nm / rim.radius_m;
            wheel.is_held_back = drive.is_held_back();
            if is_by_torque {
                self.treads.take(at, wheel.force_n - self.wheel_kg * wheel.gains_m_s2, span_s);
            }
            (speeds_rad_s[at], torques_nm[at]) = (wheel.rim_m_s / rim.radius_m, wheel.force_n * rim.radius_m);
        }
        let shown = axes(&self.kinematics.twist(&speeds_rad_s).twist_in_base);
        let [gx, gy, gain] = match self.body {
            Some(_) => std::array::from_fn(|axis| (shown[axis] - self.shown[axis]) / span_s),
            None => [0.0; 3],
        };
        self.shown = shown;
        let [vx, vy, turn_rad_s] = shown;
        let Wrench2 { fx_n, fy_n, torque_nm } = self.kinematics.wrench(&torques_nm);
        let motion = Motion {
            acceleration: [gx - turn_rad_s * vy, gy + turn_rad_s * vx, gain],
            turn_rad_s,
            wrench: [fx_n, fy_n, torque_nm],
            friction_per_newton: self.friction.per_newton(shown, self.identification.dynamics().centre_m()),
            is_trusted: is_whole
                && !measurements.is_held_back()
                && !self.wheels[..count].iter().any(Wheel::is_loose),
            moves: wished.is_some(),
            period_s: span_s,
        };
        self.identification.learn(&motion);
        let watched = self.identification.watched();
        self.slide(wished.filter(|_| is_whole), &motion, &watched, span_s);
        let Watched { dynamics, slope_n: [slope_x_n, slope_y_n], .. } = watched;
        let [spin_n, roller_n] = dynamics.friction_n;
        let of_both = |per_newton: &[[f64; 3]; 2], axis: usize| {
            spin_n * per_newton[0][axis] + roller_n * per_newton[1][axis]
        };
        let held = self.friction.held_per_newton(shown, dynamics.centre_m());
        let slope_n = [slope_x_n, slope_y_n, 0.0];
        let moved: [f64; 3] = std::array::from_fn(|axis| {
            let left = motion.wrench[axis] + slope_n[axis] - of_both(&motion.friction_per_newton, axis);
            // What axles and rollers that stand hold moves nothing.
            left - left.abs().min(of_both(&held, axis).max(0.0)).copysign(left)
        });
        self.acceleration = dynamics.acceleration(moved, turn_rad_s);
        // What mass and friction may be off shows in v̂ until it is drawn away again.
        let doubts_n = self.identification.doubts_n(&Motion { acceleration: self.acceleration, ..motion });
        let Dynamics { mass_kg, inertia_kg_m2, .. } = dynamics;
        let drawn = 1.0 - self.drawn.kept(span_s);
        for ((sigma, doubt_n), inertia) in
            self.sigma.iter_mut().zip(doubts_n).zip([mass_kg, mass_kg, inertia_kg_m2])
        {
            *sigma += span_s * doubt_n / inertia - drawn * *sigma;
        }
        let body = *self.body.get_or_insert(shown);
        let mut is_possible = true;
        let mut gripping_rad_s = PerWheel::from_fn(count, |_| 0.0);
        let rows = self.kinematics.matrix().iter().zip(self.kinematics.wheels());
        for (at, (wheel, (row, rim))) in self.wheels.iter_mut().zip(rows).enumerate() {
            let floor_m_s: f64 = row.iter().zip(body).map(|(row, speed)| row * speed).sum();
            wheel.ahead_m_s = wheel.rim_m_s - floor_m_s;
            is_possible &= wheel.rim_m_s.abs().max(wheel.ahead_m_s.abs()) < self.most_m_s;
            if !wheel.is_loose() {
                gripping_rad_s[at] = wheel.ahead_m_s / rim.radius_m;
            }
        }
        let toward = axes(&self.kinematics.twist(&gripping_rad_s).twist_in_base);
        self.body = Some(std::array::from_fn(|axis| body[axis] + drawn * toward[axis]));
        if !is_possible {
            self.forget();
        } else if self.wheels[..count].iter().all(|wheel| wheel.rim_m_s.abs() < DRY_M_S) {
            self.rest();
            if !motion.moves {
                let held_n = [0, 1].map(|axis| of_both(&held, axis));
                self.identification.rest([motion.wrench[0], motion.wrench[1]], held_n, span_s);
            }
        }
    }

    /// Wheels that stand are held by dry friction, whatever their motors' torques.
    fn rest(&mut self) {
        (self.body, self.acceleration, self.sigma) = (Some(self.shown), [0.0; 3], [0.0; 3]);
        for wheel in self.wheels.iter_mut() {
            let Wheel { rim_m_s, gains_m_s2, force_n, way_m, may_m, told_m, .. } = *wheel;
            *wheel = Wheel { rim_m_s, gains_m_s2, force_n, way_m, may_m, told_m, ..Wheel::default() };
        }
    }

    /// How far each rim is off what all of them show together, m/s; nothing before they once agreed: wires that are wrong contradict each
    /// other from the first motion on, and have their own watch.
    fn apart(&mut self, span_s: f64) -> [f64; MAX_WHEELS] {
        let mut apart_m_s = [0.0; MAX_WHEELS];
        let (mut all, mut off) = (0.0, 0.0);
        for ((apart_m_s, wheel), row) in
            apart_m_s.iter_mut().zip(self.wheels.iter()).zip(self.kinematics.matrix())
        {
            let shown_m_s: f64 = row.iter().zip(self.shown).map(|(row, speed)| row * speed).sum();
            *apart_m_s = wheel.rim_m_s - shown_m_s;
            all += wheel.rim_m_s * wheel.rim_m_s;
            off += *apart_m_s * *apart_m_s;
        }
        if off < AGREEING * AGREEING * all {
            self.agreed_m += span_s * (all / self.kinematics.wheel_count() as f64).sqrt();
        }
        if self.agreed_m < AGREED_M { [0.0; MAX_WHEELS] } else { apart_m_s }
    }

    /// Which wheels slip by now.
    fn judge(&mut self, span_s: f64) {
        let span_ns = (span_s * 1e9) as u64;
        let apart_m_s = self.apart(span_s);
        let [sx, sy, sh] = self.sigma;
        let along_m_s = sx.max(sy);
        let dynamics = self.identification.dynamics();
        let rims = self.kinematics.matrix().iter().zip(self.rim_share);
        let mean_n = |mass_kg: f64| mass_kg * GRAVITY_M_S2 / self.kinematics.wheel_count() as f64;
        let missing = self.steady.if_it_slides();
        let is_alike = self.kinematics.wheel_count() > 3
            && self.agreed_m >= AGREED_M
            && !self.is_turn_told
            && apart_m_s.iter().all(|apart_m_s| apart_m_s.abs() < ALIKE_SHARE * LEAST_SLIP_M_S);
        let (mut is_over, mut is_counted) = (false, false);
        self.felt = 0.0;
        for (at, (wheel, (row, rim_share))) in self.wheels.iter_mut().zip(rims).enumerate() {
            let load = self.loads.of(at, dynamics.centre_m());
            let sigma_m_s = omnibase_platform::length([row[0], row[1]]) * along_m_s + row[2].abs() * sh;
            let begins = is_alike && !wheel.slips && wheel.doubted_ns == 0;
            let least_m_s = if begins { ALIKE } else { 1.0 } * (LEAST_SLIP_M_S + SIGMAS * sigma_m_s);
            let rubs_n = load * dynamics.friction_n[0] * (wheel.rim_m_s / DRY_M_S).clamp(-1.0, 1.0);
            let force_n = wheel.force_n - rubs_n - self.wheel_kg * wheel.gains_m_s2;
            // Its motor's direction: what a spinning wheel gives the floor is small.
            let driven_n = wheel.force_n - rubs_n;
            // A motor that pushes the other way, or not at all, makes nothing slip.
            let is_driven = driven_n.abs().min(wheel.force_n * driven_n.signum()) > LEAST_N;
            let sign = driven_n.signum();
            // Of more than three wheels one that contradicts the others slips, whatever forces explain.
            let is_apart = is_driven && sign * apart_m_s[at] > LEAST_SLIP_M_S;
            if is_apart && sign * apart_m_s[at] > sign * wheel.ahead_m_s {
                wheel.ahead_m_s = apart_m_s[at];
            }
            // A tread gives way, until it slides.
            let ahead_m_s = sign * wheel.ahead_m_s - self.treads.ahead_m_s(at, sign);
            let is_ahead = is_apart || is_driven && ahead_m_s > least_m_s;
            let is_doubted = match wheel.slips {
                false => is_ahead,
                true => wheel.ahead_m_s.abs() < 0.5 * least_m_s,
            };
            let step_m = wheel.ahead_m_s.abs() * span_s;
            // What slid since its first motion looks light, and as if it rubbed.
            let pressed_n = rim_share * load * mean_n(dynamics.mass_kg.max(self.told_kg));
            let given = (force_n + rubs_n).abs() / pressed_n;
            self.felt = self.felt.max(given);
            if wheel.slips {
                wheel.since_ns += span_ns;
                wheel.way_m += step_m;
                if wheel.ahead_m_s.abs() > least_m_s {
                    let pressed_n = rim_share * load * mean_n(dynamics.mass_kg);
                    self.floor = Some(Floor::seen(self.floor, force_n.abs() / pressed_n, span_s));
                }
                is_over |= wheel.since_ns > LONGEST_NS;
            } else if let Some(slide) = wheel.slide {
                wheel.way_m += slide.step_m;
                self.floor = Some(Floor::seen(self.floor, given, span_s));
            } else if is_ahead {
                wheel.way_m += step_m;
            } else if wheel.way_m != 0.0 {
                wheel.way_m *= self.forgotten.kept(span_s);
            }
            wheel.doubted_ns = if is_doubted { wheel.doubted_ns + span_ns } else { 0 };
            if wheel.doubted_ns >= LASTING_NS {
                wheel.slips = !wheel.slips;
                (wheel.doubted_ns, wheel.since_ns) = (0, 0);
                if let Some(slides) = missing.filter(|_| wheel.slips) {
                    wheel.way_m = wheel.way_m.max(slides.step_m(row));
                    is_counted = true;
                }
            }
            wheel.doubt(span_s, &mut self.forgotten);
        }
        if is_counted {
            self.steady.count();
        }
        if is_over {
            self.forget();
        }
    }

    fn report(&self) -> GripReport {
        let (mut slip_m_s, mut slipped_m) = ([0.0; MAX_WHEELS], [0.0; MAX_WHEELS]);
        for (at, wheel) in self.wheels.iter().enumerate() {
            slip_m_s[at] = wheel.slide.map_or(wheel.ahead_m_s, |slide| slide.ahead_m_s);
            slipped_m[at] = if wheel.is_loose() { wheel.way_m } else { 0.0 };
        }
        GripReport {
            dynamics: self.identification.dynamics(),
            mass_sigma_kg: self.identification.mass_sigma_kg(),
            slope_m_s2: self.identification.slope_m_s2(),
            slip_m_s,
            slipped_m,
            felt: self.felt,
            friction: self.floor.map(|floor| floor.coefficient),
            friction_sigma: self.floor.map(|floor| floor.variance.sqrt()),
        }
    }
}
