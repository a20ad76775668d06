//! One way on the floor: the robot's own cycle, for as long as a key is held.

use omnibase_cia402::ErrorCode;
use omnibase_ethercat::wire::{Clock, Link};
use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_robot::config::RobotPlan;
use omnibase_robot::signals::{CycleRecord, CycleTime, Exchange, Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot::{ProcessImage, Request, RequestKind, Robot};
use omnibase_session::session::Session;

use super::super::{SetupError, in_words};
use super::FloorMotion;
use crate::dead_man::DeadMan;
use crate::hand::{Hand, Key};
use crate::jog::enables;
use crate::record::Leg;

/// The longest drive, s; how long somebody may take to hold the key; and how long it has until it stands without torque.
const LONGEST_S: f64 = 60.0;
const WAITING_S: f64 = 60.0;
const ROLLS_OUT_S: f64 = 2.0;
/// Increments of wheels are kept so often, s.
const KEPT_S: f64 = 0.1;
/// Control word (IEC 61800-7-201).
const CONTROL_WORD: u16 = 0x6040;

/// How a drive on the floor went.
pub(super) struct Drive {
    pub(super) leg: Leg,
    pub(super) has_arrived: bool,
    pub(super) is_gone: bool,
    /// Cycles in whose frames a drive was told to be in operation though no key was held; must be 0.
    pub(super) unheld_cycles: u32,
    pub(super) words: String,
}

/// A robot that drives a way, in OP.
pub(super) struct Driving<'a, L: Link, C: Clock> {
    session: Session<L, C>,
    robot: Robot,
    plan: &'a RobotPlan,
    way: &'a FloorMotion,
    index: u64,
    begun: Option<Pose2>,
    /// What each wheel turned since increments were kept last, rad.
    turned_rad: Vec<f64>,
    /// The wheel whose drive stopped the robot without saying why.
    failed: Option<usize>,
    drive: Drive,
}

impl<'a, L: Link, C: Clock> Driving<'a, L, C> {
    pub(super) fn new(
        session: Session<L, C>,
        robot: Robot,
        plan: &'a RobotPlan,
        way: &'a FloorMotion,
    ) -> Self {
        let leg = Leg { name: way.name.to_owned(), period_s: KEPT_S, ..Leg::default() };
        let drive = Drive { leg, has_arrived: false, is_gone: false, unheld_cycles: 0, words: String::new() };
        let turned_rad = vec![0.0; plan.drives.len()];
        Driving { session, robot, plan, way, index: 0, begun: None, turned_rad, failed: None, drive }
    }

    /// Until it has arrived and stands, the key is let go, or something is wrong; the drives lose their torque behind it. `key_s` is how
    /// long a beat of the key counts, and how far its first two may be apart.
    pub(super) fn while_held(&mut self, hand: &mut dyn Hand, key_s: [f64; 2]) -> Result<(), SetupError> {
        let [beat, first_beats] = key_s.map(|seconds| self.cycles_of(seconds));
        let mut key = DeadMan::new(beat, first_beats);
        hand.take_key(&format!("hold the key: {}", self.way.words));
        let (mut cycles, mut next_kept) = (0u32, self.cycles_of(KEPT_S));
        let (mut was_held, mut was_enabled, mut is_acknowledged) = (false, false, false);
        let mut wished = None;
        self.drive.words = loop {
            let (exchange, periods) = self.exchange()?;
            cycles += periods as u32;
            let heard = hand.key();
            let held = key.cycle(heard, periods);
            was_held |= held;
            // What was wished while it was held counts no more once it isn't.
            let stop = was_held.then_some(RequestKind::Stop(StopCategory::RemoveTorque));
            let asked = if held { wished } else { stop };
            let record = self.compute(exchange, asked, held);
            if cycles >= next_kept {
                next_kept = cycles + self.cycles_of(KEPT_S);
                self.keep_increments();
            }
            hand.moves(self.is_enabled(), self.gone());
            self.drive.is_gone |= heard == Key::Gone;
            self.drive.has_arrived |= self.gone() >= self.way.far;
            if was_held && !held || self.drive.is_gone {
                break if self.drive.has_arrived { "driven" } else { "the key was let go" }.to_owned();
            }
            was_enabled |= matches!(record.phase, Phase::Holding | Phase::Tracking);
            let acknowledges = asked == Some(RequestKind::Acknowledge);
            if record.phase == Phase::Fault {
                let words = stopped(self.plan, &record);
                if was_enabled || is_acknowledged {
                    self.failed = who_failed_untold(&record);
                    break words;
                }
                if !acknowledges {
                    hand.remark(&format!("{words}; the held key acknowledges that"));
                }
            }
            is_acknowledged |= acknowledges;
            if !was_held && cycles > self.cycles_of(WAITING_S) {
                break "the key wasn't held".to_owned();
            }
            if cycles > self.cycles_of(WAITING_S + LONGEST_S) {
                break format!("not there after {LONGEST_S} s: {}", record.phase.name());
            }
            let stands = record.measurements.present().iter().all(|one| one.stands());
            if self.drive.has_arrived && record.phase == Phase::Holding && stands {
                break "driven".to_owned();
            }
            wished = self.wished(record.phase);
        };
        hand.moves(false, self.gone());
        Ok(())
    }

    /// Without torque until it stands; then the bus is left.
    pub(super) fn end(mut self) -> Result<Drive, SetupError> {
        for _ in 0..self.cycles_of(ROLLS_OUT_S) {
            let (exchange, _) = self.exchange()?;
            self.compute(exchange, Some(RequestKind::Stop(StopCategory::RemoveTorque)), false);
        }
        self.keep_increments();
        // Not every drive's process data tell it.
        if let Some(wheel) = self.failed {
            let code = self.session.error_codes()?.get(wheel).copied().flatten();
            let says = code.filter(|code| *code != ErrorCode::NONE);
            self.drive.words +=
                &says.map_or(String::new(), |code| format!("; asked by SDO, it says error {code}"));
        }
        // Who lost its supply doesn't answer any more: that ends this way, not the set-up.
        if let Err(error) = self.session.end() {
            self.drive.words = format!("{}; {}", self.drive.words, in_words(&error));
        }
        Ok(self.drive)
    }

    /// What is asked while the key is held.
    fn wished(&self, phase: Phase) -> Option<RequestKind> {
        match phase {
            // By a drive that failed before: it was told.
            Phase::Fault => Some(RequestKind::Acknowledge),
            _ if self.drive.has_arrived => None,
            Phase::Disabled => Some(RequestKind::Enable),
            Phase::Holding | Phase::Tracking => {
                Some(RequestKind::Velocity { twist: self.way.twist, frame: Frame::Body })
            }
            _ => None,
        }
    }

    /// One exchange, and how many periods it took.
    fn exchange(&mut self) -> Result<(Exchange, u64), SetupError> {
        let (exchange, times) = self.session.exchange()?;
        self.index += times.periods;
        Ok((exchange, times.periods))
    }

    /// The robot's cycle behind an exchange, and how far it has gone by then.
    fn compute(&mut self, exchange: Exchange, asked: Option<RequestKind>, held: bool) -> CycleRecord {
        let period_ns = self.plan.bus.cycle_ns;
        let time = CycleTime::on_grid(self.index, period_ns);
        let asked = asked.map(|kind| Request { kind, valid_until_ns: time.now_ns + 2 * period_ns });
        let record = *self.robot.compute(time, exchange, asked, self.session.image());
        self.drive.unheld_cycles += u32::from(!held && self.is_enabled());
        let pose = record.state.odom_from_body;
        let moved = self.begun.get_or_insert(pose).inverse().then(pose);
        let turned_rad = self.drive.leg.told[2];
        let turned_rad = turned_rad + wrap_angle_rad(moved.heading_rad - turned_rad);
        self.drive.leg.told = [moved.x_m, moved.y_m, turned_rad];
        let said = record.measurements.present();
        self.turned_rad.iter_mut().zip(said).for_each(|(sum, one)| *sum += one.increment_rad);
        record
    }

    fn keep_increments(&mut self) {
        let begun = vec![0.0; self.turned_rad.len()];
        self.drive.leg.turned_rad.push(std::mem::replace(&mut self.turned_rad, begun));
    }

    fn gone(&self) -> f64 {
        self.way.gone(self.drive.leg.told)
    }

    fn cycles_of(&self, seconds: f64) -> u32 {
        (seconds / (1e-9 * self.plan.bus.cycle_ns as f64)).ceil() as u32
    }

    /// Whether some drive is told to be in operation by the bytes that leave next.
    fn is_enabled(&mut self) -> bool {
        let image = self.session.image();
        self.plan.drives.iter().enumerate().any(|(wheel, drive)| {
            let mut bit = 0usize;
            for entry in drive.outputs.iter().flat_map(|pdo| &pdo.entries) {
                if entry.index == CONTROL_WORD
                    && let Some([low, high, ..]) = image.outputs(wheel).get(bit / 8..)
                {
                    return enables([*low, *high]);
                }
                bit += usize::from(entry.bits);
            }
            false
        })
    }
}

/// The wheel whose drive stopped the robot, where its process data don't say why.
fn who_failed_untold(record: &CycleRecord) -> Option<usize> {
    let wheel = record.stop_where as usize;
    let said = record.measurements.present().get(wheel)?;
    (record.stop_reason == SafetyReason::Drive && said.error == ErrorCode::NONE).then_some(wheel)
}

/// Why the robot stopped, and which drive did that by what.
fn stopped(plan: &RobotPlan, record: &CycleRecord) -> String {
    let reason = record.stop_reason.text();
    let wheel = record.stop_where as usize;
    match (plan.drives.get(wheel), record.measurements.present().get(wheel)) {
        (Some(drive), Some(said)) if record.stop_reason == SafetyReason::Drive => {
            let error =
                if said.error == ErrorCode::NONE { String::new() } else { format!(", {}", said.error) };
            format!("the robot stopped: {reason}: {}{error}", drive.name)
        }
        _ => format!("the robot stopped: {reason}"),
    }
}
