//! A test that can't run says so, and fails where what it needs is required.

use omnibase_host::skipped;
use std::process::Command;

const LACKS: &str = "OMNIBASE_LACKS";

#[test]
fn a_test_that_lacks_something_fails_where_that_is_required() {
    if std::env::var_os(LACKS).is_some() {
        return skipped("nobody to compare with");
    }
    let run = |witnesses: Option<&str>| {
        let mut test = Command::new(std::env::current_exe().unwrap());
        test.args(["--exact", "a_test_that_lacks_something_fails_where_that_is_required", "--nocapture"]);
        test.env(LACKS, "1").env_remove("OMNIBASE_WITNESSES");
        let output = test.envs(witnesses.map(|how| ("OMNIBASE_WITNESSES", how))).output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    let (passes, said) = run(None);
    assert!(passes && said.contains("SKIPPED: nobody to compare with"), "{said}");
    let (passes, said) = run(Some("required"));
    assert!(!passes && said.contains("a test can't run: nobody to compare with"), "{said}");
}
