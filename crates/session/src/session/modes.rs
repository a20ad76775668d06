//! The modes of the drives at set-up: whether each has those that its file needs.

use omnibase_cia402::{Mode, SupportedModes};
use omnibase_ethercat::Bus;
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, Link};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{BusPlace, DriveMode};

use super::{SessionError, peripherals};

const SUPPORTED_MODES: ObjectAddress = ObjectAddress::new(0x6502, 0);

/// Asks each drive whose file names modes. One that doesn't say what it has is believed: the cycle waits for each mode, and
/// stops where it doesn't come.
pub(super) fn check<L: Link, C: Clock>(bus: &mut Bus<L, C>, plan: &RobotPlan) -> Result<(), SessionError> {
    let of_axes = plan
        .devices
        .iter()
        .filter_map(|device| Some((&device.name, device.place, device.axis.as_ref()?.needed_modes())));
    let of_wheels = plan.drives.iter().filter_map(|drive| {
        let mode = match drive.mode? {
            DriveMode::Speed => Mode::CyclicSynchronousVelocity,
            DriveMode::Torque => Mode::CyclicSynchronousTorque,
        };
        Some((&drive.name, drive.place, vec![mode]))
    });
    let named: Vec<(&String, BusPlace, Vec<Mode>)> = of_wheels.chain(of_axes).collect();
    for (name, place, needed) in named {
        let Some(position) = peripherals::found(place, bus.subdevices()).map(|found| found.position) else {
            continue;
        };
        let Some(supported) = supported_modes(bus, position) else { continue };
        if let Some(mode) = lacking(&needed, supported) {
            let needed = needed.iter().map(|mode| mode.abbreviation()).collect::<Vec<_>>().join(", ");
            return Err(SessionError::Mode { name: name.clone(), position, mode, needed, supported });
        }
    }
    Ok(())
}

/// The modes that a drive says it has; `None` where it doesn't say.
pub fn supported_modes<L: Link, C: Clock>(bus: &mut Bus<L, C>, position: u16) -> Option<SupportedModes> {
    let data = bus.sdo_read(position, SUPPORTED_MODES, SdoAccess::Entry).ok()?;
    Some(SupportedModes(data.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))))
}

/// The first mode that a drive lacks.
fn lacking(needed: &[Mode], supported: SupportedModes) -> Option<Mode> {
    needed.iter().copied().find(|mode| !supported.supports(*mode))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_mode_that_a_drive_lacks_is_found() {
        let needed = [Mode::CyclicSynchronousPosition, Mode::ProfilePosition, Mode::Homing];
        // pp, pv, tq, hm, csp, csv, cst.
        assert_eq!(lacking(&needed, SupportedModes(0x3AD)), None);
        assert_eq!(lacking(&needed, SupportedModes(0x3AD & !(1 << 5))), Some(Mode::Homing));
        assert_eq!(lacking(&needed, SupportedModes(0)), Some(Mode::CyclicSynchronousPosition));
        assert_eq!(lacking(&[], SupportedModes(0)), None);
    }
}
