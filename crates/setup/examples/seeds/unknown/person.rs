//! A person who looks at a robot's wheels, and the robot.

use std::cell::RefCell;
use std::rc::Rc;

use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, Injector};
use omnibase_robot_sim::SharedMachine;
use omnibase_setup::{Answer, Hand, Key, Question};

use super::Unknown;

/// How hard the person turns a wheel, per mille of the rated torque of its motor.
const PUSHED_PER_MILLE: i16 = 200;
/// Cycles after which the emergency stop is pressed.
const PRESSED_AT: u32 = 400;
/// Cycles after which a drive fails, and by what (CiA 402, 0x603F).
const FAILS_AT: u32 = 600;
const OVERCURRENT: u16 = 0x2310;

/// The robot on its blocks, as it is wired now.
pub struct World {
    pub robot: Unknown,
    /// It stands on the floor, not on blocks.
    pub on_floor: bool,
    pub machine: Option<SharedMachine>,
    pub injector: Option<Injector>,
    /// The position whose motor's shaft is turned by hand.
    pub pushed: Option<usize>,
}

impl World {
    /// Brakes and hands on the segment that was opened.
    pub fn lay_hands(&self) {
        let injector = self.injector.as_ref().expect("the segment is open");
        for (position, per_mille) in self.robot.brakes.into_iter().enumerate() {
            injector.inject(position, ApplicationFault::Brake(per_mille).into());
        }
        for position in 0..self.robot.brakes.len() {
            let per_mille = if self.pushed == Some(position) { PUSHED_PER_MILLE } else { 0 };
            injector.inject(position, ApplicationFault::Push(per_mille).into());
        }
    }
}

/// A person who looks, holds the key for one turn, and has the wires changed where that is asked for.
pub struct Person<'a> {
    pub world: Rc<RefCell<World>>,
    pub before: [f64; 3],
    /// Where the platform was then.
    pub from: [f64; 3],
    /// When the key is let go on the floor, once.
    pub lets_go_at: Option<u32>,
    /// A drive fails once while the key is held for what is told so.
    pub fails_while: Option<&'static str>,
    /// A drive loses its power once so, until it is asked whether it is jogged again.
    pub dark_while: Option<&'static str>,
    /// The emergency stop takes the drives' supply.
    pub stop_takes_supply: bool,
    pub cycles: u32,
    pub what: String,
    /// What was asked, in order, with its answer.
    pub asked: Vec<(String, String)>,
    /// What is answered in place of what was seen.
    pub otherwise: &'a mut dyn FnMut(&Question) -> Option<Answer>,
    /// What was told, in order.
    pub told: Vec<String>,
}

impl Person<'_> {
    fn angles(&self) -> [f64; 3] {
        let world = self.world.borrow();
        let machine = world.machine.as_ref().expect("the segment is open").lock();
        let wheels = machine.body().wheels();
        [0, 1, 2].map(|wheel| wheels[wheel].angle_rad)
    }

    /// How far the platform really went since the key was taken, m, m, rad; a turn is one.
    fn moved(&self) -> [f64; 3] {
        let pose = self.pose();
        let (sine, cosine) = self.from[2].sin_cos();
        let [x_m, y_m] = [pose[0] - self.from[0], pose[1] - self.from[1]];
        let turned_rad = pose[2] - self.from[2];
        let round = if self.what.contains("ONCE") { core::f64::consts::TAU } else { 0.0 };
        let turned_rad = turned_rad - round + core::f64::consts::PI;
        let turned_rad = turned_rad.rem_euclid(core::f64::consts::TAU) - core::f64::consts::PI + round;
        [cosine * x_m + sine * y_m, cosine * y_m - sine * x_m, turned_rad]
    }

    fn pose(&self) -> [f64; 3] {
        let world = self.world.borrow();
        let pose = world.machine.as_ref().expect("the segment is open").lock().body().pose();
        [pose.x_m, pose.y_m, pose.heading_rad]
    }

    fn to_all(&self, fault: &Fault) {
        let world = self.world.borrow();
        for position in 0..3 {
            world.injector.as_ref().expect("the segment is open").inject(position, fault.clone());
        }
    }

    /// The emergency stop is pressed, or released.
    fn stop(&self, is_pressed: bool) {
        self.to_all(&match (self.stop_takes_supply, is_pressed) {
            (false, _) => Fault::Application(ApplicationFault::SafeTorqueOff(is_pressed)),
            (true, true) => Fault::PowerOff,
            (true, false) => Fault::PowerOn,
        });
    }

    pub fn switch_off_and_on(&self) {
        let world = self.world.borrow();
        for position in 0..3 {
            for fault in [Fault::PowerOff, Fault::PowerOn] {
                world.injector.as_ref().expect("the segment is open").inject(position, fault);
            }
        }
    }

    /// The wheel that turned most, and how far.
    fn seen(&self) -> (usize, f64) {
        let now = self.angles();
        let turned = [0, 1, 2].map(|wheel| now[wheel] - self.before[wheel]);
        let most = (0..3).max_by(|one, other| turned[*one].abs().total_cmp(&turned[*other].abs())).unwrap();
        (most, turned[most])
    }
}

impl Hand for Person<'_> {
    fn ask(&mut self, question: &Question) -> Answer {
        self.world.borrow_mut().pushed = None;
        if let Some(answer) = (self.otherwise)(question) {
            let is_put_down = ["floor", "calibrate"].contains(&question.id.as_str());
            self.world.borrow_mut().on_floor |= is_put_down;
            if let Answer::Text(said) = &answer {
                self.asked.push((question.id.clone(), said.clone()));
            }
            return answer;
        }
        let word = question.id.split(' ').next().unwrap_or_default();
        let said = match word {
            "wheel" => format!("wheel_{}", self.seen().0 + 1),
            "way" => if self.seen().1 > 0.0 { "forward" } else { "backward" }.to_owned(),
            // By eye: to a hundredth of a turn.
            "turns" => format!("{:.2}", self.seen().1.abs() / core::f64::consts::TAU),
            "gear" => self.world.borrow().robot.gear.to_string(),
            "again" => {
                let mut world = self.world.borrow_mut();
                world.robot.turned_encoder = None;
                world.injector.as_ref().expect("the segment is open").inject(1, Fault::PowerOn);
                "again".to_owned()
            }
            "parameters" => "write".to_owned(),
            "stopped" | "opened" | "pushed" => "yes".to_owned(),
            "name" => "position".to_owned(),
            "dark" => "go on".to_owned(),
            "differs" => "another gear or encoder".to_owned(),
            "places" => "as before".to_owned(),
            "brake" => "no".to_owned(),
            "push" => {
                self.world.borrow_mut().pushed =
                    question.id.split(' ').nth(1).and_then(|position| position.parse().ok());
                "done".to_owned()
            }
            "braked" => "go on".to_owned(),
            "floor" | "calibrate" => "go on".to_owned(),
            "went" => match question.id.as_str() {
                "went aside" => "left",
                "went round" => "round to the left",
                _ => "ahead",
            }
            .to_owned(),
            // To a millimetre, and a tenth of a degree.
            "tape" => {
                let [x_m, y_m, turned_rad] = self.moved();
                match question.id.split(' ').nth(1) {
                    Some("x") => format!("{x_m:.3}"),
                    Some("y") => format!("{y_m:.3}"),
                    _ => format!("{:.1}", turned_rad.to_degrees()),
                }
            }
            "wheels" => "take".to_owned(),
            "drive" => {
                self.world.borrow().injector.as_ref().expect("the segment is open").inject(1, Fault::PowerOn);
                "again".to_owned()
            }
            "enable" => "again".to_owned(),
            // Measured again, and the numbers.
            "wrong" | "numbers" => question.choices[0].clone(),
            "release" => {
                self.stop(false);
                "done".to_owned()
            }
            "power" => {
                self.switch_off_and_on();
                "done".to_owned()
            }
            // What the program thinks likely.
            _ => String::new(),
        };
        self.asked.push((question.id.clone(), said.clone()));
        Answer::Text(said)
    }

    fn tell(&mut self, text: &str) {
        self.told.push(text.to_owned());
    }

    fn take_key(&mut self, what: &str) {
        (self.before, self.cycles, self.what) = (self.angles(), 0, what.to_owned());
        self.from = self.pose();
    }

    fn key(&mut self) -> Key {
        self.cycles += 1;
        if self.what.contains("emergency stop") && self.cycles == PRESSED_AT {
            self.stop(true);
        }
        if self.cycles == FAILS_AT && self.fails_while.is_some_and(|part| self.what.contains(part)) {
            self.fails_while = None;
            let fault = ApplicationFault::DriveFault(OVERCURRENT);
            self.world.borrow().injector.as_ref().expect("the segment is open").inject(1, fault.into());
        }
        if self.cycles == FAILS_AT && self.dark_while.is_some_and(|part| self.what.contains(part)) {
            self.dark_while = None;
            self.world.borrow().injector.as_ref().expect("the segment is open").inject(1, Fault::PowerOff);
        }
        if self.what.contains("the robot") && self.lets_go_at == Some(self.cycles) {
            self.lets_go_at = None;
            return Key::LetGo;
        }
        let turns = self.seen().1.abs() / core::f64::consts::TAU;
        if self.what.contains("turns; let go") && turns >= 1.0 { Key::LetGo } else { Key::Beat }
    }
}
