//! What is wished in a cycle, and what the platform's limits leave of it.

use omnibase_platform::Pose2;

use super::Robot;
use crate::guard::Drive;
use crate::signals::{Frame, LimitedBy, Phase, ReferenceStatus, Request, RequestKind, Setpoint};

/// A robot that holds ends its way to a place that is nearer than this, m and rad; and where fence or obstacles hold it back.
const SETTLES: f64 = 1e-4;
const HELD: f64 = 1e-5;

impl Robot {
    /// Reference: what is wished. A robot that doesn't track wishes to stay where it is, or to come to rest.
    pub(super) fn wish(&mut self) -> Setpoint {
        let here = self.record.state.odom_from_body;
        if !matches!(self.lifecycle.phase(), Phase::Holding | Phase::Stopping) {
            // Who holds or stops stays beside what it was led to.
            self.record.correction = Pose2::default();
        }
        match self.lifecycle.phase() {
            Phase::Disabled | Phase::Enabling | Phase::QuickStopping | Phase::Fault => {
                Setpoint::at_rest(here)
            }
            Phase::Holding => {
                let [wished, here] =
                    [self.record.wished, self.limiter.setpoint()].map(|at| at.odom_from_body);
                // Who was kept from where he should be doesn't go there once nothing keeps him from it any more.
                let settles = if self.guard.limited_by() == LimitedBy::Nothing { SETTLES } else { HELD };
                let is_there = here.distance_m(wished) <= settles
                    && (here.heading_rad - wished.heading_rad).abs() <= settles;
                let place = if is_there { wished } else { here };
                Setpoint { status: ReferenceStatus::Resting, ..Setpoint::at_rest(place) }
            }
            Phase::Stopping => Setpoint::at_rest(self.limiter.setpoint().odom_from_body),
            Phase::Tracking => match self.motion.velocity() {
                Some(&request) => self.velocity_wish(&request),
                None => {
                    let (inputs, mut outputs) = self.peripherals.open(&self.record.signals);
                    self.motion.signals(&inputs, &mut outputs);
                    let wished = self.motion.sample(
                        &self.record.time,
                        &self.limiter.setpoint(),
                        &self.settings,
                        &self.guard,
                    );
                    self.record.correction = self.motion.correction();
                    wished
                }
            },
        }
    }

    /// A velocity command as a setpoint: its pose is where the platform will be led.
    fn velocity_wish(&self, request: &Request) -> Setpoint {
        let RequestKind::Velocity { twist, frame } = request.kind else {
            return self.limiter.setpoint();
        };
        let now = self.limiter.setpoint();
        let mut twist_in_odom = match frame {
            Frame::Body => twist.rotated(now.odom_from_body.heading_rad),
            Frame::Odom => twist,
        };
        twist_in_odom = self.reduced(self.settings.slowed(twist_in_odom));
        Setpoint { twist_in_odom, status: ReferenceStatus::Moving, ..Setpoint::at_rest(now.odom_from_body) }
    }

    /// The platform's limits on speed, acceleration and jerk.
    pub(super) fn limit(&mut self) -> Setpoint {
        let wished = self.record.wished;
        let state = &self.record.state;
        let holding = self.limiter.leading_to(&wished);
        let mut guarded = |drive: Drive<'_>| self.guard.step(&mut self.limiter, drive, state);
        let limited = match self.lifecycle.phase() {
            Phase::Disabled | Phase::Enabling | Phase::QuickStopping | Phase::Fault => {
                self.limiter.reset(wished.odom_from_body);
                self.limiter.setpoint()
            }
            Phase::Stopping => guarded(Drive::Stop),
            // Fence and obstacles stand in odom, of which nothing is known: a person who sees the platform leads it.
            Phase::Tracking if !self.record.state.pose_known => {
                self.limiter.set_limits(&self.traction.limits());
                self.limiter.toward(wished.twist_in_odom)
            }
            Phase::Tracking if self.motion.velocity().is_some() => {
                guarded(Drive::Toward(wished.twist_in_odom))
            }
            Phase::Tracking => {
                let followed = guarded(Drive::Follow(&self.motion.followed(&wished)));
                let is_hindered = self.guard.limited_by() != LimitedBy::Nothing;
                self.motion.note(&wished, &followed, is_hindered);
                followed
            }
            // A robot that nobody leads stays, whatever comes near it: it gives way to nothing by itself.
            Phase::Holding => guarded(Drive::Toward(holding)),
        };
        // A platform that something holds back may rest, and isn't there yet.
        let is_held_back =
            self.guard.limited_by() != LimitedBy::Nothing && wished.status != ReferenceStatus::Resting;
        let rests =
            (self.limiter.is_at_rest() && !is_held_back) || self.limiter.has_reached(&wished.odom_from_body);
        let status = if rests { wished.status } else { ReferenceStatus::Moving };
        Setpoint { status, ..limited }
    }
}
