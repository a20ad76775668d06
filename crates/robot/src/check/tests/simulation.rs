//! The simulated body's table.

use super::*;

/// The problems of the shipped BMM with more lines under `[simulation]`, as they are shown.
fn shown(lines: &str) -> String {
    show(&problems(&format!("{BMM}\n{lines}\n")))
}

#[test]
fn damping_of_a_rigid_tread_is_refused() {
    let told = shown("tread_damping_ratio = 0.3");
    assert!(told.contains("simulation.tread_stiffness_n_m: must be given: tread_damping_ratio"), "{told}");
    assert!(check(&format!("{BMM}\ntread_stiffness_n_m = 2e5\ntread_damping_ratio = 0.3\n")).is_ok());
    let told = shown("tread_stiffness_n_m = 1.0");
    assert!(told.contains("simulation.tread_stiffness_n_m = 1.0") && told.contains("allowed"), "{told}");
}
