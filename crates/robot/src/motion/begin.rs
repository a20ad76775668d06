//! How motions begin: from rest, or from the motion that is under way, which then goes over into the new one without a stop.
//!
//! A way begins with the platform's speed and acceleration. A reference, which rests at its start, is joined further on: at the first
//! place that the platform reaches in about the time that the reference itself takes to get there. What can't begin changes nothing.

use omnibase_platform::{Pose2, Twist2, wrap_angle_rad};

use super::foothold::{Foothold, SHARE_OF_PATH};
use super::room::Ahead;
use super::way::{Allowed, Then};
use super::{CantBegin, Motion, Pausing};
use crate::guard::Guard;
use crate::settings::Settings;
use crate::signals::{Course, CycleTime, Setpoint};
use crate::stages::Reference;

/// Nearer than this to where it was left, a reference goes on without a way back to it: m, and rad.
const ON_PATH: f64 = 1e-4;
/// A reference is joined at a rate at which it needs this part of the limits at most, and half of their accelerations: a way needs the rest.
pub(super) const JOIN_RATE: f64 = 0.7;
/// First time of a reference at which it may be joined, s; how many are tried, and by what factor each is later.
const JOIN_S: f64 = 0.05;
pub(super) const JOINS: i32 = 16;
const JOIN_FACTOR: f64 = 1.35;
/// A way onto a reference takes so much longer at most than the reference itself takes with the speed that is set.
const JOIN_LONGER: f64 = 1.25;
/// A way is planned anew where it came nearer to its end by so much since it was planned, m: that ends.
const GAINED_M: f64 = 0.02;

/// How far ahead on a reference a platform that moves may be at its start: so many looks, so far apart, s.
const BESIDE_S: f64 = 0.1;
const BESIDE_LOOKS: u32 = 15;
/// Slower than this it stands there, m/s and rad/s.
const ALL_BUT_REST: f64 = 0.01;
/// A platform that came to rest still settles: what that leaves of speed and acceleration, m/s, rad/s, m/s² and rad/s². The limiter
/// takes it away.
const SETTLES: f64 = 1e-4;
/// The number of a reference that was replaced.
const REPLACED: u32 = u32::MAX;

/// Where a way leads onto the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    at_ns: f64,
    rate: f64,
    /// By how much longer than it may be it takes, s.
    pub(super) longer_s: f64,
}

/// Whether a path goes on from where the platform is.
fn stands_at(here: &Pose2, place: &Pose2) -> bool {
    here.distance_m(*place) <= ON_PATH && (here.heading_rad - place.heading_rad).abs() <= ON_PATH
}

impl Joint {
    pub(super) fn is_quick(&self) -> bool {
        self.longer_s <= 0.0
    }
}

/// Where a motion begins, and what it must keep to.
#[derive(Clone, Copy)]
pub(crate) struct From<'a> {
    pub(crate) time: &'a CycleTime,
    /// What the platform was led to last.
    pub(crate) setpoint: Setpoint,
    /// Something is followed.
    pub(crate) is_under_way: bool,
    pub(crate) settings: &'a Settings,
    pub(crate) guard: &'a Guard,
}

impl From<'_> {
    fn pose(&self) -> Pose2 {
        self.setpoint.odom_from_body
    }

    fn moves(&self) -> bool {
        let settles = |twist: &Twist2| twist.speed_m_s() <= SETTLES && twist.w_rad_s.abs() <= SETTLES;
        !(settles(&self.setpoint.twist_in_odom) && settles(&self.setpoint.acceleration_in_odom))
    }

    fn room_m(&self) -> f64 {
        self.guard.room_left(&self.pose()).room_m
    }
}

impl Motion {
    /// Puts a reference in waiting; gives back the one that waited before, or that was replaced.
    pub(crate) fn offer(
        &mut self,
        number: u32,
        reference: Box<dyn Reference>,
    ) -> Option<(u32, Box<dyn Reference>)> {
        self.offered.replace((number, reference))
    }

    /// The reference that waits takes the place of the present one; where that is followed, once it is begun, or the present one came
    /// to its end.
    pub(crate) fn use_offered(&mut self, number: u32, is_under_way: bool) -> Result<(), CantBegin> {
        if self.offered.as_ref().is_none_or(|(offered, _)| *offered != number || number == REPLACED) {
            return Err(CantBegin::Nothing);
        }
        self.is_next = true;
        if !(is_under_way && self.needs_reference()) {
            self.take_next();
        }
        Ok(())
    }

    /// The next reference takes the place of the present one.
    fn take_next(&mut self) {
        let Some((number, reference)) = self.offered.as_mut().filter(|_| self.is_next) else { return };
        std::mem::swap(reference, &mut self.reference);
        // What was replaced is not offered again.
        self.number = std::mem::replace(number, REPLACED);
        (self.is_next, self.begun) = (false, false);
    }

    /// Nothing more is to come of the present reference where it is at its end and isn't followed.
    pub(crate) fn settle(&mut self, is_under_way: bool) {
        if self.is_next && !self.begun && !(is_under_way && self.needs_reference()) {
            self.take_next();
        }
    }

    /// Whether the reference is followed, or will be.
    pub(super) fn needs_reference(&self) -> bool {
        match self.course {
            Course::Reference => true,
            Course::Way => self.way.then != Then::Rests,
            Course::Velocity | Course::Onto => false,
        }
    }

    /// The next reference, or the present one, from its start.
    pub(crate) fn track(&mut self, from: &From<'_>) -> Result<(), CantBegin> {
        if !self.is_next {
            let is_followed = from.is_under_way && self.needs_reference();
            return if is_followed { Err(CantBegin::UnderWay) } else { self.begin_anew(from) };
        }
        let before = (self.number, self.begun, self.laid_from, self.time_ns);
        self.take_next();
        let begun = self.begin_anew(from);
        if let Err(_) = begun
            && let Some((number, reference)) = &mut self.offered
        {
            // What is under way goes on, and the next one is still the next.
            std::mem::swap(reference, &mut self.reference);
            *number = self.number;
            (self.number, self.begun, self.laid_from, self.time_ns) = before;
            self.is_next = true;
        }
        begun
    }

    fn begin_anew(&mut self, from: &From<'_>) -> Result<(), CantBegin> {
        let here = from.pose();
        if self.reference.start_pose().is_some_and(|start| !self.is_near(from, [start; 2]))
            && !self.is_beside(from)
        {
            return Err(CantBegin::TooFar);
        }
        let start = self.reference.start_pose().unwrap_or(here);
        let end = self.reference.end_pose(&here).unwrap_or(start);
        // Whoever stands too near to something already may leave it: the guard lets the way out pass alone.
        if !stands_at(&here, &start) && from.guard.is_blocked(&start) || from.guard.is_blocked(&end) {
            return Err(CantBegin::Blocked);
        }
        let laid_from = std::mem::replace(&mut self.laid_from, here);
        self.reference.start(&Setpoint::at_rest(here));
        if !from.moves() {
            self.time_ns = 0.0;
            self.begin_reference(from.time, 1.0);
            return Ok(());
        }
        let joined = self.join(from);
        if joined.is_err() {
            self.laid_from = laid_from;
            self.reference.start(&Setpoint::at_rest(laid_from));
        }
        joined
    }

    /// Whether the platform is where a motion may begin, between two poses of it.
    fn is_near(&self, from: &From<'_>, [one, other]: [Pose2; 2]) -> bool {
        let here = from.pose();
        let [along, way] = [here, other].map(|pose| [pose.x_m - one.x_m, pose.y_m - one.y_m]);
        let square = way[0] * way[0] + way[1] * way[1];
        let part = if square > 0.0 {
            ((along[0] * way[0] + along[1] * way[1]) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let off_m = (along[0] - part * way[0]).hypot(along[1] - part * way[1]);
        let turned_rad = one.heading_rad + part * (other.heading_rad - one.heading_rad);
        off_m <= self.start_distance_m
            && wrap_angle_rad(turned_rad - here.heading_rad).abs() <= self.start_heading_rad
    }

    /// Whether a platform that moves is on the way already with which the reference begins.
    fn is_beside(&self, from: &From<'_>) -> bool {
        let place =
            |look: u32| self.reference.preview(BESIDE_S * f64::from(look)).map(|at| at.odom_from_body);
        let mut looks = (1..=BESIDE_LOOKS).map_while(|look| Some([place(look - 1)?, place(look)?]));
        let twist = &from.setpoint.twist_in_odom;
        let moves = twist.speed_m_s() > ALL_BUT_REST || twist.w_rad_s.abs() > ALL_BUT_REST;
        moves && looks.any(|places| self.is_near(from, places))
    }

    /// A way onto the reference while moving.
    fn join(&mut self, from: &From<'_>) -> Result<(), CantBegin> {
        let allowed = self.allowed(from.settings);
        for number in 0..JOINS {
            let Some(joint) = self.joint(from, &allowed, 0.0, number) else { continue };
            if joint.is_quick() {
                self.time_ns = 0.0;
                self.take_joint(from.time, &joint);
                return Ok(());
            }
        }
        Err(CantBegin::Moving)
    }

    /// Tries a way onto the reference, the next but `number`, behind a time of its own, s.
    pub(super) fn joint(
        &mut self,
        from: &From<'_>,
        allowed: &Allowed,
        since_s: f64,
        number: i32,
    ) -> Option<Joint> {
        let end_s = self.reference.duration_s().unwrap_or(f64::INFINITY);
        let later_s = JOIN_S * JOIN_FACTOR.powi(number);
        let at_s = since_s + later_s;
        let place = self.reference.preview(at_s).filter(|_| at_s < end_s)?;
        let set = from.settings.rate(place.twist_in_odom);
        let rate = allowed.rate_at(&place).min(set);
        let to = Setpoint {
            twist_in_odom: place.twist_in_odom.scaled(rate),
            acceleration_in_odom: place.acceleration_in_odom.scaled(rate * rate),
            ..place
        };
        let is_there = self.tried.plan([&from.setpoint, &to], allowed).is_ok()
            && !from.guard.is_blocked(&to.odom_from_body)
            && !self.tried.leads_out(from.guard, from.room_m());
        is_there.then(|| Joint {
            at_ns: 1e9 * at_s,
            rate,
            longer_s: self.tried.duration_s() - JOIN_LONGER * later_s / set,
        })
    }

    /// The way that was tried last leads onto the reference.
    pub(super) fn take_joint(&mut self, time: &CycleTime, joint: &Joint) {
        let Joint { at_ns, rate, .. } = *joint;
        self.take_way(time, Then::Joins { at_ns, rate });
        self.begun = true;
    }

    /// The reference from where it was left: first the way back to it. One that is being paused goes on at once.
    pub(crate) fn resume(&mut self, from: &From<'_>) -> Result<(), CantBegin> {
        if from.is_under_way && self.needs_reference() {
            let is_pausing = self.course == Course::Reference && self.pausing == Pausing::Yes;
            self.pausing = if is_pausing { Pausing::No } else { self.pausing };
            return if is_pausing { Ok(()) } else { Err(CantBegin::UnderWay) };
        }
        if !self.begun {
            return Err(CantBegin::Nothing);
        }
        let left = self.reference.sample(self.time_s()).odom_from_body;
        let end = self.reference.duration_s().and_then(|end_s| self.reference.preview(end_s));
        let here = from.pose();
        let is_there = stands_at(&here, &left);
        let is_blocked = |pose: &Pose2| from.guard.is_blocked(pose);
        if !is_there && is_blocked(&left) || end.is_some_and(|end| is_blocked(&end.odom_from_body)) {
            return Err(CantBegin::Blocked);
        }
        if is_there && !from.moves() {
            self.begin_reference(from.time, 0.0);
            return Ok(());
        }
        self.plan_way(from, left)?;
        self.begin_reference(from.time, 0.0);
        self.take_way(from.time, Then::GoesOn);
        Ok(())
    }

    /// The way to a pose.
    pub(crate) fn go(&mut self, from: &From<'_>, to: Pose2) -> Result<(), CantBegin> {
        self.plan_way(from, to)?;
        self.take_way(from.time, Then::Rests);
        Ok(())
    }

    fn plan_way(&mut self, from: &From<'_>, to: Pose2) -> Result<(), CantBegin> {
        let allowed = self.allowed(from.settings);
        let ends = [&from.setpoint, &Setpoint::at_rest(to)];
        self.tried.plan(ends, &allowed).map_err(|_| CantBegin::Nothing)?;
        // From rest it is straight, and what lies on it is seen when it comes near.
        if from.moves() && self.tried.leads_out(from.guard, from.room_m()) {
            return Err(CantBegin::OutsideFence);
        }
        Ok(())
    }

    pub(super) fn allowed(&self, settings: &Settings) -> Allowed {
        let share = self.carried.share;
        let share = if share >= 1.0 { 1.0 } else { SHARE_OF_PATH * share };
        Allowed { limits: self.limits, speeds: settings.speeds(), share }
    }

    /// The way that was planned last is gone, from the last cycle's setpoint.
    fn take_way(&mut self, time: &CycleTime, then: Then) {
        std::mem::swap(&mut self.way, &mut self.tried);
        (self.way.then, self.was_hindered) = (then, false);
        self.planned = self.way.middle();
        (self.rate_now, self.rate_change_1_s, self.own) = (1.0, 0.0, Default::default());
        self.rate.restart(Twist2::new(1.0, 0.0, 0.0));
        self.headway.begin();
        (self.course, self.now_ns) = (Course::Way, time.now_ns.saturating_sub(time.period_ns));
    }

    /// A way that an obstacle bent is planned anew from where the platform got to, and one for which more speed is set.
    pub(super) fn plan_anew(
        &mut self,
        time: &CycleTime,
        setpoint: &Setpoint,
        settings: &Settings,
        guard: &Guard,
    ) {
        if matches!(self.way.then, Then::Joins { .. })
            || self.is_hindered
            || self.way.is_over() && !self.was_hindered
        {
            return;
        }
        let is_bent = self.was_hindered && self.way.gained_m(&setpoint.odom_from_body) >= GAINED_M;
        let is_slow = !self.was_hindered && self.way.may_be_faster(settings.speeds());
        if is_bent || is_slow {
            let from = From { time, setpoint: *setpoint, is_under_way: true, settings, guard };
            let (to, then) = (self.way.to, self.way.then);
            match self.plan_way(&from, to) {
                Ok(()) => self.take_way(time, then),
                Err(_) => self.was_hindered = false,
            }
        }
    }

    pub(super) fn begin_reference(&mut self, time: &CycleTime, rate: f64) {
        self.foothold = Foothold::NEW;
        (self.course, self.is_on_plan) = (Course::Reference, true);
        self.warm_rate = self.reference.planned_for().map_or(1.0, |plan| self.carried.warm_rate(&plan));
        let rate = rate.min(self.foothold());
        self.rate.restart(Twist2::new(rate, 0.0, 0.0));
        self.ahead = Ahead::from(self.time_s());
        (self.rate_now, self.rate_change_1_s, self.own) = (rate, 0.0, Default::default());
        self.headway.begin();
        (self.pausing, self.begun, self.now_ns) = (Pausing::No, true, time.now_ns);
        self.was_hindered = false;
    }

    /// A way that leads back to the reference ends: the reference goes on from where it stands.
    pub(crate) fn arrive(&mut self, time: &CycleTime, setpoint: &Setpoint) {
        let is_there = setpoint.odom_from_body.distance_m(self.way.to) <= ON_PATH;
        if self.course == Course::Way && self.way.then == Then::GoesOn && is_there && self.way.is_over() {
            self.begin_reference(time, 0.0);
        }
    }
}
