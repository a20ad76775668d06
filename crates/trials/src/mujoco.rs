//! Body, wheels and floor in MuJoCo, behind the simulated motors and drives: a plant that isn't ours.
//!
//! `python/mujoco_plant.py` makes the model: each wheel a hub with passive rollers as bodies of their own, on a floor with
//! MuJoCo's contacts. It gets the torques of every step through a pipe and says how everything moves then.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use omnibase_robot_sim::floor::GRAVITY_M_S2;
use omnibase_robot_sim::{MachineParameters, Mechanics, Motion, Pose, Twist};
use serde_json::json;

/// Rollers of a wheel: where one takes over from the next the rim is 0.04 mm off the circle.
const ROLLERS: usize = 12;
/// Radius of a roller in its middle, over the wheel's.
const ROLLER_SHARE: f64 = 0.2;
/// Mass of a roller, kg: polyurethane on an axle, as large as this.
const ROLLER_KG: f64 = 0.05;
/// Mass of a wheel with them, kg: that of which the simulator's wheels have the inertia.
const WHEEL_KG: f64 = 2.5;
/// Time constant in which a contact gets rid of a depth, s: with the impedance the stiffness of a tread, 2e6 N/m.
const CONTACT_S: f64 = 0.02;
/// The same of a slip: four steps of the simulation, the least that is stable.
const GRIP_S: f64 = 5e-4;
/// How much of a contact's acceleration its constraint decides; the rest gives way.
const IMPEDANCE: f64 = 0.99;
/// How much stiffer friction is than the normal force.
const FRICTION_STIFFER: f64 = 20.0;

/// MuJoCo in a process of its own; it ends with this value.
#[derive(Debug)]
pub struct MujocoPlant {
    process: Child,
    torques: Option<ChildStdin>,
    states: BufReader<ChildStdout>,
    motion: Motion,
    message: Vec<u8>,
}

/// A Python with MuJoCo, in an environment made once in `folder`; `Err` says why there is none.
///
/// # Errors
/// In words, where Python or the packages can't be had.
pub fn python(folder: &Path) -> Result<PathBuf, String> {
    let python = folder.join("bin/python");
    let imports = "import os; os.environ.setdefault('MUJOCO_GL', 'disable'); import mujoco";
    let has_mujoco =
        || Command::new(&python).args(["-c", imports]).output().is_ok_and(|output| output.status.success());
    if !has_mujoco() {
        let packages = script("mujoco.txt");
        let pip = ["-m", "pip", "install", "--quiet", "--no-deps", "--require-hashes", "-r"];
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
        run(Command::new(&python).args(pip).arg(packages))?;
    }
    if has_mujoco() { Ok(python) } else { Err("it was installed but can't be imported".to_owned()) }
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("python").join(name)
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    let says = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(()) } else { Err(format!("{command:?}: {says}")) }
}

impl MujocoPlant {
    /// A machine on a floor with the static friction of its first wheel: MuJoCo knows one coefficient.
    ///
    /// # Errors
    /// In words, where the process can't be started or doesn't make the model.
    pub fn start(python: &Path, machine: &MachineParameters) -> Result<MujocoPlant, String> {
        let in_words = |error: std::io::Error| format!("MuJoCo's process: {error}");
        let mut process = Command::new(python)
            .arg(script("mujoco_plant.py"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(in_words)?;
        let mut torques = process.stdin.take();
        let Some(states) = process.stdout.take() else { return Err("MuJoCo's process has no output".into()) };
        let mut states = BufReader::new(states);
        if let Some(torques) = &mut torques {
            writeln!(torques, "{}", description(machine)).and_then(|()| torques.flush()).map_err(in_words)?;
        }
        let mut line = String::new();
        states.read_line(&mut line).map_err(in_words)?;
        if line.trim() != "ready" {
            return Err(format!("MuJoCo's process says {line:?}"));
        }
        let wheels = machine.wheels.len();
        Ok(MujocoPlant {
            process,
            torques,
            states,
            motion: Motion { wheels: vec![[0.0; 2]; wheels], ..Motion::default() },
            message: Vec::new(),
        })
    }

    fn exchange(&mut self, torques_n_m: &[f64]) -> std::io::Result<()> {
        let wheels = self.motion.wheels.len();
        self.message.clear();
        self.message.extend(torques_n_m.iter().flat_map(|torque| torque.to_le_bytes()));
        let Some(torques) = &mut self.torques else { return Ok(()) };
        torques.write_all(&self.message)?;
        self.message.resize(8 * (6 + 2 * wheels), 0);
        self.states.read_exact(&mut self.message)?;
        let mut numbers = self.message.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        let mut next = || numbers.next().unwrap_or_default();
        self.motion.pose = Pose { x_m: next(), y_m: next(), heading_rad: next() };
        self.motion.twist_in_body = Twist { vx_m_s: next(), vy_m_s: next(), w_rad_s: next() };
        for part in 0..2 {
            for wheel in &mut self.motion.wheels {
                wheel[part] = next();
            }
        }
        Ok(())
    }
}

impl Mechanics for MujocoPlant {
    /// # Panics
    /// Where MuJoCo's process has ended.
    fn step(&mut self, torques_n_m: &[f64]) -> &Motion {
        if let Err(error) = self.exchange(torques_n_m) {
            panic!("MuJoCo's process: {error}");
        }
        &self.motion
    }
}

impl Drop for MujocoPlant {
    fn drop(&mut self) {
        // At the end of its input it ends.
        self.torques = None;
        let _ = self.process.wait();
    }
}

/// What the script is told: everything in SI units, frames as `base_link`.
fn description(machine: &MachineParameters) -> serde_json::Value {
    let wheels = machine.wheels.len() as f64;
    let mass_kg = machine.body.mass_kg + machine.payload.mass_kg;
    let load_n = mass_kg * GRAVITY_M_S2 / wheels;
    let drives = machine.wheels.iter().map(|drive| {
        let wheel = &drive.wheel;
        let [x, y] = wheel.rolling_direction;
        let length = x.hypot(y);
        let gear = drive.motor.gear_ratio;
        json!({
            "position_m": wheel.position_m,
            "direction": [x / length, y / length],
            "radius_m": wheel.radius_m,
            "roller_radius_m": ROLLER_SHARE * wheel.radius_m,
            "inertia_kg_m2": wheel.inertia_kg_m2 + gear * gear * drive.motor.rotor_inertia_kg_m2,
            "viscous_n_m_s": wheel.bearing_viscous_n_m_s,
            // What hinders rolling follows the load at rest.
            "friction_n_m": wheel.bearing_coulomb_n_m + wheel.contact.rolling_resistance * load_n * wheel.radius_m,
            "roller_friction_n_m": wheel.contact.roller_resistance * load_n * ROLLER_SHARE * wheel.radius_m,
        })
    });
    let far_m2: f64 =
        machine.wheels.iter().map(|drive| drive.wheel.position_m.iter().map(|at| at * at).sum::<f64>()).sum();
    let radius_m = machine.wheels.first().map_or(0.0, |drive| drive.wheel.radius_m);
    // The body's figures include its wheels.
    let chassis_kg = machine.body.mass_kg - wheels * WHEEL_KG;
    let chassis_m = (machine.body.mass_kg * machine.body.center_of_mass_height_m
        - wheels * WHEEL_KG * radius_m)
        / chassis_kg;
    let chassis_kg_m2 = machine.body.yaw_inertia_kg_m2 - WHEEL_KG * far_m2;
    let mass = |kg: f64, [x, y]: [f64; 2], height_m: f64, yaw_kg_m2: f64| {
        // About the two other axes nothing is known: a body as high as it is wide.
        json!({ "kg": kg, "position_m": [x, y, height_m], "inertia_kg_m2": [0.6 * yaw_kg_m2, 0.6 * yaw_kg_m2, yaw_kg_m2] })
    };
    let mut masses = vec![mass(chassis_kg, machine.body.center_of_mass_m, chassis_m, chassis_kg_m2)];
    if machine.payload.mass_kg > 0.0 {
        let payload = &machine.payload;
        masses.push(mass(payload.mass_kg, payload.position_m, payload.height_m, payload.yaw_inertia_kg_m2));
    }
    json!({
        "wheels": drives.collect::<Vec<_>>(),
        "rollers": ROLLERS,
        "roller_kg": ROLLER_KG,
        "wheel_kg": WHEEL_KG,
        "masses": masses,
        "friction": machine.wheels.first().map_or(0.0, |drive| drive.wheel.contact.static_friction),
        "contact_s": CONTACT_S,
        "grip_s": GRIP_S,
        "impedance": IMPEDANCE,
        "impratio": FRICTION_STIFFER,
        "step_s": f64::from(machine.step_ns) * 1e-9,
    })
}
