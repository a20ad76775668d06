//! What `scan` found, as JSON and as text.

use crate::dictionary::Object;
use crate::sii_json::sync_manager_usage;
use omnibase_ethercat::image::CycleFit;
use omnibase_ethercat::subdevice::{Activation, Direction, Port, PortKind, SubDevice, SyncManager};
use omnibase_ethercat::wire::{register, sii};
use serde::Serialize;
use std::io::{self, Write};

/// The whole segment.
#[derive(Serialize)]
pub struct Report {
    /// By position.
    pub subdevices: Vec<SubDeviceReport>,
    /// Which cycle fits; null where the process data fit into none.
    pub cycle: Option<CycleReport>,
    /// What is wrong with cables, power and order, and what to do.
    pub trouble: Vec<String>,
    /// What isn't supported and lacks nowhere.
    pub notes: Vec<String>,
    /// What the set-up met and went on without: the text form has it on stderr.
    pub warnings: Vec<String>,
    /// Of them, who is broken and left out.
    #[serde(skip)]
    pub left_out: Vec<String>,
}

/// What the frames of a cycle need, us.
#[derive(Serialize)]
pub struct CycleReport {
    shortest_us: u64,
    wire_us: u64,
    propagation_us: u64,
    /// By the distributed clocks; else estimated by the number of SubDevices.
    propagation_is_measured: bool,
    #[serde(skip)]
    pub words: String,
}

impl From<CycleFit> for CycleReport {
    fn from(fit: CycleFit) -> Self {
        CycleReport {
            shortest_us: fit.shortest().as_micros() as u64,
            wire_us: fit.wire.as_micros() as u64,
            propagation_us: fit.propagation.as_micros() as u64,
            propagation_is_measured: fit.is_measured,
            words: fit.to_string(),
        }
    }
}

/// One SubDevice.
#[derive(Serialize)]
pub struct SubDeviceReport {
    /// Place in the order of frames, from 0.
    pub position: u16,
    name: String,
    vendor_id: u32,
    product_code: u32,
    revision: u32,
    serial: u32,
    /// 0 where it has none.
    alias: u16,
    /// What its switch shows, where it has one.
    identification: Option<u16>,
    station_address: u16,
    /// In words.
    pub state: String,
    parent: Option<ParentReport>,
    entry_port: u8,
    ports: Vec<PortReport>,
    features: Vec<&'static str>,
    lrw_allowed: bool,
    mailbox: Option<MailboxReport>,
    sync_managers: Vec<SyncManagerReport>,
    fmmus: Vec<FmmuReport>,
    pdos: Vec<PdoReport>,
    /// Idents by slot of a modular device (0xF030, 0xF050).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub modules: Option<ModulesReport>,
    /// Only where it was asked for and there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dictionary: Option<Vec<Object>>,
    /// Why it can't be used, where something of it is broken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broken: Option<String>,
}

/// The modules of a modular device, by slot.
#[derive(Serialize)]
pub struct ModulesReport {
    /// For which it is configured.
    pub configured: Vec<u32>,
    /// That it detected.
    pub detected: Vec<u32>,
}

#[derive(Serialize)]
struct ParentReport {
    position: u16,
    port: u8,
}

#[derive(Serialize)]
struct PortReport {
    port: u8,
    kind: &'static str,
    link: bool,
    communicates: bool,
}

#[derive(Serialize)]
struct MailboxReport {
    write_start: u16,
    write_length: u16,
    read_start: u16,
    read_length: u16,
    protocols: Vec<&'static str>,
    coe: Vec<&'static str>,
}

#[derive(Serialize)]
struct SyncManagerReport {
    index: u8,
    usage: String,
    start: u16,
    length: u16,
    control: u8,
    enabled: bool,
    /// `safe_op`, `op`, or `never` (virtual).
    activation: &'static str,
}

#[derive(Serialize)]
struct FmmuReport {
    index: usize,
    direction: &'static str,
    logical_address: u32,
    logical_start_bit: u8,
    bit_length: u32,
    physical_start: u16,
    physical_start_bit: u8,
}

#[derive(Serialize)]
struct PdoReport {
    index: u16,
    name: Option<String>,
    direction: &'static str,
    sync_manager: u8,
    bit_length: u32,
    entries: Vec<EntryReport>,
}

#[derive(Serialize)]
struct EntryReport {
    index: u16,
    subindex: u8,
    name: Option<String>,
    bit_length: u8,
    data_type: Option<u8>,
}

impl SubDeviceReport {
    /// What is known of a SubDevice; state and dictionary come later.
    pub fn new(one: &SubDevice) -> Self {
        SubDeviceReport {
            position: one.position,
            name: one.name.clone(),
            vendor_id: one.identity.vendor_id,
            product_code: one.identity.product_code,
            revision: one.identity.revision,
            serial: one.identity.serial,
            alias: one.alias.unwrap_or(0),
            identification: one.identification,
            station_address: one.station_address,
            state: String::new(),
            parent: one.parent.map(|parent| ParentReport { position: parent.position, port: parent.port }),
            entry_port: one.entry_port,
            ports: (0..).zip(&one.ports).map(|(number, port)| port_report(number, port)).collect(),
            features: features(one),
            lrw_allowed: one.lrw_allowed,
            mailbox: one.mailbox.map(|mailbox| MailboxReport {
                write_start: mailbox.write.start,
                write_length: mailbox.write.length,
                read_start: mailbox.read.start,
                read_length: mailbox.read.length,
                protocols: crate::sii_json::protocols(mailbox.protocols),
                coe: if mailbox.protocols & sii::PROTOCOL_COE != 0 {
                    crate::sii_json::coe_details(one.coe_details)
                } else {
                    Vec::new()
                },
            }),
            sync_managers: one
                .sync_managers
                .iter()
                .map(|manager| SyncManagerReport {
                    index: manager.index,
                    usage: sync_manager_usage(manager.usage),
                    start: manager.area.start,
                    length: manager.area.length,
                    control: manager.control,
                    enabled: manager.enabled,
                    activation: match manager.activation {
                        Activation::SafeOp => "safe_op",
                        Activation::OpOnly => "op",
                        Activation::Never => "never",
                    },
                })
                .collect(),
            fmmus: one
                .fmmus
                .iter()
                .enumerate()
                .map(|(index, fmmu)| FmmuReport {
                    index,
                    direction: direction_name(fmmu.direction),
                    logical_address: fmmu.logical.address,
                    logical_start_bit: fmmu.logical.start_bit,
                    bit_length: fmmu.logical.bit_length,
                    physical_start: fmmu.physical_start,
                    physical_start_bit: fmmu.physical_start_bit,
                })
                .collect(),
            pdos: one.sync_managers.iter().flat_map(pdo_reports).collect(),
            modules: None,
            dictionary: None,
            broken: one.broken.clone(),
        }
    }

    fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        let name = if self.name.is_empty() { "(no name)" } else { &self.name };
        writeln!(output, "{} {name}", self.position)?;
        writeln!(
            output,
            "    identity  vendor 0x{:08x}, product 0x{:08x}, revision 0x{:08x}, serial {}",
            self.vendor_id, self.product_code, self.revision, self.serial
        )?;
        let alias = if self.alias == 0 { "none".to_owned() } else { format!("0x{:04x}", self.alias) };
        if let Some(cause) = &self.broken {
            writeln!(output, "    broken    {cause}")?;
        }
        writeln!(
            output,
            "    state     {}, station 0x{:04x}, alias {alias}{}",
            self.state,
            self.station_address,
            self.identification.map_or_else(String::new, |number| format!(", identification {number}"))
        )?;
        let ports: Vec<String> = self
            .ports
            .iter()
            .filter(|port| port.kind != "none")
            .map(|port| {
                let state = match (port.link, port.communicates) {
                    (_, true) => "open",
                    (true, false) => "link, closed",
                    (false, false) => "no link",
                };
                format!("{} {} {state}", port.port, port.kind)
            })
            .collect();
        writeln!(output, "    ports     {}", ports.join("; "))?;
        if let Some(parent) = &self.parent {
            writeln!(output, "    hangs at  port {} of SubDevice {}", parent.port, parent.position)?;
        }
        writeln!(output, "    can       {}", listed(&self.features))?;
        if let Some(mailbox) = &self.mailbox {
            writeln!(
                output,
                "    mailbox   out 0x{:04x} {} bytes, in 0x{:04x} {} bytes: {}; CoE: {}",
                mailbox.write_start,
                mailbox.write_length,
                mailbox.read_start,
                mailbox.read_length,
                listed(&mailbox.protocols),
                listed(&mailbox.coe)
            )?;
        }
        self.print_memory(output)?;
        self.print_pdos(output)?;
        if let Some(modules) = &self.modules {
            let idents: Vec<String> = modules.detected.iter().map(|ident| format!("0x{ident:08x}")).collect();
            writeln!(output, "    modules   {}", idents.join(", "))?;
        }
        for object in self.dictionary.iter().flatten() {
            object.print(output)?;
        }
        Ok(())
    }

    /// SyncManagers and FMMUs.
    fn print_memory(&self, output: &mut dyn Write) -> io::Result<()> {
        for manager in &self.sync_managers {
            writeln!(
                output,
                "    SM{}       {}, 0x{:04x} {} bytes, control 0x{:02x}, {}",
                manager.index,
                manager.usage,
                manager.start,
                manager.length,
                manager.control,
                match (manager.enabled, manager.activation) {
                    (true, _) => "on",
                    (false, "op") => "on in OP",
                    (false, "never") => "virtual",
                    (false, _) => "off",
                }
            )?;
        }
        for fmmu in &self.fmmus {
            writeln!(
                output,
                "    FMMU{}     {}, logical 0x{:08x}.{} {} bits -> 0x{:04x}.{}",
                fmmu.index,
                fmmu.direction,
                fmmu.logical_address,
                fmmu.logical_start_bit,
                fmmu.bit_length,
                fmmu.physical_start,
                fmmu.physical_start_bit
            )?;
        }
        Ok(())
    }

    fn print_pdos(&self, output: &mut dyn Write) -> io::Result<()> {
        for pdo in &self.pdos {
            writeln!(
                output,
                "    PDO {:04x}  {}, SM{}, {} bits{}",
                pdo.index,
                pdo.direction,
                pdo.sync_manager,
                pdo.bit_length,
                pdo.name.as_ref().map_or(String::new(), |name| format!(", {name}"))
            )?;
            for entry in &pdo.entries {
                let name = entry.name.as_deref().unwrap_or(if entry.index == 0 { "gap" } else { "" });
                writeln!(
                    output,
                    "        {:04x}:{:02x} {:>3} bits  {name}",
                    entry.index, entry.subindex, entry.bit_length
                )?;
            }
        }
        Ok(())
    }
}

impl Report {
    /// Everything as text.
    pub fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        for (number, one) in self.subdevices.iter().enumerate() {
            if number > 0 {
                writeln!(output)?;
            }
            one.print(output)?;
        }
        if let Some(cycle) = &self.cycle {
            writeln!(output, "\nshortest cycle {}", cycle.words)?;
        }
        self.trouble.iter().try_for_each(|trouble| writeln!(output, "TROUBLE {trouble}"))?;
        self.notes.iter().try_for_each(|note| writeln!(output, "NOTE {note}"))
    }
}

fn listed(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn features(one: &SubDevice) -> Vec<&'static str> {
    let all = [
        (register::FEATURE_DC, "distributed clock"),
        (register::FEATURE_DC_64, "64 bit time"),
        (register::FEATURE_FMMU_BYTEWISE, "FMMUs byte-wise only"),
        (register::FEATURE_NO_LRW, "no LRW"),
        (register::FEATURE_NO_READ_WRITE, "no BRW/APRW/FPRW"),
        (register::FEATURE_FIXED_MAPPING, "fixed mapping"),
    ];
    all.iter().filter(|(bit, _)| one.esc.has(*bit)).map(|(_, name)| *name).collect()
}

fn port_report(port: u8, found: &Port) -> PortReport {
    let kind = match found.kind {
        PortKind::None => "none",
        PortKind::Unconfigured => "not configured",
        PortKind::Ebus => "EBUS",
        PortKind::Mii => "MII",
    };
    PortReport { port, kind, link: found.link, communicates: found.communicates }
}

fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Outputs => "outputs",
        Direction::Inputs => "inputs",
    }
}

fn pdo_reports(manager: &SyncManager) -> impl Iterator<Item = PdoReport> + '_ {
    let direction = manager.direction().map_or("none", direction_name);
    manager.pdos.iter().map(move |pdo| PdoReport {
        index: pdo.index,
        name: pdo.name.clone(),
        direction,
        sync_manager: manager.index,
        bit_length: pdo.bit_length(),
        entries: pdo
            .entries
            .iter()
            .map(|entry| EntryReport {
                index: entry.object.index,
                subindex: entry.object.subindex,
                name: entry.name.clone(),
                bit_length: entry.bit_length,
                data_type: entry.data_type,
            })
            .collect(),
    })
}
