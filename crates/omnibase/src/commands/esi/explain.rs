//! Files and devices in words.

use super::clocks::synchronisation;
use super::table::coe_words;
use omnibase_esi::model::{Mailbox, Pdo, Slots, SmUse, SyncManager, number};
use omnibase_esi::{Assembly, Device, EsiFile, Module, Notes, Why};
use std::io::{self, Write};
use std::path::Path;

/// Paths of what isn't read that are shown of each sort.
const SHOWN: usize = 40;
/// What nobody here knows.
const UNKNOWN: (Why, &str) = (Why::Unknown, "NOT UNDERSTOOD, so nothing follows from it");

/// A file: its devices, modules where asked, what isn't read.
pub fn file(path: &Path, file: &EsiFile, with_modules: bool, output: &mut dyn Write) -> io::Result<()> {
    writeln!(output, "{}: {} (vendor {})", path.display(), file.vendor.name, number(file.vendor.id))?;
    for reference in &file.references {
        writeln!(output, "    refers to {reference}: give that file, too, where modules of it are meant")?;
    }
    if !file.devices.is_empty() {
        writeln!(output, "    {} devices", file.devices.len())?;
    }
    for device in &file.devices {
        let mut words = Vec::new();
        if device.profiles.contains(&402) {
            words.push("drive (CiA 402)".to_owned());
        }
        let [outputs, inputs] = [true, false].map(|outputs| {
            let assembly = Assembly { device, modules: Vec::new() };
            bits(&assembly.default_pdos(outputs).0)
        });
        words.push(format!("{outputs} bits out, {inputs} in"));
        if device.mailbox.as_ref().is_some_and(|mailbox| mailbox.coe.is_some()) {
            words.push("CoE".to_owned());
        }
        let activate = device.dc_modes.iter().find(|mode| mode.assign_activate != 0);
        words.extend(activate.map(|mode| format!("DC 0x{:04X}", mode.assign_activate)));
        if let Some(slots) = &device.slots {
            let places: Option<u32> = slots.slots.iter().map(|slot| slot.most).sum();
            words.push(format!("slots for {} modules", or_unread(places)));
        }
        writeln!(
            output,
            "    {:<20} {}  {}  [{}]",
            device.type_name,
            device.numbers(),
            device.names,
            words.join("; ")
        )?;
    }
    let modules: Vec<&Module> = file
        .modules
        .iter()
        .chain(file.devices.iter().filter_map(|one| one.slots.as_ref()).flat_map(|one| &one.modules))
        .collect();
    if !modules.is_empty() {
        writeln!(
            output,
            "    {} modules{}",
            modules.len(),
            if with_modules { "" } else { ": --modules lists them" }
        )?;
    }
    for module in modules.into_iter().filter(|_| with_modules) {
        writeln!(
            output,
            "    {:<20} ident {}  class {:<8} {}  [{} bits out, {} in]",
            module.type_name,
            number(module.ident),
            module.class,
            module.names,
            bits(&module.rx_pdos),
            bits(&module.tx_pdos)
        )?;
    }
    notes(&file.notes, &[UNKNOWN, (Why::Unused, "known and not needed here")], output)
}

/// A number; a question mark where it can't be read.
fn or_unread(number: Option<impl ToString>) -> String {
    number.map_or("?".to_owned(), |number| number.to_string())
}

/// Bits of PDOs; a question mark where some can't be read.
fn bits(pdos: &[Pdo]) -> String {
    if pdos.iter().any(Pdo::is_unclear) {
        return "?".to_owned();
    }
    pdos.iter().map(Pdo::bits).sum::<u32>().to_string()
}

/// What is wrong in a file or isn't understood, beneath the file's name; nothing where all is well.
pub fn told(path: &Path, of_file: &Notes, output: &mut dyn Write) -> io::Result<()> {
    if !of_file.problems.is_empty() || of_file.unread().any(|one| one.why == Why::Unknown) {
        writeln!(output, "{}:", path.display())?;
        notes(of_file, &[UNKNOWN], output)?;
    }
    Ok(())
}

/// What isn't read of a file for these reasons, and what is wrong in it.
fn notes(notes: &Notes, reasons: &[(Why, &str)], output: &mut dyn Write) -> io::Result<()> {
    for (why, words) in reasons.iter().copied() {
        let all: Vec<_> = notes.unread().filter(|one| one.why == why).collect();
        if all.is_empty() {
            continue;
        }
        writeln!(output, "    {words}: {} kinds", all.len())?;
        for one in all.iter().take(SHOWN) {
            let times = if one.count == 1 { String::new() } else { format!(" and {} more", one.count - 1) };
            writeln!(output, "        line {}{times}: {}", one.line, one.path)?;
        }
        if all.len() > SHOWN {
            writeln!(output, "        {} kinds more: --json has all", all.len() - SHOWN)?;
        }
    }
    if notes.beyond > 0 {
        writeln!(output, "    and {} more of which there was no room to keep a note", notes.beyond)?;
    }
    for problem in &notes.problems {
        writeln!(output, "PROBLEM {problem}")?;
    }
    Ok(())
}

/// One device with its modules.
pub fn device(file: &EsiFile, assembly: &Assembly, output: &mut dyn Write) -> io::Result<()> {
    let device = assembly.device;
    writeln!(output, "{}: {}, {}", device.type_name, device.names, file.vendor.name)?;
    identity(file, device, output)?;
    for (number, manager) in device.sync_managers.iter().enumerate() {
        sync_manager(number, manager, output)?;
    }
    if let Some(mailbox) = &device.mailbox {
        writeln!(output, "mailbox        {}", mailbox_words(mailbox))?;
    }
    abilities(device, output)?;
    if let Some(of_device) = &device.slots {
        slots(of_device, output)?;
    }
    for (slot, module) in (1..).zip(&assembly.modules) {
        if module.is_none() {
            writeln!(output, "slot {slot:<9} empty")?;
        } else {
            let ident = number(module.ident);
            writeln!(output, "slot {slot:<9} {} (ident {ident}), {}", module.type_name, module.names)?;
        }
    }
    pdos(assembly, output)?;
    for command in assembly.commands() {
        let one = &command.command;
        let data: Vec<String> = one.data.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(
            output,
            "at {:<11} {:04x}:{:02x} = {}  {}",
            one.transitions.join(" "),
            one.index.index,
            one.subindex,
            data.join(" "),
            one.comment
        )?;
    }
    writeln!(output, "dictionary     {} objects", assembly.objects().len())?;
    for doubt in assembly.doubts() {
        writeln!(output, "LOOK AT THIS   {doubt}")?;
    }
    Ok(())
}

/// Who it is, and whom it replaces.
fn identity(file: &EsiFile, device: &Device, output: &mut dyn Write) -> io::Result<()> {
    writeln!(
        output,
        "identity       vendor {}, product {}, revision {}",
        number(file.vendor.id),
        number(device.product_code),
        number(device.revision)
    )?;
    for (product, revision) in &device.hides {
        let product = product.map_or(String::new(), |product| format!("product 0x{product:08x}, "));
        writeln!(output, "replaces       {product}revision 0x{revision:08x}")?;
    }
    let profiles: Vec<String> = device.profiles.iter().map(u32::to_string).collect();
    writeln!(
        output,
        "profiles       {}",
        if profiles.is_empty() { "none".to_owned() } else { profiles.join(", ") }
    )?;
    writeln!(output, "ports          {}", if device.ports.is_empty() { "not given" } else { &device.ports })
}

fn sync_manager(number: usize, manager: &SyncManager, output: &mut dyn Write) -> io::Result<()> {
    let usage = match manager.usage {
        SmUse::MailboxOut => "mailbox from the MainDevice",
        SmUse::MailboxIn => "mailbox to the MainDevice",
        SmUse::Outputs => "outputs",
        SmUse::Inputs => "inputs",
        SmUse::Unused => "unused",
    };
    let flags = [
        (manager.enabled, ", on"),
        (manager.is_virtual, ", virtual: never switched on"),
        (manager.op_only, ", on in OP alone"),
    ];
    let flags: String = flags.iter().filter(|(there, _)| *there).map(|(_, word)| *word).collect();
    writeln!(
        output,
        "SM{number}            {usage}, {}, {} bytes, control {}{flags}",
        or_unread(manager.start.map(|start| format!("0x{start:04x}"))),
        or_unread(manager.default_size),
        or_unread(manager.control.map(|control| format!("0x{control:02x}")))
    )
}

fn mailbox_words(mailbox: &Mailbox) -> String {
    let coe = mailbox.coe.as_ref().map_or(String::new(), |coe| format!("CoE ({})", coe_words(coe)));
    let others = [
        (mailbox.foe, "FoE"),
        (mailbox.eoe, "EoE (not spoken here)"),
        (mailbox.soe, "SoE (not spoken here)"),
        (mailbox.aoe, "AoE (not spoken here)"),
        (mailbox.voe, "VoE (the maker's own)"),
    ];
    let mut words: Vec<&str> = vec![&coe];
    words.extend(others.iter().filter(|(there, _)| *there).map(|(_, word)| *word));
    words.retain(|word| !word.is_empty());
    words.join(", ")
}

/// How long it takes, how it is told from others, and what it can't do.
fn abilities(device: &Device, output: &mut dyn Write) -> io::Result<()> {
    let times = &device.timeouts;
    let times = [
        ("INIT", times.back_to_init_ms),
        ("PRE-OP", times.pre_op_ms),
        ("SAFE-OP and OP", times.safe_op_op_ms),
        ("back to SAFE-OP", times.back_to_safe_op_ms),
        ("mailbox takes a request", times.request_ms),
        ("and answers", times.response_ms),
    ];
    let times: Vec<String> =
        times.iter().filter_map(|(name, time)| time.map(|time| format!("{name} {time} ms"))).collect();
    if !times.is_empty() {
        writeln!(output, "takes at most  {}", times.join(", "))?;
    }
    if let Some(register) = device.identification_address {
        writeln!(output, "identification register 0x{register:04x}")?;
    }
    if device.identifies_by_al_status {
        writeln!(output, "identification on request (0x0134)")?;
    }
    if device.refuses_lrw {
        writeln!(output, "commands       LRD and LWR, no LRW")?;
    }
    for mode in &device.dc_modes {
        writeln!(output, "clocks         {}", synchronisation(mode))?;
    }
    Ok(())
}

fn slots(slots: &Slots, output: &mut dyn Write) -> io::Result<()> {
    for slot in &slots.slots {
        writeln!(
            output,
            "slots          {}: {} to {}, classes {}",
            slot.name,
            or_unread(slot.least),
            or_unread(slot.most),
            slot.classes.join(", ")
        )?;
    }
    writeln!(
        output,
        "               objects {} apart, PDOs {} apart{}",
        or_unread(slots.index_increment),
        or_unread(slots.pdo_increment),
        if slots.download_idents { ", the list of modules is told to 0xF030" } else { "" }
    )
}

fn pdos(assembly: &Assembly, output: &mut dyn Write) -> io::Result<()> {
    for (kind, outputs) in [("RxPDO", true), ("TxPDO", false)] {
        let (chosen, _) = assembly.default_pdos(outputs);
        for pdo in assembly.pdos(outputs) {
            let assigned = chosen.iter().find(|one| one.index == pdo.index).and_then(|one| one.sync_manager);
            let assigned =
                assigned.map_or("not assigned by default".to_owned(), |number| format!("SM{number}"));
            let flags =
                [(pdo.mandatory, ", mandatory"), (pdo.fixed, ", fixed"), (pdo.is_virtual, ", virtual")];
            let flags: String = flags.iter().filter(|(there, _)| *there).map(|(_, word)| *word).collect();
            let excludes: Vec<String> = pdo.excludes.iter().map(|one| format!("{:04x}", one.index)).collect();
            let excludes = if excludes.is_empty() {
                String::new()
            } else {
                format!(", not with {}", excludes.join(", "))
            };
            writeln!(
                output,
                "{kind} {:04x}     {}, {assigned}, {} bits{flags}{excludes}",
                pdo.index.index,
                pdo.name,
                bits(std::slice::from_ref(&pdo))
            )?;
            for entry in &pdo.entries {
                if entry.is_unclear {
                    writeln!(output, "    ?       can't be read: {}", entry.name)?;
                } else if entry.is_gap() {
                    writeln!(output, "    gap     {:>3} bits", entry.bits)?;
                } else {
                    writeln!(
                        output,
                        "    {:04x}:{:02x} {:>3} bits {:<8} {}",
                        entry.index.index, entry.subindex, entry.bits, entry.data_type, entry.name
                    )?;
                }
            }
        }
    }
    Ok(())
}
