//! Which objects the robot's file lets be written while the drives are enabled.

use omnibase_ethercat::wire::coe::ObjectAddress;

use super::Check;
use crate::config::{ProblemKind, owner, parse_object};

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
    use super::ObjectAddress;
    use crate::Registry;
    use crate::config::*;

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
        // What torques are counted by: with another rated torque the limit would be another one.
        for index in [0x6075, 0x6076, 0x6091, 0x6093, 0x6096] {
            let rule = plan.sdo_write_rule(ObjectAddress::new(index, 0));
            let why = "positions, speeds and torques are counted by it";
            assert_eq!(rule, SdoWriteRule::Never(why), "{index:04x}");
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
