//! What clients ask of the robot's bus: it is answered beside the cycle, in a thread that may wait.

use omnibase_robot::RobotPlan;
use omnibase_run::live::{AcyclicLine, EntryType, SdoError, SdoPlace, SubDeviceSeen};
use serde_json::{Value, json};

use crate::call::CallResult;

/// A question that the bus answers.
#[derive(Debug)]
pub(crate) enum BusCall {
    /// Every SubDevice and its state.
    Scan,
    /// The indices of a SubDevice's objects.
    List(u16),
    /// What an object is.
    Object(SdoPlace),
    /// An object's bytes.
    Read(SdoPlace),
    /// An entry's type.
    Type(SdoPlace),
    /// An object's new value.
    Write(SdoPlace, NewValue),
}

/// A value to be written.
#[derive(Debug)]
pub(crate) enum NewValue {
    /// These bytes.
    Bytes(Vec<u8>),
    /// This number, as long as the SubDevice says.
    Number(i128),
}

impl NewValue {
    /// What a call gives: a number, true or false, or bytes in hexadecimal.
    pub(crate) fn new(value: Option<&Value>, data: Option<&str>) -> Result<Self, String> {
        match (value, data) {
            (None, Some(text)) => bytes_of(text)
                .map(NewValue::Bytes)
                .ok_or_else(|| format!("data: expected bytes in hexadecimal, found `{text}`")),
            (Some(Value::Bool(value)), None) => Ok(NewValue::Number(i128::from(*value))),
            (Some(value), None) => match (value.as_i64(), value.as_u64()) {
                (Some(number), _) => Ok(NewValue::Number(number.into())),
                (_, Some(number)) => Ok(NewValue::Number(number.into())),
                _ => Err(format!("value: expected a whole number, found {value}; other types as data")),
            },
            _ => Err("expected either value (a whole number) or data (bytes in hexadecimal)".to_owned()),
        }
    }
}

impl BusCall {
    /// The answer; waits for it.
    pub(crate) fn answer(self, line: &AcyclicLine, plan: &RobotPlan) -> CallResult {
        match self.try_answer(line, plan) {
            Ok((text, data)) => CallResult { data: Some(data), ..CallResult::done(text) },
            Err(error) => not_answered(&error),
        }
    }

    fn try_answer(self, line: &AcyclicLine, plan: &RobotPlan) -> Result<(String, Value), SdoError> {
        Ok(match self {
            BusCall::Scan => {
                let seen = line.scan();
                let text: Vec<String> = seen.iter().map(one_line).collect();
                (text.join("\n"), json!({ "subdevices": seen.iter().map(as_json).collect::<Vec<_>>() }))
            }
            BusCall::List(position) => {
                let indices = line.sdo_list(position)?;
                let text: Vec<String> = indices.iter().map(|index| format!("{index:04x}")).collect();
                (text.join(" "), json!({ "indices": indices }))
            }
            BusCall::Object(place) => {
                let found = line.sdo_object(place)?;
                let text = format!(
                    "{:04x} {}: subindices to {}",
                    place.object.index, found.name, found.max_subindex
                );
                (text, json!(found))
            }
            BusCall::Read(place) => {
                let bytes = line.sdo_read(place)?;
                let data = hexadecimal(&bytes);
                (format!("{} {}", place.object, words(&bytes)), json!({ "data": data }))
            }
            BusCall::Type(place) => {
                let found = line.sdo_type(place)?;
                let EntryType { name, data_type, bit_length, .. } = &found;
                let text = format!("{} {name}: type 0x{data_type:04x}, {bit_length} bits", place.object);
                (text, json!(found))
            }
            BusCall::Write(place, value) => {
                let bytes = match value {
                    NewValue::Bytes(bytes) => bytes,
                    NewValue::Number(number) => encoded(number, line.sdo_type(place)?.bit_length)
                        .ok_or_else(|| {
                            SdoError::new(format!("{}: {number} has no room in it", place.object))
                        })?,
                };
                let (text, data) = (words(&bytes), hexadecimal(&bytes));
                line.sdo_write(plan, place, bytes)?;
                (format!("{} written: {text}", place.object), json!({ "data": data }))
            }
        })
    }
}

/// Programs are told where the SubDevice itself refused: any other error says nothing of the object.
fn not_answered(error: &SdoError) -> CallResult {
    let data = error.is_refusal().then(|| json!({ "refused_by_subdevice": true }));
    CallResult { data, ..CallResult::refused(error) }
}

fn one_line(one: &SubDeviceSeen) -> String {
    let SubDeviceSeen { facts, state } = one;
    let drive = if facts.drive.is_empty() { String::new() } else { format!(" `{}`", facts.drive) };
    format!(
        "{} {}{drive}: {state}; vendor 0x{:08x}, product 0x{:08x}, revision 0x{:08x}, serial {}, station 0x{:04x}",
        facts.position,
        facts.name,
        facts.identity.vendor_id,
        facts.identity.product_code,
        facts.identity.revision,
        facts.identity.serial,
        facts.station_address,
    )
}

fn as_json(one: &SubDeviceSeen) -> Value {
    let SubDeviceSeen { facts, state } = one;
    json!({
        "position": facts.position, "name": facts.name, "drive": facts.drive,
        "vendor_id": facts.identity.vendor_id, "product_code": facts.identity.product_code,
        "revision": facts.identity.revision, "serial": facts.identity.serial,
        "alias": facts.alias.unwrap_or(0), "station_address": facts.station_address, "state": state,
    })
}

/// A number where it can be one, else bytes.
fn words(bytes: &[u8]) -> String {
    if !matches!(bytes.len(), 1..=8) {
        return hexadecimal(bytes);
    }
    let number = bytes.iter().rev().fold(0u64, |number, byte| number << 8 | u64::from(*byte));
    format!("{number} (0x{number:0digits$x})", digits = 2 * bytes.len())
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes_of(text: &str) -> Option<Vec<u8>> {
    let is_plain = text.len().is_multiple_of(2) && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !is_plain || text.is_empty() {
        return None;
    }
    (0..text.len()).step_by(2).map(|at| u8::from_str_radix(&text[at..at + 2], 16).ok()).collect()
}

/// A number in so many bits, little-endian; signed or unsigned, as it fits.
fn encoded(number: i128, bits: u16) -> Option<Vec<u8>> {
    let room = u32::from(bits);
    let fits = (1..=64).contains(&room) && (-(1i128 << (room - 1))..1i128 << room).contains(&number);
    fits.then(|| number.to_le_bytes()[..usize::from(bits).div_ceil(8)].to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_asks_is_told_whose_no_it_is() {
        let own = not_answered(&SdoError::refusal("6041:00 aborted".to_owned()));
        assert_eq!((own.done, own.text.as_str()), (false, "refused: 6041:00 aborted"));
        assert_eq!(own.data, Some(json!({ "refused_by_subdevice": true })));
        assert_eq!(not_answered(&SdoError::new("SubDevice 1 is away".to_owned())).data, None);
    }

    #[test]
    fn values_become_bytes_of_the_length_that_the_subdevice_says() {
        assert_eq!(encoded(-2, 16), Some(vec![0xFE, 0xFF]));
        assert_eq!(encoded(0xFFFF_FFFF, 32), Some(vec![0xFF; 4]));
        assert_eq!(encoded(1, 1), Some(vec![1]));
        for (number, bits) in [(256, 8), (-129, 8), (0, 0), (0, 65)] {
            assert_eq!(encoded(number, bits), None, "{number} in {bits}");
        }
        assert_eq!((words(&[0x50, 2]), words(&[])), ("592 (0x0250)".to_owned(), String::new()));
        assert_eq!(
            (bytes_of("0aFF"), bytes_of("0"), bytes_of("\u{e4}"), bytes_of("")),
            (Some(vec![10, 255]), None, None, None)
        );
        for (value, data) in [(None, None), (Some(json!(1.5)), None), (Some(json!(1)), Some("01"))] {
            assert!(NewValue::new(value.as_ref(), data).is_err(), "{value:?} {data:?}");
        }
    }
}
