//! What is at a bus, objects and an exchange, for programs of this process: the commands `scan`, `sdo` and `exchange`.
//!
//! Targets are those of the command line: an interface, `@robot`, or `sim:<segment.toml>`. Results are the commands' JSON, and
//! whatever they refuse is refused in their words. Each call takes the segment and lets it go.

use std::sync::atomic::AtomicBool;

use anyhow::Context;
use serde_json::Value;

use crate::commands::exchange::{self, parse_cycle};
use crate::commands::sdo::SubDeviceObjects;
use crate::commands::{at_robot, scan as look};
use crate::progress::{self, LogLevel};
use crate::target::{Manners, Target};
use crate::words;

/// A segment, and how it is taken.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// An interface, `@robot`, or `sim:<segment.toml>`.
    pub target: &'a str,
    /// Take it even where frames of another MainDevice pass there.
    pub force: bool,
}

/// A SubDevice of it.
#[derive(Clone, Copy, Debug)]
pub struct SubDevice<'a> {
    /// Where it is.
    pub segment: Segment<'a>,
    /// Its position, from 0.
    pub position: u16,
    /// The type of its objects' values, as `u16` or `hex`; `None`: by its SDO Information.
    pub data_type: Option<&'a str>,
}

/// An exchange of process data with zeros.
#[derive(Clone, Copy, Debug)]
pub struct Exchange {
    /// Time of a cycle, microseconds.
    pub cycle_us: f64,
    /// Cycles in OP.
    pub cycles: u64,
    /// Synchronised by distributed clocks.
    pub dc: bool,
}

impl Segment<'_> {
    fn open(&self) -> anyhow::Result<(Target, Manners)> {
        // What a program should know is in its answer.
        progress::show(LogLevel::Warning);
        Ok((self.target.parse().map_err(anyhow::Error::msg)?, Manners { force: self.force, visible: false }))
    }
}

impl SubDevice<'_> {
    fn open(&self) -> anyhow::Result<SubDeviceObjects> {
        let (target, manners) = self.segment.open()?;
        let data_type = self.data_type.map(str::parse).transpose().map_err(anyhow::Error::msg)?;
        let position = self.position;
        Ok(SubDeviceObjects { target, manners, position, data_type, complete: false, json: true })
    }
}

/// The SubDevices, as `omnibase scan --json` tells them, where wished with their dictionaries.
pub fn scan(segment: Segment<'_>, with_dictionary: bool) -> Result<Value, String> {
    let scan = || {
        let (target, manners) = segment.open()?;
        if let Target::Running(address) = target {
            let mut found = Vec::new();
            at_robot::scan(address, true, &mut found)?;
            return Ok(serde_json::from_slice(&found)?);
        }
        let (report, refusal) = look::look(&target, manners, with_dictionary)?;
        refusal.map_or(Ok(()), Err)?;
        Ok(serde_json::to_value(report)?)
    };
    scan().map_err(|error: anyhow::Error| words(&error))
}

/// An object, as `omnibase sdo read --json` tells it: index, subindex, type, value, data.
pub fn sdo_read(of: SubDevice<'_>, object: &str) -> Result<Value, String> {
    let read = || Ok(serde_json::to_value(of.open()?.read_one(object)?)?);
    read().map_err(|error: anyhow::Error| words(&error))
}

/// The same of an object that is written.
pub fn sdo_write(of: SubDevice<'_>, object: &str, value: &str) -> Result<Value, String> {
    let write = || Ok(serde_json::to_value(of.open()?.write_one(object, value)?)?);
    write().map_err(|error: anyhow::Error| words(&error))
}

/// To OP, so many cycles, and back to INIT, until `stop` is set: what `omnibase exchange --json` tells.
pub fn exchange(segment: Segment<'_>, wanted: Exchange, stop: &AtomicBool) -> Result<Value, String> {
    let exchange = || {
        let (target, manners) = segment.open()?;
        let Exchange { cycle_us, cycles, dc } = wanted;
        let cycle = parse_cycle(&cycle_us.to_string()).map_err(anyhow::Error::msg).context("cycle_us")?;
        let arguments = exchange::Arguments::of_program(target, manners, cycle, cycles, dc);
        let mut told = Vec::new();
        exchange::run_until(&arguments, stop, &mut told)?;
        Ok(serde_json::from_slice(&told)?)
    };
    exchange().map_err(|error: anyhow::Error| words(&error))
}
