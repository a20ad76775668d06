//! The robot's file against itself: everything that can be found without hardware.

mod axis;
mod bus;
mod clocks;
mod device_signals;
mod devices;
mod doubts;
mod drives;
mod grip;
mod guard;
mod joystick;
mod kind_keys;
mod map;
mod platform;
mod rates;
mod run_tables;
mod safety;
mod sdo_writes;
mod sensors;
mod signal_names;
mod simulation;
mod sources;
mod subdevices;
#[cfg(test)]
mod tests;
mod torque_limit;
mod wires;

use std::fmt::Display;

use crate::ability::{Ability, WheelFacts};
use crate::config::*;
use crate::registry::{FileContent, Key, Kind, Made, Registry, StageError};
use crate::signals::Quantity;
use crate::stages::Reference;
use kind_keys::Given;

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
        check.end(plan)
    }

    /// Checks another reference for this robot: its whole table and what is made of it, or every problem at once.
    pub fn check_reference(
        &self,
        source: Source<ReferenceTable>,
        registry: &Registry,
        read_file: ReadFile<'_>,
    ) -> Result<(ReferenceTable, Box<dyn Reference>), Vec<Problem>> {
        let Source { file, locations, problems } = source;
        let mut check = Check { locations, problems };
        let table = check.reference(file, registry, read_file);
        let made = table.as_ref().and_then(|table| check.reachable(table, &Ability::of(self), registry));
        check.end(table.zip(made))
    }
}

/// Collects problems while a file is resolved.
pub(crate) struct Check {
    pub(crate) locations: Locations,
    pub(crate) problems: Vec<Problem>,
}

/// Whether a setting is another one, or stands in it.
fn is_within(setting: &str, other: &str) -> bool {
    setting.strip_prefix(other).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

impl Check {
    pub(crate) fn report(&mut self, kind: ProblemKind, setting: &str, reason: impl Display) -> &mut Problem {
        self.add(Problem::new(kind, setting, reason))
    }

    fn add(&mut self, problem: Problem) -> &mut Problem {
        let place = self.locations.place(&problem.setting);
        self.problems.push(Problem { place, ..problem });
        self.problems.last_mut().expect("just pushed")
    }

    /// What was found, in the order of the file, unless it is sound.
    fn end<T>(self, found: Option<T>) -> Result<T, Vec<Problem>> {
        // What stands once, as a default, may be found wrong for each that takes it.
        let mut problems: Vec<Problem> = Vec::new();
        for problem in self.problems {
            if !problems.contains(&problem) {
                problems.push(problem);
            }
        }
        if let Some(header) = problems.iter().position(|problem| problem.kind == ProblemKind::Header) {
            return Err(vec![problems.swap_remove(header)]);
        }
        problems.sort_by_key(|problem| {
            problem.place.as_ref().map_or((true, 0), |place| (place.file.is_some(), place.span.start))
        });
        match found {
            Some(found) if problems.is_empty() => Ok(found),
            _ => Err(problems),
        }
    }

    /// Whether nothing was said yet about a table and what is in it.
    pub(crate) fn is_sound(&self, table: &str) -> bool {
        !self.problems.iter().any(|problem| is_within(&problem.setting, table))
    }

    /// What was made; otherwise every reason why not, with its place.
    pub(crate) fn made<T>(&mut self, made: Made<T>) -> Option<T> {
        let refused = |error: StageError| {
            for problem in error.0 {
                self.add(problem);
            }
        };
        made.map_err(refused).ok()
    }

    /// A setting that must be there. One whose value was refused already isn't reported twice.
    pub(crate) fn need<T>(&mut self, value: Option<T>, setting: &str, why: &str) -> Option<T> {
        if value.is_none() && !self.refused(setting) {
            self.add(Problem::missing(setting, why));
        }
        value
    }

    /// Whether something was said about a setting already.
    pub(crate) fn refused(&self, setting: &str) -> bool {
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

    fn robot(&mut self, file: RobotFile, registry: &Registry, read_file: ReadFile<'_>) -> Option<RobotPlan> {
        let name = self.need(file.name.clone(), "name", "recordings and reports carry it");
        let bus = self.bus(&file.bus, &file.safety);
        let sdo_writes = file.bus.sdo_write_while_enabled.as_deref().unwrap_or_default();
        let sdo_write_while_enabled = sdo_writes::resolve(self, sdo_writes);
        let drives = drives::resolve(self, &file.bus, &file.drive_defaults, &file.drive, registry, read_file);
        let devices = devices::resolve(self, &file, registry);
        let kinematics = platform::resolve(self, &file.platform, file.drive.len(), registry);
        let limits = self.limits(&file.limits);
        let sources = sources::resolve(self, &file.source, &file.device, registry);
        let beside = devices.zip(sources);
        let signals = beside.as_ref().map(|(devices, sources)| signal_layout(devices, sources));
        let is_known = signals.is_some();
        let signals = signals.unwrap_or_default();
        let sensors = sensors::resolve(self, &file.sensor, is_known.then_some(&signals));
        let named = beside.as_ref().map_or(&[][..], |(devices, _)| devices);
        sensors::simulated(self, &file.simulation.sensor, sensors.as_deref().unwrap_or_default(), named);
        devices::room(self, &signals);
        let mut safety = self.safety(&file.safety, &signals, is_known);
        let guard = guard::resolve(self, &file, kinematics.as_ref());
        if let Some(table) = &file.map {
            map::check(self, table);
        }
        let grip = grip::resolve(self, &file.grip, read_file);
        let controller = self.controller(file.controller, registry);
        let estimator = self.estimator(file.estimator, registry);
        let reference = self.reference(file.reference, registry, read_file);
        self.joystick(&file.joystick);
        let events = simulation::resolve(self, &file.simulation, &file.drive, registry, read_file);
        self.run(&file.run);
        self.bridges(&file.bridge);
        let recording = self.recording(&file.recording, file.bus.cycle_us);
        if let (Some(reference), Some(limits)) = (&reference, &limits) {
            let ability = match (&kinematics, &drives, &controller) {
                (Some(kinematics), Some(drives), Some(controller)) => {
                    Ability::new(limits, WheelFacts { kinematics, drives, controller, grip: &grip })
                }
                _ => Ability::from(limits),
            };
            self.reachable(reference, &ability, registry);
        }
        let (limits, mut drives) = (limits?, drives?);
        if let Some(comeback) = &mut safety.comeback {
            for (own, drive) in comeback.bus_errors.iter_mut().zip(&drives) {
                *own = registry.devices.defaults(&drive.device).map_or(&[], |defaults| defaults.bus_errors);
            }
        }
        self.motors_reach_limits(&drives, &limits);
        torque_limit::resolve(self, &mut drives, &limits);
        let (devices, mut sources) = beside?;
        sensors::take_in_any_order(&mut sources, sensors.as_deref().unwrap_or_default());
        let plan = RobotPlan {
            name: name?,
            bus: bus?,
            sdo_write_while_enabled,
            drives,
            devices,
            sources,
            sensors: sensors?,
            kinematics: kinematics?,
            mass_kg: file.platform.mass_kg,
            limits,
            estimator: estimator?,
            controller: controller?,
            reference: reference?,
            safety,
            grip,
            joystick: file.joystick,
            guard: guard?,
            map: file.map,
            simulation: file.simulation,
            events: events?,
            run: file.run,
            recording,
            bridges: file.bridge,
        };
        self.stages(&plan, registry);
        Some(plan)
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

    /// Keys of every controller may be given: a running robot may be switched, and the command line names others.
    fn controller(&mut self, table: ControllerTable, registry: &Registry) -> Option<ControllerTable> {
        let kinds = &registry.controllers;
        let name = self.need(table.kind.as_deref(), "controller.kind", "there is no default control law")?;
        let given = Given::of(&table);
        let others = table.others.iter().flatten().enumerate();
        let others = others.map(|(index, other)| (format!("controller.others[{index}]"), other.as_str()));
        let mut are_known = true;
        for (setting, name) in [("controller.kind".to_owned(), name)].into_iter().chain(others) {
            match self.known(kinds, &setting, Some(name)) {
                Some((kind, _)) => self.kind_reads(kind, &given, &|key| format!("controller.{key}")),
                None => are_known = false,
            }
        }
        let all: Vec<&Kind> = kinds.kinds().collect();
        self.nobody_reads(&all, &given, &kinds.sort, "controller");
        are_known.then_some(table)
    }

    fn estimator(&mut self, table: EstimatorTable, registry: &Registry) -> Option<EstimatorTable> {
        let kinds = &registry.estimators;
        let (kind, _) = self.known(kinds, "estimator.kind", table.kind.as_deref())?;
        self.keys(kind, &Given::of(&table), &kinds.sort);
        Some(table)
    }

    /// A reference with its files read, and its kind by name.
    fn reference(
        &mut self,
        mut table: ReferenceTable,
        registry: &Registry,
        read_file: ReadFile<'_>,
    ) -> Option<ReferenceTable> {
        let kinds = &registry.references;
        let (kind, _) = self.known(kinds, "reference.kind", table.kind.as_deref())?;
        table.kind = Some(kind.name.to_owned());
        let given = Given::of(&table);
        for (key, content) in kind.files() {
            self.read_in_place(&given, key, content, &mut table, read_file)?;
        }
        self.keys(kind, &Given::of(&table), &kinds.sort);
        Some(table)
    }

    /// A reference's table with what the file gives that a key names; `None` where that can't be read.
    fn read_in_place(
        &mut self,
        given: &Given,
        key: &Key,
        content: &FileContent,
        table: &mut ReferenceTable,
        read_file: ReadFile<'_>,
    ) -> Option<()> {
        let (file_key, key) = (key.path(), key.beside(content.instead_of));
        let Some(name) = given.get(&file_key) else { return Some(()) };
        let setting = format!("reference.{file_key}");
        if given.has(&key) {
            let reason = format!("give `{key}` or `{file_key}`, not both");
            self.report(ProblemKind::Contradiction, &setting, reason);
        }
        let file = name.as_str().ok_or_else(|| "expected a file's name".to_owned());
        let read = file.and_then(read_file).and_then(|text| (content.read)(&text, table));
        if let Err(reason) = &read {
            self.report(ProblemKind::File, &setting, reason).value = Some(name.to_string());
        }
        read.ok()
    }

    /// What the limits don't let the platform reach in its time is refused beforehand.
    fn reachable(
        &mut self,
        table: &ReferenceTable,
        ability: &Ability,
        registry: &Registry,
    ) -> Option<Box<dyn Reference>> {
        if !self.is_sound("reference") {
            return None;
        }
        let mut made = registry.make_reference(table, ability);
        if let (Err(error), Ok((kind, _))) = (&mut made, registry.references.find(table.kind.as_deref())) {
            let given = Given::of(table);
            for (key, content) in kind.files() {
                let Some(file) = given.get(&key.path()) else { continue };
                let of_it = format!("reference.{}", key.beside(content.instead_of));
                for problem in error.0.iter_mut().filter(|problem| is_within(&problem.setting, &of_it)) {
                    problem.setting = format!("reference.{}", key.path());
                    problem.value = Some(file.to_string());
                }
            }
        }
        self.made(made)
    }

    /// Stages that can't be made are told now, and not where the robot is built.
    fn stages(&mut self, plan: &RobotPlan, registry: &Registry) {
        if self.is_sound("device") {
            self.made(registry.make_peripherals(plan));
        }
        if self.is_sound("drive") && self.is_sound("drive_defaults") {
            self.made(registry.make_devices(plan));
        }
        if self.is_sound("estimator")
            && let Some(estimator) = self.made(registry.make_estimator(plan))
            && !estimator.hears_sensors()
            && !plan.sensors.is_empty()
        {
            let reason = "the wheels alone tell it where the platform is: nobody would hear the sensors";
            let problem = self.report(ProblemKind::Contradiction, "sensor", reason);
            problem.limit = Some("estimator.kind = \"fused\", or no `[[sensor]]`".into());
        }
        if self.is_sound("controller")
            && let Some(controllers) = self.made(registry.make_controllers(plan))
        {
            for (name, controller) in plan.controllers().zip(&controllers) {
                self.target_is_mapped(&plan.drives, name, controller.quantity());
            }
        }
    }

    /// What a controller tells the wheels must be what their drives take, or become it, and have a place in their process
    /// data.
    fn target_is_mapped(&mut self, drives: &[DrivePlan], controller: &str, quantity: Quantity) {
        for (index, drive) in drives.iter().enumerate() {
            let setting = |key: &str| format!("drive[{index}].{key}");
            let name = &drive.name;
            for misfit in drive.misfits(drive.mode, quantity) {
                match misfit {
                    Misfit::NoSpeedOfATorque => {
                        let reason =
                            format!("{controller} commands torques, and no speed follows from a torque");
                        let problem = self.report(ProblemKind::Contradiction, &setting("mode"), reason);
                        problem.value = Some("\"speed\"".into());
                        problem.limit = Some("\"torque\", or a controller that commands speeds".into());
                    }
                    Misfit::NoSpeedLoop => {
                        let reason = format!(
                            "{controller} commands speeds, and the cycle makes the torques of {name} of them by this loop"
                        );
                        self.add(Problem::missing(setting("speed_loop_gain_nm_s_rad"), reason));
                    }
                    Misfit::NotMapped { object, bits } => {
                        let what = if object == 0x60FF { "the target speed" } else { "the target torque" };
                        let reason =
                            format!("{controller} needs {what} in the map of {name}, whole and at a byte");
                        let problem = self.report(ProblemKind::Missing, &setting("outputs"), reason);
                        problem.limit = Some(format!("{object:04X}:{bits}"));
                    }
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
