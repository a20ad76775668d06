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
use crate::signals::{MAX_DEVICE_BYTES, MAX_DEVICES, MAX_SIGNALS, SignalLayout, column_name};

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

struct Device<'a> {
    check: &'a mut Check,
    table: String,
    own: &'a DeviceTable,
    file: &'a RobotFile,
}

impl Device<'_> {
    fn setting(&self, key: &str) -> String {
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
        let group = self.group(place, &outputs, &inputs);
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
            custom: own.custom.clone(),
        })
    }

    /// The hot-connect group, where it can be of one.
    fn group(
        &mut self,
        place: Option<BusPlace>,
        outputs: &[PdoPlan],
        inputs: &[PdoPlan],
    ) -> Option<Option<String>> {
        if self.own.group.is_none() {
            return Some(None);
        }
        let setting = self.setting("group");
        let group = self.check.signal_name(self.own.group.as_deref(), &setting);
        let misfit = if matches!(place, Some(BusPlace::Position(_))) {
            "who may be absent is found by `alias` or `identification`, for positions shift"
        } else if inputs.is_empty() && !outputs.is_empty() {
            "nothing comes from it, so nobody would know whether it is there: give it `inputs`"
        } else {
            return group.map(Some);
        };
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

    fn inputs(
        &mut self,
        defaults: &PeripheralDefaults,
        axis: Option<&AxisPlan>,
        pdos: &[PdoPlan],
    ) -> Option<Vec<InputPlan>> {
        let own = self.own.input.iter().enumerate().map(|(n, table)| {
            let InputTable { name, object, bit, kind, unit, scale, offset, simulated } = table;
            let written =
                Written { name, object, bit: *bit, kind: *kind, unit, scale: *scale, offset: *offset };
            let key = format!("input[{n}]");
            let (name, unit, coding) = self.signal(&key, "inputs", &written, pdos)?;
            let reason = "the process data can't hold it";
            self.held(&format!("{key}.simulated"), *simulated, &coding, reason)?;
            Some(InputPlan { name, unit, coding: Some(coding), simulated: *simulated })
        });
        let own: Vec<Option<InputPlan>> = own.collect();
        let of_axis = axis.map(AxisPlan::signals).unwrap_or_default();
        defaults.input.iter().cloned().chain(of_axis).map(Some).chain(own).collect()
    }

    fn outputs(&mut self, defaults: &PeripheralDefaults, pdos: &[PdoPlan]) -> Option<Vec<OutputPlan>> {
        let own = self.own.output.iter().enumerate().map(|(n, table)| {
            let OutputTable { name, object, bit, kind, unit, scale, offset, on_stop } = table;
            let written =
                Written { name, object, bit: *bit, kind: *kind, unit, scale: *scale, offset: *offset };
            let key = format!("output[{n}]");
            let (name, unit, coding) = self.signal(&key, "outputs", &written, pdos)?;
            let on_stop = on_stop.unwrap_or(0.0);
            let reason = "the process data can't hold it, and the output is it when the robot stops";
            self.held(&format!("{key}.on_stop"), Some(on_stop), &coding, reason)?;
            Some(OutputPlan { name, unit, coding: Some(coding), on_stop })
        });
        let own: Vec<Option<OutputPlan>> = own.collect();
        defaults.output.iter().cloned().map(Some).chain(own).collect()
    }

    /// A value that the process data must be able to hold; `None` where they aren't.
    fn held(&mut self, key: &str, value: Option<f64>, coding: &Coding, reason: &str) -> Option<()> {
        let Some(value) = value.filter(|value| !coding.holds(*value)) else { return Some(()) };
        let [least, greatest] = coding.values();
        let problem = self.check.report(ProblemKind::OutOfRange, &self.setting(key), reason);
        problem.value = Some(value.to_string());
        problem.limit = Some(format!("{least} to {greatest}"));
        None
    }

    fn signal(
        &mut self,
        key: &str,
        map: &str,
        written: &Written<'_>,
        pdos: &[PdoPlan],
    ) -> Option<(String, String, Coding)> {
        let setting = |part: &str| format!("{}.{key}.{part}", self.table);
        let (of_name, of_object, of_bit, of_type, of_unit, of_scale) = (
            setting("name"),
            setting("object"),
            setting("bit"),
            setting("type"),
            setting("unit"),
            setting("scale"),
        );
        let of_offset = setting("offset");
        let name = self.check.signal_name(written.name.as_deref(), &of_name);
        let object =
            self.check.need(written.object.as_ref(), &of_object, "it says where the signal stands")?;
        let (index, subindex) = match parse_object(object) {
            Ok(object) => object,
            Err(error) => {
                self.check.report(ProblemKind::WrongType, &of_object, error).value =
                    Some(format!("\"{object}\""));
                return None;
            }
        };
        let Some((first, length)) = find(pdos, index, subindex).filter(|_| index != 0) else {
            let reason = format!("the object isn't among `{map}`");
            let shown = pdos.iter().flat_map(|pdo| &pdo.entries).filter(|entry| entry.index != 0);
            let shown: Vec<String> = shown.map(ToString::to_string).collect();
            let problem = self.check.report(ProblemKind::Missing, &of_object, reason);
            problem.value = Some(format!("\"{object}\""));
            problem.limit =
                Some(if shown.is_empty() { format!("an object of `{map}`") } else { shown.join(" ") });
            return None;
        };
        let (bit, bits) = match written.bit {
            None => (first, length),
            Some(bit) if bit < length => (first + u32::from(bit), 1),
            Some(bit) => {
                let problem =
                    self.check.report(ProblemKind::OutOfRange, &of_bit, "the object has fewer bits");
                problem.value = Some(bit.to_string());
                problem.limit = Some(format!("0 to {}", length - 1));
                return None;
            }
        };
        let of_one_bit = (bits == 1).then_some(SignalType::Bool);
        let kind =
            self.check.need(written.kind.or(of_one_bit), &of_type, "it says how its bits are a number")?;
        let fits = match kind {
            SignalType::F32 | SignalType::Bool => bits == kind.bits(),
            _ => bits <= kind.bits(),
        };
        if !fits {
            let problem =
                self.check.report(ProblemKind::Contradiction, &of_type, "the object has another length");
            problem.value = Some(format!("{} bits", kind.bits()));
            problem.limit = Some(format!("a type of {bits} bits"));
            return None;
        }
        let scale = written.scale.unwrap_or(1.0);
        let offset = written.offset.unwrap_or(0.0);
        for (value, setting, is_sound) in
            [(scale, of_scale, scale.is_finite() && scale != 0.0), (offset, of_offset, offset.is_finite())]
        {
            if !is_sound {
                let problem =
                    self.check.report(ProblemKind::OutOfRange, &setting, "values can't be scaled by it");
                problem.value = Some(value.to_string());
                problem.limit = Some("a finite number, the scale not 0".into());
                return None;
            }
        }
        let unit = self.check.unit(written.unit.as_deref(), &of_unit)?;
        Some((name?, unit, Coding { bit, bits, kind, scale, offset }))
    }

    /// Recordings have a column for each, and one for the age.
    fn one_name_each(&mut self, input: &[InputPlan], output: &[OutputPlan]) {
        let inputs = input.iter().map(|one| ("input", &one.name, &one.unit));
        let outputs = output.iter().map(|one| ("output", &one.name, &one.unit));
        let mut seen = vec!["age".to_owned(), column_name("age", "s")];
        for (n, (key, name, unit)) in inputs.chain(outputs).enumerate() {
            let column = column_name(name, unit);
            if seen.contains(name) || seen.contains(&column) {
                let place = if key == "input" { n } else { n - input.len() };
                let setting = self.setting(&format!("{key}[{place}].name"));
                let reason =
                    "another signal of this SubDevice, or its age, is called so, or so with its unit";
                self.check.report(ProblemKind::Duplicate, &setting, reason).value =
                    Some(format!("\"{name}\""));
            }
            seen.extend([name.clone(), column]);
        }
    }
}

/// A signal as written, whichever way it goes.
struct Written<'a> {
    name: &'a Option<String>,
    object: &'a Option<String>,
    bit: Option<u8>,
    kind: Option<SignalType>,
    unit: &'a Option<String>,
    scale: Option<f64>,
    offset: Option<f64>,
}
