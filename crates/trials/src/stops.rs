//! Whether every wheel stops in time, whatever is lost, in which state, at which instant.
//!
//! One robot lives through case after case: it is brought into a state, at a random speed in a random direction, for a
//! random time; then something is lost, and its simulated wheels are watched until they stand.

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::Limits;
use omnibase_robot::signals::{Frame, Phase, StopCategory};
use omnibase_robot::{Exchange, RequestKind};
use omnibase_run::live::command::{Ask, Client, Command, Pad};
use omnibase_run::live::{Ages, Operator};

use crate::Trial;

/// Slower than this a wheel stands, rad/s: 2 mm/s at a radius of 0.1 m.
pub const STANDING_RAD_S: f64 = 0.02;
/// What a drive's own loop and the body take beyond the commands, s: the wheels follow with a lag.
pub const LAG_S: f64 = 0.05;
/// Time of the drives' process-data watchdog, as it is after power-on.
pub const WATCHDOG_NS: u64 = 100_000_000;
/// How long sources may be silent.
const AGES: Ages = Ages { pad_ns: 200_000_000, session_ns: 500_000_000 };
/// Longer than this no stop takes; then it counts as none.
const NEVER_S: f64 = 20.0;
/// Once it stands it has to stay so, cycles.
const STAYS: u32 = 20;

/// What the robot does when something is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum State {
    /// The drives are on their way to operation.
    Enabling,
    /// It holds.
    Holding,
    /// Driven by the joystick.
    Joystick,
    /// Driven by a page's stick.
    PageStick,
    /// It follows the reference that a page started.
    PageReference,
    /// It follows the reference that the command line started.
    Reference,
    /// On its way to a pose, for a page.
    Way,
    /// It pauses on the reference.
    Paused,
    /// It ramps down already, gently.
    Stopping,
}

/// What is lost, or asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// The stick is let go.
    LetGo,
    /// The stick is unplugged.
    StickGone,
    /// The stick falls silent.
    StickSilent,
    /// The page is closed.
    PageClosed,
    /// The page falls silent.
    PageSilent,
    /// A stop of category 0 is asked for.
    Category0,
    /// A stop of category 1.
    Category1,
    /// A stop of category 2.
    Category2,
    /// The emergency stop.
    Emergency,
    /// The process dies: nothing is computed or sent any more.
    Killed,
    /// The cable is cut: what is computed reaches no drive.
    CableCut,
}

/// All states.
pub const STATES: [State; 9] = [
    State::Enabling,
    State::Holding,
    State::Joystick,
    State::PageStick,
    State::PageReference,
    State::Reference,
    State::Way,
    State::Paused,
    State::Stopping,
];
/// All losses.
pub const LOSSES: [Loss; 11] = [
    Loss::LetGo,
    Loss::StickGone,
    Loss::StickSilent,
    Loss::PageClosed,
    Loss::PageSilent,
    Loss::Category0,
    Loss::Category1,
    Loss::Category2,
    Loss::Emergency,
    Loss::Killed,
    Loss::CableCut,
];

impl State {
    /// Who commands in it.
    fn client(self) -> Client {
        match self {
            State::Joystick => Client::Joystick,
            State::PageStick | State::PageReference | State::Way | State::Paused => Client::Page(0),
            State::Enabling | State::Holding | State::Reference | State::Stopping => Client::Command,
        }
    }
}

impl Loss {
    /// Whether it has to stop a robot in that state: the loss of a page stops what that page commands, and no more.
    pub fn concerns(self, state: State) -> bool {
        match self {
            Loss::LetGo | Loss::StickGone | Loss::StickSilent => {
                matches!(state, State::Joystick | State::PageStick)
            }
            Loss::PageClosed | Loss::PageSilent => {
                matches!(state, State::PageStick | State::PageReference | State::Way | State::Paused)
            }
            _ => true,
        }
    }
}

/// One case and what came of it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The seed that makes it, in its row of cases.
    pub seed: u64,
    /// The state.
    pub state: State,
    /// What was lost.
    pub loss: Loss,
    /// The fastest wheel at that instant, rad/s.
    pub from_rad_s: f64,
    /// Until the last wheel stood for good, s; infinite where that never came.
    pub stopped_s: f64,
    /// What limits, ages and watchdogs allow, s.
    pub allowed_s: f64,
}

impl Case {
    /// Whether every wheel stopped in time.
    pub fn is_in_time(&self) -> bool {
        self.stopped_s <= self.allowed_s
    }
}

/// A row of cases on one robot.
pub struct Stops {
    trial: Trial,
    operator: Operator,
    random: Random,
    seed: u64,
    cycle_s: f64,
    /// Whose words still come, every cycle.
    speaking: Option<(Client, Twist2, Frame)>,
    page_lives: bool,
    is_dead: bool,
}

impl Stops {
    /// A robot with a reference that moves, from a seed.
    pub fn new(trial: Trial, seed: u64) -> Self {
        let cycle_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
        let mut stops = Stops {
            trial,
            operator: Operator::new(AGES, StopCategory::RampThenRemove),
            random: Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
            seed,
            cycle_s,
            speaking: None,
            page_lives: true,
            is_dead: false,
        };
        stops.run(20);
        stops
    }

    /// One more case.
    pub fn case(&mut self) -> Case {
        self.seed += 1;
        self.make_ready();
        let state = STATES[self.random.below(STATES.len())];
        let loss = loop {
            let loss = LOSSES[self.random.below(LOSSES.len())];
            if loss.concerns(state) {
                break loss;
            }
        };
        self.bring_into(state);
        let from_rad_s = self.fastest_rad_s();
        let allowed_s = self.allowed_s(loss);
        let stopped_s = self.lose(state, loss, allowed_s);
        Case { seed: self.seed, state, loss, from_rad_s, stopped_s, allowed_s }
    }

    /// Awake, enabled and holding.
    fn make_ready(&mut self) {
        if self.is_dead || self.trial.next_exchange != Exchange::Complete {
            self.is_dead = false;
            self.trial.next_exchange = Exchange::Complete;
            self.trial.back_in_op();
        }
        self.speaking = None;
        self.page_lives = true;
        self.say(Client::Command, Ask::ReleaseEmergencyStop);
        for _ in 0..10_000 {
            match self.trial.robot.phase() {
                Phase::Holding if self.fastest_rad_s() < STANDING_RAD_S => return self.enable_sticks(),
                Phase::Fault => self.say(Client::Command, Ask::Robot(RequestKind::Acknowledge)),
                // Nobody enables drives while wheels roll.
                Phase::Disabled if self.fastest_rad_s() < STANDING_RAD_S => {
                    self.say(Client::Command, Ask::Robot(RequestKind::Enable));
                }
                _ => {}
            }
            self.run(10);
        }
        let problems: Vec<_> = self.trial.robot.drive_problems().collect();
        panic!("seed {}: never ready: {:?} {problems:?}", self.seed, self.trial.robot.phase());
    }

    /// Sticks that are there, let go, and free to drive.
    fn enable_sticks(&mut self) {
        for client in [Client::Joystick, Client::Page(0)] {
            self.say(client, Ask::Pad(Pad::Released));
            self.say(client, Ask::EnablePad(client));
            self.say(client, Ask::Pad(Pad::Released));
        }
    }

    fn bring_into(&mut self, state: State) {
        let cycles = 1 + self.random.below(700) as u32;
        let client = state.client();
        let robot = Ask::Robot;
        match state {
            State::Holding => self.run(1),
            State::Enabling => {
                self.say(client, robot(RequestKind::Stop(StopCategory::RemoveTorque)));
                self.run(20);
                self.say(client, robot(RequestKind::Enable));
                let cycles = 1 + self.random.below(12) as u32;
                self.run(cycles);
            }
            State::Joystick | State::PageStick => {
                self.speaking = Some((client, self.any_twist(), self.any_frame()));
                self.run(cycles);
                // Another wish in the middle: accelerations of any direction.
                if self.random.below(2) == 0 {
                    self.speaking = Some((client, self.any_twist(), self.any_frame()));
                    let more = 1 + self.random.below(150) as u32;
                    self.run(more);
                }
            }
            State::PageReference | State::Reference | State::Paused => {
                self.say(client, robot(RequestKind::Track));
                self.run(cycles);
                if state == State::Paused {
                    self.say(client, robot(RequestKind::Pause));
                    let more = 1 + self.random.below(300) as u32;
                    self.run(more);
                }
            }
            State::Way => {
                let here = self.trial.robot.record().state.odom_from_body;
                let Twist2 { vx_m_s, vy_m_s, w_rad_s } = self.any_twist();
                let odom_from_body = Pose2 {
                    x_m: here.x_m + 2.0 * vx_m_s,
                    y_m: here.y_m + 2.0 * vy_m_s,
                    heading_rad: here.heading_rad + w_rad_s,
                };
                self.say(client, robot(RequestKind::GoTo { odom_from_body }));
                self.run(cycles);
            }
            State::Stopping => {
                self.say(client, robot(RequestKind::Track));
                self.run(cycles);
                self.say(client, robot(RequestKind::Stop(StopCategory::RampAndHold)));
                let more = 1 + self.random.below(100) as u32;
                self.run(more);
            }
        }
    }

    /// Something is lost; the time until every wheel stands for good, s.
    fn lose(&mut self, state: State, loss: Loss, allowed_s: f64) -> f64 {
        let client = state.client();
        let stop = |category| Ask::Robot(RequestKind::Stop(category));
        match loss {
            Loss::LetGo => {
                self.speaking = None;
                self.say(client, Ask::Pad(Pad::Released));
            }
            Loss::StickGone => {
                self.speaking = None;
                self.say(client, Ask::Pad(Pad::Lost));
            }
            Loss::StickSilent => self.speaking = None,
            Loss::PageClosed => {
                (self.speaking, self.page_lives) = (None, false);
                self.say(Client::Page(0), Ask::Gone);
            }
            Loss::PageSilent => (self.speaking, self.page_lives) = (None, false),
            Loss::Category0 => self.say(Client::Command, stop(StopCategory::RemoveTorque)),
            Loss::Category1 => self.say(Client::Command, stop(StopCategory::RampThenRemove)),
            Loss::Category2 => self.say(Client::Command, stop(StopCategory::RampAndHold)),
            // With the stick still held: it must not matter.
            Loss::Emergency => self.say(Client::Page(1), Ask::EmergencyStop),
            Loss::Killed => self.is_dead = true,
            Loss::CableCut => self.trial.next_exchange = Exchange::Lost,
        }
        // A stop that was asked for while a stick is held: the stick is let go by its person, or holds on; either way
        // the robot stops, but a stick that holds on drives again after a gentle stop, as it should.
        if matches!(loss, Loss::Category1 | Loss::Category2 | Loss::Category0) {
            self.speaking = None;
            self.say(client, Ask::Pad(Pad::Released));
        }
        let cycle_ns = self.trial.plan.bus.cycle_ns;
        let watchdog = (WATCHDOG_NS / cycle_ns) as u32;
        let most = ((allowed_s.max(1.0) + NEVER_S) / self.cycle_s) as u32;
        let (mut stands, mut last_moving) = (0, 0);
        for cycle in 1..=most {
            if matches!(loss, Loss::Killed | Loss::CableCut) && cycle == watchdog {
                self.trial.watchdogs_expire();
            }
            self.cycle();
            let moves = self.fastest_rad_s() >= STANDING_RAD_S
                || self.trial.robot.phase() == Phase::Tracking && !self.is_dead;
            (stands, last_moving) = if moves { (0, cycle) } else { (stands + 1, last_moving) };
            // Silence is noticed only after its age: standing before that proves nothing.
            if stands > STAYS && f64::from(cycle) * self.cycle_s > self.noticed_s(loss) {
                return f64::from(last_moving) * self.cycle_s;
            }
        }
        f64::INFINITY
    }

    /// How long it may take until the loss is noticed, s.
    fn noticed_s(&self, loss: Loss) -> f64 {
        let ns = match loss {
            Loss::StickSilent => AGES.pad_ns,
            // A page that drives by its stick is missed as a stick first.
            Loss::PageSilent => AGES.session_ns,
            Loss::Killed | Loss::CableCut => WATCHDOG_NS,
            _ => 0,
        };
        ns as f64 * 1e-9
    }

    /// What may pass until the last wheel stands: until the loss is noticed, a ramp within the limits from the speed and
    /// acceleration of this instant, a cycle until it begins, one until it arrives, and the drives' lag.
    fn allowed_s(&self, loss: Loss) -> f64 {
        let noticed_s = self.noticed_s(loss);
        let ramp_s = match loss {
            Loss::Category0 => self.fastest_rad_s() / COASTING_RAD_S2,
            // Nobody leads the platform any more: each drive brakes its wheel by its own ramp.
            Loss::Killed | Loss::CableCut => self.fastest_rad_s() / self.quick_stop_rad_s2(),
            _ => ramp_s(self.greatest_speeds(noticed_s), &self.trial.plan.limits),
        };
        noticed_s + 2.0 * self.cycle_s + ramp_s + LAG_S
    }

    /// The drives' own deceleration (0x6085, counts/s²) at the wheel.
    fn quick_stop_rad_s2(&self) -> f64 {
        let drive = &self.trial.plan.drives[0];
        let counts_s2 =
            drive.parameters.iter().find(|parameter| parameter.index == 0x6085).map(|parameter| {
                parameter.data.iter().rev().fold(0_u64, |value, byte| value << 8 | u64::from(*byte))
            });
        let counts_per_rad =
            f64::from(drive.scale.counts_per_revolution) * drive.scale.gear_ratio / std::f64::consts::TAU;
        counts_s2.unwrap_or(0) as f64 / counts_per_rad
    }

    /// Speed and acceleration that may be reached until the loss is noticed: m/s, m/s², rad/s, rad/s².
    fn greatest_speeds(&self, unnoticed_s: f64) -> [f64; 4] {
        let limits = &self.trial.plan.limits;
        let setpoint = self.trial.robot.record().setpoint;
        let (twist, acceleration) = (setpoint.twist_in_odom, setpoint.acceleration_in_odom);
        if unnoticed_s > 0.0 {
            return [
                limits.speed_m_s,
                limits.acceleration_m_s2,
                limits.turn_speed_rad_s,
                limits.turn_acceleration_rad_s2,
            ];
        }
        [twist.speed_m_s(), acceleration.speed_m_s(), twist.w_rad_s.abs(), acceleration.w_rad_s.abs()]
    }

    fn say(&mut self, client: Client, ask: Ask) {
        let now_ns = self.trial.time().now_ns;
        self.operator.hear(now_ns, Command { client, ticket: 0, ask });
    }

    fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// One cycle of the world, and of the process where it lives.
    fn cycle(&mut self) {
        if self.is_dead {
            self.trial.next_exchange = Exchange::Lost;
            self.trial.exchange();
            return;
        }
        self.trial.exchange();
        let now_ns = self.trial.time().now_ns;
        if let Some((client, twist, frame)) = self.speaking {
            self.say(client, Ask::Pad(Pad::Held { twist, frame }));
        }
        if self.page_lives {
            self.say(Client::Page(0), Ask::Alive);
        }
        let (last, phase) = (*self.trial.robot.record(), self.trial.robot.phase());
        let request = self.operator.turn(now_ns, &last, phase).request;
        self.operator.answers().for_each(drop);
        self.operator.notes().for_each(drop);
        self.trial.compute_asked(request);
    }

    fn fastest_rad_s(&self) -> f64 {
        let machine = self.trial.machine.lock();
        let speed =
            |wheel: usize| machine.shaft(wheel).speed_rad_s / self.trial.plan.drives[wheel].scale.gear_ratio;
        (0..self.trial.plan.drives.len()).map(|wheel| speed(wheel).abs()).fold(0.0, f64::max)
    }

    fn any_twist(&mut self) -> Twist2 {
        let limits = self.trial.plan.limits;
        let angle = std::f64::consts::TAU * self.random.share();
        let speed_m_s = limits.speed_m_s * self.random.share();
        let turn = 2.0 * self.random.share() - 1.0;
        Twist2::new(speed_m_s * angle.cos(), speed_m_s * angle.sin(), limits.turn_speed_rad_s * turn)
    }

    fn any_frame(&mut self) -> Frame {
        if self.random.below(2) == 0 { Frame::Body } else { Frame::Odom }
    }
}

/// The least deceleration of wheels that roll out without torque, rad/s².
const COASTING_RAD_S2: f64 = 0.5;

/// The longest time of a ramp to rest within limits, from `[speed, acceleration]` along the way and about the vertical
/// axis, s. Worst is an acceleration away from rest: it has to end first (a/j, in which the speed grows by a²/2j), then
/// comes a ramp with full jerk at both ends (v/a + a/j). Both axes end together, so the longer counts.
fn ramp_s([v, a, w, e]: [f64; 4], limits: &Limits) -> f64 {
    let one = |speed: f64, now: f64, most: f64, jerk: f64| {
        let peak = speed + now * now / (2.0 * jerk);
        now / jerk + peak / most + most / jerk
    };
    one(v, a, limits.acceleration_m_s2, limits.jerk_m_s3).max(one(
        w,
        e,
        limits.turn_acceleration_rad_s2,
        limits.turn_jerk_rad_s3,
    ))
}

/// A small generator of its own (xorshift), so that cases are the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, count: usize) -> usize {
        ((self.next() >> 32) as usize * count) >> 32
    }
}
