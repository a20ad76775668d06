//! `scan` and `sdo` of a segment that a running robot drives: it answers itself, beside its cycle.

use crate::commands::live::Line;
use crate::dictionary::Objects;
use crate::hex;
use crate::value::DataType;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_run::live::{EntryType, ObjectType};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::io::Write;
use std::net::SocketAddr;

/// Prints the SubDevices of a running robot.
pub fn scan(address: Option<SocketAddr>, as_json: bool, output: &mut dyn Write) -> anyhow::Result<()> {
    let found = Line::to(address)?.data(&json!({ "do": "scan" }))?;
    if as_json {
        serde_json::to_writer_pretty(&mut *output, &found)?;
        writeln!(output)?;
        return Ok(());
    }
    for one in found["subdevices"].as_array().into_iter().flatten() {
        let text = |key: &str| one[key].as_str().unwrap_or_default();
        let number = |key: &str| one[key].as_u64().unwrap_or_default();
        let drive = if text("drive").is_empty() { String::new() } else { format!(" ({})", text("drive")) };
        writeln!(output, "{} {}{drive}", number("position"), text("name"))?;
        writeln!(
            output,
            "    identity  vendor 0x{:08x}, product 0x{:08x}, revision 0x{:08x}, serial {}",
            number("vendor_id"),
            number("product_code"),
            number("revision"),
            number("serial")
        )?;
        let alias = match number("alias") {
            0 => "none".to_owned(),
            alias => format!("0x{alias:04x}"),
        };
        let station = number("station_address");
        writeln!(output, "    state     {}, station 0x{station:04x}, alias {alias}", text("state"))?;
    }
    Ok(())
}

/// A SubDevice of a running robot.
pub struct Remote {
    line: Line,
    position: u16,
}

/// The bytes of a value that was read.
fn bytes_of(found: &Value) -> anyhow::Result<Vec<u8>> {
    let text = found["data"].as_str().unwrap_or_default();
    // An object without a value has no bytes.
    if text.is_empty() { Ok(Vec::new()) } else { Ok(DataType::Bytes.parse(text)?) }
}

impl Objects for Remote {
    fn list(&mut self) -> anyhow::Result<Vec<u16>> {
        let found = self.line.data(&json!({ "do": "sdo_list", "subdevice": self.position }))?;
        Ok(serde_json::from_value(found["indices"].clone())?)
    }

    fn object(&mut self, index: u16) -> anyhow::Result<Result<ObjectType, String>> {
        self.described("sdo_object", ObjectAddress::new(index, 0))
    }

    fn entry(&mut self, address: ObjectAddress) -> anyhow::Result<Result<EntryType, String>> {
        self.described("sdo_type", address)
    }

    fn value(&mut self, address: ObjectAddress) -> anyhow::Result<Result<Vec<u8>, String>> {
        let found = self.line.of_object(&self.call("sdo_read", address))?;
        found.map_or_else(|refusal| Ok(Err(refusal)), |found| bytes_of(&found).map(Ok))
    }
}

impl Remote {
    /// The one at `position`.
    pub fn new(address: Option<SocketAddr>, position: u16) -> anyhow::Result<Self> {
        Ok(Remote { line: Line::to(address)?, position })
    }

    /// The bytes of an object.
    pub fn read(&self, object: ObjectAddress) -> anyhow::Result<Vec<u8>> {
        bytes_of(&self.line.data(&self.call("sdo_read", object))?)
    }

    /// The type of an entry as the SubDevice describes it; `None` where it doesn't.
    pub fn data_type(&self, object: ObjectAddress) -> Option<DataType> {
        let found = self.line.data(&self.call("sdo_type", object)).ok()?;
        let code = found["data_type"].as_u64()?;
        Some(DataType::from_coe(u16::try_from(code).ok()?))
    }

    /// Writes an object.
    pub fn write(&self, object: ObjectAddress, data: &[u8]) -> anyhow::Result<()> {
        let mut call = self.call("sdo_write", object);
        call["data"] = json!(hex::compact(data));
        self.line.data(&call).map(drop)
    }

    fn described<T: DeserializeOwned>(
        &self,
        what: &str,
        address: ObjectAddress,
    ) -> anyhow::Result<Result<T, String>> {
        let found = self.line.of_object(&self.call(what, address))?;
        found.map(serde_json::from_value).map_or_else(|refusal| Ok(Err(refusal)), |read| Ok(Ok(read?)))
    }

    fn call(&self, what: &str, object: ObjectAddress) -> Value {
        let object = format!("{:04x}:{:02x}", object.index, object.subindex);
        json!({ "do": what, "subdevice": self.position, "object": object })
    }
}
