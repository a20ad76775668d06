//! A joystick's table against itself and against the ready maps; against a device it is checked when that is there.

use std::collections::BTreeMap;

use super::Check;
use crate::config::{AxisCode, DeadManRule, JoystickTable, ProblemKind, ReadyMapName};

/// A setting that a ready map doesn't allow.
struct Clash {
    setting: String,
    /// The axis or button that it names.
    value: String,
    kind: ProblemKind,
    reason: String,
}

/// An axis or a button that has a task.
struct Assigned {
    /// The setting that says so.
    setting: String,
    /// `axis` or `button`.
    what: &'static str,
    /// Its code among its like.
    code: u16,
    /// As the file names it, in quotes.
    name: String,
    /// Devices of the ready map can have it.
    can_be: bool,
}

impl Check {
    pub(super) fn joystick(&mut self, table: &JoystickTable) {
        let before = self.problems.len();
        let mut first: BTreeMap<(&str, u16), String> = BTreeMap::new();
        for Assigned { setting, what, code, name, .. } in assigned(table, ReadyMapName::None) {
            if let Some(other) = first.insert((what, code), setting.clone()) {
                let reason = format_args!("{other} has this {what} already");
                self.report(ProblemKind::Duplicate, &setting, reason).value = Some(name);
            }
        }
        match table.map {
            Some(ReadyMapName::None) => self.joystick_alone(table),
            _ if self.problems.len() > before => {}
            Some(ready) => {
                for Clash { setting, value, kind, reason } in against(table, ready) {
                    self.report(kind, &setting, reason).value = Some(value);
                }
            }
            None => self.joystick_of_any_map(table),
        }
    }

    /// Nobody knows yet which device there will be: one ready map, whichever, must fit.
    fn joystick_of_any_map(&mut self, table: &JoystickTable) {
        let problems = ReadyMapName::KNOWN.map(|ready| against(table, ready));
        if problems.iter().any(Vec::is_empty) {
            return;
        }
        let mut clashes: BTreeMap<String, Clash> = BTreeMap::new();
        for clash in problems.into_iter().flatten() {
            match clashes.get_mut(&clash.setting) {
                Some(known) => known.reason += &format!("; {}", clash.reason),
                None => drop(clashes.insert(clash.setting.clone(), clash)),
            }
        }
        for Clash { setting, value, kind, reason } in clashes.into_values() {
            let reason = format_args!("the joystick fits no ready map: {reason}");
            self.report(kind, &setting, reason).value = Some(value);
        }
    }

    fn joystick_alone(&mut self, table: &JoystickTable) {
        if table.dead_man != Some(DeadManRule::NotRequired) {
            let why = "without a ready map nobody else names the dead-man button";
            self.need(table.buttons.dead_man, "joystick.buttons.dead_man", why);
        }
        let why = "a joystick that was stopped or lost drives again only after a person enabled it";
        self.need(table.buttons.enable, "joystick.buttons.enable", why);
        if table.forward.axis.is_none() && table.left.axis.is_none() && table.turn.axis.is_none() {
            self.need(
                None::<AxisCode>,
                "joystick.forward.axis",
                "a joystick has at least one axis that drives",
            );
        }
    }
}

/// What of the table a ready map doesn't allow.
fn against(table: &JoystickTable, ready: ReadyMapName) -> Vec<Clash> {
    let own = assigned(table, ready);
    let all = assigned(&table.over(ready), ready);
    let map = ready.name();
    let mut problems = Vec::new();
    for Assigned { setting, what, code, name, can_be } in own {
        if !can_be {
            let reason = format!("devices of the ready map `{map}` have no {what} {name}");
            problems.push(Clash { setting, value: name, kind: ProblemKind::UnknownName, reason });
            continue;
        }
        let other =
            all.iter().find(|other| (other.what, other.code) == (what, code) && other.setting != setting);
        if let Some(other) = other {
            let reason = format!(
                "the ready map `{map}` has {name} for {0}: give {0} another {what} too",
                other.setting
            );
            problems.push(Clash { setting, value: name, kind: ProblemKind::Duplicate, reason });
        }
    }
    problems
}

/// All axes and buttons that a table names.
fn assigned(table: &JoystickTable, ready: ReadyMapName) -> Vec<Assigned> {
    let axes = table.named_axes().into_iter().filter_map(|(name, axis)| {
        let axis = axis?;
        Some(Assigned {
            setting: format!("joystick.{name}.axis"),
            what: "axis",
            code: axis.0,
            name: format!("\"{}\"", axis.name()),
            can_be: ready.can_have_axis(axis),
        })
    });
    let buttons = table.buttons.named().into_iter().filter_map(|(name, button)| {
        // Where no dead-man button is required, it is free for another task.
        let is_free = name == "dead_man" && table.dead_man == Some(DeadManRule::NotRequired);
        let button = button.filter(|_| !is_free)?;
        Some(Assigned {
            setting: format!("joystick.buttons.{name}"),
            what: "button",
            code: button.0,
            name: format!("\"{}\"", button.name()),
            can_be: ready.can_have_button(button),
        })
    });
    axes.chain(buttons).collect()
}
