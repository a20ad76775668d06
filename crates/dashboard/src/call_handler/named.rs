//! What a call names, as the robot's plan has it: controllers, wheels, outputs, sources, axes.

use std::collections::BTreeMap;

use omnibase_robot::RequestKind;
use omnibase_robot::config::{AxisMode, AxisPlan, DriveMode};
use omnibase_robot::signals::{AxisAsk, Heard};
use omnibase_run::live::Stamp;

use super::CallHandler;
use crate::call::unknown;
use crate::status::NS_OF_MS;

/// Whether an axis may be moved in a mode.
fn has_mode(name: &str, axis: &AxisPlan, mode: AxisMode) -> Result<(), String> {
    if axis.modes.contains(&mode) {
        return Ok(());
    }
    let modes: Vec<_> = axis.modes.iter().map(|mode| mode.mode().abbreviation()).collect();
    let (modes, found) = (modes.join(", "), mode.mode().abbreviation());
    Err(format!("{name}: expected a mode of its `axis.modes` ({modes}), found {found}"))
}

impl CallHandler {
    pub(super) fn controller(&self, name: &str) -> Result<u32, String> {
        let plan = &self.about.robot.plan;
        let found = plan.controllers().position(|known| known == name);
        found.map(|index| index as u32).ok_or_else(|| unknown("controller", name, plan.controllers()))
    }

    /// What commands a wheel's drive so, where there is one.
    pub(super) fn drive_mode(&self, name: &str, mode: Option<DriveMode>) -> Result<RequestKind, String> {
        let drives = &self.about.robot.plan.drives;
        let Some(wheel) = drives.iter().position(|drive| drive.name == name) else {
            return Err(unknown("wheel", name, drives.iter().map(|drive| drive.name.as_str())));
        };
        Ok(RequestKind::SetDriveMode { wheel: wheel as u32, mode })
    }

    /// What sets an output, where it is there and can have the value.
    pub(super) fn output(&self, name: &str, value: f64) -> Result<RequestKind, String> {
        let plan = &self.about.robot.plan;
        let outputs = plan.signals().outputs;
        let found = outputs.iter().position(|output| output.name == name);
        let Some(index) = found else {
            return Err(unknown("output", name, outputs.iter().map(|output| output.name.as_str())));
        };
        let coding = plan.devices.iter().flat_map(|device| &device.output).nth(index);
        if let Some(coding) = coding.and_then(|output| output.coding).filter(|coding| !coding.holds(value)) {
            let [least, greatest] = coding.values();
            return Err(format!("{name}: expected {least} to {greatest}, found {value}"));
        }
        Ok(RequestKind::SetOutput { index: index as u32, value })
    }

    /// What a program outside knows, as far as its instant lets it be believed.
    pub(crate) fn send_inputs(
        &self,
        stamp: Stamp,
        name: &str,
        values: &BTreeMap<String, Option<f64>>,
        instant_ms: Option<f64>,
    ) -> Result<(), String> {
        let sources = &self.about.robot.plan.sources;
        let found = sources.iter().position(|source| source.name == name);
        let Some(place) = found else {
            return Err(unknown("source", name, sources.iter().map(|source| source.name.as_str())));
        };
        let instant_ns = match (instant_ms, stamp) {
            (Some(ms), _) if ms.is_finite() && ms >= 0.0 => (ms * NS_OF_MS as f64) as u64,
            (Some(ms), _) => return Err(format!("instant_ms: expected ms of the robot's clock, found {ms}")),
            (None, Stamp::Told(told_ns)) => told_ns,
            (None, Stamp::Here | Stamp::OnBehalf | Stamp::Missing) => {
                return Err("expected `instant_ms`, or `stamp`: nobody knows how old it is".to_owned());
            }
        };
        let mut heard = Heard { instant_ns, ..Heard::NOTHING };
        for (value_name, value) in values {
            let inputs = &sources[place].input;
            let found = inputs.iter().position(|input| input.name == *value_name);
            let Some(slot) = found.and_then(|input| heard.values.get_mut(input)) else {
                let names = inputs.iter().map(|input| input.name.as_str());
                return Err(format!("{name}: {}", unknown("value", value_name, names)));
            };
            *slot = value.unwrap_or(f64::NAN);
        }
        self.live.send_inputs(place, &heard).map_err(|why| format!("{name}: {why}"))
    }

    /// What asks an axis, where it is there and can do it.
    pub(super) fn axis(&self, name: &str, ask: AxisAsk) -> Result<RequestKind, String> {
        let devices = &self.about.robot.plan.devices;
        let axes = || devices.iter().enumerate().filter_map(|(n, one)| Some((n, one, one.axis.as_ref()?)));
        let Some((device, _, axis)) = axes().find(|(_, one, _)| one.name == name) else {
            return Err(unknown("axis", name, axes().map(|(_, one, _)| one.name.as_str())));
        };
        match ask {
            AxisAsk::Home if axis.homing.is_none() => {
                return Err(format!("{name}: expected `axis.homing` in the robot's file, it has none"));
            }
            AxisAsk::Move { position, mode } => {
                let ([least, greatest], unit) = (axis.limits.position, axis.unit.name());
                if !(least..=greatest).contains(&position) {
                    return Err(format!("{name}: expected {least} to {greatest} {unit}, found {position}"));
                }
                if mode == AxisMode::Pv {
                    return Err(format!(
                        "{name}: expected csp or pp, found pv: it has no positions (run_axis)"
                    ));
                }
                has_mode(name, axis, mode)?;
            }
            AxisAsk::Run { speed } => {
                let (most, unit) = (axis.limits.speed, axis.unit.name());
                if !(-most..=most).contains(&speed) {
                    return Err(format!("{name}: expected {} to {most} {unit}/s, found {speed}", -most));
                }
                has_mode(name, axis, AxisMode::Pv)?;
            }
            AxisAsk::Home | AxisAsk::Stop => {}
        }
        Ok(RequestKind::Axis { device: device as u32, ask })
    }
}
