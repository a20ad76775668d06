//! What is asked of the robot in a cycle, and what it answers.

use super::Robot;
use crate::guard::Obstacle;
use crate::lifecycle::Change;
use crate::motion::{CantBegin, From};
use crate::safety::input_forbids;
use crate::signals::{Batch, Course, Phase, Request, RequestAnswer, RequestKind, SafetyReason, StopCategory};

impl Robot {
    /// What is asked of the robot in this cycle.
    pub(super) fn take(&mut self, request: &Request) -> RequestAnswer {
        let time = self.record.time;
        if time.now_ns >= request.valid_until_ns {
            return RequestAnswer::TooOld;
        }
        match request.kind {
            RequestKind::Set { index, value, batch } => {
                let controller = &mut *self.controllers[self.active];
                return self.settings.set(&mut self.guard, controller, index as usize, value, batch);
            }
            RequestKind::SwitchController { index } => return self.switch_controller(index as usize),
            RequestKind::SetDriveMode { wheel, mode } => {
                return match self.lifecycle.phase() {
                    Phase::Disabled | Phase::Holding | Phase::Tracking => {
                        match self.drive_modes.set(wheel as usize, mode) {
                            true => RequestAnswer::Taken,
                            false => RequestAnswer::DriveMode,
                        }
                    }
                    _ => RequestAnswer::WrongPhase,
                };
            }
            RequestKind::Velocity { twist, .. } => {
                if !twist.is_finite() {
                    return RequestAnswer::Refused;
                }
                if self.lacks_pose_for(&request.kind) {
                    return RequestAnswer::PoseUnknown;
                }
                if self.lifecycle.request(&time, &request.kind).0 != RequestAnswer::Taken {
                    return RequestAnswer::WrongPhase;
                }
                // However long it is said to count: a command grows old.
                let oldest_ns = time.now_ns.saturating_add(self.command_age_ns);
                let valid_until_ns = request.valid_until_ns.min(oldest_ns);
                self.motion.follow(Request { valid_until_ns, ..*request });
                return RequestAnswer::Taken;
            }
            RequestKind::Track
            | RequestKind::Resume
            | RequestKind::GoTo { .. }
            | RequestKind::Pause
            | RequestKind::UseReference { .. } => return self.lead(request.kind),
            RequestKind::SetObstacle { index, obstacle } => return self.put(index, Some(obstacle)),
            RequestKind::RemoveObstacle { index } => return self.put(index, None),
            RequestKind::SetFence { corner_m, batch } => return self.put_fence(corner_m, batch),
            RequestKind::SetPose { odom_from_body, sigma_m, sigma_rad } => {
                return self.set_pose(odom_from_body, [sigma_m, sigma_rad]);
            }
            RequestKind::SetOutput { .. } if self.lifecycle.lets_go() => return RequestAnswer::WrongPhase,
            RequestKind::SetOutput { index, value } => return taken_if(self.peripherals.ask(index, value)),
            RequestKind::Axis { device, ask } => return self.peripherals.move_by(&time, device, &ask),
            RequestKind::ResetOutput { index } => return taken_if(self.peripherals.reset(index)),
            RequestKind::Enable => {
                match input_forbids(&self.safety_plan, &self.record.signals).map(|(reason, _)| reason) {
                    None => {}
                    Some(SafetyReason::StopInput) => return RequestAnswer::StopInput,
                    Some(_) => return RequestAnswer::EnableInput,
                }
            }
            _ => {}
        }
        let (answer, change) = self.lifecycle.request(&time, &request.kind);
        match change {
            Change::None => {}
            Change::Begin => self.begin(),
            Change::Acknowledge => {
                self.devices.iter_mut().for_each(|device| device.acknowledge());
                self.peripherals.acknowledge();
                self.safety.reset();
                self.begin();
            }
        }
        answer
    }

    /// Obstacles come and go in every phase.
    fn put(&mut self, index: u32, obstacle: Option<Obstacle>) -> RequestAnswer {
        match self.guard.set(index, obstacle) {
            Ok(()) => RequestAnswer::Taken,
            Err(()) => RequestAnswer::Refused,
        }
    }

    /// The fence changes only where that can't take away the room for a stop: while nothing moves.
    fn put_fence(&mut self, corner_m: [f64; 2], batch: Batch) -> RequestAnswer {
        if !(self.stands() && self.record.state.pose_known) {
            return RequestAnswer::WrongPhase;
        }
        let poses = [self.limiter.setpoint().odom_from_body, self.record.state.odom_from_body];
        self.guard.put_fence(corner_m, batch, poses)
    }

    /// A request about what is followed.
    fn lead(&mut self, kind: RequestKind) -> RequestAnswer {
        let (time, phase) = (self.record.time, self.lifecycle.phase());
        let is_under_way = phase == Phase::Tracking;
        let fits = match kind {
            RequestKind::Pause => is_under_way,
            RequestKind::UseReference { .. } => phase != Phase::Stopping,
            _ => phase == Phase::Holding || is_under_way,
        };
        if !fits {
            return RequestAnswer::WrongPhase;
        }
        if self.lacks_pose_for(&kind) {
            return RequestAnswer::PoseUnknown;
        }
        let setpoint = self.limiter.setpoint();
        let from = From { time: &time, setpoint, is_under_way, settings: &self.settings, guard: &self.guard };
        let begun = match kind {
            // A way has nothing to be gone on with: it ends in a stop, and a path that it leads to can be resumed.
            RequestKind::Pause if matches!(self.motion.course(), Course::Way | Course::Onto) => {
                return self.lifecycle.request(&time, &RequestKind::Stop(StopCategory::RampAndHold)).0;
            }
            RequestKind::Pause => return answer(self.motion.pause()),
            RequestKind::UseReference { number } => {
                return answer(self.motion.use_offered(number, is_under_way));
            }
            RequestKind::GoTo { odom_from_body } if !odom_from_body.is_finite() => Err(CantBegin::Nothing),
            RequestKind::GoTo { odom_from_body } if !self.guard.room_left(&odom_from_body).is_enough() => {
                Err(CantBegin::OutsideFence)
            }
            RequestKind::GoTo { odom_from_body } if self.guard.is_blocked(&odom_from_body) => {
                Err(CantBegin::Blocked)
            }
            RequestKind::GoTo { odom_from_body } => self.motion.go(&from, odom_from_body),
            RequestKind::Resume => self.motion.resume(&from),
            _ => self.motion.track(&from),
        };
        if begun.is_ok() {
            self.motion.begin_with(self.guard.room_left(&setpoint.odom_from_body).room_m);
            self.lifecycle.request(&time, &kind);
        }
        answer(begun)
    }

    /// The drives change their mode by themselves where the new controller's commands need it.
    fn switch_controller(&mut self, index: usize) -> RequestAnswer {
        let Some(controller) = self.controllers.get_mut(index) else { return RequestAnswer::Refused };
        if index != self.active {
            controller.reset();
            self.active = index;
            // What waits was meant for the other one.
            self.settings.drop_waiting();
        }
        RequestAnswer::Taken
    }
}

fn taken_if(is_taken: bool) -> RequestAnswer {
    if is_taken { RequestAnswer::Taken } else { RequestAnswer::Refused }
}

fn answer(begun: Result<(), CantBegin>) -> RequestAnswer {
    match begun {
        Ok(()) => RequestAnswer::Taken,
        Err(CantBegin::Nothing) => RequestAnswer::Refused,
        Err(CantBegin::TooFar) => RequestAnswer::TooFar,
        Err(CantBegin::OutsideFence) => RequestAnswer::OutsideFence,
        Err(CantBegin::Blocked) => RequestAnswer::Blocked,
        Err(CantBegin::Moving) => RequestAnswer::Moving,
        Err(CantBegin::UnderWay) => RequestAnswer::WrongPhase,
    }
}
