//! A recorded run as Rerun has it, by the script that is shipped.

use std::process::Command;

use super::{prints, python};
use crate::command_line::{Folder, root, words};

#[test]
fn rerun_reads_a_run_with_its_scene_drawn_by_the_script_that_is_shipped() {
    let Some(python) = python() else { return };
    let folder = Folder::new("viewers-rerun");
    let [run, view, opened] = ["run.mcap", "view.mcap", "view.rrd"].map(|name| folder.path(name));
    let fence = "fence.rectangle_m=[-3.0, -3.0, 3.0, 3.0]";
    let obstacle = "obstacle=[{ centre_m = [1.5, 1.5], radius_m = 0.2 }]";
    let of = ["robots/bmm.toml", "--set", fence, "--set", obstacle];
    prints(&[&["run"], &of[..], &["--circle", "radius_m=0.2,duration_s=5", "--record", &run]].concat());
    prints(&["export", &run, "--every", "10ms", "--output", &view]);
    let script = root().join("viewers/open_in_rerun.py");
    let output = Command::new(&python).arg(script).args([&view, "--save", &opened]).output().unwrap();
    assert!(output.status.success(), "{}", words(&output.stderr));
    let rerun = |what: &str| {
        let rerun = python.with_file_name("rerun");
        let output = Command::new(rerun).args(["rrd", what, &opened]).output().unwrap();
        assert!(output.status.success(), "{what}: {}", words(&output.stderr));
        words(&output.stdout)
    };
    rerun("verify");
    let told = rerun("print");
    for entity in [
        "/tf",
        "/log",
        "/scene_drawn/footprint",
        "/scene_drawn/wheel_2/solid",
        "/scene_drawn/fence",
        "/scene_drawn/obstacle_1/solid",
        "/scene_drawn/path",
        "/plots/error/believed_m",
        "/plots/wheels/wheel_3/speed_rad_s",
    ] {
        assert!(told.contains(entity), "{entity} is missing:\n{told}");
    }
}
