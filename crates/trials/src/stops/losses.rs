//! What is lost, and what becomes of it.

use omnibase_cia402::ErrorCode;
use omnibase_robot::signals::{Phase, StopCategory};
use omnibase_robot::{Exchange, RequestKind};
use omnibase_run::live::command::{Ask, Client, StickWish};

use super::{Case, Loss, NEVER_S, STANDING_RAD_S, STAYS, State, Stops, WATCHDOG_NS};
use crate::trial::Without;

/// Exchanges after a loss until the bus knows who is missing.
const UNKNOWN: u32 = 2;
/// What a drive that fails by itself says: over-current.
pub(super) const OWN_FAULT: ErrorCode = ErrorCode(0x2310);
/// How late a slow line is, s: later than any age allows.
const SLOW_S: [f64; 2] = [0.6, 2.6];
/// The fewest cycles without a carrier: one more than are tolerated.
const SHORTEST_CARRIER: u64 = 5;

impl Stops {
    pub(super) fn lose(&mut self, case: &mut Case) {
        let policy = self.trial.plan.safety.lost_device_stop;
        let most = ((case.allowed_s.max(1.0) + NEVER_S) / self.cycle_s) as u32;
        // Not before the first cycle: else it never happened, and the case would be judged as if it had.
        let second = case.then.map(|(_, at_s)| ((at_s / self.cycle_s) as u32).max(1));
        self.happen(case.state, case.loss);
        let mut noticed_s = self.noticed_s(case.loss);
        let (mut stands, mut last_moving) = (0, 0);
        for cycle in 1..=most {
            if let Some((on_top, _)) = case.then.filter(|_| second == Some(cycle)) {
                let at_s = f64::from(cycle) * self.cycle_s;
                let is_unnoticed = at_s <= noticed_s + 2.0 * self.cycle_s;
                let is_harder = on_top.severity(policy) > case.loss.severity(policy);
                let allowed_s = at_s + self.allowed_s(on_top);
                // What a lost drive leaves unbraked rolls out, whatever comes on top.
                if case.loss.leaves_unbraked(policy) {
                    case.allowed_s = case.allowed_s.max(allowed_s);
                } else if is_harder || is_unnoticed || on_top.leaves_unbraked(policy) {
                    case.allowed_s = allowed_s;
                    noticed_s = at_s + self.noticed_s(on_top);
                }
                case.then = Some((on_top, at_s));
                self.happen(case.state, on_top);
            }
            self.cycle();
            let seconds = f64::from(cycle) * self.cycle_s;
            let phase = self.trial.robot.phase();
            if let Some((torque_off_s, _)) = &mut case.torque_off_s
                && torque_off_s.is_infinite()
                && matches!(phase, Phase::Disabled | Phase::Fault)
            {
                *torque_off_s = seconds;
            }
            let moves = self.fastest_rad_s() >= STANDING_RAD_S || phase == Phase::Tracking && !self.is_dead;
            (stands, last_moving) = if moves { (0, cycle) } else { (stands + 1, last_moving) };
            let is_over = second.is_none_or(|second| cycle > second)
                && case
                    .torque_off_s
                    .is_none_or(|(found_s, allowed_s)| found_s.is_finite() || seconds > allowed_s);
            // Silence is noticed only after its age: standing before that proves nothing.
            if stands > STAYS && is_over && seconds > noticed_s {
                case.stopped_s = f64::from(last_moving) * self.cycle_s;
                return;
            }
        }
    }

    fn happen(&mut self, state: State, loss: Loss) {
        let client = state.client();
        let stop = |category| Ask::Robot(RequestKind::Stop(category));
        match loss {
            Loss::LetGo => {
                self.speaking = None;
                self.say(client, Ask::Stick(StickWish::Released));
            }
            Loss::StickGone => {
                (self.speaking, self.has_joystick) = (None, self.has_joystick && client != Client::Joystick);
                self.say(client, Ask::Stick(StickWish::Lost));
            }
            Loss::StickSilent => {
                (self.speaking, self.has_joystick) = (None, self.has_joystick && client != Client::Joystick);
            }
            Loss::PageClosed => {
                (self.speaking, self.page_lives) = (None, false);
                self.say(Client::Page(0), Ask::Gone);
            }
            Loss::PageSilent => (self.speaking, self.page_lives) = (None, false),
            Loss::LineSlow => {
                let delay_s = SLOW_S[0] + (SLOW_S[1] - SLOW_S[0]) * self.random.share();
                self.slow_line = Some((self.trial.time().now_ns, (delay_s * 1e9) as u64));
            }
            Loss::WayBlocked => self.block(Some(self.trial.pose())),
            Loss::Category0 => self.say(Client::Command, stop(StopCategory::RemoveTorque)),
            Loss::Category1 => self.say(Client::Command, stop(StopCategory::RampThenRemove)),
            Loss::Category2 => self.say(Client::Command, stop(StopCategory::RampAndHold)),
            // With the stick still held: it must not matter.
            Loss::Emergency => self.say(Client::Page(1), Ask::EmergencyStop),
            Loss::Killed => (self.is_dead, self.silent) = (true, Some(0)),
            Loss::CableCut => self.silent = Some(0),
            Loss::CarrierLost => {
                let longest = WATCHDOG_NS / self.trial.plan.bus.cycle_ns - SHORTEST_CARRIER - 1;
                let cycles = SHORTEST_CARRIER + self.random.below(longest as usize) as u64;
                (self.silent, self.carrier_back, self.lost_carrier) = (Some(0), Some(cycles as u32), true);
            }
            Loss::DriveFault => {
                let wheels = self.trial.plan.drives.len();
                let lost = self.lost.map(|(wheel, ..)| wheel);
                let wheel = self.random.below(wheels);
                // One that has no power can't fail.
                let wheel = if lost == Some(wheel) { (wheel + 1) % wheels } else { wheel };
                self.trial.fail_drive(wheel, OWN_FAULT.0);
                self.failed = Some(wheel);
            }
            Loss::SupplyCut => {
                (0..self.trial.plan.drives.len())
                    .for_each(|wheel| self.trial.lose_drive(wheel, Without::Power));
                (self.lost, self.silent) = (None, Some(0));
            }
            Loss::DrivePower | Loss::DriveData => {
                let wheel = self.random.below(self.trial.plan.drives.len());
                let without = if loss == Loss::DrivePower { Without::Power } else { Without::Data };
                self.trial.lose_drive(wheel, without);
                self.lost = Some((wheel, loss, 0));
            }
        }
        // A stop that was asked for while a stick is held: the stick is let go by its person, or holds on; either way
        // the robot stops, but a stick that holds on drives again after a gentle stop, as it should.
        if matches!(loss, Loss::Category1 | Loss::Category2 | Loss::Category0) {
            self.speaking = None;
            self.say(client, Ask::Stick(StickWish::Released));
        }
    }

    /// What is lost takes its course: the bus finds out who is missing, watchdogs expire.
    pub(super) fn lose_more(&mut self) {
        let watchdog = (WATCHDOG_NS / self.trial.plan.bus.cycle_ns) as u32;
        if let Some((wheel, loss, cycles)) = &mut self.lost {
            *cycles += 1;
            self.trial.next_exchange = match *cycles {
                0..=UNKNOWN => Exchange::ShortCount { expected: 9, received: 6 },
                _ => Exchange::Without { wheels: 1 << *wheel, devices: 0 },
            };
            if *loss == Loss::DriveData && *cycles == watchdog {
                self.trial.watchdog_expires(*wheel);
            }
            // A drive that comes back finds no old command.
            self.trial.image.outputs[*wheel].fill(0);
        }
        if let Some(cycles) = &mut self.silent {
            *cycles += 1;
            self.trial.next_exchange = Exchange::Lost;
            if *cycles == watchdog {
                self.trial.watchdogs_expire();
            }
            if self.carrier_back.is_some_and(|back| *cycles >= back) {
                (self.silent, self.carrier_back) = (None, None);
                if self.lost.is_none() {
                    self.trial.next_exchange = Exchange::Complete;
                }
            }
        }
    }
}
