//! `omnibase foe`: files of one SubDevice, such as its firmware.

use crate::commands::eeprom::SubDeviceArgument;
use crate::progress::{bar, note, warn};
use crate::target::AnyBus;
use crate::to_the_end::to_the_end;
use crate::value::number;
use crate::{Outcome, new_file, small_file};
use anyhow::{Context, ensure};
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::field::FILE_TIMEOUT;
use omnibase_ethercat::mailbox::{FileAccess, MailboxError, MailboxRequest};
use omnibase_ethercat::wire::sii::PROTOCOL_FOE;
use omnibase_ethercat::wire::{foe, mailbox};
use std::io::Write;
use std::path::PathBuf;

/// The largest file that is read, bytes.
const READ_LIMIT: usize = 64 << 20;

/// Writes a file to a SubDevice, such as its firmware, or reads one (FoE).
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Write(WriteArguments),
    Read(ReadArguments),
}

/// Brings the SubDevice to BOOT, writes the file, reads it back and compares, and leaves it in INIT.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase foe write eth1 2 firmware.bin
  omnibase foe write eth1 2 build/fw-1.2.bin --name firmware --password 0x12345678

Refused where a robot runs and where a SubDevice is in SAFE-OP or OP. A transfer that broke off leaves a device
without firmware that waits in BOOT or INIT: leave the power on and give the same command again. A first Ctrl-C
waits for the end. Devices that give no file back can't be compared; that is said, and `omnibase scan` shows their
version (1009, 100a) afterwards.")]
struct WriteArguments {
    #[command(flatten)]
    remote: RemoteFile,
    /// The file on this computer.
    file: PathBuf,
    /// Don't read it back.
    #[arg(long)]
    no_compare: bool,
}

/// Brings the SubDevice to BOOT and reads a file of it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase foe read eth1 2 saved.bin --name firmware.bin")]
struct ReadArguments {
    #[command(flatten)]
    remote: RemoteFile,
    /// The file on this computer; must not exist yet.
    file: PathBuf,
}

/// Whose file, and its name there.
#[derive(Debug, clap::Args)]
struct RemoteFile {
    #[command(flatten)]
    subdevice: SubDeviceArgument,
    /// The file's name in the SubDevice; default: that of the file on this computer.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// The password that the maker gives, a number.
    #[arg(long, value_name = "NUMBER", default_value = "0", value_parser = parse_password)]
    password: u32,
    /// In PRE-OP, through its usual mailbox, in place of BOOT: for files that aren't firmware.
    #[arg(long)]
    pre_op: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    match &arguments.action {
        Action::Write(arguments) => write(arguments, output),
        Action::Read(arguments) => read(arguments, output),
    }
}

fn write(arguments: &WriteArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let WriteArguments { remote, file, no_compare } = arguments;
    let content = small_file::read(file, small_file::FIRMWARE)?;
    ensure!(!content.is_empty(), "`{}` is empty: not written", file.display());
    let access = remote.access(file)?;
    let mut bus = remote.open(&access)?;
    // Half a firmware is none.
    let compared = to_the_end("a part of the file", || {
        remote.write(&mut bus, &access, &content)?;
        let compared = if *no_compare {
            Err("not asked for".to_owned())
        } else {
            remote.compare(&mut bus, &access, &content)?
        };
        remote.leave(&mut bus, "it may be starting its new firmware; power it off and on");
        Ok(compared)
    })?;
    let verdict = match compared {
        Ok(()) => "read back, the same".to_owned(),
        Err(reason) => format!("written and acknowledged, but NOT read back: {reason}"),
    };
    writeln!(
        output,
        "SubDevice {}: {} bytes as `{}`: {verdict}",
        remote.subdevice.position,
        content.len(),
        access.name
    )?;
    Ok(Outcome::Done)
}

fn read(arguments: &ReadArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let ReadArguments { remote, file } = arguments;
    // Known before the device is brought to BOOT.
    new_file::check(file)?;
    let access = remote.access(file)?;
    let mut bus = remote.open(&access)?;
    let request = MailboxRequest::read_file(access.clone(), Vec::with_capacity(READ_LIMIT));
    let content = remote.transfer(&mut bus, request);
    // Its firmware is untouched, whatever became of the file.
    remote.leave(&mut bus, "power it off and on");
    let content = content.with_context(|| format!("file `{}`", access.name))?;
    new_file::write(file, &content)?;
    writeln!(
        output,
        "SubDevice {}: `{}`, {} bytes in {}",
        remote.subdevice.position,
        access.name,
        content.len(),
        file.display()
    )?;
    Ok(Outcome::Done)
}

impl RemoteFile {
    fn access(&self, file: &std::path::Path) -> anyhow::Result<FileAccess> {
        let own = file.file_name().map(|name| name.to_string_lossy().into_owned());
        let name = self.name.clone().or(own).context("the file has no name: give --name")?;
        anyhow::ensure!(!name.is_empty(), "--name is empty: expected the file's name in the SubDevice");
        Ok(FileAccess { name, password: self.password })
    }

    /// The segment, and the SubDevice where it takes files.
    fn open(&self, access: &FileAccess) -> anyhow::Result<AnyBus> {
        let mut bus = self.subdevice.open_at_rest()?;
        let header = &bus.subdevice(self.subdevice.position)?.sii.header;
        let area = if self.pre_op { header.mailbox } else { header.bootstrap_mailbox };
        let room = usize::from(area.receive_size).saturating_sub(mailbox::HEADER + foe::HEADER);
        // What it has no mailbox for is told below, by its state.
        ensure!(
            access.name.len() <= room || room == 0,
            "--name has {} bytes, SubDevice {}'s mailbox carries {room} at most",
            access.name.len(),
            self.subdevice.position
        );
        if !self.pre_op {
            note(format_args!("SubDevice {}: to BOOT", self.subdevice.position));
            bus.enter_boot(self.subdevice.position)?;
            return Ok(bus);
        }
        bus.configure_sound()?;
        let one = bus.subdevice(self.subdevice.position)?;
        if let Some(cause) = &one.broken {
            anyhow::bail!("SubDevice {} can't be used: {cause}", self.subdevice.position);
        }
        ensure!(
            one.sii.header.mailbox_protocols & PROTOCOL_FOE != 0,
            "SubDevice {} ({}) takes no files: its SII names no FoE among the mailbox protocols",
            self.subdevice.position,
            one.name
        );
        Ok(bus)
    }

    fn transfer(&self, bus: &mut AnyBus, request: MailboxRequest) -> anyhow::Result<Vec<u8>> {
        let bar = bar(request.data.len() as u64, "bytes");
        let request = request.with_timeout(FILE_TIMEOUT);
        let done =
            bus.transfer_file(self.subdevice.position, request, &mut |bytes| bar.set_position(bytes as u64));
        bar.finish_and_clear();
        Ok(done?)
    }

    fn write(&self, bus: &mut AnyBus, access: &FileAccess, content: &[u8]) -> anyhow::Result<()> {
        note(format_args!("writing {} bytes as `{}`", content.len(), access.name));
        let written = self.transfer(bus, MailboxRequest::write_file(access.clone(), content.to_vec()));
        written.map(drop).map_err(|error| {
            let position = self.subdevice.position;
            if refused_at(&error) == Some(0) {
                self.leave(bus, "power it off and on");
                return error.context(format!(
                    "SubDevice {position} refused the file before its first byte: nothing of it was written"
                ));
            }
            let left = if self.pre_op {
                "may have a part of that file now"
            } else {
                "may be without firmware now and wait for it: leave its power on"
            };
            error.context(format!("SubDevice {position} {left}; give the same command again"))
        })
    }

    /// Whether the device gives the same back; the reason where it gives nothing.
    fn compare(
        &self,
        bus: &mut AnyBus,
        access: &FileAccess,
        content: &[u8],
    ) -> anyhow::Result<Result<(), String>> {
        let room = Vec::with_capacity(content.len() + 1);
        let found = match self.transfer(bus, MailboxRequest::read_file(access.clone(), room)) {
            Ok(found) => found,
            // Many devices take a file and give none back; whoever fell silent or gave more is another matter.
            Err(error) if refused_at(&error).is_some() => return Ok(Err(format!("{error:#}"))),
            Err(error) => return Err(error.context("reading back what was written: write it again")),
        };
        let differs = found.iter().zip(content).position(|(found, written)| found != written);
        ensure!(
            found.len() == content.len() && differs.is_none(),
            "SubDevice {}: what was read back differs from byte {} on ({} bytes of {}): write it again",
            self.subdevice.position,
            differs.unwrap_or(found.len().min(content.len())),
            found.len(),
            content.len()
        );
        Ok(Ok(()))
    }

    /// To INIT; `advice` is for one that doesn't follow, as a device that starts its new firmware by itself is away for a while.
    fn leave(&self, bus: &mut AnyBus, advice: &str) {
        if !self.pre_op
            && let Err(error) = bus.leave_boot(self.subdevice.position)
        {
            warn(format_args!("{error}: {advice}"));
        }
    }
}

/// At which packet a device said that it won't; 0 is before the first.
fn refused_at(error: &anyhow::Error) -> Option<u32> {
    match error.downcast_ref() {
        Some(SetUpError::Request { cause: MailboxError::FileRefused { packet, .. }, .. }) => Some(*packet),
        _ => None,
    }
}

fn parse_password(text: &str) -> Result<u32, String> {
    number(text).ok_or_else(|| format!("`{text}` is no number of 32 bits such as 1234 or 0x12345678"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_ethercat::mailbox::{Operation, ShortText, Waiting};
    use omnibase_ethercat_wire::foe::FoeErrorCode;

    /// What a device won't give back is told; one that fell silent has perhaps no firmware.
    #[test]
    fn silence_while_a_file_is_read_back_is_no_refusal() {
        let operation = Operation::ReadFile;
        let failed = |cause| anyhow::Error::new(SetUpError::Request { position: 2, operation, cause });
        let (code, text) = (FoeErrorCode::NOT_FOUND, ShortText::beginning(b""));
        assert_eq!(refused_at(&failed(MailboxError::FileRefused { code, packet: 3, text })), Some(3));
        let silent = MailboxError::Timeout { waiting: Waiting::Answer, after: FILE_TIMEOUT };
        for cause in [silent, MailboxError::Unreachable { after: FILE_TIMEOUT }, MailboxError::Reset] {
            assert_eq!(refused_at(&failed(cause)), None, "{cause}");
        }
    }
}
