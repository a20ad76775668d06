//! Segments made of real makers' ESI files, and the commands that these want sent.

use omnibase_esi::{Assembly, EsiFile};
use omnibase_ethercat_sim::device::{Piece, esi};
use omnibase_ethercat_sim::{Attachment, Parent, Segment, SubDevice};
use std::path::{Path, PathBuf};

/// Modules of one coupler.
const MODULES: usize = 28;

/// A command of a SubDevice's maker, sent in PRE-OP.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MakersCommand {
    /// Position of the SubDevice.
    pub position: u16,
    /// Object.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Bytes as they are sent.
    pub data: Vec<u8>,
}

/// A segment of devices as their makers' files say.
pub struct MadeOfFiles {
    /// The segment.
    pub segment: Segment,
    /// How many SubDevices it has.
    pub count: usize,
    /// Modules in their slots.
    pub modules: usize,
    /// What is to be sent.
    pub commands: Vec<MakersCommand>,
}

/// Every device of each maker in a line, and couplers with every module; `None` (said aloud) where the files aren't there.
pub fn segments() -> Option<[MadeOfFiles; 3]> {
    patched(|_| {})
}

/// The same with every SyncManager of process data enabled in the EEPROM. EtherCrab 0.7.1 switches on only those, and in one
/// maker's (as the EEPROM that IgH's tool read shows) SM2 and SM3 aren't.
pub fn segments_for_ethercrab() -> Option<[MadeOfFiles; 3]> {
    patched(|file| {
        let managers = file.devices.iter_mut().flat_map(|device| &mut device.sync_managers);
        managers.for_each(|manager| manager.enabled = true);
    })
}

fn patched(patch: impl Fn(&mut EsiFile)) -> Option<[MadeOfFiles; 3]> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/esi"));
    let read = |name: &str| {
        let mut file = EsiFile::read(&Path::join(&folder, name)).ok()?;
        patch(&mut file);
        Some(file)
    };
    let files = (
        read("Beckhoff_EK11xx.xml"),
        read("Weidmueller_UR20_FBC.xml"),
        read("Weidmueller_UR20_FBC_from_IgH.xml"),
        read("Weidmueller_UR20_IO.xml"),
    );
    let (Some(couplers), Some(modular), Some(scanned), Some(modules)) = files else {
        eprintln!("SKIPPED: real makers' ESI files: {} lacks them", folder.display());
        return None;
    };
    let alone = |files: &[&'_ EsiFile]| {
        let devices = files.iter().flat_map(|file| {
            file.devices.iter().map(move |device| (*file, Assembly { device, modules: Vec::new() }))
        });
        line(&devices.collect::<Vec<_>>())
    };
    let coupler = modular.devices.last()?;
    let full = modules.modules.chunks(MODULES).map(|modules| {
        let assembly =
            Assembly::new(coupler, modules.iter().collect()).expect("the coupler has slots for them");
        (&modular, assembly)
    });
    Some([alone(&[&couplers]), alone(&[&modular, &scanned]), line(&full.collect::<Vec<_>>())])
}

fn line(assemblies: &[(&EsiFile, Assembly)]) -> MadeOfFiles {
    let mut sub_devices: Vec<SubDevice> = Vec::new();
    let (mut commands, mut modules) = (Vec::new(), 0);
    for (position, (file, assembly)) in (0..).zip(assemblies) {
        let vendor_id = file.vendor.id.unwrap_or(0);
        let made = esi::from_assembly(assembly, vendor_id, &Piece::default()).expect("it can be simulated");
        sub_devices.push(made.sub_device);
        modules += assembly.modules.len();
        for one in assembly.commands().into_iter().filter(|one| one.is_for_pre_op()) {
            let (index, subindex, data) = (one.command.index.index, one.command.subindex, one.command.data);
            commands.push(MakersCommand { position, index, subindex, data });
        }
    }
    let count = sub_devices.len();
    let attachments = attachments(&sub_devices);
    let segment = Segment::new(sub_devices, attachments).expect("they are plugged into one another");
    MadeOfFiles { segment, count, modules, commands }
}

/// Each at the first free port of the nearest one before it that has one: not every coupler has port 1.
fn attachments(sub_devices: &[SubDevice]) -> Vec<Attachment> {
    let mut taken: Vec<[bool; 4]> = Vec::new();
    let mut attachments = Vec::new();
    for _ in sub_devices {
        let ports = |position: usize| (1..4u8).map(move |port| (position, port));
        let free = (0..taken.len()).rev().flat_map(ports).find(|&(position, port)| {
            sub_devices[position].esc().config().has_port(port) && !taken[position][usize::from(port)]
        });
        let parent = match free {
            Some((position, port)) => {
                taken[position][usize::from(port)] = true;
                Parent::SubDevice { position, port }
            }
            None => Parent::MainDevice,
        };
        attachments.push(Attachment { parent, entry_port: 0, cable_delay_ns: 100 });
        taken.push([false; 4]);
    }
    attachments
}
