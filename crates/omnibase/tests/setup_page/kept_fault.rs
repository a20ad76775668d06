//! A drive that kept a fault, at the page.

use super::{
    LOOKS, ROOT, answer, browser, go_on_with_servos, hold, motions, open, seen, set_up, simulated, unknown,
    until,
};
use crate::dashboard::browser::LONGEST;
use omnibase_host::Namespace;
use std::path::Path;

/// A drive that kept a fault: the page says so beside its button, which goes on being held, and the drive turns then.
#[test]
fn a_drive_that_kept_a_fault_is_acknowledged_by_the_held_button() {
    let name = "a_drive_that_kept_a_fault_is_acknowledged_by_the_held_button";
    let Some(namespace) = Namespace::for_test(name) else { return };
    namespace.run(|| {
        let Some(mut page) = browser(1000, 800) else { return };
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("mine.toml");
        let base = folder.path().join("base.toml");
        std::fs::write(&base, unknown::BASE.replace("cycle_us = 1000", "cycle_us = 4000")).unwrap();
        let segment = format!("{ROOT}/segments/three-servos.toml");
        let _simulator = simulated(Path::new(&segment), &["--fault", "drive-fault@0:0:0x7300"]);
        let (_process, at) = set_up(&base, Namespace::NEAR, &output, &["--realtime"]);
        open(&mut page, &at);
        go_on_with_servos(&mut page);
        let told = "document.body.textContent.includes('whoever holds the button acknowledges that')";
        let turned = (0..LOOKS).any(|_| {
            let now = until(&mut page, "something is asked", |seen| {
                ["asked", "hold", "over"].iter().any(|key| !seen[*key].is_null())
            });
            assert!(now["over"].is_null(), "{now}");
            if now["hold"].is_null() {
                // A machine that pauses ended it.
                answer(&mut page, "again");
                return false;
            }
            assert!(page.is_true_within(told, LONGEST), "{}", seen(&mut page));
            assert_eq!(seen(&mut page)["hold"], now["hold"], "the button stays");
            hold(&mut page, |seen| {
                seen["enabled"] == true && seen["travel"].as_f64().is_some_and(|went| went.abs() > 0.0)
            })
            .is_some_and(|went| went.abs() > 0.0)
        });
        assert!(turned, "{:#?}", motions(&output));
        assert!(page.value(told) == true);
        assert!(motions(&output).iter().all(|(_, _, unheld)| *unheld == 0), "{:#?}", motions(&output));
    });
}
