//! The robot's file against itself: everything that can be found without hardware.

use std::fmt::Display;

use super::drives;
use super::file::*;
use super::guard_check;
use super::plan::*;
use super::platform;
use super::problem::{Problem, ProblemKind};
use super::sdo_writes;
use super::source::{Locations, Source, nearest};
use super::torque_limit;
use crate::registry::Registry;
use crate::signals::{SafetyAction, StopCategory};

/// Lost exchanges in a row that are tolerated by default.
const LOST_EXCHANGES_TOLERATED: u32 = 3;
/// The drives' watchdog by default, us: that of the standard after power-on.
const DRIVE_WATCHDOG_US: u32 = 100_000;

/// Reads files that the robot's file names; the answer is the text, or why there is none.
pub type ReadFile<'a> = &'a dyn Fn(&str) -> Result<String, String>;

impl RobotPlan {
    /// Reads and checks a robot's file: the plan, or every problem at once in the order of the file.
    pub fn from_toml(
        text: &str,
        registry: &Registry,
        read_file: ReadFile<'_>,
    ) -> Result<RobotPlan, Vec<Problem>> {
        RobotPlan::check(Source::read(text, None), registry, read_file)
    }

    /// Checks a robot's file that was read: the plan, or every problem at once in the order of the file.
    pub fn check(
        source: Source<RobotFile>,
        registry: &Registry,
        read_file: ReadFile<'_>,
    ) -> Result<RobotPlan, Vec<Problem>> {
        let Source { file, locations, problems } = source;
        let mut check = Check { locations, problems };
        let plan = check.robot(file, registry, read_file);
        let mut problems = check.problems;
        problems.sort_by_key(|problem| {
            problem.place.as_ref().map_or((true, 0), |place| (place.file.is_some(), place.span.start))
        });
        match plan {
            Some(plan) if problems.is_empty() => Ok(plan),
            _ => Err(problems),
        }
    }
}

/// Collects problems while a file is resolved.
pub(super) struct Check {
    pub(super) locations: Locations,
    pub(super) problems: Vec<Problem>,
}

impl Check {
    pub(super) fn report(&mut self, kind: ProblemKind, setting: &str, reason: impl Display) -> &mut Problem {
        let place = self.locations.place(setting);
        self.problems.push(Problem {
            kind,
            setting: setting.into(),
            value: None,
            limit: None,
            reason: reason.to_string(),
            place,
        });
        self.problems.last_mut().expect("just pushed")
    }

    /// A setting that must be there. One whose value was refused already isn't reported twice.
    pub(super) fn need<T>(&mut self, value: Option<T>, setting: &str, why: &str) -> Option<T> {
        if value.is_none() && !self.refused(setting) {
            self.report(ProblemKind::Missing, setting, format_args!("must be given: {why}"));
        }
        value
    }

    /// Whether something was said about a setting already.
    pub(super) fn refused(&self, setting: &str) -> bool {
        let (table, key) = setting.rsplit_once('.').unwrap_or(("", setting));
        self.problems.iter().any(|problem| {
            let of_table = problem.setting.rsplit_once('.').map_or("", |(table, _)| table) == table;
            problem.setting == setting
                || problem.setting.starts_with(&format!("{setting}["))
                || (of_table
                    && problem.kind == ProblemKind::WrongUnit
                    && problem.limit.as_deref() == Some(key))
        })
    }

    pub(super) fn known_name(&mut self, setting: &str, name: &str, known: &[&str]) -> Option<()> {
        if known.contains(&name) {
            return Some(());
        }
        let reason = match nearest(name, known.iter().copied()) {
            Some(near) => format!("nothing is registered by this name; did you mean `{near}`?"),
            None => "nothing is registered by this name".to_string(),
        };
        let problem = self.report(ProblemKind::UnknownName, setting, reason);
        problem.value = Some(format!("\"{name}\""));
        problem.limit = Some(known.join(", "));
        None
    }

    fn robot(&mut self, file: RobotFile, registry: &Registry, read_file: ReadFile<'_>) -> Option<RobotPlan> {
        let name = self.need(file.name.clone(), "name", "recordings and reports carry it");
        let bus = self.bus(&file.bus, &file.safety);
        let sdo_writes = file.bus.sdo_write_while_enabled.as_deref().unwrap_or_default();
        let sdo_write_while_enabled = sdo_writes::resolve(self, sdo_writes);
        let drives = drives::resolve(self, &file.drive_defaults, &file.drive, registry, read_file);
        let kinematics = platform::resolve(self, &file.platform, file.drive.len());
        let limits = self.limits(&file.limits);
        let safety = self.safety(&file.safety);
        let guard = guard_check::resolve(self, &file, kinematics.as_ref());
        let controller = self.controller(file.controller, registry);
        let estimator = file.estimator;
        let estimator_kind = estimator.kind.as_deref().unwrap_or("wheel_odometry");
        let estimator_known = self.known_name("estimator.kind", estimator_kind, &registry.estimators());
        let reference = self.reference(file.reference, registry, read_file);
        self.joystick(&file.joystick);
        self.simulation(&file.simulation);
        if let (Some(reference), Some(limits)) = (&reference, &limits) {
            self.reachable(reference, limits);
        }
        let (limits, mut drives) = (limits?, drives?);
        self.motors_reach_limits(&drives, &limits);
        torque_limit::resolve(self, &mut drives, &limits);
        if let Some(controller) = &controller {
            self.targets_are_mapped(&drives, controller);
        }
        estimator_known?;
        Some(RobotPlan {
            name: name?,
            bus: bus?,
            sdo_write_while_enabled,
            drives,
            kinematics: kinematics?,
            limits,
            estimator,
            controller: controller?,
            reference: reference?,
            safety,
            joystick: file.joystick,
            guard: guard?,
            simulation: file.simulation,
        })
    }

    fn bus(&mut self, table: &BusTable, safety: &SafetyTable) -> Option<BusPlan> {
        let cycle_us = self.need(table.cycle_us, "bus.cycle_us", "everything is timed by it")?;
        let synchronisation = table.synchronisation.unwrap_or(Synchronisation::Sync0);
        let timeout_us = table.receive_timeout_us.unwrap_or(cycle_us / 2);
        if timeout_us >= cycle_us {
            let reason = "the answer must be there before the next cycle";
            let problem = self.report(ProblemKind::OutOfRange, "bus.receive_timeout_us", reason);
            problem.value = Some(timeout_us.to_string());
            problem.limit = Some(format!("below cycle_us = {cycle_us}"));
        }
        let half_cycle_us = i32::try_from(cycle_us / 2).unwrap_or(i32::MAX);
        let drive_watchdog = self.drive_watchdog(safety, cycle_us);
        Some(BusPlan {
            cycle_ns: u64::from(cycle_us) * 1000,
            receive_timeout_ns: u64::from(timeout_us) * 1000,
            synchronisation,
            sync0_shift_ns: table.sync0_shift_us.unwrap_or(half_cycle_us).saturating_mul(1000),
            clock_source: table.clock_source.unwrap_or(ClockSource::DistributedClock),
            drive_watchdog: drive_watchdog?,
        })
    }

    /// Chips count steps: what they can't represent is refused, not rounded. A watchdog that bites before the policy
    /// for lost exchanges does would take the ramp away from it.
    fn drive_watchdog(&mut self, table: &SafetyTable, cycle_us: u32) -> Option<DriveWatchdog> {
        const KEY: &str = "safety.drive_watchdog_us";
        let us = table.drive_watchdog_us.unwrap_or(DRIVE_WATCHDOG_US);
        let Some(watchdog) = DriveWatchdog::from_us(us) else {
            let below = us / DriveWatchdog::STEP_US * DriveWatchdog::STEP_US;
            let reason = "the drives' watchdog counts whole steps of 100 us";
            let problem = self.report(ProblemKind::OutOfRange, KEY, reason);
            problem.value = Some(us.to_string());
            problem.limit = Some(format!("{below} or {}", below.saturating_add(DriveWatchdog::STEP_US)));
            return None;
        };
        let tolerated = table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED);
        let least_us = cycle_us.saturating_mul(tolerated.saturating_add(2));
        if table.drive_watchdog_us.is_some() && us < least_us {
            let reason =
                format!("it would stop the drives while {tolerated} lost exchanges are still tolerated");
            let problem = self.report(ProblemKind::Contradiction, KEY, reason);
            problem.value = Some(us.to_string());
            problem.limit = Some(format!("from {least_us}, two cycles more than are tolerated"));
        }
        Some(watchdog)
    }

    fn limits(&mut self, table: &LimitsTable) -> Option<Limits> {
        let mut limit = |value: Option<f64>, key: &str| {
            self.need(value, &format!("limits.{key}"), "without its limits no drive is enabled")
        };
        let speed_m_s = limit(table.speed_m_s, "speed_m_s");
        let acceleration_m_s2 = limit(table.acceleration_m_s2, "acceleration_m_s2");
        let jerk_m_s3 = limit(table.jerk_m_s3, "jerk_m_s3");
        let turn_speed_rad_s = limit(table.turn_speed_rad_s, "turn_speed_rad_s");
        let turn_acceleration_rad_s2 = limit(table.turn_acceleration_rad_s2, "turn_acceleration_rad_s2");
        let turn_jerk_rad_s3 = limit(table.turn_jerk_rad_s3, "turn_jerk_rad_s3");
        let wheel_speed_rad_s = limit(table.wheel_speed_rad_s, "wheel_speed_rad_s");
        let wheel_torque_nm = limit(table.wheel_torque_nm, "wheel_torque_nm");
        Some(Limits {
            speed_m_s: speed_m_s?,
            acceleration_m_s2: acceleration_m_s2?,
            jerk_m_s3: jerk_m_s3?,
            turn_speed_rad_s: turn_speed_rad_s?,
            turn_acceleration_rad_s2: turn_acceleration_rad_s2?,
            turn_jerk_rad_s3: turn_jerk_rad_s3?,
            wheel_speed_rad_s: wheel_speed_rad_s?,
            wheel_torque_nm: wheel_torque_nm?,
        })
    }

    fn safety(&mut self, table: &SafetyTable) -> SafetyPlan {
        let ns = |ms: Option<u32>, default_ms: u32| u64::from(ms.unwrap_or(default_ms)) * 1_000_000;
        let stop = |name: Option<StopName>, default: StopName| match name.unwrap_or(default) {
            StopName::Category0 => StopCategory::RemoveTorque,
            StopName::Category1 => StopCategory::RampThenRemove,
            StopName::Category2 => StopCategory::RampAndHold,
        };
        SafetyPlan {
            lost_exchanges_tolerated: table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED),
            lost_device_stop: match table.on_lost_device.unwrap_or(LostDeviceName::QuickStop) {
                LostDeviceName::QuickStop => SafetyAction::QuickStop,
                LostDeviceName::Ramp => SafetyAction::Stop(StopCategory::RampThenRemove),
                LostDeviceName::RemoveTorque => SafetyAction::Stop(StopCategory::RemoveTorque),
            },
            comeback: match table.after_lost_device.unwrap_or(ComebackName::Stay) {
                ComebackName::Stay => None,
                ComebackName::Hold => Some(ComebackEnd::Hold),
                ComebackName::MoveAgainUnattended => {
                    Some(ComebackEnd::MoveAgain { warning_ns: ns(table.move_again_warning_ms, 5000) })
                }
            }
            .map(|end| ComebackPlan {
                end,
                within_ns: ns(table.lost_device_wait_ms, 30_000),
                steady_ns: ns(table.steady_before_comeback_ms, 1000),
                lost_exchanges_tolerated: table.lost_exchanges_tolerated.unwrap_or(LOST_EXCHANGES_TOLERATED),
            }),
            command_age_ns: ns(table.command_age_ms, 200),
            enabling_timeout_ns: ns(table.enabling_timeout_ms, 5000),
            stop_timeout_ns: ns(table.stop_timeout_ms, 5000),
            tracking_error_m: table.tracking_error_m.unwrap_or(0.5),
            start_distance_m: table.start_distance_m.unwrap_or(0.05),
            start_heading_rad: table.start_heading_rad.unwrap_or(0.1),
            wheel_speed_stop: stop(table.wheel_speed_stop, StopName::Category1),
            reference_speed_stop: stop(table.reference_speed_stop, StopName::Category1),
            fence_stop: stop(table.fence_stop, StopName::Category2),
            tracking_error_stop: stop(table.tracking_error_stop, StopName::Category1),
            wheel_torque_stop: stop(table.wheel_torque_stop, StopName::Category1),
            wheel_torque_margin_nm: table.wheel_torque_margin_nm,
            wheel_torque_time_ns: ns(table.wheel_torque_time_ms, 50),
        }
    }

    fn controller(&mut self, table: ControllerTable, registry: &Registry) -> Option<ControllerTable> {
        let kind = self.need(table.kind.clone(), "controller.kind", "there is no default control law")?;
        self.known_name("controller.kind", &kind, &registry.controllers())?;
        let others = table.others.iter().flatten();
        for (index, other) in others.clone().enumerate() {
            self.known_name(&format!("controller.others[{index}]"), other, &registry.controllers())?;
        }
        if kind == "adaptive_torque" || others.clone().any(|other| other == "adaptive_torque") {
            let why = "adaptive_torque starts from it";
            self.need(table.mass_kg, "controller.mass_kg", why);
            self.need(table.inertia_kg_m2, "controller.inertia_kg_m2", why);
        }
        self.estimate("mass", table.mass_kg, table.mass_bounds_kg, "kg");
        self.estimate("inertia", table.inertia_kg_m2, table.inertia_bounds_kg_m2, "kg_m2");
        if let (Some(first), Some(greatest)) = (table.friction_n, table.friction_max_n)
            && first > greatest
        {
            let reason = "the first estimate must lie within its bound";
            let problem = self.report(ProblemKind::OutOfRange, "controller.friction_n", reason);
            problem.value = Some(first.to_string());
            problem.limit = Some(format!("at most friction_max_n = {greatest}"));
        }
        if let Some(negative) = table.kp_1_s.unwrap_or_default().iter().find(|gain| **gain < 0.0) {
            let reason = "a negative gain drives away from the path";
            let problem = self.report(ProblemKind::OutOfRange, "controller.kp_1_s", reason);
            problem.value = Some(negative.to_string());
            problem.limit = Some("at least 0".into());
        }
        Some(table)
    }

    fn estimate(&mut self, what: &str, first: Option<f64>, bounds: Option<[f64; 2]>, unit: &str) {
        let Some([low, high]) = bounds else { return };
        if !(low > 0.0 && low < high) {
            let setting = format!("controller.{what}_bounds_{unit}");
            let problem =
                self.report(ProblemKind::OutOfRange, &setting, "bounds rise, and nothing weighs nothing");
            problem.value = Some(format!("[{low}, {high}]"));
            problem.limit = Some("0 < first < second".into());
        } else if let Some(first) = first
            && !(low..=high).contains(&first)
        {
            let reason = "the first estimate must lie within its bounds";
            let problem = self.report(ProblemKind::OutOfRange, &format!("controller.{what}_{unit}"), reason);
            problem.value = Some(first.to_string());
            problem.limit = Some(format!("{low} to {high}"));
        }
    }

    fn reference(
        &mut self,
        table: ReferenceTable,
        registry: &Registry,
        read_file: ReadFile<'_>,
    ) -> Option<ReferenceTable> {
        let kind = table.kind.clone().unwrap_or_else(|| "hold".into());
        self.known_name("reference.kind", &kind, &registry.references())?;
        resolve_reference(self, table, read_file)
    }

    /// What the limits don't let the platform reach in its time is refused beforehand.
    fn reachable(&mut self, reference: &ReferenceTable, limits: &Limits) {
        let Err(refusals) = crate::references::trajectory(reference, limits) else { return };
        for refusal in refusals {
            let setting = match (refusal.key.as_str(), &reference.points_file) {
                ("", _) => "reference".to_string(),
                (key, Some(_)) if key.starts_with("points") => "reference.points_file".to_string(),
                (key, _) => format!("reference.{key}"),
            };
            let file = reference.points_file.as_ref().filter(|_| setting == "reference.points_file");
            self.report(ProblemKind::OutOfRange, &setting, refusal.reason).value =
                file.map(|name| format!("\"{name}\""));
        }
    }

    fn simulation(&mut self, table: &SimulationTable) {
        if let (Some(sticking), Some(sliding)) = (table.static_friction, table.sliding_friction)
            && sliding > sticking
        {
            let reason = "a wheel slides more easily than it breaks away";
            let problem = self.report(ProblemKind::Contradiction, "simulation.sliding_friction", reason);
            problem.value = Some(sliding.to_string());
            problem.limit = Some(format!("at most static_friction = {sticking}"));
        }
        if let (Some(rated), Some(greatest)) =
            (table.motor_rated_speed_rad_s, table.motor_greatest_speed_rad_s)
            && greatest <= rated
        {
            let reason = "the torque falls from the rated speed on";
            let problem =
                self.report(ProblemKind::Contradiction, "simulation.motor_greatest_speed_rad_s", reason);
            problem.value = Some(greatest.to_string());
            problem.limit = Some(format!("above motor_rated_speed_rad_s = {rated}"));
        }
    }

    /// What a built-in controller tells the wheels must have a place in the drives' process data.
    fn targets_are_mapped(&mut self, drives: &[DrivePlan], controller: &ControllerTable) {
        for kind in controller.kind.iter().chain(controller.others.iter().flatten()) {
            let (object, bits, what) = match kind.as_str() {
                "open_loop" | "closed_loop_speed" => (0x60FF, 32, "the target speed"),
                "adaptive_torque" | "adaptive_model_free" => (0x6071, 16, "the target torque"),
                _ => continue,
            };
            for (index, drive) in drives.iter().enumerate() {
                if !drives::is_mapped(&drive.outputs, object, bits) {
                    let reason =
                        format!("{kind} needs {what} in the map of {}, whole and at a byte", drive.name);
                    let problem =
                        self.report(ProblemKind::Missing, &format!("drive[{index}].outputs"), reason);
                    problem.limit = Some(format!("{object:04X}:{bits}"));
                }
            }
        }
    }

    fn motors_reach_limits(&mut self, drives: &[DrivePlan], limits: &Limits) {
        for drive in drives {
            let greatest = drive.scale.peak_torque_nm * drive.scale.gear_ratio;
            if limits.wheel_torque_nm > greatest {
                let reason = format!("the motor of {} can't give this torque", drive.name);
                let problem = self.report(ProblemKind::OutOfRange, "limits.wheel_torque_nm", reason);
                problem.value = Some(limits.wheel_torque_nm.to_string());
                problem.limit = Some(format!("at most {greatest} (peak_torque_nm · gear_ratio)"));
                return;
            }
        }
    }
}

/// A reference with its path points read.
fn resolve_reference(
    check: &mut Check,
    mut table: ReferenceTable,
    read_file: ReadFile<'_>,
) -> Option<ReferenceTable> {
    let kind = table.kind.as_deref().unwrap_or("hold");
    let missing: &[(&str, bool)] = match kind {
        "circle" | "holonomic" => &[("radius_m", table.radius_m.is_none())],
        "ellipse" => &[
            ("semi_axis_x_m", table.semi_axis_x_m.is_none()),
            ("semi_axis_y_m", table.semi_axis_y_m.is_none()),
        ],
        "spiral" => &[("step_m", table.step_m.is_none())],
        "eight" => &[("half_length_m", table.half_length_m.is_none())],
        "path" => &[("points", table.points.is_none() && table.points_file.is_none())],
        _ => &[],
    };
    for (key, is_missing) in missing {
        let why = format!("a reference of kind {kind} has it");
        check.need((!is_missing).then_some(()), &format!("reference.{key}"), &why);
    }
    if let Some(name) = &table.points_file {
        if table.points.is_some() {
            let reason = "give `points` or `points_file`, not both";
            check.report(ProblemKind::Contradiction, "reference.points_file", reason);
        }
        match read_file(name).and_then(|text| crate::references::read_points(&text)) {
            Ok(points) => table.points = Some(points),
            Err(reason) => {
                let problem = check.report(ProblemKind::File, "reference.points_file", reason);
                problem.value = Some(format!("\"{name}\""));
                return None;
            }
        }
    }
    Some(table)
}
