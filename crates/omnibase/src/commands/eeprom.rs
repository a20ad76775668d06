//! `omnibase eeprom`: a SubDevice's EEPROM read, written, and given an alias.

use crate::new_file;
use crate::progress::{note, warn};
use crate::target::{AnyBus, Manners, Port, Target};
use crate::to_the_end::to_the_end;
use crate::value::number;
use crate::{Outcome, commands, small_file};
use anyhow::{Context, ensure};
use omnibase_ethercat::eeprom::{MAX_BYTES, with_checksum};
use omnibase_ethercat::wire::AlState;
use omnibase_ethercat::wire::sii::{self, Image};
use omnibase_ethercat::{SetUpError, SubDevice};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Bytes of the word with the checksum.
const CHECKSUM: Range<usize> = 14..16;

/// Reads or writes the EEPROM (SII) of one SubDevice, or gives it an alias.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Read(ReadArguments),
    Write(WriteArguments),
    Alias(AliasArguments),
}

/// Reads the whole EEPROM into a file; `omnibase sii` shows it in words.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase eeprom read eth1 2 drive.bin
  omnibase sii drive.bin

The segment is reset to INIT.")]
struct ReadArguments {
    #[command(flatten)]
    subdevice: SubDeviceArgument,
    /// The file to write; must not exist yet.
    file: PathBuf,
}

/// Writes an image: backup first, checksum computed, every word read back, and in the end the whole.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase eeprom write eth1 2 drive.bin
  omnibase eeprom write eth1 2 drive.bin --backup before.bin

Refused where a robot runs, where a SubDevice is in SAFE-OP or OP, and where the image is for another product
(--other-product), is that of an erased EEPROM, has more bytes than the device's EEPROM, or has an alias that another
SubDevice has. Another revision, and a serial number that another SubDevice has, are told. The checksum is spoiled first and set right last: an EEPROM that was left half-written says so itself, to
every MainDevice and to the chip; the same command, or the backup, makes it whole again. A first Ctrl-C waits for the end.
What was written counts from the next power-on.")]
struct WriteArguments {
    #[command(flatten)]
    subdevice: SubDeviceArgument,
    /// The image.
    file: PathBuf,
    /// Where the present content goes first; must not exist yet. Default: eeprom-<position>-<milliseconds since 1970>.bin.
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
    /// Write it although vendor or product of the device are others, as behind an EEPROM that was erased.
    #[arg(long)]
    other_product: bool,
}

/// Gives a SubDevice an alias by which robot files find it wherever it is plugged in.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase eeprom alias eth1 2 7
  omnibase eeprom alias eth1 2 0x0010      as `scan` shows it
  omnibase eeprom alias eth1 2 0           takes it away

Written as `eeprom write` writes, with a backup first; counts from the next power-on.")]
struct AliasArguments {
    #[command(flatten)]
    subdevice: SubDeviceArgument,
    /// The alias, from 1, decimal or 0x...; 0 is none.
    #[arg(value_parser = parse_alias)]
    alias: u16,
    /// Where the present content goes first, as for `eeprom write`.
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
}

/// A SubDevice in which something is changed.
#[derive(Debug, clap::Args)]
pub(super) struct SubDeviceArgument {
    /// Network interface, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    /// Position of the SubDevice, from 0.
    pub(super) position: u16,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    match &arguments.action {
        Action::Read(arguments) => read(arguments, output),
        Action::Write(arguments) => write(arguments, output),
        Action::Alias(arguments) => alias(arguments, output),
    }
}

fn read(arguments: &ReadArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let position = arguments.subdevice.position;
    new_file::check(&arguments.file)?;
    let mut bus = arguments.subdevice.open_at_rest()?;
    let image = bus.read_sii(position)?;
    new_file::write(&arguments.file, &image)?;
    writeln!(output, "SubDevice {position}: {} bytes in {}", image.len(), arguments.file.display())?;
    Ok(Outcome::Done)
}

fn write(arguments: &WriteArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.file.display();
    let image = small_file::read(&arguments.file, small_file::EEPROM)?;
    ensure!(
        !is_blank(&image),
        "`{path}` is the image of an erased EEPROM, which has nothing to be known by: not written"
    );
    // Whatever the file says of it.
    let image = with_checksum(image);
    let (parsed, problems) = Image::parse(&image).with_context(|| format!("reading `{path}`"))?;
    ensure!(image.len().is_multiple_of(2), "`{path}` has {} bytes: an EEPROM has whole words", image.len());
    ensure!(
        problems.is_empty(),
        "`{path}` makes no sense everywhere (see `omnibase sii {path}`): not written"
    );
    let size = (usize::from(parsed.header.size_kibit_less_one) + 1) * 128;
    ensure!(
        image.len() <= size,
        "`{path}` has {} bytes, but says that it is for an EEPROM of {size}: not written",
        image.len()
    );
    ensure!(
        image.len() <= MAX_BYTES,
        "`{path}` has {} bytes, at most {MAX_BYTES} can be read back: not written",
        image.len()
    );
    let position = arguments.subdevice.position;
    check_backup(arguments.backup.as_deref())?;
    let mut bus = arguments.subdevice.open_at_rest()?;
    let one = bus.subdevice(position)?;
    let (found, wanted) = (one.identity, parsed.header.identity);
    ensure!(
        arguments.other_product
            || (found.vendor_id, found.product_code) == (wanted.vendor_id, wanted.product_code),
        "SubDevice {position} ({}) is vendor 0x{:08x} product 0x{:08x}, `{path}` is for vendor 0x{:08x} product 0x{:08x}: \
         not written; --other-product writes it all the same",
        one.name,
        found.vendor_id,
        found.product_code,
        wanted.vendor_id,
        wanted.product_code
    );
    ensure_alias_is_free(&bus, position, parsed.header.alias)?;
    let one = bus.subdevice(position)?;
    if found.revision != wanted.revision {
        warn(format_args!(
            "SubDevice {position} ({}) is revision 0x{:08x}, `{path}` is for revision 0x{:08x}",
            one.name, found.revision, wanted.revision
        ));
    }
    for other in others(&bus, position) {
        if wanted.serial != 0 && other.identity == wanted {
            warn(format_args!(
                "serial number {} of `{path}` belongs to SubDevice {} ({}) already: nobody can tell them apart by it",
                wanted.serial, other.position, other.name
            ));
        }
    }
    write_checked(&mut bus, position, image, arguments.backup.as_deref(), output)
}

fn alias(arguments: &AliasArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let position = arguments.subdevice.position;
    check_backup(arguments.backup.as_deref())?;
    let mut bus = arguments.subdevice.open_at_rest()?;
    ensure_alias_is_free(&bus, position, arguments.alias)?;
    let image = bus.sii_with_alias(position, arguments.alias)?.with_context(|| {
        format!(
            "SubDevice {position}: the checksum of its EEPROM is wrong: only the whole can be written (`omnibase eeprom write`)"
        )
    })?;
    write_checked(&mut bus, position, image, arguments.backup.as_deref(), output)
}

/// Whether the fixed part of an image is nothing but ones or zeros, whatever its checksum.
fn is_blank(image: &[u8]) -> bool {
    let fixed = image.iter().take(sii::HEADER).enumerate().filter(|(at, _)| !CHECKSUM.contains(at));
    let is_all = |value: u8| fixed.clone().all(|(_, byte)| *byte == value);
    !image.is_empty() && (is_all(0xFF) || is_all(0))
}

/// The size of an EEPROM that was read beyond its end, bytes, where the chip doesn't refuse that and begins anew.
fn comes_again(read: &[u8]) -> Option<usize> {
    let fixed = read.get(..sii::HEADER).filter(|fixed| !is_blank(fixed))?;
    let sizes = std::iter::successors(Some(sii::HEADER), |size| Some(2 * size));
    sizes.take_while(|size| size + sii::HEADER <= read.len()).find(|&size| read[size..].starts_with(fixed))
}

fn others(bus: &AnyBus, position: u16) -> impl Iterator<Item = &SubDevice> {
    bus.subdevices().iter().filter(move |one| one.position != position)
}

/// Refuses an alias that another SubDevice has, or will have from its next power-on.
fn ensure_alias_is_free(bus: &AnyBus, position: u16, alias: u16) -> anyhow::Result<()> {
    let has = |one: &&SubDevice| one.claims_alias(alias);
    let owners: Vec<u16> = others(bus, position).filter(has).map(|one| one.position).collect();
    ensure!(
        alias == 0 || owners.is_empty(),
        "alias {alias} belongs to SubDevice {owners:?} already: none could be found by it; not written"
    );
    Ok(())
}

/// Whether the backup can be written where it is wanted, before anybody is taken to INIT for it.
fn check_backup(wanted: Option<&Path>) -> anyhow::Result<()> {
    wanted.map_or(Ok(()), new_file::check)
}

/// Backup, writing, and what was done.
fn write_checked(
    bus: &mut AnyBus,
    position: u16,
    image: Vec<u8>,
    backup: Option<&Path>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let image = with_checksum(image);
    // An EEPROM that announces no size that is true is kept as far as it is written over.
    let announced = match bus.read_sii(position) {
        Ok(announced) => Some(announced),
        Err(SetUpError::Eeprom(_)) => None,
        Err(error) => return Err(error.into()),
    };
    let (bytes, says) = (image.len(), announced.as_ref().map_or(0, Vec::len));
    let is_valid = announced.as_ref().is_some_and(|content| *content == with_checksum(content.clone()));
    // No size at all is announced as that of the fixed part.
    ensure!(
        bytes <= says || !is_valid || says <= sii::HEADER,
        "the image has {bytes} bytes, the EEPROM of SubDevice {position} has {says}: not written"
    );
    let before = match announced.filter(|_| bytes <= says) {
        Some(announced) => announced,
        None => bus.read_sii_first(position, bytes).with_context(|| {
            format!("the image has {bytes} bytes, so much can't be read of SubDevice {position}: not written")
        })?,
    };
    if let Some(size) = comes_again(&before[..before.len().min(bytes)]) {
        anyhow::bail!(
            "the image has {bytes} bytes, the EEPROM of SubDevice {position} {size}: it begins anew behind these; not written"
        );
    }
    if before.get(..image.len()) == Some(&image[..]) {
        writeln!(output, "SubDevice {position}: its EEPROM holds exactly that; nothing was written")?;
        return Ok(Outcome::Done);
    }
    let backup = backup.map_or_else(|| default_backup(position), Path::to_path_buf);
    let words = to_the_end("an EEPROM that is half-written", || {
        new_file::write(&backup, &before)?;
        note(format_args!("the present content is in {}", backup.display()));
        let words = bus.write_sii(position, &before, &image);
        // What to do is said by whoever knows what it holds now.
        let is_advised = |error: &SetUpError| {
            matches!(error, SetUpError::EepromWrite(_) | SetUpError::EepromDiffers { .. })
        };
        words.map_err(|error| {
            let unknown = if is_advised(&error) {
                ""
            } else {
                "what it holds now isn't known, give the same command again; "
            };
            let context = format!(
                "{unknown}what it held before is in {}; another attempt needs another name by --backup",
                backup.display()
            );
            anyhow::Error::new(error).context(context)
        })
    })?;
    writeln!(
        output,
        "SubDevice {position}: {words} words written and read back; they count from the next power-on. Backup: {}",
        backup.display()
    )?;
    Ok(Outcome::Done)
}

fn default_backup(position: u16) -> PathBuf {
    let milliseconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis());
    format!("eeprom-{position}-{milliseconds}.bin").into()
}

fn parse_alias(text: &str) -> Result<u16, String> {
    let alias = number(text).and_then(|number| u16::try_from(number).ok());
    alias.ok_or_else(|| format!("`{text}` is no alias, 0 to 65535, such as 7 or 0x0010"))
}

impl SubDeviceArgument {
    /// A segment in INIT whose SubDevice at `position` is there, to change something in it: refused where a robot or another
    /// MainDevice drives it, and where a SubDevice shows that somebody does.
    pub(super) fn open_at_rest(&self) -> anyhow::Result<AnyBus> {
        let SubDeviceArgument { target, position } = self;
        ensure!(
            !matches!(target, Target::Running(_)),
            "a robot runs there: end it first; nothing is changed in devices that may be enabled"
        );
        let mut bus = Manners { force: false, visible: false }.enter(target, Port::Socket)?.into_bus();
        if let Some(states) = bus.present_states()? {
            let is_driven = states & (AlState::SafeOp.bits() | AlState::Op.bits()) != 0;
            ensure!(
                !is_driven,
                "`{target}`: a SubDevice is in SAFE-OP or OP, so somebody drives the segment or left it like that; nothing was \
                 changed. Bring it to INIT first (`omnibase scan {target}` does), when the wheels are off the ground"
            );
        }
        commands::scan_bus(&mut bus, target)?;
        commands::note_warnings(&bus);
        bus.subdevice(*position)?;
        Ok(bus)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The address lines that an EEPROM doesn't have are ignored by many.
    #[test]
    fn an_eeprom_that_begins_anew_behind_its_end_is_known_by_that() {
        let mut image = vec![0xFF; 2048];
        image[..sii::HEADER].fill(0);
        image[0] = 0x80;
        assert_eq!(comes_again(&image), None);
        assert_eq!(comes_again(&image.repeat(2)), Some(2048));
        // Of an erased one nobody can say.
        assert_eq!(comes_again(&[0xFF; 4096]), None);
    }
}
