//! `omnibase eeprom`: a SubDevice's EEPROM read, written, and given an alias.

use crate::new_file;
use crate::progress::note;
use crate::target::{AnyBus, Manners, Port, Target};
use crate::{Outcome, commands};
use anyhow::{Context, ensure};
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::eeprom::{MAX_BYTES, with_checksum};
use omnibase_ethercat::wire::AlState;
use omnibase_ethercat::wire::sii::Image;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

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
    place: Place,
    /// The file to write; must not exist yet.
    file: PathBuf,
}

/// Writes an image: backup first, checksum computed, every word read back, and in the end the whole.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase eeprom write eth1 2 drive.bin
  omnibase eeprom write eth1 2 drive.bin --backup before.bin

Refused where a robot runs, where a SubDevice is in SAFE-OP or OP, and where the image is for another product
(--other-product). The checksum is spoiled first and set right last: an EEPROM that was left half-written says so itself, to
every MainDevice and to the chip; the same command, or the backup, makes it whole again. What was written counts from
the next power-on.")]
struct WriteArguments {
    #[command(flatten)]
    place: Place,
    /// The image.
    file: PathBuf,
    /// Where the present content goes first; must not exist yet. Default: eeprom-<position>-<seconds since 1970>.bin.
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
  omnibase eeprom alias eth1 2 0           takes it away

Written as `eeprom write` writes, with a backup first; counts from the next power-on.")]
struct AliasArguments {
    #[command(flatten)]
    place: Place,
    /// The alias, from 1; 0 is none.
    alias: u16,
    /// Where the present content goes first, as for `eeprom write`.
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
}

/// Whose EEPROM.
#[derive(Debug, clap::Args)]
struct Place {
    /// Network interface, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    /// Position of the SubDevice, from 0.
    position: u16,
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
    let Place { position, .. } = arguments.place;
    new_file::check(&arguments.file)?;
    let mut bus = arguments.place.open()?;
    let image = bus.read_sii(position)?;
    new_file::write(&arguments.file, &image)?;
    writeln!(output, "SubDevice {position}: {} bytes in {}", image.len(), arguments.file.display())?;
    Ok(Outcome::Done)
}

fn write(arguments: &WriteArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.file.display();
    let image = std::fs::read(&arguments.file).with_context(|| format!("reading `{path}`"))?;
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
    let Place { position, .. } = arguments.place;
    check_backup(arguments.backup.as_deref())?;
    let mut bus = arguments.place.open()?;
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
    write_checked(&mut bus, position, image, arguments.backup.as_deref(), output)
}

fn alias(arguments: &AliasArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Place { position, .. } = arguments.place;
    check_backup(arguments.backup.as_deref())?;
    let mut bus = arguments.place.open()?;
    let others: Vec<u16> = bus
        .subdevices()
        .iter()
        .filter(|one| one.position != position && one.alias == Some(arguments.alias))
        .map(|one| one.position)
        .collect();
    ensure!(
        arguments.alias == 0 || others.is_empty(),
        "alias {} belongs to SubDevice {others:?} already: none could be found by it; not written",
        arguments.alias
    );
    let image = bus.sii_with_alias(position, arguments.alias)?.with_context(|| {
        format!(
            "SubDevice {position}: the checksum of its EEPROM is wrong: only the whole can be written (`omnibase eeprom write`)"
        )
    })?;
    write_checked(&mut bus, position, image, arguments.backup.as_deref(), output)
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
    let before = match bus.read_sii(position) {
        Ok(before) => before,
        Err(SetUpError::Eeprom(_)) => bus.read_sii_first(position, image.len())?,
        Err(error) => return Err(error.into()),
    };
    if before.get(..image.len()) == Some(&image[..]) {
        writeln!(output, "SubDevice {position}: its EEPROM holds exactly that; nothing was written")?;
        return Ok(Outcome::Done);
    }
    let backup = backup.map_or_else(|| default_backup(position), Path::to_path_buf);
    new_file::write(&backup, &before)?;
    note(format_args!("the present content is in {}", backup.display()));
    let words = bus
        .write_sii(position, &before, &image)
        .with_context(|| format!("the backup is {}", backup.display()))?;
    writeln!(
        output,
        "SubDevice {position}: {words} words written and read back; they count from the next power-on. Backup: {}",
        backup.display()
    )?;
    Ok(Outcome::Done)
}

fn default_backup(position: u16) -> PathBuf {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    format!("eeprom-{position}-{seconds}.bin").into()
}

impl Place {
    fn open(&self) -> anyhow::Result<AnyBus> {
        open_at_rest(&self.target, self.position)
    }
}

/// A segment in INIT whose SubDevice at `position` is there, to change something in it: refused where a robot or another
/// MainDevice drives it, and where a SubDevice shows that somebody does.
pub(super) fn open_at_rest(target: &Target, position: u16) -> anyhow::Result<AnyBus> {
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
    bus.subdevice(position)?;
    Ok(bus)
}
