//! The examples that library users copy do what they say.

#[path = "../examples/cycle_three_servos.rs"]
mod cycle_three_servos;
#[path = "../examples/scan.rs"]
mod scan;
#[path = "../examples/sdo.rs"]
mod sdo;

#[test]
fn scan_finds_the_tree() {
    scan::main().unwrap();
}

#[test]
fn sdo_reads_what_it_wrote() {
    sdo::main().unwrap();
}

#[test]
fn three_servos_cycle_in_op() {
    cycle_three_servos::main().unwrap();
}
