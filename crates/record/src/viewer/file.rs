//! An MCAP file for viewers.

use super::{Drawing, TOPICS, descriptors, log, messages, schemas};
use crate::run::protobuf::{Kind, descriptor_with, push_double, push_number};
use crate::run::{RunEvent, RunSchema, message_name};
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Why a file for viewers can't be written.
#[derive(Debug, thiserror::Error)]
#[error("MCAP: {0}")]
pub struct ViewerError(#[from] mcap::McapError);

/// A signal that is a code, and what its codes are called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its topic.
    pub topic: String,
    /// Its name.
    pub signal: String,
    /// What 0, 1 and so on are called, in capitals, digits and underscores; empty where no choice has the code.
    pub names: Vec<String>,
}

/// Writes a run for viewers.
pub struct ViewerFile<W: Write + Seek> {
    writer: mcap::Writer<W>,
    begun_unix_ns: u64,
    drawn: Vec<u16>,
    /// Each topic's channel, and of each of its signals whether it is a code.
    topics: Vec<(u16, Vec<bool>)>,
    sequence: u32,
}

impl<W: Write + Seek> ViewerFile<W> {
    /// Starts a file with these signals beside what is drawn; time 0 of the run was at this wall clock, ns since 1970.
    pub fn create(
        output: W,
        (schema, named): (&RunSchema, &[Named]),
        begun_unix_ns: u64,
        description: &BTreeMap<String, String>,
    ) -> Result<Self, ViewerError> {
        let options = mcap::WriteOptions::new().library("omnibase").compression(Some(mcap::Compression::Lz4));
        let mut writer = mcap::Writer::with_options(output, options)?;
        writer.write_metadata(&Metadata { name: "omnibase".into(), metadata: description.clone() })?;
        let explained = descriptors();
        let mut drawn = Vec::new();
        for (topic, name) in TOPICS {
            let schema = writer.add_schema(name, "protobuf", &explained)?;
            drawn.push(writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())?);
        }
        let mut topics = Vec::new();
        for topic in &schema.topics {
            let name = message_name(&topic.name);
            let (mut fields, mut enums, mut codes) = (Vec::new(), Vec::new(), Vec::new());
            for signal in &topic.signals {
                let code = named.iter().find(|code| code.topic == topic.name && code.signal == signal.name);
                let type_name = code.map(|_| message_name(&signal.name.replace('_', " ")));
                if let (Some(code), Some(type_name)) = (code, &type_name) {
                    enums.push(schemas::choices(type_name, &code.names));
                }
                codes.push(code.is_some());
                let full = type_name.map(|type_name| format!(".omnibase.{name}.{type_name}"));
                fields.push((signal.name.clone(), full.map_or(Kind::Double, Kind::Choice)));
            }
            let explained = descriptor_with(&name, &fields, &enums);
            let schema = writer.add_schema(&format!("omnibase.{name}"), "protobuf", &explained)?;
            let channel = writer.add_channel(schema, &topic.name, "protobuf", &BTreeMap::new())?;
            topics.push((channel, codes));
        }
        Ok(ViewerFile { writer, begun_unix_ns, drawn, topics, sequence: 0 })
    }

    /// Writes one row of signals.
    pub fn write_row(&mut self, time_ns: u64, values: &[f64]) -> Result<(), ViewerError> {
        let mut values = values.iter();
        for number in 0..self.topics.len() {
            let (channel, codes) = &self.topics[number];
            let mut bytes = Vec::with_capacity(10 * codes.len());
            for (field, (is_code, value)) in (1..).zip(codes.iter().zip(&mut values)) {
                if *is_code {
                    push_number(&mut bytes, field, *value as u64);
                } else {
                    push_double(&mut bytes, field, *value);
                }
            }
            let channel = *channel;
            self.send(channel, time_ns, &bytes)?;
        }
        Ok(())
    }

    /// Writes what is drawn at a time of the run.
    pub fn write_drawing(&mut self, time_ns: u64, drawing: &Drawing) -> Result<(), ViewerError> {
        for (topic, bytes) in messages(drawing, self.begun_unix_ns.saturating_add(time_ns)) {
            self.send(self.drawn[topic], time_ns, &bytes)?;
        }
        Ok(())
    }

    /// Writes an event as a line of the log.
    pub fn write_event(&mut self, event: &RunEvent, is_warning: bool) -> Result<(), ViewerError> {
        let bytes = log(&event.text, is_warning, self.begun_unix_ns.saturating_add(event.time_ns));
        self.send(self.drawn[4], event.time_ns, &bytes)
    }

    /// Writes index and end.
    pub fn finish(mut self) -> Result<(), ViewerError> {
        self.writer.finish()?;
        Ok(())
    }

    fn send(&mut self, channel_id: u16, time_ns: u64, bytes: &[u8]) -> Result<(), ViewerError> {
        let log_time = self.begun_unix_ns.saturating_add(time_ns);
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: time_ns };
        Ok(self.writer.write_to_known_channel(&header, bytes)?)
    }
}
