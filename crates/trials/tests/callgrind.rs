//! What a cycle costs in instructions, counted by callgrind: counts repeat, whatever else the machine does.
//!
//! A test starts itself under valgrind. Tests are less optimised than a release, so their counts are higher.

use std::process::Command;

use crate::skipped::skipped;

/// How many cycles are run, where the test runs under valgrind.
const COUNTED: &str = "OMNIBASE_COUNTED";

/// The test `test` runs `run` with two numbers of cycles under callgrind: a cycle of what they differ by, in `functions` alone
/// (none: everything), may cost `most` instructions.
pub fn a_cycle_costs_at_most(most: u64, test: &str, functions: &[&str], cycles: [u64; 2], run: impl Fn(u64)) {
    if let Some(cycles) = std::env::var_os(COUNTED) {
        return run(cycles.to_str().and_then(|cycles| cycles.parse().ok()).expect("a number of cycles"));
    }
    let [Some(before), Some(after)] = cycles.map(|cycles| counted(test, functions, cycles)) else {
        return skipped("instructions aren't counted without valgrind");
    };
    let each = (after - before) / (cycles[1] - cycles[0]);
    println!("{each} instructions a cycle");
    assert!(each > 1000, "{each} instructions a cycle are too few to be true");
    assert!(each <= most, "{each} instructions a cycle, at most {most}");
}

/// Instructions of so many cycles; `None` without valgrind.
fn counted(test: &str, functions: &[&str], cycles: u64) -> Option<u64> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    valgrind.args(functions.iter().map(|function| format!("--toggle-collect={function}")));
    valgrind.arg(std::env::current_exe().expect("this test"));
    valgrind.args(["--exact", test, "--test-threads=1"]).env(COUNTED, cycles.to_string());
    let output = valgrind.output().ok()?;
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let count = told.lines().find_map(|line| line.split("Collected : ").nth(1)).expect("a count");
    Some(count.trim().parse().expect("a number"))
}
