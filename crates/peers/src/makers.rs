//! Segments made of real makers' ESI files, and the commands that these want sent.

use omnibase_esi::{Assembly, EsiFile};
use omnibase_ethercat_sim::device::{Piece, esi};
use omnibase_ethercat_sim::{Segment, SubDevice};
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

/// Every device of the files in a line, and couplers with every module; `None` (said aloud) where the files aren't there.
pub fn segments() -> Option<[MadeOfFiles; 2]> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/esi"));
    let read = |name: &str| EsiFile::read(&Path::join(&folder, name)).ok();
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
    let mut devices = Vec::new();
    for file in [&couplers, &modular, &scanned] {
        devices.extend(file.devices.iter().map(|device| (file, Assembly { device, modules: Vec::new() })));
    }
    let coupler = modular.devices.last()?;
    let full = modules.modules.chunks(MODULES).map(|modules| {
        let assembly =
            Assembly::new(coupler, modules.iter().collect()).expect("the coupler has slots for them");
        (&modular, assembly)
    });
    Some([line(&devices), line(&full.collect::<Vec<_>>())])
}

fn line(assemblies: &[(&EsiFile, Assembly)]) -> MadeOfFiles {
    let mut sub_devices: Vec<SubDevice> = Vec::new();
    let (mut commands, mut modules) = (Vec::new(), 0);
    for (position, (file, assembly)) in (0..).zip(assemblies) {
        let vendor_id = file.vendor.id.unwrap_or(0);
        sub_devices.push(esi::from_assembly(assembly, vendor_id, &Piece::default()).sub_device);
        modules += assembly.modules.len();
        for one in assembly.commands().into_iter().filter(|one| one.is_for_pre_op()) {
            let (index, subindex, data) = (one.command.index.index, one.command.subindex, one.command.data);
            commands.push(MakersCommand { position, index, subindex, data });
        }
    }
    let count = sub_devices.len();
    let segment = Segment::line(sub_devices).expect("they are plugged into one another");
    MadeOfFiles { segment, count, modules, commands }
}
