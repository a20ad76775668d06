//! The drives: defaults, the device's own defaults, identities, PDO maps, parameters, and their places on the bus.

use super::clocks::{self, Beat};
use super::kind_keys::Given;
use super::subdevices::{self, parameter};
use super::{Check, ReadFile, torque_limit};
use crate::config::is_mapped;
use crate::config::*;
use crate::registry::{DeviceDefaults, Kind, MakeDevice, Registry, Sort, Sync0Cycles};
use crate::signals::{MAX_PROCESS_BYTES, MAX_WHEELS};

pub(super) fn resolve(
    check: &mut Check,
    bus: &BusTable,
    defaults: &DriveTable,
    drives: &[DriveTable],
    registry: &Registry,
    read_file: ReadFile<'_>,
) -> Option<Vec<DrivePlan>> {
    for (key, given) in [("name", defaults.name.is_some()), ("position", defaults.position.is_some())] {
        if given {
            let setting = format!("drive_defaults.{key}");
            check.report(ProblemKind::Contradiction, &setting, "each drive has its own");
        }
    }
    if !(3..=MAX_WHEELS).contains(&drives.len()) {
        let problem = check.report(ProblemKind::OutOfRange, "drive", "each wheel has one `[[drive]]`");
        problem.value = Some(format!("{} drives", drives.len()));
        problem.limit = Some(format!("3 to {MAX_WHEELS}"));
    }
    let shared = Given::of(defaults);
    let name = |drive: &DriveTable| drive.device.clone().or(defaults.device.clone());
    let kinds: Vec<&Kind> = drives
        .iter()
        .filter_map(|drive| registry.devices.find(name(drive).as_deref()).ok())
        .map(|(kind, _)| kind)
        .collect();
    check.nobody_reads(&kinds, &shared, &registry.devices.sort, "drive_defaults");
    let resolved: Vec<Option<DrivePlan>> = drives
        .iter()
        .enumerate()
        .map(|(index, own)| Drive { check, index, own, defaults }.resolve(bus, registry, &shared, read_file))
        .collect();
    resolved.into_iter().collect()
}

struct Drive<'a> {
    check: &'a mut Check,
    index: usize,
    own: &'a DriveTable,
    defaults: &'a DriveTable,
}

impl Drive<'_> {
    /// The setting's full name where it stands: in the drive's own table, else in the defaults.
    fn setting(&self, key: &str, is_own: bool) -> String {
        if is_own { format!("drive[{}].{key}", self.index) } else { format!("drive_defaults.{key}") }
    }

    /// A value of the drive or of the defaults; with the setting's name.
    fn pick<T: Clone>(&self, key: &str, get: fn(&DriveTable) -> &Option<T>) -> (Option<T>, String) {
        match (get(self.own), get(self.defaults)) {
            (Some(value), _) => (Some(value.clone()), self.setting(key, true)),
            (None, Some(value)) => (Some(value.clone()), self.setting(key, false)),
            (None, None) => (None, self.setting(key, self.check.locations.place("drive_defaults").is_none())),
        }
    }

    fn resolve(
        mut self,
        bus: &BusTable,
        registry: &Registry,
        shared: &Given,
        read_file: ReadFile<'_>,
    ) -> Option<DrivePlan> {
        let name = self.own.name.clone().unwrap_or_else(|| format!("wheel_{}", self.index + 1));
        let table = format!("drive[{}]", self.index);
        let place = subdevices::place(
            self.check,
            &table,
            [self.own.position, self.own.alias, self.own.identification],
            "a drive",
        );
        let (device, device_setting) = self.pick("device", |table| &table.device);
        let kinds = &registry.devices;
        let (kind, MakeDevice { defaults, .. }) =
            self.check.known(kinds, &device_setting, device.as_deref())?;
        self.keys(kind, &kinds.sort, shared);
        let identity = self.identity(defaults);
        let outputs = self.pdos("outputs", |table| &table.outputs, &defaults.outputs);
        let inputs = self.pdos("inputs", |table| &table.inputs, &defaults.inputs);
        self.required_objects(&outputs, &inputs);
        let scale = self.scale(defaults);
        let mut parameters = defaults.parameters.clone();
        if let (Some(file), setting) = self.pick("parameters_file", |table| &table.parameters_file) {
            parameters.extend(self.parameters_file(&file, &setting, read_file));
        }
        let tables = [(&self.defaults.parameters, false), (&self.own.parameters, true)];
        for (tables, is_own) in tables {
            for (index, table) in tables.iter().flatten().enumerate() {
                let setting = self.setting(&format!("parameters[{index}]"), is_own);
                parameters.extend(parameter(self.check, table, &setting));
            }
        }
        let torque_limit = self.torque_limit(&outputs, &parameters);
        let speed_loop = self.speed_loop();
        let (dc, setting) = self.pick("dc", |table| &table.dc);
        let dc = clocks::resolve(self.check, bus, &setting, dc.as_ref(), Beat::Drive);
        self.sync0(bus, kind.name, defaults.sync0_cycles, dc.flatten());
        let timeouts = self.pick("timeouts", |table| &table.timeouts).0;
        let mut custom = self.defaults.custom.clone();
        custom.0.extend(self.own.custom.0.clone());
        Some(DrivePlan {
            name,
            place: place?,
            device: kind.name.to_owned(),
            identity,
            outputs: outputs?,
            inputs: inputs?,
            scale: scale?,
            torque_limit: torque_limit?,
            mode: self.pick("mode", |table| &table.mode).0,
            speed_loop: speed_loop?,
            encoder: self.pick("encoder", |table| &table.encoder).0.unwrap_or_default(),
            dc: dc?,
            timeouts: timeouts.as_ref().map_or_else(Default::default, Into::into),
            parameters,
            custom,
        })
    }

    /// A device whose maker says which cycles it takes is given one of these.
    fn sync0(&mut self, bus: &BusTable, device: &str, cycles: Option<Sync0Cycles>, dc: Option<DcPlan>) {
        let (Some(cycles), Some(dc), Some(cycle_us)) = (cycles, dc, bus.cycle_us) else { return };
        let per_cycle = dc.sync0_per_cycle;
        if cycles.take(u64::from(cycle_us) * 1000 / u64::from(per_cycle)) {
            return;
        }
        let reason = format!(
            "with {per_cycle} SYNC0 in each cycle, device `{device}` refuses it (AL status code 0x0035), so no run begins"
        );
        let problem = self.check.report(ProblemKind::OutOfRange, "bus.cycle_us", reason);
        problem.value = Some(cycle_us.to_string());
        problem.limit = Some(format!(
            "from one SYNC0 to the next whole multiples of {} us up to {} us",
            cycles.step_us, cycles.longest_us
        ));
    }

    /// The keys of the device, in the drive's own table or among the defaults.
    fn keys(&mut self, kind: &Kind, sort: &Sort, shared: &Given) {
        let (own, index) = (Given::of(self.own), self.index);
        let has_defaults = self.check.locations.place("drive_defaults").is_some();
        let setting = |key: &str| {
            let is_shared = !own.has(key) && (shared.has(key) || has_defaults);
            if is_shared { format!("drive_defaults.{key}") } else { format!("drive[{index}].{key}") }
        };
        self.check.kind_reads(kind, &own.or(shared), &setting);
        self.check.nobody_reads(&[kind], &own, sort, &format!("drive[{index}]"));
    }

    fn identity(&mut self, device: &DeviceDefaults) -> Identity {
        let mut number = |key: &str, get: fn(&DriveTable) -> &Option<String>, default: Option<u32>| {
            let (Some(text), setting) = self.pick(key, get) else { return default };
            subdevices::identity_number(self.check, &setting, &text)
        };
        Identity {
            vendor_id: number("vendor_id", |table| &table.vendor_id, device.identity.vendor_id),
            product_code: number("product_code", |table| &table.product_code, device.identity.product_code),
            revision: number("revision", |table| &table.revision, device.identity.revision),
        }
    }

    fn pdos(
        &mut self,
        key: &str,
        get: fn(&DriveTable) -> &Option<Vec<PdoTable>>,
        default: &[PdoPlan],
    ) -> Option<Vec<PdoPlan>> {
        let (Some(tables), setting) = self.pick(key, get) else { return Some(default.to_vec()) };
        let indices = if key == "outputs" { &subdevices::OUTPUT_PDOS } else { &subdevices::INPUT_PDOS };
        subdevices::pdos(self.check, &setting, &tables, indices)
    }

    fn required_objects(&mut self, outputs: &Option<Vec<PdoPlan>>, inputs: &Option<Vec<PdoPlan>>) {
        if let Some(pdos) = outputs {
            self.required("outputs", pdos, &[(0x6040, 16, "the control word"), (0x6060, 8, "the mode")]);
        }
        if let Some(pdos) = inputs {
            self.required(
                "inputs",
                pdos,
                &[(0x6041, 16, "the status word"), (0x6064, 32, "the actual position")],
            );
        }
    }

    fn required(&mut self, key: &str, pdos: &[PdoPlan], objects: &[(u16, u8, &str)]) {
        let own = if key == "outputs" { self.own.outputs.is_some() } else { self.own.inputs.is_some() };
        let setting = self.setting(key, own);
        for (object, bits, what) in objects {
            if !is_mapped(pdos, *object, *bits) {
                let reason = format!("{what} must be mapped, whole and at a byte");
                let problem = self.check.report(ProblemKind::Missing, &setting, reason);
                problem.limit = Some(format!("{object:04X}:{bits}"));
            }
        }
        let bytes = pdos.iter().map(PdoPlan::bits).sum::<u32>().div_ceil(8) as usize;
        if bytes > MAX_PROCESS_BYTES {
            let problem =
                self.check.report(ProblemKind::OutOfRange, &setting, "too much for one cycle's record");
            problem.value = Some(format!("{bytes} bytes"));
            problem.limit = Some(format!("at most {MAX_PROCESS_BYTES} bytes a drive"));
        }
    }

    fn scale(&mut self, device: &DeviceDefaults) -> Option<DriveScale> {
        let (counts, counts_setting) =
            self.pick("counts_per_revolution", |table| &table.counts_per_revolution);
        let (rated, rated_setting) = self.pick("rated_torque_nm", |table| &table.rated_torque_nm);
        let counts = counts.or(device.counts_per_revolution);
        let counts = self.check.need(counts, &counts_setting, "positions and speeds are scaled by it");
        let rated = self.check.need(rated, &rated_setting, "torques are scaled by it");
        let (peak, peak_setting) = self.pick("peak_torque_nm", |table| &table.peak_torque_nm);
        let (rated, peak) = (rated?, peak.or(rated)?);
        // Torque objects hold 16 bits of 0.1 %.
        if peak < rated || peak > 32.767 * rated {
            let reason = "the peak torque lies above the rated torque, and its object holds 16 bits";
            let problem = self.check.report(ProblemKind::OutOfRange, &peak_setting, reason);
            problem.value = Some(peak.to_string());
            problem.limit = Some(format!("{rated} to {}", 32.767 * rated));
        }
        Some(DriveScale {
            counts_per_revolution: counts?,
            gear_ratio: self.pick("gear_ratio", |table| &table.gear_ratio).0.unwrap_or(1.0),
            direction: self.pick("direction", |table| &table.direction).0.unwrap_or(TurnDirection::Forward),
            speed_unit: self.pick("speed_unit", |table| &table.speed_unit).0.unwrap_or(SpeedUnit::CountsS),
            rated_torque_nm: rated,
            peak_torque_nm: peak,
        })
    }

    /// The loop, where the file has one; `None` for half of one. Whether it is needed the control laws tell.
    fn speed_loop(&mut self) -> Option<Option<SpeedLoopPlan>> {
        let (gain, of_gain) = self.pick("speed_loop_gain_nm_s_rad", |table| &table.speed_loop_gain_nm_s_rad);
        let (integral, of_integral) =
            self.pick("speed_loop_integral_s", |table| &table.speed_loop_integral_s);
        // What is missing stands beside the other one.
        let beside = |given: &str, key: &str| {
            given.rsplit_once('.').map_or_else(String::new, |(table, _)| format!("{table}.{key}"))
        };
        const WHY: &str = "a speed loop has a gain and an integral time";
        match (gain, integral) {
            (None, None) => Some(None),
            (Some(gain_nm_s_rad), Some(integral_s)) => {
                Some(Some(SpeedLoopPlan { gain_nm_s_rad, integral_s }))
            }
            (Some(_), None) => self.check.need(None, &beside(&of_gain, "speed_loop_integral_s"), WHY),
            (None, Some(_)) => self.check.need(None, &beside(&of_integral, "speed_loop_gain_nm_s_rad"), WHY),
        }
    }

    /// How the drive is told its torque limit; how much that is needs the limits.
    fn torque_limit(
        &mut self,
        outputs: &Option<Vec<PdoPlan>>,
        parameters: &[ParameterPlan],
    ) -> Option<TorqueLimit> {
        let objects = self.pick("torque_limit", |table| &table.torque_limit).0;
        let objects = objects.unwrap_or(TorqueLimitName::MaxTorque);
        let setting = self.setting("parameters", self.own.parameters.is_some());
        torque_limit::no_parameter_contradicts(self.check, &setting, parameters, objects);
        let setting = self.setting("outputs", self.own.outputs.is_some());
        let told = torque_limit::told(self.check, &setting, outputs.as_ref()?, objects);
        Some(TorqueLimit { wheel_nm: 0.0, objects, told })
    }

    fn parameters_file(&mut self, name: &str, setting: &str, read_file: ReadFile<'_>) -> Vec<ParameterPlan> {
        let text = match read_file(name) {
            Ok(text) => text,
            Err(reason) => {
                self.check.report(ProblemKind::File, setting, reason).value = Some(format!("\"{name}\""));
                return Vec::new();
            }
        };
        let Source { file, locations, problems } = Source::<ParametersFile>::read(&text, Some(name));
        let mut check = Check { locations, problems };
        let parameters = file
            .parameter
            .iter()
            .enumerate()
            .filter_map(|(index, table)| parameter(&mut check, table, &format!("parameter[{index}]")))
            .collect();
        // Several drives may name one file: its problems are told once.
        for problem in check.problems {
            if !self.check.problems.contains(&problem) {
                self.check.problems.push(problem);
            }
        }
        parameters
    }
}
