//! The SubDevices that drive no wheel: their places, maps and signals.

use std::ops::RangeInclusive;

use super::bus::cycle_us;
use super::clocks::{self, Beat};
use super::kind_keys::Given;
use super::subdevices::{self, Claims, parameter};
use super::{Check, axis, rates};
use crate::config::find_object as find;
use crate::config::*;
use crate::registry::{MakePeripheral, PeripheralDefaults, Registry};
use crate::signals::{MAX_DEVICE_BYTES, MAX_DEVICES, MAX_SIGNALS, SignalLayout};

pub(super) fn resolve(check: &mut Check, file: &RobotFile, registry: &Registry) -> Option<Vec<DevicePlan>> {
    let (devices, drives) = (&file.device, &file.drive);
    let claims = |table: &str, n: usize, [position, alias, identification]: [Option<u16>; 3], name| Claims {
        table: format!("{table}[{n}]"),
        position,
        alias,
        identification,
        name,
    };
    let drives = drives.iter().enumerate();
    let tables = drives
        .map(|(n, one)| claims("drive", n, [one.position, one.alias, one.identification], one.name.as_ref()))
        .chain(devices.iter().enumerate().map(|(n, one)| {
            claims("device", n, [one.position, one.alias, one.identification], one.name.as_ref())
        }));
    subdevices::duplicates(check, tables);
    if devices.len() > MAX_DEVICES {
        let problem =
            check.report(ProblemKind::OutOfRange, "device", "too many SubDevices beside the drives");
        problem.value = Some(devices.len().to_string());
        problem.limit = Some(format!("at most {MAX_DEVICES}"));
    }
    let resolved: Vec<Option<DevicePlan>> = devices
        .iter()
        .enumerate()
        .map(|(index, own)| Device { check, table: format!("device[{index}]"), own, file }.resolve(registry))
        .collect();
    positions_before_groups(check, file);
    resolved.into_iter().collect()
}

/// Positions shift behind a group that isn't there: whoever is known by one stands before all groups.
fn positions_before_groups(check: &mut Check, file: &RobotFile) {
    let groups = file.device.iter().filter(|one| one.group.is_some()).count();
    let always_there = file.drive.len() + file.device.len() - groups;
    let drives = file.drive.iter().enumerate().map(|(n, one)| ("drive", n, one.position));
    let devices = file.device.iter().enumerate().map(|(n, one)| ("device", n, one.position));
    for (table, n, position) in drives.chain(devices).filter(|_| groups > 0) {
        let Some(position) = position.filter(|position| usize::from(*position) >= always_there) else {
            continue;
        };
        let setting = format!("{table}[{n}].position");
        let reason = "it would shift with a hot-connect group: find it by `alias` or `identification`, or plug it in before the groups";
        let problem = check.report(ProblemKind::Contradiction, &setting, reason);
        problem.value = Some(position.to_string());
        problem.limit =
            Some(format!("at most {}, the SubDevices that are always there", always_there.saturating_sub(1)));
    }
}

/// A cycle's record has room for so much of SubDevices and programs.
pub(super) fn room(check: &mut Check, layout: &SignalLayout) {
    for (what, found, most) in [
        ("inputs", layout.inputs.len(), MAX_SIGNALS),
        ("outputs", layout.outputs.len(), MAX_SIGNALS),
        ("bytes of inputs", layout.input_bytes, MAX_DEVICE_BYTES),
        ("bytes of outputs", layout.output_bytes, MAX_DEVICE_BYTES),
    ] {
        if found > most {
            let table = if layout.devices.is_empty() { "source" } else { "device" };
            let problem = check.report(ProblemKind::OutOfRange, table, "too much for one cycle's record");
            problem.value = Some(format!("{found} {what}"));
            problem.limit = Some(format!("at most {most} of all SubDevices and programs together"));
        }
    }
}

pub(super) struct Device<'a> {
    pub(super) check: &'a mut Check,
    pub(super) table: String,
    pub(super) own: &'a DeviceTable,
    file: &'a RobotFile,
}

impl Device<'_> {
    pub(super) fn setting(&self, key: &str) -> String {
        format!("{}.{key}", self.table)
    }

    fn resolve(mut self, registry: &Registry) -> Option<DevicePlan> {
        let (own, table) = (self.own, self.table.clone());
        let name = self.check.topic_name(own.name.as_deref(), &self.setting("name"));
        let place = subdevices::place(
            self.check,
            &table,
            [own.position, own.alias, own.identification],
            "a SubDevice",
        );
        let kinds = &registry.peripherals;
        let setting = self.setting("kind");
        let why = "it says what the SubDevice is: `ignore` for one that nobody reads or writes";
        let kind = self.check.need(own.kind.as_deref(), &setting, why)?;
        let (kind, MakePeripheral { defaults, .. }) = self.check.known(kinds, &setting, Some(kind))?;
        let given = Given::of(own);
        self.check.kind_reads(kind, &given, &|key| format!("{table}.{key}"));
        self.check.nobody_reads(&[kind], &given, &kinds.sort, &table);
        let identity = self.identity(defaults);
        let outputs = self.pdos("outputs", &own.outputs, &defaults.outputs, &subdevices::OUTPUT_PDOS);
        let inputs = self.pdos("inputs", &own.inputs, &defaults.inputs, &subdevices::INPUT_PDOS);
        let mut parameters = defaults.parameters.clone();
        for (index, table) in own.parameters.iter().flatten().enumerate() {
            let setting = self.setting(&format!("parameters[{index}]"));
            parameters.extend(parameter(self.check, table, &setting));
        }
        let axis = own.axis.as_ref().map(|axis| {
            let table = self.setting("axis");
            axis::resolve(self.check, &table, axis, f64::from(cycle_us(&self.file.bus)) * 1e-6)
        });
        let (outputs, inputs) = (outputs?, inputs?);
        self.memory(&outputs, &inputs)?;
        let group = self.group(place);
        let setting = self.setting("every");
        let every = rates::resolve(self.check, self.file, &setting, own, !outputs.is_empty());
        let is_drive = own.axis.is_some();
        let beat = if is_drive { Beat::Drive } else { Beat::Every(own.every.unwrap_or(1)) };
        let setting = self.setting("dc");
        let dc = clocks::resolve(self.check, &self.file.bus, &setting, own.dc.as_ref(), beat);
        let axis = match axis {
            Some(axis) => Some(axis?),
            None => None,
        };
        if let Some(axis) = &axis {
            let is_given = |one: &AxisObject, all: &[ParameterPlan]| {
                all.iter().any(|other| (other.index, other.subindex) == one.object)
            };
            let mut own = axis.objects(|object| find(&outputs, object, 0).is_some());
            own.retain(|one| !is_given(one, &parameters));
            parameters.extend(own.into_iter().filter_map(|one| self.object_of_axis(one)));
        }
        let input = self.inputs(defaults, axis.as_ref(), &inputs);
        let output = self.outputs(defaults, &outputs);
        let (input, output) = (input?, output?);
        self.one_name_each(&input, &output);
        self.own_bits_each(&output);
        Some(DevicePlan {
            name: name?,
            place: place?,
            group: group?,
            every: every?,
            dc: dc?,
            timeouts: own.timeouts.as_ref().map_or_else(Default::default, Into::into),
            kind: kind.name.to_owned(),
            identity,
            outputs,
            inputs,
            input,
            output,
            axis,
            parameters,
            by_signals: defaults.by_signals,
            custom: own.custom.clone(),
        })
    }

    /// A chip has at most 60 KiB for process data, and keeps three buffers of each direction (ETG.1000.4, SyncManagers).
    fn memory(&mut self, outputs: &[PdoPlan], inputs: &[PdoPlan]) -> Option<()> {
        const MOST_BYTES: u32 = 60 * 1024 / 3;
        let bytes = |pdos: &[PdoPlan]| pdos.iter().map(PdoPlan::bits).sum::<u32>().div_ceil(8);
        let found = bytes(outputs) + bytes(inputs);
        if found <= MOST_BYTES {
            return Some(());
        }
        let setting = self.setting(if bytes(outputs) > bytes(inputs) { "outputs" } else { "inputs" });
        let problem = self.check.report(ProblemKind::OutOfRange, &setting, "no chip has so much memory");
        problem.value = Some(format!("{found} bytes of process data in both directions"));
        problem.limit = Some(format!("at most {MOST_BYTES}, for each is kept three times"));
        None
    }

    /// The hot-connect group, where it can be of one.
    fn group(&mut self, place: Option<BusPlace>) -> Option<Option<String>> {
        if self.own.group.is_none() {
            return Some(None);
        }
        let setting = self.setting("group");
        let group = self.check.signal_name(self.own.group.as_deref(), &setting);
        if !matches!(place, Some(BusPlace::Position(_))) {
            return group.map(Some);
        }
        let misfit = "who may be absent is found by `alias` or `identification`, for positions shift";
        self.check.report(ProblemKind::Contradiction, &setting, misfit);
        None
    }

    /// How an object is written that the axis' table decides; refused where it can't hold what stands there.
    fn object_of_axis(&mut self, object: AxisObject) -> Option<ParameterPlan> {
        let (index, _) = object.object;
        let misfit = match object.parameter() {
            Ok(parameter) => return Some(parameter),
            Err(misfit) => misfit,
        };
        let setting = self.setting(&format!("axis.{}", misfit.key));
        // An acceleration stands in two objects.
        if self.check.problems.iter().all(|problem| problem.setting != setting) {
            let reason = format!("the drive's object {index:#06x} can't hold it");
            let problem = self.check.report(ProblemKind::OutOfRange, &setting, reason);
            let [least, greatest] = misfit.limits;
            problem.value = Some(misfit.value.to_string());
            problem.limit = Some(format!("{least} to {greatest}"));
        }
        None
    }

    fn identity(&mut self, defaults: &PeripheralDefaults) -> Identity {
        let mut number = |key: &str, text: &Option<String>, default: Option<u32>| {
            let Some(text) = text else { return default };
            subdevices::identity_number(self.check, &format!("{}.{key}", self.table), text)
        };
        Identity {
            vendor_id: number("vendor_id", &self.own.vendor_id, defaults.identity.vendor_id),
            product_code: number("product_code", &self.own.product_code, defaults.identity.product_code),
            revision: number("revision", &self.own.revision, defaults.identity.revision),
        }
    }

    fn pdos(
        &mut self,
        key: &str,
        tables: &Option<Vec<PdoTable>>,
        default: &[PdoPlan],
        indices: &RangeInclusive<u16>,
    ) -> Option<Vec<PdoPlan>> {
        let Some(tables) = tables else { return Some(default.to_vec()) };
        subdevices::pdos(self.check, &self.setting(key), tables, indices)
    }
}
