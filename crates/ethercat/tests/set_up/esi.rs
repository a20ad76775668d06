//! SubDevices made of makers' files: brought to OP with the commands that these want sent, seen on the wire.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use omnibase_esi::model::Pdo;
use omnibase_esi::{Assembly, Command, EsiFile};
use omnibase_ethercat::config::{PdoConfig, SyncManagerPdos};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat::{SubDevice, SubDeviceConfig};
use omnibase_ethercat_sim::device::{Piece, esi};
use omnibase_ethercat_sim::{Segment, SimLink, in_process};

use crate::operational::to_op;

/// A link that keeps what is sent.
struct Kept {
    link: SimLink,
    sent: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Link for Kept {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent.lock().unwrap().push(frame.to_vec());
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

fn sdo(command: &Command) -> SdoWrite {
    let command = &command.command;
    SdoWrite {
        object: ObjectAddress::new(command.index.index, command.subindex),
        data: command.data.clone(),
        access: if command.complete_access { SdoAccess::Complete } else { SdoAccess::Entry },
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: None,
    }
}

/// What a robot's file that was made of the maker's asks of the bus.
fn config(assembly: &Assembly, found: &SubDevice) -> SubDeviceConfig {
    let commands = assembly.commands();
    let sdos = commands.iter().filter(|one| one.is_for_pre_op()).map(sdo).collect();
    let speaks_coe = found.sii.header.mailbox_protocols & 4 != 0;
    let mut pdos = Vec::new();
    for (direction, outputs) in [(Direction::Outputs, true), (Direction::Inputs, false)] {
        let (chosen, _) = assembly.default_pdos(outputs);
        let Some(sync_manager) = chosen.first().and_then(|pdo| pdo.sync_manager).filter(|_| speaks_coe)
        else {
            continue;
        };
        let entries = |pdo: &Pdo| {
            let entry = |entry: &omnibase_esi::model::PdoEntry| {
                (if entry.is_gap() { ObjectAddress::new(0, 0) } else { entry.object() }, entry.bits)
            };
            PdoConfig { index: pdo.index.index, entries: Some(pdo.entries.iter().map(entry).collect()) }
        };
        let chosen = chosen.iter().map(entries).collect();
        pdos.push(SyncManagerPdos { sync_manager, direction, pdos: chosen, origin: None });
    }
    SubDeviceConfig { sdos, pdos, ..SubDeviceConfig::default() }
}

/// The bytes of an SDO as they pass in a frame: index, subindex, then the data, behind their length where they are long.
fn on_the_wire(command: &Command) -> Vec<u8> {
    let command = &command.command;
    let mut bytes = command.index.index.to_le_bytes().to_vec();
    bytes.push(command.subindex);
    if command.data.len() > 4 {
        bytes.extend_from_slice(&(command.data.len() as u32).to_le_bytes());
    }
    bytes.extend_from_slice(&command.data);
    bytes
}

/// Brings a device to OP; the commands that were seen on the wire.
fn reach_op(assembly: &Assembly, vendor_id: u32) -> Result<usize, String> {
    let sub_device = esi::from_assembly(assembly, vendor_id, &Piece::default()).sub_device;
    let (link, clock) = in_process(Segment::line(vec![sub_device]).unwrap());
    let sent = Arc::new(Mutex::new(Vec::new()));
    let kept = Kept { link, sent: Arc::clone(&sent) };
    let operational = to_op(kept, clock, |found| vec![config(assembly, &found[0])])?;
    let one = &operational.subdevices[0];
    for (direction, outputs) in [(Direction::Outputs, true), (Direction::Inputs, false)] {
        let wanted: u32 = assembly.default_pdos(outputs).0.iter().map(Pdo::bits).sum();
        let found = one.bit_length(direction);
        if wanted != found {
            return Err(format!("{direction:?}: {wanted} bits wanted, {found} are mapped"));
        }
    }
    let (sent, mut frames, mut seen) = (sent.lock().unwrap(), 0, 0);
    for command in assembly.commands().iter().filter(|one| one.is_for_pre_op()) {
        let bytes = on_the_wire(command);
        // One behind the other, as the file has them.
        let here =
            sent[frames..].iter().position(|frame| frame.windows(bytes.len()).any(|part| part == bytes));
        frames += here.ok_or(format!("{bytes:02x?} never passed"))?;
        seen += 1;
    }
    Ok(seen)
}

fn made_up() -> EsiFile {
    EsiFile::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments/maker.xml"))).unwrap()
}

#[test]
fn a_made_up_makers_devices_reach_op() {
    let file = made_up();
    let vendor = file.vendor.id.unwrap();
    let alone = |number: usize| Assembly::new(&file.devices[number], Vec::new()).unwrap();
    assert_eq!(reach_op(&alone(0), vendor), Ok(2));
    assert_eq!(reach_op(&alone(1), vendor), Ok(0));
    let modules = vec![&file.modules[0], &file.modules[1], &file.modules[0]];
    let with_modules = Assembly::new(&file.devices[2], modules).unwrap();
    assert_eq!(reach_op(&with_modules, vendor), Ok(7));
}

#[test]
fn other_modules_than_stand_in_the_slots_are_refused() {
    let file = made_up();
    let there = Assembly::new(&file.devices[2], vec![&file.modules[0]]).unwrap();
    let wanted = Assembly::new(&file.devices[2], vec![&file.modules[1]]).unwrap();
    let sub_device = esi::from_assembly(&there, 0x0F0F, &Piece::default()).sub_device;
    let (link, clock) = in_process(Segment::line(vec![sub_device]).unwrap());
    let Err(refusal) = to_op(link, clock, |found| vec![config(&wanted, &found[0])]) else {
        panic!("the wrong module was taken");
    };
    assert!(refusal.contains("f030:01 aborted: 0x06090030"), "{refusal}");
    assert!(refusal.contains("; the slot holds module 0x00000101"), "{refusal}");
}

#[test]
fn all_devices_and_modules_of_real_makers_reach_op() {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/esi"));
    let read = |name: &str| EsiFile::read(&folder.join(name));
    let (Ok(couplers), Ok(modular), Ok(modules), Ok(scanned)) = (
        read("Beckhoff_EK11xx.xml"),
        read("Weidmueller_UR20_FBC.xml"),
        read("Weidmueller_UR20_IO.xml"),
        read("Weidmueller_UR20_FBC_from_IgH.xml"),
    ) else {
        eprintln!("SKIPPED: real makers' ESI files: {} lacks them", folder.display());
        return;
    };
    let (mut devices, mut with_modules, mut commands, mut failed) = (0, 0, 0, Vec::new());
    for file in [&couplers, &modular, &scanned] {
        for device in &file.devices {
            let assembly = Assembly::new(device, Vec::new()).unwrap();
            devices += 1;
            match reach_op(&assembly, file.vendor.id.unwrap()) {
                Ok(seen) => commands += seen,
                Err(error) => failed.push(format!("{}: {error}", device.type_name)),
            }
        }
    }
    let coupler = modular.devices.last().unwrap();
    for module in &modules.modules {
        let assembly = Assembly::new(coupler, vec![module]).unwrap();
        with_modules += 1;
        match reach_op(&assembly, modular.vendor.id.unwrap()) {
            Ok(seen) => commands += seen,
            Err(error) => failed.push(format!("{}: {error}", module.type_name)),
        }
    }
    println!("{devices} devices and {with_modules} modules in OP, {commands} commands seen on the wire");
    assert_eq!(failed, Vec::<String>::new());
    // Of each coupler 1, of each module 2, and 3 for the list with its one module.
    assert_eq!((devices, with_modules, commands), (27, 82, 2 + 82 * (1 + 2 + 3)));
}
