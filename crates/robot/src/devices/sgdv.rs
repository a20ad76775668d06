//! The Yaskawa SGDV with option SGDV-OCA01A, and its direct-drive motors with 20-bit encoders.
//!
//! It follows CiA 402; what is its own is data: identity, PDO maps and encoder. Source: thesis 5.2 and Yaskawa's
//! manual SIEP C720829 04. The map is the drive's default with the measured speed in place of the touch probe, for
//! one of its PDOs holds at most eight objects.

use omnibase_cia402::{EncoderScale, ErrorCode};

use super::{DeviceDefaults, pdo, written};
use crate::config::Identity;
use crate::registry::Sync0Cycles;

/// A.A10 to A.A12: SYNC0, AL state and process data that don't come as they should (manual, section 9.1).
const BUS_ALARMS: &[ErrorCode] = &[ErrorCode(0x0A10), ErrorCode(0x0A11), ErrorCode(0x0A12)];

pub(super) fn defaults() -> DeviceDefaults {
    DeviceDefaults {
        identity: Identity { vendor_id: Some(0x0539), product_code: Some(0x0220_0001), revision: None },
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
                (0x60C1, 1, 32),
            ],
        )],
        inputs: vec![pdo(
            0x1A00,
            &[
                (0x6041, 0, 16),
                (0x6064, 0, 32),
                (0x6077, 0, 16),
                (0x60F4, 0, 32),
                (0x6061, 0, 8),
                (0, 0, 8),
                (0x606C, 0, 32),
            ],
        )],
        counts_per_revolution: Some(EncoderScale::COUNTS_PER_REVOLUTION_20_BIT),
        parameters: vec![
            // As delivered (1, with 0x605E = 0), a drive that the bus leaves lets its motor roll out for seconds; and a
            // wheel that lets go when it has stopped is dragged on by those that still brake.
            written(0x6007, 3, "sgdv: bus lost: quick stop"),
            written(0x605A, 6, "sgdv: quick stop: ramp of 0x6085, then hold"),
        ],
        bus_errors: BUS_ALARMS,
        sync0_cycles: Some(Sync0Cycles { step_us: 125, longest_us: 4000 }),
    }
}
