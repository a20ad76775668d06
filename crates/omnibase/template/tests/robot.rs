//! The robot of `robot.toml` with the stages of this crate, simulated.

#[test]
fn the_circle_is_driven_to_its_end() {
    let ran = omnibase::simulate("robot.toml".as_ref(), CRATE::register).expect("a sound robot");
    assert!(ran.finished, "{:?}", ran.ended);
    let end_m = ran.summary.final_error_m.truth.expect("the simulator knows");
    assert!(end_m < 0.005, "{end_m} m beside the end of the circle");
}
