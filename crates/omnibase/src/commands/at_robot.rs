//! `scan` and `sdo` of a segment that a running robot drives: it answers itself, beside its cycle.

use crate::commands::live::Line;
use crate::hex;
use crate::value::DataType;
use omnibase_ethercat::wire::coe::ObjectAddress;
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

impl Remote {
    /// The one at `position`.
    pub fn new(address: Option<SocketAddr>, position: u16) -> anyhow::Result<Self> {
        Ok(Remote { line: Line::to(address)?, position })
    }

    /// The bytes of an object.
    pub fn read(&self, object: ObjectAddress) -> anyhow::Result<Vec<u8>> {
        let found = self.line.data(&self.call("sdo_read", object))?;
        let text = found["data"].as_str().unwrap_or_default();
        // An object without a value has no bytes.
        if text.is_empty() { Ok(Vec::new()) } else { Ok(DataType::Bytes.parse(text)?) }
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

    fn call(&self, what: &str, object: ObjectAddress) -> Value {
        let object = format!("{:04x}:{:02x}", object.index, object.subindex);
        json!({ "do": what, "subdevice": self.position, "object": object })
    }
}
