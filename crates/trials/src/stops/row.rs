//! A row of cases on one robot.

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Frame, Phase, StopCategory};
use omnibase_robot::{Exchange, RequestKind};
use omnibase_run::live::Operator;
use omnibase_run::live::Stamp;
use omnibase_run::live::command::{Ask, Client, Command, StickWish};

use super::{AGES, Blocking, Case, Comeback, LOSSES, Loss, ON_TOP, STANDING_RAD_S, STATES, State};
use crate::Trial;

/// Obstacles that block every way: so many, so far away and so large that the robot comes to rest between them and fits
/// through nowhere.
const RING: u32 = 12;
const RING_M: f64 = 1.4;
const RING_RADIUS_M: f64 = 0.3;
/// How long a source that was lost speaks before and after a person enables it, cycles.
const INSISTS: u32 = 10;

/// A row of cases on one robot.
pub struct Stops {
    pub(super) trial: Trial,
    pub(super) operator: Operator,
    pub(super) random: Random,
    seed: u64,
    pub(super) cycle_s: f64,
    /// Whose words still come, every cycle.
    pub(super) speaking: Option<(Client, Twist2, Frame)>,
    pub(super) page_lives: bool,
    pub(super) is_dead: bool,
    /// A lost drive, and for how many cycles.
    pub(super) lost: Option<(usize, Loss, u32)>,
    /// Cycles since all drives were left alone.
    pub(super) silent: Option<u32>,
    /// After so many of them the carrier is there again.
    pub(super) carrier_back: Option<u32>,
    /// The carrier was lost in this case.
    pub(super) lost_carrier: bool,
    /// Since when the line to the page is slow, and by how much what it says is late then, ns.
    pub(super) slow_line: Option<(u64, u64)>,
    /// Obstacles stand around it.
    is_blocked: bool,
    /// A drive that failed.
    pub(super) failed: Option<usize>,
    /// The joystick is there: it says so in every cycle.
    pub(super) has_joystick: bool,
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
            lost: None,
            silent: None,
            carrier_back: None,
            lost_carrier: false,
            slow_line: None,
            is_blocked: false,
            failed: None,
            has_joystick: false,
        };
        stops.operator.comes_back(stops.trial.plan.safety.comeback);
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
        let mut case = Case {
            seed: self.seed,
            state,
            loss,
            then: None,
            from_rad_s: self.fastest_rad_s(),
            stopped_s: f64::INFINITY,
            allowed_s: self.allowed_s(loss),
            torque_off_s: loss.is_drive().then_some((f64::INFINITY, self.torque_off_allowed_s(loss))),
            blocking: Blocking::NotConcerned,
            comeback: Comeback::NotConcerned,
        };
        let has_more = !matches!(
            loss,
            Loss::Category0 | Loss::Killed | Loss::CableCut | Loss::CarrierLost | Loss::SupplyCut
        );
        if has_more && self.random.below(2) == 0 {
            let on_top = ON_TOP[self.random.below(ON_TOP.len())];
            // Two lost drives are no other case than one, and one that was lost already can't be lost.
            if !(loss.is_drive() && on_top.is_drive()) {
                case.then = Some((on_top, case.allowed_s.min(2.0) * self.random.share()));
                case.torque_off_s = None;
            }
        }
        self.lose(&mut case);
        if case.stopped_s.is_finite() {
            case.comeback = self.watch_comeback(&case);
        }
        if case.then.is_none() && loss.blocks() && case.stopped_s.is_finite() {
            case.blocking = self.insist(state.client());
        }
        case
    }

    /// Awake, enabled and holding.
    fn make_ready(&mut self) {
        (self.failed, self.lost_carrier, self.slow_line) = (None, false, None);
        if std::mem::take(&mut self.is_blocked) {
            self.block(None);
        }
        if self.is_dead || self.trial.next_exchange != Exchange::Complete {
            self.is_dead = false;
            self.bring_back();
            // A robot that was dead meanwhile learns what became of its drives.
            self.run(20);
        }
        self.speaking = None;
        self.page_lives = true;
        self.say(Client::Command, Ask::ReleaseEmergencyStop);
        for _ in 0..10_000 {
            let is_known = self.trial.robot.record().state.pose_known;
            match self.trial.robot.phase() {
                // It goes on behind a comeback.
                Phase::Tracking => {
                    self.say(Client::Command, Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)));
                }
                Phase::Holding if !is_known => {
                    let odom_from_body = self.trial.pose();
                    let kind = RequestKind::SetPose { odom_from_body, sigma_m: 0.01, sigma_rad: 0.01 };
                    self.say(Client::Command, Ask::Robot(kind));
                }
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

    /// What was lost on the bus is there again.
    pub(super) fn bring_back(&mut self) {
        (self.lost, self.silent, self.carrier_back) = (None, None, None);
        let wheels = self.trial.back_in_op();
        if wheels != 0 {
            self.trial.next_exchange = Exchange::Restarted { wheels };
            self.cycle();
        }
        self.trial.next_exchange = Exchange::Complete;
    }

    /// Sticks that are there, let go, and free to drive.
    fn enable_sticks(&mut self) {
        self.has_joystick = true;
        for client in [Client::Joystick, Client::Page(0)] {
            self.say(client, Ask::Stick(StickWish::Released));
            self.say(client, Ask::EnableStick(client));
            self.say(client, Ask::Stick(StickWish::Released));
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

    /// Something is lost, and something more; the wheels are watched until every one stands for good.
    /// A source that was lost speaks again, as if nothing had been: it drives nothing until a person enables it.
    fn insist(&mut self, client: Client) -> Blocking {
        let has_stick = matches!(client, Client::Joystick | Client::Page(_));
        (self.page_lives, self.slow_line) = (true, None);
        if !has_stick {
            return Blocking::NotConcerned;
        }
        self.speaking = Some((client, Twist2::new(0.2, 0.0, 0.0), Frame::Body));
        for _ in 0..INSISTS {
            self.cycle();
            if self.trial.robot.phase() == Phase::Tracking {
                return Blocking::Broken;
            }
        }
        self.say(client, Ask::EnableStick(client));
        for _ in 0..INSISTS {
            self.cycle();
            // Not with the stick still in hand.
            if self.trial.robot.phase() == Phase::Tracking {
                return Blocking::Broken;
            }
        }
        self.say(client, Ask::Stick(StickWish::Released));
        for _ in 0..INSISTS {
            self.cycle();
            if self.trial.robot.phase() == Phase::Tracking {
                return Blocking::Kept;
            }
        }
        Blocking::ForEver
    }

    pub(super) fn say(&mut self, client: Client, ask: Ask) {
        let now_ns = self.trial.time().now_ns;
        let stamp = match self.slow_line.filter(|_| client == Client::Page(0)) {
            // What was said before the line became slow was in time.
            Some((since_ns, delay_ns)) => Stamp::Told(since_ns.max(now_ns.saturating_sub(delay_ns))),
            None => Stamp::Here,
        };
        self.operator.hear(now_ns, Command { client, ticket: 0, ask, stamp });
    }

    /// Obstacles all around a place, too near to each other for the robot; or none of them.
    pub(super) fn block(&mut self, around: Option<Pose2>) {
        for index in 0..RING {
            let kind = match around {
                Some(Pose2 { x_m, y_m, .. }) => {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / f64::from(RING)).sin_cos();
                    let centre_m = [x_m + RING_M * cos, y_m + RING_M * sin];
                    let obstacle = Obstacle { centre_m, radius_m: RING_RADIUS_M, velocity_m_s: [0.0; 2] };
                    RequestKind::SetObstacle { index, obstacle }
                }
                None => RequestKind::RemoveObstacle { index },
            };
            self.say(Client::Command, Ask::Robot(kind));
        }
        self.is_blocked = around.is_some();
    }

    pub(super) fn run(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.cycle();
        }
    }

    /// One cycle of the world, and of the process where it lives.
    pub(super) fn cycle(&mut self) {
        self.lose_more();
        if self.is_dead {
            self.trial.exchange();
            return;
        }
        self.trial.exchange();
        let now_ns = self.trial.time().now_ns;
        if let Some((client, twist, frame)) = self.speaking {
            self.say(client, Ask::Stick(StickWish::Held { twist, frame }));
        }
        let speaks = self.speaking.is_some_and(|(client, ..)| client == Client::Joystick);
        if self.has_joystick && !speaks {
            self.say(Client::Joystick, Ask::Stick(StickWish::Released));
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

    pub(super) fn fastest_rad_s(&self) -> f64 {
        let machine = self.trial.machine.lock();
        machine.body().wheels().iter().map(|wheel| wheel.speed_rad_s.abs()).fold(0.0, f64::max)
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

/// A small generator of its own (xorshift), so that cases are the same everywhere.
pub(super) struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub(super) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        ((self.next() >> 32) as usize * count) >> 32
    }
}
