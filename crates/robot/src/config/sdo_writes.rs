//! Which objects of the drives may be written by SDO while the robot runs.

use omnibase_ethercat::wire::coe::ObjectAddress;

use super::plan::RobotPlan;

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
pub(crate) fn owner(index: u16) -> Option<&'static str> {
    Some(match index {
        0x6040 => "the cycle writes the controlword",
        0x6060 => "the controller decides about the mode of operation",
        0x607A | 0x60FF | 0x6071 | 0x60C1 | 0x60B0..=0x60B2 => "the cycle writes the targets",
        0x6072 => "the torque limit is that of the robot's file",
        0x1600..=0x17FF | 0x1A00..=0x1BFF | 0x1C00..=0x1C2F => "the bus decides what is mapped",
        0x10F1 | 0x1C32 | 0x1C33 | 0x60C2 => "the bus decides about the synchronisation",
        0x6007 | 0x605A..=0x605E | 0x6085 => "the stops depend on it, and it was read back at the start",
        0x1011 => "it takes back what the robot's file has set",
        // Gear, feed, encoders, notation and factors, polarity; and the rated current and torque, whose thousandths torques are.
        0x6089..=0x608C | 0x608F..=0x6097 | 0x607E | 0x6075 | 0x6076 => {
            "positions, speeds and torques are counted by it"
        }
        _ => return None,
    })
}

impl RobotPlan {
    /// When an object of a drive may be written.
    pub fn sdo_write_rule(&self, object: ObjectAddress) -> SdoWriteRule {
        let is_output = |drive: &super::drive_plan::DrivePlan| {
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
