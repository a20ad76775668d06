//! Any text as a robot's file, or as the robot a recording was made of: the plan or problems, each at its place.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_robot::{Registry, Robot, RobotPlan};

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let registry = Registry::with_built_in();
    match RobotPlan::from_toml(text, &registry, &|_| Err("no file".into())) {
        // What was found right can be built; a stage may still refuse it, in words.
        Ok(plan) => {
            if let Err(error) = Robot::build(&plan, &registry) {
                assert!(!error.to_string().is_empty());
            }
        }
        Err(problems) => {
            assert!(!problems.is_empty());
            for place in problems.iter().filter_map(|problem| problem.place.as_ref()) {
                assert!(place.file.is_some() || text.get(place.span.clone()).is_some(), "{place:?}");
            }
        }
    }
});
