//! The example that library users copy does what it says.

#[path = "../examples/segment_in_a_test.rs"]
mod segment_in_a_test;

#[test]
fn a_segment_answers_a_frame_written_by_hand() {
    segment_in_a_test::main();
}
