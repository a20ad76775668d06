//! Which objects of the drives may be written by SDO while the robot runs.

use omnibase_ethercat::wire::coe::ObjectAddress;

use super::check::Check;
use super::mapping::parse_object;
use super::plan::RobotPlan;
use super::problem::ProblemKind;

/// When an object may be written beside the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoWriteRule {
    /// Never, for this reason.
    Never(&'static str),
    /// At any time: the robot's file says so.
    Always,
    /// While no drive is enabled.
    WhileDisabled,
}

/// Why the cycle or the robot's file owns an object; `None` where it is nobody's.
fn owner(index: u16) -> Option<&'static str> {
    Some(match index {
        0x6040 => "the cycle writes the controlword",
        0x6060 => "the controller decides about the mode of operation",
        0x607A | 0x60FF | 0x6071 | 0x60C1 | 0x60B0..=0x60B2 => "the cycle writes the targets",
        0x6072 => "the torque limit is that of the robot's file",
        0x1600..=0x17FF | 0x1A00..=0x1BFF | 0x1C00..=0x1C2F => "the bus decides what is mapped",
        0x10F1 | 0x1C32 | 0x1C33 | 0x60C2 => "the bus decides about the synchronisation",
        0x6007 | 0x605A..=0x605E | 0x6085 => "the stops depend on it, and it was read back at the start",
        0x1011 => "it takes back what the robot's file has set",
        0x6091 | 0x6092 | 0x608F | 0x6090 | 0x607E | 0x6089..=0x608C => {
            "positions, speeds and torques are counted by it"
        }
        _ => return None,
    })
}

impl RobotPlan {
    /// When an object of a drive may be written.
    pub fn sdo_write_rule(&self, object: ObjectAddress) -> SdoWriteRule {
        let is_output = |drive: &super::plan::DrivePlan| {
            drive.outputs.iter().flat_map(|pdo| &pdo.entries).any(|entry| {
                (entry.index, entry.subindex) == (object.index, object.subindex) && entry.index != 0
            })
        };
        if let Some(why) = owner(object.index) {
            SdoWriteRule::Never(why)
        } else if self.drives.iter().any(is_output) {
            SdoWriteRule::Never("the cycle writes it: it is mapped")
        } else if self.sdo_write_while_enabled.contains(&object) {
            SdoWriteRule::Always
        } else {
            SdoWriteRule::WhileDisabled
        }
    }
}

/// The objects that may be written while the drives are enabled.
pub(super) fn resolve(check: &mut Check, objects: &[String]) -> Vec<ObjectAddress> {
    let mut resolved = Vec::with_capacity(objects.len());
    for (number, text) in objects.iter().enumerate() {
        let setting = format!("bus.sdo_write_while_enabled[{number}]");
        match parse_object(text) {
            Err(error) => {
                check.report(ProblemKind::WrongType, &setting, error);
            }
            Ok((index, subindex)) => match owner(index) {
                Some(why) => {
                    let problem = check.report(ProblemKind::Contradiction, &setting, why);
                    problem.value = Some(format!("\"{text}\""));
                }
                None => resolved.push(ObjectAddress::new(index, subindex)),
            },
        }
    }
    resolved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Registry;

    const BMM: &str = include_str!("../../../../robots/bmm.toml");

    #[test]
    fn what_the_cycle_owns_is_never_written_and_the_rest_while_disabled() {
        let plan = |list: &str| {
            let text = BMM.replace("[bus]\n", &format!("[bus]\nsdo_write_while_enabled = [{list}]\n"));
            RobotPlan::from_toml(&text, &Registry::with_built_in(), &|name| Err(name.to_owned()))
        };
        let refused = plan("\"6040\"").unwrap_err();
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert!(refused[0].to_string().contains("the cycle writes the controlword"), "{}", refused[0]);
        let plan = plan("\"6083\", \"60F6:0A\"").unwrap();
        for (index, subindex) in
            [(0x6040, 0), (0x6060, 0), (0x60FF, 0), (0x1600, 1), (0x1C12, 0), (0x6085, 0)]
        {
            let rule = plan.sdo_write_rule(ObjectAddress::new(index, subindex));
            assert!(matches!(rule, SdoWriteRule::Never(_)), "{index:04x}: {rule:?}");
        }
        for (index, subindex, expected) in [
            (0x6083, 0, SdoWriteRule::Always),
            (0x60F6, 10, SdoWriteRule::Always),
            (0x60F6, 1, SdoWriteRule::WhileDisabled),
            (0x6084, 0, SdoWriteRule::WhileDisabled),
        ] {
            assert_eq!(plan.sdo_write_rule(ObjectAddress::new(index, subindex)), expected);
        }
    }
}
