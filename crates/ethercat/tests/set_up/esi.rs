//! SubDevices made of makers' files: brought to OP with the commands that these want sent, seen on the wire.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use omnibase_esi::model::{Module, Pdo};
use omnibase_esi::{Assembly, Command, EsiFile};
use omnibase_ethercat::config::{PdoConfig, SyncManagerPdos};
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::wire::bytes::{u16_at, u32_at};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions, Exchange, SubDevice, SubDeviceConfig};
use omnibase_ethercat_sim::device::{Piece, esi};
use omnibase_ethercat_sim::{Segment, SegmentFile, SimLink, in_process};

use crate::operational::{CYCLE, Operational, to_op, unconfigured};

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
    let safe_op_sdos = commands.iter().filter(|one| one.is_for_safe_op()).map(sdo).collect();
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
    SubDeviceConfig { sdos, safe_op_sdos, pdos, ..SubDeviceConfig::default() }
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
    let sub_device = esi::from_assembly(assembly, vendor_id, &Piece::default())?.sub_device;
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
    let commands = assembly.commands();
    let in_safe_op = commands.iter().filter(|one| one.is_for_safe_op());
    for command in commands.iter().filter(|one| one.is_for_pre_op()).chain(in_safe_op) {
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
    assert_eq!(reach_op(&alone(0), vendor), Ok(3));
    assert_eq!(reach_op(&alone(1), vendor), Ok(0));
    let modules = vec![&file.modules[0], &file.modules[1], &file.modules[0]];
    let with_modules = Assembly::new(&file.devices[2], modules).unwrap();
    assert_eq!(reach_op(&with_modules, vendor), Ok(7));
}

/// A segment of one device of the made-up maker, with more keys.
fn segment_of(device: &str, keys: &str) -> Result<Segment, String> {
    let text = format!("[[subdevice]]\nkind = \"esi\"\nesi = \"maker.xml\"\ndevice = \"{device}\"\n{keys}\n");
    let segments = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments"));
    let built = SegmentFile::parse(&text).and_then(|file| file.build(segments));
    built.map_err(|error| error.to_string())
}

#[test]
fn a_drive_of_a_makers_file_turns_its_motor() {
    const COUNTS: i32 = 1 << 16;
    let segment =
        segment_of("MU-SERVO", "servo = { counts_per_revolution = 65_536, inertia_kg_m2 = 0.01 }").unwrap();
    let (link, clock) = in_process(segment);
    let mut operational = to_op(link, clock, unconfigured).unwrap();
    let mut cycle = |control: u16, speed: i32| {
        let Operational { paced, image, .. } = &mut operational;
        // 0x1600 and 0x1A00 of the file.
        let data = &mut image.outputs;
        data[..2].copy_from_slice(&control.to_le_bytes());
        data[2] = 9;
        data[4..8].copy_from_slice(&speed.to_le_bytes());
        data[10..12].copy_from_slice(&1000_u16.to_le_bytes());
        assert_eq!(paced.exchange(image).unwrap().0, Exchange::Complete);
        let data = &image.inputs;
        (u16_at(data, 0), data[2], u32_at(data, 4) as i32, u32_at(data, 8) as i32)
    };
    for control in [6, 7, 15] {
        for _ in 0..20 {
            cycle(control, 0);
        }
    }
    let (status, mode, before, _) = cycle(15, 0);
    assert_eq!((status & 0x6F, mode), (0x27, 9), "enabled, speed");
    for _ in 0..1000 {
        cycle(15, COUNTS);
    }
    let (.., position, speed) = cycle(15, COUNTS);
    let wanted = (CYCLE * 1000).as_secs_f64() * f64::from(COUNTS);
    assert!(
        (f64::from(position - before) / wanted - 1.0).abs() < 0.05,
        "{before} to {position}, {wanted} wanted"
    );
    assert!((speed - COUNTS).abs() < COUNTS / 100, "{speed}");
}

#[test]
fn only_a_drive_has_a_motor() {
    let told = segment_of("MU-IO", "servo = { inertia_kg_m2 = 0.01 }").unwrap_err();
    assert!(told.contains("MU-IO has a table \"servo\" and is no drive"), "{told}");
    let told = segment_of("MU-SERVO", "servo = { tx_pdo = [] }").unwrap_err();
    assert!(told.contains("tx_pdo"), "{told}");
}

/// A drive whose file lets PDOs be chosen and changed takes what the file allows, and refuses what it doesn't.
#[test]
fn what_the_file_says_of_pdos_is_what_the_simulated_one_takes() {
    let file = made_up();
    let drive = Assembly::new(&file.devices[0], Vec::new()).unwrap();
    let op_with = |change: &dyn Fn(&mut SubDeviceConfig)| {
        let sub_device = esi::from_assembly(&drive, 0x0F0F, &Piece::default()).unwrap().sub_device;
        let (link, clock) = in_process(Segment::line(vec![sub_device]).unwrap());
        let asked = |found: &[SubDevice]| {
            let mut asked = config(&drive, &found[0]);
            change(&mut asked);
            vec![asked]
        };
        to_op(link, clock, asked).map(|operational| operational.subdevices[0].bit_length(Direction::Outputs))
    };
    // Without the max torque, its last entry.
    let shorter = op_with(&|asked| {
        asked.pdos[0].pdos[0].entries.as_mut().unwrap().pop();
    });
    assert_eq!(shorter, Ok(80));
    let position = [(0x6040, 16), (0x607A, 32)].map(|(index, bits)| (ObjectAddress::new(index, 0), bits));
    let other = PdoConfig { index: 0x1601, entries: Some(position.to_vec()) };
    let alone = op_with(&|asked| asked.pdos[0].pdos = vec![other.clone()]);
    assert_eq!(alone, Ok(48));
    let both = op_with(&|asked| asked.pdos[0].pdos.push(other.clone())).unwrap_err();
    assert!(both.contains("0x0025"), "{both}");
    let none = op_with(&|asked| asked.pdos[1].pdos.clear()).unwrap_err();
    assert!(none.contains("0x0024"), "{none}");
}

/// What a coupler with these modules in its slots says to a list with those.
fn refusal_of(there: &[usize], wanted: &[usize]) -> String {
    let file = made_up();
    let with = |modules: &[usize]| {
        let modules = modules.iter().map(|number| &file.modules[*number]).collect();
        Assembly::new(&file.devices[2], modules).unwrap()
    };
    let sub_device = esi::from_assembly(&with(there), 0x0F0F, &Piece::default()).unwrap().sub_device;
    let (link, clock) = in_process(Segment::line(vec![sub_device]).unwrap());
    let reached = to_op(link, clock, |found| vec![config(&with(wanted), &found[0])]);
    reached.err().expect("other modules were taken")
}

#[test]
fn other_modules_than_stand_in_the_slots_are_refused() {
    let refusal = refusal_of(&[0], &[1]);
    assert!(refusal.contains("f030:01 aborted: 0x06090030"), "{refusal}");
    let told = "; slot 1 holds module 0x00000101, 0x00000201 is expected there: plug that in";
    assert!(refusal.contains(told), "{refusal}");
}

/// Its list is as long as there are modules: what is missing behind them isn't told as a subindex alone.
#[test]
fn an_empty_slot_is_told_as_that() {
    for there in [&[][..], &[0]] {
        let refusal = refusal_of(there, &[0, 1][..=there.len()]);
        let (slot, ident) = (there.len() + 1, [0x101, 0x201][there.len()]);
        let told = format!("; slot {slot} is empty, module 0x{ident:08x} is expected there: plug it in");
        assert!(refusal.contains(&told), "{refusal}");
    }
    // The number of modules is refused where one more is plugged in.
    let refusal = refusal_of(&[0, 1], &[0]);
    assert!(refusal.contains("; slot 2 holds module 0x00000201, none is expected there"), "{refusal}");
}

/// The lists have as many subindices as the file may have modules.
#[test]
fn the_module_of_the_last_slot_is_seen() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../segments/maker.xml");
    let text = std::fs::read_to_string(path).unwrap().replace("MaxInstances=\"8\"", "MaxInstances=\"255\"");
    let file = EsiFile::parse(text.as_bytes()).unwrap();
    let mut modules = vec![Module::none(); 254];
    modules.push(&file.modules[1]);
    let assembly = Assembly::new(&file.devices[2], modules).unwrap();
    let sub_device = esi::from_assembly(&assembly, 0x0F0F, &Piece::default()).unwrap().sub_device;
    let (link, clock) = in_process(Segment::line(vec![sub_device]).unwrap());
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let detected = bus.read_modules(0).unwrap().unwrap().detected;
    assert_eq!((detected.len(), detected.last()), (255, Some(&0x201)));
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
