//! A robot in one of its states, and what becomes of it.

use omnibase_ethercat::wire::Link;
use omnibase_ethercat_sim::VirtualClock;
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot_sim::SharedMachine;

use crate::bench::Bench;

/// Slower than this a wheel stands, rad/s.
pub const STANDING_RAD_S: f64 = 0.02;
/// Less than this at the motor is none, N·m.
const NO_TORQUE_NM: f64 = 0.01;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum State {
    /// Drives on their way to operation; between INIT and OP there is no robot yet.
    Starting,
    Holding,
    Tracking,
    ByHand,
    Stopping,
}

pub const STATES: [State; 5] =
    [State::Starting, State::Holding, State::Tracking, State::ByHand, State::Stopping];

/// A robot in some state, and who drives it.
pub struct Case<L: Link + Clone> {
    pub bench: Bench<L>,
    pub machine: SharedMachine,
    pub clock: VirtualClock,
    pub by_hand: Option<Twist2>,
    pub state: State,
    seen: Observed,
}

/// What was seen since the fault, in cycles of 1 ms.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observed {
    pub ms: u64,
    /// What the robot did first, and when.
    pub reaction: Option<(u64, Phase)>,
    pub torque_off_ms: Option<u64>,
    pub moving_until: u64,
    /// For each wheel: for how long it turned, and for how long of that with torque.
    turned: [(u64, u64); 3],
}

impl<L: Link + Clone> Case<L> {
    /// Brings a robot in OP into a state.
    pub fn new(bench: Bench<L>, machine: SharedMachine, clock: VirtualClock, state: State) -> Self {
        let mut case = Case { bench, machine, clock, by_hand: None, state, seen: Observed::default() };
        match state {
            State::Starting => {
                case.bench.cycle(None);
                case.bench.cycle(Some(RequestKind::Enable));
                case.bench.run(3);
                assert_eq!(case.bench.robot.phase(), Phase::Enabling);
            }
            State::Holding => {
                case.bench.enable();
                case.bench.run(50);
            }
            State::Tracking | State::Stopping => {
                case.bench.enable();
                case.bench.cycle(Some(RequestKind::Track));
                case.bench.run(3000);
                if state == State::Stopping {
                    case.bench.cycle(Some(RequestKind::Stop(StopCategory::RampAndHold)));
                    case.bench.run(60);
                    assert_eq!(case.bench.robot.phase(), Phase::Stopping);
                }
            }
            State::ByHand => {
                case.bench.enable();
                case.by_hand = Some(Twist2::new(0.3, 0.1, 0.2));
                (0..800).for_each(|_| case.cycle());
            }
        }
        case
    }

    pub fn cycle(&mut self) {
        let request = self.by_hand.map(|twist| RequestKind::Velocity { twist, frame: Frame::Body });
        match request {
            Some(kind) => self.bench.cycle_for(kind, 200_000_000),
            None => self.bench.cycle(None),
        };
    }

    pub fn fastest_rad_s(&self) -> f64 {
        let machine = self.machine.lock();
        (0..3).map(|wheel| machine.shaft(wheel).speed_rad_s.abs()).fold(0.0, f64::max)
    }

    /// A millisecond after the fault has passed.
    pub fn watch(&mut self) -> &Observed {
        let seen = &mut self.seen;
        seen.ms += 1;
        let phase = self.bench.robot.phase();
        let stops = match phase {
            Phase::Stopping => self.state != State::Stopping,
            Phase::QuickStopping | Phase::Fault | Phase::Disabled => true,
            Phase::Enabling | Phase::Holding | Phase::Tracking => false,
        };
        if stops && seen.reaction.is_none() {
            seen.reaction = Some((seen.ms, phase));
        }
        if matches!(phase, Phase::Disabled | Phase::Fault) && seen.torque_off_ms.is_none() {
            seen.torque_off_ms = Some(seen.ms);
        }
        let machine = self.machine.lock();
        for (wheel, (turned, with_torque)) in seen.turned.iter_mut().enumerate() {
            let shaft = machine.shaft(wheel);
            if shaft.speed_rad_s.abs() >= STANDING_RAD_S {
                seen.moving_until = seen.ms;
                *turned += 1;
                *with_torque += u64::from(shaft.torque_n_m.abs() > NO_TORQUE_NM);
            }
        }
        seen
    }

    /// Whether nothing more is to be expected: for so long nothing turned, and no torque is there.
    pub fn is_quiet(&self) -> bool {
        self.seen.torque_off_ms.is_some() && self.seen.ms > self.seen.moving_until + 1000
    }

    pub fn reason(&self) -> SafetyReason {
        self.bench.robot.record().stop_reason
    }
}

impl Observed {
    /// Who braked, by the torques of the motors while their wheels turned; nothing where none did.
    pub fn who_braked(&self) -> &'static str {
        let braked = self.turned.iter().filter(|(turned, _)| *turned > 5);
        let (count, with_torque) = braked.fold((0, 0), |(count, with_torque), (turned, torque)| {
            (count + 1, with_torque + usize::from(2 * torque >= *turned))
        });
        match (count, with_torque) {
            (0, _) => "",
            (count, braked) if count == braked => "all wheels brake, ",
            (_, 0) => "all wheels roll out, ",
            (_, 1) => "one wheel brakes, the others roll out, ",
            (_, _) => "two wheels brake, one rolls out, ",
        }
    }

    pub fn stands(&self) -> String {
        match self.moving_until {
            0 => "stands".to_owned(),
            ms => format!("stand after {ms} ms"),
        }
    }
}

pub fn words(phase: Phase) -> &'static str {
    match phase {
        Phase::Disabled => "disabled",
        Phase::Enabling => "enabling",
        Phase::Holding => "holding",
        Phase::Tracking => "tracking",
        Phase::Stopping => "ramp",
        Phase::QuickStopping => "quick stop",
        Phase::Fault => "fault",
    }
}
