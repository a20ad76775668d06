//! The table `[subdevice.servo]`.

use super::Kind;
use super::reader::{Document, TableReader};
use crate::device::axis::Load;
use crate::device::drive::{Drive, DriveKind};
use crate::device::servo::ServoConfig;
use crate::dictionary::standard::PdoMap;
use omnibase_ethercat_wire::coe::ObjectAddress;

/// Reads the servo's parameters; what isn't given is as from the factory.
pub(super) fn read(kind: DriveKind, entry: &mut TableReader, document: &mut Document) -> Kind {
    let mut drive = Drive::new(kind);
    let mut load = Load::default();
    let Some(mut table) = entry.table("servo", document) else {
        return Kind::Drive(Box::new(drive), load);
    };
    motor(&mut table, document, &mut drive.servo, &mut load);
    if let Some(transition_us) = table.integer("transition_us", 0..=60_000_000, document) {
        drive.times.step_ns = transition_us as u64 * 1000;
    }
    let span = table.span();
    for (key, map) in [("rx_pdo", &mut drive.rx_pdo), ("tx_pdo", &mut drive.tx_pdo)] {
        read_pdo(key, &mut table, document, map);
    }
    table.finish(document);
    if let Err(text) = drive.check() {
        document.problem(span, text);
    }
    Kind::Drive(Box::new(drive), load)
}

/// Motor and load of a drive of a maker's file, where the table is there: timing and PDOs are the file's.
pub(super) fn read_servo(entry: &mut TableReader, document: &mut Document) -> Option<(ServoConfig, Load)> {
    let mut table = entry.table("servo", document)?;
    let (mut servo, mut load) = <(ServoConfig, Load)>::default();
    motor(&mut table, document, &mut servo, &mut load);
    table.finish(document);
    Some((servo, load))
}

fn motor(table: &mut TableReader, document: &mut Document, servo: &mut ServoConfig, load: &mut Load) {
    let positive = 1e-9..=1e6;
    let mut set = |key, value: &mut f64, limits| {
        if let Some(number) = table.number(key, limits, document) {
            *value = number;
        }
    };
    set("rated_torque_n_m", &mut servo.rated_torque_n_m, positive.clone());
    set("peak_torque_n_m", &mut servo.peak_torque_n_m, positive.clone());
    set("max_speed_rad_s", &mut servo.max_speed_rad_s, positive.clone());
    set("position_gain_per_s", &mut servo.position_gain_per_s, 0.0..=1e4);
    set("speed_bandwidth_rad_s", &mut servo.speed_bandwidth_rad_s, 0.0..=2e3);
    set("torque_time_constant_s", &mut servo.torque_time_constant_s, 0.0..=1.0);
    set("inertia_kg_m2", &mut load.inertia_kg_m2, positive);
    set("viscous_n_m_s", &mut load.viscous_n_m_s, 0.0..=1e6);
    set("coulomb_n_m", &mut load.coulomb_n_m, 0.0..=1e6);
    if let Some(counts) = table.integer("counts_per_revolution", 16..=1 << 30, document) {
        servo.counts_per_revolution = counts as u32;
    }
    let whole = i64::from(i32::MIN)..=i64::from(i32::MAX);
    if let Some(position) = table.integer("initial_position", whole, document) {
        servo.initial_position = position as i32;
    }
}

/// A list as `["6041:16", "60C1.1:32", "pad:8"]`: hexadecimal index, decimal subindex, bits.
fn read_pdo(key: &'static str, table: &mut TableReader, document: &mut Document, map: &mut PdoMap) {
    let Some(texts) = table.texts(key, document) else { return };
    map.entries.clear();
    for (text, span) in texts {
        match mapped(&text) {
            Some(entry) => map.entries.push(entry),
            None => {
                let example = "\"6041:16\", \"60C1.1:32\" or \"pad:8\"";
                document.problem(span, format!("a mapped object is written as {example}, found \"{text}\""));
            }
        }
    }
}

fn mapped(text: &str) -> Option<(ObjectAddress, u8)> {
    let (object, bits) = text.split_once(':')?;
    let bits = bits.parse().ok().filter(|bits| *bits > 0)?;
    if object == "pad" {
        return Some((ObjectAddress::new(0, 0), bits));
    }
    let (index, subindex) = object.split_once('.').unwrap_or((object, "0"));
    Some((ObjectAddress::new(u16::from_str_radix(index, 16).ok()?, subindex.parse().ok()?), bits))
}
