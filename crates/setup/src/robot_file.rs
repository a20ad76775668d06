//! The robot's file that comes of a set-up: the one that was begun with, its drives as they were found.

use omnibase_robot::Registry;
use omnibase_robot::config::{Problem, RobotPlan};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value, value};

use crate::guide::is_product;
use crate::record::{FoundDevice, FoundDrive, Record, Turned};
use crate::turns::is_seen_as;

/// Keys of a drive that a set-up finds out; others stay as they were written.
const FOUND: [&str; 9] = [
    "position",
    "alias",
    "identification",
    "vendor_id",
    "product_code",
    "revision",
    "direction",
    "counts_per_revolution",
    "gear_ratio",
];

/// Why no file can be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RobotFileError {
    /// The file that was begun with isn't TOML.
    #[error("the file that was begun with: {0}")]
    Base(String),
    /// A wheel has no drive yet.
    #[error("no drive was seen to turn the wheel {0}: jog it first")]
    Wheel(String),
    /// It isn't a robot's file.
    #[error("{}", .0.join("\n"))]
    Problems(Vec<String>),
}

/// The text: `base` with the drives of `record`, checked.
pub fn write(base: &str, record: &Record, registry: &Registry) -> Result<String, RobotFileError> {
    let plan = plan(base, registry)?;
    let mut document: DocumentMut =
        base.parse().map_err(|error: toml_edit::TomlError| RobotFileError::Base(error.to_string()))?;
    let old = document.remove("drive");
    let mut tables = ArrayOfTables::new();
    for (number, wheel) in plan.drives.iter().enumerate() {
        let of_wheel = record.drives.iter().find(|drive| drive.wheel.as_deref() == Some(&wheel.name));
        let drive = of_wheel.ok_or_else(|| RobotFileError::Wheel(wheel.name.clone()))?;
        // What else is written of a drive goes with its product: that of the wheel's own, else of one that has it.
        let of_product = plan.drives.iter().position(|other| is_product(other, drive));
        let number = if is_product(wheel, drive) { number } else { of_product.unwrap_or(number) };
        let written = old.as_ref().and_then(Item::as_array_of_tables).and_then(|all| all.get(number));
        tables.push(table(&wheel.name, drive, written));
    }
    if let Some(defaults) = document.get_mut("drive_defaults").and_then(Item::as_table_like_mut) {
        FOUND.iter().for_each(|key| drop(defaults.remove(key)));
    }
    document.insert("drive", Item::ArrayOfTables(tables));
    leave_alone(&mut document, &plan, record);
    let text = document.to_string();
    // Nobody has its lines.
    checked(&text, registry, |problem| Problem { place: None, ..problem.clone() }.to_string())?;
    Ok(text)
}

/// Who is on the bus, turns no wheel and isn't named in the file, is named there: it would keep a robot from its start.
fn leave_alone(document: &mut DocumentMut, plan: &RobotPlan, record: &Record) {
    let idle = record.drives.iter().filter(|drive| drive.wheel.is_none());
    let idle = idle.map(|drive| (drive.position, drive.alias, drive.vendor_id, drive.product_code));
    let own_alias = |one: &FoundDevice| one.alias.filter(|_| !one.is_by_position);
    let others = record.others.iter().filter(|one| one.name.is_none());
    let others = others.map(|one| (one.position, own_alias(one), one.vendor_id, one.product_code));
    // Positions shift with hot-connect groups.
    let has_groups = plan.devices.iter().any(|one| one.group.is_some());
    let mut tables = ArrayOfTables::new();
    for (position, alias, vendor_id, product_code) in others.chain(idle) {
        let mut table = Table::new();
        let mut name = format!("subdevice_{position}");
        while plan.devices.iter().any(|one| one.name == name) {
            name.push('_');
        }
        table.insert("name", value(name));
        match alias.filter(|_| has_groups) {
            Some(alias) => table.insert("alias", value(i64::from(alias))),
            None => table.insert("position", value(i64::from(position))),
        };
        table.insert("kind", value(omnibase_robot::peripherals::IGNORE));
        table.insert("vendor_id", value(format!("0x{vendor_id:X}")));
        table.insert("product_code", value(format!("0x{product_code:X}")));
        tables.push(table);
    }
    if tables.is_empty() {
        return;
    }
    match document.get_mut("device") {
        Some(Item::ArrayOfTables(written)) => written.extend(tables),
        // `device = [{ … }]`
        Some(Item::Value(Value::Array(written))) => {
            written.extend(tables.into_iter().map(Table::into_inline_table))
        }
        _ => drop(document.insert("device", Item::ArrayOfTables(tables))),
    }
}

/// The plan of a file that needs no other one.
pub fn plan(text: &str, registry: &Registry) -> Result<RobotPlan, RobotFileError> {
    checked(text, registry, ToString::to_string)
}

fn checked(
    text: &str,
    registry: &Registry,
    words: impl Fn(&Problem) -> String,
) -> Result<RobotPlan, RobotFileError> {
    let none = |name: &str| Err(format!("`{name}`: a file for a set-up stands alone"));
    RobotPlan::from_toml(text, registry, &none)
        .map_err(|problems| RobotFileError::Problems(problems.iter().map(words).collect()))
}

fn table(name: &str, drive: &FoundDrive, written: Option<&Table>) -> Table {
    let mut table = Table::new();
    let mut put = |key: &str, item: Item, reason: &str| {
        table.insert(key, item);
        if let Some(found) = table.get_mut(key).and_then(Item::as_value_mut) {
            found.decor_mut().set_suffix(format!("  # {reason}"));
        }
    };
    let seen = match drive.is_stopped {
        Some(false) => "seen to turn; the emergency stop was NOT seen to take its torque: don't drive it",
        _ => "seen to turn",
    };
    put("name", value(name), seen);
    match (
        drive.identification,
        drive.alias.filter(|_| !drive.is_by_position && drive.written_alias.is_none()),
    ) {
        (Some(number), _) => put("identification", value(i64::from(number)), "shown by its switch"),
        (None, Some(alias)) => put("alias", value(i64::from(alias)), "wherever it is plugged in"),
        (None, None) => {
            put("position", value(i64::from(drive.position)), &format!("serial {}", drive.serial))
        }
    }
    put("vendor_id", value(format!("0x{:X}", drive.vendor_id)), "read");
    put("product_code", value(format!("0x{:X}", drive.product_code)), "read");
    if let Some(turned) = drive.turned {
        let direction = if turned == Turned::Forward { "forward" } else { "backward" };
        put("direction", value(direction), "seen: which way it turns when counts rise");
    }
    if let Some(counts) = drive.counts_per_revolution {
        let of_wheel = f64::from(counts) * drive.gear_ratio.unwrap_or(1.0);
        let off =
            drive.seen_counts.filter(|seen| !is_seen_as(of_wheel, *seen)).map(|seen| of_wheel / seen - 1.0);
        let why = off.map_or("of the motor, confirmed by turns that were seen".to_owned(), |off| {
            format!("of the motor, as was said: {:+.0} % beside the turns that were seen", 100.0 * off)
        });
        put("counts_per_revolution", value(i64::from(counts)), &why);
    }
    if let Some(gear) = drive.gear_ratio {
        put("gear_ratio", value(gear), "turns of the motor per turn of the wheel");
    }
    let others = written.into_iter().flat_map(Table::iter);
    for (key, item) in others.filter(|(key, _)| *key != "name" && !FOUND.contains(key)) {
        table.insert(key, item.clone());
    }
    table
}

#[cfg(test)]
mod tests {
    use omnibase_robot::config::BusPlace;

    use super::*;

    const BASE: &str = include_str!("../../../robots/bmm.toml");

    /// Drives of two products that are wired the other way round than the file has them, one drive too many and a coupler.
    #[test]
    fn what_is_written_of_a_drive_goes_with_its_product_and_who_turns_no_wheel_is_left_alone() {
        let mut document: DocumentMut = BASE.parse().unwrap();
        let tables = document["drive"].as_array_of_tables_mut().unwrap();
        for (table, (product, rated)) in tables.iter_mut().zip([(1, 7.0), (2, 2.0), (2, 2.0)]) {
            table["product_code"] = value(format!("0x{product}"));
            table["rated_torque_nm"] = value(rated);
            table["peak_torque_nm"] = value(21.0);
        }
        let base = document.to_string();
        let of_file = plan(&base, &Registry::with_built_in()).unwrap();
        let vendor_id = of_file.drives[0].identity.vendor_id.unwrap();
        let found = |position: u16, wheel: Option<&str>, product_code| FoundDrive {
            position,
            vendor_id,
            product_code,
            wheel: wheel.map(str::to_owned),
            counts_per_revolution: Some(1 << 20),
            gear_ratio: Some(1.0),
            ..FoundDrive::default()
        };
        let record = Record {
            drives: vec![
                found(1, Some("wheel_1"), 2),
                found(2, Some("wheel_2"), 1),
                found(3, Some("wheel_3"), 2),
                found(4, None, 2),
            ],
            others: vec![FoundDevice { vendor_id: 2, product_code: 0x044C_2C52, ..FoundDevice::default() }],
            ..Record::default()
        };
        let text = write(&base, &record, &Registry::with_built_in()).unwrap();
        let plan = plan(&text, &Registry::with_built_in()).unwrap();
        let rated: Vec<f64> = plan.drives.iter().map(|drive| drive.scale.rated_torque_nm).collect();
        assert_eq!(rated, [2.0, 7.0, 2.0], "{text}");
        let alone: Vec<_> = plan.devices.iter().map(|device| (device.kind.as_str(), device.place)).collect();
        let at = BusPlace::Position;
        assert_eq!(alone, [("ignore", at(0)), ("ignore", at(4))], "{text}");
        // Whom the file has named already isn't named again, however its tables are written.
        let named = FoundDevice { name: Some("io".to_owned()), position: 5, ..FoundDevice::default() };
        let record = Record { others: [record.others.clone(), vec![named]].concat(), ..record };
        let device = "name = \"subdevice_0\"\nposition = 5\nkind = \"ignore\"\n";
        let inline = format!("device = [{{ {} }}]\n{base}", device.trim().replace('\n', ", "));
        for base in [format!("{base}\n[[device]]\n{device}"), inline] {
            let text = write(&base, &record, &Registry::with_built_in()).unwrap();
            let plan = self::plan(&text, &Registry::with_built_in()).unwrap();
            let alone: Vec<_> =
                plan.devices.iter().map(|device| (device.name.as_str(), device.place)).collect();
            assert_eq!(
                alone,
                [("subdevice_0", at(5)), ("subdevice_0_", at(0)), ("subdevice_4", at(4))],
                "{text}"
            );
        }
        // Positions shift with a hot-connect group.
        let grouped =
            format!("{base}\n[[device]]\nname = \"arm\"\nalias = 77\nkind = \"ignore\"\ngroup = \"arm\"\n");
        for (is_by_position, place) in [(false, BusPlace::Alias(9)), (true, BusPlace::Position(0))] {
            let others =
                vec![FoundDevice { alias: Some(9), is_by_position, position: 0, ..FoundDevice::default() }];
            let drives = record.drives[..3].to_vec();
            let text =
                write(&grouped, &Record { drives, others, ..Record::default() }, &Registry::with_built_in());
            let plan = self::plan(&text.unwrap(), &Registry::with_built_in()).unwrap();
            assert_eq!(plan.devices[1].place, place);
        }
    }

    /// Five turns of the motor for one of the wheel.
    #[test]
    fn counts_that_were_not_seen_are_said_beside_what_was_seen() {
        for (seen_counts, reason) in [
            (4950.0, "of the motor, confirmed by turns that were seen"),
            (4000.0, "of the motor, as was said: +25 % beside the turns that were seen"),
        ] {
            let drive = FoundDrive {
                counts_per_revolution: Some(1000),
                gear_ratio: Some(5.0),
                seen_counts: Some(seen_counts),
                ..FoundDrive::default()
            };
            let text = table("wheel_1", &drive, None).to_string();
            assert!(text.contains(&format!("counts_per_revolution = 1000  # {reason}\n")), "{text}");
        }
    }
}
