//! Files and devices as JSON.

use super::Files;
use omnibase_esi::model::Pdo;
use omnibase_esi::{Assembly, CommandSource, Device, EsiFile, Module, Why};
use serde_json::{Value, json};

/// Every file: its devices, modules, what isn't read and what is wrong.
pub fn files(files: &Files) -> Value {
    json!({ "files": files.all().map(file).collect::<Vec<_>>(), "modules": files.modules().count() })
}

fn file(file: &EsiFile) -> Value {
    let mut value = json!({
        "vendor": { "id": file.vendor.id, "name": file.vendor.name.english() },
        "references": file.references,
        "devices": file.devices.iter().map(device).collect::<Vec<_>>(),
        "modules": file.modules.iter().map(module).collect::<Vec<_>>(),
    });
    extend(&mut value, notes(file));
    value
}

/// What isn't read of a file and what is wrong in it.
fn notes(file: &EsiFile) -> Value {
    let unread = file.notes.unread().map(|one| {
        let why = if one.why == Why::Unknown { "unknown" } else { "unused" };
        json!({ "path": one.path, "line": one.line, "count": one.count, "why": why })
    });
    let problems = file.notes.problems.iter();
    let problems = problems.map(|one| json!({ "path": one.path, "line": one.line, "text": one.text }));
    json!({
        "unread": unread.collect::<Vec<_>>(),
        "problems": problems.collect::<Vec<_>>(),
        "beyond": file.notes.beyond,
    })
}

fn extend(value: &mut Value, more: Value) {
    if let (Value::Object(value), Value::Object(more)) = (value, more) {
        value.extend(more);
    }
}

fn device(device: &Device) -> Value {
    json!({
        "type": device.type_name,
        "name": device.names.english(),
        "product_code": device.product_code,
        "revision": device.revision,
        "line": device.line,
        "profiles": device.profiles,
    })
}

fn module(module: &Module) -> Value {
    json!({
        "type": module.type_name,
        "name": module.names.english(),
        "ident": module.ident,
        "class": module.class,
        "line": module.line,
    })
}

/// A device with its modules, and the notes of every file.
pub fn one(files: &Files, of: &Assembly) -> Value {
    let mut value = assembly(of);
    extend(&mut value, json!({ "files": files.all().map(notes).collect::<Vec<_>>() }));
    value
}

fn assembly(assembly: &Assembly) -> Value {
    let mut value = device(assembly.device);
    let commands = assembly.commands().into_iter().map(|one| {
        let source = match one.source {
            CommandSource::Device => json!("device"),
            CommandSource::ModuleList => json!("module list"),
            CommandSource::Module { slot } => json!({ "slot": slot }),
        };
        json!({
            "transitions": one.command.transitions,
            "index": one.command.index.index,
            "subindex": one.command.subindex,
            "data": one.command.data,
            "comment": one.command.comment,
            "source": source,
            "complete_access": one.command.complete_access,
            "sent_in_pre_op": one.is_for_pre_op(),
            "sent_in_safe_op": one.is_for_safe_op(),
            "is_parameter": one.is_parameter(),
        })
    });
    let more = json!({
        "modules": assembly.modules.iter().map(|one| module(one)).collect::<Vec<_>>(),
        "outputs": pdos(assembly, true),
        "inputs": pdos(assembly, false),
        "commands": commands.collect::<Vec<_>>(),
        "doubts": assembly.doubts().iter().map(ToString::to_string).collect::<Vec<_>>(),
        "sync_managers": assembly.device.sync_managers.iter().map(|one| json!({
            "start": one.start, "default_size": one.default_size, "control": one.control,
            "enabled": one.enabled, "virtual": one.is_virtual, "op_only": one.op_only,
        })).collect::<Vec<_>>(),
        "dc_modes": assembly.device.dc_modes.iter().map(|one| json!({
            "name": one.name, "description": one.description.english(), "assign_activate": one.assign_activate, "unclear": one.is_unclear,
            "sync0": { "cycle_ns": one.sync0.cycle_ns, "factor": one.sync0.factor, "shift_ns": one.sync0.shift_ns },
            "sync1": { "cycle_ns": one.sync1.cycle_ns, "factor": one.sync1.factor, "shift_ns": one.sync1.shift_ns },
        })).collect::<Vec<_>>(),
    });
    extend(&mut value, more);
    value
}

fn pdos(assembly: &Assembly, outputs: bool) -> Vec<Value> {
    let (chosen, _) = assembly.default_pdos(outputs);
    let one = |pdo: &Pdo| {
        let assigned = chosen.iter().find(|one| one.index == pdo.index).and_then(|one| one.sync_manager);
        let entries = pdo.entries.iter().map(|entry| {
            json!({
                "index": entry.index.index, "subindex": entry.subindex, "bits": entry.bits,
                "name": entry.name.english(), "type": entry.data_type, "unclear": entry.is_unclear,
            })
        });
        json!({
            "index": pdo.index.index, "name": pdo.name.english(), "assigned_to": assigned, "mandatory": pdo.mandatory,
            "fixed": pdo.fixed, "excludes": pdo.excludes.iter().map(|one| one.index).collect::<Vec<_>>(),
            "entries": entries.collect::<Vec<_>>(),
        })
    };
    assembly.pdos(outputs).iter().map(one).collect()
}
