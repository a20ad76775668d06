//! `omnibase sdo`: objects of one SubDevice.

use crate::commands::at_robot::Remote;
use crate::dictionary::{self, OnBus};
use crate::hex;
use crate::progress::error as say_error;
use crate::target::{AnyBus, Manners, Port, Target};
use crate::value::DataType;
use crate::{Outcome, commands};
use anyhow::Context;
use omnibase_ethercat::mailbox::{MailboxRequest, Operation};
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::sii;
use serde::Serialize;
use std::io::Write;

/// Reads or writes objects of one SubDevice.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    List(ListArguments),
    Read(ReadArguments),
    Write(WriteArguments),
}

/// Lists all objects of a SubDevice: names, types, rights, values.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase sdo list eth1 0                    the whole dictionary of the first SubDevice
  omnibase sdo list @robot 2 | grep -i torque     of a robot that runs, beside its cycle
  omnibase sdo list @robot 2 1018 6083 --json     of these objects

By the SubDevice's SDO Information, object by object as they come. r: readable, w: writable, o, i: can be mapped to outputs,
inputs; where not in every state, the states stand at the end. What a SubDevice refuses is shown with its reason.")]
struct ListArguments {
    /// Network interface, @robot, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    #[command(flatten)]
    manners: Manners,
    /// Position of the SubDevice, from 0.
    position: u16,
    /// Indices in hexadecimal; default: all.
    #[arg(value_name = "INDEX", value_parser = parse_object)]
    only: Vec<ObjectAddress>,
    /// Print one JSON array, as in `scan --dictionary --json`.
    #[arg(long)]
    json: bool,
}

/// Reads objects and prints their values.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase sdo read eth1 0 6041:00                        the status word of the first SubDevice
  omnibase sdo read eth1 2 1008:0 1018:1 1018:2 --json    several objects, as JSON
  omnibase sdo read eth1 0 1c12 --complete                a whole object in one transfer
  omnibase sdo read @robot 0 6041:00                      through the robot that runs on this machine
  omnibase sdo read sim:segments/three-sgdv.toml 0 6064:0 --type i32

Index and subindex are hexadecimal; behind a dot, as in a robot's file (0x2200.10), the subindex is decimal. Without --type the type comes from the SubDevice's SDO Information, else
the bytes are shown. The segment is reset to INIT and brought to PRE-OP first, but that of a running robot
(@robot), which reads beside its cycle.")]
struct ReadArguments {
    #[command(flatten)]
    place: SubDeviceObjects,
    /// Objects as index:subindex.
    #[arg(required = true, value_name = "INDEX:SUBINDEX", value_parser = parse_object)]
    objects: Vec<ObjectAddress>,
}

/// Writes objects, one after another.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase sdo write eth1 0 6060:00 8                     mode of operation: csp (type by SDO Information)
  omnibase sdo write eth1 0 6060:0 8 60c2:1 1 --type u8   several objects
  omnibase sdo write eth1 0 2000:1 0a0b0c --type hex      any bytes

Index and subindex are hexadecimal, the latter decimal behind a dot (0x2200.10); numbers are decimal, or hexadecimal with 0x. Stops at the first object that is
refused. The segment is reset to INIT and brought to PRE-OP first. A running robot (@robot) writes beside its cycle,
while no drive is enabled or what [bus] sdo_write_while_enabled of its file names, never what its cycle owns.")]
struct WriteArguments {
    #[command(flatten)]
    place: SubDeviceObjects,
    /// Objects and their values in turn.
    #[arg(required = true, num_args = 2.., value_names = ["INDEX:SUBINDEX", "VALUE"], allow_negative_numbers = true)]
    pairs: Vec<String>,
}

/// Objects of one SubDevice, and how they are reached.
#[derive(Debug, clap::Args)]
pub struct SubDeviceObjects {
    /// Network interface, @robot, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    pub target: Target,
    #[command(flatten)]
    pub manners: Manners,
    /// Position of the SubDevice, from 0.
    pub position: u16,
    /// Type of all values: bool, u8 to u64, i8 to i64, f32, f64, string, hex.
    #[arg(long = "type", value_name = "TYPE")]
    pub data_type: Option<DataType>,
    /// Whole objects from the given subindex (0 or 1) in one transfer; values are bytes.
    #[arg(long)]
    pub complete: bool,
    /// Print one JSON object: {"objects": [{"index", "subindex", "type", "value", "data"}]}.
    #[arg(long)]
    pub json: bool,
}

/// One object as JSON.
#[derive(Serialize)]
pub struct ObjectJson {
    index: u16,
    subindex: u8,
    /// Name of the type.
    r#type: String,
    value: serde_json::Value,
    /// The bytes in hexadecimal.
    data: String,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    match &arguments.action {
        Action::List(arguments) => list(arguments, output),
        Action::Read(arguments) => read(arguments, output),
        Action::Write(arguments) => write(arguments, output),
    }
}

fn list(arguments: &ListArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let ListArguments { target, manners, position, only, json } = arguments;
    let only: Vec<u16> = only.iter().map(|object| object.index).collect();
    let mut way = open(target, *manners, *position)?;
    let mut tell = |object: &dictionary::Object| {
        if !json {
            object.print(output)?;
        }
        Ok(())
    };
    let objects = match &mut way {
        ObjectAccess::Bus(bus) => {
            let one = bus.subdevice(*position)?;
            anyhow::ensure!(
                one.coe_details & sii::COE_SDO_INFO != 0,
                "SubDevice {position} ({}) has no SDO Information: its maker's manual lists its objects, `sdo read` reads them",
                one.name
            );
            dictionary::read(&mut OnBus { bus, position: *position }, &only, &mut tell)?
        }
        ObjectAccess::Robot(remote) => dictionary::read(remote, &only, &mut tell)?,
    };
    if *json {
        serde_json::to_writer_pretty(&mut *output, &objects)?;
        writeln!(output)?;
    }
    Ok(Outcome::Done)
}

/// The way to a SubDevice's objects.
fn open(target: &Target, manners: Manners, position: u16) -> anyhow::Result<ObjectAccess> {
    if let Target::Running(address) = target {
        return Ok(ObjectAccess::Robot(Remote::new(*address, position)?));
    }
    let mut bus = manners.enter(target, Port::Socket)?.into_bus();
    commands::scan_bus(&mut bus, target)?;
    bus.subdevice(position)?;
    bus.configure_sound()?;
    if let Some(cause) = &bus.subdevice(position)?.broken {
        anyhow::bail!("SubDevice {position} can't be used: {cause}");
    }
    Ok(ObjectAccess::Bus(Box::new(bus)))
}

fn read(arguments: &ReadArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let place = &arguments.place;
    let mut way = place.open()?;
    let (mut objects, mut failed) = (Vec::new(), false);
    for &object in &arguments.objects {
        let data = match way.read(place, object) {
            Ok(data) => data,
            // The other objects may be there all the same.
            Err(error) => {
                say_error(format_args!("{error:#}"));
                failed = true;
                continue;
            }
        };
        let data_type = place.data_type(&mut way, object)?.unwrap_or(DataType::Bytes);
        if !place.json {
            writeln!(output, "{object} {}", data_type.to_words(&data))?;
        }
        objects.push(object_json(object, data_type, &data));
    }
    place.finish(output, objects)?;
    Ok(if failed { Outcome::Failed } else { Outcome::Done })
}

fn write(arguments: &WriteArguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let place = &arguments.place;
    anyhow::ensure!(
        arguments.pairs.len().is_multiple_of(2),
        "the value for `{}` is missing",
        arguments.pairs.last().map_or("", String::as_str)
    );
    let mut pairs = Vec::new();
    for pair in arguments.pairs.chunks_exact(2) {
        pairs.push((parse_object(&pair[0]).map_err(anyhow::Error::msg)?, &pair[1]));
    }
    // A value that can't be one shall not be found out when half of them are written.
    if let Some(data_type) = place.data_type {
        for (_, text) in &pairs {
            data_type.parse(text)?;
        }
    }
    let mut way = place.open()?;
    let (mut objects, mut refused) = (Vec::new(), None);
    for (object, text) in pairs {
        let (data_type, data) = match place.write(&mut way, object, text) {
            Ok(written) => written,
            // What was written before it is told all the same.
            Err(error) => {
                refused = Some(error);
                break;
            }
        };
        if !place.json {
            writeln!(output, "{object} written: {}", data_type.to_words(&data))?;
        }
        objects.push(object_json(object, data_type, &data));
    }
    place.finish(output, objects)?;
    refused.map_or(Ok(Outcome::Done), Err)
}

impl SubDeviceObjects {
    fn open(&self) -> anyhow::Result<ObjectAccess> {
        anyhow::ensure!(
            !self.complete || !matches!(self.target, Target::Running(_)),
            "--complete: not of a robot that runs; read entries one by one"
        );
        open(&self.target, self.manners, self.position)
    }

    /// One object, read.
    pub fn read_one(&self, object: &str) -> anyhow::Result<ObjectJson> {
        let object = parse_object(object).map_err(anyhow::Error::msg)?;
        let mut way = self.open()?;
        let data = way.read(self, object)?;
        let data_type = self.data_type(&mut way, object)?.unwrap_or(DataType::Bytes);
        Ok(object_json(object, data_type, &data))
    }

    /// One object, written.
    pub fn write_one(&self, object: &str, text: &str) -> anyhow::Result<ObjectJson> {
        let object = parse_object(object).map_err(anyhow::Error::msg)?;
        // What can't be a value shall not take the segment.
        self.data_type.map(|data_type| data_type.parse(text)).transpose()?;
        let (data_type, data) = self.write(&mut self.open()?, object, text)?;
        Ok(object_json(object, data_type, &data))
    }

    /// Writes an object; what was written.
    fn write(
        &self,
        way: &mut ObjectAccess,
        object: ObjectAddress,
        text: &str,
    ) -> anyhow::Result<(DataType, Vec<u8>)> {
        let data_type = self.data_type(way, object)?.with_context(|| {
            format!("SubDevice {} does not tell the type of {object}: give it with --type", self.position)
        })?;
        let data = data_type.parse(text).with_context(|| format!("value for {object}"))?;
        way.write(self, object, &data)?;
        Ok((data_type, data))
    }

    fn access(&self) -> SdoAccess {
        if self.complete { SdoAccess::Complete } else { SdoAccess::Entry }
    }

    /// The type as given or as the SubDevice tells it.
    fn data_type(&self, way: &mut ObjectAccess, object: ObjectAddress) -> anyhow::Result<Option<DataType>> {
        if self.data_type.is_some() {
            return Ok(self.data_type);
        }
        if self.complete {
            return Ok(Some(DataType::Bytes));
        }
        let bus = match way {
            ObjectAccess::Bus(bus) => bus,
            ObjectAccess::Robot(remote) => return Ok(remote.data_type(object)),
        };
        if bus.subdevice(self.position)?.coe_details & sii::COE_SDO_INFO == 0 {
            return Ok(None);
        }
        Ok(dictionary::data_type(bus, self.position, object)?)
    }

    fn finish(&self, output: &mut dyn Write, objects: Vec<ObjectJson>) -> anyhow::Result<()> {
        if self.json {
            serde_json::to_writer_pretty(&mut *output, &serde_json::json!({ "objects": objects }))?;
            writeln!(output)?;
        }
        Ok(())
    }
}

/// Who reads and writes the objects.
enum ObjectAccess {
    /// This program, which set the segment up.
    Bus(Box<AnyBus>),
    /// A robot that runs.
    Robot(Remote),
}

impl ObjectAccess {
    fn read(&mut self, place: &SubDeviceObjects, object: ObjectAddress) -> anyhow::Result<Vec<u8>> {
        match self {
            ObjectAccess::Bus(bus) => Ok(bus.sdo_read(place.position, object, place.access())?),
            ObjectAccess::Robot(remote) => remote.read(object),
        }
    }

    fn write(&mut self, place: &SubDeviceObjects, object: ObjectAddress, data: &[u8]) -> anyhow::Result<()> {
        match self {
            ObjectAccess::Bus(bus) => {
                let operation = Operation::Download { object, access: place.access() };
                bus.request(place.position, MailboxRequest::new(operation, data.to_vec()))?;
                Ok(())
            }
            ObjectAccess::Robot(remote) => remote.write(object, data),
        }
    }
}

fn object_json(object: ObjectAddress, data_type: DataType, data: &[u8]) -> ObjectJson {
    ObjectJson {
        index: object.index,
        subindex: object.subindex,
        r#type: data_type.to_string(),
        value: data_type.to_json(data),
        data: hex::compact(data),
    }
}

/// `index:subindex`, hexadecimal with or without 0x, or `index.subindex` as a robot's file has it, whose subindex is decimal; a
/// missing one is 0.
fn parse_object(text: &str) -> Result<ObjectAddress, String> {
    let digits = |text: &str| {
        let text = text.strip_prefix("0x").unwrap_or(text);
        u16::from_str_radix(text, 16).ok().filter(|_| !text.starts_with('+'))
    };
    let (index, subindex) = match (text.split_once(':'), text.split_once('.')) {
        (Some((index, subindex)), _) => {
            (index, digits(subindex).and_then(|number| u8::try_from(number).ok()))
        }
        (None, Some((index, subindex))) => {
            (index, subindex.parse().ok().filter(|_| !subindex.starts_with('+')))
        }
        (None, None) => (text, Some(0)),
    };
    match (digits(index), subindex) {
        (Some(index), Some(subindex)) => Ok(ObjectAddress::new(index, subindex)),
        _ => {
            Err(format!("`{text}` is no object: expected index:subindex in hexadecimal, for example 6041:00"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_hexadecimal() {
        assert_eq!(parse_object("6041:00"), Ok(ObjectAddress::new(0x6041, 0)));
        assert_eq!(parse_object("0x1c12:0x1A"), Ok(ObjectAddress::new(0x1C12, 0x1A)));
        assert_eq!(parse_object("0x2200.1"), Ok(ObjectAddress::new(0x2200, 1)));
        assert_eq!(parse_object("0x8000.10"), Ok(ObjectAddress::new(0x8000, 10)));
        assert_eq!(parse_object("1008"), Ok(ObjectAddress::new(0x1008, 0)));
        for wrong in
            ["", ":", "6041:", "6041.0:1", "6041.256", "6041.+1", "60411:0", "6041:100", "+1:0", "x:0"]
        {
            assert!(parse_object(wrong).is_err(), "{wrong}");
        }
    }
}
