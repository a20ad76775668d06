//! All that tells of the platform's motion in one estimate.
//!
//! Two frames, as REP-105 has them. In map the platform is where the filter believes it to be, which may jump when
//! something new is heard. odom is smooth: it moves as wheels and what was learnt of them say, and where `task_frame` is
//! `map` it is drawn to map as softly as control can follow. At rest it isn't: nothing moves because a sensor says so.

use omnibase_fusion::{Filter, FilterSettings, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::{BodyStep, Pose2, PoseGrowth, wrap_angle_rad};

use super::{WheelOdometry, covariance_settings};
use crate::config::{InputOwner, RobotPlan, SensorPlan, TaskFrame};
use crate::registry::Made;
use crate::signals::{Exchange, FusionReport, Inputs, PlatformState, ReferenceStatus, SensorReport};
use crate::stages::{Estimator, Observation};

/// How fast odom is drawn to map: natural frequency of a critically damped filter, rad/s.
const DRAWN_RAD_S: f64 = 10.0;
/// How fast it moves by that at most, m/s and rad/s: slow against what platforms drive.
const DRAWN_AT_MOST: [f64; 2] = [0.1, 0.2];
/// Beyond these standard deviations the pose counts as unknown where the file doesn't say, m and rad.
const UNKNOWN_SIGMA: [f64; 2] = [0.1, 0.1];
/// A heading known no better than this, rad, is no place to begin from: the next pose is taken as it comes.
const PLACED_SIGMA_RAD: f64 = 0.5;

/// Wheels, and what tells of the motion beside them.
pub struct Fused {
    wheels: WheelOdometry,
    filter: Filter,
    sensors: Vec<SensorPlan>,
    input_age_ns: u64,
    /// How old what each SubDevice without a wheel says is when it comes, ns.
    device_ages_ns: Vec<u64>,
    /// What a flow sensor told last: its instant, ns, and its way, m.
    flows: Vec<Option<(u64, [f64; 2])>>,
    task_frame: TaskFrame,
    unknown_sigma: [f64; 2],
    /// The wheels' own pose after the last cycle.
    wheels_from: Pose2,
    odom_from_body: Pose2,
    /// How fast odom is drawn in body axes, m/s and rad/s.
    drawn: [f64; 3],
    report: FusionReport,
    /// Radius of a wheel and its distance from the middle, for what rolled unread, m.
    wheel_m: [f64; 2],
}

impl Fused {
    /// As a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let wheels = WheelOdometry::new(plan)?;
        let settings =
            FilterSettings::new(&plan.kinematics, covariance_settings(&plan.estimator), plan.bus.cycle_ns);
        let models: Vec<Sensor> = plan.sensors.iter().map(|sensor| sensor.sensor).collect();
        let [sigma_m, sigma_rad] = UNKNOWN_SIGMA;
        let all = plan.kinematics.wheels();
        let greatest =
            |value: &dyn Fn(&omnibase_platform::Wheel) -> f64| all.iter().map(value).fold(0.0, f64::max);
        Ok(Fused {
            wheels,
            filter: Filter::new(settings, &models),
            flows: vec![None; plan.sensors.len()],
            sensors: plan.sensors.clone(),
            input_age_ns: plan.input_age_ns(),
            device_ages_ns: plan.devices.iter().map(|device| device.input_age_ns(&plan.bus)).collect(),
            task_frame: plan.estimator.task_frame.unwrap_or_default(),
            unknown_sigma: [
                plan.estimator.unknown_sigma_m.unwrap_or(sigma_m),
                plan.estimator.unknown_sigma_rad.unwrap_or(sigma_rad),
            ],
            wheels_from: Pose2::default(),
            odom_from_body: Pose2::default(),
            drawn: [0.0; 3],
            report: FusionReport::default(),
            wheel_m: [
                greatest(&|wheel| wheel.radius_m),
                greatest(&|wheel| wheel.position_m[0].hypot(wheel.position_m[1])).max(1e-3),
            ],
        })
    }

    fn has_poses(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.sensor.kind == SensorKind::Pose)
    }

    fn follows_map(&self) -> bool {
        self.task_frame == TaskFrame::Map
    }

    /// Gives the filter what came in since the last cycle.
    fn hear(&mut self, observation: &Observation<'_>) {
        for place in 0..self.sensors.len() {
            let sensor = &self.sensors[place];
            let instant_ns = match sensor.from {
                InputOwner::Device(device) => {
                    let is_fresh = observation.inputs.device_age_s(device) == Some(0.0);
                    is_fresh.then(|| observation.time.now_ns.saturating_sub(self.device_ages_ns[device]))
                }
                InputOwner::Source(source) => observation.inputs.heard_ns(source),
            };
            let Some(instant_ns) = instant_ns.map(|instant_ns| instant_ns.saturating_sub(sensor.delay_ns))
            else {
                continue;
            };
            if let Some(reading) = reading(sensor, instant_ns, &observation.inputs, &mut self.flows[place]) {
                self.filter.hear(place, reading.0, &reading.1);
            }
        }
    }

    /// Where odom goes: as wheels and what is known of them say, and softly to map while something is followed.
    fn draw(&mut self, observation: &Observation<'_>, step: BodyStep, map_from_body: Pose2) {
        let period_s = observation.time.period_s();
        let is_followed =
            matches!(observation.wished.status, ReferenceStatus::Moving | ReferenceStatus::Finished);
        if observation.is_free {
            // In the turn in which odom is.
            let now_rad = self.odom_from_body.heading_rad;
            let heading_rad = now_rad + wrap_angle_rad(map_from_body.heading_rad - now_rad);
            self.odom_from_body = Pose2 { heading_rad, ..map_from_body };
            self.drawn = [0.0; 3];
            return;
        }
        if !is_followed {
            self.drawn = [0.0; 3];
            self.odom_from_body = self.odom_from_body.moved_by(step);
            return;
        }
        let odom = self.odom_from_body.moved_by(self.filter.corrected(step, period_s));
        let off = odom.inverse().then(map_from_body);
        let off = [off.x_m, off.y_m, wrap_angle_rad(off.heading_rad)];
        let w = DRAWN_RAD_S;
        for (drawn, off) in self.drawn.iter_mut().zip(off) {
            *drawn += (w * w * off - 2.0 * w * *drawn) * period_s;
        }
        let [x, y, turn] = self.drawn;
        let [most_m_s, most_rad_s] = DRAWN_AT_MOST;
        let share = (most_m_s / x.hypot(y)).min(most_rad_s / turn.abs()).min(1.0);
        self.drawn = self.drawn.map(|drawn| drawn * share);
        let [x, y, turn] = self.drawn.map(|drawn| drawn * period_s);
        self.odom_from_body = odom.moved_by(BodyStep::new(x, y, turn));
    }

    /// What wheels may have rolled unread, m and rad.
    fn unread(&self, observation: &Observation<'_>) -> [f64; 2] {
        let [radius_m, arm_m] = self.wheel_m;
        let square: f64 = observation.unread_rad.iter().map(|unread_rad| unread_rad * unread_rad).sum();
        // Evenly spread over both ways.
        let way_m = radius_m * (square / 3.0).sqrt();
        [way_m, way_m / arm_m]
    }
}

impl Estimator for Fused {
    fn reset(&mut self, from: &PlatformState) {
        self.wheels.reset(from);
        self.wheels_from = self.wheels.pose();
        self.odom_from_body = self.wheels_from;
        self.drawn = [0.0; 3];
        let is_placed = !self.has_poses() || from.covariance[5] < PLACED_SIGMA_RAD * PLACED_SIGMA_RAD;
        self.filter.place(self.wheels_from, from.covariance, is_placed);
        self.flows.fill(None);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        let state = self.wheels.update(observation);
        if self.sensors.is_empty() {
            return state;
        }
        let from = std::mem::replace(&mut self.wheels_from, state.odom_from_body);
        let body_from_next = from.inverse().then(state.odom_from_body);
        // The instant at which the drives read their encoders.
        let inputs_ns = observation.time.now_ns.saturating_sub(self.input_age_ns);
        self.filter.advance(
            inputs_ns,
            &Motion {
                body_from_next,
                slip_m_s: observation.slip_m_s,
                unread: self.unread(observation),
                is_heard: observation.exchange == Exchange::Complete,
                is_free: observation.is_free,
            },
        );
        self.hear(observation);
        let estimate = self.filter.estimate();
        self.report = FusionReport {
            map_from_body: estimate.map_from_body,
            covariance: estimate.covariance,
            is_placed: estimate.is_placed,
            ..FusionReport::default()
        };
        for (sensor, report) in self.report.sensors.iter_mut().enumerate().take(self.sensors.len()) {
            let (verdict, nis) = self.filter.verdict(sensor);
            *report = SensorReport { verdict, nis };
        }
        if !self.follows_map() {
            return state;
        }
        self.draw(observation, body_from_next.log(), estimate.map_from_body);
        // What odom is off yet is as wrong as what isn't known.
        let off = self.odom_from_body.inverse().then(estimate.map_from_body);
        let mut covariance = estimate.covariance;
        let off_m2 = off.x_m * off.x_m + off.y_m * off.y_m;
        covariance[0] += off_m2;
        covariance[3] += off_m2;
        covariance[5] += wrap_angle_rad(off.heading_rad).powi(2);
        let sigma_m = covariance[0].max(covariance[3]).sqrt();
        let [unknown_m, unknown_rad] = self.unknown_sigma;
        let pose_known = !self.has_poses()
            || estimate.is_placed && sigma_m <= unknown_m && covariance[5].sqrt() <= unknown_rad;
        PlatformState { odom_from_body: self.odom_from_body, covariance, pose_known, ..state }
    }

    fn sees_beyond_wheels(&self) -> bool {
        self.has_poses() && self.follows_map()
    }

    fn growth(&self) -> PoseGrowth {
        self.wheels.growth()
    }

    fn fusion(&self) -> FusionReport {
        self.report
    }
}

/// What a sensor says now, with its instant; `None` where it says nothing that can be used.
fn reading(
    sensor: &SensorPlan,
    instant_ns: u64,
    inputs: &Inputs<'_>,
    flow: &mut Option<(u64, [f64; 2])>,
) -> Option<(u64, Reading)> {
    let value = |n: usize| inputs.at(*sensor.inputs.get(n)?);
    let scale = sensor.scale;
    Some(match sensor.sensor.kind {
        SensorKind::Turn => (instant_ns, Reading::Turn(scale * value(0)?)),
        SensorKind::Inertial => {
            let acceleration = [value(1)?, value(2)?];
            (instant_ns, Reading::Inertial { turn: value(0)?, acceleration })
        }
        SensorKind::Flow => {
            let now = [scale * value(0)?, scale * value(1)?];
            let (before_ns, before) = flow.replace((instant_ns, now))?;
            let time_ns = instant_ns.checked_sub(before_ns).filter(|time_ns| *time_ns > 0)?;
            let time_s = time_ns as f64 * 1e-9;
            // The mean over the time between belongs to its middle. Too long a time tells nothing of a moment.
            let flow = [0, 1].map(|n| (now[n] - before[n]) / time_s);
            (time_s < 0.1).then_some((instant_ns - time_ns / 2, Reading::Flow(flow)))?
        }
        SensorKind::Twist => (instant_ns, Reading::Twist([value(0)?, value(1)?, value(2)?])),
        SensorKind::Pose => {
            let map_from_sensor = Pose2::new(value(0)?, value(1)?, value(2)?);
            let mut covariance = [0.0; 6];
            for (n, covariance) in
                covariance.iter_mut().enumerate().take(sensor.inputs.len().saturating_sub(3))
            {
                *covariance = value(3 + n)?;
            }
            (instant_ns, Reading::Pose { map_from_sensor, covariance })
        }
    })
}
