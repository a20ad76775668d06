//! What an axis maps where nobody says otherwise, and where its objects lie in its process data.

use crate::config::PdoPlan;
use crate::devices::{Field, pdo};
use crate::registry::{Made, PeripheralDefaults};

pub(in super::super) fn defaults() -> PeripheralDefaults {
    PeripheralDefaults {
        outputs: vec![pdo(
            0x1600,
            &[
                (0x6040, 0, 16),
                (0x607A, 0, 32),
                (0x60FF, 0, 32),
                (0x6071, 0, 16),
                (0x6072, 0, 16),
                (0x6060, 0, 8),
                (0, 0, 8),
            ],
        )],
        inputs: vec![pdo(
            0x1A00,
            &[
                (0x6041, 0, 16),
                (0x6064, 0, 32),
                (0x606C, 0, 32),
                (0x6077, 0, 16),
                (0x603F, 0, 16),
                (0x6061, 0, 8),
                (0, 0, 8),
            ],
        )],
        ..Default::default()
    }
}

/// Where its objects lie in its process data.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields {
    pub(super) status: Field,
    pub(super) position: Field,
    pub(super) speed: Field,
    pub(super) torque: Option<Field>,
    pub(super) shown_mode: Field,
    pub(super) error: Option<Field>,
    pub(super) control: Field,
    pub(super) mode: Field,
    pub(super) target_position: Field,
    pub(super) target_speed: Option<Field>,
    pub(super) torque_limit: Option<Field>,
}

impl Fields {
    pub(super) fn new(inputs: &[PdoPlan], outputs: &[PdoPlan]) -> Made<Self> {
        Ok(Fields {
            status: Field::needed(inputs, 0x6041, "the status word")?,
            position: Field::needed(inputs, 0x6064, "the actual position")?,
            speed: Field::needed(inputs, 0x606C, "the actual speed")?,
            torque: Field::find(inputs, 0x6077, 0),
            shown_mode: Field::needed(inputs, 0x6061, "the mode that the drive shows")?,
            error: Field::find(inputs, 0x603F, 0),
            control: Field::needed(outputs, 0x6040, "the control word")?,
            mode: Field::needed(outputs, 0x6060, "the mode")?,
            target_position: Field::needed(outputs, 0x607A, "the target position")?,
            target_speed: Field::find(outputs, 0x60FF, 0),
            torque_limit: Field::find(outputs, 0x6072, 0),
        })
    }
}
