//! What a device checks before it enters a state, and the AL status code that tells what is wrong.

use crate::dictionary::pdo::Direction;
use crate::pdi::Pdi;
use omnibase_ethercat_wire::AlStatusCode;
use omnibase_ethercat_wire::bytes::{u16_at, u32_at};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::sii::MailboxArea;

/// Control bits 0 and 1: buffered (0) or mailbox (2).
const MODE: u8 = 3;
const MODE_MAILBOX: u8 = 2;
/// Control bits 2 and 3: the MainDevice reads (0) or writes (1).
const DIRECTION: u8 = 3 << 2;
const WRITTEN_BY_MAIN_DEVICE: u8 = 1 << 2;
/// Activation bit 0.
const ENABLED: u8 = 1;

/// When a device expects a SyncManager to be on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SmActivation {
    /// From SAFE-OP on.
    #[default]
    SafeOp,
    /// From OP on; before it is off.
    OpOnly,
    /// Never: FMMUs alone reach its area.
    Virtual,
}

/// A SyncManager for process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessSyncManager {
    /// Number of the SyncManager.
    pub number: u8,
    /// Which way.
    pub direction: Direction,
    /// Where its area must start.
    pub start: u16,
    /// Control register that it must have, watchdog and interrupt bits aside.
    pub control: u8,
    /// Most bytes.
    pub max_bytes: u16,
    /// Length that it may have where nothing is mapped to it, bytes: that of its SII.
    pub listed_bytes: u16,
    /// When it must be on.
    pub activation: SmActivation,
}

/// A SyncManager's registers.
#[derive(Clone, Copy, Debug)]
struct SyncManagerRegisters {
    start: u16,
    length: u16,
    control: u8,
    enabled: bool,
}

fn sync_manager(pdi: &mut dyn Pdi, number: u8) -> SyncManagerRegisters {
    let mut bytes = [0; 8];
    pdi.read(reg::SM + reg::SM_SIZE * u16::from(number), &mut bytes);
    SyncManagerRegisters {
        start: u16_at(&bytes, 0),
        length: u16_at(&bytes, 2),
        control: bytes[4],
        enabled: bytes[6] & ENABLED != 0,
    }
}

/// Whether SM0 and SM1 are the mailboxes that the device has.
pub(crate) fn mailbox(pdi: &mut dyn Pdi, area: &MailboxArea) -> bool {
    let receive = sync_manager(pdi, 0);
    let send = sync_manager(pdi, 1);
    let fits = |sm: SyncManagerRegisters, start, length, direction| {
        sm.enabled
            && (sm.start, sm.length) == (start, length)
            && sm.control & (MODE | DIRECTION) == MODE_MAILBOX | direction
    };
    fits(receive, area.receive_offset, area.receive_size, WRITTEN_BY_MAIN_DEVICE)
        && fits(send, area.send_offset, area.send_size, 0)
}

/// Whether SM0 and SM1 are switched on.
pub(crate) fn mailbox_enabled(pdi: &mut dyn Pdi) -> bool {
    sync_manager(pdi, 0).enabled && sync_manager(pdi, 1).enabled
}

/// Whether a SyncManager is switched on.
pub(crate) fn enabled(pdi: &mut dyn Pdi, number: u8) -> bool {
    sync_manager(pdi, number).enabled
}

/// Whether a SyncManager and the FMMUs carry `bytes` of process data as `plan` wants them.
pub(crate) fn process_data(
    pdi: &mut dyn Pdi,
    plan: &ProcessSyncManager,
    bytes: usize,
) -> Result<(), AlStatusCode> {
    let wrong = invalid_configuration(plan.direction);
    let sm = sync_manager(pdi, plan.number);
    if bytes == 0 {
        let is_listed = plan.listed_bytes != 0 && sm.length == plan.listed_bytes && sm.start == plan.start;
        return if sm.enabled && sm.length != 0 && !is_listed { Err(wrong) } else { Ok(()) };
    }
    if plan.activation == SmActivation::Virtual {
        let area = plan.start..plan.start.saturating_add(bytes as u16);
        return if !sm.enabled && is_mapped(pdi, plan.direction, area) { Ok(()) } else { Err(wrong) };
    }
    let direction = match plan.direction {
        Direction::Outputs => WRITTEN_BY_MAIN_DEVICE,
        Direction::Inputs => 0,
    };
    let is_on_in_time = sm.enabled == (plan.activation == SmActivation::SafeOp);
    if !is_on_in_time
        || usize::from(sm.length) != bytes
        || sm.start != plan.start
        || sm.control & DIRECTION != direction
    {
        return Err(wrong);
    }
    if sm.control & MODE != plan.control & MODE {
        return Err(AlStatusCode::INVALID_SYNC_MANAGER);
    }
    if !is_mapped(pdi, plan.direction, sm.start..sm.start.saturating_add(sm.length)) {
        return Err(wrong);
    }
    Ok(())
}

/// The code that says that a direction's SyncManager isn't as it must be.
pub(crate) fn invalid_configuration(direction: Direction) -> AlStatusCode {
    match direction {
        Direction::Outputs => AlStatusCode::INVALID_OUTPUT_CONFIGURATION,
        Direction::Inputs => AlStatusCode::INVALID_INPUT_CONFIGURATION,
    }
}

/// Whether no two switched-on SyncManagers share a byte.
pub(crate) fn areas_apart(pdi: &mut dyn Pdi) -> bool {
    let mut count = [0];
    pdi.read(reg::SM_COUNT, &mut count);
    let areas: Vec<(u32, u32)> = (0..count[0].min(16))
        .map(|number| sync_manager(pdi, number))
        .filter(|sm| sm.enabled && sm.length != 0 && sm.start >= reg::PROCESS_DATA)
        .map(|sm| {
            // Three buffers lie one behind the other.
            let buffers = if sm.control & MODE == 0 { 3 } else { 1 };
            (u32::from(sm.start), u32::from(sm.start) + buffers * u32::from(sm.length))
        })
        .collect();
    areas
        .iter()
        .enumerate()
        .all(|(number, one)| areas[..number].iter().all(|other| one.1 <= other.0 || other.1 <= one.0))
}

/// Whether active FMMUs of this direction cover every byte of `area`.
fn is_mapped(pdi: &mut dyn Pdi, direction: Direction, area: core::ops::Range<u16>) -> bool {
    let wanted = match direction {
        Direction::Inputs => 1,
        Direction::Outputs => 2,
    };
    let mut count = [0];
    pdi.read(reg::FMMU_COUNT, &mut count);
    let covered: Vec<(u32, u32)> = (0..u16::from(count[0].min(16)))
        .filter_map(|number| {
            let mut fmmu = [0; 16];
            pdi.read(reg::FMMU + reg::FMMU_SIZE * number, &mut fmmu);
            let active = fmmu[12] & 1 != 0 && fmmu[11] & wanted != 0;
            active.then(|| physical_bytes(&fmmu))
        })
        .collect();
    area.map(u32::from).all(|byte| covered.iter().any(|(first, end)| (*first..*end).contains(&byte)))
}

/// First byte, and the byte behind the last, that an FMMU reaches in the SubDevice's memory.
fn physical_bytes(fmmu: &[u8; 16]) -> (u32, u32) {
    let length = u32::from(u16_at(fmmu, 4));
    let (first_bit, last_bit) = (u32::from(fmmu[6] & 7), u32::from(fmmu[7] & 7));
    let bits = (length * 8 + last_bit + 1).saturating_sub(8 + first_bit);
    let start = u32::from(u16_at(fmmu, 8));
    let start_bit = u32::from(fmmu[10] & 7);
    (start, start + (start_bit + bits).div_ceil(8))
}

/// SYNC0 as the MainDevice programmed it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SyncRegisters {
    pub sync0: bool,
    pub sync1: bool,
    pub sync0_cycle_ns: u32,
    pub sync1_cycle_ns: u32,
}

pub(crate) fn sync_registers(pdi: &mut dyn Pdi) -> SyncRegisters {
    let (mut activation, mut cycles) = ([0], [0; 8]);
    pdi.read(reg::DC_ACTIVATION, &mut activation);
    pdi.read(reg::DC_SYNC0_CYCLE, &mut cycles);
    let on = |bit: u8| activation[0] & 1 != 0 && activation[0] >> bit & 1 != 0;
    SyncRegisters {
        sync0: on(1),
        sync1: on(2),
        sync0_cycle_ns: u32_at(&cycles, 0),
        sync1_cycle_ns: u32_at(&cycles, 4),
    }
}
