//! An MCAP file for viewers.

use super::{Channels, Drawing, LOG, log, messages};
use crate::run::RunEvent;
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Why a file for viewers can't be written.
#[derive(Debug, thiserror::Error)]
#[error("MCAP: {0}")]
pub struct ViewerError(#[from] mcap::McapError);

/// Writes a run for viewers.
pub struct ViewerFile<W: Write + Seek> {
    writer: mcap::Writer<W>,
    begun_unix_ns: u64,
    channels: Channels,
    /// Of each channel, in the file.
    ids: Vec<u16>,
    sequence: u32,
}

impl<W: Write + Seek> ViewerFile<W> {
    /// Starts a file with these channels; time 0 of the run was at this wall clock, ns since 1970.
    pub fn create(
        output: W,
        channels: Channels,
        begun_unix_ns: u64,
        description: &BTreeMap<String, String>,
    ) -> Result<Self, ViewerError> {
        let options = mcap::WriteOptions::new().library("omnibase").compression(Some(mcap::Compression::Lz4));
        let mut writer = mcap::Writer::with_options(output, options)?;
        writer.write_metadata(&Metadata { name: "omnibase".into(), metadata: description.clone() })?;
        let mut ids = Vec::new();
        for channel in channels.all() {
            let schema = writer.add_schema(&channel.message, "protobuf", &channel.explained)?;
            ids.push(writer.add_channel(schema, &channel.topic, "protobuf", &BTreeMap::new())?);
        }
        Ok(ViewerFile { writer, begun_unix_ns, channels, ids, sequence: 0 })
    }

    /// Writes one row of signals.
    pub fn write_row(&mut self, time_ns: u64, values: &[f64]) -> Result<(), ViewerError> {
        let row: Vec<_> = self.channels.row(values).collect();
        row.into_iter().try_for_each(|(channel, bytes)| self.send(channel, time_ns, &bytes))
    }

    /// Writes what is drawn at a time of the run.
    pub fn write_drawing(&mut self, time_ns: u64, drawing: &Drawing) -> Result<(), ViewerError> {
        let drawn = messages(drawing, self.begun_unix_ns.saturating_add(time_ns));
        drawn.into_iter().try_for_each(|(channel, bytes)| self.send(channel, time_ns, &bytes))
    }

    /// Writes an event as a line of the log.
    pub fn write_event(&mut self, event: &RunEvent, is_warning: bool) -> Result<(), ViewerError> {
        let bytes = log(&event.text, is_warning, self.begun_unix_ns.saturating_add(event.time_ns));
        self.send(LOG, event.time_ns, &bytes)
    }

    /// Writes index and end.
    pub fn finish(mut self) -> Result<(), ViewerError> {
        self.writer.finish()?;
        Ok(())
    }

    fn send(&mut self, channel: usize, time_ns: u64, bytes: &[u8]) -> Result<(), ViewerError> {
        let log_time = self.begun_unix_ns.saturating_add(time_ns);
        self.sequence = self.sequence.wrapping_add(1);
        let (channel_id, sequence) = (self.ids[channel], self.sequence);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: time_ns };
        Ok(self.writer.write_to_known_channel(&header, bytes)?)
    }
}
