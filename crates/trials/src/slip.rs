//! Wheels that slip: when it is noticed, and where the platform is by then.

use omnibase_platform::{Kinematics, Pose2};
use omnibase_robot::signals::{MAX_WHEELS, SafetyReason, Setpoint};
use omnibase_robot_sim::{Body, MachineParameters, Mechanics, Tread};
use omnibase_run::simulated;

use crate::builds::PoseError;
use crate::robots::with_payload;
use crate::{Run, Trial, plan_of};

/// A slip that is looked at is longer than this, m: treads creep, and give way.
pub const LEAST_M: f64 = 10e-3;

/// What a robot's file says of a gyro.
const GYRO: &str = "[[source]]\nname = \"gyro\"\nmax_age_ms = 20\n[[source.input]]\nname = \"turn\"\n\
                    unit = \"rad/s\"\n[safety]\ngyro_input = \"gyro.turn\"\n";

/// A robot on a floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The robot's file.
    pub robot: &'static str,
    /// The control law.
    pub law: &'static str,
    /// What it follows: circle, square, eight or spiral.
    pub path: &'static str,
    /// How much faster than usual.
    pub faster: f64,
    /// Static friction of the floor; it slides with nine tenths of it.
    pub friction: f64,
    /// The treads; `None` are rigid ones.
    pub tread: Option<Tread>,
    /// Payload, kg.
    pub payload_kg: f64,
    /// Where it stands on the platform, x, m.
    pub off_centre_m: f64,
    /// Whether it has a gyro.
    pub gyro: bool,
    /// More of the robot's file, at its end.
    pub more: String,
}

/// A rim that slips so fast, and is so much off what the set motion asks of it, spins, m/s.
const SPINS_M_S: f64 = 0.3;

/// Wheels that spin.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spin {
    /// For how many cycles each does.
    cycles: [u64; MAX_WHEELS],
    /// The most at a time.
    pub(crate) longest: u64,
}

impl Spin {
    /// Looks at the wheels of a cycle.
    pub(crate) fn see(&mut self, body: &Body, kinematics: &Kinematics, set: &Setpoint) {
        let in_body = set.twist_in_odom.rotated(-set.odom_from_body.heading_rad);
        let set_rad_s = kinematics.wheel_speeds_rad_s(in_body);
        for (index, (wheel, cycles)) in body.wheels().iter().zip(&mut self.cycles).enumerate() {
            let off_m_s = body.lever_m(index) * (wheel.speed_rad_s - set_rad_s[index]);
            let spins = off_m_s.abs().min(wheel.slip_m_s.abs()) > SPINS_M_S;
            *cycles = if spins { *cycles + 1 } else { 0 };
            self.longest = self.longest.max(*cycles);
        }
    }
}

/// What it came to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slid {
    /// Errors of the path.
    pub run: Run,
    /// The farthest that a wheel truly slipped at a time, m.
    pub way_m: f64,
    /// The most cycles in which a wheel spun at a time.
    pub spun: u64,
    /// The fastest that a rim was believed to be ahead, m/s.
    pub believed_m_s: f64,
    /// After how many cycles the first true slip began that became longer than [`LEAST_M`].
    pub began: Option<u64>,
    /// After how many the first one was told, and how far the wheel had slipped by then, m.
    pub told: Option<(u64, f64)>,
    /// Greatest true torque at a wheel, N·m.
    pub torque_nm: f64,
    /// Why it stopped, where it did.
    pub stopped: SafetyReason,
    /// How far truth and belief were apart where its motion ended.
    pub apart: PoseError,
    /// The floor's friction as it was found.
    pub friction: Option<f64>,
}

impl Case {
    /// A robot alone, as fast as usual, on a floor that grips and rigid treads.
    pub fn plain(robot: &'static str, law: &'static str, path: &'static str) -> Case {
        Case {
            robot,
            law,
            path,
            faster: 1.0,
            friction: 0.5,
            tread: None,
            payload_kg: 0.0,
            off_centre_m: 0.0,
            gyro: false,
            more: String::new(),
        }
    }

    /// Its file.
    pub fn text(&self) -> String {
        let Case { faster, friction, payload_kg, .. } = self;
        let robot = quicker(self.robot, *faster);
        let mut text = with_payload(&robot, self.law, 1.0, *payload_kg);
        // The platform itself was weighed.
        let body = simulated::description(&plan_of(self.robot)).machine.body;
        let (mass_kg, inertia_kg_m2) = (body.mass_kg, body.yaw_inertia_kg_m2);
        let known = format!(
            "mass_bounds_kg = [{:?}, {:?}]\ninertia_bounds_kg_m2 = [{:?}, {:?}]\n",
            0.95 * mass_kg,
            mass_kg + 200.0,
            0.95 * inertia_kg_m2,
            inertia_kg_m2 + 30.0
        );
        text = text.replace("\n\n[simulation]", &format!("\n{known}\n[simulation]"));
        text.push_str(&format!(
            "payload_position_m = [{:?}, 0.0]\nstatic_friction = {friction:?}\nsliding_friction = {:?}\n",
            self.off_centre_m,
            0.9 * friction
        ));
        if let Some(Tread { stiffness_n_m, damping_ratio }) = self.tread {
            text.push_str(&format!(
                "tread_stiffness_n_m = {stiffness_n_m:?}\ntread_damping_ratio = {damping_ratio:?}\n"
            ));
        }
        let s = |duration_s: f64| duration_s / faster;
        let path = match self.path {
            "circle" => format!("kind = \"circle\"\nradius_m = 0.5\nduration_s = {:?}", s(10.0)),
            "eight" => format!("kind = \"eight\"\nhalf_length_m = 0.8\nduration_s = {:?}", s(15.0)),
            "spiral" => format!("kind = \"spiral\"\nstep_m = 0.3\nturns = 2.5\nduration_s = {:?}", s(20.0)),
            _ => format!(
                "kind = \"path\"\npoints = [[0, 0, 0, 0], [{:?}, 2, 0, 0], [{:?}, 2, 2, 0], [{:?}, 0, 2, 0], [{:?}, 0, 0, 0]]",
                s(5.0),
                s(10.0),
                s(15.0),
                s(20.0)
            ),
        };
        let gyro = if self.gyro { GYRO } else { "" };
        format!("{text}{}\n[reference]\n{path}\n{gyro}", self.more)
    }

    /// Drives it.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride(&self) -> Slid {
        Slid::of(&self.text(), self.gyro)
    }

    /// Drives it on mechanics of another make.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride_on(&self, mechanics: impl FnOnce(&MachineParameters) -> Box<dyn Mechanics>) -> Slid {
        Slid::of_text_on(&self.text(), mechanics)
    }

    /// A row of the table.
    pub fn row(&self, slid: &Slid) -> String {
        let at = |cycles: Option<u64>| {
            cycles.map_or("-".to_owned(), |cycles| format!("{:.3}", cycles as f64 * 1e-3))
        };
        let Run { believed_rms_m, true_rms_m, true_final_m, .. } = slid.run;
        let tread = self.tread.map_or("rigid".to_owned(), |tread| format!("{:.0e}", tread.stiffness_n_m));
        format!(
            "| {}{} | {} | {:.1} | {:.2} | {tread} | {:.0} | {:.1} | {:.2} | {:.1} | {:.1} | {:.1} | {:.1} | {:.0} | {} | {} | {} | {} |",
            self.law,
            if self.gyro { ", gyro" } else { "" },
            self.path,
            self.faster,
            self.friction,
            self.payload_kg,
            self.off_centre_m,
            1e3 * believed_rms_m,
            1e3 * true_rms_m,
            1e3 * true_final_m,
            slid.torque_nm,
            1e3 * slid.way_m,
            1e3 * slid.believed_m_s,
            at(slid.began),
            at(slid.told.map(|(cycles, _)| cycles)),
            slid.friction.map_or("-".to_owned(), |friction| format!("{friction:.3}")),
            slid.end(),
        )
    }
}

/// A robot that may drive as much faster as a factor says, and accelerate by its square.
pub(crate) fn quicker(robot: &str, factor: f64) -> String {
    let limits = [("speed_m_s", 1.0), ("turn_speed_rad_s", 1.5)].map(|limit| (limit, factor));
    let accelerations =
        [("acceleration_m_s2", 1.5), ("turn_acceleration_rad_s2", 3.0)].map(|limit| (limit, factor * factor));
    limits.into_iter().chain(accelerations).fold(robot.to_owned(), |text, ((key, value), factor)| {
        text.replace(&format!("\n{key} = {value:?}"), &format!("\n{key} = {:?}", value * factor))
    })
}

impl Slid {
    /// Drives the robot of a file along its path; with a gyro through its first source.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn of(text: &str, gyro: bool) -> Slid {
        let mut trial = Trial::new(plan_of(text));
        trial.gyro = gyro.then_some(0);
        Slid::of_trial(trial, 0)
    }

    /// As [`Slid::of`] without a gyro, after it stood with its drives enabled for so many cycles.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn of_rested(text: &str, cycles: u64) -> Slid {
        Slid::of_trial(Trial::new(plan_of(text)), cycles)
    }

    /// As [`Slid::of`] without a gyro, on mechanics of another make.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn of_text_on(text: &str, mechanics: impl FnOnce(&MachineParameters) -> Box<dyn Mechanics>) -> Slid {
        let mut other = None;
        let trial = Trial::on_machine(plan_of(text), |machine| other = Some(mechanics(machine)));
        if let Some(other) = other {
            trial.machine.lock().set_mechanics(other);
        }
        Slid::of_trial(trial, 0)
    }

    /// How it ended.
    pub fn end(&self) -> &'static str {
        match self.stopped {
            SafetyReason::None if self.run.finished => "finished",
            reason => reason.text(),
        }
    }

    fn of_trial(mut trial: Trial, rests: u64) -> Slid {
        trial.enable();
        trial.run(rests);
        let machine = trial.machine.clone();
        let period_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
        let mut slid = Slid::default();
        let mut ways = [(0.0_f64, 0_u64); MAX_WHEELS];
        let mut cycle = 0;
        let mut spin = Spin::default();
        let kinematics = trial.plan.kinematics.clone();
        slid.run = Run::track(&mut trial, &mut |record| {
            cycle += 1;
            let machine = machine.lock();
            spin.see(machine.body(), &kinematics, &record.setpoint);
            for (wheel, (way_m, since)) in machine.body().wheels().iter().zip(&mut ways) {
                if wheel.slip_m_s.abs() < 0.02 {
                    (*way_m, *since) = (0.0, cycle);
                } else {
                    *way_m += period_s * wheel.slip_m_s.abs();
                }
                slid.way_m = slid.way_m.max(*way_m);
                if *way_m > LEAST_M && slid.began.is_none() {
                    slid.began = Some(*since);
                }
            }
            let ahead = record.grip.slip_m_s.iter().fold(0.0_f64, |most, slip| most.max(slip.abs()));
            slid.believed_m_s = slid.believed_m_s.max(ahead);
            if record.grip.slips() && slid.told.is_none() {
                let farthest_m = ways.iter().fold(0.0_f64, |most, (way_m, _)| most.max(*way_m));
                slid.told = Some((cycle, farthest_m));
            }
            if slid.stopped == SafetyReason::None {
                slid.stopped = record.stop_reason;
            }
            slid.friction = record.grip.friction;
            let pose = machine.truth().pose;
            let truth = Pose2 { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad };
            slid.apart = PoseError::new(&record.state, truth);
        });
        slid.spun = spin.longest;
        slid.torque_nm = machine.lock().greatest_torques_n_m().iter().fold(0.0, |a, b| a.max(*b));
        slid
    }
}

/// Heading of the table of [`Case::row`].
pub const HEADING: &str = "| law | path | speed | friction | tread N/m | payload kg | at x m | believed RMS mm | true RMS mm | true final mm | greatest torque N·m | longest slip mm | believed ahead mm/s | slips at s | told at s | friction found | end |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";
