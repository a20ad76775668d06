//! Robots of every kind on every floor, by the thousand: what must happen to none of them.
//!
//! A seed draws robot and law, payload and first estimate of the mass, treads and what is told of them, the floor, the cycle
//! and the drives' lag, wheels by the file's tolerances, motors that give less than they promise, and two short ways.

use omnibase_platform::GeometrySigmas;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::signals::{MAX_WHEELS, SafetyReason};
use omnibase_robot::torque_loop::{Margins, Plant};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_robot_sim::{Grip, MachineParameters, Tread, WheelState};

use crate::approaches::Random;
use crate::grip::Swing;
use crate::laws::is_of_torque;
use crate::slip::{Spin, quicker};
use crate::{Run, Trial, builds, plan_of, robots};

/// A torque that swings for longer is a limit cycle, s.
pub const RINGS_S: f64 = 0.1;
/// A wheel that spins is to be caught in this time, s.
pub const SPINS_S: f64 = 0.05;
/// What a wheel truly slipped lately and isn't called slip, m: treads creep, and give way.
const CREEPS_M: f64 = 2e-3;
/// In this time what slipped is forgotten, s.
const LATELY_S: f64 = 1.0;
/// Nor what wasn't sliding, at the friction's limit and so fast, m/s, so long ago, s: a slide may be told in its first millimetre.
const SLIDES_M_S: f64 = 0.02;
const JUST_S: f64 = 0.05;
/// A wheel that was at the friction's limit for more than this part of what counts as just now slid, however slowly.
const SLID: f64 = 0.5;
/// A motor that gives less of what it promises is weak.
const WEAK: f64 = 0.9;
/// Farther off than this and than three standard deviations, without a stop, is lost unnoticed, m.
const LOST_M: f64 = 0.05;

/// A robot, its floor and its way, as a seed drew them.
#[derive(Clone, Debug, PartialEq)]
pub struct Seeded {
    /// The seed.
    pub seed: u64,
    /// The robot's name.
    pub robot: &'static str,
    /// The control law.
    pub law: &'static str,
    /// The treads.
    pub tread: Tread,
    /// Whether the law is told of them, within half as much again.
    pub is_tread_told: bool,
    /// Static friction of the floor; it slides with nine tenths of it.
    pub friction: f64,
    /// Whether the robot is told nine tenths of that.
    pub is_friction_told: bool,
    /// Payload, kg.
    pub payload_kg: f64,
    /// First estimate of mass and inertia over the truth.
    pub estimate: f64,
    /// How much faster than the robot's file it may drive.
    pub faster: f64,
    /// Period of the cycle, us: the delay is two of them ...
    pub cycle_us: u64,
    /// ... and this, of the current loop, us.
    pub lag_us: f64,
    /// What each motor gives over what its current promises.
    pub torque_ratios: Vec<f64>,
    /// What the encoders count in a turn of a wheel, where it isn't what the robot's file says.
    pub counts: Option<u32>,
    /// Its file.
    text: String,
}

/// What it came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Errors of the way.
    pub run: Run,
    /// The longest that a torque swung, s.
    pub rang_s: f64,
    /// The longest that a wheel spun, s.
    pub spun_s: f64,
    /// Slip was told where no wheel had slipped.
    pub is_slip_false: bool,
    /// Where it was: whether the wheel was at the friction's limit all the same.
    pub slid_slowly: bool,
    /// Whether a motor gives less than nine tenths of what it promises.
    pub has_weak_motor: bool,
    /// Why it stopped, where it did.
    pub stopped: SafetyReason,
    /// How far truth and belief were apart at the end, m.
    pub off_m: f64,
    /// How far they may be, m: three standard deviations.
    pub sure_m: f64,
    /// What the law's loops leave on these treads, where it is one of torque: the worst over its axes, of every tenth seed.
    pub margins: Option<Margins>,
}

/// What is wrong with an outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// A torque swung for longer than [`RINGS_S`].
    LimitCycle,
    /// A wheel spun for longer than [`SPINS_S`].
    SpinAway,
    /// Slip was told where nothing slipped.
    FalseSlip,
    /// Slip was told of a wheel that slid by less than counts as a slip.
    SlowSlide,
    /// Slip was told where nothing slipped, of a robot with a weak motor: whose torque isn't what its drive says.
    WeakMotorSlip,
    /// A wheel was named as wired backwards, swapped, or counting the wrong way: all are as the file says.
    Misnamed,
    /// It stopped and didn't say why.
    Unnamed,
    /// It came to its end and isn't where it believes to be.
    Lost,
    /// It stopped by a name, farther from where it believes to be than it says that it may be.
    Unsure,
}

impl Wrong {
    /// All of them.
    pub const ALL: [Wrong; 9] = [
        Wrong::LimitCycle,
        Wrong::SpinAway,
        Wrong::FalseSlip,
        Wrong::SlowSlide,
        Wrong::WeakMotorSlip,
        Wrong::Misnamed,
        Wrong::Unnamed,
        Wrong::Lost,
        Wrong::Unsure,
    ];

    /// For a table.
    pub fn text(self) -> &'static str {
        match self {
            Wrong::LimitCycle => "limit cycle beyond 100 ms",
            Wrong::SpinAway => "wheel that spun for more than 50 ms",
            Wrong::FalseSlip => "slip told where nothing slipped",
            Wrong::SlowSlide => "slip told of a wheel that slid slower than 20 mm/s",
            Wrong::WeakMotorSlip => "slip told where nothing slipped, a motor weaker than it says",
            Wrong::Misnamed => "wheel named as wired wrongly",
            Wrong::Unnamed => "stop without a name",
            Wrong::Lost => "at the end, and not where it believes to be",
            Wrong::Unsure => "stopped by a name, and not where it believes to be",
        }
    }
}

impl Outcome {
    /// How it ended.
    pub fn end(&self) -> &'static str {
        match self.stopped {
            SafetyReason::None if self.run.finished => "finished",
            reason => reason.text(),
        }
    }

    /// In one line.
    pub fn row(&self) -> String {
        let margins = self.margins.map_or(String::new(), |margins| {
            format!(", {:.1} dB and {:.0}° left", margins.gain_db, margins.phase_deg)
        });
        format!(
            "swung {:.3} s, spun {:.3} s, {:.1} mm off (3σ {:.1} mm){margins}, {}",
            self.rang_s,
            self.spun_s,
            1e3 * self.off_m,
            1e3 * self.sure_m,
            self.end()
        )
    }

    /// Whether that is wrong with it.
    pub fn is(&self, wrong: Wrong) -> bool {
        let is_named = self.stopped != SafetyReason::None;
        match wrong {
            Wrong::LimitCycle => self.rang_s > RINGS_S,
            Wrong::SpinAway => self.spun_s > SPINS_S,
            Wrong::FalseSlip => self.is_slip_false && !self.has_weak_motor && !self.slid_slowly,
            Wrong::SlowSlide => self.is_slip_false && !self.has_weak_motor && self.slid_slowly,
            Wrong::WeakMotorSlip => self.is_slip_false && self.has_weak_motor,
            Wrong::Misnamed => {
                matches!(self.stopped, SafetyReason::Wiring | SafetyReason::EncoderDirection)
            }
            Wrong::Unnamed => !self.run.finished && !is_named,
            Wrong::Lost => !is_named && self.off_m > LOST_M.max(self.sure_m),
            Wrong::Unsure => is_named && self.off_m > LOST_M.max(self.sure_m),
        }
    }
}

impl Seeded {
    /// The robot of a seed, by torque or by speed.
    pub fn new(seed: u64) -> Seeded {
        Seeded::by(seed, "adaptive_torque")
    }

    /// The same with another law of torque.
    pub fn by(seed: u64, law_of_torque: &'static str) -> Seeded {
        let mut random = Random::new(seed ^ 0x5EED_ED00_0000_0000);
        let mut chance = |share: f64| random.between(0.0, 1.0) < share;
        let (robot, file) = if chance(0.75) { ("bmm", robots::BMM) } else { ("mecanum", robots::MECANUM) };
        let law = if chance(0.6) { law_of_torque } else { "closed_loop_speed" };
        let (is_tread_told, is_friction_told) = (chance(0.3), chance(0.3));
        let (is_weighed, is_weak) = (chance(0.5), chance(0.2));
        let cycle_us = if chance(0.75) { 1000 } else { 500 };
        let tread = Tread { stiffness_n_m: random.spread(1e5, 4e6), damping_ratio: random.spread(0.1, 1.0) };
        let friction = random.between(0.08, 0.7);
        let (payload_kg, estimate) = (random.between(0.0, 200.0), random.between(0.5, 1.5));
        let (faster, lag_us) = (random.between(1.0, 2.0), random.between(0.0, 500.0));
        let wheels = file.matches("[[drive]]").count();
        let weakest = random.below(wheels as u64) as usize;
        let mut torque_ratios: Vec<f64> = (0..wheels).map(|_| random.between(0.95, 1.05)).collect();
        if is_weak {
            torque_ratios[weakest] = random.between(0.3, 0.95);
        }
        let text = robots::with_payload(&quicker(file, faster), law, estimate, payload_kg);
        let mut seeded = Seeded {
            seed,
            robot,
            law,
            tread,
            is_tread_told,
            friction,
            is_friction_told,
            payload_kg,
            estimate,
            faster,
            cycle_us,
            lag_us,
            torque_ratios,
            counts: None,
            text,
        };
        seeded.text = seeded.complete(file, is_weighed, &mut random);
        seeded
    }

    /// Its file: what else is simulated, what the robot is told, and where it is to go.
    fn complete(&self, file: &str, is_weighed: bool, random: &mut Random) -> String {
        let Tread { stiffness_n_m, damping_ratio } = self.tread;
        let machine = omnibase_run::simulated::description(&plan_of(file)).machine;
        let mut told = String::new();
        if self.is_tread_told && is_of_torque(self.law) {
            let stiffness = [(stiffness_n_m / 1.5).max(1e4), stiffness_n_m * 1.5];
            told += &format!(
                "tread_stiffness_n_m = {stiffness:?}\ntread_damping_ratio = {:?}\n",
                0.9 * damping_ratio
            );
        }
        if is_weighed {
            let body = &machine.body;
            let around = |least: f64, more: f64| {
                let first = self.estimate * (least + more * self.payload_kg / 200.0);
                [(0.95 * least).min(0.95 * first), (least + more).max(1.05 * first)]
            };
            told += &format!(
                "mass_bounds_kg = {:?}\ninertia_bounds_kg_m2 = {:?}\n",
                around(body.mass_kg, 200.0),
                around(body.yaw_inertia_kg_m2, 8.6)
            );
        }
        let text = self.text.replace("[controller]\n", &format!("[controller]\n{told}"));
        let text = text.replace("cycle_us = 1000", &format!("cycle_us = {}", self.cycle_us));
        let mut text = format!(
            "{text}tread_stiffness_n_m = {stiffness_n_m:?}\ntread_damping_ratio = {damping_ratio:?}\n\
             static_friction = {:?}\nsliding_friction = {:?}\n",
            self.friction,
            0.9 * self.friction
        );
        if self.is_friction_told {
            text +=
                &format!("\n[grip]\nfriction = {:?}\ncentre_of_mass_height_m = 0.6\n", 0.9 * self.friction);
        }
        // Quintics from rest to rest: 1.875, 5.774 and 60 times the way over time, its square and its cube.
        let least_n: f64 = machine
            .wheels
            .iter()
            .map(|drive| drive.motor.peak_torque_n_m * drive.motor.gear_ratio.abs() / drive.wheel.radius_m)
            .sum();
        let strong_m_s2 = 0.5 * least_n / (machine.body.mass_kg + self.payload_kg);
        let (mut time_s, mut place) = (0.0_f64, [0.0; 3]);
        let mut points = vec!["[0, 0, 0, 0]".to_owned()];
        for _ in 0..2 {
            let share = random.between(0.3, 0.8);
            let (way_m, direction) = (random.between(0.05, 0.6), random.between(-3.15, 3.15));
            let turn_rad = random.between(-0.6, 0.6);
            let faster = self.faster;
            let least_s = |way: f64, [speed, acceleration, jerk]: [f64; 3]| {
                let by_acceleration = (5.774 * way / (share * acceleration)).sqrt();
                (1.875 * way / (share * speed)).max(by_acceleration).max((60.0 * way / (share * jerk)).cbrt())
            };
            // Of the motors no more than seven tenths is asked for.
            let along = (1.5 * faster * faster).min(0.7 * strong_m_s2);
            let along_s = least_s(way_m, [faster, along, 40.0]);
            let turn_s = least_s(turn_rad.abs(), [1.5 * faster, 2.0 * along, 80.0]);
            time_s += along_s.max(turn_s).max(0.3);
            place[0] += way_m * f64::cos(direction);
            place[1] += way_m * f64::sin(direction);
            place[2] += turn_rad;
            points.push(format!("[{time_s:?}, {:?}, {:?}, {:?}]", place[0], place[1], place[2]));
        }
        format!(
            "{text}\n[reference]\nkind = \"path\"\ntiming = \"stretched\"\npoints = [{}]\n",
            points.join(", ")
        )
    }

    /// The same with encoders of 15,000 to 1,000,000 counts a turn of a wheel.
    ///
    /// # Panics
    /// Where the robot's file says no longer what it replaces.
    pub fn with_coarse_encoders(mut self) -> Seeded {
        let counts = Random::new(self.seed ^ 0xC0A2_5E00_0000_0000).spread(15e3, 1e6) as u32;
        let (of_file, counted) = match self.robot {
            "bmm" => ("device = \"sgdv\"", format!("device = \"sgdv\"\ncounts_per_revolution = {counts}")),
            // A gear of 10.
            _ => ("counts_per_revolution = 1_048_576", format!("counts_per_revolution = {}", counts / 10)),
        };
        assert!(self.text.contains(of_file), "the robot's file says `{of_file}`");
        self.text = self.text.replace(of_file, &counted);
        self.counts = Some(counts);
        self
    }

    /// In one line.
    pub fn row(&self) -> String {
        let counts = self.counts.map_or(String::new(), |counts| format!(", {counts} counts a turn"));
        let told = |is_told: bool| if is_told { ", told" } else { "" };
        let ratios: Vec<String> = self.torque_ratios.iter().map(|ratio| format!("{ratio:.2}")).collect();
        format!(
            "seed {} {} {}, tread {:.1e} N/m {:.2}{}, floor {:.2}{}, payload {:.0} kg, m̂ {:.0} %, {:.2} times as fast, \
             cycle {} us, lag {:.0} us{counts}, motors {}",
            self.seed,
            self.robot,
            self.law,
            self.tread.stiffness_n_m,
            self.tread.damping_ratio,
            told(self.is_tread_told),
            self.friction,
            told(self.is_friction_told),
            self.payload_kg,
            100.0 * self.estimate,
            self.faster,
            self.cycle_us,
            self.lag_us,
            ratios.join(" ")
        )
    }

    /// Its file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Drives it.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride(&self) -> Outcome {
        let plan = plan_of(&self.text);
        let geometry = covariance_settings(&plan.estimator).geometry;
        let mut margins = None;
        let mut trial = Trial::on_machine(plan.clone(), |machine| {
            self.build(machine, &geometry);
            // Designing takes as long as driving: a tenth of the robots will do.
            if self.seed.is_multiple_of(10) {
                margins = self.margins(&plan, machine);
            }
        });
        trial.enable();
        let machine = trial.machine.clone();
        let period_s = 1e-6 * self.cycle_us as f64;
        let cycles_a_ms = 1000 / self.cycle_us;
        let mut swings: Vec<Swing> =
            trial.plan.drives.iter().map(|drive| Swing::new(drive.scale.rated_torque_nm)).collect();
        let (mut rings_s, mut rang_s) = (0.0_f64, 0.0_f64);
        let mut spin = Spin::default();
        let mut ways_m = [0.0_f64; MAX_WHEELS];
        let mut grips_s = f64::INFINITY;
        let (mut slid, mut slid_slowly) = ([0.0_f64; MAX_WHEELS], true);
        let kinematics = plan.kinematics.clone();
        let (mut cycle, mut is_told, mut is_slip_false) = (0_u64, false, false);
        let mut stopped = SafetyReason::None;
        let run = Run::track(&mut trial, &mut |record| {
            cycle += 1;
            let machine = machine.lock();
            spin.see(machine.body(), &kinematics, &record.setpoint);
            for (way_m, wheel) in ways_m.iter_mut().zip(machine.body().wheels()) {
                *way_m += period_s * (wheel.slip_m_s.abs() - *way_m / LATELY_S);
            }
            for (slid, wheel) in slid.iter_mut().zip(machine.body().wheels()) {
                *slid += period_s / JUST_S * (f64::from(wheel.grip == Grip::Sliding) - *slid);
            }
            let slides =
                |wheel: &WheelState| wheel.grip == Grip::Sliding && wheel.slip_m_s.abs() > SLIDES_M_S;
            grips_s = if machine.body().wheels().iter().any(slides) { 0.0 } else { grips_s + period_s };
            if cycle.is_multiple_of(cycles_a_ms) {
                for (swing, motor) in swings.iter_mut().zip(machine.motors()) {
                    swing.see(motor.torque_n_m());
                }
                let rings = swings.iter().any(|swing| swing.crossings.is_some());
                rings_s = if rings { rings_s + 1e-3 } else { 0.0 };
                rang_s = rang_s.max(rings_s);
            }
            if record.grip.slips() && !is_told {
                let is_false = grips_s > JUST_S && ways_m.iter().all(|way_m| *way_m < CREEPS_M);
                let told = record.grip.slipped_m.iter().zip(slid).filter(|(way_m, _)| **way_m > 0.0);
                slid_slowly &= !is_false || told.into_iter().all(|(_, slid)| slid > SLID);
                is_slip_false |= is_false;
            }
            is_told = record.grip.slips();
            if stopped == SafetyReason::None {
                stopped = record.stop_reason;
            }
        });
        if stopped == SafetyReason::None {
            stopped = trial.robot.record().stop_reason;
        }
        let state = trial.robot.record().state;
        let [xx, _, _, yy, _, _] = state.covariance;
        Outcome {
            run,
            rang_s,
            spun_s: spin.longest as f64 * period_s,
            is_slip_false,
            slid_slowly: is_slip_false && slid_slowly,
            has_weak_motor: self.torque_ratios.iter().any(|ratio| *ratio < WEAK),
            stopped,
            off_m: state.odom_from_body.distance_m(trial.measured_pose()),
            sure_m: 3.0 * (xx + yy).sqrt(),
            margins,
        }
    }

    /// Its machine isn't quite what its file says.
    pub(crate) fn build(&self, machine: &mut MachineParameters, geometry: &GeometrySigmas) {
        let mut random = Random::new(self.seed ^ 0xB111_D000_0000_0000);
        for (drive, ratio) in machine.wheels.iter_mut().zip(&self.torque_ratios) {
            builds::build(&mut drive.wheel, geometry, &mut random);
            drive.motor.torque_ratio = *ratio;
            drive.motor.current_loop_s = 1e-6 * self.lag_us;
        }
    }

    /// What the law's loops leave on this machine.
    fn margins(&self, plan: &RobotPlan, machine: &MachineParameters) -> Option<Margins> {
        let laws = Registry::with_built_in().make_controllers(plan).ok()?;
        let design = laws.first()?.design()?;
        let wheel_kg = machine.wheels.iter().map(|drive| {
            let gear = drive.motor.gear_ratio;
            let inertia = drive.wheel.inertia_kg_m2 + gear * gear * drive.motor.rotor_inertia_kg_m2;
            inertia / drive.wheel.radius_m.powi(2)
        });
        let wheel_kg = wheel_kg.fold(f64::INFINITY, f64::min);
        let bodies = [
            machine.body.mass_kg + machine.payload.mass_kg,
            machine.body.yaw_inertia_kg_m2 + machine.payload.yaw_inertia_kg_m2,
        ];
        let axes = [(0, bodies[0]), (2, bodies[1])];
        let mut worst = Margins::ALL;
        for (axis, body) in axes {
            let mut closed = design.loops[axis].clone();
            (closed.wheel_kg, closed.lag_s) = (wheel_kg, 1e-6 * self.lag_us);
            for shares in closed.directions() {
                let Tread { stiffness_n_m, damping_ratio } = self.tread;
                let plant = Plant { shares: *shares, body, stiffness_n_m, damping_ratio };
                worst = worst.worse(closed.margins(&design.gains[axis], &plant));
            }
        }
        Some(worst)
    }
}
