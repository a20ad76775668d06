//! `omnibase decode` and tshark see the same in every datagram of the recordings of real devices.

use serde_json::Value;
use std::collections::HashMap;
use std::path::PathBuf;
use std::process::Command;

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures");

/// What both decoders must agree on.
#[derive(Debug, Default, PartialEq, Eq)]
struct Datagram {
    frame: u64,
    command: u8,
    index: u8,
    /// ADP and ADO, or the logical address.
    address: (Option<u16>, Option<u16>, Option<u32>),
    length: usize,
    event: u16,
    working_counter: u16,
    data: String,
}

fn ours(capture: &PathBuf) -> Vec<Datagram> {
    let output = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .arg("decode")
        .arg(capture)
        .arg("--json")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["problems"], serde_json::json!([]));
    let datagrams = document["datagrams"].as_array().unwrap();
    let number = |value: &Value| value.as_u64();
    datagrams
        .iter()
        .map(|datagram| Datagram {
            frame: number(&datagram["frame"]).unwrap(),
            command: number(&datagram["command_code"]).unwrap() as u8,
            index: number(&datagram["index"]).unwrap() as u8,
            address: (
                number(&datagram["adp"]).map(|value| value as u16),
                number(&datagram["ado"]).map(|value| value as u16),
                number(&datagram["logical"]).map(|value| value as u32),
            ),
            length: number(&datagram["length"]).unwrap() as usize,
            event: number(&datagram["event"]).unwrap() as u16,
            working_counter: number(&datagram["working_counter"]).unwrap() as u16,
            data: datagram["data"].as_str().unwrap().to_owned(),
        })
        .collect()
}

/// Frame bytes by number, from tshark's hexadecimal dump.
fn frame_bytes(capture: &PathBuf) -> HashMap<u64, String> {
    let output = Command::new("tshark")
        .arg("-r")
        .arg(capture)
        .args(["-T", "json", "-x", "-j", "frame"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let packets: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packets = packets.as_array().unwrap();
    (1..)
        .zip(
            packets
                .iter()
                .map(|packet| packet["_source"]["layers"]["frame_raw"][0].as_str().unwrap().to_owned()),
        )
        .collect()
}

/// The value of an attribute in a line of PDML.
fn attribute<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let start = line.find(&format!(" {name}=\""))? + name.len() + 3;
    line[start..].split('"').next()
}

/// The datagrams as tshark's details (PDML) show them; data by the places that it gives for the fields around.
fn theirs(capture: &PathBuf) -> Vec<Datagram> {
    let bytes = frame_bytes(capture);
    let output = Command::new("tshark").arg("-r").arg(capture).args(["-T", "pdml"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout);
    let (mut datagrams, mut datagram, mut frame, mut data_start) = (Vec::new(), Datagram::default(), 0, 0);
    for line in text.lines() {
        let Some(name) = attribute(line, "name") else { continue };
        let shown = || {
            let shown = attribute(line, "show").unwrap();
            match shown.strip_prefix("0x") {
                Some(digits) => u64::from_str_radix(digits, 16).unwrap(),
                None => shown.parse().unwrap(),
            }
        };
        let position = || attribute(line, "pos").unwrap().parse::<usize>().unwrap();
        match name {
            "num" => frame = shown(),
            "ecat.cmd" => datagram.command = shown() as u8,
            "ecat.idx" => datagram.index = shown() as u8,
            "ecat.adp" => datagram.address.0 = Some(shown() as u16),
            "ecat.ado" => datagram.address.1 = Some(shown() as u16),
            "ecat.lad" => datagram.address.2 = Some(shown() as u32),
            "ecat.subframe.length" => datagram.length = shown() as usize,
            "ecat.int" => {
                datagram.event = shown() as u16;
                data_start = position() + 2;
            }
            "ecat.cnt" => {
                datagram.frame = frame;
                datagram.working_counter = shown() as u16;
                datagram.data = bytes[&frame][2 * data_start..2 * position()].to_owned();
                datagrams.push(std::mem::take(&mut datagram));
            }
            _ => {}
        }
    }
    datagrams
}

fn compare(name: &str, expected: usize) {
    let capture = PathBuf::from(format!("{CAPTURES}/{name}"));
    if !capture.exists() {
        eprintln!("SKIPPED: {} is not there", capture.display());
        return;
    }
    if Command::new("tshark").arg("--version").output().is_err() {
        return omnibase_host::skipped("tshark is not installed");
    }
    let (ours, theirs) = (ours(&capture), theirs(&capture));
    assert_eq!(theirs.len(), expected, "datagrams that tshark sees");
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert_eq!(ours, theirs);
    }
    assert_eq!(ours.len(), theirs.len());
}

#[test]
fn every_datagram_of_a_start_up_with_clocks() {
    compare("replay-dc.pcapng", 5676);
}

#[test]
fn every_datagram_of_a_start_up_with_coe() {
    compare("replay-ek1914-no-complete-access.pcapng", 2214);
}
