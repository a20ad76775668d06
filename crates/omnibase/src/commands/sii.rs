//! `omnibase sii`: an SII image in words.

use crate::Outcome;
use crate::hex;
use crate::sii_json::{self, ImageJson};
use crate::small_file;
use anyhow::Context;
use omnibase_ethercat_wire::sii::{Image, MailboxArea, Pdo};
use std::io::{self, Write};
use std::path::PathBuf;

/// Shows an SII (EEPROM) image in words.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase sii drive.bin               identity, mailboxes, SyncManagers, PDOs, clocks in words
  omnibase sii drive.bin --json | jq .identity

Of a broken image everything is shown that can be read, then the problems with their byte offsets; exit code 1.")]
pub struct Arguments {
    /// The image, as read from the device's EEPROM.
    image: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Bytes of an unknown category shown in text.
const SHOWN: usize = 64;

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.image.display();
    let bytes = small_file::read(&arguments.image, small_file::EEPROM)?;
    let (image, problems) = Image::parse(&bytes).with_context(|| format!("reading `{path}`"))?;
    if arguments.json {
        serde_json::to_writer_pretty(&mut *output, &ImageJson::new(&image, &problems))?;
        writeln!(output)?;
    } else {
        header(output, &image)?;
        categories(output, &image)?;
        for problem in &problems {
            writeln!(output, "PROBLEM at {problem}")?;
        }
    }
    let sound = problems.is_empty() && image.header.checksum as u8 == sii_json::expected_checksum(&image);
    Ok(if sound { Outcome::Done } else { Outcome::Failed })
}

fn header(output: &mut dyn Write, image: &Image) -> io::Result<()> {
    let header = &image.header;
    let identity = header.identity;
    writeln!(output, "name             {}", image.name().unwrap_or_else(|| "not given".to_owned()))?;
    writeln!(output, "vendor           0x{:08x}", identity.vendor_id)?;
    writeln!(output, "product          0x{:08x}", identity.product_code)?;
    writeln!(output, "revision         0x{:08x}", identity.revision)?;
    writeln!(output, "serial           {}", identity.serial)?;
    writeln!(output, "alias            0x{:04x}", header.alias)?;
    writeln!(
        output,
        "PDI              control 0x{:04x}, configuration 0x{:04x} 0x{:04x}, SYNC pulse {} ns",
        header.pdi_control,
        header.pdi_configuration,
        header.pdi_configuration_2,
        u32::from(header.sync_pulse_length) * 10
    )?;
    let expected = sii_json::expected_checksum(image);
    let found = header.checksum as u8;
    let verdict =
        if found == expected { "right".to_owned() } else { format!("WRONG, expected 0x{expected:02x}") };
    writeln!(output, "checksum         0x{found:02x}, {verdict}")?;
    writeln!(output, "mailbox          {}", mailbox(&header.mailbox))?;
    writeln!(output, "mailbox in BOOT  {}", mailbox(&header.bootstrap_mailbox))?;
    writeln!(output, "protocols        {}", listed(&sii_json::protocols(header.mailbox_protocols)))?;
    writeln!(
        output,
        "EEPROM           {} bytes, layout version {}",
        (u32::from(header.size_kibit_less_one) + 1) * 128,
        header.version
    )
}

fn mailbox(area: &MailboxArea) -> String {
    if area.receive_size == 0 && area.send_size == 0 {
        return "none".to_owned();
    }
    format!(
        "from the MainDevice 0x{:04x} {} bytes, to the MainDevice 0x{:04x} {} bytes",
        area.receive_offset, area.receive_size, area.send_offset, area.send_size
    )
}

fn listed<T: AsRef<str>>(names: &[T]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

fn categories(output: &mut dyn Write, image: &Image) -> io::Result<()> {
    let string = |index: u8| match index {
        0 => "-".to_owned(),
        index => image.string(index).unwrap_or_else(|| format!("string {index} is missing")),
    };
    if let Some(general) = &image.general {
        writeln!(output, "group            {}", string(general.group))?;
        writeln!(output, "order            {}", string(general.order))?;
        writeln!(output, "image            {}", string(general.image))?;
        writeln!(output, "CoE              {}", listed(&sii_json::coe_details(general.coe_details)))?;
        let yes = |there: bool| if there { "yes" } else { "no" };
        writeln!(output, "FoE              {}", yes(general.foe_details & 1 != 0))?;
        writeln!(output, "EoE              {}", yes(general.eoe_details & 1 != 0))?;
        writeln!(output, "flags            {}", listed(&sii_json::general_flags(general.flags)))?;
        writeln!(output, "EBUS current     {} mA", general.ebus_current_ma)?;
        writeln!(output, "ports            {}", listed(&sii_json::ports(general.physical_ports)))?;
        if general.identification_address != 0 {
            writeln!(output, "identification   register 0x{:04x}", general.identification_address)?;
        }
    } else {
        writeln!(output, "general          no such category")?;
    }
    for (number, usage) in image.fmmus.iter().enumerate() {
        writeln!(output, "FMMU{number}            {}", sii_json::fmmu_usage(*usage))?;
    }
    for (number, manager) in image.sync_managers.iter().enumerate() {
        writeln!(
            output,
            "SM{number}              {}, 0x{:04x} {} bytes, control 0x{:02x}, enable 0x{:02x}",
            sii_json::sync_manager_usage(manager.usage),
            manager.start,
            manager.length,
            manager.control,
            manager.enable
        )?;
    }
    pdos(output, image, "TxPDO", &image.tx_pdos)?;
    pdos(output, image, "RxPDO", &image.rx_pdos)?;
    for (number, mode) in image.dc_modes.iter().enumerate() {
        writeln!(
            output,
            "DC mode {number}        \"{}\" {}: activate 0x{:04x}, SYNC0 cycle {} ns factor {} shift {} ns, SYNC1 factor {} shift {} ns",
            string(mode.name),
            string(mode.description),
            mode.assign_activate,
            mode.sync0_cycle_ns,
            mode.sync0_cycle_factor,
            mode.sync0_shift_ns as i32,
            mode.sync1_cycle_factor,
            mode.sync1_shift_ns as i32
        )?;
    }
    for (number, bytes) in image.strings.iter().enumerate() {
        writeln!(output, "string {:<9} {:?}", number + 1, String::from_utf8_lossy(bytes))?;
    }
    for category in &image.other {
        writeln!(
            output,
            "category {:<7} {} bytes: {}",
            category.kind,
            category.data.len(),
            hex::spaced(&category.data, SHOWN)
        )?;
    }
    Ok(())
}

fn pdos(output: &mut dyn Write, image: &Image, kind: &str, pdos: &[Pdo]) -> io::Result<()> {
    for pdo in pdos {
        let assigned = pdo.sync_manager.map_or("not assigned".to_owned(), |number| format!("SM{number}"));
        let bits = pdo.bit_length();
        writeln!(
            output,
            "{kind} {:04x}       {}, {assigned}, {} bytes{}, flags 0x{:04x}",
            pdo.index,
            image.string(pdo.name).unwrap_or_else(|| "-".to_owned()),
            bits / 8,
            if bits % 8 == 0 { String::new() } else { format!(" and {} bits", bits % 8) },
            pdo.flags
        )?;
        for entry in &pdo.entries {
            if entry.object.index == 0 {
                writeln!(output, "    gap                  {:>3} bits", entry.bit_length)?;
                continue;
            }
            writeln!(
                output,
                "    {} {:>3} bits type 0x{:02x}  {}",
                entry.object,
                entry.bit_length,
                entry.data_type,
                image.string(entry.name).unwrap_or_else(|| "-".to_owned())
            )?;
        }
    }
    Ok(())
}
