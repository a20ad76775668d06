//! The robot's cycle on MuJoCo's mechanics beside the simulator's own: believed, true, torque, slip.
//!
//! `cargo run --release -p omnibase-trials --example mujoco [friction] [laws]`: the table of `docs/control.md`, or the rows of one
//! friction. A Python with MuJoCo is made under `target/mujoco`.

use std::path::Path;

use omnibase_trials::laws::{CLOSED, asked};
use omnibase_trials::mujoco::{self, MujocoPlant};
use omnibase_trials::robots::BMM;
use omnibase_trials::slip::{Case, Slid};

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/mujoco");
    let python = mujoco::python(&folder).expect("a Python with MuJoCo");
    let (laws, words) = asked(&CLOSED);
    let only: Option<f64> = words.first().map(|text| text.parse().expect("a number"));
    println!(
        "| law | path | speed | friction | payload kg | plant | believed RMS mm | true RMS mm | true final mm | greatest torque N·m | longest slip mm | slip told at s | end |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for law in laws {
        for (path, faster) in [("circle", 1.0), ("circle", 2.0), ("square", 1.0), ("square", 2.0)] {
            for friction in
                [0.15, 0.5, 0.7].into_iter().filter(|friction| only.is_none_or(|only| only == *friction))
            {
                for payload_kg in [0.0, 100.0] {
                    let case = Case { faster, friction, payload_kg, ..Case::plain(BMM, law, path) };
                    print(&case, "ours", &case.ride());
                    let slid = case.ride_on(|machine| {
                        Box::new(MujocoPlant::start(&python, machine).expect("MuJoCo's process"))
                    });
                    print(&case, "MuJoCo", &slid);
                }
            }
        }
    }
}

fn print(case: &Case, plant: &str, slid: &Slid) {
    let told = slid.told.map_or("-".to_owned(), |(cycles, _)| format!("{:.3}", cycles as f64 * 1e-3));
    println!(
        "| {} | {} | {:.0} | {:.2} | {:.0} | {plant} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} | {told} | {} |",
        case.law,
        case.path,
        case.faster,
        case.friction,
        case.payload_kg,
        1e3 * slid.run.believed_rms_m,
        1e3 * slid.run.true_rms_m,
        1e3 * slid.run.true_final_m,
        slid.torque_nm,
        1e3 * slid.way_m,
        slid.end(),
    );
}
