//! SOEM, driven by Python scripts through `pysoem`.

use crate::makers::MakersCommand;
use std::path::Path;
use std::process::{Command, Output};

fn run(command: &mut Command) -> Result<Output, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() {
        return Ok(output);
    }
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

/// Lets SOEM drive the `count` drives behind `interface`; the script's JSON report, or what failed.
pub fn drive(python: &Path, interface: &str, count: usize) -> Result<String, String> {
    report(python, "soem.py", &[interface, &count.to_string()])
}

/// Lets SOEM bring `count` SubDevices behind `interface` to OP, among them terminals with inputs and outputs, and drives,
/// by their positions; the script's JSON report, or what failed.
pub fn bring_up_terminals(
    python: &Path,
    interface: &str,
    count: usize,
    [inputs, outputs]: [usize; 2],
    drives: &[usize],
) -> Result<String, String> {
    let positions = [count, inputs, outputs].into_iter().chain(drives.iter().copied());
    let positions: Vec<String> = positions.map(|position| position.to_string()).collect();
    let arguments: Vec<&str> =
        std::iter::once(interface).chain(positions.iter().map(String::as_str)).collect();
    report(python, "soem_terminals.py", &arguments)
}

/// Lets SOEM bring the SubDevices behind `interface` to OP with their makers' commands, each read back; the script's JSON
/// report, or what failed.
pub fn bring_up_with(python: &Path, interface: &str, commands: &[MakersCommand]) -> Result<String, String> {
    let one = |one: &MakersCommand| {
        format!("[{}, {}, {}, \"{}\"]", one.position, one.index, one.subindex, in_hex(&one.data))
    };
    let commands: Vec<String> = commands.iter().map(one).collect();
    report(python, "soem_esi.py", &[interface, &format!("[{}]", commands.join(", "))])
}

/// Lets SOEM write this alias into the EEPROM of the first SubDevice behind `interface`, and `firmware` into its flash where there is
/// any, and read both back; the script's JSON report, or what failed.
pub fn write_into(python: &Path, interface: &str, alias: u16, firmware: &[u8]) -> Result<String, String> {
    report(python, "soem_field.py", &[interface, &alias.to_string(), &in_hex(firmware)])
}

fn in_hex(data: &[u8]) -> String {
    data.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn report(python: &Path, script: &str, arguments: &[&str]) -> Result<String, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python").join(script);
    let output = run(Command::new(python).arg(script).args(arguments))?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
