//! Everything that is chosen by name in the robot's file: one [`Kind`] each, and how it is made. The file's check, the
//! JSON schema, the command line, live loading and replay read the kinds here; there is no other list of them.
//!
//! Users add kinds of their own, or put them in the place of built-in ones. What is a closed set by a standard (stop
//! categories, clock sources, units) is an enum in [`config`](crate::config): that is one list already.

mod describe;
mod files;
mod kind;

use std::fmt::Display;

use omnibase_cia402::ErrorCode;
use omnibase_platform::Wheel;
use omnibase_trajectory::LONGEST_S;

use crate::ability::Ability;
use crate::config::{
    DevicePlan, DrivePlan, EventTable, Happening, Identity, InputPlan, OutputPlan, ParameterPlan, PdoPlan,
    PlatformTable, Problem, ProblemKind, ReceiverPlan, ReferenceTable, RobotPlan, SentPlan, SourceTable,
    nearest,
};
use crate::signals::Carries;
use crate::stages::{Controller, Device, Estimator, Peripheral, Reference};
pub use files::{FileContent, ReadContent};
use kind::{CONTROLLER, DEVICE, ESTIMATOR, EVENT, LAYOUT, PERIPHERAL, RECEIVER, REFERENCE};
pub use kind::{Custom, Key, Kind, Sort, needed, optional};

/// Why something can't be made: every reason, with its setting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct StageError(pub Vec<Problem>);

impl From<Problem> for StageError {
    fn from(problem: Problem) -> Self {
        StageError(vec![problem])
    }
}

impl From<Box<Problem>> for StageError {
    fn from(problem: Box<Problem>) -> Self {
        (*problem).into()
    }
}

impl StageError {
    /// The same about another setting.
    pub(crate) fn named(mut self, setting: &str) -> Self {
        self.0.iter_mut().for_each(|problem| setting.clone_into(&mut problem.setting));
        self
    }

    /// The same with settings of a table called by their full names.
    pub(crate) fn under(mut self, table: impl Display) -> Self {
        for Problem { setting, .. } in &mut self.0 {
            let dot = if setting.is_empty() { "" } else { "." };
            *setting = format!("{table}{dot}{setting}");
        }
        self
    }
}

/// What was made, and who can't be made.
pub type Made<T> = Result<T, StageError>;

/// A value of a table that must be there.
pub fn given<T>(value: Option<T>, key: &str) -> Made<T> {
    value.ok_or_else(|| Problem::missing(key, "nothing is made without it").into())
}

/// The kinds of one sort, each with how it is made.
pub struct Kinds<Make> {
    /// Where they are chosen.
    pub sort: Sort,
    list: Vec<(Kind, Make)>,
}

impl<Make> Kinds<Make> {
    fn new(sort: Sort) -> Self {
        Kinds { sort, list: Vec::new() }
    }

    /// Puts a kind to the others; one of the same name is replaced.
    fn put(&mut self, kind: Kind, make: Make) {
        self.list.retain(|(other, _)| other.name != kind.name);
        self.list.push((kind, make));
    }

    /// All kinds, in the order in which they were added.
    pub fn kinds(&self) -> impl Iterator<Item = &Kind> {
        self.list.iter().map(|(kind, _)| kind)
    }

    /// Their names.
    pub fn names(&self) -> Vec<&'static str> {
        self.kinds().map(|kind| kind.name).collect()
    }

    /// The kind of a name, or of the default where none is given, and how it is made.
    pub fn find(&self, name: Option<&str>) -> Made<&(Kind, Make)> {
        let name = name.or(self.sort.default).unwrap_or_default();
        self.list.iter().find(|(kind, _)| kind.name == name).ok_or_else(|| self.unknown(name).into())
    }

    /// What is wrong with a name that nothing has.
    fn unknown(&self, name: &str) -> Problem {
        let names = self.names();
        let near = nearest(name, names.iter().copied());
        let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        let reason = format!("nothing is registered by this name{near}");
        let (value, limit) = (Some(format!("\"{name}\"")), Some(names.join(", ")));
        Problem { value, limit, ..Problem::new(ProblemKind::UnknownName, self.sort.key, reason) }
    }
}

/// What a device brings along where the robot's file says nothing.
#[derive(Clone, Debug, Default)]
pub struct DeviceDefaults {
    /// Who must be there.
    pub identity: Identity,
    /// PDOs from the cycle to the drive.
    pub outputs: Vec<PdoPlan>,
    /// PDOs from the drive to the cycle.
    pub inputs: Vec<PdoPlan>,
    /// Encoder counts per revolution.
    pub counts_per_revolution: Option<u32>,
    /// Parameters that every drive of this kind is sent first.
    pub parameters: Vec<ParameterPlan>,
    /// Errors of its own by which it says that the bus failed; those of the profile are known.
    pub bus_errors: &'static [ErrorCode],
    /// From one SYNC0 to the next; `None` where its maker doesn't say which it takes.
    pub sync0_cycles: Option<Sync0Cycles>,
}

/// Times from one SYNC0 to the next that a device takes; it refuses others with AL status code 0x0035 (ETG.1000.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync0Cycles {
    /// Whole multiples of this, us.
    pub step_us: u32,
    /// The longest, us.
    pub longest_us: u32,
}

impl Sync0Cycles {
    /// Whether it takes this, ns.
    pub fn take(&self, cycle_ns: u64) -> bool {
        let [step_ns, longest_ns] = [self.step_us, self.longest_us].map(|us| u64::from(us) * 1000);
        (step_ns..=longest_ns).contains(&cycle_ns) && cycle_ns.is_multiple_of(step_ns)
    }
}

/// What a SubDevice that drives no wheel brings along where the robot's file says nothing.
#[derive(Clone, Debug, Default)]
pub struct PeripheralDefaults {
    /// Who must be there.
    pub identity: Identity,
    /// PDOs from the cycle to it.
    pub outputs: Vec<PdoPlan>,
    /// PDOs from it to the cycle.
    pub inputs: Vec<PdoPlan>,
    /// Signals that come from it, before those of its table.
    pub input: Vec<InputPlan>,
    /// Signals that it is told, before those of its table.
    pub output: Vec<OutputPlan>,
    /// Parameters that every one of this kind is sent first.
    pub parameters: Vec<ParameterPlan>,
    /// It reads and writes its signals alone: where a robot has more process data than a record holds, only the bytes in
    /// which these have bits are kept.
    pub by_signals: bool,
}

impl Kinds<MakeStage<dyn Controller>> {
    /// Adds a control law, made from the robot's plan; one of the same name is replaced.
    pub fn add<C: Controller + 'static>(
        &mut self,
        kind: Kind,
        make: impl Fn(&RobotPlan) -> Made<C> + Send + Sync + 'static,
    ) {
        self.put(kind, Box::new(move |plan| Ok(Box::new(make(plan)?))));
    }
}

impl Kinds<MakeStage<dyn Estimator>> {
    /// Adds an estimator, made from the robot's plan; one of the same name is replaced.
    pub fn add<E: Estimator + 'static>(
        &mut self,
        kind: Kind,
        make: impl Fn(&RobotPlan) -> Made<E> + Send + Sync + 'static,
    ) {
        self.put(kind, Box::new(move |plan| Ok(Box::new(make(plan)?))));
    }
}

impl Kinds<MakeReference> {
    /// Adds a reference, made from its table and the limits alone, for it may be loaded while the robot runs; one of
    /// the same name is replaced.
    pub fn add<R: Reference + 'static>(
        &mut self,
        kind: Kind,
        make: impl Fn(&ReferenceTable, &Ability) -> Made<R> + Send + Sync + 'static,
    ) {
        self.put(kind, Box::new(move |table, limits| Ok(Box::new(make(table, limits)?))));
    }
}

impl Kinds<MakeWheels> {
    /// Adds a layout: its wheels in the order of the drives; one of the same name is replaced.
    pub fn add(
        &mut self,
        kind: Kind,
        make: impl Fn(&PlatformTable) -> Made<Vec<Wheel>> + Send + Sync + 'static,
    ) {
        self.put(kind, Box::new(make));
    }
}

impl Kinds<MakeEvent> {
    /// Adds something that happens to the simulated robot; one of the same name is replaced.
    pub fn add(
        &mut self,
        kind: Kind,
        make: impl Fn(&EventTable, &[&str]) -> Made<Effect> + Send + Sync + 'static,
    ) {
        self.put(kind, Box::new(make));
    }
}

impl Kinds<MakeReceiver> {
    /// Adds a way by which values come in; one of the same name is replaced.
    pub fn add(&mut self, kind: Kind, make: impl Fn(&SourceTable) -> Made<Received> + Send + Sync + 'static) {
        self.put(kind, Box::new(make));
    }
}

impl Kinds<MakeDevice> {
    /// Adds a kind of drive, made from its plan, with what the robot's file need not say; one of the same name is
    /// replaced. Settings in its refusals are those of the drive's table.
    pub fn add<D: Device + 'static>(
        &mut self,
        kind: Kind,
        defaults: DeviceDefaults,
        make: impl Fn(&DrivePlan) -> Made<D> + Send + Sync + 'static,
    ) {
        self.put(kind, MakeDevice { defaults, make: Box::new(move |plan| Ok(Box::new(make(plan)?))) });
    }

    /// What a device brings along; `None` where none has this name.
    pub fn defaults(&self, name: &str) -> Option<&DeviceDefaults> {
        self.find(Some(name)).ok().map(|(_, device)| &device.defaults)
    }
}

impl Kinds<MakePeripheral> {
    /// Adds a kind of SubDevice that drives no wheel, made from its plan, with what the robot's file need not say; one
    /// of the same name is replaced.
    pub fn add<P: Peripheral + 'static>(
        &mut self,
        kind: Kind,
        defaults: PeripheralDefaults,
        make: impl Fn(&DevicePlan) -> Made<P> + Send + Sync + 'static,
    ) {
        self.put(kind, MakePeripheral { defaults, make: Box::new(move |plan| Ok(Box::new(make(plan)?))) });
    }
}

/// Makes a stage from a robot's plan.
pub type MakeStage<Stage> = Box<dyn Fn(&RobotPlan) -> Made<Box<Stage>> + Send + Sync>;
/// Makes a reference that keeps within the limits from its table alone: the robot's own, or one loaded while it runs.
pub type MakeReference = Box<dyn Fn(&ReferenceTable, &Ability) -> Made<Box<dyn Reference>> + Send + Sync>;
/// Makes the wheels of a layout, in the order of the drives.
pub type MakeWheels = Box<dyn Fn(&PlatformTable) -> Made<Vec<Wheel>> + Send + Sync>;

/// Makes the device of a drive from its plan.
pub type MakeDrive = Box<dyn Fn(&DrivePlan) -> Made<Box<dyn Device>> + Send + Sync>;

/// A kind of drive.
pub struct MakeDevice {
    /// What it brings along.
    pub defaults: DeviceDefaults,
    /// Makes it; settings in its refusals are those of the drive's table, as everywhere.
    pub make: MakeDrive,
}

/// Makes a SubDevice that drives no wheel from its plan.
pub type MakeBeside = Box<dyn Fn(&DevicePlan) -> Made<Box<dyn Peripheral>> + Send + Sync>;

/// A kind of SubDevice that drives no wheel.
pub struct MakePeripheral {
    /// What it brings along.
    pub defaults: PeripheralDefaults,
    /// Makes it; settings in its refusals are those of its table.
    pub make: MakeBeside,
}

/// Makes what happens to the simulated robot, and what ends it where it has a duration, from its table and the drives' names.
pub type MakeEvent = Box<dyn Fn(&EventTable, &[&str]) -> Made<Effect> + Send + Sync>;

/// What an event does, and what ends it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// At its time.
    pub begin: Happening,
    /// After its duration, where it has one; `None` for what doesn't last.
    pub end: Option<Happening>,
}

/// Makes a way by which a source's values come in, from its table.
pub type MakeReceiver = Box<dyn Fn(&SourceTable) -> Made<Received> + Send + Sync>;

/// What comes in, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Received {
    /// How.
    pub receiver: ReceiverPlan,
    /// What.
    pub carries: Carries,
    /// Its values; empty: those of the table, or of what it carries.
    pub input: Vec<SentPlan>,
}

/// All kinds.
pub struct Registry {
    /// Control laws.
    pub controllers: Kinds<MakeStage<dyn Controller>>,
    /// Wished motions.
    pub references: Kinds<MakeReference>,
    /// From measurements to the platform's state.
    pub estimators: Kinds<MakeStage<dyn Estimator>>,
    /// Drives.
    pub devices: Kinds<MakeDevice>,
    /// SubDevices that drive no wheel.
    pub peripherals: Kinds<MakePeripheral>,
    /// Where the wheels stand.
    pub layouts: Kinds<MakeWheels>,
    /// What happens to the simulated robot.
    pub events: Kinds<MakeEvent>,
    /// How values of sources come in.
    pub receivers: Kinds<MakeReceiver>,
}

impl Registry {
    /// A registry without any kind.
    pub fn empty() -> Self {
        Registry {
            controllers: Kinds::new(CONTROLLER),
            references: Kinds::new(REFERENCE),
            estimators: Kinds::new(ESTIMATOR),
            devices: Kinds::new(DEVICE),
            peripherals: Kinds::new(PERIPHERAL),
            layouts: Kinds::new(LAYOUT),
            events: Kinds::new(EVENT),
            receivers: Kinds::new(RECEIVER),
        }
    }

    /// Makes the devices of a plan's drives.
    pub fn make_devices(&self, plan: &RobotPlan) -> Made<Vec<Box<dyn Device>>> {
        all(plan.drives.iter().enumerate().map(|(index, drive)| {
            let made = self.devices.find(Some(&drive.device)).and_then(|(_, device)| (device.make)(drive));
            made.map_err(|error| error.under(format_args!("drive[{index}]")))
        }))
    }

    /// Makes the SubDevices of a plan that drive no wheel.
    pub fn make_peripherals(&self, plan: &RobotPlan) -> Made<Vec<Box<dyn Peripheral>>> {
        all(plan.devices.iter().enumerate().map(|(index, device)| {
            let found = self.peripherals.find(Some(&device.kind));
            let made = found.and_then(|(_, peripheral)| (peripheral.make)(device));
            made.map_err(|error| error.under(format_args!("device[{index}]")))
        }))
    }

    /// Makes the estimator of a plan.
    pub fn make_estimator(&self, plan: &RobotPlan) -> Made<Box<dyn Estimator>> {
        let found = self.estimators.find(plan.estimator.kind.as_deref());
        found.and_then(|(_, make)| make(plan)).map_err(|error| error.under(ESTIMATOR.table))
    }

    /// Makes the reference of a table; none of them lasts longer than anybody waits for.
    pub fn make_reference(&self, table: &ReferenceTable, ability: &Ability) -> Made<Box<dyn Reference>> {
        let found = self.references.find(table.kind.as_deref());
        let made = found.and_then(|(_, make)| make(table, ability)).and_then(|reference| {
            match reference.duration_s() {
                Some(found_s) if !(0.0..=LONGEST_S).contains(&found_s) => {
                    let reason = format!("it takes {found_s} s, expected 0 to {LONGEST_S} s");
                    Err(Problem::refused("", reason).into())
                }
                _ => Ok(reference),
            }
        });
        made.map_err(|error| error.under(REFERENCE.table))
    }

    /// Makes the controllers of a plan: the one that begins, then those to which it can be switched.
    pub fn make_controllers(&self, plan: &RobotPlan) -> Made<Vec<Box<dyn Controller>>> {
        let make = |name| self.controllers.find(Some(name)).and_then(|(_, make)| make(plan));
        all(plan.controllers().map(make)).map_err(|error| error.under(CONTROLLER.table))
    }
}

/// A word with a capital at its beginning.
fn capital(word: &str) -> String {
    format!("{}{}", word[..1].to_uppercase(), &word[1..])
}

/// All of them, or every reason why not.
pub(crate) fn all<T>(made: impl Iterator<Item = Made<T>>) -> Made<Vec<T>> {
    let mut problems = Vec::new();
    let made: Vec<T> = made.filter_map(|one| one.map_err(|error| problems.extend(error.0)).ok()).collect();
    if problems.is_empty() { Ok(made) } else { Err(StageError(problems)) }
}
