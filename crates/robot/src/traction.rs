//! What the floor carries: how hard the platform may speed up and brake, and how hard its wheels may push.
//!
//! A wheel grips while its force on the floor stays below μ·N (C.-A. de Coulomb); its rim feels the part of it that lies along
//! it. N is its part of the weight, shifted by the platform's acceleration as the centre of mass stands above the floor. With a
//! friction μ that is counted on (`reliance.rs`) two things follow:
//! - the greatest part of the file's accelerations, of way and turn alike, at which every wheel still grips, in whatever
//!   direction, and overcomes the rollers of the others: the setpoint keeps to it under every law, stops too, so that fence
//!   and obstacles count with it;
//! - the most torque of each wheel: commands by torque are scaled as a whole, so that the direction of force is kept.
//!
//! With more than three wheels the same force on the body can be shared in many ways. The least torques are asked for first; where a wheel
//! can't give its part, the wheels that bear more take it over (`sharing.rs`).
//!
//! Where the file says nothing of the floor nothing is counted on or held back, but for wheels that spin while the robot stops.
//!
//! On a slope wheels push the platform and hold it: what they need for an acceleration a on a slope that pulls it with g is what they
//! need for a − g on a level floor, loads included. So much less is left for motions and stops, whichever way the platform is turned.

mod footing;
mod reliance;
mod sharing;
mod warmth;

use omnibase_platform::{MAX_WHEELS, length};

use crate::config::{GripPlan, Limits, RobotPlan};
use crate::grip::{FirstEstimates, GRAVITY_M_S2};
use crate::motion::{Asked, Carried};
use crate::signals::{
    Commands, CycleTime, GripReport, Measurements, PlatformState, Quantity, Setpoint, TractionReport,
};
pub(crate) use footing::Footing;
use footing::LEAST_LOAD;
use footing::Push;
use reliance::Reliance;
use sharing::Rims;
pub(crate) use warmth::HEAT_WINDOW_S;
use warmth::Warmth;

/// The part of a friction counted on that accelerations are planned with; the rest is the control law's: its corrections, and
/// what rubs.
const PLANNED: f64 = 0.8;
/// The part of it that a plan that is slowed down or caught up with may take; what is planned with exactly is no more for rounding.
const TAKEN: f64 = 0.9;
const ROUNDING: f64 = 1.01;
/// A mass is known to be more than was told once so many standard deviations say so.
const MASS_SIGMAS: f64 = 3.0;
/// A wheel whose rim is further ahead spins, m/s: that is no doubt of an estimate.
const SPINS_M_S: f64 = 0.2;
/// After torques were held back, or a wheel slipped, the platform counts as behind for so long, s: what waits for it must not swing
/// with it.
const BEHIND_S: f64 = 0.1;
/// Less than this part of its acceleration is asked of no robot: it would never stand.
const LEAST_SHARE: f64 = 0.05;
/// What is carried of the accelerations falls at once and rises by so much in a second: estimates of a platform's mass and centre
/// wander by a tenth from cycle to cycle, and what they hold back would swing with them.
const RISES_1_S: f64 = 0.5;
/// A wheel that the platform leans away from is held back as if it bore this part of the mean load at least.
const LEANING_LOAD: f64 = 0.1;
/// What a level floor carries of which nothing is told, m/s², where the file's accelerations aren't more: that of hard polyurethane, a
/// friction of 0.20 (`omnibase_robot_sim::floor` has the source), in the weakest direction of three wheels.
const CARRIED_M_S2: f64 = 1.5;
/// A wheel that slips gets this part of what it could push: its rim comes back to the platform's speed.
const SLIPPING: f64 = 0.5;

/// The stage.
#[derive(Clone, Debug)]
pub(crate) struct Traction {
    footing: Footing,
    rims: Rims,
    /// What the robot's file says of floor and mass.
    told: Option<f64>,
    told_kg: f64,
    limits: Limits,
    reliance: Reliance,
    warmth: Warmth,
    /// For how long the platform still counts as behind, s.
    behind_s: f64,
    report: TractionReport,
    /// How fast the rims of wheels that slip are ahead, m/s.
    slips_m_s: [f64; MAX_WHEELS],
}

impl Traction {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        Traction {
            footing: Footing::new(&plan.kinematics, plan.grip.height_m),
            rims: Rims::new(&plan.kinematics),
            told: plan.grip.friction,
            told_kg: FirstEstimates::of(&plan.controller).mass.0,
            limits: plan.limits,
            reliance: Reliance::new(&plan.grip),
            warmth: Warmth::new(&plan.drives),
            behind_s: 0.0,
            report: TractionReport::default(),
            slips_m_s: [0.0; MAX_WHEELS],
        }
    }

    /// What the floor carries from now on.
    pub(crate) fn look(
        &mut self,
        time: &CycleTime,
        grip: &GripReport,
        state: &PlatformState,
    ) -> TractionReport {
        let way_m = state.twist_in_body.speed_m_s() * time.period_s();
        self.reliance.look(grip, way_m);
        let slips = grip.slip_m_s.iter().zip(grip.slipped_m);
        for (slips_m_s, (ahead_m_s, way_m)) in self.slips_m_s.iter_mut().zip(slips) {
            *slips_m_s = if way_m > 0.0 { *ahead_m_s } else { 0.0 };
        }
        let friction = self.reliance.friction();
        let is_behind = friction.is_some() && (self.report.is_capped() || grip.slips());
        self.behind_s = if is_behind { BEHIND_S } else { (self.behind_s - time.period_s()).max(0.0) };
        let rises = self.report.share + RISES_1_S * time.period_s();
        let share = match friction {
            Some(friction) => self.share(PLANNED * friction, grip),
            // On a level floor the file's accelerations are carried, whatever they are.
            None => {
                let most_m_s2 = self.limits.acceleration_m_s2;
                ((most_m_s2.max(CARRIED_M_S2) - pull_m_s2(grip)) / most_m_s2).min(1.0)
            }
        };
        let share = share.max(LEAST_SHARE).min(rises);
        self.report = TractionReport { friction, share, factor: 1.0 };
        self.report
    }

    /// What the motors' torques warmed in a cycle.
    pub(crate) fn warm(&mut self, time: &CycleTime, measurements: &Measurements) {
        self.warmth.take(time, measurements);
    }

    /// What a motion that is followed has to keep to, after a setpoint that it led to.
    pub(crate) fn carried(&self, setpoint: &Setpoint, grip: &GripReport) -> Carried {
        Carried {
            share: self.report.share,
            friction: self.report.friction.map(|friction| PLANNED * friction),
            slope: self.footing.slope_friction(&grip.dynamics, pull_m_s2(grip)),
            mass_kg: grip.dynamics.mass_kg - MASS_SIGMAS * grip.mass_sigma_kg,
            asked: self.report.friction.map_or(Asked::AsPlanned, |friction| {
                let needs = self.footing.needs(setpoint, &grip.dynamics, grip.slope_m_s2);
                let is_given = |part: f64| {
                    setpoint.is_finite()
                        && needs.friction <= part * friction
                        && needs.torque_nm <= self.limits.wheel_torque_nm
                };
                match (is_given(ROUNDING * PLANNED), is_given(TAKEN)) {
                    (true, _) => Asked::AsPlanned,
                    (false, true) => Asked::More,
                    (false, false) => Asked::TooMuch,
                }
            }),
            warmth: self.warmth.most(),
            is_behind: self.behind_s > 0.0,
        }
    }

    /// The friction that motions are planned with before the robot moves.
    pub(crate) fn planned_friction(plan: &GripPlan) -> Option<f64> {
        Reliance::new(plan).friction().map(|friction| PLANNED * friction)
    }

    /// What was counted on in this cycle.
    pub(crate) fn report(&self) -> TractionReport {
        self.report
    }

    /// The platform's limits by its file.
    pub(crate) fn told_limits(&self) -> Limits {
        self.limits
    }

    /// The platform's limits as far as the floor carries them.
    pub(crate) fn limits(&self) -> Limits {
        let (limits, share) = (self.limits, self.report.share);
        Limits {
            acceleration_m_s2: share * limits.acceleration_m_s2,
            turn_acceleration_rad_s2: share * limits.turn_acceleration_rad_s2,
            ..limits
        }
    }

    /// The greatest part of the limits' accelerations at which no wheel needs more friction than this.
    fn share(&self, friction: f64, grip: &GripReport) -> f64 {
        let Limits { acceleration_m_s2, turn_acceleration_rad_s2, .. } = self.limits;
        let of_wheel = |wheel: usize| {
            let Push { force, lighter, left_n, .. } = self.footing.push(wheel, friction, &grip.dynamics);
            let worst = |sign: f64| length([sign * force[0] + lighter[0], sign * force[1] + lighter[1]]);
            let worst_kg = worst(1.0).max(worst(-1.0));
            let needed_n = acceleration_m_s2 * worst_kg + turn_acceleration_rad_s2 * force[2].abs();
            // What holds the platform on a slope is pushed like what speeds it up, and leans it as far.
            (left_n - pull_m_s2(grip) * worst_kg) / needed_n
        };
        let share = (0..self.footing.wheels).map(of_wheel).fold(1.0, f64::min);
        // Before anything is known of a mass there is nothing to bound.
        if share.is_nan() { 1.0 } else { share }
    }

    /// Torques that the floor carries: all scaled alike where a wheel would slip. Where nothing is counted on each wheel that spins is
    /// caught by itself, and only once the platform `stops`: as long as it goes on its way tells that it has to.
    pub(crate) fn cap(
        &mut self,
        wished: Commands,
        setpoint: &Setpoint,
        grip: &GripReport,
        stops: bool,
    ) -> Commands {
        // A slope or a push makes a platform look light, and its wheels slip: a stop that believes that doesn't brake. What the file
        // tells counts there, where it is more.
        let counted =
            self.report.friction.map(|friction| if stops { self.told.unwrap_or(friction) } else { friction });
        let found = grip.friction.filter(|_| stops);
        let Some(friction) = counted.or(found).filter(|_| wished.quantity == Quantity::Torque) else {
            return wished;
        };
        let acceleration = setpoint.acceleration_in_odom.rotated(-setpoint.odom_from_body.heading_rad);
        // A push looks like a slope: a stop isn't held back by how far one would lean it.
        let [pull_x, pull_y] = if stops { [0.0; 2] } else { grip.slope_m_s2 };
        let footing = &self.footing;
        let leans_m = footing.height_m / GRAVITY_M_S2;
        let centre_m = grip.dynamics.centre_m();
        // How far inertia and slope shift where the weight presses.
        let leans = [-leans_m * (acceleration.vx_m_s - pull_x), -leans_m * (acceleration.vy_m_s - pull_y)];
        let told_n = if stops { footing.mean_n(self.told_kg) } else { 0.0 };
        let (mean_n, [spin_n, _]) =
            (footing.mean_n(grip.dynamics.mass_kg).max(told_n), grip.dynamics.friction_n);
        let mut values = wished.values;
        let mut most = [0.0; MAX_WHEELS];
        for (wheel, (value, most_nm)) in values.iter().zip(&mut most).enumerate().take(footing.wheels) {
            // What holds a spinning rim back ends its slip.
            let spins = self.slips_m_s[wheel] * *value > 0.0;
            let part = if spins { SLIPPING } else { 1.0 };
            // What the wheel's own bearing takes never reaches the floor.
            let given_n = part * footing.rim_share[wheel] * friction * mean_n;
            let [by_x, by_y] = footing.loads.shift(wheel);
            let rests = footing.loads.of(wheel, centre_m).max(LEAST_LOAD);
            let load = (rests + by_x * leans[0] + by_y * leans[1]).max(LEANING_LOAD);
            *most_nm = footing.radius_m[wheel] * load * (given_n + spin_n);
        }
        if counted.is_some() {
            sharing::share(&mut values[..footing.wheels], &most[..footing.wheels], &self.rims);
        }
        let mut factor = 1.0_f64;
        for (wheel, value) in values.iter_mut().enumerate().take(footing.wheels) {
            let (spins, most_nm) = (self.slips_m_s[wheel] * *value > 0.0, most[wheel]);
            match (value.abs() > most_nm, counted) {
                (true, Some(_)) => factor = factor.min(most_nm / value.abs()),
                // What the floor gives it doesn't depend on its torque: nothing turns the platform.
                (true, None) if spins && self.slips_m_s[wheel].abs() > SPINS_M_S => {
                    *value = most_nm.copysign(*value)
                }
                _ => {}
            }
        }
        self.report.factor = factor;
        Commands {
            values: values.map(|value| factor * value),
            saturation: factor * wished.saturation,
            ..wished
        }
    }
}

/// How hard a slope may pull whichever way the platform is turned, m/s²: of what is no number, harder than any.
fn pull_m_s2(grip: &GripReport) -> f64 {
    let pull_m_s2 = length(grip.slope_m_s2);
    if pull_m_s2.is_nan() { f64::INFINITY } else { pull_m_s2 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Registry;
    use crate::signals::Dynamics;
    use omnibase_platform::Twist2;

    const BMM: &str = include_str!("../../../robots/bmm.toml");
    const TOLD: &str = "\n[grip]\nfriction = 0.5\ncentre_of_mass_height_m = 0.25\n";
    const TIME: CycleTime = CycleTime { index: 0, now_ns: 0, period_ns: 1_000_000 };

    /// The BMM with another acceleration, m/s², on a floor of which this is told.
    fn bmm(acceleration_m_s2: f64, told: &str) -> Traction {
        let text =
            BMM.replace("\nacceleration_m_s2 = 1.5", &format!("\nacceleration_m_s2 = {acceleration_m_s2:?}"));
        let no_files = |_: &str| Err(String::new());
        let plan = RobotPlan::from_toml(&format!("{text}{told}"), &Registry::with_built_in(), &no_files);
        Traction::new(&plan.unwrap_or_else(|problems| panic!("{problems:?}")))
    }

    /// What is felt on a slope that pulls so, m/s².
    fn on(slope_m_s2: [f64; 2]) -> GripReport {
        let dynamics = Dynamics { mass_kg: 70.0, inertia_kg_m2: 7.0, ..Dynamics::default() };
        GripReport { dynamics, slope_m_s2, ..GripReport::default() }
    }

    fn accelerating(x_m_s2: f64, y_m_s2: f64) -> Setpoint {
        Setpoint { acceleration_in_odom: Twist2::new(x_m_s2, y_m_s2, 0.0), ..Setpoint::default() }
    }

    fn share(traction: &mut Traction, slope_m_s2: [f64; 2]) -> f64 {
        traction.look(&TIME, &on(slope_m_s2), &PlatformState::default()).share
    }

    #[test]
    fn a_slope_leaves_less_of_the_accelerations_that_a_level_floor_carries() {
        assert_eq!(share(&mut bmm(1.5, ""), [0.0; 2]), 1.0);
        let steep = [0.36, -0.48];
        let mut shipped = bmm(1.5, "");
        assert!((share(&mut shipped, steep) - (1.5 - 0.6) / 1.5).abs() < 1e-12);
        // So do stops.
        assert!((shipped.limits().acceleration_m_s2 - 0.9).abs() < 1e-12);
        // Who asks for little of the floor is held back by nothing, and who asks for more had it on a level floor.
        assert_eq!(share(&mut bmm(0.4, ""), steep), 1.0);
        assert!((share(&mut bmm(3.0, ""), steep) - 0.8).abs() < 1e-12);
        for (steeper, told) in [[9.0, 0.0], [f64::NAN, 0.0]]
            .into_iter()
            .flat_map(|steeper| ["", TOLD].map(|told| (steeper, told)))
        {
            assert_eq!(share(&mut bmm(1.5, told), steeper), LEAST_SHARE, "{told}");
        }
        // It comes back slowly.
        let after = share(&mut shipped, [0.0; 2]);
        assert!((after - 0.6 - 1e-3 * RISES_1_S).abs() < 1e-12, "{after}");
    }

    #[test]
    fn on_a_floor_that_is_told_every_wheel_grips_on_a_slope_whichever_way_it_drives() {
        let mut traction = bmm(6.0, TOLD);
        let level = share(&mut traction, [0.0; 2]);
        let carried = share(&mut traction, [0.6, 0.0]);
        assert!(carried < level, "{carried}, {level}");
        let takes = traction.footing.slope_friction(&on([0.0; 2]).dynamics, 0.6);
        let mut worst = [0.0_f64; 2];
        for (way, slope) in (0..24).flat_map(|way| (0..24).map(move |slope| (way, slope))) {
            let angle = |step: i32| f64::from(step) * std::f64::consts::TAU / 24.0;
            let (pull_y, pull_x) = angle(slope).sin_cos();
            let grip = on([0.6 * pull_x, 0.6 * pull_y]);
            let held = traction.footing.needs(&accelerating(0.0, 0.0), &grip.dynamics, grip.slope_m_s2);
            assert!((0.5 * takes..=takes).contains(&held.friction), "{held:?}, {takes}");
            for (worst, share) in worst.iter_mut().zip([carried, level]) {
                let (y, x) = angle(way).sin_cos();
                let setpoint = accelerating(6.0 * share * x, 6.0 * share * y);
                let needs = traction.footing.needs(&setpoint, &grip.dynamics, grip.slope_m_s2);
                *worst = worst.max(needs.friction);
            }
        }
        let [carried, level] = worst;
        assert!(carried <= 0.8 * 0.5 && level > 0.8 * 0.5, "{carried}, {level}");
    }

    #[test]
    fn who_is_held_on_a_slope_pushes_and_leans_as_who_speeds_up_against_it() {
        let told = "\n[grip]\nfriction = 0.2\ncentre_of_mass_height_m = 0.4\n";
        let mut traction = bmm(1.5, told);
        let mut asked = |[x, y]: [f64; 2], slope_m_s2: [f64; 2], stops: bool| {
            let (setpoint, grip) = (accelerating(x, y), on(slope_m_s2));
            traction.look(&TIME, &grip, &PlatformState::default());
            let needs = traction.footing.needs(&setpoint, &grip.dynamics, slope_m_s2);
            let mut wished = Commands { quantity: Quantity::Torque, ..Commands::default() };
            wished.values[..3].copy_from_slice(&[1.0, -9.0, 8.0]);
            (needs, traction.cap(wished, &setpoint, &grip, stops).values)
        };
        let speeds_up = asked([1.2, 0.4], [0.0; 2], false);
        let held = asked([0.0; 2], [-1.2, -0.4], false);
        let level = asked([0.0; 2], [0.0; 2], false);
        assert_eq!(speeds_up, held);
        assert_ne!(held.1, level.1);
        assert_eq!(level.0.friction, 0.0);
        // A push looks like a slope: a stop isn't held back by how far one would lean it.
        let [pushed, alone] = [[-1.2, -0.4], [0.0; 2]].map(|slope_m_s2| asked([0.0; 2], slope_m_s2, true).1);
        assert_eq!(pushed, alone);
    }

    #[test]
    fn torques_are_held_to_what_the_floor_gives_in_one_direction_and_who_slips_gets_half() {
        let mut traction = bmm(1.5, TOLD);
        let (at_rest, grip) = (accelerating(0.0, 0.0), on([0.0; 2]));
        let mut capped = |wished: [f64; 3], slips_m_s: f64| {
            let slips =
                GripReport { slip_m_s: [slips_m_s; MAX_WHEELS], slipped_m: [0.1; MAX_WHEELS], ..grip };
            traction.look(&TIME, if slips_m_s == 0.0 { &grip } else { &slips }, &PlatformState::default());
            let mut commands = Commands { quantity: Quantity::Torque, ..Commands::default() };
            commands.values[..3].copy_from_slice(&wished);
            let capped = traction.cap(commands, &at_rest, &grip, false);
            [capped.values[0], capped.values[1], capped.values[2]]
        };
        let little = [1.0, -2.0, 1.5];
        assert_eq!(capped(little, 0.0), little);
        // A wheel bears a third of 70 kg, of which the floor gives half, at 0.1 m.
        let [a, b, c] = capped([30.0, -60.0, 45.0], 0.0);
        assert!((a / b + 0.5).abs() < 1e-12 && (c / b + 0.75).abs() < 1e-12, "{a} {b} {c}");
        assert!((5.0..20.0).contains(&b.abs()), "{b}");
        // Slipping forwards half of it; what brakes the slip stays.
        let [spins, ..] = capped([60.0, 0.0, 0.0], 0.5);
        let [brakes, ..] = capped([60.0, 0.0, 0.0], -0.5);
        assert!((spins / brakes - SLIPPING).abs() < 1e-12, "{spins} {brakes}");
    }
}
