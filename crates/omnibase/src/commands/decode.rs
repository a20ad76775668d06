//! `omnibase decode`: a capture in words.

use crate::Outcome;
use crate::decode::records::{FrameDirection, Record, way_rule};
use crate::decode::summary::{Gatherer, Summary};
use crate::decode::words;
use crate::hex;
use anyhow::Context;
use omnibase_ethercat_wire::frame::Datagram;
use omnibase_ethercat_wire::{Address, Command};
use omnibase_measure::quantiles::{Quantiles, microseconds};
use omnibase_record::{Capture, CaptureError, CapturedFrame};
use serde::Serialize;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Bytes by which a capture is known.
const MAGIC: u64 = 4;

/// Shows every datagram of a capture (pcapng or pcap) in words, then a summary.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase decode start-up.pcapng                  every datagram, then the summary
  omnibase decode start-up.pcapng --summary        the summary alone: losses, round trips, cycle, working counters
  omnibase decode start-up.pcapng --json | jq '.datagrams[] | select(.working_counter == 0)'

Columns: frame, time since the first frame in s, to (->) or from (<-) the segment, index, command, address,
length, working counter, data and their meaning. Exit code 1 where something of the file could not be read.")]
pub struct Arguments {
    /// The capture.
    capture: PathBuf,
    /// Print one JSON object: {"datagrams": [...], "problems": [...], "summary": {...}}.
    #[arg(long)]
    json: bool,
    /// Print the summary only.
    #[arg(long)]
    summary: bool,
    /// Print all data bytes in text, not the first 32 of each datagram.
    #[arg(long)]
    full: bool,
}

/// Data bytes of a datagram shown in text without `--full`.
const SHOWN: usize = 32;

/// A datagram as JSON.
#[derive(Serialize)]
struct DatagramRecord {
    frame: u64,
    time_ns: u64,
    direction: FrameDirection,
    /// Its place in the frame, from 0.
    datagram: usize,
    index: u8,
    command: &'static str,
    command_code: u8,
    /// ADP: position, station or count; absent for logical addresses.
    #[serde(skip_serializing_if = "Option::is_none")]
    adp: Option<u16>,
    /// ADO: register or memory address; absent for logical addresses.
    #[serde(skip_serializing_if = "Option::is_none")]
    ado: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    logical: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    place: Option<String>,
    length: usize,
    circulating: bool,
    event: u16,
    working_counter: u16,
    /// Hexadecimal.
    data: String,
    meaning: Vec<String>,
}

/// Something that could not be read.
#[derive(Serialize)]
struct Unreadable {
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u64>,
    text: String,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.capture.display();
    let file = read(&arguments.capture).with_context(|| format!("reading `{path}`"))?;
    let capture = Capture::read(&file).with_context(|| format!("reading `{path}`"))?;
    let records: Vec<Result<Record<'_>, CapturedFrame<'_>>> =
        capture.frames.iter().map(|frame| Record::new(*frame).ok_or(*frame)).collect();
    let rule = way_rule(records.iter().filter_map(|record| record.as_ref().ok()));
    let start_ns = capture.frames.first().map_or(0, |frame| frame.unix_ns);

    let mut printer = Printer { output, arguments, start_ns, datagrams: 0 };
    let mut gatherer = Gatherer::new(rule);
    let mut problems: Vec<Unreadable> = capture
        .warnings
        .iter()
        .map(|warning| Unreadable { frame: None, text: warning.to_string() })
        .collect();
    printer.begin()?;
    for record in &records {
        let Ok(record) = record else {
            gatherer.other_protocol();
            continue;
        };
        let (datagrams, mut problem) = record.datagrams();
        let way = gatherer.frame(record, &datagrams);
        if problem.is_some() {
            gatherer.malformed();
        } else if record.frame.data.len() < record.frame.original_length {
            let (found, expected) = (record.frame.data.len(), record.frame.original_length);
            problem = Some(format!("only {found} of {expected} bytes were captured"));
        }
        for (place, datagram) in datagrams.iter().enumerate() {
            let meaning = words::content(datagram, way);
            for text in meaning.iter().filter(|text| is_event(text)) {
                gatherer.event(record.frame.number, text);
            }
            printer.datagram(record, way, place, datagram, meaning)?;
        }
        if let Some(text) = problem {
            printer.problem(record.frame.number, &text)?;
            problems.push(Unreadable { frame: Some(record.frame.number), text });
        }
    }
    printer.end(&problems, &gatherer.finish())?;
    Ok(if problems.is_empty() { Outcome::Done } else { Outcome::Failed })
}

/// A capture, however large; of another file the first bytes alone.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let (mut file, mut bytes) = (File::open(path)?, Vec::new());
    (&mut file).take(MAGIC).read_to_end(&mut bytes)?;
    if !matches!(Capture::read(&bytes), Err(CaptureError::NotACapture { .. })) {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// AL errors, aborts, emergencies and mailbox errors, by the words that are used for them alone.
fn is_event(text: &str) -> bool {
    ["+ ERROR", "AL status code", "ABORT", "EMERGENCY", "mailbox error", ": ERROR"]
        .iter()
        .any(|word| text.contains(word))
}

struct Printer<'a> {
    output: &'a mut dyn Write,
    arguments: &'a Arguments,
    start_ns: u64,
    datagrams: u64,
}

impl Printer<'_> {
    fn begin(&mut self) -> io::Result<()> {
        if self.arguments.json { write!(self.output, "{{\"datagrams\":[") } else { Ok(()) }
    }

    fn datagram(
        &mut self,
        record: &Record<'_>,
        way: FrameDirection,
        place: usize,
        datagram: &Datagram<'_>,
        meaning: Vec<String>,
    ) -> anyhow::Result<()> {
        if self.arguments.summary {
            return Ok(());
        }
        if self.arguments.json {
            let separator = if self.datagrams == 0 { "\n" } else { ",\n" };
            self.datagrams += 1;
            write!(self.output, "{separator}")?;
            let datagram = json_record(record, way, place, datagram, meaning);
            serde_json::to_writer(&mut *self.output, &datagram)?;
            return Ok(());
        }
        let header = &datagram.header;
        let since_ns = record.frame.unix_ns.saturating_sub(self.start_ns);
        let command = Command::from_code(header.command);
        let name = command.map_or_else(|| format!("0x{:02x}", header.command), |command| command.to_string());
        let address = address_text(datagram);
        let arrow = if way == FrameDirection::Request { "->" } else { "<-" };
        let limit = if self.arguments.full { usize::MAX } else { SHOWN };
        write!(
            self.output,
            "{:>6} {:>4}.{:09} {arrow} #{:02x} {name:<4} {address:<36} len {:>4} wkc {:>3}  {}",
            record.frame.number,
            since_ns / 1_000_000_000,
            since_ns % 1_000_000_000,
            header.index,
            header.length,
            datagram.working_counter,
            hex::spaced(datagram.data, limit),
        )?;
        if !meaning.is_empty() {
            write!(self.output, "  | {}", meaning.join("; "))?;
        }
        writeln!(self.output)?;
        Ok(())
    }

    fn problem(&mut self, frame: u64, text: &str) -> io::Result<()> {
        if self.arguments.json || self.arguments.summary {
            return Ok(());
        }
        writeln!(self.output, "{frame:>6}  !! {text}")
    }

    fn end(&mut self, problems: &[Unreadable], summary: &Summary) -> anyhow::Result<()> {
        if self.arguments.json {
            write!(self.output, "\n],\n\"problems\":")?;
            serde_json::to_writer(&mut *self.output, problems)?;
            write!(self.output, ",\n\"summary\":")?;
            serde_json::to_writer(&mut *self.output, summary)?;
            writeln!(self.output, "}}")?;
            return Ok(());
        }
        if !self.arguments.summary && summary.frames > 0 {
            writeln!(self.output)?;
        }
        print_summary(self.output, summary)?;
        for problem in problems {
            match problem.frame {
                Some(frame) => writeln!(self.output, "problem          frame {frame}: {}", problem.text)?,
                None => writeln!(self.output, "problem          {}", problem.text)?,
            }
        }
        Ok(())
    }
}

fn json_record(
    record: &Record<'_>,
    way: FrameDirection,
    place: usize,
    datagram: &Datagram<'_>,
    meaning: Vec<String>,
) -> DatagramRecord {
    let header = &datagram.header;
    let target = header.target();
    let logical = match target {
        Some(Address::Logical(address)) => Some(address),
        _ => None,
    };
    let halves = logical.is_none();
    DatagramRecord {
        frame: record.frame.number,
        time_ns: record.frame.unix_ns,
        direction: way,
        datagram: place,
        index: header.index,
        command: Command::from_code(header.command).map_or("unknown", Command::name),
        command_code: header.command,
        adp: halves.then_some(header.address as u16),
        ado: halves.then_some((header.address >> 16) as u16),
        logical,
        place: target.and_then(words::place),
        length: header.length,
        circulating: header.circulating,
        event: header.event,
        working_counter: datagram.working_counter,
        data: hex::compact(datagram.data),
        meaning,
    }
}

/// Whom and where, with the register's name.
fn address_text(datagram: &Datagram<'_>) -> String {
    let raw = datagram.header.address;
    let Some(target) = datagram.header.target() else {
        return format!("unknown command, address 0x{raw:08x}");
    };
    let name = words::place(target).map_or(String::new(), |name| format!(" {name}"));
    match target {
        // Counted up on the way: as it stands in the frame.
        Address::Position { position, register } => {
            format!("pos {:>5} 0x{register:04x}{name}", position as i16)
        }
        Address::Station { station, register } => format!("stn 0x{station:04x} 0x{register:04x}{name}"),
        Address::Broadcast { passed, register } => format!("all {passed:>5} 0x{register:04x}{name}"),
        Address::Logical(address) => format!("log 0x{address:08x}"),
    }
}

fn print_summary(output: &mut dyn Write, summary: &Summary) -> io::Result<()> {
    let Summary { frames, requests, replies, datagrams, .. } = summary;
    writeln!(
        output,
        "frames           {frames} ({requests} requests, {replies} replies) with {datagrams} datagrams in {}.{:06} s",
        summary.duration_ns / 1_000_000_000,
        summary.duration_ns % 1_000_000_000 / 1000
    )?;
    writeln!(
        output,
        "matched          {}, lost {}, open at the end {}, replies without request {}",
        summary.matched, summary.lost_frames, summary.open_at_end, summary.replies_without_request
    )?;
    if summary.malformed + summary.other_protocols > 0 {
        writeln!(
            output,
            "other            {} malformed, {} of other protocols",
            summary.malformed, summary.other_protocols
        )?;
    }
    if let Some(round_trip) = &summary.round_trip_ns {
        writeln!(output, "round trip       {}", quantiles_text(round_trip))?;
    }
    if let Some(cycle) = &summary.cycle {
        writeln!(output, "cyclic frame     {}, {} times", cycle.datagrams, cycle.frames)?;
        writeln!(output, "  period         {}", quantiles_text(&cycle.period_ns))?;
        writeln!(output, "  jitter         {}, {} gaps", quantiles_text(&cycle.jitter_ns), cycle.gaps)?;
    }
    let commands: Vec<String> =
        summary.commands.iter().map(|(name, count)| format!("{name} {count}")).collect();
    if !commands.is_empty() {
        writeln!(output, "commands         {}", commands.join(", "))?;
    }
    for counters in &summary.working_counters {
        let found: Vec<String> =
            counters.counters.iter().map(|(counter, count)| format!("{counter} ({count} times)")).collect();
        writeln!(
            output,
            "working counter  {} {}, {} bytes: {}",
            counters.command,
            counters.target,
            counters.length,
            found.join(", ")
        )?;
    }
    if summary.unanswered_datagrams > 0 {
        writeln!(
            output,
            "unanswered       {} datagrams came back with working counter 0",
            summary.unanswered_datagrams
        )?;
    }
    for event in &summary.events {
        writeln!(output, "event            frame {}: {}", event.frame, event.text)?;
    }
    let left = summary.event_count - summary.events.len() as u64;
    if left > 0 {
        writeln!(output, "event            and {left} more")?;
    }
    Ok(())
}

fn quantiles_text(quantiles: &Quantiles) -> String {
    let Quantiles { min, p50, p99, p999, max } = *quantiles;
    let [min, p50, p99, p999, max] = [min, p50, p99, p999, max].map(microseconds);
    format!("min {min}, p50 {p50}, p99 {p99}, p99.9 {p999}, max {max}")
}
