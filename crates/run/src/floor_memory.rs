//! What a run found of its floor, kept for the next one in the file that the robot's file names.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use omnibase_robot::signals::GripReport;

/// Writes what is known of the floor's friction at the end of a run; nothing where nothing is. The file is whole at every
/// instant: it is written beside its place, and renamed.
pub fn keep(path: &Path, grip: &GripReport) -> io::Result<()> {
    let (Some(friction), Some(friction_sigma)) = (grip.friction, grip.friction_sigma) else { return Ok(()) };
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let mut file = File::create(&beside)?;
    writeln!(
        file,
        "# What omnibase found of this robot's floor: force at a sliding wheel over its load, with its deviation."
    )?;
    writeln!(
        file,
        "friction = {:?}\nfriction_sigma = {:?}",
        friction.clamp(0.01, 2.0),
        friction_sigma.clamp(1e-3, 2.0)
    )?;
    file.sync_all()?;
    std::fs::rename(&beside, path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot_text::RobotText;
    use omnibase_robot::Registry;

    const BMM: &str = include_str!("../../../robots/bmm.toml");

    #[test]
    fn what_a_run_found_is_what_the_next_one_begins_with_but_less_surely() {
        let folder = std::env::temp_dir().join(format!("omnibase_floor_{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let text = RobotText {
            text: format!("{BMM}\n[grip]\nmemory = \"floor.toml\"\n"),
            folder: folder.clone(),
            ..Default::default()
        };
        let load = || text.load(&Registry::with_built_in());
        // The first run finds no file, and one that found nothing writes none.
        assert_eq!(load().unwrap().plan.grip.remembered, None);
        let path = folder.join("floor.toml");
        keep(&path, &GripReport::default()).unwrap();
        assert!(!path.exists());
        let found = GripReport { friction: Some(0.12), friction_sigma: Some(0.01), ..Default::default() };
        keep(&path, &found).unwrap();
        let robot = load().unwrap();
        let remembered = robot.plan.grip.remembered.unwrap();
        assert_eq!(remembered.friction, 0.12);
        assert!((remembered.friction_sigma - 0.01_f64.hypot(0.024)).abs() < 1e-12, "{remembered:?}");
        // The recording holds it, for it is computed again with the same.
        let again =
            crate::robot_text::from_description(&robot.description, &Registry::with_built_in()).unwrap();
        assert_eq!(again.grip.remembered, Some(remembered));
        for (wrong, words) in [
            (
                "friction = -0.1\nfriction_sigma = 0.1\n",
                "`friction` is -0.1: expected more than 0, at most 2",
            ),
            ("friction = 0.1\n", "line 1: missing field `friction_sigma`"),
            ("friction = 0.1\nfriction_sigma = nan\n", "`friction_sigma` is NaN"),
            ("{", "expected `friction` and `friction_sigma`"),
        ] {
            std::fs::write(&path, wrong).unwrap();
            let problems = load().unwrap_err();
            let told = problems[0].to_string();
            assert!(told.contains("grip.memory = \"floor.toml\"") && told.contains(words), "{told}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
