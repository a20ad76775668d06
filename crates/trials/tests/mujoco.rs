//! The robot's cycle drives a plant that isn't ours: MuJoCo's, on wheels with true rollers.

use std::path::Path;

use omnibase_trials::mujoco::{self, MujocoPlant};
use omnibase_trials::robots::BMM;
use omnibase_trials::slip::{Case, Slid};

use crate::skipped::skipped;

/// A short circle; `None` where there is no MuJoCo.
fn ride(law: &'static str, friction: f64, faster: f64) -> Option<Slid> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-mujoco");
    let lacking = |why: &String| skipped(format_args!("no Python with MuJoCo: {why}"));
    let python = mujoco::python(&folder).inspect_err(lacking).ok()?;
    let case = Case { friction, faster, ..Case::plain(BMM, law, "circle") };
    let text = case
        .text()
        .replace("radius_m = 0.5\n", "radius_m = 0.15\n")
        .replace("duration_s = 10.0", "duration_s = 4.0");
    let slid = Slid::of_text_on(&text, |machine| {
        Box::new(MujocoPlant::start(&python, machine).expect("MuJoCo's process"))
    });
    println!("{}", case.row(&slid));
    Some(slid)
}

#[test]
fn each_law_follows_a_circle_on_the_other_plant() {
    for (law, believed_m) in [("closed_loop_speed", 0.1e-3), ("adaptive_torque", 2e-3)] {
        let Some(slid) = ride(law, 0.5, 1.0) else { return };
        assert!(slid.run.finished && slid.told.is_none(), "{law}: {slid:?}");
        assert!(slid.run.believed_rms_m < believed_m && slid.run.true_final_m < 2e-3, "{law}: {slid:?}");
        // It was the other plant: it has no creep, so that the truth is nearer than on ours.
        assert!(slid.run.true_rms_m < 2e-3 && slid.torque_nm > 0.5, "{law}: {slid:?}");
    }
}
