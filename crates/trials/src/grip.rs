//! Robots on treads that give way and floors that let them slip: what a control law believes, and what it truly does.

use omnibase_robot::signals::SafetyReason;
use omnibase_robot_sim::Tread;

use crate::framed::Treads;
use crate::{Run, Trial, plan_of, robots};

/// A control law on one tread and one floor: a row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The control law.
    pub law: &'static str,
    /// What it is told of the treads.
    pub told: Treads,
    /// The treads; `None` are rigid ones.
    pub tread: Option<Tread>,
    /// Static friction of the floor; it slides with nine tenths of it.
    pub friction: f64,
    /// Payload, kg.
    pub payload_kg: f64,
    /// First estimate of mass and inertia over the truth.
    pub estimate: f64,
    /// Time of a side of the square, s.
    pub side_s: f64,
}

/// Time of a side of the thesis's square, s.
pub const SIDE_S: f64 = 5.0;

/// What a case came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ridden {
    /// Errors of the path.
    pub run: Run,
    /// Greatest true torque of a motor at its wheel, N·m.
    pub greatest_torque_n_m: f64,
    /// Share of the time of tracking in which a torque rang.
    pub ringing: f64,
    /// Most swings in a second of a torque while it rang, Hz.
    pub ringing_hz: f64,
    /// Why it stopped, where it did.
    pub stopped: SafetyReason,
}

/// A torque rings where it swings about its mean over this many cycles ...
const WINDOW: usize = 50;
/// ... with at least this root of the mean square, over the rated torque. What the square asks for changes by a tenth of that
/// in such a time.
const RINGING_SHARE: f64 = 1.0 / 7.0;
/// ... and at least so often through it, 40 Hz.
const LEAST_CROSSINGS: usize = 4;

impl Case {
    /// One of a family of cases for a law: tread, damping, friction and payload by a seed.
    pub fn seeded(law: &'static str, told: Treads, seed: u64) -> Self {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut unit = || {
            state ^= state >> 12;
            state ^= state << 25;
            state ^= state >> 27;
            (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let stiffness_n_m = 1e5 * 40.0_f64.powf(unit());
        let tread = Tread { stiffness_n_m, damping_ratio: 0.1 * 10.0_f64.powf(unit()) };
        let (friction, payload_kg, estimate) = (0.35 + 0.35 * unit(), 200.0 * unit(), 0.5 + unit());
        Case { law, told, tread: Some(tread), friction, payload_kg, estimate, side_s: SIDE_S }
    }

    /// Drives a square of 2 m with the BMM; the thesis's takes 20 s.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride(&self) -> Ridden {
        let mut trial = Trial::new(plan_of(&self.text()));
        trial.enable();
        let mut swings: Vec<Swing> =
            trial.plan.drives.iter().map(|drive| Swing::new(drive.scale.rated_torque_nm)).collect();
        let machine = trial.machine.clone();
        let (mut ringing, mut ringing_hz) = (0_u64, 0.0_f64);
        let cycle_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
        let mut stopped = SafetyReason::default();
        let run = Run::track(&mut trial, &mut |record| {
            stopped = record.stop_reason;
            let machine = machine.lock();
            let mut rings = false;
            for (swing, motor) in swings.iter_mut().zip(machine.motors()) {
                swing.see(motor.torque_n_m());
                if let Some(crossings) = swing.crossings {
                    rings = true;
                    ringing_hz = ringing_hz.max(0.5 * crossings as f64 / (WINDOW as f64 * cycle_s));
                }
            }
            ringing += u64::from(rings);
        });
        let greatest = machine.lock().greatest_torques_n_m().iter().fold(0.0_f64, |a, b| a.max(*b));
        Ridden {
            run,
            greatest_torque_n_m: greatest,
            ringing: ringing as f64 / run.cycles.max(1) as f64,
            ringing_hz,
            stopped,
        }
    }

    /// Its file.
    pub fn text(&self) -> String {
        // As fast as the path asks for; what the wheels may stays.
        let faster = (SIDE_S / self.side_s).max(1.0);
        let robot = robots::BMM.replace("\nspeed_m_s = 1.0", &format!("\nspeed_m_s = {faster:?}")).replace(
            "\nacceleration_m_s2 = 1.5",
            &format!("\nacceleration_m_s2 = {:?}", 1.5 * faster * faster),
        );
        let mut text = robots::with_payload(&robot, self.law, self.estimate, self.payload_kg);
        if self.told == Treads::Stiff {
            text = robots::on_stiff_treads(&text);
        }
        text.push_str(&format!(
            "static_friction = {:?}\nsliding_friction = {:?}\n",
            self.friction,
            0.9 * self.friction
        ));
        if let Some(tread) = self.tread {
            let Tread { stiffness_n_m, damping_ratio } = tread;
            text.push_str(&format!(
                "tread_stiffness_n_m = {stiffness_n_m:?}\ntread_damping_ratio = {damping_ratio:?}\n"
            ));
        }
        let corners = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]];
        let times_s = (0..).map(|side| f64::from(side) * self.side_s);
        let points = times_s.zip(corners).map(|(t, [x, y])| format!("[{t:?}, {x}, {y}, 0]"));
        let points = points.collect::<Vec<_>>().join(", ");
        format!("{text}\n[reference]\nkind = \"path\"\npoints = [{points}]\n")
    }

    /// A row of the table.
    pub fn row(&self, ridden: &Ridden) -> String {
        let tread = match self.tread {
            None => "rigid | -".to_owned(),
            Some(tread) => format!("{:.1e} | {:.2}", tread.stiffness_n_m, tread.damping_ratio),
        };
        let Run { believed_rms_m, true_rms_m, true_final_m, .. } = ridden.run;
        let ending = match ridden.stopped {
            SafetyReason::None if ridden.run.finished => "finished",
            reason => reason.text(),
        };
        format!(
            "| {} | {} | {tread} | {:.2} | {:.0} | {:.0} % | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} | {:.0} % | {:.0} | {ending} |",
            self.law,
            self.told.text(self.law),
            self.friction,
            self.payload_kg,
            100.0 * self.estimate,
            self.side_s,
            1e3 * believed_rms_m,
            1e3 * true_rms_m,
            1e3 * true_final_m,
            ridden.greatest_torque_n_m,
            100.0 * ridden.ringing,
            ridden.ringing_hz,
        )
    }
}

/// Heading of the table of [`Case::row`].
pub const HEADING: &str = "| law | told of treads | tread N/m | damping | friction | payload kg | m̂ at start | side s | believed RMS mm | true RMS mm | true final mm | greatest torque N·m | rings | at Hz | end |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";

/// The last torques of a motor, one a millisecond.
#[derive(Clone, Debug)]
pub(crate) struct Swing {
    torques_n_m: [f64; WINDOW],
    next: usize,
    /// From what root of the mean square on it rings.
    ringing_n_m: f64,
    /// How often it went through its mean in the window, where it rings.
    pub(crate) crossings: Option<usize>,
}

impl Swing {
    /// Of a motor with this rated torque.
    pub(crate) fn new(rated_n_m: f64) -> Self {
        let ringing_n_m = RINGING_SHARE * rated_n_m;
        Swing { torques_n_m: [0.0; WINDOW], next: 0, ringing_n_m, crossings: None }
    }

    pub(crate) fn see(&mut self, torque_n_m: f64) {
        self.torques_n_m[self.next] = torque_n_m;
        self.next = (self.next + 1) % WINDOW;
        let count = WINDOW as f64;
        let mean = self.torques_n_m.iter().sum::<f64>() / count;
        let square = self.torques_n_m.iter().map(|torque| (torque - mean).powi(2)).sum::<f64>() / count;
        let in_order = || self.torques_n_m[self.next..].iter().chain(&self.torques_n_m[..self.next]);
        let crossings =
            in_order().zip(in_order().skip(1)).filter(|(a, b)| (**a > mean) != (**b > mean)).count();
        self.crossings =
            (square.sqrt() > self.ringing_n_m && crossings >= LEAST_CROSSINGS).then_some(crossings);
    }
}
