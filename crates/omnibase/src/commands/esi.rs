//! `omnibase esi`: what a maker's file says of its devices.

mod clocks;
mod explain;
mod json;
mod table;

use crate::Outcome;
use crate::new_file;
use crate::progress::{note, warn};
use anyhow::{Context, ensure};
use omnibase_esi::model::number;
use omnibase_esi::{Assembly, Device, EsiFile, Module, image};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Reads makers' files (ESI): devices, what they need, and their tables for a robot's file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase esi maker.xml                             which devices and modules the file has, what of it isn't read
  omnibase esi maker.xml --device MU-SERVO           everything about one, in words
  omnibase esi maker.xml --device 0x402:0x10000 --toml        its table for a robot's file, a reason beside each line
  omnibase esi coupler.xml modules.xml --device MU-COUPLER --slot MU-AI --slot MU-DO --toml
                                                     with modules in its slots, from slot 1 on
  omnibase esi maker.xml --device MU-IO --segment > io.toml   a simulated one of it:
  omnibase exchange sim:io.toml                               brought to OP
  omnibase esi maker.xml --device MU-IO --sii io.bin          the EEPROM's image that follows

A device is named by its type, by a name of it, or by product:revision. Exit code 1 where something in a file is
wrong; what can be read is shown all the same. With --device, what is wrong or isn't understood in the files is told
on stderr.")]
pub struct Arguments {
    /// The maker's file; modules may stand in further ones.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Which device: its type, a name, or product:revision.
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// The module in the next slot, by its type or ident, "" for a slot that stays empty; may be given several times.
    #[arg(long = "slot", value_name = "MODULE", requires = "device")]
    slots: Vec<String>,
    /// List the modules.
    #[arg(long)]
    modules: bool,
    /// Print the device's table for a robot's file.
    #[arg(long, requires = "device", conflicts_with_all = ["json", "segment"])]
    toml: bool,
    /// Print a segment file with the device, for `simulate` and `sim:`.
    #[arg(long, requires = "device", conflicts_with = "json")]
    segment: bool,
    /// Write the image of the device's EEPROM to this file, which mustn't exist yet.
    #[arg(long, value_name = "FILE", requires = "device")]
    sii: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The files of a command line: the first one has the device.
struct Files {
    first: EsiFile,
    others: Vec<EsiFile>,
}

impl Files {
    fn all(&self) -> impl Iterator<Item = &EsiFile> {
        std::iter::once(&self.first).chain(&self.others)
    }

    fn modules(&self) -> impl Iterator<Item = &Module> {
        self.all().flat_map(|file| &file.modules)
    }

    /// A device with the modules of these names in its slots.
    fn assembly<'a>(&'a self, device: &'a Device, slots: &[String]) -> anyhow::Result<Assembly<'a>> {
        let module = |name: &String| device.module(self.all(), name).map_err(anyhow::Error::msg);
        let modules = slots.iter().map(module).collect::<anyhow::Result<Vec<_>>>()?;
        Ok(Assembly::new(device, modules)?)
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let mut given = BTreeSet::new();
    for path in &arguments.files {
        let real = path.canonicalize().with_context(|| format!("`{}`", path.display()))?;
        ensure!(given.insert(real), "`{}` is given twice", path.display());
    }
    let read = |path: &PathBuf| EsiFile::read(path).with_context(|| format!("`{}`", path.display()));
    let mut files = arguments.files.iter().map(read);
    let first = files.next().context("no file is given")??;
    let files = Files { first, others: files.collect::<anyhow::Result<_>>()? };
    let sound = files.all().all(|file| file.notes.problems.is_empty());
    match &arguments.device {
        Some(name) => {
            for (path, file) in arguments.files.iter().zip(files.all()) {
                explain::told(path, &file.notes, &mut std::io::stderr())?;
            }
            one(arguments, &files, name, output)?;
        }
        None if arguments.json => {
            serde_json::to_writer_pretty(&mut *output, &json::files(&files))?;
            writeln!(output)?;
        }
        None => {
            for (path, file) in arguments.files.iter().zip(files.all()) {
                explain::file(path, file, arguments.modules, output)?;
            }
        }
    }
    Ok(if sound { Outcome::Done } else { Outcome::Failed })
}

/// One device, in the form that is asked for.
fn one(arguments: &Arguments, files: &Files, name: &str, output: &mut dyn Write) -> anyhow::Result<()> {
    let device = files.first.device(name).map_err(anyhow::Error::msg)?;
    let revisions = files.first.devices.iter().filter(|one| one.type_name == *name).count();
    if revisions > 1 {
        note(format_args!(
            "{revisions} revisions are called \"{name}\": the newest, {}, is taken",
            number(device.revision)
        ));
    }
    let assembly = files.assembly(device, &arguments.slots)?;
    if let Some(path) = &arguments.sii {
        if let Some(problem) = device.problems.first() {
            anyhow::bail!("no image is written of a device that can't be read whole: {problem}");
        }
        let identity =
            files.first.vendor.id.filter(|_| device.product_code.is_some() && device.revision.is_some());
        let vendor = identity.with_context(|| {
            format!("its file doesn't say who {} is: vendor, product code or revision", device.type_name)
        })?;
        new_file::write(path, &image::eeprom(device, vendor).emit())?;
    }
    if arguments.sii.is_some() || arguments.segment {
        for doubt in assembly.doubts() {
            warn(doubt);
        }
    }
    if arguments.toml {
        write!(output, "{}", table::of(&files.first, &assembly))?;
    } else if arguments.segment {
        write!(output, "{}", segment(arguments, device)?)?;
    } else if arguments.json {
        serde_json::to_writer_pretty(&mut *output, &json::one(files, &assembly))?;
        writeln!(output)?;
    } else if arguments.sii.is_none() {
        explain::device(&files.first, &assembly, output)?;
    }
    Ok(())
}

/// A segment file with the device alone. Paths don't depend on where the file is put.
fn segment(arguments: &Arguments, device: &Device) -> anyhow::Result<String> {
    let path = |path: &Path| -> anyhow::Result<String> {
        let path = std::path::absolute(path)?;
        let text = path.into_os_string().into_string();
        Ok(format!("{:?}", text.map_err(|_| anyhow::anyhow!("the path isn't UTF-8"))?))
    };
    let has_numbers = device.product_code.is_some() && device.revision.is_some();
    let wanted = if has_numbers { device.numbers() } else { device.type_name.clone() };
    let mut text = format!(
        "# {} as its maker's file says.\n[[subdevice]]\nkind = \"esi\"\nesi = {}\ndevice = {wanted:?}\n",
        device.type_name.replace(char::is_control, " "),
        path(&arguments.files[0])?
    );
    if !arguments.slots.is_empty() {
        let others = arguments.files[1..].iter().map(|one| path(one)).collect::<anyhow::Result<Vec<_>>>()?;
        text += &format!("modules = {:?}\n", arguments.slots);
        if !others.is_empty() {
            text += &format!("module_files = [{}]\n", others.join(", "));
        }
    }
    Ok(text)
}
