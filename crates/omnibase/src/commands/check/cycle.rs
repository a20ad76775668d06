//! Which cycle a robot's frames fit into, as far as its file tells: lengths of process data, and how many SubDevices.

use omnibase_ethercat::config::{DcConfig, Every, LrwPermission, Timeouts};
use omnibase_ethercat::image::{Area, ClockUse, CycleFit, ImagePlan, Member, Packing};
use omnibase_ethercat::mailbox::DEFAULT_TIMEOUT;
use omnibase_ethercat::subdevice::{DcWidth, Direction, MailboxConfig, MemoryArea};
use omnibase_ethercat::wire::sii::PROTOCOL_COE;
use omnibase_robot::RobotPlan;
use std::io::{self, Write};

/// Mailboxes of drives are about that long, bytes.
const MAILBOX_BYTES: u16 = 256;

/// The shortest cycle of its frames, and whether the file's is one.
pub fn print(plan: &RobotPlan, output: &mut dyn Write) -> io::Result<()> {
    let Some(fit) = fit(plan) else { return Ok(()) };
    writeln!(output, "\nshortest cycle, estimated: {fit}")?;
    let timeout_us = plan.bus.receive_timeout_ns / 1000;
    if fit.needed().as_micros() as u64 > timeout_us {
        writeln!(
            output,
            "\nWARNING: bus.cycle_us = {}, frames awaited for {timeout_us} us: they are probably not back by then",
            plan.bus.cycle_ns / 1000
        )?;
    }
    Ok(())
}

/// What its frames need; `None` where they fit into no cycle. The way through the segment is estimated.
fn fit(plan: &RobotPlan) -> Option<CycleFit> {
    let drives = plan.drives.iter().map(|drive| (drive.output_bytes(), drive.input_bytes(), Every::CYCLE));
    let devices =
        plan.devices.iter().map(|device| (device.output_bytes(), device.input_bytes(), device.every));
    let members: Vec<Member> = (0u16..)
        .zip(drives.chain(devices))
        .map(|(position, (outputs, inputs, every))| {
            let area = |sync_manager, direction, bytes: usize| Area {
                sync_manager,
                direction,
                bit_length: 8 * bytes as u32,
                packing: Packing::Bytes,
            };
            let areas = [area(2, Direction::Outputs, outputs), area(3, Direction::Inputs, inputs)];
            let memory = |start| MemoryArea { start, length: MAILBOX_BYTES };
            Member {
                position,
                station: 0x1001 + position,
                lrw: LrwPermission::Barred,
                areas: areas.into_iter().filter(|area| area.bit_length > 0).collect(),
                mailbox: Some(MailboxConfig {
                    write: memory(0x1000),
                    read: memory(0x1400),
                    protocols: PROTOCOL_COE,
                    answer_timeout: DEFAULT_TIMEOUT,
                }),
                every,
                op_only: Vec::new(),
                clock: Some(DcWidth::Bits64),
                sync: DcConfig::Off,
                assign_activate: 0,
                timeouts: Timeouts::default(),
            }
        })
        .collect();
    let plan = ImagePlan::new(&members, ClockUse::Distribute { reference: 0 }).ok()?;
    Some(plan.fit(members.len(), None))
}
