//! The robot's file that comes of a set-up: the one that was begun with, its drives as they were found.

use omnibase_robot::Registry;
use omnibase_robot::config::{Problem, RobotPlan};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, value};

use crate::record::{FoundDrive, Record, Turned};

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
        let written = old.as_ref().and_then(Item::as_array_of_tables).and_then(|all| all.get(number));
        tables.push(table(&wheel.name, drive, written));
    }
    if let Some(defaults) = document.get_mut("drive_defaults").and_then(Item::as_table_like_mut) {
        FOUND.iter().for_each(|key| drop(defaults.remove(key)));
    }
    document.insert("drive", Item::ArrayOfTables(tables));
    let text = document.to_string();
    self::plan(&text, registry)?;
    Ok(text)
}

/// The plan of a file that needs no other one.
pub fn plan(text: &str, registry: &Registry) -> Result<RobotPlan, RobotFileError> {
    let none = |name: &str| Err(format!("`{name}`: a file for a set-up stands alone"));
    let words = |problems: Vec<Problem>| problems.iter().map(ToString::to_string).collect();
    RobotPlan::from_toml(text, registry, &none).map_err(|problems| RobotFileError::Problems(words(problems)))
}

fn table(name: &str, drive: &FoundDrive, written: Option<&Table>) -> Table {
    let mut table = Table::new();
    let mut put = |key: &str, item: Item, reason: &str| {
        table.insert(key, item);
        if let Some(found) = table.get_mut(key).and_then(Item::as_value_mut) {
            found.decor_mut().set_suffix(format!("  # {reason}"));
        }
    };
    put("name", value(name), "seen to turn");
    match (drive.identification, drive.alias) {
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
        put(
            "counts_per_revolution",
            value(i64::from(counts)),
            "of the motor, confirmed by turns that were seen",
        );
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
